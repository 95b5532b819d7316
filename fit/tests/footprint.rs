//! Readings that are means over a beam give back the field that was blurred: readings are made here
//! by counting rays through pupil and spot, and by no rule of the fit's.

#[allow(dead_code)]
mod scenes;

use fit::{
    AngularKind, BasisSpec, BeamRows, Common, Noise, Optics, Outline, Position, Ray, Region,
    Sample, Shift, Wish,
};
use radiometry::beam::Beam;
use radiometry::direction::{angles, unit};
use radiometry::quadrature::Sobol;
use scenes::{Die, spread_rays};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Quasi-random rays of a reading: their error is a few parts in ten thousand at an edge.
const RAYS: usize = 1 << 17;

/// 12.5 mm pupil, 5 mm spot, 300 mm.
fn stock() -> Beam {
    Beam::of_spot(0.00625, 0.0025, 0.3).unwrap()
}

fn region(half_m: f64, theta_max_deg: f64) -> Region {
    let side = (-half_m, half_m);
    Region::surface(side, side, theta_max_deg.to_radians())
}

fn ray(x_m: f64, y_m: f64, theta_deg: f64, phi_deg: f64) -> Ray {
    Ray { x_m, y_m, theta_rad: theta_deg.to_radians(), phi_rad: phi_deg.to_radians() }
}

/// (1/T) ∫ L dT, by so many rays between points of the pupil and of the spot: their geometry
/// written out in the sample's frame, dT = cos cos dA dA / r².
fn read(beam: &Beam, ray: &Ray, rays: usize, field: &dyn Fn(&Ray) -> f64) -> f64 {
    let axis = unit(ray.theta_rad, ray.phi_rad);
    let side = unit(FRAC_PI_2, ray.phi_rad + FRAC_PI_2);
    let down = side.cross(axis);
    let h = beam.separation_m();
    let centre = scenes_place(ray);
    let mut sobol = Sobol::<4>::new().unwrap();
    let (mut sum, mut whole) = (0.0, 0.0);
    for _ in 0..rays {
        let t = sobol.next_point().map(|bits| (f64::from(bits) + 0.5) * 2f64.powi(-32));
        let on_disk = |square: f64, turn: f64| {
            let (sin, cos) = (TAU * turn).sin_cos();
            (down * cos + side * sin) * square.sqrt()
        };
        let spot = centre + on_disk(t[0], t[1]) * beam.stop_radius_m();
        let pupil = centre + axis * h + on_disk(t[2], t[3]) * beam.pupil_radius_m();
        let between = pupil - spot;
        let weight = (h / between.length_squared()).powi(2);
        whole += weight;
        if pupil.z <= 0.0 || between.z <= 0.0 {
            continue;
        }
        let place = spot - between * (spot.z / between.z);
        let (theta_rad, phi_rad) = angles(between);
        sum += weight * field(&Ray { x_m: place.x, y_m: place.y, theta_rad, phi_rad });
    }
    sum / whole
}

fn scenes_place(ray: &Ray) -> glam::DVec3 {
    glam::DVec3::new(ray.x_m, ray.y_m, 0.0)
}

const NOISE: Noise = Noise::Fixed { variance: 1e-4 };

fn samples(rays: &[Ray], value: impl Fn(&Ray) -> f64) -> Vec<Sample> {
    rays.iter().map(|ray| Sample { ray: *ray, value: value(ray), noise: NOISE }).collect()
}

fn rows(fit: &fit::Fit) -> BeamRows {
    fit.beam().expect("a beam was handed in")
}

/// A lobe and a gradient, in the span of degrees 6 and 1, 40 mm wide.
fn lobe(ray: &Ray) -> f64 {
    let (u, cos) = (ray.theta_rad.sin() * ray.phi_rad.cos(), ray.theta_rad.cos());
    10.0 * cos.powi(6) + 2.0 * u + 3.0 + 40.0 * ray.x_m * (1.0 + u) - 25.0 * ray.y_m
}

