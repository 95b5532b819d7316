//! Readings without a device: the compiled rig looked through from given poses, for benches, tests
//! and whoever wants to know what an effect costs. It does not know time: nothing has warmed up
//! when a sampler begins, and readings follow each other without a pause.

use core::time::Duration;
use std::sync::Arc;

use firmware_protocol::{Illumination, Instant, Shutter};

use crate::Compiled;
use crate::stage::Stages;
use crate::time::Interval;

/// A compiled rig without its wire and its motors: joints in, counts out. Each axis stands where
/// it is said to.
#[derive(Debug)]
pub struct Sampler {
    compiled: Arc<Compiled>,
    stages: Stages,
    gain: u8,
    reading_us: u64,
    reading_s: f64,
    now: Instant,
}

impl Sampler {
    /// In this gain range, with the noise of reading 0.
    pub fn new(compiled: &Arc<Compiled>, gain: u8) -> Self {
        let rate_hz = compiled.nominal.detector.adc_rate_hz;
        let mut sampler = Self {
            stages: compiled.stages(),
            compiled: Arc::clone(compiled),
            gain,
            reading_us: 1_000_000 / u64::from(rate_hz),
            reading_s: 1.0 / f64::from(rate_hz),
            now: Instant::ZERO,
        };
        sampler.begin(0);
        sampler
    }

    /// Another reading begins, with noise of its own.
    pub fn begin(&mut self, reading: u32) {
        let illumination = Illumination { reading, gain: self.gain, shutter: Shutter::Open };
        self.stages.prepare(self.now, illumination);
        self.stages.begin(self.now, illumination);
    }

    /// One value of the converter with the joints θ, φ (radians), x, y (metres) standing so.
    /// `None` in a gain range that is none.
    pub fn convert(&mut self, joints: [f64; 4]) -> Option<i32> {
        let light_a = self.photocurrent_a(joints);
        self.pass(light_a)
    }

    /// The mean of a reading of so many values at one pose, counts.
    pub fn dwell(&mut self, reading: u32, joints: [f64; 4], values: u32) -> Option<f64> {
        self.begin(reading);
        let light_a = self.photocurrent_a(joints);
        let mut sum = 0.0;
        for _ in 0..values {
            sum += f64::from(self.pass(light_a)?);
        }
        Some(sum / f64::from(values))
    }

    /// The light's current, amperes.
    pub fn photocurrent_a(&self, joints: [f64; 4]) -> f64 {
        let axis = self.compiled.drawn.kinematics.seen(joints);
        self.compiled.optics.radiance(&axis) * self.compiled.drawn.current_per_radiance
    }

    fn pass(&mut self, light_a: f64) -> Option<i32> {
        self.now = self.now + Duration::from_micros(self.reading_us);
        let current_a = self.stages.pass(Interval::ending(self.now, self.reading_s), light_a);
        self.compiled.drawn.amplifier.convert(self.gain, current_a)
    }
}
