//! Fits in charts other than the surface one, against closed forms; and one light field in two charts.

use fit::derive::{ALL_DIRECTIONS, Cone, Field, PointReceiver, Receiver, Zone};
use fit::{
    Angular, BasisSpec, Common, Fit, FitError, Noise, Optics, Outline, Position, Ray, Region,
    Sample, Shift, Wish, fit_seen,
};
use glam::DVec3;
use radiometry::beam::{Beam, Placed};
use radiometry::direction::unit;
use std::f64::consts::{FRAC_PI_2, PI};

const RADIUS_M: f64 = 0.05;
const NOISE: Noise = Noise::Fixed { variance: 0.01 };

fn spherical(degree: usize, position: usize) -> BasisSpec {
    BasisSpec {
        angular: Angular::Spherical { degree },
        position: Position::Legendre { degree: position },
    }
}

/// Directions over the whole sphere, evenly in solid angle.
fn directions(count: u32) -> impl Iterator<Item = (f64, f64)> {
    (0..count).map(move |i| {
        let theta = libm::acos(1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(count));
        (theta, f64::from(i) * 2.399_963_229_728_653)
    })
}

fn near(found: f64, expected: f64, relative: f64) {
    let off = (found - expected).abs();
    assert!(off <= relative * expected.abs(), "{found}, expected {expected}");
}

/// Along rays at the origin, in all directions.
fn seen_all_round(field: impl Fn(f64, f64) -> f64) -> Vec<Sample> {
    directions(300)
        .map(|(theta_rad, phi_rad)| Sample {
            ray: Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad },
            value: field(theta_rad, phi_rad),
            noise: NOISE,
        })
        .collect()
}

/// 100 (1 + cos θ/2 + 0.3 sin θ cos φ).
fn lopsided(theta: f64, phi: f64) -> f64 {
    100.0 * (1.0 + 0.5 * libm::cos(theta) + 0.3 * libm::sin(theta) * libm::cos(phi))
}

fn object(field: impl Fn(f64, f64) -> f64, degree: usize) -> Fit {
    let region = Region::object(RADIUS_M, PI);
    let scale = Common { name: "responsivity".into(), u: 0.02, shift: Shift::Scale };
    fit::fit(&seen_all_round(field), &region, spherical(degree, 0), &[scale]).unwrap()
}

#[test]
fn a_lambertian_ball_has_the_intensity_of_its_disk_and_the_flux_of_its_surface() {
    let ball = object(|_, _| 100.0, 4);
    let field = Field::of(&ball);
    let area = PI * RADIUS_M * RADIUS_M;
    for (theta, phi) in [(0.0, 0.0), (1.0, 2.0), (2.5, -1.0), (PI, 0.0)] {
        let intensity = field.intensity(theta, phi).unwrap();
        near(intensity.estimate.value, 100.0 * area, 1e-9);
        near(intensity.measured_fraction.unwrap(), 1.0, 1e-12);
        // 2 % of the responsivity, and 0.1 of noise a reading.
        assert!(intensity.estimate.u > 0.02 * 100.0 * area);
        assert!(intensity.estimate.u_independent < 1e-3 * 100.0 * area);
    }
    let flux = field.flux(ALL_DIRECTIONS).unwrap().estimate;
    near(flux.value, 4.0 * PI * PI * RADIUS_M * RADIUS_M * 100.0, 1e-9);
    near(flux.u, flux.u_independent.hypot(0.02 * flux.value), 1e-9);
    near(ball.flux().value, flux.value, 1e-9);
    near(ball.flux().u, flux.u, 1e-9);
}

