//! One run along a ray: steps of adapted size to the stop, and the same steps halved. It does not
//! know how well the ray's end has to be known: it is told the error of a step.

use super::steps::{Counted, EVALUATIONS, State};
use super::trace::{IndexField, Stop, TraceError};

/// One run: where it ended, and by which steps.
pub(super) struct Run {
    pub(super) end: State,
    pub(super) steps: Vec<f64>,
}

/// What a ray is asked to do.
pub(super) struct Course {
    pub(super) start: State,
    pub(super) stop: Stop,
    pub(super) length_max_m: f64,
}

impl Course {
    /// With steps whose own error is at most so large. None if the budget is spent.
    pub(super) fn adapted<F: IndexField>(
        &self,
        counted: &mut Counted<'_, F>,
        step_error_m: f64,
        budget: usize,
    ) -> Result<Option<Run>, TraceError> {
        /// Of the longest ray.
        const STEP_MAX: f64 = 1.0 / 32.0;
        const STEP_MIN: f64 = 1e-9;
        /// What is aimed at, of the error granted: a refused step costs as much as a good one.
        const AIM: f64 = 0.9;
        let mut state = self.start;
        let mut steps = Vec::new();
        let mut step = f64::INFINITY;
        loop {
            step = step.min(STEP_MAX * self.length_max_m / state.optical_direction().length());
            if counted.evaluations + EVALUATIONS > budget {
                return Ok(None);
            }
            let (next, position_m, turn) = match counted.step(state, step) {
                // A trial step may leave the field where the ray doesn't.
                Err(_) if step > STEP_MIN * self.length_max_m => {
                    step *= 0.25;
                    continue;
                }
                stepped => stepped?,
            };
            // A wrong direction is a wrong place by as much as there is still to go.
            let ahead_m = self.length_max_m / state.optical_direction().length();
            let error = position_m.max(turn * ahead_m) / step_error_m;
            let error = if error.is_nan() { f64::INFINITY } else { error };
            let factor = if error > 0.0 { AIM * libm::pow(error, -0.2) } else { 5.0 };
            if error > 1.0 {
                step *= factor.clamp(0.1, AIM);
                continue;
            }
            steps.push(step);
            if let Some(end) = self.end_within(counted, state, next, step)? {
                return Ok(Some(Run { end, steps }));
            }
            self.not_missed(&next)?;
            state = next;
            step *= factor.clamp(0.2, 5.0);
        }
    }

    /// The same steps, each in two. None if the budget is spent.
    pub(super) fn halved<F: IndexField>(
        &self,
        counted: &mut Counted<'_, F>,
        steps: &[f64],
        budget: usize,
    ) -> Result<Option<Run>, TraceError> {
        let mut state = self.start;
        let mut halves = Vec::with_capacity(2 * steps.len());
        // Where the other run ended within its last step, this one may need a little more.
        let again = steps.last().copied().unwrap_or(0.0);
        for step in steps.iter().flat_map(|step| [step / 2.0; 2]).chain([again / 2.0; 2]) {
            if counted.evaluations + EVALUATIONS > budget {
                return Ok(None);
            }
            let (next, _, _) = counted.step(state, step)?;
            halves.push(step);
            if let Some(end) = self.end_within(counted, state, next, step)? {
                return Ok(Some(Run { end, steps: halves }));
            }
            state = next;
        }
        Err(TraceError::Missed { length_max_m: self.length_max_m })
    }

    fn not_missed(&self, state: &State) -> Result<(), TraceError> {
        if state.length_m() <= self.length_max_m {
            Ok(())
        } else {
            Err(TraceError::Missed { length_max_m: self.length_max_m })
        }
    }

    /// The state at the stop, if the step from `state` to `next` reaches it.
    fn end_within<F: IndexField>(
        &self,
        counted: &mut Counted<'_, F>,
        state: State,
        next: State,
        step: f64,
    ) -> Result<Option<State>, TraceError> {
        /// Bisection alone would take fewer.
        const TRIES_MAX: usize = 100;
        let (mut low, mut high) = ((0.0, self.stop.side(&state)), (step, self.stop.side(&next)));
        // A ray that starts on the plane has not met it by that.
        let is_met = high.1 == 0.0 || low.1 * high.1 < 0.0;
        if !is_met {
            return Ok(None);
        }
        let mut end = next;
        // Regula falsi, the side that stays being halved (Dowell and Jarratt 1971, Illinois).
        let mut last_was_low = None;
        for _ in 0..TRIES_MAX {
            let span = high.0 - low.0;
            if high.1 == 0.0 || span <= f64::EPSILON * step {
                break;
            }
            let share = (low.1 / (low.1 - high.1)).clamp(0.0, 1.0);
            let at = span.mul_add(share, low.0);
            (end, _, _) = counted.step(state, at)?;
            let side = self.stop.side(&end);
            if side == 0.0 || at <= low.0 || at >= high.0 {
                break;
            }
            let is_low = side * low.1 > 0.0;
            if is_low {
                low = (at, side);
                high.1 *= if last_was_low == Some(true) { 0.5 } else { 1.0 };
            } else {
                high = (at, side);
                low.1 *= if last_was_low == Some(false) { 0.5 } else { 1.0 };
            }
            last_was_low = Some(is_low);
        }
        if end.length_m() <= self.length_max_m * (1.0 + 1e-9) {
            Ok(Some(end))
        } else {
            Err(TraceError::Missed { length_max_m: self.length_max_m })
        }
    }
}
