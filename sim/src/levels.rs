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

#[cfg(test)]
mod tests {
    use super::*;

    /// The largest |with - without| / max(either, floor) over signals of the region, ten thousand to
    /// the decade.
    fn largest(levels: &Levels, with: impl Fn(f64) -> f64) -> f64 {
        let signals = (0..=200_000).map(|i| 1e-28 * libm::pow(10.0, f64::from(i) / 10_000.0));
        let signals = signals.map(|signal_a| signal_a.clamp(levels.lowest_a, levels.highest_a));
        let influence = |signal_a: f64| {
            let reading = signal_a.abs().max(with(signal_a).abs()).max(levels.floor_a);
            (with(signal_a) - signal_a).abs() / reading
        };
        signals.map(influence).fold(0.0, f64::max)
    }

    #[test]
    fn the_closed_forms_are_the_largest_over_the_signals() {
        for range in [(0.0, 1e-9), (3e-11, 1e-9), (1e-9, 1e-9), (0.0, 1e-14)] {
            for floor_a in [1e-13, 1e-10] {
                let levels = Levels::new(range, floor_a, 2000, (0.05, 3600.0));
                for current_a in [1e-15, 1e-12, 2e-10, 5e-9, -1e-12, -2e-10, -5e-9] {
                    let (found, bound) =
                        (largest(&levels, |signal| signal + current_a), levels.additive(current_a));
                    assert!(found <= bound * (1.0 + 1e-9), "{found} beside {bound}");
                    assert!(found >= bound * 0.98, "{found} beside {bound}: {levels:?}");
                }
                let (found, bound) =
                    (largest(&levels, |signal| signal * 0.9), levels.proportional(0.1));
                assert!((found / bound - 1.0).abs() < 1e-9, "{found} beside {bound}");
            }
        }
    }

    #[test]
    fn what_grows_as_a_root_is_largest_at_the_floor() {
        let levels = Levels::new((0.0, 1e-9), 1e-12, 2000, (0.05, 3600.0));
        let root = |signal_a: f64| 1e-8 * libm::sqrt(signal_a);
        let signals = (0..=100_000).map(|i| 1e-9 * f64::from(i) / 100_000.0);
        let found = signals.map(|signal| root(signal) / signal.max(1e-12)).fold(0.0, f64::max);
        assert!((levels.of_root(root) / found - 1.0).abs() < 1e-3);
    }

    #[test]
    fn a_dwell_has_the_readings_that_the_device_counts() {
        let readings = |dwell_s, rate_hz| Levels::bright(1e-9, rate_hz, dwell_s).readings();
        assert_eq!([readings(0.05, 2000), readings(0.0509, 300), readings(1e-9, 10)], [100, 15, 1]);
    }
}
