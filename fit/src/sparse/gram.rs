//! The sums of products that least squares needs, of rows of which few numbers are not zero: taken in
//! in blocks, in memory that grows with the pairs of functions that overlap, not with the rows.

use faer::Mat;

/// The lower triangle of `AᵀA` by columns, and Aᵀb of every side, of all rows [a | b] taken in.
#[derive(Debug, Clone)]
pub(crate) struct Gram {
    /// Rows from the diagonal on, rising.
    columns: Vec<Vec<(usize, f64)>>,
    sides: Mat<f64>,
    block: Vec<Vec<(usize, f64)>>,
}

impl Gram {
    pub(crate) fn new(unknowns: usize, sides: usize) -> Self {
        let columns = vec![Vec::new(); unknowns];
        Self { columns, sides: Mat::zeros(unknowns, sides), block: Vec::new() }
    }

    /// Takes in a row: the numbers that are not zero, by rising place, and the sides.
    pub(crate) fn absorb(&mut self, row: Vec<(usize, f64)>, sides: &[f64]) {
        for (k, side) in sides.iter().enumerate() {
            let column = self.sides.col_as_slice_mut(k);
            for (j, value) in &row {
                column[*j] += value * side;
            }
        }
        self.block.push(row);
        if self.block.len() == BLOCK_ROWS {
            self.settle();
        }
    }

    /// All columns, and the sides.
    pub(crate) fn finish(mut self) -> (Vec<Vec<(usize, f64)>>, Mat<f64>) {
        self.settle();
        (self.columns, self.sides)
    }

    /// Column by column of the block, by way of the rows that each meets (Gustavson 1978).
    fn settle(&mut self) {
        let mut meets: Vec<Vec<(usize, usize)>> = vec![Vec::new(); self.columns.len()];
        for (i, row) in self.block.iter().enumerate() {
            for (place, (j, _)) in row.iter().enumerate() {
                meets[*j].push((i, place));
            }
        }
        let mut sums = vec![0.0; self.columns.len()];
        let mut is_touched = vec![false; self.columns.len()];
        let mut touched = Vec::new();
        for (j, meets) in meets.iter().enumerate() {
            for &(i, place) in meets {
                let row = &self.block[i];
                let factor = row[place].1;
                for &(k, value) in &row[place..] {
                    if !is_touched[k] {
                        is_touched[k] = true;
                        touched.push(k);
                    }
                    sums[k] += factor * value;
                }
            }
            touched.sort_unstable();
            let entries: Vec<(usize, f64)> = touched.iter().map(|k| (*k, sums[*k])).collect();
            add(&mut self.columns[j], &entries);
            for k in touched.drain(..) {
                (sums[k], is_touched[k]) = (0.0, false);
            }
        }
        self.block.clear();
    }
}

/// Adds a sorted column to another.
pub(super) fn add(own: &mut Vec<(usize, f64)>, more: &[(usize, f64)]) {
    if own.len() == more.len() && own.iter().zip(more).all(|(a, b)| a.0 == b.0) {
        own.iter_mut().zip(more).for_each(|(a, b)| a.1 += b.1);
        return;
    }
    let mut sum = Vec::with_capacity(own.len().max(more.len()));
    let (mut a, mut b) = (own.iter().copied().peekable(), more.iter().copied().peekable());
    loop {
        let next = match (a.peek(), b.peek()) {
            (Some((i, x)), Some((k, y))) if i == k => (*i, x + y),
            (Some(x), Some(y)) => *if x.0 < y.0 { x } else { y },
            (Some(one), None) | (None, Some(one)) => *one,
            (None, None) => break,
        };
        a.next_if(|x| x.0 == next.0);
        b.next_if(|x| x.0 == next.0);
        sum.push(next);
    }
    *own = sum;
}

/// Rows of which the products are summed before they are added to the whole.
const BLOCK_ROWS: usize = 4096;

#[cfg(test)]
mod tests {
    use super::*;

    fn row(i: usize) -> Vec<(usize, f64)> {
        let from = (i * 7) % 12;
        (from..(from + 3).min(13)).map(|j| (j, libm::sin((i * 13 + j) as f64))).collect()
    }

    #[test]
    fn sums_are_those_of_the_dense_products() {
        let (p, n) = (13, 5000);
        let mut gram = Gram::new(p, 1);
        let mut dense = Mat::<f64>::zeros(p, p + 1);
        for i in 0..n {
            let value = libm::cos(i as f64);
            gram.absorb(row(i), &[value]);
            for (j, x) in row(i) {
                for (k, y) in row(i) {
                    dense[(k, j)] += x * y;
                }
                dense[(j, p)] += x * value;
            }
        }
        let (columns, sides) = gram.finish();
        for (j, column) in columns.iter().enumerate() {
            assert!(column.iter().all(|(k, _)| *k >= j) && column.is_sorted_by_key(|(k, _)| *k));
            for k in j..p {
                let found = column.iter().find(|(row, _)| *row == k).map_or(0.0, |(_, v)| *v);
                assert!((found - dense[(k, j)]).abs() < 1e-9, "{k} {j}: {found}");
            }
            assert!((sides[(j, 0)] - dense[(j, p)]).abs() < 1e-9);
        }
    }
}
