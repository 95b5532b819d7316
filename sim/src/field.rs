//! Radiance as a function on rays, in the sample's frame: what stands on the sample, without the
//! detector that looks at it.

use core::f64::consts::TAU;
use core::fmt;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use crate::optics::Boundary;
use crate::scene::Shape;
use crate::{Emitter, Law, Region, Scene};

/// A ray from the sample to the detector, sample's frame. It is named by where it crosses the
/// sample's plane and by its direction: light that leaves something above the plane goes along the
/// ray that would have come from the plane. Within one medium its radiance is the same all along.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it crosses z = 0, metres.
    pub point: DVec3,
    /// Of length one, from the sample to the detector.
    pub direction: DVec3,
}

impl Ray {
    /// From (x, y) on the sample into (θ, φ).
    pub fn new(x_m: f64, y_m: f64, theta_rad: f64, phi_rad: f64) -> Self {
        let (sin, cos) = libm::sincos(theta_rad);
        let (sin_phi, cos_phi) = libm::sincos(phi_rad);
        Self {
            point: DVec3::new(x_m, y_m, 0.0),
            direction: DVec3::new(sin * cos_phi, sin * sin_phi, cos),
        }
    }

    /// The ray through a point anywhere along a direction. `None` for one that never comes from
    /// the sample's plane: it runs along it, or from above.
    pub fn through(point: DVec3, direction: DVec3) -> Option<Self> {
        if direction.z <= EDGE_ON {
            return None;
        }
        let crossing = point - direction * (point.z / direction.z);
        let point = DVec3::new(crossing.x, crossing.y, 0.0);
        point.is_finite().then_some(Self { point, direction })
    }
}

/// The cosine below which a ray runs along the plane: cos 90° is not zero in floating point.
const EDGE_ON: f64 = 1e-12;

/// What can be looked at.
pub(crate) trait Field: fmt::Debug + Send + Sync {
    /// Radiance along a ray, in the scene's unit; zero off the sample.
    fn radiance(&self, ray: &Ray) -> f64;

    /// Rays of a region among which there are, but for a stated margin, the brightest one and
    /// those around which the field changes most: its corners, and the field's own landmarks.
    fn landmarks(&self, region: &Region) -> Vec<Ray> {
        grid(region)
    }

    /// Rays of a region along which there is a detail that no grid meets for certain: an outline of what
    /// stands above the plane, or one within an image.
    fn details(&self, _: &Region) -> Vec<Ray> {
        Vec::new()
    }

    /// The flat patches on the sample's plane, if they are all that there is to see; they do not
    /// overlap.
    fn patches(&self) -> Option<Vec<Patch>> {
        None
    }

    /// Radiance along a ray from one of the patches, by its place among them, as if it had no end.
    fn on_patch(&self, _: usize, ray: &Ray) -> f64 {
        self.radiance(ray)
    }

    /// Whether what leaves each place goes alike into all directions, and all places lie in the plane.
    fn is_even(&self) -> bool {
        false
    }

    /// Whether a radiance costs so much that fewer rays are asked for when effects are weighed.
    fn is_slow(&self) -> bool {
        false
    }

    /// The largest radiance of a region; no less than that of any landmark.
    fn brightest(&self, region: &Region) -> f64 {
        self.landmarks(region).iter().map(|ray| self.radiance(ray)).fold(0.0, f64::max)
    }
}

/// A flat patch on the sample's plane.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Patch {
    /// What calls it into being: its key in scene.toml.
    pub(crate) name: String,
    pub(crate) boundary: Boundary,
    /// A place within.
    pub(crate) place: DVec2,
    pub(crate) goes: Goes,
}

/// With what the radiance of a patch goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Goes {
    /// With nothing: this is it.
    Even(f64),
    /// With direction alone; whether it is the same all round the normal.
    WithDirection { is_round: bool },
    /// With the place alone.
    WithPlace,
    /// With both.
    WithBoth,
}

