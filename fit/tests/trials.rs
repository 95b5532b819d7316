//! Propagation of distributions against the law of propagation, and against what is known of numbers
//! that aren't linear.

use fit::trials::Spread;
use fit::{
    BasisSpec, Common, Estimate, Fit, FitError, Functional, Noise, Penalised, Penalty, Ray,
    Readings, Region, Sample, Shift,
};
use radiometry::direction::unit;
use rand_core::Rng;
use rand_pcg::Pcg64;
use std::f64::consts::FRAC_PI_2;

/// Standard normal deviates (Box, Muller 1958).
fn normals(seed: u64) -> impl FnMut() -> f64 {
    let mut generator = Pcg64::new(u128::from(seed) << 64 | 0x9e37_79b9, 7);
    let mut uniform = move || (generator.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let mut spare = None;
    move || {
        spare.take().unwrap_or_else(|| {
            let radius = (-2.0 * (1.0 - uniform()).ln()).sqrt();
            let (sin, cos) = (std::f64::consts::TAU * uniform()).sin_cos();
            spare = Some(radius * sin);
            radius * cos
        })
    }
}

const REGION: Region = Region::surface((-0.01, 0.01), (-0.01, 0.01), 1.3);

/// A tilted broad lobe, with noise by the dice.
fn samples(u: f64, normal: &mut dyn FnMut() -> f64) -> Vec<Sample> {
    let mut samples = Vec::new();
    for ring in 0..14 {
        for spoke in 0..10 {
            let (theta_rad, phi_rad) = (0.1 * f64::from(ring), f64::from(spoke) * 0.628_32);
            let (sin, cos) = theta_rad.sin_cos();
            let towards = cos * 0.9 + sin * phi_rad.cos() * 0.436;
            let value = 100.0 * towards.max(0.0).powi(2) + u * normal();
            let ray = Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad };
            samples.push(Sample { ray, value, noise: Noise::Fixed { variance: u * u } });
        }
    }
    samples
}

fn common() -> Vec<Common> {
    let dark = Shift::Value(Box::new(|i, _| if i % 2 == 0 { 0.3 } else { 0.1 }));
    let zero = Shift::Ray(Box::new(|_, ray| Ray { theta_rad: ray.theta_rad + 2e-3, ..*ray }));
    vec![
        Common { name: "responsivity".into(), u: 0.007, shift: Shift::Scale },
        Common { name: "dark".into(), u: 0.3, shift: dark },
        Common { name: "theta zero".into(), u: 2e-3, shift: zero },
    ]
}

/// Half a unit of the second digit of u.
fn half_a_unit(u: f64) -> f64 {
    0.5 * 10_f64.powf(u.log10().floor() - 1.0)
}

/// Whether both ends of the intervals agree within half a unit of u's second digit.
fn assert_agree(what: &str, estimate: Estimate, spread: &Spread) {
    let Estimate { value, u, .. } = estimate;
    let tolerance = half_a_unit(u);
    // The test can tell: the ends are known to half of what they may differ by.
    assert!(2.0 * spread.end_sd < tolerance, "{what}: {} {tolerance}", spread.end_sd);
    for (end, sign) in [(spread.symmetric.low, -1.0), (spread.symmetric.high, 1.0)] {
        let expected = value + sign * 1.959_964 * u;
        assert!((end - expected).abs() < tolerance, "{what}: {end} {expected} {tolerance}");
    }
}

fn spreads(fit: &Fit, readings: &Readings<'_>, of: &[Functional], count: usize) -> Vec<Spread> {
    let mut all = vec![Vec::new(); of.len()];
    fit.trials(readings, None).unwrap().run(count, &mut normals(3), &mut |trial| {
        all.iter_mut().zip(of).for_each(|(all, functional)| all.push(trial.of(functional)));
    });
    all.into_iter().map(|trials| Spread::of(trials).unwrap()).collect()
}

fn asked(fit: &Fit) -> (Vec<Functional>, Vec<Estimate>) {
    let steep = Ray { x_m: 0.005, y_m: 0.0, theta_rad: 1.2, phi_rad: 0.4 };
    let of = vec![
        fit.exitance_sum(),
        fit.flux_sum(),
        fit.mean_towards(0.0, 0.0),
        fit.weighted_rays([(steep, 1.0)]),
    ];
    let estimates = of.iter().map(|functional| fit.of(functional)).collect();
    (of, estimates)
}

