//! Where a field is rougher than elsewhere. The wider model's prior knows one roughness for all
//! directions; a lamp has a smooth flank and the sharp shoulder of a beam. Readings tell them apart: each
//! is foretold from all the others, and where they lie further off than the model expects of itself,
//! more is missed.
//!
//! It does not know where the field is rough between readings that all others foretell well.

use super::wider::{Joint, Wider};
use crate::basis::dot;
use crate::triangle::Solution;
use crate::{Ray, Symmetry};
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
    /// How far readings lie off what all others foretell of them, under the likeliest model: its
    /// variances are `scale` times the joint ones, and `solution` is of all rows and priors.
    pub(super) fn uneven(&self, joint: &Joint, scale: f64, solution: &Solution) -> Uneven {
        let (unknowns, factor) = (solution.unknowns(0), solution.inverse_matrix());
        let mut means = Means { wider: self, rooms: self.rooms(), unknowns: &unknowns };
        let mut cells = Vec::new();
        for some in self.directions(joint).chunks(ROWS) {
            let mut rows = Mat::<f64>::zeros(unknowns.len(), some.len());
            let residuals: Vec<f64> = (0..some.len())
                .map(|k| means.residual(&some[k], rows.col_as_slice_mut(k)))
                .collect();
            let fitted = factor.transpose() * &rows;
            cells.extend(some.iter().enumerate().map(|(k, group)| {
                let n = group.len() as f64;
                let variances = group.iter().map(|i| joint.variances[*i]);
                let variance = scale * variances.sum::<f64>() / (n * n);
                // What is left of a value beside the others is its residual over this part, with the
                // variance over it.
                let known = dot(fitted.col_as_slice(k), fitted.col_as_slice(k)) / variance;
                let part = (1.0 - known).max(PART_LEAST);
                let sum: DVec3 = group.iter().map(|i| self.towards(*i)).sum();
                let ratio = residuals[k] * residuals[k] / (variance * part);
                Cell { towards: sum.normalize_or(DVec3::Z), ratio }
            }));
        }
        Uneven { cells, symmetry: None }
    }

    /// Readings that say what they read, those of about one direction together: of as small a part of
    /// the sphere as leaves few enough directions.
    fn directions(&self, joint: &Joint) -> Vec<Vec<usize>> {
        let is_heard = |i: &usize| {
            joint.variances[*i].is_finite() && self.weighed.limits.binary_search(i).is_err()
        };
        let heard: Vec<usize> = (0..self.values.len()).filter(is_heard).collect();
        let mut cells_a_unit = CELLS_A_UNIT;
        loop {
            let mut cells: BTreeMap<[i32; 3], Vec<usize>> = BTreeMap::new();
            for i in &heard {
                let cell = (cells_a_unit * self.towards(*i)).to_array().map(libm::round);
                #[allow(clippy::cast_possible_truncation)] // up to CELLS_A_UNIT
                let cell = cell.map(|index| index as i32);
                cells.entry(cell).or_default().push(*i);
            }
            if cells.len() <= CELLS_MAX {
                return cells.into_values().collect();
            }
            cells_a_unit /= 2.0;
        }
    }

    fn towards(&self, i: usize) -> DVec3 {
        let Ray { theta_rad, phi_rad, .. } = self.own.samples()[i].ray;
        direction(theta_rad, phi_rad)
    }
}

/// Means over readings.
struct Means<'w> {
    wider: &'w Wider<'w>,
    rooms: super::wider::Rooms,
    unknowns: &'w [f64],
}

impl Means<'_> {
    /// What some readings lie off the model on average; their mean row goes to `mean`.
    fn residual(&mut self, group: &[usize], mean: &mut [f64]) -> f64 {
        let part = 1.0 / group.len() as f64;
        let mut row = vec![0.0; mean.len()];
        let mut residual = 0.0;
        for i in group {
            self.wider.row(*i, &mut self.rooms, &mut row);
            residual += part * (self.wider.values[*i] - dot(&row, self.unknowns));
            mean.iter_mut().zip(&row).for_each(|(mean, value)| *mean += part * value);
        }
        residual
    }
}

fn direction(theta_rad: f64, phi_rad: f64) -> DVec3 {
    let (sin, cos) = (libm::sin(theta_rad), libm::cos(theta_rad));
    DVec3::new(sin * libm::cos(phi_rad), sin * libm::sin(phi_rad), cos)
}

/// Directions that tell of one between them.
const NEAREST: usize = 4;
/// Of the squared distance of the farthest of these what is added to each one's: a direction that
/// was measured is told of by its own readings nearly alone.
const OWN: f64 = 1.0 / 16.0;
/// Of readings that nothing else says anything of not less than this part is left.
const PART_LEAST: f64 = 1e-6;
/// About a quarter of a degree, and more where directions are more than this.
const CELLS_A_UNIT: f64 = 200.0;
const CELLS_MAX: usize = 2000;
/// Rows at a time.
const ROWS: usize = 256;

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
