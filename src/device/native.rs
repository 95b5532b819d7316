//! The task that drives a controller of gonio's own: a link joined to the protocol's host
//! endpoint, the one place that knows both bytes and messages.
//!
//! It lives as long as its handle: then it stops the axes if they may be moving, and ends.

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use firmware_protocol::{
    CommandId, Dwell, Event, Home, HostEndpoint, HostEvent, Instant, LinkStatistics, MoveTo, Reply,
    Request, RequestType, Sweep, frame,
};
use tokio::io::{AsyncReadExt, AsyncWriteExt, ReadHalf, WriteHalf};
use tokio::sync::{mpsc, watch};

use super::Link;
use super::controller::{DeviceEvent, LinkLost, Order, Said};

/// Read at a time, bytes.
const READ_BYTES: usize = 1024;
/// Signs of life in a lease, so that one or two may be lost.
const ALIVE_PER_LEASE: u32 = 4;
/// How long the driver waits for the answer to its last `Stop` before it lets go of the link.
const LAST_STOP: Duration = Duration::from_secs(1);

/// The task that owns the link.
pub(super) struct Pump {
    name: String,
    reader: ReadHalf<Link>,
    writer: WriteHalf<Link>,
    host: HostEndpoint,
    origin: tokio::time::Instant,
    // Requests that found the window full, in order.
    waiting: VecDeque<Request>,
    outgoing: Vec<u8>,
    // Commands without a result: while there are any, the device holds us to its lease.
    open_commands: BTreeSet<CommandId>,
    lease: Duration,
    last_sent: Instant,
    said: mpsc::UnboundedSender<Said>,
    statistics: watch::Sender<LinkStatistics>,
    is_over: bool,
}

impl Pump {
    pub(super) fn new(
        link: Link,
        host: HostEndpoint,
        said: mpsc::UnboundedSender<Said>,
        statistics: watch::Sender<LinkStatistics>,
    ) -> Self {
        let name = link.name().to_owned();
        let (reader, writer) = tokio::io::split(link);
        Self {
            name,
            reader,
            writer,
            host,
            origin: tokio::time::Instant::now(),
            waiting: VecDeque::new(),
            outgoing: Vec::new(),
            open_commands: BTreeSet::new(),
            lease: Duration::ZERO,
            last_sent: Instant::ZERO,
            said,
            statistics,
            is_over: false,
        }
    }

    pub(super) async fn run(mut self, mut orders: mpsc::UnboundedReceiver<Order>) {
        let mut buffer = [0; READ_BYTES];
        // Once nobody listens: until when to wait for the answer to the last Stop.
        let mut last_stop: Option<tokio::time::Instant> = None;
        while !self.is_over {
            self.prepare();
            if last_stop.is_some() && self.is_quiet() {
                return;
            }
            let wake = self.wake(last_stop);
            tokio::select! {
                biased;
                order = orders.recv(), if last_stop.is_none() => match order {
                    Some(order) => self.obey(order),
                    None => last_stop = Some(self.say_stop()),
                },
                () = sleep_until(wake) => {
                    if last_stop.is_some_and(|end| end <= tokio::time::Instant::now()) {
                        return;
                    }
                    self.on_time();
                }
                written = self.writer.write(&self.outgoing), if !self.outgoing.is_empty() => {
                    match written {
                        Ok(0) => self.hang_up(&"nothing can be written"),
                        Ok(n) => drop(self.outgoing.drain(..n)),
                        Err(error) => self.hang_up(&error),
                    }
                }
                read = self.reader.read(&mut buffer) => match read {
                    Ok(0) => self.hang_up(&"end of the stream"),
                    Ok(n) => {
                        let now = self.now();
                        self.host.handle_bytes(now, buffer.get(..n).unwrap_or_default());
                    }
                    Err(error) => self.hang_up(&error),
                },
            }
            self.tell();
        }
    }

    fn now(&self) -> Instant {
        Instant::ZERO + self.origin.elapsed()
    }

    /// Puts what waits into the window, and the window's frames onto the wire.
    fn prepare(&mut self) {
        let now = self.now();
        while let Some(request) = self.waiting.front() {
            if !self.host.is_open() {
                self.waiting.clear();
                break;
            }
            if self.host.submit(now, request.clone()).is_err() {
                break;
            }
            self.waiting.pop_front();
        }
        // One frame at a time: its time-out starts when the wire takes it.
        let mut wire = [0; frame::WIRE_MAX];
        while self.outgoing.len() < frame::WIRE_MAX {
            let Some(length) = self.host.poll_transmit(now, &mut wire) else { break };
            self.outgoing.extend_from_slice(wire.get(..length).unwrap_or_default());
            self.last_sent = now;
        }
    }

