//! What leaves lit patches, tabulated: polynomials over cells of each patch, halved again where they
//! are farthest off, across the side along which they follow worse, so that a radiance costs a look-up and not a shadow. It does not know lamps; it
//! knows a field that goes with the place alone.
//!
//! Each cell has a polynomial of the fifth degree along each side, through Chebyshev's points. How far
//! it is off is asked at the extremes of the next polynomial and at the field's own landmarks, a small
//! shadow among them. Next comes whichever cell may change a reading most, until all are within what was
//! asked for or the budget is used up.

use core::cmp::Ordering;
use core::f64::consts::PI;
use std::collections::BinaryHeap;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use crate::Region;
use crate::field::{Field, Goes, Patch, Ray};

/// Points along each side of a cell.
const POINTS: usize = 6;
/// Radiances that a table may ask for: about half a second's worth of penumbra.
const BUDGET: usize = 60_000;
/// Halvings of a cell of the first grid at most.
const DEPTH: u32 = 20;
/// Cells along a side of the first grid at most.
const FIRST: f64 = 32.0;
/// Between the nodes, where a polynomial is likely to be farthest off.
const EXTREMES: [f64; 4] = [-1.0, -0.5, 0.5, 1.0];

/// What a table is to reach.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wanted {
    /// Places within, metres.
    pub(crate) x_m: (f64, f64),
    pub(crate) y_m: (f64, f64),
    /// Width of the spot over which it will be averaged, metres.
    pub(crate) spot_m: f64,
    /// Below this radiance no reading is told from another.
    pub(crate) floor: f64,
    /// How far off a reading may be, relative to it.
    pub(crate) error: f64,
}

/// A field on flat patches, those that go with the place alone by their tables.
#[derive(Debug)]
pub(crate) struct Tabled {
    field: Arc<dyn Field>,
    patches: Vec<Patch>,
    tables: Vec<Option<Table>>,
}

impl Tabled {
    /// `None` where no patch goes with the place alone.
    pub(crate) fn new(field: &Arc<dyn Field>, region: &Region, wanted: Wanted) -> Option<Self> {
        let patches = field.patches()?;
        let goes = |patch: &Patch| patch.goes == Goes::WithPlace;
        if !patches.iter().any(goes) {
            return None;
        }
        let mut told: Vec<DVec2> =
            field.landmarks(region).iter().map(|ray| ray.point.truncate()).collect();
        told.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
        told.dedup();
        let told = &told[..];
        let tables = patches.iter().enumerate().map(|(i, patch)| {
            let radiance = |place: DVec2| {
                let point = place.extend(0.0);
                field.on_patch(i, &Ray { point, direction: DVec3::Z })
            };
            if goes(patch) { Table::new(patch, told, wanted, &radiance) } else { None }
        });
        let tables = tables.collect();
        Some(Self { field: Arc::clone(field), patches, tables })
    }

    /// Of all tables.
    pub(crate) fn cells(&self) -> usize {
        self.tables.iter().flatten().map(|table| table.leaves.len() / (POINTS * POINTS)).sum()
    }
}

impl Field for Tabled {
    fn radiance(&self, ray: &Ray) -> f64 {
        let at = ray.point.truncate();
        let on = self.patches.iter().position(|patch| patch.boundary.holds(at));
        on.map_or(0.0, |i| self.on_patch(i, ray))
    }

    fn on_patch(&self, patch: usize, ray: &Ray) -> f64 {
        let table = self.tables.get(patch).and_then(Option::as_ref);
        let read = table.and_then(|table| table.at(ray.point.truncate()));
        read.unwrap_or_else(|| self.field.on_patch(patch, ray))
    }

    fn landmarks(&self, region: &Region) -> Vec<Ray> {
        self.field.landmarks(region)
    }

    fn patches(&self) -> Option<Vec<Patch>> {
        Some(self.patches.clone())
    }

    fn is_even(&self) -> bool {
        self.field.is_even()
    }

    fn brightest(&self, region: &Region) -> f64 {
        self.field.brightest(region)
    }
}

/// A cell: halved across one side, or a polynomial.
#[derive(Debug, Clone, Copy)]
enum Cell {
    /// Its halves, the lower one first, along x.
    AlongX(usize),
    /// Along y.
    AlongY(usize),
    Leaf(usize),
}

/// A function over a rectangle.
#[derive(Debug)]
struct Table {
    low: DVec2,
    /// One over the sides of a cell of the first grid.
    per_cell: DVec2,
    columns: usize,
    rows: usize,
    /// The first grid's, row by row; then halves, two by two.
    cells: Vec<Cell>,
    /// Coefficients of each leaf, those along x together.
    leaves: Vec<f64>,
}

