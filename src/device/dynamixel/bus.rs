//! The master's end of a half-duplex bus: one question at a time, answered, asked again, or
//! given up; and words that nobody answers, which overtake questions that wait.
//!
//! All that is asked here can be asked twice: it reads, or it writes absolute values. After a
//! question that had to be repeated the bus is left alone for a while, so that a late answer is
//! never taken for the answer to the next question. It knows packets and time, no registers.

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
/// How late bytes may come beside: adapters hand them on every 16 ms, and hosts are busy.
const SLACK: Duration = Duration::from_millis(60);
/// How often each servo is asked.
const ATTEMPTS: u8 = 2;

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
    /// Until when nothing is asked.
    quiet_until: Option<Instant>,
    heard: Option<Heard>,
    retries: u64,
}

#[derive(Debug)]
struct Question {
    exchanges: VecDeque<Exchange>,
    /// When the first of them was put on the wire is given up; `None` while it has not been.
    deadline: Option<Instant>,
    /// Whom was asked, in order.
    ids: Vec<ServoId>,
    answers: Vec<Status>,
    missing: Vec<ServoId>,
    was_repeated: bool,
}

/// One packet and those who shall answer it.
#[derive(Debug)]
struct Exchange {
    packet: Vec<u8>,
    ids: Vec<ServoId>,
    /// Bytes of data in each answer; another length is the answer to something else.
    length: usize,
    attempts: u8,
    /// Asked one by one where not all answer to this.
    alone: Vec<Exchange>,
}

impl Bus {
    pub(super) fn new(baud: u32) -> Self {
        Self {
            baud: baud.max(1),
            decoder: Decoder::default(),
            told: VecDeque::new(),
            question: None,
            quiet_until: None,
            heard: None,
            retries: 0,
        }
    }

    /// Forgets everything: the port was opened anew.
    pub(super) fn reset(&mut self) {
        *self = Self::new(self.baud);
    }

    /// What was heard that is no answer.
    pub(super) const fn bad(&self) -> BadPackets {
        self.decoder.bad()
    }

    /// Says what nobody answers, before any question that waits.
    pub(super) fn tell(&mut self, instruction: &Instruction) {
        self.told.extend(instruction.encode());
    }

    /// Asks one servo, which answers with so many bytes of data. A question that is open is given
    /// up.
    pub(super) fn ask(&mut self, id: ServoId, instruction: &Instruction, length: usize) {
        self.open(vec![id], Exchange::new(vec![id], instruction, length));
    }

    /// Reads the same bytes of several servos; where not all answer together, each alone.
    pub(super) fn read_all(&mut self, ids: &[ServoId], address: u16, length: u16, is_fast: bool) {
        let data = usize::from(length);
        let alone = |id: &ServoId| {
            Exchange::new(vec![*id], &Instruction::Read { id: *id, address, length }, data)
        };
        let together = ids.to_vec();
        let instruction = match together[..] {
            [id] => Instruction::Read { id, address, length },
            _ if is_fast => Instruction::FastSyncRead { address, length, ids: together },
            _ => Instruction::SyncRead { address, length, ids: together },
        };
        let mut exchange = Exchange::new(ids.to_vec(), &instruction, data);
        if ids.len() > 1 {
            exchange.alone = ids.iter().map(alone).collect();
        }
        self.open(ids.to_vec(), exchange);
    }

    fn open(&mut self, ids: Vec<ServoId>, exchange: Exchange) {
        self.heard = None;
        self.question = Some(Question {
            exchanges: VecDeque::from([exchange]),
            deadline: None,
            ids,
            answers: Vec::new(),
            missing: Vec::new(),
            was_repeated: false,
        });
    }

    /// What became of the last question, once.
    pub(super) fn poll_heard(&mut self) -> Option<Heard> {
        self.heard.take()
    }

    pub(super) fn handle_bytes(&mut self, now: Instant, bytes: &[u8]) {
        for status in self.decoder.take(bytes) {
            let Some(question) = &mut self.question else { continue };
            if question.deadline.is_none() {
                continue;
            }
            question.take(status);
            self.go_on(now);
        }
    }

