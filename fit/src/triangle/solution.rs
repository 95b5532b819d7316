//! What the rows of a closed triangle determine, how well, and what they leave open.

use crate::spectral::Singular;
use faer::linalg::triangular_solve::solve_upper_triangular_in_place;
use faer::{Mat, MatRef, Par};

/// What a closed [`Triangle`](super::Triangle) determines.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The triangle of unknowns and right-hand sides.
    whole: Mat<f64>,
    unknowns: usize,
}

impl Solution {
    /// Takes a triangle up; `None` if it holds numbers that are not finite.
    pub(super) fn of(whole: Mat<f64>, unknowns: usize) -> Option<Self> {
        let is_finite = whole.col_iter().all(|column| column.norm_l2().is_finite());
        is_finite.then_some(Self { whole, unknowns })
    }

    /// How many unknowns there are.
    #[expect(clippy::len_without_is_empty, reason = "a fit without unknowns is never asked for")]
    pub fn len(&self) -> usize {
        self.unknowns
    }

    /// What is determined, and how well. Returns `None` if the decomposition doesn't converge.
    pub fn spectrum(&self) -> Option<Spectrum> {
        Spectrum::of(self.r())
    }

    /// The unknowns that fit a right-hand side best. Meaningful at full rank.
    pub fn unknowns(&self, side: usize) -> Vec<f64> {
        let sides = self.whole.as_ref().get(..self.unknowns, self.unknowns..);
        let mut x = sides.subcols(side, 1).to_owned();
        solve_upper_triangular_in_place(self.r(), x.as_mut(), Par::Seq);
        x.col(0).iter().copied().collect()
    }

    /// The sum of squared residuals of a right-hand side.
    pub fn residual_squares(&self, side: usize) -> f64 {
        let column = self.unknowns + side;
        (self.unknowns..=column).map(|i| self.whole[(i, column)].powi(2)).sum()
    }

    /// S = R⁻¹, upper triangular, so that the unknowns' covariance is S Sᵀ for rows of unit
    /// variance; packed by columns. Meaningful at full rank.
    pub fn inverse(&self) -> Vec<f64> {
        let (p, inverse) = (self.unknowns, self.inverse_matrix());
        (0..p).flat_map(|j| (0..=j).map(move |i| (i, j))).map(|at| inverse[at]).collect()
    }

    /// R⁻¹ as a matrix.
    pub(crate) fn inverse_matrix(&self) -> Mat<f64> {
        let mut inverse = Mat::<f64>::identity(self.unknowns, self.unknowns);
        solve_upper_triangular_in_place(self.r(), inverse.as_mut(), Par::Seq);
        inverse
    }

    /// The rotated right-hand side, over the unknowns.
    pub(crate) fn rotated(&self, side: usize) -> Vec<f64> {
        (0..self.unknowns).map(|i| self.whole[(i, self.unknowns + side)]).collect()
    }

    /// The triangle of the unknowns.
    pub(crate) fn r(&self) -> MatRef<'_, f64> {
        self.whole.as_ref().get(..self.unknowns, ..self.unknowns)
    }
}

/// Singular values of R with its columns scaled to length 1, and the directions of the small ones.
#[derive(Debug, Clone)]
pub struct Spectrum {
    values: Vec<f64>,
    /// The unknowns' shares in the combinations that are not determined.
    undetermined_shares: Vec<f64>,
}

impl Spectrum {
    fn of(r: MatRef<'_, f64>) -> Option<Self> {
        let p = r.ncols();
        let lengths: Vec<f64> = r.col_iter().map(|column| column.norm_l2()).collect();
        let divisor = |length: f64| if length > 0.0 { length } else { 1.0 };
        let scaled = Mat::from_fn(p, p, |i, j| r[(i, j)] / divisor(lengths[j]));
        let values = Singular::values(&scaled)?;
        let mut spectrum = Self { values, undetermined_shares: vec![0.0; p] };
        let rank = spectrum.rank();
        // The directions cost another p² of memory, and are of interest only where some are open.
        if rank < p {
            let Singular { right, .. } = Singular::of(&scaled)?;
            let share = |k: usize| (rank..p).map(|i| right[(k, i)].powi(2)).sum();
            spectrum.undetermined_shares = (0..p).map(share).collect();
        }
        Some(spectrum)
    }

    /// Largest over smallest singular value; infinite when a column is zero.
    pub fn condition(&self) -> f64 {
        match (self.values.first(), self.values.last()) {
            (Some(largest), Some(smallest)) => largest / smallest,
            _ => 1.0,
        }
    }

    /// How many combinations of unknowns are determined.
    pub fn rank(&self) -> usize {
        let largest = self.values.first().copied().unwrap_or(0.0);
        self.values.iter().filter(|value| **value > RANK_TOLERANCE * largest).count()
    }

    /// The unknowns' shares, from 0 to 1, in what is not determined: all 0 at full rank.
    pub fn undetermined_shares(&self) -> &[f64] {
        &self.undetermined_shares
    }
}

/// A combination is determined when its singular value is above this share of the largest one.
/// The factorisation itself takes a column for dependent below about 1e-11 of its length.
const RANK_TOLERANCE: f64 = 1e-10;
