//! The stated uncertainty is the one that repeated measurement shows, and what is common to all
//! samples shifts the fit as it would if the samples were taken again.

#[allow(dead_code)]
mod scenes;

use fit::{BasisSpec, Common, Fit, Noise, Ray, Sample, Shift};
use scenes::{Die, REGION, exact, raster_rays, scaled, spread_rays};
use std::f64::consts::PI;

const BASIS: BasisSpec = BasisSpec::zernike(4, 1);
const SEEDS: u64 = 200;

/// A polynomial lobe on a floor, from 30 at the normal to about 4 at the rim.
fn lobe(ray: &Ray) -> f64 {
    let c2 = libm::cos(ray.theta_rad).powi(2);
    let (x, _) = scaled(ray);
    0.5 + 30.0 * c2 * c2 + 3.0 * (1.0 + 0.5 * x) * (1.0 - c2)
}

/// ∫ 1 -> π, cos⁴ -> π/3, sin² -> π/2 under the projected solid angle; x has no mean.
const LOBE_EXITANCE: f64 = PI * (0.5 + 10.0 + 1.5);

/// Gaussian noise of the modelled variance at the true level.
fn noisy(rays: &[Ray], floor: f64, per_radiance: f64, die: &mut Die) -> Vec<Sample> {
    let noise = Noise::Modelled { floor, per_radiance };
    let sample = |ray: &Ray| {
        let level = lobe(ray);
        let sigma = (floor + per_radiance * level).sqrt();
        Sample { ray: *ray, value: level + sigma * die.normal(), noise }
    };
    rays.iter().map(sample).collect()
}

/// Root mean square and mean of (exitance - truth)/u and the mean relative error, over the seeds.
fn exitance_over_seeds(rays: &[Ray], floor: f64, per_radiance: f64) -> (f64, f64, f64) {
    let (mut squares, mut sum, mut relative) = (0.0, 0.0, 0.0);
    for seed in 0..SEEDS {
        let samples = noisy(rays, floor, per_radiance, &mut Die::new(seed));
        let field = fit::fit(&samples, &REGION, BASIS, &[]).unwrap();
        let exitance = field.exitance();
        let z = (exitance.value - LOBE_EXITANCE) / exitance.u;
        squares += z * z;
        sum += z;
        relative += exitance.value / LOBE_EXITANCE - 1.0;
    }
    let n = SEEDS as f64;
    ((squares / n).sqrt(), sum / n, relative / n)
}

#[test]
fn the_exitance_scatters_as_its_u_says() {
    for rays in [spread_rays(400, &REGION, 1), raster_rays(&REGION, 9, 12, 2)] {
        let (rms, mean, _) = exitance_over_seeds(&rays, 1e-3, 1e-2);
        assert!((0.9..=1.1).contains(&rms), "rms of z: {rms}");
        assert!(mean.abs() < 3.0 / (SEEDS as f64).sqrt(), "mean of z: {mean}");
    }
}

#[test]
fn radiance_at_any_ray_scatters_as_its_u_says() {
    let rays = spread_rays(300, &REGION, 2);
    let probes = spread_rays(20, &REGION, 3);
    let mut squares = 0.0;
    for seed in 0..SEEDS {
        let samples = noisy(&rays, 1e-2, 1e-2, &mut Die::new(1000 + seed));
        let field = fit::fit(&samples, &REGION, BASIS, &[]).unwrap();
        for probe in &probes {
            let found = field.radiance(probe);
            squares += ((found.value - lobe(probe)) / found.u).powi(2);
        }
    }
    let rms = (squares / (SEEDS as f64 * probes.len() as f64)).sqrt();
    assert!((0.9..=1.1).contains(&rms), "rms of z: {rms}");
}

/// Poisson numbers (Knuth's product), so that a low count is low in its own variance too.
fn poisson(mean: f64, die: &mut Die) -> f64 {
    let limit = libm::exp(-mean);
    let (mut count, mut product) = (0.0, die.uniform());
    while product > limit {
        count += 1.0;
        product *= die.uniform();
    }
    count
}

#[test]
fn few_photons_do_not_bias_the_flux() {
    // 0.5 to 30 counts a reading. Weights of 1/count would bias by about one count in ten.
    let rays = spread_rays(400, &REGION, 4);
    let noise = Noise::Modelled { floor: 0.05, per_radiance: 1.0 };
    let (mut sum, mut u_squares) = (0.0, 0.0);
    for seed in 0..SEEDS / 2 {
        let mut die = Die::new(2000 + seed);
        let sample = |ray: &Ray| Sample { ray: *ray, value: poisson(lobe(ray), &mut die), noise };
        let samples: Vec<Sample> = rays.iter().map(sample).collect();
        let exitance = fit::fit(&samples, &REGION, BASIS, &[]).unwrap().exitance();
        sum += exitance.value / LOBE_EXITANCE - 1.0;
        u_squares += (exitance.u / LOBE_EXITANCE).powi(2);
    }
    let n = (SEEDS / 2) as f64;
    let (bias, u) = (sum / n, (u_squares / n).sqrt());
    assert!(bias.abs() < 0.25 * u, "bias {bias:.5} of a relative u of {u:.5}");
    assert!(bias.abs() < 0.005, "bias {bias:.5}");
}

