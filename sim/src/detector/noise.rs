//! White noise: of the light's and the leakage's electrons, and of the amplifier.

use firmware_protocol::{Illumination, Instant};

use super::ELEMENTARY_CHARGE_C;
use crate::chance::Stream;
use crate::levels::Levels;
use crate::stage::Stage;
use crate::time::Interval;

/// The names that noise is keyed by. Changing one changes every simulated run.
const SHOT_NOISE_KEY: &str = "shot noise";
const READ_NOISE_KEY: &str = "read noise";

/// Normal numbers that begin anew with every dwell.
#[derive(Debug)]
pub(super) struct Noise {
    seed: u64,
    effect: &'static str,
    stream: Stream,
}

impl Noise {
    pub(super) fn new(seed: u64, effect: &'static str) -> Self {
        Self { seed, effect, stream: Stream::new(seed, effect, 0) }
    }

    pub(super) fn begin(&mut self, reading: u32) {
        self.stream = Stream::new(self.seed, self.effect, u64::from(reading));
    }

    pub(super) fn normal(&mut self) -> f64 {
        self.stream.normal()
    }
}

/// Schottky (1918): a current I averaged over a time t has the variance q I / t. Light and
/// leakage alike.
#[derive(Debug)]
pub(crate) struct ShotNoise {
    charge_times_rate: f64,
    noise: Noise,
}

impl ShotNoise {
    pub(crate) fn new(rate_hz: u32, seed: u64) -> Self {
        Self {
            charge_times_rate: ELEMENTARY_CHARGE_C * f64::from(rate_hz),
            noise: Noise::new(seed, SHOT_NOISE_KEY),
        }
    }

    /// The standard deviation of a dwell's mean, relative to max(|reading|, noise floor), of the
    /// signal where that is largest, with so much dark current.
    pub(crate) fn influence(dark_a: f64, levels: &Levels) -> f64 {
        let charge_over_time = ELEMENTARY_CHARGE_C / levels.dwell_s();
        levels.of_root(|signal_a| libm::sqrt(charge_over_time * (signal_a + dark_a.abs())))
    }
}

impl Stage for ShotNoise {
    fn begin(&mut self, _now: Instant, dwell: Illumination) {
        self.noise.begin(dwell.reading);
    }

    fn pass(&mut self, _at: Interval, current_a: f64) -> f64 {
        let variance = self.charge_times_rate * libm::fabs(current_a);
        current_a + libm::sqrt(variance) * self.noise.normal()
    }
}

/// A normal number for each ADC reading, of one standard deviation: the amplifier's and the
/// converter's white noise, referred to the input.
#[derive(Debug)]
pub(crate) struct ReadNoise {
    sigma_a: f64,
    noise: Noise,
}

impl ReadNoise {
    pub(crate) fn new(sigma_a: f64, seed: u64) -> Self {
        Self { sigma_a, noise: Noise::new(seed, READ_NOISE_KEY) }
    }

    /// The standard deviation of a dwell's mean, relative to max(|reading|, noise floor).
    pub(crate) fn influence(sigma_a: f64, levels: &Levels) -> f64 {
        levels.noise(sigma_a / libm::sqrt(f64::from(levels.readings())))
    }
}

impl Stage for ReadNoise {
    fn begin(&mut self, _now: Instant, dwell: Illumination) {
        self.noise.begin(dwell.reading);
    }

    fn pass(&mut self, _at: Interval, current_a: f64) -> f64 {
        current_a + self.sigma_a * self.noise.normal()
    }
}
