//! What the rig is, and what it yields: axes and their limits, kinematics, the detector, raw
//! readings, and the calibration that turns them into samples with an uncertainty.
//!
//! This room reads no clock, does no I/O but for the text of rig.toml, and does not know whether
//! hardware exists.

mod alignment;
mod axis;
pub mod calibration;
mod detector;
mod devices;
mod file;
#[cfg(test)]
mod file_tests;
mod kinematics;
mod link;
mod meters;
mod motion;
mod pose;
mod reading;
mod waits;

pub use alignment::{Alignment, Misalignment};
pub use axis::{Approach, Axis, LimitError, Readback};
pub use detector::{Adc, Detector, Gain, ModelledVariance, Quantity};
pub use devices::{AxesDriver, AxesLink, Devices, GrblOutput, PhotometerLink, Port, ShutterServo};
pub use kinematics::{Route, forward, solutions};
pub use link::Link;
pub use meters::{
    Filter, Measures, Newport1830, PhotometerDriver, Picoammeter, PowerMeter, ScpiTable,
};
pub use motion::{Flight, comes_to_rest, set_out};
pub use pose::{AXES, AxisName, AxisPositions, Pose};
pub use reading::{DeviceTimes, Latched, Reading, ReadingKind};
pub use waits::{SERVO_LOOK_AGAIN, SHUTTER_ACCELERATION, SHUTTER_SPEED};

use spanned_toml::Document;

/// A rig as its file describes it.
#[derive(Debug, Clone)]
pub struct Rig {
    /// Its name.
    pub name: String,
    /// Its axes, in the order of [`AXES`].
    pub axes: [Axis; 4],
    /// How well it is known that its axes stand to each other as drawn.
    pub alignment: Alignment,
    /// Its detector.
    pub detector: Detector,
    /// How it is reached.
    pub link: Link,
    /// What it is put together of; `None` where a controller of gonio's own drives all of it.
    pub devices: Option<Devices>,
    document: Document,
}

impl Rig {
    /// The file that it was read from. Its table `[simulated]` is left unread here, for whoever
    /// simulates the rig.
    pub fn document(&self) -> &Document {
        &self.document
    }

    /// Whether it is a simulated rig: then so is everything that it measures.
    pub fn is_simulated(&self) -> bool {
        matches!(self.link, Link::Simulated { .. })
    }

    /// Its simulated twin: the same axes and detector on a simulated link, and simulated devices where it is put
    /// together of them.
    #[must_use]
    pub fn twin(&self) -> Self {
        Self { link: Link::Simulated { baud: self.link.baud() }, ..self.clone() }
    }

    /// Whether what a plan would take in flight is taken at rest: a meter of another make does not
    /// integrate while axes pass.
    pub fn takes_sweeps_at_rest(&self) -> bool {
        self.devices.is_some()
    }

    /// Whether a shutter can be closed before the detector. A controller of gonio's own has one; of
    /// other devices the file says which.
    pub fn has_shutter(&self) -> bool {
        let holds = |link: &AxesLink| match &link.driver {
            AxesDriver::Dynamixel { shutter, .. } => shutter.is_some(),
            AxesDriver::Grbl { shutter, .. } => shutter.is_some(),
        };
        self.devices.as_ref().is_none_or(|devices| devices.axes.iter().any(holds))
    }
}
