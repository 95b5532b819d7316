//! What could break: a sign, a unit, an average across the zenith or the seam, a part of the
//! uncertainty counted twice or not at all, a flag that is missing or that changes a value.

use std::f64::consts::PI;

use proptest::prelude::*;

use super::*;
use crate::rig::{AxisName, ModelledVariance, ReadingKind};

const RELATIVE: f64 = 1e-12;

fn rig() -> Rig {
    Rig::built_in().unwrap()
}

/// A reading in which the detector sees `radiance` over `dark_a`, at rest at `counts`.
fn reading(rig: &Rig, id: u32, kind: ReadingKind, radiance: f64, dark_a: f64) -> Reading {
    let current_a = radiance * rig.detector.a_per_radiance() + dark_a;
    let at = Latched([10_000, 20_000, 1000, -2000]);
    let begin = i64::from(id) * 1_000_000;
    Reading {
        id,
        kind,
        gain: 0,
        n: 100,
        mean: current_a / rig.detector.lsb_a(0),
        variance: 0.0,
        min: 0,
        max: 0,
        saturated: 0,
        commanded: at,
        travel: Latched([0; 4]),
        start: at,
        end: at,
        start_us: begin,
        end_us: begin + 50_000,
        time_s: f64::from(id),
        session: 0,
        device_times: crate::rig::DeviceTimes::default(),
        link_retries: 0,
        unsettled: false,
    }
}

fn dark(rig: &Rig, id: u32, dark_a: f64) -> Reading {
    Reading { n: 400, ..reading(rig, id, ReadingKind::Dark, 0.0, dark_a) }
}

fn target(rig: &Rig, id: u32, radiance: f64) -> Reading {
    reading(rig, id, ReadingKind::Target { index: id, repeat: 0 }, radiance, DARK_A)
}

const DARK_A: f64 = 1e-12;

fn only_sample(rig: &Rig, target: Reading) -> Sample {
    calibrate(rig, &[dark(rig, 0, DARK_A), target]).unwrap().samples.remove(0)
}

fn assert_close(a: f64, b: f64) {
    assert!((a - b).abs() <= RELATIVE * b.abs().max(1e-300), "{a} and {b}");
}

#[test]
fn counts_become_the_radiance_that_made_them() {
    let rig = rig();
    for radiance in [0.5, 40.0, -0.01] {
        let sample = only_sample(&rig, target(&rig, 1, radiance));
        assert!((sample.value - radiance).abs() < 1e-11 * 40.0, "{radiance}: {}", sample.value);
        assert_close(sample.dwell_s, 0.05);
        assert_close(sample.pose.theta_rad, 10_f64.to_radians());
        assert_close(sample.pose.phi_rad, 20_f64.to_radians());
        assert_close(sample.pose.x_m, 1e-3);
        assert_close(sample.pose.y_m, -2e-3);
    }
}

#[test]
fn the_dark_level_is_weighted_by_adc_readings() {
    let rig = rig();
    let long = Reading { n: 300, ..dark(&rig, 0, 3e-12) };
    let short = Reading { n: 100, ..dark(&rig, 1, 7e-12) };
    let saturated = Reading { saturated: 1, ..dark(&rig, 2, 1e-6) };
    let other = Reading { gain: 1, ..dark(&rig, 3, 1e-6) };
    let calibrated =
        calibrate(&rig, &[long, short, saturated, other, target(&rig, 4, 1.0)]).unwrap();
    assert_eq!(calibrated.darks.len(), 1);
    assert_eq!(calibrated.darks[0].readings, 2);
    assert_close(calibrated.darks[0].level_a, 4e-12);
}

#[test]
fn quiet_darks_have_the_modelled_uncertainty_and_wandering_ones_that_of_their_scatter() {
    let rig = rig();
    let level = |darks: &[f64]| {
        let mut readings: Vec<Reading> =
            (0..).zip(darks).map(|(id, &dark_a)| dark(&rig, id, dark_a)).collect();
        readings.push(target(&rig, 100, 1.0));
        calibrate(&rig, &readings).unwrap().darks[0]
    };
    let quiet = level(&[DARK_A; 4]);
    // Rounded alike, all four: as good as one dwell of their length.
    assert_close(quiet.u_radiance, rig.detector.modelled_variance(0, 1600, DARK_A).floor.sqrt());
    // Far beyond noise: the standard error of the mean from the scatter, s / sqrt(4).
    let wandering = level(&[0.0, 4e-11, 0.0, 4e-11]);
    let a_per_radiance = rig.detector.a_per_radiance();
    assert_close(wandering.u_radiance, (4e-22_f64 / 3.0).sqrt() / a_per_radiance);
}

