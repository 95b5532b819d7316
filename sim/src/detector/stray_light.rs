//! Light that reaches the detector beside its beam.

use firmware_protocol::{Illumination, Instant, Shutter};

use crate::levels::Levels;
use crate::stage::Stage;
use crate::time::Interval;

/// A part of the scene's whole flux, by way of walls and baffles, whatever the pose: light that
/// was scattered often enough to have forgotten where it came from, as in an integrating sphere.
/// The shutter keeps it out.
#[derive(Debug)]
pub(crate) struct StrayLight {
    stray_a: f64,
    is_open: bool,
}

impl StrayLight {
    /// Of a scene's flux (W, or lm), for a responsivity as drawn (A/W, or A/lm).
    pub(crate) fn new(fraction_of_flux: f64, flux: f64, responsivity: f64) -> Self {
        Self { stray_a: fraction_of_flux * flux * responsivity, is_open: false }
    }

    /// Relative to max(|reading|, noise floor).
    pub(crate) fn influence(&self, levels: &Levels) -> f64 {
        levels.additive(self.stray_a)
    }
}

impl Stage for StrayLight {
    fn begin(&mut self, _now: Instant, dwell: Illumination) {
        self.is_open = dwell.shutter == Shutter::Open;
    }

    fn pass(&mut self, _at: Interval, current_a: f64) -> f64 {
        if self.is_open { current_a + self.stray_a } else { current_a }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_closed_shutter_keeps_it_out() {
        let mut stage = StrayLight::new(1e-6, 5.0, 0.2);
        let at = Interval { begin_s: 0.0, end_s: 1.0 };
        for (shutter, expected) in [(Shutter::Open, 1.0e-6), (Shutter::Closed, 0.0)] {
            stage.begin(Instant::ZERO, Illumination { reading: 0, gain: 0, shutter });
            assert!((stage.pass(at, 0.0) - expected).abs() < 1e-21);
        }
        // A thousand times the signal, beside it and the signal.
        let influence = stage.influence(&Levels::bright(1e-9, 2000, 0.05));
        assert!((influence * 1.001 - 1.0).abs() < 1e-12, "{influence}");
    }
}
