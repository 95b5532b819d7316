//! The streamed orthogonal factorisation: rows come in blocks and leave a triangle behind that
//! holds all that least squares needs, in memory that doesn't grow with the number of rows: three
//! times the triangle's square at most, and blocks of 512 rows.
//!
//! A block B is taken in by factoring [R; B] and keeping the new R (Golub & Van Loan 2013, Matrix
//! Computations, §6.5.3 and §5.2.2; Demmel et al. 2012, "Communication-optimal parallel and
//! sequential QR and LU", for the tree of such steps). The first blocks are taken in by reflections
//! (`reflect`). Once R is a measure of what comes, a block is taken in by the normal equations of
//! B R⁻¹ (`gram`), in about half the time; that those are well conditioned is checked for every
//! block, and reflections do what fails the check. The order in which rows come changes R by
//! rounding alone.
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

pub use solution::{Solution, Spectrum};

use faer::{Mat, MatMut, MatRef};
use gram::Gram;

mod gram;
mod reflect;
mod solution;

/// R of all rows [a | b] taken in so far: `unknowns` columns a, then `sides` right-hand sides b.
#[derive(Debug, Clone)]
pub struct Triangle {
    unknowns: usize,
    sides: usize,
    rows: u64,
    /// Zeros below its diagonal.
    r: Mat<f64>,
    /// What was taken in since `r` was renewed; made when it is first of use.
    gram: Option<Gram>,
    /// The rows that wait for the next factorisation, one after the other.
    waiting: Vec<f64>,
}

impl Triangle {
    /// An empty triangle.
    pub fn new(unknowns: usize, sides: usize) -> Self {
        let columns = unknowns + sides;
        let r = Mat::zeros(columns, columns);
        Self { unknowns, sides, rows: 0, r, gram: None, waiting: Vec::new() }
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
        if self.waiting.len() == BLOCK_ROWS * self.columns() {
            self.take_in();
        }
    }

    /// Takes in all rows that another triangle of the same columns has taken in.
    ///
    /// # Panics
    /// When the columns differ.
    pub fn merge(&mut self, other: &Self) {
        assert_eq!((self.unknowns, self.sides), (other.unknowns, other.sides));
        let mut other = other.clone();
        other.settle();
        let rows = self.rows + other.rows;
        let mut row = vec![0.0; self.columns()];
        for i in 0..self.columns() {
            for (j, value) in row.iter_mut().enumerate() {
                *value = if j < i { 0.0 } else { other.r[(i, j)] };
            }
            self.absorb(&row);
        }
        self.rows = rows;
    }

    /// The upper triangle of unknowns and right-hand sides, packed by columns: R₀₀, R₀₁, R₁₁, ...
    pub fn packed(&self) -> Vec<f64> {
        let mut whole = self.clone();
        whole.settle();
        let columns = 0..self.columns();
        columns.flat_map(|j| whole.r.col_as_slice(j)[..=j].to_vec()).collect()
    }

    /// Takes up a packed triangle of so many rows.
    ///
    /// # Panics
    /// When the length is not that of such a triangle.
    pub fn from_packed(unknowns: usize, sides: usize, rows: u64, packed: &[f64]) -> Self {
        let mut new = Self::new(unknowns, sides);
        let columns = new.columns();
        assert_eq!(packed.len(), columns * (columns + 1) / 2, "a triangle's length");
        for j in 0..columns {
            new.r.col_as_slice_mut(j)[..=j].copy_from_slice(&packed[j * (j + 1) / 2..][..=j]);
        }
        new.rows = rows;
        new
    }

