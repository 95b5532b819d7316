//! A source that flickers with the mains.

use core::f64::consts::{PI, TAU};

use spanned_toml::{Bounds, Problem, Table};

use super::Interval;
use super::effects::MAINS_FLICKER;
use crate::chance::Stream;
use crate::levels::Levels;
use crate::stage::Stage;

/// All light has the factor 1 + d sin(2π f t + φ₀).
///
/// d is the modulation depth of IEEE Std 1789-2015: (max - min) / (max + min).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MainsFlicker {
    /// f: of the light, hertz, above 0. It is twice the mains' frequency, since a lamp does not
    /// care for the current's sign.
    pub frequency_hz: f64,
    /// d: amplitude relative to the mean, from 0 to 1.
    pub depth_relative: f64,
    /// φ₀: at the device's boot, radians; drawn where absent.
    pub phase_rad: Option<f64>,
}

/// A detector's amplifier follows no light that is faster.
const FREQUENCY_HZ_MAX: f64 = 1e6;

/// More ADC readings than this are taken to end exactly when they should, not at the whole
/// microsecond before.
const EXACT_READINGS_MAX: u32 = 1 << 20;

impl MainsFlicker {
    pub(super) fn read(table: Table<'_>) -> Result<Self, Problem> {
        let phase_deg = table.number("phase_deg", Bounds::between(-360.0, 360.0))?;
        let read = Self {
            frequency_hz: table
                .required_number("frequency_hz", Bounds::positive_up_to(FREQUENCY_HZ_MAX))?,
            depth_relative: table.required_number("depth_relative", Bounds::between(0.0, 1.0))?,
            phase_rad: phase_deg.map(f64::to_radians),
        };
        table.finish()?;
        Ok(read)
    }

    /// By how much a dwell's mean changes at most, whenever it begins, relative to
    /// max(|reading|, noise floor). A dwell of whole periods averages the flicker away.
    pub(crate) fn influence(&self, levels: &Levels) -> f64 {
        let over_reading = sinc(self.frequency_hz * levels.reading_s());
        levels.proportional(self.depth_relative * (over_reading * self.mean_phasor(levels)).abs())
    }

    /// |Σ exp(2πi f t)| / n over the ends t of a dwell's ADC readings.
    fn mean_phasor(&self, levels: &Levels) -> f64 {
        let (n, rate_hz) = (levels.readings(), levels.rate_hz());
        let are_whole_us = 1_000_000 % rate_hz == 0;
        if are_whole_us || n > EXACT_READINGS_MAX {
            // Dirichlet's kernel: sin(n x) / (n sin x) with x = π f / rate.
            let turns = self.frequency_hz / f64::from(rate_hz);
            let sin = sin_turns(turns / 2.0);
            if sin.abs() < f64::EPSILON {
                return 1.0;
            }
            return (sin_turns(f64::from(n) * turns / 2.0) / (f64::from(n) * sin)).abs();
        }
        let (mut re, mut im) = (0.0, 0.0);
        for k in 1..=u64::from(n) {
            let us = k * 1_000_000 / u64::from(rate_hz);
            let (sin, cos) = libm::sincos(TAU * fraction(self.frequency_hz * us as f64 * 1e-6));
            (re, im) = (re + cos, im + sin);
        }
        libm::hypot(re, im) / f64::from(n)
    }
}

/// The factor on all light, averaged over an ADC reading.
#[derive(Debug)]
pub(crate) struct Flickering {
    frequency_hz: f64,
    phase_rad: f64,
    /// What is left of the depth in the mean over one ADC reading.
    depth: f64,
}

impl Flickering {
    pub(crate) fn new(flicker: &MainsFlicker, rate_hz: u32, seed: u64) -> Self {
        let drawn = || TAU * Stream::new(seed, MAINS_FLICKER, 0).uniform();
        Self {
            frequency_hz: flicker.frequency_hz,
            phase_rad: flicker.phase_rad.unwrap_or_else(drawn),
            depth: flicker.depth_relative * sinc(flicker.frequency_hz / f64::from(rate_hz)),
        }
    }
}

