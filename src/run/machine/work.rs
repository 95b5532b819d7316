//! What is still to be measured, and what has been: each reading is taken over once,
//! whatever is repeated, stopped or lost on the way.

use std::collections::VecDeque;

use crate::plan::{RESUME_IDS_FROM, Step, WARM_UP_IDS_FROM, WarmUp, closing};
use crate::run::warm_up::{Gate, Stability};

/// Dwells queued ahead while warming up: each verdict comes this many dwells late at most.
const WARM_UP_AHEAD: usize = 2;

/// What a run is to do, in this order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Program {
    /// Waiting for stability: the gate, the reading to take again and again, and how many
    /// warm-up readings the run has from earlier sessions.
    pub warm_up: Option<(WarmUp, Step, u32)>,
    /// The reference pose, measured again after an interruption: somebody judges the readings
    /// before the run goes on.
    pub checks: Vec<Step>,
    /// The steps that have no reading yet, in the plan's order.
    pub steps: Vec<Step>,
    /// Whether somebody decides, once all of them are measured, what follows.
    pub is_open: bool,
}

/// In which part of the program the run is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    WarmUp,
    Check,
    /// The checks are measured, and somebody ponders them.
    Judging,
    Steps,
    /// All steps that there are so far are measured, and somebody decides which ones follow.
    Deciding,
}

/// Whether a reading only serves to see the source become stable.
pub(super) fn is_warm_up(step: &Step) -> bool {
    (WARM_UP_IDS_FROM..RESUME_IDS_FROM).contains(&step.id)
}

/// Names a step of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Index(usize);

impl Index {
    /// So many further on.
    pub(super) const fn plus(self, by: usize) -> Self {
        Self(self.0 + by)
    }
}

#[derive(Debug)]
pub(super) struct Work {
    // Every step that was handed out or will be, and whether its reading was taken over.
    all: Vec<(Step, bool)>,
    todo: VecDeque<Index>,
    checks: VecDeque<Index>,
    steps: VecDeque<Index>,
    gate: Option<(Gate, Step, u32)>,
    phase: Phase,
    // The first of the steps with which the plan closes.
    closing: Index,
    // Only those are still wanted.
    is_concluded: bool,
    is_open: bool,
    done: usize,
    total: usize,
}

impl Work {
    pub(super) fn new(program: Program) -> Self {
        let Program { warm_up, checks, steps, is_open } = program;
        let (first_step, total) = (checks.len(), steps.len());
        let closing = Index(first_step + total - closing(&steps).len());
        let all: Vec<_> = checks.into_iter().chain(steps).map(|s| (s, false)).collect();
        let steps: VecDeque<_> = (first_step..all.len()).map(Index).collect();
        let checks: VecDeque<_> = (0..first_step).map(Index).collect();
        let gate = warm_up.map(|(asked, step, had)| (Gate::new(asked), step, had));
        let mut work = Self {
            all,
            todo: VecDeque::new(),
            checks,
            steps,
            gate,
            phase: Phase::WarmUp,
            closing,
            is_concluded: false,
            is_open,
            done: 0,
            total,
        };
        if work.gate.is_none() {
            work.leave_warm_up();
        }
        work
    }

    pub(super) fn phase(&self) -> Phase {
        self.phase
    }

    /// Steps done and to do, warm-up and checks apart.
    pub(super) fn progress(&self) -> (usize, usize) {
        (self.done, self.total)
    }

    pub(super) fn step(&self, index: Index) -> &Step {
        &self.all[index.0].0
    }

    /// The next step to hand out, if one may be while `dwells` wait or run on the device.
    pub(super) fn peek(&mut self, dwells: usize) -> Option<Index> {
        if self.phase == Phase::WarmUp && self.todo.is_empty() && dwells < WARM_UP_AHEAD {
            let (_, step, count) = self.gate.as_mut()?;
            let step = Step { id: WARM_UP_IDS_FROM + *count, ..*step };
            *count += 1;
            self.todo.push_back(Index(self.all.len()));
            self.all.push((step, false));
        }
        match self.phase {
            Phase::Judging | Phase::Deciding => None,
            Phase::WarmUp | Phase::Check | Phase::Steps => self.todo.front().copied(),
        }
    }

    /// The next step of this phase, whether or not it may be handed out.
    pub(super) fn next(&self) -> Option<Index> {
        self.todo.front().copied()
    }

