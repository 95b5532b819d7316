//! What a basis can't follow is in every u, no wider than it has to be, and only where it is there.

#[allow(dead_code)]
mod scenes;

use fit::{
    Angular, BasisSpec, Common, Fit, Noise, Position, Ray, Readings, Robust, Rules, Sample, Shift,
    Symmetry, Wish,
};
use scenes::{Die, REGION, raster_rays};
use std::f64::consts::PI;

const BASIS: BasisSpec = BasisSpec::zernike(6, 0);
const SIGMA: f64 = 2e-4;

/// Readings of a field that is the same everywhere and all round.
fn readings(field: impl Fn(f64) -> f64, die: &mut Die) -> Vec<Sample> {
    readings_along(&raster_rays(&REGION, 10, 16, 1), field, die)
}

fn readings_along(rays: &[Ray], field: impl Fn(f64) -> f64, die: &mut Die) -> Vec<Sample> {
    let noise = Noise::Fixed { variance: SIGMA * SIGMA };
    let sample = |ray: &Ray| {
        let value = field(ray.theta_rad) + SIGMA * die.normal();
        Sample { ray: *ray, value, noise }
    };
    rays.iter().map(sample).collect()
}

fn plain(samples: &[Sample], common: &[Common]) -> Fit {
    fit::fit(samples, &REGION, BASIS, common).unwrap()
}

/// cosⁿ: only of even n a polynomial on the disk.
fn lobe(exponent: f64) -> impl Fn(f64) -> f64 {
    move |theta_rad| libm::pow(libm::cos(theta_rad), exponent)
}

/// (value - truth, u) of M, of M within 60°, and of I and L in two directions.
fn asked(fit: &Fit, exponent: f64) -> Vec<(f64, f64)> {
    let whole = 2.0 * PI / (exponent + 2.0);
    let cone = PI / 3.0;
    let within = whole * (1.0 - libm::pow(libm::cos(cone), exponent + 2.0));
    let mut all = vec![(fit.exitance(), whole), (fit.exitance_within(cone).unwrap(), within)];
    for (theta_rad, phi_rad) in [(0.1, 0.3), (0.9, 2.0)] {
        let ray = Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad };
        let radiance = lobe(exponent)(theta_rad);
        all.push((fit.radiance(&ray), radiance));
        let towards = radiance * REGION.area_m2() * libm::cos(theta_rad);
        all.push((fit.intensity(theta_rad, phi_rad), towards));
    }
    all.into_iter().map(|(estimate, truth)| (estimate.value - truth, estimate.u)).collect()
}

#[test]
fn where_the_basis_limits_intervals_hold_the_truth_and_are_not_huge() {
    let mut die = Die::new(7);
    let (mut with, mut without) = (Vec::new(), Vec::new());
    for run in 0..60 {
        // From 0.6 to 7: by the golden ratio, so that they spread evenly.
        let exponent = 0.6 + 6.4 * (f64::from(run) * 0.618_034).fract();
        let samples = readings(lobe(exponent), &mut die);
        let fit = plain(&samples, &[]);
        without.push(asked(&fit, exponent));
        let fit = fit.with_truncation(&samples, &[], &[], None).unwrap();
        with.push(asked(&fit, exponent));
    }
    let coverage = |runs: &[Vec<(f64, f64)>]| {
        let all: Vec<bool> =
            runs.iter().flatten().map(|(error, u)| error.abs() <= 1.96 * u).collect();
        all.iter().filter(|holds| **holds).count() as f64 / all.len() as f64
    };
    assert!(coverage(&without) < 0.9, "the basis follows too well: {}", coverage(&without));
    assert!(coverage(&with) >= 0.93, "{}", coverage(&with));
    for quantity in 0..with[0].len() {
        let mut u: Vec<f64> = with.iter().map(|run| run[quantity].1).collect();
        u.sort_by(f64::total_cmp);
        let squares: f64 = with.iter().map(|run| run[quantity].0.powi(2)).sum();
        let rms = (squares / with.len() as f64).sqrt();
        assert!(u[u.len() / 2] <= 2.0 * rms, "{quantity}: median u {}, rms {rms}", u[u.len() / 2]);
    }
}

