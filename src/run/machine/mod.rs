//! The run machine: what the device is told next, given what it said and what people ask.
//!
//! It knows the steps to do, the last event, and `now`; no link, runtime, file or clock. Feed it
//! with [`Machine::handle`], [`Machine::handle_request`] and [`Machine::handle_timeout`]; after
//! each of them take [`Machine::poll_action`] until it is empty, in order, then ask
//! [`Machine::poll_timeout`]. Actions are to be carried out in that order: a result is
//! acknowledged only after its `Record` was taken over.

mod advance;
#[cfg(test)]
mod bench_tests;
mod heard;
#[cfg(test)]
mod open_tests;
mod request;
#[cfg(test)]
mod sweep_tests;
mod sweeping;
#[cfg(test)]
mod tests;
mod work;

use std::collections::VecDeque;
use std::time::Duration;

use firmware_protocol::{
    Cause, CommandId, DwellResult, Event, Instant, Rejection, Request, TickUnwrapper,
};

pub use heard::{Action, Connected, Input, OnFault, Setup, Source, Taken};
pub use request::{Answer, Wish};
pub use work::Program;

use super::channels;
use super::state::{Doubt, Fault, Outcome, Position, State};
use super::warm_up::Stability;
use crate::device::QUEUE_DEPTH_MIN;
use crate::rig::Latched;
use sweeping::Sweeping;
use work::{Index, Phase, Work, is_warm_up};

/// How often in a row the device may say that its queue is full before that is a fault.
const QUEUE_FULL_MAX: u32 = 3;

#[derive(Debug)]
enum What {
    Home,
    Move,
    Dwell { index: Index, settle: Duration },
    Sweep(Sweeping),
}

#[derive(Debug)]
struct Outstanding {
    id: CommandId,
    what: What,
    // An earlier command went wrong: whatever this one yields, it was not what was meant.
    is_void: bool,
}

/// What follows when the axes stand still and nothing is outstanding.
#[derive(Debug, Clone, PartialEq)]
enum After {
    Finish(Outcome),
    Pause,
    Resubmit,
}

/// Whether the device takes commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Latch {
    /// It was told `ClearFault`, and has not answered.
    Clearing,
    /// Not before it is told `ClearFault`.
    Closed,
    Open,
}

/// Whether anybody is at the other end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Line {
    Down,
    /// Somebody is opening another session.
    Opening,
    Up,
}

/// What follows when a standstill is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Next {
    Pause,
    Run,
}

/// See the module.
#[derive(Debug)]
pub struct Machine {
    setup: Setup,
    work: Work,
    state: State,
    position: Position,
    // How the run ends when nothing is left to do.
    ending: Outcome,
    // The boot in which this run saw the axes homed.
    homed_in: Option<u32>,
    boot_id: u32,
    window: usize,
    // The most windows that a sweep can have.
    windows: u16,
    next_id: u32,
    outstanding: VecDeque<Outstanding>,
    // Steps whose commands ended without a reading, to be put back before the next is sent.
    unmeasured: Vec<Index>,
    // Where the last move ended or will end; `None` if nobody knows.
    commanded: Option<Latched>,
    // The dwell that settles, and until when.
    settling: Option<(CommandId, Instant)>,
    // Once the dwell named here is over, stop, then do this.
    wish: Option<(After, Option<CommandId>)>,
    after: After,
    stop_confirmed: bool,
    latch: Latch,
    line: Line,
    // What to do as soon as the device lets us.
    next: Option<Next>,
    fault: Option<Fault>,
    asked: Option<Source>,
    source: Source,
    queue_full: u32,
    ticks: TickUnwrapper,
    actions: VecDeque<Action>,
}

impl Machine {
    /// A machine that waits for [`Input::Connected`].
    pub fn new(setup: Setup, program: Program) -> Self {
        Self {
            setup,
            work: Work::new(program),
            state: State::Idle,
            position: Position::Untrusted(Doubt::NotHomed),
            ending: Outcome::Complete,
            homed_in: None,
            boot_id: 0,
            window: 1,
            windows: 0,
            next_id: 1,
            outstanding: VecDeque::new(),
            unmeasured: Vec::new(),
            commanded: None,
            settling: None,
            wish: None,
            after: After::Pause,
            stop_confirmed: true,
            latch: Latch::Open,
            line: Line::Down,
            next: None,
            fault: None,
            asked: None,
            source: Source::On,
            queue_full: 0,
            ticks: TickUnwrapper::default(),
            actions: VecDeque::new(),
        }
    }

