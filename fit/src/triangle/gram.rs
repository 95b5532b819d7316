//! Rows into a triangle by sums of products, where that is as good as by reflections and half the
//! time.
//!
//! The normal equations `AᵀA` square the condition of A. Those of C = A R⁻¹ do not, where R is the
//! triangle of the rows so far: their matrix is `1 + CᵀC`, which has no eigenvalue below 1 and none
//! above 1 + |C|², so that its Cholesky factor L is known to a relative rounding of about
//! (1 + |C|²) ε whatever the condition of A, and Lᵀ R is the new triangle (Garrison & Ipsen 2024, "A
//! randomized preconditioned Cholesky-QR algorithm", arXiv:2406.11751, §3; Fukaya et al. 2020,
//! "Shifted Cholesky QR", SIAM J. Sci. Comput. 42(1), for the error analysis). |C|² is bounded here,
//! and each block's C is checked against its rows; a block that passes neither goes to
//! [`super::reflect`].
//!
//! Right-hand sides enter as their residual against the solution so far, for the same reason.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{
    LltRegularization, cholesky_in_place, cholesky_in_place_scratch,
};
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::prelude::ReborrowMut;
use faer::{Accum, Col, Mat, MatMut, Par, Spec};

/// The sums Σ c cᵀ over the rows c = [a R⁻¹ | b - a x] since the triangle was last renewed.
#[derive(Debug, Clone)]
pub(super) struct Gram {
    unknowns: usize,
    /// The lower triangle counts.
    sums: Mat<f64>,
    /// The unknowns' part of the sums' trace.
    trace: f64,
}

impl Gram {
    pub(super) fn new(unknowns: usize, sides: usize) -> Self {
        let columns = unknowns + sides;
        Self { unknowns, sums: Mat::zeros(columns, columns), trace: 0.0 }
    }

    /// Adds rows, one a column of `rows`, if that is safe; says whether it did. Where it is not,
    /// `rows` is used up, and what was summed before is still to be folded into `r`.
    pub(super) fn add(&mut self, r: &Mat<f64>, mut rows: MatMut<'_, f64>) -> bool {
        let p = self.unknowns;
        let unknown = r.as_ref().get(..p, ..p);
        let Some(probe) = probe(r, p) else { return false };
        let (mut a, mut b) = rows.rb_mut().split_at_row_mut(p);
        let before = a.as_ref().transpose() * &probe;
        solve_lower_triangular_in_place(unknown.transpose(), a.rb_mut(), Par::Seq);
        let trace = a.as_ref().squared_norm_l2();
        // NaN is not less than anything.
        let is_measured = trace < TRACE_PER_COLUMN * p as f64;
        if !is_measured {
            return false;
        }
        let after = a.as_ref().transpose() * (unknown * &probe);
        let allowed = RESIDUAL_MAX * (p as f64 * (1.0 + trace)).sqrt();
        let is_exact = (before - after).norm_l2() < allowed;
        if !is_exact {
            return false;
        }
        let sides = r.as_ref().get(..p, p..);
        matmul(b.rb_mut(), Accum::Add, sides.transpose(), a.as_ref(), -1.0, Par::Seq);
        triangular::matmul(
            self.sums.as_mut(),
            BlockStructure::TriangularLower,
            Accum::Add,
            rows.as_ref(),
            BlockStructure::Rectangular,
            rows.as_ref().transpose(),
            BlockStructure::Rectangular,
            1.0,
            Par::Seq,
        );
        self.trace += trace;
        true
    }

    /// Whether the sums have grown so far that they should be folded into the triangle.
    pub(super) fn is_full(&self) -> bool {
        self.trace > TRACE_PER_COLUMN * self.unknowns as f64
    }

    /// Makes `r` the triangle of all rows, those summed included.
    pub(super) fn fold(&mut self, r: &mut Mat<f64>) {
        if self.trace == 0.0 {
            return;
        }
        let (p, columns) = (self.unknowns, r.ncols());
        let (mut unknown, _, mut sides, corner) = self.sums.as_mut().split_at_mut(p, p);
        for j in 0..p {
            unknown[(j, j)] += 1.0;
        }
        let scratch = cholesky_in_place_scratch::<f64>(p, Par::Seq, Spec::default());
        let factored = cholesky_in_place(
            unknown.rb_mut(),
            LltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Spec::default(),
        );
        assert!(factored.is_ok(), "1 + CᵀC has no eigenvalue below 1");
        let lower = unknown.as_ref();
        solve_lower_triangular_in_place(lower, sides.rb_mut().transpose_mut(), Par::Seq);
        // The sides' own corner, less what the unknowns now explain.
        let residual = r.as_ref().get(p.., p..).to_owned();
        let mut squares = corner.as_ref().to_owned();
        for i in 0..columns - p {
            for j in 0..=i {
                let of = |m: usize| residual[(m, i)] * residual[(m, j)];
                let before: f64 = (0..=j).map(of).sum();
                let explained: f64 = (0..p).map(|k| sides[(i, k)] * sides[(j, k)]).sum();
                squares[(i, j)] += before;
                let whole = squares[(i, j)];
                squares[(i, j)] = whole - explained;
            }
        }
        // Lᵀ R from the top, each band from rows that are still the old ones.
        for from in (0..p).step_by(BAND) {
            let to = (from + BAND).min(p);
            let mut band = Mat::zeros(to - from, columns - from);
            matmul(
                band.as_mut(),
                Accum::Replace,
                upper_band(lower, from, to).as_ref(),
                r.as_ref().get(from..p, from..),
                1.0,
                Par::Seq,
            );
            r.as_mut().get_mut(from..to, from..).copy_from(&band);
        }
        for i in 0..columns - p {
            for k in 0..p {
                r[(k, p + i)] += sides[(i, k)];
            }
        }
        write_factor(r.as_mut().get_mut(p.., p..), squares);
        self.sums.fill(0.0);
        self.trace = 0.0;
    }
}

