//! Shares against the whole.

use super::*;
use crate::blocks::{self, Asked, Blocks, Totals};
use crate::scattered::{BASIS, REGION, part, reading};
use crate::{Common, Fit, Noise, Penalised, Ray, Readings, Robust, Sample, Shift};

/// Readings of a field that the basis holds, scattering by 0.41.
fn samples(count: usize, u: impl Fn(usize) -> Option<f64>) -> Vec<Sample> {
    let sample = |i: usize| {
        let (ray, value) = reading(i);
        let noise = u(i).map_or(Noise::Unknown, |u| Noise::Fixed { variance: u * u });
        Sample { ray, value, noise }
    };
    (0..count).map(sample).collect()
}

fn share(samples: &[Sample], weighting: Weighting) -> Partial {
    let mut share = Accumulator::new(REGION, BASIS, None, weighting).unwrap();
    for block in samples.chunks(100) {
        share.absorb(block).unwrap();
    }
    Partial::from_parts(share.finish().parts()).unwrap()
}

fn merged(samples: &[Sample], weighting: Weighting) -> Partial {
    let mut whole = share(&samples[1000..], weighting);
    whole.merge(&share(&samples[..7], weighting)).unwrap();
    whole.merge(&share(&[], weighting)).unwrap();
    whole.merge(&share(&samples[7..1000], weighting)).unwrap();
    whole
}

fn assert_alike(a: &Fit, b: &Fit, tolerance: f64) {
    let all = |fit: &Fit| -> Vec<f64> {
        let estimates = [fit.exitance(), fit.flux(), fit.intensity(0.4, 1.0)];
        let of = |e: &crate::Estimate| [e.value, e.u, e.u_independent];
        let numbers = [fit.condition(), fit.chi2(), fit.residual_rms(), fit.excess_rms()];
        estimates.iter().flat_map(of).chain(numbers).chain(fit.coefficients().to_vec()).collect()
    };
    for (i, (a, b)) in all(a).into_iter().zip(all(b)).enumerate() {
        assert!((a - b).abs() <= tolerance * (1.0 + b.abs()), "number {i}: {a} {b}");
    }
    assert_eq!((a.n_used(), a.dof()), (b.n_used(), b.dof()));
}

#[test]
fn merged_shares_equal_the_fit_of_all_readings() {
    // Uncertainties that explain the scatter, by turns; alike and too small; not stated.
    let honest = samples(3000, |i| Some(if i % 2 == 0 { 0.42 } else { 0.5 }));
    let small = samples(3000, |_| Some(0.1));
    let none = samples(3000, |_| None);
    for (samples, weighting) in
        [(honest, Weighting::Stated), (small, Weighting::Stated), (none, Weighting::Alike)]
    {
        let whole = crate::fit(&samples, &REGION, BASIS, &[]).unwrap();
        let one = share(&samples, weighting).fit(None).unwrap();
        let several = merged(&samples, weighting).fit(None).unwrap();
        assert_alike(&one, &several, 1e-11);
        // The weighted RMS of residuals is another where the weights differ.
        let tolerance = if samples[0].noise == samples[1].noise { 1e-6 } else { 2e-2 };
        assert_alike(&several, &whole, tolerance);
        let value = |fit: &Fit| fit.exitance().value;
        assert!((value(&several) / value(&whole) - 1.0).abs() < 1e-12);
    }
}

#[test]
fn scatter_beyond_the_stated_noise_is_said() {
    let small = samples(3000, |i| Some(if i % 2 == 0 { 0.1 } else { 0.2 }));
    let closed = merged(&small, Weighting::Stated).close(None).unwrap();
    assert!((2.0..4.0).contains(&closed.u_factor), "{}", closed.u_factor);
    let honest = samples(3000, |_| Some(0.5));
    assert!(
        (merged(&honest, Weighting::Stated).close(None).unwrap().u_factor - 1.0).abs()
            < 0.0_f64.max(1e-15)
    );
}

/// Samples taken in flight, with what they share, in blocks.
struct Taken<'s> {
    samples: &'s [Sample],
    ways: &'s [Option<(Ray, Ray)>],
    block: usize,
}

