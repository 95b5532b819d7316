//! Which directions were measured, and where the gaps are.
//!
//! A direction counts as measured where a reading's direction lies within a reach of it. The reach
//! is the schedule's own mesh: from each reading's direction to its neighbours on four sides, the
//! farthest of the four, four fifths of what that is for all but a fifth of the readings. So the
//! meshes of a schedule, fine in one direction and wide in the other, are no gaps, while what it
//! left out is one, and so is whatever lies further than 26° from any reading. Beyond the largest θ
//! that was read nothing is measured, whatever the reach.

use std::collections::BTreeMap;

/// Directions to compare with, at most: more lie so close together that they add nothing.
const DIRECTIONS_MAX: usize = 2000;
/// Directions whose neighbours are looked for.
const PROBES: usize = 160;
/// The middle of a mesh of two sides is 0.71 of the longer one from its corners, at most.
const SHARE: f64 = 0.8;
const QUANTILE: f64 = 0.8;
/// A reach is at least this, at most that, radians.
const REACH_RAD: (f64, f64) = (0.02, 0.45);
/// A readback is never exactly the direction asked for.
const RIM_MARGIN_RAD: f64 = 0.005;

/// The directions of readings, and how far each counts.
#[derive(Debug, Clone)]
pub struct Coverage {
    units: Vec<[f64; 3]>,
    reach_rad: f64,
    theta_max_rad: f64,
}

impl Coverage {
    /// Of directions (θ, φ), radians.
    pub fn of(directions: &[(f64, f64)]) -> Self {
        let theta_max_rad = directions.iter().map(|(theta, _)| *theta).fold(0.0, f64::max);
        let units = distinct(directions);
        let theta_max_rad = (theta_max_rad + RIM_MARGIN_RAD).min(core::f64::consts::FRAC_PI_2);
        Self { reach_rad: reach(&units), units, theta_max_rad }
    }

    /// Whether something was measured there or nearby.
    pub fn holds(&self, theta_rad: f64, phi_rad: f64) -> bool {
        theta_rad <= self.theta_max_rad && self.reaches(theta_rad, phi_rad)
    }

    /// Whether a reading counts as far as there, beyond the largest θ that was read too.
    pub fn reaches(&self, theta_rad: f64, phi_rad: f64) -> bool {
        let unit = unit(theta_rad, phi_rad);
        let cos_reach = libm::cos(self.reach_rad);
        self.units.iter().any(|u| dot(u, &unit) >= cos_reach)
    }

    /// The directions, each once: unit vectors.
    pub fn units(&self) -> &[[f64; 3]] {
        &self.units
    }

    /// Beyond this angle nothing was measured, radians; at most π/2.
    pub fn theta_max_rad(&self) -> f64 {
        self.theta_max_rad
    }

    /// How far a reading counts, radians.
    pub fn reach_rad(&self) -> f64 {
        self.reach_rad
    }
}

/// Directions that differ, in cells of the equal-area disk, as coarse as the number of them needs.
fn distinct(directions: &[(f64, f64)]) -> Vec<[f64; 3]> {
    let mut cells = 256.0;
    loop {
        let mut first: BTreeMap<(i64, i64), [f64; 3]> = BTreeMap::new();
        for &(theta, phi) in directions {
            let r = cells * libm::sin(0.5 * theta);
            #[allow(clippy::cast_possible_truncation)] // at most 256
            let place = |x: f64| libm::round(x) as i64;
            let key = (place(r * libm::cos(phi)), place(r * libm::sin(phi)));
            first.entry(key).or_insert_with(|| unit(theta, phi));
        }
        if first.len() <= DIRECTIONS_MAX {
            return first.into_values().collect();
        }
        cells *= 0.75;
    }
}

fn reach(units: &[[f64; 3]]) -> f64 {
    let stride = units.len().div_ceil(PROBES).max(1);
    let mut sides: Vec<f64> =
        units.iter().step_by(stride).filter_map(|probe| farthest_neighbour(probe, units)).collect();
    sides.sort_by(f64::total_cmp);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // below the length
    let place = (QUANTILE * sides.len() as f64) as usize;
    let side = sides.get(place).copied().unwrap_or(0.0);
    (SHARE * side).clamp(REACH_RAD.0, REACH_RAD.1)
}