#[test]
fn what_two_priors_say_beyond_the_readings_is_mixed() {
    // Lamps with an edge: about as many readings bear out a smooth prior as a rough one, and what the
    // two say of directions between rings and beyond them differs by far.
    let rays = raster_rays(&REGION, 10, 32, 1);
    let mut off = Vec::new();
    for seed in 0..40_u32 {
        let part = |irrational: f64| (f64::from(seed) * irrational).fract();
        let (at, wide) = (0.5 + 0.7 * part(0.618_034), 0.03 + 0.12 * part(0.754_877));
        let lamp = |theta_rad: f64| 0.1 + 1.0 / (1.0 + libm::exp((theta_rad - at) / wide));
        let samples = readings_along(&rays, lamp, &mut Die::new(u64::from(seed)));
        let fit = fit::fit(&samples, &REGION, BasisSpec::zernike(12, 0), &[]).unwrap();
        let found = fit.with_truncation(&samples, &[], &[], None).unwrap().exitance();
        // By the midpoint rule in sin², 1e-6 of it.
        let truth = PI / 20_000.0
            * (0..20_000)
                .map(|i| lamp(libm::asin(libm::sqrt((f64::from(i) + 0.5) / 20_000.0))))
                .sum::<f64>();
        off.push((found.value - truth) / found.u);
    }
    let rms = (off.iter().map(|off| off * off).sum::<f64>() / off.len() as f64).sqrt();
    assert!((0.4..1.1).contains(&rms) && off.iter().all(|off| off.abs() < 2.5), "{rms} {off:.1?}");
}

#[test]
fn where_the_basis_follows_nothing_is_added() {
    let mut die = Die::new(3);
    let mut wider = 0;
    for run in 0..60 {
        let exponent = [0.0, 2.0, 4.0, 6.0][run % 4];
        let samples = readings(lobe(exponent), &mut die);
        let fit = plain(&samples, &[]);
        let u = fit.exitance().u;
        let fit = fit.with_truncation(&samples, &[], &[], None).unwrap();
        if fit.parts().truncation.is_some() {
            wider += 1;
        } else {
            assert!((fit.exitance().u / u - 1.0).abs() < 0.1, "{} {u}", fit.exitance().u);
        }
    }
    assert!(wider <= 3, "{wider} of 60");
}

#[test]
fn a_shift_that_all_rays_share_is_no_truncation() {
    // What an arm that swings through the zenith is off by has another sign on the far side: no
    // smooth field shows it, and the residuals are far beyond the noise.
    let off_rad = 1e-3;
    let seen = move |theta_rad: f64, phi_rad: f64| {
        if phi_rad.rem_euclid(2.0 * PI) < PI { theta_rad + off_rad } else { theta_rad - off_rad }
    };
    let noise = Noise::Fixed { variance: SIGMA * SIGMA };
    let mut die = Die::new(5);
    let rays = raster_rays(&REGION, 10, 16, 1);
    let sample = |ray: &Ray| {
        let value = lobe(4.0)(seen(ray.theta_rad, ray.phi_rad)) + SIGMA * die.normal();
        Sample { ray: *ray, value, noise }
    };
    let samples: Vec<Sample> = rays.iter().map(sample).collect();
    let zero = Common {
        name: "theta zero".into(),
        u: off_rad,
        shift: Shift::Ray(Box::new(move |_, ray| Ray {
            theta_rad: seen(ray.theta_rad, ray.phi_rad),
            ..*ray
        })),
    };
    let fit = plain(&samples, std::slice::from_ref(&zero));
    let noise_alone = {
        let quiet = readings(lobe(4.0), &mut Die::new(5));
        plain(&quiet, &[]).exitance().u_independent
    };
    assert!(fit.exitance().u_independent > 1.2 * noise_alone, "no misfit to begin with");
    let fit = fit.with_truncation(&samples, &[], &[zero], None).unwrap();
    assert!(fit.parts().truncation.is_none());
    let ratio = fit.exitance().u_independent / noise_alone;
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
}

