//! Dynamixel servos of the X series on one half-duplex bus, simulated: their protocol 2.0, their
//! control tables, their profiles, their bus watchdog and their hardware errors, around the
//! board's axes.
//!
//! Written from the maker's documents. It shares no code with any driver, and does not know the
//! host: not even which axis of a rig a servo moves, only the board's channel.

mod servo;
mod travel;
mod wire;

use std::collections::VecDeque;

use firmware_protocol::{Board as _, BoardFault, Instant};

use crate::{FaultKind, SimulatedBoard, Twin};
use servo::{CRC_ERROR, INSTRUCTION_ERROR, OVERHEATING, OVERLOAD, Servo};
pub use servo::{ServoLoad, ServoSetting};
use wire::{BROADCAST, Ear, Received, status, status_together};

/// A hardware error that a servo raises by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ServoFault {
    /// It was asked for more torque than it gives for longer than it may.
    Overload,
    /// It is too hot.
    Overheating,
}

/// A bus of servos.
#[derive(Debug)]
pub struct DynamixelBus {
    servos: Vec<Servo>,
    ear: Ear,
    /// Statuses that wait for their time.
    waiting: VecDeque<(Instant, Vec<u8>)>,
    said: Vec<u8>,
    now: Instant,
    /// Servos whose cable is out.
    cut: Vec<u8>,
    /// Instructions that made servos set out.
    moves: u32,
}

impl DynamixelBus {
    /// Servos that were just switched on. Each knows where its axis stands within a turn.
    pub fn new(settings: Vec<ServoSetting>, board: &mut SimulatedBoard) -> Self {
        let servos = settings.into_iter().map(|setting| Servo::new(setting, board)).collect();
        Self {
            servos,
            ear: Ear::default(),
            waiting: VecDeque::new(),
            said: Vec::new(),
            now: Instant::ZERO,
            cut: Vec::new(),
            moves: 0,
        }
    }

    /// The bus with a servo that raises a hardware error as it sets out on its n-th move, counted
    /// from 1.
    #[must_use]
    pub fn with_fault(mut self, id: u8, in_move: u32, fault: ServoFault) -> Self {
        let error = match fault {
            ServoFault::Overload => OVERLOAD,
            ServoFault::Overheating => OVERHEATING,
        };
        for servo in self.servos.iter_mut().filter(|servo| servo.id() == id) {
            servo.fails_in = Some((in_move.max(1), error));
        }
        self
    }

    /// The bus with a servo that nobody reaches, though its motor goes on.
    #[must_use]
    pub fn with_cut(mut self, id: u8) -> Self {
        self.cut.push(id);
        self
    }

    fn answer(&mut self, now: Instant, place: usize, error: u8, data: &[u8]) {
        let Some(servo) = self.servos.get(place) else { return };
        let packet = status(servo.id(), error | servo.alert(), data);
        self.waiting.push_back((now + servo.return_delay(), packet));
    }

    /// Those who hear an instruction to this id.
    fn spoken_to(&self, now: Instant, id: u8) -> Vec<usize> {
        let servos = self.servos.iter().enumerate();
        let hear = |(place, servo): (usize, &Servo)| {
            let is_meant = id == BROADCAST || servo.id() == id;
            let is_there = servo.is_on(now) && !self.cut.contains(&servo.id());
            (is_meant && is_there).then_some(place)
        };
        servos.filter_map(hear).collect()
    }

    fn obey(&mut self, board: &mut SimulatedBoard, now: Instant, received: &Received) {
        let all = self.spoken_to(now, BROADCAST);
        for place in &all {
            self.servos[*place].hear(now);
        }
        let parameters = &received.parameters[..];
        match received.instruction {
            0x82 | 0x8a => {
                return self.read_same(board, now, received.instruction == 0x8a, parameters);
            }
            0x83 => return self.write_same(board, now, parameters),
            0x92 => return self.read_each(board, now, parameters),
            0x93 => return self.write_each(board, now, parameters),
            _ => {}
        }
        for place in self.spoken_to(now, received.id) {
            self.obey_one(board, now, place, received);
        }
    }

    /// An instruction to one servo, or to all alike.
    fn obey_one(
        &mut self,
        board: &mut SimulatedBoard,
        now: Instant,
        place: usize,
        received: &Received,
    ) {
        let servo = &mut self.servos[place];
        let parameters = &received.parameters[..];
        let address = word(parameters, 0);
        let level = servo.status_return_level();
        let mut data = Vec::new();
        let (result, is_heard) = match (received.instruction, address) {
            _ if received.is_garbled => (Err(CRC_ERROR), level > 0),
            (0x01, _) => {
                data = servo.read(board, now, 0, 7).unwrap_or_default();
                data = [&data[..2], &data[6..]].concat();
                (Ok(()), true)
            }
            (0x02, Some(address)) => {
                let read = servo.read(board, now, address, word(parameters, 2).unwrap_or(0));
                (read.map(|read| data = read), level > 0)
            }
            (0x03, Some(address)) => {
                let bytes = parameters.get(2..).unwrap_or_default();
                (servo.write(board, now, address, bytes), level > 1)
            }
            (0x04, Some(address)) => {
                servo.register(address, parameters.get(2..).unwrap_or_default());
                (Ok(()), level > 1)
            }
            (0x05, _) => {
                servo.act(board, now);
                (Ok(()), level > 1)
            }
            (0x08, _) => {
                self.answer(now, place, 0, &[]);
                self.servos[place].restart(board, now);
                return;
            }
            (0x10, _) if parameters == [1, 0x44, 0x58, 0x4c, 0x22] => {
                servo.clear_turns(board, now);
                (Ok(()), level > 1)
            }
            _ => (Err(INSTRUCTION_ERROR), level > 0),
        };
        // To all at once nobody answers, but for a ping.
        if is_heard && (received.id != BROADCAST || received.instruction == 0x01) {
            self.answer(now, place, result.err().unwrap_or(0), &data);
        }
    }

