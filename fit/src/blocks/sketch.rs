//! Squared residuals and stated variances by the hundred thousand, summed up in cells: what the excess is
//! found from where the readings themselves are not kept.
//!
//! A cell holds readings whose variance is alike to a 64th of an octave, and, where residuals are cut off,
//! whose squared residual is so too. Sums over it are those of its middle, with the second order of the
//! variances' spread: without cutting they err by 1e-6 of themselves at most, with it by some 1e-5, and in
//! nothing where all variances are the same and nothing is cut. Where there would be too many cells they
//! become twice as wide: of variances over 40 octaves the excess is right to a part in 200.

use std::collections::BTreeMap;

use crate::excess::Scatter;
use crate::robust::cut_square;

/// Sums over readings in cells.
#[derive(Debug, Clone)]
pub(super) struct Sketch {
    is_cut: bool,
    /// Cells in an octave.
    fineness: f64,
    cells: BTreeMap<(i32, i32), Cell>,
    count: f64,
    largest: f64,
}

/// Readings that are taken together.
#[derive(Debug, Clone, Copy)]
struct Cell {
    count: f64,
    /// The variance of the first of them, which the others' are taken less.
    variance: f64,
    /// Σ r², Σ r² (v - first) and Σ r² (v - first)².
    squares: [f64; 3],
}

impl Sketch {
    /// Of nothing yet; `is_cut`: large residuals will be cut off.
    pub(super) const fn new(is_cut: bool) -> Self {
        let (count, largest) = (0.0, 0.0);
        Self { is_cut, fineness: CELLS_PER_OCTAVE, cells: BTreeMap::new(), count, largest }
    }

    pub(super) fn take(&mut self, terms: &[(f64, f64)]) {
        for &(square, variance) in terms {
            self.count += 1.0;
            self.largest = self.largest.max(square);
            let place = |number: f64| place(number, self.fineness);
            let key = (place(variance), if self.is_cut { place(square) } else { 0 });
            let cell = Cell { count: 1.0, variance, squares: [square, 0.0, 0.0] };
            self.cells.entry(key).and_modify(|own| own.merge(&cell)).or_insert(cell);
            if self.cells.len() > CELLS_MAX {
                self.coarsen();
            }
        }
    }

    fn coarsen(&mut self) {
        self.fineness *= 0.5;
        let half = |place: i32| if place == i32::MIN { place } else { place.div_euclid(2) };
        for ((variance, square), cell) in std::mem::take(&mut self.cells) {
            let key = (half(variance), half(square));
            self.cells.entry(key).and_modify(|own| own.merge(&cell)).or_insert(cell);
        }
    }
}

impl Cell {
    fn merge(&mut self, other: &Self) {
        let step = other.variance - self.variance;
        let [zeroth, first, second] = other.squares;
        self.count += other.count;
        self.squares[0] += zeroth;
        self.squares[1] += first + step * zeroth;
        self.squares[2] += second + step * (2.0 * first + step * zeroth);
    }

    /// Σ r²/(v + τ²)^power, to the second order about the mean variance.
    fn sum(&self, tau2: f64, power: f64) -> f64 {
        let [zeroth, first, second] = self.squares;
        if zeroth == 0.0 {
            return 0.0;
        }
        let mean = first / zeroth;
        let spread = (second - mean * first).max(0.0);
        let whole = self.variance + mean + tau2;
        let bent = 0.5 * power * (power + 1.0) * spread / (whole * whole);
        (zeroth + bent) / whole.powf(power)
    }
}

impl Scatter for Sketch {
    fn count(&self) -> f64 {
        self.count
    }

    fn sums(&self, tau2: f64) -> (f64, f64) {
        let sum = |power: f64| self.cells.values().map(|cell| cell.sum(tau2, power)).sum();
        (sum(1.0), sum(2.0))
    }

    fn cut_sum(&self, tau2: f64, factor: f64) -> f64 {
        let cut = |cell: &Cell| cell.count * cut_square(cell.sum(tau2, 1.0) / cell.count * factor);
        self.cells.values().map(cut).sum()
    }

    fn largest(&self) -> f64 {
        self.largest
    }
}

/// Which cell a number above 0 is in.
#[allow(clippy::cast_possible_truncation)] // some 1e5 at most; that of 0 is the least
fn place(number: f64, fineness: f64) -> i32 {
    if number > 0.0 { libm::floor(libm::log2(number) * fineness) as i32 } else { i32::MIN }
}

/// Before they become wider.
const CELLS_PER_OCTAVE: f64 = 64.0;
/// Some 5 MB.
const CELLS_MAX: usize = 1 << 16;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::excess::{cut_excess, excess};
    use crate::scattered::part;

    /// Residuals twice as large as variances that go over some octaves say, one in twenty far off.
    fn terms(count: usize, octaves: f64) -> Vec<(f64, f64)> {
        let term = |i: usize| {
            let variance = 1e-4 * libm::exp2(octaves * part(i, 0.618_034));
            let normal =
                (0..12).map(|k| part(i, 0.131 + 0.071_3 * f64::from(k))).sum::<f64>() - 6.0;
            let far = if i.is_multiple_of(20) { 30.0 } else { 2.0 };
            (variance * (far * normal).powi(2), variance)
        };
        (0..count).map(term).collect()
    }

    fn sketch(terms: &[(f64, f64)], is_cut: bool) -> Sketch {
        let mut sketch = Sketch::new(is_cut);
        terms.chunks(777).for_each(|block| sketch.take(block));
        assert!(sketch.cells.len() <= CELLS_MAX);
        sketch
    }

    #[test]
    fn the_excess_is_that_of_the_terms_themselves() {
        for octaves in [0.0, 0.01, 3.0, 12.0] {
            let terms = terms(40_000, octaves);
            let dof = terms.len() as f64 - 60.0;
            let plain = sketch(&terms, false);
            let (found, expected) = (excess(&plain, dof, false), excess(&terms, dof, false));
            assert!((found / expected - 1.0).abs() < 3e-6, "{octaves}: {found} {expected}");
            let cut = sketch(&terms, true);
            let (count, largest) = (Scatter::count(&terms), Scatter::largest(&terms));
            assert!((cut.count - count).abs() + (cut.largest - largest).abs() <= 0.0);
            let (found, expected) = (cut_excess(&cut, dof, false), cut_excess(&terms, dof, false));
            assert!((found / expected - 1.0).abs() < 3e-4, "{octaves}: {found} {expected}");
        }
    }

    #[test]
    fn what_is_too_much_for_fine_cells_is_held_by_wide_ones() {
        let terms = terms(400_000, 40.0);
        let cut = sketch(&terms, true);
        assert!(cut.fineness < CELLS_PER_OCTAVE, "{}", cut.fineness);
        let dof = terms.len() as f64;
        let (found, expected) = (cut_excess(&cut, dof, false), cut_excess(&terms, dof, false));
        assert!((found / expected - 1.0).abs() < 5e-3, "{found} {expected}");
    }
}