    /// The triangle of rows that are so many times as large.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let mut scaled = self.clone();
        scaled.settle();
        scaled.r *= faer::Scale(factor);
        scaled
    }

    /// The same of some of its unknowns alone: of those that are kept, in their order.
    ///
    /// # Panics
    /// When it isn't said of each unknown whether it is kept.
    #[must_use]
    pub(crate) fn keeping(&self, is_kept: &[bool]) -> Self {
        assert_eq!(is_kept.len(), self.unknowns, "said of every unknown");
        let mut whole = self.clone();
        whole.settle();
        let columns: Vec<usize> =
            (0..self.columns()).filter(|j| is_kept.get(*j).copied().unwrap_or(true)).collect();
        let mut kept = Self::new(columns.len() - self.sides, self.sides);
        for i in 0..self.columns() {
            let entry = |j: &usize| if *j < i { 0.0 } else { whole.r[(i, *j)] };
            kept.absorb(&columns.iter().map(entry).collect::<Vec<f64>>());
        }
        kept.rows = self.rows;
        kept
    }

    /// The sum of squared residuals that these unknowns leave of the first right-hand side.
    pub fn residual_squares(&self, unknowns: &[f64]) -> f64 {
        let mut whole = self.clone();
        whole.settle();
        let p = self.unknowns;
        let residual = |i: usize| {
            let fitted: f64 = (i..p).map(|j| whole.r[(i, j)] * unknowns[j]).sum();
            whole.r[(i, p)] - fitted
        };
        (0..p).map(residual).map(|r| r * r).sum::<f64>() + whole.r[(p, p)].powi(2)
    }

    /// How many rows were taken in.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Ends the stream: what the rows determine.
    ///
    /// Returns `None` if the numbers left the range of f64.
    pub fn solve(mut self) -> Option<Solution> {
        self.settle();
        Solution::of(self.r, self.unknowns)
    }

    /// The rows of the first `count` unknowns, over all columns, and the triangle of the other unknowns
    /// with those fitted along.
    pub(crate) fn split_off(mut self, count: usize) -> (Mat<f64>, Self) {
        self.settle();
        let columns = self.columns();
        let rows = Mat::from_fn(count, columns, |i, j| self.r[(i, j)]);
        let r =
            Mat::from_fn(columns - count, columns - count, |i, j| self.r[(count + i, count + j)]);
        let unknowns = self.unknowns - count;
        (rows, Self { unknowns, r, gram: None, waiting: Vec::new(), ..self })
    }

    fn columns(&self) -> usize {
        self.unknowns + self.sides
    }

    /// Takes in what waits and leaves all of it in `r`.
    fn settle(&mut self) {
        self.take_in();
        if let Some(mut gram) = self.gram.take() {
            gram.fold(&mut self.r);
        }
        self.waiting = Vec::new();
    }

    fn take_in(&mut self) {
        let (columns, rows) = (self.columns(), self.waiting.len() / self.columns());
        if rows == 0 {
            return;
        }
        let mut copy = self.waiting.clone();
        let gram = self.gram.get_or_insert_with(|| Gram::new(self.unknowns, self.sides));
        let added =
            gram.add(&self.r, MatMut::from_column_major_slice_mut(&mut copy, columns, rows));
        if !added || gram.is_full() {
            gram.fold(&mut self.r);
        }
        if !added {
            let waiting = MatRef::from_row_major_slice(&self.waiting, rows, columns);
            let mut block = MatMut::from_column_major_slice_mut(&mut copy, rows, columns);
            block.copy_from(waiting);
            reflect::absorb(&mut self.r, block);
        }
        self.waiting.clear();
    }
}

/// Rows that are taken in at a time: fewer leave the products too thin to be fast, more cost
/// memory and gain nothing.
const BLOCK_ROWS: usize = 512;

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

    /// Rows whose later columns are all but silent in the first `quiet` rows.
    fn late_rows(count: usize, quiet: usize) -> Vec<Vec<f64>> {
        let mut rows = rows(count, 12);
        for row in &mut rows[..quiet] {
            row[8..12].iter_mut().for_each(|value| *value *= 1e-7);
            row[13] = (0..12).map(|j| (j + 1) as f64 * row[j]).sum();
        }
        rows
    }

    #[test]
    fn columns_that_come_late_are_solved_as_well_as_the_others() {
        for quiet in [1, 511, 1500, 3900] {
            let solution = of(&late_rows(4000, quiet), 12).solve().unwrap();
            let expected: Vec<f64> = (1..=12).map(f64::from).collect();
            assert_close(&solution.unknowns(1), &expected, 1e-12);
            assert!(solution.residual_squares(1).sqrt() < 1e-9);
        }
    }

    #[test]
    fn an_ill_conditioned_stream_errs_as_reflections_do() {
        for (nearly, allowed) in [(1e-4, 1e-10), (1e-6, 1e-8), (1e-8, 1e-6)] {
            let mut rows = rows(5000, 8);
            for row in &mut rows {
                row[7] = row[2] + nearly * row[7];
                row[9] = (0..8).map(|j| (j + 1) as f64 * row[j]).sum();
            }
            let solution = of(&rows, 8).solve().unwrap();
            let condition = solution.spectrum().unwrap().condition();
            assert!(condition * nearly > 0.5 && condition * nearly < 5.0, "{condition:e}");
            let expected: Vec<f64> = (1..=8).map(f64::from).collect();
            assert_close(&solution.unknowns(1), &expected, allowed);
        }
    }

    #[test]
    fn a_long_stream_keeps_the_residual_of_a_short_one() {
        let rows = rows(4000, 20);
        let mut triangle = Triangle::new(20, 2);
        for _ in 0..25 {
            for row in &rows {
                triangle.absorb(row);
            }
        }
        let long = triangle.solve().unwrap();
        let short = of(&rows, 20).solve().unwrap();
        let ratio = long.residual_squares(0) / short.residual_squares(0);
        assert!((ratio / 25.0 - 1.0).abs() < 1e-12, "{ratio}");
        assert_close(&long.unknowns(0), &short.unknowns(0), 1e-12);
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
