//! Several devices that look like one: the drivers of a rig's axes and of its meter behind the
//! vocabulary of gonio's own controllers, so that whoever runs a plan can't tell the difference.
//!
//! The composer queues commands, executes one at a time, keeps a stop ahead of everything, and
//! turns steps into counts of the rig file and the meter's values into counts of its ranges. When
//! one device fails or falls silent, it stops the others. It is a machine without I/O; [`pump`]
//! joins it to the ports.
//!
//! It does not know what the devices speak, nor what a run is.

mod build;
mod halting;
mod meter;
mod opening;
mod part;
mod pump;
mod queue;
#[cfg(test)]
mod tests;
mod work;

use std::collections::{BTreeSet, VecDeque};

use firmware_protocol::{
    AxisCounts, AxisMask, Capabilities, Cause, CommandId, Event, Instant, PROTOCOL, Rejection,
    Reply, Request, RequestType, Status,
};

use super::controller::{DeviceEvent, Order, Said};
use super::driver::Promises;
use halting::Halting;
use meter::MeterPart;
use opening::Opening;
use part::{Awaited, Part};
pub(super) use pump::pump;
use queue::Command;
use work::Work;

/// Commands that can wait behind the running one: as many as on gonio's own controllers.
const QUEUE_DEPTH: usize = firmware_protocol::QUEUE_DEPTH;

/// See the module.
#[derive(Debug)]
pub struct Composer {
    parts: Vec<Part>,
    meter: MeterPart,
    boot_id: u32,
    // Channels that were homed since their device booted.
    homed: u8,
    // Channels that nothing moves: they stand at their count 0.
    fixed: u8,
    // Where the axes were last seen, counts by channel.
    here: Vec<i32>,
    queue: VecDeque<Command>,
    running: Option<(CommandId, Work)>,
    last_id: Option<CommandId>,
    unacknowledged: BTreeSet<CommandId>,
    fault: Option<Cause>,
    opening: Option<Opening>,
    halting: Option<Halting>,
    said: VecDeque<Said>,
}

impl Composer {
    /// What its devices' words mean, by their names.
    pub fn promises(&self) -> Vec<(String, Promises)> {
        let axes = self.parts.iter().map(|part| &*part.driver as &dyn super::Driver);
        let meter = &*self.meter.driver as &dyn super::Driver;
        axes.chain([meter]).map(|driver| (driver.name().to_owned(), driver.promises())).collect()
    }

    /// Which of its devices stop by themselves when the host falls silent, in words: the meter
    /// moves nothing.
    pub fn watchdogs(&self) -> Vec<String> {
        let words = |part: &Part| {
            let watchdog = part.driver.promises().watchdog.map_or_else(
                || "no device watchdog".to_owned(),
                |after| format!("stops by itself after {} ms of silence", after.as_millis()),
            );
            format!("{}: {watchdog}", part.driver.name())
        };
        self.parts.iter().map(words).collect()
    }

    /// How many ports it needs: one for each device that moves axes, and the meter's as the last.
    pub(super) fn ports(&self) -> usize {
        self.parts.len() + 1
    }

    /// Somebody asks something.
    pub(super) fn handle_order(&mut self, now: Instant, order: Order) {
        match order {
            Order::Identify => self.identify(now),
            Order::Send(request) => self.handle_request(now, request),
        }
        self.advance(now);
    }

    /// Bytes came from this port.
    pub(super) fn handle_bytes(&mut self, now: Instant, port: usize, bytes: &[u8]) {
        match self.parts.get_mut(port) {
            Some(part) => part.driver.handle_bytes(now, bytes),
            None => self.meter.driver.handle_bytes(now, bytes),
        }
        self.listen(now);
    }

    /// Time has passed.
    pub(super) fn handle_timeout(&mut self, now: Instant) {
        for part in self.parts.iter_mut().filter(|part| is_due(part.driver.poll_timeout(), now)) {
            part.driver.handle_timeout(now);
        }
        if is_due(self.meter.driver.poll_timeout(), now) {
            self.meter.driver.handle_timeout(now);
        }
        self.listen(now);
    }

    /// The next bytes for this port.
    pub(super) fn poll_transmit(&mut self, now: Instant, port: usize) -> Option<Vec<u8>> {
        match self.parts.get_mut(port) {
            Some(part) => part.driver.poll_transmit(now),
            None => self.meter.driver.poll_transmit(now),
        }
    }

