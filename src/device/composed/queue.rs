//! Which commands a composer takes, and in which order they run. Nothing is checked again later.

use firmware_protocol::{CommandId, Dwell, Home, MoveTo, Rejection, Reply, Shutter};

use super::{Composer, QUEUE_DEPTH};

/// A command that waits for its turn.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Command {
    Dwell(Dwell),
    Home(Home),
    MoveTo(MoveTo),
}

impl Command {
    pub(super) const fn id(&self) -> CommandId {
        match self {
            Self::Dwell(dwell) => dwell.id,
            Self::Home(home) => home.id,
            Self::MoveTo(to) => to.id,
        }
    }
}

impl Composer {
    pub(super) fn offer(&mut self, command: Command) -> Reply {
        let id = command.id();
        if let Err(rejection) = self.admit(&command) {
            return Reply::Rejected(id, rejection);
        }
        self.last_id = Some(id);
        self.queue.push_back(command);
        Reply::Accepted(id)
    }

    fn admit(&self, command: &Command) -> Result<(), Rejection> {
        if self.last_id.is_some_and(|last| command.id() <= last) {
            return Err(Rejection::IdReused);
        }
        if let Some(cause) = self.fault {
            return Err(Rejection::Faulted(cause));
        }
        if self.queue.len() >= QUEUE_DEPTH {
            return Err(Rejection::QueueFull);
        }
        match command {
            Command::Home(home) => {
                let all = self.parts.iter().fold(self.fixed, |mask, part| mask | part.mask());
                let is_some = home.axes.0 != 0 && home.axes.0 & !all == 0;
                if is_some { Ok(()) } else { Err(Rejection::Senseless) }
            }
            Command::MoveTo(to) => self.admit_move(to),
            Command::Dwell(dwell) => self.admit_dwell(dwell),
        }
    }

    fn admit_move(&self, to: &MoveTo) -> Result<(), Rejection> {
        if to.targets.0.len() != self.here.len() {
            return Err(Rejection::Senseless);
        }
        let is_fixed = |channel: usize| self.fixed & (1 << channel) != 0;
        let mut targets = to.targets.0.iter().enumerate();
        if let Some((n, to)) = targets.find(|(channel, to)| is_fixed(*channel) && **to != 0) {
            return Err(Rejection::OutsideLimits(u8::try_from(n).unwrap_or(u8::MAX), *to));
        }
        let will_home = self.queue.iter().any(|command| matches!(command, Command::Home(_)));
        for part in &self.parts {
            let Some(facts) = &part.facts else { return Err(Rejection::Senseless) };
            let steps = part.steps(&to.targets.0);
            for ((channel, axis), step) in part.channels.iter().zip(&facts.axes).zip(steps) {
                let number = u8::try_from(*channel).unwrap_or(u8::MAX);
                if self.homed & (1 << channel) == 0 && !will_home && !self.is_homing() {
                    return Err(Rejection::Unhomed(number));
                }
                if !(axis.low..=axis.high).contains(&step) {
                    let target = to.targets.0.get(*channel).copied().unwrap_or_default();
                    return Err(Rejection::OutsideLimits(number, target));
                }
            }
        }
        Ok(())
    }

    fn admit_dwell(&self, dwell: &Dwell) -> Result<(), Rejection> {
        if usize::from(dwell.gain) >= self.meter.full_scales.len() || dwell.duration_us == 0 {
            return Err(Rejection::Senseless);
        }
        if dwell.shutter == Shutter::Closed && self.shutter_part().is_none() {
            return Err(Rejection::Unsupported);
        }
        Ok(())
    }
}
