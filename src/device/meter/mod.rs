//! The drivers of light meters that are spoken to in lines of text: picoammeters and power meters
//! of several makes, and others by a table of their words.
//!
//! One machine for all: it says one word at a time, waits for its answer where it has one, reads
//! back what it set, and takes nothing for a number that is not written as one. What is overrange
//! is saturated, and never a value. *Accepted* means that the words for a reading were said;
//! *done*, that as many readings came back as were asked for. A meter moves nothing, and has
//! nothing to stop.
//!
//! It does not know what is looked at, nor ports.

mod exposing;
mod keithley;
mod language;
mod lines;
mod newport;
mod script;
mod table;
#[cfg(test)]
mod tests;
mod thorlabs;

use std::collections::VecDeque;
use std::time::Duration;

use firmware_protocol::{Cause, Instant};

use super::driver::{Driver, NamedFault, Promises, Refusal, Trouble};
use super::photometer::{Photometer, PhotometerCommand, PhotometerEvent, PhotometerFacts};
use crate::rig::PhotometerDriver;
use exposing::Exposing;
use language::{Language, Wrong};
use lines::{Lines, number};
use script::{Expects, Step, begins, is_about};

/// Between two askings for a name.
const ASK_AGAIN: Duration = Duration::from_millis(500);
/// After so many answers that make no sense it is said what is wrong.
const NONSENSE_MAX: u32 = 2;
/// Between two looks at something that is at work.
const LOOK_AGAIN: Duration = Duration::from_millis(100);
/// Start bit, eight data bits, stop bit.
const BITS_A_BYTE: u64 = 10;

/// A meter behind a line of text.
#[derive(Debug)]
pub struct Meter {
    name: String,
    baud: u32,
    language: Box<dyn Language>,
    /// The ranges of the rig file, full scales in the meter's unit.
    full_scales: Vec<f64>,
    /// Readings a second.
    rate_hz: u32,
    lines: Lines,
    script: VecDeque<Step>,
    awaited: Option<Awaited>,
    /// The answer to a word that nobody waits for any more may come until then.
    stale_until: Option<Instant>,
    /// Not before then.
    resume_at: Option<Instant>,
    doing: Doing,
    is_set_up: bool,
    /// The range that it is in, as far as is known.
    range: Option<u8>,
    events: VecDeque<PhotometerEvent>,
}

/// A word that is to be answered.
#[derive(Debug)]
struct Awaited {
    step: Step,
    since: Instant,
    until: Instant,
}

#[derive(Debug)]
enum Doing {
    Nothing,
    /// Who it is; what it said so far, and how often it said nonsense.
    Opening(Vec<String>, u32),
    Zeroing,
    Exposing(Exposing),
}

impl Meter {
    /// The meter that the rig file names.
    pub fn of(line: &Line, driver: &PhotometerDriver) -> Self {
        match driver {
            PhotometerDriver::Keithley(meter) => Self::new(line, Box::new(*meter)),
            PhotometerDriver::Newport(meter) => Self::new(line, Box::new(meter.clone())),
            PhotometerDriver::Scpi(table) => Self::new(line, Box::new(table.clone())),
            PhotometerDriver::Thorlabs(meter) => Self::new(line, Box::new(*meter)),
        }
    }

    fn new(line: &Line, language: Box<dyn Language>) -> Self {
        Self {
            name: format!("{} at {}", language.kind(), line.port),
            baud: line.baud.max(1),
            language,
            full_scales: line.full_scales.clone(),
            rate_hz: line.rate_hz.max(1),
            lines: Lines::default(),
            script: VecDeque::new(),
            awaited: None,
            stale_until: None,
            resume_at: None,
            doing: Doing::Nothing,
            is_set_up: false,
            range: None,
            events: VecDeque::new(),
        }
    }

    fn wire_time(&self, bytes: usize) -> Duration {
        let bits = BITS_A_BYTE * bytes as u64;
        Duration::from_micros((bits * 1_000_000).div_ceil(u64::from(self.baud)))
    }

