//! Fields in the span of the basis come back exactly, and derived quantities have their closed
//! forms.

#[allow(dead_code)]
mod scenes;

use fit::{BasisSpec, Common, Noise, Parts, Ray, Sample, Shift};
use scenes::{Die, REGION, exact, raster_rays, scaled, spread_rays};
use std::f64::consts::{FRAC_PI_2, PI};

const BASIS: BasisSpec = BasisSpec::zernike(4, 2);

/// A polynomial in sin θ cos φ, sin θ sin φ, x and y of the degrees of `BASIS`. Its mean over the
/// region is 3 + u² + u⁴ - v/2 + (0.4 + 0.2/3)(1 - u² - v²), since <x²> = 1/3 and <x> = <xy> = 0.
fn polynomial(ray: &Ray) -> f64 {
    let (u, v) = (
        libm::sin(ray.theta_rad) * libm::cos(ray.phi_rad),
        libm::sin(ray.theta_rad) * libm::sin(ray.phi_rad),
    );
    let (x, y) = scaled(ray);
    3.0 + u.powi(2) + u.powi(4) - 0.5 * v
        + (0.4 + 0.2 * x * x + 0.3 * x * y - 0.1 * y) * (1.0 - u * u - v * v)
        + 0.7 * x * u * v.powi(3)
}

#[test]
fn a_field_in_the_span_comes_back_exactly() {
    let samples = exact(&spread_rays(400, &REGION, 1), polynomial);
    let field = fit::fit(&samples, &REGION, BASIS, &[]).unwrap();
    for ray in spread_rays(200, &REGION, 2) {
        let found = field.radiance(&ray).value;
        assert!((found - polynomial(&ray)).abs() < 1e-12, "{found} at {ray:?}");
        assert!((found - field.value(&ray)).abs() < 1e-13);
    }
    assert!(field.residual_rms() < 1e-13);
    assert_eq!((field.n_used(), field.dof()), (400, 400 - 15 * 6));
    assert!(field.excess_rms() == 0.0);
}

#[test]
fn the_exitance_of_a_polynomial_is_its_integral_over_the_disk() {
    // ∫ over the unit disk: 1 -> π, u² -> π/4, u⁴ -> π/8, v -> 0, 1 - r² -> π/2.
    let samples = exact(&spread_rays(400, &REGION, 3), polynomial);
    let field = fit::fit(&samples, &REGION, BASIS, &[]).unwrap();
    let exitance = PI * (3.0 + 0.25 + 0.125 + (0.4 + 0.2 / 3.0) * 0.5);
    assert!((field.exitance().value - exitance).abs() < 1e-11);
    assert!((field.flux().value - exitance * 0.04 * 0.02).abs() < 1e-14);
    // Within a cone, s = sin θ: s² π, s⁴ π/4, s⁶ π/8, s² π - s⁴ π/2.
    let s2 = libm::sin(0.7).powi(2);
    let within = PI
        * (3.0 * s2
            + s2.powi(2) / 4.0
            + s2.powi(3) / 8.0
            + (0.4 + 0.2 / 3.0) * (s2 - s2.powi(2) / 2.0));
    assert!((field.exitance_within(0.7).unwrap().value - within).abs() < 1e-11);
    let whole = field.exitance_within(FRAC_PI_2).unwrap().value;
    assert!((whole - field.exitance().value).abs() < 1e-12);
    let cone = field.exitance_within(REGION.theta_max_rad).unwrap().value;
    assert!((field.exitance_within_region().value - cone).abs() < 1e-13);
    assert!(field.exitance_within(2.0).is_err());
    assert!((field.measured_fraction().unwrap() - cone / whole).abs() < 1e-15);
}

#[test]
fn a_lambertian_source_has_pi_times_its_radiance_as_exitance() {
    let samples = exact(&raster_rays(&REGION, 9, 12, 3), |_| 250.0);
    let field = fit::fit(&samples, &REGION, BASIS, &[]).unwrap();
    assert!((field.exitance().value - 250.0 * PI).abs() < 1e-10);
    let share = libm::sin(REGION.theta_max_rad).powi(2);
    assert!((field.measured_fraction().unwrap() - share).abs() < 1e-12);
    let intensity = field.intensity(1.0, 2.0).value;
    assert!((intensity - 250.0 * REGION.area_m2() * libm::cos(1.0)).abs() < 1e-12);
}

