//! How well the dark level is known, and how much longer it has to be read for what is asked. All
//! readings share it: no sweep makes it better known.
//!
//! What a longer reading brings is the noise model's word alone.

use std::time::Duration;

use super::Terms;
use crate::rig::calibration::{Calibrated, Dark};

/// A dark reading is no longer than this; where more is wanted another follows.
const DWELL_MAX: Duration = Duration::from_mins(2);
/// A variance that is larger by this factor than the model's is no noise that a longer reading lessens.
const IS_SCATTER: f64 = 1.000_001;
/// What is aimed at lies this far below what is allowed, so that one reading does.
const AIM: f64 = 0.95;
/// Only where all else is below this part of a target is the dark level what is missing.
const REST_MAX: f64 = 0.9;

/// A target, and what of it is found, all relative to a level of radiance.
pub(super) struct Part {
    pub(super) asked: f64,
    /// What is left without the dark level's part.
    pub(super) rest: f64,
    /// The mean radiance that an offset counts against.
    pub(super) level: f64,
}

/// The level of the range that all sweeps are read in: whose u is the largest, were there several.
pub(super) fn known(calibrated: &Calibrated) -> Option<&Dark> {
    calibrated.darks.iter().max_by(|a, b| a.u_radiance.total_cmp(&b.u_radiance))
}

/// How long to read the dark level so that all parts keep to their targets, where it is all that they
/// lack; `None` where it lacks nothing, or not that alone, or a longer reading would not do.
pub(super) fn wanted(terms: &Terms, calibrated: &Calibrated, parts: &[Part]) -> Option<Duration> {
    let dark = known(calibrated)?;
    let is_met = |part: &Part| libm::hypot(part.rest, dark.u_radiance / part.level) <= part.asked;
    let missed = || parts.iter().filter(|part| !is_met(part));
    if missed().next().is_none() || missed().any(|part| part.rest > REST_MAX * part.asked) {
        return None;
    }
    let allowed =
        |part: &Part| part.level * libm::sqrt(part.asked * part.asked - part.rest * part.rest);
    dwell_to(terms, dark, AIM * missed().map(allowed).fold(f64::INFINITY, f64::min))
}

/// Whether a longer reading makes it better known: what is left is noise.
pub(super) fn is_noise(terms: &Terms, dark: &Dark) -> bool {
    dark.u_radiance * dark.u_radiance <= IS_SCATTER * variance(terms, dark, dark.adc_readings)
}

fn variance(terms: &Terms, dark: &Dark, adc_readings: u32) -> f64 {
    terms.rig.detector.modelled_variance(dark.gain, adc_readings, dark.level_a).floor
}

fn dwell_to(terms: &Terms, dark: &Dark, u_radiance: f64) -> Option<Duration> {
    if !is_noise(terms, dark) {
        return None;
    }
    let asked = u_radiance * u_radiance;
    let had = f64::from(dark.adc_readings);
    let all = libm::ceil(had * variance(terms, dark, dark.adc_readings) / asked);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    let reaches = variance(terms, dark, all as u32) <= asked * IS_SCATTER;
    let seconds = (all - had).max(0.0) / f64::from(terms.rig.detector.adc.rate_hz);
    let dwell = Duration::try_from_secs_f64(seconds).unwrap_or(DWELL_MAX);
    reaches.then(|| dwell.clamp(terms.plan.dark.dwell, DWELL_MAX.max(terms.plan.dark.dwell)))
}