impl Table {
    /// Over what of a patch is wanted. `None` if nothing is.
    fn new(
        patch: &Patch,
        told: &[DVec2],
        wanted: Wanted,
        radiance: &dyn Fn(DVec2) -> f64,
    ) -> Option<Self> {
        let (low, high) = patch.boundary.bounds();
        let low = low.max(DVec2::new(wanted.x_m.0, wanted.y_m.0));
        let extent = high.min(DVec2::new(wanted.x_m.1, wanted.y_m.1)) - low;
        if extent.min_element() <= 0.0 || !extent.is_finite() {
            return None;
        }
        let count = |extent: f64| libm::ceil(extent / wanted.spot_m).clamp(1.0, FIRST);
        let counts = DVec2::new(count(extent.x), count(extent.y));
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most FIRST
        let (columns, rows) = (counts.x as usize, counts.y as usize);
        let table = Self {
            low,
            per_cell: counts / extent,
            columns,
            rows,
            cells: vec![Cell::Leaf(0); columns * rows],
            leaves: Vec::new(),
        };
        let within = |at: &&DVec2| low.cmple(**at).all() && (**at - low).cmple(extent).all();
        let told: Vec<(DVec2, f64)> =
            told.iter().filter(within).map(|at| (*at, radiance(*at))).collect();
        let (open, asked) = (BinaryHeap::new(), told.len());
        let told = &told[..];
        let mut making =
            Making { table, told, wanted, radiance, monomials: monomials(), open, asked };
        making.refine(extent / counts);
        Some(making.table)
    }

    /// `None` outside.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within the first grid
    fn at(&self, place: DVec2) -> Option<f64> {
        let at = (place - self.low) * self.per_cell;
        let within =
            at.x >= 0.0 && at.y >= 0.0 && at.x <= self.columns as f64 && at.y <= self.rows as f64;
        if !within {
            return None;
        }
        let column = (at.x as usize).min(self.columns - 1);
        let row = (at.y as usize).min(self.rows - 1);
        let mut part = at - DVec2::new(column as f64, row as f64);
        let mut cell = self.cells[row * self.columns + column];
        loop {
            match cell {
                Cell::Leaf(leaf) => return Some(self.polynomial(leaf, part * 2.0 - 1.0)),
                Cell::AlongX(first) => {
                    let (upper, rest) = half(part.x);
                    (part.x, cell) = (rest, self.cells[first + upper]);
                }
                Cell::AlongY(first) => {
                    let (upper, rest) = half(part.y);
                    (part.y, cell) = (rest, self.cells[first + upper]);
                }
            }
        }
    }

    /// By Horner's rule; both coordinates from -1 to 1.
    fn polynomial(&self, leaf: usize, at: DVec2) -> f64 {
        let own = &self.leaves[leaf * POINTS * POINTS..(leaf + 1) * POINTS * POINTS];
        let along = |row: &[f64]| row.iter().rev().fold(0.0, |sum, part| sum * at.x + part);
        // What is not negative is not made so by a polynomial that swings.
        own.chunks_exact(POINTS).rev().fold(0.0, |sum, row| sum * at.y + along(row)).max(0.0)
    }
}

/// Which half of [0, 1] a place is in, 0 or 1, and where in it.
fn half(part: f64) -> (usize, f64) {
    let twice = 2.0 * part;
    if twice < 1.0 { (0, twice) } else { (1, twice - 1.0) }
}

/// A cell that may be halved.
struct Open {
    /// By how much it may change a reading, relative.
    excess: f64,
    cell: usize,
    low: DVec2,
    side: DVec2,
    depth: u32,
    is_along_x: bool,
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        // Of equal ones the first.
        self.excess.total_cmp(&other.excess).then(other.cell.cmp(&self.cell))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Open {}

/// A table while it is made.
struct Making<'m> {
    table: Table,
    /// Places at which the field itself says it should be asked, rising in x, and what it says there.
    told: &'m [(DVec2, f64)],
    wanted: Wanted,
    radiance: &'m dyn Fn(DVec2) -> f64,
    monomials: [[f64; POINTS]; POINTS],
    open: BinaryHeap<Open>,
    asked: usize,
}