    fn obey(&mut self, order: Order) {
        let now = self.now();
        match order {
            Order::Identify => {
                self.waiting.clear();
                self.open_commands.clear();
                self.host.identify(now);
            }
            Order::Send(Request::Stop) => {
                // It goes before what waits here, and must not be undone by it.
                self.waiting.retain(|request| *request != Request::ClearFault);
                let _ = self.host.submit(now, Request::Stop);
            }
            Order::Send(request) => {
                if let Request::Dwell(Dwell { id, .. })
                | Request::Home(Home { id, .. })
                | Request::MoveTo(MoveTo { id, .. })
                | Request::Sweep(Sweep { id, .. }) = &request
                {
                    self.open_commands.insert(*id);
                }
                self.waiting.push_back(request);
            }
        }
    }

    fn is_quiet(&self) -> bool {
        self.outgoing.is_empty() && self.waiting.is_empty() && self.host.poll_timeout().is_none()
    }

    /// Nobody listens any more: the axes are not left moving.
    fn say_stop(&mut self) -> tokio::time::Instant {
        self.waiting.clear();
        if !self.open_commands.is_empty() {
            let _ = self.host.submit(self.now(), Request::Stop);
        }
        tokio::time::Instant::now() + LAST_STOP
    }

    /// When to look at the clock next; `None` while nothing waits for anything.
    fn wake(&self, last_stop: Option<tokio::time::Instant>) -> Option<tokio::time::Instant> {
        let alive = (!self.open_commands.is_empty() && self.host.is_open())
            .then(|| self.last_sent + self.lease / ALIVE_PER_LEASE);
        let host = self.host.poll_timeout();
        let ours = [alive, host].into_iter().flatten().min();
        let ours = ours.map(|at| self.origin + Duration::from_micros(at.micros()));
        [ours, last_stop].into_iter().flatten().min()
    }

    fn on_time(&mut self) {
        let now = self.now();
        self.host.handle_timeout(now);
        let is_silent = now.since(self.last_sent) >= self.lease / ALIVE_PER_LEASE;
        if !self.open_commands.is_empty() && self.host.is_open() && is_silent {
            // A full window is a sign of life too.
            let _ = self.host.submit(now, Request::KeepAlive);
            self.last_sent = now;
        }
    }

    fn hang_up(&mut self, reason: &dyn std::fmt::Display) {
        self.is_over = true;
        let lost = LinkLost::HungUp { port: self.name.clone(), detail: reason.to_string() };
        let _ = self.said.send(Said::Device(DeviceEvent::LinkLost(lost)));
    }

    /// Hands on what the endpoint has to tell.
    fn tell(&mut self) {
        while let Some(event) = self.host.poll_event() {
            let said = match event {
                HostEvent::Reply { request: RequestType::KeepAlive, .. }
                | HostEvent::Garbage { .. } => continue,
                HostEvent::Reply { request, reply, retries, .. } => {
                    self.note(&reply);
                    Said::Device(DeviceEvent::Reply { request, reply, retries })
                }
                HostEvent::Event(event) => {
                    self.end(&event);
                    Said::Device(DeviceEvent::Event(event))
                }
                HostEvent::DeviceRestarted { old, new } => {
                    self.open_commands.clear();
                    Said::Device(DeviceEvent::Restarted { old, new })
                }
                HostEvent::LinkDown { request: RequestType::Identify, cause, .. } => {
                    Said::Unheard(cause)
                }
                HostEvent::LinkDown { request, attempts, elapsed, cause } => {
                    self.open_commands.clear();
                    let port = self.name.clone();
                    let lost = LinkLost::NoReply { port, request, attempts, elapsed, cause };
                    Said::Device(DeviceEvent::LinkLost(lost))
                }
                HostEvent::VersionMismatch { device, host } => Said::Version { device, host },
            };
            let _ = self.said.send(said);
        }
        self.statistics.send_if_modified(|told| {
            let counted = self.host.statistics();
            std::mem::replace(told, counted) != counted
        });
    }

    fn note(&mut self, reply: &Reply) {
        match reply {
            Reply::Identity(identity) => {
                self.lease = Duration::from_millis(identity.lease_ms.into());
            }
            Reply::Rejected(id, _) => {
                self.open_commands.remove(id);
            }
            _ => {}
        }
    }

    fn end(&mut self, event: &Event) {
        let id = match event {
            Event::Started(..) | Event::Window(_) => return,
            Event::Done(done) => done.id,
            Event::Sampled(result) => result.id,
            Event::Failed(id, ..) => *id,
        };
        self.open_commands.remove(&id);
    }
}

async fn sleep_until(wake: Option<tokio::time::Instant>) {
    match wake {
        Some(wake) => tokio::time::sleep_until(wake).await,
        None => std::future::pending().await,
    }
}
