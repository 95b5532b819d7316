//! A window in a ray's way: what of the light passes, and by how much the ray is shifted.

use glam::DVec3;
use radiometry::interface::{Incidence, Interface, Window as Pane};

use crate::scene::{SceneError, Window};

/// A plane-parallel plate above the sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plate {
    low_m: f64,
    thickness_m: f64,
    index: f64,
    pane: Pane,
}

/// What a plate does to a ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct Passage {
    pub(super) transmittance: f64,
    /// From the ray's line above the plate to its line below, along the plate, metres.
    pub(super) shift_m: DVec3,
}

impl Plate {
    pub(super) fn new(window: &Window) -> Result<Self, SceneError> {
        Ok(Self {
            low_m: window.z_m,
            thickness_m: window.thickness_m,
            index: window.index,
            pane: window.pane()?,
        })
    }

    pub(super) fn low_m(&self) -> f64 {
        self.low_m
    }

    pub(super) fn high_m(&self) -> f64 {
        self.low_m + self.thickness_m
    }

    /// Of a ray with this unit direction away from the sample. Inside it is steeper, d tan θ₂ along
    /// the plate instead of d tan θ₁: below, it is nearer to the detector's side by the difference.
    pub(super) fn passage(&self, direction: DVec3) -> Passage {
        let cos = direction.z.clamp(0.0, 1.0);
        let Ok(incidence) = Incidence::from_cos(cos) else {
            return Passage { transmittance: 0.0, shift_m: DVec3::ZERO };
        };
        // sin θ₂ = sin θ₁ / n: tan θ₁ - tan θ₂ for each unit of sin θ₁.
        let sin_square = (1.0 - cos) * (1.0 + cos);
        let inside = libm::sqrt(self.index * self.index - sin_square);
        let part = if cos > 0.0 { 1.0 / cos - 1.0 / inside } else { 0.0 };
        Passage {
            transmittance: self.pane.transmittance(incidence),
            shift_m: DVec3::new(direction.x, direction.y, 0.0) * (self.thickness_m * part),
        }
    }

    /// How thick it looks from below, straight up: d/n.
    pub(super) fn apparent_thickness_m(&self) -> f64 {
        self.thickness_m / self.index
    }

    /// What its lower face throws back at an angle with this cosine, and what all of it does.
    pub(super) fn reflectances(&self, cos: f64) -> (f64, f64) {
        let Ok(incidence) = Incidence::from_cos(cos.clamp(0.0, 1.0)) else { return (1.0, 1.0) };
        let face = Interface::new(1.0, self.index);
        let lower = face.map_or(1.0, |face| face.reflectance(incidence));
        (lower, self.pane.reflectance(incidence))
    }

    /// What passes, at an angle with this cosine.
    pub(super) fn transmittance(&self, cos: f64) -> f64 {
        let incidence = Incidence::from_cos(cos.clamp(0.0, 1.0));
        incidence.map_or(0.0, |incidence| self.pane.transmittance(incidence))
    }

    /// By how much higher a place below looks from above, at an angle with this cosine:
    /// d (1 - tan θ₂ / tan θ₁).
    pub(super) fn raises_m(&self, cos: f64) -> f64 {
        let sin_square = (1.0 - cos) * (1.0 + cos);
        let inside = libm::sqrt(self.index * self.index - sin_square);
        if inside > 0.0 { self.thickness_m * (1.0 - cos / inside) } else { 0.0 }
    }
}