#[test]
fn scatter_beyond_the_stated_noise_widens_u() {
    // Noise ten times as large as stated: u follows the residuals, and says that it does.
    let rays = spread_rays(400, &REGION, 5);
    let mut squares = 0.0;
    for seed in 0..SEEDS {
        let mut samples = noisy(&rays, 1.0, 0.0, &mut Die::new(3000 + seed));
        for sample in &mut samples {
            sample.noise = Noise::Fixed { variance: 1e-2 };
        }
        let field = fit::fit(&samples, &REGION, BASIS, &[]).unwrap();
        assert!((field.excess_rms() - 1.0).abs() < 0.2, "{}", field.excess_rms());
        assert!(field.chi2() / field.dof() as f64 > 50.0);
        let exitance = field.exitance();
        squares += ((exitance.value - LOBE_EXITANCE) / exitance.u).powi(2);
    }
    let rms = (squares / SEEDS as f64).sqrt();
    assert!((0.9..=1.1).contains(&rms), "rms of z: {rms}");
}

#[test]
fn unknown_noise_is_told_by_the_residuals() {
    let rays = spread_rays(400, &REGION, 6);
    let mut samples = noisy(&rays, 0.09, 0.0, &mut Die::new(1));
    let stated = fit::fit(&samples, &REGION, BASIS, &[]).unwrap();
    for sample in &mut samples {
        sample.noise = Noise::Unknown;
    }
    let found = fit::fit(&samples, &REGION, BASIS, &[]).unwrap();
    assert!((found.excess_rms() / 0.3 - 1.0).abs() < 0.1, "{}", found.excess_rms());
    assert!((found.exitance().u / stated.exitance().u - 1.0).abs() < 0.1);
    assert!((found.exitance().value - stated.exitance().value).abs() < 1e-10);
    assert!((found.chi2() / found.dof() as f64 - 1.0).abs() < 1e-6);
}

#[test]
fn u_grows_where_nothing_was_measured() {
    let mut cone = REGION;
    cone.theta_max_rad = 0.9;
    let field = fit::fit(&exact(&spread_rays(400, &cone, 7), lobe), &REGION, BASIS, &[]).unwrap();
    let at = |theta_rad| field.radiance(&Ray { x_m: 0.0, y_m: 0.015, theta_rad, phi_rad: 1.0 }).u;
    assert!(at(1.5) > 5.0 * at(0.5));
}

#[test]
fn rays_that_are_off_each_on_its_own_are_in_every_u() {
    // An encoder of 0.3°, next to which the noise is nothing: where the lobe is steep, readings
    // scatter by it, on the normal and at the rim they don't.
    let rays = spread_rays(300, &REGION, 11);
    let off = 0.005;
    let mut squares = 0.0;
    for seed in 0..SEEDS {
        let mut die = Die::new(4000 + seed);
        let seen = |ray: &Ray, die: &mut Die| {
            let theta_rad = (ray.theta_rad + off * die.normal()).clamp(0.0, PI / 2.0);
            Ray { theta_rad, ..*ray }
        };
        let noise = Noise::Fixed { variance: 1e-4 };
        let sample = |ray: &Ray| {
            let value = lobe(&seen(ray, &mut die)) + 0.01 * die.normal();
            Sample { ray: *ray, value, noise }
        };
        let samples: Vec<Sample> = rays.iter().map(sample).collect();
        let moved = move |_: usize, ray: &Ray| Ray { theta_rad: ray.theta_rad - off, ..*ray };
        let encoder =
            Common { name: "encoder".into(), u: off, shift: Shift::Jitter(Box::new(moved)) };
        let field = with_common(&samples, encoder);
        assert!(field.parts().shifts.is_empty(), "it shifts nothing in common");
        let chi2 = field.chi2() / field.dof() as f64;
        assert!((0.6..1.5).contains(&chi2), "chi2 a degree of freedom: {chi2}");
        squares += ((field.exitance().value - LOBE_EXITANCE) / field.exitance().u).powi(2);
    }
    let rms = (squares / SEEDS as f64).sqrt();
    assert!((0.9..=1.1).contains(&rms), "rms of z: {rms}");
}

#[test]
fn the_influences_of_the_samples_make_up_the_independent_variance() {
    let rays = spread_rays(300, &REGION, 13);
    let samples = noisy(&rays, 1e-3, 1e-2, &mut Die::new(5));
    let field = fit::fit(&samples, &REGION, BASIS, &[]).unwrap();
    let influence = field.influence().unwrap();
    assert!(influence.excess.abs() < f64::MIN_POSITIVE);
    let variance: f64 = influence
        .exitance
        .iter()
        .zip(&samples)
        .map(|(g, s)| g * g * (1e-3 + 1e-2 * field.value(&s.ray).max(0.0)))
        .sum();
    let u = field.exitance().u_independent;
    assert!((variance.sqrt() / u - 1.0).abs() < 1e-2, "{} {u}", variance.sqrt());
    // And they are what a sample's value does.
    let expected = brute_force(&samples, |i, _| f64::from(u8::from(i == 7)));
    let of_value = expected[0] * PI.sqrt();
    assert!((influence.exitance[7] / of_value - 1.0).abs() < 0.05, "{of_value}");
}

