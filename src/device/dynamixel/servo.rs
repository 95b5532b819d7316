//! One servo as the rig file describes it and as it was found: what it may not be, where it
//! stands, and how it is brought to rest. It knows registers and steps, no bus.

use std::time::Duration;

use firmware_protocol::Instant;

use super::packet::ServoId;
use super::table::{
    ACCELERATION_LIMIT, BUS_WATCHDOG, Block, DRIVE_MODE, GOAL_POSITION, HARDWARE_ERROR,
    HardwareError, MAX_POSITION_LIMIT, MIN_POSITION_LIMIT, MOVING, OPERATING_MODE, OperatingMode,
    PRESENT_POSITION, PRESENT_VELOCITY, PROFILE_ACCELERATION, PROFILE_VELOCITY, REALTIME_TICK,
    STATUS_RETURN_LEVEL, TIME_BASED_PROFILE, TORQUE_ENABLE, VELOCITY_LIMIT, has_fast_sync_read,
    model_name,
};
use super::units::{
    ACCELERATION_STEPS_PER_S2, STEPS_A_TURN, STEPS_MAX, VELOCITY_STEPS_PER_S, acceleration_units,
    velocity_units, whole_steps,
};
use crate::device::axes::AxisFacts;
use crate::rig::{Readback, SHUTTER_ACCELERATION, SHUTTER_SPEED};

/// How old a state is when a word by it arrives, seconds, at about.
const LEAD_S: f64 = 0.02;

/// A servo that moves an axis, as the rig file has it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ServoAxis {
    /// What the rig file calls the axis.
    pub axis: &'static str,
    /// The servo's number on the bus.
    pub id: ServoId,
    /// Highest speed, steps a second.
    pub speed: u32,
    /// Acceleration, steps a second squared.
    pub acceleration: u32,
    /// Lowest and highest position of the travel, steps from the servo's own zero.
    pub travel: (i32, i32),
}

/// A servo that holds a shutter before the detector.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShutterServo {
    /// The servo's number on the bus.
    pub id: ServoId,
    /// Where it stands when light reaches the detector, steps.
    pub open: i32,
    /// Where it stands when none does, steps.
    pub closed: i32,
}

impl ShutterServo {
    /// As a servo like any other.
    pub(super) fn as_axis(&self) -> ServoAxis {
        ServoAxis {
            axis: "shutter",
            id: self.id,
            speed: SHUTTER_SPEED,
            acceleration: SHUTTER_ACCELERATION,
            travel: (self.open.min(self.closed), self.open.max(self.closed)),
        }
    }
}

/// What is wrong with a servo, in the words of a refusal: found, expected, to do.
pub(super) type Wrong = (String, String, String);

/// The servo and what is known of it.
#[derive(Debug, Clone)]
pub(super) struct Servo {
    pub(super) axis: ServoAxis,
    /// Model number and firmware, once it has answered a ping.
    pub(super) identity: Option<(u16, u8)>,
    mode: Option<OperatingMode>,
    /// Its own limits of a position, steps.
    limits: (i32, i32),
    /// As it was last read.
    state: Option<Block>,
}

impl Servo {
    pub(super) const fn new(axis: ServoAxis) -> Self {
        Self { axis, identity: None, mode: None, limits: (-STEPS_MAX, STEPS_MAX), state: None }
    }

    pub(super) const fn id(&self) -> ServoId {
        self.axis.id
    }

    /// As messages call it.
    pub(super) fn words(&self) -> String {
        format!("{} ({})", self.axis.id, self.axis.axis)
    }

    /// Model and firmware in words.
    pub(super) fn model(&self) -> String {
        let Some((model, firmware)) = self.identity else { return "unknown".to_owned() };
        match model_name(model) {
            Some(name) => format!("{name} firmware {firmware}"),
            None => format!("model {model} firmware {firmware}"),
        }
    }

    pub(super) fn is_fast(&self) -> bool {
        self.identity.is_some_and(|(model, firmware)| has_fast_sync_read(model, firmware))
    }

    pub(super) fn forget(&mut self) {
        *self = Self::new(self.axis.clone());
    }

    /// Takes drive mode and operating mode.
    pub(super) fn set_modes(&mut self, block: &Block) -> Result<(), Wrong> {
        let mode = block.unsigned(OPERATING_MODE).and_then(|mode| u8::try_from(mode).ok());
        let mode = mode.map_or(OperatingMode::Unknown(u8::MAX), OperatingMode::read);
        if !matches!(mode, OperatingMode::Position | OperatingMode::ExtendedPosition) {
            return Err((
                format!("{}: operating mode {mode}", self.words()),
                "operating mode 3 (position) or 4 (extended position)".to_owned(),
                "set register 11 with the maker's tool while the torque is off".to_owned(),
            ));
        }
        if block.unsigned(DRIVE_MODE).unwrap_or(0) & TIME_BASED_PROFILE != 0 {
            return Err((
                format!("{}: profiles are set to times (drive mode, bit 2)", self.words()),
                "profiles of velocity and acceleration".to_owned(),
                "clear bit 2 of register 10 with the maker's tool while the torque is off"
                    .to_owned(),
            ));
        }
        self.mode = Some(mode);
        Ok(())
    }

