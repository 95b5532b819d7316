//! What the rig is, and what it yields: axes and their limits, kinematics, the detector, raw
//! readings, and the calibration that turns them into samples with an uncertainty.
//!
//! This room reads no clock, does no I/O but for the text of rig.toml, and does not know whether
//! hardware exists.

mod pose;
mod reading;

pub use pose::{AXES, AxisName, AxisPositions, Pose};
pub use reading::{Latched, Reading, ReadingKind};
