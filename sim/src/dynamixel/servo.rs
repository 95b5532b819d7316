//! One servo: its control table, and the motor that follows it. Addresses and meanings as the
//! maker's e-manual has them for the XM430-W210.

use core::time::Duration;

use firmware_protocol::{Board, Instant, Shutter};

use super::travel::Travel;
use crate::SimulatedBoard;

/// A servo of a simulated bus, and the axis that it moves.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ServoSetting {
    /// Its number on the bus, 0 to 252.
    pub id: u8,
    /// What it moves.
    pub load: ServoLoad,
    /// Where the axis's home mark stands on its encoder, steps.
    pub zero_steps: i32,
    /// What its motor follows: register 11.
    pub operating_mode: u8,
    /// Its firmware: register 6.
    pub firmware: u8,
}

/// What a servo moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ServoLoad {
    /// The axis of this channel of the board.
    Axis(u8),
    /// A shutter before the detector.
    Shutter {
        /// Where no light passes it, steps; elsewhere all of it does.
        closed_steps: i32,
    },
}

/// A shutter's blade covers the beam within so many steps of where it is closed.
const BLADE_STEPS: u32 = 100;

impl ServoSetting {
    /// Steps of an encoder's turn; in position mode a servo takes goals from 0 to one less.
    pub const STEPS_A_TURN: i32 = 4096;

    /// A servo whose encoder stands in the middle of its turn at the axis's home mark.
    pub const fn new(id: u8, channel: u8) -> Self {
        let load = ServoLoad::Axis(channel);
        Self { id, load, zero_steps: 2048, operating_mode: 3, firmware: 48 }
    }

    /// A servo that holds a shutter, open at power-up.
    pub const fn shutter(id: u8, open_steps: i32, closed_steps: i32) -> Self {
        let load = ServoLoad::Shutter { closed_steps };
        Self { id, load, zero_steps: open_steps, operating_mode: 3, firmware: 48 }
    }
}

/// Bits of the hardware-error register.
pub(super) const OVERLOAD: u8 = 1 << 5;
pub(super) const OVERHEATING: u8 = 1 << 2;

/// Errors of a status packet.
pub(super) const INSTRUCTION_ERROR: u8 = 2;
pub(super) const CRC_ERROR: u8 = 3;
const DATA_RANGE: u8 = 4;
const DATA_LENGTH: u8 = 5;
const DATA_LIMIT: u8 = 6;
const ACCESS: u8 = 7;

const MODEL: u16 = 1030;
const EEPROM_BYTES: u16 = 64;
const TABLE_BYTES: usize = 147;
const STEPS_A_TURN: i32 = ServoSetting::STEPS_A_TURN;
const STEPS_PER_S: f64 = 0.229 / 60.0 * 4096.0;
const STEPS_PER_S2: f64 = 214.577 / 3600.0 * 4096.0;
/// It says that it moves while it is faster than register 24 has it: 10 units.
const MOVING_UNITS: f64 = 10.0;
/// Silence in which nobody can reach it after a restart.
const RESTART: Duration = Duration::from_millis(300);

/// Registers that a host may write, with their lengths; all others it may only read.
const WRITABLE: [(u16, u16); 41] = [
    (7, 1),
    (8, 1),
    (9, 1),
    (10, 1),
    (11, 1),
    (12, 1),
    (13, 1),
    (20, 4),
    (24, 4),
    (31, 1),
    (32, 2),
    (34, 2),
    (36, 2),
    (38, 2),
    (40, 4),
    (44, 4),
    (48, 4),
    (52, 4),
    (60, 1),
    (63, 1),
    (64, 1),
    (65, 1),
    (68, 1),
    (76, 2),
    (78, 2),
    (80, 2),
    (82, 2),
    (84, 2),
    (88, 2),
    (90, 2),
    (98, 1),
    (100, 2),
    (102, 2),
    (104, 4),
    (108, 4),
    (112, 4),
    (116, 4),
    (56, 4),
    (14, 2),
    (16, 2),
    (18, 2),
];

