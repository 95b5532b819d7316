//! The host's end of the link: requests in, replies and events out, bytes between. Sends again
//! what was lost, notices when the device restarted or went away. Knows neither the clock nor
//! what the commands mean.

mod delivered;
mod event;
mod round_trip;
mod window;

use core::fmt;

use heapless::Deque;

pub use event::{HostEvent, LinkCause, LinkStatistics, Nonsense, Ticket};
pub use window::WINDOW;

use crate::packet::{self, Foreign, NakReason, PROTOCOL, PacketError, Said, SessionTag, ToHost};
use crate::{Decoder, Event, Identity, Instant, Reply, Request};
use delivered::Delivered;
use round_trip::RoundTrip;
use window::{Flight, Window};

/// Events that can wait to be polled: all that a device can have unacknowledged, with their
/// starts, the replies in the window, and the link's own.
const EVENTS: usize = 64;
/// Places of those that events and garbage don't take: a result that finds no place comes again.
const EVENTS_KEPT: usize = 16;

/// The request cannot be taken now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SubmitError {
    /// [`WINDOW`] requests wait for their answers already: submit again after a reply.
    WindowFull,
    /// No session is open: [`HostEndpoint::identify`] first.
    NoSession,
}

impl fmt::Display for SubmitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WindowFull => write!(f, "{WINDOW} requests wait for their answers already"),
            Self::NoSession => write!(f, "no session with the device is open"),
        }
    }
}

impl core::error::Error for SubmitError {}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Closed,
    Identifying,
    /// With this boot.
    Open(u32),
}

/// What came in since the oldest open request was submitted.
#[derive(Debug, Clone, Copy, Default)]
struct Heard {
    bytes: u32,
    frames: u32,
}

/// The host's end of the link, a machine without a clock or a port.
///
/// After every call of `handle_bytes`, `handle_timeout` or `submit`: poll events and transmits
/// until they give `None`, then ask `poll_timeout`.
///
/// ```
/// use firmware_protocol::{HostEndpoint, HostEvent, Instant, Request, frame};
/// let now = Instant::ZERO;
/// let mut host = HostEndpoint::new(0x5eed_0001, 115_200);
/// host.identify(now);
/// let mut wire = [0; frame::WIRE_MAX];
/// assert!(host.poll_transmit(now, &mut wire).is_some());
/// assert_eq!(host.poll_transmit(now, &mut wire), None);
/// // Nobody answers: after five tries the link is down.
/// while let Some(deadline) = host.poll_timeout() {
///     host.handle_timeout(deadline);
///     while host.poll_transmit(deadline, &mut wire).is_some() {}
/// }
/// assert!(matches!(host.poll_event(), Some(HostEvent::LinkDown { attempts: 5, .. })));
/// ```
#[derive(Debug, Clone)]
pub struct HostEndpoint {
    decoder: Decoder,
    session: u32,
    phase: Phase,
    identify: Option<Flight>,
    stop: Option<Flight>,
    /// The session in which the stop was asked for, and in which it is answered.
    stop_session: SessionTag,
    window: Window,
    trip: RoundTrip,
    delivered: Delivered,
    events: Deque<HostEvent, EVENTS>,
    heard: Heard,
    tickets: u32,
    statistics: LinkStatistics,
}

impl HostEndpoint {
    /// A host that has not spoken yet. `session` numbers its first session; draw it anew every
    /// time that a host connects, or a device takes the new host for the old one. `baud` is
    /// bits a second on the wire, for time-outs.
    pub fn new(session: u32, baud: u32) -> Self {
        Self {
            decoder: Decoder::default(),
            session: session.wrapping_sub(1),
            phase: Phase::Closed,
            identify: None,
            stop: None,
            stop_session: SessionTag(0),
            window: Window::default(),
            trip: RoundTrip::new(baud),
            delivered: Delivered::default(),
            events: Deque::new(),
            heard: Heard::default(),
            tickets: 0,
            statistics: LinkStatistics::default(),
        }
    }

    /// Opens a session with the next number, and ends the one before with its open tickets: the
    /// device stops, and forgets commands and results of it. Requests are taken once its reply
    /// is there.
    pub fn identify(&mut self, now: Instant) -> Ticket {
        self.begin(now, self.session.wrapping_add(1))
    }

    /// Takes a request in. `Stop` is always taken, before or without a session too, and goes
    /// out first; a second one before the answer to the first shares its ticket, and goes out
    /// anew if anything else was submitted in between.
    /// `Identify(session)` is [`Self::identify`] with a number of the caller's.
    pub fn submit(&mut self, now: Instant, request: Request) -> Result<Ticket, SubmitError> {
        match request {
            Request::Identify(session) => return Ok(self.begin(now, session)),
            Request::Stop => return Ok(self.submit_stop(now)),
            _ => {}
        }
        if !matches!(self.phase, Phase::Open(_)) {
            return Err(SubmitError::NoSession);
        }
        if self.window.is_full() {
            return Err(SubmitError::WindowFull);
        }
        let ticket = self.next_ticket();
        self.window.push(ticket, request, now);
        Ok(ticket)
    }

