//! Input that can't be fitted is refused with a sentence that says what is missing.

#[allow(dead_code)]
mod scenes;

use fit::{BasisSpec, Common, FitError, Noise, Ray, Region, Sample, Shift};
use scenes::{Die, REGION, exact, raster_rays, spread_rays};

const BASIS: BasisSpec = BasisSpec::zernike(4, 2);

fn refusal(samples: &[Sample], region: &Region, basis: BasisSpec) -> String {
    fit::fit(samples, region, basis, &[]).unwrap_err().to_string()
}

fn says(text: &str, part: &str) {
    assert!(text.contains(part), "`{text}` doesn't say `{part}`");
}

fn good() -> Vec<Sample> {
    exact(&spread_rays(300, &REGION, 1), |_| 1.0)
}

fn refused_with(change: impl Fn(&mut Sample)) -> String {
    let mut samples = good();
    change(&mut samples[17]);
    refusal(&samples, &REGION, BASIS)
}

/// Refits after moving every ray.
fn refused_rays(change: impl Fn(&mut Ray)) -> String {
    let mut rays = spread_rays(400, &REGION, 2);
    rays.iter_mut().for_each(change);
    refusal(&exact(&rays, |_| 1.0), &REGION, BASIS)
}

#[test]
fn numbers_without_sense_are_named_by_their_sample() {
    assert_eq!(refusal(&[], &REGION, BASIS), "no samples: there is nothing to fit");
    assert_eq!(refused_with(|s| s.value = f64::NAN), "sample 17: value is not finite");
    assert_eq!(refused_with(|s| s.ray.phi_rad = f64::INFINITY), "sample 17: phi is not finite");
    assert_eq!(
        refused_with(|s| s.noise = Noise::Fixed { variance: 0.0 }),
        "sample 17: variance 0e0, expected more than 0"
    );
    assert_eq!(
        refused_with(|s| s.noise = Noise::Modelled { floor: 1.0, per_radiance: -2.0 }),
        "sample 17: variance per radiance -2e0, expected 0 or more"
    );
    assert_eq!(
        refused_with(|s| s.ray.theta_rad = 1.6),
        "sample 17: theta 91.673° is outside 0° to 90°"
    );
    let off = refused_with(|s| (s.ray.x_m, s.ray.y_m) = (0.021, 0.012));
    assert_eq!(off, "sample 17: (21.000, 12.000) mm lies outside the region");
    let reversed = Region { x_m: (0.02, -0.02), ..REGION };
    says(&refusal(&good(), &reversed, BASIS), "ends must be finite and in order");
}

#[test]
fn a_readback_a_little_off_the_region_is_taken() {
    let mut samples = good();
    samples[3].ray.x_m = 0.0203;
    assert!(fit::fit(&samples, &REGION, BASIS, &[]).is_ok());
}

#[test]
fn too_few_readings_are_counted() {
    let samples = exact(&spread_rays(89, &REGION, 1), |_| 1.0);
    assert_eq!(refusal(&samples, &REGION, BASIS), "89 readings are fewer than the 90 coefficients");
    let mut samples = exact(&spread_rays(90, &REGION, 1), |_| 1.0);
    assert!(fit::fit(&samples, &REGION, BASIS, &[]).is_ok());
    for sample in &mut samples {
        sample.noise = Noise::Unknown;
    }
    says(&refusal(&samples, &REGION, BASIS), "90 readings of unknown noise");
    let vast = BasisSpec::zernike(1000, usize::MAX);
    says(&refusal(&samples, &REGION, vast), "are more than 4096");
}

#[test]
fn one_azimuth_line_is_named_with_both_its_sides() {
    let text =
        refused_rays(|ray| ray.phi_rad = if ray.phi_rad < 0.0 { -2.5 } else { 0.641_592_653_6 });
    says(&text, "all readings lie on one azimuth line (phi = 36.8°)");
    says(&text, "Z(");
}

#[test]
fn too_few_azimuths_and_polar_angles_are_counted() {
    let text = refused_rays(|ray| ray.phi_rad = (ray.phi_rad * 2.0).round() * 0.5 % 1.0);
    says(&text, "distinct azimuth lines (phi and phi + 180° count as one): degree 4 needs 5");
    let text = refused_rays(|ray| ray.theta_rad = if ray.theta_rad < 0.8 { 0.3 } else { 1.2 });
    says(&text, "only 2 distinct angles theta: degree 4 needs 3");
}

