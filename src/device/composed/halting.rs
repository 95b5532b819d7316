//! Coming to rest: every device that may be moving brakes, and then the commands that this ended
//! say so. And leaving what was stopped for.

use firmware_protocol::{Cause, CommandId, Event, Instant, Rejection, Reply, RequestType};

use super::Composer;
use super::part::Awaited;
use crate::device::axes::AxesCommand;

/// What is awaited while the axes come to rest or a fault is left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Halting {
    /// What ended commands say; `None` where nobody waits for them.
    cause: Option<Cause>,
    /// `ClearFault` was asked for meanwhile.
    clears: Clears,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Clears {
    /// Nobody asked.
    No,
    /// As soon as all stand.
    Next,
    /// The devices were told.
    Now,
}

impl Halting {
    /// Commands that this ends fail for this cause.
    pub(super) const fn for_cause(cause: Cause) -> Self {
        Self { cause: Some(cause), clears: Clears::No }
    }

    /// Nobody waits for what this ends.
    pub(super) const fn silent() -> Self {
        Self { cause: None, clears: Clears::No }
    }
}

impl Composer {
    /// Brakes whatever may be moving.
    pub(super) fn halt(&mut self, now: Instant, halting: Halting) {
        let first_cause = self.halting.and_then(|before| before.cause);
        let cause = first_cause.or(halting.cause);
        self.halting = Some(Halting { cause, ..halting });
        for part in &mut self.parts {
            let is_stopping = matches!(part.awaited, Some(Awaited::Stopped | Awaited::Ready));
            if part.awaited.is_some() && !is_stopping && !part.is_gone {
                part.awaited = Some(Awaited::Stopped);
                part.driver.stop(now);
            }
        }
        self.meter.abandon(now);
    }

    /// Whether coming to rest came further.
    pub(super) fn go_on_halting(&mut self, now: Instant) -> bool {
        let Some(halting) = self.halting else { return false };
        let is_waiting = self.parts.iter().any(|part| part.awaited.is_some());
        if is_waiting || (halting.clears == Clears::Now && self.meter.awaited.is_some()) {
            return false;
        }
        match halting.clears {
            Clears::Now => {
                self.halting = None;
                self.fault = None;
                self.reply(RequestType::ClearFault, Reply::Cleared);
            }
            clears => {
                self.fail_all(now, halting.cause);
                self.halting = None;
                if clears == Clears::Next {
                    self.clear(now);
                }
            }
        }
        true
    }

    fn fail_all(&mut self, now: Instant, cause: Option<Cause>) {
        let running = self.running.take().map(|(id, _)| id);
        let waiting: Vec<CommandId> = self.queue.drain(..).map(|command| command.id()).collect();
        let Some(cause) = cause else { return };
        for id in running.into_iter().chain(waiting) {
            self.end(id, Event::Failed(id, cause, now.tick()));
        }
    }

    /// Leaves the fault, once all stand.
    pub(super) fn clear(&mut self, now: Instant) {
        if let Some(halting) = &mut self.halting {
            if halting.clears == Clears::No {
                halting.clears = Clears::Next;
            }
            return;
        }
        for part in self.parts.iter_mut().filter(|part| part.fault.is_some()) {
            part.begin(now, AxesCommand::Clear);
        }
        if self.meter.is_at_fault {
            self.meter.open(now);
        }
        self.halting = Some(Halting { cause: None, clears: Clears::Now });
    }

    pub(super) fn is_clearing(&self) -> bool {
        self.halting.is_some_and(|halting| halting.clears == Clears::Now)
    }

    /// The cause persists.
    pub(super) fn not_cleared(&mut self, cause: Cause) {
        self.halting = None;
        self.fault = Some(cause);
        let why = Rejection::Faulted(cause);
        self.reply(RequestType::ClearFault, Reply::Rejected(CommandId(0), why));
    }
}