#[test]
fn zones_and_cones_of_an_object_add_up_to_their_closed_forms() {
    let fit = object(lopsided, 3);
    let field = Field::of(&fit);
    let area = PI * RADIUS_M * RADIUS_M;
    near(field.flux(ALL_DIRECTIONS).unwrap().estimate.value, 400.0 * PI * area, 1e-9);
    // Upward: 2π (1 + 1/4), downward the rest.
    let up = field.flux(Zone { from_rad: 0.0, to_rad: FRAC_PI_2 }).unwrap().estimate.value;
    near(up, 250.0 * PI * area, 1e-9);
    let down = field.flux(Zone { from_rad: FRAC_PI_2, to_rad: PI }).unwrap().estimate.value;
    near(down, 150.0 * PI * area, 1e-9);
    // About +x: 2π (1 - cos α) + 0.3 π sin² α.
    let alpha: f64 = 0.7;
    let cone = Cone { axis_theta_rad: FRAC_PI_2, axis_phi_rad: 0.0, half_angle_rad: alpha };
    let expected = 100.0 * PI * (2.0 * (1.0 - alpha.cos()) + 0.3 * alpha.sin().powi(2));
    near(field.flux_into(&cone).unwrap().estimate.value, expected * area, 1e-9);
    let peak = field.peak_intensity().unwrap();
    let size = 0.5_f64.hypot(0.3);
    near(peak.intensity.estimate.value, 100.0 * (1.0 + size) * area, 1e-6);
    near(peak.theta_rad, libm::atan2(0.3, 0.5), 1e-3);
    near(fit.peak().radiance.value, 100.0 * (1.0 + size), 1e-6);
    // What an object has not is refused by its name.
    let refusal = field.mean_exitance(ALL_DIRECTIONS).unwrap_err().to_string();
    assert!(refusal.contains("perpendicular") && refusal.contains("no exitance"), "{refusal}");
}

#[test]
fn directions_that_were_not_measured_are_extrapolated_and_said_so() {
    let region = Region::object(RADIUS_M, 2.0);
    let samples = seen_all_round(lopsided);
    let samples: Vec<Sample> = samples.into_iter().filter(|s| s.ray.theta_rad <= 2.0).collect();
    let fit = fit::fit(&samples, &region, spherical(3, 0), &[]).unwrap();
    let flux = Field::of(&fit).flux(ALL_DIRECTIONS).unwrap();
    // 2π (1 - cos 2) + π/2 sin² 2, of 4π.
    let inside = 2.0 * PI * (1.0 - 2f64.cos()) + 0.5 * PI * 2f64.sin().powi(2);
    near(flux.measured_fraction.unwrap(), inside / (4.0 * PI), 1e-6);
    let within = Field::of(&fit).intensity(1.0, 0.0).unwrap().estimate.u;
    let beyond = Field::of(&fit).intensity(3.0, 0.0).unwrap().estimate.u;
    assert!(beyond > 5.0 * within, "{within} {beyond}");
}

/// Beams whose spot is wider than the object look at it from all round; what they read by counting
/// rays, or in closed form.
fn wide_beam() -> Beam {
    Beam::of_spot(0.005, 0.08, 0.6).unwrap()
}

#[test]
fn a_ball_seen_whole_is_known_by_the_light_that_enters_the_pupil() {
    // Of a ball's light ½ (1 - h/√(h² + a²)) enters a coaxial disk, wherever on the ball it began.
    let (beam, h, a) = (wide_beam(), 0.6_f64, 0.005_f64);
    let enters = 0.5 * (a / h).powi(2) / (1.0 + (a / h).powi(2) + (1.0 + (a / h).powi(2)).sqrt());
    let flux = 4.0 * PI * PI * RADIUS_M * RADIUS_M * 100.0;
    let read = flux * enters / beam.throughput().unwrap().m2_sr();
    let samples: Vec<Sample> = seen_all_round(|_, _| read).into_iter().step_by(5).collect();
    let outline = Some(Outline::Disk { centre_m: (0.0, 0.0), radius_m: RADIUS_M });
    let region = Region::object(RADIUS_M, PI);
    let optics = Optics { beam, outline };
    let fit = fit_seen(&samples, &region, spherical(2, 0), &[], Some(&optics)).unwrap();
    assert_eq!(fit.beam().unwrap().cut, 60);
    near(fit.flux().value, flux, 2e-4);
    near(fit.value(&samples[7].ray), 100.0, 2e-4);
}

