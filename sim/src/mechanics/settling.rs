//! How an axis comes to rest after a stop.

use crate::NominalAxis;

/// It is behind by what its servo lags at the axis's acceleration, or by its whole move if that is
/// shorter, and comes in as (1 - t/T)³: at rest exactly after the time T.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Settling {
    time_s: f64,
    lag_counts: f64,
}

/// A critically damped servo whose error falls as (1 - t/T)³ begins with a time constant of T/3:
/// it lags a constant acceleration a by a (T/3)².
const LAG_PART_OF_TIME: f64 = 1.0 / 3.0;

impl Settling {
    /// `time_s`: T. `None` for an axis that is at rest at once.
    pub(super) fn new(axis: &NominalAxis, time_s: f64) -> Option<Self> {
        let lag_s = time_s * LAG_PART_OF_TIME;
        let lag_counts = f64::from(axis.acceleration_counts_per_s2) * lag_s * lag_s;
        (time_s > 0.0).then_some(Self { time_s, lag_counts })
    }

    /// By how much it is behind at most, counts.
    pub(super) const fn lag_counts(&self) -> f64 {
        self.lag_counts
    }

    /// By how much it is ahead at the stop after a move, counts: it is behind.
    pub(super) const fn after(&self, moved_counts: f64) -> f64 {
        -moved_counts.clamp(-self.lag_counts, self.lag_counts)
    }

    /// By how much it is ahead at an acceleration of this part of the axis's own: it is behind.
    pub(super) const fn lagging(&self, part: f64) -> f64 {
        -self.lag_counts * part.clamp(-1.0, 1.0)
    }

    /// What is left of that, as a part, so many seconds after the stop.
    pub(super) fn left(&self, since_s: f64) -> f64 {
        let rest = (1.0 - since_s / self.time_s).max(0.0);
        rest * rest * rest
    }

    /// The mean of what is left from one moment to a later one.
    pub(super) fn mean_left(&self, from_s: f64, to_s: f64) -> f64 {
        let fourth = |since_s: f64| {
            let rest = (1.0 - since_s / self.time_s).max(0.0);
            rest * rest * rest * rest
        };
        self.time_s / 4.0 * (fourth(from_s) - fourth(to_s)) / (to_s - from_s)
    }

    /// T, seconds.
    pub(super) const fn lasts_s(&self) -> f64 {
        self.time_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTLING: Settling = Settling { time_s: 0.06, lag_counts: 20.0 };

    #[test]
    fn it_is_behind_by_its_lag_at_most_and_at_rest_when_its_time_is_over() {
        assert_eq!((SETTLING.after(500.0), SETTLING.after(-3.0)), (-20.0, 3.0));
        assert_eq!(SETTLING.left(0.0).to_bits(), 1.0_f64.to_bits());
        assert!((SETTLING.left(0.03) - 0.125).abs() < 1e-15);
        assert_eq!((SETTLING.left(0.06), SETTLING.left(1.0)), (0.0, 0.0));
    }

    #[test]
    fn the_mean_is_that_of_many_moments() {
        for (from, to) in [(0.0, 0.06), (0.05, 0.15), (0.01, 0.02), (0.07, 0.1)] {
            let moments = (0..10_000).map(|k| from + (to - from) * (f64::from(k) + 0.5) / 1e4);
            let expected = moments.map(|at| SETTLING.left(at)).sum::<f64>() / 1e4;
            let found = SETTLING.mean_left(from, to);
            assert!((found - expected).abs() < 1e-8, "{from} to {to}: {found}, {expected}");
        }
    }
}