#[test]
fn components_that_differ_by_a_place_alone_share_a_row_of_the_budget() {
    let samples = exact(&spread_rays(300, &REGION, 12), lobe);
    let of_place = |place: usize, excess: f64| Common {
        name: format!("readback @ {place}"),
        u: 1.0,
        shift: Shift::Value(Box::new(move |i, _| if i % 2 == place { excess } else { 0.0 })),
    };
    let alone = |place, excess| with_common(&samples, of_place(place, excess)).contributions()[1].u;
    let both = fit::fit(&samples, &REGION, BASIS, &[of_place(0, 0.3), of_place(1, 0.4)]).unwrap();
    let budget = both.contributions();
    assert_eq!(budget.len(), 2);
    assert_eq!(budget[1].name, "readback");
    assert!((budget[1].u - alone(0, 0.3).hypot(alone(1, 0.4))).abs() < 1e-12);
}

fn brute_force(samples: &[Sample], change: impl Fn(usize, &Sample) -> f64) -> Vec<f64> {
    let fitted = |samples: &[Sample]| fit::fit(samples, &REGION, BASIS, &[]).unwrap();
    let shifted = |(i, s): (usize, &Sample)| Sample { value: s.value + change(i, s), ..*s };
    let moved: Vec<Sample> = samples.iter().enumerate().map(shifted).collect();
    let (before, after) = (fitted(samples), fitted(&moved));
    before.coefficients().iter().zip(after.coefficients()).map(|(a, b)| b - a).collect()
}

fn with_common(samples: &[Sample], common: Common) -> Fit {
    fit::fit(samples, &REGION, BASIS, &[common]).unwrap()
}

fn assert_same(found: &Fit, expected: &[f64]) {
    for (a, b) in found.parts().shifts[0].shift.iter().zip(expected) {
        assert!((a - b).abs() < 1e-11, "{a} {b}");
    }
}

#[test]
fn common_components_shift_the_fit_as_refitting_does() {
    let samples = exact(&spread_rays(300, &REGION, 8), lobe);
    let common = |shift, u| Common { name: "it".into(), u, shift };
    let scale = with_common(&samples, common(Shift::Scale, 0.03));
    assert_same(&scale, &brute_force(&samples, |_, s| 0.03 * s.value));
    assert!((scale.exitance().u / scale.exitance().value - 0.03).abs() < 1e-4);
    let offset = with_common(&samples, common(Shift::Offset, 0.2));
    assert_same(&offset, &brute_force(&samples, |_, _| 0.2));
    // One gain range's factor: it holds for every third sample.
    let gain = |i: usize, level: f64| if i.is_multiple_of(3) { 0.01 * level } else { 0.0 };
    let range = with_common(&samples, common(Shift::Value(Box::new(gain)), 0.01));
    assert_same(&range, &brute_force(&samples, |i, s| gain(i, s.value)));
    // The arm's zero is off by 0.2°.
    let arm = |_: usize, ray: &Ray| Ray { theta_rad: ray.theta_rad + 0.0035, ..*ray };
    let zero = with_common(&samples, common(Shift::Ray(Box::new(arm)), 0.2));
    assert_same(&zero, &brute_force(&samples, |i, s| lobe(&arm(i, &s.ray)) - s.value));
    assert!(zero.exitance().u > 10.0 * zero.exitance().u_independent);
}

#[test]
fn common_components_do_not_average_out() {
    let u = |count| {
        let samples = exact(&spread_rays(count, &REGION, 9), lobe);
        let scale = Common { name: "responsivity".into(), u: 0.01, shift: Shift::Scale };
        with_common(&samples, scale).exitance()
    };
    let (few, many) = (u(200), u(3200));
    assert!((few.u_independent / many.u_independent - 4.0).abs() < 0.6);
    assert!(many.u > 0.01 * LOBE_EXITANCE);
}

#[test]
fn an_offset_and_a_scale_are_told_apart_in_the_budget() {
    let samples = exact(&spread_rays(300, &REGION, 10), lobe);
    let common = [
        Common { name: "responsivity".into(), u: 0.01, shift: Shift::Scale },
        Common { name: "dark".into(), u: 0.02, shift: Shift::Offset },
    ];
    let field = fit::fit(&samples, &REGION, BASIS, &common).unwrap();
    let budget = field.contributions();
    let names: Vec<&str> = budget.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["independent", "responsivity", "dark"]);
    assert!((budget[1].u - 0.01 * LOBE_EXITANCE).abs() < 1e-10);
    assert!((budget[2].u - 0.02 * PI).abs() < 1e-12);
}
