//! What the device core needs from the hardware under it. A microcontroller's board and the
//! simulated board implement this and nothing more.
//!
//! The core plans motion, keeps limits, queues, statistics and faults; the board moves what it is
//! told to move, and reads encoders and the converter. Calls come with a time that never goes
//! back.

use crate::{AxisIdentity, Instant, Shutter};

/// A fault that the board itself notices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BoardFault {
    /// A limit switch opened on this channel.
    LimitSwitch(u8),
    /// This channel does not follow its setpoint.
    Stalled(u8),
    /// The detector's converter does not answer.
    Detector,
}

/// What is integrated: handed to the board at the start of a dwell, so that a simulated board
/// can key its noise by the dwell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Illumination {
    /// The host's name for the reading, [`crate::Dwell::reading`].
    pub reading: u32,
    /// The gain range.
    pub gain: u8,
    /// Whether the sample is seen.
    pub shutter: Shutter,
}

/// The hardware under the device core.
pub trait Board {
    /// The axes, in channel order; at most [`crate::AXES_MAX`].
    fn axes(&self) -> &[AxisIdentity];
    /// How many gain ranges the detector has.
    fn gains(&self) -> u8;
    /// ADC resolution in bits, readings a second.
    fn adc(&self) -> (u8, u32);
    /// Drawn anew at every boot.
    fn boot_id(&self) -> u32;

    /// Puts the axis's setpoint, in counts from its home mark (before homing: from where it
    /// stood at boot). Fractions matter to a simulated board; a stepper rounds them.
    fn set_setpoint(&mut self, now: Instant, channel: u8, counts: f64);
    /// The encoder's position, counts; where there is no encoder, the setpoint, rounded.
    fn readback(&mut self, now: Instant, channel: u8) -> i32;
    /// How far the home mark is from here, in counts, if the board can tell while it looks for
    /// it: the core moves there. `None` before the mark has been found within the travel.
    fn home_mark(&mut self, now: Instant, channel: u8) -> Option<i32>;
    /// The axis stands on its home mark: count from here.
    fn set_home(&mut self, now: Instant, channel: u8);

    /// A dwell begins: gain and shutter are set.
    fn begin_dwell(&mut self, now: Instant, illumination: Illumination);
    /// One ADC reading over the interval that ends now, counts.
    fn convert(&mut self, now: Instant) -> Result<i32, BoardFault>;
    /// What the board noticed since it was last asked.
    fn fault(&mut self, now: Instant) -> Option<BoardFault>;
}
