//! What happens to the detector's current on its way from the light to the converter, one stage
//! an effect. A stage that is not called for is not in the list, so that nothing asks for it at
//! run time.

use core::fmt;

use firmware_protocol::{Illumination, Instant};

use crate::time::Interval;

/// One thing that happens to a current.
pub(crate) trait Stage: fmt::Debug + Send {
    /// The detector is set for a dwell: shutter and gain change now.
    fn prepare(&mut self, _now: Instant, _next: Illumination) {}
    /// A dwell begins to integrate. Its readings' noise depends on its name alone.
    fn begin(&mut self, _now: Instant, _dwell: Illumination) {}
    /// The mean current over the interval of one ADC reading, amperes.
    fn pass(&mut self, at: Interval, current_a: f64) -> f64;
}

/// Stages in the order in which a current meets them.
#[derive(Debug, Default)]
pub(crate) struct Stages(Vec<Box<dyn Stage>>);

impl Stages {
    pub(crate) fn push(&mut self, stage: impl Stage + 'static) {
        self.0.push(Box::new(stage));
    }

    pub(crate) fn prepare(&mut self, now: Instant, next: Illumination) {
        for stage in &mut self.0 {
            stage.prepare(now, next);
        }
    }

    pub(crate) fn begin(&mut self, now: Instant, dwell: Illumination) {
        for stage in &mut self.0 {
            stage.begin(now, dwell);
        }
    }

    pub(crate) fn pass(&mut self, at: Interval, current_a: f64) -> f64 {
        self.0.iter_mut().fold(current_a, |current_a, stage| stage.pass(at, current_a))
    }
}