#[test]
fn the_exitance_of_a_cosine_power_is_two_pi_over_n_plus_two() {
    // Even powers are polynomials on the disk; odd ones converge with the degree.
    for (power, degree, tolerance) in [(2, 2, 1e-13), (4, 4, 1e-13), (8, 8, 1e-12), (3, 12, 1e-4)] {
        let basis = BasisSpec::zernike(degree, 0);
        let samples =
            exact(&raster_rays(&REGION, 21, 36, 1), |ray| libm::cos(ray.theta_rad).powi(power));
        let field = fit::fit(&samples, &REGION, basis, &[]).unwrap();
        let exitance = 2.0 * PI / f64::from(power + 2);
        let error = (field.exitance().value - exitance).abs();
        assert!(error < tolerance, "cos^{power}: off by {error:e}");
    }
}

#[test]
fn the_order_of_the_samples_does_not_matter() {
    let mut die = Die::new(5);
    let noise = Noise::Modelled { floor: 1e-4, per_radiance: 1e-3 };
    let mut samples: Vec<Sample> = exact(&spread_rays(900, &REGION, 4), polynomial);
    for sample in &mut samples {
        sample.noise = noise;
        sample.value += 0.05 * die.normal();
    }
    let one_way = fit::fit(&samples, &REGION, BASIS, &[]).unwrap();
    samples.reverse();
    samples.rotate_left(333);
    let other_way = fit::fit(&samples, &REGION, BASIS, &[]).unwrap();
    for (a, b) in one_way.coefficients().iter().zip(other_way.coefficients()) {
        assert!((a - b).abs() < 1e-12);
    }
    assert!((one_way.exitance().u / other_way.exitance().u - 1.0).abs() < 1e-10);
}

#[test]
fn duplicated_samples_halve_the_variance_and_nothing_else() {
    let samples = exact(&spread_rays(300, &REGION, 6), polynomial);
    let doubled: Vec<Sample> = samples.iter().chain(&samples).copied().collect();
    let once = fit::fit(&samples, &REGION, BASIS, &[]).unwrap();
    let twice = fit::fit(&doubled, &REGION, BASIS, &[]).unwrap();
    assert!((once.exitance().value - twice.exitance().value).abs() < 1e-11);
    assert!((once.exitance().u / twice.exitance().u - 2f64.sqrt()).abs() < 1e-10);
}

#[test]
fn well_spread_samples_have_a_condition_of_one_digit() {
    let basis = BasisSpec::zernike(8, 2);
    let samples = exact(&spread_rays(2000, &REGION, 7), polynomial);
    let condition = fit::fit(&samples, &REGION, basis, &[]).unwrap().condition();
    assert!(condition < 10.0, "condition {condition}");
}

#[test]
fn a_raster_conditions_degree_eight_as_well() {
    let basis = BasisSpec::zernike(8, 2);
    let samples = exact(&raster_rays(&REGION, 17, 24, 3), polynomial);
    let condition = fit::fit(&samples, &REGION, basis, &[]).unwrap().condition();
    assert!(condition < 30.0, "condition {condition}");
}