#[test]
fn a_beam_of_the_perpendicular_chart_averages_position_and_direction_as_its_rays_do() {
    // A field of the basis, so that what beams read is known by counting rays with radiometry's own.
    let region = Region::perpendicular((-0.05, 0.05), (-0.05, 0.05), PI);
    let field = |ray: &Ray| {
        let (x, y) = (ray.x_m / 0.05, ray.y_m / 0.05);
        lopsided(ray.theta_rad, ray.phi_rad) + 8.0 * x * libm::cos(ray.theta_rad) + 5.0 * y * y
    };
    let beam = Beam::of_spot(0.02, 0.01, 0.3).unwrap();
    let rule = beam.rule(7);
    let places = [
        (0.0, 0.0),
        (0.03, -0.02),
        (-0.03, 0.03),
        (-0.02, -0.03),
        (0.04, 0.01),
        (0.01, 0.04),
        (-0.04, 0.0),
    ];
    let mut samples = Vec::new();
    // Off the poles, at which the plane's own frame turns about.
    for (i, (theta_rad, phi_rad)) in directions(200).enumerate().skip(8).take(184) {
        let (x_m, y_m) = places[i % places.len()];
        let ray = Ray { x_m, y_m, theta_rad, phi_rad };
        let towards = unit(theta_rad, phi_rad);
        let along_theta = unit(theta_rad + FRAC_PI_2, phi_rad);
        let along_phi = towards.cross(along_theta);
        let placed = Placed::new(x_m * along_theta + y_m * along_phi, towards);
        let value = rule.mean(|ray| {
            let point = placed.point(ray.point);
            let line = radiometry::chart::Line::new(point, placed.direction(ray.direction));
            let place = radiometry::chart::Perpendicular::of(&line.unwrap());
            let radiometry::chart::Perpendicular { theta_rad, phi_rad, x_m, y_m } = place;
            field(&Ray { x_m, y_m, theta_rad, phi_rad })
        });
        samples.push(Sample { ray, value, noise: NOISE });
    }
    let optics = Optics { beam, outline: None };
    let basis = spherical(2, 2);
    let seen = fit_seen(&samples, &region, basis, &[], Some(&optics)).unwrap();
    let point = fit::fit(&samples, &region, basis, &[]).unwrap();
    let off = |fit: &Fit| {
        let offs = samples.iter().map(|s| (fit.value(&s.ray) - field(&s.ray)).abs());
        offs.fold(0.0, f64::max)
    };
    assert!(off(&seen) < 2e-3, "{}", off(&seen));
    assert!(off(&point) > 0.05, "{}", off(&point));
}

#[test]
fn an_environment_has_the_irradiances_of_its_point() {
    let region = Region::environment(PI);
    let even = fit::fit(&seen_all_round(|_, _| 100.0), &region, spherical(2, 0), &[]).unwrap();
    let field = Field::of(&even);
    let up = PointReceiver::Face { normal: DVec3::new(0.3, -0.2, 0.9) };
    near(field.irradiance_at_point(&up).unwrap().estimate.value, 100.0 * PI, 1e-9);
    let axis = DVec3::new(1.0, 1.0, 0.0);
    let cylinder = field.irradiance_at_point(&PointReceiver::Cylinder { axis }).unwrap();
    near(cylinder.estimate.value, 100.0 * PI, 1e-9);
    let sphere = field.irradiance_at_point(&PointReceiver::Sphere).unwrap();
    near(sphere.estimate.value, 400.0 * PI, 1e-9);

    // Of L₀ + L₁·d a face receives π L₀ + 2π/3 L₁·n.
    let fit = fit::fit(&seen_all_round(lopsided), &region, spherical(3, 0), &[]).unwrap();
    let field = Field::of(&fit);
    for normal in [DVec3::Z, -DVec3::Z, DVec3::X, DVec3::new(0.6, 0.0, -0.8)] {
        let slope = DVec3::new(30.0, 0.0, 50.0).dot(normal);
        let found = field.irradiance_at_point(&PointReceiver::Face { normal }).unwrap();
        near(found.estimate.value, 100.0 * PI + 2.0 * PI / 3.0 * slope, 1e-8);
        near(found.measured_fraction.unwrap(), 1.0, 1e-12);
    }
    // A point has no area to leave from.
    let refusal = field.flux(ALL_DIRECTIONS).unwrap_err().to_string();
    assert!(refusal.contains("environment") && refusal.contains("no flux"), "{refusal}");
    let refusal = Field::of(&object(lopsided, 2)).irradiance_at_point(&up).unwrap_err();
    assert!(refusal.to_string().contains("perpendicular"), "{refusal}");
}

