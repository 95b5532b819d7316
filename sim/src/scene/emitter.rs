//! What emits: a body, how its radiance goes with direction, and a level.

use core::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use radiometry::direction::{frame, normalised};

use super::contact::{polygon_area_m2, polygon_normal};
use super::law::{Batwing, Lobes};
use super::{EXPONENT_MAX, Image, Law, SceneError, Shape, Solid, Tabulated};

/// What has a surface that emits or is lit.
#[derive(Debug, Clone, PartialEq)]
pub enum Body {
    /// A part of the sample's plane; its upper side counts.
    Flat(Shape),
    /// Above the plane. Of a disk and a polygon the side counts from which a disk's axis points and
    /// a polygon's corners run counter-clockwise; the other is black. Of a ball all of it.
    Raised(Solid),
}

impl Body {
    /// Square metres of the side that counts.
    pub fn area_m2(&self) -> f64 {
        match self {
            Self::Flat(shape) => shape.area_m2(),
            Self::Raised(Solid::Disk(disk)) => PI * disk.radius_m() * disk.radius_m(),
            Self::Raised(Solid::Polygon(polygon)) => polygon_area_m2(polygon),
            Self::Raised(Solid::Sphere(ball)) => 4.0 * PI * ball.radius_m() * ball.radius_m(),
            Self::Raised(Solid::HalfPlane(_)) => f64::INFINITY,
        }
    }

    /// The outline on the sample's plane, of a body that lies in it.
    pub fn shape(&self) -> Option<&Shape> {
        match self {
            Self::Flat(shape) => Some(shape),
            Self::Raised(_) => None,
        }
    }

    /// As a body in space.
    pub(crate) fn solid(&self) -> Option<Solid> {
        match self {
            Self::Flat(shape) => Solid::of_shape(shape),
            Self::Raised(solid) => Some(solid.clone()),
        }
    }

    /// The unit normal of the side that counts, at a place on it.
    pub(crate) fn normal(&self, place: DVec3) -> DVec3 {
        match self {
            Self::Flat(_) | Self::Raised(Solid::HalfPlane(_)) => DVec3::Z,
            Self::Raised(Solid::Disk(disk)) => normalised(disk.axis()).unwrap_or(DVec3::Z),
            Self::Raised(Solid::Polygon(polygon)) => polygon_normal(polygon),
            Self::Raised(Solid::Sphere(ball)) => {
                normalised(place - ball.center_m()).unwrap_or(DVec3::Z)
            }
        }
    }

    /// Whether a part of each may lie before the side of the other that counts.
    pub(crate) fn faces(&self, other: &Self) -> bool {
        let sees = |from: &Self, to: &Self| match (from.solid(), to.solid()) {
            (Some(Solid::Sphere(_)), _) => true,
            (Some(from_solid), Some(to_solid)) => {
                let (at, _) = from_solid.plane();
                let normal = from.normal(at);
                let margin = 1e-9 * from_solid.extent_m().max(to_solid.extent_m());
                let top = match &to_solid {
                    Solid::Sphere(ball) => normal.dot(ball.center_m() - at) + ball.radius_m(),
                    flat => {
                        let outline = flat.points().into_iter();
                        outline.map(|p| normal.dot(p - at)).fold(f64::NEG_INFINITY, f64::max)
                    }
                };
                top > margin
            }
            _ => false,
        };
        sees(self, other) && sees(other, self)
    }

    pub(super) fn check(&self) -> Result<(), SceneError> {
        match self {
            Self::Flat(shape) if !shape.is_sound() => Err(SceneError::Shape(shape.clone())),
            Self::Flat(_) => Ok(()),
            Self::Raised(Solid::HalfPlane(_)) => {
                Err(SceneError::Unsupported("a half-plane that emits or is lit"))
            }
            Self::Raised(_) => {
                let area_m2 = self.area_m2();
                let is_sound = area_m2.is_finite() && area_m2 > 0.0;
                if is_sound { Ok(()) } else { Err(SceneError::NoArea(area_m2)) }
            }
        }
    }
}

/// Something that emits.
#[derive(Debug, Clone, PartialEq)]
pub struct Emitter {
    body: Body,
    law: Law,
    /// Radiance where the law and the image are one; one for a law that brings its own level.
    level: f64,
    /// How the level goes with the place, on a rectangle.
    image: Option<Image>,
}

impl Emitter {
    /// After a law; the level is its radiance where the law is 1.
    pub const fn new(body: Body, law: Law, level: f64) -> Self {
        Self { body, law, level, image: None }
    }

    /// The same radiance into every direction.
    pub const fn lambertian(shape: Shape, radiance: f64) -> Self {
        Self::new(Body::Flat(shape), Law::Lambertian, radiance)
    }

