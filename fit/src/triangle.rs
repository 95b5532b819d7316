//! The streamed orthogonal factorisation: rows come in blocks and leave a triangle behind that
//! holds all that least squares needs, in memory that doesn't grow with the number of rows.
//!
//! A block B is taken in by factoring [R; B] and keeping the new R (Golub & Van Loan 2013, Matrix
//! Computations, §6.5.3 and §5.2.2 for the factorisation; Demmel et al. 2012, "Communication-optimal
//! parallel and sequential QR and LU", for the tree of such steps). The order in which rows come
//! changes R by rounding alone.

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
    /// R on top, below it the rows that wait for the next factorisation.
    work: Mat<f64>,
    waiting: usize,
}

impl Triangle {
    /// An empty triangle.
    pub fn new(unknowns: usize, sides: usize) -> Self {
        let columns = unknowns + sides;
        let block = (BLOCK_ROWS_PER_COLUMN * columns).max(BLOCK_ROWS_MIN);
        let work = Mat::zeros(columns + block, columns);
        Self { unknowns, sides, rows: 0, work, waiting: 0 }
    }

    /// Takes in one row: `unknowns` numbers, then one for each right-hand side, all already
    /// divided by the reading's standard uncertainty.
    ///
    /// # Panics
    /// When the row's length is not that of the triangle's columns.
    pub fn absorb(&mut self, row: &[f64]) {
        assert_eq!(row.len(), self.columns(), "a row has as many numbers as there are columns");
        let at = self.columns() + self.waiting;
        for (j, value) in row.iter().enumerate() {
            self.work[(at, j)] = *value;
        }
        self.waiting += 1;
        self.rows += 1;
        if at + 1 == self.work.nrows() {
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
        if self.waiting == 0 {
            return;
        }
        let columns = self.columns();
        let rows = columns + self.waiting;
        let size = factor::recommended_block_size::<f64>(rows, columns);
        let scratch =
            factor::qr_in_place_scratch::<f64>(rows, columns, size, Par::Seq, Spec::default());
        let mut householder = Mat::zeros(size, columns);
        factor::qr_in_place(
            self.work.as_mut().get_mut(..rows, ..),
            householder.as_mut(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Spec::default(),
        );
        for j in 0..columns {
            for i in j + 1..rows {
                self.work[(i, j)] = 0.0;
            }
        }
        self.waiting = 0;
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
