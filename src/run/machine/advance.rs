//! How the machine goes on by itself: keeping the device's queue filled, stopping, standing
//! still, ending.

use std::time::Duration;

use firmware_protocol::{CommandId, Dwell, Home, Instant, MoveTo, Request};

use super::{
    Action, After, Fault, Index, Latch, Line, Machine, Next, OnFault, Outcome, Outstanding, Phase,
    Position, Source, State, What,
};
use crate::plan::Step;
use crate::run::channels::{all_axes, micros, route, to_channels};

impl Machine {
    /// Does what the last input made possible.
    pub(super) fn advance(&mut self, now: Instant) {
        match self.state {
            state if state.is_active() => self.advance_active(now),
            State::Stopping => self.advance_stopping(now),
            State::Done => {}
            _ => self.proceed(now),
        }
    }

    fn advance_active(&mut self, now: Instant) {
        if let Some((after, dwell)) = self.wish.take() {
            let is_dwelling = |dwell| self.outstanding.iter().any(|o| o.id == dwell);
            if dwell.is_some_and(is_dwelling) {
                self.wish = Some((after, dwell));
            } else if self.outstanding.is_empty() {
                self.at_rest(now, after);
            } else {
                self.begin_stop(after);
                return;
            }
        } else {
            self.fill(now);
        }
        self.follow_front(now);
    }

    fn advance_stopping(&mut self, now: Instant) {
        if self.next.is_some() {
            self.proceed(now);
        } else if self.stop_confirmed && self.outstanding.is_empty() {
            let after = std::mem::replace(&mut self.after, After::Pause);
            self.at_rest(now, after);
        }
    }

    fn at_rest(&mut self, now: Instant, after: After) {
        match after {
            After::Finish(outcome) => self.finish(outcome),
            After::Pause => self.go(State::Paused),
            After::Resubmit => {
                self.next = Some(Next::Run);
                self.proceed(now);
            }
        }
    }

    /// Does what is to follow a standstill, or the next thing that stands in its way.
    fn proceed(&mut self, now: Instant) {
        let is_busy = !self.outstanding.is_empty() || !self.stop_confirmed;
        let Some(next) = self.next else { return };
        if is_busy || self.line == Line::Opening {
            return;
        }
        match self.latch {
            Latch::Clearing => return,
            Latch::Closed => {
                self.latch = Latch::Clearing;
                self.actions.push_back(Action::Send(Request::ClearFault));
                return;
            }
            Latch::Open => {}
        }
        if next == Next::Run && matches!(self.work.phase(), Phase::Judging | Phase::Deciding) {
            return;
        }
        self.next = None;
        self.fault = None;
        match next {
            Next::Pause => self.go(State::Paused),
            Next::Run => {
                self.fill(now);
                self.follow_front(now);
            }
        }
    }

    /// Keeps the device busy several commands ahead, so that the wire's time hides behind motion.
    fn fill(&mut self, now: Instant) {
        if self.outstanding.is_empty() {
            let unmeasured = std::mem::take(&mut self.unmeasured);
            self.work.put_back(unmeasured);
            if !self.position.is_trusted() {
                self.home();
            }
        }
        if !self.position.is_trusted() {
            return;
        }
        while let Some(index) = self.work.peek(self.dwells()) {
            let source = if self.work.step(index).source_off { Source::Off } else { Source::On };
            if source != self.source {
                if self.outstanding.is_empty() {
                    self.asked = Some(source);
                    self.actions.push_back(Action::AskSource(source));
                    self.go(State::Paused);
                }
                return;
            }
            if self.windows > 0 && self.work.step(index).swept.is_some() {
                if !self.has_room_for_sweep() || !self.submit_sweep(index) {
                    return;
                }
                continue;
            }
            if !self.has_room(index) {
                return;
            }
            self.work.take();
            self.submit(now, index);
        }
        if self.outstanding.is_empty() && self.work.is_handed_out() {
            match self.work.phase() {
                Phase::Check => {
                    self.work.begin_judging();
                    self.actions.push_back(Action::Judge);
                }
                Phase::Steps if self.work.is_open() => {
                    self.work.begin_deciding();
                    self.actions.push_back(Action::Decide);
                }
                Phase::Steps => self.finish(self.ending.clone()),
                Phase::Deciding | Phase::Judging | Phase::WarmUp => {}
            }
        }
    }

    /// The steps that will be measured whatever is decided now, in order, and one more.
    pub fn steps_ahead(&self) -> Vec<Step> {
        let on_device = self.outstanding.iter().flat_map(|outstanding| outstanding.what.indices());
        let on_device = on_device.filter(|index| !self.work.is_recorded(*index));
        on_device.chain(self.work.next()).map(|index| *self.work.step(index)).collect()
    }

    fn dwells(&self) -> usize {
        let reads = |o: &&Outstanding| matches!(o.what, What::Dwell { .. } | What::Sweep(_));
        self.outstanding.iter().filter(reads).count()
    }

