//! Basis and penalty chosen by sweeps left out: fields of many kinds are recovered, and the stated
//! uncertainty covers what the basis can't follow.

#[allow(dead_code, reason = "tests share them")]
mod scenes;

use fit::{
    Angular, AngularKind, BasisSpec, Choice, Fit, Limit, Noise, Penalty, Ray, Region, Resolves,
    Sample, Wish,
};
use scenes::{Die, raster_rays, spread_rays};
use std::f64::consts::FRAC_PI_2;

/// To 80°, at one place.
const CONE: Region = Region::surface((-0.01, 0.01), (-0.01, 0.01), 80.0 / 90.0 * FRAC_PI_2);

fn unit(theta: f64, phi: f64) -> [f64; 3] {
    let ((st, ct), (sp, cp)) = (libm::sincos(theta), libm::sincos(phi));
    [st * cp, st * sp, ct]
}

/// exp(g (cos of the angle to a direction - 1)).
fn lobe(ray: &Ray, g: f64, theta_deg: f64, phi_deg: f64) -> f64 {
    let a = unit(ray.theta_rad, ray.phi_rad);
    let b = unit(theta_deg.to_radians(), phi_deg.to_radians());
    let cos: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    libm::exp(g * (cos - 1.0))
}

type Field = fn(&Ray) -> f64;

const FIELDS: [(&str, Field); 7] = [
    ("limb darkening", |ray| 0.4 + 0.6 * libm::cos(ray.theta_rad)),
    ("batwing", |ray| 0.2 + lobe(ray, 25.0, 35.0, 0.0) + lobe(ray, 25.0, 35.0, 180.0)),
    ("gloss", |ray| 0.2 + lobe(ray, 80.0, 45.0, 30.0)),
    ("cos^10", |ray| libm::pow(libm::cos(ray.theta_rad), 10.0)),
    ("cos^100", |ray| libm::pow(libm::cos(ray.theta_rad), 100.0)),
    ("grazing", |ray| {
        0.2 + libm::exp(-0.5 * ((ray.theta_rad - 1.36) / 0.06).powi(2)) * lobe(ray, 6.0, 78.0, 0.0)
    }),
    ("edge", |ray| 0.1 + 0.9 / (1.0 + libm::exp((ray.theta_rad - 0.9) / 0.04))),
];

fn noisy(rays: &[Ray], field: Field, u: f64, die: &mut Die) -> Vec<Sample> {
    let noise = Noise::Fixed { variance: u * u };
    rays.iter()
        .map(|ray| Sample { ray: *ray, value: field(ray) + u * die.normal(), noise })
        .collect()
}

fn fitted(samples: &[Sample], region: &Region) -> (Fit, Choice) {
    let (model, choice) = fit::choose(samples, region, &Wish::default(), None).unwrap();
    (fit::fit(samples, region, model, &[]).unwrap(), choice.unwrap())
}

/// RMS error of L over the cone, of L's error over u, share within 2 u, median u.
fn errors(fit: &Fit, field: Field, region: &Region) -> (f64, f64, f64, f64) {
    let rays = spread_rays(600, region, 77);
    let (mut squares, mut ratios, mut covered) = (0.0, 0.0, 0.0);
    let mut us = Vec::new();
    for ray in &rays {
        let found = fit.radiance(ray);
        let off = found.value - field(ray);
        squares += off * off;
        ratios += (off / found.u).powi(2);
        covered += f64::from(u8::from(off.abs() < 1.96 * found.u));
        us.push(found.u);
    }
    us.sort_by(f64::total_cmp);
    let n = rays.len() as f64;
    ((squares / n).sqrt(), (ratios / n).sqrt(), covered / n, us[us.len() / 2])
}

fn scattered(count: usize, seed: u64) -> Vec<Ray> {
    let rays = spread_rays(count, &CONE, seed);
    rays.into_iter().map(|ray| Ray { x_m: 0.0, y_m: 0.0, ..ray }).collect()
}

