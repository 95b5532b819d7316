//! Maps of the field, and the field with a layer removed: each against the ray's own geometry and
//! against closed forms.

#[allow(dead_code)]
mod scenes;

use fit::derive::{
    Cells, DeriveError, EnvironmentMap, Field, HEMISPHERE, Layer, Medium, Receiver, Reference,
    Remark, TwoPlaneGrid, Uncertain, Zone,
};
use fit::{BasisSpec, Fit, Noise, Ray, Region};
use glam::DVec3;
use radiometry::interface::{Incidence, Interface, Window};
use scenes::{REGION, exact, scaled, spread_rays};
use std::f64::consts::PI;

/// As far as a window's transmittance is a polynomial to a part in a thousand.
const SMOOTH: Region = Region { theta_max_rad: 1.1, ..REGION };

fn fitted(
    region: &Region,
    angular_degree: usize,
    position_degree: usize,
    field: impl Fn(&Ray) -> f64,
) -> Fit {
    let basis = BasisSpec::zernike(angular_degree, position_degree);
    let mut samples = exact(&spread_rays(900, region, 7), field);
    for sample in &mut samples {
        sample.noise = Noise::Fixed { variance: 1e-2 };
    }
    fit::fit(&samples, region, basis, &[]).unwrap()
}

fn lobed() -> Fit {
    fitted(&REGION, 4, 1, |ray| {
        let (sin, cos) = libm::sincos(ray.theta_rad);
        2.0 + 28.0 * cos.powi(4) + 4.0 * sin * libm::cos(ray.phi_rad - 0.5) + scaled(ray).0
    })
}

#[track_caller]
fn near(found: f64, expected: f64, relative: f64) {
    let error = found / expected - 1.0;
    assert!(error.abs() < relative, "found {found:e}, expected {expected:e}: {error:e}");
}

#[test]
fn an_environment_adds_up_to_the_irradiance() {
    let fit = lobed();
    let field = Field::of(&fit);
    let (place_m, normal) = (DVec3::new(0.01, 0.01, 0.02), DVec3::new(0.3, 0.2, -1.0));
    let receiver = Receiver::point(place_m, normal).unwrap();
    let expected = field.received(&receiver).unwrap().irradiance.estimate.value;
    for cells in [Cells::LatLong, Cells::EqualArea] {
        let map = EnvironmentMap { place_m, normal, cells, rows: 30, columns: 60 };
        let found = field.environment(&map).unwrap();
        assert_eq!(found.len(), 1800);
        let sum: f64 = found
            .iter()
            .map(|c| c.radiance.value * libm::cos(c.theta_rad) * c.solid_angle_sr)
            .sum();
        near(sum, expected, 5e-3);
        let sphere: f64 = found.iter().map(|cell| cell.solid_angle_sr).sum();
        near(sphere, 2.0 * PI, 1e-12);
        // A cell's direction leads to where its radiance leaves.
        let cell = found.iter().find(|cell| cell.covered > 0.99).unwrap();
        let foot = place_m - place_m.z / cell.towards.z * cell.towards;
        let (theta_rad, phi_rad) = radiometry::direction::angles(-cell.towards);
        let ray = Ray { x_m: foot.x, y_m: foot.y, theta_rad, phi_rad };
        near(cell.radiance.value, fit.value(&ray), 0.02);
        near(cell.radiance.u, fit.radiance(&ray).u, 0.1);
        assert!(found.iter().any(|cell| cell.covered == 0.0 && cell.radiance.value == 0.0));
    }
    let map =
        EnvironmentMap { place_m: -place_m, normal, cells: Cells::LatLong, rows: 2, columns: 2 };
    assert!(matches!(field.environment(&map), Err(DeriveError::BelowPlane { .. })));
    let map = EnvironmentMap { place_m, rows: 0, ..map };
    assert!(matches!(field.environment(&map), Err(DeriveError::Domain { .. })));
}

