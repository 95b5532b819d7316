//! A responsivity that drifts.

use spanned_toml::{Bounds, Problem, Table};

use super::wiener::Wiener;
use super::{HOUR_S, name};
use crate::levels::Levels;
use crate::stage::Stage;
use crate::time::Interval;

/// The light's current has the factor 1 + r t + w W(t): a steady loss or gain, and a random walk
/// (Brownian motion), both in the device's time t. A resumed run boots the device, and with it the
/// drift, anew: the reference readings tell, as they would on a real rig.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Drift {
    /// r, of the responsivity, an hour.
    pub relative_per_h: f64,
    /// w: the random walk's standard deviation after an hour; it grows with the root of time.
    pub random_walk_relative_per_root_h: f64,
}

const RELATIVE_MAX: f64 = 1.0;

impl Drift {
    pub(super) fn read(table: Table<'_>) -> Result<Self, Problem> {
        let relative = Bounds::between(-RELATIVE_MAX, RELATIVE_MAX);
        let walk = Bounds::between(0.0, RELATIVE_MAX);
        let read = Self {
            relative_per_h: table.number("relative_per_h", relative)?.unwrap_or(0.0),
            random_walk_relative_per_root_h: table
                .number("random_walk_relative_per_root_h", walk)?
                .unwrap_or(0.0),
        };
        table.finish()?;
        Ok(read)
    }

    /// The root of the mean square of what has drifted at the end of the run, relative to
    /// max(|reading|, noise floor).
    pub(crate) fn influence(&self, levels: &Levels) -> f64 {
        let hours = levels.run_s() / HOUR_S;
        let walked = self.random_walk_relative_per_root_h * libm::sqrt(hours);
        levels.proportional(libm::hypot(self.relative_per_h * hours, walked))
    }

    /// Whether nothing drifts.
    pub fn is_none(&self) -> bool {
        self.relative_per_h == 0.0 && self.random_walk_relative_per_root_h == 0.0
    }
}

/// The factor on the light's current.
#[derive(Debug)]
pub(crate) struct Drifting {
    relative_per_s: f64,
    relative_per_root_s: f64,
    path: Wiener,
}

impl Drifting {
    pub(crate) fn new(drift: &Drift, seed: u64) -> Self {
        Self {
            relative_per_s: drift.relative_per_h / HOUR_S,
            relative_per_root_s: drift.random_walk_relative_per_root_h / libm::sqrt(HOUR_S),
            path: Wiener::new(seed, name::DETECTOR_DRIFT),
        }
    }
}

impl Stage for Drifting {
    fn pass(&mut self, at: Interval, current_a: f64) -> f64 {
        let t = at.middle_s();
        let walked = if self.relative_per_root_s > 0.0 { self.path.at(t) } else { 0.0 };
        current_a * (1.0 + self.relative_per_s * t + self.relative_per_root_s * walked)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(t: f64) -> Interval {
        Interval { begin_s: t, end_s: t }
    }

    #[test]
    fn a_steady_drift_is_its_rate_times_time() {
        let drift = Drift { relative_per_h: -0.01, ..Drift::default() };
        let mut stage = Drifting::new(&drift, 1);
        assert!((stage.pass(at(1800.0), 2.0) - 2.0 * 0.995).abs() < 1e-14);
        let bound = drift.influence(&Levels::bright(1e-9, 2000, 0.05));
        assert!((bound - 0.01).abs() < 1e-14, "{bound}");
    }

    #[test]
    fn a_random_walk_spreads_as_stated() {
        let drift = Drift { random_walk_relative_per_root_h: 0.01, ..Drift::default() };
        let rms = |t: f64| {
            let squares = (0..3000).map(|seed| {
                let drifted = Drifting::new(&drift, seed).pass(at(t), 1.0) - 1.0;
                drifted * drifted
            });
            libm::sqrt(squares.sum::<f64>() / 3000.0)
        };
        // The standard error is 1.3 %.
        assert!((rms(3600.0) / 0.01 - 1.0).abs() < 0.06);
        assert!((rms(900.0) / 0.005 - 1.0).abs() < 0.06);
    }

    #[test]
    fn the_bound_is_the_spread_at_the_end_of_the_run() {
        let drift = Drift { relative_per_h: 0.002, random_walk_relative_per_root_h: 0.004 };
        let levels = Levels::new((1e-9, 1e-9), 1e-15, 2000, (0.05, 600.0));
        let squares = (0..3000).map(|seed| {
            let drifted = Drifting::new(&drift, seed).pass(at(600.0), 1.0) - 1.0;
            drifted * drifted
        });
        let (found, bound) = (libm::sqrt(squares.sum::<f64>() / 3000.0), drift.influence(&levels));
        assert!((found / bound - 1.0).abs() < 0.06, "{found} beside {bound}");
    }
}
