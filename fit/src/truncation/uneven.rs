//! Where a field is rougher than elsewhere. The wider model's prior knows one roughness for all
//! directions; a lamp has a smooth flank and the sharp shoulder of a beam. Readings tell them apart: each
//! is foretold from all the others, and where they lie further off than the model expects of itself,
//! more is missed.
//!
//! It does not know where the field is rough between readings that all others foretell well.

use super::heard::{Heard, Walks, direction};
use super::left_out::{Group, LeftOut};
use super::wider::{Noise, Wider};
use crate::Symmetry;
use crate::basis::dot;
use crate::triangle::Solution;
use faer::Mat;
use glam::DVec3;
use std::collections::BTreeMap;

/// How much more is missed towards some directions than the missed fields say.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Uneven {
    cells: Vec<Cell>,
    /// Under which images of a direction are one.
    symmetry: Option<Symmetry>,
}

/// Readings of about one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cell {
    towards: DVec3,
    /// The squared error of what the other readings foretell of them over its expectation.
    ratio: f64,
}

impl Uneven {
    pub(super) fn of(left_out: &LeftOut) -> Self {
        let cells = left_out.ratios().map(|(towards, ratio)| Cell { towards, ratio });
        Self { cells: cells.collect(), symmetry: None }
    }

    /// What the variance of all that is missed along a ray is to be multiplied by: the mean ratio of the
    /// nearest measured directions, the nearer the more; never less than 1.
    pub(crate) fn times(&self, theta_rad: f64, phi_rad: f64) -> f64 {
        let towards = folded(self.symmetry, direction(theta_rad, phi_rad));
        let mut near: Vec<(f64, f64)> = Vec::with_capacity(NEAREST + 1);
        for cell in &self.cells {
            let distance = cell.towards.distance_squared(towards);
            let at = near.partition_point(|(other, _)| *other <= distance);
            if at < NEAREST {
                near.insert(at, (distance, cell.ratio));
                near.truncate(NEAREST);
            }
        }
        let Some((farthest, _)) = near.last() else { return 1.0 };
        let own = farthest * OWN;
        let (mut whole, mut ratio) = (0.0, 0.0);
        for (distance, of_cell) in &near {
            let weight = 1.0 / (distance + own).max(f64::MIN_POSITIVE);
            whole += weight;
            ratio += weight * of_cell;
        }
        (ratio / whole).max(1.0)
    }

    /// The same of a field with a symmetry: what readings of all images say together.
    pub(crate) fn under(&self, symmetry: Symmetry) -> Self {
        let mut all: Vec<(DVec3, Vec<f64>)> = Vec::new();
        for cell in &self.cells {
            let towards = folded(Some(symmetry), cell.towards);
            match all.iter_mut().find(|(at, _)| at.distance(towards) < 1.0 / CELLS_A_UNIT) {
                Some((_, ratios)) => ratios.push(cell.ratio),
                None => all.push((towards, vec![cell.ratio])),
            }
        }
        let mean = |ratios: Vec<f64>| ratios.iter().sum::<f64>() / ratios.len() as f64;
        let cells = all.into_iter().map(|(towards, ratios)| Cell { towards, ratio: mean(ratios) });
        Self { cells: cells.collect(), symmetry: Some(symmetry) }
    }
}

/// One of a direction's images under a symmetry, the same of all of them.
fn folded(symmetry: Option<Symmetry>, towards: DVec3) -> DVec3 {
    let mirrored = |phi_rad: f64| {
        let (sin, cos) = (libm::sin(phi_rad), libm::cos(phi_rad));
        let (along, across) =
            (towards.x * cos + towards.y * sin, towards.y * cos - towards.x * sin);
        DVec3::new(along, across.abs(), towards.z)
    };
    match symmetry {
        None => towards,
        Some(Symmetry::Rotational) => DVec3::new(towards.x.hypot(towards.y), 0.0, towards.z),
        Some(Symmetry::Plane { phi_rad }) => mirrored(phi_rad),
        Some(Symmetry::Quadrant { phi_rad }) => {
            let half = mirrored(phi_rad);
            DVec3::new(half.x.abs(), half.y, half.z)
        }
    }
}

impl Wider<'_> {
    /// What all others foretell of readings under the likeliest model; `solution` is of all rows and priors.
    pub(super) fn left_out<W: Walks>(
        &self,
        walks: &mut W,
        noise: Noise,
        directions: &Directions,
        solution: &Solution,
    ) -> Result<LeftOut, W::Error> {
        let (unknowns, factor) = (solution.unknowns(0), solution.inverse_matrix());
        let mut means = Means::new(directions, &unknowns);
        walks.each(&mut |heard| {
            means.take(heard, self.kept());
            Ok(())
        })?;
        Ok(LeftOut::of(means.groups, means.rows, &factor, noise))
    }
}

/// How many readings lie in about one direction: of as small a part of the sphere as leaves few enough
/// directions.
#[derive(Debug)]
pub(super) struct Directions {
    /// By fineness, falling: cells a unit, and the readings of each cell, while these are few enough.
    counts: Vec<(f64, Option<Counts>)>,
}

type Counts = BTreeMap<[i32; 3], f64>;

impl Directions {
    /// Of no reading yet.
    pub(super) fn new() -> Self {
        let of = |halvings: i32| (CELLS_A_UNIT * f64::powi(0.5, halvings), Some(Counts::new()));
        Self { counts: (0..FINENESSES).map(of).collect() }
    }