/// Pooled over fields and seeds: RMS of error over u, and the share of rays within 1.96 u.
fn pooled(names: &[&str], rays: &[Ray], seeds: u64) -> (f64, f64) {
    let (mut squares, mut covered, mut count) = (0.0, 0.0, 0.0);
    for (name, field) in FIELDS.iter().filter(|(name, _)| names.contains(name)) {
        for seed in 0..seeds {
            let samples = noisy(rays, *field, 0.002, &mut Die::new(100 + seed));
            let (fit, _) = fitted(&samples, &CONE);
            let (rms, ratio, share, u) = errors(&fit, *field, &CONE);
            println!(
                "{name} {seed}: RMS error {rms:.4}, over u {ratio:.2}, covered {share:.3}, median u {u:.4}"
            );
            assert!(u < 2.5 * rms, "{name}: a u that is merely huge");
            squares += ratio * ratio;
            covered += share;
            count += 1.0;
        }
    }
    ((squares / count).sqrt(), covered / count)
}

#[test]
fn u_covers_the_truth_on_a_raster() {
    let rays = raster_rays(&CONE, 17, 24, 1);
    let names = ["batwing", "cos^10", "edge"];
    let (ratio, covered) = pooled(&names, &rays, 1);
    assert!((0.6..1.2).contains(&ratio) && covered > 0.93, "{ratio} {covered}");
}

#[test]
fn u_covers_the_truth_where_readings_are_scattered() {
    let names = ["limb darkening", "batwing", "cos^100"];
    let (ratio, covered) = pooled(&names, &scattered(500, 5), 1);
    assert!((0.6..1.3).contains(&ratio) && covered > 0.9, "{ratio} {covered}");
}

#[test]
fn a_gap_is_filled_with_uncertainty_not_with_confidence() {
    // Readings to 60° and from 70° on: nothing between.
    let rays: Vec<Ray> = scattered(500, 8)
        .into_iter()
        .filter(|ray| !(60.0..70.0).contains(&ray.theta_rad.to_degrees()))
        .collect();
    let field = FIELDS[1].1;
    let (fit, _) = fitted(&noisy(&rays, field, 0.002, &mut Die::new(4)), &CONE);
    let at = |theta_deg: f64, phi_rad: f64| Ray {
        x_m: 0.0,
        y_m: 0.0,
        theta_rad: theta_deg.to_radians(),
        phi_rad,
    };
    let (mut inside, mut around, mut worst) = (0.0, 0.0, 0.0_f64);
    for i in 0..24 {
        let phi = f64::from(i) * 0.26;
        let found = fit.radiance(&at(65.0, phi));
        inside += found.u;
        around += fit.radiance(&at(50.0, phi)).u;
        worst = worst.max((found.value - field(&at(65.0, phi))).abs() / found.u);
    }
    assert!(inside > 1.5 * around, "{inside} {around}");
    assert!(worst < 4.5, "{worst}");
}

#[test]
fn the_choice_does_not_depend_on_order_or_unit() {
    let rays = raster_rays(&CONE, 9, 12, 1);
    let samples = noisy(&rays, FIELDS[3].1, 0.01, &mut Die::new(2));
    let (fit, choice) = fitted(&samples, &CONE);
    let mut turned = samples.clone();
    turned.reverse();
    turned.rotate_left(31);
    let (fit_turned, choice_turned) = fitted(&turned, &CONE);
    assert_eq!(fit.basis(), fit_turned.basis());
    assert!((fit.exitance().value / fit_turned.exitance().value - 1.0).abs() < 1e-9);
    assert_eq!(choice.candidates.len(), choice_turned.candidates.len());
    let scaled: Vec<Sample> = samples
        .iter()
        .map(|s| Sample {
            value: 1e3 * s.value,
            noise: Noise::Fixed { variance: 1e-4 * 1e6 },
            ..*s
        })
        .collect();
    let (fit_scaled, _) = fitted(&scaled, &CONE);
    assert_eq!(fit.basis(), fit_scaled.basis());
    assert!((fit_scaled.exitance().value / fit.exitance().value - 1e3).abs() < 1e-5);
    assert!((fit_scaled.exitance().u / fit.exitance().u - 1e3).abs() < 1e-3);
}