#[test]
fn a_blurred_field_comes_back_and_the_axis_alone_is_biased() {
    let region = region(0.04, 75.0);
    // A wide beam: ±5°, 20 mm of spot.
    let beam = Beam::of_spot(0.02, 0.01, 0.3).unwrap();
    let basis = BasisSpec::zernike(6, 1);
    let rays = spread_rays(260, &region, 11);
    let read = samples(&rays, |ray| read(&beam, ray, 1 << 13, &lobe));
    let optics = Optics { beam, outline: None };
    let averaged = fit::fit_seen(&read, &region, basis, &[], Some(&optics)).unwrap();
    let point = fit::fit(&read, &region, basis, &[]).unwrap();
    let worst = |fit: &fit::Fit| {
        let rays = spread_rays(200, &region, 12);
        rays.iter().map(|ray| (fit.value(ray) - lobe(ray)).abs()).fold(0.0, f64::max)
    };
    assert!(worst(&averaged) < 0.01, "{} with the beam", worst(&averaged));
    assert!(worst(&point) > 0.05, "{} without", worst(&point));
    assert_eq!(point.beam(), None);
    let rows = rows(&averaged);
    assert_eq!((rows.point, rows.off_sample, rows.point + rows.averaged + rows.cut), (0, 0, 260));
    assert!(rows.quadrature < 0.2, "{rows:?}");
}

#[test]
fn a_field_whose_readings_run_over_the_outline_comes_back_within_its_u() {
    // An emitter of 9 mm radius, measured to 80° over its inner part, with noise.
    let region = region(0.004, 80.0);
    let outline = Outline::Disk { centre_m: (0.0005, -0.0003), radius_m: 0.009 };
    let field = |ray: &Ray| {
        let is_on = (ray.x_m - 0.0005).hypot(ray.y_m + 0.0003) <= 0.009;
        if is_on { 20.0 + 30.0 * ray.theta_rad.cos().powi(4) } else { 0.0 }
    };
    let basis = BasisSpec::zernike(4, 0);
    let rays = spread_rays(300, &region, 21);
    let mut die = Die::new(22);
    let mut read = samples(&rays, |ray| read(&stock(), ray, 1 << 13, &field));
    for sample in &mut read {
        sample.value += 0.01 * die.normal();
    }
    let optics = Optics { beam: stock(), outline: Some(outline) };
    let averaged = fit::fit_seen(&read, &region, basis, &[], Some(&optics)).unwrap();
    let blind =
        fit::fit_seen(&read, &region, basis, &[], Some(&Optics { outline: None, ..optics }));
    let exitance = PI * (20.0 + 30.0 * 2.0 / 6.0);
    let off = |fit: &fit::Fit| fit.exitance().value / exitance - 1.0;
    assert!(off(&averaged).abs() < 2e-3, "{:e} with the outline", off(&averaged));
    let blind = off(&blind.unwrap());
    assert!(blind.abs() > 0.01, "{blind:e} without");
    assert!(rows(&averaged).cut > 50, "{:?}", rows(&averaged));
}

/// Footprints at 80° reach 28 mm beyond a region of ±10 mm, along whichever axis.
#[test]
fn a_slope_that_goes_on_beyond_the_region_is_followed_at_grazing() {
    let region = region(0.01, 80.0);
    let slope = |ray: &Ray| 1.0 + 12.0 * ray.x_m - 5.0 * ray.y_m;
    let places = [-0.01, 0.0, 0.01].map(|x| [-0.01, 0.01].map(|y| (x, y)));
    let turns = [0.0, 72.0, 144.0, 216.0, 288.0];
    let of = |(x, y)| {
        let tilts = [0.0, 40.0, 60.0, 80.0];
        tilts.map(|theta| turns.map(|phi| ray(x, y, theta, phi))).into_iter().flatten()
    };
    let rays: Vec<Ray> = places.into_iter().flatten().flat_map(of).collect();
    let read = samples(&rays, |ray| read(&stock(), ray, 1 << 14, &slope));
    let optics = Optics { beam: stock(), outline: None };
    let basis = BasisSpec::zernike(2, 1);
    let fit = fit::fit_seen(&read, &region, basis, &[], Some(&optics)).unwrap();
    assert_eq!(rows(&fit).cut, 0, "{:?}", rows(&fit));
    let asked = [ray(0.006, 0.006, 72.0, 10.0), ray(-0.01, 0.0, 80.0, 0.0)];
    for ray in asked {
        let off = fit.value(&ray) - slope(&ray);
        assert!(off.abs() < 2e-5, "{off:e} at {ray:?}");
    }
}