#[test]
fn what_was_missed_is_stored_with_the_fit() {
    let samples = readings(lobe(3.0), &mut Die::new(1));
    let fit = plain(&samples, &[]).with_truncation(&samples, &[], &[], None).unwrap();
    assert!(fit.parts().truncation.is_some());
    let again = Fit::from_parts(fit.parts().clone()).unwrap();
    assert_eq!(asked(&again, 3.0), asked(&fit, 3.0));
    let budget = fit.contributions();
    let squares: f64 = budget.iter().map(|part| part.u * part.u).sum();
    assert!((squares.sqrt() / fit.exitance().u - 1.0).abs() < 1e-12);
    assert!(budget.iter().any(|part| part.name == "truncation" && part.u > 0.0));
    // A field of another length belongs to another basis.
    let mut parts = fit.parts().clone();
    if let Some(truncation) = &mut parts.truncation {
        truncation.missed[0].pop();
    }
    assert!(matches!(Fit::from_parts(parts), Err(fit::FitError::Parts { .. })));
}

#[test]
fn readings_that_count_for_nothing_take_no_truncation_away() {
    // The basis doesn't follow, so that there is scatter beyond the noise; one reading is a glitch,
    // and one a limit far below what is there.
    let mut samples = readings(lobe(0.6), &mut Die::new(2));
    let tukey = |samples: &[Sample], limits: &[usize]| {
        let of = Readings { robust: Robust::Tukey, limits, ..Readings::of(samples) };
        fit::fit_readings(&of, &REGION, BASIS, None).unwrap()
    };
    let others = [&samples[..40], &samples[42..]].concat();
    let without = tukey(&others, &[]).with_truncation(&others, &[], &[], None).unwrap();
    samples[40].value += 0.5;
    samples[41].value = 0.01;
    let fit = tukey(&samples, &[41]);
    assert!(fit.excess_rms() > 0.0, "nothing beyond the noise to begin with");
    let weights = &fit.weighed().unwrap().weights;
    assert!(weights[40] == 0.0 && weights[41] < 1e-6, "{} {}", weights[40], weights[41]);
    let fit = fit.with_truncation(&samples, &[], &[], None).unwrap();
    assert!(fit.parts().truncation.is_some());
    let ray = Ray { x_m: 0.0, y_m: 0.0, theta_rad: 0.5, phi_rad: 0.3 };
    for (with, without) in
        [(fit.exitance(), without.exitance()), (fit.radiance(&ray), without.radiance(&ray))]
    {
        assert!((with.value / without.value - 1.0).abs() < 1e-4, "{with:?} {without:?}");
        assert!((0.95..1.05).contains(&(with.u / without.u)), "{with:?} {without:?}");
    }
}

#[test]
fn a_reading_that_hardly_counts_says_little_of_what_is_finer() {
    // Weights near zero make variances near infinity of the same excess.
    let mut samples = readings(lobe(0.6), &mut Die::new(2));
    let ray = Ray { x_m: 0.0, y_m: 0.0, theta_rad: 0.5, phi_rad: 0.3 };
    let u_of = |samples: &[Sample]| {
        let of = Readings { robust: Robust::Huber, ..Readings::of(samples) };
        let fit = fit::fit_readings(&of, &REGION, BASIS, None).unwrap();
        fit.with_truncation(samples, &[], &[], None).unwrap().radiance(&ray).u
    };
    let clean = u_of(&samples);
    samples[40].value += 1e5;
    let ratio = u_of(&samples) / clean;
    assert!((0.7..1.4).contains(&ratio), "{ratio}");
}

/// A wide basis times positions, by so many directions at four places.
fn wide(angular: Angular, position: Position) -> Fit {
    let noise = Noise::Fixed { variance: SIGMA * SIGMA };
    let mut die = Die::new(11);
    let sample = |ray: &Ray| {
        // A kink that no degree follows, and a slope with the place.
        let field = 1.0 + (0.8 - ray.theta_rad).abs() + 4.0 * ray.x_m;
        Sample { ray: *ray, value: field + SIGMA * die.normal(), noise }
    };
    let samples: Vec<Sample> = raster_rays(&REGION, 14, 20, 2).iter().map(sample).collect();
    let fit = fit::fit(&samples, &REGION, BasisSpec { angular, position }, &[]).unwrap();
    fit.with_truncation(&samples, &[], &[], None).unwrap()
}

