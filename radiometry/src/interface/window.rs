//! A plane-parallel plate in one medium: how much light passes it with all reflections between its
//! faces, and by how much it shifts a ray. It adds powers, not fields: the plate is thicker than the
//! light's coherence length, as windows are.

use crate::domain::{DomainError, not_negative};

use super::{Incidence, Interface};

/// A plate of medium 2 with medium 1 on both sides. The simulator puts it in front of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    face: Interface,
    thickness_m: f64,
    absorption_per_m: f64,
}

/// What a face and one crossing of the plate do to one polarisation.
#[derive(Clone, Copy)]
struct Face {
    reflectance: f64,
    transmittance: f64,
}

impl Window {
    /// The front face seen from outside, a thickness >= 0, and an absorption coefficient >= 0
    /// (Beer: exp(-αs) is left after a path s).
    pub fn new(
        face: Interface,
        thickness_m: f64,
        absorption_per_m: f64,
    ) -> Result<Self, DomainError> {
        Ok(Self {
            face,
            thickness_m: not_negative("thickness_m", thickness_m)?,
            absorption_per_m: not_negative("absorption_per_m", absorption_per_m)?,
        })
    }

    /// The part of unpolarised light that passes, in [0, 1]; 0 at total reflection. With the face's
    /// R and T and one crossing's a: T² a/(1 - R² a²) for each polarisation (Stokes 1862).
    ///
    /// ```
    /// use radiometry::interface::{Incidence, Interface, Window};
    /// let pane = Window::new(Interface::new(1.0, 1.5)?, 4e-3, 0.0)?;
    /// // A clear pane at normal incidence: (1 - R)/(1 + R) = 2n/(n² + 1).
    /// let through = pane.transmittance(Incidence::from_cos(1.0)?);
    /// assert!((through - 3.0 / 3.25).abs() < 1e-15);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn transmittance(self, incidence: Incidence) -> f64 {
        self.mean(incidence, transmitted)
    }

    /// The part of unpolarised light that is thrown back, in [0, 1]: R (1 + a T a T/(1 - R² a²)).
    pub fn reflectance(self, incidence: Incidence) -> f64 {
        self.mean(incidence, |face, loss| {
            let left = 1.0 - loss;
            (face.reflectance * (1.0 + left * transmitted(face, loss))).min(1.0)
        })
    }

    /// How far the ray leaves beside its own continuation, m, towards the normal's side where the
    /// plate is denser: d sin(θ₁ - θ₂)/cos θ₂; none at total reflection, and none along the plate.
    pub fn lateral_shift_m(self, incidence: Incidence) -> Option<f64> {
        let deviation = self.face.deviation(incidence)?;
        let cos = self.face.refracted_cos(incidence)?;
        (cos > 0.0).then(|| self.thickness_m * (libm::sin(deviation) / cos))
    }

    /// Of both polarisations; a ray that doesn't enter is reflected wholly.
    fn mean(self, incidence: Incidence, share: impl Fn(Face, f64) -> f64) -> f64 {
        let face = self.face;
        let loss = self.loss(incidence);
        let s = Face {
            reflectance: face.reflectance_s(incidence),
            transmittance: face.transmittance_s(incidence),
        };
        let p = Face {
            reflectance: face.reflectance_p(incidence),
            transmittance: face.transmittance_p(incidence),
        };
        f64::midpoint(share(s, loss), share(p, loss))
    }

    /// 1 - exp(-α d/cos θ₂): what one crossing swallows.
    fn loss(self, incidence: Incidence) -> f64 {
        let depth = self.absorption_per_m * self.thickness_m;
        match self.face.refracted_cos(incidence) {
            _ if depth == 0.0 => 0.0,
            Some(cos) if cos > 0.0 => -libm::expm1(-depth / cos),
            _ => 1.0,
        }
    }
}

/// T² a/((1 - Ra)(1 + Ra)), with 1 - Ra = T + R (1 - a), which keeps its digits at grazing.
fn transmitted(face: Face, loss: f64) -> f64 {
    let left = 1.0 - loss;
    let closed = face.reflectance.mul_add(loss, face.transmittance);
    if closed == 0.0 || face.transmittance == 0.0 {
        return 0.0;
    }
    let share = face.transmittance / closed;
    (share * face.transmittance * left / face.reflectance.mul_add(left, 1.0)).min(1.0)
}