impl Taken<'_> {
    /// The components of the samples from one on.
    fn common(from: usize) -> [Common; 4] {
        let tilt = |_: usize, ray: &Ray| Ray { theta_rad: ray.theta_rad + 1e-3, ..*ray };
        let value = move |i: usize, _: f64| (from + i) as f64 * 1e-3;
        [
            Common { name: "responsivity".into(), u: 0.02, shift: Shift::Scale },
            Common { name: "dark".into(), u: 0.3, shift: Shift::Offset },
            Common { name: "axis".into(), u: 1.0, shift: Shift::Ray(Box::new(tilt)) },
            Common { name: "drift".into(), u: 1.0, shift: Shift::Value(Box::new(value)) },
        ]
    }

    fn share(self) -> Partial {
        self.share_with(false)
    }

    fn share_with(mut self, with_truncation: bool) -> Partial {
        let mut totals = Totals::default();
        let counted = self.each(&mut |block| {
            totals.take(block);
            Ok(())
        });
        counted.unwrap();
        let asked = Asked {
            region: REGION,
            model: BASIS.into(),
            robust: Robust::None,
            optics: None,
            with_truncation,
            others: &[],
        };
        let share = blocks::share(&mut self, &totals, &asked).unwrap();
        Partial::from_parts(share.parts()).unwrap()
    }
}

impl Blocks for Taken<'_> {
    type Error = FitError;

    fn each(
        &mut self,
        take: &mut dyn FnMut(&Readings<'_>) -> Result<(), FitError>,
    ) -> Result<(), FitError> {
        let ways = self.ways.chunks(self.block);
        for (k, (samples, flown)) in self.samples.chunks(self.block).zip(ways).enumerate() {
            let common = Self::common(k * self.block);
            take(&Readings { flown, common: &common, ..Readings::of(samples) })?;
        }
        Ok(())
    }
}

#[test]
fn a_share_with_common_components_equals_its_fit() {
    let way = |sample: &Sample| {
        let at = |theta_rad| Ray { theta_rad, ..sample.ray };
        let theta_rad = sample.ray.theta_rad;
        (theta_rad < 1.1).then(|| (at(theta_rad), at(theta_rad + 0.2)))
    };
    let of = |u: f64| {
        let samples = samples(900, |_| Some(u));
        let ways: Vec<_> = samples.iter().map(way).collect();
        (samples, ways)
    };
    let (samples, ways) = of(0.5);
    let common = Taken::common(0);
    let readings = Readings { flown: &ways, common: &common, ..Readings::of(&samples) };
    let whole = crate::fit_readings(&readings, &REGION, BASIS, None).unwrap();
    // That they were taken in flight tells.
    let at_rest = crate::fit(&samples, &REGION, BASIS, &common).unwrap();
    let value = |fit: &Fit| fit.exitance().value;
    assert!((value(&at_rest) / value(&whole) - 1.0).abs() > 1e-6);
    for block in [900, 170] {
        let share = Taken { samples: &samples, ways: &ways, block }.share();
        assert_eq!(share.readings(), 900);
        assert_alike(&share.fit(None).unwrap(), &whole, 1e-9);
    }
    // Where they scatter beyond what they state, in blocks as at once.
    let (samples, ways) = of(0.1);
    let [at_once, blocks] = [900, 170].map(|block| {
        let share = Taken { samples: &samples, ways: &ways, block }.share();
        share.fit(None).unwrap()
    });
    assert_alike(&blocks, &at_once, 1e-5);
}

