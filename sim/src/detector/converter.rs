//! Gain ranges and the converter behind them: quantisation and saturation.

/// Gain ranges as they are, and the converter.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Amplifier {
    counts_per_a: Vec<f64>,
    low: f64,
    high: f64,
}

impl Amplifier {
    pub(crate) fn new(full_scales_a: &[f64], bits: u8) -> Self {
        let full_scale = libm::scalbn(1.0, i32::from(bits) - 1);
        let counts_per_a = full_scales_a.iter().map(|current| full_scale / current).collect();
        Self { counts_per_a, low: -full_scale, high: full_scale - 1.0 }
    }

    /// Counts of a current in a gain range; the ends of the range are where it saturates. `None`
    /// for a range that isn't there.
    #[allow(clippy::cast_possible_truncation)] // within 32 bits, signed
    pub(crate) fn convert(&self, gain: u8, current_a: f64) -> Option<i32> {
        let counts = current_a * self.counts_per_a.get(usize::from(gain))?;
        Some(libm::round(counts).clamp(self.low, self.high) as i32)
    }

    /// The currents at the upper end of the ranges, amperes.
    pub(crate) fn full_scales_a(&self) -> Vec<f64> {
        self.counts_per_a.iter().map(|counts_per_a| -self.low / counts_per_a).collect()
    }
}
