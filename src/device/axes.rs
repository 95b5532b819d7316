//! What can be asked of a thing that moves axes, whatever it is and whatever it speaks.
//!
//! Positions are the device's own steps, counted from the device's own zero, one an axis, in the
//! order in which the rig file lists the driver's axes. A step is a count of rig.toml
//! (`counts_per_deg`, `counts_per_mm`), which says how many make a radian or a metre; where the
//! rig's zero lies among them the rig file says too (`zero_deg`, `zero_mm`), and whoever composes
//! the rig takes it off. One command at a time: whoever composes queues.

use firmware_protocol::{Instant, Shutter};

use super::driver::{Driver, Trouble};
use crate::rig::Readback;

/// A thing that moves axes.
pub trait Axes: Driver {
    /// Begins a command. At most one is open: until its event has come, or `Stopped`, or trouble.
    fn begin(&mut self, now: Instant, command: AxesCommand);
    /// Brakes all axes, and forgets the open command: its bytes go before any others that wait.
    /// [`AxesEvent::Stopped`] is the answer, once they stand. Counts are not lost by it. Where
    /// nothing moves it is answered too.
    fn stop(&mut self, now: Instant);
    /// What it says, in order.
    fn poll_event(&mut self) -> Option<AxesEvent>;
}

/// What a thing that moves axes is told.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AxesCommand {
    /// Find the home marks of all axes of this driver. [`AxesEvent::Done`] is the answer. Leaves
    /// a fault that homing mends.
    Home,
    /// Go to these absolute positions, all axes together. [`AxesEvent::Done`] is the answer, once
    /// they stand there and were read back there; never before.
    MoveTo(Vec<i32>),
    /// Say where the axes are, now. [`AxesEvent::Located`] is the answer.
    Locate,
    /// Put the shutter: only where [`AxesFacts::has_shutter`]. [`AxesEvent::ShutterIs`] is the
    /// answer, once it is in place as far as the device can tell.
    PutShutter(Shutter),
    /// Leave a fault, without moving. [`AxesEvent::Cleared`] is the answer, or the fault again.
    Clear,
}

/// What it says.
#[derive(Debug, Clone, PartialEq)]
pub enum AxesEvent {
    /// The answer to [`Driver::open`].
    Ready(AxesFacts),
    /// A home or a move is done: the axes stand, and here they are.
    Done(Located),
    /// The answer to `Locate`.
    Located(Located),
    /// The shutter is in place.
    ShutterIs(Shutter),
    /// The axes stand after [`Axes::stop`]; `None` where they could not be located any more.
    Stopped(Option<Located>),
    /// The fault is left.
    Cleared,
    /// Something is wrong. The open command is over.
    Trouble(Trouble),
}

/// Where the axes are.
#[derive(Debug, Clone, PartialEq)]
pub struct Located {
    /// Steps from the device's zero.
    pub steps: Vec<i32>,
    /// The device's own time of it, seconds, where it has a clock.
    pub device_time_s: Option<f64>,
}

/// Who moves the axes, asked at [`Driver::open`].
#[derive(Debug, Clone, PartialEq)]
pub struct AxesFacts {
    /// As it calls itself: "grbl 1.1h".
    pub identity: String,
    /// One an axis.
    pub axes: Vec<AxisFacts>,
    /// Whether the positions that it reports still count from the home marks: it was homed, and
    /// says so. Where it can't tell, it is not.
    pub is_homed: bool,
    /// Whether the axes of one move start and arrive together.
    pub is_synchronous: bool,
    /// Whether it can close a shutter.
    pub has_shutter: bool,
    /// What it stands still for already.
    pub fault: Option<super::driver::NamedFault>,
}

/// An axis as its device knows it, in steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AxisFacts {
    /// Lowest position that it goes to; `i32::MIN` where it has no limit of its own.
    pub low: i32,
    /// Highest position that it goes to; `i32::MAX` where it has no limit of its own.
    pub high: i32,
    /// Highest speed, steps a second.
    pub speed: u32,
    /// Acceleration, steps a second squared.
    pub acceleration: u32,
    /// Where the positions that it reports come from.
    pub readback: Readback,
}
