//! The master's end of a half-duplex bus: one question at a time, answered, asked again, or
//! given up; and words that nobody answers, which overtake questions that wait.
//!
//! Answers may be late by more than a wire's time: adapters hold them back, and hosts are busy. A
//! question that can be asked twice is: it reads, or it writes absolute values. It is asked again
//! with ever more time, whoever has not answered alone, and whose answer is late has answered;
//! only who says nothing for the whole of the caller's patience is given up. After a question that
//! had to be repeated the bus is left alone until all that was asked for has come or can't come any
//! more, so that a late answer is never taken for the answer to the next question. It knows packets
//! and time, no registers.

use std::collections::VecDeque;
use std::time::Duration;

use firmware_protocol::Instant;

use super::packet::{BadPackets, Decoder, Instruction, ServoId, Status};

/// Start bit, eight data bits, stop bit.
const BITS_A_BYTE: u64 = 10;
/// What a status packet has beside its data: header, id, length, instruction, error, CRC.
const STATUS_BYTES: usize = 11;
/// The longest that a servo waits before it answers: register 9 at its largest, 254 × 2 µs.
const RETURN_DELAY: Duration = Duration::from_micros(508);
/// How late bytes may come before a question is asked again: adapters hand them on every 16 ms,
/// and hosts are busy. Twice as long after each round.
const SLACK: Duration = Duration::from_millis(60);
/// No later than that: moving servos stop by themselves where nothing is said for 500 ms.
const SLACK_MAX: Duration = Duration::from_millis(240);
/// How long answers that are still owed are waited for before the next question.
const OWED: Duration = Duration::from_millis(120);

/// What became of a question.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Heard {
    /// The answers, in the order of the servos that were asked.
    pub(super) answers: Vec<Status>,
    /// Who did not answer, also when asked alone.
    pub(super) missing: Vec<ServoId>,
}

/// The bus. At most one question is open.
#[derive(Debug)]
pub(super) struct Bus {
    baud: u32,
    decoder: Decoder,
    /// Packets that nobody answers, before anything else.
    told: VecDeque<Vec<u8>>,
    question: Option<Question>,
    /// Until when nothing is asked, for the sake of answers that are owed.
    quiet_until: Option<Instant>,
    /// Whose answers may still come, once for each.
    owed: Vec<ServoId>,
    heard: Option<Heard>,
}

#[derive(Debug)]
struct Question {
    /// What asks all together.
    together: Option<Exchange>,
    /// What asks each alone who has not answered yet, the next one first.
    alone: VecDeque<Exchange>,
    /// What is on the wire.
    open: Option<Open>,
    /// Bytes of data in each answer; another length is the answer to something else.
    length: usize,
    patience: Duration,
    /// When it was first asked.
    asked: Option<Instant>,
    /// Who has not answered.
    waiting: Vec<ServoId>,
    /// Whom was asked, in order.
    ids: Vec<ServoId>,
    answers: Vec<Status>,
}

/// One packet and those who shall answer it.
#[derive(Debug, Clone)]
struct Exchange {
    packet: Vec<u8>,
    ids: Vec<ServoId>,
    /// How late its answer may be.
    slack: Duration,
    was_asked: bool,
}

/// An exchange that was put on the wire.
#[derive(Debug)]
struct Open {
    ids: Vec<ServoId>,
    /// Until when its answer may be being said: two at once on a half-duplex bus are none.
    said: Instant,
    /// Until when it is waited for.
    deadline: Instant,
}

impl Bus {
    pub(super) fn new(baud: u32) -> Self {
        Self {
            baud: baud.max(1),
            decoder: Decoder::default(),
            told: VecDeque::new(),
            question: None,
            quiet_until: None,
            owed: Vec::new(),
            heard: None,
        }
    }

    /// Forgets everything: the port was opened anew.
    pub(super) fn reset(&mut self) {
        *self = Self::new(self.baud);
    }

    /// Bits a second.
    pub(super) const fn baud(&self) -> u32 {
        self.baud
    }

