//! Integration: fixed nodes and weights, adaptive rules in one and two dimensions, quasi-Monte Carlo in
//! more, and sums that keep their digits. It doesn't know the integrand.

use core::f64::consts::PI;

use crate::domain::{DomainError, within};
use crate::error_free::DoubleDouble;

mod adaptive;
mod cubature;
mod quasi_monte_carlo;
mod sum;

pub(crate) use adaptive::adaptive_noisy;
pub use adaptive::{adaptive, adaptive_between};
pub use cubature::{Cell, cubature};
pub use quasi_monte_carlo::{Sobol, quasi_monte_carlo};
pub use sum::Sum;

/// Nodes in (-1, 1), rising, and weights, of the Gauss-Legendre rule with `n` nodes: exact for
/// polynomials of degree 2n-1; the weights sum to 2. Both within an ulp or two of the true ones:
/// Newton's method on Pₙ, finished in double-double. None for n = 0. Costs n² steps.
/// Who needs it: the simulator's tables, the study's scores, B-splines and beams.
///
/// ```
/// let rule = radiometry::quadrature::gauss_legendre(2);
/// assert_eq!(rule[1], (0.577_350_269_189_625_7, 1.0)); // 1/√3
/// ```
pub fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    let mut rule = vec![(0.0, 0.0); n];
    for i in 0..n.div_ceil(2) {
        let (node, weight) = node_and_weight(n, i);
        rule[n - 1 - i] = (node, weight);
        rule[i] = (-node, weight);
    }
    if n % 2 == 1 {
        // The middle node is 0 exactly, and not -0.
        rule[n / 2].0 = 0.0;
    }
    rule
}

/// The same rule on [0, 1], with 32 digits.
pub(crate) fn wide_gauss_legendre(n: usize) -> Vec<(DoubleDouble, DoubleDouble)> {
    let one = DoubleDouble::from_f64(1.0);
    let mut rule = Vec::with_capacity(n);
    for i in 0..n {
        let mirrored = n - 1 - i;
        let (node, weight) = wide_node_and_weight(n, i.min(mirrored));
        let node = if i <= mirrored { one.sub(node) } else { one.add(node) };
        rule.push((node.scaled(-1), weight.scaled(-1)));
    }
    rule
}

/// The i-th node from the right end, and its weight 2(1-x²)/(n Pₙ₋₁(x))².
fn node_and_weight(n: usize, i: usize) -> (f64, f64) {
    let (node, weight) = wide_node_and_weight(n, i);
    (node.to_f64(), weight.to_f64())
}

fn wide_node_and_weight(n: usize, i: usize) -> (DoubleDouble, DoubleDouble) {
    /// Newton doubles the digits: from the start's 3 to 32 in four, and one to spare.
    const STEPS: usize = 5;
    let order = n as f64;
    // Abramowitz and Stegun 22.16.6, first term.
    let start = libm::cos(PI * (i as f64 + 0.75) / (order + 0.5));
    let one = DoubleDouble::from_f64(1.0);
    let mut x = DoubleDouble::from_f64(start);
    for _ in 0..STEPS {
        let (last, before) = legendre_pair(n, x);
        // Pₙ' = n (Pₙ₋₁ - x Pₙ)/(1 - x²)
        let slope = DoubleDouble::from_f64(order).mul(before.sub(x.mul(last)));
        x = x.sub(last.mul(one.sub(x.mul(x))).div(slope));
    }
    let (_, before) = legendre_pair(n, x);
    let scaled = DoubleDouble::from_f64(order).mul(before);
    let weight = DoubleDouble::from_f64(2.0).mul(one.sub(x.mul(x))).div(scaled.mul(scaled));
    (x, weight)
}

/// Pₙ and Pₙ₋₁ at x.
fn legendre_pair(n: usize, x: DoubleDouble) -> (DoubleDouble, DoubleDouble) {
    let (mut last, mut before) = (DoubleDouble::from_f64(1.0), DoubleDouble::from_f64(0.0));
    for k in 0..n {
        let k = k as f64;
        let next = DoubleDouble::from_f64(2.0f64.mul_add(k, 1.0))
            .mul(x.mul(last))
            .sub(DoubleDouble::from_f64(k).mul(before))
            .div(DoubleDouble::from_f64(k + 1.0));
        (last, before) = (next, last);
    }
    (last, before)
}

/// A direction of a rule, with its weight in projected solid angle.
/// Who needs it: whoever averages over a [`cone`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConeNode {
    /// From +z, radians.
    pub theta_rad: f64,
    /// From +x towards +y, radians, in [0, 2π).
    pub phi_rad: f64,
    /// Projected solid angle, sr; all weights are positive.
    pub weight_sr: f64,
}

/// A product rule over the cone θ <= `theta_max` in [0, π/2] under the projected solid angle
/// cos θ dω; the weights sum to π sin² θmax. Gauss-Legendre in sin² θ on `rings`, the mean over
/// `spokes` equidistant azimuths: exact for a polynomial in (sin θ cos φ, sin θ sin φ) of degree up
/// to min(4·rings - 2, spokes - 1).
/// Who needs it: the page on radiant exitance: L over a cone under cos θ dω.
///
/// ```
/// use std::f64::consts::{FRAC_PI_2, PI};
/// let rule = radiometry::quadrature::cone(FRAC_PI_2, 4, 8)?;
/// let hemisphere: f64 = rule.iter().map(|node| node.weight_sr).sum();
/// assert!((hemisphere - PI).abs() < 1e-14);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn cone(theta_max_rad: f64, rings: usize, spokes: usize) -> Result<Vec<ConeNode>, DomainError> {
    let theta_max = within("theta_max_rad", theta_max_rad, 0.0, PI / 2.0)?;
    let sin_max = libm::sin(theta_max);
    let spoke = 2.0 * PI / spokes as f64;
    let mut nodes = Vec::with_capacity(rings.saturating_mul(spokes));
    for (node, weight) in gauss_legendre(rings) {
        let sin_theta = sin_max * f64::midpoint(1.0, node).sqrt();
        // sin² θ is s² (1+t)/2, ring area ½ d(sin² θ) dφ.
        let weight_sr = sin_max * sin_max * weight / 4.0 * spoke;
        let cos_theta = ((1.0 - sin_theta) * (1.0 + sin_theta)).sqrt();
        let theta_rad = libm::atan2(sin_theta, cos_theta);
        nodes.extend((0..spokes).map(|k| ConeNode {
            theta_rad,
            phi_rad: k as f64 * spoke,
            weight_sr,
        }));
    }
    Ok(nodes)
}
