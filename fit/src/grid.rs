//! The distinct coordinates that samples were meant to have: readbacks scatter about a plan's grid.

use crate::{Ray, Region, Sample};
use std::f64::consts::PI;

/// The distinct coordinates of samples, each rising.
#[derive(Debug)]
pub(crate) struct Grid {
    pub(crate) x_m: Vec<f64>,
    pub(crate) y_m: Vec<f64>,
    pub(crate) theta_rad: Vec<f64>,
    /// Azimuths as lines through the pole, in [0, π): an arm swung to the other side is on the
    /// same line. Of readings well off the pole only, near which an azimuth means little.
    pub(crate) azimuth_lines_rad: Vec<f64>,
    position_apart_m: f64,
}

impl Grid {
    pub(crate) fn of(samples: &[Sample], region: &Region) -> Self {
        let rays = || samples.iter().map(|s| s.ray);
        let theta_max = rays().map(|ray| ray.theta_rad).fold(0.0, f64::max);
        let off_pole = off_pole_rad(theta_max);
        let lines = rays().filter(|ray| pole_distance_rad(ray) > off_pole);
        Self::of_values(
            rays().map(|ray| ray.x_m).collect(),
            rays().map(|ray| ray.y_m).collect(),
            rays().map(|ray| ray.theta_rad).collect(),
            lines.map(|ray| azimuth_line(ray.phi_rad)).collect(),
            region,
        )
    }

    /// Of all values that samples have; of azimuth lines those well off the pole.
    pub(crate) fn of_values(
        x_m: Vec<f64>,
        y_m: Vec<f64>,
        theta_rad: Vec<f64>,
        azimuth_lines_rad: Vec<f64>,
        region: &Region,
    ) -> Self {
        let position_apart_m = position_apart_m(region);
        Self {
            x_m: distinct(x_m, position_apart_m),
            y_m: distinct(y_m, position_apart_m),
            theta_rad: distinct(theta_rad, ANGLE_APART_RAD),
            azimuth_lines_rad: distinct(azimuth_lines_rad, ANGLE_APART_RAD),
            position_apart_m,
        }
    }

    /// Whether the normal is among the directions.
    pub(crate) fn has_pole(&self) -> bool {
        self.theta_rad.first().is_some_and(|theta_rad| *theta_rad < ANGLE_APART_RAD)
    }

    /// The ray moved to the grid.
    pub(crate) fn snap(&self, ray: &Ray) -> Ray {
        let line = azimuth_line(ray.phi_rad);
        let turn = ray.phi_rad - line;
        Ray {
            x_m: nearest(&self.x_m, ray.x_m, self.position_apart_m),
            y_m: nearest(&self.y_m, ray.y_m, self.position_apart_m),
            theta_rad: nearest(&self.theta_rad, ray.theta_rad, ANGLE_APART_RAD),
            phi_rad: turn + nearest(&self.azimuth_lines_rad, line, ANGLE_APART_RAD),
        }
    }
}

/// Of a ray the angle to the nearer pole: over the whole sphere there is one below, too.
pub(crate) fn pole_distance_rad(ray: &Ray) -> f64 {
    ray.theta_rad.min(PI - ray.theta_rad)
}

/// Beyond this angle from the pole an azimuth means something, among samples up to `theta_max`.
pub(crate) fn off_pole_rad(theta_max: f64) -> f64 {
    (OFF_POLE_SHARE * theta_max).clamp(ANGLE_APART_RAD, OFF_POLE_RAD)
}

/// Positions closer than this are one.
pub(crate) fn position_apart_m(region: &Region) -> f64 {
    POSITION_APART * region.margin_m()
}

/// The line through the pole that an azimuth lies on, from just below 0 to below π.
pub(crate) fn azimuth_line(phi_rad: f64) -> f64 {
    let line = phi_rad.rem_euclid(PI);
    if PI - line < ANGLE_APART_RAD { line - PI } else { line }
}

/// The values without those that lie closer than `apart` above another one.
fn distinct(mut sorted: Vec<f64>, apart: f64) -> Vec<f64> {
    sorted.sort_by(f64::total_cmp);
    sorted.dedup_by(|value, kept| *value - *kept < apart);
    sorted
}

/// The grid's value at or just below, if there is one closer than `apart`.
fn nearest(grid: &[f64], value: f64, apart: f64) -> f64 {
    let at_or_below = grid[..grid.partition_point(|g| *g <= value)].last();
    at_or_below.copied().filter(|g| value - g < apart).unwrap_or(value)
}

/// Angles closer than this (0.06°) are one: readbacks scatter less, and no plan steps so finely.
pub(crate) const ANGLE_APART_RAD: f64 = 1e-3;
/// Positions closer than this share of the region's margin (0.2 % of its half width) are one.
const POSITION_APART: f64 = 0.1;
/// Readings farther off the pole than this (6°) have an azimuth ..
const OFF_POLE_RAD: f64 = 0.1;
/// .. or than this share of the farthest one.
const OFF_POLE_SHARE: f64 = 0.3;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Noise;

    const REGION: Region = Region::surface((-0.01, 0.01), (-0.01, 0.01), 1.4);

    fn sample(theta_deg: f64, phi_deg: f64) -> Sample {
        let (theta_rad, phi_rad) = (theta_deg.to_radians(), phi_deg.to_radians());
        let ray = Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad };
        Sample { ray, value: 1.0, noise: Noise::Unknown }
    }

    #[test]
    fn opposite_and_scattered_azimuths_are_one_line() {
        let phis = [-0.01, 0.02, 179.99, -179.985, 360.0];
        let samples: Vec<Sample> = phis.iter().map(|phi| sample(40.0, *phi)).collect();
        let grid = Grid::of(&samples, &REGION);
        assert_eq!(grid.azimuth_lines_rad.len(), 1);
        let snapped = samples.iter().map(|s| grid.snap(&s.ray).phi_rad);
        for phi_rad in snapped {
            let on_line = libm::sin(phi_rad - grid.azimuth_lines_rad[0]);
            assert!(on_line.abs() < 1e-12, "{phi_rad}");
        }
    }

    #[test]
    fn azimuths_next_to_the_pole_do_not_count() {
        let samples = [sample(0.003, 77.0), sample(0.01, -20.0), sample(30.0, 10.0)];
        let grid = Grid::of(&samples, &REGION);
        assert_eq!(grid.azimuth_lines_rad.len(), 1);
        assert!(grid.has_pole());
        assert_eq!(grid.theta_rad.len(), 2);
    }
}
