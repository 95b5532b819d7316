//! Motion smear: an ADC reading averages over the places that the axes pass in its time.
//!
//! At rest only an axis smears that still rings, or takes longer to settle than is stated. In a
//! sweep's window every reading does; there [`super::passing`] averages.

/// A moment of an ADC reading: how long before its end, as a part of it, and its weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Moment {
    pub(crate) before_end: f64,
    pub(crate) weight: f64,
}

/// The end stands for the whole reading.
pub(crate) const END: Moment = Moment { before_end: 0.0, weight: 1.0 };

/// Gauss and Legendre's rule of four points on (0, 1) (Abramowitz, Stegun 1964, table 25.4).
const RULE: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// More periods within one ADC reading than this are not followed one by one.
const PANELS_MAX: f64 = 64.0;

/// The moments that a reading averages over: the rule once in each period of the fastest ringing.
pub(super) fn moments(fastest_hz: f64, reading_s: f64) -> Vec<Moment> {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most 64
    let panels = libm::ceil(fastest_hz * reading_s).clamp(1.0, PANELS_MAX) as u32;
    let of_panel = |panel: u32| {
        RULE.into_iter().map(move |(node, weight)| Moment {
            before_end: (f64::from(panel) + node) / f64::from(panels),
            weight: weight / f64::from(panels),
        })
    };
    (0..panels).flat_map(of_panel).collect()
}

/// By how much the mean of a dwell that begins so long after a stop changes, of a departure of
/// which `left` is what remains at a time, when its readings average instead of standing for their
/// ends.
pub(super) fn change(
    left: &dyn Fn(f64) -> f64,
    moments: &[Moment],
    begin_s: f64,
    reading_s: f64,
    n: u32,
) -> f64 {
    let of_reading = |k: u32| {
        let end_s = begin_s + f64::from(k) * reading_s;
        let at = |moment: &Moment| {
            moment.weight * left((end_s - moment.before_end * reading_s).max(0.0))
        };
        moments.iter().map(at).sum::<f64>() - left(end_s)
    };
    (1..=n).map(of_reading).sum::<f64>().abs() / f64::from(n)
}

#[cfg(test)]
mod tests {
    use core::f64::consts::TAU;

    use super::super::ringing::Rings;
    use super::*;
    use crate::mechanics::Ringing;

    #[test]
    fn the_moments_average_a_sine_over_the_reading() {
        for (hz, reading_s) in [(20.0, 5e-4), (900.0, 5e-4), (3000.0, 1e-2)] {
            let moments = moments(hz, reading_s);
            let weights: f64 = moments.iter().map(|moment| moment.weight).sum();
            assert!((weights - 1.0).abs() < 1e-14);
            let at = |t: f64| libm::cos(TAU * hz * t + 0.3);
            let found: f64 =
                moments.iter().map(|m| m.weight * at(reading_s * (1.0 - m.before_end))).sum();
            let sine = |t: f64| libm::sin(TAU * hz * t + 0.3);
            let expected = (sine(reading_s) - sine(0.0)) / (TAU * hz * reading_s);
            // The rule's error on one period is (4!)⁴ / (9 (8!)³) (2π)⁸ = 1.4e-3.
            assert!((found - expected).abs() < 2e-3, "{hz} Hz: {found} beside {expected}");
        }
    }

    #[test]
    fn over_a_dwell_the_changes_of_its_readings_leave_half_of_its_ends() {
        let ringing = Ringing { amplitude: 1.0, frequency_hz: 20.0, damping_ratio: 0.05 };
        let rings = Rings::new(&ringing, 1e6);
        let found = change(&|since_s| rings.left(since_s), &moments(20.0, 5e-4), 0.0, 5e-4, 100);
        // The sum over ends is the integral and half the difference of the ends (Euler, Maclaurin).
        let expected = (rings.left(0.0) - rings.left(0.05)) / 200.0;
        assert!((found / expected - 1.0).abs() < 0.05, "{found} beside {expected}");
    }
}
