//! Spherical harmonics, real and orthonormal: over the whole sphere under the solid angle, and
//! squeezed onto the hemisphere. They know nothing of samples or of fitting.
//!
//! No Condon-Shortley sign: Y₁ of m = 1 is positive towards +x. The associated Legendre function
//! is sinᵐ θ times a Gegenbauer polynomial scaled to 1 at the pole, whose recurrence
//! (k + 2λ) c₍ₖ₊₁₎ = 2(k + λ) x cₖ - k c₍ₖ₋₁₎, λ = m + ½ (DLMF 18.9.1), runs in double-double: at the
//! poles doubles would lose k² roundings. The norm is a product with an exponent of its own
//! (Fukushima 2012), since (l+m)! leaves the range at l = 86.

#![expect(
    clippy::inline_always,
    reason = "code for a kind of processor is what was inlined into it"
)]

use core::f64::consts::PI;

use glam::DVec3;

use crate::domain::{DomainError, within};
use crate::error_free::{Abreast, DoubleDouble, cosine};

/// Degrees beyond this are refused: a double has no digit left of what the recurrence would need.
const DEGREE_MAX: usize = 10_000;

/// The orthonormal amplitude √((2l+1)/(4π) · (l-m)!/(l+m)!) Pₗᵐ(cos θ), sr^-½, for 0 <= m <= l and
/// θ in [0, π]: the harmonic without its azimuth. Good to 1e-13 of itself at l = 200; below the
/// range of a double it is 0.
/// Who needs it: the page on fields over the whole sphere; `gonio calc`.
///
/// ```
/// use radiometry::basis::harmonics::amplitude;
/// // l = 2, m = 1: √(15/8π) sin θ cos θ.
/// let pi = std::f64::consts::PI;
/// let expected = (15.0 / (8.0 * pi)).sqrt() * 1f64.sin() * 1f64.cos();
/// assert!((amplitude(2, 1, 1.0)? - expected).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn amplitude(l: usize, m: usize, theta_rad: f64) -> Result<f64, DomainError> {
    let theta = within("theta_rad", theta_rad, 0.0, PI)?;
    within("l", l as f64, 0.0, DEGREE_MAX as f64)?;
    within("m", m as f64, 0.0, l as f64)?;
    let mut gegenbauer = Gegenbauer::new(m, cosine(theta));
    for _ in m..l {
        gegenbauer.advance();
    }
    let (scale, exponent) = norm(l, m, libm::sin(theta));
    let value = gegenbauer.value.to_f64();
    if value == 0.0 {
        return Ok(0.0);
    }
    let (mantissa, more) = libm::frexp(value);
    Ok(libm::scalbn(scale * mantissa, exponent + more))
}

/// All real harmonics up to a degree, orthonormal over the sphere under the solid angle:
/// index l(l+1)+m, with √2 cos mφ for m > 0 and √2 sin |m|φ for m < 0. The first is 1/√(4π).
/// Who needs it: the page on fields over the whole sphere (all light leaving an object).
#[derive(Debug, Clone, PartialEq)]
pub struct SphericalHarmonics {
    degree: usize,
    /// From m = 0 upwards.
    orders: Vec<Orders>,
}

impl SphericalHarmonics {
    /// All of them up to a degree in 0 to 200.
    pub fn new(degree: usize) -> Result<Self, DomainError> {
        within("degree", degree as f64, 0.0, 200.0)?;
        let orders = (0..=degree).step_by(LANES).map(|first| Orders::new(first, degree));
        Ok(Self { degree, orders: orders.collect() })
    }

    /// The highest degree.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// How many there are: (degree+1)².
    #[expect(clippy::len_without_is_empty, reason = "there is always the constant")]
    pub fn len(&self) -> usize {
        (self.degree + 1) * (self.degree + 1)
    }