#[test]
fn a_range_without_darks_says_what_to_add() {
    let rig = rig();
    let error = calibrate(&rig, &[target(&rig, 1, 1.0)]).unwrap_err();
    assert!(error.to_string().starts_with("gain range \"1 uA\": no dark reading"), "{error}");
    assert!(error.to_string().contains("add [dark]"), "{error}");
    let saturated = Reading { saturated: 400, ..dark(&rig, 0, 1e-6) };
    assert!(calibrate(&rig, &[saturated, target(&rig, 1, 1.0)]).is_err());
    assert_eq!(calibrate(&rig, &[]).unwrap().samples, []);
}

#[test]
fn readings_that_cannot_be_are_refused_by_name() {
    let rig = rig();
    let gain = Reading { gain: 9, ..target(&rig, 3, 1.0) };
    let error = calibrate(&rig, &[gain]).unwrap_err();
    assert_eq!(error, CalibrationError::NoSuchGain { id: 3, gain: 9, count: 4 });
    let empty = Reading { n: 0, ..target(&rig, 3, 1.0) };
    assert_eq!(calibrate(&rig, &[empty]).unwrap_err(), CalibrationError::Empty { id: 3 });
    let nan = Reading { mean: f64::NAN, ..target(&rig, 3, 1.0) };
    let error = calibrate(&rig, &[nan]).unwrap_err();
    assert!(matches!(error, CalibrationError::NotFinite { id: 3, .. }));
}

#[test]
fn poses_are_averaged_on_directions() {
    let rig = rig();
    let at = |start: [i32; 4], end: [i32; 4]| {
        let (start, end) = (Latched(start), Latched(end));
        rig.measured(&Reading { start, end, ..target(&rig, 1, 1.0) }).1
    };
    // Across the seam: 179.9 and -179.9 degrees.
    let seam = at([30_000, 179_900, 0, 0], [30_000, -179_900, 0, 0]);
    assert!((seam.phi_rad.abs() - PI).abs() < 1e-9, "{seam:?}");
    assert!((seam.theta_rad - 30_f64.to_radians()).abs() < 1e-5);
    // Across the zenith: the arm from +1 to -1 degree.
    let zenith = at([1000, 45_000, 0, 0], [-1000, 45_000, 0, 0]);
    assert!(zenith.theta_rad < 1e-12, "{zenith:?}");
    // At rest on the zenith the turntable's azimuth is kept.
    assert_close(at([0, 45_000, 0, 0], [0, 45_000, 0, 0]).phi_rad, 45_f64.to_radians());
    let stage = at([0, 0, 1000, 0], [0, 0, 3000, -500]);
    assert_close(stage.x_m, 2e-3);
    assert_close(stage.y_m, -0.25e-3);
}

#[test]
fn an_axis_without_readback_stood_where_it_was_sent() {
    let mut rig = rig();
    let elsewhere = Latched([10_007, 20_007, 1007, 2007]);
    let reading = Reading { start: elsewhere, end: elsewhere, ..target(&rig, 1, 1.0) };
    rig.axes[1].readback = Readback::None;
    rig.axes[2].readback = Readback::Steps;
    let (AxisPositions([theta, phi, x_m, _]), _) = rig.measured(&reading);
    assert_close(theta, 10.007_f64.to_radians());
    assert_close(phi, 20.0_f64.to_radians());
    assert_close(x_m, 1.007e-3);
}

#[test]
fn every_flag_has_its_cause_and_changes_no_value() {
    let rig = rig();
    let plain = target(&rig, 1, 20.0);
    let value = only_sample(&rig, plain.clone()).value;
    let moved = Latched([10_020, 20_000, 1000, -2000]);
    for (reading, flags) in [
        (plain.clone(), ""),
        (Reading { saturated: 1, ..plain.clone() }, "saturated"),
        (Reading { unsettled: true, link_retries: 2, ..plain.clone() }, "unsettled|link_retry"),
        (Reading { end: moved, ..plain.clone() }, "unsettled"),
    ] {
        let sample = only_sample(&rig, reading);
        assert_eq!(sample.flags.to_string(), flags);
        assert_eq!(sample.value.to_bits(), value.to_bits());
    }
    let mut dim = only_sample(&rig, target(&rig, 1, 0.0));
    assert_eq!(dim.flags.to_string(), "below_noise");
    assert!(!dim.flags.excludes_from_fit());
    dim.flags.set(Flag::OffSample, true);
    assert_eq!(dim.flags.to_string(), "below_noise|off_sample");
    // The fit averages over what is on the sample.
    assert!(!dim.flags.excludes_from_fit());
}

