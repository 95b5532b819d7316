//! The streamed orthogonal factorisation: rows come in blocks and leave a triangle behind that
//! holds all that least squares needs, in memory that doesn't grow with the number of rows.
//!
//! A block B is taken in by factoring [R; B] and keeping the new R (Golub & Van Loan 2013, Matrix
//! Computations, §6.5.3 and §5.2.2 for the factorisation; Demmel et al. 2012, "Communication-optimal
//! parallel and sequential QR and LU", for the tree of such steps). The order in which rows come
//! changes R by rounding alone.
//!
//! ```
//! use fit::triangle::Triangle;
//!
//! // 1 + 2 t at t = 0, 1, 2, with 0.1, -0.2, 0.1 on top, which no line follows.
//! let mut triangle = Triangle::new(2, 1);
//! for row in [[1.0, 0.0, 1.1], [1.0, 1.0, 2.8], [1.0, 2.0, 5.1]] {
//!     triangle.absorb(&row);
//! }
//! let solution = triangle.solve().expect("finite numbers");
//! let line = solution.unknowns(0);
//! assert!((line[0] - 1.0).abs() < 1e-14 && (line[1] - 2.0).abs() < 1e-14);
//! assert!((solution.residual_squares(0) - 0.06).abs() < 1e-14);
//! ```

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::qr::no_pivoting::factor;
use faer::linalg::svd;
use faer::linalg::triangular_solve::solve_upper_triangular_in_place;
use faer::{Mat, MatRef, Par, Spec};

/// R of all rows [a | b] taken in so far: `unknowns` columns a, then `sides` right-hand sides b.
#[derive(Debug, Clone)]
pub struct Triangle {
    unknowns: usize,
    sides: usize,
    rows: u64,
    /// R on top, zeros below its diagonal; room for a block of rows under it.
    work: Mat<f64>,
    /// The rows that wait for the next factorisation, one after the other.
    waiting: Vec<f64>,
}

impl Triangle {
    /// An empty triangle.
    pub fn new(unknowns: usize, sides: usize) -> Self {
        let columns = unknowns + sides;
        let block = (BLOCK_ROWS_PER_COLUMN * columns).max(BLOCK_ROWS_MIN);
        let work = Mat::zeros(columns + block, columns);
        let waiting = Vec::with_capacity(block * columns);
        Self { unknowns, sides, rows: 0, work, waiting }
    }

    /// Takes in one row: `unknowns` numbers, then one for each right-hand side, all already
    /// divided by the reading's standard uncertainty.
    ///
    /// # Panics
    /// When the row's length is not that of the triangle's columns.
    pub fn absorb(&mut self, row: &[f64]) {
        assert_eq!(row.len(), self.columns(), "a row has as many numbers as there are columns");
        self.waiting.extend_from_slice(row);
        self.rows += 1;
        if self.waiting.len() == (self.work.nrows() - self.columns()) * self.columns() {
            self.factor();
        }
    }

    /// Takes in all rows that another triangle of the same columns has taken in.
    ///
    /// # Panics
    /// When the columns differ.
    pub fn merge(&mut self, other: &Self) {
        assert_eq!((self.unknowns, self.sides), (other.unknowns, other.sides));
        let mut other = other.clone();
        other.factor();
        let rows = self.rows + other.rows;
        let mut row = vec![0.0; self.columns()];
        for i in 0..self.columns() {
            for (j, value) in row.iter_mut().enumerate() {
                *value = if j < i { 0.0 } else { other.work[(i, j)] };
            }
            self.absorb(&row);
        }
        self.rows = rows;
    }

    /// How many rows were taken in.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Ends the stream: what the rows determine.
    ///
    /// Returns `None` if the numbers left the range of f64.
    pub fn solve(mut self) -> Option<Solution> {
        self.factor();
        let upper = |i: usize, j: usize| if i <= j { self.work[(i, j)] } else { 0.0 };
        let r = Mat::from_fn(self.unknowns, self.unknowns, upper);
        let sides = Mat::from_fn(self.unknowns, self.sides, |i, j| upper(i, self.unknowns + j));
        let residual = |side: usize| {
            let column = self.unknowns + side;
            (self.unknowns..=column).map(|i| upper(i, column).powi(2)).sum()
        };
        let residual_squares: Vec<f64> = (0..self.sides).map(residual).collect();
        let is_finite = residual_squares.iter().all(|square| square.is_finite())
            && r.col_iter().all(|column| column.norm_l2().is_finite());
        is_finite.then_some(Solution { r, sides, residual_squares })
    }

    fn columns(&self) -> usize {
        self.unknowns + self.sides
    }