#[test]
fn scatter_about_too_few_azimuths_is_no_information() {
    // Eight meridians at 0.01° of readback scatter: degree 8 has a solution, of noise alone.
    let mut die = Die::new(6);
    let basis = BasisSpec::zernike(8, 0);
    let mut rays = raster_rays(&REGION, 12, 16, 2);
    for ray in &mut rays {
        ray.theta_rad = (ray.theta_rad + 2e-4 * die.uniform()).min(1.5);
        ray.phi_rad += 2e-4 * die.uniform();
        ray.x_m += 1e-6 * die.uniform();
    }
    let text = refusal(&exact(&rays, |_| 1.0), &REGION, basis);
    says(&text, "44 of 45 coefficients are determined");
    says(&text, "only 8 distinct azimuth lines");
    says(&text, "most involved: Z(8,-8)");
}

#[test]
fn a_term_that_vanishes_on_all_azimuths_measured_is_named() {
    let mut rays = raster_rays(&REGION, 3, 5, 4);
    for (k, ray) in rays.iter_mut().enumerate() {
        ray.phi_rad = [0.0, 0.5, 1.0, -0.5][k % 4] * std::f64::consts::PI;
    }
    let basis = BasisSpec::zernike(2, 0);
    let text = refusal(&exact(&rays, |_| 1.0), &REGION, basis);
    says(&text, "5 of 6 coefficients are determined; only 2 distinct azimuth lines");
    says(&text, "most involved: Z(2,-2)");
}

#[test]
fn too_few_positions_are_counted_by_axis() {
    let text = refused_rays(|ray| ray.x_m = if ray.x_m < 0.0 { -0.01 } else { 0.01 });
    says(&text, "only 2 distinct positions in x: degree 2 needs 3");
    assert!(!text.contains("in y"), "{text}");
    says(&text, "P2(x)");
    let text = refused_rays(|ray| ray.y_m = 0.015 + 0.5 * ray.x_m);
    says(&text, "the positions (x, y) determine 3 of 6 position terms");
}

#[test]
fn all_readings_at_one_pose_miss_everything() {
    let text = refused_rays(|ray| {
        *ray = Ray { x_m: 0.01, y_m: 0.01, theta_rad: 0.2, phi_rad: 1.0 };
    });
    says(&text, "1 of 90 coefficients are determined");
    says(&text, "only 1 distinct position in x");
    says(&text, "only 1 distinct position in y");
    says(&text, "one azimuth line");
    says(&text, "only 1 distinct angle theta");
    says(&text, "nothing was measured beyond 11.5°");
}

#[test]
fn a_narrow_cone_is_named_when_it_is_too_narrow() {
    let text = refused_rays(|ray| ray.theta_rad *= 0.002);
    says(&text, "nothing was measured beyond 0.2°");
}

#[test]
fn position_and_direction_must_vary_independently() {
    // Nine positions, one direction each, over and over.
    let text = {
        let mut rays = raster_rays(&REGION, 12, 12, 4);
        for ray in &mut rays {
            ray.theta_rad = 1.0 + 20.0 * ray.x_m;
            ray.phi_rad = 300.0 * ray.y_m;
        }
        refusal(&exact(&rays, |_| 1.0), &REGION, BasisSpec::zernike(1, 2))
    };
    says(&text, "position and direction were not varied independently");
}

#[test]
fn a_point_region_is_fitted_without_position_terms() {
    let region = Region { x_m: (0.01, 0.01), y_m: (0.0, 0.0), ..REGION };
    let mut rays = spread_rays(100, &REGION, 3);
    for ray in &mut rays {
        (ray.x_m, ray.y_m) = (0.010_02, 0.0);
    }
    let samples = exact(&rays, |_| 2.0);
    let basis = BasisSpec::zernike(4, 0);
    let field = fit::fit(&samples, &region, basis, &[]).unwrap();
    assert!((field.exitance().value - 2.0 * std::f64::consts::PI).abs() < 1e-12);
    says(&refusal(&samples, &region, BASIS), "only 1 distinct position in x");
}

#[test]
fn a_common_component_without_sense_is_named() {
    let refused = |u, shift| {
        let common = Common { name: "arm zero".into(), u, shift };
        fit::fit(&good(), &REGION, BASIS, &[common]).unwrap_err()
    };
    let expected = FitError::Common { name: "arm zero".into() };
    assert_eq!(refused(f64::NAN, Shift::Scale), expected);
    assert_eq!(refused(-1.0, Shift::Offset), expected);
    assert_eq!(refused(1.0, Shift::Value(Box::new(|_, _| f64::NAN))), expected);
}