/// An end of a normal number's interval is then known to 2.67 u/√N = 0.0032 u. Half a unit of the
/// second digit of u is 0.0050 u where u begins with 99, and 0.050 u where it begins with 10.
const TRIALS: usize = 700_000;

#[test]
fn ends_of_linear_quantities_agree_to_half_a_unit_of_us_second_digit() {
    let (samples, common) = (samples(0.5, &mut normals(1)), common());
    let readings = Readings { common: &common, ..Readings::of(&samples) };
    let fit = fit::fit_readings(&readings, &REGION, BasisSpec::zernike(4, 0), None).unwrap();
    let (of, estimates) = asked(&fit);
    let found = spreads(&fit, &readings, &of, TRIALS);
    for ((k, estimate), spread) in estimates.into_iter().enumerate().zip(&found) {
        assert_agree(&k.to_string(), estimate, spread);
        // Linear and normal: the shortest interval is the symmetric one, but flat at its least.
        assert!((spread.shortest.low - spread.symmetric.low).abs() < 0.1 * estimate.u);
    }
}

#[test]
fn a_penalty_and_what_is_fitted_along_are_drawn_as_well() {
    let (samples, mut common) = (samples(0.5, &mut normals(1)), common());
    let nuisances = vec![common.remove(1)];
    let readings = Readings { common: &common, nuisances: &nuisances, ..Readings::of(&samples) };
    let model = Penalised::new(BasisSpec::zernike(6, 0), Penalty { power: 2.0, strength: 1e-3 });
    let fit = fit::fit_readings(&readings, &REGION, model, None).unwrap();
    let (of, estimates) = asked(&fit);
    let found = spreads(&fit, &readings, &of, 20_000);
    for (estimate, spread) in estimates.into_iter().zip(&found) {
        let ratio = spread.u / estimate.u;
        // A standard deviation of 20 000 trials is known to 0.5 %.
        assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
        assert!((spread.mean - estimate.value).abs() < 0.03 * estimate.u);
    }
}

#[test]
fn a_peak_is_higher_and_scatters_as_noisy_refits_do() {
    let u = 2.0;
    let quiet = samples(u, &mut || 0.0);
    let basis = BasisSpec::zernike(4, 0);
    let readings = Readings::of(&quiet);
    let fit = fit::fit_readings(&readings, &REGION, basis, None).unwrap();
    let top = fit.peak();
    let mut by_trial = (Vec::new(), Vec::new());
    let mut excess = Vec::new();
    fit.trials(&readings, None).unwrap().run(2000, &mut normals(5), &mut |trial| {
        let peak = trial.peak();
        by_trial.0.push(peak.radiance);
        excess.push(peak.radiance - trial.radiance(&top.ray));
        by_trial.1.push(peak.ray.theta_rad);
    });
    // Independently: the readings themselves with noise, fitted and searched from the start.
    let mut by_refit = (Vec::new(), Vec::new());
    let mut normal = normals(11);
    for _ in 0..400 {
        let noisy = samples(u, &mut normal);
        let peak = fit::fit(&noisy, &REGION, basis, &[]).unwrap().peak();
        by_refit.0.push(peak.radiance.value);
        by_refit.1.push(peak.ray.theta_rad);
    }
    let spread = |values: Vec<f64>| Spread::of(values).unwrap();
    let (trial, refit) = (spread(by_trial.0), spread(by_refit.0));
    let (trial_theta, refit_theta) = (spread(by_trial.1), spread(by_refit.1));
    // A standard deviation of 400 is known to 3.5 %, their mean to 0.05 u.
    for (a, b) in [(trial, refit), (trial_theta, refit_theta)] {
        assert!((a.u / b.u - 1.0).abs() < 0.13, "{} {}", a.u, b.u);
        assert!((a.mean - b.mean).abs() < 0.2 * b.u, "{} {}", a.mean, b.mean);
    }
    // The largest value of a trial's field is no less than its value where the fit's own is largest.
    assert!(excess.iter().all(|excess| *excess > -1e-9));
    assert!(excess.iter().sum::<f64>() / 2000.0 > 0.01 * trial.u);
    assert!((trial.u / top.radiance.u - 1.0).abs() < 0.1, "{} {top:?}", trial.u);
}

