//! Raw readings to samples: counts to current to radiance, at the pose that was measured, with an
//! uncertainty whose parts are kept apart.
//!
//! What is independent from sample to sample (shot noise, read noise, quantisation) comes from the
//! detector's model at a level, never from a reading's own scatter. What is common to many samples
//! (responsivity, gain, throughput, dark level, axis zeros) is listed as [`Component`]s for whoever
//! averages over samples, because averaging does not reduce it.
//!
//! The uncertainty of a sample is that of the radiance along the pose it states. How far that pose
//! may be off is a component (or the axis's readback) of its own: what it does to a value depends
//! on how the radiance changes around it, which only a fit knows.
//!
//! It depends on the set of readings, not on their order, so that a resumed run gives the same
//! samples. It corrects for no drift; it reports and flags it.

#[cfg(test)]
mod block_tests;
mod budget;
mod calibrating;
mod component;
mod dark;
mod drift;
mod fit_input;
mod fitting;
#[cfg(test)]
mod fitting_tests;
mod readback;
mod reference;
mod sample;
mod spread;
#[cfg(test)]
mod tests;

pub use budget::{IndependentParts, IndependentSums};
pub use calibrating::{Calibration, FirstLook};
pub use component::{Component, Effect};
pub use dark::Dark;
pub use drift::FittedDrift;
pub use fit_input::{FitInput, Handing};
pub use fitting::Fitted;
pub use reference::{Drift, Reference};
pub use sample::{Flag, Flags, Part, Sample};
pub use spread::Spread;

use radiometry::direction;

use super::{AxisPositions, Latched, Pose, Readback, Reading, Rig, forward};

/// What a run's readings amount to.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibrated {
    /// One a target's reading, by target and repeat.
    pub samples: Vec<Sample>,
    /// What all samples, or all of one gain range or session, share. None has u = 0.
    pub components: Vec<Component>,
    /// The reference pose's readings, by time.
    pub references: Vec<Reference>,
    /// The dark level of every gain range that was used.
    pub darks: Vec<Dark>,
}

/// Why readings can't be turned into samples.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// The run has no usable dark reading in this range: they are taken at its start, at its end
    /// and as often as `every` in the plan's `[dark]` says, unless it was interrupted before.
    #[error(
        "gain range \"{gain}\": no dark reading that is not saturated; expected at least one \
         (add [dark] with `every` and `dwell_ms` to the plan, and see that the shutter closes)"
    )]
    NoDark {
        /// The range's name.
        gain: String,
    },
    /// The readings are another rig's.
    #[error("reading {id}: gain range {gain}, but the rig has {count} of them")]
    NoSuchGain {
        /// The reading.
        id: u32,
        /// Its range.
        gain: u8,
        /// How many ranges the rig has.
        count: usize,
    },
    /// A dwell in which the ADC was not read: a defect of the device.
    #[error("reading {id}: 0 ADC readings; expected at least 1")]
    Empty {
        /// The reading.
        id: u32,
    },
    /// A mean that is no number: a defect of the device.
    #[error("reading {id}: its mean is {mean} counts; expected a finite number")]
    NotFinite {
        /// The reading.
        id: u32,
        /// The mean.
        mean: f64,
    },
}

/// Turns a run's readings, all kinds in any order, into samples.
pub fn calibrate(rig: &Rig, readings: &[Reading]) -> Result<Calibrated, CalibrationError> {
    let mut look = FirstLook::default();
    readings.iter().try_for_each(|reading| look.take(rig, reading))?;
    let calibration = look.calibration(rig)?;
    let mut samples = calibration.samples(readings);
    samples.sort_by_key(|sample| (sample.index, sample.repeat, sample.reading));
    let components = component::of(rig, &calibration.darks, &Spread::of(&samples));
    let Calibration { references, darks, .. } = calibration;
    Ok(Calibrated { samples, components, references, darks })
}

impl Calibrated {
    /// States every sample's uncertainty at its fitted level instead of at its own value, which
    /// carries its noise. `level` answers by the sample's place in [`Calibrated::samples`].
    pub fn restate(&mut self, mut level: impl FnMut(usize, &Sample) -> f64) {
        for (i, sample) in self.samples.iter_mut().enumerate() {
            let level = level(i, sample);
            sample.state_at(level);
        }
    }

    /// What the reference pose did during the run; `None` with fewer than two readings of it.
    pub fn drift(&self) -> Option<Drift> {
        Drift::of(&self.references)
    }
}

impl Rig {
    /// Where the axes stood during a reading, and the ray that they looked along: the mean of the
    /// positions latched at its start and at its end, directions averaged as vectors. An axis
    /// without a readback stood where it was sent.
    pub fn measured(&self, reading: &Reading) -> (AxisPositions, Pose) {
        let (start, end) = self.ends(reading);
        if start == end {
            // Exactly, and with the azimuth that the turntable has, at the zenith too.
            let positions = self.positions(start);
            return (positions, forward(positions));
        }
        (self.mean_positions(start, end), self.mean_pose(start, end))
    }

    /// The rays at the beginning and the end of a reading that was taken in flight.
    pub fn way(&self, reading: &Reading) -> Option<(Pose, Pose)> {
        if reading.travel == Latched::ZERO {
            return None;
        }
        let (start, end) = self.ends(reading);
        Some((forward(self.positions(start)), forward(self.positions(end))))
    }

    /// Where the axes stood at the beginning and at the end. One without a readback stood where it
    /// was sent.
    fn ends(&self, reading: &Reading) -> (Latched, Latched) {
        let (mut start, mut end) = (reading.start, reading.end);
        for (i, axis) in self.axes.iter().enumerate() {
            if axis.readback == Readback::None {
                start.0[i] = reading.commanded.0[i];
                end.0[i] = reading.commanded.0[i].saturating_add(reading.travel.0[i]);
            }
        }
        (start, end)
    }

    fn mean_positions(&self, start: Latched, end: Latched) -> AxisPositions {
        let (AxisPositions(mut mean), AxisPositions(end)) =
            (self.positions(start), self.positions(end));
        for (mean, end) in mean.iter_mut().zip(end) {
            *mean = 0.5 * (*mean + end);
        }
        AxisPositions(mean)
    }

    fn mean_pose(&self, start: Latched, end: Latched) -> Pose {
        let poses = [start, end].map(|latched| forward(self.positions(latched)));
        let directions = poses.map(|pose| direction::unit(pose.theta_rad, pose.phi_rad));
        // Opposite directions have no mean; no dwell goes half a turn, and the start stands.
        let mean = direction::mean(directions).unwrap_or(directions[0]);
        let (theta_rad, phi_rad) = direction::angles(mean);
        Pose {
            x_m: 0.5 * (poses[0].x_m + poses[1].x_m),
            y_m: 0.5 * (poses[0].y_m + poses[1].y_m),
            theta_rad,
            phi_rad,
        }
    }
}