#[test]
fn numbers_beyond_the_range_of_doubles_are_refused() {
    let samples = exact(&spread_rays(300, &REGION, 4), |_| 1e300);
    assert_eq!(fit::fit(&samples, &REGION, BASIS, &[]).unwrap_err(), FitError::OutOfRange);
}

#[test]
fn a_dark_field_of_zeros_is_a_fit_like_any_other() {
    let mut samples = exact(&spread_rays(300, &REGION, 5), |_| 0.0);
    for sample in &mut samples {
        sample.noise = Noise::Unknown;
    }
    let field = fit::fit(&samples, &REGION, BASIS, &[]).unwrap();
    assert!(field.exitance().value.abs() < 1e-12);
    assert_eq!(field.measured_fraction(), None);
}

#[test]
fn one_pose_tells_no_field_unless_it_is_said_to_be_constant() {
    let ray = Ray { x_m: 0.0, y_m: 0.015, theta_rad: 0.2, phi_rad: 1.0 };
    let mut die = Die::new(3);
    let noise = Noise::Fixed { variance: 0.01 };
    let samples: Vec<Sample> =
        (0..40).map(|_| Sample { ray, value: 5.0 + 0.1 * die.normal(), noise }).collect();
    let chosen =
        |wish: fit::Wish| fit::fit_wished(&fit::Readings::of(&samples), &REGION, &wish, None);
    let refused = chosen(fit::Wish::default()).unwrap_err().to_string();
    says(&refused, "all 40 readings are of one pose (theta 11.459°, phi 57.296°)");
    let constant =
        fit::Wish { angular_degree: Some(0), position_degree: Some(0), ..fit::Wish::default() };
    let fit = chosen(constant).unwrap().fit;
    assert!((fit.value(&ray) - 5.0).abs() < 0.1);
}

#[test]
fn splines_that_only_a_file_asks_for_are_counted_before_they_are_made() {
    let of = |theta_spans, phi_spans, fine| fit::BasisSpec {
        angular: fit::Angular::Splines { theta_spans, phi_spans, fine },
        position: fit::Position::Legendre { degree: 0 },
    };
    let begun = std::time::Instant::now();
    for halvings in [0, 8, 40] {
        let fine = fit::Fine { from: 0, to: usize::MAX, halvings, ..fit::Fine::NONE };
        let text = refusal(&good(), &REGION, of(32_768, 32_768, fine));
        says(&text, "coefficients");
    }
    assert!(begun.elapsed().as_secs() < 5);
    // Nor are few ones miscounted.
    let fine = fit::Fine { from: 2, to: 4, halvings: 3, ..fit::Fine::NONE };
    assert_eq!(of(8, 16, fine).len(), 342);
    // Spans of θ as they are, and of φ halved twice in two of five bands, which have 16 round them.
    let around = fit::Around { from: 14, to: 18, halvings: 2 };
    let patch = fit::Fine { from: 6, to: 8, around, ..fit::Fine::NONE };
    let more = of(8, 16, patch).len() - of(8, 16, fit::Fine::NONE).len();
    assert_eq!(more, 3 * 4 * 3);
    let around = fit::Around { halvings: 40, ..around };
    says(&refusal(&good(), &REGION, of(8, 16, fit::Fine { around, ..patch })), "coefficients");
}

#[test]
fn a_cone_beyond_the_horizon_is_refused_by_every_basis() {
    let splines = fit::Angular::Splines { theta_spans: 2, phi_spans: 6, fine: fit::Fine::NONE };
    let all = [
        fit::Angular::Zernike { degree: 2, cosine_columns: 0 },
        fit::Angular::Zernike { degree: 2, cosine_columns: 1 },
        fit::Angular::Hemispherical { degree: 2 },
        fit::Angular::EvenHarmonics { degree: 2 },
        splines,
    ];
    let samples = scenes::exact(&scenes::raster_rays(&REGION, 8, 12, 1), |_| 1.0);
    for angular in all {
        let basis = fit::BasisSpec { angular, position: fit::Position::Legendre { degree: 0 } };
        let fit = fit::fit(&samples, &REGION, basis, &[]).unwrap();
        for wrong in [f64::NAN, -0.1, 1.6, f64::INFINITY] {
            assert!(fit.exitance_within(wrong).is_err(), "{angular:?} {wrong}");
        }
        assert!(fit.exitance_within(0.0).unwrap().value.abs() < 1e-12, "{angular:?}");
    }
}