#[test]
fn cut_rows_are_the_shares_of_rays_that_leave_the_sample() {
    let basis = BasisSpec::zernike(0, 0);
    let square = Outline::Rectangle { x_m: (-0.02, 0.02), y_m: (-0.015, 0.02) };
    let disk = Outline::Disk { centre_m: (0.003, 0.0), radius_m: 0.02 };
    let places =
        [ray(0.0, 0.0, 85.0, 0.0), ray(0.019, 0.0, 40.0, 0.0), ray(0.018, 0.018, 70.0, 33.0)];
    let more =
        [ray(-0.017, 0.0, 0.0, 0.0), ray(0.0, 0.016, 80.0, -90.0), ray(0.0, 0.0, 88.0, 45.0)];
    for at in places.iter().chain(&more) {
        for outline in [square, disk] {
            let on = |ray: &Ray| f64::from(outline.holds(ray.x_m, ray.y_m));
            let share = read(&stock(), at, RAYS, &on);
            // One reading, one unknown: what a field of 1 is fitted as, is one over the row.
            let one = Sample { ray: *at, value: 1.0, noise: NOISE };
            let optics = Optics { beam: stock(), outline: Some(outline) };
            let region = region(0.021, 90.0);
            let fit = fit::fit_seen(&[one], &region, basis, &[], Some(&optics)).unwrap();
            let found = 1.0 / fit.value(at);
            let close = if at.theta_rad > 1.5 { 2e-3 } else { 3e-4 };
            assert!((found - share).abs() < close, "{found} of {share} at {at:?} on {outline:?}");
        }
    }
}

#[test]
fn rays_from_below_the_horizon_see_nothing() {
    let basis = BasisSpec::zernike(0, 0);
    let optics = Optics { beam: stock(), outline: None };
    let region = region(0.02, 90.0);
    for (theta_deg, low, high) in
        [(90.0, 0.4, 0.5), (89.0, 0.9, 0.999), (87.0, 1.0 - 1e-9, 1.0 + 1e-9)]
    {
        let at = ray(0.0, 0.0, theta_deg, 20.0);
        let one = Sample { ray: at, value: 1.0, noise: NOISE };
        let fit = fit::fit_seen(&[one], &region, basis, &[], Some(&optics)).unwrap();
        let found = 1.0 / fit.value(&at);
        assert!(found > low && found < high, "{found} at {theta_deg}°");
        let share = read(&stock(), &at, RAYS, &|_| 1.0);
        // Every second ray is near the plane: the rules see the half that rises coarsely.
        let close = if theta_deg > 88.5 { 0.02 } else { 2e-3 };
        assert!((found - share).abs() < close, "{found} of {share} at {theta_deg}°");
    }
}

#[test]
fn a_shrinking_beam_ends_in_the_point() {
    let region = region(0.02, 75.0);
    let basis = BasisSpec::zernike(6, 1);
    let rays = spread_rays(200, &region, 31);
    let read = samples(&rays, lobe);
    let point = fit::fit(&read, &region, basis, &[]).unwrap();
    let mut last = f64::INFINITY;
    for shrink in [1.0, 1e-1, 1e-2, 1e-4] {
        let beam = Beam::of_spot(0.006 * shrink, 0.0025 * shrink, 0.3).unwrap();
        let optics = Optics { beam, outline: None };
        let fit = fit::fit_seen(&read, &region, basis, &[], Some(&optics)).unwrap();
        let pairs = fit.coefficients().iter().zip(point.coefficients());
        let off = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < last || off == 0.0, "{off:e} after {last:e} at {shrink}");
        last = off;
        if shrink < 1e-3 {
            assert_eq!(rows(&fit).point, 200, "the point rule is enough for a thread");
        }
    }
    assert!(last < 1e-9, "{last:e}");
}

