//! A smooth interface between two clear media: which way a ray goes on, how much of it, and what
//! becomes of its radiance. It knows rays (geometrical optics), neither wavelength nor coherence;
//! both indices are real, so that an interface alone absorbs nothing.
//!
//! The simulator needs it for windows and domes in front of a sample. The formulas are those of Born
//! and Wolf (1999, sections 1.5.1 to 1.5.4), with each difference of nearly equal terms
//! rationalised: with p = n₁ cos θ₁, q = n₂ cos θ₂ and D = n₂² - n₁² there is q² = p² + D, and q - p = D/(p + q). So nothing is lost at grazing
//! incidence, next to the critical angle, or where the indices hardly differ.
//!
//! ```
//! use radiometry::interface::{Incidence, Interface};
//! let glass = Interface::new(1.0, 1.5)?;
//! // At normal incidence ((n₂ - n₁)/(n₂ + n₁))²: the 4 % of a window pane's face.
//! assert!((glass.reflectance(Incidence::from_cos(1.0)?) - 0.04).abs() < 1e-16);
//! # Ok::<(), radiometry::DomainError>(())
//! ```

mod graded;
mod incidence;
mod window;

use glam::DVec3;

use crate::direction::normalised;
use crate::domain::{DomainError, positive, within};
use crate::error_free::{DoubleDouble, two_sum};

pub use graded::{
    ExponentialProfile, IndexField, IndexProfile, Leg, LinearProfile, Stop, Stratified,
    StratifiedRay, TraceError, Traced, basic_radiance, radiance_in_medium, trace,
};
pub use incidence::Incidence;
pub use window::Window;

/// The plane between medium 1, where the light comes from, and medium 2.
/// Who needs it: the simulator, for windows and domes; the page on the n² law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interface {
    /// Both in one scale, the larger in [1, 2): only their ratio has a meaning.
    n1: f64,
    n2: f64,
}

/// p, q and cos θ of one ray at one interface.
#[derive(Debug, Clone, Copy)]
struct Passage {
    p: f64,
    q: f64,
    cos: f64,
    /// n₂² - n₁².
    difference: f64,
}

impl Interface {
    /// Refractive indices, both positive and finite, and within a factor of 1e60 of each other.
    pub fn new(n1: f64, n2: f64) -> Result<Self, DomainError> {
        const RATIO_MAX: f64 = 1e60;
        let (n1, n2) = (positive("n1", n1)?, positive("n2", n2)?);
        within("n2/n1", n2 / n1, 1.0 / RATIO_MAX, RATIO_MAX)?;
        let exponent = -libm::ilogb(n1.max(n2));
        Ok(Self { n1: libm::scalbn(n1, exponent), n2: libm::scalbn(n2, exponent) })
    }

    /// The same plane, met from the other side.
    #[must_use]
    pub const fn reversed(self) -> Self {
        Self { n1: self.n2, n2: self.n1 }
    }

    /// (n₂/n₁)²: what refraction does to the radiance of a ray, losses aside, since L/n² stays.
    pub fn radiance_ratio(self) -> f64 {
        let ratio = self.n2 / self.n1;
        ratio * ratio
    }

    /// cos θ₂ of the refracted ray, in [0, 1]; none at total reflection.
    pub fn refracted_cos(self, incidence: Incidence) -> Option<f64> {
        Some((self.passage(incidence)?.q / self.n2).min(1.0))
    }