    fn hello(&mut self, nonsense: u32) {
        self.doing = Doing::Opening(Vec::new(), nonsense);
        self.script = self.language.hello().into();
    }

    /// An answer came to what was asked.
    fn answered(&mut self, now: Instant, answer: &str) {
        let Some(awaited) = self.awaited.take() else { return };
        // Some meters say back what they hear.
        if answer == awaited.step.text {
            self.awaited = Some(awaited);
            return;
        }
        let matches = match &awaited.step.expects {
            Expects::About(expected) => {
                number(answer).is_some_and(|found| is_about(found, *expected))
            }
            Expects::Number(expected) => {
                let digits = answer.trim_start_matches(|c: char| c.is_ascii_alphabetic());
                number(digits).is_some_and(|found| (found - expected).abs() < 1e-9)
            }
            Expects::Word(word) => begins(answer, word),
            Expects::Until(word) if begins(answer, word) => true,
            // At work for longer than it may be: that is no answer either.
            Expects::Until(_) if awaited.until <= now => return self.unanswered(now, &awaited),
            Expects::Until(_) => {
                self.resume_at = Some(now + LOOK_AGAIN);
                self.script.push_front(Step { until: Some(awaited.until), ..awaited.step });
                return;
            }
            Expects::Fact => return self.told(now, answer),
            Expects::Values => return self.exposed(now, awaited.since, answer),
            Expects::Nothing => true,
        };
        if matches {
            self.advance(now);
        } else {
            self.misunderstood(&awaited.step, answer);
        }
    }

    fn told(&mut self, now: Instant, answer: &str) {
        if let Doing::Opening(answers, _) = &mut self.doing {
            answers.push(answer.to_owned());
        }
        self.advance(now);
    }

    fn misunderstood(&mut self, step: &Step, answer: &str) {
        let expected = match &step.expects {
            Expects::About(value) | Expects::Number(value) => format!("{value:e}"),
            Expects::Word(words) | Expects::Until(words) => words.replace('|', " or "),
            Expects::Fact | Expects::Nothing | Expects::Values => "readings".to_owned(),
        };
        self.is_set_up = false;
        self.range = None;
        self.fault(format!("it answers \"{answer}\" to {}; expected {expected}", step.text));
    }

    /// The script has come to its end, or goes on.
    fn advance(&mut self, now: Instant) {
        if !self.script.is_empty() || self.awaited.is_some() {
            return;
        }
        match std::mem::replace(&mut self.doing, Doing::Nothing) {
            Doing::Nothing => {}
            Doing::Opening(answers, nonsense) => self.introduced(&answers, nonsense, now),
            Doing::Zeroing => {
                self.is_set_up = true;
                // Its zero is measured in a range of its own.
                self.range = None;
                self.events.push_back(PhotometerEvent::Zeroed);
            }
            Doing::Exposing(exposing) => self.go_on_exposing(exposing),
        }
    }

    fn introduced(&mut self, answers: &[String], nonsense: u32, now: Instant) {
        let checked = self.language.recognise(answers).and_then(|identity| {
            let mut scales = self.full_scales.iter();
            scales.try_for_each(|scale| self.language.check_range(*scale)).map(|()| identity)
        });
        match checked {
            Ok(identity) => {
                let facts = PhotometerFacts { identity };
                self.events.push_back(PhotometerEvent::Ready(facts));
            }
            // The first line after a port was opened may be the rest of another.
            Err(_) if nonsense < NONSENSE_MAX => {
                self.hello(nonsense + 1);
                self.resume_at = Some(now + ASK_AGAIN);
            }
            Err(Wrong { what, expected, help }) => {
                let refusal = Refusal { device: self.name.clone(), what, expected, help };
                self.trouble(Trouble::Refused(refusal));
            }
        }
    }

    fn fault(&mut self, name: String) {
        let device = self.name.clone();
        let cause = Cause::Detector;
        self.trouble(Trouble::Fault(NamedFault { device, name, cause, loses_position: false }));
    }

