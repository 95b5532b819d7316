//! Where samples lay, of any number of them: what [`Resolves`](crate::Resolves) and
//! [`Grid`] ask of their poses, taken in block by block in bounded memory. It knows no values.
//!
//! Coordinates are kept by cells of a sixteenth of what counts as apart, the lowest and the highest in each:
//! of samples on a plan's grid, scattering less than that or not at all, what comes out is that of all samples.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use glam::DVec3;

use crate::choice::Tally;
use crate::grid::{
    ANGLE_APART_RAD, Grid, azimuth_line, off_pole_rad, pole_distance_rad, position_apart_m,
};
use crate::{Ray, Region, Sample};

/// Poses that are forgotten one by one.
#[derive(Debug)]
pub(crate) struct Poses {
    region: Region,
    /// Of so many readings the direction of one is compared with the probes.
    every: usize,
    seen: usize,
    measured_to_rad: f64,
    x_m: Cells,
    y_m: Cells,
    theta_rad: Cells,
    lines_rad: Cells,
    azimuths_rad: Cells,
    /// Directions over the cone, and the cosine of the angle to the nearest reading.
    probes: Vec<(DVec3, f64)>,
}

impl Poses {
    /// Of so many readings of a region.
    pub(crate) fn new(readings: usize, region: &Region) -> Self {
        let position = || Cells::new(position_apart_m(region));
        let angle = || Cells::new(ANGLE_APART_RAD);
        let cos_min = libm::cos(region.theta_max_rad);
        let probe = |i: u32| {
            // Evenly in solid angle, turned on by the golden angle.
            let t = (f64::from(i) + 0.5) / f64::from(PROBES);
            let theta = libm::acos(1.0 - t * (1.0 - cos_min));
            (radiometry::direction::unit(theta, f64::from(i) * GOLDEN_RAD), -1.0)
        };
        Self {
            region: *region,
            every: readings.div_ceil(DIRECTIONS_MAX).max(1),
            seen: 0,
            measured_to_rad: 0.0,
            x_m: position(),
            y_m: position(),
            theta_rad: angle(),
            lines_rad: angle(),
            azimuths_rad: angle(),
            probes: (0..PROBES).map(probe).collect(),
        }
    }

    /// Of samples that are there.
    pub(crate) fn of(samples: &[Sample], region: &Region) -> Self {
        let mut poses = Self::new(samples.len(), region);
        poses.take(samples);
        poses
    }

    /// Takes samples of finite poses in.
    pub(crate) fn take(&mut self, samples: &[Sample]) {
        for Sample { ray, .. } in samples {
            let off = pole_distance_rad(ray);
            self.measured_to_rad = self.measured_to_rad.max(ray.theta_rad);
            self.x_m.take(ray.x_m, off);
            self.y_m.take(ray.y_m, off);
            self.theta_rad.take(ray.theta_rad, off);
            self.lines_rad.take(azimuth_line(ray.phi_rad), off);
            self.azimuths_rad.take(ray.phi_rad.rem_euclid(TAU), off);
            if self.seen.is_multiple_of(self.every) {
                self.probe(ray);
            }
            self.seen += 1;
        }
    }

    fn probe(&mut self, ray: &Ray) {
        let seen = radiometry::direction::unit(ray.theta_rad, ray.phi_rad);
        for (probe, nearest) in &mut self.probes {
            *nearest = nearest.max(seen.dot(*probe));
        }
    }

    /// The largest angle from the normal, radians.
    pub(crate) fn measured_to_rad(&self) -> f64 {
        self.measured_to_rad
    }

    /// The distinct coordinates.
    pub(crate) fn grid(&self) -> Grid {
        let off = off_pole_rad(self.measured_to_rad);
        Grid::of_values(
            self.x_m.values(f64::NEG_INFINITY),
            self.y_m.values(f64::NEG_INFINITY),
            self.theta_rad.values(f64::NEG_INFINITY),
            self.lines_rad.values(off),
            &self.region,
        )
    }

    /// Distinct positions along the axis that has more of them.
    pub(crate) fn places(&self) -> usize {
        let grid = self.grid();
        grid.x_m.len().max(grid.y_m.len())
    }

    /// What tells how readings belong together, to be handed all of them once more.
    pub(crate) fn tally(&self) -> Tally {
        Tally::new(self.grid())
    }

    /// The widest step in azimuth between readings farther than this from the poles, radians; 0 without any.
    pub(crate) fn widest_turn_rad(&self, off: f64) -> f64 {
        let mut azimuths = self.azimuths_rad.values(off);
        let around = azimuths.first().map(|first| first + TAU);
        azimuths.extend(around);
        azimuths.windows(2).map(|ends| ends[1] - ends[0]).fold(0.0, f64::max)
    }

    /// The diameter of the largest circle of directions within the cone without a reading, to about a
    /// grid of 400, radians.
    pub(crate) fn hole_rad(&self) -> f64 {
        let apart = |(_, nearest): &(DVec3, f64)| libm::acos(nearest.min(1.0));
        2.0 * self.probes.iter().map(apart).fold(0.0, f64::max)
    }
}

/// Numbers in cells.
#[derive(Debug)]
struct Cells {
    width: f64,
    cells: BTreeMap<i64, Cell>,
}

/// Numbers that lie close together.
#[derive(Debug)]
struct Cell {
    lowest: f64,
    highest: f64,
    /// How far the farthest of its rays is from the poles, radians.
    off: f64,
}

impl Cells {
    fn new(apart: f64) -> Self {
        Self { width: apart / CELLS_APART, cells: BTreeMap::new() }
    }

    #[allow(clippy::cast_possible_truncation)] // angles, and positions within a region
    fn take(&mut self, value: f64, off: f64) {
        let place = libm::floor(value / self.width) as i64;
        let cell = self.cells.entry(place).or_insert(Cell { lowest: value, highest: value, off });
        cell.lowest = cell.lowest.min(value);
        cell.highest = cell.highest.max(value);
        cell.off = cell.off.max(off);
    }

    /// The ends of cells that reach farther than this from the poles, rising.
    fn values(&self, off: f64) -> Vec<f64> {
        let cells = self.cells.values().filter(|cell| cell.off > off);
        cells.flat_map(|cell| [cell.lowest, cell.highest]).collect()
    }
}

/// Cells in what counts as apart.
const CELLS_APART: f64 = 16.0;
/// Probes of a hole.
const PROBES: u32 = 400;
/// Of more readings every so many-th is compared with them.
const DIRECTIONS_MAX: usize = 20_000;
/// π(3 - √5).
const GOLDEN_RAD: f64 = 2.399_963_229_728_653;
