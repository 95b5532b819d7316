//! Outlines of bodies as directions from a place: the curves that they follow on the sphere, and where
//! a curve crosses another's. It knows no lobe.

use core::f64::consts::TAU;

use glam::{DMat3, DVec3};
use radiometry::direction::{frame, normalised};

use super::Sight;
use crate::scene::Solid;

/// Steps of a circle in which crossings are looked for, and halvings of each one's place.
const LOOKS: u32 = 48;
const HALVINGS: u32 = 48;

/// Directions, not of length one, over a parameter.
#[derive(Debug, Clone, Copy)]
pub(in crate::light) enum Curve {
    /// a + t b, t from 0 to 1.
    Segment(DVec3, DVec3),
    /// a + b cos t + c sin t, t from 0 to 2π.
    Circle(DVec3, DVec3, DVec3),
}

/// What is 0 along an outline, and perhaps elsewhere.
#[derive(Debug, Clone, Copy)]
pub(in crate::light) enum Level {
    /// n·d.
    Plane(DVec3),
    /// d·Md.
    Cone(DMat3),
    /// u·d - |d| cos: directions at an angle from a unit vector.
    Round(DVec3, f64),
}

impl Level {
    /// At an angle from a vector or from its opposite.
    fn both_ways(towards: DVec3, cos: f64) -> Self {
        // Of a cone as flat as this the two nappes are one plane, which is crossed but once.
        if cos.abs() < LEVEL {
            return Self::Plane(towards);
        }
        let along = DMat3::from_cols(towards * towards.x, towards * towards.y, towards * towards.z);
        Self::Cone(along - DMat3::IDENTITY * (cos * cos))
    }
}

/// Rounding of products of unit vectors.
const LEVEL: f64 = 1e-14;

impl Curve {
    /// All directions across another.
    pub(super) fn great_circle(normal: DVec3) -> Self {
        let (e, f) = frame(normal);
        Self::Circle(DVec3::ZERO, e, f)
    }

    /// A circle about z, t being φ.
    pub(in crate::light) fn parallel(sin: f64, cos: f64) -> Self {
        Self::Circle(DVec3::Z * cos, DVec3::X * sin, DVec3::Y * sin)
    }

    pub(super) const fn range(&self) -> (f64, f64) {
        match self {
            Self::Segment(..) => (0.0, 1.0),
            Self::Circle(..) => (0.0, TAU),
        }
    }

    /// By how much a part of it turns about its middle, radians.
    pub(super) const fn turns(&self, from: f64, to: f64) -> f64 {
        match self {
            Self::Segment(..) => 0.0,
            Self::Circle(..) => to - from,
        }
    }

    /// Where it is, and where it goes.
    pub(super) fn at(&self, t: f64) -> (DVec3, DVec3) {
        match self {
            Self::Segment(a, b) => (*a + *b * t, *b),
            Self::Circle(a, b, c) => {
                let (sin, cos) = libm::sincos(t);
                (*a + *b * cos + *c * sin, *c * cos - *b * sin)
            }
        }
    }

    /// Where it crosses an outline.
    pub(in crate::light) fn crossings(&self, level: &Level, found: &mut Vec<f64>) {
        match (self, level) {
            (Self::Segment(a, b), Level::Plane(normal)) => {
                found.push(-normal.dot(*a) / normal.dot(*b));
            }
            (Self::Segment(..), Level::Round(towards, cos)) => {
                self.crossings(&Level::both_ways(*towards, *cos), found);
            }
            (Self::Segment(a, b), Level::Cone(matrix)) => {
                let (square, middle) = (b.dot(*matrix * *b), -a.dot(*matrix * *b));
                let root = middle * middle - square * a.dot(*matrix * *a);
                if root >= 0.0 {
                    let root = libm::sqrt(root);
                    found.extend([(middle - root) / square, (middle + root) / square]);
                }
            }
            (Self::Circle(a, b, c), Level::Plane(normal)) => {
                let (rest, e, f) = (-normal.dot(*a), normal.dot(*b), normal.dot(*c));
                let wide = libm::hypot(e, f);
                if wide > rest.abs() {
                    let (turn, aside) = (libm::atan2(f, e), libm::acos(rest / wide));
                    found.extend([turn - aside, turn + aside].map(|t| t - TAU * (t / TAU).floor()));
                }
            }
            (Self::Circle(a, b, c), Level::Round(towards, cos)) => {
                let is_even = a.dot(*b).abs() + a.dot(*c).abs() + b.dot(*c).abs() < LEVEL
                    && (b.length_squared() - c.length_squared()).abs() < LEVEL
                    && (a.length_squared() + b.length_squared() - 1.0).abs() < LEVEL;
                if !is_even {
                    return self.crossings(&Level::both_ways(*towards, *cos), found);
                }
                let (rest, e, f) = (cos - towards.dot(*a), towards.dot(*b), towards.dot(*c));
                let wide = libm::hypot(e, f);
                if wide > rest.abs() {
                    let (turn, aside) = (libm::atan2(f, e), libm::acos(rest / wide));
                    found.extend([turn - aside, turn + aside].map(|t| t - TAU * (t / TAU).floor()));
                }
            }
            (Self::Circle(..), Level::Cone(matrix)) => {
                let of = |t| {
                    let (at, _) = self.at(t);
                    at.dot(*matrix * at)
                };
                scan(&of, found);
            }
        }
        let (low, high) = self.range();
        found.retain(|t| *t > low && *t < high);
    }
}