    /// θ₂ of the refracted ray, radians in [0, π/2]; none at total reflection. Snell's law.
    ///
    /// ```
    /// use radiometry::interface::{Incidence, Interface};
    /// let theta = Interface::new(1.0, 2.0)?
    ///     .refracted_angle(Incidence::from_angle(std::f64::consts::FRAC_PI_2)?);
    /// // Grazing light enters at the critical angle: sin θ₂ = 1/2.
    /// assert!((theta.unwrap() - std::f64::consts::FRAC_PI_6).abs() < 1e-15);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn refracted_angle(self, incidence: Incidence) -> Option<f64> {
        Some(libm::atan2(self.n1 * incidence.sin(), self.passage(incidence)?.q))
    }

    /// θ₁ - θ₂, radians, positive towards the normal; none at total reflection.
    pub fn deviation(self, incidence: Incidence) -> Option<f64> {
        let passage = self.passage(incidence)?;
        let sin = incidence.sin();
        let along = self.n1.mul_add(sin * sin, incidence.cos() * passage.q);
        Some(libm::atan2(sin * passage.q_minus_p(), along))
    }

    /// The part of the power that s-polarised light (field across the plane of incidence) leaves
    /// in medium 1, in [0, 1]; 1 at total reflection.
    pub fn reflectance_s(self, incidence: Incidence) -> f64 {
        self.passage(incidence).map_or(1.0, |passage| square(passage.amplitude_s()))
    }

    /// The same for p-polarised light (field in the plane of incidence): 0 at Brewster's angle.
    pub fn reflectance_p(self, incidence: Incidence) -> f64 {
        self.passage(incidence).map_or(1.0, |passage| square(self.amplitude_p(incidence, passage)))
    }

    /// The same for unpolarised light: the mean of both.
    pub fn reflectance(self, incidence: Incidence) -> f64 {
        f64::midpoint(self.reflectance_s(incidence), self.reflectance_p(incidence))
    }

    /// The part of the power of s-polarised light that goes on in medium 2, in [0, 1]: 4pq/(p+q)²,
    /// which keeps its digits where 1 - R has none.
    pub fn transmittance_s(self, incidence: Incidence) -> f64 {
        let share = |passage: Passage| {
            let sum = passage.p + passage.q;
            if passage.is_open() {
                1.0
            } else if sum == 0.0 {
                // Grazing, beyond the range of doubles.
                0.0
            } else {
                4.0 * (passage.p / sum) * (passage.q / sum)
            }
        };
        self.passage(incidence).map_or(0.0, share).min(1.0)
    }

    /// The same for p-polarised light: 4 n₁ n₂² cos θ₁ q/(n₂² cos θ₁ + n₁ q)².
    pub fn transmittance_p(self, incidence: Incidence) -> f64 {
        let share = |passage: Passage| {
            let (inward, outward) = self.p_terms(passage);
            let sum = inward + outward;
            if passage.is_open() {
                1.0
            } else if sum == 0.0 {
                // Grazing, beyond the range of doubles.
                0.0
            } else {
                4.0 * (inward / sum) * (outward / sum)
            }
        };
        self.passage(incidence).map_or(0.0, share).min(1.0)
    }

    /// The same for unpolarised light: the mean of both.
    pub fn transmittance(self, incidence: Incidence) -> f64 {
        f64::midpoint(self.transmittance_s(incidence), self.transmittance_p(incidence))
    }

    /// The refracted ray's unit vector, from the incident `direction` of any length and a `normal`
    /// of any length that points into medium 1; none at total reflection. A direction that leads
    /// away from the interface is an error, and so are vectors without a direction.
    ///
    /// (n₁ d + (p - q) n)/n₂ with p - q = -D/(p + q).
    ///
    /// ```
    /// use glam::DVec3;
    /// use radiometry::interface::Interface;
    /// let glass = Interface::new(1.0, 1.5)?;
    /// let refracted = glass.refract(DVec3::new(0.6, 0.0, -0.8), DVec3::Z)?.unwrap();
    /// assert!((refracted.x - 0.4).abs() < 1e-15); // sin θ₂ = 0.6/1.5
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn refract(self, direction: DVec3, normal: DVec3) -> Result<Option<DVec3>, DomainError> {
        let incidence = Incidence::between(direction, normal)?;
        let unit = |vector: DVec3| normalised(vector).unwrap_or(DVec3::ZERO);
        Ok(self.passage(incidence).map(|passage| {
            let along = self.n1 * unit(direction) - passage.q_minus_p() * unit(normal);
            unit(along / self.n2)
        }))
    }

    /// None at total reflection. The sign of q² is decided in double-double arithmetic.
    fn passage(self, incidence: Incidence) -> Option<Passage> {
        let sum = pair(two_sum(self.n2, self.n1));
        let difference = pair(two_sum(self.n2, -self.n1)).mul(sum);
        let p = self.n1 * incidence.cos();
        if self.n1.to_bits() == self.n2.to_bits() {
            return Some(Passage { p, q: p, cos: incidence.cos(), difference: 0.0 });
        }
        let n1 = DoubleDouble::from_f64(self.n1);
        let q_squared = n1.mul(n1).mul(incidence.cos_squared()).add(difference).to_f64();
        let passage =
            |q: f64| Passage { p, q, cos: incidence.cos(), difference: difference.to_f64() };
        (q_squared >= 0.0).then(|| passage(q_squared.sqrt()))
    }

    /// n₂² cos θ₁ and n₁ q, the two terms of the p-polarised amplitudes.
    fn p_terms(self, passage: Passage) -> (f64, f64) {
        (self.n2 * self.n2 * passage.cos, self.n1 * passage.q)
    }

    /// rp = D (c²(n₁² + n₂²) - n₁²)/(n₂² c + n₁ q)², whose bracket is 0 at Brewster's angle.
    fn amplitude_p(self, incidence: Incidence, passage: Passage) -> f64 {
        if passage.is_open() {
            return 0.0;
        }
        let square = |n: f64| DoubleDouble::from_f64(n).mul(DoubleDouble::from_f64(n));
        let (n1_squared, n2_squared) = (square(self.n1), square(self.n2));
        let bracket = incidence.cos_squared().mul(n1_squared.add(n2_squared)).sub(n1_squared);
        let (inward, outward) = self.p_terms(passage);
        let sum = inward + outward;
        if sum == 0.0 {
            return 1.0;
        }
        (passage.difference / sum * (bracket.to_f64() / sum)).clamp(-1.0, 1.0)
    }
}

