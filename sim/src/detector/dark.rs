//! Current without light, and how it changes with time.

use super::HOUR_S;
use crate::levels::Levels;
use crate::stage::Stage;
use crate::time::Interval;

/// A photodiode's leakage: the same current whether the shutter is open or closed.
#[derive(Debug)]
pub(crate) struct DarkCurrent {
    pub(crate) dark_a: f64,
}

impl DarkCurrent {
    /// Relative to max(|reading|, noise floor).
    pub(crate) fn influence(dark_a: f64, levels: &Levels) -> f64 {
        levels.additive(dark_a)
    }
}

impl Stage for DarkCurrent {
    fn pass(&mut self, _at: Interval, current_a: f64) -> f64 {
        current_a + self.dark_a
    }
}

/// The dark current's change: linear in the device's time, as that of a diode whose temperature
/// drifts by little. (It doubles with every 8 to 10 K of a silicon diode: +0.1 K an hour is
/// +0.8 % an hour.)
#[derive(Debug)]
pub(crate) struct DarkDrift {
    a_per_s: f64,
}

impl DarkDrift {
    pub(crate) fn new(dark_a: f64, relative_per_h: f64) -> Self {
        Self { a_per_s: dark_a * relative_per_h / HOUR_S }
    }

    /// At the end of the run, relative to max(|reading|, noise floor).
    pub(crate) fn influence(&self, levels: &Levels) -> f64 {
        levels.additive(self.a_per_s * levels.run_s())
    }
}

impl Stage for DarkDrift {
    fn pass(&mut self, at: Interval, current_a: f64) -> f64 {
        current_a + self.a_per_s * at.middle_s()
    }
}