    /// Takes its limits, in which what the rig file asks for must lie: a servo passes over what
    /// lies outside without a word.
    pub(super) fn set_limits(&mut self, block: &Block) -> Result<(), Wrong> {
        self.check_profile(block)?;
        if self.mode == Some(OperatingMode::Position) {
            let low = block.signed(MIN_POSITION_LIMIT).unwrap_or(0);
            let high = block.signed(MAX_POSITION_LIMIT).unwrap_or(STEPS_A_TURN - 1);
            self.limits = (low, high);
        }
        let (low, high) = self.axis.travel;
        if low >= self.limits.0 && high <= self.limits.1 {
            return Ok(());
        }
        Err((
            format!("{}: takes positions {} to {}", self.words(), self.limits.0, self.limits.1),
            format!("at least {low} to {high}, the axis's travel"),
            "correct travel and zero in the rig file, or registers 48 and 52".to_owned(),
        ))
    }

    fn check_profile(&self, block: &Block) -> Result<(), Wrong> {
        let velocity = velocity_units(self.axis.speed);
        let acceleration = acceleration_units(self.axis.acceleration);
        for (asked, register, unit, what, key) in [
            (velocity, VELOCITY_LIMIT, VELOCITY_STEPS_PER_S, "steps/s", "speed"),
            (
                acceleration,
                ACCELERATION_LIMIT,
                ACCELERATION_STEPS_PER_S2,
                "steps/s²",
                "acceleration",
            ),
        ] {
            let limit = block.unsigned(register).unwrap_or(0);
            if asked > limit {
                return Err((
                    format!(
                        "{}: its limit of {key} is {limit} ({} {what})",
                        self.words(),
                        whole_steps(limit, unit)
                    ),
                    format!(
                        "at least {asked} ({} {what}), as the rig file has it",
                        whole_steps(asked, unit)
                    ),
                    format!("lower the axis's {key}, or raise register {}", register.address),
                ));
            }
        }
        Ok(())
    }

    /// Takes how it is, for the first time; an error where it can't be driven so.
    pub(super) fn set_state(&mut self, block: Block) -> Result<(), Wrong> {
        let level = block.unsigned(STATUS_RETURN_LEVEL).unwrap_or(0);
        if level != 2 {
            return Err((
                format!("{}: status return level {level}", self.words()),
                "2: it answers to all that it is told".to_owned(),
                "set register 68 with the maker's tool".to_owned(),
            ));
        }
        self.take_state(block);
        Ok(())
    }

    /// Takes how it is.
    pub(super) fn take_state(&mut self, block: Block) {
        self.state = Some(block);
    }

    fn unsigned(&self, register: super::table::Register) -> u32 {
        self.state.as_ref().and_then(|state| state.unsigned(register)).unwrap_or(0)
    }

    fn signed(&self, register: super::table::Register) -> i32 {
        self.state.as_ref().and_then(|state| state.signed(register)).unwrap_or(0)
    }

    #[allow(clippy::cast_possible_truncation)] // a register of one byte
    pub(super) fn hardware_error(&self) -> HardwareError {
        HardwareError(self.unsigned(HARDWARE_ERROR) as u8)
    }

    pub(super) fn has_torque(&self) -> bool {
        self.unsigned(TORQUE_ENABLE) != 0
    }

    /// Whether its bus watchdog has struck: it reads -1.
    pub(super) fn watchdog_struck(&self) -> bool {
        self.unsigned(BUS_WATCHDOG) == 0xff
    }

    pub(super) fn position(&self) -> i32 {
        self.signed(PRESENT_POSITION)
    }

    #[allow(clippy::cast_possible_truncation)] // a register of two bytes
    pub(super) fn tick_ms(&self) -> u16 {
        self.unsigned(REALTIME_TICK) as u16
    }

    /// Whether it has taken all that a move needs.
    pub(super) fn has_taken(&self, goal: i32, watchdog: u8) -> bool {
        self.signed(GOAL_POSITION) == goal
            && self.unsigned(PROFILE_VELOCITY) == velocity_units(self.axis.speed)
            && self.unsigned(PROFILE_ACCELERATION) == acceleration_units(self.axis.acceleration)
            && self.unsigned(BUS_WATCHDOG) == u32::from(watchdog)
    }

