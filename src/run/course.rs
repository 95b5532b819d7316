//! The course of a run: how far it is, how long it still takes, and whether its time is used up.
//!
//! It has no clock: run time, in seconds, is handed in, and never goes back here.

use std::sync::Arc;

use super::events::Progress;
use super::job::Job;
use super::pace::Pace;
use super::state::State;
use crate::plan::{Step, StepTime, WARM_UP_IDS_FROM, closing};
use crate::rig::{Latched, Rig};

/// See the module.
#[derive(Debug, Clone)]
pub(super) struct Course {
    rig: Arc<Rig>,
    pace: Pace,
    progress: Progress,
    closing: Vec<Step>,
    rig_s_max: f64,
    // Whether it is decided on the way what is measured.
    is_open: bool,
    // Run time since which the rig waits for a person.
    waits_since_s: Option<f64>,
}

impl Course {
    /// Of a job that begins now, with homing.
    pub(super) fn new(rig: &Arc<Rig>, job: &Job) -> Self {
        let mut pace = Pace::new(rig, &job.steps, job.session_began_s);
        pace.trust(rig, false);
        let progress = Progress {
            done: job.done_before,
            total: job.done_before + job.steps.len(),
            rig_s: job.session_began_s,
            rest_s: pace.rest_s(job.session_began_s),
            rest_most_s: None,
        };
        Self {
            rig: Arc::clone(rig),
            pace,
            progress,
            closing: closing(&job.steps).to_vec(),
            rig_s_max: job.rig_time_max.map_or(f64::INFINITY, |max| max.as_secs_f64()),
            is_open: job.decider.is_some(),
            waits_since_s: None,
        }
    }

    /// As it was when it was last looked at.
    pub(super) fn progress(&self) -> Progress {
        self.progress
    }

    /// It is this time by now.
    pub(super) fn look(&mut self, now_s: f64) -> Progress {
        self.progress.rig_s = self.progress.rig_s.max(now_s);
        self.progress.rest_s = self.pace.rest_s(self.progress.rig_s);
        let most_s = (self.rig_s_max - self.progress.rig_s).max(self.progress.rest_s);
        self.progress.rest_most_s = (self.is_open && most_s.is_finite()).then_some(most_s);
        self.progress
    }

    /// The state changed.
    pub(super) fn became(&mut self, state: State, now_s: f64) {
        let rig_s = self.look(now_s).rig_s;
        let is_waiting = matches!(state, State::Paused | State::Faulted);
        if is_waiting {
            self.waits_since_s.get_or_insert(rig_s);
        } else if let Some(since_s) = self.waits_since_s.take() {
            self.rig_s_max += rig_s - since_s;
            self.pace.interrupt(rig_s);
        }
        if !matches!(state, State::Moving | State::Settling | State::Dwelling) {
            self.pace.interrupt(rig_s);
        }
        self.look(rig_s);
    }

    /// The axes' position became trusted, or lost its trust.
    pub(super) fn trust(&mut self, is_trusted: bool, now_s: f64) {
        self.pace.trust(&self.rig, is_trusted);
        self.pace.interrupt(now_s);
        self.look(now_s);
    }

    /// A step has its reading, which ended at `end_s`.
    pub(super) fn take(&mut self, step: &Step, end_s: f64) {
        if step.id < WARM_UP_IDS_FROM {
            self.progress.done += 1;
            self.pace.step(&self.rig, step, end_s);
        } else {
            self.pace.interrupt(end_s);
        }
        self.look(end_s);
    }

    /// Whether there is no time for the steps ahead, coming from `here`, and those with which the
    /// plan closes. Says so once, and never where only those are left: they are taken in any case.
    pub(super) fn is_late(&mut self, mut here: Latched, ahead: &[Step]) -> bool {
        let closes = |step: &Step| self.closing.iter().any(|closing| closing.id == step.id);
        if self.rig_s_max == f64::INFINITY || ahead.last().is_none_or(closes) {
            return false;
        }
        let times = ahead.iter().chain(&self.closing).map(|step| {
            let time = StepTime::of(&self.rig, here, step);
            here = step.rests_at(&self.rig);
            time.total_s()
        });
        let is_late = self.progress.rig_s + times.sum::<f64>() >= self.rig_s_max;
        if is_late {
            self.rig_s_max = f64::INFINITY;
        }
        is_late
    }

    /// These steps follow those that there were.
    pub(super) fn extend(&mut self, steps: &[Step]) {
        self.pace.extend(&self.rig, steps);
        self.progress.total += steps.len();
        self.closing = closing(steps).to_vec();
        self.look(self.progress.rig_s);
    }

    /// Only the readings with which the plan closes are still wanted.
    pub(super) fn conclude(&mut self) {
        self.is_open = false;
        self.pace.conclude(&self.rig, &self.closing);
    }
}
