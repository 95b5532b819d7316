//! What a beam that looks at a place from a direction sees of the sample's plane: from a ray's
//! slope and its place on the stop to where it leaves the plane, and in which direction.
//!
//! Frame of incidence: origin where the axis meets the plane, x towards the detector's side in the
//! plane of incidence, y horizontal across it, z the normal.

use glam::DVec3;
use radiometry::beam::Beam;

use super::directions::Node;
use crate::Ray;

/// A beam's axis over the plane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sight {
    pub(crate) sin: f64,
    pub(crate) cos: f64,
    sin_phi: f64,
    cos_phi: f64,
    x_m: f64,
    y_m: f64,
}

/// The rays of one direction: from a place s on the stop to the plane, which is affine in s:
/// x = α (s₁ - o₁), y = s₂ - o₂ + β (s₁ - o₁).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shear {
    pub(crate) alpha: f64,
    pub(crate) beta: f64,
    pub(crate) offset: (f64, f64),
}

impl Sight {
    pub(crate) fn new(ray: &Ray) -> Self {
        let (sin, cos) = libm::sincos(ray.theta_rad);
        let (sin_phi, cos_phi) = libm::sincos(ray.phi_rad);
        Self { sin, cos, sin_phi, cos_phi, x_m: ray.x_m, y_m: ray.y_m }
    }

    /// The direction of rays of this slope, sample's frame; `None` from below the plane or along it.
    pub(crate) fn direction(&self, (a, b): (f64, f64)) -> Option<DVec3> {
        let z = self.cos - a * self.sin;
        let x = a * self.cos + self.sin;
        let turned = (x * self.cos_phi - b * self.sin_phi, x * self.sin_phi + b * self.cos_phi);
        let length = (1.0 + a * a + b * b).sqrt();
        (z > 0.0).then(|| DVec3::new(turned.0, turned.1, z) / length)
    }

    /// Where rays of a direction above the plane leave it.
    pub(crate) fn shear(&self, beam: &Beam, node: &Node) -> Shear {
        let (a, b) = node.slope;
        let alpha = 1.0 / (self.cos - a * self.sin);
        let z = beam.stop_z_m();
        Shear { alpha, beta: self.sin * b * alpha, offset: (a * z, b * z) }
    }

    /// A place of the frame of incidence, on the sample.
    pub(crate) fn place(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (
            self.x_m + x * self.cos_phi - y * self.sin_phi,
            self.y_m + x * self.sin_phi + y * self.cos_phi,
        )
    }

    /// A place on the sample, in the frame of incidence.
    pub(crate) fn seen(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let (x, y) = (x - self.x_m, y - self.y_m);
        (x * self.cos_phi + y * self.sin_phi, y * self.cos_phi - x * self.sin_phi)
    }

    /// The coordinate x (or y) of the sample as n·place + offset in the frame of incidence.
    pub(crate) fn axis(&self, is_x: bool) -> ((f64, f64), f64) {
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
        let (s1, s2) = (s1 - self.offset.0, s2 - self.offset.1);
        (self.alpha * s1, s2 + self.beta * s1)
    }

    /// A half-plane n·place <= q of the plane as m·s <= r on the stop.
    pub(crate) fn on_stop(&self, (n1, n2): (f64, f64), q: f64) -> Line {
        let m = (self.alpha * n1 + self.beta * n2, n2);
        Line { m, r: q + m.0 * self.offset.0 + m.1 * self.offset.1 }
    }
}

/// m·s = r on the stop; m·s <= r is within.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line {
    pub(crate) m: (f64, f64),
    pub(crate) r: f64,
}
