//! Shares against the whole.

use super::*;
use crate::blocks::{self, Asked, Blocks, Totals};
use crate::scattered::{BASIS, REGION, reading};
use crate::{Common, Fit, Ray, Readings, Robust, Shift};

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

    fn share(mut self) -> Partial {
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
            with_truncation: false,
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