#[test]
fn what_is_pinned_stays_pinned() {
    let rays = raster_rays(&CONE, 9, 12, 1);
    let samples = noisy(&rays, FIELDS[3].1, 0.01, &mut Die::new(2));
    let choose = |wish: Wish| fit::choose(&samples, &CONE, &wish, None).unwrap();
    let all = Wish { angular_degree: Some(5), position_degree: Some(0), ..Wish::default() };
    let (model, choice) = choose(all);
    assert_eq!((model, choice), (BasisSpec::zernike(5, 0).into(), None));
    for kind in AngularKind::OF_SURFACE {
        let (model, choice) = choose(Wish { kind: Some(kind), ..Wish::default() });
        assert_eq!(model.basis.angular.name(), kind.name());
        let candidates = choice.unwrap().candidates;
        assert!(candidates.len() > 1);
        assert!(candidates.iter().all(|c| c.model.basis.angular.name() == kind.name()));
    }
    let wish = Wish { penalty_power: Some(1.0), ..Wish::default() };
    assert!((choose(wish).0.penalty.power - 1.0).abs() < 1e-12);
    let wish = Wish { penalty_strength: Some(3.0), angular_degree: Some(8), ..Wish::default() };
    let model = choose(wish).0;
    assert_eq!(
        (model.basis.angular.degree(), model.penalty),
        (Some(8), Penalty { power: 2.0, strength: 3.0 })
    );
}

/// The wish for exactly this model.
fn pinned(model: &fit::Penalised) -> Wish {
    let (angular, position) = (model.basis.angular, model.basis.position);
    let kind = AngularKind::ALL.into_iter().find(|kind| kind.name() == angular.name());
    let mut wish = Wish { kind, angular_degree: angular.degree(), ..Wish::default() };
    match angular {
        Angular::Zernike { cosine_columns, .. } => wish.cosine_columns = Some(cosine_columns),
        Angular::Splines { theta_spans, phi_spans, fine } => {
            wish.spans = Some(fit::Spans { theta: theta_spans, phi: phi_spans, fine });
        }
        _ => {}
    }
    match position {
        fit::Position::Legendre { degree } => wish.position_degree = Some(degree),
        fit::Position::Splines { spans } => wish.position_spans = Some(spans),
    }
    let Penalty { power, strength } = model.penalty;
    Wish { penalty_power: Some(power), penalty_strength: Some(strength), ..wish }
}

#[test]
fn all_that_was_tried_can_be_pinned() {
    // A lobe for splines in direction, and waves over the sample for such in position.
    let lobe: Field = |ray| libm::pow(libm::cos(ray.theta_rad), 400.0);
    let waves: Field = |ray| libm::cos(ray.theta_rad) + libm::sin(500.0 * ray.x_m);
    let mut candidates = Vec::new();
    for (rays, field) in
        [(raster_rays(&CONE, 81, 12, 1), lobe), (raster_rays(&CONE, 5, 4, 9), waves)]
    {
        let samples = noisy(&rays, field, 0.002, &mut Die::new(4));
        let choice = fit::choose(&samples, &CONE, &Wish::default(), None).unwrap().1.unwrap();
        candidates.extend(choice.candidates.into_iter().map(|candidate| candidate.model));
    }
    let is_tried = |of: &dyn Fn(&BasisSpec) -> bool| candidates.iter().any(|c| of(&c.basis));
    assert!(is_tried(&|spec| matches!(spec.angular, Angular::Zernike { cosine_columns: 2, .. })));
    assert!(is_tried(
        &|spec| matches!(spec.angular, Angular::Splines { fine, .. } if !fine.is_none())
    ));
    assert!(is_tried(&|spec| matches!(spec.position, fit::Position::Splines { .. })));
    for model in &candidates {
        let wish = pinned(model);
        assert_eq!((wish.clash(), wish.decided()), (None, Some(*model)));
    }
}

