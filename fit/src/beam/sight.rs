//! What a beam that looks at a place from a direction sees of the sample's plane: from a ray's
//! slope and its place on the stop to where it leaves the plane, and in which direction.
//!
//! Frame of incidence: origin where the axis meets the plane, x towards the detector's side in the
//! plane of incidence, y horizontal across it, z the normal.
//!
//! In the perpendicular chart every direction has a plane of its own, and a ray's place is where it
//! pierces that, in that direction's frame: then the frame of incidence is the chart's.

use glam::DVec3;
use radiometry::beam::Beam;
use radiometry::chart::{Line as RayLine, Perpendicular};

use super::directions::Node;
use crate::{Chart, Ray};

/// A beam's axis over the plane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sight {
    pub(crate) sin: f64,
    pub(crate) cos: f64,
    sin_phi: f64,
    cos_phi: f64,
    x_m: f64,
    y_m: f64,
    horizon: Horizon,
}

/// Where the rays of a chart end.
#[derive(Debug, Clone, Copy)]
enum Horizon {
    /// At the plane z = 0.
    Plane,
    /// Nowhere: there are rays in all directions. With the axis's own place, in its own frame.
    None { place_m: (f64, f64) },
}

/// The rays of one direction: from a place s on the stop to the plane, which is affine in s:
/// x = A s + b.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shear {
    pub(crate) along: (f64, f64),
    pub(crate) across: (f64, f64),
    pub(crate) at: (f64, f64),
}

impl Sight {
    pub(crate) fn new(ray: &Ray, chart: Chart) -> Self {
        let (sin, cos) = libm::sincos(ray.theta_rad);
        let (sin_phi, cos_phi) = libm::sincos(ray.phi_rad);
        let (horizon, x_m, y_m) = if chart.is_whole_sphere() {
            (Horizon::None { place_m: (ray.x_m, ray.y_m) }, 0.0, 0.0)
        } else {
            (Horizon::Plane, ray.x_m, ray.y_m)
        };
        Self { sin, cos, sin_phi, cos_phi, x_m, y_m, horizon }
    }

    /// Whether rays end at the sample's plane.
    pub(crate) fn has_horizon(&self) -> bool {
        matches!(self.horizon, Horizon::Plane)
    }

    /// The direction of rays of this slope, sample's frame; `None` from below the plane or along it.
    pub(crate) fn direction(&self, (a, b): (f64, f64)) -> Option<DVec3> {
        let z = self.cos - a * self.sin;
        let x = a * self.cos + self.sin;
        let turned = (x * self.cos_phi - b * self.sin_phi, x * self.sin_phi + b * self.cos_phi);
        let length = (1.0 + a * a + b * b).sqrt();
        let is_seen = z > 0.0 || !self.has_horizon();
        is_seen.then(|| DVec3::new(turned.0, turned.1, z) / length)
    }

    /// Where rays of a direction that is seen leave the plane.
    pub(crate) fn shear(&self, beam: &Beam, node: &Node) -> Shear {
        let (a, b) = node.slope;
        let z = beam.stop_z_m();
        match self.horizon {
            Horizon::Plane => {
                let alpha = 1.0 / (self.cos - a * self.sin);
                let beta = self.sin * b * alpha;
                let (o1, o2) = (a * z, b * z);
                let at = (-alpha * o1, -o2 - beta * o1);
                Shear { along: (alpha, beta), across: (0.0, 1.0), at }
            }
            Horizon::None { place_m } => self.across(place_m, z, node),
        }
    }

    /// From the stop to the plane across the rays' own direction.
    fn across(&self, (x_m, y_m): (f64, f64), z: f64, node: &Node) -> Shear {
        let axis = DVec3::new(self.sin * self.cos_phi, self.sin * self.sin_phi, self.cos);
        let theta = DVec3::new(self.cos * self.cos_phi, self.cos * self.sin_phi, -self.sin);
        let phi = DVec3::new(-self.sin_phi, self.cos_phi, 0.0);
        let towards = axis + node.slope.0 * theta + node.slope.1 * phi;
        // The direction is never zero: it is the axis and something across it.
        let place = |point: DVec3| {
            let line = RayLine::new(point, towards).map(|line| Perpendicular::of(&line));
            line.map_or((0.0, 0.0), |place| (place.x_m, place.y_m))
        };
        let at = place(x_m * theta + y_m * phi + z * axis);
        Shear { along: place(theta), across: place(phi), at }
    }

    /// A place of the frame of incidence, on the sample.
    pub(crate) fn place(&self, (x, y): (f64, f64)) -> (f64, f64) {
        if !self.has_horizon() {
            return (x, y);
        }
        (
            self.x_m + x * self.cos_phi - y * self.sin_phi,
            self.y_m + x * self.sin_phi + y * self.cos_phi,
        )
    }

    /// A place on the sample, in the frame of incidence.
    pub(crate) fn seen(&self, (x, y): (f64, f64)) -> (f64, f64) {
        if !self.has_horizon() {
            return (x, y);
        }
        let (x, y) = (x - self.x_m, y - self.y_m);
        (x * self.cos_phi + y * self.sin_phi, y * self.cos_phi - x * self.sin_phi)
    }

    /// The coordinate x (or y) of the sample as n·place + offset in the frame of incidence.
    pub(crate) fn axis(&self, is_x: bool) -> ((f64, f64), f64) {
        if !self.has_horizon() {
            return if is_x { ((1.0, 0.0), 0.0) } else { ((0.0, 1.0), 0.0) };
        }
        if is_x {
            ((self.cos_phi, -self.sin_phi), self.x_m)
        } else {
            ((self.sin_phi, self.cos_phi), self.y_m)
        }
    }
}

impl Shear {
    /// From the stop to the plane, frame of incidence.
    pub(crate) fn place(&self, (s1, s2): (f64, f64)) -> (f64, f64) {
        (
            self.along.0 * s1 + self.across.0 * s2 + self.at.0,
            self.along.1 * s1 + self.across.1 * s2 + self.at.1,
        )
    }

    /// A half-plane n·place <= q of the plane as m·s <= r on the stop.
    pub(crate) fn on_stop(&self, (n1, n2): (f64, f64), q: f64) -> Line {
        let m = (self.along.0 * n1 + self.along.1 * n2, self.across.0 * n1 + self.across.1 * n2);
        Line { m, r: q - n1 * self.at.0 - n2 * self.at.1 }
    }

    /// Where on the stop the chords s₁ = constant touch a disk of the plane.
    pub(crate) fn tangents(&self, (x, y): (f64, f64), radius: f64) -> [f64; 2] {
        let determinant = self.along.0 * self.across.1 - self.along.1 * self.across.0;
        let row = (self.across.1 / determinant, -self.across.0 / determinant);
        let middle = row.0 * (x - self.at.0) + row.1 * (y - self.at.1);
        let half = radius * libm::hypot(row.0, row.1);
        [middle - half, middle + half]
    }
}

/// m·s = r on the stop; m·s <= r is within.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line {
    pub(crate) m: (f64, f64),
    pub(crate) r: f64,
}
