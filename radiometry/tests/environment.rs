//! Irradiance from environment maps: what must hold for every map and every normal, and the same numbers
//! by quadrature of the clipped cosine and by rays at random, which share nothing with the kernel.

mod dice;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use dice::Dice;
use glam::DVec3;
use radiometry::direction::{frame, unit};
use radiometry::environment::{EnvironmentError, LatLong};
use radiometry::quadrature::{adaptive, gauss_legendre};
use radiometry::quantity::{Luminance, Radiance};
use radiometry::{DomainError, Estimate, Tolerance};

impl Dice {
    /// Some pixels dark, some bright, one a Sun.
    fn radiances(&mut self, count: usize) -> Vec<f64> {
        let mut radiances: Vec<f64> =
            (0..count).map(|_| (8.0 * self.unit() - 3.0).max(0.0).exp() - 1.0).collect();
        radiances[count / 3] = 1e4;
        radiances
    }
}

fn map(rows: usize, columns: usize, radiances: &[f64]) -> LatLong {
    let radiances: Vec<_> = radiances.iter().map(|l| Radiance::from_w_per_m2_sr(*l)).collect();
    LatLong::new(rows, columns, &radiances).unwrap()
}

/// On pixel edges and next to them, in the mirror plane, anywhere.
fn normals() -> Vec<DVec3> {
    let mut dice = Dice(5);
    let mut normals = vec![DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z];
    for tilt in [1e-300, 1e-17, 1e-12, 1e-6, 0.25 * PI, FRAC_PI_2 - 1e-15, FRAC_PI_2 + 1e-9] {
        for heading in [0.0, FRAC_PI_2, 0.3, PI, -1e-14] {
            normals.push(unit(tilt, heading));
            normals.push(-unit(tilt, heading));
        }
    }
    normals.extend((0..40).map(|_| dice.direction() * (40.0 * dice.unit() - 20.0).exp()));
    normals
}

const SIZES: [(usize, usize); 9] =
    [(1, 1), (1, 2), (2, 1), (3, 5), (4, 8), (7, 3), (16, 32), (33, 64), (90, 180)];

#[test]
fn a_uniform_map_gives_pi_l_on_every_tilt() {
    for (rows, columns) in SIZES {
        let uniform = map(rows, columns, &vec![2.5; rows * columns]);
        for normal in normals() {
            let found = uniform.irradiance(normal).unwrap();
            let error = (found.value - 2.5 * PI).abs();
            let said = format!("{rows} x {columns}, {normal}: {found:?}, off by {error:e}");
            assert!(error <= found.error_bound, "{said}");
            assert!(found.error_bound < 2.5e-13 * found.value, "{said}");
        }
    }
}

/// ∫ L max(0, n·ω) dω over one pixel: Gauss's rule over the visible θ, adaptive over φ.
fn by_quadrature(theta: [f64; 2], phi: [f64; 2], normal: DVec3) -> Estimate {
    let rule = gauss_legendre(24);
    let over_theta = |phi: f64| {
        let sideways = normal.x * phi.cos() + normal.y * phi.sin();
        // On the meridian's whole circle; one beyond θ = -π/2 is reached over θ = π.
        let highest = sideways.atan2(normal.z);
        let highest = if highest < -FRAC_PI_2 { highest + TAU } else { highest };
        let (from, to) = (theta[0].max(highest - FRAC_PI_2), theta[1].min(highest + FRAC_PI_2));
        let (middle, half) = (f64::midpoint(from, to), 0.5 * (to - from).max(0.0));
        let at = |(node, weight): &(f64, f64)| {
            let (sin, cos) = (half * node + middle).sin_cos();
            weight * half * (sideways * sin + normal.z * cos) * sin
        };
        rule.iter().map(at).sum::<f64>()
    };
    let tolerance = Tolerance::new(1e-9, 1e-13, 200_000).unwrap();
    adaptive(over_theta, phi[0], phi[1], tolerance).unwrap()
}

