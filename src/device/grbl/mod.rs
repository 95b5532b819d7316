//! The driver of boards with grbl 1.1: a machine without I/O.
//!
//! | word | what it means here |
//! |---|---|
//! | accepted | grbl said `ok`: the line is parsed and queued; nothing has moved |
//! | done | motion has drained (`G4P0` was answered), the state is `Idle`, and the machine position that was read back equals the target within a step |
//! | watchdog | none: a board whose host falls silent ends what it was told |
//!
//! There is no checksum, so that nothing is believed that was not read back; and no settings are
//! written. Positions are grbl's own: steps from its machine zero. It does not know the rig's
//! zeros, nor what the axes carry.

mod codec;
mod going;
mod greeting;
mod opening;
mod settings;
mod stopping;
mod stream;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;
use std::time::Duration;

use firmware_protocol::{Cause, Instant, Shutter};

use super::axes::{Axes, AxesCommand, AxesEvent, Located};
use super::driver::{Driver, NamedFault, Promises, Trouble};
use crate::rig::GrblOutput;
use codec::{Lines, Message, Position, Report, State, describe_alarm, describe_error};
pub use greeting::Greeting;
pub(super) use greeting::Listener;
use settings::{Board, whole};
use stream::{Purpose, Stream};

/// Real-time bytes: acted on at once, wherever they stand.
mod byte {
    pub(super) const ASK: u8 = b'?';
    pub(super) const HOLD: u8 = b'!';
    pub(super) const JOG_CANCEL: u8 = 0x85;
    pub(super) const RESET: u8 = 0x18;
}

/// How often a moving board is asked where it is; grbl's documents recommend no more than 5 to
/// 10 Hz.
const WATCH_EVERY: Duration = Duration::from_millis(200);
/// How long an answer to `?` may take before it is asked again: the report of a real board comes
/// within 20 ms.
const ANSWER_WITHIN: Duration = Duration::from_millis(300);
/// How often it is asked before it counts as silent.
const TRIES: u32 = 6;
/// A board that stands idle this often in a row, and has not answered its lines, lost one.
const IDLE_IN_A_ROW: u32 = 3;

/// What the board is doing for us.
#[derive(Debug, Clone, PartialEq)]
enum Task {
    Clearing(stopping::Clearing),
    Homing { until: Instant, is_answered: bool },
    Locating,
    Moving(going::Moving),
    None,
    Opening(opening::Step),
    PuttingShutter(Shutter),
    Stopping(stopping::Stopping),
}

/// See the module.
#[derive(Debug)]
pub struct Grbl {
    name: String,
    letters: Vec<char>,
    shutter: Option<GrblOutput>,
    lines: Lines,
    board: Board,
    /// Where our axes stand in reports, and their steps a unit.
    places: Vec<(usize, f64)>,
    stream: Stream,
    /// Real-time bytes that go before all lines.
    urgent: Vec<u8>,
    task: Task,
    /// When to ask next, and how often that was in vain.
    ask_at: Option<Instant>,
    tries: u32,
    /// What work positions are offset by.
    offset: Option<Vec<f64>>,
    garbled: u32,
    bytes: u64,
    alarm: Option<u8>,
    events: VecDeque<AxesEvent>,
}

impl Grbl {
    /// A driver for the axes with these letters, in the rig file's order.
    pub fn new(port: &str, letters: &[char], shutter: Option<GrblOutput>) -> Self {
        Self {
            name: format!("grbl at {port}"),
            letters: letters.to_vec(),
            shutter,
            lines: Lines::default(),
            board: Board::default(),
            places: Vec::new(),
            stream: Stream::new(0),
            urgent: Vec::new(),
            task: Task::None,
            ask_at: None,
            tries: 0,
            offset: None,
            garbled: 0,
            bytes: 0,
            alarm: None,
            events: VecDeque::new(),
        }
    }

    fn say(&mut self, event: AxesEvent) {
        self.events.push_back(event);
    }

    /// The open command ends here, with trouble.
    fn fail(&mut self, trouble: Trouble) {
        self.rest();
        self.say(AxesEvent::Trouble(trouble));
    }

