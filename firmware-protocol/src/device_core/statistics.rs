//! Mean, variance and extremes of the ADC readings of one dwell. It knows whole numbers and no
//! time.
//!
//! Readings are whole, so their sums are kept exactly: 2^32 readings of 32 bits leave room in
//! 128. Mean and variance are rounded at the end only, and a small noise on a large level costs
//! no digits.

#[derive(Debug, Clone)]
pub(super) struct Statistics {
    n: u32,
    /// Deviations are counted from the first reading, which keeps the squares small.
    first: i32,
    sum: i128,
    sum_of_squares: u128,
    min: i32,
    max: i32,
    saturated: u32,
    /// The ends of the ADC's range.
    ends: (i64, i64),
}

impl Statistics {
    /// Of no readings yet, of a bipolar ADC of so many bits.
    pub(super) fn new(adc_bits: u8) -> Self {
        let half = 1_i64 << (adc_bits.clamp(1, 32) - 1);
        Self {
            n: 0,
            first: 0,
            sum: 0,
            sum_of_squares: 0,
            min: i32::MAX,
            max: i32::MIN,
            saturated: 0,
            ends: (-half, half - 1),
        }
    }

    pub(super) fn take(&mut self, reading: i32) {
        if self.n == 0 {
            self.first = reading;
        }
        let deviation = i128::from(reading) - i128::from(self.first);
        self.n += 1;
        self.sum += deviation;
        self.sum_of_squares += deviation.unsigned_abs() * deviation.unsigned_abs();
        self.min = self.min.min(reading);
        self.max = self.max.max(reading);
        let is_at_end = i64::from(reading) <= self.ends.0 || i64::from(reading) >= self.ends.1;
        self.saturated += u32::from(is_at_end);
    }

    pub(super) const fn n(&self) -> u32 {
        self.n
    }

    pub(super) const fn min(&self) -> i32 {
        self.min
    }

    pub(super) const fn max(&self) -> i32 {
        self.max
    }

    pub(super) const fn saturated(&self) -> u32 {
        self.saturated
    }

    /// Counts; zero for no readings.
    pub(super) fn mean(&self) -> f64 {
        if self.n == 0 {
            return 0.0;
        }
        let sum = self.sum + i128::from(self.n) * i128::from(self.first);
        sum as f64 / f64::from(self.n)
    }

    /// Counts squared, over n - 1; zero for fewer than two readings.
    pub(super) fn variance(&self) -> f64 {
        if self.n < 2 {
            return 0.0;
        }
        let n = u128::from(self.n);
        // (Σd² - (Σd)²/n) / (n - 1) over one denominator. Both products stay below 2^128, and
        // the difference is not negative (Cauchy-Schwarz).
        let square_of_sum = self.sum.unsigned_abs() * self.sum.unsigned_abs();
        let numerator = n * self.sum_of_squares - square_of_sum;
        numerator as f64 / (n * (n - 1)) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(readings: &[i32], adc_bits: u8) -> Statistics {
        let mut statistics = Statistics::new(adc_bits);
        for &reading in readings {
            statistics.take(reading);
        }
        statistics
    }

    #[test]
    fn small_noise_on_a_large_level_keeps_every_digit() {
        let statistics = of(&[2_000_000_001, 2_000_000_002, 2_000_000_003, 2_000_000_004], 32);
        assert!(statistics.mean().to_bits() == 2_000_000_002.5_f64.to_bits());
        assert!(statistics.variance().to_bits() == (5.0_f64 / 3.0).to_bits());
    }

    #[test]
    fn the_widest_readings_do_not_overflow() {
        let statistics = of(&[i32::MIN, i32::MAX, i32::MIN, i32::MAX], 32);
        let expected = f64::from(u32::MAX) * f64::from(u32::MAX) / 3.0;
        assert!((statistics.variance() / expected - 1.0).abs() < 1e-15);
        assert!((statistics.mean() + 0.5).abs() < 1e-15);
        assert_eq!(statistics.saturated(), 4);
    }

    #[test]
    fn both_ends_of_the_range_count_as_saturated() {
        let statistics = of(&[-8, -7, 0, 6, 7], 4);
        assert_eq!(statistics.saturated(), 2);
        assert_eq!((statistics.min(), statistics.max(), statistics.n()), (-8, 7, 5));
    }

    #[test]
    fn a_single_reading_has_no_variance() {
        assert!(of(&[-3], 8).variance().abs() < f64::MIN_POSITIVE);
        assert!((of(&[-3], 8).mean() + 3.0).abs() < f64::MIN_POSITIVE);
    }
}
