//! What must hold of the kernels whatever the numbers: orthonormality, reciprocity, scale, symmetry,
//! and that no meaningful input yields NaN.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use radiometry::basis::{Legendre, Zernike, zernike};
use radiometry::quadrature::{Sum, cone, gauss_legendre};
use radiometry::throughput::{CoaxialDisks, coaxial_disks};
use radiometry::{direction, solid_angle};

/// Gram matrices by a rule that is exact for the products: what is left is rounding of about
/// `len` terms of order one.
const ORTHONORMAL: f64 = 2e-14;

#[test]
fn zernike_polynomials_are_orthonormal_under_projected_solid_angle() {
    let zernike = Zernike::new(20);
    let count = zernike.len();
    let mut gram = vec![Sum::default(); count * count];
    let mut values = vec![0.0; count];
    for node in cone(FRAC_PI_2, 11, 42).unwrap() {
        zernike.evaluate(node.theta_rad, node.phi_rad, &mut values);
        for (i, a) in values.iter().enumerate() {
            for (j, b) in values.iter().enumerate() {
                gram[i * count + j].add(node.weight_sr * a * b);
            }
        }
    }
    for i in 0..count {
        for j in 0..count {
            let expected = f64::from(u8::from(i == j));
            let got = gram[i * count + j].value();
            assert!((got - expected).abs() < ORTHONORMAL, "<Z_{i}, Z_{j}> = {got}");
        }
    }
}

#[test]
fn zernike_members_are_the_radial_polynomials_in_ansi_order() {
    let zernike = Zernike::new(60);
    let mut values = vec![0.0; zernike.len()];
    for (theta, phi) in [(0.0, 0.4), (1e-6, -2.0), (0.8, 1.0), (1.57, 3.0), (FRAC_PI_2, -0.3)] {
        zernike.evaluate(theta, phi, &mut values);
        for (j, value) in values.iter().enumerate() {
            let (n, m) = zernike::ansi_order(j);
            let order = usize::try_from(m.unsigned_abs()).unwrap();
            assert_eq!(i64::try_from(n * (n + 2)).unwrap() + m, 2 * i64::try_from(j).unwrap());
            let radial = zernike::radial(n, order, theta.sin()).unwrap();
            let angle = order as f64 * phi;
            let azimuthal = if m < 0 { angle.sin() } else { angle.cos() };
            let both_signs = if m == 0 { 1.0 } else { 2.0 };
            let norm = (both_signs * (n as f64 + 1.0) / PI).sqrt();
            let expected = norm * radial * azimuthal;
            // 2e-14 of the largest value, as the basis promises.
            assert!((value - expected).abs() < 2e-14 * norm, "Z_{n}^{m}({theta}, {phi}): {value}");
        }
    }
}

#[test]
fn zernike_integrals_over_a_cone_agree_with_quadrature() {
    let zernike = Zernike::new(12);
    let mut exact = vec![0.0; zernike.len()];
    let mut values = vec![0.0; zernike.len()];
    for theta_max in [0.0, 0.2, 1.0, 1.4, FRAC_PI_2] {
        zernike.integrals_within(theta_max, &mut exact).unwrap();
        let mut sums = vec![Sum::default(); zernike.len()];
        for node in cone(theta_max, 8, 16).unwrap() {
            zernike.evaluate(node.theta_rad, node.phi_rad, &mut values);
            for (sum, value) in sums.iter_mut().zip(&values) {
                sum.add(node.weight_sr * value);
            }
        }
        for (sum, exact) in sums.iter().zip(&exact) {
            assert!((sum.value() - exact).abs() < 1e-14, "θmax {theta_max}: {exact}");
        }
    }
    zernike.integrals_within(FRAC_PI_2, &mut exact).unwrap();
    assert!((exact[0] - PI.sqrt()).abs() < 1e-15);
    assert!(exact[1..].iter().all(|integral| integral.abs() < 1e-15), "{exact:?}");
}

#[test]
fn legendre_squares_have_mean_one() {
    let legendre = Legendre::new(30);
    let mut gram = vec![vec![Sum::default(); legendre.len()]; legendre.len()];
    let mut values = vec![0.0; legendre.len()];
    for (t, weight) in gauss_legendre(31) {
        legendre.evaluate(t, &mut values);
        for (row, a) in gram.iter_mut().zip(&values) {
            for (sum, b) in row.iter_mut().zip(&values) {
                sum.add(weight / 2.0 * a * b);
            }
        }
    }
    for (i, row) in gram.iter().enumerate() {
        for (j, sum) in row.iter().enumerate() {
            let expected = f64::from(u8::from(i == j));
            assert!((sum.value() - expected).abs() < ORTHONORMAL, "mean of P_{i} P_{j}");
        }
    }
}

