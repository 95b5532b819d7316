//! One of the devices that move axes, as the composer sees it: which channels are its, where their
//! zeros lie, and what it was asked.

use firmware_protocol::{Cause, Instant};

use super::{Composer, DeviceEvent, Said};
use crate::device::axes::{Axes, AxesCommand, AxesEvent, AxesFacts, Located};
use crate::device::controller::{ConnectError, LinkLost};
use crate::device::driver::{NamedFault, Trouble};

/// What a device was asked and has not answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Awaited {
    Cleared,
    Done,
    Located,
    Ready,
    Shutter,
    Stopped,
}

/// See the module.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) driver: Box<dyn Axes>,
    /// The channel of each of its axes.
    pub(super) channels: Vec<usize>,
    /// Where the rig's zero of each lies, steps from the device's.
    pub(super) zeros: Vec<i32>,
    /// Whether the rig file says that positions come from encoders, for each.
    pub(super) says_encoder: Vec<bool>,
    pub(super) facts: Option<AxesFacts>,
    pub(super) awaited: Option<Awaited>,
    /// What it stands still for.
    pub(super) fault: Option<NamedFault>,
    /// Its port hung up.
    pub(super) is_gone: bool,
}

impl Part {
    pub(super) fn begin(&mut self, now: Instant, command: AxesCommand) {
        self.awaited = Some(match command {
            AxesCommand::Home | AxesCommand::MoveTo(_) => Awaited::Done,
            AxesCommand::Locate => Awaited::Located,
            AxesCommand::PutShutter(_) => Awaited::Shutter,
            AxesCommand::Clear => Awaited::Cleared,
        });
        self.driver.begin(now, command);
    }

    /// Its channels as a mask.
    pub(super) fn mask(&self) -> u8 {
        self.channels.iter().fold(0, |mask, channel| mask | 1 << channel)
    }

    /// Its steps for these counts by channel.
    pub(super) fn steps(&self, counts: &[i32]) -> Vec<i32> {
        let count = |channel: &usize| counts.get(*channel).copied().unwrap_or_default();
        let channels = self.channels.iter().zip(&self.zeros);
        channels.map(|(channel, zero)| count(channel).saturating_add(*zero)).collect()
    }
}

impl Composer {
    /// Hears what the drivers have to say, and goes on.
    pub(super) fn listen(&mut self, now: Instant) {
        self.advance(now);
        loop {
            let said = self.parts.iter_mut().enumerate().find_map(|(n, part)| {
                let event = part.driver.poll_event()?;
                Some((n, event))
            });
            if let Some((n, event)) = said {
                self.hear(now, n, event);
            } else if let Some(event) = self.meter.driver.poll_event() {
                self.hear_meter(now, event);
            } else {
                return;
            }
            self.advance(now);
        }
    }

    fn hear(&mut self, now: Instant, n: usize, event: AxesEvent) {
        match event {
            AxesEvent::Ready(facts) => self.ready(n, facts),
            AxesEvent::Done(located) => {
                self.locate(n, &located);
                self.answered(n, Awaited::Done);
            }
            AxesEvent::Located(located) => {
                self.locate(n, &located);
                self.answered(n, Awaited::Located);
            }
            AxesEvent::ShutterIs(shutter) => {
                self.meter.shutter = Some(shutter);
                self.answered(n, Awaited::Shutter);
            }
            AxesEvent::Stopped(located) => {
                self.forget_shutter(n);
                if let Some(located) = located {
                    self.locate(n, &located);
                }
                self.answered(n, Awaited::Stopped);
            }
            AxesEvent::Cleared => {
                self.forget_shutter(n);
                if let Some(part) = self.parts.get_mut(n) {
                    part.fault = None;
                }
                self.answered(n, Awaited::Cleared);
            }
            AxesEvent::Trouble(trouble) => self.trouble(now, n, trouble),
        }
    }

