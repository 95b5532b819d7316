//! Blocks against the fit of all readings in memory.

use super::{Asked, Blocks, Blockwise, Totals, fit};
use crate::scattered::{BASIS, REGION, part, reading};
use crate::{
    Angular, BasisSpec, Common, Fine, Fit, FitError, FittedNuisance, Limit, Noise, Penalised,
    Penalty, Position, Ray, Readings, Resolves, Robust, Sample, Shift, fit_readings,
};

mod once_tests;

const READINGS: usize = 2500;

/// Readings, and how what they share is made for those from one place to another.
struct Source {
    samples: Vec<Sample>,
    flown: Vec<Option<(Ray, Ray)>>,
    limits: Vec<usize>,
    common: fn(usize) -> Vec<Common>,
    nuisances: fn(usize) -> Vec<Common>,
    walks: usize,
}

impl Source {
    /// Of a field that the basis holds, scattering by 0.41; every 50th reading is off by a lot.
    fn new(noise: impl Fn(usize, f64) -> Noise, spoilt: bool) -> Self {
        let sample = |i: usize| {
            let (ray, plain) = reading(i);
            let off = if spoilt && i.is_multiple_of(50) { 9.0 } else { 0.0 };
            let value = plain + off;
            Sample { ray, value, noise: noise(i, value) }
        };
        let samples = (0..READINGS).map(sample).collect();
        let none = |_| Vec::new();
        let (flown, limits) = (Vec::new(), Vec::new());
        Self { samples, flown, limits, common: none, nuisances: none, walks: 0 }
    }

    fn part(&self, from: usize, to: usize, take: &mut dyn FnMut(&Readings<'_>)) {
        let end = to.min(self.flown.len());
        let limits: Vec<usize> =
            self.limits.iter().filter(|i| (from..to).contains(*i)).map(|i| i - from).collect();
        let (common, nuisances) = ((self.common)(from), (self.nuisances)(from));
        take(&Readings {
            flown: self.flown.get(from..end).unwrap_or(&[]),
            limits: &limits,
            common: &common,
            nuisances: &nuisances,
            ..Readings::of(&self.samples[from..to])
        });
    }

    fn in_memory(&self, model: Penalised, robust: Robust) -> (Fit, Vec<FittedNuisance>) {
        let mut whole = None;
        self.part(0, self.samples.len(), &mut |readings| {
            let readings = Readings { robust, ..*readings };
            whole = Some(fit_readings(&readings, &REGION, model, None).unwrap());
        });
        let fit = whole.unwrap();
        let nuisances = fit.weighed().unwrap().nuisances.clone();
        (fit, nuisances)
    }
}

impl Blocks for Source {
    type Error = FitError;

