//! The device's end of the link: bytes in, requests out, each once and in order; replies and
//! events in, bytes out. Knows neither the clock nor what the commands mean.

mod outbox;
mod replies;

use heapless::Deque;

use crate::packet::{Foreign, NakReason, PacketError, Said, SessionTag, ToDevice, ToHost};
use crate::{
    BadFrames, Cause, CommandId, Decoder, Event, Identity, Instant, Rejection, Reply, Request,
    RequestType, WINDOW,
};
use outbox::Outbox;
use replies::{Place, Replies};

/// Requests that can wait to be polled: a window, a `Stop` before and behind each of it, and an
/// `Identify`.
const INBOX: usize = 2 * WINDOW + 2;
/// Sessions that are remembered after their end, so that a late `Identify` does not bring one
/// back.
const PAST: usize = 4;

/// To a `ClearFault` that was said before a `Stop` and comes behind it. It has no command to name.
const OVERTAKEN: Reply = Reply::Rejected(CommandId(0), Rejection::Faulted(Cause::Stopped));

/// Which request a reply belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReplyTo {
    session: SessionTag,
    seq: u8,
}

/// A request to be executed now, and answered with [`DeviceEndpoint::answer`].
#[derive(Debug, Clone, PartialEq)]
pub struct Incoming {
    /// Whom the reply goes to.
    pub reply_to: ReplyTo,
    /// What to do.
    pub request: Request,
}

/// The device's end of the link, a machine without a clock or a port.
///
/// After every call of `handle_bytes`: poll the requests, and answer each before the next call;
/// hand in the events that this caused; then poll transmits until they give `None`, and ask
/// `poll_timeout`.
#[derive(Debug, Clone)]
pub struct DeviceEndpoint {
    decoder: Decoder,
    identity: Identity,
    session: Option<u32>,
    past: Deque<u32, PAST>,
    inbox: Deque<Incoming, INBOX>,
    replies: Replies,
    outbox: Outbox,
    identity_due: Option<ReplyTo>,
    stopping_due: Option<ReplyTo>,
    nak_due: Option<(NakReason, SessionTag)>,
    /// The number that a resend was asked for, until it comes.
    asked_for: Option<u8>,
    /// The first number behind a `Stop` that came before the requests in front of it.
    stopped_before: Option<u8>,
    heard: Instant,
}

impl DeviceEndpoint {
    /// A device that has just booted, as the one it tells that it is.
    pub fn new(identity: Identity) -> Self {
        Self {
            decoder: Decoder::default(),
            identity,
            session: None,
            past: Deque::new(),
            inbox: Deque::new(),
            replies: Replies::default(),
            outbox: Outbox::default(),
            identity_due: None,
            stopping_due: None,
            nak_due: None,
            asked_for: None,
            stopped_before: None,
            heard: Instant::ZERO,
        }
    }

    /// Takes what the wire brought, in slices of any size. Of requests that are not polled in
    /// between, a window's worth is kept.
    pub fn handle_bytes(&mut self, now: Instant, mut bytes: &[u8]) {
        while let Some(result) = self.decoder.next_frame(&mut bytes) {
            match result.map(|frame| ToDevice::decode(&frame)) {
                Ok(Ok(packet)) => self.handle_packet(now, packet),
                Ok(Err(PacketError::Version(foreign))) => self.handle_foreign(foreign),
                // An echo, or a peer that makes no sense: silence lets its patience end.
                Ok(Err(PacketError::Kind(_) | PacketError::Codec(_))) => {}
                Err(_) => self.ask_for_resend(),
            }
        }
    }

    /// The time is `now`; call when [`Self::poll_timeout`]'s moment has come.
    pub fn handle_timeout(&mut self, now: Instant) {
        self.outbox.handle_timeout(now, self.heard);
    }

    /// Writes the next frame to `out`, which should have [`crate::frame::WIRE_MAX`] bytes, and
    /// gives its length. Call after every other call until it gives `None`.
    pub fn poll_transmit(&mut self, now: Instant, out: &mut [u8]) -> Option<usize> {
        let (to, message) = self.next_to_say(now)?;
        let ReplyTo { session, seq } = to;
        ToHost { session, boot_id: self.identity.boot_id, seq, message }.encode(out)
    }

    /// The next request to execute. Call after `handle_bytes` until it gives `None`.
    pub fn poll_event(&mut self) -> Option<Incoming> {
        self.inbox.pop_front()
    }

    /// When to call [`Self::handle_timeout`]. Changes with every other call; `None` while no
    /// result waits for its acknowledgement.
    pub fn poll_timeout(&self) -> Option<Instant> {
        self.outbox.next_repeat(self.heard)
    }

    /// The reply to a request that was polled.
    pub fn answer(&mut self, to: ReplyTo, reply: Reply) {
        match reply {
            Reply::Identity(_) => self.identity_due = Some(to),
            Reply::Stopping => self.stopping_due = Some(to),
            reply if Some(to.session) == self.tag() => self.replies.answer(to.seq, reply),
            _ => {}
        }
    }

    /// Whether [`Self::say`] takes any event.
    pub fn has_room(&self) -> bool {
        self.outbox.has_room()
    }