#[test]
fn the_quadrature_holds_what_it_says() {
    // Exact readings: what remains of a fit that errs within its bound is a part of its u.
    let region = region(0.03, 70.0);
    let field = |ray: &Ray| {
        let (u, v) =
            (ray.theta_rad.sin() * ray.phi_rad.cos(), ray.theta_rad.sin() * ray.phi_rad.sin());
        5.0 + 20.0 * u.powi(5) * v - 10.0 * v.powi(6)
            + 100.0 * ray.x_m * v
            + 2e3 * ray.x_m * ray.y_m
    };
    let basis = BasisSpec::zernike(6, 2);
    let rays = spread_rays(400, &region, 41);
    // Two fine rules of another make, so that their own error is known to be small.
    let rule = stock().rule(9);
    let mean = |ray: &Ray| {
        let placed =
            radiometry::beam::Placed::new(scenes_place(ray), unit(ray.theta_rad, ray.phi_rad));
        rule.mean(|of| {
            let (point, along) = (placed.point(of.point), placed.direction(of.direction));
            let place = point - along * (point.z / along.z);
            let (theta_rad, phi_rad) = angles(along);
            field(&Ray { x_m: place.x, y_m: place.y, theta_rad, phi_rad })
        })
    };
    let read = samples(&rays, mean);
    let optics = Optics { beam: stock(), outline: None };
    for variance in [1e-2, 1e-4, 1e-6, 1e-8] {
        let noise = Noise::Fixed { variance };
        let read: Vec<Sample> = read.iter().map(|sample| Sample { noise, ..*sample }).collect();
        let fit = fit::fit_seen(&read, &region, basis, &[], Some(&optics)).unwrap();
        let rows = rows(&fit);
        assert!(rows.quadrature < 0.2, "{rows:?}");
        for at in spread_rays(100, &region, 42) {
            let found = fit.radiance(&at);
            let off = (found.value - field(&at)).abs() / found.u_independent;
            assert!(off <= rows.quadrature + 1e-6, "{off} u, said {rows:?}");
        }
    }
}

#[test]
fn a_constant_is_a_constant_inside_whatever_the_rule() {
    let region = region(0.02, 80.0);
    let basis = BasisSpec::zernike(5, 2);
    let read = samples(&spread_rays(300, &region, 51), |_| 7.0);
    let optics = Optics { beam: stock(), outline: None };
    let fit = fit::fit_seen(&read, &region, basis, &[], Some(&optics)).unwrap();
    for at in spread_rays(50, &region, 52) {
        assert!((fit.value(&at) - 7.0).abs() < 1e-5, "{} at {at:?}", fit.value(&at));
    }
    assert!(fit.residual_rms() < 1e-5);
}

#[test]
fn an_offset_of_cut_readings_is_no_constant_field() {
    let region = region(0.004, 80.0);
    let outline = Some(Outline::Disk { centre_m: (0.0, 0.0), radius_m: 0.006 });
    let optics = Optics { beam: stock(), outline };
    let rays = spread_rays(60, &region, 61);
    let on = |ray: &Ray| f64::from(ray.x_m.hypot(ray.y_m) <= 0.006);
    let read = samples(&rays, |ray| read(&stock(), ray, 1 << 13, &on));
    let basis = BasisSpec::zernike(1, 0);
    let offset = |u: f64| {
        let shifted: Vec<Sample> =
            read.iter().map(|s| Sample { value: s.value + u, ..*s }).collect();
        let dark = Common { name: "dark".into(), u: 1e-3, shift: Shift::Offset };
        fit::fit_seen(&shifted, &region, basis, &[dark], Some(&optics)).unwrap()
    };
    let (without, with) = (offset(0.0), offset(1e-3));
    let change = with.exitance().value - without.exitance().value;
    let stated = without.contributions()[1].u;
    assert!((change / stated - 1.0).abs() < 1e-6, "{change} beside {stated}");
    assert!(change > 1.02 * PI * 1e-3);
}