    fn each(
        &mut self,
        take: &mut dyn FnMut(&Readings<'_>) -> Result<(), FitError>,
    ) -> Result<(), FitError> {
        self.walks += 1;
        let mut outcome = Ok(());
        for from in (0..self.samples.len()).step_by(BLOCK) {
            let to = (from + BLOCK).min(self.samples.len());
            self.part(from, to, &mut |readings| {
                if outcome.is_ok() {
                    outcome = take(readings);
                }
            });
        }
        outcome
    }
}

const BLOCK: usize = 170;

/// By blocks, and what each reading's weight, residual and influence on the exitance are.
fn in_blocks(source: &mut Source, model: Penalised, robust: Robust) -> (Blockwise, [Vec<f64>; 3]) {
    in_blocks_with(source, model, robust, (false, &[]))
}

fn in_blocks_with(
    source: &mut Source,
    model: Penalised,
    robust: Robust,
    (with_truncation, others): (bool, &[Penalised]),
) -> (Blockwise, [Vec<f64>; 3]) {
    let mut totals = Totals::default();
    let mut look = |block: &Readings<'_>| {
        totals.take(block);
        Ok(())
    };
    source.each(&mut look).unwrap();
    source.walks = 0;
    let asked = Asked { region: REGION, model, robust, optics: None, with_truncation, others };
    let mut each = [const { Vec::new() }; 3];
    let outcome = fit(source, &totals, &asked, &mut |_, told| {
        each[0].extend_from_slice(&told.weighed.weights);
        each[1].extend_from_slice(&told.weighed.residuals);
        each[2].extend_from_slice(&told.influence.exitance);
    });
    (outcome.unwrap(), each)
}

/// All numbers of a fit within a part of their size, what is left of it where nothing is excess.
fn assert_same(source: &mut Source, model: impl Into<Penalised>, robust: Robust, tolerance: f64) {
    let model = model.into();
    let (whole, nuisances) = source.in_memory(model, robust);
    let (found, each) = in_blocks(source, model, robust);
    let numbers = |fit: &Fit| -> Vec<f64> {
        let estimates = [fit.exitance(), fit.flux(), fit.intensity(0.4, 1.0)];
        let of = |e: &crate::Estimate| [e.value, e.u, e.u_independent];
        let mut all: Vec<f64> = estimates.iter().flat_map(of).collect();
        all.extend([fit.condition(), fit.chi2(), fit.residual_rms(), fit.excess_rms()]);
        all.extend(fit.determined().is_finite().then(|| fit.determined()));
        all.extend_from_slice(fit.coefficients());
        all.extend(fit.parts().shifts.iter().flat_map(|shift| shift.shift.clone()));
        all
    };
    let (a, b) = (numbers(&found.fit), numbers(&whole));
    assert_eq!(a.len(), b.len());
    for (i, (a, b)) in a.iter().zip(&b).enumerate() {
        assert!((a - b).abs() <= tolerance * (1.0 + b.abs()), "number {i}: {a} {b}");
    }
    assert_eq!((found.fit.n_used(), found.fit.dof()), (whole.n_used(), whole.dof()));
    assert_eq!(found.nuisances.len(), nuisances.len());
    for (a, b) in found.nuisances.iter().zip(&nuisances) {
        assert!(a.name == b.name && (a.value - b.value).abs() <= tolerance);
        assert!((a.u - b.u).abs() <= tolerance, "{a:?} {b:?}");
    }
    let weighed = whole.weighed().unwrap();
    let influence = &whole.influence().unwrap().exitance;
    for (a, b) in each.iter().zip([&weighed.weights, &weighed.residuals, influence]) {
        assert_eq!(a.len(), b.len());
        let off = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off <= 30.0 * tolerance, "{off}");
    }
}

fn stated(u: f64) -> impl Fn(usize, f64) -> Noise {
    move |i, _| {
        let u = if i % 2 == 0 { u } else { 1.2 * u };
        Noise::Fixed { variance: u * u }
    }
}

/// As shot noise: 0.41 at 70.
fn modelled(_: usize, _: f64) -> Noise {
    Noise::Modelled { floor: 0.02, per_radiance: 2.2e-3 }
}

#[test]
fn readings_that_are_what_they_read_come_out_as_in_memory() {
    let penalty = Penalty { power: 2.0, strength: 3.0 };
    for model in [BASIS.into(), Penalised::new(BASIS, penalty)] {
        assert_same(&mut Source::new(stated(0.42), false), model, Robust::None, 1e-10);
        assert_same(&mut Source::new(modelled, false), model, Robust::None, 1e-10);
        // Scatter beyond what is stated goes by sums.
        assert_same(&mut Source::new(stated(0.1), false), model, Robust::None, 1e-6);
        assert_same(&mut Source::new(|_, _| Noise::Unknown, false), model, Robust::None, 1e-6);
    }
    let mut source = Source::new(stated(0.42), false);
    in_blocks(&mut source, BASIS.into(), Robust::None);
    assert_eq!(source.walks, 3);
}

#[test]
fn outliers_lose_the_weight_that_they_lose_in_memory() {
    for robust in [Robust::Huber, Robust::Tukey] {
        assert_same(&mut Source::new(stated(0.42), true), BASIS, robust, 1e-9);
        assert_same(&mut Source::new(modelled, true), BASIS, robust, 1e-9);
        assert_same(&mut Source::new(stated(0.1), true), BASIS, robust, 3e-4);
        assert_same(&mut Source::new(|_, _| Noise::Unknown, true), BASIS, robust, 3e-4);
    }
    // It is the outliers that do.
    let (found, each) =
        in_blocks(&mut Source::new(stated(0.42), true), BASIS.into(), Robust::Tukey);
    assert!(each[0].iter().step_by(50).all(|weight| *weight == 0.0));
    assert_eq!(found.fit.n_used(), READINGS - READINGS / 50);
}