/// How far it is to the nearest direction on each of four sides (greater θ, smaller θ, greater φ,
/// smaller φ), the farthest of those, radians; sides without any do not count.
fn farthest_neighbour(probe: &[f64; 3], units: &[[f64; 3]]) -> Option<f64> {
    let [x, y, z] = *probe;
    let rho = libm::hypot(x, y);
    let (cos, sin) = if rho > 1e-9 { (x / rho, y / rho) } else { (1.0, 0.0) };
    let (along_theta, along_phi) = ([z * cos, z * sin, -rho], [-sin, cos, 0.0]);
    // Cosines: the nearest has the largest.
    let mut nearest = [-1.0_f64; 4];
    for other in units {
        let (a, b) = (dot(&along_theta, other), dot(&along_phi, other));
        if a.abs().max(b.abs()) < 1e-9 {
            continue; // itself
        }
        let side = if a.abs() >= b.abs() { usize::from(a < 0.0) } else { 2 + usize::from(b < 0.0) };
        nearest[side] = nearest[side].max(dot(probe, other));
    }
    let found = nearest.into_iter().filter(|cos| *cos > -1.0);
    found.map(|cos| libm::acos(cos.min(1.0))).max_by(f64::total_cmp)
}

fn unit(theta_rad: f64, phi_rad: f64) -> [f64; 3] {
    let sin = libm::sin(theta_rad);
    [sin * libm::cos(phi_rad), sin * libm::sin(phi_rad), libm::cos(theta_rad)]
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(theta_step: u32, phi_step: u32, keep: impl Fn(f64, f64) -> bool) -> Vec<(f64, f64)> {
        let theta = (0..=80).step_by(theta_step as usize).map(f64::from);
        let all = theta.flat_map(|theta| {
            let phi = (-180..180).step_by(phi_step as usize).map(f64::from);
            phi.map(move |phi| (theta, phi))
        });
        let kept = all.filter(|(theta, phi)| keep(*theta, *phi));
        kept.map(|(theta, phi)| (theta.to_radians(), phi.to_radians())).collect()
    }

    fn gaps(coverage: &Coverage) -> Vec<(i32, i32)> {
        let mut gaps = Vec::new();
        for theta in 0..=90 {
            for phi in (-180..180).step_by(5) {
                if !coverage.holds(f64::from(theta).to_radians(), f64::from(phi).to_radians()) {
                    gaps.push((theta, phi));
                }
            }
        }
        gaps
    }

    #[test]
    fn the_meshes_of_a_schedule_are_no_gaps_and_the_horizon_is_one() {
        for (theta, phi) in [(20, 45), (10, 15), (5, 5), (2, 10), (1, 15)] {
            let gaps = gaps(&Coverage::of(&grid(theta, phi, |_, _| true)));
            let inside: Vec<_> = gaps.iter().filter(|(theta, _)| *theta <= 80).collect();
            assert!(inside.is_empty(), "{theta} {phi}: {inside:?}");
            assert!((81..=90).all(|theta| gaps.contains(&(theta, 0))));
        }
    }

    #[test]
    fn a_wedge_left_out_is_a_gap_and_nothing_else_is() {
        let wedge = |phi: f64| (30.0..=90.0).contains(&phi);
        let coverage = Coverage::of(&grid(5, 5, |theta, phi| theta < 20.0 || !wedge(phi)));
        let gaps = gaps(&coverage);
        for middle in 40..=80 {
            assert!(gaps.contains(&(middle, 60)), "{middle}");
        }
        let beside = |(theta, phi): &&(i32, i32)| *theta <= 80 && !wedge(f64::from(*phi));
        assert_eq!(gaps.iter().find(beside), None);
    }

    #[test]
    fn two_planes_are_not_a_hemisphere() {
        let gaps = gaps(&Coverage::of(&grid(5, 90, |_, _| true)));
        assert!(gaps.contains(&(60, 45)) && gaps.contains(&(80, -135)));
        assert!(!gaps.contains(&(60, 90)) && !gaps.contains(&(5, 45)));
    }

    #[test]
    fn nothing_one_direction_and_a_hundred_thousand_have_an_answer() {
        assert!(!Coverage::of(&[]).holds(0.0, 0.0));
        let one = Coverage::of(&[(0.0, 0.0)]);
        assert!(one.holds(0.0, 0.0) && !one.holds(0.1, 0.0));
        let many: Vec<(f64, f64)> =
            (0..100_000_u32).map(|i| (1.5 * f64::from(i) / 1e5, 2.4 * f64::from(i))).collect();
        let coverage = Coverage::of(&many);
        assert!(coverage.units.len() <= DIRECTIONS_MAX);
        assert!(gaps(&coverage).iter().all(|(theta, _)| *theta >= 86));
    }
}
