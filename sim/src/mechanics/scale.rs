//! Where the true position departs from the one that is reported by an amount that belongs to the
//! position: the same wherever the axis comes from.

use core::f64::consts::TAU;

use super::flaws::EncoderError;
use crate::chance::{Stream, draw, mix};

/// A number for each line of the scale.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Lines {
    pub(super) sigma_counts: f64,
    pub(super) effect: String,
    pub(super) seed: u64,
}

impl Lines {
    pub(super) fn error_counts(&self, mechanical_counts: f64) -> f64 {
        #[allow(clippy::cast_possible_truncation)] // counts are far inside 64 bits
        let line = libm::round(mechanical_counts) as i64;
        self.sigma_counts * draw(self.seed, &self.effect, mix(line.cast_unsigned()))
    }
}

/// A sin(2π p / P + φ₀) at the mechanical position p, φ₀ drawn by the seed: what a graduated
/// circle does that is mounted off its centre (P a turn), a screw (P its pitch), an encoder
/// that interpolates (P a line).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Periodic {
    amplitude_counts: f64,
    turns_per_count: f64,
    phase_rad: f64,
}

impl Periodic {
    pub(super) fn new(error: &EncoderError, counts_per_unit: f64, effect: &str, seed: u64) -> Self {
        Self {
            amplitude_counts: error.amplitude * counts_per_unit.abs(),
            turns_per_count: 1.0 / (error.period * counts_per_unit.abs()),
            phase_rad: TAU * Stream::new(seed, effect, 0).uniform(),
        }
    }

    pub(super) fn error_counts(&self, mechanical_counts: f64) -> f64 {
        let turns = mechanical_counts * self.turns_per_count;
        self.amplitude_counts * libm::sin(TAU * (turns - libm::floor(turns)) + self.phase_rad)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_periodic_error_repeats_after_its_period_with_its_amplitude() {
        let error = EncoderError { amplitude: 0.002, period: 0.5 };
        let periodic = Periodic::new(&error, -1000.0, "theta-encoder-error", 3);
        let (mut largest, mut sum) = (0.0_f64, 0.0);
        for i in 0..500 {
            let counts = f64::from(i) - 77.0;
            let here = periodic.error_counts(counts);
            assert!((here - periodic.error_counts(counts + 500.0)).abs() < 1e-12);
            largest = largest.max(here.abs());
            sum += here;
        }
        assert!((largest - 2.0).abs() < 1e-4 && sum.abs() < 1e-9, "{largest}, {sum}");
        let other = Periodic::new(&error, -1000.0, "theta-encoder-error", 4);
        assert!(other.phase_rad.to_bits() != periodic.phase_rad.to_bits());
    }
}
