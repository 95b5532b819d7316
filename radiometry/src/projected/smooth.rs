//! The integral of a smooth function that is nowhere negative, to rounding: Gauss panels, halved where
//! they and their halves disagree. It is for kernels whose integrand is known to be such; anything
//! else wants a tolerance and an error bound.

use std::cell::Cell;
use std::sync::OnceLock;

use crate::quadrature::gauss_legendre;

/// Of a panel's integral: two panels of 20 points that agree so far are right to rounding.
const AGREEMENT: f64 = 1e-13;
/// Halvings: no scale of a double's is finer, seen from a well placed origin.
const DEPTH_MAX: u32 = 60;
/// Halvings in all: a smooth integrand takes some hundred. One that asks for more has lost its
/// digits to the extremes of its arguments.
const HALVINGS_MAX: u32 = 2_000;

/// ∫ f over [from, to]; 0 if the interval is empty, NaN where it does not settle.
pub(crate) fn integral(from: f64, to: f64, f: &impl Fn(f64) -> f64) -> f64 {
    if from >= to {
        return 0.0;
    }
    let halvings_left = Cell::new(HALVINGS_MAX);
    halved(from, to, panel(from, to, f), 0.0, 0, &|| spend(&halvings_left), f)
}

/// Whether another halving may be made.
fn spend(halvings_left: &Cell<u32>) -> bool {
    let left = halvings_left.get();
    halvings_left.set(left.saturating_sub(1));
    left > 0
}

/// `elsewhere` is a lower bound of the integral over other panels: what does not matter beside it
/// is not refined.
fn halved(
    from: f64,
    to: f64,
    whole: f64,
    elsewhere: f64,
    depth: u32,
    may_halve: &impl Fn() -> bool,
    f: &impl Fn(f64) -> f64,
) -> f64 {
    if !whole.is_finite() || !may_halve() {
        return f64::NAN;
    }
    let middle = f64::midpoint(from, to);
    let (left, right) = (panel(from, middle, f), panel(middle, to, f));
    let sum = left + right;
    let settled = (sum - whole).abs() <= AGREEMENT * (sum + 0.01 * elsewhere);
    if settled || depth == DEPTH_MAX {
        return sum;
    }
    let left = halved(from, middle, left, elsewhere, depth + 1, may_halve, f);
    left + halved(middle, to, right, elsewhere + left, depth + 1, may_halve, f)
}

fn panel(from: f64, to: f64, f: &impl Fn(f64) -> f64) -> f64 {
    static RULE: OnceLock<Vec<(f64, f64)>> = OnceLock::new();
    let rule = RULE.get_or_init(|| gauss_legendre(20));
    let (middle, half) = (f64::midpoint(from, to), (to - from) / 2.0);
    half * rule.iter().map(|(node, weight)| weight * f(half.mul_add(*node, middle))).sum::<f64>()
}