    /// What was heard that is no answer.
    pub(super) const fn bad(&self) -> BadPackets {
        self.decoder.bad()
    }

    /// Says what nobody answers, before any question that waits.
    pub(super) fn tell(&mut self, instruction: &Instruction) {
        self.told.extend(instruction.encode());
    }

    /// Asks one servo, which answers with so many bytes of data, as often as there is patience. A
    /// question that is open is given up.
    pub(super) fn ask(
        &mut self,
        id: ServoId,
        instruction: &Instruction,
        length: usize,
        patience: Duration,
    ) {
        let exchange = Exchange::new(vec![id], instruction);
        self.open(None, VecDeque::from([exchange]), length, patience);
    }

    /// Asks one servo what must not be said twice; it answers without data.
    pub(super) fn ask_once(&mut self, id: ServoId, instruction: &Instruction, patience: Duration) {
        let exchange = Exchange::new(vec![id], instruction);
        let exchange = Exchange { slack: patience, ..exchange };
        self.open(None, VecDeque::from([exchange]), 0, patience);
    }

    /// Reads the same bytes of several servos; where not all answer together, each alone.
    pub(super) fn read_all(
        &mut self,
        ids: &[ServoId],
        (address, length): (u16, u16),
        is_fast: bool,
        patience: Duration,
    ) {
        let alone = |id: &ServoId| {
            Exchange::new(vec![*id], &Instruction::Read { id: *id, address, length })
        };
        let together = (ids.len() > 1).then(|| {
            let asked = ids.to_vec();
            let instruction = if is_fast {
                Instruction::FastSyncRead { address, length, ids: asked }
            } else {
                Instruction::SyncRead { address, length, ids: asked }
            };
            Exchange::new(ids.to_vec(), &instruction)
        });
        self.open(together, ids.iter().map(alone).collect(), usize::from(length), patience);
    }

    fn open(
        &mut self,
        together: Option<Exchange>,
        alone: VecDeque<Exchange>,
        length: usize,
        patience: Duration,
    ) {
        self.heard = None;
        if let Some(given_up) = self.question.as_ref().and_then(|question| question.open.as_ref()) {
            self.quiet_until = Some(given_up.deadline);
        }
        let ids: Vec<ServoId> = alone.iter().flat_map(|one| one.ids.clone()).collect();
        self.question = Some(Question {
            together,
            alone,
            open: None,
            length,
            patience,
            asked: None,
            waiting: ids.clone(),
            ids,
            answers: Vec::new(),
        });
    }

    /// What became of the last question, once.
    pub(super) fn poll_heard(&mut self) -> Option<Heard> {
        self.heard.take()
    }

    pub(super) fn handle_bytes(&mut self, now: Instant, bytes: &[u8]) {
        for status in self.decoder.take(bytes) {
            if let Some(place) = self.owed.iter().position(|id| *id == status.id) {
                self.owed.swap_remove(place);
            }
            if let Some(question) = self.question.as_mut().filter(|asked| asked.asked.is_some()) {
                question.take(status);
            }
        }
        if self.owed.is_empty() {
            self.quiet_until = None;
        }
        if self.question.as_ref().is_some_and(|question| question.waiting.is_empty()) {
            self.close(now);
        }
    }

    pub(super) fn handle_timeout(&mut self, now: Instant) {
        let Some(question) = &mut self.question else { return };
        if question.open.as_ref().is_none_or(|open| now < open.deadline) {
            return;
        }
        // Half a packet would swallow the beginning of the next.
        self.decoder.discard();
        question.open = None;
        if question.is_given_up(now) {
            self.close(now);
        }
    }

    /// All have answered or were given up.
    fn close(&mut self, now: Instant) {
        let Some(mut question) = self.question.take() else { return };
        self.quiet_until = (!self.owed.is_empty()).then_some(now + OWED);
        let order = |id: ServoId| question.ids.iter().position(|known| *known == id);
        question.answers.sort_by_key(|status| order(status.id));
        self.heard = Some(Heard { answers: question.answers, missing: question.waiting });
    }