#[test]
fn samples_between_disagreeing_references_are_flagged_and_no_others() {
    let rig = rig();
    let reference = |id, radiance| reading(&rig, id, ReadingKind::Reference, radiance, DARK_A);
    let readings = [
        dark(&rig, 0, DARK_A),
        target(&rig, 1, 5.0),
        reference(2, 5.0),
        target(&rig, 3, 5.0),
        reference(4, 5.0),
        target(&rig, 5, 5.0),
        reference(6, 5.5),
        target(&rig, 7, 5.0),
    ];
    let calibrated = calibrate(&rig, &readings).unwrap();
    let drifted: Vec<u32> = calibrated
        .samples
        .iter()
        .filter(|sample| sample.flags.contains(Flag::Drift))
        .map(|sample| sample.index)
        .collect();
    assert_eq!(drifted, [5]);
    let drift = calibrated.drift().unwrap();
    assert_eq!(drift.readings, 3);
    assert!((drift.spread - 0.5).abs() < 1e-9);
    assert!(drift.chi2 > 100.0);
}

#[test]
fn a_steady_drift_has_its_slope() {
    let references: Vec<Reference> = (0..5)
        .map(|id| {
            let time_s = f64::from(id) * 10.0;
            Reference {
                id,
                session: 0,
                time_s,
                dwell_s: 0.0,
                value: 2.0 + 0.01 * time_s,
                u_independent: 0.1,
            }
        })
        .collect();
    let drift = Drift::of(&references).unwrap();
    assert_close(drift.per_s, 0.01);
    assert_close(drift.mean, 2.2);
    // u / sqrt(sum of (t - mean)²)
    assert_close(drift.u_per_s, 0.1 / 1000_f64.sqrt());
    assert_eq!(Drift::of(&references[..1]), None);
}

#[test]
fn the_independent_part_is_the_models_at_the_stated_level() {
    let rig = rig();
    let mut calibrated = calibrate(&rig, &[dark(&rig, 0, DARK_A), target(&rig, 1, 9.0)]).unwrap();
    let ModelledVariance { floor, per_radiance, .. } =
        rig.detector.modelled_variance(0, 100, DARK_A);
    assert_close(calibrated.samples[0].u_independent, (floor + per_radiance * 9.0).sqrt());
    calibrated.restate(|_, _| 4.0);
    let sample = &calibrated.samples[0];
    assert_close(sample.u_independent, (floor + per_radiance * 4.0).sqrt());
    assert!((sample.value - 9.0).abs() < 1e-9);
    // A level below zero has no shot noise.
    calibrated.restate(|_, _| -4.0);
    assert_close(calibrated.samples[0].u_independent, floor.sqrt());
}

#[test]
fn the_components_squares_add_to_the_common_part() {
    let rig = rig();
    let calibrated = calibrate(&rig, &[dark(&rig, 0, DARK_A), target(&rig, 1, 9.0)]).unwrap();
    let sample = &calibrated.samples[0];
    let squares: f64 = calibrated
        .components
        .iter()
        .map(|component| component.excess(sample, sample.value).powi(2))
        .sum();
    assert_close(squares.sqrt(), sample.u_common);
    assert_close(sample.u, sample.u_common.hypot(sample.u_independent));
}

#[test]
fn a_gain_concerns_its_own_samples_alone_and_a_homing_its_session() {
    let rig = rig();
    let mut fine = target(&rig, 2, 0.5);
    (fine.gain, fine.session) = (1, 1);
    let fine_dark = Reading { gain: 1, ..dark(&rig, 3, DARK_A) };
    let readings = [dark(&rig, 0, DARK_A), target(&rig, 1, 0.5), fine, fine_dark];
    let Calibrated { samples, components, .. } = calibrate(&rig, &readings).unwrap();
    let concerned = |name: &str| -> Vec<u32> {
        let component = components.iter().find(|component| component.name == name).unwrap();
        samples.iter().filter(|sample| component.concerns(sample)).map(|s| s.index).collect()
    };
    assert_eq!(concerned("responsivity"), [1, 2]);
    assert_eq!(concerned("gain 1 uA"), [1]);
    assert_eq!(concerned("dark 100 nA"), [2]);
    assert_eq!(concerned("theta zero"), [1, 2]);
    assert_eq!(concerned("theta homing 1"), [2]);
}