    /// As [`Emitter::lambertian`], its level as exitance: L = M / π.
    pub const fn lambertian_exitance(shape: Shape, exitance: f64) -> Self {
        Self::lambertian(shape, exitance / PI)
    }

    /// L(θ) = L₀ cosⁿ θ, n = 0 being Lambert's law.
    pub const fn cosine_power(shape: Shape, exponent: f64, radiance: f64) -> Self {
        Self::new(Body::Flat(shape), Law::CosinePower { exponent }, radiance)
    }

    /// As [`Emitter::cosine_power`], its level as exitance: L₀ = M (n + 2) / 2π.
    pub const fn cosine_power_exitance(shape: Shape, exponent: f64, exitance: f64) -> Self {
        Self::cosine_power(shape, exponent, exitance * (exponent + 2.0) / (2.0 * PI))
    }

    /// Brightest on a ring, there with the given radiance.
    pub const fn batwing(shape: Shape, batwing: Batwing, radiance: f64) -> Self {
        Self::new(Body::Flat(shape), Law::Batwing(batwing), radiance)
    }

    /// Lobes off the normal; the radiance is that of a weight of 1 along its lobe's axis.
    pub const fn lobes(shape: Shape, lobes: Lobes, radiance: f64) -> Self {
        Self::new(Body::Flat(shape), Law::Lobes(lobes), radiance)
    }

    /// A patch that emits after a table of intensities: L = I / (A cos θ), with A the area of
    /// `shape`.
    pub fn tabulated(shape: Shape, table: Tabulated) -> Self {
        let level = 1.0 / shape.area_m2();
        Self::new(Body::Flat(shape), Law::Tabulated(table), level)
    }

    /// An image on a rectangle, x and y from low to high: at each place the law times the level times
    /// the image's value.
    pub const fn image(
        x_m: (f64, f64),
        y_m: (f64, f64),
        image: Image,
        law: Law,
        level: f64,
    ) -> Self {
        let body = Body::Flat(Shape::Rectangle { x_m, y_m });
        Self { body, law, level, image: Some(image) }
    }

    /// Where it is.
    pub const fn body(&self) -> &Body {
        &self.body
    }

    /// Its outline on the sample's plane, if it lies in that.
    pub fn shape(&self) -> Option<&Shape> {
        self.body.shape()
    }

    /// How its radiance goes with direction.
    pub const fn law(&self) -> &Law {
        &self.law
    }

    /// What its radiance is where law and image are 1.
    pub const fn level(&self) -> f64 {
        self.level
    }

    /// How its level goes with the place, where it does.
    pub const fn texture(&self) -> Option<&Image> {
        self.image.as_ref()
    }

