//! What the sweeps have not looked at: the widest gaps between them.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use super::Terms;
use super::scans::Scan;

/// Places closer than this are one, metres.
const SAME_M: f64 = 1e-5;

/// The widest gaps that are left. What fits into one may have been missed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Gaps {
    /// Arc between neighbouring meridians at the region's largest θ, degrees; places pooled.
    pub arc_deg: f64,
    /// From a direction at the region's largest θ to the nearest meridian, by arc, where only sweeps
    /// of one place count, that with the fewest among the places that have several, degrees.
    pub arc_at_a_place_deg: f64,
    /// Between neighbouring columns of places, or from the region's edge to the nearest, mm.
    pub x_mm: f64,
    /// The same of rows.
    pub y_mm: f64,
    /// The way of a reading, degrees.
    pub window_deg: f64,
}

impl Gaps {
    /// Of sweeps that reach the region's largest θ.
    pub(super) fn of(terms: &Terms, scans: &[Scan]) -> Self {
        let region = &terms.plan.region;
        let sin = libm::sin(region.theta_max_rad);
        let arc_deg = |phis: Vec<f64>| (widest(phis, TAU) * sin).to_degrees();
        let at_a_place = places(scans).into_iter().filter(|scans| scans.len() > 1).map(|scans| {
            let phis = scans.iter().flat_map(|scan| azimuths(scan, region.theta_max_rad));
            0.5 * arc_deg(phis.collect())
        });
        let along = |range: (f64, f64), of: &dyn Fn(&Scan) -> f64| {
            let mut at: Vec<f64> = scans.iter().map(of).chain([range.0, range.1]).collect();
            at.sort_by(f64::total_cmp);
            at.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max) * 1e3
        };
        let window = scans.iter().map(|scan| {
            let ends = scan.points.last().zip(scan.points.first());
            let span = ends.map_or(0.0, |(last, first)| last.arm_rad - first.arm_rad);
            (span / (scan.points.len().max(2) - 1) as f64).to_degrees()
        });
        Self {
            arc_deg: arc_deg(
                scans.iter().flat_map(|scan| azimuths(scan, region.theta_max_rad)).collect(),
            ),
            arc_at_a_place_deg: at_a_place.fold(0.0, f64::max),
            x_mm: along(region.x_m, &|scan| scan.x_m),
            y_mm: along(region.y_m, &|scan| scan.y_m),
            window_deg: window.fold(0.0, f64::max),
        }
    }
}

/// Sweeps by place.
fn places(scans: &[Scan]) -> Vec<Vec<&Scan>> {
    let mut places: Vec<Vec<&Scan>> = Vec::new();
    for scan in scans {
        let is_same = |other: &&Scan| {
            (other.x_m - scan.x_m).abs() < SAME_M && (other.y_m - scan.y_m).abs() < SAME_M
        };
        match places.iter_mut().find(|place| place.first().is_some_and(is_same)) {
            Some(place) => place.push(scan),
            None => places.push(vec![scan]),
        }
    }
    places
}

/// Where a sweep reaches the largest θ, on either side.
fn azimuths(scan: &Scan, theta_max_rad: f64) -> impl Iterator<Item = f64> + use<> {
    let first = scan.points.first().map_or(0.0, |point| point.arm_rad);
    let last = scan.points.last().map_or(0.0, |point| point.arm_rad);
    let most = 0.95 * theta_max_rad;
    let phi = scan.phi_rad;
    let up = (last >= most).then_some(phi);
    let down = (first <= -most).then_some(phi + 0.5 * TAU);
    up.into_iter().chain(down)
}

/// The widest gap on a circle; all of it where there is nothing.
fn widest(mut angles: Vec<f64>, turn: f64) -> f64 {
    for angle in &mut angles {
        *angle -= turn * libm::floor(*angle / turn);
    }
    angles.sort_by(f64::total_cmp);
    let (Some(first), Some(last)) = (angles.first(), angles.last()) else { return turn };
    let around = first + turn - last;
    angles.windows(2).map(|pair| pair[1] - pair[0]).fold(around, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_widest_gap_may_lie_across_zero() {
        assert!((widest(vec![0.5, 1.0, 5.5], TAU) - 4.5).abs() < 1e-12);
        assert!((widest(vec![-1.0, 1.0, 3.0], TAU) - (TAU - 4.0)).abs() < 1e-12);
        assert!((widest(vec![], TAU) - TAU).abs() < 1e-12);
    }
}