#[test]
fn limits_hold_the_field_up_as_in_memory() {
    for robust in [Robust::None, Robust::Tukey] {
        for noise in [0.42, 0.1] {
            let mut source = Source::new(stated(noise), false);
            // Saturated at 74, blocks without any other reading among them.
            let above = |i: &usize| source.samples[*i].value > 74.0 || (340..510).contains(i);
            source.limits = (0..READINGS).filter(above).collect();
            for &i in &source.limits {
                source.samples[i].value = source.samples[i].value.min(74.0);
            }
            assert!(source.limits.len() > 600);
            let tolerance = if noise > 0.4 { 1e-9 } else { 3e-4 };
            assert_same(&mut source, BASIS, robust, tolerance);
        }
    }
}

/// A gain of the second half, and what else goes by the reading.
fn common(from: usize) -> Vec<Common> {
    let half = move |i: usize, level: f64| if from + i > READINGS / 2 { 0.01 * level } else { 0.0 };
    let tilted = |_: usize, ray: &Ray| Ray { theta_rad: ray.theta_rad + 2e-3, ..*ray };
    let jittered = move |i: usize, ray: &Ray| {
        let by = if (from + i).is_multiple_of(3) { 5e-3 } else { 0.0 };
        Ray { theta_rad: ray.theta_rad + by, ..*ray }
    };
    vec![
        Common { name: "scale".into(), u: 0.02, shift: Shift::Scale },
        Common { name: "half".into(), u: 0.01, shift: Shift::Value(Box::new(half)) },
        Common { name: "jitter".into(), u: 5e-3, shift: Shift::Jitter(Box::new(jittered)) },
        Common { name: "dark".into(), u: 0.05, shift: Shift::Offset },
        Common { name: "zero".into(), u: 2e-3, shift: Shift::Ray(Box::new(tilted)) },
    ]
}

/// What goes up with time, and another range's gain.
fn nuisances(from: usize) -> Vec<Common> {
    let drift =
        move |i: usize, level: f64| level * 0.03 * ((from + i) as f64 / READINGS as f64 - 0.5);
    let range =
        move |i: usize, level: f64| if (from + i).is_multiple_of(3) { 0.01 * level } else { 0.0 };
    vec![
        Common { name: "drift".into(), u: 1.0, shift: Shift::Value(Box::new(drift)) },
        Common { name: "range".into(), u: 0.01, shift: Shift::Value(Box::new(range)) },
    ]
}

#[test]
fn what_readings_share_is_carried_and_fitted_along_as_in_memory() {
    for robust in [Robust::None, Robust::Huber] {
        let mut source = Source::new(modelled, robust != Robust::None);
        (source.common, source.nuisances) = (common, nuisances);
        let drifted = |(i, sample): (usize, &mut Sample)| {
            sample.value *= 1.0 + 0.02 * (i as f64 / READINGS as f64 - 0.5);
        };
        source.samples.iter_mut().enumerate().for_each(drifted);
        let way = |sample: &Sample| {
            let end = |by: f64| Ray { theta_rad: sample.ray.theta_rad + by, ..sample.ray };
            (sample.ray.theta_rad < 1.3).then(|| (end(-0.05), end(0.05)))
        };
        source.flown = source.samples[..2000].iter().map(way).collect();
        let (_, along) = source.in_memory(BASIS.into(), robust);
        assert!((along[0].value - 0.67).abs() < 0.1, "{along:?}");
        // The field scatters beyond what is stated, which goes by sums.
        let tolerance = if robust == Robust::None { 1e-6 } else { 3e-4 };
        assert_same(&mut source, BASIS, robust, tolerance);
    }
}

#[test]
fn what_can_be_seen_is_what_is_seen_of_all_readings() {
    let of = |rays: &dyn Fn(usize) -> Ray| {
        let mut source = Source::new(stated(0.42), false);
        let each = source.samples.iter_mut().enumerate();
        each.for_each(|(i, sample)| sample.ray = rays(i));
        let resolves = in_blocks(&mut source, BASIS.into(), Robust::None).0.resolves;
        assert_eq!(resolves, Resolves::of(&source.samples, &REGION, BASIS, None));
        resolves
    };
    // 25 meridians at 5 places, whose readbacks scatter, with a gap of 50° among them.
    let meridians = of(&|i| {
        let jitter = 2e-5 * (part(i, 0.618_034) - 0.5);
        let meridian = (i / 20 % 25) as f64;
        let phi_rad = (13.0 * meridian + if meridian > 11.0 { 37.0 } else { 0.0 }).to_radians();
        let theta_rad = (3.0 + 4.0 * (i % 20) as f64).to_radians() + jitter;
        let x_m = -8e-3 + 4e-3 * (i / 500) as f64;
        Ray { x_m, y_m: 8e-3 - x_m.abs(), theta_rad, phi_rad: phi_rad + jitter }
    });
    let phi = meridians.phi_rad.unwrap();
    assert!((phi.width - 50f64.to_radians()).abs() < 2e-5 && phi.limit == Limit::Sampling);
    assert!((meridians.measured_to_rad - 79f64.to_radians()).abs() < 2e-5);
    // Scattered ones: the hole is wider than what the basis bends in.
    let scattered = of(&|i| Ray { theta_rad: 0.4 * reading(i).0.theta_rad, ..reading(i).0 });
    assert_eq!(scattered.theta_rad.limit, Limit::Sampling);
}