#[test]
fn every_bound_holds_against_quadrature_of_the_clipped_cosine() {
    let mut dice = Dice(7);
    for (rows, columns) in [(1, 1), (2, 3), (5, 4), (6, 12), (20, 9)] {
        let radiances = dice.radiances(rows * columns);
        let whole = map(rows, columns, &radiances);
        for normal in normals().into_iter().skip(3).step_by(7) {
            let normal = normal.normalize();
            let (mut expected, mut slack) = (0.0, 0.0);
            for (index, radiance) in radiances.iter().enumerate() {
                let edge = |at: usize, parts: usize, all: f64| all * at as f64 / parts as f64;
                let (row, column) = (index / columns, index % columns);
                let theta = [edge(row, rows, PI), edge(row + 1, rows, PI)];
                let phi = [edge(column, columns, TAU), edge(column + 1, columns, TAU)];
                let pixel = by_quadrature(theta, phi, normal);
                expected += radiance * pixel.value;
                slack += radiance * (pixel.error_bound + 1e-15);
            }
            let found = whole.irradiance(normal).unwrap();
            let error = (found.value - expected).abs();
            assert!(
                error <= found.error_bound + slack,
                "{rows} x {columns}, {normal}: {found:?}, expected {expected}, off by {error:e}"
            );
            assert!(slack < 1e-8 * expected, "the reference itself is within {slack:e}");
        }
    }
}

#[test]
fn rays_at_random_find_the_same_through_the_lookup() {
    const RAYS: usize = 200_000;
    let mut dice = Dice(11);
    let radiances: Vec<f64> = (0..9 * 14).map(|_| dice.unit()).collect();
    let map = map(9, 14, &radiances);
    for _ in 0..6 {
        let normal = dice.direction();
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..RAYS {
            let sample = PI * map.radiance(dice.ray(normal)).unwrap().w_per_m2_sr();
            sum += sample;
            squares += sample * sample;
        }
        let mean = sum / RAYS as f64;
        let deviation = ((squares / RAYS as f64 - mean * mean) / RAYS as f64).sqrt();
        let found = map.irradiance(normal).unwrap().value;
        assert!((found - mean).abs() < 4.5 * deviation, "{normal}: {found}, by rays {mean}");
    }
}

/// Equal within what both admit.
fn same(what: &str, a: Estimate, b: Estimate) {
    let error = (a.value - b.value).abs();
    assert!(error <= a.error_bound + b.error_bound, "{what}: {a:?} and {b:?}, off by {error:e}");
}

#[test]
fn turning_map_and_receiver_together_changes_nothing() {
    let (rows, columns) = (11, 24);
    let radiances = Dice(13).radiances(rows * columns);
    let there = map(rows, columns, &radiances);
    for steps in [1, 5, 12, 23] {
        let turned: Vec<f64> = (0..rows * columns)
            .map(|i| radiances[i / columns * columns + (i % columns + columns - steps) % columns])
            .collect();
        let turned = map(rows, columns, &turned);
        let (sin, cos) = (TAU * steps as f64 / columns as f64).sin_cos();
        for n in normals() {
            let with_it = DVec3::new(n.x * cos - n.y * sin, n.x * sin + n.y * cos, n.z);
            let (a, b) = (there.irradiance(n).unwrap(), turned.irradiance(with_it).unwrap());
            // The turned normal is itself rounded.
            let rounding = 1e-15 * 1e4;
            same(&format!("{n}"), a, Estimate { error_bound: b.error_bound + rounding, ..b });
        }
    }
}

#[test]
fn a_mirrored_map_gives_the_mirrored_receiver_the_same() {
    let (rows, columns) = (10, 6);
    let radiances = Dice(17).radiances(rows * columns);
    let upside_down: Vec<f64> = (0..rows * columns)
        .map(|i| radiances[(rows - 1 - i / columns) * columns + i % columns])
        .collect();
    let (up, down) = (map(rows, columns, &radiances), map(rows, columns, &upside_down));
    for n in normals() {
        let mirrored = DVec3::new(n.x, n.y, -n.z);
        same("mirrored", up.irradiance(n).unwrap(), down.irradiance(mirrored).unwrap());
    }
}

#[test]
fn irradiance_is_linear_in_the_map_and_no_matter_of_how_fine_it_is_drawn() {
    let (rows, columns) = (6, 10);
    let mut dice = Dice(19);
    let (a, b) = (dice.radiances(rows * columns), dice.radiances(rows * columns));
    let both: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a + 3.0 * b).collect();
    let finer: Vec<f64> = (0..4 * rows * 3 * columns)
        .map(|i| a[i / (3 * columns) / 4 * columns + i % (3 * columns) / 3])
        .collect();
    let finer = map(4 * rows, 3 * columns, &finer);
    let [a, b, both] = [a, b, both].map(|radiances| map(rows, columns, &radiances));
    for n in normals() {
        let (at_a, at_b) = (a.irradiance(n).unwrap(), b.irradiance(n).unwrap());
        let sum = Estimate {
            value: at_a.value + 3.0 * at_b.value,
            error_bound: at_a.error_bound + 3.0 * at_b.error_bound,
            evaluations: 0,
        };
        same("sum", both.irradiance(n).unwrap(), sum);
        same("finer", finer.irradiance(n).unwrap(), at_a);
    }
}

