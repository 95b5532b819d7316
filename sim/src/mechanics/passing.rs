//! What the ADC readings of a sweep's window see: the light along the way, averaged over the
//! places that each reading passes.
//!
//! A window has tens of readings, and the light changes smoothly from one to the next nearly
//! everywhere. So it is worked out at few places and a polynomial put through them; where places
//! between say otherwise, the stretch is halved, down to a single reading. An outline that the
//! beam crosses costs a few more places, and nobody's accuracy.

/// By how much the polynomial may miss the light where it is checked, relative to the largest
/// light of the window. Noise of a window is a hundred times more.
const TOLERANCE: f64 = 1e-6;

/// The light over each of `count` readings that share a window evenly, from `light` at parts of
/// the window from 0 to 1: its mean over the reading, or without averaging what it is at the
/// reading's end.
pub(crate) fn readings(light: impl Fn(f64) -> f64, count: usize, averages: bool) -> Vec<f64> {
    let mut window =
        Window { light, count, averages, largest: 0.0, out: Vec::with_capacity(count) };
    if count > 0 {
        let ends = [window.at(0.0), window.at(count as f64)];
        let middle = window.at(0.5 * count as f64);
        window.stretch(0, count, [ends[0], middle, ends[1]]);
    }
    window.out
}

struct Window<L> {
    light: L,
    count: usize,
    averages: bool,
    largest: f64,
    out: Vec<f64>,
}

impl<L: Fn(f64) -> f64> Window<L> {
    /// After so many readings.
    fn at(&mut self, readings: f64) -> f64 {
        let light = (self.light)(readings / self.count as f64);
        self.largest = self.largest.max(light.abs());
        light
    }

    /// Readings from one to another, the light known at the ends and in the middle.
    fn stretch(&mut self, from: usize, to: usize, [a, middle, b]: [f64; 3]) {
        let (begin, length) = (from as f64, (to - from) as f64);
        let mut at = |part: f64| self.at(begin + part * length);
        let (low, high) = (at(0.25), at(0.75));
        let quartic = Quartic::through([a, low, middle, high, b]);
        let is_one = to - from == 1;
        let is_smooth = is_one || {
            // Where a quartic through even places is worst.
            let off = |part: f64, light: f64| (quartic.value(part) - light).abs();
            let worst = off(0.125, at(0.125)).max(off(0.875, at(0.875)));
            worst <= TOLERANCE * self.largest
        };
        if is_smooth {
            for reading in 0..to - from {
                let (t0, t1) = (reading as f64 / length, (reading + 1) as f64 / length);
                self.out.push(if self.averages { quartic.mean(t0, t1) } else { quartic.value(t1) });
            }
            return;
        }
        // At a whole reading; the middle of an even stretch is known.
        let half = from + (to - from) / 2;
        let at_half = if (to - from).is_multiple_of(2) { middle } else { self.at(half as f64) };
        let of_low = self.at(0.5 * (from + half) as f64);
        let of_high = self.at(0.5 * (half + to) as f64);
        self.stretch(from, half, [a, of_low, at_half]);
        self.stretch(half, to, [at_half, of_high, b]);
    }
}

/// The polynomial of degree four through values at 0, 1/4, 1/2, 3/4 and 1.
struct Quartic([f64; 5]);

impl Quartic {
    fn through(values: [f64; 5]) -> Self {
        // Newton's forward differences over quarters, then powers of s = 4 t.
        let mut d = values;
        for order in 1..5 {
            for i in (order..5).rev() {
                d[i] -= d[i - 1];
            }
        }
        let [d0, d1, d2, d3, d4] = [d[0], d[1], d[2] / 2.0, d[3] / 6.0, d[4] / 24.0];
        // s (s-1) = s² - s; s (s-1) (s-2) = s³ - 3 s² + 2 s; … (s-3) = s⁴ - 6 s³ + 11 s² - 6 s.
        Self([d0, d1 - d2 + 2.0 * d3 - 6.0 * d4, d2 - 3.0 * d3 + 11.0 * d4, d3 - 6.0 * d4, d4])
    }

    fn value(&self, t: f64) -> f64 {
        let s = 4.0 * t;
        self.0.iter().rev().fold(0.0, |sum, power| sum * s + power)
    }

    /// Over (t0, t1), by Simpson and Gauss's three points: exact to degree five.
    fn mean(&self, t0: f64, t1: f64) -> f64 {
        let (middle, half) = (f64::midpoint(t0, t1), 0.5 * (t1 - t0));
        let off = half * GAUSS_NODE;
        let sides = self.value(middle - off) + self.value(middle + off);
        (5.0 * sides + 8.0 * self.value(middle)) / 18.0
    }
}

/// √(3/5), Gauss and Legendre's outer node of three points.
const GAUSS_NODE: f64 = 0.774_596_669_241_483_4;

#[cfg(test)]
mod tests {
    use core::cell::Cell;

    use super::*;

    #[test]
    fn a_quartic_and_its_means_are_exact() {
        let f = |t: f64| 1.0 - 2.0 * t + 3.0 * t * t - t * t * t + 0.5 * t * t * t * t;
        let integral =
            |t: f64| t - t * t + t * t * t - 0.25 * t * t * t * t + 0.1 * t * t * t * t * t;
        let quartic = Quartic::through([f(0.0), f(0.25), f(0.5), f(0.75), f(1.0)]);
        for t in [0.0, 0.1, 0.6, 1.0] {
            assert!((quartic.value(t) - f(t)).abs() < 1e-14);
        }
        let mean = (integral(0.7) - integral(0.2)) / 0.5;
        assert!((quartic.mean(0.2, 0.7) - mean).abs() < 1e-14);
    }

    #[test]
    fn a_smooth_window_costs_seven_places_and_its_readings_are_right() {
        for count in [1, 2, 50, 333] {
            let places = Cell::new(0);
            let light = |t: f64| {
                places.set(places.get() + 1);
                libm::exp(-t / 8.0)
            };
            let means = readings(light, count, true);
            assert!(places.get() <= 7, "{count}: {}", places.get());
            assert_eq!(means.len(), count);
            for (k, mean) in means.iter().enumerate() {
                let (t0, t1) = (k as f64 / count as f64, (k + 1) as f64 / count as f64);
                let integral = |t: f64| -8.0 * libm::exp(-t / 8.0);
                let expected = (integral(t1) - integral(t0)) / (t1 - t0);
                assert!((mean - expected).abs() < 1e-8, "{count}, {k}: {mean}, {expected}");
            }
        }
    }

    #[test]
    fn an_edge_is_found_to_the_reading_that_it_falls_into() {
        let places = Cell::new(0);
        let light = |t: f64| {
            places.set(places.get() + 1);
            if t < 0.3137 { 2.0 } else { 0.5 }
        };
        let means = readings(light, 64, true);
        assert!(places.get() < 100, "{}", places.get());
        let edge = 20; // 0.3137 · 64 = 20.08
        assert!(means[..edge].iter().all(|mean| (mean - 2.0).abs() < 1e-12));
        assert!(means[edge + 1..].iter().all(|mean| (mean - 0.5).abs() < 1e-12));
        assert!((0.4..2.1).contains(&means[edge]), "{}", means[edge]);
    }

    #[test]
    fn without_averaging_a_reading_stands_for_its_end() {
        let ends = readings(|t| 1.0 + t, 4, false);
        for (k, end) in ends.iter().enumerate() {
            assert!((end - (1.0 + 0.25 * (k + 1) as f64)).abs() < 1e-14);
        }
    }
}
