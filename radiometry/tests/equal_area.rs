//! The equal-area environment map: against the published map from the square to the sphere, written down
//! once more, and against what must hold for every map and normal.

mod dice;

use std::f64::consts::{FRAC_PI_4, PI};

use dice::Dice;
use glam::DVec3;
use radiometry::direction::{frame, unit};
use radiometry::environment::{EnvironmentError, EqualArea};
use radiometry::quantity::Radiance;
use radiometry::{Estimate, EstimateError, Tolerance};

impl Dice {
    fn radiances(&mut self, side: usize) -> Vec<f64> {
        (0..side * side).map(|_| (8.0 * self.unit() - 3.0).max(0.0).exp() - 1.0).collect()
    }
}

fn map(side: usize, radiances: &[f64]) -> EqualArea {
    let radiances: Vec<_> = radiances.iter().map(|l| Radiance::from_w_per_m2_sr(*l)).collect();
    EqualArea::new(side, &radiances).unwrap()
}

fn normals() -> Vec<DVec3> {
    let mut dice = Dice(23);
    let mut normals = vec![DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z];
    for (tilt, heading) in [(1e-17, 0.3), (1e-9, 3.0), (FRAC_PI_4, 0.0), (2.0 * FRAC_PI_4, 0.7)] {
        normals.extend([unit(tilt, heading), -unit(tilt, heading)]);
    }
    normals.extend((0..60).map(|_| dice.direction() * (40.0 * dice.unit() - 20.0).exp()));
    normals
}

/// `EqualAreaSquareToSphere` of Pharr, Jakob and Humphreys 2023, u and v in [0, 1].
fn square_to_sphere(u: f64, v: f64) -> DVec3 {
    let (u, v) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let signed_distance = 1.0 - (u.abs() + v.abs());
    let r = 1.0 - signed_distance.abs();
    let phi = if r == 0.0 { 1.0 } else { (v.abs() - u.abs()) / r + 1.0 } * FRAC_PI_4;
    let z = (1.0 - r * r).copysign(signed_distance);
    let across = r * (2.0 - r * r).sqrt();
    DVec3::new(phi.cos().copysign(u) * across, phi.sin().copysign(v) * across, z)
}

#[test]
fn a_direction_finds_the_pixel_that_the_published_map_takes_it_to() {
    let side = 10;
    let radiances: Vec<f64> = (0..100).map(f64::from).collect();
    let map = map(side, &radiances);
    let mut dice = Dice(29);
    for (index, expected) in radiances.iter().enumerate() {
        for _ in 0..20 {
            let within =
                |at: usize, dice: &mut Dice| (at as f64 + 0.01 + 0.98 * dice.unit()) / side as f64;
            let (u, v) = (within(index % side, &mut dice), within(index / side, &mut dice));
            let towards = square_to_sphere(u, v) * 1e-3;
            let found = map.radiance(towards).unwrap().w_per_m2_sr();
            assert!((found - expected).abs() < 0.5, "{u} {v}: pixel {found}, expected {expected}");
        }
    }
    assert!((100.0 * map.pixel_solid_angle().sr() - 4.0 * PI).abs() < 1e-14);
}

#[test]
fn a_uniform_map_gives_pi_l_on_every_tilt() {
    for side in [2, 4, 6, 16, 50] {
        let uniform = map(side, &vec![2.5; side * side]);
        for normal in normals() {
            let found = uniform.irradiance(normal, Tolerance::default()).unwrap();
            let error = (found.value - 2.5 * PI).abs();
            let said = format!("{side}, {normal}: {found:?}, off by {error:e}");
            assert!(error <= found.error_bound, "{said}");
            assert!(found.error_bound <= 1e-10 * found.value, "{said}");
        }
    }
}

#[test]
fn the_midpoint_rule_over_the_square_finds_the_same() {
    const FINE: usize = 600;
    let mut dice = Dice(31);
    for side in [2, 6, 12] {
        let radiances = dice.radiances(side);
        let map = map(side, &radiances);
        for normal in normals().into_iter().step_by(5) {
            let (normal, mut sum) = (normal.normalize(), 0.0);
            for (i, j) in (0..FINE).flat_map(|i| (0..FINE).map(move |j| (i, j))) {
                let at = |index: usize| (index as f64 + 0.5) / FINE as f64;
                let cos = normal.dot(square_to_sphere(at(i), at(j))).max(0.0);
                sum += cos * radiances[j * side / FINE * side + i * side / FINE];
            }
            let expected = sum * 4.0 * PI / (FINE * FINE) as f64;
            let found = map.irradiance(normal, Tolerance::default()).unwrap().value;
            assert!((found / expected - 1.0).abs() < 2e-5, "{side}: {found}, expected {expected}");
        }
    }
}