    /// The next packet. Words that nobody answers wait only for an answer that is being said.
    pub(super) fn poll_transmit(&mut self, now: Instant) -> Option<Vec<u8>> {
        let open = self.question.as_ref().and_then(|question| question.open.as_ref());
        let is_open = open.is_some();
        if open.is_none_or(|open| open.said <= now)
            && let Some(packet) = self.told.pop_front()
        {
            return Some(packet);
        }
        if is_open || self.quiet_until.is_some_and(|until| now < until) {
            return None;
        }
        let question = self.question.as_mut()?;
        if self.quiet_until.take().is_some() {
            // What has not come by now never will.
            self.owed.clear();
        }
        let (packet, ids) = question.put_on_the_wire(now, self.baud)?;
        self.owed.extend(ids);
        Some(packet)
    }

    /// While an answer is awaited: until when; while the bus is left alone: how long.
    pub(super) fn poll_timeout(&self) -> Option<Instant> {
        let question = self.question.as_ref()?;
        let Some(open) = &question.open else {
            // What can go out now waits for no time.
            return self.quiet_until;
        };
        let said = (!self.told.is_empty()).then_some(open.said);
        Some(said.map_or(open.deadline, |said| said.min(open.deadline)))
    }
}

impl Question {
    /// The next packet, and who shall answer it: all together first, then each who has not.
    fn put_on_the_wire(&mut self, now: Instant, baud: u32) -> Option<(Vec<u8>, Vec<ServoId>)> {
        let waiting = &self.waiting;
        self.alone.retain(|exchange| exchange.ids.iter().any(|id| waiting.contains(id)));
        let end = *self.asked.get_or_insert(now) + self.patience;
        let exchange = self.together.take().or_else(|| {
            let next = self.alone.pop_front()?;
            let slack = (next.slack * 2).min(SLACK_MAX.max(next.slack));
            self.alone.push_back(Exchange { slack, was_asked: true, ..next.clone() });
            Some(next)
        })?;
        let answered = now + exchange.time(baud, self.length);
        let left = end.since(answered);
        let said = answered + SLACK;
        let deadline = answered + exchange.slack.min(left.max(SLACK));
        self.open = Some(Open { ids: exchange.ids.clone(), said, deadline });
        Some((exchange.packet, exchange.ids))
    }

    /// Takes an answer of someone who was asked; others' are passed over.
    fn take(&mut self, status: Status) {
        let is_whole = status.data.len() == self.length || status.result.is_err();
        let place = self.waiting.iter().position(|id| *id == status.id);
        let Some(place) = place.filter(|_| is_whole) else { return };
        self.waiting.remove(place);
        self.answers.push(status);
        let waits = |open: &Open| open.ids.iter().any(|id| self.waiting.contains(id));
        if !self.open.as_ref().is_some_and(waits) {
            self.open = None;
        }
    }

    /// Whether there is no more patience, and whoever is missing was asked alone.
    fn is_given_up(&self, now: Instant) -> bool {
        let is_over = self.asked.is_some_and(|asked| asked + self.patience <= now);
        let is_missing = |one: &&Exchange| one.ids.iter().any(|id| self.waiting.contains(id));
        is_over && self.alone.iter().filter(is_missing).all(|exchange| exchange.was_asked)
    }
}

impl Exchange {
    fn new(ids: Vec<ServoId>, instruction: &Instruction) -> Self {
        // What is asked here is short: a list of a rig's servos at most.
        let packet = instruction.encode().unwrap_or_default();
        Self { packet, ids, slack: SLACK, was_asked: false }
    }

    /// How long the question and answers with so many bytes of data take on the wire.
    fn time(&self, baud: u32, length: usize) -> Duration {
        let answers = self.ids.len() * (STATUS_BYTES + length);
        let bits = BITS_A_BYTE * (self.packet.len() + answers) as u64;
        let wire = Duration::from_micros((bits * 1_000_000).div_ceil(u64::from(baud)));
        wire + RETURN_DELAY * u32::try_from(self.ids.len()).unwrap_or(u32::MAX)
    }
}

#[cfg(test)]
mod tests;
