//! How steeply a ray meets a surface, with the square of the cosine to 32 digits: next to the
//! critical angle and to Brewster's it is all that decides. It knows no medium.

use core::f64::consts::FRAC_PI_2;

use glam::DVec3;

use crate::domain::{self, DomainError, within};
use crate::error_free::{DoubleDouble, cosine};

/// The angle between a ray and the normal of the surface that it meets, in [0, π/2].
/// Who needs it: every kernel of interfaces and windows.
#[derive(Debug, Clone, Copy)]
pub struct Incidence {
    cos: f64,
    sin: f64,
    cos_squared: DoubleDouble,
}

impl Incidence {
    /// From the cosine, in [0, 1]: the form to hand on between modules, since an angle near π/2 or
    /// near a critical angle has lost digits already.
    pub fn from_cos(cos_i: f64) -> Result<Self, DomainError> {
        let cos = within("cos_i", cos_i, 0.0, 1.0)?.abs();
        let sin = ((1.0 - cos) * (1.0 + cos)).sqrt();
        let exact = DoubleDouble::from_f64(cos);
        Ok(Self { cos, sin, cos_squared: exact.mul(exact) })
    }

    /// From the angle to the normal, radians in [0, π/2]. Its cosine is found to 30 digits, so
    /// that the answer is that of the angle as given.
    pub fn from_angle(theta_i_rad: f64) -> Result<Self, DomainError> {
        let theta = within("theta_i_rad", theta_i_rad, 0.0, FRAC_PI_2)?;
        let cos = cosine(theta);
        Ok(Self { cos: cos.to_f64(), sin: libm::sin(theta), cos_squared: cos.mul(cos) })
    }

    /// From a ray's direction and a normal against it, both of any length. Zero vectors and a
    /// direction along the normal's half-space are errors.
    pub fn between(direction: DVec3, normal: DVec3) -> Result<Self, DomainError> {
        let (direction, normal) =
            (domain::direction("direction", direction)?, domain::direction("normal", normal)?);
        let dot = dot(direction, normal);
        if dot.to_f64() > 0.0 {
            let value = dot.to_f64() / (direction.length() * normal.length());
            let argument = "the cosine between direction and normal";
            return Err(DomainError::Outside { argument, value, low: -1.0, high: 0.0 });
        }
        let lengths = dot_self(direction).mul(dot_self(normal));
        let cos_squared = dot.mul(dot).div(lengths);
        let cos = cos_squared.to_f64().sqrt().min(1.0);
        let sin_squared = DoubleDouble::from_f64(1.0).sub(cos_squared).to_f64();
        Ok(Self { cos, sin: sin_squared.max(0.0).sqrt(), cos_squared })
    }

    /// cos θ, in [0, 1].
    pub const fn cos(self) -> f64 {
        self.cos
    }

    /// sin θ, in [0, 1].
    pub const fn sin(self) -> f64 {
        self.sin
    }

    pub(super) const fn cos_squared(self) -> DoubleDouble {
        self.cos_squared
    }
}

fn dot(a: DVec3, b: DVec3) -> DoubleDouble {
    let product = |x: f64, y: f64| DoubleDouble::from_f64(x).mul(DoubleDouble::from_f64(y));
    product(a.x, b.x).add(product(a.y, b.y)).add(product(a.z, b.z))
}

fn dot_self(a: DVec3) -> DoubleDouble {
    dot(a, a)
}