/// A servo at work.
#[derive(Debug)]
pub(super) struct Servo {
    pub(super) setting: ServoSetting,
    table: Vec<u8>,
    travel: Travel,
    /// Turns that its encoder does not know of, steps: those of before it was switched on.
    lost_steps: i32,
    restarts_until: Option<Instant>,
    booted: Instant,
    /// When a word last came over the bus.
    heard: Instant,
    /// What a `REG_WRITE` left for the next action.
    registered: Option<(u16, Vec<u8>)>,
    /// How often it set out for a goal.
    pub(super) moves: u32,
    /// Raised in the n-th move from now on, as hardware would by itself.
    pub(super) fails_in: Option<(u32, u8)>,
}

impl Servo {
    pub(super) fn new(setting: ServoSetting, board: &mut SimulatedBoard) -> Self {
        if let ServoLoad::Axis(channel) = setting.load {
            board.know_home(channel);
        }
        let mut servo = Self {
            table: Vec::new(),
            travel: Travel::rest(Instant::ZERO, 0.0),
            lost_steps: 0,
            restarts_until: None,
            booted: Instant::ZERO,
            heard: Instant::ZERO,
            registered: None,
            moves: 0,
            fails_in: None,
            setting,
        };
        servo.table = servo.factory();
        servo.switch_on(board, Instant::ZERO);
        servo
    }

    fn factory(&self) -> Vec<u8> {
        let mut table = vec![0; TABLE_BYTES];
        let mut put = |address: usize, bytes: &[u8]| {
            table[address..address + bytes.len()].copy_from_slice(bytes);
        };
        put(0, &MODEL.to_le_bytes());
        put(6, &[self.setting.firmware, self.setting.id, 3, 250, 0, self.setting.operating_mode]);
        put(13, &[2]);
        put(24, &10_u32.to_le_bytes());
        put(31, &[80]);
        put(32, &160_u16.to_le_bytes());
        put(34, &95_u16.to_le_bytes());
        put(36, &885_u16.to_le_bytes());
        put(38, &1193_u16.to_le_bytes());
        put(40, &32_767_u32.to_le_bytes());
        put(44, &350_u32.to_le_bytes());
        put(48, &4095_u32.to_le_bytes());
        put(63, &[52]);
        table
    }

    /// Everything that is not kept goes back to what it is at power-up.
    fn switch_on(&mut self, board: &mut SimulatedBoard, now: Instant) {
        self.table[usize::from(EEPROM_BYTES)..].fill(0);
        self.table[68] = 2;
        self.put(84, 800_u16.to_le_bytes());
        self.put(100, 885_u16.to_le_bytes());
        self.put(102, 1193_u16.to_le_bytes());
        self.put(104, self.velocity_limit().to_le_bytes());
        self.put(144, 120_u16.to_le_bytes());
        self.table[146] = 33;
        self.booted = now;
        self.registered = None;
        let all = self.count(board, now) + self.setting.zero_steps;
        self.lost_steps = all.div_euclid(STEPS_A_TURN) * STEPS_A_TURN;
        let here = f64::from(all - self.setting.zero_steps);
        self.travel = Travel::rest(now, here);
    }

    pub(super) const fn id(&self) -> u8 {
        self.setting.id
    }

    /// Whether it hears anything.
    pub(super) fn is_on(&self, now: Instant) -> bool {
        self.restarts_until.is_none_or(|until| until <= now)
    }

    fn put<const N: usize>(&mut self, address: usize, bytes: [u8; N]) {
        self.table[address..address + N].copy_from_slice(&bytes);
    }

    fn word(&self, address: usize) -> u32 {
        let bytes = &self.table[address..address + 4];
        bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
    }

    fn velocity_limit(&self) -> u32 {
        self.word(44)
    }

    pub(super) fn hardware_error(&self) -> u8 {
        self.table[70]
    }

    /// Bit 7 of every status that it sends.
    pub(super) fn alert(&self) -> u8 {
        if self.hardware_error() == 0 { 0 } else { 0x80 }
    }

    pub(super) fn return_delay(&self) -> Duration {
        Duration::from_micros(2 * u64::from(self.table[9]))
    }

    pub(super) fn status_return_level(&self) -> u8 {
        self.table[68]
    }

    fn has_torque(&self) -> bool {
        self.table[64] == 1
    }

    /// Bytes of its table now; an error code where there are none.
    pub(super) fn read(
        &mut self,
        board: &mut SimulatedBoard,
        now: Instant,
        address: u16,
        length: u16,
    ) -> Result<Vec<u8>, u8> {
        self.refresh(board, now);
        let from = usize::from(address);
        let bytes = self.table.get(from..from + usize::from(length));
        bytes.map(<[u8]>::to_vec).ok_or(DATA_LENGTH)
    }

