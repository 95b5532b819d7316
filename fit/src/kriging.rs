//! A quick interpolation of scattered values with its own error: Gaussian processes of Matérn's
//! kind (smoothness 5/2; Rasmussen and Williams 2006, chapters 4 and 5), whose left-out errors are
//! had without another fit. It serves to decide where to read next; fields that people get are fits
//! in a basis.
//!
//! It does not know what its coordinates mean. Dense: cubic in the number of values.

use faer::linalg::solvers::{DenseSolveCore, Solve};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Mat, Par, Side};

/// The least variance of a value over the process's: rounding, and that no two readings are quite at
/// one place.
const NUGGET: f64 = 1e-6;
/// The least variance of the process over the square of the largest value: a constant is known to a
/// part in ten thousand, not better, before there are more values.
const VARIANCE_LEAST: f64 = 1e-8;

/// Values that lengths are chosen by at most.
const TELLING_MAX: usize = 160;

/// A place: two coordinates that share a length, and two that share another.
pub type Place = [f64; 4];

/// A value at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knot {
    /// Where.
    pub at: Place,
    /// What was read.
    pub value: f64,
    /// The variance of its noise.
    pub variance: f64,
}

/// How far the others miss a value that is left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeftOut {
    /// Value less prediction.
    pub error: f64,
    /// The variance that the process gives that error, the value's own noise included.
    pub variance: f64,
}

/// The process, given values.
#[derive(Debug, Clone)]
pub struct Kriging {
    knots: Vec<Knot>,
    lengths: [f64; 2],
    mean: f64,
    amplitude: f64,
    lower: Mat<f64>,
    // K⁻¹ of the values less their mean.
    weights: Vec<f64>,
    left_out: Vec<LeftOut>,
}

impl Kriging {
    /// With given lengths, of the first two coordinates and of the last two; the variance is what the
    /// left-out errors ask for. `None` for fewer than three values, or numbers out of range.
    pub fn new(knots: &[Knot], lengths: [f64; 2]) -> Option<Self> {
        let n = knots.len();
        let is_sound = |knot: &Knot| {
            knot.at.iter().chain([&knot.value, &knot.variance]).all(|number| number.is_finite())
                && knot.variance >= 0.0
        };
        let are_lengths = lengths.iter().all(|length| length.is_finite() && *length > 0.0);
        if n < 3 || !are_lengths || !knots.iter().all(is_sound) {
            return None;
        }
        let mean = knots.iter().map(|knot| knot.value).sum::<f64>() / n as f64;
        let square = |knot: &Knot| (knot.value - mean).powi(2);
        let noise = knots.iter().map(|knot| knot.variance).sum::<f64>() / n as f64;
        let largest = knots.iter().map(|knot| knot.value.powi(2)).fold(0.0, f64::max);
        let least = (VARIANCE_LEAST * largest).max(f64::MIN_POSITIVE / NUGGET);
        let seen = knots.iter().map(square).sum::<f64>() / n as f64 - noise;
        let first = Self::given(knots, lengths, mean, seen.max(0.1 * noise).max(least))?;
        // Of errors over what they were expected to be, the mean square is one.
        let ratio = |e: &LeftOut| e.error * e.error / e.variance;
        let scale = first.left_out.iter().map(ratio).sum::<f64>() / n as f64;
        Self::given(knots, lengths, mean, (first.amplitude * scale).max(least))
    }

    /// With the lengths under which the left-out values are likeliest, of those on two lists; of many
    /// values, so far as evenly picked ones tell.
    pub fn likeliest(knots: &[Knot], first: &[f64], second: &[f64]) -> Option<Self> {
        // Odd, since knots may come in pairs.
        let stride = knots.len().div_ceil(TELLING_MAX) | 1;
        let telling: Vec<Knot> = knots.iter().step_by(stride).copied().collect();
        let pairs = first.iter().flat_map(|a| second.iter().map(move |b| [*a, *b]));
        let tried = pairs.filter_map(|lengths| Self::new(&telling, lengths));
        let best = tried.max_by(|a, b| a.log_density().total_cmp(&b.log_density()))?;
        if stride == 1 { Some(best) } else { Self::new(knots, best.lengths) }
    }

