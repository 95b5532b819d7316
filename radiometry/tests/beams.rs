//! What could break: a rule that is not the beam it says, moments that are another beam's, or a
//! footprint that a ray leaves.

use core::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec2, DVec3};
use radiometry::beam::{Beam, Placed, disk_rule, footprint};

/// Slender, wide, a tube, one whose stop stands behind the plane, and the widest.
fn beams() -> [Beam; 5] {
    [
        Beam::of_spot(0.006_25, 0.002_5, 0.3).unwrap(),
        Beam::of_spot(0.012_5, 0.005, 0.3).unwrap(),
        Beam::of_tube(0.004, 0.003, 0.08, 0.05).unwrap(),
        Beam::of_spot(0.006_25, 0.002_5, 0.3).unwrap().with_origin_moved(0.004),
        Beam::of_spot(0.06, 0.05, 0.2).unwrap(),
    ]
}

/// A point of the unit disk for each pair of numbers in [0, 1), evenly.
fn on_disk(radius: f64, u: f64, v: f64) -> DVec2 {
    DVec2::from_angle(TAU * v) * (radius * u.sqrt())
}

/// Every ray of a dense lattice through both disks: where it crosses the stop, its direction, and
/// dT for it, up to a common factor.
fn dense(beam: &Beam, n: u32) -> Vec<(DVec3, DVec3, f64)> {
    // A rank-1 lattice in four dimensions: generators of the plastic-number family.
    let root = 1.167_303_978_261_418_7_f64;
    let generators = [1, 2, 3, 4].map(|k| root.powi(-k));
    let rays = (0..n).map(|i| {
        let at = generators.map(|g| (0.5 + f64::from(i) * g).fract());
        let stop = on_disk(beam.stop_radius_m(), at[0], at[1]).extend(beam.stop_z_m());
        let pupil = on_disk(beam.pupil_radius_m(), at[2], at[3]).extend(beam.pupil_z_m());
        let along = pupil - stop;
        let r = along.length();
        (stop, along / r, (beam.separation_m() / r).powi(4))
    });
    rays.collect()
}

#[test]
fn disk_rules_are_exact_to_their_degree_and_not_beyond() {
    // The mean of x^a y^b over the unit disk, a and b even: 2/(a+b+2) times the mean of
    // cos^a sin^b, which is (a-1)!!(b-1)!!/(a+b)!!.
    let double = |n: i32| (1..=n).rev().step_by(2).map(f64::from).product::<f64>();
    let moment = |a: i32, b: i32| match (a % 2, b % 2) {
        (0, 0) => 2.0 / f64::from(a + b + 2) * double(a - 1) * double(b - 1) / double(a + b),
        _ => 0.0,
    };
    for degree in [1, 3, 5, 7, 9, 12, 15] {
        let rule = disk_rule(degree);
        let error = |total: i32| {
            let of = |a: i32| {
                let b = total - a;
                let mean: f64 = rule.iter().map(|(n, w)| w * n.x.powi(a) * n.y.powi(b)).sum();
                (mean - moment(a, b)).abs()
            };
            (0..=total).map(of).fold(0.0, f64::max)
        };
        let exact = i32::try_from(degree).unwrap();
        for total in 0..=exact {
            assert!(error(total) < 1e-15, "degree {degree}: {total}");
        }
        let beyond = (exact + 1..=4 * exact + 4).map(error).fold(0.0, f64::max);
        assert!(beyond > 1e-7, "degree {degree}: nothing beyond it is wrong");
    }
}

#[test]
fn the_throughput_of_the_rays_is_the_closed_forms() {
    for beam in beams() {
        let exact = beam.throughput().unwrap().m2_sr();
        let off = |degree| (beam.rule(degree).throughput_m2_sr() / exact - 1.0).abs();
        let wide = (beam.pupil_radius_m() + beam.stop_radius_m()) / beam.separation_m();
        // The weights' series goes with the square of the width: one power more every two degrees.
        for degree in [3, 5, 7, 9] {
            let power = i32::try_from(degree + 1).unwrap();
            assert!(off(degree) < 8.0 * wide.powi(power) + 3e-15, "{beam:?} at {degree}");
        }
        assert!(off(1) > 1e-6, "one ray is not a beam");
    }
}

