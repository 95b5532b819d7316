//! A host and a device in lock step: one virtual clock, a wire each way with faults as data, one
//! seed. Nothing sleeps.

use std::time::Duration;

use firmware_protocol::{
    AxisMask, Board, Capabilities, CommandId, Device, DeviceEndpoint, Done, Event, HostEndpoint,
    Identity, Instant, Rejection, Reply, Request, Status, frame,
};

use crate::golden;

/// What a wire does to the frames on it. Chances are for one frame.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Faults {
    pub(crate) drop: f64,
    pub(crate) duplicate: f64,
    /// One to four bits flipped.
    pub(crate) corrupt: f64,
    /// Each frame is late by up to this, so that frames overtake each other.
    pub(crate) delay_us: u64,
    /// The first frames after this is set are lost: how many.
    pub(crate) lose_next: u32,
}

/// splitmix64 (Steele, Lea and Flood 2014).
pub(crate) struct Dice(u64);

impl Dice {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub(crate) fn roll(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn below(&mut self, bound: u64) -> u64 {
        self.roll() % bound.max(1)
    }

    fn happens(&mut self, chance: f64) -> bool {
        ((self.roll() >> 11) as f64) < chance * (1_u64 << 53) as f64
    }
}

/// One direction: a millisecond of latency, and the bytes' own time.
pub(crate) struct Wire {
    pub(crate) faults: Faults,
    pub(crate) baud: u32,
    dice: Dice,
    free_at: Instant,
    travelling: Vec<(Instant, Vec<u8>)>,
    pub(crate) carried: Vec<Vec<u8>>,
}

impl Wire {
    fn new(seed: u64, baud: u32, faults: Faults) -> Self {
        let dice = Dice::new(seed);
        let free_at = Instant::ZERO;
        Self { faults, baud, dice, free_at, travelling: Vec::new(), carried: Vec::new() }
    }

    pub(crate) fn send(&mut self, now: Instant, frame: &[u8]) {
        self.carried.push(frame.to_vec());
        let length = Duration::from_secs(10) * u32::try_from(frame.len()).unwrap() / self.baud;
        self.free_at = self.free_at.max(now) + length;
        if self.faults.lose_next > 0 {
            self.faults.lose_next -= 1;
            return;
        }
        if self.dice.happens(self.faults.drop) {
            return;
        }
        self.travel(frame);
        if self.dice.happens(self.faults.duplicate) {
            self.travel(frame);
        }
    }

    fn travel(&mut self, frame: &[u8]) {
        let mut frame = frame.to_vec();
        if self.dice.happens(self.faults.corrupt) {
            for _ in 0..=self.dice.below(4) {
                let bit = usize::try_from(self.dice.below(frame.len() as u64 * 8)).unwrap();
                frame[bit / 8] ^= 1 << (bit % 8);
            }
        }
        let late = Duration::from_micros(1000 + self.dice.below(self.faults.delay_us));
        self.travelling.push((self.free_at + late, frame));
    }

    fn next_arrival(&self) -> Option<Instant> {
        self.travelling.iter().map(|(at, _)| *at).min()
    }

    /// What has arrived by now, the earliest first.
    fn arrive(&mut self, now: Instant) -> Vec<u8> {
        self.travelling.sort_by_key(|(at, _)| *at);
        let arrived = self.travelling.iter().take_while(|(at, _)| *at <= now).count();
        self.travelling.drain(..arrived).flat_map(|(_, frame)| frame).collect()
    }
}

/// What stands at the far end.
pub(crate) trait Peer {
    fn handle_bytes(&mut self, now: Instant, bytes: &[u8]);
    fn handle_timeout(&mut self, now: Instant);
    fn poll_transmit(&mut self, now: Instant, out: &mut [u8]) -> Option<usize>;
    fn poll_timeout(&self) -> Option<Instant>;
}

impl<B: Board> Peer for Device<B> {
    fn handle_bytes(&mut self, now: Instant, bytes: &[u8]) {
        self.handle_bytes(now, bytes);
    }

    fn handle_timeout(&mut self, now: Instant) {
        self.handle_timeout(now);
    }

    fn poll_transmit(&mut self, now: Instant, out: &mut [u8]) -> Option<usize> {
        self.poll_transmit(now, out)
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.poll_timeout()
    }
}

/// A device whose core writes down what it is told to execute: every command takes 3 ms.
pub(crate) struct Ledger {
    pub(crate) link: DeviceEndpoint,
    identity: Identity,
    pub(crate) executed: Vec<Request>,
    waiting: Vec<(Instant, Event)>,
}

impl Ledger {
    pub(crate) fn new(boot_id: u32) -> Self {
        let identity = Identity {
            protocol: (1, 0),
            boot_id,
            queue_depth: 8,
            lease_ms: 500,
            gains: 1,
            adc_bits: 16,
            adc_rate_hz: 1000,
            axes: heapless::Vec::new(),
        };
        let link = DeviceEndpoint::new(identity.clone());
        Self { link, identity, executed: Vec::new(), waiting: Vec::new() }
    }

    pub(crate) fn count(&self, request: &Request) -> usize {
        self.executed.iter().filter(|executed| *executed == request).count()
    }