#[test]
fn a_spectral_mismatch_multiplies_the_values_and_all_share_its_u() {
    let rig = rig();
    let mut other = rig.clone();
    other.detector.spectral_mismatch = 1.04;
    other.detector.u_spectral_mismatch_relative = 0.012;
    let readings = [dark(&rig, 0, DARK_A), target(&rig, 1, 40.0)];
    let of = |rig: &Rig| calibrate(rig, &readings).unwrap();
    let (plain, corrected) = (of(&rig), of(&other));
    assert_close(corrected.samples[0].value, 1.04 * plain.samples[0].value);
    // The noise is multiplied along.
    assert_close(corrected.samples[0].u_independent, 1.04 * plain.samples[0].u_independent);
    let common = |of: &Calibrated| of.samples[0].u_common / of.samples[0].value;
    assert_close(common(&corrected), libm::hypot(common(&plain), 0.012));
    let component = corrected.components.iter().find(|c| c.name == "spectral mismatch").unwrap();
    assert_eq!(component.effect, Effect::Scale { gain: None });
    assert_close(component.u, 0.012);
    assert!(!plain.components.iter().any(|c| c.name == "spectral mismatch"));
}

#[test]
fn an_axis_zero_moves_the_ray_by_what_the_axis_does() {
    let rig = rig();
    let other_side = Latched([-10_000, 20_000, 0, 0]);
    let reading = Reading { start: other_side, end: other_side, ..target(&rig, 1, 1.0) };
    let sample = only_sample(&rig, reading);
    let by = |axis| {
        let effect = Effect::Axis { axis, session: None };
        Component { name: String::new(), u: 0.01, effect }.ray_seen(&sample, 1.0)
    };
    // The arm stands beyond the zenith: further on is nearer to it.
    assert_close(by(AxisName::Theta).theta_rad, 10_f64.to_radians() - 0.01);
    assert!((by(AxisName::Phi).phi_rad - (sample.pose.phi_rad + 0.01)).abs() < 1e-12);
    assert_close(by(AxisName::Y).y_m, 0.01);
}

#[test]
fn the_fit_gets_the_usable_samples_and_what_they_share() {
    let rig = rig();
    let mut fine = target(&rig, 2, 0.5);
    fine.gain = 1;
    let fine_dark = Reading { gain: 1, ..dark(&rig, 3, DARK_A) };
    let saturated = Reading { saturated: 3, ..target(&rig, 4, 0.5) };
    let last = target(&rig, 5, 0.5);
    let readings = [dark(&rig, 0, DARK_A), target(&rig, 1, 0.5), fine, fine_dark, saturated, last];
    let calibrated = calibrate(&rig, &readings).unwrap();
    let carried = fit::Rules { ranges: Some(false), ..fit::Rules::default() };
    let input = calibrated.fit_input(&carried);
    assert_eq!((&*input.places, &*input.limits), ([0, 1, 2, 3].as_slice(), [2].as_slice()));
    assert!(input.nuisances.is_empty());
    let by_name =
        |name: &str| &input.common.iter().find(|common| common.name == name).unwrap().shift;
    assert!(matches!(by_name("responsivity"), fit::Shift::Scale));
    let fit::Shift::Value(excess) = by_name("gain 100 nA") else { panic!("one range alone") };
    let u = rig.detector.gains[1].u_relative;
    assert_close(excess(1, 2.0), 2.0 * u);
    assert!(excess(0, 2.0).abs() + excess(2, 2.0).abs() < f64::MIN_POSITIVE);
    let fit::Shift::Ray(seen) = by_name("x zero") else { panic!("an axis moves rays") };
    let sample = &input.samples[3];
    assert_close(seen(3, &sample.ray).x_m - sample.ray.x_m, rig.axes[2].u_zero);
    // Where more than one range was used, the ranges' own components are fitted along.
    let fitted = calibrated.fit_input(&fit::Rules::default());
    let names = |common: &[fit::Common]| -> Vec<String> {
        let own =
            common.iter().filter(|c| c.name.starts_with("gain") || c.name.starts_with("dark"));
        own.map(|c| c.name.clone()).collect()
    };
    assert_eq!(names(&fitted.nuisances), names(&input.common));
    assert!(names(&fitted.common).is_empty() && fitted.nuisances.len() >= 2);
}

