//! Scatter beyond the stated noise: the variance that, added to every sample's, makes the residuals as
//! large as they should be. Knows residuals and stated variances, one by one or summed up, and no field.

use crate::robust::{CUT_SIGMA, cut_square};

/// Squared residuals r² and stated variances v, as far as sums over them tell.
pub(crate) trait Scatter {
    /// How many there are.
    fn count(&self) -> f64;
    /// Σ r²/(v + τ²) and Σ r²/(v + τ²)².
    fn sums(&self, tau2: f64) -> (f64, f64);
    /// Σ of [`cut_square`] of r²/(v + τ²) times `factor`.
    fn cut_sum(&self, tau2: f64, factor: f64) -> f64;
    /// The largest r².
    fn largest(&self) -> f64;
}

impl Scatter for Vec<(f64, f64)> {
    fn count(&self) -> f64 {
        self.len() as f64
    }

    fn sums(&self, tau2: f64) -> (f64, f64) {
        let sum = |power: i32| self.iter().map(|(r2, v)| r2 / (v + tau2).powi(power)).sum();
        (sum(1), sum(2))
    }

    fn cut_sum(&self, tau2: f64, factor: f64) -> f64 {
        self.iter().map(|(r2, v)| cut_square(r2 / (v + tau2) * factor)).sum()
    }

    fn largest(&self) -> f64 {
        self.iter().map(|(r2, _)| *r2).fold(0.0, f64::max)
    }
}

/// The variance τ² that, added to the stated ones, makes Σ r²/(v + τ²) equal the dof (samples less
/// what they determine: what a penalty smooths away is in the posterior, not counted here twice); 0 where the
/// stated noise explains the residuals.
pub(crate) fn excess(terms: &impl Scatter, dof: f64, is_unknown: bool) -> f64 {
    let threshold = if is_unknown { dof } else { threshold(dof) };
    if dof <= 0.0 || terms.sums(0.0).0 <= threshold {
        return 0.0;
    }
    // Newton's method on 1/Σ, which is concave and rising: from 0 it rises to the root.
    let mut tau2 = 0.0;
    for _ in 0..NEWTON_MAX {
        let (s, slope) = terms.sums(tau2);
        let step = (1.0 / dof - 1.0 / s) * s * s / slope;
        tau2 += step;
        if step <= NEWTON_RELATIVE * tau2 {
            break;
        }
    }
    tau2
}

/// The same by residuals that are cut off where Huber's weight begins to fall: a few large ones say
/// nothing of the scatter of the others.
pub(crate) fn cut_excess(terms: &impl Scatter, dof: f64, is_unknown: bool) -> f64 {
    let n = terms.count();
    if dof <= 0.0 {
        return 0.0;
    }
    let sum = |tau2: f64| terms.cut_sum(tau2, n / dof);
    let threshold = if is_unknown { n } else { n + EXCESS_SIGMA * CUT_SIGMA * n.sqrt() };
    if sum(0.0) <= threshold {
        return 0.0;
    }
    // The sum falls as τ² rises. At the largest residual's square it is below n.
    let mut high = terms.largest() * (n / dof) * 2.0;
    let mut low = 0.0;
    for _ in 0..BISECTIONS {
        // By ratio once there is one: τ² may be anything between rounding and the largest residual.
        let middle = if low > 0.0 { (low * high).sqrt() } else { high / 16.0 };
        if sum(middle) > n {
            low = middle;
        } else {
            high = middle;
        }
        if low > 0.0 && high / low - 1.0 < NEWTON_RELATIVE {
            break;
        }
    }
    high
}

/// The chi² beyond which residuals of so many degrees of freedom are larger than the stated noise.
pub(crate) fn threshold(dof: f64) -> f64 {
    dof + EXCESS_SIGMA * (2.0 * dof).sqrt()
}

/// The excess is taken for real beyond this many standard deviations of chi².
const EXCESS_SIGMA: f64 = 3.0;
/// From the largest residual down to rounding in steps of 16, then by halving the ratio.
const BISECTIONS: usize = 120;
/// More steps than Newton's method needs from any start.
const NEWTON_MAX: usize = 60;
/// The excess is as exact as this.
const NEWTON_RELATIVE: f64 = 1e-6;