    fn given(knots: &[Knot], lengths: [f64; 2], mean: f64, amplitude: f64) -> Option<Self> {
        let n = knots.len();
        let own = |knot: &Knot| knot.variance + NUGGET * amplitude;
        let covariance = Mat::from_fn(n, n, |i, j| {
            let common = amplitude * matern(distance(&knots[i].at, &knots[j].at, lengths));
            if i == j { common + own(&knots[i]) } else { common }
        });
        let factor = covariance.llt(Side::Lower).ok()?;
        let inverse = factor.inverse();
        let values = Mat::from_fn(n, 1, |i, _| knots[i].value - mean);
        let solved = factor.solve(&values);
        let weights: Vec<f64> = (0..n).map(|i| solved[(i, 0)]).collect();
        let left_out = (0..n).map(|i| {
            let variance = 1.0 / inverse[(i, i)];
            LeftOut { error: weights[i] * variance, variance }
        });
        let left_out: Vec<LeftOut> = left_out.collect();
        let is_sound = left_out.iter().all(|e| e.variance > 0.0 && e.error.is_finite());
        let lower = factor.L().to_owned();
        let knots = knots.to_vec();
        is_sound.then_some(Self { knots, lengths, mean, amplitude, lower, weights, left_out })
    }

    /// Mean log density of the values, each left out in turn.
    pub fn log_density(&self) -> f64 {
        let of = |e: &LeftOut| -0.5 * (e.error * e.error / e.variance + libm::log(e.variance));
        self.left_out.iter().map(of).sum::<f64>() / self.left_out.len() as f64
    }

    /// How far the others miss each value, in the values' order.
    pub fn left_out(&self) -> &[LeftOut] {
        &self.left_out
    }

    /// What it was made from.
    pub fn knots(&self) -> &[Knot] {
        &self.knots
    }

    /// How far two places are apart, in lengths.
    pub fn distance(&self, a: &Place, b: &Place) -> f64 {
        distance(a, b, self.lengths)
    }

    /// The value at a place.
    pub fn value(&self, at: &Place) -> f64 {
        let of = |(knot, weight): (&Knot, &f64)| {
            weight * self.amplitude * matern(distance(&knot.at, at, self.lengths))
        };
        self.mean + self.knots.iter().zip(&self.weights).map(of).sum::<f64>()
    }

    /// The same process, were its values without noise: what is not known then lies between them.
    /// `None` where they are too close for that.
    #[must_use]
    pub fn without_noise(&self) -> Option<Self> {
        let exact = |knot: &Knot| Knot { variance: 0.0, ..*knot };
        let knots: Vec<Knot> = self.knots.iter().map(exact).collect();
        Self::given(&knots, self.lengths, self.mean, self.amplitude)
    }

    /// What is not known at some places, given the values.
    pub fn unknown(&self, places: &[Place]) -> Unknown {
        let (n, m) = (self.knots.len(), places.len());
        let common = |a: &Place, b: &Place| self.amplitude * matern(distance(a, b, self.lengths));
        let mut known = Mat::from_fn(n, m, |i, j| common(&self.knots[i].at, &places[j]));
        solve_lower_triangular_in_place(self.lower.as_ref(), known.as_mut(), Par::Seq);
        let explained = known.transpose() * &known;
        let mut covariance = vec![0.0; m * m];
        for i in 0..m {
            for j in 0..m {
                covariance[i * m + j] = common(&places[i], &places[j]) - explained[(i, j)];
            }
            // What is known entirely is known up to rounding, of either sign.
            covariance[i * m + i] = covariance[i * m + i].max(0.0);
        }
        Unknown { places: m, covariance }
    }
}