#[test]
fn it_does_not_matter_how_fine_a_map_is_drawn() {
    let side = 4;
    let radiances = Dice(37).radiances(side);
    let there = map(side, &radiances);
    for finer in [2, 3, 7] {
        let width = side * finer;
        let drawn: Vec<f64> = (0..width * width)
            .map(|k| radiances[k / width / finer * side + k % width / finer])
            .collect();
        let drawn = map(width, &drawn);
        for normal in normals() {
            let [a, b]: [Estimate; 2] =
                [&there, &drawn].map(|map| map.irradiance(normal, Tolerance::default()).unwrap());
            let error = (a.value - b.value).abs();
            assert!(error <= a.error_bound + b.error_bound, "{a:?} and {b:?}, off by {error:e}");
        }
    }
}

#[test]
fn contours_find_what_integrals_find_to_the_last_digits() {
    // Nothing meets a tolerance of 0: every pixel on the horizon is integrated, and the best is said.
    let without_end = Tolerance::new(0.0, 0.0, 100_000_000).unwrap();
    for side in [18, 40, 150] {
        let map = map(side, &Dice(41).radiances(side));
        for normal in normals().into_iter().step_by(if side > 100 { 4 } else { 1 }) {
            let quick = map.irradiance(normal, Tolerance::from_relative(1e-13).unwrap()).unwrap();
            let unmet = map.irradiance(normal, without_end).unwrap_err();
            let EstimateError::Unmet { estimate: fine, .. } = unmet else { panic!("{unmet}") };
            let error = (quick.value - fine.value).abs();
            let said = format!("{side}, {normal}: {quick:?}, {fine:?}, off by {error:e}");
            assert!(error <= quick.error_bound + fine.error_bound, "{said}");
            assert!(error <= 2e-15 * fine.value, "{said}");
            assert!(side < 100 || 2 * quick.evaluations < fine.evaluations, "{said}");
        }
    }
}

#[test]
fn what_has_set_is_dark_and_a_budget_too_small_says_so() {
    let side = 64;
    let mut radiances = vec![0.0; side * side];
    radiances[20 * side + 41] = 1e7;
    let sun = map(side, &radiances);
    let middle = square_to_sphere(41.5 / 64.0, 20.5 / 64.0);
    let facing = sun.irradiance(middle, Tolerance::default()).unwrap();
    assert!((facing.value / (1e7 * sun.pixel_solid_angle().sr()) - 1.0).abs() < 1e-3);
    let set = sun.irradiance(-middle, Tolerance::default()).unwrap();
    assert_eq!((set.value.to_bits(), set.error_bound.to_bits()), (0, 0));
    let (grazing, _) = frame(middle);
    let fine = sun.irradiance(grazing, Tolerance::default()).unwrap();
    assert!(fine.value > 0.0 && fine.error_bound <= 1e-10 * fine.value, "{fine:?}");
    let hurried = Tolerance::new(0.0, 0.0, 21).unwrap();
    let unmet = sun.irradiance(grazing, hurried).unwrap_err();
    let EstimateError::Unmet { estimate, .. } = unmet else { panic!("{unmet}") };
    assert!((estimate.value - fine.value).abs() <= estimate.error_bound + fine.error_bound);
}

#[test]
fn what_is_no_map_is_refused() {
    let one = Radiance::from_w_per_m2_sr(1.0);
    let refused =
        |side: usize, radiances: &[Radiance]| EqualArea::new(side, radiances).unwrap_err();
    assert_eq!(refused(3, &[one; 9]), EnvironmentError::Odd { side: 3 });
    assert_eq!(refused(2, &[one; 3]), EnvironmentError::Count { found: 3, expected: 4 });
    assert_eq!(refused(0, &[]), EnvironmentError::Size { rows: 0, columns: 0 });
    assert!(matches!(refused(2, &[one, one, one, -one]), EnvironmentError::Pixel { index: 3, .. }));
    let map = EqualArea::new(2, &[one; 4]).unwrap();
    assert!(map.irradiance(DVec3::ZERO, Tolerance::default()).is_err());
    assert!(map.irradiance(DVec3::NAN, Tolerance::default()).is_err());
    assert!(map.radiance(DVec3::ZERO).is_err());
}
