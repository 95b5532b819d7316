//! Poses on grids, and poses that fill a region evenly.
//!
//! Which poses a schedule means depends on plan and region alone: whether a rig can take them is
//! asked afterwards.

use radiometry::direction::wrap_deg;
use radiometry::quadrature::gauss_legendre;

use super::{Region, Schedule};
use crate::rig::Pose;

/// A multiple of a step may pass the region's edge by this much of a step: ten steps of 0.1° are
/// not exactly one degree in binary.
const STEP_SLACK: f64 = 1e-9;

/// The fractional parts of g^-1 to g^-4 times 2^64, with g the real root of g^5 = g + 1: the
/// additive recurrence R4 (Roberts 2018, "The unreasonable effectiveness of quasirandom
/// sequences"), a Kronecker sequence. Whole numbers, so that every machine makes the same points.
const R4: [u64; 4] =
    [0xdb4f_0b91_75ae_2165, 0xbbe0_5633_03a4_615f, 0xa0f2_ec75_a1fe_1575, 0x89e1_8285_7d9e_d688];
/// Where the sequence begins: in the middle of every interval.
const R4_START: u64 = 1 << 63;

/// The poses of a schedule, in its order; none for a list, which has its own file.
pub(super) fn poses(schedule: &Schedule, region: &Region) -> Vec<Pose> {
    match *schedule {
        Schedule::CGamma { x_count, y_count, c_step_deg, gamma_step_deg } => {
            let places = places(region, x_count, y_count);
            let phis: Vec<f64> =
                turn(c_step_deg).map(|c_deg| wrap_deg(0.0 - c_deg).to_radians()).collect();
            tensor(&places, &phis, &thetas(gamma_step_deg, region))
        }
        // Sweeps have their poses from the rig's counts.
        Schedule::Adaptive(_)
        | Schedule::List { .. }
        | Schedule::Spiral { .. }
        | Schedule::Sweep { .. } => Vec::new(),
        Schedule::LowDiscrepancy { count } => (0..count).map(|i| evenly(i, region)).collect(),
        Schedule::Quadrature { x_count, y_count, theta_count, phi_count } => {
            let xs = nodes(region.x_m, x_count);
            let ys = nodes(region.y_m, y_count);
            let places: Vec<(f64, f64)> =
                xs.iter().flat_map(|x_m| ys.iter().map(|y_m| (*x_m, *y_m))).collect();
            let sin2_max = libm::pow(libm::sin(region.theta_max_rad), 2.0);
            let thetas: Vec<f64> = nodes((0.0, sin2_max), theta_count)
                .into_iter()
                .map(|sin2| libm::asin(libm::sqrt(sin2)))
                .collect();
            let phi = |i: u32| wrap_deg(360.0 * f64::from(i) / f64::from(phi_count)).to_radians();
            // No node lies at the pole.
            let meridians = |place: &(f64, f64)| {
                let (x_m, y_m) = *place;
                let thetas = &thetas;
                let along = move |phi_rad: f64| {
                    thetas.iter().map(move |&theta_rad| Pose { x_m, y_m, theta_rad, phi_rad })
                };
                (0..phi_count).map(phi).flat_map(along).collect::<Vec<Pose>>()
            };
            places.iter().flat_map(meridians).collect()
        }
        Schedule::Raster { x_count, y_count, theta_step_deg, phi_step_deg } => {
            let places = places(region, x_count, y_count);
            let phis: Vec<f64> =
                turn(phi_step_deg).map(|phi_deg| wrap_deg(phi_deg).to_radians()).collect();
            tensor(&places, &phis, &thetas(theta_step_deg, region))
        }
    }
}

/// How many poses the schedule means, without making them.
pub(super) fn count(schedule: &Schedule, region: &Region) -> u64 {
    let grid = |x_count: u32, y_count: u32, theta_step_deg: f64, phi_step_deg: f64| {
        let circles = u64::from(steps_within(region.theta_max_rad, theta_step_deg.to_radians()));
        let directions = 1 + circles * u64::from(turn_steps(phi_step_deg));
        directions.saturating_mul(u64::from(x_count) * u64::from(y_count))
    };
    match *schedule {
        Schedule::CGamma { x_count, y_count, c_step_deg, gamma_step_deg } => {
            grid(x_count, y_count, gamma_step_deg, c_step_deg)
        }
        Schedule::Adaptive(_)
        | Schedule::List { .. }
        | Schedule::Spiral { .. }
        | Schedule::Sweep { .. } => 0,
        Schedule::LowDiscrepancy { count } => u64::from(count),
        Schedule::Quadrature { x_count, y_count, theta_count, phi_count } => {
            let directions = u64::from(theta_count) * u64::from(phi_count);
            directions.saturating_mul(u64::from(x_count) * u64::from(y_count))
        }
        Schedule::Raster { x_count, y_count, theta_step_deg, phi_step_deg } => {
            grid(x_count, y_count, theta_step_deg, phi_step_deg)
        }
    }
}