#[test]
fn gauss_legendre_integrates_powers_and_its_weights_sum_to_two() {
    for n in [1, 2, 3, 7, 20, 64, 200] {
        let rule = gauss_legendre(n);
        assert!(rule.is_sorted_by(|a, b| a.0 < b.0), "{n} nodes rise");
        for power in [0, 1, (2 * n - 1).min(60), (2 * n - 2).min(60)] {
            let exponent = i32::try_from(power).unwrap();
            let sum: Sum = rule.iter().map(|(node, weight)| weight * node.powi(exponent)).collect();
            let exact = if power % 2 == 0 { 2.0 / (power as f64 + 1.0) } else { 0.0 };
            assert!((sum.value() - exact).abs() < 5e-16, "n {n}, power {power}: {}", sum.value());
        }
    }
    assert!(gauss_legendre(0).is_empty());
}

#[test]
fn gauss_legendre_nodes_match_the_tables() {
    // Abramowitz and Stegun, table 25.4, n = 5 and n = 20 (the outermost).
    let five = gauss_legendre(5);
    assert!((five[4].0 - 0.906_179_845_938_664).abs() < 1e-15);
    assert!((five[4].1 - 0.236_926_885_056_189).abs() < 1e-15);
    assert!((five[2].1 - 0.568_888_888_888_889).abs() < 1e-15);
    let twenty = gauss_legendre(20);
    assert!((twenty[19].0 - 0.993_128_599_185_095).abs() < 1e-15);
    assert!((twenty[19].1 - 0.017_614_007_139_152).abs() < 1e-15);
}

#[test]
fn touching_and_far_disks_have_the_limits_of_the_closed_form() {
    // In contact all light from the smaller meets the larger: T = π A.
    let contact = coaxial_disks(0.5, 1.0, 1e-12).unwrap().m2_sr();
    assert!((contact / (PI * PI * 0.25) - 1.0).abs() < 1e-11);
    // Far apart: A₁ A₂ / h².
    let far = coaxial_disks(1e-3, 2e-3, 1e3).unwrap().m2_sr();
    assert!((far / (PI * PI * 4e-12 / 1e6) - 1.0).abs() < 1e-11);
}

#[test]
fn lengths_without_meaning_are_refused() {
    for bad in [-1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(coaxial_disks(bad, 1.0, 1.0).is_err());
        assert!(coaxial_disks(1.0, bad, 1.0).is_err());
        assert!(coaxial_disks(1.0, 1.0, bad).is_err());
    }
    for no_gap in [0.0, -0.0] {
        assert!(coaxial_disks(1.0, 1.0, no_gap).is_err());
    }
    let error = coaxial_disks(1.0, -2.0, 1.0).unwrap_err();
    assert_eq!(error.to_string(), "radius_2_m is -2, expected 0 or more");
    assert!(coaxial_disks(1e200, 1e200, 1e200).is_err(), "beyond the largest double");
}

/// Lengths over twenty-four decades.
fn length() -> impl Strategy<Value = f64> {
    (-12.0..12.0f64).prop_map(|exponent| 10f64.powf(exponent))
}