    /// Takes what the wire brought, in slices of any size.
    pub fn handle_bytes(&mut self, now: Instant, mut bytes: &[u8]) {
        self.heard.bytes =
            self.heard.bytes.saturating_add(u32::try_from(bytes.len()).unwrap_or(u32::MAX));
        while let Some(result) = self.decoder.next_frame(&mut bytes) {
            let Ok(frame) = result else { continue };
            let type_byte = frame.header.type_byte;
            let packet = ToHost::decode(&frame);
            self.statistics.received += 1;
            self.heard.frames = self.heard.frames.saturating_add(1);
            match packet {
                Ok(packet) => self.handle_packet(now, packet),
                Err(PacketError::Version(foreign)) => self.handle_foreign(foreign),
                Err(PacketError::Kind(kind)) => self.garbage(type_byte, Nonsense::Kind(kind)),
                Err(PacketError::Codec(error)) => self.garbage(type_byte, Nonsense::Body(error)),
            }
        }
    }

    /// The time is `now`; call when [`Self::poll_timeout`]'s moment has come.
    pub fn handle_timeout(&mut self, now: Instant) {
        let over = |deadline: Option<Instant>| deadline.is_some_and(|deadline| deadline <= now);
        let mut given_up = None;
        for slot in [&mut self.stop, &mut self.identify] {
            let Some(flight) = slot else { continue };
            if over(flight.deadline(&self.trip)) && !flight.try_again() {
                given_up = slot.take();
            }
        }
        if over(self.window.deadline(&self.trip)) {
            self.trip.timed_out();
            if !self.window.try_again() {
                given_up = self.window.oldest().cloned();
            }
        }
        if let Some(flight) = given_up {
            self.link_down(now, &flight, self.silence());
        }
    }

    /// Writes the next frame to `out`, which should have [`crate::frame::WIRE_MAX`] bytes, and
    /// gives its length. Call after every other call until it gives `None`; `now` starts the
    /// request's time-out, so call it when the wire is about to take the bytes.
    pub fn poll_transmit(&mut self, now: Instant, out: &mut [u8]) -> Option<usize> {
        let session = SessionTag::of(self.session);
        let alone = [(self.stop_session, &mut self.stop), (session, &mut self.identify)];
        let alone = alone.into_iter().filter_map(|(session, slot)| Some((session, slot.as_mut()?)));
        let first = alone.into_iter().find(|(_, flight)| flight.is_due());
        let (session, flight) = first.or_else(|| Some((session, self.window.due()?)))?;
        let length = packet::encode_request(session, flight.seq, &flight.request, out)?;
        match flight.sends {
            0 => self.statistics.sent += 1,
            _ => self.statistics.resent += 1,
        }
        flight.sent(now, length);
        Some(length)
    }

    /// The next thing to tell. Call after `handle_bytes` and `handle_timeout` until it gives
    /// `None`.
    pub fn poll_event(&mut self) -> Option<HostEvent> {
        self.events.pop_front()
    }

    /// When to call [`Self::handle_timeout`]. Changes with every other call; `None` while
    /// nothing waits for an answer.
    pub fn poll_timeout(&self) -> Option<Instant> {
        let alone = [&self.stop, &self.identify].into_iter().flatten();
        let alone = alone.filter_map(|flight| flight.deadline(&self.trip));
        alone.chain(self.window.deadline(&self.trip)).min()
    }

    /// Whether a session is open, so that requests are taken.
    pub fn is_open(&self) -> bool {
        matches!(self.phase, Phase::Open(_))
    }

    /// What was counted so far.
    pub fn statistics(&self) -> LinkStatistics {
        LinkStatistics { bad: self.decoder.bad(), srtt: self.trip.smoothed(), ..self.statistics }
    }

    fn begin(&mut self, now: Instant, session: u32) -> Ticket {
        self.session = session;
        self.phase = Phase::Identifying;
        self.window = Window::default();
        self.trip.forget_time_outs();
        self.delivered = Delivered::default();
        self.heard = Heard::default();
        let ticket = self.next_ticket();
        self.identify = Some(Flight::new(ticket, 0, Request::Identify(session), now));
        ticket
    }

    fn submit_stop(&mut self, now: Instant) -> Ticket {
        let (session, seq) = (SessionTag::of(self.session), self.window.next_seq());
        let before = core::mem::replace(&mut self.stop_session, session);
        if let Some(flight) = &mut self.stop {
            if (before, flight.seq) != (session, seq) {
                flight.renumber(seq);
            }
            return flight.ticket;
        }
        let ticket = self.next_ticket();
        self.stop = Some(Flight::new(ticket, seq, Request::Stop, now));
        ticket
    }

    fn next_ticket(&mut self) -> Ticket {
        self.tickets = self.tickets.wrapping_add(1);
        Ticket(self.tickets)
    }