    /// All values, sr^-½, at a unit vector, into `values` (of length [`len`](Self::len), or it
    /// panics).
    ///
    /// ```
    /// let harmonics = radiometry::basis::SphericalHarmonics::new(1)?;
    /// let mut values = [0.0; 4];
    /// harmonics.evaluate(glam::DVec3::X, &mut values);
    /// let amplitude = (3.0 / (4.0 * std::f64::consts::PI)).sqrt();
    /// assert_eq!((values[1], values[2]), (0.0, 0.0)); // y, z
    /// assert!((values[3] - amplitude).abs() < 1e-16); // x
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn evaluate(&self, direction: DVec3, values: &mut [f64]) {
        assert_eq!(values.len(), self.len(), "one value a harmonic");
        // The widest instructions that this processor has: the same bits, up to thirty times sooner.
        pulp::Arch::new().dispatch(Evaluation { harmonics: self, direction, values });
    }
}

/// All values in one direction, in code that is compiled for each kind of processor.
struct Evaluation<'a> {
    harmonics: &'a SphericalHarmonics,
    direction: DVec3,
    values: &'a mut [f64],
}

impl pulp::NullaryFnOnce for Evaluation<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { harmonics, direction, values } = self;
        // (x + iy)^m = sinᵐ θ (cos mφ + i sin mφ): no angle needed, exact zeros at the pole.
        let (mut re, mut im) = (1.0, 0.0);
        for orders in &harmonics.orders {
            let (mut cos, mut sin) = ([0.0; LANES], [0.0; LANES]);
            for i in 0..LANES {
                (cos[i], sin[i]) = (re, im);
                (re, im) =
                    (re * direction.x - im * direction.y, re * direction.y + im * direction.x);
            }
            orders.evaluate(direction.z, &cos, &sin, values);
        }
    }
}

/// As many orders m as one instruction takes side by side: from one degree above m to the next all
/// take the same steps.
const LANES: usize = 8;

/// Neighbouring orders: how each one's recurrence goes on, and its norms.
#[derive(Debug, Clone, PartialEq)]
struct Orders {
    /// The lowest m.
    first: usize,
    /// By k = l - m.
    steps: Vec<Step>,
}

#[derive(Debug, Clone, PartialEq)]
struct Step {
    /// √2 (1 of m = 0) √((2l+1)/(4π)) Π √((l+i)(l-i+1))/(2i); 0 beyond the highest degree.
    norm: [f64; LANES],
    /// k/(k + 2λ), to twice a double's digits.
    ratio: Abreast<LANES>,
}

impl Orders {
    fn new(first: usize, degree: usize) -> Self {
        let step = |k: usize| {
            let norm_of = |m: usize| {
                let l = k + m;
                if l > degree {
                    return 0.0;
                }
                let (scale, exponent) = norm(l, m, 1.0);
                let azimuth = if m > 0 { core::f64::consts::SQRT_2 } else { 1.0 };
                azimuth * libm::scalbn(scale, exponent)
            };
            let ratio_of = |m: usize| DoubleDouble::ratio(k as f64, (k + 2 * m + 1) as f64);
            let orders: [usize; LANES] = core::array::from_fn(|i| first + i);
            Step { norm: orders.map(norm_of), ratio: Abreast::of(orders.map(ratio_of)) }
        };
        Self { first, steps: (0..=degree - first).map(step).collect() }
    }

    /// The values of these orders, whose azimuths are given.
    #[inline(always)]
    fn evaluate(&self, z: f64, cos: &[f64; LANES], sin: &[f64; LANES], values: &mut [f64]) {
        let mut value = Abreast::of([DoubleDouble::from_f64(1.0); LANES]);
        let mut before = Abreast::of([DoubleDouble::from_f64(0.0); LANES]);
        let degree = self.first + self.steps.len() - 1;
        for (k, step) in self.steps.iter().enumerate() {
            let (mut even, mut odd) = ([0.0; LANES], [0.0; LANES]);
            for i in 0..LANES {
                let amplitude = step.norm[i] * value.get(i).to_f64();
                (even[i], odd[i]) = (amplitude * cos[i], amplitude * sin[i]);
            }
            for i in 0..LANES.min(degree + 1 - self.first - k) {
                let (m, l) = (self.first + i, self.first + i + k);
                if m > 0 {
                    values[l * (l + 1) - m] = odd[i];
                }
                values[l * (l + 1) + m] = even[i];
            }
            for i in 0..LANES {
                let last = value.get(i);
                value.set(i, advanced(last, before.get(i), z, step.ratio.get(i)));
                before.set(i, last);
            }
        }
    }
}