fn vector() -> impl Strategy<Value = DVec3> {
    (-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

fn relative(a: f64, b: f64) -> f64 {
    (a - b).abs() / b.abs()
}

/// The same cases every time; `PROPTEST_RNG_SEED` and `PROPTEST_CASES` ask for others.
fn seeded() -> ProptestConfig {
    let config = ProptestConfig::default();
    let rng_seed = match config.rng_seed {
        RngSeed::Random => RngSeed::Fixed(222),
        given @ RngSeed::Fixed(_) => given,
    };
    ProptestConfig { failure_persistence: None, rng_seed, ..config }
}

proptest! {
    #![proptest_config(seeded())]

    #[test]
    fn throughput_is_the_same_from_either_end(a in length(), b in length(), h in length()) {
        let there = coaxial_disks(a, b, h).unwrap();
        let back = coaxial_disks(b, a, h).unwrap();
        prop_assert_eq!(there, back);
    }

    #[test]
    fn throughput_scales_with_area(a in length(), b in length(), h in length(), s in length()) {
        let one = coaxial_disks(a, b, h).unwrap().m2_sr();
        let scaled = coaxial_disks(a * s, b * s, h * s).unwrap().m2_sr();
        prop_assert!(relative(scaled, one * s * s) < 4e-15, "{scaled:e} {one:e}");
    }

    #[test]
    fn form_factor_is_in_range_and_gives_the_throughput(
        a in length(), b in length(), h in length()
    ) {
        let disks = CoaxialDisks::new(a, b, h).unwrap();
        let factor = disks.form_factor().ratio();
        prop_assert!((0.0..=1.0).contains(&factor));
        let throughput = PI * (PI * a * a) * factor;
        prop_assert!(relative(throughput, disks.throughput().unwrap().m2_sr()) < 4e-15);
    }

    #[test]
    fn partials_obey_euler_and_their_signs(a in length(), b in length(), h in length()) {
        // T is homogeneous of degree 2 in the lengths: Σ x ∂T/∂x = 2T.
        let disks = CoaxialDisks::new(a, b, h).unwrap();
        let partials = disks.partials().unwrap();
        let (along_1, along_2) = (a * partials.per_radius_1, b * partials.per_radius_2);
        let along_h = h * partials.per_distance;
        prop_assert!(along_1 >= 0.0 && along_2 >= 0.0 && along_h <= 0.0);
        let size = along_1 + along_2 - along_h;
        let throughput = disks.throughput().unwrap().m2_sr();
        prop_assert!((along_1 + along_2 + along_h - 2.0 * throughput).abs() < 1e-14 * size);
    }

    #[test]
    fn partials_are_the_slopes_of_the_throughput(
        a in 0.1..10.0f64, b in 0.1..10.0f64, h in 0.1..10.0f64
    ) {
        let value = |a: f64, b: f64, h: f64| coaxial_disks(a, b, h).unwrap().m2_sr();
        let partials = CoaxialDisks::new(a, b, h).unwrap().partials().unwrap();
        // Central differences: truncation 1e-10, rounding 1e-11 of T.
        let step = 1e-5;
        let tolerance = 1e-7 * value(a, b, h) + 1e-8;
        let slope_1 = (value(a + step, b, h) - value(a - step, b, h)) / (2.0 * step);
        let slope_2 = (value(a, b + step, h) - value(a, b - step, h)) / (2.0 * step);
        let slope_h = (value(a, b, h + step) - value(a, b, h - step)) / (2.0 * step);
        prop_assert!((slope_1 - partials.per_radius_1).abs() < tolerance);
        prop_assert!((slope_2 - partials.per_radius_2).abs() < tolerance);
        prop_assert!((slope_h - partials.per_distance).abs() < tolerance);
    }

    #[test]
    fn no_pair_of_doubles_makes_nan(a in any::<f64>(), b in any::<f64>(), h in any::<f64>()) {
        if let Ok(disks) = CoaxialDisks::new(a, b, h) {
            prop_assert!(disks.form_factor().ratio().is_finite());
            prop_assert!(disks.throughput().is_ok_and(|t| t.m2_sr() >= 0.0) || a.max(b).max(h) > 1e100);
            if let Ok(partials) = disks.partials() {
                prop_assert!(partials.per_radius_1.is_finite() && partials.per_distance.is_finite());
            }
        }
        if let Ok(solid_angle) = solid_angle::disk(a, h) {
            prop_assert!((0.0..=2.0 * PI).contains(&solid_angle.sr()));
        }
        if let Ok(solid_angle) = solid_angle::cone(a) {
            prop_assert!((0.0..=4.0 * PI).contains(&solid_angle.sr()));
        }
    }

    #[test]
    fn angles_and_unit_are_inverse(theta in 1e-9..PI, phi in -PI..PI) {
        let (theta_back, phi_back) = direction::angles(direction::unit(theta, phi));
        prop_assert!((theta - theta_back).abs() < 1e-15 * PI);
        // Near the pole φ has no more digits than the vector's own rounding leaves it: all of them.
        prop_assert!(direction::shortest_rotation(phi, phi_back).abs() < 2e-15 / theta.sin().max(0.1));
    }

    #[test]
    fn directions_of_finite_vectors_are_in_range(
        x in any::<f64>(), y in any::<f64>(), z in any::<f64>()
    ) {
        let vector = DVec3::new(x, y, z);
        prop_assume!(vector.is_finite());
        let (theta, phi) = direction::angles(vector);
        prop_assert!((0.0..=PI).contains(&theta) && (-PI..=PI).contains(&phi));
        prop_assert!((0.0..=PI).contains(&direction::angle_between(vector, DVec3::Z)));
        if let Some(unit) = direction::normalised(vector) {
            prop_assert!((unit.length() - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn the_angle_between_is_symmetric_and_blind_to_length(
        a in vector(), b in vector(), s in length()
    ) {
        prop_assume!(a.length() > 1e-3 && b.length() > 1e-3);
        let angle = direction::angle_between(a, b);
        prop_assert!((direction::angle_between(b, a) - angle).abs() < 1e-15);
        prop_assert!((direction::angle_between(a * s, b) - angle).abs() < 2e-15);
        let (theta_a, phi_a) = direction::angles(a);
        let (theta_b, phi_b) = direction::angles(b);
        let from_angles = direction::angular_distance(theta_a, phi_a, theta_b, phi_b);
        prop_assert!((from_angles - angle).abs() < 4e-15, "{from_angles} {angle}");
    }

    #[test]
    fn the_midpoint_is_as_far_from_both_ends(a in vector(), b in vector()) {
        prop_assume!(a.length() > 1e-3 && b.length() > 1e-3);
        let angle = direction::angle_between(a, b);
        prop_assume!(angle < 3.0);
        let middle = direction::midpoint(a, b).unwrap();
        prop_assert!((direction::angle_between(a, middle) - angle / 2.0).abs() < 1e-14);
        prop_assert!((direction::angle_between(b, middle) - angle / 2.0).abs() < 1e-14);
    }

    #[test]
    fn wrapped_angles_differ_by_whole_turns(angle in -1e6..1e6f64) {
        let wrapped = direction::wrap(angle);
        prop_assert!((-PI..=PI).contains(&wrapped));
        prop_assert!((wrapped.sin() - angle.sin()).abs() < 1e-15 * 4.0);
        let degrees = direction::wrap_deg(angle);
        prop_assert!(-180.0 < degrees && degrees <= 180.0);
        prop_assert!(((angle - degrees) / 360.0).fract() == 0.0 || angle.abs() > 1e5);
    }
}

#[test]
fn opposite_directions_have_no_midpoint() {
    assert_eq!(direction::midpoint(DVec3::X, -DVec3::X), None);
    assert_eq!(direction::midpoint(DVec3::X, DVec3::ZERO), None);
    assert_eq!(direction::mean([]), None);
    let across_the_seam =
        direction::midpoint(direction::unit(1.0, 3.0), direction::unit(1.0, -3.0)).unwrap();
    assert!((direction::angles(across_the_seam).1.abs() - PI).abs() < 1e-15);
}

#[test]
fn half_a_turn_is_plus_180_degrees() {
    for angle in [180.0, -180.0, 540.0, -900.0] {
        assert!((direction::wrap_deg(angle) - 180.0).abs() < f64::EPSILON);
    }
}

#[test]
fn a_polygon_whose_fan_cancels_keeps_its_digits_from_every_vertex() {
    use radiometry::shape::Polygon;
    // A dart: from a vertex beside the notch two triangles of 1 sr cancel but for the dart.
    for notch in [1e-2, 1e-6, 1e-10, 1e-14] {
        let dart = [(0.0, 1.0), (1.0, -1.0), (0.0, 1.0 - notch), (-1.0, -1.0)];
        let point = DVec3::new(0.1, -0.2, -1.0);
        let seen = |first: usize| {
            let from = (0..4).map(|k| dart[(first + k) % 4]).map(|(x, y)| DVec3::new(x, y, 0.5));
            solid_angle::polygon(point, &Polygon::new(from.collect()).unwrap()).unwrap().sr()
        };
        // From the tip the diagonal lies within: two triangles of one sign.
        let expected = seen(0);
        assert!(expected > 0.1 * notch, "{notch:e}: {expected:e}");
        for first in 1..4 {
            let found = seen(first);
            assert!((found / expected - 1.0).abs() < 1e-13, "{notch:e}: {found:e}, {expected:e}");
        }
    }
}
