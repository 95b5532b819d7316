//! Readings that don't belong, readings that are limits, and what readings tell of what they share: value
//! and stated uncertainty against the truth, over seeds.

#[allow(dead_code)]
mod scenes;

use fit::{BasisSpec, Common, Fit, Noise, Ray, Readings, Robust, Sample, Shift, fit_readings};
use scenes::{Die, REGION, raster_rays};
use std::f64::consts::PI;

const BASIS: BasisSpec = BasisSpec::zernike(6, 1);
const SEEDS: u64 = 60;

/// A polynomial lobe on a floor: in the span of [`BASIS`].
fn lobe(ray: &Ray) -> f64 {
    let c2 = libm::cos(ray.theta_rad).powi(2);
    4.0 + 26.0 * c2 * c2
}

/// ∫ lobe cos θ dω over the hemisphere.
const EXITANCE: f64 = 4.0 * PI + 26.0 * PI / 3.0;

const NOISE: Noise = Noise::Modelled { floor: 1e-4, per_radiance: 4e-4 };

fn u_at(level: f64) -> f64 {
    (1e-4 + 4e-4 * level).sqrt()
}

fn readings(seed: u64) -> Vec<Sample> {
    let mut die = Die::new(seed);
    let rays = raster_rays(&REGION, 9, 16, 2);
    let noisy = |ray: &Ray| lobe(ray) + u_at(lobe(ray)) * die.normal();
    let values: Vec<f64> = rays.iter().map(noisy).collect();
    rays.iter().zip(values).map(|(ray, value)| Sample { ray: *ray, value, noise: NOISE }).collect()
}

/// A hand in the beam for a dozen readings in a row, and a mains glitch every so often.
fn disturb(samples: &mut [Sample], seed: u64) {
    let mut die = Die::new(1000 + seed);
    let mut place = |most: usize| {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // below `most`
        let place = (die.uniform() * most as f64) as usize;
        (place, die.uniform())
    };
    let (from, _) = place(500);
    for sample in &mut samples[from..from + 12] {
        sample.value *= 0.05;
    }
    for _ in 0..6 {
        let (at, size) = place(samples.len());
        samples[at].value += 40.0 * (size - 0.3);
    }
}

fn fitted(samples: &[Sample], robust: Robust) -> Fit {
    let readings = Readings { robust, ..Readings::of(samples) };
    fit_readings(&readings, &REGION, BASIS, None).unwrap()
}

/// RMS of (exitance - truth)/u, and the mean of u.
fn in_u(fit_of: impl Fn(u64) -> Fit, truth: f64) -> (f64, f64) {
    let (mut squares, mut u) = (0.0, 0.0);
    for seed in 0..SEEDS {
        let exitance = fit_of(seed).exitance();
        squares += ((exitance.value - truth) / exitance.u).powi(2) / SEEDS as f64;
        u += exitance.u / SEEDS as f64;
    }
    (squares.sqrt(), u)
}

#[test]
fn of_disturbed_readings_the_robust_fit_is_as_good_as_it_says() {
    let of = |robust| {
        in_u(
            |seed| {
                let mut samples = readings(seed);
                disturb(&mut samples, seed);
                fitted(&samples, robust)
            },
            EXITANCE,
        )
    };
    let (clean, u_clean) = in_u(|seed| fitted(&readings(seed), Robust::None), EXITANCE);
    let (plain, u_plain) = of(Robust::None);
    let (huber, u_huber) = of(Robust::Huber);
    let (tukey, u_tukey) = of(Robust::Tukey);
    println!(
        "clean {clean} {u_clean}; plain {plain} {u_plain}; huber {huber} {u_huber}; tukey {tukey} {u_tukey}"
    );
    assert!((0.8..1.2).contains(&clean));
    // Least squares either is off by many u or has a u many times as large.
    assert!(u_plain > 10.0 * u_clean, "{u_plain} {u_clean}");
    assert!(u_tukey < 1.1 * u_clean, "{u_tukey} {u_clean}");
    assert!((0.8..1.2).contains(&tukey), "{tukey}");
    // Outliers to one side pull on Huber's fit, as they must.
    assert!(u_huber < 2.0 * u_clean && huber < 6.0, "{u_huber} {huber}");
}

#[test]
fn of_clean_readings_little_is_lost_and_u_says_what() {
    for robust in [Robust::Huber, Robust::Tukey] {
        let (rms, u) = in_u(|seed| fitted(&readings(seed), robust), EXITANCE);
        let (_, plain) = in_u(|seed| fitted(&readings(seed), Robust::None), EXITANCE);
        assert!((0.8..1.2).contains(&rms), "{robust:?}: {rms}");
        assert!(u / plain > 0.99 && u / plain < 1.03, "{robust:?}: {}", u / plain);
    }
}