#[test]
fn an_outline_without_area_is_refused() {
    let region = region(0.004, 80.0);
    let basis = BasisSpec::zernike(0, 0);
    let read = samples(&spread_rays(4, &region, 71), |_| 1.0);
    let nan = Outline::Disk { centre_m: (0.0, f64::NAN), radius_m: 1.0 };
    let flat = Outline::Rectangle { x_m: (0.0, 1.0), y_m: (1.0, 1.0) };
    for outline in [nan, flat] {
        let optics = Optics { beam: stock(), outline: Some(outline) };
        let refusal = fit::fit_seen(&read, &region, basis, &[], Some(&optics)).unwrap_err();
        assert_eq!(refusal, fit::FitError::Outline);
    }
}

/// One u of the spot's radius, 4 %, and what the throughput grows by.
fn wider_spot() -> (Beam, f64) {
    let wide = Beam::of_spot(0.00625, 0.0026, 0.3).unwrap();
    let of = |beam: &Beam| beam.throughput().unwrap().m2_sr();
    (wide, of(&wide) / of(&stock()) - 1.0)
}

fn spot_off() -> Common {
    let (wide, u) = wider_spot();
    Common { name: "throughput @ spot".into(), u, shift: Shift::Beam(wide) }
}

#[test]
fn a_spot_that_is_wider_than_stated_shifts_the_fit_as_its_component_says() {
    // A stripe of light about as wide as the spot, fitted in a basis that follows it.
    let region = region(0.01, 60.0);
    let stripe = |ray: &Ray| 1.0 + libm::exp(-(ray.x_m / 0.004).powi(2));
    let basis = BasisSpec::zernike(0, 8);
    let rays = spread_rays(300, &region, 4);
    let optics = Optics { beam: stock(), outline: None };
    let (wide, u) = wider_spot();
    let through = |beam: &Beam| -> Vec<f64> {
        rays.iter().map(|ray| read(beam, ray, 1 << 13, &stripe)).collect()
    };
    let fitted = |values: &[f64]| {
        let noise = Noise::Fixed { variance: 1e-8 };
        let all = rays.iter().zip(values);
        let all: Vec<Sample> =
            all.map(|(ray, value)| Sample { ray: *ray, value: *value, noise }).collect();
        fit::fit_seen(&all, &region, basis, &[spot_off()], Some(&optics)).unwrap()
    };
    let plain = fitted(&through(&stock()));
    let off: Vec<f64> = through(&wide).iter().map(|value| (1.0 + u) * value).collect();
    let off = fitted(&off);
    for x_m in [0.0, 0.002, 0.004, 0.006] {
        let at = ray(x_m, 0.001, 20.0, 40.0);
        let stated = plain.radiance_contributions(&at)[1].u;
        let found = off.value(&at) - plain.value(&at);
        assert!((found.abs() / stated - 1.0).abs() < 0.03, "{x_m}: {found} {stated}");
    }
    // At the top what the wider footprint blurs away takes from what the throughput adds.
    let top = ray(0.0, 0.001, 20.0, 40.0);
    let part = plain.radiance_contributions(&top)[1].u / (u * plain.value(&top));
    assert!(part < 0.97, "{part}");
    // Without the scale that is common to all, the blur stays, and no less than what is independent.
    let shape = plain.without_scale(&["throughput @ spot"]);
    assert!(shape.exitance().u < 1e-9 + 1.0001 * plain.exitance().u_independent);
    for x_m in [0.0, 0.002, 0.004, 0.006] {
        let at = ray(x_m, 0.001, 20.0, 40.0);
        let (with, without) = (plain.radiance(&at), shape.radiance(&at));
        assert!(without.u >= without.u_independent && without.u < with.u, "{x_m}: {without:?}");
        assert!((without.u_independent / with.u_independent - 1.0).abs() < 1e-12);
    }
    assert!(shape.radiance(&top).u > 2.0 * shape.radiance(&top).u_independent);
}

