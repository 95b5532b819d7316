//! How an axis rings after a stop.

use core::f64::consts::TAU;

use super::flaws::Ringing;

/// e(t) = A exp(-ζ ω t) cos(ω √(1 - ζ²) t), the free oscillation of a damped mass on a spring: the
/// load overshoots in its direction by A and comes to rest. A move shorter than A rings by its
/// length alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rings {
    amplitude_counts: f64,
    /// ζ ω, 1/s.
    decay: f64,
    /// ω √(1 - ζ²), 1/s.
    omega: f64,
    lasts_s: f64,
}

/// An oscillation of this many counts is over: a thousandth of what the axis resolves.
const OVER_COUNTS: f64 = 1e-3;

impl Rings {
    pub(super) fn new(ringing: &Ringing, counts_per_unit: f64) -> Self {
        let Ringing { amplitude, frequency_hz, damping_ratio } = *ringing;
        let amplitude_counts = amplitude * counts_per_unit.abs();
        let decay = damping_ratio * TAU * frequency_hz;
        let omega = TAU * frequency_hz * libm::sqrt(1.0 - damping_ratio * damping_ratio);
        let lasts_s = libm::log((amplitude_counts / OVER_COUNTS).max(1.0)) / decay;
        Self { amplitude_counts, decay, omega, lasts_s }
    }

    /// By how much it begins to ring after a move, counts.
    pub(super) const fn after(&self, moved_counts: f64) -> f64 {
        moved_counts.clamp(-self.amplitude_counts, self.amplitude_counts)
    }

    /// By how much it begins to ring when an acceleration ends, as a part of the axis's own.
    pub(super) const fn excited(&self, part: f64) -> f64 {
        self.amplitude_counts * part.clamp(-1.0, 1.0)
    }

    /// What is left of an oscillation that began with one, so many seconds after the stop.
    pub(crate) fn left(&self, since_s: f64) -> f64 {
        if since_s >= self.lasts_s {
            return 0.0;
        }
        libm::exp(-self.decay * since_s) * libm::cos(self.omega * since_s)
    }

    /// How long it is to be reckoned with, seconds.
    pub(super) const fn lasts_s(&self) -> f64 {
        self.lasts_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RINGING: Ringing = Ringing { amplitude: 0.01, frequency_hz: 20.0, damping_ratio: 0.05 };

    #[test]
    fn it_swings_at_its_frequency_and_decays_at_its_rate() {
        let rings = Rings::new(&RINGING, -1000.0);
        let begins = rings.after(500.0);
        assert_eq!((begins, rings.after(-3.0)), (10.0, -3.0));
        // A period of the damped oscillation later it stands at exp(-2π ζ / √(1 - ζ²)).
        let period_s = 1.0 / (20.0 * libm::sqrt(1.0 - 0.0025));
        let after = begins * rings.left(period_s);
        let expected = 10.0 * libm::exp(-TAU * 0.05 / libm::sqrt(1.0 - 0.0025));
        assert!((after - expected).abs() < 1e-12, "{after}");
        assert!(rings.left(period_s / 2.0) < 0.0);
    }

    #[test]
    fn it_is_over_when_it_no_longer_shows() {
        let rings = Rings::new(&RINGING, 1000.0);
        assert!(10.0 * libm::exp(-rings.decay * rings.lasts_s()) < 1.000_001e-3);
        assert_eq!(rings.left(rings.lasts_s()).to_bits(), 0);
    }
}