    fn execute(&mut self, now: Instant, request: &Request) -> Reply {
        self.executed.push(request.clone());
        match request {
            Request::Identify(_) => {
                self.waiting.clear();
                Reply::Identity(self.identity.clone())
            }
            Request::ReadStatus => Reply::Status(self.status(now)),
            Request::Stop => Reply::Stopping,
            Request::ClearFault => Reply::Cleared,
            Request::KeepAlive => Reply::Alive,
            Request::Acknowledge(id) => Reply::Acknowledged(*id),
            // It keeps no windows.
            Request::Capabilities => Reply::Capabilities(Capabilities { windows: 0 }),
            Request::FetchWindow(id, _) => Reply::Rejected(*id, Rejection::NoSuchWindow),
            command => self.accept(now, command.command().expect("all others are commands")),
        }
    }

    fn accept(&mut self, now: Instant, id: CommandId) -> Reply {
        let begin = self.waiting.last().map_or(now, |(at, _)| *at);
        let end = begin + Duration::from_millis(3);
        self.waiting.push((begin, Event::Started(id, begin.tick())));
        let done = Done { id, readback: golden::counts(&[]), tick: end.tick() };
        self.waiting.push((end, Event::Done(done)));
        Reply::Accepted(id)
    }

    fn status(&self, now: Instant) -> Status {
        Status {
            boot_id: self.identity.boot_id,
            homed: AxisMask(0),
            moving: false,
            fault: None,
            running: None,
            queued: 0,
            unacknowledged: 0,
            last_id: None,
            readback: golden::counts(&[]),
            tick: now.tick(),
        }
    }

    fn say(&mut self, now: Instant) {
        while self.link.has_room() && self.waiting.first().is_some_and(|(at, _)| *at <= now) {
            let (_, event) = self.waiting.remove(0);
            self.link.say(event).expect("there is room");
        }
    }
}

impl Peer for Ledger {
    fn handle_bytes(&mut self, now: Instant, bytes: &[u8]) {
        for piece in bytes.split_inclusive(|byte| *byte == 0) {
            self.link.handle_bytes(now, piece);
            while let Some(incoming) = self.link.poll_event() {
                let reply = self.execute(now, &incoming.request);
                self.link.answer(incoming.reply_to, reply);
            }
        }
        self.say(now);
    }

    fn handle_timeout(&mut self, now: Instant) {
        self.link.handle_timeout(now);
        self.say(now);
    }

    fn poll_transmit(&mut self, now: Instant, out: &mut [u8]) -> Option<usize> {
        self.link.poll_transmit(now, out)
    }

    fn poll_timeout(&self) -> Option<Instant> {
        let next = self.waiting.first().map(|(at, _)| *at).filter(|_| self.link.has_room());
        [next, self.link.poll_timeout()].into_iter().flatten().min()
    }
}

/// Both ends, and the wires between them.
pub(crate) struct Pair<P> {
    pub(crate) now: Instant,
    pub(crate) host: HostEndpoint,
    pub(crate) device: P,
    pub(crate) down: Wire,
    pub(crate) up: Wire,
    /// The host's user wants to be woken then.
    pub(crate) alarm: Option<Instant>,
}

impl<P: Peer> Pair<P> {
    pub(crate) fn new(seed: u64, device: P, faults: Faults) -> Self {
        let baud = 115_200;
        Self {
            now: Instant::ZERO,
            host: HostEndpoint::new(golden::SESSION, baud),
            device,
            down: Wire::new(seed ^ 0xd0, baud, faults),
            up: Wire::new(seed ^ 0x0b, baud, faults),
            alarm: None,
        }
    }

    /// Sends what is to be sent, and goes to the next moment at which anything happens; `false`
    /// if nothing will.
    pub(crate) fn step(&mut self) -> bool {
        self.send();
        let mut out = [0; frame::WIRE_MAX];
        while let Some(length) = self.device.poll_transmit(self.now, &mut out) {
            self.up.send(self.now, &out[..length]);
        }
        let timeouts = [self.host.poll_timeout(), self.device.poll_timeout()];
        let arrivals = [self.down.next_arrival(), self.up.next_arrival(), self.alarm];
        let Some(next) = timeouts.into_iter().chain(arrivals).flatten().min() else {
            return false;
        };
        self.now = next.max(self.now);
        let bytes = self.down.arrive(self.now);
        self.device.handle_bytes(self.now, &bytes);
        let bytes = self.up.arrive(self.now);
        self.host.handle_bytes(self.now, &bytes);
        if self.device.poll_timeout().is_some_and(|at| at <= self.now) {
            self.device.handle_timeout(self.now);
        }
        if self.host.poll_timeout().is_some_and(|at| at <= self.now) {
            self.host.handle_timeout(self.now);
        }
        true
    }

    /// The host sends what it has.
    pub(crate) fn send(&mut self) {
        let mut out = [0; frame::WIRE_MAX];
        while let Some(length) = self.host.poll_transmit(self.now, &mut out) {
            self.down.send(self.now, &out[..length]);
        }
    }

    /// Steps until the host has something to tell, for a simulated minute at most.
    pub(crate) fn next_event(&mut self) -> Option<firmware_protocol::HostEvent> {
        let end = self.now + Duration::from_mins(1);
        loop {
            if let Some(event) = self.host.poll_event() {
                return Some(event);
            }
            if self.now > end || !self.step() {
                return None;
            }
        }
    }

    /// Steps until an event for which this holds; others are dropped.
    pub(crate) fn wait_for(
        &mut self,
        is_meant: impl Fn(&firmware_protocol::HostEvent) -> bool,
    ) -> firmware_protocol::HostEvent {
        loop {
            let event = self.next_event().expect("nothing happens any more");
            if is_meant(&event) {
                return event;
            }
        }
    }
}