/// The covariance of the errors at some places: what is not known there, and how a further reading at
/// one of them would lessen it at all.
#[derive(Debug, Clone)]
pub struct Unknown {
    places: usize,
    // Rows of a symmetric matrix.
    covariance: Vec<f64>,
}

impl Unknown {
    /// The same where the error at each place is this many times as large.
    #[must_use]
    pub fn scaled(mut self, factors: &[f64]) -> Self {
        for (row, a) in self.covariance.chunks_exact_mut(self.places.max(1)).zip(factors) {
            for (entry, b) in row.iter_mut().zip(factors) {
                *entry *= a * b;
            }
        }
        self
    }

    /// The variance of the error at a place.
    pub fn variance(&self, place: usize) -> f64 {
        self.covariance[place * self.places + place]
    }

    /// The sum of the variances at all places.
    pub fn total(&self) -> f64 {
        (0..self.places).map(|place| self.variance(place)).sum()
    }

    /// By how much that sum falls with a reading at a place, whose noise has this variance.
    pub fn reduction(&self, place: usize, noise: f64) -> f64 {
        let whole = self.variance(place) + noise;
        let squares: f64 = self.row(place).iter().map(|entry| entry * entry).sum();
        if whole > 0.0 { squares / whole } else { 0.0 }
    }

    /// A reading is taken at a place.
    pub fn learn(&mut self, place: usize, noise: f64) {
        let whole = self.variance(place) + noise;
        if whole <= 0.0 {
            return;
        }
        let learnt = self.row(place).to_vec();
        for (row, a) in self.covariance.chunks_exact_mut(self.places).zip(&learnt) {
            let factor = a / whole;
            for (entry, b) in row.iter_mut().zip(&learnt) {
                *entry -= factor * b;
            }
        }
        for i in 0..self.places {
            let at = i * self.places + i;
            self.covariance[at] = self.covariance[at].max(0.0);
        }
    }

    fn row(&self, place: usize) -> &[f64] {
        &self.covariance[place * self.places..][..self.places]
    }
}

/// Matérn's correlation of smoothness 5/2 at a distance in lengths.
fn matern(distance: f64) -> f64 {
    let r = distance * libm::sqrt(5.0);
    (1.0 + r + r * r / 3.0) * libm::exp(-r)
}