    /// Puts what it measures into the table.
    fn refresh(&mut self, board: &mut SimulatedBoard, now: Instant) {
        let (_, speed) = self.travel.at(now);
        let units = speed / STEPS_PER_S;
        let at = self.count(board, now) + self.setting.zero_steps;
        let ms = now.since(self.booted).as_millis() % 32_768;
        #[allow(clippy::cast_possible_truncation)] // below 32768; a servo's speed
        let (tick, velocity) = (ms as u16, units.round() as i32);
        let is_moving = units.abs() > MOVING_UNITS;
        let is_on_its_way = now < self.travel.ends();
        self.put(120, tick.to_le_bytes());
        self.table[122] = u8::from(is_moving);
        self.table[123] = u8::from(is_on_its_way) << 1 | u8::from(!is_on_its_way);
        self.put(128, velocity.to_le_bytes());
        self.put(132, (at - self.lost_steps).to_le_bytes());
        if !self.has_torque() {
            self.put(116, (at - self.lost_steps).to_le_bytes());
        }
    }

    /// Writes to its table; an error code where it does not take that.
    pub(super) fn write(
        &mut self,
        board: &mut SimulatedBoard,
        now: Instant,
        address: u16,
        data: &[u8],
    ) -> Result<(), u8> {
        let mut from = address;
        let mut rest = data;
        // Register by register, all or nothing: a host may write several that stand in a row.
        let mut pieces = Vec::new();
        while !rest.is_empty() {
            let known = WRITABLE.iter().find(|(address, _)| *address == from);
            let (_, length) = known.ok_or(ACCESS)?;
            let (piece, left) = rest.split_at_checked(usize::from(*length)).ok_or(DATA_LENGTH)?;
            self.check(from, piece)?;
            pieces.push((usize::from(from), piece));
            (from, rest) = (from + length, left);
        }
        let before = (self.table[64], self.word(116));
        for (at, piece) in pieces {
            self.table[at..at + piece.len()].copy_from_slice(piece);
        }
        let goal_is_written = address <= 116 && from > 116;
        if goal_is_written && self.has_torque() {
            self.set_out(board, now);
        } else if self.has_torque() && before.0 == 0 {
            // Torque holds it where it is.
            self.refresh(board, now);
            self.put(116, self.word(132).to_le_bytes());
        } else if !self.has_torque() && before.0 == 1 {
            self.let_go(now);
        }
        Ok(())
    }

    /// Whether a register takes a value now.
    fn check(&self, address: u16, data: &[u8]) -> Result<(), u8> {
        let value = data.iter().rev().fold(0_u32, |value, byte| value << 8 | u32::from(*byte));
        if address < EEPROM_BYTES && self.has_torque() {
            return Err(ACCESS);
        }
        let is_struck = self.table[98] == 0xff;
        match address {
            64 if value == 1 && self.hardware_error() != 0 => Err(ACCESS),
            64 | 65 if value > 1 => Err(DATA_RANGE),
            11 if ![0, 1, 3, 4, 5, 16].contains(&value) => Err(DATA_RANGE),
            68 if value > 2 => Err(DATA_RANGE),
            98 if value > 127 => Err(DATA_RANGE),
            100..=104 | 116 if is_struck => Err(DATA_RANGE),
            108 if value > self.word(40) => Err(DATA_LIMIT),
            112 if value > self.velocity_limit() => Err(DATA_LIMIT),
            116 => {
                let goal = i64::from(value.cast_signed());
                let (low, high) = match self.table[11] {
                    3 => (i64::from(self.word(52)), i64::from(self.word(48))),
                    _ => (-1_048_575, 1_048_575),
                };
                if (low..=high).contains(&goal) { Ok(()) } else { Err(DATA_LIMIT) }
            }
            _ => Ok(()),
        }
    }

    fn speed_and_acceleration(&self) -> (f64, f64) {
        let or = |units: u32, default: u32| f64::from(if units == 0 { default } else { units });
        // A profile of 0 is none: as fast as it can.
        let speed = or(self.word(112), self.velocity_limit()) * STEPS_PER_S;
        (speed, or(self.word(108), 400) * STEPS_PER_S2)
    }