    fn trouble(&mut self, trouble: Trouble) {
        self.doing = Doing::Nothing;
        self.script.clear();
        self.events.push_back(PhotometerEvent::Trouble(trouble));
    }

    /// It did not answer in time.
    fn unanswered(&mut self, now: Instant, awaited: &Awaited) {
        self.lines.discard();
        if let Doing::Opening(_, nonsense) = self.doing {
            // Asked as often as it takes.
            return self.hello(nonsense);
        }
        let waited = now.since(awaited.since).as_secs_f64();
        let words =
            format!("{}: no answer to {} within {waited:.1} s", self.name, awaited.step.text);
        self.is_set_up = false;
        self.range = None;
        self.trouble(Trouble::Silent(words));
    }
}

/// The line to a meter, and what the rig file says of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// The port, as messages call it.
    pub port: String,
    /// Bits a second.
    pub baud: u32,
    /// The ranges, full scales in the meter's unit.
    pub full_scales: Vec<f64>,
    /// Readings a second.
    pub rate_hz: u32,
}

impl Driver for Meter {
    fn open(&mut self, _now: Instant) {
        self.lines = Lines::default();
        self.awaited = None;
        self.stale_until = None;
        self.resume_at = None;
        self.is_set_up = false;
        self.range = None;
        self.events.clear();
        self.hello(0);
    }

    fn handle_bytes(&mut self, now: Instant, bytes: &[u8]) {
        for line in self.lines.take(bytes) {
            if self.stale_until.take().is_none() {
                self.answered(now, &line);
            }
        }
    }

    fn handle_timeout(&mut self, now: Instant) {
        if self.stale_until.is_some_and(|until| until <= now) {
            self.stale_until = None;
        }
        if self.resume_at.is_some_and(|at| at <= now) {
            self.resume_at = None;
        }
        if let Some(awaited) = self.awaited.take_if(|awaited| awaited.until <= now) {
            self.unanswered(now, &awaited);
        }
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<Vec<u8>> {
        if self.awaited.is_some() || self.stale_until.is_some() || self.resume_at.is_some() {
            return None;
        }
        let step = self.script.pop_front()?;
        let bytes = format!("{}{}", step.text, self.language.end()).into_bytes();
        if step.expects == Expects::Nothing {
            // What was the last word has no answer that would say so.
            self.advance(now);
        } else {
            let until = step.until.unwrap_or(now + step.patience + self.wire_time(bytes.len()));
            self.awaited = Some(Awaited { step, since: now, until });
        }
        Some(bytes)
    }

    fn poll_timeout(&self) -> Option<Instant> {
        let awaited = self.awaited.as_ref().map(|awaited| awaited.until);
        let waits = !self.script.is_empty();
        let pauses = [self.stale_until, self.resume_at].into_iter().flatten().filter(|_| waits);
        pauses.chain(awaited).min()
    }

    fn name(&self) -> &str {
        &self.name
    }

    fn promises(&self) -> Promises {
        Promises {
            accepted: "range and averaging are set and were read back, and readings were asked for",
            done: "as many readings came back as were asked for",
            watchdog: None,
        }
    }
}

impl Photometer for Meter {
    fn begin(&mut self, now: Instant, command: PhotometerCommand) {
        match command {
            PhotometerCommand::Zero => {
                self.script = self.language.set_up().into();
                self.script.extend(self.language.zero());
                self.doing = Doing::Zeroing;
                self.advance(now);
            }
            PhotometerCommand::Expose(exposure) => self.begin_exposure(exposure),
        }
    }

    fn abandon(&mut self, _now: Instant) {
        self.script.clear();
        self.doing = Doing::Nothing;
        self.resume_at = None;
        // Two questions at once get their answers mixed up: the next one waits for this.
        if let Some(awaited) = self.awaited.take() {
            self.stale_until = Some(awaited.until);
        }
    }

    fn poll_event(&mut self) -> Option<PhotometerEvent> {
        self.events.pop_front()
    }
}