impl Stage for Flickering {
    fn pass(&mut self, at: Interval, current_a: f64) -> f64 {
        // The mean of sin over an interval is sinc(f Δ) times the sine of its middle.
        let turns = fraction(self.frequency_hz * at.middle_s());
        current_a * (1.0 + self.depth * libm::sin(TAU * turns + self.phase_rad))
    }
}

/// sin(π x) / (π x).
fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { sin_turns(x / 2.0) / (PI * x) }
}

/// sin(2π x), exactly 0 where x is a multiple of a half.
fn sin_turns(x: f64) -> f64 {
    let halves = 2.0 * x;
    let nearest = libm::round(halves);
    let sign = if fraction(nearest / 2.0) == 0.0 { 1.0 } else { -1.0 };
    sign * libm::sin(PI * (halves - nearest))
}

fn fraction(x: f64) -> f64 {
    x - libm::floor(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLICKER: MainsFlicker =
        MainsFlicker { frequency_hz: 100.0, depth_relative: 0.4, phase_rad: Some(0.7) };

    /// The mean of a dwell that begins at a time, at whole microseconds, as a device reads it.
    fn dwell(flicker: &MainsFlicker, begin_us: u64, n: u32, rate_hz: u32) -> f64 {
        let mut stage = Flickering::new(flicker, rate_hz, 1);
        let length_s = 1.0 / f64::from(rate_hz);
        let readings = (1..=u64::from(n)).map(|k| {
            let end_s = (begin_us + k * 1_000_000 / u64::from(rate_hz)) as f64 * 1e-6;
            stage.pass(Interval { begin_s: end_s - length_s, end_s }, 1.0)
        });
        readings.sum::<f64>() / f64::from(n)
    }

    #[test]
    fn an_adc_reading_is_the_mean_over_its_interval() {
        let mut stage = Flickering::new(&FLICKER, 250, 1);
        let at = Interval { begin_s: 3.1, end_s: 3.104 };
        let n = 10_000;
        let sum: f64 = (0..n)
            .map(|i| {
                let t = at.begin_s + 0.004 * (f64::from(i) + 0.5) / f64::from(n);
                1.0 + 0.4 * libm::sin(TAU * 100.0 * t + 0.7)
            })
            .sum();
        let found = stage.pass(at, 1.0);
        assert!((found - sum / f64::from(n)).abs() < 1e-9, "{found}");
    }

    #[test]
    fn whole_periods_average_out_and_the_bound_knows() {
        let levels = Levels::bright(1e-9, 2000, 0.05);
        assert!(FLICKER.influence(&levels) < 1e-15);
        assert!((dwell(&FLICKER, 123_457, 100, 2000) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_bound_is_met_at_the_worst_phase() {
        for (rate_hz, dwell_s) in [(2000, 0.047), (3000, 0.05), (300, 0.0233), (7000, 1.003)] {
            let levels = Levels::bright(1e-9, rate_hz, dwell_s);
            let bound = FLICKER.influence(&levels);
            let n = levels.readings();
            let worst = (0..500_u32)
                .map(|i| (dwell(&FLICKER, u64::from(i) * 20, n, rate_hz) - 1.0).abs())
                .fold(0.0, f64::max);
            assert!(worst <= bound * (1.0 + 1e-9) + 1e-15, "{worst} beside {bound}");
            assert!(worst >= 0.99 * bound, "{worst} beside {bound}");
        }
    }

    #[test]
    fn a_phase_that_is_not_stated_is_drawn() {
        let drawn = MainsFlicker { phase_rad: None, ..FLICKER };
        let first = |seed| Flickering::new(&drawn, 2000, seed).phase_rad.to_bits();
        assert_eq!(first(1), first(1));
        assert_ne!(first(1), first(2));
    }
}
