//! Executing a command, step by step, as the devices answer.

use std::time::Duration;

use firmware_protocol::{
    AxisCounts, CommandId, Done, Dwell, Event, Home, Instant, MoveTo, Shutter,
};

use super::part::Awaited;
use super::queue::Command;
use super::{Composer, DeviceEvent};
use crate::device::axes::AxesCommand;
use crate::rig::DeviceTimes;

/// A command that runs.
#[derive(Debug)]
pub(super) enum Work {
    Dwelling(Dwelling),
    /// One device after another, the next one this.
    Homing {
        axes: u8,
        next: usize,
    },
    Moving,
}

/// A dwell that runs.
#[derive(Debug)]
pub(super) struct Dwelling {
    dwell: Dwell,
    began: Instant,
    stage: Stage,
    start: AxisCounts,
}

/// What a dwell waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// The shutter that is closed for the meter's zero, then the zero.
    Covering,
    Zeroing,
    /// The shutter for the reading.
    Shutter,
    /// The end of the settling, and where the axes are.
    Settling,
    Exposing,
    /// Where the axes are afterwards.
    Locating,
}

impl Work {
    /// When it goes on by itself.
    pub(super) fn wake(&self) -> Option<Instant> {
        match self {
            Self::Dwelling(dwelling) if dwelling.stage == Stage::Settling => {
                Some(dwelling.settled())
            }
            _ => None,
        }
    }
}

impl Dwelling {
    fn settled(&self) -> Instant {
        self.began + Duration::from_micros(self.dwell.settle_us.into())
    }
}

impl Composer {
    /// Whether the running command came further, or the next one began.
    pub(super) fn go_on_working(&mut self, now: Instant) -> bool {
        if self.fault.is_some() || self.halting.is_some() || self.opening.is_some() {
            return false;
        }
        if !self.is_answered() {
            return false;
        }
        match self.running.take() {
            None => self.start_next(now),
            Some((id, Work::Moving)) => {
                self.done(now, id);
                true
            }
            Some((id, Work::Homing { axes, next })) => self.home_on(now, id, axes, next),
            Some((id, Work::Dwelling(dwelling))) => self.dwell_on(now, id, dwelling),
        }
    }

    /// Whether every device has answered what it was asked.
    pub(super) fn is_answered(&self) -> bool {
        self.parts.iter().all(|part| part.awaited.is_none()) && self.meter.awaited.is_none()
    }

    pub(super) fn is_homing(&self) -> bool {
        matches!(self.running, Some((_, Work::Homing { .. })))
    }

    /// The device that has the shutter.
    pub(super) fn shutter_part(&self) -> Option<usize> {
        let has = |part: &super::Part| part.facts.as_ref().is_some_and(|facts| facts.has_shutter);
        self.parts.iter().position(has)
    }

    fn start_next(&mut self, now: Instant) -> bool {
        let Some(command) = self.queue.pop_front() else { return false };
        let id = command.id();
        self.say(DeviceEvent::Event(Event::Started(id, now.tick())));
        match command {
            Command::Home(Home { axes, .. }) => {
                return self.home_on(now, id, axes.0, 0);
            }
            Command::MoveTo(to) => {
                self.set_out(now, &to);
                self.running = Some((id, Work::Moving));
            }
            Command::Dwell(dwell) => {
                let start = self.counts_here();
                let dwelling = Dwelling { dwell, began: now, stage: Stage::Covering, start };
                if !self.meter.is_zeroed {
                    self.put_shutter(now, Shutter::Closed);
                }
                self.running = Some((id, Work::Dwelling(dwelling)));
            }
        }
        true
    }

    fn set_out(&mut self, now: Instant, to: &MoveTo) {
        for part in &mut self.parts {
            let steps = part.steps(&to.targets.0);
            part.begin(now, AxesCommand::MoveTo(steps));
        }
    }

    fn home_on(&mut self, now: Instant, id: CommandId, axes: u8, next: usize) -> bool {
        if let Some(last) = next.checked_sub(1).and_then(|last| self.parts.get(last))
            && last.mask() & axes != 0
        {
            self.homed |= last.mask();
        }
        match self.parts.get_mut(next) {
            Some(part) => {
                if part.mask() & axes != 0 {
                    part.begin(now, AxesCommand::Home);
                }
                self.running = Some((id, Work::Homing { axes, next: next + 1 }));
            }
            None => self.done(now, id),
        }
        true
    }

    fn done(&mut self, now: Instant, id: CommandId) {
        let done = Done { id, readback: self.counts_here(), tick: now.tick() };
        self.end(id, Event::Done(done));
    }

    /// Puts the shutter, where there is one that stands otherwise.
    fn put_shutter(&mut self, now: Instant, shutter: Shutter) {
        if self.meter.shutter == Some(shutter) {
            return;
        }
        let Some(n) = self.shutter_part() else { return };
        if let Some(part) = self.parts.get_mut(n) {
            part.begin(now, AxesCommand::PutShutter(shutter));
        }
    }

    fn locate_all(&mut self, now: Instant) {
        for part in &mut self.parts {
            part.begin(now, AxesCommand::Locate);
            debug_assert_eq!(part.awaited, Some(Awaited::Located));
        }
    }

    fn dwell_on(&mut self, now: Instant, id: CommandId, mut dwelling: Dwelling) -> bool {
        let (stage, goes_on) = match dwelling.stage {
            Stage::Covering => {
                if !self.meter.is_zeroed {
                    self.meter.zero(now);
                }
                (Stage::Zeroing, true)
            }
            Stage::Zeroing => {
                self.put_shutter(now, dwelling.dwell.shutter);
                (Stage::Shutter, true)
            }
            Stage::Shutter => {
                self.locate_all(now);
                (Stage::Settling, true)
            }
            Stage::Settling if now < dwelling.settled() => (Stage::Settling, false),
            Stage::Settling => {
                dwelling.start = self.counts_here();
                self.meter.expose(now, &dwelling.dwell);
                (Stage::Exposing, true)
            }
            Stage::Exposing => {
                self.locate_all(now);
                (Stage::Locating, true)
            }
            Stage::Locating => {
                self.sampled(id, &dwelling);
                return true;
            }
        };
        dwelling.stage = stage;
        self.running = Some((id, Work::Dwelling(dwelling)));
        goes_on
    }

    fn sampled(&mut self, id: CommandId, dwelling: &Dwelling) {
        let Some(exposed) = self.meter.exposed.take() else { return };
        let ends = [dwelling.start.clone(), self.counts_here()];
        let result = self.meter.result(&dwelling.dwell, &exposed, ends);
        let times =
            DeviceTimes { axes_s: self.meter.axes_time_s, photometer_s: exposed.device_time_s };
        self.say(DeviceEvent::Clocks(id, times));
        self.end(id, Event::Sampled(result));
    }
}