impl Passage {
    /// Equal indices: there is no interface, however the ray runs.
    fn is_open(self) -> bool {
        self.difference == 0.0
    }

    fn q_minus_p(self) -> f64 {
        let sum = self.p + self.q;
        if self.is_open() || sum == 0.0 { 0.0 } else { self.difference / sum }
    }

    /// rs = -D/(p + q)².
    fn amplitude_s(self) -> f64 {
        let sum = self.p + self.q;
        if self.is_open() {
            0.0
        } else if sum == 0.0 {
            // Grazing, beyond the range of doubles.
            1.0
        } else {
            (-(self.difference / sum) / sum).clamp(-1.0, 1.0)
        }
    }
}

/// The mirrored ray's unit vector, from the incident `direction` of any length and a `normal` of any
/// length on the side that the ray comes from: d - 2 (d·n) n. The solid angle and the cosine to the
/// normal stay, and so does the throughput of a beam. A direction that leads away from the
/// interface is an error, and so are vectors without a direction.
/// Who needs it: the page on throughput at a mirror.
///
/// ```
/// use glam::DVec3;
/// let mirrored = radiometry::interface::reflect(DVec3::new(0.6, 0.0, -0.8), DVec3::Z)?;
/// assert!((mirrored - DVec3::new(0.6, 0.0, 0.8)).length() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn reflect(direction: DVec3, normal: DVec3) -> Result<DVec3, DomainError> {
    Incidence::between(direction, normal)?;
    let unit = |vector: DVec3| normalised(vector).unwrap_or(DVec3::ZERO);
    let (direction, normal) = (unit(direction), unit(normal));
    Ok(unit(direction - 2.0 * direction.dot(normal) * normal))
}

fn pair((high, low): (f64, f64)) -> DoubleDouble {
    DoubleDouble::from_f64(high).add(DoubleDouble::from_f64(low))
}

fn square(x: f64) -> f64 {
    x * x
}