    /// The open command ends here, and the board stands for this reason.
    fn fault(&mut self, name: String, cause: Cause, loses_position: bool) {
        let device = self.name.clone();
        self.fail(Trouble::Fault(NamedFault { device, name, cause, loses_position }));
    }

    fn rest(&mut self) {
        self.task = Task::None;
        self.ask_at = None;
        self.tries = 0;
    }

    /// Asks for a report, at once.
    fn ask(&mut self, now: Instant) {
        if !self.urgent.contains(&byte::ASK) {
            self.urgent.push(byte::ASK);
        }
        self.ask_at = Some(now + ANSWER_WITHIN);
    }

    /// It was asked and has not answered: again, or enough.
    fn ask_again(&mut self, now: Instant) {
        self.tries += 1;
        if self.tries < TRIES {
            self.ask(now);
            return;
        }
        let heard = match self.garbled {
            0 => "nothing".to_owned(),
            n => format!("{n} damaged lines and no whole one"),
        };
        let waited = ANSWER_WITHIN * TRIES;
        let name = &self.name;
        let what = format!("{name}: no answer to ? in {} ms, but {heard}", waited.as_millis());
        self.fail(Trouble::Silent(what));
    }

    fn hear(&mut self, now: Instant, message: Message) {
        if !matches!(message, Message::Garbled) {
            self.garbled = 0;
        }
        match message {
            Message::Garbled => self.garbled += 1,
            Message::Banner(version) => self.hear_banner(now, &version),
            Message::Alarm(number) => self.hear_alarm(number),
            Message::Error(number) => self.hear_error(number),
            Message::Feedback(feedback) => self.board.note(&feedback),
            Message::Ok => self.hear_ok(now),
            Message::Setting(number, value) => self.board.set(number, value),
            Message::StartUp => {}
            Message::Status(report) => self.hear_report(now, &report),
        }
    }

    fn hear_banner(&mut self, now: Instant, version: &str) {
        self.stream.clear();
        match self.task.clone() {
            Task::Opening(_) => self.begin_opening(now, Some(version)),
            Task::Stopping(stopping) => self.stopped_by_reset(now, stopping),
            Task::Clearing(_) => self.go_on_clearing(now),
            // After an alarm of homing the board starts over by itself; it has said that its
            // position is lost.
            Task::None if self.alarm.is_some_and(|number| describe_alarm(number).1) => {}
            _ => {
                self.rest();
                self.say(AxesEvent::Trouble(Trouble::Restarted));
            }
        }
    }

    fn hear_alarm(&mut self, number: u8) {
        self.alarm = Some(number);
        self.stream.clear();
        match self.task {
            // A reset that we sent ourselves, or an earlier host did: the banner follows.
            Task::Clearing(_) | Task::Opening(_) => {}
            Task::Stopping(_) => self.lose_in_stop(),
            _ => {
                let (name, loses_position) = describe_alarm(number);
                self.fault(name, cause_of(number), loses_position);
            }
        }
    }

    fn hear_error(&mut self, number: u8) {
        let purpose = self.stream.answered();
        match &self.task {
            // Half a line that somebody left, the errors of its start-up blocks, an answer that
            // comes too late: the board is asked until it answers as it should.
            Task::Opening(_) | Task::Stopping(_) | Task::None => {}
            _ => {
                let what = describe_error(number);
                let name = match purpose {
                    Some(Purpose::Home) => format!("refused to home: {what}"),
                    Some(Purpose::Move | Purpose::Barrier) => format!("refused to move: {what}"),
                    _ => what,
                };
                self.break_off(name);
            }
        }
    }

    /// A line was refused: what else was sent must not be carried out.
    fn break_off(&mut self, name: String) {
        self.urgent.push(byte::HOLD);
        self.stream.clear();
        self.fault(name, Cause::Stopped, true);
    }

    fn hear_ok(&mut self, now: Instant) {
        match self.stream.answered() {
            Some(Purpose::Barrier) => self.drained(now),
            Some(Purpose::Home) => self.homed(now),
            Some(Purpose::Ask) => self.answered(now),
            Some(Purpose::Unlock) => self.cleared(),
            // Its barrier follows; or it is said in answer to what an earlier host sent.
            Some(Purpose::Move | Purpose::Shutter) | None => {}
        }
    }

