//! How strong a penalty the data themselves ask for: the strength under which they are likeliest,
//! all fields weighed by the prior that the penalty is (restricted maximum likelihood: Patterson and
//! Thompson 1971; Wahba 1985, "A comparison of GCV and GML"). The free constant is integrated out.
//!
//! In coordinates in which the prior is λ times the identity, and with the free direction taken out,
//! rows R z with eigenvalues s² of R Rᵀ and components a of z along its eigenvectors have
//! -2 log L = (n - 1) log φ + Σ log(1 + s²/λ) + (ρ + Σ a²/(1 + s²/λ))/φ, where φ is the variance of a
//! reading over its stated one and ρ the squares that no field of the basis takes up.

use crate::FitError;
use crate::penalty::Roughness;
use crate::spectral::Eigen;
use crate::triangle::Solution;
use faer::Mat;

/// A strength and how likely the data are under it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Likeliest {
    /// λ, over φ.
    pub(crate) strength: f64,
    /// Variance of the readings over what was stated.
    pub(crate) scale: f64,
    /// -2 log L.
    pub(crate) deviance: f64,
}

/// What a triangle says of strengths.
pub(crate) struct Evidence {
    squares: Vec<f64>,
    components: Vec<f64>,
    rest: f64,
    readings: f64,
    scale_min: f64,
}

impl Evidence {
    /// Of the whitened rows' triangle with the values as its first side; `scale_min` is the least φ
    /// there can be.
    pub(crate) fn new(
        solution: &Solution,
        readings: usize,
        scale_min: f64,
        roughness: &Roughness,
    ) -> Result<Self, FitError> {
        let mut standard = roughness.standard(solution.r());
        let (mut z, rest) = (solution.rotated(0), solution.residual_squares(0));
        let p = z.len();
        reflect_first(&mut standard, &mut z);
        let held = standard.as_ref().submatrix(1, 1, p - 1, p - 1);
        let gram = held * held.transpose();
        let Eigen { values, vectors } = Eigen::of(&gram).ok_or(FitError::OutOfRange)?;
        let components = (0..p - 1)
            .map(|i| (0..p - 1).map(|k| vectors[(k, i)] * z[k + 1]).sum::<f64>())
            .collect();
        let squares = (0..p - 1).map(|i| values[i].max(0.0)).collect();
        Ok(Self { squares, components, rest, readings: readings as f64, scale_min })
    }

    /// The best strength of all, to a few per cent.
    pub(crate) fn likeliest(&self) -> Option<Likeliest> {
        let largest = self.squares.iter().copied().fold(0.0, f64::max);
        if largest <= 0.0 || self.readings < 2.0 {
            return None;
        }
        let at = |step: f64| self.at(largest * libm::exp2(step));
        let mut best = (STEP_LEAST, at(STEP_LEAST));
        let mut step = STEP_LEAST;
        while step < STEP_MOST {
            step += 2.0;
            let found = at(step);
            if found.deviance < best.1.deviance {
                best = (step, found);
            }
        }
        for width in [1.0, 0.5, 0.25, 0.125] {
            for step in [best.0 - width, best.0 + width] {
                let found = at(step);
                if found.deviance < best.1.deviance {
                    best = (step, found);
                }
            }
        }
        best.1.deviance.is_finite().then_some(best.1)
    }

    /// At a given strength, the scatter of the readings left to the data.
    pub(crate) fn with(&self, strength: f64) -> Likeliest {
        let mut found = self.at(strength * self.scale_min);
        for _ in 0..ROUNDS {
            found = self.at(strength * found.scale);
        }
        Likeliest { strength, ..found }
    }

    /// λ being relative to φ here.
    fn at(&self, lambda: f64) -> Likeliest {
        let (mut logs, mut squares) = (0.0, self.rest);
        for (square, component) in self.squares.iter().zip(&self.components) {
            let factor = 1.0 + square / lambda;
            logs += libm::log(factor);
            squares += component * component / factor;
        }
        let free = self.readings - 1.0;
        let scale = (squares / free).max(self.scale_min).max(f64::MIN_POSITIVE);
        let deviance = free * libm::log(scale) + logs + squares / scale;
        Likeliest { strength: lambda / scale, scale, deviance }
    }
}

/// Reflects rows so that the first column has but its first element.
fn reflect_first(r: &mut Mat<f64>, z: &mut [f64]) {
    let p = z.len();
    let mut v: Vec<f64> = (0..p).map(|i| r[(i, 0)]).collect();
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length == 0.0 {
        return;
    }
    v[0] += if v[0] > 0.0 { length } else { -length };
    let square: f64 = v.iter().map(|x| x * x).sum();
    let reflect = |column: &mut [f64]| {
        let product: f64 = column.iter().zip(&v).map(|(x, v)| x * v).sum();
        let factor = 2.0 * product / square;
        column.iter_mut().zip(&v).for_each(|(x, v)| *x -= factor * v);
    };
    for j in 0..p {
        reflect(r.col_as_slice_mut(j));
    }
    reflect(z);
}

/// Strengths from 2^-36 of the best determined combination's weight to 2^20 times it.
const STEP_LEAST: f64 = -36.0;
const STEP_MOST: f64 = 20.0;
/// φ and λ φ agree after so many rounds.
const ROUNDS: usize = 20;
