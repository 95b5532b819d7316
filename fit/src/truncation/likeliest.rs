//! How strongly the readings themselves ask for finer functions to be held: by the marginal likelihood,
//! as in [`crate::choose`]. It knows a joint triangle, and no functions.

use crate::spectral::Eigen;
use crate::triangle::Solution;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Mat, Par};
use std::ops::RangeInclusive;

/// What is held against one finer function more than against another.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hold {
    /// Of 1 and the degree.
    pub(super) power: f64,
    /// How much smaller a function is that varies around the normal or with the place: most sources
    /// are nearly the same all round.
    pub(super) around: f64,
}

impl Default for Hold {
    fn default() -> Self {
        Self { power: POWER, around: 1.0 }
    }
}

/// What is held against finer functions, and how likely the readings are then.
#[derive(Debug, Clone, Copy)]
pub(super) struct Likeliest {
    pub(super) hold: Hold,
    /// λ; infinite without finer functions.
    pub(super) strength: f64,
    /// What the variances are to be multiplied by.
    pub(super) scale: f64,
    /// -2 log of the marginal likelihood.
    pub(super) deviance: f64,
    /// What the deviance is less than without finer functions.
    pub(super) gain: f64,
}

impl Likeliest {
    /// Without finer functions.
    pub(super) fn alone(squares: f64, free: f64, scales: &RangeInclusive<f64>) -> Self {
        let scale = (squares / free.max(1.0)).clamp(*scales.start(), *scales.end());
        let deviance = free * libm::log(scale) + squares / scale;
        Self { hold: Hold::default(), strength: f64::INFINITY, scale, deviance, gain: 0.0 }
    }

    /// The likelier one.
    pub(super) fn or(self, other: Option<Self>) -> Self {
        other.filter(|other| other.deviance < self.deviance).unwrap_or(self)
    }
}

/// How the readings' squares spread over combinations of finer functions that the prior takes for
/// equally large, and how well the readings determine each.
pub(super) struct Shares {
    determined: Vec<f64>,
    components: Vec<f64>,
}

impl Shares {
    /// Of a joint triangle whose first p unknowns are the fit's own. `None` where the combinations
    /// can't be told apart: the iteration for them doesn't converge.
    pub(super) fn of(solution: &Solution, p: usize, root: &Mat<f64>) -> Option<Self> {
        let q = root.nrows();
        let z = solution.rotated(0).split_off(p);
        // X L = R, so Lᵀ Xᵀ = Rᵀ.
        let mut turned = solution.r().submatrix(p, p, q, q).transpose().to_owned();
        solve_lower_triangular_in_place(root.transpose(), turned.as_mut(), Par::Seq);
        let gram = turned.transpose() * &turned;
        let Eigen { values, vectors } = Eigen::of(&gram)?;
        let component = |i: usize| (0..q).map(|k| vectors[(k, i)] * z[k]).sum::<f64>();
        Some(Self {
            determined: (0..q).map(|i| values[i].max(0.0)).collect(),
            components: (0..q).map(component).collect(),
        })
    }

    /// The likeliest strength, to a few per cent.
    pub(super) fn likeliest(
        &self,
        rest: f64,
        free: f64,
        scales: &RangeInclusive<f64>,
    ) -> Option<Likeliest> {
        let largest = self.determined.iter().copied().fold(0.0, f64::max);
        if largest <= 0.0 || free < 1.0 {
            return None;
        }
        let at = |step: f64| self.at(largest * libm::exp2(step), rest, free, scales);
        let mut best = (STEP_MOST, at(STEP_MOST));
        let attempt = |best: &mut (f64, Likeliest), step: f64| {
            let found = at(step);
            if found.deviance < best.1.deviance {
                *best = (step, found);
            }
        };
        let mut step = STEP_MOST;
        while step > STEP_LEAST {
            step -= 2.0;
            attempt(&mut best, step);
        }
        for width in [1.0, 0.5, 0.25, 0.125] {
            let middle = best.0;
            for step in [middle - width, middle + width] {
                attempt(&mut best, step);
            }
        }
        best.1.deviance.is_finite().then_some(best.1)
    }

    /// At a strength over the scale.
    fn at(&self, lambda: f64, rest: f64, free: f64, scales: &RangeInclusive<f64>) -> Likeliest {
        let (mut logs, mut squares) = (0.0, rest);
        for (determined, component) in self.determined.iter().zip(&self.components) {
            let factor = 1.0 + determined / lambda;
            logs += libm::log(factor);
            squares += component * component / factor;
        }
        let scale = (squares / free).clamp(*scales.start(), *scales.end());
        let deviance = free * libm::log(scale) + logs + squares / scale;
        Likeliest { hold: Hold::default(), strength: lambda / scale, scale, deviance, gain: 0.0 }
    }
}

/// Powers of the degree that a prior is tried with.
pub(super) const POWER: f64 = 4.0;
/// Strengths from 2^-36 of the best determined combination's weight to 2^20 times it.
const STEP_LEAST: f64 = -36.0;
const STEP_MOST: f64 = 20.0;