    fn has_room(&self, index: Index) -> bool {
        let to = self.work.step(index).at_rest().counts;
        let is_there = self.commanded == Some(to);
        let is_straight = || route(&self.setup.rig, self.commanded, to).via.is_none();
        let moves = if is_there { 0 } else { 2 - usize::from(is_straight()) };
        self.outstanding.len() + moves < self.window
    }

    fn submit(&mut self, now: Instant, index: Index) {
        let step = self.work.step(index).at_rest();
        let rig = self.setup.rig.clone();
        let mut settle = Duration::ZERO;
        if self.commanded != Some(step.counts) {
            let way = route(&rig, self.commanded, step.counts);
            settle = way.settle;
            for stop in way.via.into_iter().chain([step.counts]) {
                let targets = to_channels(&rig, stop);
                self.send(What::Move, |id| Request::MoveTo(MoveTo { id, targets }));
            }
            self.commanded = Some(step.counts);
        }
        let id = self.send(What::Dwell { index, settle }, |id| {
            Request::Dwell(Dwell {
                id,
                reading: step.id,
                gain: step.gain,
                shutter: step.shutter,
                settle_us: micros(settle),
                duration_us: micros(step.dwell),
            })
        });
        if self.outstanding.len() == 1 {
            self.note_start(now, id);
        }
    }

    fn home(&mut self) {
        let axes = all_axes(&self.setup.rig);
        self.commanded = None;
        self.send(What::Home, |id| Request::Home(Home { id, axes }));
    }

    pub(super) fn send(
        &mut self,
        what: What,
        request: impl FnOnce(CommandId) -> Request,
    ) -> CommandId {
        let id = CommandId(self.next_id);
        self.next_id = self.next_id.saturating_add(1);
        self.outstanding.push_back(Outstanding { id, what, is_void: false });
        self.actions.push_back(Action::Send(request(id)));
        id
    }

    /// The device began this command: if it is a dwell, it settles from now on.
    pub(super) fn note_start(&mut self, now: Instant, id: CommandId) {
        let command = self.outstanding.iter().find(|outstanding| outstanding.id == id);
        if let Some(Outstanding { what: What::Dwell { settle, .. }, .. }) = command {
            self.settling = Some((id, now + *settle));
        }
    }

    /// Commands run in order: the state is that of the oldest outstanding one.
    fn follow_front(&mut self, now: Instant) {
        let Some(Outstanding { id, what, .. }) = self.outstanding.front() else { return };
        let id = *id;
        match what {
            What::Home => self.go(State::Homing),
            What::Move => self.go(State::Moving),
            What::Sweep(_) => self.go(State::Dwelling),
            What::Dwell { .. } => {
                if self.settling.is_none_or(|(settling, _)| settling != id) {
                    self.note_start(now, id);
                }
                let is_settling = self.settling.is_some_and(|(_, until)| until > now);
                self.go(if is_settling { State::Settling } else { State::Dwelling });
            }
        }
    }

    /// Brakes, and forgets what was queued.
    pub(super) fn begin_stop(&mut self, after: After) {
        self.after = after;
        self.next = None;
        self.wish = None;
        self.halt();
        self.go(State::Stopping);
    }

    fn halt(&mut self) {
        self.commanded = None;
        self.settling = None;
        self.stop_confirmed = false;
        self.latch = Latch::Closed;
        self.actions.push_back(Action::Send(Request::Stop));
    }

    /// Stops because of a fault.
    pub(super) fn stand_still(&mut self, fault: Fault) {
        if self.state == State::Done {
            return;
        }
        if let Some(doubt) = fault.doubt() {
            self.trust(Position::Untrusted(doubt));
        }
        // The first cause stays: what follows from it is no news, unless nobody answers any more.
        if self.state == State::Faulted && matches!(fault, Fault::Device(_)) && self.next.is_none()
        {
            return;
        }
        self.actions.push_back(Action::Fault(fault.clone()));
        self.next = None;
        if fault.is_link() {
            self.line = Line::Down;
            self.forget_session();
        } else {
            self.halt();
        }
        let wish = self.wish.take().map(|(after, _)| after);
        let after = wish.or_else(|| (self.state == State::Stopping).then(|| self.after.clone()));
        // To continue would help neither; a resume does.
        let is_for_good = matches!(fault, Fault::Journal(_) | Fault::Undecided(_));
        let must_finish = self.setup.on_fault == OnFault::Finish || is_for_good;
        self.fault = Some(fault.clone());
        self.go(State::Faulted);
        match after {
            Some(After::Finish(outcome)) => self.finish(outcome),
            _ if must_finish => self.finish(Outcome::Faulted(fault)),
            _ => {}
        }
    }

    /// The device forgets the session that is over, and so do we: what had no result will be
    /// measured again.
    pub(super) fn forget_session(&mut self) {
        let lost = self.outstanding.drain(..).flat_map(|lost| lost.what.indices());
        self.unmeasured.extend(lost);
        self.commanded = None;
        self.settling = None;
        self.stop_confirmed = true;
    }

    pub(super) fn finish(&mut self, outcome: Outcome) {
        if self.state == State::Done {
            return;
        }
        self.next = None;
        self.go(State::Done);
        self.actions.push_back(Action::Finish(outcome));
    }
}
