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
use crate::stored::{Numbers, put_all, whole};
use crate::{Region, Sample};

/// Poses that are forgotten one by one.
#[derive(Debug, Clone, PartialEq)]
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
    /// Directions over the cone, and the cosine of the angle to the nearest reading; none of poses that are
    /// to be probed later.
    probes: Vec<(DVec3, f64)>,
}

impl Poses {
    /// Of so many readings of a region.
    pub(crate) fn new(readings: usize, region: &Region) -> Self {
        let every = readings.div_ceil(DIRECTIONS_MAX).max(1);
        Self { every, probes: probes(region), ..Self::unprobed(region) }
    }

    /// Of nobody knows how many readings, whose directions are kept elsewhere.
    pub(crate) fn unprobed(region: &Region) -> Self {
        let position = || Cells::new(position_apart_m(region));
        let angle = || Cells::new(ANGLE_APART_RAD);
        Self {
            region: *region,
            every: 1,
            seen: 0,
            measured_to_rad: 0.0,
            x_m: position(),
            y_m: position(),
            theta_rad: angle(),
            lines_rad: angle(),
            azimuths_rad: angle(),
            probes: Vec::new(),
        }
    }

    /// The same with all of its directions, (θ, φ), once it is known which these are.
    #[must_use]
    pub(crate) fn probed(&self, directions: impl Iterator<Item = (f64, f64)>) -> Self {
        let mut probed = Self { probes: probes(&self.region), ..self.clone() };
        directions.for_each(|(theta_rad, phi_rad)| probed.probe(theta_rad, phi_rad));
        probed
    }

    /// Takes in what another one of the same region holds, but for its probes.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.seen += other.seen;
        self.measured_to_rad = self.measured_to_rad.max(other.measured_to_rad);
        for (own, other) in self.cells_mut().into_iter().zip(other.cells()) {
            own.merge(other);
        }
    }

    fn cells(&self) -> [&Cells; 5] {
        [&self.x_m, &self.y_m, &self.theta_rad, &self.lines_rad, &self.azimuths_rad]
    }

    fn cells_mut(&mut self) -> [&mut Cells; 5] {
        let Self { x_m, y_m, theta_rad, lines_rad, azimuths_rad, .. } = self;
        [x_m, y_m, theta_rad, lines_rad, azimuths_rad]
    }

    /// Adds the numbers that it consists of, but for its probes.
    pub(crate) fn put(&self, out: &mut Vec<f64>) {
        out.extend([self.seen as f64, self.measured_to_rad]);
        for cells in self.cells() {
            put_all(out, cells.cells.values().map(|cell| [cell.lowest, cell.highest, cell.off]));
        }
    }

    /// Takes them up again.
    pub(crate) fn stored(numbers: &mut Numbers<'_>, region: &Region) -> Option<Self> {
        let mut poses = Self::unprobed(region);
        poses.seen = numbers.count(usize::MAX)?;
        poses.measured_to_rad = numbers.number()?;
        for cells in poses.cells_mut() {
            let width = cells.width;
            let cell = |[lowest, highest, off]: [f64; 3]| {
                let cell = Cell { lowest, highest, off };
                let place = place(lowest, width)?;
                (place == self::place(highest, width)? && lowest <= highest)
                    .then_some((place, cell))
            };
            cells.cells = numbers.all(CELLS_MAX, cell)?;
        }
        Some(poses)
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
                self.probe(ray.theta_rad, ray.phi_rad);
            }
            self.seen += 1;
        }
    }

    fn probe(&mut self, theta_rad: f64, phi_rad: f64) {
        let seen = radiometry::direction::unit(theta_rad, phi_rad);
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

/// Directions evenly over the cone, to which no reading is near yet.
fn probes(region: &Region) -> Vec<(DVec3, f64)> {
    let cos_min = libm::cos(region.theta_max_rad);
    let probe = |i: u32| {
        // Evenly in solid angle, turned on by the golden angle.
        let t = (f64::from(i) + 0.5) / f64::from(PROBES);
        let theta = libm::acos(1.0 - t * (1.0 - cos_min));
        (radiometry::direction::unit(theta, f64::from(i) * GOLDEN_RAD), -1.0)
    };
    (0..PROBES).map(probe).collect()
}

/// Numbers in cells.
#[derive(Debug, Clone, PartialEq)]
struct Cells {
    width: f64,
    cells: BTreeMap<i64, Cell>,
}

/// Numbers that lie close together.
#[derive(Debug, Clone, Copy, PartialEq)]
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

    fn take(&mut self, value: f64, off: f64) {
        // Angles, and positions within a region: none is out of range.
        if let Some(place) = place(value, self.width) {
            self.put(place, Cell { lowest: value, highest: value, off });
        }
    }

    fn merge(&mut self, other: &Self) {
        other.cells.iter().for_each(|(place, cell)| self.put(*place, *cell));
    }

    fn put(&mut self, place: i64, other: Cell) {
        let cell = self.cells.entry(place).or_insert(other);
        cell.lowest = cell.lowest.min(other.lowest);
        cell.highest = cell.highest.max(other.highest);
        cell.off = cell.off.max(other.off);
    }

    /// The ends of cells that reach farther than this from the poles, rising.
    fn values(&self, off: f64) -> Vec<f64> {
        let cells = self.cells.values().filter(|cell| cell.off > off);
        cells.flat_map(|cell| [cell.lowest, cell.highest]).collect()
    }
}

/// The cell of a number; `None` where cells can't be told apart any more.
fn place(value: f64, width: f64) -> Option<i64> {
    whole(libm::floor(value / width))
}

/// Cells in what counts as apart.
const CELLS_APART: f64 = 16.0;
/// Stored cells of a coordinate at most: there are 100,000 in a turn, and some 8,000 across a region.
const CELLS_MAX: usize = 1 << 18;
/// Probes of a hole.
const PROBES: u32 = 400;
/// Of more readings every so many-th is compared with them.
const DIRECTIONS_MAX: usize = 20_000;
/// π(3 - √5).
const GOLDEN_RAD: f64 = 2.399_963_229_728_653;
