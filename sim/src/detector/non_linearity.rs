//! An amplifier that compresses.

use firmware_protocol::{Illumination, Instant};

use crate::levels::Levels;
use crate::stage::Stage;
use crate::time::Interval;

/// I' = I / (1 + b |I| / F), with F the present range's full scale and b = a / (1 - a): at
/// full scale the reading is short by the part a, below it by a part in proportion to the signal.
/// To first order this is I (1 - a I / F), but it stays monotone however large the signal.
#[derive(Debug)]
pub(crate) struct NonLinearity {
    /// b / F of each range.
    per_a: Vec<f64>,
    present: f64,
}

impl NonLinearity {
    pub(crate) fn new(relative_at_full_scale: f64, full_scales_a: &[f64]) -> Self {
        let b = relative_at_full_scale / (1.0 - relative_at_full_scale);
        let per_a: Vec<f64> = full_scales_a.iter().map(|full_scale_a| b / full_scale_a).collect();
        Self { present: per_a.first().copied().unwrap_or(0.0), per_a }
    }

    /// At the largest signal, in the range where it comes nearest to full scale, relative to
    /// max(|reading|, noise floor). Beyond full scale both readings saturate alike.
    pub(crate) fn influence(&self, full_scales_a: &[f64], levels: &Levels) -> f64 {
        let of_range = |(per_a, full_scale_a): (&f64, &f64)| {
            let compression = per_a * levels.highest_a().min(*full_scale_a);
            (compression / (1.0 + compression)).abs()
        };
        levels.proportional(self.per_a.iter().zip(full_scales_a).map(of_range).fold(0.0, f64::max))
    }
}

impl Stage for NonLinearity {
    fn begin(&mut self, _now: Instant, dwell: Illumination) {
        self.present = self.per_a.get(usize::from(dwell.gain)).copied().unwrap_or(0.0);
    }

    fn pass(&mut self, _at: Interval, current_a: f64) -> f64 {
        current_a / (1.0 + self.present * libm::fabs(current_a))
    }
}

#[cfg(test)]
mod tests {
    use firmware_protocol::Shutter;

    use super::*;

    #[test]
    fn a_reading_at_full_scale_is_short_by_what_is_stated() {
        let mut stage = NonLinearity::new(0.02, &[1e-6, 1e-8]);
        let at = Interval { begin_s: 0.0, end_s: 1.0 };
        for (gain, full_scale_a) in [(0, 1e-6), (1, 1e-8)] {
            let shutter = Shutter::Open;
            stage.begin(Instant::ZERO, Illumination { reading: 0, gain, shutter });
            let mut short =
                |part: f64| 1.0 - stage.pass(at, part * full_scale_a) / part / full_scale_a;
            assert!((short(1.0) / 0.02 - 1.0).abs() < 1e-12);
            assert!((short(-1.0) / 0.02 - 1.0).abs() < 1e-12);
            // To first order in proportion to the signal: a (1 + a) s - (a s)².
            assert!((short(0.01) / 0.000_2 - 1.0).abs() < 0.021);
        }
    }

    #[test]
    fn the_bound_is_the_compression_of_the_brightest_reading() {
        let full_scales_a = [1e-6, 1e-8];
        let stage = NonLinearity::new(0.02, &full_scales_a);
        let bright =
            |signal_a| stage.influence(&full_scales_a, &Levels::bright(signal_a, 2000, 0.05));
        assert!((bright(1e-6) / 0.02 - 1.0).abs() < 1e-12);
        assert!((bright(1e-3) / 0.02 - 1.0).abs() < 1e-12, "saturated");
        assert!((bright(1e-10) / 0.000_2 - 1.0).abs() < 0.021, "in the finer range");
    }
}