/// Every place, and at each every meridian from the pole outwards; the pole itself once.
fn tensor(places: &[(f64, f64)], phis: &[f64], thetas: &[f64]) -> Vec<Pose> {
    let mut poses = Vec::new();
    for &(x_m, y_m) in places {
        for (meridian, &phi_rad) in phis.iter().enumerate() {
            let from = usize::from(meridian > 0);
            let directions = thetas[from..].iter();
            poses.extend(directions.map(|&theta_rad| Pose { x_m, y_m, theta_rad, phi_rad }));
        }
    }
    poses
}

/// Columns of places, x first; one column or row stands in the middle, more reach the edges.
pub(super) fn places(region: &Region, x_count: u32, y_count: u32) -> Vec<(f64, f64)> {
    let ys = spread(region.y_m, y_count);
    let column = |x_m: f64| ys.iter().map(move |&y_m| (x_m, y_m));
    spread(region.x_m, x_count).into_iter().flat_map(column).collect()
}

/// Gauss-Legendre's nodes of an interval, rising.
fn nodes((low, high): (f64, f64), count: u32) -> Vec<f64> {
    let mut nodes: Vec<f64> = gauss_legendre(count as usize)
        .into_iter()
        .map(|(t, _)| low + (high - low) * 0.5 * (1.0 + t))
        .collect();
    nodes.sort_by(f64::total_cmp);
    nodes
}

fn spread((low, high): (f64, f64), count: u32) -> Vec<f64> {
    if count <= 1 {
        return vec![0.5 * (low + high)];
    }
    let gaps = f64::from(count - 1);
    let place = |i: u32| (low * (gaps - f64::from(i)) + high * f64::from(i)) / gaps;
    (0..count).map(place).collect()
}

/// 0 and every step from it inside the region, radians.
fn thetas(step_deg: f64, region: &Region) -> Vec<f64> {
    let circles = steps_within(region.theta_max_rad, step_deg.to_radians());
    let theta = |i: u32| (f64::from(i) * step_deg).to_radians().min(region.theta_max_rad);
    (0..=circles).map(theta).collect()
}

