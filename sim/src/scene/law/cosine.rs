//! cosⁿ of the angle to an axis, n at least 0: its integral, and how steep and curved it is at most
//! over an interval of that angle.

use core::f64::consts::{FRAC_PI_2, PI};

/// 2π ∫ cosⁿ⁺¹θ sin θ dθ = 2π (1 - cosⁿ⁺²θ) / (n + 2), without cancellation near 0:
/// cosᵏθ = exp(k ln cos θ), and ln cos θ = ln(1 - 2 sin²(θ/2)).
pub(super) fn exitance_within(exponent: f64, theta_rad: f64) -> f64 {
    let half = libm::sin(theta_rad / 2.0);
    let log_cos = libm::log1p((-2.0 * half * half).max(-1.0));
    -2.0 * PI * libm::expm1((exponent + 2.0) * log_cos) / (exponent + 2.0)
}

/// The largest |f'| = n cosⁿ⁻¹γ sin γ for γ within an interval of [0, π/2]; along any great circle,
/// since f changes fastest away from its axis.
pub(super) fn slope_bound(exponent: f64, (from, to): (f64, f64)) -> f64 {
    if exponent == 0.0 {
        return 0.0;
    }
    let slope = |gamma: f64| {
        let cos = libm::cos(gamma);
        if cos <= 0.0 && exponent < 1.0 {
            return f64::INFINITY;
        }
        exponent * libm::pow(cos.max(0.0), exponent - 1.0) * libm::sin(gamma)
    };
    // tan²γ = 1/(n - 1) is the steepest place, if there is one.
    let steepest =
        if exponent > 1.0 { libm::atan(1.0 / libm::sqrt(exponent - 1.0)) } else { FRAC_PI_2 };
    slope(steepest.clamp(from, to))
}

/// The largest curvature over an interval of [0, π/2], along any great circle: of
/// f'' = n cosⁿ⁻²γ (n sin²γ - 1) and, across, f' cot γ = -n cosⁿγ.
pub(super) fn curvature_bound(exponent: f64, (from, to): (f64, f64)) -> f64 {
    if exponent == 0.0 {
        return 0.0;
    }
    let along = |gamma: f64| {
        let (sin, cos) = libm::sincos(gamma);
        let cos = cos.max(0.0);
        if cos == 0.0 && exponent < 2.0 {
            // cosⁿ⁻² beats n sin² - 1, unless that vanishes with it.
            return if (exponent - 1.0).abs() < f64::EPSILON { 0.0 } else { f64::INFINITY };
        }
        (exponent * libm::pow(cos, exponent - 2.0) * (exponent * sin * sin - 1.0)).abs()
    };
    let across = exponent * libm::pow(libm::cos(from), exponent);
    // The derivative vanishes where cos² = (n - 1)(n - 2)/n².
    let square = (exponent - 1.0) * (exponent - 2.0) / (exponent * exponent);
    let turning = (exponent > 2.0).then(|| libm::acos(libm::sqrt(square)).clamp(from, to));
    [Some(from), Some(to), turning].into_iter().flatten().map(along).fold(across, f64::max)
}