    pub(super) fn handle_timeout(&mut self, now: Instant) {
        if self.quiet_until.is_some_and(|until| until <= now) {
            self.quiet_until = None;
        }
        let Some(question) = &mut self.question else { return };
        if question.deadline.is_none_or(|deadline| now < deadline) {
            return;
        }
        self.decoder.discard();
        question.deadline = None;
        question.was_repeated = true;
        self.retries += 1;
        let Some(exchange) = question.exchanges.front_mut() else { return };
        exchange.attempts -= 1;
        if exchange.attempts == 0
            && let Some(given_up) = question.exchanges.pop_front()
        {
            let alone = given_up.alone.into_iter();
            let left = alone.filter(|one| one.ids.iter().any(|id| given_up.ids.contains(id)));
            let before = question.exchanges.len();
            question.exchanges.extend(left);
            if question.exchanges.len() == before {
                question.missing.extend(given_up.ids);
            }
        }
        self.go_on(now);
    }

    /// Closes the question when all have answered or were given up.
    fn go_on(&mut self, now: Instant) {
        let Some(question) = &mut self.question else { return };
        while question.exchanges.front().is_some_and(|exchange| exchange.ids.is_empty()) {
            question.exchanges.pop_front();
            question.deadline = None;
        }
        if !question.exchanges.is_empty() {
            return;
        }
        if let Some(mut question) = self.question.take() {
            if question.was_repeated {
                self.quiet_until = Some(now + SLACK);
            }
            let order = |id: ServoId| question.ids.iter().position(|known| *known == id);
            question.answers.sort_by_key(|status| order(status.id));
            self.heard = Some(Heard { answers: question.answers, missing: question.missing });
        }
    }

    /// The next packet. Words that nobody answers wait only for an answer that is being said:
    /// two at once on a half-duplex bus are none.
    pub(super) fn poll_transmit(&mut self, now: Instant) -> Option<Vec<u8>> {
        if self.question.as_ref().is_none_or(|question| question.deadline.is_none()) {
            if let Some(packet) = self.told.pop_front() {
                return Some(packet);
            }
            if self.quiet_until.is_some() {
                return None;
            }
            let baud = self.baud;
            let question = self.question.as_mut()?;
            let exchange = question.exchanges.front()?;
            question.deadline = Some(now + exchange.patience(baud));
            return Some(exchange.packet.clone());
        }
        None
    }

    /// While an answer is awaited: until when; while the bus is left alone: how long.
    pub(super) fn poll_timeout(&self) -> Option<Instant> {
        let question = self.question.as_ref()?;
        // A question that can go out now waits for no time.
        question.deadline.or(self.quiet_until)
    }
}

impl Question {
    /// Takes an answer of someone who was asked; others' are passed over.
    fn take(&mut self, status: Status) {
        let Some(exchange) = self.exchanges.front_mut() else { return };
        let is_whole = status.data.len() == exchange.length || status.result.is_err();
        let place = exchange.ids.iter().position(|id| *id == status.id);
        if let Some(place) = place.filter(|_| is_whole) {
            exchange.ids.remove(place);
            self.answers.push(status);
        }
    }
}

impl Exchange {
    fn new(ids: Vec<ServoId>, instruction: &Instruction, length: usize) -> Self {
        // What is asked here is short: a list of a rig's servos at most.
        let packet = instruction.encode().unwrap_or_default();
        Self { packet, ids, length, attempts: ATTEMPTS, alone: Vec::new() }
    }