fn distance(a: &Place, b: &Place, [first, second]: [f64; 2]) -> f64 {
    let square = |i: usize| (a[i] - b[i]).powi(2);
    let of = |i: usize, length: f64| (square(i) + square(i + 1)) / (length * length);
    libm::sqrt(of(0, first) + of(2, second))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(at: &Place) -> f64 {
        3.0 + libm::sin(2.0 * at[0]) + at[1] * at[1] + 0.5 * at[2] - 0.2 * at[3] * at[0]
    }

    /// Evenly in the unit cube, by the additive recurrence R4.
    fn places(n: u32) -> Vec<Place> {
        let steps =
            [0.856_674_883_854_502_9, 0.733_891_856_627_126_8, 0.628_706_721_037_84, 0.538_6];
        (1..=n).map(|i| steps.map(|step| (f64::from(i) * step).fract())).collect()
    }

    fn knots(n: u32, variance: f64) -> Vec<Knot> {
        let of = |at: Place| Knot { at, value: field(&at), variance };
        places(n).into_iter().map(of).collect()
    }

    #[test]
    fn values_come_back_and_what_lies_between_is_close() {
        let all = knots(120, 0.0);
        let found = Kriging::likeliest(&all, &[0.3, 1.0, 3.0], &[1.0, 4.0]).unwrap();
        for knot in &all {
            assert!((found.value(&knot.at) - knot.value).abs() < 1e-3, "{knot:?}");
        }
        let at = [0.4, 0.6, 0.5, 0.5];
        assert!((found.value(&at) - field(&at)).abs() < 0.02, "{}", found.value(&at));
    }

    #[test]
    fn a_value_left_out_is_missed_by_what_the_others_say() {
        let all = knots(30, 1e-4);
        let whole = Kriging::given(&all, [0.7, 1.5], 3.5, 0.4).unwrap();
        for (i, left_out) in whole.left_out().iter().enumerate() {
            let mut others = all.clone();
            let knot = others.remove(i);
            let rest = Kriging::given(&others, [0.7, 1.5], 3.5, 0.4).unwrap();
            let error = knot.value - rest.value(&knot.at);
            let variance = rest.unknown(&[knot.at]).variance(0) + knot.variance + NUGGET * 0.4;
            assert!((left_out.error - error).abs() < 1e-8, "{left_out:?} {error}");
            assert!((left_out.variance / variance - 1.0).abs() < 1e-6, "{left_out:?} {variance}");
        }
    }

    #[test]
    fn errors_are_of_the_size_that_is_stated() {
        let found = Kriging::likeliest(&knots(60, 0.0), &[0.3, 1.0, 3.0], &[1.0, 4.0]).unwrap();
        let elsewhere: Vec<Place> = places(400).split_off(200);
        let stated = found.unknown(&elsewhere);
        let ratio = |i: usize| {
            let error = found.value(&elsewhere[i]) - field(&elsewhere[i]);
            error * error / stated.variance(i)
        };
        let mean = (0..elsewhere.len()).map(ratio).sum::<f64>() / elsewhere.len() as f64;
        assert!((0.05..4.0).contains(&mean), "{mean}");
    }

    #[test]
    fn a_further_reading_lessens_what_is_unknown_by_what_was_foretold() {
        let all = knots(40, 1e-4);
        let before = Kriging::given(&all, [0.7, 1.5], 3.5, 0.4).unwrap();
        let elsewhere: Vec<Place> = places(60).split_off(45);
        let mut unknown = before.unknown(&elsewhere);
        let noise = 1e-4 + NUGGET * 0.4;
        let foretold = unknown.total() - unknown.reduction(3, noise);
        let further = Knot { at: elsewhere[3], value: 3.3, variance: 1e-4 };
        let more = [all, vec![further]].concat();
        let after = Kriging::given(&more, [0.7, 1.5], 3.5, 0.4).unwrap().unknown(&elsewhere);
        unknown.learn(3, noise);
        assert!((after.total() / foretold - 1.0).abs() < 1e-9);
        assert!((0..15).all(|i| (after.variance(i) - unknown.variance(i)).abs() < 1e-12));
        let doubled = after.clone().scaled(&[2.0; 15]);
        assert!((doubled.total() / after.total() - 4.0).abs() < 1e-12);
    }

    #[test]
    fn noise_is_not_followed_and_bad_numbers_are_refused() {
        let noisy = |(i, knot): (usize, Knot)| {
            let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
            Knot { value: 2.0 + 0.1 * sign, variance: 0.01, ..knot }
        };
        let all: Vec<Knot> = knots(80, 0.0).into_iter().enumerate().map(noisy).collect();
        let found = Kriging::likeliest(&all, &[0.3, 1.0], &[1.0]).unwrap();
        assert!((found.value(&[0.5; 4]) - 2.0).abs() < 0.06, "{}", found.value(&[0.5; 4]));
        assert!(Kriging::new(&all[..2], [1.0, 1.0]).is_none());
        assert!(Kriging::new(&all, [0.0, 1.0]).is_none());
        let bad = Knot { value: f64::NAN, ..all[0] };
        assert!(Kriging::new(&[all[0], all[1], bad], [1.0, 1.0]).is_none());
        // Darkness is a constant like any other.
        let dark: Vec<Knot> =
            all.iter().map(|k| Knot { value: 0.0, variance: 0.0, ..*k }).collect();
        let found = Kriging::new(&dark, [1.0, 1.0]).unwrap();
        assert!(found.value(&[0.5; 4]).abs() < 1e-12);
    }
}