#[test]
fn each_outlier_is_listed_with_what_is_left_of_its_weight() {
    let mut samples = readings(3);
    samples[17].value += 3.0; // 20 or more u
    let fit = fitted(&samples, Robust::Tukey);
    let weighed = fit.weighed().unwrap();
    assert!(weighed.weights[17] == 0.0 && weighed.residuals[17] > 15.0);
    let least = (0..samples.len()).filter(|i| *i != 17).map(|i| weighed.weights[i]);
    assert!(least.fold(1.0, f64::min) > 0.1);
    assert_eq!(fit.n_used(), samples.len() - 1);
    let plain = fitted(&samples, Robust::None);
    let weighed = plain.weighed().unwrap();
    assert!(weighed.weights.iter().all(|weight| (weight - 1.0).abs() < 1e-15));
    assert!(weighed.residuals[17] > 6.0, "{}", weighed.residuals[17]);
}

/// The lobe where the detector is full: what lies above reads as much.
fn saturated(seed: u64, full: f64) -> (Vec<Sample>, Vec<usize>) {
    let mut samples = readings(seed);
    let limits: Vec<usize> = (0..samples.len()).filter(|i| samples[*i].value >= full).collect();
    for i in &limits {
        samples[*i].value = full;
    }
    (samples, limits)
}

#[test]
fn a_saturated_peak_is_held_up_by_its_limits() {
    // The detector is full within the noise of the peak: of its readings those that came out low are
    // left, and the others say that they would have been higher.
    let peak = Ray { x_m: 0.0, y_m: 0.015, theta_rad: 0.0, phi_rad: 0.0 };
    let (mut with, mut without, mut in_u, mut u) = (0.0, 0.0, 0.0, [0.0; 3]);
    for seed in 0..SEEDS {
        let (samples, limits) = saturated(seed, 30.0);
        assert!(limits.len() > 15);
        let given = Readings { limits: &limits, ..Readings::of(&samples) };
        let fit = fit_readings(&given, &REGION, BASIS, None).unwrap();
        let kept = samples.iter().enumerate().filter(|(i, _)| !limits.contains(i));
        let kept: Vec<Sample> = kept.map(|(_, sample)| *sample).collect();
        let left_out = fit::fit(&kept, &REGION, BASIS, &[]).unwrap();
        let clean = fit::fit(&readings(seed), &REGION, BASIS, &[]).unwrap();
        let (a, b) = (fit.radiance(&peak), left_out.radiance(&peak));
        with += (a.value - 30.0) / SEEDS as f64;
        without += (b.value - 30.0) / SEEDS as f64;
        in_u += ((a.value - 30.0) / a.u).powi(2) / SEEDS as f64;
        for (sum, u) in u.iter_mut().zip([a.u, b.u, clean.radiance(&peak).u]) {
            *sum += u / SEEDS as f64;
        }
    }
    assert!(without < -1.5 * u[0], "{without} {u:?}");
    assert!(with.abs() < 0.3 * u[0], "{with} {u:?}");
    assert!((0.75..1.25).contains(&in_u.sqrt()), "{in_u}");
    // A limit holds less than a reading, and more than nothing.
    assert!(u[0] > 1.02 * u[2] && u[0] < u[1], "{u:?}");
}

#[test]
fn limits_taken_for_readings_bias_the_peak_and_limits_far_below_change_nothing() {
    let (samples, limits) = saturated(1, 26.0);
    let peak = Ray { x_m: 0.0, y_m: 0.015, theta_rad: 0.0, phi_rad: 0.0 };
    let as_read = fitted(&samples, Robust::None).radiance(&peak);
    let given = Readings { limits: &limits, ..Readings::of(&samples) };
    let limited = fit_readings(&given, &REGION, BASIS, None).unwrap().radiance(&peak);
    assert!((as_read.value - 30.0).abs() > 10.0 * (limited.value - 30.0).abs());
    assert!((limited.value - 30.0).abs() < 4.0 * limited.u, "{limited:?}");

    let mut low = readings(1);
    let plain = fit::fit(&low[1..], &REGION, BASIS, &[]).unwrap();
    low[0].value = 1.0;
    let given = Readings { limits: &[0], ..Readings::of(&low) };
    let with = fit_readings(&given, &REGION, BASIS, None).unwrap();
    let (a, b) = (plain.exitance(), with.exitance());
    assert!((a.value - b.value).abs() < 1e-6 * a.u && (a.u / b.u - 1.0).abs() < 1e-6);
    assert_eq!((with.n_used(), with.weighed().unwrap().weights[0]), (low.len() - 1, 0.0));
}

#[test]
fn a_glitch_that_fills_the_detector_is_an_outlier_like_others() {
    let mut samples = readings(2);
    samples[40].value = 300.0;
    let given = Readings { limits: &[40], robust: Robust::Tukey, ..Readings::of(&samples) };
    let fit = fit_readings(&given, &REGION, BASIS, None).unwrap();
    assert!(fit.weighed().unwrap().weights[40] < 1e-9);
    let exitance = fit.exitance();
    assert!((exitance.value - EXITANCE).abs() < 4.0 * exitance.u);
}