#[test]
fn what_a_readback_is_off_by_is_shared_by_the_samples_of_a_position() {
    let rig = rig();
    let at = |id: u32, theta: i32, phi: i32| {
        let at = Latched([theta, phi, 0, 0]);
        Reading { start: at, end: at, ..target(&rig, id, 0.5) }
    };
    // Two on one ring, one on another; three azimuths.
    let readings =
        [dark(&rig, 0, DARK_A), at(1, 10_000, 0), at(2, 10_000, 20_000), at(3, 30_000, 40_000)];
    let calibrated = calibrate(&rig, &readings).unwrap();
    let input = calibrated.fit_input(&fit::Rules::default());
    let of = |start: &str| -> Vec<&fit::Common> {
        input.common.iter().filter(|common| common.name.starts_with(start)).collect()
    };
    let change = |common: &fit::Common, i: usize| -> f64 {
        let (fit::Shift::Ray(seen) | fit::Shift::Jitter(seen)) = &common.shift else {
            panic!("a readback moves rays")
        };
        let ray = input.samples[i].ray;
        libm::hypot(seen(i, &ray).theta_rad - ray.theta_rad, seen(i, &ray).phi_rad - ray.phi_rad)
    };
    let theta = of("theta readback");
    let names: Vec<&str> = theta.iter().map(|common| common.name.as_str()).collect();
    assert_eq!(names, ["theta readback", "theta readback @ 10.000°"]);
    let u = rig.axes[0].u_readback;
    for (common, moved) in theta.iter().zip([[0.0, 0.0, u], [u, u, 0.0]]) {
        for (i, moved) in moved.into_iter().enumerate() {
            assert!((change(common, i) - moved).abs() < 1e-12, "{} {i}", common.name);
        }
    }
    assert!(matches!(theta[0].shift, fit::Shift::Jitter(_)));
    // No two of one azimuth: nothing is shared.
    assert_eq!(of("phi readback").len(), 1);
}

#[test]
fn many_positions_share_components_that_have_their_squares() {
    let rig = rig();
    let mut readings = vec![dark(&rig, 0, DARK_A)];
    for place in 0..100_u32 {
        for twice in 0..2 {
            let at = Latched([100 * i32::try_from(place).unwrap(), 0, 0, 0]);
            let id = 1 + 2 * place + twice;
            readings.push(Reading { start: at, end: at, ..target(&rig, id, 0.5) });
        }
    }
    let input = calibrate(&rig, &readings).unwrap().fit_input(&fit::Rules::default());
    let u = rig.axes[0].u_readback;
    let theta = input.common.iter().filter(|c| c.name.starts_with("theta readback"));
    let shifts: Vec<Vec<f64>> = theta
        .map(|common| {
            let fit::Shift::Ray(seen) = &common.shift else { panic!("all positions are shared") };
            let moved = |(i, s): (usize, &fit::Sample)| {
                let (from, to) = (s.ray, seen(i, &s.ray));
                // The zenith is passed: sin keeps its sign by the azimuth.
                (to.theta_rad - from.theta_rad) / u
            };
            input.samples.iter().enumerate().skip(2).map(moved).collect()
        })
        .collect();
    assert_eq!(shifts.len(), 64);
    let product = |i: usize, j: usize| shifts.iter().map(|s| s[i] * s[j]).sum::<f64>();
    for i in (0..190).step_by(2) {
        assert!((product(i, i) - 1.0).abs() < 1e-6, "{}", product(i, i));
        assert!((product(i, i + 1) - 1.0).abs() < 1e-6, "one position is off as one");
        assert!(product(i, i + 2).abs() < 0.6, "others are not: {}", product(i, i + 2));
    }
}

proptest! {
    #[test]
    fn order_is_of_no_consequence(
        order in Just((0..14_usize).collect::<Vec<_>>()).prop_shuffle(),
        radiances in proptest::collection::vec(-0.1_f64..40.0, 14),
    ) {
        let rig = rig();
        let readings: Vec<Reading> = (0..14).zip(radiances).map(|(id, radiance)| match id % 5 {
            0 => dark(&rig, id, radiance * 1e-12),
            1 => reading(&rig, id, ReadingKind::Reference, radiance, DARK_A),
            _ => target(&rig, id, radiance),
        }).collect();
        let shuffled: Vec<Reading> = order.into_iter().map(|i| readings[i].clone()).collect();
        prop_assert_eq!(calibrate(&rig, &readings).unwrap(), calibrate(&rig, &shuffled).unwrap());
    }
}
