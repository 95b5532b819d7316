//! Derived quantities against closed forms, an independent Monte Carlo integration, and, for their
//! uncertainty, coefficients drawn from the covariance.

#[allow(dead_code)]
mod scenes;

use fit::derive::{Cone, DeriveError, Field, HEMISPHERE, Receiver, Remark, Zone};
use fit::{BasisSpec, Common, Fit, Noise, Ray, Shift};
use glam::DVec3;
use radiometry::projected;
use radiometry::shape::{Disk, Polygon};
use scenes::disturbed::scatters_as_stated;
use scenes::{Die, REGION, exact, scaled, spread_rays};
use std::f64::consts::{FRAC_PI_2, PI};

const LEVEL: f64 = 100.0;

fn fitted(field: impl Fn(&Ray) -> f64, variance: f64, common: &[Common]) -> Fit {
    let basis = BasisSpec::zernike(4, 1);
    let mut samples = exact(&spread_rays(400, &REGION, 7), field);
    for sample in &mut samples {
        sample.noise = Noise::Fixed { variance };
    }
    fit::fit(&samples, &REGION, basis, common).unwrap()
}

fn lambertian() -> Fit {
    fitted(|_| LEVEL, 1e-2, &[])
}

/// In the span of the basis: from 30 at the normal to 3 at the rim, brighter towards +x.
fn lobe(ray: &Ray) -> f64 {
    let (sin, cos) = libm::sincos(ray.theta_rad);
    let (x, y) = scaled(ray);
    2.0 + 28.0 * cos.powi(4) + 4.0 * sin * libm::cos(ray.phi_rad - 0.5) + x * (3.0 + sin) - y
}

fn lobed() -> Fit {
    let scale = Common { name: "responsivity".into(), u: 0.01, shift: Shift::Scale };
    fitted(lobe, 1e-2, &[scale])
}

/// The region as a source of uniform radiance.
fn rectangle() -> Polygon {
    let corner = |x_m: f64, y_m: f64| DVec3::new(x_m, y_m, 0.0);
    let ((x0, x1), (y0, y1)) = (REGION.x_m, REGION.y_m);
    Polygon::new(vec![corner(x0, y0), corner(x1, y0), corner(x1, y1), corner(x0, y1)]).unwrap()
}

#[track_caller]
fn near(found: f64, expected: f64, relative: f64) {
    let error = found / expected - 1.0;
    assert!(error.abs() < relative, "found {found:e}, expected {expected:e}: {error:e}");
}

#[test]
fn a_lambertian_rectangle_lights_points_as_its_closed_form_says() {
    let fit = lambertian();
    let field = Field::of(&fit);
    for (place, normal) in [
        (DVec3::new(0.0, 0.015, 0.3), DVec3::NEG_Z),
        (DVec3::new(0.05, -0.02, 0.04), DVec3::new(-1.0, 0.3, -0.5)),
        // Near the surface, and just beside it.
        (DVec3::new(0.004, 0.012, 1e-3), DVec3::NEG_Z),
        (DVec3::new(0.021, 0.012, 1e-4), DVec3::NEG_X),
        // The face sees a part of the region alone.
        (DVec3::new(0.0, 0.015, 0.01), DVec3::X),
    ] {
        let receiver = Receiver::point(place, normal).unwrap();
        let found = field.received(&receiver).unwrap();
        assert!(found.flux.is_none());
        let seen_from = projected::Receiver::new(place, normal).unwrap();
        let expected = LEVEL * projected::polygon(&seen_from, &rectangle()).unwrap().sr();
        let irradiance = found.irradiance;
        let error = (irradiance.estimate.value - expected).abs();
        assert!(
            error <= irradiance.quadrature_bound + 1e-9 * expected,
            "{place}: {error:e} {irradiance:?}"
        );
        assert!(irradiance.quadrature_bound <= 0.02 * irradiance.estimate.u);
        near(irradiance.estimate.value, expected, 1e-5);
    }
}

