//! Coming to rest, and leaving what the board stood still for.
//!
//! A feed hold brakes within the accelerations and loses no step; at rest in it, a reset forgets
//! what was queued, and keeps the position. Homing alone can only be broken off by the reset,
//! which loses it.

use std::time::Duration;

use firmware_protocol::{Cause, Instant};

use super::{ANSWER_WITHIN, Grbl, Purpose, Report, State, Task, byte, cause_of, describe_alarm};
use crate::device::axes::AxesEvent;

/// How long braking may take before the board is reset as it moves.
const BRAKING: Duration = Duration::from_secs(3);
/// A board that says an alarm is deaf to resets for half a second: so much later it is sent again.
const RESET_AGAIN: Duration = Duration::from_secs(1);
/// How long a reset may take.
const RESETTING: Duration = Duration::from_secs(3);

/// Coming to rest.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stopping {
    until: Instant,
    stage: Stage,
    keeps_position: bool,
    pub(super) then: Then,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    Braking,
    Resetting,
    Looking,
}

/// What is said in the end.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Then {
    Fault(String, Cause),
    Stopped,
}

/// Leaving a fault.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Clearing {
    until: Instant,
    is_unlocking: bool,
}

impl Grbl {
    pub(super) fn begin_stopping(&mut self, now: Instant) {
        let was_homing = matches!(self.task, Task::Homing { .. });
        self.stream.clear();
        self.tries = 0;
        let (stage, until) = if was_homing {
            self.urgent = vec![byte::RESET];
            (Stage::Resetting, now + RESETTING)
        } else {
            self.urgent = vec![byte::HOLD, byte::ASK];
            (Stage::Braking, now + BRAKING)
        };
        let keeps_position = !was_homing;
        self.task = Task::Stopping(Stopping { until, stage, keeps_position, then: Then::Stopped });
        self.ask_at = Some(now + ANSWER_WITHIN / 3);
    }

    /// A report while it comes to rest.
    pub(super) fn stop_on(&mut self, now: Instant, mut stopping: Stopping, report: &Report) {
        match (stopping.stage, report.state) {
            (Stage::Braking, State::Hold(0) | State::Door(0..=1) | State::Sleep) => {
                self.urgent.push(byte::RESET);
                stopping.stage = Stage::Resetting;
                stopping.until = now + RESETTING;
                self.task = Task::Stopping(stopping);
                self.ask_at = Some(now + ANSWER_WITHIN);
            }
            (Stage::Braking | Stage::Looking, State::Alarm) => {
                stopping.keeps_position = false;
                self.stopped(&stopping, None);
            }
            (Stage::Looking, State::Idle) => {
                let located = self.steps(report);
                self.stopped(&stopping, located);
            }
            _ => self.ask_at = Some(now + ANSWER_WITHIN / 3),
        }
    }

    /// The banner of the reset that was asked for.
    pub(super) fn stopped_by_reset(&mut self, now: Instant, mut stopping: Stopping) {
        stopping.stage = Stage::Looking;
        stopping.until = now + RESETTING;
        self.task = Task::Stopping(stopping);
        self.ask(now);
    }

    /// An alarm while it came to rest.
    pub(super) fn lose_in_stop(&mut self) {
        if let Task::Stopping(stopping) = &mut self.task {
            stopping.keeps_position = false;
        }
    }

    fn stopped(&mut self, stopping: &Stopping, located: Option<super::Located>) {
        self.rest();
        let was_told = self.alarm.filter(|_| !stopping.keeps_position);
        match (&stopping.then, was_told) {
            (Then::Fault(name, cause), _) => self.fault(name.clone(), *cause, true),
            // Counts were lost by coming to rest: whoever asked for it must know.
            (Then::Stopped, Some(number)) => {
                let (name, loses_position) = describe_alarm(number);
                self.fault(name, cause_of(number), loses_position);
            }
            (Then::Stopped, None) => self.say(AxesEvent::Stopped(located)),
        }
    }

    pub(super) fn stopping_late(&mut self, now: Instant, mut stopping: Stopping) {
        if now < stopping.until {
            if stopping.stage == Stage::Resetting {
                self.ask_at = Some(now + ANSWER_WITHIN);
            } else {
                self.ask(now);
                self.ask_at = Some(now + ANSWER_WITHIN / 3);
            }
            return;
        }
        if stopping.stage == Stage::Braking {
            // It does not brake: cut its steps off.
            self.urgent = vec![byte::RESET];
            stopping.stage = Stage::Resetting;
            stopping.keeps_position = false;
            stopping.until = now + RESETTING;
            self.task = Task::Stopping(stopping);
            self.ask_at = Some(now + ANSWER_WITHIN);
            return;
        }
        let name = &self.name;
        let waited = (BRAKING + RESETTING).as_secs();
        let what = format!("{name}: no sign that it stopped in {waited} s; switch its power off");
        self.fail(super::Trouble::Silent(what));
    }

    /// A reset leaves an alarm; where the position was kept, the lock is opened too. A board that
    /// lost it stays locked until it homes.
    pub(super) fn begin_clearing(&mut self, now: Instant) {
        self.stream.clear();
        self.urgent = vec![byte::RESET];
        self.task = Task::Clearing(Clearing { until: now + RESETTING, is_unlocking: false });
        self.ask_at = Some(now + RESET_AGAIN);
    }

    /// The banner after the reset.
    pub(super) fn go_on_clearing(&mut self, now: Instant) {
        let keeps_position = self.alarm.is_none_or(|number| !describe_alarm(number).1);
        if !keeps_position {
            return self.cleared();
        }
        self.stream.push("$X", Purpose::Unlock);
        self.task = Task::Clearing(Clearing { until: now + RESETTING, is_unlocking: true });
        self.ask_at = Some(now + RESETTING);
    }

    pub(super) fn cleared(&mut self) {
        if matches!(self.task, Task::Clearing(_)) {
            self.alarm = None;
            self.rest();
            self.say(AxesEvent::Cleared);
        }
    }

    pub(super) fn clearing_late(&mut self, now: Instant, clearing: &Clearing) {
        if now < clearing.until && !clearing.is_unlocking {
            self.urgent = vec![byte::RESET];
            self.ask_at = Some(clearing.until.min(now + RESET_AGAIN));
            return;
        }
        let what = format!("{}: no banner after a reset", self.name);
        self.fail(super::Trouble::Silent(what));
    }
}