#[test]
fn a_two_plane_ray_is_the_ray_through_both_places() {
    let fit = lobed();
    let field = Field::of(&fit);
    let grid = TwoPlaneGrid {
        distance_m: 0.1,
        u: (-0.01, 0.01, 3),
        v: (0.01, 0.02, 2),
        s: (-0.05, 0.05, 5),
        t: (0.02, 0.02, 1),
    };
    let found = field.two_plane(&grid).unwrap();
    assert_eq!(found.len(), 30);
    let ray = found[6];
    let expected = DVec3::new(-0.05, 0.02, 0.1) - DVec3::new(-0.01, 0.02, 0.0);
    assert!((ray.place.u_m, ray.place.v_m, ray.place.s_m) == (-0.01, 0.02, -0.025));
    let along = DVec3::new(-0.025 + 0.01, 0.0, 0.1);
    near(ray.ray.theta_rad, along.angle_between(DVec3::Z), 1e-12);
    near(ray.radiance.unwrap().value, fit.value(&ray.ray), 1e-12);
    near(ray.radiance.unwrap().u, fit.radiance(&ray.ray).u, 1e-12);
    assert!(ray.is_measured && expected.z > 0.0);
    let flat = TwoPlaneGrid { distance_m: 1e-3, ..grid };
    assert!(field.two_plane(&flat).unwrap().iter().any(|ray| !ray.is_measured));
    for wrong in [
        TwoPlaneGrid { distance_m: 0.0, ..grid },
        TwoPlaneGrid { u: (0.1, 0.0, 2), ..grid },
        TwoPlaneGrid { t: (0.0, 0.1, 10_000_000), ..grid },
    ] {
        assert!(matches!(field.two_plane(&wrong), Err(DeriveError::Domain { .. })));
    }
}

const EXACT: fn(f64) -> Uncertain = |value| Uncertain { value, u: 0.0 };

fn pane() -> Layer {
    Layer { index: EXACT(1.5), thickness_m: EXACT(2e-3), absorption_per_m: EXACT(20.0) }
}

#[test]
fn a_window_removed_is_the_field_behind_it() {
    // Behind the pane: brighter towards +x, by 30 % from the middle to the edge.
    let behind = |x_m: f64| 100.0 * (1.0 + 15.0 * x_m);
    let window = Window::new(Interface::new(1.0, 1.5).unwrap(), 2e-3, 20.0).unwrap();
    let through = |theta_rad: f64| window.transmittance(Incidence::from_angle(theta_rad).unwrap());
    // In front of it, by the lecture's construction: a ray is shifted across itself.
    let in_front = |ray: &Ray| {
        let incidence = Incidence::from_angle(ray.theta_rad).unwrap();
        let along_plane = window.lateral_shift_m(incidence).unwrap() / libm::cos(ray.theta_rad);
        through(ray.theta_rad) * behind(ray.x_m + along_plane * libm::cos(ray.phi_rad))
    };
    let fit = fitted(&SMOOTH, 12, 1, in_front);
    let field = Field::without(&fit, Medium::Window(pane())).unwrap();
    for (x_m, theta_rad, phi_rad) in [(0.01, 0.0, 0.0), (-0.005, 0.8, 0.3), (0.0, 1.0, 3.0)] {
        let ray = Ray { x_m, y_m: 0.015, theta_rad, phi_rad };
        let found = field.radiance(&ray).unwrap();
        near(found.estimate.value, behind(x_m), 2e-3);
        near(
            found.estimate.u,
            fit.radiance(&field_ray(&ray, &window)).u / through(theta_rad),
            1e-6,
        );
        // Taken for the field itself it is too dark.
        assert!(fit.value(&ray) < 0.93 * behind(x_m));
    }
    let zone = Zone { from_rad: 0.0, to_rad: 1.0 };
    let expected = PI * libm::sin(1.0).powi(2) * 100.0;
    near(field.mean_exitance(zone).unwrap().estimate.value, expected, 2e-3);
    let receiver = Receiver::point(DVec3::new(0.0, 0.015, 0.05), DVec3::NEG_Z).unwrap();
    let (with, without) = (Field::of(&fit).received(&receiver), field.received(&receiver));
    let ratio =
        without.unwrap().irradiance.estimate.value / with.unwrap().irradiance.estimate.value;
    near(ratio, 1.0 / through(0.15), 5e-3);
}

/// The ray in front of the window that a ray behind it becomes.
fn field_ray(ray: &Ray, window: &Window) -> Ray {
    let incidence = Incidence::from_angle(ray.theta_rad).unwrap();
    let aside = window.lateral_shift_m(incidence).unwrap() / libm::cos(ray.theta_rad);
    let (sin, cos) = libm::sincos(ray.phi_rad);
    Ray { x_m: ray.x_m - aside * cos, y_m: ray.y_m - aside * sin, ..*ray }
}