#[test]
fn one_pixel_on_the_horizon_keeps_its_digits_and_none_behind_it_shines() {
    let (rows, columns) = (512, 1024);
    let mut radiances = vec![0.0; rows * columns];
    radiances[200 * columns + 300] = 2e7;
    let sun = map(rows, columns, &radiances);
    let (theta, phi) = (PI / rows as f64, TAU / columns as f64);
    let middle = unit(200.5 * theta, 300.5 * phi);
    let (x, _) = frame(middle);
    // The pixel's centre is on the horizon, and half of the pixel above it.
    let grazing = sun.irradiance(x).unwrap();
    let edges = |at: f64, step: f64| [at * step, (at + 1.0) * step];
    let expected = by_quadrature(edges(200.0, theta), edges(300.0, phi), x).value * 2e7;
    assert!((grazing.value / expected - 1.0).abs() < 1e-7, "{grazing:?}, expected {expected:e}");
    assert!(grazing.error_bound < 1e-8 * grazing.value, "{grazing:?}");
    // Two pixels lower it has set.
    let set = sun.irradiance(x - 0.03 * middle).unwrap();
    assert_eq!((set.value.to_bits(), set.error_bound.to_bits()), (0, 0));
    let facing = sun.irradiance(middle).unwrap().value;
    let solid_angle = sun.pixel_solid_angle(200).unwrap().sr();
    assert!((facing / (2e7 * solid_angle) - 1.0).abs() < 1e-5);
}

#[test]
#[expect(clippy::float_cmp, reason = "pixels are handed back as given")]
fn a_direction_finds_its_pixel() {
    let radiances: Vec<f64> = (0..12).map(f64::from).collect();
    let map = map(3, 4, &radiances);
    let at = |direction: DVec3| map.radiance(direction).unwrap().w_per_m2_sr();
    assert_eq!(at(DVec3::Z), 0.0);
    assert_eq!(at(unit(0.1, 1.6)), 1.0);
    assert_eq!(at(unit(1.5, -0.1) * 1e-200), 7.0);
    assert_eq!(at(unit(3.0, -3.1) * 1e200), 10.0);
    assert_eq!(at(DVec3::new(1.0, -1e-300, 0.0)), 7.0);
    assert_eq!(at(-DVec3::Z), 8.0);
    assert!(map.radiance(DVec3::ZERO).is_err() && map.radiance(DVec3::NAN).is_err());
    let total: f64 = (0..3).map(|row| 4.0 * map.pixel_solid_angle(row).unwrap().sr()).sum();
    assert!((total - 4.0 * PI).abs() < 1e-14 && map.pixel_solid_angle(3).is_none());
}

#[test]
fn what_is_no_map_is_refused_with_its_place() {
    let radiances = |values: &[f64]| -> Vec<Radiance> {
        values.iter().map(|l| Radiance::from_w_per_m2_sr(*l)).collect()
    };
    let refused = |rows, columns, values: &[f64]| {
        LatLong::new(rows, columns, &radiances(values)).unwrap_err()
    };
    assert_eq!(refused(0, 4, &[]), EnvironmentError::Size { rows: 0, columns: 4 });
    assert_eq!(
        refused(usize::MAX, 2, &[]),
        EnvironmentError::Size { rows: usize::MAX, columns: 2 }
    );
    assert_eq!(refused(1, 2, &[1.0]), EnvironmentError::Count { found: 1, expected: 2 });
    let negative = DomainError::Negative { argument: "radiance", value: -1.0 };
    assert_eq!(
        refused(2, 2, &[0.0, 1.0, -1.0, f64::NAN]),
        EnvironmentError::Pixel { index: 2, error: negative }
    );
    let nan = refused(1, 2, &[0.0, f64::NAN]).to_string();
    assert_eq!(nan, "pixel 1: radiance is NaN, expected a finite number");
    let map = map(1, 1, &[f64::MAX]);
    assert!(map.irradiance(DVec3::Z).is_err(), "beyond the largest double");
    assert!(map.irradiance(DVec3::ZERO).is_err());
    assert!(map.irradiance(DVec3::new(f64::NAN, 0.0, 1.0)).is_err());
}

#[test]
fn a_map_of_luminance_gives_lux() {
    let overcast = [Luminance::from_cd_per_m2(4000.0), Luminance::from_cd_per_m2(0.0)];
    let map = LatLong::new(2, 1, &overcast).unwrap();
    assert_eq!(map.radiance(DVec3::Z).unwrap(), overcast[0]);
    assert!((map.irradiance(DVec3::Z).unwrap().value / (4000.0 * PI) - 1.0).abs() < 1e-15);
}