#[test]
fn limits_that_are_no_samples_are_refused() {
    let samples = readings(0);
    for limits in [[3, 3], [4, 3], [3, samples.len()]] {
        let given = Readings { limits: &limits, ..Readings::of(&samples) };
        let refused = fit_readings(&given, &REGION, BASIS, None).unwrap_err().to_string();
        assert!(refused.contains("limits"), "{refused}");
    }
}

/// Of the drift a straight line and a parabola, of 2 % each as far as is known.
fn drifting(n: usize) -> Vec<Common> {
    (1..=2)
        .map(|power| {
            let shift = move |i: usize, level: f64| {
                0.02 * level * (2.0 * i as f64 / (n - 1) as f64 - 1.0).powi(power)
            };
            let shift = Shift::Value(Box::new(shift));
            Common { name: format!("drift @ {power}"), u: 0.02, shift }
        })
        .collect()
}

#[test]
fn a_drift_that_biases_the_plain_fit_is_fitted_along_and_u_holds_what_is_left() {
    let mut rms = [0.0; 3];
    for seed in 0..SEEDS {
        let mut die = Die::new(seed);
        let (a, b) = (0.02 * die.normal(), 0.02 * die.normal());
        let rays = raster_rays(&REGION, 9, 16, 2);
        let n = 2 * rays.len();
        // There, and back again.
        let samples: Vec<Sample> = rays
            .iter()
            .chain(rays.iter().rev())
            .enumerate()
            .map(|(i, ray)| {
                let t = 2.0 * i as f64 / (n - 1) as f64 - 1.0;
                let value = lobe(ray) * (1.0 + a * t + b * t * t);
                Sample { ray: *ray, value: value + u_at(value) * die.normal(), noise: NOISE }
            })
            .collect();
        let nuisances = drifting(n);
        let given = Readings { nuisances: &nuisances, ..Readings::of(&samples) };
        let fit = fit_readings(&given, &REGION, BASIS, None).unwrap();
        let plain = fit::fit(&samples, &REGION, BASIS, &[]).unwrap();
        let (e, p) = (fit.exitance(), plain.exitance());
        rms[0] += ((e.value - EXITANCE) / e.u).powi(2) / SEEDS as f64;
        rms[1] += ((p.value - EXITANCE) / p.u).powi(2) / SEEDS as f64;
        let found = &fit.weighed().unwrap().nuisances;
        rms[2] += ((found[0].value * 0.02 - a) / (found[0].u * 0.02)).powi(2) / SEEDS as f64;
        assert!(found[0].u < 0.1, "{found:?}");
        // What is left of the drift is common, not independent; the parts add up.
        let budget = fit.contributions();
        assert_eq!(budget[1].name, "drift");
        assert!((e.u - e.u_independent.hypot(budget[1].u)).abs() < 1e-9 * e.u);
    }
    let rms = rms.map(f64::sqrt);
    assert!((0.8..1.2).contains(&rms[0]) && (0.8..1.2).contains(&rms[2]), "{rms:?}");
    assert!(rms[1] > 1.5, "{rms:?}");
}

#[test]
fn a_component_that_readings_say_nothing_of_is_carried_whether_fitted_or_not() {
    // An offset of all readings is a field like any other.
    let offset = |name: &str| {
        let shift = Shift::Value(Box::new(|_, _| 0.3));
        vec![Common { name: name.into(), u: 0.3, shift }]
    };
    let samples = readings(7);
    let (carried, fitted) = (offset("dark"), offset("dark"));
    let carried = fit::fit(&samples, &REGION, BASIS, &carried).unwrap();
    let given = Readings { nuisances: &fitted, ..Readings::of(&samples) };
    let fitted = fit_readings(&given, &REGION, BASIS, None).unwrap();
    let (a, b) = (carried.exitance(), fitted.exitance());
    assert!((a.value - b.value).abs() < 1e-6 * a.u, "{a:?} {b:?}");
    assert!(
        (a.u / b.u - 1.0).abs() < 1e-6 && (a.u_independent / b.u_independent - 1.0).abs() < 1e-6
    );
    let found = &fitted.weighed().unwrap().nuisances[0];
    assert!(found.value.abs() < 1e-6 && (found.u - 1.0).abs() < 1e-6, "{found:?}");
}

#[test]
fn limits_alone_are_refused_by_every_way_to_a_field() {
    let samples = readings(0);
    let limits: Vec<usize> = (0..samples.len()).collect();
    let given = Readings { limits: &limits, ..Readings::of(&samples) };
    let expected = fit::FitError::OnlyLimits { readings: samples.len() };
    assert_eq!(fit_readings(&given, &REGION, BASIS, None).unwrap_err(), expected);
    let open = fit::fit_wished(&given, &REGION, &fit::Wish::default(), None);
    assert_eq!(open.unwrap_err(), expected);
    // One that is none, and a field of one coefficient stands on it.
    let flat = BasisSpec::zernike(0, 0);
    let given = Readings { limits: &limits[1..], ..Readings::of(&samples) };
    assert!(fit_readings(&given, &REGION, flat, None).is_ok());
}
