//! What people ask of a run, and what they are told. Asking twice does no harm.

use firmware_protocol::{CommandId, Instant};

use super::{Action, After, Fault, Line, Machine, Next, Outcome, State, What};

/// What people can ask of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wish {
    /// Stop at once, and end the run.
    Abort,
    /// Leave the fault, and pause.
    ClearFault,
    /// Go on after a pause, a question or a fault; homes first where the position is not trusted.
    Continue,
    /// Finish the dwell or the sweep that runs, and come to rest.
    Pause,
    /// Finish the dwell or the sweep that runs, come to rest, and end the run.
    Stop,
}

/// What happened to a wish.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// The run goes on.
    Continuing,
    /// The run is going on already.
    Running,
    /// The run will pause after the dwell or the sweep that runs.
    Pausing,
    /// The run is paused already.
    Paused,
    /// The run is coming to its end.
    Ending,
    /// The run is over already.
    Over,
    /// The fault is being cleared.
    Clearing,
    /// The link is being opened again.
    Reconnecting,
    /// There is no fault to clear.
    NoFault,
    /// The run stands still because of a fault: continue, or abort.
    Faulted,
}

impl Answer {
    /// One sentence for people.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Continuing => "continuing",
            Self::Running => "running already",
            Self::Pausing => "pausing after the dwell or sweep that runs",
            Self::Paused => "paused already",
            Self::Ending => "ending",
            Self::Over => "over already",
            Self::Clearing => "clearing the fault",
            Self::Reconnecting => "opening the link again",
            Self::NoFault => "no fault to clear",
            Self::Faulted => "standing still because of a fault: continue or abort",
        }
    }
}

impl Machine {
    /// Somebody asks something.
    pub fn handle_request(&mut self, now: Instant, wish: Wish) -> Answer {
        let answer = match wish {
            _ if self.state == State::Done => Answer::Over,
            Wish::Abort => self.end_now(),
            Wish::ClearFault => self.leave_fault(Next::Pause),
            Wish::Continue => self.go_on(),
            Wish::Pause => self.pause(),
            Wish::Stop => self.end_after_dwell(Outcome::Stopped),
        };
        self.advance(now);
        answer
    }

    /// A rule of the plan is met. What the device has in its queue is still measured, then what the
    /// plan closes with; the run ends without having braked. Before its first step, and in a
    /// fault, it ends at once.
    pub fn conclude(&mut self, now: Instant, rule: String) {
        if self.state == State::Done || self.ending != Outcome::Complete {
            return;
        }
        self.ending = Outcome::Reached(rule);
        if self.state == State::Faulted || !self.work.conclude() {
            self.end_after_dwell(self.ending.clone());
        }
        self.advance(now);
    }

    fn pause(&mut self) -> Answer {
        match self.state {
            State::Faulted => {
                self.next = None;
                Answer::Faulted
            }
            State::Paused => {
                self.next = None;
                Answer::Paused
            }
            State::Stopping => {
                self.next = None;
                if self.after == After::Resubmit {
                    self.after = After::Pause;
                }
                if self.after == After::Pause { Answer::Pausing } else { Answer::Ending }
            }
            _ if matches!(self.wish, Some((After::Finish(_), _))) => Answer::Ending,
            _ => {
                self.wish = Some((After::Pause, self.running_dwell()));
                Answer::Pausing
            }
        }
    }

    fn end_after_dwell(&mut self, outcome: Outcome) -> Answer {
        match self.state {
            State::Faulted | State::Paused => self.finish(outcome),
            State::Stopping if matches!(self.after, After::Finish(_)) => {}
            State::Stopping => {
                self.next = None;
                self.after = After::Finish(outcome);
            }
            _ => self.wish = Some((After::Finish(outcome), self.running_dwell())),
        }
        Answer::Ending
    }

    fn end_now(&mut self) -> Answer {
        match self.state {
            State::Idle | State::Faulted | State::Paused => self.finish(Outcome::Aborted),
            State::Stopping => {
                self.next = None;
                self.after = After::Finish(Outcome::Aborted);
            }
            _ if self.outstanding.is_empty() => self.finish(Outcome::Aborted),
            _ => self.begin_stop(After::Finish(Outcome::Aborted)),
        }
        Answer::Ending
    }

    fn go_on(&mut self) -> Answer {
        match self.state {
            State::Paused => {
                if let Some(source) = self.asked.take() {
                    self.source = source;
                }
                self.next = Some(Next::Run);
                Answer::Continuing
            }
            State::Faulted => self.leave_fault(Next::Run),
            State::Stopping => match self.after {
                After::Finish(_) => Answer::Ending,
                After::Pause | After::Resubmit => {
                    self.after = After::Resubmit;
                    Answer::Continuing
                }
            },
            _ => match self.wish.take() {
                Some(ending @ (After::Finish(_), _)) => {
                    self.wish = Some(ending);
                    Answer::Ending
                }
                Some(_) => Answer::Continuing,
                None => Answer::Running,
            },
        }
    }

    fn leave_fault(&mut self, next: Next) -> Answer {
        if self.state != State::Faulted {
            return Answer::NoFault;
        }
        self.next = Some(next);
        if self.line != Line::Up {
            if self.line == Line::Down {
                self.line = Line::Opening;
                self.actions.push_back(Action::Reconnect);
            }
            return Answer::Reconnecting;
        }
        match &self.fault {
            // Whoever says continue takes the source as it is.
            Some(Fault::NotWarm { .. }) if next == Next::Run => self.work.leave_warm_up(),
            Some(Fault::ReferenceMoved(_)) if next == Next::Run => self.work.end_judging(),
            _ => {}
        }
        match next {
            Next::Pause => Answer::Clearing,
            Next::Run => Answer::Continuing,
        }
    }

    /// The dwell or the sweep that the device is in the middle of, as far as is known.
    fn running_dwell(&self) -> Option<CommandId> {
        let front = self.outstanding.front()?;
        matches!(front.what, What::Dwell { .. } | What::Sweep(_)).then_some(front.id)
    }
}
