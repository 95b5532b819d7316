//! A batwing: brightest on a ring around the normal, as the luminaires that light a wide floor
//! evenly.
//!
//! L(θ) = v + (1 - v) s(θ), s(θ) = sin²ᵐθ cosᵏθ / N, with k = 2m / tan²θ₀ and N such that s(θ₀) = 1:
//! exactly 1 at the ring θ₀ and v, the valley, on the normal and at the horizon. The whole number m
//! makes the ring narrow.

use core::f64::consts::{FRAC_PI_2, PI};

/// The narrowest ring.
pub const SHARPNESS_MAX: u32 = 64;

/// Intervals of θ that a bound looks at one by one.
const PIECES: u32 = 2048;

/// A law that is brightest on a ring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Batwing {
    peak_theta_rad: f64,
    valley: f64,
    /// 2m.
    sine_power: f64,
    /// k.
    cosine_power: f64,
    /// ln N.
    log_norm: f64,
    sharpness: u32,
}

impl Batwing {
    /// The ring's angle, in (0, π/2); the valley, in [0, 1]; m, from 1 to [`SHARPNESS_MAX`].
    /// `None` outside.
    pub fn new(peak_theta_rad: f64, valley: f64, sharpness: u32) -> Option<Self> {
        let is_sound = peak_theta_rad > 1e-3
            && peak_theta_rad < FRAC_PI_2 - 1e-3
            && (0.0..=1.0).contains(&valley)
            && (1..=SHARPNESS_MAX).contains(&sharpness);
        let (sin, cos) = libm::sincos(peak_theta_rad);
        let sine_power = 2.0 * f64::from(sharpness);
        let cosine_power = sine_power * (cos / sin) * (cos / sin);
        let log_norm = sine_power * libm::log(sin) + cosine_power * libm::log(cos);
        let batwing =
            Self { peak_theta_rad, valley, sine_power, cosine_power, log_norm, sharpness };
        is_sound.then_some(batwing)
    }

    /// Where it is brightest, radians.
    pub fn peak_theta_rad(&self) -> f64 {
        self.peak_theta_rad
    }

    /// At the angle with this cosine, in (0, 1].
    pub(super) fn value(&self, cos: f64) -> f64 {
        self.valley + (1.0 - self.valley) * self.wing((1.0 - cos) * (1.0 + cos), cos)
    }

    /// s.
    fn wing(&self, sin_square: f64, cos: f64) -> f64 {
        if sin_square <= 0.0 || cos <= 0.0 {
            return 0.0;
        }
        let log = f64::from(self.sharpness) * libm::log(sin_square);
        libm::exp(log + self.cosine_power * libm::log(cos) - self.log_norm)
    }

    /// π v sin²θ + (1 - v) π/N ∫ tᵐ (1 - t)^(k/2) dt for t = sin² up to sin²θ: an incomplete beta
    /// function.
    pub(super) fn exitance_within(&self, theta_rad: f64) -> f64 {
        let sin = libm::sin(theta_rad);
        let flat = PI * sin * sin * self.valley;
        let beta = self.ring_within(sin * sin, theta_rad);
        flat + (1.0 - self.valley) * PI * beta
    }

    /// B(t; m + 1, k/2 + 1) / N by its series of positive terms, or that of its complement, whichever
    /// converges the faster (Abramowitz and Stegun 1964, 26.5.4).
    fn ring_within(&self, t: f64, theta_rad: f64) -> f64 {
        let (a, b) = (f64::from(self.sharpness) + 1.0, self.cosine_power / 2.0 + 1.0);
        if t <= (a + 1.0) / (a + b + 2.0) {
            return self.series(t, 1.0 - t, a, b);
        }
        let cos = libm::cos(theta_rad);
        // B(1; a, b) = (a - 1)! / (b (b + 1) ... (b + a - 1)).
        let mut log_whole = -libm::log(b + a - 1.0);
        for i in 1..=self.sharpness {
            log_whole += libm::log(f64::from(i)) - libm::log(b + f64::from(i) - 1.0);
        }
        let whole = libm::exp(log_whole - self.log_norm);
        whole - self.series(cos * cos, 1.0 - cos * cos, b, a)
    }

