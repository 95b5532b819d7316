//! Beam and field angles and the peak intensity: closed forms, and u to first order against
//! coefficients drawn from the covariance.

#[allow(dead_code)]
mod scenes;

use fit::derive::{DeriveError, Field, Reference, Remark};
use fit::{BasisSpec, Common, Fit, Noise, Ray, Shift};
use scenes::disturbed::scatters_as_stated;
use scenes::{REGION, exact, spread_rays};
use std::f64::consts::{FRAC_PI_2, PI};

fn fitted(field: impl Fn(&Ray) -> f64, variance: f64) -> Fit {
    let basis = BasisSpec::zernike(6, 0);
    let mut samples = exact(&spread_rays(400, &REGION, 7), field);
    for sample in &mut samples {
        sample.noise = Noise::Fixed { variance };
    }
    let scale = Common { name: "responsivity".into(), u: 0.01, shift: Shift::Scale };
    fit::fit(&samples, &REGION, basis, &[scale]).unwrap()
}

/// I = 100 A cos⁵ γ in every plane.
fn beam(ray: &Ray) -> f64 {
    100.0 * libm::cos(ray.theta_rad).powi(4)
}

#[test]
fn angles_at_a_share_of_the_peak_have_their_closed_form() {
    let fit = fitted(beam, 1e-2);
    let field = Field::of(&fit);
    for level in [0.5_f64, 0.1] {
        let expected = 2.0 * libm::acos(level.powf(0.2));
        for (phi_rad, reference) in [(0.0, Reference::PlanePeak), (FRAC_PI_2, Reference::Centre)] {
            let found = field.beam_angle(phi_rad, level, reference).unwrap();
            let error = found.estimate.value - expected;
            assert!(error.abs() < 1e-6, "{level}: {error:e}");
            assert!(found.estimate.u > 1e-5 && found.estimate.u < 0.02, "{found:?}");
            // What all readings share by a factor does not move an angle.
            assert!(found.budget[1].u < 1e-6 * found.estimate.u, "{:?}", found.budget);
            assert!(found.remarks.is_empty(), "{:?}", found.remarks);
        }
    }
}

#[test]
fn an_angles_u_is_how_it_scatters() {
    let tilted = |ray: &Ray| {
        let sin = libm::sin(ray.theta_rad);
        beam(ray) + 30.0 * sin * libm::cos(ray.phi_rad) * (1.0 - sin * sin)
    };
    let fit = fitted(tilted, 1.0);
    for (level, reference) in [(0.5, Reference::PlanePeak), (0.1, Reference::Centre)] {
        let angle = |fit: &Fit| Field::of(fit).beam_angle(0.0, level, reference).unwrap().estimate;
        scatters_as_stated(&fit, [angle(&fit).u], |fit| [angle(fit).value]);
    }
}

#[test]
fn the_peak_intensity_and_its_direction_scatter_as_stated() {
    let (theta_rad, phi_rad) = (0.5, 1.2);
    let axis = radiometry::direction::unit(theta_rad, phi_rad);
    let lobe = |ray: &Ray| {
        let cos = axis.dot(radiometry::direction::unit(ray.theta_rad, ray.phi_rad));
        20.0 + 80.0 * cos * cos * cos * cos
    };
    let fit = fitted(lobe, 1.0);
    let peak = Field::of(&fit).peak_intensity().unwrap();
    let at = |fit: &Fit, theta_rad: f64, phi_rad: f64| {
        Field::of(fit).intensity(theta_rad, phi_rad).unwrap().estimate
    };
    let there = at(&fit, peak.theta_rad, peak.phi_rad);
    assert!((peak.intensity.estimate.value / there.value - 1.0).abs() < 1e-9);
    assert!((peak.intensity.estimate.u / there.u - 1.0).abs() < 1e-9);
    for aside in [-0.02, 0.02] {
        assert!(at(&fit, peak.theta_rad + aside, peak.phi_rad).value < there.value);
        assert!(at(&fit, peak.theta_rad, peak.phi_rad + aside).value < there.value);
    }
    let found = |fit: &Fit| Field::of(fit).peak_intensity().unwrap();
    let sin = libm::sin(peak.theta_rad);
    let stated = [peak.intensity.estimate.u, peak.u_theta_rad.unwrap(), peak.u_across_rad.unwrap()];
    scatters_as_stated(&fit, stated, |fit| {
        let found = found(fit);
        [found.intensity.estimate.value, found.theta_rad, sin * found.phi_rad]
    });
}

#[test]
fn what_first_order_cannot_tell_is_said() {
    // A Lambertian source falls to half at 60°, and to a tenth beyond the 80° that were measured.
    let flat = fitted(|_| 100.0, 1e-2);
    let field = Field::of(&flat);
    let beam = field.beam_angle(0.3, 0.5, Reference::PlanePeak).unwrap();
    assert!((beam.estimate.value - 2.0 * PI / 3.0).abs() < 1e-6);
    let wide = field.beam_angle(0.3, 0.1, Reference::PlanePeak);
    let theta_max_rad = REGION.theta_max_rad;
    assert_eq!(wide, Err(DeriveError::NotReached { level: 0.1, theta_max_rad }));

    // Two equal wings, and a dip below half the peak between them.
    let wings = fitted(
        |ray| {
            let sin2 = libm::sin(ray.theta_rad).powi(2);
            10.0 + 400.0 * sin2 * (1.0 - sin2)
        },
        1e-2,
    );
    let found = Field::of(&wings).beam_angle(0.0, 0.5, Reference::PlanePeak).unwrap();
    assert!(found.remarks.contains(&Remark::Tie) && found.remarks.contains(&Remark::Dips));
    assert!(found.estimate.value > 2.0);
    let ring = Field::of(&wings).peak_intensity().unwrap();
    assert!(ring.u_across_rad.is_none() || ring.u_across_rad.unwrap() > ring.u_theta_rad.unwrap());

    let dark = fitted(|_| -1.0, 1e-4);
    let dark = Field::of(&dark);
    assert_eq!(dark.beam_angle(0.0, 0.5, Reference::PlanePeak), Err(DeriveError::NoPeak));
    assert!(dark.peak_intensity().is_err());
    for level in [0.0, 1.0, f64::NAN] {
        assert!(field.beam_angle(0.0, level, Reference::Centre).is_err());
    }
}
