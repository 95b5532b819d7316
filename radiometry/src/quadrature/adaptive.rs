//! Adaptive Gauss-Kronrod quadrature on intervals. It doesn't know the integrand.
//!
//! The piece with the largest bound is halved until the sum of bounds is within the tolerance
//! (de Doncker 1978; Piessens et al., QUADPACK, 1983). The bound of a piece is the plain difference of
//! the 21-point and the 10-point rule, not QUADPACK's sharpened 1.5th power of it: where the integrand
//! is smooth it overstates the error of the better rule by far. Where halving hardly shrinks it, there
//! is a singularity, both rules err alike, and the bound is four times that. The roundings of the
//! weighted sum come on top.

use core::cmp::Ordering;
use std::collections::BinaryHeap;

use super::Sum;
use crate::domain::finite;
use crate::estimate::{Estimate, EstimateError, Tolerance};

/// Of the 21-point Kronrod rule on [-1, 1]; every second one is a node of the 10-point Gauss rule.
#[expect(clippy::unreadable_literal, clippy::excessive_precision, reason = "as published")]
const NODES: [f64; 11] = [
    0.995657163025808080735527280689003,
    0.973906528517171720077964012084452,
    0.930157491355708226001207180059508,
    0.865063366688984510732096688423493,
    0.780817726586416897063717578345042,
    0.679409568299024406234327365114874,
    0.562757134668604683339000099272694,
    0.433395394129247190799265943165784,
    0.294392862701460198131126603103866,
    0.148874338981631210884826001129720,
    0.0,
];
#[expect(clippy::unreadable_literal, clippy::excessive_precision, reason = "as published")]
const KRONROD: [f64; 11] = [
    0.011694638867371874278064396062192,
    0.032558162307964727478818972459390,
    0.054755896574351996031381300244580,
    0.075039674810919952767043140916190,
    0.093125454583697605535065465083366,
    0.109387158802297641899210590325805,
    0.123491976262065851077958109585166,
    0.134709217311473325928054001771707,
    0.142775938577060080797094273138717,
    0.147739104901338491374841515972068,
    0.149445554002916905664936468389821,
];
#[expect(clippy::unreadable_literal, clippy::excessive_precision, reason = "as published")]
const GAUSS: [f64; 5] = [
    0.066671344308688137593568809893332,
    0.149451349150580593145863396957658,
    0.219086362515982043995534934228163,
    0.269266719309996355091226921569469,
    0.295524224714752870173815619188769,
];

/// Evaluations of one application of the rule.
const EVALUATIONS: usize = 21;
/// A weighted sum of 21 values, in units of 2⁻⁵² of the sum of their sizes.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Halving shrinks the difference of the rules by 2²⁰ where the integrand is smooth; by less than this,
/// and it is not.
pub(super) const SMOOTH: f64 = 16.0;
/// Of the difference, where the integrand is not smooth or nothing is known yet.
pub(super) const CAUTION: f64 = 4.0;

/// An interval with its integral.
#[derive(Debug, Clone, Copy)]
struct Piece {
    from: f64,
    to: f64,
    value: f64,
    /// |Kronrod - Gauss|
    difference: f64,
    /// Of that, the bound.
    truncation: f64,
    /// Does not shrink.
    rounding: f64,
}

impl Ord for Piece {
    fn cmp(&self, other: &Self) -> Ordering {
        self.truncation.total_cmp(&other.truncation)
    }
}

impl PartialOrd for Piece {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Piece {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Piece {}

impl Piece {
    fn new(
        integrand: &mut impl FnMut(f64) -> (f64, f64),
        from: f64,
        to: f64,
        parents_difference: f64,
    ) -> Result<Self, EstimateError> {
        let (middle, half) = (f64::midpoint(from, to), 0.5 * (to - from));
        let (mut kronrod, mut gauss, mut size, mut noise) = (0.0, 0.0, 0.0, 0.0);
        for (i, (node, weight)) in NODES.into_iter().zip(KRONROD).enumerate() {
            let step = half * node;
            let (left, left_noise) = integrand(middle - step);
            let (right, right_noise) = if i == 10 { (0.0, 0.0) } else { integrand(middle + step) };
            let pair = left + right;
            kronrod += weight * pair;
            size += weight * (left.abs() + right.abs());
            noise += weight * (left_noise + right_noise);
            if i % 2 == 1 {
                gauss += GAUSS[i / 2] * pair;
            }
        }
        if !size.is_finite() {
            return Err(EstimateError::Integrand { value: size });
        }
        let difference = (half * (kronrod - gauss)).abs();
        let caution = if SMOOTH * difference < parents_difference { 1.0 } else { CAUTION };
        Ok(Self {
            from,
            to,
            value: half * kronrod,
            difference,
            truncation: caution * difference,
            rounding: half.abs() * ROUNDING.mul_add(size, noise),
        })
    }

