//! Fits whose coefficients are drawn from their covariance: brute force against propagation.

use super::Die;
use fit::{Fit, Parts};

/// Coefficients drawn from the covariance, by nothing but the stored parts.
pub(crate) fn disturbed(parts: &Parts, die: &mut Die) -> Fit {
    let mut parts = parts.clone();
    for j in 0..parts.coefficients.len() {
        let z = die.normal();
        for i in 0..=j {
            parts.coefficients[i] += parts.factor[j * (j + 1) / 2 + i] * z;
        }
    }
    for common in parts.shifts.clone() {
        let z = die.normal();
        for (c, shift) in parts.coefficients.iter_mut().zip(&common.shift) {
            *c += z * shift;
        }
    }
    Fit::from_parts(parts).unwrap()
}

/// The scatter of quantities over disturbed fits is their u; 300 draws tell it to 4 %.
#[track_caller]
pub(crate) fn scatters_as_stated<const N: usize>(
    fit: &Fit,
    u: [f64; N],
    quantities: impl Fn(&Fit) -> [f64; N],
) {
    let mut die = Die::new(5);
    let draws: Vec<[f64; N]> =
        (0..300).map(|_| quantities(&disturbed(fit.parts(), &mut die))).collect();
    for (k, u) in u.into_iter().enumerate() {
        let mean = draws.iter().map(|draw| draw[k]).sum::<f64>() / draws.len() as f64;
        let squares: f64 = draws.iter().map(|draw| (draw[k] - mean).powi(2)).sum();
        let ratio = (squares / (draws.len() - 1) as f64).sqrt() / u;
        assert!((0.86..1.14).contains(&ratio), "quantity {k}: scatter over u: {ratio}");
    }
}
