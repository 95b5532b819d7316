//! Homing, moving, and looking where the axes are. What was sent is one thing; where the board
//! says it stands afterwards is what counts.

use std::fmt::Write as _;
use std::time::Duration;

use firmware_protocol::{Cause, Instant, Shutter};

use super::{Grbl, IDLE_IN_A_ROW, Purpose, Report, State, Task, WATCH_EVERY, stopping};
use crate::device::axes::AxesEvent;
use crate::rig::GrblOutput;

/// grbl's reports have three decimals: positions are known to half of the last.
const REPORT_RESOLUTION: f64 = 0.0005;

/// A move that goes on.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Moving {
    target: Vec<i32>,
    /// Its motion has drained: `G4P0` was answered.
    is_drained: bool,
    /// How often in a row the board said that it is idle, although it has not.
    idle: u32,
}

impl Grbl {
    pub(super) fn begin_move(&mut self, now: Instant, steps: &[i32]) {
        // Absolute, in machine coordinates, whatever modes somebody left.
        let mut line = "G21G53G0".to_owned();
        for ((letter, (_, per_unit)), step) in self.letters.iter().zip(&self.places).zip(steps) {
            // Writing to a string does not fail.
            let _ = write!(line, "{letter}{:.4}", f64::from(*step) / per_unit);
        }
        self.stream.push(&line, Purpose::Move);
        self.stream.push("G4P0", Purpose::Barrier);
        self.task = Task::Moving(Moving { target: steps.to_vec(), is_drained: false, idle: 0 });
        self.tries = 0;
        self.ask_at = Some(now + WATCH_EVERY);
    }

    /// The barrier was answered.
    pub(super) fn drained(&mut self, now: Instant) {
        match &mut self.task {
            Task::Moving(moving) => {
                moving.is_drained = true;
                self.tries = 0;
                self.ask(now);
            }
            Task::PuttingShutter(shutter) => {
                let shutter = *shutter;
                self.rest();
                self.say(AxesEvent::ShutterIs(shutter));
            }
            _ => {}
        }
    }

    /// A report in mid-move.
    pub(super) fn moving(&mut self, now: Instant, mut moving: Moving, report: &Report) {
        match report.state {
            State::Idle if moving.is_drained => return self.verify(now, &moving, report),
            State::Idle => {
                moving.idle += 1;
                if moving.idle >= IDLE_IN_A_ROW {
                    self.stream.clear();
                    let name = "a line was lost: it stands idle and has not answered all of them";
                    return self.fault(name.to_owned(), Cause::Stopped, true);
                }
            }
            State::Run => moving.idle = 0,
            other => return self.unexpected(other),
        }
        self.task = Task::Moving(moving);
        self.ask_at = Some(now + WATCH_EVERY);
    }

    fn verify(&mut self, now: Instant, moving: &Moving, report: &Report) {
        let Some(located) = self.steps(report) else {
            self.ask_at = Some(now + WATCH_EVERY / 2);
            return;
        };
        let found = located.steps.iter().zip(&moving.target).zip(&self.places);
        let off = found.enumerate().find(|(_, ((step, target), (_, per_unit)))| {
            let within = (REPORT_RESOLUTION * per_unit).max(0.0) + 1.0;
            (f64::from(**step) - f64::from(**target)).abs() > within
        });
        match off {
            None => {
                self.rest();
                self.say(AxesEvent::Done(located));
            }
            Some((n, ((step, target), _))) => {
                let letter = self.letters.get(n).copied().unwrap_or('?');
                let name = format!(
                    "axis {letter} was sent to step {target}, and stands at {step}: the line was \
                     damaged on its way, or somebody else moves the board"
                );
                let axis = u8::try_from(n).unwrap_or(u8::MAX);
                self.fault(name, Cause::Stalled(axis), true);
            }
        }
    }

    fn unexpected(&mut self, state: State) {
        self.stream.clear();
        let name = match state {
            State::Door(_) => "the safety door was opened".to_owned(),
            other => format!("it is in state {}, and nobody here asked for that", other.name()),
        };
        self.fault(name, Cause::Stopped, true);
    }

    /// The answer to `Locate`.
    pub(super) fn located(&mut self, report: &Report) {
        match (report.state, self.steps(report)) {
            // A locked board at rest knows where it counts to be, for what that is worth.
            (State::Idle | State::Alarm, Some(located)) => {
                self.rest();
                self.say(AxesEvent::Located(located));
            }
            // What work positions are offset by comes with a later report.
            (State::Idle | State::Alarm, None) => {}
            (other, _) => self.unexpected(other),
        }
    }

    pub(super) fn begin_homing(&mut self, now: Instant) {
        self.alarm = None;
        self.stream.push("$H", Purpose::Home);
        let until = now + Duration::from_secs_f64(self.board.homing_s().min(3600.0));
        self.task = Task::Homing { until, is_answered: false };
        // It does not answer while it homes.
        self.ask_at = Some(until);
    }

    pub(super) fn homed(&mut self, now: Instant) {
        if let Task::Homing { is_answered, .. } = &mut self.task {
            *is_answered = true;
            self.tries = 0;
            self.ask(now);
        }
    }

    pub(super) fn homing(&mut self, now: Instant, is_answered: bool, report: &Report) {
        match (report.state, self.steps(report)) {
            (State::Idle, Some(located)) if is_answered => {
                self.rest();
                self.say(AxesEvent::Done(located));
            }
            (State::Idle | State::Home | State::Run, _) => {
                if is_answered {
                    self.ask_at = Some(now + WATCH_EVERY);
                }
            }
            (State::Alarm, _) if !is_answered => {}
            (other, _) => self.unexpected(other),
        }
    }

    pub(super) fn homing_late(&mut self, now: Instant, until: Instant) {
        if now < until {
            return self.ask_again(now);
        }
        self.begin_stopping(now);
        let name = "homing did not end within the time that its travel takes".to_owned();
        if let Task::Stopping(stopping) = &mut self.task {
            stopping.then = stopping::Then::Fault(name, Cause::HomingMissed(0));
        }
    }

    pub(super) fn begin_shutter(&mut self, now: Instant, shutter: Shutter) {
        let Some(output) = self.shutter else { return };
        let line = match (output, shutter) {
            (GrblOutput::Flood, Shutter::Closed) => "M8",
            (GrblOutput::Flood, Shutter::Open) => "M9",
            (GrblOutput::Spindle, Shutter::Closed) => "M3S1000",
            (GrblOutput::Spindle, Shutter::Open) => "M5",
        };
        self.stream.push(line, Purpose::Shutter);
        self.stream.push("G4P0", Purpose::Barrier);
        self.task = Task::PuttingShutter(shutter);
        self.tries = 0;
        self.ask_at = Some(now + WATCH_EVERY);
    }
}