    /// x^a (1-x)^b / (a N) Σ (a+b)ₙ/(a+1)ₙ xⁿ.
    fn series(&self, x: f64, rest: f64, a: f64, b: f64) -> f64 {
        if x <= 0.0 {
            return 0.0;
        }
        let (mut term, mut sum, mut i) = (1.0, 1.0, 0.0);
        while term > f64::EPSILON * sum / 8.0 && i < 1e6 {
            term *= x * (a + b + i) / (a + 1.0 + i);
            sum += term;
            i += 1.0;
        }
        let log_rest = if rest > 0.0 { b * libm::log(rest) } else { 0.0 };
        libm::exp(a * libm::log(x) + log_rest - self.log_norm) * sum / a
    }

    pub(super) fn peak_within(&self, theta_max_rad: f64) -> (f64, f64, f64) {
        let theta = self.peak_theta_rad.min(theta_max_rad);
        if theta >= self.peak_theta_rad {
            return (1.0, theta, 0.0);
        }
        (self.value(libm::cos(theta)), theta, 0.0)
    }

    /// |s'| over [0, θ]: of 2m sin²ᵐ⁻¹ cosᵏ⁺¹ - k sin²ᵐ⁺¹ cosᵏ⁻¹.
    pub(super) fn slope_bound(&self, theta_rad: f64) -> f64 {
        let (p, k) = (self.sine_power, self.cosine_power);
        let terms = [(p, p - 1.0, k + 1.0), (-k, p + 1.0, k - 1.0)];
        (1.0 - self.valley) * self.bound(&terms, theta_rad)
    }

    /// |s''| and |s' cot θ|, the curvature across.
    pub(super) fn curvature_bound(&self, theta_rad: f64) -> f64 {
        let (p, k) = (self.sine_power, self.cosine_power);
        let along = [
            (p * (p - 1.0), p - 2.0, k + 2.0),
            (-(p * (k + 1.0) + k * (p + 1.0)), p, k),
            (k * (k - 1.0), p + 2.0, k - 2.0),
        ];
        let across = [(p, p - 2.0, k + 2.0), (-k, p, k)];
        let larger = self.bound(&along, theta_rad).max(self.bound(&across, theta_rad));
        (1.0 - self.valley) * larger
    }

    /// A bound over [0, θ] of |Σ c sinᵃ cosᵇ| / N: interval by interval, since each power rises or
    /// falls throughout.
    fn bound(&self, terms: &[(f64, f64, f64)], theta_rad: f64) -> f64 {
        let mut bound: f64 = 0.0;
        let step = theta_rad / f64::from(PIECES);
        for i in 0..PIECES {
            let (low, high) = (f64::from(i) * step, f64::from(i + 1) * step);
            let ends = [libm::sincos(low), libm::sincos(high)];
            let (mut least, mut most) = (0.0, 0.0);
            for (factor, a, b) in terms {
                let sines = ends.map(|(sin, _)| power(sin, *a));
                let cosines = ends.map(|(_, cos)| power(cos.max(0.0), *b));
                let small = sines[0].min(sines[1]) * cosines[0].min(cosines[1]);
                let large = sines[0].max(sines[1]) * cosines[0].max(cosines[1]);
                let (x, y) = (factor * small, factor * large);
                least += x.min(y);
                most += x.max(y);
            }
            bound = bound.max(-least).max(most);
        }
        if bound.is_nan() { f64::INFINITY } else { bound * libm::exp(-self.log_norm) }
    }
}

fn power(base: f64, exponent: f64) -> f64 {
    if exponent == 0.0 { 1.0 } else { libm::pow(base, exponent) }
}