    /// Whether it stands still, to one unit of its velocity.
    pub(super) fn stands(&self) -> bool {
        self.unsigned(MOVING) == 0 && self.signed(PRESENT_VELOCITY).unsigned_abs() <= 1
    }

    /// The goal at which it comes to rest when it brakes from here as hard as its profile says.
    #[allow(clippy::cast_possible_truncation)] // saturates, within its limits
    pub(super) fn braked(&self) -> i32 {
        let velocity = f64::from(self.signed(PRESENT_VELOCITY)) * VELOCITY_STEPS_PER_S;
        let units = f64::from(acceleration_units(self.axis.acceleration));
        let acceleration = units * ACCELERATION_STEPS_PER_S2;
        // What it does until the word arrives, and then the way in which it brakes.
        let way = velocity * LEAD_S + velocity * velocity.abs() / (2.0 * acceleration);
        let goal = (f64::from(self.position()) + way).round() as i32;
        goal.clamp(self.limits.0, self.limits.1)
    }

    /// Profile and goal as they stand in the table, one after the other.
    pub(super) fn motion(&self, goal: i32) -> Vec<u8> {
        let acceleration = acceleration_units(self.axis.acceleration).to_le_bytes();
        let velocity = velocity_units(self.axis.speed).to_le_bytes();
        [acceleration, velocity, goal.to_le_bytes()].concat()
    }

    /// How long its profile takes from where it stands to a goal.
    pub(super) fn duration(&self, goal: i32) -> Duration {
        let facts = self.facts();
        let distance = f64::from(goal.abs_diff(self.position()));
        let (speed, acceleration) =
            (f64::from(facts.speed.max(1)), f64::from(facts.acceleration.max(1)));
        let ramp = speed * speed / acceleration;
        Duration::from_secs_f64(if distance > ramp {
            distance / speed + speed / acceleration
        } else {
            2.0 * (distance / acceleration).sqrt()
        })
    }

    /// As it moves: its profile is a whole number of its own units.
    pub(super) fn facts(&self) -> AxisFacts {
        AxisFacts {
            low: self.limits.0,
            high: self.limits.1,
            speed: whole_steps(velocity_units(self.axis.speed), VELOCITY_STEPS_PER_S),
            acceleration: whole_steps(
                acceleration_units(self.axis.acceleration),
                ACCELERATION_STEPS_PER_S2,
            ),
            readback: Readback::Encoder,
        }
    }

    /// Whether it stands beyond its axis's travel by more than this.
    pub(super) fn is_outside(&self, tolerance: u32) -> bool {
        let ((low, high), slack) = (self.axis.travel, tolerance.cast_signed());
        !(low.saturating_sub(slack)..=high.saturating_add(slack)).contains(&self.position())
    }

    /// Whether the position that it reports is that of its axis whatever happened before: within
    /// one turn its encoder is absolute; beyond, it counts turns from zero at each power-up.
    pub(super) fn is_absolute(&self) -> bool {
        let (low, high) = self.axis.travel;
        self.mode == Some(OperatingMode::Position) || (low >= 0 && high < STEPS_A_TURN)
    }
}

/// A servo's clock: milliseconds that begin again after 32.768 s, brought on by the host's.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Ticks {
    last: Option<(Instant, f64)>,
}

/// After how many milliseconds a servo's clock begins again.
const TICKS_A_ROUND: f64 = 32_768.0;

impl Ticks {
    /// The servo's own time, seconds since some moment, of a tick that was read now: between two
    /// reads the host's clock says how often it began again.
    pub(super) fn read(&mut self, now: Instant, tick_ms: u16) -> f64 {
        let tick = f64::from(tick_ms);
        let time_ms = self.last.map_or(tick, |(then, time_ms)| {
            let guess = time_ms + now.since(then).as_secs_f64() * 1e3;
            tick + ((guess - tick) / TICKS_A_ROUND).round() * TICKS_A_ROUND
        });
        self.last = Some((now, time_ms));
        time_ms / 1e3
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_servo_s_clock_goes_on_when_it_begins_again() {
        let mut ticks = Ticks::default();
        let mut last = ticks.read(Instant::ZERO, 32_000);
        for s in 1..200_u64 {
            let now = Instant::from_micros(s * 1_000_000);
            let tick = u16::try_from((32_000 + s * 1001) % 32_768).unwrap();
            let time = ticks.read(now, tick);
            assert!((time - last - 1.001).abs() < 1e-9, "{s}: {last} to {time}");
            last = time;
        }
        // An hour without a question: the servo's clock is 0.1 % fast, and that is told apart.
        let tick = u16::try_from((32_000_u64 + 3_803_800) % 32_768).unwrap();
        let time = ticks.read(Instant::from_micros(3_800_000_000), tick);
        assert!((time - 3835.8).abs() < 1e-9, "{time}");
    }
}