#[test]
fn an_immersed_emitter_is_brighter_by_n_squared_and_ends_at_the_critical_angle() {
    // A Lambertian emitter of 100 in a medium of n = 1.5: outside T(θ)/n² of it.
    let face = Interface::new(1.5, 1.0).unwrap();
    let outside = |ray: &Ray| {
        let inside_rad = libm::asin(libm::sin(ray.theta_rad) / 1.5);
        100.0 / 2.25 * face.transmittance(Incidence::from_angle(inside_rad).unwrap())
    };
    let fit = fitted(&SMOOTH, 12, 0, outside);
    let layer = Layer { thickness_m: EXACT(0.0), absorption_per_m: EXACT(0.0), ..pane() };
    let field = Field::without(&fit, Medium::Immersion(layer)).unwrap();
    for theta_deg in [0.0_f64, 20.0, 36.0] {
        let ray = Ray { x_m: 0.0, y_m: 0.015, theta_rad: theta_deg.to_radians(), phi_rad: 1.0 };
        near(field.radiance(&ray).unwrap().estimate.value, 100.0, 3e-3);
    }
    let beyond = Ray { x_m: 0.0, y_m: 0.015, theta_rad: 42f64.to_radians(), phi_rad: 0.0 };
    let refused = field.radiance(&beyond);
    assert_eq!(refused, Err(DeriveError::NothingThrough { theta_rad: beyond.theta_rad }));
    // What comes out of the cone that was measured, and no more: sin θ inside is sin 80°/n.
    let whole = field.mean_exitance(HEMISPHERE).unwrap();
    let sin = libm::sin(SMOOTH.theta_max_rad) / 1.5;
    near(whole.estimate.value, 100.0 * PI * sin * sin, 2e-3);
    assert_eq!(whole.measured_fraction, None);
    assert!(whole.remarks.iter().any(|remark| matches!(
        remark,
        Remark::Unmeasured { critical_rad, .. } if (critical_rad - libm::asin(1.0 / 1.5)).abs() < 1e-12
    )));
    let receiver = Receiver::point(DVec3::Z, DVec3::NEG_Z).unwrap();
    assert!(matches!(field.received(&receiver), Err(DeriveError::InAir { .. })));
    // With a layer of some thickness the ray seems to come from nearer to its axis.
    let deep = Layer { thickness_m: EXACT(5e-3), ..layer };
    assert!(Field::without(&fit, Medium::Immersion(deep)).is_ok());
}

#[test]
fn a_layers_own_uncertainty_is_a_difference_by_hand() {
    let fit = lobed();
    let index = Uncertain { value: 1.5, u: 0.02 };
    let layer = Layer { index, thickness_m: Uncertain { value: 2e-3, u: 1e-4 }, ..pane() };
    let field = Field::without(&fit, Medium::Window(layer)).unwrap();
    let flux = field.flux(Zone { from_rad: 0.0, to_rad: 1.0 }).unwrap();
    let with = |index: f64| {
        let layer = Layer { index: EXACT(index), ..pane() };
        let field = Field::without(&fit, Medium::Window(layer)).unwrap();
        field.flux(Zone { from_rad: 0.0, to_rad: 1.0 }).unwrap().estimate.value
    };
    let by_hand = 0.5 * (with(1.52) - with(1.48)).abs();
    let names: Vec<&str> = flux.budget.iter().map(|part| part.name.as_str()).collect();
    assert_eq!(names, ["independent", "window index", "window thickness"]);
    near(flux.budget[1].u, by_hand, 1e-6);
    let squares: f64 = flux.budget.iter().map(|part| part.u * part.u).sum();
    near(flux.estimate.u, squares.sqrt(), 1e-12);
    let angle = field.beam_angle(0.0, 0.5, Reference::PlanePeak).unwrap();
    assert!(angle.budget[1].u > 0.0);
    for wrong in [
        Layer { index: EXACT(0.9), ..layer },
        Layer { thickness_m: EXACT(-1.0), ..layer },
        Layer { absorption_per_m: EXACT(f64::NAN), ..layer },
        Layer { index: Uncertain { value: 1.5, u: -0.1 }, ..layer },
    ] {
        assert!(Field::without(&fit, Medium::Window(wrong)).is_err());
    }
}
