//! The control table of the X series: where registers stand, how long they are, what their
//! numbers mean. Source: the maker's e-manual (XM430-W210; the registers named here are the same
//! throughout the X series and MX with firmware for protocol 2.0). It knows no bus.

use std::fmt;

/// A register: its address and its length in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Register {
    pub(super) address: u16,
    pub(super) length: u16,
}

const fn register(address: u16, length: u16) -> Register {
    Register { address, length }
}

pub(super) const DRIVE_MODE: Register = register(10, 1);
pub(super) const OPERATING_MODE: Register = register(11, 1);
pub(super) const ACCELERATION_LIMIT: Register = register(40, 4);
pub(super) const VELOCITY_LIMIT: Register = register(44, 4);
pub(super) const MAX_POSITION_LIMIT: Register = register(48, 4);
pub(super) const MIN_POSITION_LIMIT: Register = register(52, 4);
pub(super) const TORQUE_ENABLE: Register = register(64, 1);
pub(super) const STATUS_RETURN_LEVEL: Register = register(68, 1);
pub(super) const HARDWARE_ERROR: Register = register(70, 1);
pub(super) const BUS_WATCHDOG: Register = register(98, 1);
pub(super) const PROFILE_ACCELERATION: Register = register(108, 4);
pub(super) const PROFILE_VELOCITY: Register = register(112, 4);
pub(super) const GOAL_POSITION: Register = register(116, 4);
pub(super) const REALTIME_TICK: Register = register(120, 2);
pub(super) const MOVING: Register = register(122, 1);
pub(super) const PRESENT_VELOCITY: Register = register(128, 4);
pub(super) const PRESENT_POSITION: Register = register(132, 4);

/// Bytes of a table from an address on, as they were read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Block {
    pub(super) address: u16,
    pub(super) bytes: Vec<u8>,
}

/// A stretch of the table that is read at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) address: u16,
    pub(super) length: u16,
}

impl Span {
    /// From the first register to the last one.
    const fn over(first: Register, last: Register) -> Self {
        Self { address: first.address, length: last.address + last.length - first.address }
    }
}

/// How it is set: mode and kind of profile.
pub(super) const MODES: Span = Span::over(DRIVE_MODE, OPERATING_MODE);
/// What it is limited to.
pub(super) const LIMITS: Span = Span::over(ACCELERATION_LIMIT, MIN_POSITION_LIMIT);
/// Everything about how it is: torque, errors, lease, profile, goal, clock, position.
pub(super) const STATE: Span = Span::over(TORQUE_ENABLE, PRESENT_POSITION);

impl Block {
    /// A register's value; `None` where the block does not hold it whole.
    pub(super) fn unsigned(&self, register: Register) -> Option<u32> {
        let from = usize::from(register.address.checked_sub(self.address)?);
        let bytes = self.bytes.get(from..from + usize::from(register.length))?;
        Some(bytes.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte)))
    }

    /// The same of a signed register of four bytes.
    pub(super) fn signed(&self, register: Register) -> Option<i32> {
        self.unsigned(register).map(u32::cast_signed)
    }
}

/// What a servo's motor follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum OperatingMode {
    /// Its current.
    Current,
    /// A position over many turns, within a current.
    CurrentBasedPosition,
    /// A position over many turns.
    ExtendedPosition,
    /// A position within one turn.
    Position,
    /// A voltage.
    Pwm,
    /// A speed.
    Velocity,
    /// A number that the table does not have.
    Unknown(u8),
}

impl OperatingMode {
    /// By the register's number.
    pub(super) const fn read(number: u8) -> Self {
        match number {
            0 => Self::Current,
            1 => Self::Velocity,
            3 => Self::Position,
            4 => Self::ExtendedPosition,
            5 => Self::CurrentBasedPosition,
            16 => Self::Pwm,
            other => Self::Unknown(other),
        }
    }
}

impl fmt::Display for OperatingMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Current => write!(f, "0 (current)"),
            Self::Velocity => write!(f, "1 (velocity)"),
            Self::Position => write!(f, "3 (position)"),
            Self::ExtendedPosition => write!(f, "4 (extended position)"),
            Self::CurrentBasedPosition => write!(f, "5 (current-based position)"),
            Self::Pwm => write!(f, "16 (PWM)"),
            Self::Unknown(number) => write!(f, "{number} (unknown)"),
        }
    }
}

/// Bit 2 of the drive mode: profiles are given as times instead of speeds.
pub(super) const TIME_BASED_PROFILE: u32 = 1 << 2;

/// What the hardware-error register holds: why a servo has let go of its torque.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct HardwareError(pub(super) u8);

