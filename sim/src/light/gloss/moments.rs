//! What of a lobe cosⁿα lies beyond a cone about its axis: two integrals over α, one in closed form and
//! one from a table. It knows an exponent and nothing of surfaces or sources.

use core::f64::consts::FRAC_PI_2;

use radiometry::quadrature::gauss_legendre;

/// Beyond this part of its peak a lobe is dark.
const DARK: f64 = 1e-11;
/// Steps of the table for each width of the lobe.
const STEPS: f64 = 64.0;
/// Points of the rule between two entries.
const POINTS: usize = 8;
/// Where cos α is less, nothing is left.
const LEVEL: f64 = 1e-8;

/// Of one lobe.
#[derive(Debug)]
pub(super) struct Moments {
    exponent: f64,
    /// Where it goes dark, radians.
    edge: f64,
    step: f64,
    /// ∫ cosⁿ sin² from α to 90° over cosⁿ⁺¹α, and its slope, at even steps of α.
    entries: Vec<(f64, f64)>,
    /// ∫ cosⁿ sin² from 0 to 90°.
    whole: f64,
}

impl Moments {
    /// Of cosⁿα.
    pub(super) fn new(exponent: f64) -> Self {
        let n = exponent;
        let cosine = |part: f64| libm::acos(libm::pow(part, 1.0 / n.max(f64::MIN_POSITIVE)));
        let edge = cosine(DARK).min(FRAC_PI_2);
        // Farther, so that what lies beyond the table's end is counted too.
        let end = cosine(DARK * DARK).min(FRAC_PI_2);
        let steps = libm::ceil(end * STEPS / Self::width_of(n)).max(1.0);
        let step = end / steps;
        let rule = gauss_legendre(POINTS);
        let mut entries = Vec::new();
        let (mut beyond, mut at) = (0.0, steps);
        while at >= 0.0 {
            let (sin, cos) = libm::sincos(step * at);
            entries.push(if cos > LEVEL {
                let ratio = beyond / libm::pow(cos, n + 1.0);
                (ratio, (n + 1.0) * ratio * sin / cos - sin * sin / cos)
            } else {
                (1.0 / (n + 1.0), 0.0)
            });
            let parts = rule.iter().map(|(node, weight)| {
                let (sin, cos) = libm::sincos(step * (at - 0.5 + 0.5 * node));
                weight * 0.5 * step * libm::pow(cos.max(0.0), n) * sin * sin
            });
            if at > 0.0 {
                beyond += parts.sum::<f64>();
            }
            at -= 1.0;
        }
        entries.reverse();
        Self { exponent, edge, step, entries, whole: beyond }
    }

    fn width_of(exponent: f64) -> f64 {
        1.0 / libm::sqrt(exponent + 2.0)
    }

    /// n.
    pub(super) const fn exponent(&self) -> f64 {
        self.exponent
    }

    /// How wide the lobe is, radians.
    pub(super) fn width(&self) -> f64 {
        Self::width_of(self.exponent)
    }

    /// Where it goes dark, radians.
    pub(super) const fn edge(&self) -> f64 {
        self.edge
    }

    /// ∫ cosⁿ⁺¹ sin and ∫ cosⁿ sin² from an angle to 90°, of its sine and cosine.
    pub(super) fn beyond(&self, sin: f64, cos: f64) -> (f64, f64) {
        if cos < LEVEL {
            return (0.0, 0.0);
        }
        let power = libm::exp((self.exponent + 2.0) * log_cos(sin, cos));
        (power / (self.exponent + 2.0), power / cos * self.ratio(libm::atan2(sin, cos)))
    }

    /// The same from 0 to an angle.
    pub(super) fn within(&self, sin: f64, cos: f64) -> (f64, f64) {
        let n = self.exponent;
        if cos < LEVEL {
            return (1.0 / (n + 2.0), self.whole);
        }
        let less = libm::expm1((n + 2.0) * log_cos(sin, cos));
        let beyond = (1.0 + less) / cos * self.ratio(libm::atan2(sin, cos));
        (-less / (n + 2.0), self.whole - beyond)
    }

    /// Between two entries a cubic.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within the table
    fn ratio(&self, angle: f64) -> f64 {
        let at = angle / self.step;
        let i = (at as usize).min(self.entries.len() - 2);
        let t = (at - i as f64).min(1.0);
        let ((a, slope_a), (b, slope_b)) = (self.entries[i], self.entries[i + 1]);
        let (slope_a, slope_b) = (slope_a * self.step, slope_b * self.step);
        let (c, d) = (3.0 * (b - a) - 2.0 * slope_a - slope_b, 2.0 * (a - b) + slope_a + slope_b);
        a + t * (slope_a + t * (c + t * d))
    }
}

/// ln cos α, exact to the last digits near 0 and near 90°.
fn log_cos(sin: f64, cos: f64) -> f64 {
    if cos > 0.7 { 0.5 * libm::log1p(-sin * sin) } else { libm::log(cos) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_integrals_are_what_a_fine_rule_says() {
        for n in [0.0, 1.0, 2.5, 12.0, 400.0, 20_000.0] {
            let moments = Moments::new(n);
            let scale = moments.width();
            for part in [0.01, 0.3, 1.0, 2.7, 5.0] {
                let angle: f64 = (part * scale).min(1.5);
                let within = moments.within(angle.sin(), angle.cos());
                let beyond = moments.beyond(angle.sin(), angle.cos());
                let (mut cone, mut aside) = (0.0, 0.0);
                let steps = 200;
                for i in 0..steps {
                    for (node, weight) in gauss_legendre(5) {
                        let at = angle * (f64::from(i) + 0.5 + 0.5 * node) / f64::from(steps);
                        let weight = weight * 0.5 * angle / f64::from(steps);
                        cone += weight * at.cos().powf(n + 1.0) * at.sin();
                        aside += weight * at.cos().powf(n) * at.sin().powi(2);
                    }
                }
                assert!((within.0 / cone - 1.0).abs() < 1e-12, "{n} {part}: {within:?} {cone}");
                let off = (within.1 - aside).abs();
                assert!(off < 2e-8 * moments.whole, "{n} {part}: {within:?} {aside}");
                let whole = (within.0 + beyond.0) * (n + 2.0);
                assert!((whole - 1.0).abs() < 1e-12, "{n} {part}: {whole}");
                let whole = (within.1 + beyond.1) / moments.whole;
                assert!((whole - 1.0).abs() < 1e-12, "{n} {part}: {whole}");
            }
        }
    }
}
