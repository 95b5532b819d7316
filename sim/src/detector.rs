//! From a photocurrent to counts: just the stages that the rig calls for, one after the other.
//! A stage that is not called for is not in the list, so that nothing asks for it at run time.

mod effects;

use core::fmt;

pub(crate) use effects::{candidates, dark_current_a, departing};

use crate::NominalDetector;
use crate::chance::Stream;
use crate::effect::Chosen;

/// The elementary charge, coulombs; exact since 2019 (SI).
pub(crate) const ELEMENTARY_CHARGE_C: f64 = 1.602_176_634e-19;

/// The names that noise is keyed by. Changing one changes every simulated run.
pub(crate) const SHOT_NOISE: &str = "shot noise";
pub(crate) const READ_NOISE: &str = "read noise";

/// One thing that happens to a current between photodiode and converter.
pub(crate) trait Stage: fmt::Debug + Send {
    /// A dwell begins. Its readings' noise depends on its name alone.
    fn begin(&mut self, _reading: u32) {}
    /// One ADC reading's current, amperes.
    fn pass(&mut self, current_a: f64) -> f64;
}

/// The stages in the order in which a current meets them.
#[derive(Debug)]
pub(crate) struct Stages(Vec<Box<dyn Stage>>);

impl Stages {
    /// Those that were chosen; `detector` is without the departures that were not.
    pub(crate) fn chosen(
        detector: &NominalDetector,
        dark_a: f64,
        seed: u64,
        chosen: &Chosen,
    ) -> Self {
        let mut stages: Vec<Box<dyn Stage>> = Vec::new();
        if dark_a != 0.0 {
            stages.push(Box::new(DarkCurrent { dark_a }));
        }
        let rate_hz = f64::from(detector.adc_rate_hz);
        if chosen.has("shot-noise") {
            stages.push(Box::new(ShotNoise {
                charge_times_rate: ELEMENTARY_CHARGE_C * rate_hz,
                noise: Noise::new(seed, SHOT_NOISE),
            }));
        }
        if detector.read_noise_a > 0.0 {
            let sigma_a = detector.read_noise_a;
            stages.push(Box::new(ReadNoise { sigma_a, noise: Noise::new(seed, READ_NOISE) }));
        }
        Self(stages)
    }

    pub(crate) fn begin(&mut self, reading: u32) {
        for stage in &mut self.0 {
            stage.begin(reading);
        }
    }

    pub(crate) fn pass(&mut self, current_a: f64) -> f64 {
        self.0.iter_mut().fold(current_a, |current_a, stage| stage.pass(current_a))
    }
}

#[derive(Debug)]
struct DarkCurrent {
    dark_a: f64,
}

impl Stage for DarkCurrent {
    fn pass(&mut self, current_a: f64) -> f64 {
        current_a + self.dark_a
    }
}

/// Normal numbers that begin anew with every dwell.
#[derive(Debug)]
struct Noise {
    seed: u64,
    effect: &'static str,
    stream: Stream,
}

impl Noise {
    fn new(seed: u64, effect: &'static str) -> Self {
        Self { seed, effect, stream: Stream::new(seed, effect, 0) }
    }

    fn begin(&mut self, reading: u32) {
        self.stream = Stream::new(self.seed, self.effect, u64::from(reading));
    }
}

/// Schottky (1918): a current I averaged over a time t has the variance q I / t. Light and
/// leakage alike.
#[derive(Debug)]
struct ShotNoise {
    charge_times_rate: f64,
    noise: Noise,
}

impl Stage for ShotNoise {
    fn begin(&mut self, reading: u32) {
        self.noise.begin(reading);
    }

    fn pass(&mut self, current_a: f64) -> f64 {
        let variance = self.charge_times_rate * libm::fabs(current_a);
        current_a + libm::sqrt(variance) * self.noise.stream.normal()
    }
}

#[derive(Debug)]
struct ReadNoise {
    sigma_a: f64,
    noise: Noise,
}

impl Stage for ReadNoise {
    fn begin(&mut self, reading: u32) {
        self.noise.begin(reading);
    }

    fn pass(&mut self, current_a: f64) -> f64 {
        current_a + self.sigma_a * self.noise.stream.normal()
    }
}

/// Gain ranges as they are, and the converter behind them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Amplifier {
    counts_per_a: Vec<f64>,
    low: f64,
    high: f64,
}

impl Amplifier {
    pub(crate) fn new(full_scales_a: &[f64], bits: u8) -> Self {
        let full_scale = libm::scalbn(1.0, i32::from(bits) - 1);
        let counts_per_a = full_scales_a.iter().map(|current| full_scale / current).collect();
        Self { counts_per_a, low: -full_scale, high: full_scale - 1.0 }
    }

    /// Counts of a current in a gain range; the ends of the range are where it saturates. `None`
    /// for a range that isn't there.
    #[allow(clippy::cast_possible_truncation)] // within 32 bits, signed
    pub(crate) fn convert(&self, gain: u8, current_a: f64) -> Option<i32> {
        let counts = current_a * self.counts_per_a.get(usize::from(gain))?;
        Some(libm::round(counts).clamp(self.low, self.high) as i32)
    }
}
