//! From readings to samples, a part of them at a time: by the dark and reference readings of all of them,
//! which a first look keeps. Knows no journal, and not what samples share.

use std::collections::BTreeSet;

use super::dark::{self, Dark};
use super::reference::{self, Reference};
use super::{Calibrated, CalibrationError, Sample, sample};
use crate::rig::{Reading, ReadingKind, Rig};

/// What has to be known of all readings before any of them is a sample.
#[derive(Debug, Clone, Default)]
pub struct FirstLook {
    dark: Vec<Reading>,
    reference: Vec<Reading>,
    /// Ranges in which something else than dark was read.
    gains: BTreeSet<u8>,
}

/// How a run's readings become samples.
#[derive(Debug, Clone)]
pub struct Calibration<'r> {
    pub(super) rig: &'r Rig,
    /// The dark level of every gain range that was used.
    pub darks: Vec<Dark>,
    /// The reference pose's readings, by time.
    pub references: Vec<Reference>,
}

impl FirstLook {
    /// Takes a reading in, of any kind, in any order; or says what is wrong with it.
    pub fn take(&mut self, rig: &Rig, reading: &Reading) -> Result<(), CalibrationError> {
        check(rig, reading)?;
        match reading.kind {
            ReadingKind::Dark => self.dark.push(reading.clone()),
            ReadingKind::Reference => self.reference.push(reading.clone()),
            _ => {}
        }
        if reading.kind != ReadingKind::Dark {
            self.gains.insert(reading.gain);
        }
        Ok(())
    }

    /// After the last one.
    pub fn calibration(self, rig: &Rig) -> Result<Calibration<'_>, CalibrationError> {
        let darks = dark::levels(rig, &self.gains, &self.dark)?;
        let reference = self.reference.iter();
        let mut references: Vec<Reference> =
            reference.map(|reading| reference::from_reading(rig, &darks, reading)).collect();
        references.sort_by(|a, b| a.time_s.total_cmp(&b.time_s).then(a.id.cmp(&b.id)));
        Ok(Calibration { rig, darks, references })
    }
}

impl Calibrated {
    /// How these samples came about, for more of the same run's readings.
    pub fn calibration<'r>(&self, rig: &'r Rig) -> Calibration<'r> {
        Calibration { rig, darks: self.darks.clone(), references: self.references.clone() }
    }
}

impl Calibration<'_> {
    /// The samples of those readings that are targets', in their order.
    pub fn samples(&self, readings: &[Reading]) -> Vec<Sample> {
        let mut samples: Vec<Sample> = readings
            .iter()
            .filter_map(|reading| sample::from_reading(self.rig, &self.darks, reading))
            .collect();
        reference::flag_drift(&self.references, &mut samples);
        samples
    }
}

fn check(rig: &Rig, reading: &Reading) -> Result<(), CalibrationError> {
    let (id, gain, count) = (reading.id, reading.gain, rig.detector.gains.len());
    if usize::from(gain) >= count {
        return Err(CalibrationError::NoSuchGain { id, gain, count });
    }
    if reading.n == 0 {
        return Err(CalibrationError::Empty { id });
    }
    if !reading.mean.is_finite() {
        return Err(CalibrationError::NotFinite { id, mean: reading.mean });
    }
    Ok(())
}