    /// Takes an event to say: a result is kept until the host acknowledges it. While there is
    /// [no room](Self::has_room), a result or a window is given back.
    pub fn say(&mut self, event: Event) -> Result<(), Event> {
        self.outbox.push(event)
    }

    /// When a valid frame of the session, an `Identify` or a `Stop` last came: what renews the
    /// lease.
    pub const fn heard(&self) -> Instant {
        self.heard
    }

    /// Frames refused so far.
    pub const fn bad(&self) -> BadFrames {
        self.decoder.bad()
    }

    fn tag(&self) -> Option<SessionTag> {
        self.session.map(SessionTag::of)
    }

    fn handle_packet(&mut self, now: Instant, packet: ToDevice) {
        let ToDevice { session, seq, request } = packet;
        let reply_to = ReplyTo { session, seq };
        match request {
            Request::Stop => {
                self.heard = now;
                if Some(session) == self.tag() {
                    self.stopped_before = self.replies.is_before(seq).then_some(seq);
                }
                self.take(Incoming { reply_to, request });
            }
            Request::Identify(number) => self.handle_identify(now, number, reply_to),
            request if Some(session) == self.tag() => {
                self.heard = now;
                self.handle_sequenced(Incoming { reply_to, request });
            }
            _ => self.nak_due = Some((NakReason::NoSession, session)),
        }
    }

    fn handle_identify(&mut self, now: Instant, number: u32, reply_to: ReplyTo) {
        if self.past.iter().any(|past| *past == number) {
            return;
        }
        self.heard = now;
        if self.session == Some(number) {
            self.identity_due = Some(reply_to);
            return;
        }
        self.begin(number);
        self.take(Incoming { reply_to, request: Request::Identify(number) });
    }

    fn begin(&mut self, number: u32) {
        if let Some(past) = self.session.replace(number) {
            if self.past.is_full() {
                self.past.pop_front();
            }
            let _ = self.past.push_back(past);
        }
        self.identity_due = None;
        self.nak_due = None;
        self.asked_for = None;
        self.stopped_before = None;
        // A stop that nobody has executed yet stays; the last of several does.
        self.inbox.retain(|incoming| incoming.request == Request::Stop);
        while self.inbox.len() > 1 {
            self.inbox.pop_front();
        }
        self.replies = Replies::default();
        self.outbox = Outbox::default();
    }

    fn handle_sequenced(&mut self, incoming: Incoming) {
        let seq = incoming.reply_to.seq;
        match self.replies.place(seq) {
            // Without a place it counts as lost, and comes again.
            Place::Next if self.inbox.len() >= WINDOW => {}
            Place::Next => {
                if let Request::Acknowledge(id) = incoming.request {
                    self.outbox.acknowledge(id);
                }
                let is_overtaken = self.is_overtaken();
                self.replies.take_next();
                self.asked_for = None;
                if is_overtaken && incoming.request == Request::ClearFault {
                    self.replies.answer(seq, OVERTAKEN);
                } else {
                    self.take(incoming);
                }
            }
            Place::Repeat => self.replies.repeat(seq),
            Place::Ahead => self.ask_for_resend(),
            Place::Elsewhere => {}
        }
    }

    /// Whether a `Stop` that the host said after the next request was executed already.
    fn is_overtaken(&mut self) -> bool {
        self.stopped_before = self.stopped_before.filter(|seq| self.replies.is_before(*seq));
        self.stopped_before.is_some()
    }

    fn handle_foreign(&mut self, foreign: Foreign) {
        let Foreign { session, seq, type_byte, .. } = foreign;
        if type_byte == RequestType::Identify.byte() {
            self.identity_due = Some(ReplyTo { session, seq });
        } else {
            self.nak_due = Some((NakReason::Version, session));
        }
    }

    /// There is always a place: stops in a row share one.
    fn take(&mut self, incoming: Incoming) {
        match self.inbox.back_mut() {
            Some(last) if last.request == Request::Stop && incoming.request == Request::Stop => {
                *last = incoming;
            }
            _ => {
                let _ = self.inbox.push_back(incoming);
            }
        }
    }

    /// Asks once for everything from the expected number on. If that is lost too, the host's
    /// patience ends.
    fn ask_for_resend(&mut self) {
        let expected = self.replies.expected();
        if let Some(session) = self.tag()
            && self.asked_for != Some(expected)
        {
            self.asked_for = Some(expected);
            self.nak_due = Some((NakReason::Resend, session));
        }
    }

    fn next_to_say(&mut self, now: Instant) -> Option<(ReplyTo, Said)> {
        if let Some(to) = self.stopping_due.take() {
            return Some((to, Said::Reply(Reply::Stopping)));
        }
        if let Some(to) = self.identity_due.take() {
            return Some((to, Said::Reply(Reply::Identity(self.identity.clone()))));
        }
        if let Some((reason, session)) = self.nak_due.take() {
            let seq = self.replies.expected();
            return Some((ReplyTo { session, seq }, Said::Nak(reason)));
        }
        let session = self.tag()?;
        if let Some((seq, reply)) = self.replies.pop_due() {
            return Some((ReplyTo { session, seq }, Said::Reply(reply.clone())));
        }
        let (seq, event) = self.outbox.pop_due(now)?;
        Some((ReplyTo { session, seq }, Said::Event(event)))
    }
}
