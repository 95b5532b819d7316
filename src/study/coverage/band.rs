//! What honest answers look like: the ranges in which all but one in a thousand experiments fall when
//! every stated uncertainty is right and every error normal.

/// The normal distribution's 99.95 % quantile.
const Z: f64 = 3.290_526_731_491_926;
/// What lies outside on either side.
const TAIL: f64 = 0.000_5;

/// The central 99.9 % of the RMS of `n` independent standard normal numbers: sqrt(χ²/n), its
/// quantiles by Wilson and Hilferty (1931), right to 2 % from n = 10 on.
pub fn rms_band(n: usize) -> (f64, f64) {
    let n = n as f64;
    let spread = 2.0 / (9.0 * n);
    let quantile = |z: f64| {
        let root = (1.0 - spread + z * libm::sqrt(spread)).max(0.0);
        libm::sqrt(root * root * root)
    };
    (quantile(-Z), quantile(Z))
}

/// The least and the most of `n` independent trials that succeed in 99.9 % of experiments, when each
/// does with this chance: at most a half in a thousand lies outside on either side, exactly by the
/// binomial distribution.
pub fn binomial_band(n: usize, chance: f64) -> (usize, usize) {
    let count = n as f64;
    let log_choose =
        |k: f64| libm::lgamma(count + 1.0) - libm::lgamma(k + 1.0) - libm::lgamma(count - k + 1.0);
    let (yes, no) = (libm::log(chance), libm::log1p(-chance));
    let part = |k: usize| {
        let k = k as f64;
        libm::exp(log_choose(k) + k * yes + (count - k) * no)
    };
    let mut below = 0.0;
    let low = (0..=n).find(|&k| {
        below += part(k);
        below > TAIL
    });
    let mut above = 0.0;
    let high = (0..=n).rev().find(|&k| {
        above += part(k);
        above > TAIL
    });
    (low.unwrap_or(0), high.unwrap_or(n))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rms_band_is_that_of_the_chi_square_tables() {
        // χ² of 100 degrees of freedom at 0.05 % and 99.95 %: 59.896 and 153.167 (any table).
        let (low, high) = rms_band(100);
        assert!((low - 0.773_9).abs() < 3e-3 && (high - 1.237_6).abs() < 3e-3, "{low} {high}");
    }

    #[test]
    fn the_binomial_band_leaves_at_most_a_half_in_a_thousand_on_either_side() {
        // Ten trials at one half: none with the chance 1/1024, which is more; so is ten.
        assert_eq!(binomial_band(10, 0.5), (0, 10));
        // Twenty: the chance of 2 or fewer is 2.0e-4, of 3 or fewer 1.3e-3.
        assert_eq!(binomial_band(20, 0.5), (3, 17));
        // A thousand at 95 %: mean 950, standard deviation 6.9.
        let (low, high) = binomial_band(1000, 0.95);
        assert!((925..=928).contains(&low) && (970..=973).contains(&high), "{low} {high}");
    }
}
