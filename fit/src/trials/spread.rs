//! What trials of a number say of it: mean, standard deviation, and the intervals that hold 95 % of
//! them (JCGM 101:2008, 7.6 and 7.7). Knows no fields.

/// From a number to another one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// The lower end.
    pub low: f64,
    /// The upper end.
    pub high: f64,
}

/// What a number's trials say of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// The mean of the trials.
    pub mean: f64,
    /// Their standard deviation: the standard uncertainty.
    pub u: f64,
    /// As many trials below it as above: 2.5 % each.
    pub symmetric: Interval,
    /// The shortest that holds 95 % of the trials; of equally short ones the lowest.
    pub shortest: Interval,
    /// The standard deviation that an end of the symmetric interval itself has with so many trials,
    /// if the number is about normal.
    pub end_sd: f64,
}

impl Spread {
    /// Trials that it takes at least: with fewer no 2.5 % can be left out at either end.
    pub const TRIALS_MIN: usize = 100;

    /// Of trials, in any order; `None` of fewer than [`TRIALS_MIN`](Self::TRIALS_MIN) or where one
    /// isn't finite.
    ///
    /// ```
    /// use fit::trials::Spread;
    /// // 0 to 999, each once.
    /// let spread = Spread::of((0..1000).map(f64::from).collect()).ok_or("too few")?;
    /// assert!((spread.mean - 499.5).abs() < 1e-9 && (spread.u - 288.8).abs() < 0.1);
    /// assert!((spread.symmetric.high - spread.symmetric.low - 950.0).abs() < 0.5);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of(mut trials: Vec<f64>) -> Option<Self> {
        let n = trials.len();
        if n < Self::TRIALS_MIN || !trials.iter().all(|value| value.is_finite()) {
            return None;
        }
        trials.sort_by(f64::total_cmp);
        // From the middle, so that the squares of a small spread about a large mean are not lost.
        let middle = trials[n / 2];
        let offset = trials.iter().map(|value| value - middle).sum::<f64>() / n as f64;
        let squares: f64 = trials.iter().map(|value| (value - middle - offset).powi(2)).sum();
        let u = (squares / (n - 1) as f64).sqrt();
        // So many steps from one trial to a later one hold 95 %.
        let steps = (19 * n + 10) / 20;
        let interval = |from: usize| Interval { low: trials[from], high: trials[from + steps] };
        let width = |i: &Interval| i.high - i.low;
        let last = n - 1 - steps;
        let shortest = (0..=last).map(interval);
        let shortest = shortest.min_by(|a, b| width(a).total_cmp(&width(b)))?;
        Some(Self {
            mean: middle + offset,
            u,
            symmetric: interval(last / 2),
            shortest,
            end_sd: END_SD * u / (n as f64).sqrt(),
        })
    }
}

/// `√(p (1 - p))/φ(z_p)` for p = 0.975: the standard deviation of a normal sample's quantile times √n.
const END_SD: f64 = 2.671;

#[cfg(test)]
mod tests {
    use super::*;

    /// As even a sample of a distribution as there is, by its quantile function.
    fn even(n: u32, quantile: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..n).map(|i| quantile((f64::from(i) + 0.5) / f64::from(n))).collect()
    }

    #[test]
    fn an_exponentials_intervals_are_its_own() {
        let spread = Spread::of(even(100_000, |p| -libm::log(1.0 - p))).unwrap();
        assert!((spread.mean - 1.0).abs() < 1e-4 && (spread.u - 1.0).abs() < 1e-3);
        let Interval { low, high } = spread.symmetric;
        assert!((low + libm::log(0.975)).abs() < 1e-4, "{low}");
        assert!((high + libm::log(0.025)).abs() < 1e-3, "{high}");
        // Its density falls: the shortest interval begins at 0 and ends where 5 % are left.
        let Interval { low, high } = spread.shortest;
        assert!(low < 1e-4 && (high + libm::log(0.05)).abs() < 1e-3, "{low} {high}");
    }

    #[test]
    fn a_large_mean_leaves_a_small_spread_whole_and_a_constant_has_none() {
        let spread = Spread::of(even(1000, |p| 1e9 + 1e-3 * p)).unwrap();
        assert!((spread.u / (1e-3 / 12.0_f64.sqrt()) - 1.0).abs() < 1e-2, "{}", spread.u);
        let spread = Spread::of(vec![7.0; 100]).unwrap();
        assert!(spread.u.abs() < 1e-300 && (spread.shortest.high - 7.0).abs() < 1e-300);
    }

    #[test]
    fn too_few_trials_and_such_as_are_no_numbers_have_no_spread() {
        assert_eq!(Spread::of(vec![1.0; 99]), None);
        assert_eq!(Spread::of([vec![1.0; 99], vec![f64::NAN]].concat()), None);
        assert!(Spread::of((0..100).map(f64::from).collect()).is_some());
    }

    #[test]
    fn the_ends_of_normal_samples_scatter_as_stated() {
        // φ(1.96) = 0.05845.
        assert!((END_SD - (0.975_f64 * 0.025).sqrt() / 0.058_451).abs() < 1e-3);
    }
}
