//! An amplifier that settles after its range was changed.

use firmware_protocol::{Illumination, Instant};
use spanned_toml::{Bounds, Problem, Table};

use crate::levels::Levels;
use crate::stage::Stage;
use crate::time::{Interval, mean_of_decay, seconds};

/// A change of range injects a charge into the amplifier's input, which leaks away through the
/// feedback: an offset that decays exponentially, a single pole's step response.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GainSwitching {
    /// The offset right after the change, as a part of the new range's full scale.
    pub step_relative: f64,
    /// Its time constant, seconds, above 0.
    pub time_constant_s: f64,
}

const TIME_MS_MAX: f64 = 1e6;

impl GainSwitching {
    pub(super) fn read(table: Table<'_>) -> Result<Self, Problem> {
        let time_ms =
            table.required_number("time_constant_ms", Bounds::positive_up_to(TIME_MS_MAX))?;
        let read = Self {
            step_relative: table.required_number("step_relative", Bounds::between(-1.0, 1.0))?,
            time_constant_s: time_ms / 1e3,
        };
        table.finish()?;
        Ok(read)
    }
}

/// The offset, averaged over an ADC reading. Which dwell has one depends on the range of the
/// dwell before: after a resume the device begins in its first range, and the first dwell of
/// another may have an offset that it had not in an uninterrupted run.
#[derive(Debug)]
pub(crate) struct Switching {
    time_constant_s: f64,
    /// One a range, amperes.
    steps_a: Vec<f64>,
    gain: u8,
    step_a: f64,
    switched_s: f64,
}

impl Switching {
    pub(crate) fn new(switching: &GainSwitching, full_scales_a: &[f64]) -> Self {
        let step_a = |full_scale_a: &f64| switching.step_relative * full_scale_a;
        Self {
            time_constant_s: switching.time_constant_s,
            steps_a: full_scales_a.iter().map(step_a).collect(),
            gain: 0,
            step_a: 0.0,
            switched_s: 0.0,
        }
    }

    /// Of a dwell that begins at the change of range, relative to max(|reading|, noise floor):
    /// the largest of those ranges that hold the region's smallest signal.
    pub(crate) fn influence(&self, full_scales_a: &[f64], levels: &Levels) -> f64 {
        let over_dwell = mean_of_decay(levels.dwell_s() / self.time_constant_s);
        let holding = self.steps_a.iter().zip(full_scales_a);
        let holding = holding.filter(|(_, full_scale_a)| **full_scale_a > levels.lowest_a());
        levels.additive(holding.map(|(step_a, _)| step_a.abs()).fold(0.0, f64::max) * over_dwell)
    }

    fn switch(&mut self, now: Instant, gain: u8) {
        if gain != self.gain {
            self.gain = gain;
            self.step_a = self.steps_a.get(usize::from(gain)).copied().unwrap_or(0.0);
            self.switched_s = seconds(now);
        }
    }
}

impl Stage for Switching {
    fn prepare(&mut self, now: Instant, next: Illumination) {
        self.switch(now, next.gain);
    }

    fn begin(&mut self, now: Instant, dwell: Illumination) {
        self.switch(now, dwell.gain);
    }

    fn pass(&mut self, at: Interval, current_a: f64) -> f64 {
        let since = (at.begin_s - self.switched_s).max(0.0) / self.time_constant_s;
        let mean = mean_of_decay((at.end_s - at.begin_s) / self.time_constant_s);
        current_a + self.step_a * libm::exp(-since) * mean
    }
}

#[cfg(test)]
mod tests {
    use core::time::Duration;

    use firmware_protocol::Shutter;

    use super::*;

    const FULL_SCALES_A: [f64; 2] = [1e-6, 1e-8];

    fn switching() -> Switching {
        let stated = GainSwitching { step_relative: 0.01, time_constant_s: 0.02 };
        Switching::new(&stated, &FULL_SCALES_A)
    }

    fn dwell(stage: &mut Switching, now: Instant, gain: u8) -> f64 {
        let illumination = Illumination { reading: 0, gain, shutter: Shutter::Open };
        stage.prepare(now, illumination);
        stage.begin(now, illumination);
        let readings = (1..=100).map(|k| {
            let end = now + Duration::from_micros(500 * k);
            stage.pass(Interval::ending(end, 5e-4), 0.0)
        });
        readings.sum::<f64>() / 100.0
    }

    #[test]
    fn only_a_change_of_range_steps_and_it_decays() {
        let mut stage = switching();
        let at = |ms: u64| Instant::from_micros(ms * 1000);
        assert_eq!(dwell(&mut stage, at(0), 0).to_bits(), 0, "the range that it boots with");
        let stepped = dwell(&mut stage, at(1000), 1);
        assert!((stepped / (1e-10 * mean_of_decay(2.5)) - 1.0).abs() < 1e-12, "{stepped}");
        assert!(dwell(&mut stage, at(1050), 1) < 0.1 * stepped, "the same range again");
        let back = dwell(&mut stage, at(2000), 0);
        assert!((back / (1e-8 * mean_of_decay(2.5)) - 1.0).abs() < 1e-12, "{back}");
    }

    #[test]
    fn the_bound_is_met_by_a_dwell_that_does_not_wait() {
        let levels = Levels::bright(1e-9, 2000, 0.05);
        let bound = switching().influence(&FULL_SCALES_A, &levels);
        let worst = dwell(&mut switching(), Instant::from_micros(7), 1).max({
            let mut stage = switching();
            dwell(&mut stage, Instant::ZERO, 1);
            dwell(&mut stage, Instant::from_micros(1_000_000), 0)
        });
        assert!((worst / (1e-9 + worst) / bound - 1.0).abs() < 1e-9, "{worst} beside {bound}");
    }
}