    /// Factors [R; waiting rows] and keeps the upper triangle.
    fn factor(&mut self) {
        let columns = self.columns();
        if self.waiting.is_empty() {
            return;
        }
        let rows = columns + self.waiting.len() / columns;
        for j in 0..columns {
            let below = self.work.col_as_slice_mut(j)[columns..rows].iter_mut();
            for (to, row) in below.zip(self.waiting.chunks_exact(columns)) {
                *to = row[j];
            }
        }
        self.waiting.clear();
        let block = factor::recommended_block_size::<f64>(rows, columns);
        let scratch =
            factor::qr_in_place_scratch::<f64>(rows, columns, block, Par::Seq, Spec::default());
        factor::qr_in_place(
            self.work.as_mut().get_mut(..rows, ..),
            Mat::zeros(block, columns).as_mut(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Spec::default(),
        );
        for j in 0..columns {
            self.work.col_as_slice_mut(j)[j + 1..rows].fill(0.0);
        }
    }
}

/// What a closed [`Triangle`] determines.
#[derive(Debug, Clone)]
pub struct Solution {
    r: Mat<f64>,
    sides: Mat<f64>,
    residual_squares: Vec<f64>,
}

impl Solution {
    /// How many unknowns there are.
    #[expect(clippy::len_without_is_empty, reason = "a fit without unknowns is never asked for")]
    pub fn len(&self) -> usize {
        self.r.ncols()
    }

    /// What is determined, and how well. Returns `None` if the decomposition doesn't converge.
    pub fn spectrum(&self) -> Option<Spectrum> {
        Spectrum::of(self.r.as_ref())
    }

    /// The unknowns that fit a right-hand side best. Meaningful at full rank.
    pub fn unknowns(&self, side: usize) -> Vec<f64> {
        let mut x = self.sides.as_ref().subcols(side, 1).to_owned();
        solve_upper_triangular_in_place(self.r.as_ref(), x.as_mut(), Par::Seq);
        x.col(0).iter().copied().collect()
    }

    /// The sum of squared residuals of a right-hand side.
    pub fn residual_squares(&self, side: usize) -> f64 {
        self.residual_squares[side]
    }

    /// S = R⁻¹, upper triangular, so that the unknowns' covariance is S Sᵀ for rows of unit
    /// variance; packed by columns. Meaningful at full rank.
    pub fn inverse(&self) -> Vec<f64> {
        let p = self.r.nrows();
        let mut inverse = Mat::<f64>::identity(p, p);
        solve_upper_triangular_in_place(self.r.as_ref(), inverse.as_mut(), Par::Seq);
        (0..p).flat_map(|j| (0..=j).map(move |i| (i, j))).map(|at| inverse[at]).collect()
    }
}

/// Singular values of R with its columns scaled to length 1, and the directions of the small ones.
#[derive(Debug, Clone)]
pub struct Spectrum {
    values: Vec<f64>,
    right: Mat<f64>,
}

impl Spectrum {
    fn of(r: MatRef<'_, f64>) -> Option<Self> {
        let p = r.ncols();
        let lengths: Vec<f64> = r.col_iter().map(|column| column.norm_l2()).collect();
        let divisor = |length: f64| if length > 0.0 { length } else { 1.0 };
        let scaled = Mat::from_fn(p, p, |i, j| r[(i, j)] / divisor(lengths[j]));
        let mut values = faer::diag::Diag::<f64>::zeros(p);
        let mut right = Mat::zeros(p, p);
        let vectors = svd::ComputeSvdVectors::Full;
        let scratch = svd::svd_scratch::<f64>(
            p,
            p,
            svd::ComputeSvdVectors::No,
            vectors,
            Par::Seq,
            Spec::default(),
        );
        svd::svd(
            scaled.as_ref(),
            values.as_mut(),
            None,
            Some(right.as_mut()),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Spec::default(),
        )
        .ok()?;
        Some(Self { values: values.column_vector().iter().copied().collect(), right })
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
    pub fn undetermined_shares(&self) -> Vec<f64> {
        let p = self.right.nrows();
        let share = |k: usize| (self.rank()..p).map(|i| self.right[(k, i)].powi(2)).sum();
        (0..p).map(share).collect()
    }
}

/// A block of this many rows for each column costs a quarter more than one block of all rows.
const BLOCK_ROWS_PER_COLUMN: usize = 4;
/// Fewest rows of a block: below it the factorisation's overhead shows.
const BLOCK_ROWS_MIN: usize = 64;
/// A combination is determined when its singular value is above this share of the largest one.
/// The factorisation itself takes a column for dependent below about 1e-11 of its length.
const RANK_TOLERANCE: f64 = 1e-10;

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers that look random, in [-1, 1).
    fn numbers(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 * 2f64.powi(-52) - 1.0
        }
    }

    /// Rows whose two right-hand sides are 1, 2, .. times the columns, the first with noise.
    fn rows(count: usize, unknowns: usize) -> Vec<Vec<f64>> {
        let mut next = numbers(7);
        let row = |_| {
            let mut row: Vec<f64> = (0..unknowns).map(|_| next()).collect();
            let exact: f64 = row.iter().enumerate().map(|(j, a)| (j + 1) as f64 * a).sum();
            row.push(exact + 0.1 * next());
            row.push(exact);
            row
        };
        (0..count).map(row).collect()
    }