    /// Sets out for its goal.
    fn set_out(&mut self, board: &mut SimulatedBoard, now: Instant) {
        if !matches!(self.table[11], 3 | 4) {
            return;
        }
        let goal = self.word(116).cast_signed() + self.lost_steps - self.setting.zero_steps;
        let goal = f64::from(goal);
        if (goal - self.travel.goal()).abs() < 0.5 {
            return;
        }
        let (speed, acceleration) = self.speed_and_acceleration();
        self.travel = Travel::new(now, self.travel.at(now), goal, speed, acceleration);
        if let ServoLoad::Axis(channel) = self.setting.load {
            board.begin_motion(now, channel, goal);
        }
        self.moves += 1;
        if let Some((moves, error)) = self.fails_in.filter(|(moves, _)| *moves <= self.moves) {
            debug_assert!(moves > 0);
            self.fails_in = None;
            self.fail(now, error);
        }
    }

    /// Lets go of its torque: friction holds the axis where it is.
    fn let_go(&mut self, now: Instant) {
        let (at, _) = self.travel.at(now);
        self.travel = Travel::rest(now, at.round());
    }

    /// A hardware error: the motor is off until a restart.
    pub(super) fn fail(&mut self, now: Instant, error: u8) {
        self.table[70] |= error;
        self.table[64] = 0;
        self.let_go(now);
    }

    pub(super) fn register(&mut self, address: u16, data: &[u8]) {
        self.registered = Some((address, data.to_vec()));
        self.table[69] = 1;
    }

    pub(super) fn act(&mut self, board: &mut SimulatedBoard, now: Instant) {
        if let Some((address, data)) = self.registered.take() {
            self.table[69] = 0;
            let _ = self.write(board, now, address, &data);
        }
    }

    pub(super) fn restart(&mut self, board: &mut SimulatedBoard, now: Instant) {
        self.let_go(now);
        self.follow(board, now);
        self.restarts_until = Some(now + RESTART);
        self.switch_on(board, now);
    }

    /// Forgets whole turns: its position is within one turn from now on.
    pub(super) fn clear_turns(&mut self, board: &mut SimulatedBoard, now: Instant) {
        let at = self.count(board, now) + self.setting.zero_steps;
        self.lost_steps = at.div_euclid(STEPS_A_TURN) * STEPS_A_TURN;
    }

    /// A word came over the bus.
    pub(super) const fn hear(&mut self, now: Instant) {
        self.heard = now;
    }

    fn strikes_at(&self) -> Option<Instant> {
        let units = self.table[98];
        let is_armed = self.has_torque() && (1..=127).contains(&units);
        is_armed.then(|| self.heard + Duration::from_millis(20) * u32::from(units))
    }

    /// When something happens by itself: its watchdog strikes, or it comes to its goal.
    pub(super) fn next(&self, now: Instant) -> Option<Instant> {
        let arrives = Some(self.travel.ends()).filter(|ends| *ends > now);
        [self.strikes_at(), arrives].into_iter().flatten().min()
    }

    pub(super) fn on_time(&mut self, now: Instant) {
        if self.strikes_at().is_some_and(|at| at <= now) {
            self.table[98] = 0xff;
            let (_, acceleration) = self.speed_and_acceleration();
            if now < self.travel.ends() {
                self.travel = self.travel.braked(now, acceleration);
            }
        }
    }

    /// What its encoder counts from its zero.
    #[allow(clippy::cast_possible_truncation)] // within a few turns
    fn count(&self, board: &mut SimulatedBoard, now: Instant) -> i32 {
        match self.setting.load {
            ServoLoad::Axis(channel) => board.readback(now, channel),
            ServoLoad::Shutter { .. } => self.travel.at(now).0.round() as i32,
        }
    }

    /// Takes what it moves to where it is.
    #[allow(clippy::cast_possible_truncation)] // within a few turns
    pub(super) fn follow(&self, board: &mut SimulatedBoard, now: Instant) {
        let (at, _) = self.travel.at(now);
        match self.setting.load {
            ServoLoad::Axis(channel) => board.set_setpoint(now, channel, at),
            ServoLoad::Shutter { closed_steps } => {
                let steps = at.round() as i32 + self.setting.zero_steps;
                let is_closed = steps.abs_diff(closed_steps) <= BLADE_STEPS;
                let shutter = if is_closed { Shutter::Closed } else { Shutter::Open };
                if board.shutter() != shutter {
                    board.put_shutter(shutter);
                }
            }
        }
    }
}
