//! Drift, ranges and saturation from raw readings to the field: value and stated uncertainty against what
//! was put in, over seeds.

use fit::{Contribution, Ray, Rules, Wish};

use super::*;
use crate::rig::{Alignment, ReadingKind};

const DARK_A: f64 = 2e-11;

/// Numbers that look random.
struct Die(u64);

impl Die {
    fn uniform(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 * 2f64.powi(-53)
    }

    /// Twelve uniform numbers less six: mean 0, variance 1, normal enough.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// A source of which half a hemisphere is read, meridian by meridian, at one place.
fn field(ray: &Ray) -> f64 {
    let c = libm::cos(ray.theta_rad);
    20.0 + 30.0 * c * c
}

/// The readings of a run: every 16 targets the reference, dark ones before and after. `signal` makes what
/// the detector sees at a time of what shines, `range` which range it is read in by the target's number.
pub(super) fn readings(
    rig: &Rig,
    seed: u64,
    signal: impl Fn(f64, f64) -> f64,
    range: impl Fn(u32) -> u8,
) -> Vec<Reading> {
    let mut die = Die(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
    let mut all = Vec::new();
    let mut take = |kind: ReadingKind, at: Latched, gain: u8, shines: Option<f64>| {
        let id = u32::try_from(all.len()).unwrap();
        let time_s = f64::from(id);
        let mut reading = at_rest(id, kind, at, gain);
        let n = reading.n;
        let radiance = shines.unwrap_or_else(|| field(&ray(rig.measured(&reading).1)));
        let radiance =
            if kind == ReadingKind::Dark { 0.0 } else { signal(radiance, time_s + 0.025) };
        let noise = rig.detector.modelled_variance(gain, n, DARK_A);
        let sigma = libm::sqrt(noise.floor + noise.per_radiance * radiance);
        let current_a = (radiance + sigma * die.normal()) * rig.detector.a_per_radiance() + DARK_A;
        reading.mean = current_a / rig.detector.lsb_a(gain);
        all.push(reading);
    };
    let origin = Latched([0, 0, 1000, -2000]);
    for gain in [0, 1] {
        take(ReadingKind::Dark, origin, gain, Some(0.0));
    }
    let mut index = 0;
    for phi in -6..6 {
        for theta in -8..8 {
            if index % 16 == 0 {
                take(ReadingKind::Reference, origin, 0, Some(60.0));
            }
            let at = Latched([theta * 9000, phi * 15_000, 1000, -2000]);
            take(ReadingKind::Target { index, repeat: 0 }, at, range(index), None);
            index += 1;
        }
    }
    take(ReadingKind::Reference, origin, 0, Some(60.0));
    for gain in [0, 1] {
        take(ReadingKind::Dark, origin, gain, Some(0.0));
    }
    all
}

fn at_rest(id: u32, kind: ReadingKind, at: Latched, gain: u8) -> Reading {
    let begin = i64::from(id) * 1_000_000;
    Reading {
        id,
        kind,
        gain,
        n: 100,
        mean: 0.0,
        variance: 0.0,
        min: 0,
        max: 0,
        saturated: 0,
        commanded: at,
        travel: Latched::ZERO,
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

fn ray(pose: Pose) -> Ray {
    let Pose { x_m, y_m, theta_rad, phi_rad } = pose;
    Ray { x_m, y_m, theta_rad, phi_rad }
}

/// The samples' rays, and a region that holds them.
pub(super) fn region(calibrated: &Calibrated) -> (Vec<Ray>, fit::Region) {
    let rays: Vec<Ray> = calibrated.samples.iter().map(Sample::ray).collect();
    let theta_max_rad = rays.iter().map(|ray| ray.theta_rad).fold(0.0, f64::max);
    let region = fit::Region::surface(
        (rays[0].x_m, rays[0].x_m),
        (rays[0].y_m, rays[0].y_m),
        theta_max_rad.min(1.5),
    );
    (rays, region)
}

const WISH: Wish = Wish {
    kind: None,
    angular_degree: Some(4),
    cosine_columns: None,
    spans: None,
    position_degree: Some(0),
    position_spans: None,
    penalty_power: None,
    penalty_strength: None,
    rules: Rules {
        robust: fit::Robust::None,
        nonnegative: false,
        symmetry: None,
        drift: None,
        ranges: None,
    },
};

/// A rig whose axes stand where they say.
fn rig() -> Rig {
    let mut rig = Rig::built_in().unwrap();
    for axis in &mut rig.axes {
        (axis.u_zero, axis.u_homing, axis.u_readback) = (0.0, 0.0, 0.0);
    }
    rig
}

/// The u of these sources alone.
fn u_by(budget: &[Contribution], names: &[&str]) -> f64 {
    let is_meant = |row: &&Contribution| names.iter().any(|name| row.name.starts_with(name));
    libm::sqrt(budget.iter().filter(is_meant).map(|row| row.u * row.u).sum())
}

#[test]
fn a_drift_is_fitted_along_and_what_is_left_of_it_is_in_u() {
    let rig = rig();
    let (mut with, mut without, mut count) = (0.0, 0.0, 0.0);
    for seed in 0..120 {
        let mut die = Die(seed * 7 + 3);
        let (a, b) = (0.01 * die.normal(), 0.01 * die.normal());
        let drift = |time_s: f64| {
            let t = time_s / 200.0;
            a * t + b * t * t
        };
        let signal = |radiance: f64, time_s: f64| radiance * (1.0 + drift(time_s));
        let calibrated = calibrate(&rig, &readings(&rig, seed, signal, |_| 0)).unwrap();
        let n = calibrated.references.len() as f64;
        let mean = calibrated.references.iter().map(|r| drift(r.middle_s()) / n).sum::<f64>();
        let (rays, region) = region(&calibrated);
        let fitted = calibrated.fit(&region, &WISH, None).unwrap();
        let found = fitted.drift.as_ref().unwrap();
        assert!((1..=5).contains(&found.degree), "{found:?}");
        let ignored = Wish { rules: Rules { drift: Some(false), ..WISH.rules }, ..WISH };
        let ignored = calibrated.fit(&region, &ignored, None).unwrap();
        assert!(ignored.drift.is_none());
        for ray in rays.iter().step_by(23) {
            let truth = field(ray) * (1.0 + mean);
            let u =
                u_by(&fitted.fit.radiance_contributions(ray), &["independent", "dark", "drift"]);
            with += ((fitted.fit.value(ray) - truth) / u).powi(2);
            let u = u_by(&ignored.fit.radiance_contributions(ray), &["independent", "dark"]);
            without += ((ignored.fit.value(ray) - truth) / u).powi(2);
            count += 1.0;
        }
    }
    let (with, without) = (libm::sqrt(with / count), libm::sqrt(without / count));
    assert!((0.7..1.25).contains(&with), "{with}");
    assert!(without > 2.0, "{without}");
}

#[test]
fn a_run_without_drift_has_none_fitted_and_too_few_references_are_refused() {
    let rig = rig();
    let all = readings(&rig, 1, |radiance, _| radiance, |_| 0);
    let calibrated = calibrate(&rig, &all).unwrap();
    let (_, region) = region(&calibrated);
    assert!(calibrated.fit(&region, &WISH, None).unwrap().drift.is_none());
    let must = Wish { rules: Rules { drift: Some(true), ..WISH.rules }, ..WISH };
    assert!(calibrated.fit(&region, &must, None).unwrap().drift.is_some());
    let mut few = calibrated.clone();
    few.references.truncate(2);
    let refused = few.fit(&region, &must, None).unwrap_err().to_string();
    assert!(refused.contains("three reference readings"), "{refused}");
}

#[test]
fn a_step_between_ranges_is_found_where_both_saw_the_same_field() {
    let mut rig = rig();
    rig.detector.gains[0].u_relative = 0.0;
    rig.detector.gains[1].u_relative = 0.01;
    let full = rig.detector.gains[1].full_scale_a;
    let (mut squares, mut count) = (0.0, 0.0);
    for seed in 0..30 {
        let step = 0.01 * Die(seed * 11 + 5).normal();
        // The second range's full scale is another one than the rig's file says.
        let mut real = rig.clone();
        real.detector.gains[1].full_scale_a = full / (1.0 + step);
        let all = readings(&real, seed, |radiance, _| radiance, |index| u8::from(index % 3 == 0));
        let calibrated = calibrate(&rig, &all).unwrap();
        let (rays, region) = region(&calibrated);
        let fitted = calibrated.fit(&region, &WISH, None).unwrap();
        let weighed = fitted.fit.weighed().unwrap();
        let name = format!("gain {}", rig.detector.gains[1].name);
        let found = weighed.nuisances.iter().find(|nuisance| nuisance.name == name).unwrap();
        assert!(found.u < 0.2, "{found:?}");
        for ray in rays.iter().step_by(31) {
            let u = u_by(&fitted.fit.radiance_contributions(ray), &["independent", "gain", "dark"]);
            squares += ((fitted.fit.value(ray) - field(ray)) / u).powi(2);
            count += 1.0;
        }
    }
    let rms = libm::sqrt(squares / count);
    assert!((0.75..1.3).contains(&rms), "{rms}");
}

#[test]
fn independent_parts_by_source_add_to_the_independent_part() {
    let rig = rig();
    let all = readings(&rig, 4, |radiance, _| radiance, |index| u8::from(index % 3 == 0));
    let mut calibrated = calibrate(&rig, &all).unwrap();
    let (rays, _) = region(&calibrated);
    let at = (rays[0].x_m - 0.001, rays[0].x_m + 0.001);
    let region = fit::Region::surface(at, (rays[0].y_m - 0.001, rays[0].y_m + 0.001), 1.25);
    let fitted = calibrated.fit(&region, &WISH, None).unwrap();
    calibrated.restate_from(&fitted.fit, None);
    let parts = calibrated.independent_parts(&fitted);
    let fit = &fitted.fit;
    let normal = fit.mean_towards(0.0, 0.0).times(region.area_m2());
    for (rows, whole) in [
        (&parts.exitance, fit.contributions()),
        (&parts.intensity, fit.contributions_of(&normal)),
        (&parts.peak, fit.radiance_contributions(&fit.peak().ray)),
    ] {
        let sum: f64 = rows.iter().map(|row| row.u * row.u).sum();
        assert!((sum / whole[0].u.powi(2) - 1.0).abs() < 0.02, "{rows:?} {whole:?}");
        assert_eq!(rows[0].name, "shot noise");
    }
    // A fit that was stored no longer knows its samples.
    let stored = fit::Fit::from_parts(fit.parts().clone()).unwrap();
    let stored = Fitted { fit: stored, ..fitted.clone() };
    assert_eq!(calibrated.independent_parts(&stored), IndependentParts::NONE);
}

/// Where a rig that stands askew looks, every rotation exact.
fn askew(positions: AxisPositions, [x, y, z, arm_axis, beam, tilt, towards]: [f64; 7]) -> Ray {
    use glam::{DMat3, DVec3};
    let AxisPositions([theta, phi, stage_x, stage_y]) = positions;
    let arm = DMat3::from_rotation_x(arm_axis)
        * DMat3::from_rotation_y(theta)
        * DMat3::from_rotation_x(beam);
    let lean = DMat3::from_rotation_z(towards);
    let top = lean * DMat3::from_rotation_y(tilt) * lean.transpose();
    let to_sample = (DMat3::from_rotation_z(-phi) * top).transpose();
    let (through, along) = (to_sample * DVec3::new(x, y, z), to_sample * arm * DVec3::Z);
    let place = through - along * (through.z / along.z);
    let (theta_rad, phi_rad) = direction::angles(along);
    Ray { x_m: stage_x + place.x, y_m: stage_y + place.y, theta_rad, phi_rad }
}

#[test]
fn a_rig_that_stands_askew_is_off_by_what_its_alignment_s_u_says() {
    let mut rig = rig();
    rig.alignment = Alignment {
        u_offset_m: [2e-4, 3e-4, 2.5e-4],
        u_arm_axis_rad: 0.004,
        u_beam_rad: 0.002,
        u_tilt_rad: 0.003,
    };
    // What the basis follows, with a slope along everything.
    let field = |ray: &Ray| {
        let d = direction::unit(ray.theta_rad, ray.phi_rad);
        (50.0 + 12.0 * d.x - 9.0 * d.y + 10.0 * d.x * d.x + 8.0 * d.x * d.y)
            * (1.0 + 15.0 * ray.x_m - 10.0 * ray.y_m)
    };
    let wish = Wish { position_degree: Some(1), ..WISH };
    let region = fit::Region::surface((-0.01, 0.01), (-0.01, 0.01), 1.3);
    let names = ["axis offset", "arm axis tilt", "beam tilt", "table tilt"];
    let (mut squares, mut count, mut exitance) = (0.0, 0.0, 0.0);
    let seeds = 150;
    for seed in 0..seeds {
        let mut die = Die(seed * 13 + 7);
        let Alignment { u_offset_m: [x, y, z], u_arm_axis_rad, u_beam_rad, u_tilt_rad } =
            rig.alignment;
        let drawn = [x, y, z, u_arm_axis_rad, u_beam_rad, u_tilt_rad].map(|u| u * die.normal());
        let [x, y, z, arm_axis, beam, tilt] = drawn;
        let drawn = [x, y, z, arm_axis, beam, tilt, die.uniform() * std::f64::consts::TAU];
        let mut all = vec![at_rest(0, ReadingKind::Dark, Latched::ZERO, 0)];
        for index in 0..240_u32 {
            let i = i32::try_from(index).unwrap();
            let place =
                [[-8000, -7000], [8000, -6000], [-7500, 8000], [7000, 7500]][index as usize % 4];
            let at =
                Latched([-70_000 + i * 583, i * 37_000 % 340_000 - 170_000, place[0], place[1]]);
            let kind = ReadingKind::Target { index, repeat: 0 };
            let mut reading = at_rest(index + 1, kind, at, 0);
            let seen = field(&askew(rig.measured(&reading).0, drawn));
            reading.mean = seen * rig.detector.a_per_radiance() / rig.detector.lsb_a(0);
            all.push(reading);
        }
        let calibrated = calibrate(&rig, &all).unwrap();
        let fit = calibrated.fit(&region, &wish, None).unwrap().fit;
        for k in 0..24_u32 {
            let t = f64::from(k);
            let (theta_rad, phi_rad) = (0.05 + 0.05 * t, 2.4 * t);
            let ray = Ray { x_m: 0.004 - 3e-4 * t, y_m: 2e-4 * t - 0.003, theta_rad, phi_rad };
            let u = u_by(&fit.radiance_contributions(&ray), &names);
            squares += ((fit.value(&ray) - field(&ray)) / u).powi(2);
            count += 1.0;
        }
        exitance += u_by(&fit.contributions(), &names) / fit.exitance().value / f64::from(150);
    }
    let rms = libm::sqrt(squares / count);
    assert!((0.85..1.15).contains(&rms), "{rms}");
    assert!(exitance > 1e-4, "{exitance}");
}

#[test]
fn a_saturated_reading_is_a_limit_and_an_unsettled_one_has_no_part() {
    let rig = rig();
    let mut all = readings(&rig, 3, |radiance, _| radiance, |_| 0);
    let targets: Vec<usize> =
        (0..all.len()).filter(|i| matches!(all[*i].kind, ReadingKind::Target { .. })).collect();
    for &i in &targets[..5] {
        all[i].saturated = 3;
        all[i].mean *= 0.5;
    }
    all[targets[9]].unsettled = true;
    // At the lower end of the range the value is no lower limit.
    all[targets[11]].saturated = 3;
    all[targets[11]].mean = -1000.0;
    let calibrated = calibrate(&rig, &all).unwrap();
    let input = calibrated.fit_input(&Rules::default());
    assert_eq!(input.limits, [0, 1, 2, 3, 4]);
    assert_eq!(input.samples.len(), targets.len() - 2);
    let values = calibrated.samples.iter().filter(|sample| sample.part() == Part::Value);
    let share = Handing::of_share(calibrated.components.clone(), &Spread::of(values));
    assert_eq!(share.usable(&calibrated.samples).samples.len(), targets.len() - 7);
    let (_, region) = region(&calibrated);
    let fitted = calibrated.fit(&region, &WISH, None).unwrap();
    assert_eq!((fitted.n_excluded, fitted.fit.n_used()), (2, targets.len() - 7));
}
