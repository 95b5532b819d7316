//! What an honest answer looks like: the ranges in which 95 % of experiments fall when every
//! stated uncertainty is right and every error normal.

/// Root mean square.
pub fn rms(numbers: &[f64]) -> f64 {
    let squares: f64 = numbers.iter().map(|number| number * number).sum();
    (squares / numbers.len() as f64).sqrt()
}

/// The least and the most of `n` independent numbers within ±2 u that central 95 % of experiments
/// show, when each is so with the normal distribution's 95.45 %. At most 2.5 % lie outside on
/// either side, exactly by the binomial distribution.
pub fn binomial_band(n: usize) -> (usize, usize) {
    let inside = libm::erf(std::f64::consts::SQRT_2);
    let log_choose = |k: usize| {
        libm::lgamma(n as f64 + 1.0)
            - libm::lgamma(k as f64 + 1.0)
            - libm::lgamma((n - k) as f64 + 1.0)
    };
    let chance = |k: usize| {
        (log_choose(k) + k as f64 * inside.ln() + (n - k) as f64 * (1.0 - inside).ln()).exp()
    };
    let mut below = 0.0;
    let low = (0..=n).find(|&k| {
        below += chance(k);
        below > 0.025
    });
    let mut above = 0.0;
    let high = (0..=n).rev().find(|&k| {
        above += chance(k);
        above > 0.025
    });
    (low.unwrap_or(0), high.unwrap_or(n))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_binomial_band_leaves_at_most_a_fortieth_on_either_side() {
        // One trial shows 0 or 1; 0 has the chance 4.55 %, more than a fortieth.
        assert_eq!(binomial_band(1), (0, 1));
        let (low, high) = binomial_band(100);
        assert!((90..=92).contains(&low) && (98..=100).contains(&high), "{low} {high}");
    }
}
