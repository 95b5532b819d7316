//! Finding out who is there. A board may be booting, locked, or still busy with what an earlier
//! host asked: it is asked until it answers, brought to rest, and asked what it is.

use std::time::Duration;

use firmware_protocol::Instant;

use super::{ANSWER_WITHIN, Grbl, Purpose, Report, State, Stream, Task, byte};
use crate::device::axes::{AxesEvent, AxesFacts, AxisFacts};
use crate::device::driver::{Refusal, Trouble};

/// A board that was reset by opening its port answers after two seconds, at most.
const PATIENCE: Duration = Duration::from_secs(4);
/// How long `$I` and `$$` may take: forty lines at 9600 baud.
const TALK: Duration = Duration::from_secs(2);
/// What a board takes that has said nothing of its buffer yet.
const FIRST_BUFFER: usize = 64;

/// How far the opening has come.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Step {
    until: Instant,
    stage: Stage,
    /// Nothing else helped.
    was_reset: bool,
}

#[derive(Debug, Clone, PartialEq)]
enum Stage {
    /// Somebody answers `?` at all.
    Greeting,
    /// What it was doing comes to rest.
    Calming,
    /// `$I`, then `$$`.
    Asking,
    Listing,
}

impl Grbl {
    /// From the beginning; or over again, after the banner of a board that has just booted.
    pub(super) fn begin_opening(&mut self, now: Instant, banner: Option<&str>) {
        self.board = super::Board::default();
        self.offset = None;
        self.stream = Stream::new(FIRST_BUFFER);
        self.tries = 0;
        let (until, was_reset) = match (&self.task, banner) {
            (Task::Opening(step), Some(_)) => (step.until.max(now + TALK), step.was_reset),
            _ => (now + PATIENCE, false),
        };
        if let Some(version) = banner.filter(|version| !version.starts_with("1.1")) {
            let what = format!("it is grbl {version}");
            return self.refuse((what, "grbl 1.1".to_owned(), "flash grbl 1.1".to_owned()));
        }
        self.task = Task::Opening(Step { until, stage: Stage::Greeting, was_reset });
        self.ask(now);
    }

    fn go(&mut self, stage: Stage, until: Instant) {
        let was_reset = matches!(self.task, Task::Opening(Step { was_reset: true, .. }));
        self.task = Task::Opening(Step { until, stage, was_reset });
    }

    /// A report came.
    pub(super) fn open_on(&mut self, now: Instant, step: Step, report: &Report) {
        let Step { until, stage, .. } = step;
        match (stage, report.state) {
            (Stage::Greeting, State::Run | State::Home) => {
                self.urgent.push(byte::HOLD);
                self.go(Stage::Calming, until);
                self.ask_at = Some(now + ANSWER_WITHIN);
            }
            (Stage::Greeting | Stage::Calming, State::Jog) => {
                self.urgent.push(byte::JOG_CANCEL);
                self.go(Stage::Calming, until);
                self.ask_at = Some(now + ANSWER_WITHIN);
            }
            (Stage::Greeting | Stage::Calming, State::Door(_)) if step.was_reset => self.refuse((
                "its safety door is open, in which state it answers no line".to_owned(),
                "a closed door".to_owned(),
                "close the door; or, where there is none, look at the board's door input"
                    .to_owned(),
            )),
            // At rest, in a state in which it reads no lines: a reset forgets what is queued, and
            // loses no step.
            (
                Stage::Greeting | Stage::Calming,
                state @ (State::Hold(0) | State::Door(0..=1) | State::Sleep),
            ) => {
                self.urgent.push(byte::RESET);
                let was_reset = step.was_reset || matches!(state, State::Door(_));
                self.task = Task::Opening(Step { until, stage: Stage::Calming, was_reset });
                self.ask_at = Some(now + ANSWER_WITHIN);
            }
            (Stage::Greeting | Stage::Calming, State::Check) => self.refuse((
                "it is in check mode, in which nothing moves".to_owned(),
                "a board that moves".to_owned(),
                "send $C, or reset the board".to_owned(),
            )),
            (Stage::Greeting | Stage::Calming, State::Idle | State::Alarm) => {
                self.board.axes = match &report.position {
                    super::Position::Machine(axes) | super::Position::Work(axes) => axes.len(),
                };
                // Spoils half a line that somebody may have left, and which an empty one would have
                // carried out; alone it asks for help. Its answer is nobody's.
                self.stream.push("$", Purpose::Move);
                self.stream.push("$I", Purpose::Ask);
                self.go(Stage::Asking, until.max(now + TALK));
                self.ask_at = Some(now + TALK / 2);
            }
            // Still braking; or a report that comes late.
            (Stage::Greeting | Stage::Calming, _) => self.ask_at = Some(now + ANSWER_WITHIN / 3),
            (Stage::Asking | Stage::Listing, _) => {}
        }
    }

