//! What the device core needs from the hardware under it. A microcontroller's board and the
//! simulated board implement this and nothing more.
//!
//! The core plans motion, keeps limits, queues, statistics and faults; the board moves what it is
//! told to move, and reads encoders and the converter. Calls come with a time that never goes
//! back. It is the time that the call is about: a core that is woken late catches up, moment by
//! moment.

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

/// What is integrated: handed to the board with a dwell, so that a simulated board can key its
/// noise by the dwell.
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
    /// The axes, in channel order; at most [`crate::AXES_MAX`]. They stay as they are at boot.
    fn axes(&self) -> &[AxisIdentity];
    /// How many gain ranges the detector has.
    fn gains(&self) -> u8;
    /// ADC resolution in bits (1 to 32), readings a second.
    fn adc(&self) -> (u8, u32);
    /// Drawn anew at every boot.
    fn boot_id(&self) -> u32;

    /// Whether the board can be called after the fact, with the moment that was meant. A
    /// simulated board can: it is then woken when something ends, not for every ADC reading and
    /// every millisecond of a move. Hardware can't, and is not asked to by default.
    fn answers_late(&self) -> bool {
        false
    }

    /// When the board wants to be asked for a fault, if it knows that beforehand: a simulated
    /// board schedules its faults so. Hardware wakes the core by an interrupt instead.
    fn wake_at(&self) -> Option<Instant> {
        None
    }

    /// The axis sets out, and comes to rest at the setpoint `towards` unless it is braked before.
    /// From here a board that knows its own faults beforehand can tell when to be asked.
    fn begin_motion(&mut self, now: Instant, channel: u8, towards: f64) {
        let _ = (now, channel, towards);
    }
    /// The axis has come to a constant speed, counts a second, signed, to which it accelerated
    /// evenly within `ramp`. It keeps it until its setpoint leaves that line.
    fn begin_cruise(
        &mut self,
        now: Instant,
        channel: u8,
        counts_per_s: f64,
        ramp: core::time::Duration,
    ) {
        let _ = (now, channel, counts_per_s, ramp);
    }
    /// Puts the axis's setpoint, in counts from its home mark (before homing: from where it
    /// stood at boot). Fractions matter to a simulated board; a stepper rounds them. Called at
    /// the end of every motion with its exact target, before anything is read while an axis
    /// moves, and, unless the board [answers late](Board::answers_late), every
    /// [`crate::SETPOINT_PERIOD`] in between.
    fn set_setpoint(&mut self, now: Instant, channel: u8, counts: f64);
    /// The encoder's position, counts; where there is no encoder, the setpoint, rounded.
    fn readback(&mut self, now: Instant, channel: u8) -> i32;

    /// The axis is about to move in search of its home mark: forget a mark passed earlier, and
    /// from now on latch it.
    fn begin_search(&mut self, now: Instant, channel: u8);
    /// The setpoint at which the home mark stands, once the axis has passed it or stood on it
    /// since [`Board::begin_search`]. A board that knows it without a search, as with an
    /// absolute encoder, answers at once, and the core goes there straight.
    fn home_mark(&mut self, now: Instant, channel: u8) -> Option<f64>;
    /// The axis stands still on its home mark: its setpoint is zero here from now on.
    fn set_home(&mut self, now: Instant, channel: u8);

    /// A dwell begins to settle: hardware whose shutter or amplifier takes time sets them now.
    fn prepare_dwell(&mut self, now: Instant, illumination: Illumination) {
        let _ = (now, illumination);
    }
    /// A dwell begins to integrate: gain and shutter are set.
    fn begin_dwell(&mut self, now: Instant, illumination: Illumination);
    /// A window of a sweep begins to integrate, and ends at `until`: gain and shutter are set. A
    /// board that need not know the end takes it as a dwell.
    fn begin_window(&mut self, now: Instant, until: Instant, illumination: Illumination) {
        let _ = until;
        self.begin_dwell(now, illumination);
    }
    /// One ADC reading over the interval that ends now, counts.
    fn convert(&mut self, now: Instant) -> Result<i32, BoardFault>;
    /// What the board noticed since it was last asked; one fault a call.
    fn fault(&mut self, now: Instant) -> Option<BoardFault>;
}
