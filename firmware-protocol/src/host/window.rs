//! Requests on their way: sent, due to be sent again, answered. Sequenced ones stand in a small
//! window; when one is lost, all unanswered ones from it on are sent again (go-back-N), so that
//! the device never sees them in another order.

use core::time::Duration;

use heapless::Deque;

use super::Ticket;
use super::round_trip::RoundTrip;
use crate::frame::WIRE_MAX;
use crate::{Instant, Request};

/// How many sequenced requests can wait for their answers. The device keeps as many replies.
pub const WINDOW: usize = 4;
/// How often patience may end before the link counts as down.
pub(super) const TRIES: u8 = 5;

/// One request on its way.
#[derive(Debug, Clone)]
pub(super) struct Flight {
    pub(super) ticket: Ticket,
    pub(super) seq: u8,
    pub(super) request: Request,
    pub(super) submitted: Instant,
    pub(super) sends: u8,
    due: bool,
    answered: bool,
    sent_at: Instant,
    timeouts: u8,
    wire_bytes: usize,
}

impl Flight {
    pub(super) fn new(ticket: Ticket, seq: u8, request: Request, submitted: Instant) -> Self {
        Self {
            ticket,
            seq,
            request,
            submitted,
            sends: 0,
            due: true,
            answered: false,
            sent_at: submitted,
            timeouts: 0,
            wire_bytes: 0,
        }
    }

    pub(super) fn is_due(&self) -> bool {
        self.due
    }

    /// It goes out again, under another number: an answer to the one before is none any more.
    pub(super) fn renumber(&mut self, seq: u8) {
        self.seq = seq;
        self.due = true;
    }

    /// It goes out now, with so many bytes.
    pub(super) fn sent(&mut self, now: Instant, wire_bytes: usize) {
        self.due = false;
        self.sends = self.sends.saturating_add(1);
        self.sent_at = now;
        self.wire_bytes = wire_bytes;
    }

    /// The round trip, of a request that was sent once.
    pub(super) fn round_trip(&self, now: Instant) -> Option<Duration> {
        (self.sends == 1).then(|| now.since(self.sent_at))
    }

    pub(super) fn retries(&self) -> u8 {
        self.sends.saturating_sub(1)
    }

    /// Sent, and waiting.
    fn is_waiting(&self) -> bool {
        !self.answered && !self.due && self.sends > 0
    }

    /// For a request that stands alone: when patience ends.
    pub(super) fn deadline(&self, trip: &RoundTrip) -> Option<Instant> {
        let patience = trip.patience_after(self.timeouts.into(), self.wire_bytes + WIRE_MAX);
        self.is_waiting().then(|| self.sent_at + patience)
    }

    /// Patience has ended: send again, or `false` after too many times.
    pub(super) fn try_again(&mut self) -> bool {
        self.timeouts += 1;
        self.due = true;
        self.timeouts < TRIES
    }
}

/// The sequenced requests, oldest first.
#[derive(Debug, Clone, Default)]
pub(super) struct Window {
    flights: Deque<Flight, WINDOW>,
    next_seq: u8,
    /// When the device last made progress.
    progress: Instant,
    /// The number that was sent again quickly, once: a second nak for it is ignored.
    hurried: Option<u8>,
}

impl Window {
    pub(super) fn is_full(&self) -> bool {
        self.flights.is_full()
    }

    pub(super) fn oldest(&self) -> Option<&Flight> {
        self.flights.front()
    }

    /// The number of the request that is taken in next.
    pub(super) fn next_seq(&self) -> u8 {
        self.next_seq
    }

    /// Takes a request in; there must be room.
    pub(super) fn push(&mut self, ticket: Ticket, request: Request, now: Instant) {
        let flight = Flight::new(ticket, self.next_seq, request, now);
        if self.flights.push_back(flight).is_ok() {
            self.next_seq = self.next_seq.wrapping_add(1);
        }
    }

    /// The next request to go out, in order.
    pub(super) fn due(&mut self) -> Option<&mut Flight> {
        self.flights.iter_mut().find(|flight| flight.due && !flight.answered)
    }

    /// The unanswered request with this number, if it has been sent.
    pub(super) fn waiting(&self, seq: u8) -> Option<&Flight> {
        self.flights.iter().find(|flight| flight.seq == seq && !flight.answered && flight.sends > 0)
    }

    /// Marks the request as answered, and moves on if it was the oldest.
    pub(super) fn answered(&mut self, seq: u8, now: Instant) {
        for flight in self.flights.iter_mut().filter(|flight| flight.seq == seq) {
            flight.answered = true;
        }
        while self.flights.front().is_some_and(|flight| flight.answered) {
            self.flights.pop_front();
            self.progress = now;
            self.hurried = None;
        }
    }

    /// The device asks for everything from `seq` on. Only the first time is listened to: the
    /// rest are answers to what was in flight meanwhile. Gives whether anything is sent again.
    pub(super) fn hurry(&mut self, seq: u8) -> bool {
        if self.hurried == Some(seq) || self.waiting(seq).is_none() {
            return false;
        }
        self.hurried = Some(seq);
        let oldest = self.flights.front().map_or(seq, |flight| flight.seq);
        let first = seq.wrapping_sub(oldest);
        for flight in &mut self.flights {
            flight.due |= flight.is_waiting() && flight.seq.wrapping_sub(oldest) >= first;
        }
        true
    }

    /// When patience ends for the oldest unanswered request.
    pub(super) fn deadline(&self, trip: &RoundTrip) -> Option<Instant> {
        let oldest = self.flights.front().filter(|flight| flight.is_waiting())?;
        let waiting = self.flights.iter().filter(|flight| flight.is_waiting());
        let bytes: usize = waiting.map(|flight| flight.wire_bytes).sum();
        Some(oldest.sent_at.max(self.progress) + trip.patience(bytes + WIRE_MAX))
    }

    /// Patience has ended: send everything unanswered again, or `false` after too many times.
    pub(super) fn try_again(&mut self) -> bool {
        self.hurried = None;
        for flight in &mut self.flights {
            flight.due |= flight.is_waiting();
        }
        self.flights.front_mut().is_none_or(Flight::try_again)
    }
}
