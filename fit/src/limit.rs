//! Readings that say no more than "at least this much": a saturated one. Knows one reading at a
//! time, its limit and what the fit expects of it.
//!
//! Of a limit y at the level l with standard deviation σ the log-likelihood is log Φ(-α), α = (y - l)/σ
//! (Tobin 1958, Econometrica 26, 24; Amemiya 1984, J. Econometrics 24, 3). It is concave in l, so that
//! Newton's method ends at its one maximum: each step is least squares with the working value
//! l + σ λ/d of variance σ²/d, λ = φ(α)/Φ(-α) being the slope and d = λ (λ - α) the curvature. A
//! limit far below the level weighs nothing (d = 0); one far above it counts as a reading of that value.

/// What a limit amounts to at a level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Working {
    /// What it is taken to have read.
    pub(crate) value: f64,
    /// Its variance; infinite where the limit says nothing.
    pub(crate) variance: f64,
}

/// At a level and the variance that a reading there has.
pub(crate) fn working(limit: f64, level: f64, variance: f64) -> Working {
    let sigma = variance.sqrt();
    let alpha = (limit - level) / sigma;
    let slope = hazard(alpha);
    let curvature = curvature(alpha, slope);
    if curvature < CURVATURE_MIN {
        return Working { value: level, variance: f64::INFINITY };
    }
    Working { value: level + sigma * slope / curvature, variance: variance / curvature }
}

/// λ (λ - α). Far out λ and α differ in their last digits alone: by the series of both there, to 1e-6.
fn curvature(alpha: f64, slope: f64) -> f64 {
    if alpha > FAR {
        let over = 1.0 / (alpha * alpha);
        return 1.0 - over * (1.0 - 6.0 * over * (1.0 - 50.0 / 6.0 * over));
    }
    (slope * (slope - alpha)).clamp(0.0, 1.0)
}

/// φ(α)/Φ(-α), to 1e-14 relative up to 25, beyond by its asymptotic series (Abramowitz and Stegun
/// 26.2.12) to 1e-9.
fn hazard(alpha: f64) -> f64 {
    if alpha > FAR {
        let over = 1.0 / (alpha * alpha);
        return alpha / (1.0 - over * (1.0 - 3.0 * over * (1.0 - 5.0 * over)));
    }
    let density = libm::exp(-0.5 * alpha * alpha) / (2.0 * core::f64::consts::PI).sqrt();
    let tail = 0.5 * libm::erfc(alpha * core::f64::consts::FRAC_1_SQRT_2);
    density / tail
}

/// From here on series stand for the tails of the normal distribution.
const FAR: f64 = 25.0;
/// Less information than this, as a part of that of a reading, is none: limits eight standard
/// deviations below the level.
const CURVATURE_MIN: f64 = 1e-12;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_far_below_says_nothing_and_one_far_above_is_a_reading() {
        assert!(working(1.0, 10.0, 1.0).variance.is_infinite());
        let far = working(110.0, 10.0, 1.0);
        assert!((far.value - 110.0).abs() < 0.02 && (far.variance - 1.0).abs() < 1e-3, "{far:?}");
        // At the level itself: λ = √(2/π), d = 2/π.
        let at = working(10.0, 10.0, 4.0);
        let slope = (2.0 / core::f64::consts::PI).sqrt();
        assert!((at.value - (10.0 + 2.0 / slope)).abs() < 1e-12);
        assert!((at.variance - 4.0 / (slope * slope)).abs() < 1e-12);
    }

    #[test]
    fn a_limit_however_far_above_is_a_reading() {
        for alpha in [25.0 - 1e-9, 25.0 + 1e-9, 1e3, 1e7, 1e9, 1e12, 1e150] {
            let far = working(alpha, 0.0, 1.0);
            // λ/d is α + 2/α, and the variance 1 + 1/α², both to 1/α⁴.
            let over = 1.0 / (alpha * alpha);
            assert!((far.value / alpha - 1.0 - 2.0 * over).abs() < 30.0 * over * over + 1e-15);
            assert!((far.variance - 1.0 - over).abs() < 10.0 * over * over + 1e-15, "{far:?}");
        }
    }

    #[test]
    fn the_hazard_is_the_slope_of_the_log_likelihood_and_goes_on_smoothly() {
        for alpha in [-3.0, 0.0, 2.0, 10.0, 24.0] {
            let log = |a: f64| libm::log(libm::erfc(a * core::f64::consts::FRAC_1_SQRT_2));
            let slope = -(log(alpha + 1e-4) - log(alpha - 1e-4)) / 2e-4;
            assert!((hazard(alpha) / slope - 1.0).abs() < 1e-5, "{alpha}");
        }
        assert!((hazard(25.0 - 1e-9) / hazard(25.0 + 1e-9) - 1.0).abs() < 2e-8);
        assert!(hazard(1e8).is_finite());
    }
}