#[test]
fn of_a_source_within_the_spot_the_spots_size_does_not_matter() {
    let region = region(0.0, 30.0);
    let outline = Some(Outline::Disk { centre_m: (0.0, 0.0), radius_m: 0.001 });
    let optics = Optics { beam: stock(), outline };
    let rays: Vec<Ray> = (0..8).map(|i| ray(0.0, 0.0, 3.0 * f64::from(i), 0.0)).collect();
    let even = |ray: &Ray| {
        read(&stock(), ray, 1 << 14, &|seen| {
            f64::from(u8::from(libm::hypot(seen.x_m, seen.y_m) < 0.001))
        })
    };
    let samples = samples(&rays, even);
    let fit = |optics| {
        let basis = BasisSpec::zernike(0, 0);
        fit::fit_seen(&samples, &region, basis, &[spot_off()], optics).unwrap()
    };
    let (_, u) = wider_spot();
    let of_spot = |fit: &fit::Fit| fit.contributions()[1].u / (u * fit.exitance().value);
    // To the coarsest rule's error for so small a source.
    assert!(of_spot(&fit(Some(&optics))) < 0.05, "{}", of_spot(&fit(Some(&optics))));
    // Who knows nothing of beams takes it for a scale.
    assert!((of_spot(&fit(None)) - 1.0).abs() < 1e-9, "{}", of_spot(&fit(None)));
}

/// 3.5 mm at half height, under a spot of 5 mm: more than a polynomial of degree 8 in the place follows.
#[test]
fn a_line_narrower_than_the_spot_is_found_by_splines_of_the_place() {
    let region = region(0.012, 50.0);
    let line = |ray: &Ray| 0.1 + 0.9 * libm::exp(-0.5 * (ray.x_m / 0.0015).powi(2));
    let place = |i: usize, count: usize| 0.024 * ((i as f64 + 0.5) / count as f64 - 0.5);
    let places = (0..15 * 7).map(|i| (place(i % 15, 15), place(i / 15, 7)));
    let directions = [(0.0, 0.0), (25.0, 30.0), (50.0, 150.0)];
    let rays: Vec<Ray> =
        places.flat_map(|(x, y)| directions.map(|(theta, phi)| ray(x, y, theta, phi))).collect();
    let mut die = Die::new(31);
    let mut seen = samples(&rays, |ray| read(&stock(), ray, 1 << 10, &line));
    for sample in &mut seen {
        sample.value += 0.002 * die.normal();
        sample.noise = Noise::Fixed { variance: 4e-6 };
    }
    let optics = Optics { beam: stock(), outline: None };
    let off = |wish: &Wish| {
        let (model, _) = fit::choose(&seen, &region, wish, Some(&optics)).unwrap();
        let fit = fit::fit_seen(&seen, &region, model, &[], Some(&optics)).unwrap();
        let rays = spread_rays(300, &region, 32);
        let squares = rays.iter().map(|ray| (fit.value(ray) - line(ray)).powi(2));
        (model.basis.position, (squares.sum::<f64>() / 300.0).sqrt())
    };
    let even = Wish {
        kind: Some(AngularKind::Spherical),
        angular_degree: Some(0),
        penalty_power: Some(2.0),
        ..Wish::default()
    };
    let (position, found) = off(&even);
    assert!(matches!(position, Position::Splines { .. }), "{position:?}");
    let (_, blurred) = off(&Wish { position_degree: Some(8), ..even });
    assert!(found < 0.03 && found < blurred / 4.0, "{found} {blurred}");
    // Seven places along y tell no more than seven functions where nothing is held against any.
    let free = Wish { penalty_power: None, ..even };
    assert!(off(&free).1 < blurred);
}