#[test]
fn a_lambertian_rectangle_lights_disks_and_polygons_as_form_factors_say() {
    let fit = lambertian();
    let field = Field::of(&fit);
    // The region itself, 30 mm above: both rectangles alike and opposite.
    let (width, depth, height) = (0.04_f64, 0.02_f64, 0.03_f64);
    let lifted = rectangle().vertices().iter().map(|v| *v + height * DVec3::Z).rev().collect();
    let opposite = Receiver::polygon(lifted).unwrap();
    let found = field.received(&opposite).unwrap();
    let factor = opposite_rectangles(width / height, depth / height);
    near(found.irradiance.estimate.value, LEVEL * PI * factor, 1e-5);
    near(found.flux.unwrap().estimate.value, LEVEL * PI * factor * width * depth, 1e-5);

    // A small disk is a point; a large one is the mean over points.
    let centre = DVec3::new(0.01, 0.0, 0.05);
    let normal = DVec3::new(0.2, 0.1, -1.0);
    let small = field.received(&Receiver::disk(centre, normal, 1e-6).unwrap()).unwrap();
    let point = field.received(&Receiver::point(centre, normal).unwrap()).unwrap();
    near(small.irradiance.estimate.value, point.irradiance.estimate.value, 1e-6);
    let large = field.received(&Receiver::disk(centre, DVec3::NEG_Z, 0.04).unwrap()).unwrap();
    // By reciprocity, the mean over the region of what the disk's projected solid angle is there.
    let disk = Disk::new(centre, DVec3::NEG_Z, 0.04).unwrap();
    let mut sum = 0.0;
    let side = 60;
    for k in 0..side * side {
        let along = |(from, to): (f64, f64), i: i32| {
            from + (to - from) * (f64::from(i) + 0.5) / f64::from(side)
        };
        let place = DVec3::new(along(REGION.x_m, k % side), along(REGION.y_m, k / side), 0.0);
        let up = projected::Receiver::new(place, DVec3::Z).unwrap();
        sum += projected::disk(&up, &disk).unwrap().sr() / f64::from(side * side);
    }
    let expected = LEVEL * sum * REGION.area_m2() / (PI * 0.04 * 0.04);
    near(large.irradiance.estimate.value, expected, 1e-4);
}

/// Form factor of two equal rectangles opposite each other, sides over distance (Howell C-11).
fn opposite_rectangles(x: f64, y: f64) -> f64 {
    let (x1, y1) = (1.0 + x * x, 1.0 + y * y);
    let log = (x1 * y1 / (x1 + y * y)).sqrt().ln();
    let across = x * y1.sqrt() * (x / y1.sqrt()).atan() + y * x1.sqrt() * (y / x1.sqrt()).atan();
    2.0 / (PI * x * y) * (log + across - x * x.atan() - y * y.atan())
}

#[test]
fn far_away_the_irradiance_is_intensity_over_distance_squared() {
    let fit = lobed();
    let field = Field::of(&fit);
    let (theta_rad, phi_rad) = (0.6, 1.1);
    let intensity = field.intensity(theta_rad, phi_rad).unwrap();
    let towards = radiometry::direction::unit(theta_rad, phi_rad);
    let centre = DVec3::new(0.0, 0.015, 0.0);
    for distance_m in [30.0, 300.0] {
        let receiver = Receiver::point(centre + distance_m * towards, -towards).unwrap();
        let found = field.received(&receiver).unwrap().irradiance.estimate;
        let expected = intensity.estimate.value / (distance_m * distance_m);
        near(found.value, expected, 1e-3 * 30.0 / distance_m);
        near(found.u * distance_m * distance_m, intensity.estimate.u, 1e-2);
    }
}

#[test]
fn a_lobes_irradiance_is_the_one_of_rays_cast_at_random() {
    let fit = lobed();
    let field = Field::of(&fit);
    let (centre, normal, radius_m) =
        (DVec3::new(0.03, 0.0, 0.02), DVec3::new(-1.0, 0.2, -0.7), 0.01);
    let found = field.received(&Receiver::disk(centre, normal, radius_m).unwrap()).unwrap();
    let (axis, mut die) = (normal.normalize(), Die::new(11));
    let across = axis.any_orthonormal_pair();
    let rays = 200_000;
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..rays {
        let between = |(from, to): (f64, f64), t: f64| from + (to - from) * t;
        let foot =
            DVec3::new(between(REGION.x_m, die.uniform()), between(REGION.y_m, die.uniform()), 0.0);
        let (r, turn) = (radius_m * die.uniform().sqrt(), 2.0 * PI * die.uniform());
        let place = centre + r * (turn.cos() * across.0 + turn.sin() * across.1);
        let way = place - foot;
        let towards = way.normalize();
        let cosines = towards.z * (-towards.dot(axis)).max(0.0) / way.length_squared();
        let (theta_rad, phi_rad) = radiometry::direction::angles(towards);
        let ray = Ray { x_m: foot.x, y_m: foot.y, theta_rad, phi_rad };
        let term = lobe(&ray) * cosines * REGION.area_m2();
        sum += term;
        squares += term * term;
    }
    let n = f64::from(rays);
    let mean = sum / n;
    let scatter = ((squares / n - mean * mean) / n).sqrt();
    let error = found.irradiance.estimate.value - mean;
    assert!(error.abs() < 4.0 * scatter, "{error:e} {scatter:e} of {mean}");
    assert!(scatter < 0.005 * mean);
}

