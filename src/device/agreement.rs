//! Whether a device is the one that rig.toml describes, asked before anything moves.

use firmware_protocol::{AxisIdentity, Identity};

use crate::rig::{AxisName, Rig};

/// Speeds and accelerations may differ by this much: a file rounds, and plans stay truthful.
const RATE_TOLERANCE: f64 = 0.01;

/// The commands of one step: to its run-up point, to its pose, dwell. A device queues as many.
pub const QUEUE_DEPTH_MIN: usize = 3;

/// What the device says and rig.toml says otherwise. Correct the file, or plug in the other rig.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Disagreement {
    /// Another converter.
    #[error(
        "the device's converter has {found_bits} bits at {found_hz} Hz, rig.toml says {expected_bits} bits at {expected_hz} Hz"
    )]
    Adc {
        /// The device's.
        found_bits: u8,
        /// The device's.
        found_hz: u32,
        /// The file's.
        expected_bits: u8,
        /// The file's.
        expected_hz: u32,
    },
    /// Another number of axes: a move names the targets of all of them.
    #[error("the device has {found} axes, rig.toml has {expected}")]
    Axes {
        /// The device's.
        found: usize,
        /// The file's.
        expected: usize,
    },
    /// No such channel on the device.
    #[error("{}: channel {channel} in rig.toml, but the device has {count} axes", axis.name())]
    Channel {
        /// Whose.
        axis: AxisName,
        /// The file's.
        channel: u8,
        /// The device's.
        count: usize,
    },
    /// Other gain ranges.
    #[error("the device has {found} gain ranges, rig.toml lists {expected}")]
    Gains {
        /// The device's.
        found: u8,
        /// The file's.
        expected: usize,
    },
    /// Too short a queue to measure with.
    #[error("the device queues {found} commands, at least {expected} are needed")]
    Queue {
        /// The device's.
        found: u8,
        /// What a step takes.
        expected: usize,
    },
    /// Another speed or acceleration: predictions would be wrong.
    #[error("{}: the device's {what} is {found} counts, rig.toml's makes {expected:.0}", axis.name())]
    Rate {
        /// Whose.
        axis: AxisName,
        /// Speed or acceleration.
        what: &'static str,
        /// The device's.
        found: u32,
        /// The file's.
        expected: f64,
    },
    /// The file allows more than the device does.
    #[error("{}: rig.toml's travel makes counts {} to {}, the device allows {} to {}", axis.name(), expected.0, expected.1, found.0, found.1)]
    Travel {
        /// Whose.
        axis: AxisName,
        /// The device's.
        found: (i32, i32),
        /// The file's.
        expected: (i32, i32),
    },
}

/// Checks that the device has the axes, limits, gain ranges and converter that the file states.
pub fn check_agreement(identity: &Identity, rig: &Rig) -> Result<(), Disagreement> {
    for axis in &rig.axes {
        let device = identity.axes.get(usize::from(axis.channel)).ok_or(Disagreement::Channel {
            axis: axis.name,
            channel: axis.channel,
            count: identity.axes.len(),
        })?;
        check_axis(axis, *device)?;
    }
    if identity.axes.len() != rig.axes.len() {
        let (found, expected) = (identity.axes.len(), rig.axes.len());
        return Err(Disagreement::Axes { found, expected });
    }
    if usize::from(identity.queue_depth) < QUEUE_DEPTH_MIN {
        let (found, expected) = (identity.queue_depth, QUEUE_DEPTH_MIN);
        return Err(Disagreement::Queue { found, expected });
    }
    let detector = &rig.detector;
    if usize::from(identity.gains) != detector.gains.len() {
        let (found, expected) = (identity.gains, detector.gains.len());
        return Err(Disagreement::Gains { found, expected });
    }
    if (identity.adc_bits, identity.adc_rate_hz) != (detector.adc.bits, detector.adc.rate_hz) {
        return Err(Disagreement::Adc {
            found_bits: identity.adc_bits,
            found_hz: identity.adc_rate_hz,
            expected_bits: detector.adc.bits,
            expected_hz: detector.adc.rate_hz,
        });
    }
    Ok(())
}

fn check_axis(axis: &crate::rig::Axis, device: AxisIdentity) -> Result<(), Disagreement> {
    let expected = axis.count_limits();
    if expected.0 < device.low || expected.1 > device.high {
        let found = (device.low, device.high);
        return Err(Disagreement::Travel { axis: axis.name, found, expected });
    }
    if axis.fixed.is_some() {
        return Ok(());
    }
    let rates = [
        ("speed", device.speed, axis.speed * axis.counts_per_unit),
        ("acceleration", device.acceleration, axis.acceleration * axis.counts_per_unit),
    ];
    for (what, found, expected) in rates {
        // One count is what a whole number can be off by.
        if (f64::from(found) - expected).abs() > (RATE_TOLERANCE * expected).max(1.0) {
            return Err(Disagreement::Rate { axis: axis.name, what, found, expected });
        }
    }
    Ok(())
}