    fn of(rows: &[Vec<f64>], unknowns: usize) -> Triangle {
        let mut triangle = Triangle::new(unknowns, rows[0].len() - unknowns);
        for row in rows {
            triangle.absorb(row);
        }
        triangle
    }

    fn assert_close(a: &[f64], b: &[f64], tolerance: f64) {
        let largest = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(a.len() == b.len() && largest < tolerance, "differ by {largest:e}");
    }

    #[test]
    fn an_exact_side_is_solved_exactly_and_a_noisy_one_leaves_its_residual() {
        let rows = rows(3000, 12);
        let solution = of(&rows, 12).solve().unwrap();
        let expected: Vec<f64> = (1..=12).map(f64::from).collect();
        assert_close(&solution.unknowns(1), &expected, 1e-12);
        assert!(solution.residual_squares(1).sqrt() < 1e-10);
        let found = solution.unknowns(0);
        let residual = |row: &Vec<f64>| {
            row[12] - row[..12].iter().zip(&found).map(|(a, c)| a * c).sum::<f64>()
        };
        let squares: f64 = rows.iter().map(|row| residual(row).powi(2)).sum();
        assert!((solution.residual_squares(0) / squares - 1.0).abs() < 1e-12);
        // The residual is orthogonal to every column.
        for j in 0..12 {
            let product: f64 = rows.iter().map(|row| residual(row) * row[j]).sum();
            assert!(product.abs() < 1e-10, "column {j}: {product:e}");
        }
    }

    #[test]
    fn blocks_and_merged_parts_equal_the_whole() {
        let rows = rows(2500, 9);
        let whole = of(&rows, 9).solve().unwrap();
        let mut merged = of(&rows[1700..], 9);
        merged.merge(&of(&rows[..4], 9)); // fewer rows than unknowns
        merged.merge(&Triangle::new(9, 2));
        merged.merge(&of(&rows[4..1700], 9));
        assert_eq!(merged.rows(), 2500);
        let merged = merged.solve().unwrap();
        for side in 0..2 {
            assert_close(&merged.unknowns(side), &whole.unknowns(side), 1e-12);
        }
        assert!((merged.residual_squares(0) / whole.residual_squares(0) - 1.0).abs() < 1e-12);
        let (a, b) = (merged.spectrum().unwrap(), whole.spectrum().unwrap());
        assert!((a.condition() / b.condition() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_inverse_is_a_factor_of_the_covariance() {
        let rows = rows(200, 5);
        let solution = of(&rows, 5).solve().unwrap();
        let inverse = solution.inverse();
        let s = |i: usize, j: usize| if i <= j { inverse[j * (j + 1) / 2 + i] } else { 0.0 };
        // (AᵀA) S Sᵀ = 1.
        for i in 0..5 {
            for k in 0..5 {
                let gram = |l: usize| rows.iter().map(|row| row[i] * row[l]).sum::<f64>();
                let covariance = |l: usize| (0..5).map(|j| s(l, j) * s(k, j)).sum::<f64>();
                let product: f64 = (0..5).map(|l| gram(l) * covariance(l)).sum();
                assert!((product - f64::from(u8::from(i == k))).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn dependent_and_empty_columns_lower_the_rank_wherever_they_stand() {
        for (copy_to, empty) in [(5, 0), (0, 3), (2, 5)] {
            let mut rows = rows(400, 6);
            for row in &mut rows {
                row[copy_to] = row[1] - 2.0 * row[4];
                row[empty] = 0.0;
            }
            let spectrum = of(&rows, 6).solve().unwrap().spectrum().unwrap();
            assert_eq!(spectrum.rank(), 4);
            let shares = spectrum.undetermined_shares();
            assert!((shares[empty] - 1.0).abs() < 1e-12);
            assert!([1, 4, copy_to].iter().all(|k| shares[*k] > 0.05), "{shares:?}");
            assert!((shares.iter().sum::<f64>() - 2.0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_length_of_a_column_changes_neither_condition_nor_rank() {
        let plain = rows(300, 6);
        let mut stretched = plain.clone();
        for row in &mut stretched {
            for (j, value) in row[..6].iter_mut().enumerate() {
                *value *= [1e-20, 1e-9, 1e-3, 1.0, 1e7, 1e20][j];
            }
        }
        let (a, b) = (of(&plain, 6).solve().unwrap(), of(&stretched, 6).solve().unwrap());
        let condition = a.spectrum().unwrap().condition();
        assert!((b.spectrum().unwrap().condition() / condition - 1.0).abs() < 1e-9);
        assert!((a.residual_squares(0) / b.residual_squares(0) - 1.0).abs() < 1e-10);
    }

    #[test]
    fn numbers_out_of_range_are_no_solution() {
        let mut rows = rows(30, 3);
        rows[7][1] = f64::INFINITY;
        assert!(of(&rows, 3).solve().is_none());
    }
}
