//! Zernike polynomials on the Nusselt disk: the hemisphere of directions seen along its axis,
//! r = sin θ, where the disk's area element is the projected solid angle, r dr dφ = cos θ dω.
//!
//! They are orthonormal under the projected solid angle, so that the radiant exitance of a field
//! with coefficients c is c₀ √π and its mean square is Σ c². In x = sin θ cos φ, y = sin θ sin φ
//! they are polynomials: smooth over the pole. What is fitted with them is not known here.

#![expect(
    clippy::inline_always,
    reason = "code for a kind of processor is what was inlined into it"
)]

use core::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

use super::jacobi::{self, Recurrence, Step};
use crate::direction;
use crate::domain::{DomainError, within};

/// All Zernike polynomials up to a degree, in the order of ANSI Z80.28: j = (n(n+2)+m)/2, with
/// cos mφ for m >= 0, sin |m|φ for m < 0.
/// Who needs it: the fit, whose angular basis it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Zernike {
    degree: usize,
    /// For each |m|, the radial polynomials n = |m|, |m|+2, ...
    families: Vec<Vec<Member>>,
}

/// One radial polynomial n of a family |m|, which serves the two polynomials (n, m) and (n, -m).
#[derive(Debug, Clone, Copy, PartialEq)]
struct Member {
    cos_index: usize,
    sin_index: usize,
    norm: f64,
    /// To the next member.
    step: Step,
}

impl Zernike {
    /// All of them up to a degree; 2e-14 of the largest value at degree 60, 4e-13 at 200.
    pub fn new(degree: usize) -> Self {
        let families = (0..=degree).map(|m| family(m, degree)).collect();
        Self { degree, families }
    }

    /// The highest degree n.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// How many there are: (n+1)(n+2)/2.
    #[expect(clippy::len_without_is_empty, reason = "there is always the constant")]
    pub fn len(&self) -> usize {
        (self.degree + 1) * (self.degree + 2) / 2
    }

    /// All values, sr^-½, at the direction (θ, φ), into `values` (of length [`len`](Self::len), or it
    /// panics). θ in [0, π/2]; beyond the horizon the value is that of the ray mirrored in it.
    ///
    /// ```
    /// let zernike = radiometry::basis::Zernike::new(1);
    /// let mut values = [0.0; 3];
    /// zernike.evaluate(0.3, 0.0, &mut values);
    /// let pi = std::f64::consts::PI;
    /// assert!((values[0] - 1.0 / pi.sqrt()).abs() < 1e-16);
    /// assert_eq!(values[1], 0.0); // n = 1, m = -1: 2/√π sin θ sin φ
    /// assert!((values[2] - 2.0 / pi.sqrt() * 0.3f64.sin()).abs() < 1e-15);
    /// ```
    pub fn evaluate(&self, theta: f64, phi: f64, values: &mut [f64]) {
        self.evaluate_direction(direction::unit(theta, phi), values);
    }

    /// As [`evaluate`](Self::evaluate), at a unit vector.
    pub fn evaluate_direction(&self, direction: DVec3, values: &mut [f64]) {
        assert_eq!(values.len(), self.len(), "one value a polynomial");
        // With fused multiply-adds where the processor has them: the same bits, sooner.
        pulp::Arch::new().dispatch(Evaluation { zernike: self, direction, values });
    }

    /// The integral of each polynomial over the cone θ <= `theta_max`, under the projected solid
    /// angle, √sr; only those with m = 0 have one. Into `values` (of length [`len`](Self::len), or it
    /// panics). At π/2: √π for the constant, 0 for all others.
    ///
    /// Source: ∫ Pₖ dx = (Pₖ₊₁ - Pₖ₋₁)/(2k+1) with x = 2r² - 1.
    ///
    /// ```
    /// let zernike = radiometry::basis::Zernike::new(2);
    /// let mut values = [0.0; 6];
    /// zernike.integrals_within(std::f64::consts::FRAC_PI_6, &mut values)?;
    /// // Z₀ = 1/√π over π sin² 30°; nothing of what goes round with φ.
    /// assert!((values[0] - std::f64::consts::PI.sqrt() / 4.0).abs() < 1e-15);
    /// assert_eq!(values[1], 0.0);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn integrals_within(&self, theta_max: f64, values: &mut [f64]) -> Result<(), DomainError> {
        assert_eq!(values.len(), self.len(), "one value a polynomial");
        let theta_max = within("theta_max_rad", theta_max, 0.0, FRAC_PI_2)?;
        values.fill(0.0);
        let (sin, cos) = libm::sincos(theta_max);
        // The double nearest π/2 has a cosine of 6e-17: its square is as good as nothing.
        let mut radial = Recurrence::new(2.0 * cos * cos);
        for (k, member) in self.families[0].iter().enumerate() {
            let to_here = radial.difference();
            radial.advance(member.step);
            let over_disk = if k == 0 {
                PI * sin * sin
            } else {
                PI / 2.0 * (radial.difference() + to_here) / 2.0f64.mul_add(k as f64, 1.0)
            };
            values[member.cos_index] = member.norm * over_disk;
        }
        Ok(())
    }
}

