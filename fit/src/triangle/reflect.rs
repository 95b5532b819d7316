//! Rows into a triangle by reflections: safe for whatever the rows are.
//!
//! Householder reflections of [R; B] that touch of R only its upper triangle, in panels of a few
//! columns that are split in halves down to one (Elmroth & Gustavson 2000, "Applying recursion to
//! serial and parallel QR factorization", IBM J. Res. Dev. 44(4), §2; the compact form Q = I - V T Vᵀ
//! of Schreiber & Van Loan 1989). Costs 2 n p² operations for n rows, without the zeros of R that a
//! factorisation of [R; B] as it stands would take along. Backward stable, column by column.

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::prelude::ReborrowMut;
use faer::{Accum, Mat, MatMut, MatRef, Par};

/// Makes `r` the triangle of [r; rows]. `rows` has the columns of `r` and is used up.
pub(super) fn absorb(r: &mut Mat<f64>, mut rows: MatMut<'_, f64>) {
    let columns = r.ncols();
    let mut product = Mat::zeros(PANEL, PANEL);
    for from in (0..columns).step_by(PANEL) {
        let width = PANEL.min(columns - from);
        let (_, right) = rows.rb_mut().split_at_col_mut(from);
        let (mut panel, right) = right.split_at_col_mut(width);
        let (top, top_right) =
            r.as_mut().get_mut(from..from + width, from..).split_at_col_mut(width);
        let mut product = product.as_mut().get_mut(..width, ..width);
        factor(top, panel.rb_mut(), product.rb_mut());
        if right.ncols() > 0 {
            apply(panel.as_ref(), product.as_ref(), top_right, right);
        }
    }
}

/// Reflects the columns of [r; rows] onto the triangle `r`; leaves V in `rows` and T in `product`.
fn factor(r: MatMut<'_, f64>, rows: MatMut<'_, f64>, product: MatMut<'_, f64>) {
    let width = r.ncols();
    if width == 1 {
        return reflect(r, rows, product);
    }
    let half = width / 2;
    let (mut left, mut right) = rows.split_at_col_mut(half);
    let (r_left, top_right, _, r_right) = r.split_at_mut(half, half);
    let (mut t_left, mut t_across, _, mut t_right) = product.split_at_mut(half, half);
    factor(r_left, left.rb_mut(), t_left.rb_mut());
    apply(left.as_ref(), t_left.as_ref(), top_right, right.rb_mut());
    factor(r_right, right.rb_mut(), t_right.rb_mut());
    // -T₁ (V₁ᵀ V₂) T₂; the ones of V stand in rows of their own.
    let across = multiply(left.as_ref().transpose(), right.as_ref());
    let across = triangular_left(t_left.as_ref(), BlockStructure::TriangularUpper, &across);
    triangular::matmul(
        t_across.rb_mut(),
        BlockStructure::Rectangular,
        Accum::Replace,
        across.as_ref(),
        BlockStructure::Rectangular,
        t_right.as_ref(),
        BlockStructure::TriangularUpper,
        -1.0,
        Par::Seq,
    );
}

/// The reflection I - τ [1; v][1; v]ᵀ that takes one column [α; x] to [±|(α, x)|; 0].
fn reflect(mut r: MatMut<'_, f64>, rows: MatMut<'_, f64>, mut product: MatMut<'_, f64>) {
    let (alpha, x) = (r[(0, 0)], rows.col_mut(0));
    let below = x.norm_l2();
    if below == 0.0 {
        product[(0, 0)] = 0.0;
        return;
    }
    let beta = -alpha.hypot(below).copysign(alpha);
    x.iter_mut().for_each(|x| *x /= alpha - beta);
    product[(0, 0)] = (beta - alpha) / beta;
    r[(0, 0)] = beta;
}

/// Applies (I - V T Vᵀ)ᵀ, V being [1; v], to [top; below].
fn apply(
    v: MatRef<'_, f64>,
    product: MatRef<'_, f64>,
    mut top: MatMut<'_, f64>,
    below: MatMut<'_, f64>,
) {
    let mut change = top.as_ref().to_owned();
    matmul(change.as_mut(), Accum::Add, v.transpose(), below.as_ref(), 1.0, Par::Seq);
    let change = triangular_left(product.transpose(), BlockStructure::TriangularLower, &change);
    top -= &change;
    matmul(below, Accum::Add, v, change.as_ref(), -1.0, Par::Seq);
}

fn multiply(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    let mut product = Mat::zeros(a.nrows(), b.ncols());
    matmul(product.as_mut(), Accum::Replace, a, b, 1.0, Par::Seq);
    product
}

/// A triangular matrix times a full one.
fn triangular_left(a: MatRef<'_, f64>, structure: BlockStructure, b: &Mat<f64>) -> Mat<f64> {
    let mut product = Mat::zeros(a.nrows(), b.ncols());
    triangular::matmul(
        product.as_mut(),
        BlockStructure::Rectangular,
        Accum::Replace,
        a,
        structure,
        b.as_ref(),
        BlockStructure::Rectangular,
        1.0,
        Par::Seq,
    );
    product
}

/// Columns of a panel: narrower ones leave less to the small products, wider ones more to the
/// large ones. Measured at 64 to 1024 columns.
const PANEL: usize = 32;
