//! Noise whose power goes as 1/f.

use core::f64::consts::{LN_2, TAU};

use firmware_protocol::{Illumination, Instant};

use super::name;
use super::noise::Noise;
use crate::levels::Levels;
use crate::stage::Stage;
use crate::time::{Interval, mean_of_decay};

/// One-sided power spectral density S(f) = W C / f, with W = 2 σ² / rate that of the read
/// noise and C the corner, flat below the lowest frequency.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flicker {
    /// C: where flicker and read noise have the same density, hertz, above 0.
    pub corner_hz: f64,
    /// Below it the density is flat, hertz, above 0. What is slower cancels against the dark
    /// readings, so that this is about one over the time between them.
    pub lowest_hz: f64,
}

/// Between the rates of neighbouring processes. The sum of Lorentzians ripples around 1/f by
/// 4 exp(-π²/ln 4) = 0.3 %.
const RATIO: f64 = 4.0;

/// Noise of the amplifier, within a dwell; from dwell to dwell it is drawn anew, so that a reading
/// has the same whenever it is taken. (What goes on from dwell to dwell is drift.)
///
/// It is a sum of Ornstein-Uhlenbeck processes of equal variance, their rates spaced evenly in
/// the logarithm (Bernamont 1937; van der Ziel 1950): with S(f) = A²/f each has the variance
/// A² ln(ratio). They are advanced and averaged over an ADC reading exactly (Gillespie 1996).
#[derive(Debug)]
pub(crate) struct FlickerNoise {
    /// A² ln(ratio), A².
    variance: f64,
    processes: Vec<Process>,
    /// Standard deviation of what is left of all processes' means once their ends are known.
    rest_a: f64,
    noise: Noise,
}

/// One process, in units of its standard deviation.
#[derive(Debug, Clone)]
struct Process {
    /// λ, 1/s.
    rate: f64,
    state: f64,
    /// exp(-λΔ), and what the end of a reading has of a new number.
    keeps: f64,
    gains: f64,
    /// What the mean over a reading has of the state at its beginning, and of the new number.
    mean_of_state: f64,
    mean_of_new: f64,
}

impl FlickerNoise {
    pub(crate) fn new(flicker: &Flicker, read_noise_a: f64, rate_hz: u32, seed: u64) -> Self {
        let rate_hz = f64::from(rate_hz);
        let density = 2.0 * read_noise_a * read_noise_a / rate_hz * flicker.corner_hz;
        let variance = density * 2.0 * LN_2;
        let mut processes = Vec::new();
        let mut rest = 0.0;
        let mut corner_hz = flicker.lowest_hz * libm::sqrt(RATIO);
        loop {
            let process = Process::new(TAU * corner_hz, 1.0 / rate_hz);
            rest += process.rest_of_mean(1.0 / rate_hz);
            processes.push(process);
            corner_hz *= RATIO;
            if corner_hz > rate_hz {
                break;
            }
        }
        let noise = Noise::new(seed, name::FLICKER_NOISE);
        Self { variance, processes, rest_a: libm::sqrt(variance * rest), noise }
    }

    /// The standard deviation of a dwell's mean, relative to max(|reading|, noise floor).
    pub(crate) fn influence(&self, levels: &Levels) -> f64 {
        let variance_of_mean = |process: &Process| mean_variance(process.rate * levels.dwell_s());
        let sum: f64 = self.processes.iter().map(variance_of_mean).sum();
        levels.noise(libm::sqrt(self.variance * sum))
    }
}

impl Process {
    fn new(rate: f64, reading_s: f64) -> Self {
        let u = rate * reading_s;
        let keeps = libm::exp(-u);
        let gains = libm::sqrt(-libm::expm1(-2.0 * u));
        let mean_of_state = mean_of_decay(u);
        // Cov(mean, end) given the state is m (1 - exp(-u)).
        let mean_of_new = mean_of_state * -libm::expm1(-u) / gains;
        Self { rate, state: 0.0, keeps, gains, mean_of_state, mean_of_new }
    }

    /// The variance of the mean over a reading, given the states at both its ends.
    fn rest_of_mean(&self, reading_s: f64) -> f64 {
        let u = self.rate * reading_s;
        if u < 0.05 {
            // The Brownian bridge's u/6, and the next term: the differences below cancel.
            return u / 6.0 - u * u * u / 60.0;
        }
        let (m, c) = (self.mean_of_state, self.mean_of_new);
        (mean_variance(u) - m * m - c * c).max(0.0)
    }
}

/// The variance of the mean of a process of variance one over a time of u relaxation times:
/// 2 (u - 1 + exp(-u)) / u².
fn mean_variance(u: f64) -> f64 {
    if u < 1e-3 { 1.0 - u / 3.0 + u * u / 12.0 } else { 2.0 * (u + libm::expm1(-u)) / (u * u) }
}

impl Stage for FlickerNoise {
    fn begin(&mut self, _now: Instant, dwell: Illumination) {
        self.noise.begin(dwell.reading);
        for process in &mut self.processes {
            process.state = self.noise.normal();
        }
    }