/// A lobe that the basis is too coarse for, on top of the readings.
fn add_lobe(source: &mut Source, height: f64) {
    for Sample { ray, value, .. } in &mut source.samples {
        let off = (ray.theta_rad - 0.5).hypot(ray.theta_rad.sin() * libm::sin(0.5 * ray.phi_rad));
        *value += height * libm::exp(-(off / 0.2).powi(2));
    }
}

/// What the basis can't follow, of the same readings by blocks and in memory.
fn assert_as_truncated(source: &mut Source, robust: Robust, tolerance: f64) {
    let (whole, _) = source.in_memory(BASIS.into(), robust);
    let plain = whole.exitance().u_independent;
    let (samples, flown, common) = (&source.samples, &source.flown, (source.common)(0));
    let whole = whole.with_truncation(samples, flown, &common, None).unwrap();
    let (found, each) = in_blocks_with(source, BASIS.into(), robust, (true, &[]));
    let ray = |theta_rad, phi_rad| Ray { x_m: 2e-3, y_m: -5e-3, theta_rad, phi_rad };
    let numbers = |fit: &Fit| -> Vec<f64> {
        let rays = [ray(0.0, 0.0), ray(0.5, 0.1), ray(0.8, 3.0), ray(1.35, 5.0)];
        let along = rays.iter().map(|ray| fit.radiance(ray));
        let sums = [fit.exitance(), fit.exitance_within(0.9).unwrap(), fit.intensity(0.4, 1.0)];
        let of = |e: crate::Estimate| [e.value, e.u, e.u_independent];
        along.chain(sums).flat_map(of).chain([fit.model().truncation, fit.chi2()]).collect()
    };
    let truncation = |fit: &Fit| {
        let found = fit.parts().truncation.clone().unwrap();
        (found.gain, found.beyond, found.missed.len())
    };
    let ((gain, beyond, missed), expected) = (truncation(&found.fit), truncation(&whole));
    assert!((gain / expected.0 - 1.0).abs() < tolerance, "{gain} {expected:?}");
    assert_eq!((beyond, missed), (expected.1, expected.2));
    for (i, (a, b)) in numbers(&found.fit).iter().zip(numbers(&whole)).enumerate() {
        assert!((a - b).abs() <= tolerance * b.abs(), "number {i}: {a} {b}");
    }
    assert!(whole.exitance().u_independent > 1.3 * plain, "{:?} {plain}", whole.exitance());
    let influence = &whole.influence().unwrap().exitance;
    let largest = influence.iter().copied().fold(0.0, f64::max);
    assert_eq!(each[2].len(), influence.len());
    let off = each[2].iter().zip(influence).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off <= tolerance * largest, "{off} {largest}");
}

#[test]
fn what_functions_cannot_follow_is_in_u_as_in_memory() {
    for (noise, robust, tolerance) in
        [(0.42, Robust::None, 1e-6), (0.1, Robust::None, 1e-6), (0.42, Robust::Huber, 1e-3)]
    {
        let mut source = Source::new(stated(noise), robust != Robust::None);
        add_lobe(&mut source, 4.0);
        assert_as_truncated(&mut source, robust, tolerance);
    }
    let mut source = Source::new(|_, _| Noise::Unknown, false);
    add_lobe(&mut source, 4.0);
    assert_as_truncated(&mut source, Robust::None, 1e-6);
    // With limits, shifts and what is fitted along.
    let mut source = Source::new(modelled, false);
    (source.common, source.nuisances) = (common, nuisances);
    add_lobe(&mut source, 6.0);
    source.limits = (0..READINGS).filter(|i| i % 40 == 7).collect();
    let way = |sample: &Sample| {
        let end = |by: f64| Ray { theta_rad: sample.ray.theta_rad + by, ..sample.ray };
        (sample.ray.theta_rad < 1.3).then(|| (end(-0.05), end(0.05)))
    };
    source.flown = source.samples[..2000].iter().map(way).collect();
    assert_as_truncated(&mut source, Robust::None, 1e-5);
}