    fn place_of(&self, now: Instant, id: u8) -> Option<usize> {
        self.spoken_to(now, id).into_iter().next().filter(|_| id != BROADCAST)
    }

    /// Sync read: each waits for the one before it in the list, and says nothing when that is
    /// not there.
    fn read_same(
        &mut self,
        board: &mut SimulatedBoard,
        now: Instant,
        is_fast: bool,
        parameters: &[u8],
    ) {
        let (Some(address), Some(length)) = (word(parameters, 0), word(parameters, 2)) else {
            return;
        };
        let mut parts = Vec::new();
        for id in parameters.get(4..).unwrap_or_default() {
            let Some(place) = self.place_of(now, *id) else { return };
            let servo = &mut self.servos[place];
            let Ok(data) = servo.read(board, now, address, length) else { return };
            if is_fast {
                parts.push((*id, servo.alert(), data));
            } else {
                self.answer(now, place, 0, &data);
            }
        }
        if let Some(servo) = self.servos.first().filter(|_| is_fast) {
            self.waiting.push_back((now + servo.return_delay(), status_together(&parts)));
        }
    }

    fn write_same(&mut self, board: &mut SimulatedBoard, now: Instant, parameters: &[u8]) {
        let (Some(address), Some(length)) = (word(parameters, 0), word(parameters, 2)) else {
            return;
        };
        let each = parameters.get(4..).unwrap_or_default().chunks_exact(1 + usize::from(length));
        for part in each {
            if let Some(place) = self.place_of(now, part[0]) {
                let _ = self.servos[place].write(board, now, address, &part[1..]);
            }
        }
    }

    fn read_each(&mut self, board: &mut SimulatedBoard, now: Instant, parameters: &[u8]) {
        for part in parameters.chunks_exact(5) {
            let (Some(address), Some(length)) = (word(part, 1), word(part, 3)) else { return };
            let Some(place) = self.place_of(now, part[0]) else { return };
            let Ok(data) = self.servos[place].read(board, now, address, length) else { return };
            self.answer(now, place, 0, &data);
        }
    }

    fn write_each(&mut self, board: &mut SimulatedBoard, now: Instant, mut rest: &[u8]) {
        while let (Some(address), Some(length)) = (word(rest, 1), word(rest, 3)) {
            let end = 5 + usize::from(length);
            let Some(data) = rest.get(5..end) else { return };
            if let Some(place) = self.place_of(now, rest[0]) {
                let _ = self.servos[place].write(board, now, address, data);
            }
            rest = rest.get(end..).unwrap_or_default();
        }
    }
}

fn word(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from(*bytes.get(at)?) | u16::from(*bytes.get(at + 1)?) << 8)
}

impl Twin for DynamixelBus {
    fn follow(&mut self, board: &mut SimulatedBoard, now: Instant) {
        self.now = now;
        for servo in &self.servos {
            servo.follow(board, now);
        }
    }

    fn handle_bytes(&mut self, board: &mut SimulatedBoard, now: Instant, bytes: &[u8]) {
        for byte in bytes {
            if let Some(received) = self.ear.hear(*byte) {
                let count = |servos: &[Servo]| servos.iter().map(|servo| servo.moves).sum::<u32>();
                let before = count(&self.servos);
                self.obey(board, now, &received);
                self.moves += u32::from(count(&self.servos) != before);
            }
        }
    }

    fn handle_timeout(&mut self, board: &mut SimulatedBoard, now: Instant) {
        for servo in &mut self.servos {
            servo.on_time(now);
        }
        // An axis at its end stop is more than a motor can move.
        if let Some(BoardFault::LimitSwitch(channel)) = board.fault(now) {
            let stopped =
                self.servos.iter_mut().find(|servo| servo.setting.load == ServoLoad::Axis(channel));
            if let Some(servo) = stopped {
                servo.fail(now, OVERLOAD);
            }
        }
        while let Some((_, packet)) = self.waiting.pop_front_if(|(at, _)| *at <= now) {
            self.said.extend(packet);
        }
    }

    fn poll_timeout(&self, board: &SimulatedBoard) -> Option<Instant> {
        let servos = self.servos.iter().filter_map(|servo| servo.next(self.now));
        let says = self.waiting.front().map(|(at, _)| *at);
        servos.chain(says).chain(board.wake_at()).min()
    }

    fn deeds(&self) -> u32 {
        self.moves
    }

    fn fail(&mut self, _board: &mut SimulatedBoard, now: Instant, fault: FaultKind) {
        let (id, error) = match fault {
            FaultKind::Overheating(id) => (id, OVERHEATING),
            FaultKind::Overload(id) => (id, OVERLOAD),
            _ => return,
        };
        for servo in self.servos.iter_mut().filter(|servo| servo.id() == id) {
            servo.fail(now, error);
        }
    }

    fn poll_transmit(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.said)
    }
}