#[test]
fn a_wide_basis_has_its_truncation_too() {
    let position = Position::Legendre { degree: 1 };
    let splines = Angular::Splines { theta_spans: 4, phi_spans: 8, fine: fit::Fine::NONE };
    for angular in [Angular::Zernike { degree: 8, cosine_columns: 0 }, splines] {
        let fit = wide(angular, position);
        assert!(fit.parts().truncation.is_some(), "{angular:?}");
        // Off by the kink, and u knows.
        let ray = Ray { x_m: 0.0, y_m: 0.015, theta_rad: 0.8, phi_rad: 0.3 };
        let found = fit.radiance(&ray);
        assert!((found.value - 1.0).abs() < 3.0 * found.u, "{angular:?}: {found:?}");
    }
}

#[test]
fn a_symmetry_stays_in_what_is_missed() {
    let mut die = Die::new(4);
    let (mut with, mut without) = (Vec::new(), Vec::new());
    for run in 0..20 {
        let exponent = 0.6 + 6.4 * (f64::from(run) * 0.618_034).fract();
        let samples = readings(lobe(exponent), &mut die);
        let of = |symmetry| {
            let wish = Wish {
                angular_degree: Some(6),
                position_degree: Some(0),
                rules: Rules { symmetry, ..Rules::default() },
                ..Wish::default()
            };
            let ruled = fit::fit_wished(&Readings::of(&samples), &REGION, &wish, None).unwrap();
            assert!(
                symmetry.is_none() || matches!(ruled.symmetry, Some(Ok(_))),
                "{:?}",
                ruled.symmetry
            );
            ruled.fit
        };
        let symmetric = of(Some(Symmetry::Rotational));
        assert!(symmetric.influence().is_none());
        without.extend(asked(&of(None), exponent));
        with.extend(asked(&symmetric, exponent));
        // The same all round, and so is its u.
        let along = |phi_rad| {
            let found = symmetric.radiance(&Ray { x_m: 0.0, y_m: 0.015, theta_rad: 0.9, phi_rad });
            (found.value, found.u)
        };
        let ((value, u), (other_value, other_u)) = (along(0.2), along(2.9));
        assert!(
            (value - other_value).abs() < 1e-9 && (u / other_u - 1.0).abs() < 1e-6,
            "{u} {other_u}"
        );
    }
    let covered = |all: &[(f64, f64)]| {
        let holds = all.iter().filter(|(error, u)| error.abs() <= 1.96 * u).count();
        holds as f64 / all.len() as f64
    };
    assert!(covered(&with) >= 0.92, "{} {}", covered(&with), covered(&without));
    // Off the axis u is that of what is missed, which readings all round already show to be the same
    // all round: the symmetry makes it no larger.
    let sum = |all: &[(f64, f64)]| all.iter().skip(4).step_by(6).map(|(_, u)| u).sum::<f64>();
    assert!(sum(&with) < 1.01 * sum(&without), "{} {}", sum(&with), sum(&without));
}

#[test]
fn what_is_finer_still_is_in_sums_of_one_direction_and_not_of_several() {
    let mut die = Die::new(5);
    // A step in θ, between rings that are closer than all functions of the wider model can follow.
    let noise = Noise::Fixed { variance: SIGMA * SIGMA };
    let sample = |ray: &Ray| {
        let step = if ray.theta_rad < 0.8 { 1.0 } else { 0.2 };
        Sample { ray: *ray, value: step + SIGMA * die.normal(), noise }
    };
    let samples: Vec<Sample> = raster_rays(&REGION, 40, 16, 1).iter().map(sample).collect();
    let fit = plain(&samples, &[]).with_truncation(&samples, &[], &[], None).unwrap();
    let finer = fit.model().truncation;
    assert!(finer > 0.01, "{finer}");
    let ray = |x_m: f64, theta_rad: f64| Ray { x_m, y_m: 0.0, theta_rad, phi_rad: 0.3 };
    let one = fit.of(&fit.weighted_rays([(ray(0.0, 0.4), 1.0)]));
    assert_eq!(one, fit.radiance(&ray(0.0, 0.4)));
    // The same at all places of a field without position.
    let places = [(ray(0.0, 0.4), 0.5), (ray(0.002, 0.4), 0.5)];
    let mean = fit.of(&fit.weighted_rays(places));
    assert!((mean.u - one.u).abs() < 1e-12 * one.u, "{} {}", mean.u, one.u);
    let intensity = fit.intensity(0.4, 0.3);
    let factor = REGION.area_m2() * libm::cos(0.4);
    assert!((intensity.u - factor * one.u).abs() < 1e-9 * intensity.u);
    // Of two directions less than of each, by as much at least as is finer.
    let two = [(ray(0.0, 0.4), 0.5), (ray(0.0, 0.41), 0.5)];
    let both = fit.of(&fit.weighted_rays(two)).u;
    assert!(both * both + 0.8 * finer * finer < one.u * one.u, "{both} {} {finer}", one.u);
    // The budget adds up to u.
    let budget = fit.contributions_of(&fit.weighted_rays([(ray(0.0, 0.4), 1.0)]));
    let squares: f64 = budget.iter().map(|part| part.u * part.u).sum();
    assert!((squares.sqrt() - one.u).abs() < 1e-12 * one.u);
}