    /// `$I` or `$$` was answered to its end.
    pub(super) fn answered(&mut self, now: Instant) {
        let Task::Opening(Step { stage, .. }) = &self.task else { return };
        match *stage {
            Stage::Asking if self.board.version.is_some() => {
                if let Err(unfit) = self.board.check_version() {
                    return self.refuse(unfit);
                }
                self.stream.push("$$", Purpose::Ask);
                self.go(Stage::Listing, now + 2 * TALK);
                self.ask_at = Some(now + TALK);
            }
            Stage::Listing => match self.facts() {
                Ok(facts) => {
                    self.stream = Stream::new(self.board.buffer());
                    self.rest();
                    self.say(AxesEvent::Ready(facts));
                }
                Err(unfit) => self.refuse(unfit),
            },
            // The answer to something older.
            Stage::Asking | Stage::Greeting | Stage::Calming => {}
        }
    }

    /// No answer in time.
    pub(super) fn open_again(&mut self, now: Instant, step: Step) {
        let Step { until, stage, was_reset } = step;
        let is_talking = matches!(stage, Stage::Asking | Stage::Listing);
        if !was_reset && self.garbled == 0 && (now >= until || is_talking) {
            // After a limit's alarm it answers nothing, or nothing but `?`, until it is reset. At
            // rest a reset loses nothing, and a board that does not answer is not moving, or homes.
            self.stream.clear();
            self.urgent = vec![byte::RESET];
            let until = now + PATIENCE;
            self.task = Task::Opening(Step { until, stage: Stage::Greeting, was_reset: true });
            self.ask_at = Some(now + ANSWER_WITHIN);
            return;
        }
        if now >= until || (was_reset && is_talking) {
            let heard = match (self.bytes, self.garbled) {
                (0, _) => "nothing was heard; is it powered, and is this its port?".to_owned(),
                (bytes, garbled) if garbled > 0 || self.board.version.is_none() => format!(
                    "{bytes} bytes were heard, and no line of grbl's among them; another baud \
                     rate, or another device?"
                ),
                (bytes, _) => format!("{bytes} bytes were heard, but not to their end"),
            };
            let what = format!("{}: no answer from a grbl: {heard}", self.name);
            return self.fail(Trouble::Silent(what));
        }
        match stage {
            Stage::Greeting | Stage::Calming => self.ask(now),
            Stage::Asking | Stage::Listing => {
                // Its buffer may hold what an earlier host sent: begin again.
                self.stream.clear();
                self.go(Stage::Greeting, until);
                self.ask(now);
            }
        }
    }

    fn facts(&mut self) -> Result<AxesFacts, super::settings::Unfit> {
        self.board.check_modes()?;
        let places = self.board.places(&self.letters)?;
        let mut scaled = Vec::new();
        let mut axes: Vec<AxisFacts> = Vec::new();
        for place in places {
            scaled.push((place, self.board.steps_per_unit(place)?));
            axes.push(self.board.facts(place)?);
        }
        self.places = scaled;
        let version = self.board.version.as_deref().unwrap_or_default();
        Ok(AxesFacts {
            identity: format!("grbl {version}"),
            axes,
            // A board that is not locked may have been unlocked without homing: it can't tell.
            is_homed: false,
            is_synchronous: true,
            has_shutter: self.shutter.is_some(),
            fault: None,
        })
    }

    fn refuse(&mut self, (what, expected, help): super::settings::Unfit) {
        let device = self.name.clone();
        self.fail(Trouble::Refused(Refusal { device, what, expected, help }));
    }
}
