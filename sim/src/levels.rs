//! What readings there will be: how bright, how long, how noisy at least. Effects state their
//! influence relative to them. It does not know the scene that they come from.

use crate::Emitter;
use crate::compile::Setting;

/// The readings of a region. Signals are the light's current in the axis's stead, without what
/// the effects make of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Levels {
    /// The smallest signal of the region, or less, amperes.
    lowest_a: f64,
    /// The largest, or more.
    highest_a: f64,
    /// The noise floor: below it readings are noise.
    floor_a: f64,
    rate_hz: u32,
    dwell_s: f64,
    /// How long the run takes: what drifts has so long to do it.
    run_s: f64,
}

/// How much smaller than the smallest radiance among a field's landmarks one between them may be.
const BETWEEN_LANDMARKS: f64 = 0.5;

impl Levels {
    /// Of the region that effects are weighed in.
    pub(crate) fn of(setting: &Setting<'_>) -> Self {
        let landmarks = setting.field.landmarks(&setting.region);
        let radiances = landmarks.iter().map(|ray| setting.field.radiance(ray));
        let dimmest = if has_gap(setting) {
            0.0
        } else {
            radiances.fold(setting.brightest, f64::min) * BETWEEN_LANDMARKS
        };
        Self {
            lowest_a: dimmest * setting.current_per_radiance,
            highest_a: setting.brightest_a(),
            floor_a: setting.floor * setting.current_per_radiance,
            rate_hz: setting.nominal.detector.adc_rate_hz,
            dwell_s: setting.terms.dwell_s,
            run_s: setting.terms.run_s,
        }
    }

    #[cfg(test)]
    pub(crate) const fn new(
        (lowest_a, highest_a): (f64, f64),
        floor_a: f64,
        rate_hz: u32,
        (dwell_s, run_s): (f64, f64),
    ) -> Self {
        Self { lowest_a, highest_a, floor_a, rate_hz, dwell_s, run_s }
    }

    /// Influence of a current that is added, amperes; it may be negative. It is the largest where
    /// the larger of the two readings, with and without it, is smallest.
    pub(crate) fn additive(&self, current_a: f64) -> f64 {
        let signal_a = (-current_a / 2.0).clamp(self.lowest_a, self.highest_a.max(self.lowest_a));
        let larger_a = signal_a.max((signal_a + current_a).abs());
        current_a.abs() / larger_a.max(self.floor_a)
    }

    /// Influence of noise of this standard deviation, amperes, whatever the signal.
    pub(crate) fn noise(&self, sigma_a: f64) -> f64 {
        sigma_a / self.lowest_a.max(self.floor_a)
    }

    /// Influence of a change that is a part of the signal.
    pub(crate) fn proportional(&self, part: f64) -> f64 {
        part.abs() * self.highest_a / self.highest_a.max(self.floor_a)
    }

    /// Influence of a change that grows with the signal as its square root does: it is the
    /// largest where the signal is the floor, or as near to that as the region has it.
    pub(crate) fn of_root(&self, change_a: impl Fn(f64) -> f64) -> f64 {
        let signal_a = self.floor_a.clamp(self.lowest_a, self.highest_a.max(self.lowest_a));
        change_a(signal_a) / signal_a.max(self.floor_a)
    }

    /// The smallest signal, amperes.
    pub(crate) const fn lowest_a(&self) -> f64 {
        self.lowest_a
    }

    /// The largest signal, amperes.
    pub(crate) const fn highest_a(&self) -> f64 {
        self.highest_a
    }

    /// ADC readings a second.
    pub(crate) const fn rate_hz(&self) -> u32 {
        self.rate_hz
    }

    /// The time of one ADC reading.
    pub(crate) fn reading_s(&self) -> f64 {
        1.0 / f64::from(self.rate_hz)
    }

    /// ADC readings of a dwell, at least one.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    pub(crate) fn readings(&self) -> u32 {
        // As the device counts them: whole microseconds, whole readings.
        let us = libm::round(self.dwell_s * 1e6) as u64;
        u32::try_from(us * u64::from(self.rate_hz) / 1_000_000).unwrap_or(u32::MAX).max(1)
    }

    /// How long a dwell integrates: its whole ADC readings.
    pub(crate) fn dwell_s(&self) -> f64 {
        f64::from(self.readings()) / f64::from(self.rate_hz)
    }

    /// How long the run takes.
    pub(crate) const fn run_s(&self) -> f64 {
        self.run_s
    }

    /// A region of one brightness, far above any noise.
    #[cfg(test)]
    pub(crate) const fn bright(signal_a: f64, rate_hz: u32, dwell_s: f64) -> Self {
        Self::new((signal_a, signal_a), signal_a * 1e-6, rate_hz, (dwell_s, 3600.0))
    }
}

/// Whether the region has a place that no emitter covers: landmarks may all miss it. Emitters do
/// not overlap; what else the scene has may cover it, and is left to the landmarks.
fn has_gap(setting: &Setting<'_>) -> bool {
    let (scene, region) = (setting.scene, &setting.region);
    let shapes: Option<Vec<_>> = scene.emitters().iter().map(Emitter::shape).collect();
    let Some(shapes) = shapes.filter(|_| scene.surfaces().is_empty()) else { return false };
    let within = shapes.iter().map(|shape| shape.area_within_m2(region.x_m, region.y_m));
    let covered: f64 = within.sum();
    covered < region.area_m2() * (1.0 - ROUNDING)
}

/// Of a sum of areas.
const ROUNDING: f64 = 1e-9;
