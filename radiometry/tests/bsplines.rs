//! What must hold of B-splines whatever the knots: they are a partition of unity, live where they
//! should, reproduce polynomials with all derivatives (Marsden's identity), close round a circle, and
//! their integrals are exact.

use std::f64::consts::TAU;

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use radiometry::basis::{Active, BSpline, DEGREE_MAX};
use radiometry::quadrature::adaptive_between;
use radiometry::{DomainError, Tolerance};

fn repeatable() -> ProptestConfig {
    ProptestConfig {
        cases: 400,
        rng_seed: RngSeed::Fixed(20_261_122),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// Breaks from 0 on whose gaps differ by up to a thousandfold.
fn breaks(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<f64>> {
    proptest::collection::vec(-3.0..0.0f64, count).prop_map(|exponents| {
        walk(&exponents.into_iter().map(|exponent| 10f64.powf(exponent)).collect::<Vec<_>>())
    })
}

/// Breaks from 0 on with these gaps.
fn walk(gaps: &[f64]) -> Vec<f64> {
    let mut at = 0.0;
    let ends = gaps.iter().map(|gap| {
        at += gap;
        at
    });
    std::iter::once(0.0).chain(ends).collect()
}

/// The knots of an open basis.
fn clamped(degree: usize, breaks: &[f64]) -> Vec<f64> {
    let (first, last) = (breaks[0], breaks[breaks.len() - 1]);
    let ends = |knot| std::iter::repeat_n(knot, degree);
    ends(first).chain(breaks.iter().copied()).chain(ends(last)).collect()
}

/// Coefficients of (ξ - x)ᵖ: Πⱼ (ξ - tᵢ₊ⱼ) over the inner knots of each function (Marsden 1970).
fn marsden(degree: usize, knots: &[f64], xi: f64) -> Vec<f64> {
    (0..knots.len() - degree - 1)
        .map(|i| knots[i + 1..=i + degree].iter().map(|knot| xi - knot).product())
        .collect()
}

fn sum(active: &Active, coefficients: &[f64]) -> f64 {
    active.iter().map(|(index, value)| coefficients[index] * value).sum()
}

/// p!/(p-m)!
fn falling(degree: usize, order: usize) -> f64 {
    (0..order).map(|k| (degree - k) as f64).product()
}

fn power(base: f64, exponent: usize) -> f64 {
    base.powi(i32::try_from(exponent).unwrap())
}

proptest! {
    #![proptest_config(repeatable())]

    #[test]
    fn they_sum_to_one_and_are_nowhere_negative(
        degree in 0..=DEGREE_MAX, breaks in breaks(1..12), share in 0.0..=1.0f64
    ) {
        let spline = BSpline::open(degree, &breaks).unwrap();
        let x = share * breaks[breaks.len() - 1];
        let active = spline.nonzero(x).unwrap();
        prop_assert_eq!(active.values().len(), degree + 1);
        prop_assert!(active.values().iter().all(|value| (0.0..=1.0).contains(value)), "{active:?}");
        prop_assert!((active.values().iter().sum::<f64>() - 1.0).abs() < 4e-15);
        let mut values = vec![f64::NAN; spline.len()];
        spline.evaluate(x, &mut values).unwrap();
        // Each lives between its first knot and its last.
        let knots = clamped(degree, &breaks);
        for (i, value) in values.iter().enumerate() {
            prop_assert!(*value <= 0.0 || (knots[i] <= x && x <= knots[i + degree + 1]));
        }
    }

    /// Σ Πⱼ(ξ - tᵢ₊ⱼ) Bᵢ(x) = (ξ - x)ᵖ and all its derivatives: every value of every function takes
    /// part, against a closed form.
    #[test]
    fn they_reproduce_powers_with_all_derivatives(
        degree in 0..=7_usize, gaps in proptest::collection::vec(0.3..1.0f64, 1..8),
        share in 0.0..=1.0f64, xi in -2.0..3.0f64
    ) {
        let breaks = walk(&gaps);
        let end = breaks[breaks.len() - 1];
        let spline = BSpline::open(degree, &breaks).unwrap();
        let coefficients = marsden(degree, &clamped(degree, &breaks), xi);
        let x = share * end;
        for order in 0..=degree {
            let active = spline.nonzero_derivatives(x, order).unwrap();
            let sign = if order % 2 == 0 { 1.0 } else { -1.0 };
            let expected = sign * falling(degree, order) * power(xi - x, degree - order);
            let size: f64 =
                active.iter().map(|(index, value)| (coefficients[index] * value).abs()).sum();
            let found = sum(&active, &coefficients);
            let allowed = 1e-13 * (size + expected.abs());
            prop_assert!((found - expected).abs() <= allowed, "{order}: {found} {expected}");
        }
        let beyond = spline.nonzero_derivatives(x, degree + 1).unwrap();
        prop_assert!(beyond.values().iter().all(|value| *value == 0.0));
    }

    #[test]
    fn integrals_are_a_share_of_the_support(degree in 0..=DEGREE_MAX, breaks in breaks(1..12)) {
        let spline = BSpline::open(degree, &breaks).unwrap();
        let (from, to) = spline.domain();
        let mut areas = vec![0.0; spline.len()];
        spline.integrals(from, to, &mut areas).unwrap();
        let knots = clamped(degree, &breaks);
        for (i, area) in areas.iter().enumerate() {
            // De Boor 1978, eq. X.33.
            let expected = (knots[i + degree + 1] - knots[i]) / (degree as f64 + 1.0);
            // Nodes are rounded where the knots are, however close these stand.
            let allowed = 2e-14 * expected + f64::EPSILON * to;
            prop_assert!((area - expected).abs() < allowed, "{i}: {area} {expected}");
        }
        let middle = f64::midpoint(from, to);
        let mut parts = vec![0.0; spline.len()];
        let mut rest = vec![0.0; spline.len()];
        spline.integrals(from, middle, &mut parts).unwrap();
        spline.integrals(middle, to, &mut rest).unwrap();
        for ((part, rest), area) in parts.iter().zip(&rest).zip(&areas) {
            prop_assert!((part + rest - area).abs() < 1e-14 * to);
        }
    }

    /// A spline of degree p on shifted knots: turning x and the knots together changes nothing but
    /// the numbering, across the seam too.
    #[test]
    fn round_a_circle_there_is_no_first_function(
        degree in 0..=5_usize, gaps in proptest::collection::vec(0.2..1.0f64, 6..10),
        turn in 0..6_usize, share in 0.0..1.0f64
    ) {
        let mut turned = gaps.clone();
        turned.rotate_left(turn);
        let shift: f64 = gaps[..turn].iter().sum();
        let (one, other) = (
            BSpline::periodic(degree, &walk(&gaps)).unwrap(),
            BSpline::periodic(degree, &walk(&turned)).unwrap(),
        );
        let len = one.len();
        prop_assert_eq!(len, gaps.len());
        let period: f64 = gaps.iter().sum();
        let x = share * period;
        let (mut there, mut here) = (vec![0.0; len], vec![0.0; len]);
        one.evaluate(x, &mut there).unwrap();
        other.evaluate(x - shift + 3.0 * period, &mut here).unwrap();
        prop_assert!((there.iter().sum::<f64>() - 1.0).abs() < 4e-15);
        // A step moves between neighbours where x falls on a knot to rounding.
        prop_assume!(degree > 0);
        for i in 0..len {
            let (a, b) = (there[(i + turn) % len], here[i]);
            prop_assert!((a - b).abs() < 1e-13, "{i}: {a} {b}");
        }
    }

    #[test]
    fn gram_matrices_are_the_integrals_of_products(
        degree in 1..=4_usize, breaks in breaks(5..8), is_periodic in any::<bool>()
    ) {
        let spline = if is_periodic {
            BSpline::periodic(degree.min(breaks.len() - 2), &breaks).unwrap()
        } else {
            BSpline::open(degree, &breaks).unwrap()
        };
        let len = spline.len();
        for order in 0..=degree {
            let gram = spline.gram(order).unwrap();
            for (i, j) in [(0, 0), (0, 1), (1, 0), (len - 1, 0), (len / 2, len / 2), (len / 2, 1)] {
                let value = |x: f64, index: usize| {
                    let active = spline.nonzero_derivatives(x, order).unwrap();
                    active.iter().find(|(at, _)| *at == index).map_or(0.0, |(_, value)| value)
                };
                let size = (gram[i * len + i] * gram[j * len + j]).sqrt();
                let tolerance = Tolerance::new(1e-12, 1e-12 * size, 100_000).unwrap();
                let product = |x: f64| value(x, i) * value(x, j);
                let expected = adaptive_between(product, &breaks, tolerance).unwrap().value;
                let found = gram[i * len + j];
                prop_assert!((found - expected).abs() < 1e-11 * size, "{order}, {i}, {j}: {found} {expected}");
                prop_assert!((found - gram[j * len + i]).abs() <= 1e-15 * size);
            }
            // The functions sum to a constant, whose slope is nothing.
            if order > 0 {
                for row in gram.chunks_exact(len) {
                    let size: f64 = row.iter().map(|entry| entry.abs()).sum();
                    prop_assert!(row.iter().sum::<f64>().abs() < 1e-12 * size);
                }
            }
        }
    }

    /// Whatever doubles come in: an answer or an error, never NaN, never a panic.
    #[test]
    fn no_doubles_make_nan(
        degree in 0..20_usize, bits in proptest::collection::vec(any::<u64>(), 0..12),
        at in any::<u64>(), order in 0..4_usize
    ) {
        let mut knots: Vec<f64> = bits.into_iter().map(f64::from_bits).collect();
        let x = f64::from_bits(at);
        for _ in 0..2 {
            let splines = [
                BSpline::with_knots(degree, &knots), BSpline::open(degree, &knots),
                BSpline::periodic(degree, &knots), BSpline::open(degree % 4, &knots),
                BSpline::periodic(degree % 4, &knots), BSpline::with_knots(degree % 4, &knots),
            ];
            for spline in splines.into_iter().flatten() {
                let (from, to) = spline.domain();
                for x in [x, from, to, f64::midpoint(from, to), from + 1e-3 * (to - from)] {
                    if let Ok(active) = spline.nonzero(x) {
                        prop_assert!(active.values().iter().all(|v| (0.0..=1.0).contains(v)), "{active:?}");
                        prop_assert!((active.values().iter().sum::<f64>() - 1.0).abs() < 1e-14);
                    }
                    if let Ok(active) = spline.nonzero_derivatives(x, order) {
                        prop_assert!(active.values().iter().all(|value| value.is_finite()));
                    }
                }
                if let Ok(gram) = spline.gram(order) {
                    prop_assert!(gram.iter().all(|entry| entry.is_finite()));
                }
            }
            // Once more, in an order that stands a chance.
            knots.retain(|knot| knot.is_finite());
            knots.sort_by(f64::total_cmp);
        }
    }
}

#[test]
fn a_knot_that_stands_twice_takes_a_derivative_away() {
    let spline = BSpline::open(3, &[0.0, 1.0, 1.0, 2.0, 3.0, 3.0, 3.0, 4.0]).unwrap();
    let step = 1e-9;
    let jump = |x: f64, order: usize| {
        let mut values = vec![0.0; spline.len()];
        let below = spline.nonzero_derivatives(x - step, order).unwrap();
        below.iter().for_each(|(index, value)| values[index] -= value);
        let above = spline.nonzero_derivatives(x + step, order).unwrap();
        above.iter().for_each(|(index, value)| values[index] += value);
        values.into_iter().fold(0.0, |largest: f64, value| largest.max(value.abs()))
    };
    // Twice at 1: the first derivative is continuous, the second is not; thrice at 3: the value is.
    assert!(jump(1.0, 1) < 1e-7 && jump(1.0, 2) > 0.1);
    assert!(jump(2.0, 2) < 1e-7 && jump(2.0, 3) > 0.1);
    assert!(jump(3.0, 0) < 1e-7 && jump(3.0, 1) > 0.1);
    // Four times: a jump, the value being that from the right.
    let torn = BSpline::open(3, &[0.0, 1.0, 1.0, 1.0, 1.0, 2.0]).unwrap();
    assert_eq!(torn.nonzero(1.0).unwrap().iter().find(|(_, v)| *v > 0.0), Some((4, 1.0)));
    assert_eq!(torn.nonzero(2.0).unwrap().values(), [0.0, 0.0, 0.0, 1.0]);
}

#[test]
fn the_seam_of_a_circle_is_smooth() {
    let breaks: Vec<f64> = (0..=8).map(|k| -TAU / 2.0 + TAU * f64::from(k) / 8.0).collect();
    let spline = BSpline::periodic(3, &breaks).unwrap();
    assert!(spline.is_periodic() && spline.len() == 8);
    let (mut below, mut above) = (vec![0.0; 8], vec![0.0; 8]);
    // Half a turn either way is one place, and so is a turn further.
    spline.evaluate(TAU / 2.0, &mut below).unwrap();
    spline.evaluate(-TAU / 2.0, &mut above).unwrap();
    assert_eq!(below, above);
    spline.evaluate(TAU / 2.0 - 1e-13, &mut below).unwrap();
    assert!(below.iter().zip(&above).all(|(a, b)| (a - b).abs() < 1e-12));
    // A cubic one on its middle knots: 1/6, 4/6, 1/6.
    let active = spline.nonzero(-TAU / 2.0).unwrap();
    let expected = [1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0, 0.0];
    assert!(active.values().iter().zip(expected).all(|(v, e)| (v - e).abs() < 1e-15), "{active:?}");
    let mut areas = vec![0.0; 8];
    spline.integrals(-TAU / 2.0, TAU / 2.0, &mut areas).unwrap();
    assert!(areas.iter().all(|area| (area - TAU / 8.0).abs() < 1e-15));
    assert_eq!(spline.spans().count(), 8);
}

#[test]
fn knots_may_lie_as_close_as_doubles_do() {
    let tiny = f64::MIN_POSITIVE / 1024.0;
    for breaks in [vec![0.0, tiny, 3.0 * tiny], vec![0.0, 1e-300, 1e-300 + tiny, 1.0]] {
        let spline = BSpline::open(3, &breaks).unwrap();
        for x in breaks {
            let active = spline.nonzero(x).unwrap();
            let sum: f64 = active.values().iter().sum();
            assert!((sum - 1.0).abs() < 4e-15, "{x:e}: {active:?}");
        }
    }
}

#[test]
fn unclamped_knots_are_a_partition_of_unity_on_their_domain() {
    let knots: Vec<f64> = (0..10).map(f64::from).collect();
    let spline = BSpline::with_knots(3, &knots).unwrap();
    assert_eq!((spline.len(), spline.degree(), spline.domain()), (6, 3, (3.0, 6.0)));
    let middle = spline.nonzero(4.0).unwrap();
    assert_eq!(middle.first(), 1);
    assert!((middle.values()[1] - 2.0 / 3.0).abs() < 1e-15);
    assert!(spline.nonzero(2.9).is_err() && spline.nonzero(6.1).is_err());
}

#[test]
fn knots_without_meaning_are_refused_with_their_value() {
    let text = |result: Result<BSpline, DomainError>| result.unwrap_err().to_string();
    assert_eq!(
        text(BSpline::open(3, &[0.0, 2.0, 1.0, 3.0])),
        "number 2 of knots is 1 after 2, expected no less than that"
    );
    assert_eq!(
        text(BSpline::open(2, &[0.0, 1.0, 1.0, 1.0, 1.0, 2.0])),
        "the knot 1 stands 4 times, expected at most 3"
    );
    assert_eq!(text(BSpline::open(2, &[1.0])), "1 breaks are given, expected 2 or more");
    assert_eq!(
        text(BSpline::periodic(3, &[0.0, 1.0, 2.0, 3.0])),
        "4 breaks are given, expected 5 or more"
    );
    assert_eq!(text(BSpline::open(16, &[0.0, 1.0])), "degree is 16, expected 0 to 15");
    assert_eq!(text(BSpline::open(1, &[0.0, f64::NAN])), "knot is NaN, expected a finite number");
    assert!(BSpline::open(0, &[1.0, 1.0]).is_err(), "nothing between the ends");
    assert!(BSpline::open(1, &[-1e308, 1e308]).is_err(), "an infinite extent");
    let narrow = BSpline::open(3, &[0.0, 1e-200]).unwrap();
    assert!(narrow.nonzero(1e-200).is_ok());
    assert_eq!(
        narrow.nonzero_derivatives(0.0, 2),
        Err(DomainError::Overflow { result: "a derivative of a B-spline" })
    );
    let spline = BSpline::open(1, &[0.0, 1.0]).unwrap();
    assert!(spline.nonzero(-1e-9).is_err() && spline.nonzero(f64::NAN).is_err());
    assert!(spline.integrals(0.5, 0.4, &mut [0.0; 2]).is_err());
}

#[test]
fn integrals_over_any_part_agree_with_quadrature_of_the_values() {
    let tolerance = Tolerance::new(1e-10, 1e-11, 200_000).unwrap();
    let breaks = [0.0, 0.7, 1.0, 2.5, 3.0];
    for degree in 0..=4 {
        for spline in [BSpline::open(degree, &breaks), BSpline::periodic(degree, &breaks)] {
            let Ok(spline) = spline else { continue };
            let (mut areas, mut values) = (vec![0.0; spline.len()], vec![0.0; spline.len()]);
            for (from, to) in [(0.0, 3.0), (0.2, 0.6), (0.3, 2.7), (1.1, 1.1), (0.7, 2.5)] {
                spline.integrals(from, to, &mut areas).unwrap();
                let inner = breaks.iter().copied().filter(|at| from < *at && *at < to);
                let ends: Vec<f64> = [from].into_iter().chain(inner).chain([to]).collect();
                for (i, area) in areas.iter().enumerate() {
                    let value = |x: f64| {
                        spline.evaluate(x, &mut values).unwrap();
                        values[i]
                    };
                    let summed = if from < to {
                        adaptive_between(value, &ends, tolerance).unwrap().value
                    } else {
                        0.0
                    };
                    let said = format!("degree {degree}, {i} in {from}..{to}");
                    assert!((area - summed).abs() < 1e-10, "{said}: {area}, summed {summed}");
                }
            }
        }
    }
}