#[test]
fn shares_that_stand_for_something_else_are_refused() {
    let samples = samples(50, |_| Some(0.5));
    let mut one = share(&samples, Weighting::Stated);
    let said = |result: Result<(), PartialError>| result.unwrap_err().to_string();
    let other = Region { theta_max_rad: 1.3, ..REGION };
    let other = Accumulator::new(other, BASIS, None, Weighting::Stated).unwrap().finish();
    assert!(said(one.merge(&other)).contains("region"));
    let other = BasisSpec::zernike(3, 1);
    let other = Accumulator::new(REGION, other, None, Weighting::Stated).unwrap().finish();
    assert!(said(one.merge(&other)).contains("basis"));
    let other = Accumulator::new(REGION, BASIS, None, Weighting::Alike).unwrap().finish();
    assert!(said(one.merge(&other)).contains("weights"));
    assert_eq!(one.readings(), 50);
    let mut parts = one.parts();
    parts.triangle[3] = f64::NAN;
    assert!(matches!(Partial::from_parts(parts), Err(FitError::Parts { .. })));
    let mut share = Accumulator::new(REGION, BASIS, None, Weighting::Stated).unwrap();
    let unknown = Sample { noise: Noise::Unknown, ..samples[0] };
    assert_eq!(share.absorb(&[samples[0], unknown]), Err(PartialError::Noise { index: 1 }));
    assert_eq!(share.finish().readings(), 0);
    let few = one.fit(None).map(|fit| fit.dof());
    assert!(matches!(few, Ok(5)), "{few:?}");
}

#[test]
fn a_penalised_merge_equals_the_penalised_fit() {
    let penalty = Penalty { power: 2.0, strength: 1e-4 };
    let model = Penalised::new(BasisSpec::zernike(8, 1), penalty);
    for (u, weighting) in [(Some(0.45), Weighting::Stated), (None, Weighting::Alike)] {
        let samples = samples(300, |_| u);
        let whole = crate::fit(&samples, &REGION, model, &[]).unwrap();
        let mut shares = samples.chunks(100).map(|samples| {
            let mut share = Accumulator::new(REGION, model, None, weighting).unwrap();
            share.absorb(samples).unwrap();
            share.finish()
        });
        let mut merged = shares.next().unwrap();
        shares.for_each(|share| merged.merge(&share).unwrap());
        let merged = merged.fit(None).unwrap();
        // The fit of all readings stops when its noise agrees to a hundredth.
        let tolerance = if u.is_some() { 1e-9 } else { 2e-2 };
        assert_alike(&merged, &whole, tolerance);
        assert!(merged.dof() > 300 - 135 && merged.dof() < 290);
    }
}

/// Two shares of samples on meridians, their field with a ridge that the basis can't follow.
fn ridged(u: Option<f64>, width_rad: f64) -> (Vec<Sample>, Partial) {
    let sample = |i: usize| {
        let (ray, _) = reading(i);
        let ray = Ray { phi_rad: 0.3 * (i % 21) as f64, theta_rad: 0.03 * (i / 21) as f64, ..ray };
        let noise = part(i, 0.233_7) + part(i, 0.871_3) - 1.0;
        let ridge = 6.0 * libm::exp(-((ray.theta_rad - 0.7) / width_rad).powi(2));
        let noise_of = |u: f64| Noise::Fixed { variance: u * u };
        Sample { ray, value: 80.0 + ridge + noise, noise: u.map_or(Noise::Unknown, noise_of) }
    };
    let samples: Vec<Sample> = (0..21 * 46).map(sample).collect();
    let weighting = if u.is_some() { Weighting::Stated } else { Weighting::Alike };
    let mut shares = samples.chunks(500).map(|samples| {
        let share = Accumulator::new(REGION, BASIS, None, weighting).unwrap();
        let mut share = share.with_truncation().unwrap();
        share.absorb(samples).unwrap();
        Partial::from_parts(share.finish().parts()).unwrap()
    });
    let mut merged = shares.next().unwrap();
    shares.for_each(|share| merged.merge(&share).unwrap());
    (samples, merged)
}

#[test]
fn what_the_functions_cant_follow_is_in_the_merges_u_as_in_that_of_the_whole() {
    for u in [Some(0.41), Some(0.1), None] {
        let (samples, merged) = ridged(u, 0.15);
        let bare = crate::fit(&samples, &REGION, BASIS, &[]).unwrap();
        let whole = bare.clone().with_truncation(&samples, &[], &[], None).unwrap();
        let resolves = merged.resolves(None);
        assert_eq!(resolves, crate::Resolves::of(&samples, &REGION, BASIS, None));
        let closed = merged.close(None).unwrap();
        assert!(closed.fit.parts().truncation.is_some());
        assert_followed_alike((&closed.fit, &whole, &bare), 2e-3);
    }
}