    /// What there is to say, in order.
    pub(super) fn poll_said(&mut self) -> Option<Said> {
        self.said.pop_front()
    }

    /// When [`Composer::handle_timeout`] wants to be called.
    pub(super) fn poll_timeout(&self) -> Option<Instant> {
        let parts = self.parts.iter().filter(|part| !part.is_gone);
        let drivers = parts.filter_map(|part| part.driver.poll_timeout());
        let meter = self.meter.driver.poll_timeout().filter(|_| !self.meter.is_gone);
        // What a device has still to answer comes with its bytes.
        let working = self.running.as_ref().filter(|_| self.is_answered());
        let settling = working.and_then(|(_, work)| work.wake());
        drivers.chain(meter).chain(settling).min()
    }

    /// Whether nothing moves, and nothing is on its way to rest.
    pub(super) fn is_at_rest(&self) -> bool {
        self.halting.is_none() && self.parts.iter().all(|part| part.awaited.is_none())
    }

    /// Nobody listens any more: the axes are not left moving.
    pub(super) fn stop_for_good(&mut self, now: Instant) {
        self.opening = None;
        self.queue.clear();
        self.running = None;
        self.halt(now, Halting::silent());
        self.advance(now);
    }

    fn handle_request(&mut self, now: Instant, request: Request) {
        let (asked, reply) = match request {
            Request::Home(home) => (RequestType::Home, self.offer(Command::Home(home))),
            Request::MoveTo(to) => (RequestType::MoveTo, self.offer(Command::MoveTo(to))),
            Request::Dwell(dwell) => (RequestType::Dwell, self.offer(Command::Dwell(dwell))),
            Request::Sweep(sweep) => {
                (RequestType::Sweep, Reply::Rejected(sweep.id, Rejection::Unsupported))
            }
            Request::ReadStatus => (RequestType::ReadStatus, Reply::Status(self.status(now))),
            Request::Stop => {
                self.reply(RequestType::Stop, Reply::Stopping);
                self.fault.get_or_insert(Cause::Stopped);
                self.halt(now, Halting::for_cause(Cause::Stopped));
                return;
            }
            Request::ClearFault => return self.clear(now),
            Request::KeepAlive => (RequestType::KeepAlive, Reply::Alive),
            Request::Acknowledge(id) => {
                self.unacknowledged.remove(&id);
                (RequestType::Acknowledge, Reply::Acknowledged(id))
            }
            Request::Capabilities => {
                // They stop and start between two readings: a meter has no windows.
                (RequestType::Capabilities, Reply::Capabilities(Capabilities { windows: 0 }))
            }
            Request::FetchWindow(id, _) => {
                (RequestType::FetchWindow, Reply::Rejected(id, Rejection::NoSuchWindow))
            }
            Request::Identify(_) => return self.identify(now),
        };
        self.reply(asked, reply);
    }

    fn reply(&mut self, request: RequestType, reply: Reply) {
        self.say(DeviceEvent::Reply { request, reply, retries: 0 });
    }

    fn say(&mut self, event: DeviceEvent) {
        self.said.push_back(Said::Device(event));
    }

    /// The result of a command, which waits for its acknowledgement.
    fn end(&mut self, id: CommandId, event: Event) {
        self.unacknowledged.insert(id);
        self.say(DeviceEvent::Event(event));
    }

    fn status(&self, now: Instant) -> Status {
        let narrow = |length: usize| u8::try_from(length).unwrap_or(u8::MAX);
        Status {
            boot_id: self.boot_id,
            homed: AxisMask(self.homed),
            moving: self.parts.iter().any(|part| part.awaited == Some(Awaited::Done)),
            fault: self.fault,
            running: self.running.as_ref().map(|(id, _)| *id),
            queued: narrow(self.queue.len()),
            unacknowledged: narrow(self.unacknowledged.len()),
            last_id: self.last_id,
            readback: self.counts_here(),
            tick: now.tick(),
        }
    }

    fn counts_here(&self) -> AxisCounts {
        AxisCounts(self.here.iter().copied().collect())
    }

    /// Does what the last input made possible.
    fn advance(&mut self, now: Instant) {
        while self.go_on_opening(now) || self.go_on_halting(now) || self.go_on_working(now) {}
    }
}

/// The protocol's version that a composer speaks to its host: this program's own.
const SPOKEN: (u8, u8) = PROTOCOL;

fn is_due(at: Option<Instant>, now: Instant) -> bool {
    at.is_some_and(|at| at <= now)
}
