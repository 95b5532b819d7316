//! How much of the directions within a fit's cone was measured: gaps of solid angle, such as an azimuth
//! that an arm's shadow took, and too few meridians. It looks at directions alone, not at values.

use crate::basis::Basis;
use crate::coverage::Coverage;
use crate::stored::{Numbers, put_all, whole};
use crate::{Cause, Chart, Ray, Region, Sample, Symmetry};
use std::collections::BTreeSet;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::OnceLock;

/// The directions that a fit's samples lie along.
#[derive(Debug, Clone)]
pub(crate) struct Measured {
    directions: Vec<(f64, f64)>,
    /// Distinct azimuths, φ and φ + 180° being two.
    meridians: usize,
    map: OnceLock<Map>,
}

/// Which cells of the equal-area disk were measured.
#[derive(Debug, Clone)]
struct Map {
    end_rad: f64,
    is_measured: Vec<bool>,
    has_gaps: bool,
}

/// Where samples of any number lie, taken in block by block in bounded memory: a direction is known by
/// its cell.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Looked {
    places: BTreeSet<(i64, i64)>,
    width_rad: f64,
}

impl Looked {
    pub(crate) fn new() -> Self {
        Self { places: BTreeSet::new(), width_rad: PLACE_RAD }
    }

    /// Takes samples of finite directions in.
    pub(crate) fn take(&mut self, samples: &[Sample]) {
        for Sample { ray, .. } in samples {
            self.note((ray.theta_rad, ray.phi_rad));
        }
    }

    /// Takes in what another one holds.
    pub(crate) fn merge(&mut self, other: &Self) {
        while self.width_rad < other.width_rad {
            self.widen();
        }
        other.directions().for_each(|direction| self.note(direction));
    }

    /// The middles of its cells, (θ, φ).
    pub(crate) fn directions(&self) -> impl Iterator<Item = (f64, f64)> {
        self.places.iter().map(|at| angles(*at, self.width_rad))
    }

    pub(crate) fn measured(&self) -> Measured {
        Measured::of_directions(self.directions().collect())
    }

    fn note(&mut self, direction: (f64, f64)) {
        self.places.insert(place(direction, self.width_rad));
        if self.places.len() > PLACES_MAX {
            self.widen();
        }
    }

    fn widen(&mut self) {
        let angles: Vec<(f64, f64)> = self.directions().collect();
        self.width_rad *= 2.0;
        self.places = angles.into_iter().map(|at| place(at, self.width_rad)).collect();
    }
}

impl Looked {
    /// Adds the numbers that it consists of.
    pub(crate) fn put(&self, out: &mut Vec<f64>) {
        out.push(self.width_rad);
        put_all(out, self.places.iter().map(|&(theta, phi)| [theta as f64, phi as f64]));
    }

    /// Takes them up again.
    pub(crate) fn stored(numbers: &mut Numbers<'_>) -> Option<Self> {
        let width_rad = numbers.number().filter(|width| (PLACE_RAD..1.0).contains(width))?;
        let places = numbers.all(PLACES_MAX, |[theta, phi]| Some((whole(theta)?, whole(phi)?)))?;
        Some(Self { places, width_rad })
    }
}

impl Measured {
    pub(crate) fn of(samples: &[Sample]) -> Self {
        let place = |sample: &Sample| place((sample.ray.theta_rad, sample.ray.phi_rad), PLACE_RAD);
        let places: BTreeSet<(i64, i64)> = samples.iter().map(place).collect();
        let directions = places.into_iter().map(|at| angles(at, PLACE_RAD)).collect();
        let azimuths = samples.iter().map(|sample| (sample.ray.theta_rad, sample.ray.phi_rad));
        Self { directions, meridians: meridians(azimuths), map: OnceLock::new() }
    }

    fn of_directions(directions: Vec<(f64, f64)>) -> Self {
        let meridians = meridians(directions.iter().copied());
        Self { directions, meridians, map: OnceLock::new() }
    }

