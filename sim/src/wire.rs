//! A device at the end of a serial wire, without the wire: bytes come in when they were sent and
//! reach the device when the last of them has passed at the baud rate; what the device says comes
//! out when it has passed. All of it to the microsecond, whenever it is called.
//!
//! It reads no clock and does no I/O: [`crate::serve`] does.

use std::collections::VecDeque;

use firmware_protocol::{Board, Device, Instant, frame};

use crate::LinkFaults;
use crate::chance::Stream;

/// Start bit, eight data bits, stop bit.
const BITS_A_BYTE: u64 = 10;

const MICROS_A_SECOND: u64 = 1_000_000;

/// The line's own properties, the same both ways.
#[derive(Debug, Clone)]
pub struct Wire {
    baud: u32,
    faults: Option<Faults>,
}

#[derive(Debug, Clone)]
struct Faults {
    rates: LinkFaults,
    chance: Stream,
}

impl Wire {
    /// A faultless line of so many bits a second (at least 1), ten to the byte.
    pub fn new(baud: u32) -> Self {
        Self { baud: baud.max(1), faults: None }
    }

    /// The line with bytes lost and bits flipped by chance.
    #[must_use]
    pub fn with_faults(mut self, rates: LinkFaults, seed: u64) -> Self {
        let chance = Stream::new(seed, "link faults", 0);
        self.faults = (!rates.is_none()).then_some(Faults { rates, chance });
        self
    }

    /// When the last of `len` bytes has passed whose first sets out at `from`.
    pub(crate) fn passed(&self, from: Instant, len: usize) -> Instant {
        let bits = BITS_A_BYTE * len as u64;
        let micros = (bits * MICROS_A_SECOND).div_ceil(u64::from(self.baud));
        Instant::from_micros(from.micros() + micros)
    }

    /// What arrives of bytes that are sent.
    pub(crate) fn carry(&mut self, bytes: &[u8]) -> Vec<u8> {
        let Some(Faults { rates, chance }) = &mut self.faults else { return bytes.to_vec() };
        let mut carried = Vec::with_capacity(bytes.len());
        for byte in bytes {
            let lost = chance.uniform() < rates.drop_rate;
            let flipped = chance.uniform() < rates.corrupt_rate;
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to 7
            let bit = (chance.uniform() * 8.0) as u8;
            if !lost {
                carried.push(if flipped { byte ^ (1 << bit) } else { *byte });
            }
        }
        carried
    }
}

/// A device and its wire.
pub(crate) struct Wired<'d, B> {
    device: &'d mut Device<B>,
    wire: Wire,
    /// Everything up to here has happened.
    clock: Instant,
    /// When the wire towards the device is free.
    inward: Instant,
    /// When the wire from the device is free.
    outward: Instant,
    /// Whether the device may have more to say.
    unsaid: bool,
    /// What is on its way out, with the moment at which the last byte has passed.
    on_its_way: VecDeque<(Instant, Vec<u8>)>,
}

impl<'d, B: Board> Wired<'d, B> {
    pub(crate) fn new(device: &'d mut Device<B>, wire: Wire, now: Instant) -> Self {
        let on_its_way = VecDeque::new();
        Self { device, wire, clock: now, inward: now, outward: now, unsaid: true, on_its_way }
    }

    /// The host has put bytes on the wire at `now`. The device takes them at the moments at
    /// which they arrive, ahead of the caller's clock: nothing can come in between but later
    /// bytes and the device's own deadlines, which are kept in order.
    pub(crate) fn send(&mut self, now: Instant, bytes: &[u8]) {
        // A frame's worth at a time: the device acts on whole frames only.
        for piece in bytes.split_inclusive(|byte| *byte == 0) {
            self.inward = self.wire.passed(self.inward.max(now), piece.len());
            let piece = self.wire.carry(piece);
            self.advance(self.inward);
            self.clock = self.clock.max(self.inward);
            self.device.handle_bytes(self.clock, &piece);
            self.unsaid = true;
        }
    }

    /// Lets everything happen that is due by `now`, in order, each at its own moment.
    pub(crate) fn advance(&mut self, now: Instant) {
        loop {
            let timeout = self.device.poll_timeout().filter(|at| *at <= now);
            let send = self.next_send().filter(|at| *at <= now);
            match (timeout, send) {
                (Some(at), send) if send.is_none_or(|send| at <= send) => {
                    self.clock = self.clock.max(at);
                    self.device.handle_timeout(self.clock);
                    self.unsaid = true;
                }
                (_, Some(at)) => self.say(at),
                _ => return,
            }
        }
    }

    /// The next bytes that have arrived at the host by `now`.
    pub(crate) fn receive(&mut self, now: Instant) -> Option<Vec<u8>> {
        let is_due = self.on_its_way.front().is_some_and(|(at, _)| *at <= now);
        is_due.then(|| self.on_its_way.pop_front()).flatten().map(|(_, bytes)| bytes)
    }

    /// When something happens next, or arrives.
    pub(crate) fn next(&self) -> Option<Instant> {
        let arrival = self.on_its_way.front().map(|(at, _)| *at);
        [self.device.poll_timeout(), self.next_send(), arrival].into_iter().flatten().min()
    }

    /// Until when the wire towards the device is busy.
    pub(crate) const fn inward_free(&self) -> Instant {
        self.inward
    }

    fn next_send(&self) -> Option<Instant> {
        self.unsaid.then(|| self.outward.max(self.clock))
    }

    fn say(&mut self, at: Instant) {
        self.clock = self.clock.max(at);
        let mut bytes = [0; frame::WIRE_MAX];
        match self.device.poll_transmit(self.clock, &mut bytes) {
            Some(len) => {
                self.outward = self.wire.passed(self.clock, len);
                let frame = bytes.get(..len).unwrap_or(&bytes);
                let frame = self.wire.carry(frame);
                self.on_its_way.push_back((self.outward, frame));
            }
            None => self.unsaid = false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_bits_a_byte_and_never_early() {
        let at = Instant::from_micros;
        assert_eq!(Wire::new(1_000_000).passed(at(5), 32), at(325));
        assert_eq!(Wire::new(115_200).passed(at(0), 1), at(87));
        assert_eq!(Wire::new(115_200).passed(at(0), 64), at(5556));
    }

    #[test]
    fn faults_come_at_their_rates_and_by_the_seed() {
        let rates = LinkFaults { drop_rate: 0.01, corrupt_rate: 0.02 };
        let bytes = vec![0x55; 100_000];
        let mut wire = Wire::new(1).with_faults(rates, 7);
        let carried = wire.carry(&bytes);
        let (lost, flipped) =
            (bytes.len() - carried.len(), carried.iter().filter(|byte| **byte != 0x55).count());
        assert!((900..1100).contains(&lost), "{lost}");
        assert!((1850..2150).contains(&flipped), "{flipped}");
        assert_eq!(carried, Wire::new(1).with_faults(rates, 7).carry(&bytes));
        assert_eq!(Wire::new(1).with_faults(LinkFaults::default(), 7).carry(&bytes), bytes);
    }
}