    fn pass(&mut self, _at: Interval, current_a: f64) -> f64 {
        let mut mean = 0.0;
        for process in &mut self.processes {
            let new = self.noise.normal();
            mean += process.mean_of_state * process.state + process.mean_of_new * new;
            process.state = process.keeps * process.state + process.gains * new;
        }
        current_a + libm::sqrt(self.variance) * mean + self.rest_a * self.noise.normal()
    }
}

#[cfg(test)]
mod tests {
    use firmware_protocol::Shutter;

    use super::*;

    const RATE_HZ: u32 = 2000;
    const SIGMA_A: f64 = 3e-12;
    const FLICKER: Flicker = Flicker { corner_hz: 40.0, lowest_hz: 0.1 };

    fn dwell(noise: &mut FlickerNoise, reading: u32, n: u32) -> Vec<f64> {
        let shutter = Shutter::Open;
        noise.begin(Instant::ZERO, Illumination { reading, gain: 0, shutter });
        let at = Interval { begin_s: 0.0, end_s: 0.0 };
        (0..n).map(|_| noise.pass(at, 0.0)).collect()
    }

    /// The one-sided density of so many dwells at a frequency, A²/Hz.
    fn density(dwells: &[Vec<f64>], frequency_hz: f64) -> f64 {
        let rate_hz = f64::from(RATE_HZ);
        let sum: f64 = dwells
            .iter()
            .map(|dwell| {
                let (mut re, mut im, mut weights) = (0.0, 0.0, 0.0);
                for (k, value) in (0_u32..).zip(dwell) {
                    // Hann's window: a 1/f spectrum leaks into its steep end otherwise.
                    let part = (f64::from(k) + 0.5) / dwell.len() as f64;
                    let weight = 1.0 - libm::cos(TAU * part);
                    let (sin, cos) = libm::sincos(TAU * frequency_hz * f64::from(k) / rate_hz);
                    re += weight * value * cos;
                    im += weight * value * sin;
                    weights += weight * weight;
                }
                2.0 * (re * re + im * im) / weights / rate_hz
            })
            .sum();
        sum / dwells.len() as f64
    }

    #[test]
    fn the_spectrum_falls_as_one_over_f_at_the_stated_level() {
        // 1500 dwells: a density's standard error is 2.6 %.
        let mut noise = FlickerNoise::new(&FLICKER, SIGMA_A, RATE_HZ, 5);
        let dwells: Vec<Vec<f64>> = (0..1500).map(|i| dwell(&mut noise, i, 2000)).collect();
        let white = 2.0 * SIGMA_A * SIGMA_A / f64::from(RATE_HZ);
        let (mut sum_xy, mut sum_xx) = (0.0, 0.0);
        let frequencies = [5.0, 10.0, 20.0, 40.0, 80.0, 160.0];
        let middle = libm::log(libm::sqrt(5.0 * 160.0));
        for frequency_hz in frequencies {
            let found = density(&dwells, frequency_hz);
            let expected = white * FLICKER.corner_hz / frequency_hz;
            assert!((found / expected - 1.0).abs() < 0.11, "{frequency_hz} Hz: {found} {expected}");
            let x = libm::log(frequency_hz) - middle;
            sum_xy += x * libm::log(found);
            sum_xx += x * x;
        }
        // The slope's standard error is 2.6 % / sqrt(sum_xx = 8.4) = 0.009.
        let slope = sum_xy / sum_xx;
        assert!((slope + 1.0).abs() < 0.04, "slope {slope}");
    }

    #[test]
    fn a_dwells_mean_spreads_as_the_bound_says() {
        for n in [1, 10, 400] {
            let mut noise = FlickerNoise::new(&FLICKER, SIGMA_A, RATE_HZ, 5);
            let dwell_s = f64::from(n) / f64::from(RATE_HZ);
            let levels = Levels::new((0.0, 1e-9), 1e-13, RATE_HZ, (dwell_s, 3600.0));
            let squares = (0..4000).map(|i| {
                let mean = dwell(&mut noise, i, n).iter().sum::<f64>() / f64::from(n);
                mean * mean
            });
            let found = libm::sqrt(squares.sum::<f64>() / 4000.0) / 1e-13;
            let bound = noise.influence(&levels);
            // The standard error is 1.1 %.
            assert!((found / bound - 1.0).abs() < 0.05, "{n} readings: {found} beside {bound}");
        }
    }

    #[test]
    fn a_reading_has_its_noise_whatever_came_before() {
        let mut noise = FlickerNoise::new(&FLICKER, SIGMA_A, RATE_HZ, 5);
        let first = dwell(&mut noise, 7, 50);
        dwell(&mut noise, 8, 3);
        assert_eq!(dwell(&mut noise, 7, 50), first);
        assert_ne!(dwell(&mut noise, 9, 50), first);
    }

    #[test]
    fn the_series_meets_the_closed_form() {
        let just = |u: f64| Process::new(u, 1.0).rest_of_mean(1.0);
        assert!((just(0.049_999) / just(0.050_001) - 1.0).abs() < 1e-4);
        assert!((mean_variance(0.000_999_9) - mean_variance(0.001_000_1)).abs() < 1e-7);
    }
}