#[test]
fn a_detector_that_looks_outward_averages_over_its_acceptance() {
    let beam = Beam::of_spot(0.01, 0.06, 0.3).unwrap();
    let rule = beam.rule(9);
    let narrow = |d: DVec3| 100.0 + 40.0 * d.z.powi(3) + 20.0 * d.x * d.y;
    let samples: Vec<Sample> = directions(250)
        .map(|(theta_rad, phi_rad)| {
            let placed = Placed::new(DVec3::ZERO, unit(theta_rad, phi_rad));
            let value = rule.mean(|ray| narrow(placed.direction(ray.direction)));
            let ray = Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad };
            Sample { ray, value, noise: NOISE }
        })
        .collect();
    let optics = Optics { beam, outline: None };
    let region = Region::environment(PI);
    let fit = fit_seen(&samples, &region, spherical(3, 0), &[], Some(&optics)).unwrap();
    assert!(fit.beam().unwrap().averaged == 250);
    for sample in &samples {
        let (theta, phi) = (sample.ray.theta_rad, sample.ray.phi_rad);
        let off = (fit.value(&sample.ray) - narrow(unit(theta, phi))).abs();
        assert!(off < 2e-3, "{off} at {theta}");
    }
}

fn between(rays: usize) -> (Region, Vec<Ray>) {
    let (side, far) = ((-0.01, 0.01), (-0.03, 0.02));
    let region = Region::two_plane((side, (-0.008, 0.008)), (far, (-0.02, 0.02)), 0.05);
    let part = |i: usize, prime: f64| (i as f64 * prime).fract();
    let at = |(a, b): (f64, f64), t: f64| a + (b - a) * t;
    // Roberts's sequence in four dimensions.
    let g: f64 = 1.167_303_978_261_418_7;
    let rays = (1..=rays).map(|i| {
        let t = [1, 2, 3, 4].map(|k| part(i, g.powi(-k)));
        let first = (at(side, t[0]), at((-0.008, 0.008), t[1]));
        Ray::between(first, (at(far, t[2]), at((-0.02, 0.02), t[3])), 0.05)
    });
    (region, rays.collect())
}

fn second_plane(degree: usize, position: usize) -> BasisSpec {
    BasisSpec {
        angular: Angular::SecondPlane { degree },
        position: Position::Legendre { degree: position },
    }
}

#[test]
fn an_even_light_field_carries_its_radiance_times_the_throughput_of_two_rectangles() {
    let (region, rays) = between(200);
    let sample = |ray: &Ray| Sample { ray: *ray, value: 100.0, noise: NOISE };
    let samples: Vec<Sample> = rays.iter().map(sample).collect();
    for (degree, position) in [(0, 0), (2, 1)] {
        let fit = fit::fit(&samples, &region, second_plane(degree, position), &[]).unwrap();
        let factor = radiometry::form_factor::aligned_rectangles(
            [-0.01, 0.01],
            [-0.008, 0.008],
            [-0.03, 0.02],
            [-0.02, 0.02],
            0.05,
        );
        let throughput = PI * 0.02 * 0.016 * factor.unwrap().ratio();
        let flux = Field::of(&fit).flux(ALL_DIRECTIONS).unwrap();
        near(flux.estimate.value, 100.0 * throughput, 1e-9);
        near(fit.flux().value, 100.0 * throughput, 1e-9);
    }
}

