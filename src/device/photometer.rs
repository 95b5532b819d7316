//! What can be asked of a meter that reads the detector, whatever it is and whatever it speaks.
//!
//! Values come in the unit that the rig file states for the meter. It does not know what is
//! looked at, nor what moves.

use std::time::Duration;

use firmware_protocol::Instant;

use super::driver::{Driver, Trouble};

/// A meter.
pub trait Photometer: Driver {
    /// Begins a command. At most one is open: until its event has come, or trouble.
    fn begin(&mut self, now: Instant, command: PhotometerCommand);
    /// Forgets the open command; the meter is ready for another. No event answers it.
    fn abandon(&mut self, now: Instant);
    /// What it says, in order.
    fn poll_event(&mut self) -> Option<PhotometerEvent>;
}

/// What a meter is told.
#[derive(Debug, Clone, PartialEq)]
pub enum PhotometerCommand {
    /// Measure its own offset and take it off from now on. [`PhotometerEvent::Zeroed`] is the
    /// answer. Asked for once after `Ready`, before the first exposure, with the shutter closed
    /// where there is one; a meter that has no zero answers at once.
    Zero,
    /// Set range and averaging, where they are not set so already, and read.
    /// [`PhotometerEvent::Exposed`] is the answer.
    Expose(Exposure),
}

/// One integration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exposure {
    /// The range, an index into the ranges that the rig file lists (`[[detector.gain]]`), which
    /// the driver was made with. Never "auto": a reading's uncertainty is its range's.
    pub range: u8,
    /// How long.
    pub duration: Duration,
    /// How many readings of the meter that is, by the rate that the rig file states
    /// (`[detector.adc] rate_hz`): at least one.
    pub readings: u32,
}

/// What it says.
#[derive(Debug, Clone, PartialEq)]
pub enum PhotometerEvent {
    /// The answer to [`Driver::open`]. The meter's unit and ranges were compared with the rig
    /// file's by then.
    Ready(PhotometerFacts),
    /// Its zero is taken off.
    Zeroed,
    /// The answer to an exposure.
    Exposed(Exposed),
    /// Something is wrong. The open command is over.
    Trouble(Trouble),
}

/// Who reads the detector, asked at [`Driver::open`].
#[derive(Debug, Clone, PartialEq)]
pub struct PhotometerFacts {
    /// As it calls itself.
    pub identity: String,
}

/// What an exposure gave.
#[derive(Debug, Clone, PartialEq)]
pub struct Exposed {
    /// The range that it was taken in: as asked for.
    pub range: u8,
    /// How many readings of the meter the mean is of: one where it averages itself.
    pub readings: u32,
    /// Their mean, in the meter's unit. Where readings were saturated and have no value, the
    /// range's full scale stands for each of them, with its sign.
    pub mean: f64,
    /// Their variance (n - 1), in the unit squared; zero where the meter averages itself.
    pub variance: f64,
    /// The smallest.
    pub min: f64,
    /// The largest.
    pub max: f64,
    /// How many were saturated. A saturated reading is never a number of its own.
    pub saturated: u32,
    /// When the integration began, by the host's clock, as nearly as the driver knows.
    pub began: Instant,
    /// When it ended.
    pub ended: Instant,
    /// The meter's own time of it, seconds, where it has a clock.
    pub device_time_s: Option<f64>,
}