    /// The state now.
    pub fn state(&self) -> State {
        self.state
    }

    /// Whether the position is trusted, and why.
    pub fn position(&self) -> Position {
        self.position
    }

    /// The fault that the run stands in.
    pub fn fault(&self) -> Option<&Fault> {
        self.fault.as_ref().filter(|_| self.state == State::Faulted)
    }

    /// Steps done in this session, and steps that it had to do; warm-up and checks apart.
    pub fn progress(&self) -> (usize, usize) {
        self.work.progress()
    }

    /// What to do next. Ask again until `None`, after every `handle_…`.
    pub fn poll_action(&mut self) -> Option<Action> {
        self.actions.pop_front()
    }

    /// When [`Machine::handle_timeout`] wants to be called. Ask again after every `handle_…`.
    /// `None` while paused, faulted or idle: at rest nothing ticks.
    pub fn poll_timeout(&self) -> Option<Instant> {
        self.settling.filter(|_| self.state == State::Settling).map(|(_, until)| until)
    }

    /// Time has passed.
    pub fn handle_timeout(&mut self, now: Instant) {
        if self.poll_timeout().is_some_and(|until| until <= now) {
            self.go(State::Dwelling);
        }
    }

    /// Something happened.
    pub fn handle(&mut self, now: Instant, input: Input) {
        if self.state == State::Done {
            return;
        }
        match input {
            Input::Connected(connected) => self.on_connected(connected),
            Input::Rejected(id, rejection) => self.on_rejected(id, rejection),
            // A stop since then has latched it again.
            Input::Cleared if self.latch == Latch::Clearing => self.latch = Latch::Open,
            Input::Accepted(_) | Input::Cleared => {}
            Input::ClearRefused(rejection) => self.on_clear_refused(rejection),
            Input::Stopping => self.stop_confirmed = true,
            Input::Event(event) => self.on_event(now, event),
            Input::WindowGone(id) => self.on_window_gone(id),
            Input::Judged(Ok(())) => self.work.end_judging(),
            Input::Judged(Err(why)) => self.stand_still(Fault::ReferenceMoved(why)),
            Input::Decided(steps) => self.work.extend(steps),
            Input::Enough(why) => {
                self.conclude(now, why);
                return;
            }
            Input::Fault(fault) => self.stand_still(fault),
        }
        self.advance(now);
    }

    fn on_connected(&mut self, connected: Connected) {
        let Connected { boot_id, queue_depth, homed, last_id, fault, windows } = connected;
        let axes = channels::all_axes(&self.setup.rig).0;
        let is_homed = homed.0 & axes == axes;
        self.window = usize::from(queue_depth).max(QUEUE_DEPTH_MIN);
        self.next_id = last_id.map_or(1, |last| last.0.saturating_add(1));
        self.boot_id = boot_id;
        self.windows = windows;
        self.line = Line::Up;
        self.forget_session();
        self.ticks = TickUnwrapper::default();
        self.latch = if fault.is_some() { Latch::Closed } else { Latch::Open };
        self.trust(match (self.position, self.homed_in) {
            (upset @ Position::Untrusted(Doubt::Upset(_)), _) => upset,
            (_, Some(was)) if was != boot_id => {
                Position::Untrusted(Doubt::Restarted { was, is: boot_id })
            }
            (_, Some(_)) if is_homed => Position::Trusted { boot_id },
            (_, None) if is_homed && !self.setup.home_first => Position::Trusted { boot_id },
            _ => Position::Untrusted(Doubt::NotHomed),
        });
        match (self.state, fault) {
            // What an earlier session left: whoever starts a run by hand has seen it, and its
            // device says so if it persists. Elsewhere somebody must say continue.
            (State::Idle, fault)
                if self.setup.on_fault == OnFault::Finish
                    || matches!(fault, None | Some(Cause::LeaseExpired | Cause::Stopped)) =>
            {
                match self.wish.take() {
                    Some((After::Pause, _)) => self.go(State::Paused),
                    Some((After::Finish(outcome), _)) => self.finish(outcome),
                    _ => self.next = Some(Next::Run),
                }
            }
            (State::Idle, Some(cause)) => self.stand_still(Fault::Device(cause)),
            _ => {}
        }
    }

    fn on_clear_refused(&mut self, rejection: Rejection) {
        if self.latch != Latch::Clearing {
            return;
        }
        self.latch = Latch::Closed;
        self.next = None;
        self.stand_still(match rejection {
            Rejection::Faulted(cause) => Fault::Device(cause),
            other => Fault::Refused(other),
        });
    }