#[test]
fn the_peak_is_found_inside_on_the_rim_and_at_a_corner() {
    // A paraboloid about (u, v) = (0.3, -0.2), rising towards +x and -y.
    let hill = |ray: &Ray| {
        let (s, c) = libm::sincos(ray.phi_rad);
        let (u, v) = (libm::sin(ray.theta_rad) * c, libm::sin(ray.theta_rad) * s);
        let (x, y) = scaled(ray);
        5.0 - (u - 0.3).powi(2) - 2.0 * (v + 0.2).powi(2) + 0.1 * x - 0.2 * y
    };
    let samples = exact(&spread_rays(600, &REGION, 8), hill);
    let peak = fit::fit(&samples, &REGION, BASIS, &[]).unwrap().peak();
    assert!((peak.radiance.value - 5.3).abs() < 1e-10, "{peak:?}");
    assert!((peak.ray.theta_rad - libm::asin(libm::hypot(0.3, 0.2))).abs() < 1e-5);
    assert!((peak.ray.phi_rad - libm::atan2(-0.2, 0.3)).abs() < 1e-5);
    assert!((peak.ray.x_m - 0.02).abs() < 1e-9 && (peak.ray.y_m - 0.005).abs() < 1e-9);
    assert!(peak.radiance.u > 0.0);
    // Towards a rim in the azimuth of 100°.
    let slope =
        |ray: &Ray| 1.0 + libm::sin(ray.theta_rad) * libm::cos(ray.phi_rad - 100f64.to_radians());
    let samples = exact(&spread_rays(600, &REGION, 9), slope);
    let peak = fit::fit(&samples, &REGION, BASIS, &[]).unwrap().peak();
    assert!((peak.ray.theta_rad - REGION.theta_max_rad).abs() < 1e-6, "{peak:?}");
    assert!((peak.ray.phi_rad.to_degrees() - 100.0).abs() < 1e-3, "{peak:?}");
}

#[test]
fn the_peak_of_a_constant_is_at_the_normal() {
    let samples = exact(&spread_rays(600, &REGION, 10), |_| 7.0);
    let peak = fit::fit(&samples, &REGION, BASIS, &[]).unwrap().peak();
    assert!((peak.radiance.value - 7.0).abs() < 1e-11);
    assert!(peak.ray.theta_rad < 0.2, "{peak:?}");
}

#[test]
fn stored_parts_give_the_same_answers() {
    let samples = exact(&spread_rays(300, &REGION, 11), polynomial);
    let scale = Common { name: "scale".into(), u: 0.01, shift: Shift::Scale };
    let field = fit::fit(&samples, &REGION, BASIS, &[scale]).unwrap();
    let again = fit::Fit::from_parts(field.parts().clone()).unwrap();
    let ray = spread_rays(1, &REGION, 12)[0];
    assert_eq!(field.radiance(&ray), again.radiance(&ray));
    assert_eq!(field.contributions(), again.contributions());
    let short = Parts { coefficients: vec![1.0; 3], ..field.parts().clone() };
    let refusal = fit::Fit::from_parts(short).unwrap_err().to_string();
    assert_eq!(refusal, "stored fit: coefficients: expected 90 finite numbers, found 3");
}

#[test]
fn the_covariance_matrix_says_what_the_estimates_say() {
    let samples = exact(&spread_rays(300, &REGION, 13), polynomial);
    let basis = BasisSpec::zernike(2, 1);
    let common = || {
        vec![
            Common { name: "scale".into(), u: 0.01, shift: Shift::Scale },
            Common { name: "dark".into(), u: 0.02, shift: Shift::Offset },
        ]
    };
    let field = fit::fit(&samples, &REGION, basis, &common()).unwrap();
    let covariance = field.covariance();
    let u = (covariance[0][0] * PI).sqrt();
    assert!((u / field.exitance().u - 1.0).abs() < 1e-12);
    for (i, row) in covariance.iter().enumerate() {
        for (j, value) in row.iter().enumerate() {
            assert!((value - covariance[j][i]).abs() < 1e-18);
        }
    }
    let squares: f64 = field.contributions().iter().map(|c| c.u * c.u).sum();
    assert!((squares.sqrt() / field.exitance().u - 1.0).abs() < 1e-12);
}

#[test]
fn functions_are_named_by_their_degrees() {
    let samples = exact(&spread_rays(300, &REGION, 14), polynomial);
    let basis = BasisSpec::zernike(1, 2);
    let names = fit::fit(&samples, &REGION, basis, &[]).unwrap().names();
    assert_eq!(names[..4], ["Z(0,0)", "Z(1,-1)", "Z(1,1)", "Z(0,0) P1(x)"]);
    assert_eq!(names[13], "Z(1,-1) P1(x) P1(y)");
    assert_eq!(names.len(), 18);
}