#[test]
fn one_light_field_has_one_flux_in_the_surface_and_the_two_plane_chart() {
    let (region, rays) = between(600);
    let light = |ray: &Ray| {
        let d = unit(ray.theta_rad, ray.phi_rad);
        100.0 * (1.0 + 20.0 * ray.x_m) * (0.5 + 0.5 * d.z * d.z + 0.2 * d.x)
    };
    // A noise of 0.1 that isn't drawn at random, so that the test always says the same.
    let noise = |i: usize| 0.1 * (((i * 7919) % 101) as f64 / 50.0 - 1.0);
    let sample =
        |(i, ray): (usize, &Ray)| Sample { ray: *ray, value: light(ray) + noise(i), noise: NOISE };
    let samples: Vec<Sample> = rays.iter().enumerate().map(sample).collect();
    let in_planes = fit::fit(&samples, &region, second_plane(4, 2), &[]).unwrap();
    let flux = Field::of(&in_planes).flux(ALL_DIRECTIONS).unwrap().estimate;
    let surface = Region::surface(region.x_m, region.y_m, region.theta_max_rad);
    let on_surface = fit::fit(&samples, &surface, BasisSpec::zernike(4, 2), &[]).unwrap();
    let (s, t) = ((-0.03, 0.02), (-0.02, 0.02));
    // Counter-clockwise seen from below, where the light comes from.
    let corners = [(s.0, t.0), (s.0, t.1), (s.1, t.1), (s.1, t.0)];
    let corners = corners.map(|(x, y)| DVec3::new(x, y, 0.05)).to_vec();
    let receiver = Receiver::polygon(corners).unwrap();
    let received = Field::of(&on_surface).received(&receiver).unwrap().flux.unwrap().estimate;
    let apart = (flux.value - received.value).abs();
    let u = flux.u.hypot(received.u);
    assert!(received.u < 2e-3 * received.value && apart < 2.0 * u, "{apart} {u} {received:?}");
}

#[test]
fn a_beam_between_planes_averages_as_its_rays_do() {
    let (region, rays) = between(300);
    let light = |ray: &Ray| {
        let (s, t) = ray.beyond(0.05);
        100.0 + 30.0 * (s / 0.03).powi(2) - 10.0 * t / 0.02 * ray.x_m / 0.01
    };
    let beam = Beam::of_spot(0.004, 0.002, 0.05).unwrap();
    let rule = beam.rule(7);
    let inner = |ray: &&Ray| {
        let (s, t) = ray.beyond(0.05);
        ray.x_m.abs() < 0.007 && ray.y_m.abs() < 0.005 && s.abs() < 0.016 && t.abs() < 0.012
    };
    let samples: Vec<Sample> = rays
        .iter()
        .filter(inner)
        .map(|ray| {
            let spot = DVec3::new(ray.x_m, ray.y_m, 0.0);
            let placed = Placed::new(spot, unit(ray.theta_rad, ray.phi_rad));
            let value = rule.mean(|one| {
                let line = radiometry::chart::Line::new(
                    placed.point(one.point),
                    placed.direction(one.direction),
                );
                let seen = radiometry::chart::Surface::of(&line.unwrap()).unwrap();
                let radiometry::chart::Surface { x_m, y_m, theta_rad, phi_rad } = seen;
                light(&Ray { x_m, y_m, theta_rad, phi_rad })
            });
            Sample { ray: *ray, value, noise: NOISE }
        })
        .collect();
    let optics = Optics { beam, outline: None };
    let basis = second_plane(2, 1);
    let seen = fit_seen(&samples, &region, basis, &[], Some(&optics)).unwrap();
    let point = fit::fit(&samples, &region, basis, &[]).unwrap();
    let off = |fit: &Fit| {
        let offs = samples.iter().map(|s| (fit.value(&s.ray) - light(&s.ray)).abs());
        offs.fold(0.0, f64::max)
    };
    assert!(off(&seen) < 5e-3, "{}", off(&seen));
    assert!(off(&point) > 0.1, "{}", off(&point));
}