#[test]
fn means_and_moments_agree_with_a_dense_lattice_of_rays() {
    for beam in beams() {
        let rays = dense(&beam, 200_000);
        let total: f64 = rays.iter().map(|(.., w)| w).sum();
        let mean = |of: &dyn Fn(DVec3, DVec3) -> f64| {
            rays.iter().map(|(p, d, w)| w * of(*p, *d)).sum::<f64>() / total
        };
        let at_origin = |p: DVec3, d: DVec3| p - d * (p.z / d.z);
        let moments = beam.moments().unwrap();
        let close = |found: f64, expected: f64, scale: f64| {
            assert!((found - expected).abs() < 2e-4 * scale, "{beam:?}: {found}, {expected}");
        };
        let x2 = mean(&|p, d| at_origin(p, d).x.powi(2));
        let u2 = mean(&|_, d| d.x * d.x);
        close(moments.position_m2, x2, x2);
        close(moments.direction, u2, u2);
        let xu = mean(&|p, d| at_origin(p, d).x * d.x);
        close(moments.position_direction_m, xu, (x2 * u2).sqrt());
        // A function that is no polynomial, tilted as a cosine lobe is.
        let lobe = |p: DVec3, d: DVec3| {
            let cos = (d.dot(DVec3::new(0.6, 0.0, 0.8))).max(0.0);
            (1.0 + p.x / beam.stop_radius_m() * 0.1).exp() * cos.powi(6)
        };
        let rule = beam.rule(11).mean(|ray| lobe(ray.point, ray.direction));
        close(rule, mean(&lobe), rule);
    }
}

#[test]
fn no_ray_leaves_the_footprint_and_some_come_near_its_ends() {
    for beam in beams() {
        for theta_deg in [0.0_f64, 10.0, 45.0, 70.0, 80.0, 85.0, 88.0, 90.0] {
            let theta = theta_deg.to_radians().min(FRAC_PI_2);
            let placed = Placed::new(DVec3::ZERO, DVec3::new(theta.sin(), 0.0, theta.cos()));
            // Rays along both rims reach furthest.
            let mut ends = [0.0_f64; 3];
            let mut all_meet = true;
            for i in 0..360 {
                for j in 0..360 {
                    let rim = |r: f64, k: i32| DVec2::from_angle(TAU * f64::from(k) / 360.0) * r;
                    let stop = rim(beam.stop_radius_m(), i).extend(beam.stop_z_m());
                    let pupil = rim(beam.pupil_radius_m(), j).extend(beam.pupil_z_m());
                    let (stop, pupil) = (placed.point(stop), placed.point(pupil));
                    let along = pupil - stop;
                    if along.z <= 0.0 || pupil.z <= 0.0 {
                        all_meet = false;
                        continue;
                    }
                    let at = stop - along * (stop.z / along.z);
                    ends = [ends[0].max(at.x), ends[1].max(-at.x), ends[2].max(at.y.abs())];
                }
            }
            let Some(reach) = footprint(&beam, theta).unwrap() else {
                assert!(!all_meet || ends[1] > 1.0, "{beam:?} at {theta_deg}° has a footprint");
                continue;
            };
            assert!(all_meet, "{beam:?} at {theta_deg}°");
            let stated = [reach.near_m, reach.far_m, reach.across_m];
            for (stated, found) in stated.iter().zip(ends) {
                assert!(found <= stated * (1.0 + 1e-12), "{beam:?} {theta_deg}° {stated} {found}");
            }
            // In the plane of incidence the ends are reached; across it is a bound.
            for (stated, found) in stated.iter().zip(ends).take(2) {
                assert!(found > stated * 0.99, "{beam:?} {theta_deg}°: {stated}, {found}");
            }
        }
    }
}

#[test]
fn a_placed_beam_keeps_lengths_and_looks_along_its_axis() {
    for direction in [
        DVec3::Z,
        DVec3::new(0.6, 0.0, 0.8),
        DVec3::new(-0.48, 0.64, 0.6),
        DVec3::new(0.0, -1.0, 0.0),
    ] {
        let spot = DVec3::new(0.01, -0.02, 0.003);
        let placed = Placed::new(spot, direction);
        assert!(
            (placed.point(DVec3::new(0.0, 0.0, 2.0)) - spot - 2.0 * direction).length() < 1e-15
        );
        let [x, y, z] = placed.axes();
        assert!((x.cross(y) - z).length() < 1e-15 && y.z.abs() < 1e-15, "{direction}");
        assert!(
            (placed.direction(DVec3::new(0.3, -0.5, 0.2)).length_squared() - 0.38).abs() < 1e-15
        );
    }
}

#[test]
fn beams_that_cannot_be_are_refused() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(Beam::of_spot(bad, 1.0, 1.0).is_err());
        assert!(Beam::of_spot(1.0, bad, 1.0).is_err());
        assert!(Beam::of_spot(1.0, 1.0, bad).is_err());
        assert!(Beam::of_tube(1.0, 1.0, bad, 0.0).is_err());
    }
    assert!(Beam::of_tube(1.0, 1.0, 1.0, -0.1).is_err());
    let beam = Beam::of_spot(0.01, 0.01, 0.3).unwrap();
    assert!(footprint(&beam, -0.1).is_err() && footprint(&beam, f64::NAN).is_err());
}