#[test]
fn where_functions_follow_all_one_more_walk_finds_nothing() {
    let mut source = Source::new(stated(0.42), false);
    let (found, _) = in_blocks_with(&mut source, BASIS.into(), Robust::None, (true, &[]));
    assert_eq!(source.walks, 4);
    assert!(found.fit.parts().truncation.is_none());
}

#[test]
fn gaps_and_what_other_functions_make_of_them_are_those_in_memory() {
    let mut source = Source::new(stated(0.42), false);
    (source.common, source.nuisances) = (common, nuisances);
    add_lobe(&mut source, 6.0);
    let is_gap = |ray: &Ray| ray.theta_rad > 1.2 || (ray.theta_rad > 0.4 && ray.phi_rad < 1.4);
    source.samples.retain(|sample| !is_gap(&sample.ray));
    let held = Penalty { power: 2.0, strength: 1e-3 };
    let splines = Angular::Splines { theta_spans: 4, phi_spans: 8, fine: Fine::NONE };
    let position = Position::Legendre { degree: 0 };
    let others = [
        Penalised::new(BasisSpec::zernike(7, 1), held),
        Penalised::new(BasisSpec { angular: splines, position }, held),
        // More functions than readings, with nothing held against them: says nothing.
        BasisSpec::zernike(60, 1).into(),
    ];
    let mut whole = None;
    source.part(0, source.samples.len(), &mut |readings| {
        let fit = fit_readings(readings, &REGION, BASIS, None).unwrap();
        whole = Some(fit.with_extrapolation(&others, readings, None));
    });
    let whole = whole.unwrap();
    let (found, _) = in_blocks_with(&mut source, BASIS.into(), Robust::None, (false, &others));
    let numbers = |fit: &Fit| -> Vec<f64> {
        let row = |c: &crate::Contribution| (c.name == crate::EXTRAPOLATION).then_some(c.u);
        let row = fit.contributions().iter().find_map(row).unwrap();
        vec![row, fit.exitance().u, fit.intensity(0.7, 0.7).u, fit.intensity(0.7, 3.0).u]
    };
    let (numbers, expected) = (numbers(&found.fit), numbers(&whole));
    for (a, b) in numbers.iter().zip(&expected) {
        assert!((a / b - 1.0).abs() < 1e-6, "{numbers:?} {expected:?}");
    }
    assert!(expected[0] > 0.2 * expected[1], "{expected:?}");
    assert!(expected[2] > 1.1 * expected[3], "{expected:?}");
    let part = |fit: &Fit| fit.measured_fraction().unwrap();
    assert!((part(&found.fit) - part(&whole)).abs() < 1e-12, "{}", part(&whole));
    assert!(part(&whole) < 0.9, "{}", part(&whole));
}

#[test]
fn what_makes_no_sense_is_refused_as_in_memory() {
    let refused = |source: &mut Source, model: Penalised| {
        let mut totals = Totals::default();
        let mut look = |block: &Readings<'_>| {
            totals.take(block);
            Ok(())
        };
        source.each(&mut look).unwrap();
        let robust = Robust::None;
        let asked = Asked {
            region: REGION,
            model,
            robust,
            optics: None,
            with_truncation: false,
            others: &[],
        };
        fit(source, &totals, &asked, &mut |_, _| {}).unwrap_err()
    };
    let mut source = Source::new(stated(0.42), false);
    source.samples[200].value = f64::NAN;
    // The block's own index.
    let expected = FitError::NotFinite { index: 30, what: "value" };
    assert_eq!(refused(&mut source, BASIS.into()), expected);
    let mut source = Source::new(stated(0.42), false);
    source.limits = (0..READINGS).collect();
    assert_eq!(refused(&mut source, BASIS.into()), FitError::OnlyLimits { readings: READINGS });
    let mut source = Source::new(stated(0.42), false);
    source.samples.iter_mut().for_each(|sample| sample.ray.phi_rad = 0.3);
    let error = refused(&mut source, BASIS.into());
    assert!(matches!(error, FitError::Undetermined { .. }), "{error}");
    source.common = |from| common(from).split_off(from.min(4));
    let error = refused(&mut source, BasisSpec::zernike(0, 0).into());
    assert!(error.to_string().contains("common components of a block"), "{error}");
    source.samples.clear();
    assert_eq!(refused(&mut source, BASIS.into()), FitError::Empty);
}