    /// How many steps from the next one on are windows of one sweep, one after the other; at most
    /// so many.
    pub(super) fn windows_ahead(&self, most: u16) -> u16 {
        let mut windows = 0;
        let mut before: Option<Index> = None;
        for index in self.todo.iter().take(most.into()) {
            let follows = before.is_none_or(|before| {
                *index == before.plus(1) && self.step(*index).continues(self.step(before))
            });
            if !follows {
                break;
            }
            before = Some(*index);
            windows += 1;
        }
        windows
    }

    /// Whether its reading was taken over.
    pub(super) fn is_recorded(&self, index: Index) -> bool {
        self.all[index.0].1
    }

    /// Hands out the step that [`Work::peek`] showed.
    pub(super) fn take(&mut self) -> Option<Index> {
        self.todo.pop_front()
    }

    /// Takes back what was handed out and never measured: it comes first again, in order.
    pub(super) fn put_back(&mut self, mut indices: Vec<Index>) {
        indices.sort_unstable();
        for index in indices.into_iter().rev() {
            let (step, recorded) = &self.all[index.0];
            // Warm-up readings that nobody waits for any more are not worth repeating.
            let is_stale = is_warm_up(step) && self.phase != Phase::WarmUp;
            if !recorded && !is_stale && self.is_wanted(index) {
                self.todo.push_front(index);
            }
        }
    }

    /// Wants no more targets: what is left to hand out is what the plan closes with, without what
    /// would need a person. False before the steps have begun.
    pub(super) fn conclude(&mut self) -> bool {
        if self.phase != Phase::Steps {
            return false;
        }
        self.is_concluded = true;
        let todo = std::mem::take(&mut self.todo);
        self.todo = todo.into_iter().filter(|index| self.is_wanted(*index)).collect();
        true
    }

    fn is_wanted(&self, index: Index) -> bool {
        !self.is_concluded || (index >= self.closing && !self.step(index).source_off)
    }

    /// Notes that the reading was taken over; false if it had been before.
    pub(super) fn record(&mut self, index: Index) -> bool {
        let recorded = &mut self.all[index.0].1;
        if std::mem::replace(recorded, true) {
            return false;
        }
        if self.is_step(index) {
            self.done += 1;
        }
        true
    }

    fn is_step(&self, index: Index) -> bool {
        self.all[index.0].0.id < WARM_UP_IDS_FROM
    }

    /// Shows the gate a warm-up reading, and goes on to the next phase when it passes.
    pub(super) fn watch(&mut self, time_s: f64, mean: f64) -> Stability {
        let Some((gate, ..)) = &mut self.gate else { return Stability::Stable };
        let stability = gate.take(time_s, mean);
        if stability == Stability::Stable {
            self.leave_warm_up();
        }
        stability
    }

    /// Goes on without stability.
    pub(super) fn leave_warm_up(&mut self) {
        if self.phase != Phase::WarmUp {
            return;
        }
        self.gate = None;
        self.todo = std::mem::take(&mut self.checks);
        self.phase = Phase::Check;
        if self.todo.is_empty() {
            self.begin_steps();
        }
    }

    pub(super) fn begin_judging(&mut self) {
        self.phase = Phase::Judging;
    }

    pub(super) fn end_judging(&mut self) {
        if self.phase == Phase::Judging {
            self.begin_steps();
        }
    }

    fn begin_steps(&mut self) {
        self.phase = Phase::Steps;
        self.todo = std::mem::take(&mut self.steps);
    }

    /// Whether somebody is to decide what follows the last step.
    pub(super) fn is_open(&self) -> bool {
        self.is_open && !self.is_concluded
    }

    pub(super) fn begin_deciding(&mut self) {
        self.phase = Phase::Deciding;
    }

    /// These steps follow; they close as the ones before them did.
    pub(super) fn extend(&mut self, steps: Vec<Step>) {
        if self.phase != Phase::Deciding {
            return;
        }
        let (first, count) = (self.all.len(), steps.len());
        self.closing = Index(first + count - closing(&steps).len());
        self.all.extend(steps.into_iter().map(|step| (step, false)));
        self.total += count;
        self.todo = (first..first + count).map(Index).collect();
        self.phase = Phase::Steps;
    }

    /// Whether nothing is left to hand out in this phase.
    pub(super) fn is_handed_out(&self) -> bool {
        self.phase != Phase::WarmUp && self.todo.is_empty()
    }
}
