//! Who is on the bus: every servo of the rig file is found, read, and compared with what it
//! shall do. Nothing is written.

use std::time::Duration;

use firmware_protocol::Instant;

use super::bus::Heard;
use super::packet::{Instruction, Status};
use super::servo::{Servo, Wrong};
use super::table::{Block, LIMITS, MODES, STATE, Span};
use super::{Doing, Dynamixel, WATCHDOG};
use crate::device::axes::{AxesEvent, AxesFacts};
use crate::device::driver::{Refusal, Trouble};

/// How long each is waited for in a round: some may not be there.
const PING: Duration = Duration::from_millis(120);
/// Between two rounds of pings.
const PING_AGAIN: Duration = Duration::from_millis(100);
/// Servos answer a second after their power came on, adapters sooner.
const BOOT: Duration = Duration::from_secs(4);
/// After so many rounds it is said what is missing, where anything is heard at all.
const ROUNDS: u32 = 3;

/// How far it has come.
#[derive(Debug, Clone, Copy)]
pub(super) enum Survey {
    /// The n-th servo was asked for its name, in this round.
    Ping(usize, u32),
    /// The n-th servo was asked for this.
    Read(usize, Asked),
}

/// What of a servo's table is read.
#[derive(Debug, Clone, Copy)]
pub(super) enum Asked {
    Modes,
    Limits,
    State,
}

impl Asked {
    const fn span(self) -> Span {
        match self {
            Self::Modes => MODES,
            Self::Limits => LIMITS,
            Self::State => STATE,
        }
    }
}

impl Dynamixel {
    pub(super) fn begin_survey(&mut self, now: Instant) {
        self.boots_until = now + BOOT;
        self.doing = Doing::Survey(Survey::Ping(0, 1));
        self.ping_next(now);
    }

    /// Asks the next servo that has not answered yet for its name.
    pub(super) fn ping_next(&mut self, now: Instant) {
        let Doing::Survey(Survey::Ping(from, round)) = self.doing else { return };
        let mut waiting = self.servos.iter().enumerate().skip(from);
        if let Some((n, servo)) = waiting.find(|(_, servo)| servo.identity.is_none()) {
            let id = servo.id();
            self.doing = Doing::Survey(Survey::Ping(n, round));
            self.bus.ask(id, &Instruction::Ping(id), 3, PING);
            return;
        }
        if self.servos.iter().all(|servo| servo.identity.is_some()) {
            self.read(0, Asked::Modes);
        } else if let Some(refusal) = self.missing().filter(|_| round >= ROUNDS) {
            self.refuse(refusal);
        } else if now >= self.boots_until {
            let (name, baud) = (&self.name, self.bus.baud());
            let what = format!(
                "{name}: no servo answers at {baud} baud, and nothing else does; are they powered, \
                 is this their port, and is this their rate (register 8)? New ones speak 57600: \
                 `gonio ports --probe PORT --baud 57600` asks who is there"
            );
            self.end(AxesEvent::Trouble(Trouble::Silent(what)));
        } else {
            self.doing = Doing::Survey(Survey::Ping(0, round + 1));
            self.wake = Some(now + PING_AGAIN);
        }
    }

    /// What is wrong with a bus on which not all answer; `None` where nothing at all is heard,
    /// which may be a device that boots.
    fn missing(&self) -> Option<Wrong> {
        let words = |is_there: bool| {
            let servos = self.servos.iter().filter(|servo| servo.identity.is_some() == is_there);
            servos.map(Servo::words).collect::<Vec<_>>().join(", ")
        };
        if self.servos.iter().any(|servo| servo.identity.is_some()) {
            return Some((
                format!("no answer from {}", words(false)),
                format!("all servos of the rig file, as {} answered", words(true)),
                "check its number, its baud rate and its cable".to_owned(),
            ));
        }
        let bad = self.bus.bad();
        let heard = bad.noise_bytes + bad.foreign;
        (heard > 0).then(|| {
            (
                format!("something answers, but not in Dynamixel's protocol 2.0 ({heard} bytes)"),
                format!("answers from {}", words(false)),
                "check the baud rate, and that the servos speak protocol 2.0".to_owned(),
            )
        })
    }

    fn read(&mut self, n: usize, asked: Asked) {
        let Some(servo) = self.servos.get(n) else { return self.ready() };
        let (id, Span { address, length }) = (servo.id(), asked.span());
        self.doing = Doing::Survey(Survey::Read(n, asked));
        let read = Instruction::Read { id, address, length };
        self.bus.ask(id, &read, usize::from(length), WATCHDOG);
    }

    pub(super) fn surveyed(&mut self, now: Instant, survey: Survey, heard: Heard) {
        let answer = heard.answers.into_iter().next();
        match survey {
            Survey::Ping(n, round) => {
                if let Some((servo, status)) = self.servos.get_mut(n).zip(answer)
                    && let [low, high, firmware] = status.data[..]
                {
                    servo.identity = Some((u16::from_le_bytes([low, high]), firmware));
                }
                self.doing = Doing::Survey(Survey::Ping(n + 1, round));
                self.ping_next(now);
            }
            Survey::Read(n, asked) => match self.take(n, asked, answer) {
                Ok(()) => match asked {
                    Asked::Modes => self.read(n, Asked::Limits),
                    Asked::Limits => self.read(n, Asked::State),
                    Asked::State => self.read(n + 1, Asked::Modes),
                },
                Err(wrong) => self.refuse(wrong),
            },
        }
    }

    fn take(&mut self, n: usize, asked: Asked, answer: Option<Status>) -> Result<(), Wrong> {
        let Some(servo) = self.servos.get_mut(n) else { return Ok(()) };
        let wrong = |what: &str| {
            (
                format!("{}: {what}", servo.words()),
                "a servo of the X series that answers to all that it is asked".to_owned(),
                "check its model, and register 68 (status return level 2)".to_owned(),
            )
        };
        let status = answer.ok_or_else(|| wrong("it answers to a ping, but can't be read"))?;
        status.result.map_err(|error| wrong(&error.to_string()))?;
        let block = Block { address: asked.span().address, bytes: status.data };
        match asked {
            Asked::Modes => servo.set_modes(&block),
            Asked::Limits => servo.set_limits(&block),
            Asked::State => servo.set_state(block),
        }
    }

    fn refuse(&mut self, (what, expected, help): Wrong) {
        let device = self.name.clone();
        let refusal = Refusal { device, what, expected, help };
        self.end(AxesEvent::Trouble(Trouble::Refused(refusal)));
    }

    fn ready(&mut self) {
        // A turn that is counted from power-up: what stands outside can't be homed.
        let mut counted = self.axes().iter().filter(|servo| !servo.is_absolute());
        if let Some(servo) = counted.find(|servo| servo.is_outside(self.tolerance)) {
            let (low, high) = servo.axis.travel;
            return self.refuse((
                format!("{}: stands at {} steps of its own", servo.words(), servo.position()),
                format!("{low} to {high}, its travel in the rig file"),
                "correct zero_deg or zero_mm; or turn it back by hand with the power off, within \
                 the right turn"
                    .to_owned(),
            ));
        }
        let servos = self.servos.iter();
        let identities = servos.map(|servo| format!("{} {}", servo.words(), servo.model()));
        let facts = AxesFacts {
            identity: identities.collect::<Vec<_>>().join(", "),
            axes: self.axes().iter().map(Servo::facts).collect(),
            is_homed: self.axes().iter().all(Servo::is_absolute),
            is_synchronous: false,
            has_shutter: self.shutter.is_some(),
            fault: self.raised(),
        };
        self.end(AxesEvent::Ready(facts));
    }
}