/// By u of radiance along and across the ridge, and of the exitance, which are far more than those without truncation.
fn assert_followed_alike((found, expected, bare): (&Fit, &Fit, &Fit), tolerance: f64) {
    let along = |theta_rad: f64| {
        move |fit: &Fit| {
            fit.radiance(&Ray { x_m: 3e-3, y_m: 0.0, theta_rad, phi_rad: 0.8 }).u_independent
        }
    };
    let exitance = |fit: &Fit| fit.exitance().u_independent;
    let all: [&dyn Fn(&Fit) -> f64; 5] =
        [&along(0.1), &along(0.5), &along(0.7), &along(1.0), &exitance];
    for (i, u) in all.into_iter().enumerate() {
        let (found, expected, bare) = (u(found), u(expected), u(bare));
        assert!((found / expected - 1.0).abs() < tolerance, "number {i}: {found} {expected}");
        assert!(found > 1.2 * bare, "number {i}: {found} {bare}");
    }
}

#[test]
fn a_run_s_shares_know_what_they_share_beside_what_the_functions_cant_follow() {
    let (samples, _) = ridged(Some(0.41), 0.15);
    let ways = vec![None; samples.len()];
    let readings = Taken { samples: &samples, ways: &ways, block: 500 };
    let common = Taken::common(0);
    let all = Readings { common: &common, ..Readings::of(&samples) };
    let bare = crate::fit_readings(&all, &REGION, BASIS, None).unwrap();
    let whole = bare.clone().with_truncation(&samples, &[], &common, None).unwrap();
    let share = readings.share_with(true);
    let shown = share.parts().finer.map(|finer| finer.common);
    assert_eq!(shown.unwrap(), ["axis", "drift"]);
    let closed = share.close(None).unwrap();
    assert_followed_alike((&closed.fit, &whole, &bare), 2e-2);
}

#[test]
fn shares_with_and_without_finer_functions_are_not_merged() {
    let (samples, mut merged) = ridged(Some(0.41), 0.15);
    let said = merged.merge(&share(&samples, Weighting::Stated)).unwrap_err().to_string();
    assert!(said.contains("truncation"), "{said}");
    let parts = merged.parts();
    let cut = |parts: &mut FinerParts| parts.numbers.truncate(900);
    let impossible = |parts: &mut FinerParts| parts.numbers[3] = 2.0;
    let unheard_of = |parts: &mut FinerParts| parts.common.push("moon".to_owned());
    for change in [&cut as &dyn Fn(&mut FinerParts), &impossible, &unheard_of] {
        let mut wrong = parts.clone();
        change(wrong.finer.as_mut().unwrap());
        assert!(matches!(Partial::from_parts(wrong), Err(FitError::Parts { .. })));
    }
    let mut wrong = parts.clone();
    wrong.whereabouts.pop();
    assert!(matches!(Partial::from_parts(wrong), Err(FitError::Parts { .. })));
}

#[test]
fn what_no_place_tells_is_left_out_at_the_merge() {
    // At one place, of which no share knows that it is the only one: its finer functions are of a degree less.
    let basis = BasisSpec::zernike(4, 0);
    let (samples, _) = ridged(Some(0.41), 0.35);
    let at_one =
        |sample: &Sample| Sample { ray: Ray { x_m: 0.0, y_m: 0.0, ..sample.ray }, ..*sample };
    let samples: Vec<Sample> = samples.iter().map(at_one).collect();
    let share = Accumulator::new(REGION, basis, None, Weighting::Stated).unwrap();
    let mut share = share.with_truncation().unwrap();
    share.absorb(&samples).unwrap();
    let closed = share.finish().close(None).unwrap();
    let finer = closed.fit.parts().truncation.as_ref().map(|truncation| truncation.beyond);
    assert_eq!(finer.unwrap().position, crate::Position::Legendre { degree: 0 });
    let bare = crate::fit(&samples, &REGION, basis, &[]).unwrap();
    let whole = bare.clone().with_truncation(&samples, &[], &[], None).unwrap();
    assert_followed_alike((&closed.fit, &whole, &bare), 0.1);
}
