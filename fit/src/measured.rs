//! How much of the directions within a fit's cone was measured: gaps of solid angle, such as an azimuth
//! that an arm's shadow took, and too few meridians. It looks at directions alone, not at values.

use crate::basis::Basis;
use crate::coverage::Coverage;
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

impl Measured {
    pub(crate) fn of(samples: &[Sample]) -> Self {
        let farthest = samples.iter().map(|sample| sample.ray.theta_rad).fold(0.0, f64::max);
        let off_pole_rad = OFF_POLE_SHARE * farthest;
        let is_off = |theta_rad: f64| theta_rad.min(PI - theta_rad) > off_pole_rad;
        let off = samples.iter().map(|sample| sample.ray).filter(|ray| is_off(ray.theta_rad));
        let mut azimuths: Vec<f64> = off.map(|ray| ray.phi_rad.rem_euclid(TAU)).collect();
        azimuths.sort_by(f64::total_cmp);
        azimuths.dedup_by(|phi, kept| *phi - *kept < APART_RAD);
        if azimuths.len() > 1 && azimuths[0] + TAU - azimuths[azimuths.len() - 1] < APART_RAD {
            azimuths.pop();
        }
        // A reading's scatter about its direction is far below a cell of the map.
        #[allow(clippy::cast_possible_truncation)] // angles
        let place = |angle: f64| libm::round(angle / PLACE_RAD) as i64;
        let places: BTreeSet<(i64, i64)> = samples
            .iter()
            .map(|sample| (place(sample.ray.theta_rad), place(sample.ray.phi_rad)))
            .collect();
        let angle = |place: i64| place as f64 * PLACE_RAD;
        let directions = places.into_iter().map(|(theta, phi)| (angle(theta), angle(phi)));
        Self { directions: directions.collect(), meridians: azimuths.len(), map: OnceLock::new() }
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