/// Bright within 0.8 rad of the axis, the edge as wide as a reading is from the next.
fn beam(theta_rad: f64) -> f64 {
    0.2 + 0.8 / (1.0 + libm::exp((theta_rad - 0.8) / 0.02))
}

#[test]
fn more_is_missed_at_the_shoulder_of_a_beam_than_beside_it() {
    let mut die = Die::new(11);
    let noise = Noise::Fixed { variance: SIGMA * SIGMA };
    let sample = |ray: &Ray| {
        let value = beam(ray.theta_rad) + SIGMA * die.normal();
        Sample { ray: *ray, value, noise }
    };
    let samples: Vec<Sample> = raster_rays(&REGION, 30, 16, 1).iter().map(sample).collect();
    let fit = plain(&samples, &[]).with_truncation(&samples, &[], &[], None).unwrap();
    let ray = |theta_rad: f64| Ray { x_m: 0.0, y_m: 0.015, theta_rad, phi_rad: 0.2 };
    let u = |theta_rad: f64| fit.radiance(&ray(theta_rad)).u;
    // Over whole turns of the basis' ripples, which are in u too.
    let mean_u = |from: f64| (0..30).map(|i| u(from + 0.01 * f64::from(i))).sum::<f64>() / 30.0;
    assert!(mean_u(0.65) > 1.3 * mean_u(0.2), "{} {}", mean_u(0.65), mean_u(0.2));
    let rays: Vec<f64> = (0..120).map(|i| 0.01 * f64::from(i)).collect();
    let holds = |theta_rad: &&f64| {
        let estimate = fit.radiance(&ray(**theta_rad));
        (estimate.value - beam(**theta_rad)).abs() <= 1.96 * estimate.u
    };
    let held = rays.iter().filter(holds).count();
    assert!(held * 100 >= 93 * rays.len(), "{held} of {}", rays.len());
}

#[test]
fn a_noise_known_to_a_factor_of_ten_explains_no_misfit_of_a_thousand() {
    // A bright spot along the axis alone, and noise in proportion to the signal: noise a thousand times
    // as large as stated could make it, but whoever states a noise knows better.
    let mut die = Die::new(2);
    let sample = |ray: &Ray| {
        let level = if ray.theta_rad < 0.05 { 2.0 } else { libm::cos(ray.theta_rad).powi(8) };
        let sigma = 1e-4 * level + 1e-6;
        let noise = Noise::Fixed { variance: sigma * sigma };
        Sample { ray: *ray, value: level + sigma * die.normal(), noise }
    };
    let mut rays = raster_rays(&REGION, 11, 30, 1);
    // Along the axis once.
    rays.drain(1..30);
    let samples: Vec<Sample> = rays.iter().map(sample).collect();
    let fit = plain(&samples, &[]).with_truncation(&samples, &[], &[], None).unwrap();
    let axis = fit.radiance(&Ray { x_m: 0.0, y_m: 0.015, theta_rad: 0.0, phi_rad: 0.0 });
    assert!((axis.value - 2.0).abs() > 0.1, "the basis follows the spot");
    assert!((axis.value - 2.0).abs() <= 3.0 * axis.u, "{} ± {}", axis.value, axis.u);
}
