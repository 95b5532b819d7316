//! A basis is judged by meridians that it was not fitted to: of plans that fly each meridian at every
//! place, readings at another place give those of the same meridian away.

#[allow(dead_code, reason = "tests share them")]
mod scenes;

use fit::{Choice, Fit, Noise, Ray, Region, Sample, Wish};
use scenes::{Die, raster_rays, spread_rays};
use std::f64::consts::PI;

const CONE: Region = Region::surface((-0.01, 0.01), (-0.01, 0.01), 80.0 * PI / 180.0);
const U: f64 = 1e-3;

/// The same all round, brightest on a ring.
fn ring(ray: &Ray) -> f64 {
    0.3 + libm::exp(-0.5 * ((ray.theta_rad - 0.9) / 0.25).powi(2))
}

fn noisy(rays: &[Ray], field: impl Fn(&Ray) -> f64) -> Vec<Sample> {
    let mut die = Die::new(3);
    let noise = Noise::Fixed { variance: U * U };
    let sample = |ray: &Ray| Sample { ray: *ray, value: field(ray) + U * die.normal(), noise };
    rays.iter().map(sample).collect()
}

/// RMS error over the cone, and RMS of error over u.
fn errors(fit: &Fit, field: impl Fn(&Ray) -> f64) -> (f64, f64) {
    let rays = spread_rays(500, &CONE, 9);
    let (mut squares, mut ratios) = (0.0, 0.0);
    for ray in &rays {
        let found = fit.radiance(ray);
        let off = found.value - field(ray);
        squares += off * off;
        ratios += (off / found.u).powi(2);
    }
    let n = rays.len() as f64;
    ((squares / n).sqrt(), (ratios / n).sqrt())
}

/// Two lobes at the horizon, off the meridians.
fn lobes(ray: &Ray) -> f64 {
    let towards = |phi_rad: f64| libm::sin(ray.theta_rad) * libm::cos(ray.phi_rad - phi_rad);
    0.3 + libm::exp(8.0 * (towards(0.4) - 1.0)) + libm::exp(8.0 * (towards(PI + 0.4) - 1.0))
}

fn chosen(samples: &[Sample], wish: &Wish) -> (Fit, Choice) {
    let (model, choice) = fit::choose(samples, &CONE, wish, None).unwrap();
    let fit = fit::fit(samples, &CONE, model, &[]).unwrap();
    (fit.with_truncation(samples, &[], &[], None).unwrap(), choice.unwrap())
}

#[test]
fn a_ring_is_followed_between_the_meridians_that_all_places_share() {
    for (spokes, side) in [(8, 2), (8, 3), (12, 2)] {
        let samples = noisy(&raster_rays(&CONE, 17, spokes, side), ring);
        let (fit, choice) = chosen(&samples, &Wish::default());
        // A meridian and the one across are one line.
        assert_eq!((choice.n_sweeps, choice.n_lines), (spokes / 2 * side * side, Some(spokes / 2)));
        let (rms, ratio) = errors(&fit, ring);
        // Sweeps left out one by one led to six times as much.
        assert!(rms < U && (0.5..1.5).contains(&ratio), "{spokes} x {side}: {rms} {ratio}");
    }
}

#[test]
fn too_few_meridians_are_told_by_what_is_left_out() {
    let samples = noisy(&raster_rays(&CONE, 17, 8, 3), lobes);
    let (fit, choice) = chosen(&samples, &Wish::default());
    let (rms, _) = errors(&fit, lobes);
    assert!(rms > 10.0 * U, "enough meridians: {rms}");
    assert!(choice.candidates[0].left_out_rms > 10.0, "{}", choice.candidates[0].left_out_rms);
    // Of two lines none can be left out, and u covers what it can't know: of what goes round four
    // times nothing was seen at all.
    for field in [ring, |ray: &Ray| ring(ray) * (1.0 + 0.3 * libm::cos(4.0 * ray.phi_rad))] {
        let samples = noisy(&raster_rays(&CONE, 17, 4, 3), field);
        let (fit, choice) = chosen(&samples, &Wish::default());
        let (_, ratio) = errors(&fit, field);
        assert!(ratio < 1.5 && choice.n_lines.is_none(), "{ratio}");
    }
}

#[test]
fn where_a_line_less_determines_nothing_sweeps_are_left_out_one_by_one() {
    let slope = |ray: &Ray| {
        (1.0 + 20.0 * ray.x_m) * (1.0 + 0.1 * libm::sin(ray.theta_rad) * libm::cos(ray.phi_rad))
    };
    let plain = Wish { angular_degree: Some(1), ..Wish::default() };
    let samples = noisy(&raster_rays(&CONE, 9, 4, 3), slope);
    let (fit, choice) = chosen(&samples, &plain);
    assert_eq!((fit.basis().position.degree(), choice.n_lines), (Some(1), None));
    // Of eight meridians, degree 3 needs seven.
    let plain = Wish { angular_degree: Some(3), ..plain };
    let samples = noisy(&raster_rays(&CONE, 9, 8, 3), slope);
    let (fit, choice) = chosen(&samples, &plain);
    assert_eq!((fit.basis().position.degree(), choice.n_lines), (Some(1), None));
}
