//! Round numbers along an axis, and how they are written.

/// Round numbers within two ends, and how far apart they are.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ticks {
    /// Rising.
    pub(super) at: Vec<f64>,
    step: f64,
    /// All labels are in this power of ten, a multiple of three.
    exponent: i32,
}

impl Ticks {
    /// About `count` of them in [low, high]; steps are 1, 2 or 5 times a power of ten. Ends that
    /// are equal or no numbers have the one tick `low`, or none.
    pub(super) fn within((low, high): (f64, f64), count: u32) -> Self {
        let exponent = exponent_of(low.abs().max(high.abs()));
        let span = high - low;
        if !(span > 0.0 && span.is_finite()) {
            let at = if low.is_finite() { vec![low] } else { Vec::new() };
            return Self { at, step: 0.0, exponent };
        }
        let step = round_step(span / f64::from(count.max(1)));
        let (first, last) = (libm::ceil(low / step - 1e-9), libm::floor(high / step + 1e-9));
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few times `count`
        let n = (last - first).clamp(0.0, 1000.0) as u32;
        let at = (0..=n).map(|i| (first + f64::from(i)) * step).collect();
        Self { at, step, exponent }
    }

    /// The same with labels in no power of ten, for who can't show one.
    pub(super) fn plain(ends: (f64, f64), count: u32) -> Self {
        Self { exponent: 0, ..Self::within(ends, count) }
    }

    /// The label of a tick: as many decimals as tell it from its neighbour.
    pub(super) fn label(&self, value: f64) -> String {
        let scale = libm::exp10(f64::from(-self.exponent));
        let step = self.step * scale;
        let value = value * scale;
        if step <= 0.0 {
            return significant(value, 4);
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to 15
        let decimals = (-libm::floor(libm::log10(step) + 1e-9)).clamp(0.0, 15.0) as usize;
        let text = format!("{value:.decimals$}");
        // A zero has no sign.
        if text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') {
            text.trim_start_matches('-').to_owned()
        } else {
            text
        }
    }

    /// The unit that goes with the labels: with a power of ten in front where they need one.
    pub(super) fn unit(&self, unit: &str) -> String {
        if self.exponent == 0 {
            return unit.to_owned();
        }
        format!("1e{} {unit}", self.exponent).trim_end().to_owned()
    }
}

/// The round number that is at least `value`, for the end of an axis.
pub(super) fn round_up(value: f64) -> f64 {
    if !(value > 0.0 && value.is_finite()) {
        return 1.0;
    }
    let step = round_step(value / 4.0);
    libm::ceil(value / step - 1e-9) * step
}

/// So many significant digits, with an exponent far from 1.
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    #[allow(clippy::cast_possible_truncation)] // between -324 and 308
    let magnitude = libm::floor(libm::log10(value.abs())) as i32;
    let digits = i32::try_from(digits).unwrap_or(i32::MAX);
    if (-4..6).contains(&magnitude) {
        let decimals = usize::try_from(digits - 1 - magnitude).unwrap_or(0);
        return format!("{value:.decimals$}");
    }
    format!("{value:.*e}", usize::try_from(digits - 1).unwrap_or(0))
}

/// 1, 2 or 5 times a power of ten, at most `value`, which is above zero.
pub(super) fn round_down_1_2_5(value: f64) -> f64 {
    let decade = libm::exp10(libm::floor(libm::log10(value)));
    let factor = [5.0, 2.0].into_iter().find(|factor| factor * decade <= value);
    factor.unwrap_or(1.0) * decade
}

/// 1, 2 or 5 times a power of ten, above `value`, which is above zero.
pub(super) fn round_up_1_2_5(value: f64) -> f64 {
    let decade = libm::exp10(libm::floor(libm::log10(value)));
    let factor = [2.0, 5.0].into_iter().find(|factor| factor * decade > value);
    factor.unwrap_or(10.0) * decade
}

fn round_step(least: f64) -> f64 {
    let decade = libm::exp10(libm::floor(libm::log10(least)));
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * decade >= least * (1.0 - 1e-9));
    factor.unwrap_or(10.0) * decade
}

/// 0 where plain decimals read well.
fn exponent_of(largest: f64) -> i32 {
    if !(largest > 0.0 && largest.is_finite()) || (0.01..1e5).contains(&largest) {
        return 0;
    }
    #[allow(clippy::cast_possible_truncation)] // between -324 and 308
    let thousands = libm::floor(libm::log10(largest) / 3.0) as i32;
    3 * thousands
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64) -> Vec<String> {
        let ticks = Ticks::within((low, high), 5);
        ticks.at.iter().map(|value| ticks.label(*value)).collect()
    }

    #[test]
    fn ticks_are_round_and_told_apart() {
        assert_eq!(labels(0.0, 1.0), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(49.97, 50.03), ["49.98", "50.00", "50.02"]);
        assert_eq!(labels(-5.0, 5.0), ["-4", "-2", "0", "2", "4"]);
        assert_eq!(labels(3.0, 3.0), ["3.000"]);
        assert!(labels(f64::NAN, f64::NAN).is_empty());
    }

    #[test]
    fn small_and_large_ones_share_a_power_of_ten() {
        let ticks = Ticks::within((0.0, 4e-6), 4);
        assert_eq!(ticks.label(2e-6), "2");
        assert_eq!(ticks.unit("W"), "1e-6 W");
        assert_eq!(Ticks::within((0.0, 3e7), 4).unit(""), "1e6");
    }

    #[test]
    fn ends_are_round_and_beyond() {
        assert!((round_up(87.3) - 100.0).abs() < 1e-9);
        assert!((round_up(40.0) - 40.0).abs() < 1e-9);
        assert!((round_up(0.0) - 1.0).abs() < 1e-9 && (round_up(f64::NAN) - 1.0).abs() < 1e-9);
        assert_eq!(significant(0.012_345, 3), "0.0123");
        assert_eq!(significant(-1.5e-7, 2), "-1.5e-7");
    }
}