/// A ridge 6° wide in θ and 25° long in φ, beside the horizon: finer spans of θ all round, as many as
/// are affordable, do not follow its ends.
#[test]
fn what_is_narrow_both_ways_is_followed_in_a_patch() {
    let field: Field =
        |ray| 0.2 + (0..5).map(|k| lobe(ray, 500.0, 70.0, 5.0 * f64::from(k) - 12.0)).sum::<f64>();
    let samples = noisy(&raster_rays(&CONE, 41, 90, 1), field, 0.002, &mut Die::new(5));
    let (fit, choice) = fitted(&samples, &CONE);
    let Angular::Splines { theta_spans, phi_spans, fine } =
        choice.candidates[0].model.basis.angular
    else {
        panic!("{:?}", choice.candidates[0])
    };
    assert!(!fine.around.is_none() && fine.around.halvings > 1, "{fine:?}");
    // The patch lies about the ridge, which goes through φ = 0.
    let deg = |span: usize, spans: usize, whole: f64| whole * span as f64 / spans as f64;
    let (from, to) = (deg(fine.from, theta_spans, 90.0), deg(fine.to, theta_spans, 90.0));
    assert!(from < 66.0 && to > 74.0, "{from} {to}");
    let around = fine.around;
    let (from, to) = (deg(around.from, phi_spans, 360.0), deg(around.to, phi_spans, 360.0));
    assert!(from - 360.0 < -12.0 && to - 360.0 > 8.0 && to - from < 181.0, "{from} {to}");
    let (rms, ratio, covered, _) = errors(&fit, field, &CONE);
    assert!(rms < 0.006 && ratio < 2.0 && covered > 0.93, "{rms} {ratio} {covered}");
    let without = |c: &&fit::Candidate| matches!(c.model.basis.angular, Angular::Splines { fine, .. } if fine.around.is_none());
    let without = choice.candidates.iter().find(without).unwrap().model;
    let coarse = fit::fit(&samples, &CONE, without, &[]).unwrap();
    let (coarse, ..) = errors(&coarse, field, &CONE);
    assert!(coarse > 3.0 * rms, "{coarse} {rms}");
}

/// Whole sweeps are left out, so that nothing tells how functions go between a sweep's readings: in patches of a
/// third of their distance a lobe this narrow was off by a fifth.
#[test]
fn no_patch_is_much_finer_than_readings_along_a_sweep() {
    let field: Field = |ray| 0.2 * libm::cos(ray.theta_rad) + lobe(ray, 1300.0, 30.0, 101.0);
    let samples = noisy(&raster_rays(&CONE, 21, 36, 1), field, 0.002, &mut Die::new(7));
    let step_deg = CONE.theta_max_rad.to_degrees() / 20.0;
    // Of each patch how many of its spans lie between readings of a sweep.
    let spans_between = |choice: &fit::Choice| -> Vec<f64> {
        let of = |candidate: &fit::Candidate| match candidate.model.basis.angular {
            Angular::Splines { theta_spans, fine, .. } if !fine.around.is_none() => {
                Some(step_deg / 90.0 * (theta_spans << fine.halvings) as f64)
            }
            _ => None,
        };
        choice.candidates.iter().filter_map(of).collect()
    };
    let (_, choice) = fitted(&samples, &CONE);
    let at_rest = spans_between(&choice);
    assert!(at_rest.len() > 2 && at_rest.iter().all(|spans| *spans <= 2.0), "{at_rest:?}");
    // In flight nothing lies between them.
    let flown = fit::choose_flown(&samples, &CONE, &Wish::default(), None).unwrap().1.unwrap();
    let flown = spans_between(&flown);
    assert!(flown.iter().any(|spans| *spans > 2.0), "{flown:?}");
    assert!(flown.iter().all(|spans| *spans <= 4.0), "{flown:?}");
}

