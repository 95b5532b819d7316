//! The reference pose, measured again and again: what it says of drift.

use super::dark::{self, Dark};
use super::{Flag, Sample};
use crate::rig::{Reading, Rig};

/// Neighbouring reference readings that differ by more standard uncertainties than this drifted.
const DRIFT_U: f64 = 3.0;

/// A reading of the reference pose, in the unit of the detector's quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reference {
    /// The reading's id.
    pub id: u32,
    /// The session that took it.
    pub session: u32,
    /// Run time at which the integration began, seconds.
    pub time_s: f64,
    /// The integration, seconds, by the device's clock.
    pub dwell_s: f64,
    /// The radiance.
    pub value: f64,
    /// Standard uncertainty by what is independent from reading to reading.
    pub u_independent: f64,
}

impl Reference {
    /// Run time in the middle of the integration, seconds.
    pub fn middle_s(&self) -> f64 {
        self.time_s + 0.5 * self.dwell_s
    }
}

/// What the reference readings did during a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// How many there are.
    pub readings: usize,
    /// Their mean, each weighted by its variance.
    pub mean: f64,
    /// The largest less the smallest.
    pub spread: f64,
    /// The slope of a straight line through them, per second; 0 if all are of one moment.
    pub per_s: f64,
    /// Its standard uncertainty, by noise alone; infinite if all are of one moment.
    pub u_per_s: f64,
    /// Sum of squared deviations from the mean over their variances: about `readings` - 1 where
    /// noise explains them.
    pub chi2: f64,
}

impl Drift {
    /// Of two readings or more.
    pub(super) fn of(references: &[Reference]) -> Option<Self> {
        if references.len() < 2 {
            return None;
        }
        let weight = |reference: &Reference| 1.0 / reference.u_independent.powi(2);
        let sum = |f: &dyn Fn(&Reference) -> f64| -> f64 {
            references.iter().map(|reference| weight(reference) * f(reference)).sum()
        };
        let weights = sum(&|_| 1.0);
        let mean = sum(&|r| r.value) / weights;
        let mean_s = sum(&|r| r.time_s) / weights;
        let spread_s2 = sum(&|r| (r.time_s - mean_s).powi(2));
        let slope = sum(&|r| (r.time_s - mean_s) * (r.value - mean));
        let values = || references.iter().map(|r| r.value);
        Some(Self {
            readings: references.len(),
            mean,
            spread: values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min),
            per_s: if spread_s2 > 0.0 { slope / spread_s2 } else { 0.0 },
            u_per_s: 1.0 / libm::sqrt(spread_s2),
            chi2: sum(&|r| (r.value - mean).powi(2)),
        })
    }
}

pub(super) fn from_reading(rig: &Rig, darks: &[Dark], reading: &Reading) -> Reference {
    let (value, noise) = dark::radiance(rig, darks, reading);
    Reference {
        id: reading.id,
        session: reading.session,
        time_s: reading.time_s,
        dwell_s: (reading.end_us - reading.start_us) as f64 / 1e6,
        value,
        u_independent: libm::sqrt(noise.floor + noise.per_radiance * value.max(0.0)),
    }
}

/// Flags the samples between two neighbouring reference readings that differ by more than
/// [`DRIFT_U`] standard uncertainties of their difference. `references` are sorted by time.
/// Samples before the first or after the last have one neighbour, and are not flagged.
pub(super) fn flag_drift(references: &[Reference], samples: &mut [Sample]) {
    for sample in samples {
        let after = references.partition_point(|reference| reference.time_s <= sample.time_s);
        let (Some(before), Some(after)) =
            (after.checked_sub(1).and_then(|i| references.get(i)), references.get(after))
        else {
            continue;
        };
        let u = libm::hypot(before.u_independent, after.u_independent);
        sample.flags.set(Flag::Drift, (after.value - before.value).abs() > DRIFT_U * u);
    }
}