/// c₍ₖ₊₁₎ of cₖ and c₍ₖ₋₁₎, scaled to 1 at x = 1: x cₖ + (x cₖ - c₍ₖ₋₁₎) k/(k + 2λ), the recurrence
/// without a division.
#[inline(always)]
fn advanced(
    value: DoubleDouble,
    before: DoubleDouble,
    x: f64,
    ratio: DoubleDouble,
) -> DoubleDouble {
    let ahead = value.times(x);
    ahead.add(ahead.sub(before).mul(ratio))
}

/// All real hemispherical harmonics up to a degree, orthonormal over the hemisphere under the
/// solid angle: the spherical ones at cos θ' = 2 cos θ - 1, times √2 (Gautron, Křivánek, Pattanaik
/// and Bouatouch 2004). Smooth inside, but every m > 0 has a kink of its slope at the pole's chart.
/// Who needs it: the page on bases over the hemisphere, beside Zernike's.
#[derive(Debug, Clone, PartialEq)]
pub struct HemisphericalHarmonics(SphericalHarmonics);

impl HemisphericalHarmonics {
    /// All of them up to a degree in 0 to 200.
    pub fn new(degree: usize) -> Result<Self, DomainError> {
        Ok(Self(SphericalHarmonics::new(degree)?))
    }

    /// How many there are: (degree+1)².
    #[expect(clippy::len_without_is_empty, reason = "there is always the constant")]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// All values, sr^-½, at a unit vector with z in [0, 1], into `values` (of length
    /// [`len`](Self::len), or it panics).
    ///
    /// ```
    /// let harmonics = radiometry::basis::HemisphericalHarmonics::new(0)?;
    /// let mut values = [0.0];
    /// harmonics.evaluate(glam::DVec3::Z, &mut values);
    /// assert!((values[0] - 1.0 / (2.0 * std::f64::consts::PI).sqrt()).abs() < 1e-16);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn evaluate(&self, direction: DVec3, values: &mut [f64]) {
        // sin θ' = 2 √(z(1-z)), and 1 - z = sin² θ/(1 + z).
        let z = direction.z.clamp(0.0, 1.0);
        let stretch = 2.0 * (z / (1.0 + z)).sqrt();
        let squeezed = DVec3::new(stretch * direction.x, stretch * direction.y, 2.0 * z - 1.0);
        self.0.evaluate(squeezed, values);
        for value in values {
            *value *= core::f64::consts::SQRT_2;
        }
    }
}

/// cₖ at x and cₖ₋₁, scaled to 1 at x = 1.
struct Gegenbauer {
    x: DoubleDouble,
    k: f64,
    twice_lambda: f64,
    value: DoubleDouble,
    before: DoubleDouble,
}

impl Gegenbauer {
    fn new(m: usize, x: DoubleDouble) -> Self {
        let (value, before) = (DoubleDouble::from_f64(1.0), DoubleDouble::from_f64(0.0));
        Self { x, k: 0.0, twice_lambda: 2.0f64.mul_add(m as f64, 1.0), value, before }
    }

    fn advance(&mut self) {
        let number = DoubleDouble::from_f64;
        let ahead = number(2.0f64.mul_add(self.k, self.twice_lambda)).mul(self.x).mul(self.value);
        let next = ahead.sub(number(self.k).mul(self.before));
        self.before = self.value;
        self.value = next.div(number(self.k + self.twice_lambda));
        self.k += 1.0;
    }
}

/// √((2l+1)/(4π)) Π √((l+i)(l-i+1)) sin θ/(2i) over i = 1 to m, as mantissa and exponent.
fn norm(l: usize, m: usize, sin: f64) -> (f64, i32) {
    let degree = l as f64;
    let (mut scale, mut exponent) = (((2.0 * degree + 1.0) / (4.0 * PI)).sqrt(), 0);
    for i in 1..=m {
        let i = i as f64;
        let factor = ((degree + i) * (degree - i + 1.0)).sqrt() / (2.0 * i);
        let (mantissa, more) = libm::frexp(scale * factor * sin);
        if mantissa == 0.0 {
            return (0.0, 0);
        }
        (scale, exponent) = (mantissa, exponent + more);
    }
    (scale, exponent)
}