    fn handle_packet(&mut self, now: Instant, packet: ToHost) {
        let ToHost { session, seq, .. } = packet;
        if session != SessionTag::of(self.session) {
            // A stop may be answered in the session before.
            match packet.message {
                Said::Reply(Reply::Stopping) => self.handle_stopping(now, session, seq),
                _ => self.statistics.stale += 1,
            }
            return;
        }
        if let Phase::Open(boot_id) = self.phase
            && boot_id != packet.boot_id
        {
            self.close();
            self.tell(HostEvent::DeviceRestarted { old: boot_id, new: packet.boot_id });
        }
        match packet.message {
            Said::Reply(Reply::Identity(identity)) => {
                self.handle_identity(now, packet.boot_id, identity);
            }
            Said::Reply(Reply::Stopping) => self.handle_stopping(now, session, seq),
            Said::Reply(reply) => self.handle_reply(now, seq, reply),
            Said::Event(event) => self.handle_event(event),
            Said::Nak(reason) => self.handle_nak(now, reason, seq),
        }
    }

    fn handle_identity(&mut self, now: Instant, boot_id: u32, identity: Identity) {
        let Some(flight) = self.identify.take() else {
            self.statistics.stale += 1;
            return;
        };
        let (major, minor) = identity.protocol;
        if major != PROTOCOL.0 {
            self.close();
            let device = (major, Some(minor));
            self.tell(HostEvent::VersionMismatch { device, host: PROTOCOL });
            return;
        }
        self.phase = Phase::Open(boot_id);
        self.answer(now, &flight, Reply::Identity(identity));
    }

    fn handle_stopping(&mut self, now: Instant, session: SessionTag, seq: u8) {
        let asked_in = self.stop_session;
        match self.stop.take_if(|flight| (asked_in, flight.seq) == (session, seq)) {
            Some(flight) => self.answer(now, &flight, Reply::Stopping),
            None => self.statistics.stale += 1,
        }
    }

    fn handle_reply(&mut self, now: Instant, seq: u8, reply: Reply) {
        let Some(flight) = self.window.waiting(seq).cloned().filter(|_| self.is_open()) else {
            self.statistics.stale += 1;
            return;
        };
        if !flight.request.is_answered_by(&reply) {
            let problem = Nonsense::Answer(flight.request.message_type());
            self.garbage(reply.message_type().byte(), problem);
            return;
        }
        self.window.answered(seq, now);
        self.answer(now, &flight, reply);
    }

    fn answer(&mut self, now: Instant, flight: &Flight, reply: Reply) {
        if let Some(round_trip) = flight.round_trip(now) {
            self.trip.sample(round_trip);
        }
        self.heard = Heard::default();
        self.tell(HostEvent::Reply {
            ticket: flight.ticket,
            request: flight.request.message_type(),
            reply,
            retries: flight.retries(),
        });
    }

    fn handle_event(&mut self, event: Event) {
        if self.has_room() && self.is_open() && self.delivered.is_news(&event) {
            self.tell(HostEvent::Event(event));
        } else {
            self.statistics.stale += 1;
        }
    }

    fn handle_nak(&mut self, now: Instant, reason: NakReason, expected: u8) {
        match (reason, self.window.oldest().cloned()) {
            (NakReason::NoSession, Some(flight)) if self.is_open() => {
                self.link_down(now, &flight, LinkCause::SessionLost);
            }
            (NakReason::Resend, Some(_)) if self.window.hurry(expected) => {}
            _ => self.statistics.stale += 1,
        }
    }

    fn handle_foreign(&mut self, foreign: Foreign) {
        if self.phase == Phase::Closed || foreign.session != SessionTag::of(self.session) {
            self.statistics.stale += 1;
            return;
        }
        self.close();
        let device = (foreign.major, foreign.minor);
        self.tell(HostEvent::VersionMismatch { device, host: PROTOCOL });
    }

    fn garbage(&mut self, type_byte: u8, problem: Nonsense) {
        if self.has_room() {
            self.tell(HostEvent::Garbage { type_byte, problem });
        }
    }

    /// Whether there is a place for what may be dropped.
    fn has_room(&self) -> bool {
        self.events.len() + EVENTS_KEPT < EVENTS
    }

    /// What was heard since the last answer.
    fn silence(&self) -> LinkCause {
        match self.heard {
            Heard { bytes: 0, .. } => LinkCause::Silent,
            Heard { bytes, frames: 0 } => LinkCause::Garbled { bytes },
            Heard { .. } => LinkCause::Unanswered,
        }
    }

    fn link_down(&mut self, now: Instant, flight: &Flight, cause: LinkCause) {
        self.close();
        self.tell(HostEvent::LinkDown {
            request: flight.request.message_type(),
            attempts: flight.sends,
            elapsed: now.since(flight.submitted),
            cause,
        });
    }

    /// Ends the session. A `Stop` goes on being sent.
    fn close(&mut self) {
        self.phase = Phase::Closed;
        self.identify = None;
        self.window = Window::default();
    }

    /// There is always a place: replies are fewer than [`EVENTS_KEPT`], results and garbage
    /// leave that many free, and the link ends once.
    fn tell(&mut self, event: HostEvent) {
        let _ = self.events.push_back(event);
    }
}
