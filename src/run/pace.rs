//! What is left of a run, truthfully: the plan's prediction, scaled by how it fared so far.

use crate::plan::{Step, StepTime, TimeLeft};
use crate::rig::{Latched, Reading, Rig};

/// Steps after which the prediction is scaled by what was measured.
const STEPS_MIN: u32 = 5;
/// A scale beyond these bounds says that something else happened.
const SCALE: (f64, f64) = (0.25, 10.0);

/// See the module.
#[derive(Debug, Clone)]
pub(super) struct Pace {
    left: TimeLeft,
    done: usize,
    // Where the last reading was taken, and when it ended; `None` after an interruption.
    last: Option<(Latched, f64)>,
    measured_s: f64,
    predicted_s: f64,
    steps: u32,
}

impl Pace {
    /// Of the steps that are left to do, in order.
    pub(super) fn new(rig: &Rig, steps: &[Step]) -> Self {
        let left = TimeLeft::of(rig, steps);
        Self { left, done: 0, last: None, measured_s: 0.0, predicted_s: 0.0, steps: 0 }
    }

    /// A step has its reading, which ended at `end_s`.
    pub(super) fn step(&mut self, rig: &Rig, step: &Step, reading: &Reading, end_s: f64) {
        self.done += 1;
        if let Some((from, since_s)) = self.last {
            self.measured_s += end_s - since_s;
            self.predicted_s += StepTime::of(rig, from, step).total_s();
            self.steps += 1;
        }
        self.last = Some((reading.commanded, end_s));
    }

    /// What comes next is no measure of pace: a pause, a fault, a warm-up reading.
    pub(super) fn interrupt(&mut self) {
        self.last = None;
    }

    /// Rig time that is left, seconds.
    pub(super) fn rest_s(&self) -> f64 {
        let is_known = self.steps >= STEPS_MIN && self.predicted_s > 0.0;
        let scale = if is_known { self.measured_s / self.predicted_s } else { 1.0 };
        self.left.at(self.done).as_secs_f64() * scale.clamp(SCALE.0, SCALE.1)
    }
}