#[test]
fn places_and_cones_have_their_closed_forms() {
    let fit = lobed();
    let field = Field::of(&fit);
    let at = field.exitance_at(0.01, 0.015, HEMISPHERE).unwrap();
    // ∫ cos⁵ dω = π/3, ∫ sin cos dω over the sphere's half = 2π/3; the odd terms in φ vanish.
    let (x, y) = (0.5, 0.0);
    let expected = PI * (2.0 + 28.0 / 3.0 + 3.0 * x - y) + x * 2.0 * PI / 3.0;
    near(at.estimate.value, expected, 2e-3);
    let mean = field.mean_exitance(HEMISPHERE).unwrap().estimate;
    near(mean.value, fit.exitance().value, 1e-9);
    near(mean.u, fit.exitance().u, 1e-6);
    let flux = field.flux(HEMISPHERE).unwrap();
    near(flux.estimate.value, fit.flux().value, 1e-9);
    near(flux.measured_fraction.unwrap(), fit.measured_fraction().unwrap(), 1e-6);
    assert!(flux.remarks.contains(&Remark::Extrapolated));
    // A cone about the normal is a zone; one about the horizon is what sets of a sphere.
    let half_angle_rad = 0.8;
    let cone = Cone { axis_theta_rad: 0.0, axis_phi_rad: 0.0, half_angle_rad };
    let zone = field.flux(Zone { from_rad: 0.0, to_rad: half_angle_rad }).unwrap();
    near(field.flux_into(&cone).unwrap().estimate.value, zone.estimate.value, 1e-9);
    assert_eq!(zone.measured_fraction, Some(1.0));
    let flat = lambertian();
    let low = Cone { axis_theta_rad: 1.3, axis_phi_rad: 2.0, half_angle_rad };
    let sets = projected::sphere_tilted(libm::sin(half_angle_rad), 1.0, 1.3).unwrap().sr();
    let found = Field::of(&flat).flux_into(&low).unwrap();
    near(found.estimate.value, LEVEL * sets * REGION.area_m2(), 1e-5);
}

#[test]
fn linear_quantities_scatter_with_the_coefficients_as_their_u_says() {
    let fit = lobed();
    let field = Field::of(&fit);
    let place = DVec3::new(0.05, -0.02, 0.04);
    let receiver = Receiver::point(place, DVec3::new(-1.0, 0.3, -0.5)).unwrap();
    let received = |fit: &Fit| Field::of(fit).received(&receiver).unwrap().irradiance.estimate;
    let stated = received(&fit);
    assert!(stated.u > stated.u_independent);
    let at = |fit: &Fit| Field::of(fit).exitance_at(0.015, 0.02, HEMISPHERE).unwrap().estimate;
    let both = |fit: &Fit| [received(fit).value, at(fit).value];
    scatters_as_stated(&fit, [stated.u, at(&fit).u], both);
    let budget = field.received(&receiver).unwrap().irradiance.budget;
    assert_eq!(budget[1].name, "responsivity");
    near(budget[1].u, 0.01 * stated.value, 1e-6);
}

#[test]
fn receivers_that_cannot_be_are_refused() {
    let below = Receiver::point(DVec3::new(0.0, 0.0, -0.1), DVec3::Z);
    assert_eq!(below, Err(DeriveError::BelowPlane { height_m: -0.1 }));
    assert!(matches!(
        Receiver::disk(DVec3::new(0.0, 0.0, 0.01), DVec3::X, 0.01),
        Err(DeriveError::BelowPlane { .. })
    ));
    assert!(Receiver::disk(DVec3::new(0.0, 0.0, 0.01), DVec3::NEG_Z, 0.01).is_ok());
    assert!(Receiver::disk(DVec3::Z, DVec3::X, -1.0).is_err());
    assert!(Receiver::point(DVec3::Z, DVec3::ZERO).is_err());
    let touching = vec![DVec3::ZERO, DVec3::X, DVec3::Z];
    assert!(matches!(Receiver::polygon(touching), Err(DeriveError::BelowPlane { .. })));
    let line = vec![DVec3::Z, DVec3::new(1.0, 0.0, 1.0), DVec3::new(2.0, 0.0, 1.0)];
    assert!(matches!(Receiver::polygon(line), Err(DeriveError::Receiver { .. })));

    let fit = lambertian();
    let field = Field::of(&fit);
    let away = field.received(&Receiver::point(DVec3::Z, DVec3::Z).unwrap()).unwrap().irradiance;
    assert!(away.estimate.value.abs() < 1e-300 && away.remarks.contains(&Remark::FaceAway));
    let grazing = Receiver::disk(DVec3::new(0.0, 0.015, 1e-15), DVec3::NEG_Z, 0.01).unwrap();
    assert!(matches!(field.received(&grazing), Err(DeriveError::TooNear { .. })));
    let turned = Zone { from_rad: 1.0, to_rad: 0.5 };
    assert!(matches!(field.flux(turned), Err(DeriveError::Domain { .. })));
    assert!(field.intensity(FRAC_PI_2 + 0.1, 0.0).is_err());
}
