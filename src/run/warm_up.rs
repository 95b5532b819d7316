//! The warm-up gate: when a source has become stable, told from readings of the reference pose.
//!
//! Time is the device's, handed in with the readings.

use std::collections::VecDeque;

use crate::plan::WarmUp;

/// Fewer readings than this say nothing about stability.
const READINGS_MIN: usize = 3;
/// Readings kept: a window with more of them is taken as full.
const READINGS_MAX: usize = 100_000;

/// What the readings so far say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Stability {
    /// Go on waiting.
    NotYet,
    /// Stable.
    Stable,
    /// Waited long enough, in vain.
    TimedOut {
        /// How long, seconds.
        waited_s: f64,
        /// The change over the window, relative, if there was enough to tell.
        change_relative: Option<f64>,
    },
}

/// Watches readings until they are stable.
#[derive(Debug, Clone)]
pub(super) struct Gate {
    asked: WarmUp,
    began_s: Option<f64>,
    // Time in seconds, mean in counts, in order of time, as long as is asked for.
    window: VecDeque<(f64, f64)>,
}

impl Gate {
    /// A gate that saw nothing yet.
    pub(super) fn new(asked: WarmUp) -> Self {
        Self { asked, began_s: None, window: VecDeque::new() }
    }

    /// Takes a reading: its time in seconds on any clock that only goes forward, its mean in
    /// counts.
    pub(super) fn take(&mut self, time_s: f64, mean: f64) -> Stability {
        let (over_s, timeout_s) = (self.asked.over.as_secs_f64(), self.asked.timeout.as_secs_f64());
        let began_s = *self.began_s.get_or_insert(time_s);
        self.window.push_back((time_s, mean));
        while self.window.len() > READINGS_MAX
            || self.window.get(1).is_some_and(|next| time_s - next.0 >= over_s)
        {
            self.window.pop_front();
        }
        let waited_s = time_s - began_s;
        let change_relative = self.change_relative();
        let is_full = self.window.front().is_some_and(|first| time_s - first.0 >= over_s);
        match change_relative {
            Some(change) if is_full && change <= self.asked.tolerance_relative => Stability::Stable,
            _ if waited_s >= timeout_s => Stability::TimedOut { waited_s, change_relative },
            _ => Stability::NotYet,
        }
    }

    /// Highest less lowest over the window, relative to the mean.
    fn change_relative(&self) -> Option<f64> {
        if self.window.len() < READINGS_MIN {
            return None;
        }
        let means = || self.window.iter().map(|reading| reading.1);
        let mean = means().sum::<f64>() / self.window.len() as f64;
        let change = (means().fold(f64::MIN, f64::max) - means().fold(f64::MAX, f64::min)) / mean;
        // Without light there is nothing to be stable.
        (change.is_finite() && mean > 0.0).then_some(change)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    const ASKED: WarmUp = WarmUp {
        tolerance_relative: 0.002,
        over: Duration::from_mins(1),
        timeout: Duration::from_mins(30),
    };

    /// When an exponential warm-up with time constant `tau_s` passes, read every two seconds.
    fn passes_at(amplitude: f64, tau_s: f64) -> Option<f64> {
        let mut gate = Gate::new(ASKED);
        for n in 0..2000 {
            let t = f64::from(n) * 2.0;
            match gate.take(t, 1e5 * (1.0 - amplitude * (-t / tau_s).exp())) {
                Stability::NotYet => {}
                Stability::Stable => return Some(t),
                Stability::TimedOut { .. } => return None,
            }
        }
        None
    }

    #[test]
    fn a_steady_source_passes_after_one_window() {
        assert_eq!(passes_at(0.0, 1.0), Some(60.0));
    }

    #[test]
    fn an_exponential_warm_up_passes_when_its_slope_has_died() {
        // Over the window before t it rose by a (exp(60/tau) - 1) exp(-t/tau); 0.2 % of that is at
        let at = passes_at(0.1, 120.0).unwrap();
        let expected = 120.0 * (0.1 * (60.0_f64 / 120.0).exp_m1() / 0.002).ln();
        assert!((at - expected).abs() < 3.0, "{at} s, expected about {expected} s");
    }

    #[test]
    fn a_drifting_source_times_out_and_says_by_how_much() {
        let mut gate = Gate::new(ASKED);
        let mut t = 0.0;
        let end = loop {
            match gate.take(t, 1e5 * (1.0 + 1e-4 * t)) {
                Stability::NotYet => t += 10.0,
                other => break other,
            }
        };
        let Stability::TimedOut { waited_s, change_relative: Some(change) } = end else {
            panic!("{end:?}");
        };
        assert!((waited_s - 1800.0).abs() < 11.0);
        assert!((change - 60.0 * 1e-4 / 1.18).abs() < 2e-4, "{change}");
    }

    #[test]
    fn darkness_never_counts_as_stable() {
        let mut gate = Gate::new(ASKED);
        let last = (0..1000).map(|n| gate.take(f64::from(n) * 2.0, 0.0)).last().unwrap();
        assert!(matches!(last, Stability::TimedOut { change_relative: None, .. }));
    }
}