#[test]
fn a_peaks_direction_is_known_as_its_trials_scatter() {
    let (samples, common) = (samples(0.3, &mut normals(1)), common());
    let readings = Readings { common: &common, ..Readings::of(&samples) };
    let fit = fit::fit_readings(&readings, &REGION, BasisSpec::zernike(4, 0), None).unwrap();
    let top = fit.peak();
    let found = fit.pointing(&top).unwrap();
    let axis = unit(top.ray.theta_rad, top.ray.phi_rad);
    let theta = unit(top.ray.theta_rad + FRAC_PI_2, top.ray.phi_rad);
    let mut off = (Vec::new(), Vec::new());
    fit.trials(&readings, None).unwrap().run(4000, &mut normals(5), &mut |trial| {
        let ray = trial.peak().ray;
        let towards = unit(ray.theta_rad, ray.phi_rad);
        off.0.push(towards.dot(theta));
        off.1.push(towards.dot(axis.cross(theta)));
    });
    let u = |values: Vec<f64>| Spread::of(values).unwrap().u;
    // A standard deviation of 4000 is known to 1.1 %.
    for (stated, scatter) in [(found.u_theta_rad, u(off.0)), (found.u_across_rad, u(off.1))] {
        assert!((stated / scatter - 1.0).abs() < 0.06, "{stated} {scatter}");
    }
}

#[test]
fn no_direction_is_stated_of_a_flat_field_or_of_one_that_rises_to_the_end_of_its_cone() {
    let of = |value: &dyn Fn(f64) -> f64| {
        let flat = samples(0.3, &mut normals(1)).into_iter();
        let flat = flat.map(|sample| Sample { value: value(sample.ray.theta_rad), ..sample });
        let fit = fit::fit(&flat.collect::<Vec<_>>(), &REGION, BasisSpec::zernike(4, 0), &[]);
        let fit = fit.unwrap();
        fit.pointing(&fit.peak())
    };
    assert_eq!(of(&|_| 100.0), None);
    assert_eq!(of(&|theta| 100.0 + 30.0 * theta.sin().powi(2)), None);
    assert!(of(&|theta| 100.0 - 30.0 * theta.sin().powi(2)).is_some());
}

#[test]
fn the_same_deviates_make_the_same_trials() {
    let samples = samples(0.5, &mut normals(1));
    let readings = Readings::of(&samples);
    let fit = fit::fit_readings(&readings, &REGION, BasisSpec::zernike(2, 0), None).unwrap();
    let run = || {
        let mut all = Vec::new();
        let trials = fit.trials(&readings, None).unwrap();
        trials.run(300, &mut normals(9), &mut |trial| all.push(trial.coefficients().to_vec()));
        all
    };
    assert_eq!(run(), run());
}

#[test]
fn a_fit_without_its_readings_has_no_trials() {
    let samples = samples(0.5, &mut normals(1));
    let readings = Readings::of(&samples);
    let fit = fit::fit_readings(&readings, &REGION, BasisSpec::zernike(2, 0), None).unwrap();
    let stored = Fit::from_parts(fit.parts().clone()).unwrap();
    assert!(matches!(stored.trials(&readings, None), Err(FitError::Trials { .. })));
    let fewer = Readings::of(&samples[1..]);
    let refused = fit.trials(&fewer, None).unwrap_err();
    assert!(refused.to_string().contains("are not at hand"), "{refused}");
}

#[test]
fn what_is_missed_is_drawn_as_large_as_it_is_in_each_direction() {
    // A step in θ that no polynomial follows: more is missed there than elsewhere.
    let mut normal = normals(5);
    let u = 1e-3;
    let stepped = |sample: Sample| {
        let level = if sample.ray.theta_rad < 0.75 { 1.0 } else { 0.2 };
        let noise = Noise::Fixed { variance: u * u };
        Sample { value: level + u * normal(), noise, ..sample }
    };
    let samples: Vec<Sample> = samples(0.5, &mut || 0.0).into_iter().map(stepped).collect();
    let readings = Readings::of(&samples);
    let fit = fit::fit_readings(&readings, &REGION, BasisSpec::zernike(4, 0), None).unwrap();
    let fit = fit.with_truncation(&samples, &[], &[], None).unwrap();
    let ray = |theta_rad: f64| Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad: 0.3 };
    let thetas = [0.2, 0.55, 0.7, 0.75, 0.8, 0.95, 1.2].map(ray);
    let of: Vec<Functional> = thetas.iter().map(|ray| fit.weighted_rays([(*ray, 1.0)])).collect();
    for (functional, spread) in of.iter().zip(spreads(&fit, &readings, &of, 20_000)) {
        let ratio = spread.u / fit.of(functional).u;
        // Noise moves the reported fit a little more than it does the likeliest wider model.
        assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
    }
}