    /// Coming to rest may switch a board's outputs off, and leaving a fault does: whether the
    /// shutter is where it was put is not known any more.
    fn forget_shutter(&mut self, n: usize) {
        if self.shutter_part().is_none_or(|part| part == n) {
            self.meter.shutter = None;
        }
    }

    fn answered(&mut self, n: usize, what: Awaited) {
        if let Some(part) = self.parts.get_mut(n).filter(|part| part.awaited == Some(what)) {
            part.awaited = None;
        }
    }

    fn locate(&mut self, n: usize, located: &Located) {
        let Some(part) = self.parts.get(n) else { return };
        for ((channel, zero), step) in part.channels.iter().zip(&part.zeros).zip(&located.steps) {
            if let Some(here) = self.here.get_mut(*channel) {
                *here = step.saturating_sub(*zero);
            }
        }
        self.meter.axes_time_s = located.device_time_s.or(self.meter.axes_time_s);
    }

    fn trouble(&mut self, now: Instant, n: usize, trouble: Trouble) {
        let Some(part) = self.parts.get_mut(n) else { return };
        let was_opening = part.awaited == Some(Awaited::Ready);
        part.awaited = None;
        self.forget_shutter(n);
        let Some(part) = self.parts.get_mut(n) else { return };
        match trouble {
            Trouble::Fault(fault) => {
                if fault.loses_position {
                    self.homed &= !part.mask();
                }
                part.fault = Some(fault.clone());
                self.fault(now, fault);
            }
            Trouble::Refused(refusal) => self.unfit(ConnectError::Refused(refusal)),
            Trouble::Restarted => {
                self.homed &= !part.mask();
                part.facts = None;
                self.restarted(now);
            }
            Trouble::Silent(what) => {
                part.facts = None;
                if was_opening {
                    self.unfit(ConnectError::Mute(what));
                } else {
                    self.lost(now, LinkLost::Mute(what));
                }
            }
        }
    }

    /// One of the devices stands still: so shall all.
    pub(super) fn fault(&mut self, now: Instant, fault: NamedFault) {
        let cause = fault.cause;
        if self.is_clearing() {
            self.say(DeviceEvent::Fault(fault));
            self.not_cleared(cause);
            return;
        }
        if self.opening.is_some() {
            self.fault.get_or_insert(cause);
            return;
        }
        self.fault = match self.fault {
            None | Some(Cause::Stopped) => Some(cause),
            other => other,
        };
        self.say(DeviceEvent::Fault(fault));
        self.halt(now, super::Halting::for_cause(cause));
    }

    /// One of the devices booted: what was asked of it is forgotten, and the session is over.
    fn restarted(&mut self, now: Instant) {
        let old = self.boot_id;
        self.boot_id = old.wrapping_add(1);
        self.say(DeviceEvent::Restarted { old, new: self.boot_id });
        self.forget(now);
    }

    /// One of the devices is gone: what was asked is forgotten, and the others come to rest.
    pub(super) fn lost(&mut self, now: Instant, lost: LinkLost) {
        self.say(DeviceEvent::LinkLost(lost));
        self.forget(now);
    }

    pub(super) fn forget(&mut self, now: Instant) {
        self.opening = None;
        self.queue.clear();
        self.running = None;
        self.unacknowledged.clear();
        self.halt(now, super::Halting::silent());
    }

    pub(super) fn unfit(&mut self, error: ConnectError) {
        self.opening = None;
        self.said.push_back(Said::Unfit(error));
    }

    /// The port hung up.
    pub(super) fn port_gone(&mut self, now: Instant, port: usize, lost: LinkLost) {
        let was_gone = if let Some(part) = self.parts.get_mut(port) {
            part.awaited = None;
            part.facts = None;
            std::mem::replace(&mut part.is_gone, true)
        } else {
            self.meter.awaited = None;
            self.meter.facts = None;
            std::mem::replace(&mut self.meter.is_gone, true)
        };
        if !was_gone {
            self.lost(now, lost);
            self.advance(now);
        }
    }
}