impl HardwareError {
    const VOLTAGE: u8 = 1;
    const OVERHEATING: u8 = 1 << 2;
    const ENCODER: u8 = 1 << 3;
    const SHOCK: u8 = 1 << 4;
    const OVERLOAD: u8 = 1 << 5;

    /// Whether any is raised.
    pub(super) const fn is_raised(self) -> bool {
        self.0 != 0
    }

    /// Whether the position that it reports is worth nothing.
    pub(super) const fn is_of_encoder(self) -> bool {
        self.0 & Self::ENCODER != 0
    }
}

impl fmt::Display for HardwareError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = [
            (Self::VOLTAGE, "input voltage outside its limits"),
            (Self::OVERHEATING, "overheating"),
            (Self::ENCODER, "motor encoder"),
            (Self::SHOCK, "electrical shock"),
            (Self::OVERLOAD, "overload"),
        ];
        let raised = names.iter().filter(|(bit, _)| self.0 & bit != 0);
        let words: Vec<&str> = raised.map(|(_, name)| *name).collect();
        match words[..] {
            [] => write!(f, "hardware error {:#04x}", self.0),
            _ => write!(f, "{} (hardware error {:#04x})", words.join(", "), self.0),
        }
    }
}

/// What a model calls itself; `None` for a number that is not in this list of the X series and of
/// MX with firmware for protocol 2.0.
pub(super) const fn model_name(number: u16) -> Option<&'static str> {
    Some(match number {
        30 => "MX-28(2.0)",
        311 => "MX-64(2.0)",
        321 => "MX-106(2.0)",
        1000 => "XH430-W350",
        1010 => "XH430-W210",
        1020 => "XM430-W350",
        1030 => "XM430-W210",
        1040 => "XH430-V350",
        1050 => "XH430-V210",
        1060 => "XL430-W250",
        1070 => "XC430-W150",
        1080 => "XC430-W240",
        1090 => "2XL430-W250",
        1100 => "XH540-W270",
        1110 => "XH540-W150",
        1120 => "XM540-W270",
        1130 => "XM540-W150",
        1140 => "XH540-V270",
        1150 => "XH540-V150",
        1160 => "2XC430-W250",
        1170 => "XW540-T260",
        1180 => "XW540-T140",
        1190 => "XL330-M077",
        1200 => "XL330-M288",
        1210 => "XC330-T181",
        1220 => "XC330-T288",
        1230 => "XC330-M181",
        1240 => "XC330-M288",
        1270 => "XW430-T200",
        1280 => "XW430-T333",
        _ => return None,
    })
}

/// Fast sync read came to the 430 and 540 models with this firmware, to the 330 ones one later.
pub(super) const fn has_fast_sync_read(model: u16, firmware: u8) -> bool {
    let since = if matches!(model, 1190..=1240) { 46 } else { 45 };
    model >= 1000 && firmware >= since
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_are_read_where_they_stand() {
        let mut bytes = vec![0; usize::from(STATE.length)];
        bytes[34] = 0xff; // the watchdog has struck
        bytes[52..56].copy_from_slice(&(-2048_i32).to_le_bytes());
        bytes[56..58].copy_from_slice(&31_000_u16.to_le_bytes());
        bytes[68..72].copy_from_slice(&1_048_575_i32.to_le_bytes());
        let block = Block { address: STATE.address, bytes };
        assert_eq!(block.unsigned(BUS_WATCHDOG), Some(255));
        assert_eq!(block.signed(GOAL_POSITION), Some(-2048));
        assert_eq!(block.unsigned(REALTIME_TICK), Some(31_000));
        assert_eq!(block.signed(PRESENT_POSITION), Some(1_048_575));
        assert_eq!(block.unsigned(ACCELERATION_LIMIT), None, "before it");
        let cut = Block { bytes: block.bytes[..71].to_vec(), ..block };
        assert_eq!(cut.signed(PRESENT_POSITION), None, "not whole");
    }

    #[test]
    fn hardware_errors_are_named() {
        assert_eq!(HardwareError(0x20).to_string(), "overload (hardware error 0x20)");
        let both = HardwareError(0x24).to_string();
        assert_eq!(both, "overheating, overload (hardware error 0x24)");
        assert_eq!(HardwareError(0x40).to_string(), "hardware error 0x40");
        assert!(!HardwareError(0).is_raised() && HardwareError(8).is_of_encoder());
    }

    #[test]
    fn spans_are_as_long_as_they_must() {
        assert_eq!((MODES.address, MODES.length), (10, 2));
        assert_eq!((LIMITS.address, LIMITS.length), (40, 16));
        assert_eq!((STATE.address, STATE.length), (64, 72));
    }
}