    /// What scene.toml calls its kind.
    pub const fn kind(&self) -> &'static str {
        if self.image.is_some() { "image" } else { self.law.name() }
    }

    /// Radiance into (θ, φ) from its normal, radians, in the scene's unit, where its image (if it
    /// has one) is 1. Zero for θ of 90° and beyond, where a surface is not seen.
    pub fn radiance(&self, theta_rad: f64, phi_rad: f64) -> f64 {
        self.level * self.law.radiance(theta_rad, phi_rad)
    }

    /// Radiance of a patch on the sample's plane from a place on it, metres, into (θ, φ). The
    /// caller knows that it is on the patch.
    pub fn radiance_at(&self, x_m: f64, y_m: f64, theta_rad: f64, phi_rad: f64) -> f64 {
        self.image_at(x_m, y_m) * self.radiance(theta_rad, phi_rad)
    }

    /// As [`Emitter::radiance_at`], into a unit vector.
    pub fn radiance_into(&self, x_m: f64, y_m: f64, direction: DVec3) -> f64 {
        self.image_at(x_m, y_m) * self.level * self.law.radiance_into(direction)
    }

    /// Radiance of any emitter from a place on its surface into a unit vector of the sample's frame.
    pub fn radiance_from(&self, place: DVec3, direction: DVec3) -> f64 {
        match &self.body {
            Body::Flat(_) => self.radiance_into(place.x, place.y, direction),
            Body::Raised(_) => {
                let normal = self.body.normal(place);
                let (e, f) = frame(normal);
                let local = DVec3::new(e.dot(direction), f.dot(direction), normal.dot(direction));
                self.level * self.law.radiance_into(local)
            }
        }
    }

    /// Exitance into directions up to `theta_max_rad` from the normal, where its image is 1.
    pub fn exitance_within(&self, theta_max_rad: f64) -> f64 {
        self.level * self.law.exitance_within(theta_max_rad)
    }

    /// What it sends into all directions, W or lm.
    pub fn flux(&self) -> f64 {
        let exitance = Self::exitance_per_level(&self.law, self.image.as_ref());
        self.level * exitance * self.body.area_m2()
    }

    /// The largest radiance up to `theta_max_rad`, with its direction (θ, φ), anywhere on it. `None`
    /// where it grows beyond any bound, as a table does that ends above zero at 90°.
    pub fn peak_within(&self, theta_max_rad: f64) -> Option<(f64, f64, f64)> {
        let (value, theta, phi) = self.law.peak_within(theta_max_rad)?;
        Some((self.level * self.image.as_ref().map_or(1.0, Image::peak) * value, theta, phi))
    }

    /// ∫ of its image over what it has in common with a rectangle of the sample's plane, square
    /// metres: the area, where it has no image. Zero for what stands above the plane.
    pub fn area_within_m2(&self, xs: (f64, f64), ys: (f64, f64)) -> f64 {
        match (&self.body, &self.image) {
            (Body::Flat(shape), None) => shape.area_within_m2(xs, ys),
            (Body::Flat(shape), Some(image)) => {
                let (along, up) = shape.bounding_box();
                shape.area_m2() * image.integral(parts(along, xs), parts(up, ys))
            }
            (Body::Raised(_), _) => 0.0,
        }
    }

    /// Places on the borders between pixels of an image, and on its outline, within a rectangle of the
    /// sample's plane.
    pub(crate) fn borders_within(&self, xs: (f64, f64), ys: (f64, f64)) -> Vec<(f64, f64)> {
        let (Some(image), Some(shape)) = (self.texture(), self.shape()) else { return Vec::new() };
        let ((x0, x1), (y0, y1)) = shape.bounding_box();
        let sides = (2 * image.columns(), 2 * image.rows());
        let at = |from: f64, to: f64, i: usize, n: usize| from + (to - from) * i as f64 / n as f64;
        // Corners of pixels and middles of their sides.
        let places = (0..=sides.1).flat_map(|k| (0..=sides.0).map(move |i| (i, k)));
        let on_border = places.filter(|(i, k)| i % 2 == 0 || k % 2 == 0);
        let places = on_border.map(|(i, k)| (at(x0, x1, i, sides.0), at(y0, y1, k, sides.1)));
        let within = |(low, high): (f64, f64), at: f64| (low..=high).contains(&at);
        places.filter(|(x, y)| within(xs, *x) && within(ys, *y)).collect()
    }

    /// Where it is brightest within a rectangle of the sample's plane: x and y, metres, and its
    /// image's value there, 1 where it has none.
    pub fn brightest_within(&self, xs: (f64, f64), ys: (f64, f64)) -> Option<(f64, f64, f64)> {
        let shape = self.shape()?;
        let Some(image) = &self.image else {
            return shape.point_within(xs, ys).map(|(x, y)| (x, y, 1.0));
        };
        let (along, up) = shape.bounding_box();
        let (value, x, y) = image.brightest(parts(along, xs), parts(up, ys))?;
        let at = |side: (f64, f64), part: f64| side.0 + part * (side.1 - side.0);
        Some((at(along, x), at(up, y), value))
    }

    fn image_at(&self, x_m: f64, y_m: f64) -> f64 {
        match (&self.image, &self.body) {
            (Some(image), Body::Flat(Shape::Rectangle { x_m: along, y_m: up })) => {
                let part = |(low, high): (f64, f64), at: f64| (at - low) / (high - low);
                image.at(part(*along, x_m), part(*up, y_m))
            }
            _ => 1.0,
        }
    }

    /// Exitance of a level of 1, averaged over its surface.
    pub(super) fn exitance_per_level(law: &Law, image: Option<&Image>) -> f64 {
        let mean = image.map_or(1.0, |image| image.integral((0.0, 1.0), (0.0, 1.0)));
        mean * law.exitance_within(FRAC_PI_2)
    }

    pub(super) fn check(&self) -> Result<(), SceneError> {
        self.body.check()?;
        if !self.level.is_finite() || self.level < 0.0 {
            return Err(SceneError::Level(self.level));
        }
        if matches!(self.body, Body::Raised(_)) && !self.law.is_round() {
            return Err(SceneError::Unsupported(
                "a body above the plane with lobes or a photometric file, whose φ has no zero there",
            ));
        }
        if self.image.is_some() && !matches!(self.body, Body::Flat(Shape::Rectangle { .. })) {
            return Err(SceneError::Unsupported("an image on anything but an upright rectangle"));
        }
        match self.law {
            Law::CosinePower { exponent } if !(0.0..=EXPONENT_MAX).contains(&exponent) => {
                Err(SceneError::Exponent(exponent))
            }
            _ => Ok(()),
        }
    }
}

/// An interval in parts of a side, within [0, 1].
fn parts((low, high): (f64, f64), within: (f64, f64)) -> (f64, f64) {
    let part = |at: f64| ((at - low) / (high - low)).clamp(0.0, 1.0);
    (part(within.0), part(within.1))
}