    fn hear_report(&mut self, now: Instant, report: &Report) {
        if let Some(offset) = &report.offset {
            self.offset = Some(offset.clone());
        }
        self.tries = 0;
        match self.task.clone() {
            Task::Opening(step) => self.open_on(now, step, report),
            Task::Moving(moving) => self.moving(now, moving, report),
            Task::Homing { is_answered, .. } => self.homing(now, is_answered, report),
            Task::Locating => self.located(report),
            Task::PuttingShutter(_) => self.ask_at = Some(now + WATCH_EVERY),
            Task::Stopping(stopping) => self.stop_on(now, stopping, report),
            Task::Clearing(_) | Task::None => {}
        }
    }

    /// Machine positions of our axes, steps; `None` where work positions are reported and what
    /// they are offset by is not known yet.
    fn steps(&self, report: &Report) -> Option<Located> {
        let machine: Vec<f64> = match &report.position {
            Position::Machine(units) => units.clone(),
            Position::Work(units) => {
                let offset = self.offset.as_ref().filter(|offset| offset.len() == units.len())?;
                units.iter().zip(offset).map(|(work, offset)| work + offset).collect()
            }
        };
        let step = |(place, steps_per_unit): &(usize, f64)| {
            machine.get(*place).map(|units| whole(units * steps_per_unit))
        };
        let steps = self.places.iter().map(step).collect::<Option<_>>()?;
        Some(Located { steps, device_time_s: None })
    }
}

/// The nearest cause of the common vocabulary. grbl does not say which axis: the first stands for
/// it, and the fault's name for what happened.
const fn cause_of(alarm: u8) -> Cause {
    match alarm {
        1 => Cause::LimitSwitch(0),
        6..=10 => Cause::HomingMissed(0),
        2 | 3 => Cause::Stopped,
        _ => Cause::Stalled(0),
    }
}

impl Driver for Grbl {
    fn open(&mut self, now: Instant) {
        self.lines = Lines::default();
        self.garbled = 0;
        self.bytes = 0;
        self.alarm = None;
        self.begin_opening(now, None);
    }

    fn handle_bytes(&mut self, now: Instant, bytes: &[u8]) {
        self.bytes += bytes.len() as u64;
        for byte in bytes {
            if let Some(message) = self.lines.take(*byte) {
                self.hear(now, message);
            }
        }
    }

    fn handle_timeout(&mut self, now: Instant) {
        if self.ask_at.is_none_or(|at| at > now) {
            return;
        }
        match self.task.clone() {
            Task::None => self.ask_at = None,
            Task::Opening(step) => self.open_again(now, step),
            Task::Homing { until, .. } => self.homing_late(now, until),
            Task::Stopping(stopping) => self.stopping_late(now, stopping),
            Task::Clearing(clearing) => self.clearing_late(now, &clearing),
            Task::Locating | Task::Moving(_) | Task::PuttingShutter(_) => self.ask_again(now),
        }
    }

    fn poll_transmit(&mut self, _now: Instant) -> Option<Vec<u8>> {
        if !self.urgent.is_empty() {
            return Some(std::mem::take(&mut self.urgent));
        }
        self.stream.poll()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.ask_at
    }

    fn name(&self) -> &str {
        &self.name
    }

    fn promises(&self) -> Promises {
        Promises {
            accepted: "grbl parsed the line and queued it (ok)",
            done: "its motion has drained, its state is Idle, and the position that was read \
                   back equals the target within a step",
            watchdog: None,
        }
    }
}

impl Axes for Grbl {
    fn begin(&mut self, now: Instant, command: AxesCommand) {
        match command {
            AxesCommand::Home => self.begin_homing(now),
            AxesCommand::MoveTo(steps) => self.begin_move(now, &steps),
            AxesCommand::Locate => {
                self.task = Task::Locating;
                self.ask(now);
            }
            AxesCommand::PutShutter(shutter) => self.begin_shutter(now, shutter),
            AxesCommand::Clear => self.begin_clearing(now),
        }
    }

    fn stop(&mut self, now: Instant) {
        self.begin_stopping(now);
    }

    fn poll_event(&mut self) -> Option<AxesEvent> {
        self.events.pop_front()
    }
}
