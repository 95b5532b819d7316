//! Common components that are fitted along: a few columns more, before those of the field.
//!
//! A component being off by t of its u shifts the values by t z. As a column z with a row of its own
//! that says 0 ± 1 it takes from the residuals what they tell of it. The columns stand first: what is left of
//! the triangle below and to the right of theirs is that of the field with the nuisances fitted, whatever
//! they are, and everything else goes on from there (Golub & Van Loan 2013, §5.3.3 on ordering;
//! Bierman 1977, "Factorization Methods for Discrete Sequential Estimation", §VII on bias parameters).
//!
//! What remains of their uncertainty is common to all samples: the coefficients' shift by each prior row
//! being off by one is carried like any common component's, and taken out of the independent part.

use crate::readings::Fitted;
use crate::triangle::{Solution, Triangle};
use crate::{Common, FitError};
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_upper_triangular_in_place,
};
use faer::{Mat, MatRef, Par, Side};

/// A solution for the field, and the rows above it that say what the nuisances are then.
#[derive(Debug)]
pub(crate) struct Solved {
    pub(crate) field: Solution,
    /// The nuisances' rows over nuisances, field and sides.
    rows: Mat<f64>,
    count: usize,
}

impl Solved {
    /// Of a triangle whose first columns are those of so many nuisances; `prior` takes in what is held
    /// against the field.
    pub(crate) fn of(
        triangle: Triangle,
        count: usize,
        prior: impl FnOnce(&mut Triangle),
    ) -> Result<Self, FitError> {
        let (rows, mut field) = triangle.split_off(count);
        prior(&mut field);
        let field = field.solve().ok_or(FitError::OutOfRange)?;
        Ok(Self { field, rows, count })
    }

    /// The nuisances, in units of their u, where the field's coefficients are these.
    pub(crate) fn nuisances(&self, coefficients: &[f64]) -> Vec<f64> {
        self.against(coefficients, true)
    }

    /// What of the nuisances carries a functional of the field's coefficients, given C f.
    pub(crate) fn carried(&self, carried: &[f64]) -> Vec<f64> {
        self.against(carried, false)
    }

    /// Solves the nuisances' rows for them: of values or of zeros.
    fn against(&self, coefficients: &[f64], has_values: bool) -> Vec<f64> {
        let (q, p) = (self.count, coefficients.len());
        let mut x = Mat::from_fn(q, 1, |i, _| {
            let value = if has_values { self.rows[(i, q + p)] } else { 0.0 };
            value - (0..p).map(|j| self.rows[(i, q + j)] * coefficients[j]).sum::<f64>()
        });
        solve_upper_triangular_in_place(self.own(), x.as_mut(), Par::Seq);
        (0..q).map(|i| x[(i, 0)]).collect()
    }

    /// What other readings make of the field's coefficients, a column for each set: of their products
    /// with the rows, AᵀW^½ y, nuisances first, (RᵀR)⁻¹ times that.
    pub(crate) fn refitted(&self, sides: &Mat<f64>) -> Mat<f64> {
        let (q, p) = (self.count, self.field.len());
        let mut field = sides.as_ref().get(q.., ..).to_owned();
        if q > 0 {
            let mut own = sides.as_ref().get(..q, ..).to_owned();
            solve_lower_triangular_in_place(self.own().transpose(), own.as_mut(), Par::Seq);
            field -= self.rows.as_ref().get(.., q..q + p).transpose() * own;
        }
        solve_lower_triangular_in_place(self.field.r().transpose(), field.as_mut(), Par::Seq);
        solve_upper_triangular_in_place(self.field.r(), field.as_mut(), Par::Seq);
        field
    }

    /// With what is left of their uncertainty. `inverse` is S of the field's covariance S Sᵀ.
    pub(crate) fn fitted(
        &self,
        nuisances: &[Common],
        coefficients: &[f64],
        inverse: &Mat<f64>,
    ) -> Vec<Fitted> {
        let (q, p) = (self.count, coefficients.len());
        let mut own = Mat::<f64>::identity(q, q);
        solve_upper_triangular_in_place(self.own(), own.as_mut(), Par::Seq);
        let across = self.rows.as_ref().get(.., q..q + p) * inverse;
        let across = &own * across;
        let values = self.nuisances(coefficients);
        let u = |k: usize| (own.row(k).squared_norm_l2() + across.row(k).squared_norm_l2()).sqrt();
        nuisances
            .iter()
            .zip(values)
            .enumerate()
            .map(|(k, (common, value))| Fitted { name: common.name.clone(), value, u: u(k) })
            .collect()
    }

    fn own(&self) -> MatRef<'_, f64> {
        self.rows.as_ref().get(.., ..self.count)
    }
}

/// S' upper triangular with S' S'ᵀ = S Sᵀ - Σ d dᵀ, which has to be a covariance: what is
/// independent of the whole S Sᵀ, the shifts d being what is not. `r` is S⁻¹.
pub(crate) fn without(
    inverse: &Mat<f64>,
    r: MatRef<'_, f64>,
    shifts: &[Vec<f64>],
) -> Option<Mat<f64>> {
    if shifts.is_empty() {
        return Some(inverse.clone());
    }
    let p = inverse.ncols();
    // S (1 - W Wᵀ) Sᵀ with W = S⁻¹ D; of the middle U Uᵀ with U upper triangular, turned about.
    let d = Mat::from_fn(p, shifts.len(), |i, k| shifts[k][i]);
    let w = r * d;
    let turned = Mat::from_fn(p, shifts.len(), |i, k| w[(p - 1 - i, k)]);
    let product = &turned * turned.transpose();
    let middle =
        Mat::from_fn(p, p, |i, j| f64::from(u8::from(i == j)) * (1.0 + EDGE) - product[(i, j)]);
    let lower = middle.llt(Side::Lower).ok()?;
    let lower = lower.L();
    let upper = Mat::from_fn(p, p, |i, j| lower[(p - 1 - i, p - 1 - j)]);
    Some(inverse * upper)
}

/// An upper triangular matrix packed by columns.
pub(crate) fn packed(upper: &Mat<f64>, factor: f64) -> Vec<f64> {
    let p = upper.ncols();
    (0..p).flat_map(|j| (0..=j).map(move |i| (i, j))).map(|at| factor * upper[at]).collect()
}

/// Keeps the middle positive where a shift holds nearly all of a combination's variance.
const EDGE: f64 = 1e-12;