impl Patch {
    /// Of an emitter in the sample's plane, the `i`-th of its scene. `None` for another one, and for an
    /// image, which has outlines within.
    pub(crate) fn of_emitter(i: usize, emitter: &Emitter) -> Option<Self> {
        let shape = emitter.shape().filter(|_| emitter.texture().is_none())?;
        let ((x0, x1), (y0, y1)) = shape.bounding_box();
        let (x, y) = (f64::midpoint(x0, x1), f64::midpoint(y0, y1));
        let goes = match emitter.law() {
            Law::Lambertian => Goes::Even(emitter.radiance_into(x, y, DVec3::Z)),
            law => Goes::WithDirection { is_round: law.is_round() },
        };
        Some(Self::new(format!("emitter[{i}]"), shape, goes))
    }

    pub(crate) fn new(name: String, shape: &Shape, goes: Goes) -> Self {
        let boundary = Boundary::of(shape);
        Self { name, place: boundary.place_within(), boundary, goes }
    }
}

/// What leaves one place of a field, as if it left every place.
#[derive(Debug)]
pub(crate) struct OfPlace {
    pub(crate) field: Arc<dyn Field>,
    /// The place's patch, by its place among them.
    pub(crate) patch: usize,
    pub(crate) place: DVec3,
}

impl Field for OfPlace {
    fn radiance(&self, ray: &Ray) -> f64 {
        self.field.on_patch(self.patch, &Ray { point: self.place, ..*ray })
    }
}

/// Places a side, polar angles and azimuths of the landmarks that every region has.
const PLACES: u32 = 5;
const POLAR: u32 = 16;
const AZIMUTHS: u32 = 16;

/// Places on the borders of pixels at most.
const BORDERS: usize = 400;

/// A grid of rays over a region, its corners and its largest θ included.
pub(crate) fn grid(region: &Region) -> Vec<Ray> {
    let between =
        |(low, high): (f64, f64), i: u32| low + (high - low) * f64::from(i) / f64::from(PLACES - 1);
    let mut rays = Vec::new();
    for place in 0..PLACES * PLACES {
        let (x, y) = (between(region.x_m, place / PLACES), between(region.y_m, place % PLACES));
        rays.push(Ray::new(x, y, 0.0, 0.0));
        for direction in 0..POLAR * AZIMUTHS {
            let theta =
                region.theta_max_rad * f64::from(direction / AZIMUTHS + 1) / f64::from(POLAR);
            let phi = TAU * f64::from(direction % AZIMUTHS) / f64::from(AZIMUTHS);
            rays.push(Ray::new(x, y, theta, phi));
        }
    }
    rays
}

impl Field for Scene {
    fn radiance(&self, ray: &Ray) -> f64 {
        let (x_m, y_m) = (ray.point.x, ray.point.y);
        let on = |emitter: &&Emitter| emitter.shape().is_some_and(|shape| shape.contains(x_m, y_m));
        let emitter = self.emitters().iter().find(on);
        emitter.map_or(0.0, |emitter| emitter.radiance_into(x_m, y_m, ray.direction))
    }

    fn patches(&self) -> Option<Vec<Patch>> {
        let emitters = self.emitters().iter().enumerate();
        emitters.map(|(i, emitter)| Patch::of_emitter(i, emitter)).collect()
    }

    fn details(&self, region: &Region) -> Vec<Ray> {
        let emitters = self.emitters().iter();
        let places = emitters.flat_map(|emitter| emitter.borders_within(region.x_m, region.y_m));
        let places: Vec<(f64, f64)> = places.collect();
        let every = places.len().div_ceil(BORDERS).max(1);
        let places = places.into_iter().step_by(every);
        places.map(|(x, y)| Ray::new(x, y, 0.0, 0.0)).collect()
    }

    fn on_patch(&self, patch: usize, ray: &Ray) -> f64 {
        let emitter = self.emitters().get(patch);
        emitter
            .map_or(0.0, |emitter| emitter.radiance_into(ray.point.x, ray.point.y, ray.direction))
    }

    fn brightest(&self, region: &Region) -> f64 {
        let peaks = self.emitters().iter().filter_map(|emitter| {
            let (.., part) = emitter.brightest_within(region.x_m, region.y_m)?;
            let (value, ..) = emitter.law().peak_within(region.theta_max_rad)?;
            Some(part * emitter.level() * value)
        });
        peaks.fold(0.0, f64::max)
    }
}
