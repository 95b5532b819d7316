//! Which kind of sweeps the readings of shares come in, while nobody knows yet about which grid their poses
//! lie: how many share a cell of what a sweep shares. The grid, once it is known, says which cells are
//! one. What [`Tally`](super::Tally) says where the grid is known before the readings are counted.

use std::f64::consts::PI;

use super::sweeps::{KINDS, SweepKind, are_sweeps};
use super::tally::Counts;
use crate::grid::{ANGLE_APART_RAD, Grid, azimuth_line, position_apart_m};
use crate::stored::Numbers;
use crate::{Ray, Region, Sample};

/// Counts of readings by cells as wide as what counts as apart.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Loose {
    position_apart_m: f64,
    /// One for each of the kinds that are looked for.
    kinds: [Counts; KINDS.len()],
}

/// About where a ray is.
struct Cell {
    x: i64,
    y: i64,
    theta: i64,
    line: i64,
    /// Which half of the line: 0 or 1.
    half: i64,
}

impl Loose {
    pub(crate) fn new(region: &Region) -> Self {
        Self { position_apart_m: position_apart_m(region), kinds: Default::default() }
    }

    pub(crate) fn take(&mut self, samples: &[Sample]) {
        for sample in samples {
            let cell = self.cell(&sample.ray);
            for ((kind, _), counts) in KINDS.iter().zip(&mut self.kinds) {
                counts.take(cell.shared(*kind), 1);
            }
        }
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        for (own, other) in self.kinds.iter_mut().zip(&other.kinds) {
            own.merge(other);
        }
    }

    /// The kind of readings whose poses lie about a grid.
    pub(crate) fn kind(&self, grid: &Grid) -> SweepKind {
        let position = |grid: &[f64], cell: i64| nearest(grid, cell, self.position_apart_m);
        let angle = |grid: &[f64], cell: i64| nearest(grid, cell, ANGLE_APART_RAD);
        let (x, y) = (|x| position(&grid.x_m, x), |y| position(&grid.y_m, y));
        let theta = |theta| angle(&grid.theta_rad, theta);
        let line = |line| angle(&grid.azimuth_lines_rad, line);
        let are = |kind: SweepKind, counts: &Counts| {
            let swept = counts.renamed(|&[a, b, c]| match kind {
                SweepKind::Theta => [line(a), x(b), y(c)],
                SweepKind::Phi => [theta(a), x(b), y(c)],
                SweepKind::Place | SweepKind::Block => [theta(a), line(b), c],
            });
            are_sweeps(swept.values().copied())
        };
        let mut kinds = KINDS.iter().zip(&self.kinds);
        let found = kinds.find(|((kind, _), counts)| are(*kind, counts));
        found.map_or(SweepKind::Block, |((kind, _), _)| *kind)
    }

    /// Takes stored counts of readings of a region up.
    pub(crate) fn stored(numbers: &mut Numbers<'_>, region: &Region) -> Option<Self> {
        let mut loose = Self::new(region);
        for counts in &mut loose.kinds {
            *counts = Counts::stored(numbers)?;
        }
        Some(loose)
    }

    pub(crate) fn put(&self, out: &mut Vec<f64>) {
        self.kinds.iter().for_each(|counts| counts.put(out));
    }

    fn cell(&self, ray: &Ray) -> Cell {
        let line = azimuth_line(ray.phi_rad);
        #[allow(clippy::cast_possible_truncation)] // a whole number of half turns
        let half = libm::round((ray.phi_rad - line) / PI).rem_euclid(2.0) as i64;
        Cell {
            x: cell(ray.x_m, self.position_apart_m),
            y: cell(ray.y_m, self.position_apart_m),
            theta: cell(ray.theta_rad, ANGLE_APART_RAD),
            line: cell(line, ANGLE_APART_RAD),
            half,
        }
    }
}

impl Cell {
    /// What readings of one sweep share.
    fn shared(&self, kind: SweepKind) -> [i64; 3] {
        match kind {
            SweepKind::Theta => [self.line, self.x, self.y],
            SweepKind::Phi => [self.theta, self.x, self.y],
            SweepKind::Place | SweepKind::Block => [self.theta, self.line, self.half],
        }
    }
}

#[allow(clippy::cast_possible_truncation)] // angles, and positions within a region
fn cell(value: f64, width: f64) -> i64 {
    libm::floor(value / width) as i64
}

/// The place in the grid of what is nearest to a cell; beyond all of them, by the cell, where nothing of the grid is
/// about there: azimuths near the pole.
fn nearest(grid: &[f64], cell: i64, width: f64) -> i64 {
    let middle = (cell as f64 + 0.5) * width;
    let above = grid.partition_point(|place| *place <= middle);
    let off = |at: usize| grid.get(at).map_or(f64::INFINITY, |place| (place - middle).abs());
    let at = if above > 0 && off(above - 1) <= off(above) { above - 1 } else { above };
    let number = |at: usize| i64::try_from(at).unwrap_or(i64::MAX);
    if off(at) < width { number(at) } else { number(grid.len()) + cell.abs() }
}