/// 0 and every step from it below a turn, degrees.
fn turn(step_deg: f64) -> impl Iterator<Item = f64> {
    (0..turn_steps(step_deg)).map(move |i| f64::from(i) * step_deg)
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates; never negative
fn turn_steps(step_deg: f64) -> u32 {
    libm::round(360.0 / step_deg) as u32
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates; never negative
fn steps_within(end: f64, step: f64) -> u32 {
    libm::floor(end / step + STEP_SLACK) as u32
}

/// The i-th point of a sequence that is uniform in x, in y, and in solid angle: sin²(θ/2) is
/// uniform, not sin²θ, since that is where a fit on the Nusselt disk wants its samples.
fn evenly(i: u32, region: &Region) -> Pose {
    let unit = |dimension: usize| {
        let point = R4_START.wrapping_add(R4[dimension].wrapping_mul(u64::from(i)));
        (point >> 11) as f64 * libm::ldexp(1.0, -53)
    };
    let along = |(low, high): (f64, f64), t: f64| low + (high - low) * t;
    let rim = libm::sin(0.5 * region.theta_max_rad);
    let theta_rad = 2.0 * libm::asin(rim * libm::sqrt(unit(0)));
    Pose {
        x_m: along(region.x_m, unit(2)),
        y_m: along(region.y_m, unit(3)),
        theta_rad: theta_rad.min(region.theta_max_rad),
        phi_rad: std::f64::consts::PI * (1.0 - 2.0 * unit(1)),
    }
}

/// The place of the k-th of meridians that are dealt out over so many, so that neighbours stand far
/// apart: about 0.38 of the places from one to the next, and no divisor of their count.
pub(super) fn dealt(k: usize, places: usize) -> usize {
    let wanted = (places * 382).div_ceil(1000).max(1);
    let stride = (wanted..=wanted + places).find(|stride| gcd(*stride, places) == 1).unwrap_or(1);
    (k * stride) % places
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use radiometry::direction::{angle_between, unit};

    use super::*;

    fn region(theta_max_deg: f64) -> Region {
        let theta_max_rad = theta_max_deg.to_radians();
        Region { x_m: (-0.01, 0.03), y_m: (-0.02, 0.02), theta_max_rad }
    }

    fn degrees(poses: &[Pose]) -> Vec<(f64, f64)> {
        let round = |deg: f64| libm::round(deg * 1e9) / 1e9;
        poses
            .iter()
            .map(|p| (round(p.theta_rad.to_degrees()), round(p.phi_rad.to_degrees())))
            .collect()
    }

    fn raster(x_count: u32, y_count: u32, theta_step_deg: f64, phi_step_deg: f64) -> Schedule {
        Schedule::Raster { x_count, y_count, theta_step_deg, phi_step_deg }
    }

    #[test]
    fn a_raster_has_the_pole_once_and_no_azimuth_twice() {
        let poses = poses(&raster(1, 1, 40.0, 90.0), &region(80.0));
        let expected = [
            (0.0, 0.0),
            (40.0, 0.0),
            (80.0, 0.0),
            (40.0, 90.0),
            (80.0, 90.0),
            (40.0, 180.0),
            (80.0, 180.0),
            (40.0, -90.0),
            (80.0, -90.0),
        ];
        assert_eq!(degrees(&poses), expected);
        assert!(poses.iter().all(|pose| (pose.x_m - 0.01).abs() < 1e-15 && pose.y_m == 0.0));
    }

    #[test]
    fn c_planes_run_against_the_azimuth() {
        let schedule =
            Schedule::CGamma { x_count: 1, y_count: 1, c_step_deg: 90.0, gamma_step_deg: 50.0 };
        let expected = [(0.0, 0.0), (50.0, 0.0), (50.0, -90.0), (50.0, 180.0), (50.0, 90.0)];
        assert_eq!(degrees(&poses(&schedule, &region(60.0))), expected);
    }

    #[test]
    fn places_reach_the_edges_and_the_count_is_known_before() {
        for schedule in [raster(3, 2, 0.1, 60.0), raster(1, 5, 7.0, 0.5), raster(2, 2, 90.0, 360.0)]
        {
            let region = region(60.0);
            assert_eq!(poses(&schedule, &region).len() as u64, count(&schedule, &region));
        }
        let poses = poses(&raster(3, 2, 30.0, 60.0), &region(30.0));
        let xs: Vec<f64> = poses.iter().map(|pose| pose.x_m).collect();
        assert_eq!(xs.first(), Some(&-0.01));
        assert_eq!(xs.last(), Some(&0.03));
        assert!(xs.iter().any(|x_m| (x_m - 0.01).abs() < 1e-15));
    }

    #[test]
    fn quadrature_nodes_integrate_polynomials_of_the_disk() {
        let region = region(80.0);
        let schedule =
            Schedule::Quadrature { x_count: 2, y_count: 1, theta_count: 3, phi_count: 8 };
        let poses = poses(&schedule, &region);
        assert_eq!(poses.len() as u64, count(&schedule, &region));
        // The rule's weights in sin²θ, in the order of the nodes; its mean of a power is exact up to the
        // fifth, and of waves round the circle up to the seventh.
        let weights: Vec<f64> = {
            let mut rule = gauss_legendre(3);
            rule.sort_by(|a, b| a.0.total_cmp(&b.0));
            rule.into_iter().map(|(_, weight)| 0.5 * weight / 16.0).collect()
        };
        let mean = |f: &dyn Fn(&Pose) -> f64| -> f64 {
            poses.iter().enumerate().map(|(i, pose)| weights[i % 3] * f(pose)).sum()
        };
        let rim2 = libm::pow(libm::sin(80_f64.to_radians()), 2.0);
        let u = |pose: &Pose| libm::pow(libm::sin(pose.theta_rad), 2.0) / rim2;
        assert!((mean(&|pose| libm::pow(u(pose), 5.0)) - 1.0 / 6.0).abs() < 1e-12);
        assert!(mean(&|pose| u(pose) * libm::cos(7.0 * pose.phi_rad + 0.3)).abs() < 1e-12);
        assert!((mean(&|pose| pose.x_m) - 0.01).abs() < 1e-15);
    }

    #[test]
    fn ten_steps_of_a_tenth_reach_the_region_s_edge() {
        let thetas = thetas(0.1, &region(1.0));
        assert_eq!(thetas.len(), 11);
        assert_eq!(thetas[10].to_bits(), region(1.0).theta_max_rad.to_bits());
    }

    #[test]
    fn even_points_are_uniform_in_solid_angle_and_place() {
        let region = region(80.0);
        let poses = poses(&Schedule::LowDiscrepancy { count: 4_000 }, &region);
        let share = |is_in: &dyn Fn(&Pose) -> bool| {
            poses.iter().filter(|pose| is_in(pose)).count() as f64 / poses.len() as f64
        };
        let cap = |deg: f64| libm::pow(libm::sin(0.5 * deg.to_radians()), 2.0);
        let near = |found: f64, expected: f64| (found - expected).abs() < 0.003;
        for deg in [20.0_f64, 45.0, 70.0] {
            let found = share(&|pose| pose.theta_rad < deg.to_radians());
            assert!(near(found, cap(deg) / cap(80.0)), "{found} within {deg}°");
        }
        assert!(near(share(&|pose| pose.phi_rad > 0.25 * PI), 0.375));
        assert!(near(share(&|pose| pose.x_m < 0.0), 0.25));
        assert!(near(share(&|pose| pose.y_m < 0.0 && pose.x_m < 0.01), 0.25));
        assert!(poses.iter().all(|pose| pose.phi_rad > -PI && pose.phi_rad <= PI));
    }

    #[test]
    fn even_directions_keep_apart() {
        let poses = poses(&Schedule::LowDiscrepancy { count: 60 }, &region(90.0));
        let directions: Vec<_> = poses.iter().map(|p| unit(p.theta_rad, p.phi_rad)).collect();
        for (i, a) in directions.iter().enumerate() {
            for b in &directions[..i] {
                assert!(angle_between(*a, *b).to_degrees() > 1.0);
            }
        }
    }
}