    /// How long an answer may take.
    fn patience(&self, baud: u32) -> Duration {
        let answers = self.ids.len() * (STATUS_BYTES + self.length);
        let bits = BITS_A_BYTE * (self.packet.len() + answers) as u64;
        let wire = Duration::from_micros((bits * 1_000_000).div_ceil(u64::from(baud)));
        let delays = RETURN_DELAY * u32::try_from(self.ids.len()).unwrap_or(u32::MAX);
        wire + delays + SLACK
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(number: u8) -> ServoId {
        ServoId::new(number).unwrap()
    }

    fn ms(ms: u64) -> Instant {
        Instant::from_micros(ms * 1000)
    }

    /// A position as servo 1 of the maker's example answers it, and as servo 2 does.
    const FIRST: [u8; 15] = [0xff, 0xff, 0xfd, 0, 1, 8, 0, 0x55, 0, 0xa6, 0, 0, 0, 0x8c, 0xc0];
    const SECOND: [u8; 15] = [0xff, 0xff, 0xfd, 0, 2, 8, 0, 0x55, 0, 0x1f, 8, 0, 0, 0xba, 0xbe];

    fn asked() -> Bus {
        let mut bus = Bus::new(1_000_000);
        bus.read_all(&[id(1), id(2)], 132, 4, false);
        assert!(bus.poll_transmit(ms(0)).is_some());
        assert_eq!(bus.poll_transmit(ms(0)), None, "one question at a time");
        bus
    }

    #[test]
    fn answers_come_in_the_order_of_the_question() {
        let mut bus = asked();
        bus.handle_bytes(ms(1), &SECOND);
        assert_eq!(bus.poll_heard(), None);
        bus.handle_bytes(ms(2), &FIRST);
        let heard = bus.poll_heard().unwrap();
        let ids: Vec<u8> = heard.answers.iter().map(|status| status.id.number()).collect();
        assert_eq!((ids, heard.missing.len()), (vec![1, 2], 0));
        assert_eq!(bus.poll_timeout(), None, "an idle bus arms no timer");
        bus.read_all(&[id(1)], 132, 4, false);
        assert_eq!(bus.poll_timeout(), None, "nor one that can speak at once");
    }

    #[test]
    fn who_does_not_answer_with_the_others_is_asked_alone_and_named() {
        let mut bus = asked();
        let mut questions = 1;
        let mut now = ms(0);
        let heard = loop {
            if let Some(packet) = bus.poll_transmit(now) {
                questions += 1;
                if packet[4] == 1 {
                    bus.handle_bytes(now, &FIRST);
                }
            }
            if let Some(heard) = bus.poll_heard() {
                break heard;
            }
            // None: the next one can be asked at once.
            now = bus.poll_timeout().map_or(now, |next| next.max(now));
            bus.handle_timeout(now);
        };
        assert_eq!(heard.answers.len(), 1);
        assert_eq!(heard.missing, [id(2)]);
        assert_eq!(questions, 2 + 1 + 2, "twice together, servo 1 alone, servo 2 twice alone");
        assert!(now < ms(300), "{now:?}");
    }

    #[test]
    fn a_late_answer_is_not_the_next_question_s() {
        let mut bus = Bus::new(1_000_000);
        let read = Instruction::Read { id: id(1), address: 132, length: 4 };
        bus.ask(id(1), &read, 4);
        assert!(bus.poll_transmit(ms(0)).is_some());
        bus.handle_timeout(ms(100));
        assert!(bus.poll_transmit(ms(100)).is_some(), "again");
        bus.handle_bytes(ms(101), &FIRST);
        assert!(bus.poll_heard().is_some());
        bus.ask(id(1), &read, 4);
        assert_eq!(bus.poll_transmit(ms(102)), None, "the other answer may still come");
        bus.handle_bytes(ms(103), &FIRST);
        assert_eq!(bus.poll_heard(), None);
        let quiet = bus.poll_timeout().unwrap();
        bus.handle_timeout(quiet);
        assert!(bus.poll_transmit(quiet).is_some());
    }

    #[test]
    fn what_nobody_answers_overtakes_but_does_not_interrupt() {
        let mut bus = asked();
        let stop = Instruction::SyncWrite { address: 116, length: 4, data: vec![] };
        bus.tell(&stop);
        assert_eq!(bus.poll_transmit(ms(0)), None, "an answer is being said");
        bus.handle_bytes(ms(1), &[FIRST, SECOND].concat());
        bus.read_all(&[id(1)], 132, 4, false);
        assert_eq!(bus.poll_transmit(ms(1)), Some(stop.encode().unwrap()));
        assert!(bus.poll_transmit(ms(1)).is_some());
    }
}