    /// With what a symmetry says of other directions; `None` where it leaves no gap to speak of.
    pub(crate) fn under(&self, symmetry: Symmetry, region: &Region) -> Option<Self> {
        if symmetry == Symmetry::Rotational {
            return None;
        }
        let mut directions = self.directions.clone();
        // A mirror, and of two mirrors the second one on both.
        for mirror in 0..2 {
            let ray = |(theta_rad, phi_rad)| Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad };
            let images = directions.iter().map(|at| symmetry.images(&ray(*at), region));
            let images: Vec<(f64, f64)> = images
                .filter_map(|images| images.get(mirror).copied())
                .map(|image| (image.theta_rad, image.phi_rad))
                .collect();
            directions.extend(images);
        }
        // What azimuths determine is no longer theirs alone.
        Some(Self { directions, meridians: usize::MAX, map: OnceLock::new() })
    }

    /// Whether something was measured in a direction within the region's cone, or so near that the
    /// readings' own mesh reaches there.
    pub(crate) fn holds(&self, theta_rad: f64, phi_rad: f64, region: &Region) -> bool {
        let map = self.map(region);
        !map.has_gaps || map.is_measured[map.cell(theta_rad, phi_rad)]
    }

    /// Directions of the gaps within the region's cone, each standing for the same solid angle, and
    /// that solid angle; none where the gaps are specks.
    pub(crate) fn gaps(&self, region: &Region) -> (Vec<(f64, f64)>, f64) {
        let map = self.map(region);
        if !map.has_gaps {
            return (Vec::new(), 0.0);
        }
        let side = 2.0 * libm::sin(0.5 * map.end_rad) / SIDE as f64;
        // On the disk of radius sin(θ/2) an area is a quarter of the solid angle.
        let gaps = (0..SIDE * SIDE).filter(|cell| !map.is_measured[*cell]);
        (gaps.filter_map(|cell| direction(cell, map.end_rad)).collect(), 4.0 * side * side)
    }

    /// Too few meridians for the basis, if so.
    pub(crate) fn too_few_meridians(&self, basis: &Basis) -> Option<Cause> {
        let degree = basis.directions().needs()?.degree;
        let needed = 2 * degree + 1;
        (self.meridians < needed).then_some(Cause::Meridians {
            distinct: self.meridians,
            degree,
            needed,
        })
    }

    fn map(&self, region: &Region) -> &Map {
        self.map.get_or_init(|| Map::of(&self.directions, region))
    }
}

impl Map {
    fn of(directions: &[(f64, f64)], region: &Region) -> Self {
        let end_rad = match region.chart {
            // Directions between two planes fill no cone.
            Chart::TwoPlane { .. } => 0.0,
            chart if chart.is_whole_sphere() => region.theta_max_rad.min(PI),
            _ => region.theta_max_rad.min(FRAC_PI_2),
        };
        let coverage = Coverage::of(directions);
        let mut is_measured = vec![true; SIDE * SIDE];
        let (mut cells, mut gaps) = (0, 0);
        for (cell, is_measured) in is_measured.iter_mut().enumerate() {
            let Some((theta_rad, phi_rad)) = direction(cell, end_rad) else { continue };
            *is_measured = coverage.reaches(theta_rad, phi_rad);
            cells += 1;
            gaps += usize::from(!*is_measured);
        }
        let has_gaps = end_rad > 0.0 && gaps as f64 > SPECKS * f64::from(cells);
        Self { end_rad, is_measured, has_gaps }
    }

    fn cell(&self, theta_rad: f64, phi_rad: f64) -> usize {
        let r = libm::sin(0.5 * theta_rad) / libm::sin(0.5 * self.end_rad);
        let (sin, cos) = libm::sincos(phi_rad);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
        let place = |t: f64| (0.5 * (t + 1.0) * SIDE as f64).clamp(0.0, (SIDE - 1) as f64) as usize;
        place(r * sin) * SIDE + place(r * cos)
    }
}

