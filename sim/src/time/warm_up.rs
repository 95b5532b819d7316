//! A source that warms up: its light comes to its level exponentially.

use spanned_toml::{Bounds, Problem, Table};

use super::{Interval, mean_of_decay};
use crate::levels::Levels;
use crate::stage::Stage;

/// A source that was switched on `age_s` before the device: all its light has the factor
/// 1 - a exp(-(t + age) / τ). One time constant describes the approach to thermal equilibrium of
/// a body that loses heat in proportion to its excess temperature (Newton's law of cooling), with
/// light linear in temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WarmUp {
    /// a: by what part of its level the light falls short when it is switched on. Negative for a
    /// source that begins too bright, as an LED does. At most 1.
    pub amplitude_relative: f64,
    /// τ, seconds, above 0.
    pub time_constant_s: f64,
    /// How long the source had been on when the device booted, seconds, at least 0.
    pub age_s: f64,
}

/// Ten times its level and more no source begins with.
const AMPLITUDE_MIN: f64 = -10.0;
/// More than eleven days of warming up nobody waits for.
const TIME_S_MAX: f64 = 1e6;

impl WarmUp {
    pub(super) fn read(table: Table<'_>) -> Result<Self, Problem> {
        let amplitude = Bounds::between(AMPLITUDE_MIN, 1.0);
        let read = Self {
            amplitude_relative: table.required_number("amplitude_relative", amplitude)?,
            time_constant_s: table
                .required_number("time_constant_s", Bounds::positive_up_to(TIME_S_MAX))?,
            age_s: table.number("age_s", Bounds::between(0.0, TIME_S_MAX))?.unwrap_or(0.0),
        };
        table.finish()?;
        Ok(read)
    }

    /// By how much a dwell's mean changes at most, relative to max(|reading|, noise floor): in
    /// the first dwell after the device's boot.
    pub(crate) fn influence(&self, levels: &Levels) -> f64 {
        let at_boot = self.amplitude_relative.abs() * libm::exp(-self.age_s / self.time_constant_s);
        let over_dwell = mean_of_decay(levels.dwell_s() / self.time_constant_s);
        levels.proportional(at_boot * over_dwell)
    }
}

/// The factor on all light, averaged over an ADC reading.
#[derive(Debug)]
pub(crate) struct WarmingUp {
    warm_up: WarmUp,
}

impl WarmingUp {
    pub(crate) const fn new(warm_up: WarmUp) -> Self {
        Self { warm_up }
    }

    fn factor(&self, at: Interval) -> f64 {
        let WarmUp { amplitude_relative, time_constant_s, age_s } = self.warm_up;
        let begin = (at.begin_s + age_s).max(0.0) / time_constant_s;
        let mean = mean_of_decay((at.end_s - at.begin_s) / time_constant_s);
        1.0 - amplitude_relative * libm::exp(-begin) * mean
    }
}

impl Stage for WarmingUp {
    fn pass(&mut self, at: Interval, current_a: f64) -> f64 {
        current_a * self.factor(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_light_of_an_interval_is_the_mean_over_it() {
        let warm_up = WarmUp { amplitude_relative: 0.3, time_constant_s: 2.0, age_s: 0.5 };
        let stage = WarmingUp::new(warm_up);
        // The midpoint rule's error is (Δ/n)²/24 τ² of the amplitude: 1e-9.
        let (begin_s, end_s, n) = (1.0, 4.0, 10_000);
        let sum: f64 = (0..n)
            .map(|i| {
                let t = begin_s + (end_s - begin_s) * (f64::from(i) + 0.5) / f64::from(n);
                1.0 - 0.3 * libm::exp(-(t + 0.5) / 2.0)
            })
            .sum();
        let found = stage.factor(Interval { begin_s, end_s });
        assert!((found - sum / f64::from(n)).abs() < 2e-9, "{found}");
    }

    #[test]
    fn it_ends_at_the_level_and_begins_short_of_it() {
        let warm_up = WarmUp { amplitude_relative: 0.3, time_constant_s: 2.0, age_s: 0.0 };
        let mut stage = WarmingUp::new(warm_up);
        let instant = |t: f64| Interval { begin_s: t, end_s: t };
        assert!((stage.pass(instant(0.0), 2.0) - 1.4).abs() < 1e-15);
        assert_eq!(stage.pass(instant(1e6), 2.0).to_bits(), 2.0_f64.to_bits());
    }
}