    /// Takes those in that say what they read.
    pub(super) fn take(&mut self, heard: &Heard<'_>) {
        for i in (0..heard.values.len()).filter(|i| heard.is_plain(*i)) {
            let towards = heard.towards(i);
            for (cells_a_unit, counts) in &mut self.counts {
                let Some(cells) = counts else { continue };
                *cells.entry(cell(*cells_a_unit, towards)).or_default() += 1.0;
                if cells.len() > CELLS_MAX {
                    *counts = None;
                }
            }
        }
    }

    fn finest(&self) -> (f64, &Counts) {
        let few =
            self.counts.iter().find_map(|(fineness, counts)| Some((*fineness, counts.as_ref()?)));
        few.unwrap_or_else(|| unreachable!("the coarsest cells are fewer than {CELLS_MAX}"))
    }
}

/// The cell of a direction.
pub(super) fn cell(cells_a_unit: f64, towards: DVec3) -> [i32; 3] {
    let cell = (cells_a_unit * towards).to_array().map(libm::round);
    #[allow(clippy::cast_possible_truncation)] // up to CELLS_A_UNIT
    cell.map(|index| index as i32)
}

/// Means over readings of one direction.
struct Means<'w> {
    cells_a_unit: f64,
    /// Rising.
    cells: Vec<[i32; 3]>,
    groups: Vec<Group>,
    /// The mean row of each, one a column.
    rows: Mat<f64>,
    unknowns: &'w [f64],
    row: Vec<f64>,
}

impl<'w> Means<'w> {
    fn new(directions: &Directions, unknowns: &'w [f64]) -> Self {
        let (cells_a_unit, counts) = directions.finest();
        let none = |count: &f64| Group {
            count: *count,
            found: 0.0,
            stated: 0.0,
            residual: 0.0,
            towards: DVec3::ZERO,
        };
        Self {
            cells_a_unit,
            cells: counts.keys().copied().collect(),
            groups: counts.values().map(none).collect(),
            rows: Mat::zeros(unknowns.len(), counts.len()),
            unknowns,
            row: vec![0.0; unknowns.len()],
        }
    }

    fn take(&mut self, heard: &Heard<'_>, kept: &[usize]) {
        let mut rooms = heard.rooms();
        for i in (0..heard.values.len()).filter(|i| heard.is_plain(*i)) {
            let towards = heard.towards(i);
            let found = self.cells.binary_search(&cell(self.cells_a_unit, towards));
            // The same readings come each time.
            let Ok(at) = found else { continue };
            heard.row(i, kept, &mut rooms, &mut self.row);
            let group = &mut self.groups[at];
            let part = 1.0 / group.count;
            group.residual += part * (heard.values[i] - dot(&self.row, self.unknowns));
            group.found += heard.variance(i, false);
            group.stated += heard.variance(i, true);
            group.towards += towards;
            let mean = self.rows.col_as_slice_mut(at);
            mean.iter_mut().zip(&self.row).for_each(|(mean, value)| *mean += part * value);
        }
    }
}

/// Directions that tell of one between them.
const NEAREST: usize = 4;
/// Of the squared distance of the farthest of these what is added to each one's: a direction that
/// was measured is told of by its own readings nearly alone.
const OWN: f64 = 1.0 / 16.0;
/// About a quarter of a degree, and more where directions are more than this.
pub(super) const CELLS_A_UNIT: f64 = 200.0;
pub(super) const CELLS_MAX: usize = 2000;
/// Cells half as fine, and so on, of which the last are fewer than this on all the sphere.
const FINENESSES: i32 = 6;

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(theta_deg: f64, phi_deg: f64, ratio: f64) -> Cell {
        Cell { towards: direction(theta_deg.to_radians(), phi_deg.to_radians()), ratio }
    }

    fn ring() -> Uneven {
        let of = |k: u32| cell(30.0, 30.0 * f64::from(k), if k == 3 { 25.0 } else { 0.5 });
        Uneven { cells: (0..12).map(of).collect(), symmetry: None }
    }

    #[test]
    fn a_measured_direction_is_told_of_by_itself_and_others_by_those_around_them() {
        let times = |phi_deg: f64| ring().times(30f64.to_radians(), f64::to_radians(phi_deg));
        assert!((15.0..25.0).contains(&times(90.0)), "{}", times(90.0));
        assert!((5.0..14.0).contains(&times(105.0)), "{}", times(105.0));
        assert!((times(270.0) - 1.0).abs() < 1e-15);
        // The same direction from either side of the cut.
        assert!((times(-15.0) - times(345.0)).abs() < 1e-12);
    }

    #[test]
    fn under_a_symmetry_images_share_what_they_say() {
        let of = |symmetry, phi_deg: f64| {
            ring().under(symmetry).times(30f64.to_radians(), phi_deg.to_radians())
        };
        let mean = (25.0 + 11.0 * 0.5) / 12.0;
        for phi_deg in [90.0, 200.0, 311.0] {
            let found = of(Symmetry::Rotational, phi_deg);
            assert!((found - mean).abs() < 1e-9, "{found} {mean}");
        }
        let plane = Symmetry::Plane { phi_rad: 0.0 };
        assert!((of(plane, 90.0) / of(plane, -90.0) - 1.0).abs() < 1e-9);
        let alone = ring().times(30f64.to_radians(), 90f64.to_radians());
        assert!(of(plane, 90.0) > 8.0 && of(plane, 90.0) < alone, "{}", of(plane, 90.0));
        let quadrant = Symmetry::Quadrant { phi_rad: 0.0 };
        let four = [70.0, 110.0, 250.0, 290.0].map(|phi_deg| of(quadrant, phi_deg));
        assert!(four.iter().all(|times| (times / four[0] - 1.0).abs() < 1e-9), "{four:?}");
    }

    #[test]
    fn without_readings_nothing_is_rougher() {
        assert!((Uneven::default().times(0.5, 1.0) - 1.0).abs() < 1e-15);
    }
}
