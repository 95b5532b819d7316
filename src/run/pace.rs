//! What is left of a run, truthfully: the plan's prediction, scaled by how it fared so far, and
//! less what has passed since it was made.
//!
//! It has no clock: run time is handed in.

use crate::plan::{Prediction, Step, StepTime, TimeLeft};
use crate::rig::{Latched, Rig};

/// Steps after which the prediction is scaled by what was measured.
const STEPS_MIN: u32 = 5;
/// A scale beyond these bounds says that something else happened.
const SCALE: (f64, f64) = (0.25, 10.0);

/// See the module.
#[derive(Debug, Clone)]
pub(super) struct Pace {
    left: TimeLeft,
    done: usize,
    // How long homing takes that is to come or goes on.
    homing_s: f64,
    // Run time since which the next step, or homing, is under way.
    since_s: f64,
    // Where the last reading was taken, and when it ended; `None` after an interruption.
    last: Option<(Latched, f64)>,
    measured_s: f64,
    predicted_s: f64,
    steps: u32,
}

impl Pace {
    /// Of the steps that are left to do, in order, from this run time on.
    pub(super) fn new(rig: &Rig, steps: &[Step], now_s: f64) -> Self {
        Self {
            left: TimeLeft::of(rig, steps),
            done: 0,
            homing_s: 0.0,
            since_s: now_s,
            last: None,
            measured_s: 0.0,
            predicted_s: 0.0,
            steps: 0,
        }
    }

    /// The axes' position is trusted or not: whether they home before they measure.
    pub(super) fn trust(&mut self, rig: &Rig, is_trusted: bool) {
        self.homing_s = if is_trusted { 0.0 } else { Prediction::homing_s_of(rig) };
    }

    /// A step has its reading, which ended at `end_s`.
    pub(super) fn step(&mut self, rig: &Rig, step: &Step, end_s: f64) {
        self.done += 1;
        if let Some((from, since_s)) = self.last {
            self.measured_s += end_s - since_s;
            self.predicted_s += StepTime::of(rig, from, step).total_s();
            self.steps += 1;
        }
        self.last = Some((step.rests_at(rig), end_s));
        self.since_s = end_s;
    }

    /// What comes next is no measure of pace, and begins now: after a pause, a fault, a warm-up
    /// reading, homing.
    pub(super) fn interrupt(&mut self, now_s: f64) {
        self.last = None;
        self.since_s = now_s;
    }

    /// Only these steps are still wanted.
    pub(super) fn conclude(&mut self, rig: &Rig, closing: &[Step]) {
        self.left = TimeLeft::of(rig, closing);
        self.done = 0;
    }

    /// All steps are done, and these follow.
    pub(super) fn extend(&mut self, rig: &Rig, steps: &[Step]) {
        self.left = TimeLeft::of(rig, steps);
        self.done = 0;
    }

    /// Rig time that is left, seconds. Something that takes longer than predicted is always about
    /// to end.
    pub(super) fn rest_s(&self, now_s: f64) -> f64 {
        let is_known = self.steps >= STEPS_MIN && self.predicted_s > 0.0;
        let scale = if is_known { self.measured_s / self.predicted_s } else { 1.0 };
        let scale = scale.clamp(SCALE.0, SCALE.1);
        let left_s = |step: usize| self.left.at(step).as_secs_f64() * scale;
        let passed_s = (now_s - self.since_s).max(0.0);
        if self.homing_s > 0.0 {
            return (self.homing_s - passed_s).max(0.0) + left_s(self.done);
        }
        (left_s(self.done) - passed_s).max(left_s(self.done + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Plan;

    #[test]
    fn what_is_left_runs_down_with_time_and_never_below_what_is_still_to_come() {
        let rig = Rig::built_in().unwrap();
        let text = include_str!("../../examples/lambertian/plan.toml");
        let document = spanned_toml::Document::parse(spanned_toml::Source::new("plan", text));
        let plan = Plan::read(document.unwrap()).unwrap();
        let sequence = plan.lay_out(&rig, None).unwrap();
        let mut pace = Pace::new(&rig, &sequence.steps, 100.0);
        pace.trust(&rig, false);
        let whole_s = sequence.prediction.total_s();
        assert!((pace.rest_s(100.0) / whole_s - 1.0).abs() < 1e-9);
        assert!((pace.rest_s(110.0) - (whole_s - 10.0)).abs() < 1e-9);
        // Homing takes longer than predicted, and then ends.
        let steps_s = whole_s - sequence.prediction.homing_s;
        assert!((pace.rest_s(200.0) - steps_s).abs() < 1e-9);
        pace.trust(&rig, true);
        pace.interrupt(200.0);
        let first_s = StepTime::of(&rig, Latched([0; 4]), &sequence.steps[0]).total_s();
        assert!((pace.rest_s(200.0 + 0.5 * first_s) - (steps_s - 0.5 * first_s)).abs() < 1e-9);
        assert!((pace.rest_s(900.0) - (steps_s - first_s)).abs() < 1e-9);
    }
}