/// Many functions of the position leave no room for splines in direction: no patch, and no refusal.
#[test]
fn a_patch_that_is_not_affordable_is_not_tried() {
    let field: Field = |ray| 0.2 + lobe(ray, 400.0, 45.0, 45.0);
    let samples = noisy(&raster_rays(&CONE, 9, 8, 6), field, 0.002, &mut Die::new(3));
    let wish = Wish { position_degree: Some(8), ..Wish::default() };
    let (_, choice) = fit::choose(&samples, &CONE, &wish, None).unwrap();
    let candidates = choice.unwrap().candidates;
    // What is tried misses enough to ask for one.
    assert!(candidates[0].left_out_rms > 3.0, "{}", candidates[0].left_out_rms);
    let is_patch = |c: &fit::Candidate| matches!(c.model.basis.angular, Angular::Splines { fine, .. } if !fine.around.is_none());
    assert!(!candidates.iter().any(is_patch));
}

/// Too few readings to leave any out. Were the penalty dropped, nothing would hold the splines.
#[test]
fn what_is_pinned_holds_where_nothing_can_be_chosen() {
    let samples = noisy(&scattered(3, 3), FIELDS[3].1, 0.01, &mut Die::new(2));
    let spans = Some(fit::Spans { theta: 4, phi: 8, fine: fit::Fine::NONE });
    let wish = Wish { spans, penalty_strength: Some(1e-13), ..Wish::default() };
    let (model, _) = fit::choose(&samples, &CONE, &wish, None).unwrap();
    assert!(matches!(model.basis.angular, Angular::Splines { theta_spans: 4, phi_spans: 8, .. }));
    assert!((model.penalty.strength / 1e-13 - 1.0).abs() < 1e-12, "{model:?}");
    assert!(fit::fit(&samples, &CONE, model, &[]).is_ok());
}

#[test]
fn of_pinned_splines_the_penalty_is_chosen() {
    let rays = raster_rays(&CONE, 21, 12, 1);
    let samples = noisy(&rays, FIELDS[3].1, 0.01, &mut Die::new(2));
    let spans = Some(fit::Spans { theta: 7, phi: 12, fine: fit::Fine::NONE });
    let wish = Wish { spans, position_degree: Some(0), ..Wish::default() };
    let (model, choice) = fit::choose(&samples, &CONE, &wish, None).unwrap();
    assert_eq!(choice.unwrap().candidates.len(), 1);
    let Angular::Splines { theta_spans: 7, phi_spans: 12, fine } = model.basis.angular else {
        panic!("{model:?}")
    };
    assert!(fine.is_none() && model.penalty.strength > 0.0, "{model:?}");
}

#[test]
fn what_cannot_be_had_together_is_told_and_so_is_a_strength_that_cannot_be_chosen() {
    let spans = Some(fit::Spans { theta: 60, phi: 60, fine: fit::Fine::NONE });
    let splines = Some(AngularKind::Splines);
    let all = Wish::default();
    for (wish, clash) in [
        (Wish { kind: splines, angular_degree: Some(3), ..all }, fit::WishClash::DegreeOfSplines),
        (Wish { spans, angular_degree: Some(3), ..all }, fit::WishClash::DegreeOfSplines),
        (Wish { spans, kind: Some(AngularKind::Spherical), ..all }, fit::WishClash::SpansOfOthers),
        (Wish { cosine_columns: Some(2), ..all }, fit::WishClash::CosineColumns),
        (
            Wish { position_degree: Some(1), position_spans: Some(4), ..all },
            fit::WishClash::DegreeAndSpans,
        ),
    ] {
        assert_eq!(wish.clash(), Some(clash));
    }
    let rays = raster_rays(&CONE, 9, 12, 1);
    let samples = noisy(&rays, FIELDS[3].1, 0.01, &mut Die::new(2));
    let many = Wish { spans, position_degree: Some(0), ..all };
    assert_eq!(many.clash(), Some(fit::WishClash::OpenStrength));
    let refused = fit::choose(&samples, &CONE, &many, None).unwrap_err();
    assert!(refused.to_string().contains("expected a strength, or fewer spans"), "{refused}");
    let held = Wish { penalty_strength: Some(1.0), ..many };
    let model = fit::choose(&samples, &CONE, &held, None).unwrap().0;
    assert!(fit::fit(&samples, &CONE, model, &[]).unwrap().is_sparse());
}