#[test]
fn one_light_field_has_one_flux_in_the_surface_and_the_perpendicular_chart() {
    // A disk of 10 mm that shines upward with L = 100 cos² θ, seen whole by a wide beam.
    let (radius, beam) = (0.01, Beam::of_spot(0.004, 0.02, 0.5).unwrap());
    let rule = beam.rule_of(41, 3);
    let mut samples = Vec::new();
    for (i, (theta_rad, phi_rad)) in directions(400).enumerate() {
        let placed = Placed::new(DVec3::ZERO, unit(theta_rad, phi_rad));
        let value = rule.mean(|ray| {
            let line = radiometry::chart::Line::new(
                placed.point(ray.point),
                placed.direction(ray.direction),
            );
            let left = radiometry::chart::Surface::of(&line.unwrap());
            let left = left.filter(|ray| libm::hypot(ray.x_m, ray.y_m) < radius);
            left.map_or(0.0, |ray| 100.0 * libm::cos(ray.theta_rad).powi(2))
        });
        let jitter = 0.02 * (((i * 7919) % 101) as f64 / 50.0 - 1.0);
        let ray = Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad };
        samples.push(Sample { ray, value: value + jitter, noise: Noise::Fixed { variance: 4e-4 } });
    }
    let outline = Some(Outline::Disk { centre_m: (0.0, 0.0), radius_m: radius });
    let optics = Optics { beam, outline };
    let whole = Region::object(radius, PI);
    let object = fit_seen(&samples, &whole, spherical(8, 0), &[], Some(&optics)).unwrap();
    // The same light, a spot at a time.
    let on_sample = |sample: &Sample| {
        let value = 100.0 * libm::cos(sample.ray.theta_rad).powi(2);
        Sample { value, noise: NOISE, ..*sample }
    };
    let above = samples.iter().filter(|s| s.ray.theta_rad < 1.45).map(on_sample);
    let point = Region::surface((0.0, 0.0), (0.0, 0.0), 1.45);
    let above: Vec<Sample> = above.collect();
    let surface = fit::fit(&above, &point, BasisSpec::zernike(4, 0), &[]).unwrap();
    let exitance = surface.exitance();
    let area = PI * radius * radius;
    near(exitance.value, 50.0 * PI, 5e-3);
    let (a, b) = (object.flux(), exitance);
    let apart = (a.value - area * b.value).abs();
    let u = a.u.hypot(area * b.u).hypot(3e-3 * a.value);
    assert!(apart < 2.0 * u, "{} {} {u}", a.value, area * b.value);
}

#[test]
fn the_basis_of_a_chart_is_chosen_from_its_own_functions() {
    let field = |theta: f64, phi: f64| lopsided(theta, phi) + 20.0 * libm::cos(theta).powi(5);
    let samples = seen_all_round(field);
    let region = Region::environment(PI);
    let (model, choice) = fit::choose(&samples, &region, &Wish::default(), None).unwrap();
    assert_eq!(model.basis.angular.name(), "spherical");
    assert!(model.basis.angular.degree().unwrap() >= 5, "{:?}", model.basis);
    assert!(choice.unwrap().candidates.len() > 3);
    let fit = fit::fit(&samples, &region, model, &[]).unwrap();
    let off = (fit.value(&samples[100].ray) - samples[100].value).abs();
    assert!(off < 0.05, "{off}");
}

#[test]
fn bases_and_rays_of_other_charts_are_refused_by_name() {
    let samples = seen_all_round(|_, _| 1.0);
    let round = Region::environment(PI);
    let refused =
        |region: &Region, basis: BasisSpec| fit::fit(&samples, region, basis, &[]).unwrap_err();
    let foreign = refused(&round, BasisSpec::zernike(2, 0));
    assert_eq!(foreign, FitError::BasisOfChart { kind: "zernike", chart: "environment" });
    assert!(foreign.to_string().contains("expected spherical"), "{foreign}");
    let flat = Region::surface((0.0, 0.0), (0.0, 0.0), 1.5);
    let below = refused(&flat, BasisSpec::zernike(0, 0));
    assert!(below.to_string().contains("outside 0° to 90°"), "{below}");
    assert_eq!(
        refused(&Region::environment(3.5), spherical(0, 0)),
        FitError::Region,
        "beyond the nadir"
    );
    let (region, mut rays) = between(30);
    rays[3] = Ray::between((0.0, 0.0), (0.06, 0.0), 0.05);
    let samples: Vec<Sample> =
        rays.iter().map(|ray| Sample { ray: *ray, value: 1.0, noise: NOISE }).collect();
    let missed = fit::fit(&samples, &region, second_plane(1, 0), &[]).unwrap_err();
    assert!(matches!(missed, FitError::OutsideSecondPlane { index: 3, .. }), "{missed}");
    let touching = Region::two_plane(((0.0, 1.0), (0.0, 1.0)), ((0.0, 1.0), (0.0, 1.0)), 1e-4);
    let samples = [Sample { ray: Ray::between((0.5, 0.5), (0.5, 0.5), 1e-4), ..samples[0] }];
    let near = fit::fit(&samples, &touching, second_plane(0, 0), &[]).unwrap_err();
    assert!(matches!(near, FitError::PlanesTooNear { .. }), "{near}");
}