/// All values in one direction, in code that is compiled for each kind of processor.
struct Evaluation<'a> {
    zernike: &'a Zernike,
    direction: DVec3,
    values: &'a mut [f64],
}

impl pulp::NullaryFnOnce for Evaluation<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { zernike, direction, values } = self;
        let one_minus_x = 2.0 * direction.z * direction.z;
        // (x + iy)^m = r^m (cos mφ + i sin mφ): exact zeros at the pole, no angle needed.
        let (mut re, mut im) = (1.0, 0.0);
        for (m, family) in zernike.families.iter().enumerate() {
            // Those of m = 0 are Legendre polynomials, even or odd in x: near the pole, where x is -1,
            // they are as exact as at the rim. For m > 0 the power of r takes care of that.
            let is_mirrored = m == 0 && one_minus_x > 1.0;
            let one_minus_x =
                if is_mirrored { 2.0 * direction.truncate().length_squared() } else { one_minus_x };
            let mut radial = Recurrence::new(one_minus_x);
            let mut sign = 1.0;
            for member in family {
                let amplitude = sign * member.norm * radial.value();
                sign = if is_mirrored { -sign } else { sign };
                // For m = 0 both are one place, and the cosine is written last.
                values[member.sin_index] = amplitude * im;
                values[member.cos_index] = amplitude * re;
                radial.advance(member.step);
            }
            (re, im) = (re * direction.x - im * direction.y, re * direction.y + im * direction.x);
        }
    }
}

/// (n, m) of the polynomial at place `j` in ANSI order.
/// Who needs it: the fit, to name its coefficients.
pub fn ansi_order(j: usize) -> (usize, i64) {
    // At most one off either way, whatever the square root's rounding.
    let mut n = (2 * j + 1).isqrt();
    while n * (n + 1) / 2 > j {
        n -= 1;
    }
    let place = j - n * (n + 1) / 2;
    let signed = |value: usize| i64::try_from(value).unwrap_or(i64::MAX);
    (n, 2 * signed(place) - signed(n))
}

/// The radial polynomial Rₙᵐ(r) with R(1) = 1, r in [0, 1]; n - m even and not negative, or 0 as
/// by definition.
/// Who needs it: the basis's tests and `gonio calc`.
///
/// ```
/// assert_eq!(radiometry::basis::zernike::radial(4, 2, 0.5)?, -0.5);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn radial(n: usize, m: usize, r: f64) -> Result<f64, DomainError> {
    let r = within("r", r, 0.0, 1.0)?;
    if m > n || (n - m) % 2 == 1 {
        return Ok(0.0);
    }
    let one_minus_x = 2.0 * (1.0 - r) * (1.0 + r);
    // A Legendre polynomial, even or odd in x = 2r² - 1: as exact at the pole as at the rim.
    if m == 0 && one_minus_x > 1.0 {
        let sign = if n.is_multiple_of(4) { 1.0 } else { -1.0 };
        return Ok(sign * jacobi::polynomial(n / 2, 0, 2.0 * r * r));
    }
    Ok(libm::pow(r, m as f64) * jacobi::polynomial((n - m) / 2, m, one_minus_x))
}

fn family(m: usize, degree: usize) -> Vec<Member> {
    (m..=degree)
        .step_by(2)
        .enumerate()
        .map(|(k, n)| {
            let centre = n * (n + 2);
            let both_signs = if m == 0 { 1.0 } else { 2.0 };
            Member {
                cos_index: usize::midpoint(centre, m),
                sin_index: (centre - m) / 2,
                norm: (both_signs * (n as f64 + 1.0) / PI).sqrt(),
                step: jacobi::step(k, m),
            }
        })
        .collect()
}