/// Distinct azimuths of directions (θ, φ) that are not too near to the pole.
fn meridians(directions: impl Iterator<Item = (f64, f64)> + Clone) -> usize {
    let farthest = directions.clone().map(|(theta_rad, _)| theta_rad).fold(0.0, f64::max);
    let off_pole_rad = OFF_POLE_SHARE * farthest;
    let off = directions.filter(|(theta_rad, _)| theta_rad.min(PI - theta_rad) > off_pole_rad);
    let mut azimuths: Vec<f64> = off.map(|(_, phi_rad)| phi_rad.rem_euclid(TAU)).collect();
    azimuths.sort_by(f64::total_cmp);
    azimuths.dedup_by(|phi, kept| *phi - *kept < APART_RAD);
    if azimuths.len() > 1 && azimuths[0] + TAU - azimuths[azimuths.len() - 1] < APART_RAD {
        azimuths.pop();
    }
    azimuths.len()
}

/// The cell of a direction: a reading's scatter about its own is far below a cell of the map.
#[allow(clippy::cast_possible_truncation)] // angles
fn place((theta_rad, phi_rad): (f64, f64), width_rad: f64) -> (i64, i64) {
    let place = |angle_rad: f64| libm::round(angle_rad / width_rad) as i64;
    (place(theta_rad), place(phi_rad))
}

/// A cell's middle.
fn angles((theta, phi): (i64, i64), width_rad: f64) -> (f64, f64) {
    (theta as f64 * width_rad, phi as f64 * width_rad)
}

/// The direction of a cell's middle within the cone.
fn direction(cell: usize, end_rad: f64) -> Option<(f64, f64)> {
    let t = |place: usize| 2.0 * (place as f64 + 0.5) / SIDE as f64 - 1.0;
    let (u, v) = (t(cell % SIDE), t(cell / SIDE));
    let r = libm::hypot(u, v);
    let theta_rad = 2.0 * libm::asin((r * libm::sin(0.5 * end_rad)).min(1.0));
    (r <= 1.0).then(|| (theta_rad, libm::atan2(v, u)))
}

/// Cells across the disk: of a hemisphere 1.7° wide.
const SIDE: usize = 96;
/// Gaps of less than this part of the cone are none: a mesh that isn't quite even.
const SPECKS: f64 = 0.01;
/// Azimuths of readings nearer to the pole than this share of the farthest one mean little.
const OFF_POLE_SHARE: f64 = 0.3;
/// Azimuths closer than this (0.6°) are one meridian: readbacks scatter about a plan's.
const APART_RAD: f64 = 1e-2;
/// Directions closer than this (0.06°) are one.
const PLACE_RAD: f64 = 1e-3;
/// Cells of directions at most; beyond, of twice the width. A hemisphere is full of them at 0.7°.
const PLACES_MAX: usize = 1 << 16;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Noise;

    #[test]
    fn many_directions_are_kept_by_wider_cells_with_the_same_gaps() {
        let sample = |i: u32| {
            let turned = f64::from(i) * 0.618_034;
            // Evenly in solid angle up to 70°, but for a sector.
            let theta_rad = libm::acos(1.0 - 0.658 * (f64::from(i) * 0.754_878).fract());
            let ray = Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad: 5.0 * turned.fract() };
            Sample { ray, value: 1.0, noise: Noise::Unknown }
        };
        let samples: Vec<Sample> = (0..300_000).map(sample).collect();
        let mut looked = Looked::new();
        samples.chunks(1000).for_each(|block| looked.take(block));
        assert!(looked.places.len() <= PLACES_MAX && looked.width_rad > PLACE_RAD);
        let (found, whole) = (looked.measured(), Measured::of(&samples));
        let region = Region::surface((0.0, 0.0), (0.0, 0.0), 70_f64.to_radians());
        for (theta_rad, phi_rad, expected) in
            [(0.0, 0.0, true), (0.9, 2.5, true), (0.9, 5.7, false), (1.2, 4.9, true)]
        {
            assert_eq!(found.holds(theta_rad, phi_rad, &region), expected, "{theta_rad} {phi_rad}");
            assert_eq!(whole.holds(theta_rad, phi_rad, &region), expected, "{theta_rad} {phi_rad}");
        }
        let (gap, expected) = (found.gaps(&region), whole.gaps(&region));
        let off = gap.0.len().abs_diff(expected.0.len());
        assert!(10 * off < expected.0.len(), "{} {}", gap.0.len(), expected.0.len());
        // More than the finest functions of a fit ask for.
        assert!(found.meridians > 250, "{}", found.meridians);
    }
}