impl Sight {
    /// Its outline, seen from a place.
    pub(super) fn outline(&self, place: DVec3) -> Vec<Curve> {
        let around = |towards: DVec3, sin: f64, cos: f64| {
            let (e, f) = frame(towards);
            vec![Curve::Circle(towards * cos, e * sin, f * sin)]
        };
        match self {
            Self::Cap(towards, half) => {
                let (sin, cos) = libm::sincos(*half);
                around(*towards, sin, cos)
            }
            Self::Body(Solid::Sphere(ball)) => {
                let away = ball.center_m() - place;
                let sin = (ball.radius_m() / away.length()).min(1.0);
                let towards = normalised(away).unwrap_or(DVec3::Z);
                around(towards, sin, libm::sqrt(1.0 - sin * sin))
            }
            Self::Body(Solid::Disk(disk)) => {
                let (e, f) = frame(normalised(disk.axis()).unwrap_or(DVec3::Z));
                let r = disk.radius_m();
                vec![Curve::Circle(disk.center_m() - place, e * r, f * r)]
            }
            Self::Body(Solid::Polygon(polygon)) => {
                edges(polygon.vertices()).map(|(a, b)| Curve::Segment(a - place, b - a)).collect()
            }
            Self::Body(Solid::HalfPlane(edge)) => {
                let planes = half_plane((edge.x_max_m(), edge.z_m()), place);
                planes.into_iter().filter_map(normalised).map(Curve::great_circle).collect()
            }
        }
    }

    /// What is 0 along its outline.
    pub(in crate::light) fn levels(&self, place: DVec3) -> Vec<Level> {
        match self {
            Self::Cap(towards, half) => vec![Level::Round(*towards, libm::cos(*half))],
            Self::Body(Solid::Sphere(ball)) => {
                let away = ball.center_m() - place;
                let sin = (ball.radius_m() / away.length()).min(1.0);
                let towards = normalised(away).unwrap_or(DVec3::Z);
                vec![Level::Round(towards, libm::sqrt(1.0 - sin * sin))]
            }
            Self::Body(Solid::Disk(disk)) => {
                let (c, n) = (disk.center_m() - place, normalised(disk.axis()).unwrap_or(DVec3::Z));
                let (depth, r) = (n.dot(c), disk.radius_m());
                // |(n·c) d - (n·d) c|² = (r n·d)² on the rim.
                let column = |unit: DVec3| {
                    let (along, across) = (n.dot(unit), c.dot(unit));
                    unit * (depth * depth) - (n * across + c * along) * depth
                        + n * (along * (c.length_squared() - r * r))
                };
                vec![Level::Cone(DMat3::from_cols(
                    column(DVec3::X),
                    column(DVec3::Y),
                    column(DVec3::Z),
                ))]
            }
            Self::Body(Solid::Polygon(polygon)) => edges(polygon.vertices())
                .map(|(a, b)| Level::Plane((a - place).cross(b - place)))
                .collect(),
            Self::Body(Solid::HalfPlane(edge)) => {
                half_plane((edge.x_max_m(), edge.z_m()), place).map(Level::Plane).to_vec()
            }
        }
    }
}

/// The planes through a place and the edge, and through it level with the half-plane's far end.
fn half_plane((x_max_m, z_m): (f64, f64), place: DVec3) -> [DVec3; 2] {
    [DVec3::new(place.z - z_m, 0.0, x_max_m - place.x), DVec3::Z]
}

fn edges(corners: &[DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> {
    corners.iter().copied().zip(corners.iter().copied().cycle().skip(1))
}

/// The roots of a trigonometric polynomial of the second degree, of which two may lie within a step.
fn scan(of: &dyn Fn(f64) -> f64, found: &mut Vec<f64>) {
    let step = TAU / f64::from(LOOKS);
    let mut bracket = |mut low: f64, mut high: f64| {
        let is_low = of(low) > 0.0;
        if is_low == (of(high) > 0.0) {
            return;
        }
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(low, high);
            if (of(middle) > 0.0) == is_low { low = middle } else { high = middle }
        }
        found.push(low);
    };
    let mut before = of(-step);
    let mut here = of(0.0);
    for i in 0..LOOKS {
        let t = step * f64::from(i);
        let after = of(t + step);
        if (here > 0.0) == (after > 0.0) {
            // Where a parabola through three has its turn.
            let (slope, bend) = ((after - before) / 2.0, after - 2.0 * here + before);
            let turn = -slope / bend;
            if turn > 0.0 && turn < 1.0 {
                bracket(t, t + step * turn);
                bracket(t + step * turn, t + step);
            }
        } else {
            bracket(t, t + step);
        }
        (before, here) = (here, after);
    }
}