impl Making<'_> {
    fn refine(&mut self, side: DVec2) {
        let (columns, low) = (self.table.columns, self.table.low);
        for cell in 0..self.table.cells.len() {
            let at = DVec2::new((cell % columns) as f64, (cell / columns) as f64);
            self.fill(cell, low + side * at, side, 0);
        }
        while let Some(open) = self.open.pop() {
            if open.excess <= self.wanted.error || self.asked >= BUDGET {
                break;
            }
            let first = self.table.cells.len();
            self.table.cells.extend([Cell::Leaf(0); 2]);
            let (cell, whole) = if open.is_along_x {
                (Cell::AlongX(first), DVec2::new(0.5, 1.0))
            } else {
                (Cell::AlongY(first), DVec2::new(1.0, 0.5))
            };
            self.table.cells[open.cell] = cell;
            let side = open.side * whole;
            self.fill(first, open.low, side, open.depth + 1);
            self.fill(first + 1, open.low + open.side - side, side, open.depth + 1);
        }
    }

    /// Gives a cell its polynomial, and opens it by how far that is off.
    fn fill(&mut self, cell: usize, low: DVec2, side: DVec2, depth: u32) {
        let place = |at: DVec2| low + side * (at + 1.0) / 2.0;
        let mut values = [[0.0; POINTS]; POINTS];
        let mut brightest = 0.0_f64;
        for (j, row) in values.iter_mut().enumerate() {
            for (i, value) in row.iter_mut().enumerate() {
                *value = (self.radiance)(place(DVec2::new(chebyshev(i), chebyshev(j))));
                brightest = brightest.max(*value);
            }
        }
        self.table.cells[cell] = Cell::Leaf(self.table.leaves.len() / (POINTS * POINTS));
        self.table.leaves.extend(coefficients(&self.monomials, &values).as_flattened());
        let leaf = self.table.leaves.len() / (POINTS * POINTS) - 1;
        let own = |at: DVec2| self.table.polynomial(leaf, (at - low) / side * 2.0 - 1.0);
        let mut off = 0.0_f64;
        let ask = |off: &mut f64, brightest: &mut f64, at: DVec2, value: f64| {
            *brightest = brightest.max(value);
            *off = off.max((own(at) - value).abs());
        };
        for at in EXTREMES.iter().flat_map(|y| EXTREMES.map(|x| DVec2::new(x, *y))) {
            ask(&mut off, &mut brightest, place(at), (self.radiance)(place(at)));
        }
        let seen = off;
        let high = low + side;
        let from = self.told.partition_point(|(told, _)| told.x < low.x);
        for (told, value) in self.told[from..].iter().take_while(|(told, _)| told.x <= high.x) {
            if (low.y..=high.y).contains(&told.y) {
                ask(&mut off, &mut brightest, *told, *value);
            }
        }
        self.asked += POINTS * POINTS + EXTREMES.len() * EXTREMES.len();
        // A reading is the mean over a spot that is wider than the cell, or over part of it. What only
        // the field tells of has no direction yet.
        let is_told = off > seen;
        let extent = if is_told { side.max_element() } else { side.min_element() };
        let part = (extent / self.wanted.spot_m).min(1.0);
        let excess = off * part / brightest.max(self.wanted.floor).max(f64::MIN_POSITIVE);
        let is_along_x =
            if is_told { side.x >= side.y } else { swing(&values) >= swing(&transposed(&values)) };
        if depth < DEPTH {
            self.open.push(Open { excess, cell, low, side, depth, is_along_x });
        }
    }
}

/// How much of the highest two of Chebyshev's polynomials there is along x.
fn swing(values: &[[f64; POINTS]; POINTS]) -> f64 {
    let part = |row: &[f64; POINTS], degree: usize| {
        let angle = |i: usize| PI * (i as f64 + 0.5) / POINTS as f64;
        (0..POINTS).map(|i| row[i] * libm::cos(degree as f64 * angle(i))).sum::<f64>().abs()
    };
    values.iter().map(|row| part(row, POINTS - 1) + part(row, POINTS - 2)).sum()
}

fn transposed(values: &[[f64; POINTS]; POINTS]) -> [[f64; POINTS]; POINTS] {
    core::array::from_fn(|i| core::array::from_fn(|k| values[k][i]))
}

/// The i-th zero of Chebyshev's polynomial.
fn chebyshev(i: usize) -> f64 {
    -libm::cos(PI * (i as f64 + 0.5) / POINTS as f64)
}

/// Of the polynomial that is one at a zero and nothing at the others, for each: its coefficients.
fn monomials() -> [[f64; POINTS]; POINTS] {
    core::array::from_fn(|i| {
        let mut product = [0.0; POINTS];
        product[0] = 1.0;
        for k in (0..POINTS).filter(|k| *k != i) {
            let (zero, scale) = (chebyshev(k), 1.0 / (chebyshev(i) - chebyshev(k)));
            for power in (0..POINTS).rev() {
                let lower = if power > 0 { product[power - 1] } else { 0.0 };
                product[power] = (lower - zero * product[power]) * scale;
            }
        }
        product
    })
}

/// Of values at the zeros, row by row, to coefficients of powers, those along x together.
fn coefficients(
    monomials: &[[f64; POINTS]; POINTS],
    values: &[[f64; POINTS]; POINTS],
) -> [[f64; POINTS]; POINTS] {
    let of_row = |row: &[f64; POINTS]| -> [f64; POINTS] {
        core::array::from_fn(|power| (0..POINTS).map(|i| row[i] * monomials[i][power]).sum())
    };
    let along: [[f64; POINTS]; POINTS] = values.each_ref().map(of_row);
    core::array::from_fn(|y| {
        core::array::from_fn(|x| (0..POINTS).map(|j| along[j][x] * monomials[j][y]).sum())
    })
}

#[cfg(test)]
mod tests;