#[test]
fn readings_of_unknown_noise_and_few_of_them_have_a_fit() {
    for count in [2, 3, 7, 20] {
        let rays = scattered(count, 3);
        let samples: Vec<Sample> = rays
            .iter()
            .enumerate()
            .map(|(i, ray)| Sample {
                ray: *ray,
                value: 1.0 + 1e-3 * libm::sin(i as f64),
                noise: Noise::Unknown,
            })
            .collect();
        let (model, _) = fit::choose(&samples, &CONE, &Wish::default(), None).unwrap();
        let fit = fit::fit(&samples, &CONE, model, &[]).unwrap();
        let exitance = fit.exitance_within_region();
        assert!(exitance.u > 0.0 && exitance.u < 0.1 * exitance.value, "{count}: {exitance:?}");
    }
}

#[test]
fn what_can_be_resolved_is_what_basis_plan_and_beam_allow() {
    let rays = raster_rays(&CONE, 17, 12, 1);
    let samples = noisy(&rays, FIELDS[0].1, 0.01, &mut Die::new(1));
    let fine = Resolves::of(&samples, &CONE, BasisSpec::zernike(40, 0), None);
    assert!((fine.theta_rad.width.to_degrees() - 5.0).abs() < 1e-6, "{fine:?}");
    let phi = fine.phi_rad.unwrap();
    assert_eq!((fine.theta_rad.limit, phi.limit), (Limit::Sampling, Limit::Sampling));
    assert!((phi.width.to_degrees() - 30.0).abs() < 1e-6, "{phi:?}");
    assert!((fine.measured_to_rad - CONE.theta_max_rad).abs() < 1e-12);
    let coarse = Resolves::of(&samples, &CONE, BasisSpec::zernike(4, 0), None);
    assert_eq!(coarse.theta_rad.limit, Limit::Basis);
    assert!((coarse.theta_rad.width.to_degrees() - 45.0).abs() < 1e-9);
    assert_eq!((coarse.x_m, coarse.y_m), (None, None));
}

#[test]
fn a_lobe_narrower_than_even_splines_follow_gets_finer_ones() {
    let rays = raster_rays(&CONE, 81, 12, 1);
    let field: Field = |ray| libm::pow(libm::cos(ray.theta_rad), 400.0);
    let u = 0.002;
    let samples = noisy(&rays, field, u, &mut Die::new(3));
    let wish = Wish { kind: Some(AngularKind::Splines), ..Wish::default() };
    let (model, _) = fit::choose(&samples, &CONE, &wish, None).unwrap();
    let Angular::Splines { fine, .. } = model.basis.angular else { panic!("{model:?}") };
    assert!(fine.halvings > 0 && fine.from == 0, "{fine:?}");
    let (rms, ..) = errors(&fit::fit(&samples, &CONE, model, &[]).unwrap(), field, &CONE);
    // Even spans leave four times as much.
    assert!(rms < 1.2 * u, "{rms}");
}

#[test]
fn a_field_even_in_x_is_not_taken_for_alike_everywhere() {
    let rays: Vec<Ray> = raster_rays(&CONE, 7, 6, 3);
    let field: Field = |ray| libm::cos(ray.theta_rad) * (1.0 - 5e3 * ray.x_m * ray.x_m);
    let samples = noisy(&rays, field, 0.002, &mut Die::new(6));
    let (fit, _) = fitted(&samples, &CONE);
    assert_eq!(fit.basis().position.degree(), Some(2));
}
