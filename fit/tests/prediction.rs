//! A prediction against the fit that follows it: the same covariance, budget and truncation.

use fit::{BasisSpec, Common, FitError, Noise, Optics, Outline, Ray, Region, Sample, Shift};
use radiometry::beam::Beam;

const REGION: Region = Region::surface((-0.01, 0.01), (-0.01, 0.01), 1.3);

fn rays() -> Vec<Ray> {
    let mut rays = Vec::new();
    for (x_m, y_m) in [(-0.01, -0.01), (0.01, -0.01), (-0.01, 0.01), (0.01, 0.01)] {
        for i in 0..60_u32 {
            let theta_rad = 1.3 * (f64::from(i) / 59.0).sqrt();
            rays.push(Ray { x_m, y_m, theta_rad, phi_rad: f64::from(i) * 2.399_963 });
        }
    }
    rays
}

/// In the basis: of degree 2 in direction and 1 in position.
fn field(ray: &Ray) -> f64 {
    let r = ray.theta_rad.sin();
    50.0 + 200.0 * ray.x_m + 20.0 * r * ray.phi_rad.cos() - 10.0 * r * r
}

fn samples(value: impl Fn(&Ray) -> f64) -> Vec<Sample> {
    let noise = Noise::Modelled { floor: 1e-4, per_radiance: 1e-3 };
    rays().into_iter().map(|ray| Sample { ray, value: value(&ray), noise }).collect()
}

fn common() -> [Common; 3] {
    let turned = |_, ray: &Ray| Ray { phi_rad: ray.phi_rad + 0.01, ..*ray };
    [
        Common { name: "scale".into(), u: 0.01, shift: Shift::Scale },
        Common { name: "dark".into(), u: 0.02, shift: Shift::Offset },
        Common { name: "phi zero".into(), u: 0.01, shift: Shift::Ray(Box::new(turned)) },
    ]
}

fn close(a: f64, b: f64, relative: f64) {
    assert!((a - b).abs() <= relative * b.abs(), "{a} and {b}");
}

#[test]
fn what_is_expected_exactly_has_the_covariance_of_its_fit() {
    let basis = BasisSpec::zernike(2, 1);
    let beam = Beam::of_spot(0.00625, 0.0025, 0.3).unwrap();
    let optics = Optics { beam, outline: None };
    let fitted = fit::fit_seen(&samples(field), &REGION, basis, &common(), Some(&optics)).unwrap();
    let predicted =
        fit::predict(&samples(field), &[], &REGION, basis, &common(), Some(&optics), &[])
            .unwrap()
            .fit;
    // The beam blurs the field a little, and the weights settle to a percent.
    close(predicted.exitance().value, fitted.exitance().value, 1e-3);
    for ((a, b), name) in
        predicted.contributions().iter().zip(fitted.contributions()).zip(fitted.names())
    {
        assert!((a.u - b.u).abs() <= 0.01 * b.u.max(1e-9), "{name}: {a:?} {b:?}");
    }
    let ray = Ray { x_m: 0.003, y_m: -0.004, theta_rad: 1.25, phi_rad: 0.7 };
    close(predicted.radiance(&ray).u, fitted.radiance(&ray).u, 0.01);
}

#[test]
fn a_field_beyond_the_basis_is_fitted_as_readings_of_it_would_be() {
    let lobe = |ray: &Ray| 30.0 * (-8.0 * (ray.theta_rad - 0.6).powi(2)).exp();
    let basis = BasisSpec::zernike(4, 0);
    let values: Vec<f64> = rays().iter().map(lobe).collect();
    let predicted =
        fit::predict(&samples(|_| 50.0), &[], &REGION, basis, &[], None, &[values]).unwrap();
    // Equal weights, as an even expectation has.
    let noise = Noise::Fixed { variance: 1.0 };
    let readings: Vec<Sample> =
        rays().into_iter().map(|ray| Sample { ray, value: lobe(&ray), noise }).collect();
    let fitted = fit::fit(&readings, &REGION, basis, &[]).unwrap();
    let found = &predicted.fields[0];
    close(found.fit.exitance().value, fitted.exitance().value, 1e-9);
    close(found.residual_rms, fitted.residual_rms(), 1e-6);
    assert!(found.residual_rms > 0.1, "degree 4 follows it: {}", found.residual_rms);
    // What was expected is in the basis.
    assert!(predicted.fit.residual_rms() < 1e-10);
}

#[test]
fn a_beam_half_off_the_sample_is_expected_to_read_half() {
    let beam = Beam::of_spot(0.00625, 0.0025, 0.3).unwrap();
    let outline = Some(Outline::Rectangle { x_m: (-0.011, 0.011), y_m: (-0.011, 0.011) });
    let optics = Optics { beam, outline };
    let basis = BasisSpec::zernike(2, 0);
    let even = samples(|_| 50.0);
    let predicted = fit::predict(&even, &[], &REGION, basis, &[], Some(&optics), &[]).unwrap().fit;
    assert!(predicted.beam().unwrap().cut > 0);
    // An even field stays even, however much of the beams misses the sample.
    close(predicted.radiance(&even[0].ray).value, 50.0, 1e-6);
}

#[test]
fn what_a_fit_refuses_is_refused_before_it() {
    let basis = BasisSpec::zernike(2, 0);
    let mut one_azimuth = samples(field);
    for sample in &mut one_azimuth {
        sample.ray.phi_rad = 0.3;
    }
    let refused = fit::predict(&one_azimuth, &[], &REGION, basis, &[], None, &[]).unwrap_err();
    assert!(matches!(refused, FitError::Undetermined { .. }), "{refused}");
    let short =
        fit::predict(&samples(field), &[], &REGION, basis, &[], None, &[vec![1.0]]).unwrap_err();
    assert_eq!(short, FitError::Parts { what: "field", expected: 240, found: 1 });
    let mut unknown = samples(field);
    unknown[7].noise = Noise::Unknown;
    let refused = fit::predict(&unknown, &[], &REGION, basis, &[], None, &[]).unwrap_err();
    assert!(matches!(refused, FitError::Variance { index: 7, .. }), "{refused}");
}