    /// Its halves, or nothing if there is no double between its ends.
    fn halves(
        &self,
        integrand: &mut impl FnMut(f64) -> (f64, f64),
    ) -> Result<Option<[Self; 2]>, EstimateError> {
        let middle = f64::midpoint(self.from, self.to);
        let between = self.from.min(self.to) < middle && middle < self.from.max(self.to);
        if !between {
            return Ok(None);
        }
        let left = Self::new(integrand, self.from, middle, self.difference)?;
        let right = Self::new(integrand, middle, self.to, self.difference)?;
        Ok(Some([left, right]))
    }
}

/// ∫ f over [from, to], to the tolerance; `to` below `from` turns the sign.
///
/// Smooth integrands take 21 evaluations; one with a singularity at an end or at a point of
/// [`adaptive_between`] converges as well (each halving costs 42), as long as it is integrable.
/// Who needs it: what is seen past an occluder's rim; curved rays, with a bound of their rounding.
///
/// ```
/// use radiometry::{Tolerance, quadrature::adaptive};
/// // ∫ ln x over [0, 1] is -1.
/// let estimate = adaptive(|x| x.ln(), 0.0, 1.0, Tolerance::default())?;
/// assert!((estimate.value + 1.0).abs() <= estimate.error_bound);
/// assert!(estimate.error_bound < 1e-10);
/// # Ok::<(), radiometry::EstimateError>(())
/// ```
pub fn adaptive(
    integrand: impl FnMut(f64) -> f64,
    from: f64,
    to: f64,
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    adaptive_between(integrand, &[from, to], tolerance)
}

/// ∫ f from the first to the last of the points, broken at each: where f has a kink or a peak, a
/// point there saves the search for it. The integrand is never evaluated at a point itself.
/// Who needs it: the simulator, for the exitance of a lobe.
///
/// ```
/// use radiometry::{Tolerance, quadrature::adaptive_between};
/// let kink = adaptive_between(f64::abs, &[-1.0, 0.0, 2.0], Tolerance::default())?;
/// assert_eq!((kink.value, kink.evaluations), (2.5, 42));
/// # Ok::<(), radiometry::EstimateError>(())
/// ```
pub fn adaptive_between(
    mut integrand: impl FnMut(f64) -> f64,
    points: &[f64],
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    adaptive_noisy(|x| (integrand(x), 0.0), points, tolerance)
}

/// The same for an integrand that tells a bound of its own rounding besides its value.
pub(crate) fn adaptive_noisy(
    mut integrand: impl FnMut(f64) -> (f64, f64),
    points: &[f64],
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    let mut open = BinaryHeap::with_capacity(16);
    // Pieces that cannot be halved any more.
    let mut closed: Vec<Piece> = Vec::new();
    let mut evaluations = 0;
    for ends in points.windows(2) {
        let (from, to) =
            (finite("integration limit", ends[0])?, finite("integration limit", ends[1])?);
        open.push(Piece::new(&mut integrand, from, to, 0.0)?);
        evaluations += EVALUATIONS;
    }
    loop {
        let pieces = || open.iter().chain(&closed);
        let value = pieces().map(|piece| piece.value).collect::<Sum>().value();
        let truncation = pieces().map(|piece| piece.truncation).sum::<f64>();
        let rounding = pieces().map(|piece| piece.rounding).sum::<f64>();
        let estimate = Estimate { value, error_bound: truncation + rounding, evaluations };
        let hopeless = rounding > tolerance.allowed(value) && truncation < rounding;
        if estimate.meets(tolerance) || hopeless {
            return estimate.within(tolerance);
        }
        // A quarter of the pieces at a time, so that summing them anew costs nothing.
        for _ in 0..=open.len() / 4 {
            let Some(worst) = open.pop() else { return estimate.within(tolerance) };
            if evaluations + 2 * EVALUATIONS > tolerance.budget() {
                return estimate.within(tolerance);
            }
            match worst.halves(&mut integrand)? {
                Some(halves) => open.extend(halves),
                None => closed.push(worst),
            }
            evaluations += 2 * EVALUATIONS;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rules_are_exact_to_their_degree() {
        for degree in 0..=31 {
            let moment = |x: f64| (libm::pow(x, f64::from(degree)), 0.0);
            let piece = Piece::new(&mut { moment }, 0.0, 1.0, 0.0).unwrap();
            let exact = 1.0 / f64::from(degree + 1);
            assert!((piece.value - exact).abs() < 1e-15, "degree {degree}");
            assert!(degree > 19 || piece.difference < 1e-15, "degree {degree}");
        }
    }

    #[test]
    fn the_bound_holds_next_to_singularities_and_peaks() {
        type Case = (fn(f64) -> f64, f64, f64, f64);
        let cases: [Case; 5] = [
            (f64::sqrt, 0.0, 1.0, 2.0 / 3.0),
            (|x| x.powf(-0.75), 0.0, 1.0, 4.0),
            (|x| 1e-6 / (x * x + 1e-12), -1.0, 1.0, 2.0 * 1e6_f64.atan()),
            (|x| (x - 1.0 / 3.0).abs(), 0.0, 1.0, 5.0 / 18.0),
            (f64::exp, 1.0, 0.0, 1.0 - core::f64::consts::E),
        ];
        for (case, (integrand, from, to, exact)) in cases.into_iter().enumerate() {
            for relative in [1e-3, 1e-6, 1e-9, 1e-12] {
                let tolerance = Tolerance::from_relative(relative).unwrap();
                let estimate = adaptive(integrand, from, to, tolerance).unwrap();
                let error = (estimate.value - exact).abs();
                assert!(error <= estimate.error_bound, "case {case}: {error:e}, {estimate:?}");
            }
        }
    }

    #[test]
    fn a_spent_budget_tells_how_far_it_came() {
        let tolerance = Tolerance::new(1e-12, 0.0, 100).unwrap();
        let Err(EstimateError::Unmet { estimate, .. }) = adaptive(f64::sqrt, 0.0, 1.0, tolerance)
        else {
            panic!("five applications cannot do");
        };
        assert!(estimate.evaluations <= 100);
        assert!((estimate.value - 2.0 / 3.0).abs() <= estimate.error_bound);
    }

    #[test]
    fn an_integrand_without_a_number_is_an_error() {
        let error = adaptive(|_| f64::NAN, 0.0, 1.0, Tolerance::default()).unwrap_err();
        assert!(matches!(error, EstimateError::Integrand { .. }));
        assert!(adaptive(|x| x, 0.0, f64::INFINITY, Tolerance::default()).is_err());
    }
}