    fn on_rejected(&mut self, id: CommandId, rejection: Rejection) {
        let Some(refused) = self.end(id) else { return };
        self.void_after(id);
        self.unmeasured.extend(refused.what.indices());
        if !self.state.is_active() {
            return;
        }
        match rejection {
            Rejection::QueueFull if self.queue_full < QUEUE_FULL_MAX => {
                self.queue_full += 1;
                self.window = self.window.saturating_sub(1).max(QUEUE_DEPTH_MIN);
                let after = self.wish.take().map_or(After::Resubmit, |(after, _)| after);
                self.begin_stop(after);
            }
            Rejection::Faulted(cause) => self.stand_still(Fault::Device(cause)),
            other => self.stand_still(Fault::Refused(other)),
        }
    }

    fn on_event(&mut self, now: Instant, event: Event) {
        match event {
            Event::Started(id, _) => self.note_start(now, id),
            Event::Window(window) => self.on_window(&window),
            Event::Done(done) if self.is_sweep(done.id) => self.on_swept(done.id),
            Event::Done(done) => {
                self.acknowledge(done.id);
                let ended = self.end(done.id);
                if ended.is_some_and(|ended| matches!(ended.what, What::Home)) {
                    self.homed_in = Some(self.boot_id);
                    self.commanded = Some(channels::to_axes(&self.setup.rig, &done.readback));
                    self.trust(Position::Trusted { boot_id: self.boot_id });
                }
            }
            Event::Sampled(result) => self.on_sampled(result),
            Event::Failed(id, cause, _) => self.on_failed(id, cause),
        }
    }

    fn on_sampled(&mut self, result: DwellResult) {
        let id = result.id;
        match self.end(id) {
            Some(Outstanding { what: What::Dwell { index, .. }, is_void: false, .. }) => {
                let step = self.work.step(index).at_rest();
                let time_s = self.ticks.unwrap(result.end_tick) as f64 * 1e-6;
                let mean = result.mean;
                if self.work.record(index) {
                    self.queue_full = 0;
                    let taken = Taken { step, id, result };
                    self.actions.push_back(Action::Record(Box::new(taken)));
                    self.acknowledge(id);
                    if is_warm_up(&step) {
                        self.on_warm_up(time_s, mean);
                    }
                    return;
                }
            }
            Some(Outstanding { what: What::Dwell { index, .. }, .. }) => {
                self.unmeasured.push(index);
            }
            _ => {}
        }
        self.acknowledge(id);
    }

    fn on_warm_up(&mut self, time_s: f64, mean: f64) {
        if let Stability::TimedOut { waited_s, change_relative } = self.work.watch(time_s, mean)
            && self.state.is_active()
        {
            self.stand_still(Fault::NotWarm { waited_s, change_relative });
        }
    }

    fn on_failed(&mut self, id: CommandId, cause: Cause) {
        self.acknowledge(id);
        let Some(failed) = self.end(id) else { return };
        self.void_after(id);
        match failed.what {
            What::Dwell { .. } | What::Sweep(_) => self.unmeasured.extend(failed.what.indices()),
            What::Home => self.trust(Position::Untrusted(Doubt::Upset(cause))),
            What::Move => {}
        }
        if cause != Cause::Stopped || self.state.is_active() {
            self.stand_still(Fault::Device(cause));
        }
    }

    fn acknowledge(&mut self, id: CommandId) {
        self.actions.push_back(Action::Send(Request::Acknowledge(id)));
    }

    /// The command is over, one way or another.
    fn end(&mut self, id: CommandId) -> Option<Outstanding> {
        let at = self.outstanding.iter().position(|outstanding| outstanding.id == id)?;
        self.outstanding.remove(at)
    }

    fn void_after(&mut self, id: CommandId) {
        for later in self.outstanding.iter_mut().filter(|outstanding| outstanding.id > id) {
            later.is_void = true;
        }
    }

    fn trust(&mut self, position: Position) {
        if std::mem::replace(&mut self.position, position) != position {
            self.actions.push_back(Action::Position(position));
        }
    }

    fn go(&mut self, state: State) {
        if self.state == state {
            return;
        }
        assert!(
            self.state.may_become(state),
            "{} can't become {}: a bug in the run machine",
            self.state.name(),
            state.name()
        );
        self.state = state;
        self.actions.push_back(Action::Became(state));
    }
}
