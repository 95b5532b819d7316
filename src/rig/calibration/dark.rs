//! The dark level of each gain range, and how well it is known.

use std::collections::BTreeSet;

use super::CalibrationError;
use crate::rig::{Detector, ModelledVariance, Reading, Rig};

/// Dark readings scatter more than noise explains when chi2 exceeds its degrees of freedom by this
/// many of its standard deviations, sqrt(2 dof).
const SCATTER_SIGMA: f64 = 3.0;

/// The dark level of a gain range: the mean of the run's dark readings in it, each weighted by how
/// many ADC readings it averages.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dark {
    /// The range, an index into the detector's.
    pub gain: u8,
    /// Dark readings used: those that are not saturated.
    pub readings: usize,
    /// ADC readings that these average, all together.
    pub adc_readings: u32,
    /// The level, ampere.
    pub level_a: f64,
    /// Its standard uncertainty, in the detector's radiance unit; common to all samples of the
    /// range. By the noise model; where the readings scatter beyond it (the level wandered), by
    /// their scatter.
    pub u_radiance: f64,
}

/// The dark levels of the ranges in which something else was read, by range.
pub(super) fn levels(
    rig: &Rig,
    gains: &BTreeSet<u8>,
    dark: &[Reading],
) -> Result<Vec<Dark>, CalibrationError> {
    gains.iter().map(|gain| level(&rig.detector, *gain, dark)).collect()
}

/// What a reading's mean says of the radiance: dark level subtracted, negative where noise or a
/// drifting dark level made it so; and the variance that the model expects of it.
pub(super) fn radiance(rig: &Rig, darks: &[Dark], reading: &Reading) -> (f64, ModelledVariance) {
    let (detector, gain) = (&rig.detector, reading.gain);
    let dark_a = darks.iter().find(|dark| dark.gain == gain).map_or(0.0, |dark| dark.level_a);
    let current_a = reading.mean * detector.lsb_a(gain) - dark_a;
    let variance = detector.modelled_variance(gain, reading.n, dark_a);
    (current_a / detector.a_per_radiance(), variance)
}

fn level(detector: &Detector, gain: u8, dark: &[Reading]) -> Result<Dark, CalibrationError> {
    let is_used = |reading: &&Reading| reading.gain == gain && reading.saturated == 0;
    let mut used: Vec<&Reading> = dark.iter().filter(is_used).collect();
    // The same sum, to the last bit, in whatever order they came.
    used.sort_by_key(|reading| reading.id);
    let n: f64 = used.iter().map(|reading| f64::from(reading.n)).sum();
    if n <= 0.0 {
        let gain = detector.gains[usize::from(gain)].name.clone();
        return Err(CalibrationError::NoDark { gain });
    }
    let weighted = |f: &dyn Fn(&Reading) -> f64| -> f64 {
        used.iter().map(|reading| f64::from(reading.n) / n * f(reading)).sum()
    };
    let mean = weighted(&|reading| reading.mean);
    let level_a = mean * detector.lsb_a(gain);

    let radiance_per_count = detector.lsb_a(gain) / detector.a_per_radiance();
    let square = |reading: &Reading| ((reading.mean - mean) * radiance_per_count).powi(2);
    let model = |n: u32| detector.modelled_variance(gain, n, level_a).floor;
    let chi2: f64 = used.iter().map(|reading| square(reading) / model(reading.n)).sum();
    let dof = used.len() as f64 - 1.0;
    // One long dwell rather than a mean of many: where no noise dithers the converter, all dark
    // readings are rounded alike, and averaging them does not help.
    let n_all = used.iter().fold(0_u32, |n, reading| n.saturating_add(reading.n));
    let mut variance = model(n_all);
    if dof > 0.0 && chi2 > dof + SCATTER_SIGMA * libm::sqrt(2.0 * dof) {
        variance = variance.max(weighted(&square) / dof);
    }
    let u_radiance = libm::sqrt(variance);
    Ok(Dark { gain, readings: used.len(), adc_readings: n_all, level_a, u_radiance })
}