/// Rows `from..to` of Lᵀ from column `from` on.
fn upper_band(lower: faer::MatRef<'_, f64>, from: usize, to: usize) -> Mat<f64> {
    let entry = |i: usize, j: usize| if j >= i { lower[(from + j, from + i)] } else { 0.0 };
    Mat::from_fn(to - from, lower.nrows() - from, entry)
}

/// The Cholesky factor of the residuals' products, as an upper triangle. What is left of a residual
/// that the unknowns explain entirely is rounding, of either sign: it counts as none.
fn write_factor(mut upper: MatMut<'_, f64>, mut squares: Mat<f64>) {
    let sides = squares.nrows();
    upper.fill(0.0);
    for j in 0..sides {
        let pivot = squares[(j, j)].max(0.0).sqrt();
        upper[(j, j)] = pivot;
        if pivot == 0.0 {
            continue;
        }
        for i in j + 1..sides {
            upper[(j, i)] = squares[(i, j)] / pivot;
        }
        for i in j + 1..sides {
            for k in j + 1..=i {
                squares[(i, k)] -= upper[(j, i)] * upper[(j, k)];
            }
        }
    }
}

/// A combination of the unknowns, each as long as its column asks for; `None` where the triangle
/// is no measure of rows yet: a column is empty, or all but a combination of others.
fn probe(r: &Mat<f64>, unknowns: usize) -> Option<Col<f64>> {
    let mut probe = Col::zeros(unknowns);
    for j in 0..unknowns {
        let length = r.col(j).norm_l2();
        // NaN is not greater than anything.
        let is_apart = r[(j, j)].abs() > DIAGONAL_MIN * length;
        if !is_apart {
            return None;
        }
        probe[j] = if j % 2 == 0 { 1.0 } else { -1.0 } / length;
    }
    Some(probe)
}

/// The mean eigenvalue of `CᵀC` may rise to this: L then errs by some hundred ε at most.
const TRACE_PER_COLUMN: f64 = 64.0;
/// Backward error of C, of what its rows are made of, at most: rounding is a hundredth of it.
const RESIDUAL_MAX: f64 = 1e-13;
/// A column whose own part is a smaller share of its length is all but dependent on those before.
const DIAGONAL_MIN: f64 = 1e-9;
/// Rows of the new triangle that are computed at a time.
const BAND: usize = 64;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::triangle::reflect;

    /// Numbers in [-1, 1) of a golden-ratio sequence, well spread.
    fn matrix(rows: usize, columns: usize, offset: f64) -> Mat<f64> {
        let at = |i: usize, j: usize| 0.618_033_988 * (i * columns + j) as f64 * (j + 1) as f64;
        Mat::from_fn(rows, columns, |i, j| 2.0 * (at(i, j) + offset).fract() - 1.0)
    }

    #[test]
    fn sums_of_products_and_reflections_leave_the_same_triangle() {
        let (first, second) = (matrix(60, 9, 0.0), matrix(200, 9, 0.3));
        let mut reflected = Mat::zeros(9, 9);
        reflect::absorb(&mut reflected, first.clone().as_mut());
        let mut summed = reflected.clone();
        reflect::absorb(&mut reflected, second.clone().as_mut());
        let mut gram = Gram::new(7, 2);
        assert!(gram.add(&summed, second.transpose().to_owned().as_mut()));
        gram.fold(&mut summed);
        let (a, b) = (reflected.transpose() * &reflected, summed.transpose() * &summed);
        let all = first.transpose() * &first + second.transpose() * &second;
        assert!((&a - &all).norm_max() < 1e-12 && (&b - &all).norm_max() < 1e-12);
        for j in 0..9 {
            assert!((j + 1..9).all(|i| summed[(i, j)] == 0.0 && reflected[(i, j)] == 0.0));
        }
    }

    #[test]
    fn rows_that_the_triangle_is_no_measure_of_are_refused() {
        let rows = matrix(60, 9, 0.0);
        let mut gram = Gram::new(7, 2);
        // Nothing was seen yet; then a column almost not; then all of them.
        let mut r = Mat::zeros(9, 9);
        assert!(!gram.add(&r, rows.transpose().to_owned().as_mut()));
        let mut faint = rows.clone();
        faint.col_mut(3).iter_mut().for_each(|value| *value *= 1e-4);
        reflect::absorb(&mut r, faint.as_mut());
        assert!(!gram.add(&r, rows.transpose().to_owned().as_mut()));
        reflect::absorb(&mut r, rows.clone().as_mut());
        assert!(gram.add(&r, rows.transpose().to_owned().as_mut()));
    }
}
