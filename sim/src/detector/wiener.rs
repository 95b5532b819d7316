//! Brownian motion as a function of time: a path that is drawn once by the seed, whoever asks
//! first, and can be asked anywhere.

use crate::chance::draw;

/// W(t), t in whole seconds and linear in between; W(0) = 0 and Var W(t) = t.
///
/// Lévy's construction (Lévy 1948): values at powers of two are sums of independent steps, those
/// between are filled in by halves, each the mean of its two neighbours and an independent number
/// of variance L/4, with L the neighbours' distance. A number goes by the second at which it
/// enters, so that the path does not depend on where it was asked before.
#[derive(Debug, Clone)]
pub(super) struct Wiener {
    seed: u64,
    effect: &'static str,
    /// The second that was asked last, with the values at its ends.
    here: Option<(u64, f64, f64)>,
}

impl Wiener {
    pub(super) const fn new(seed: u64, effect: &'static str) -> Self {
        Self { seed, effect, here: None }
    }

    /// W(t); zero before zero.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    pub(super) fn at(&mut self, t: f64) -> f64 {
        if t <= 0.0 {
            return 0.0;
        }
        let second = libm::floor(t) as u64;
        let (low, high) = match self.here {
            Some((known, low, high)) if known == second => (low, high),
            _ => {
                let ends = (self.node(second), self.node(second.saturating_add(1)));
                self.here = Some((second, ends.0, ends.1));
                ends
            }
        };
        low + (high - low) * (t - second as f64)
    }

    fn node(&self, second: u64) -> f64 {
        if second == 0 {
            return 0.0;
        }
        let (mut low, mut high) = ((0, 0.0), (1, self.draw(1)));
        while high.0 < second {
            low = high;
            let end = low.0.saturating_mul(2);
            high = (end, low.1 + libm::sqrt(low.0 as f64) * self.draw(end));
        }
        while high.0 != second {
            let middle = self.between(low, high);
            if second < middle.0 || middle.0 == low.0 {
                high = middle;
            } else if second == middle.0 {
                return middle.1;
            } else {
                low = middle;
            }
        }
        high.1
    }

    fn between(&self, low: (u64, f64), high: (u64, f64)) -> (u64, f64) {
        let middle = u64::midpoint(low.0, high.0);
        let deviation = libm::sqrt((high.0 - low.0) as f64) / 2.0;
        (middle, f64::midpoint(low.1, high.1) + deviation * self.draw(middle))
    }

    fn draw(&self, second: u64) -> f64 {
        draw(self.seed, self.effect, second)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_path_is_one_however_it_is_asked() {
        let mut forwards = Wiener::new(3, "test");
        let values: Vec<f64> = (0..100).map(|i| forwards.at(f64::from(i) * 0.7)).collect();
        for (i, value) in (0..100).zip(&values).rev() {
            let mut alone = Wiener::new(3, "test");
            assert_eq!(alone.at(f64::from(i) * 0.7).to_bits(), value.to_bits());
        }
        assert!(Wiener::new(3, "test").at(1e12).is_finite());
        assert_eq!(Wiener::new(3, "test").at(-1.0).to_bits(), 0);
    }

    #[test]
    fn increments_are_independent_with_the_variance_of_their_length() {
        // 4000 seeds: a variance's standard error is 2.2 %, a correlation's 1.6 %.
        const N: u32 = 4000;
        let mut sums = [0.0; 6];
        let mut crossed = 0.0;
        let times = [0.0, 1.0, 5.0, 13.0, 64.0, 65.0, 100.0];
        for seed in 0..u64::from(N) {
            let mut path = Wiener::new(seed, "test");
            let values = times.map(|t| path.at(t));
            for (i, sum) in sums.iter_mut().enumerate() {
                let step = (values[i + 1] - values[i]) / libm::sqrt(times[i + 1] - times[i]);
                *sum += step * step / f64::from(N);
            }
            crossed += values[2] * (values[4] - values[2]) / libm::sqrt(5.0 * 59.0) / f64::from(N);
        }
        for sum in sums {
            assert!((sum - 1.0).abs() < 0.1, "{sums:?}");
        }
        assert!(crossed.abs() < 0.07, "{crossed}");
    }
}
