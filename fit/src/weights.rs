//! Weights that follow from the fit itself.
//!
//! The variance of a reading is modelled from the *fitted* level and the fit is repeated until the
//! weights settle. Weights from the reading's own value would favour readings that came out low:
//! the flux of a source of N photons a reading would come out low by about one photon a reading.
//!
//! Where the residuals scatter beyond the stated noise (the basis can't follow the field, poses
//! jitter, the source drifts) an excess variance, alike for all samples, is added so that the
//! residuals are as large as they should be (Paule & Mandel 1982, J. Res. NBS 87, 377).

use crate::beam::design::Design;
use crate::penalty::Prior;
use crate::solve::{levels, solve};
use crate::{Common, FitError, Noise, Sample, Shift, undetermined};

/// Weights that agree with the fit that they lead to.
pub(crate) struct Settled {
    /// The fit of the last pass.
    pub(crate) coefficients: Vec<f64>,
    /// Its values along the samples' rays.
    pub(crate) levels: Vec<f64>,
    /// What the samples are weighted by.
    pub(crate) variances: Vec<f64>,
    /// The part of each variance that comes from rays off the ones that were meant.
    pub(crate) moved: Vec<f64>,
    /// The part of every variance that the stated noise doesn't hold.
    pub(crate) excess: f64,
}

/// Fits until the weights agree with the fit, in at most `PASSES_MAX` passes. `jitters` are what each
/// sample's ray is off by on its own.
pub(crate) fn settle(
    design: &Design<'_>,
    prior: &Prior,
    jitters: &[&Common],
) -> Result<Settled, FitError> {
    let (samples, basis) = (design.samples(), design.basis());
    let model = Model::of(samples);
    let mut settled = start(samples, model);
    for pass in 0..PASSES_MAX {
        let solution = solve(design, &settled.variances, &[], prior)?;
        if pass == 0 && prior.is_none() {
            let spectrum = solution.spectrum().ok_or(FitError::OutOfRange)?;
            if spectrum.rank() < basis.len() {
                return Err(undetermined::by_rank(samples, basis));
            }
        }
        settled.coefficients = solution.unknowns(0);
        settled.levels = levels(design, &settled.coefficients);
        let determined = prior.determined_by(&solution);
        let dof = (samples.len() as f64 - determined).max(0.0);
        // The field of the second pass is near enough to the last one's: this is of second order.
        if pass < 2 {
            settled.moved = moved(design, &settled.coefficients, jitters)?;
        }
        let stated = model.variances(samples, &settled);
        settled.excess = excess(samples, &settled.levels, &stated, dof);
        let next: Vec<f64> = stated.iter().map(|variance| variance + settled.excess).collect();
        let change = next.iter().zip(&settled.variances).map(|(a, b)| (a / b - 1.0).abs());
        let is_settled = change.fold(0.0, f64::max) < SETTLED_RELATIVE;
        settled.variances = next;
        if is_settled {
            break;
        }
    }
    Ok(settled)
}

/// Before anything is fitted every sample is taken to lie at the mean of all.
fn start(samples: &[Sample], model: Model) -> Settled {
    let mean = samples.iter().map(|s| s.value / samples.len() as f64).sum::<f64>();
    let levels = vec![mean; samples.len()];
    let excess = if has_unknown(samples) { model.mean_square } else { 0.0 };
    let moved = vec![0.0; samples.len()];
    let mut start =
        Settled { coefficients: Vec::new(), levels, variances: Vec::new(), moved, excess };
    let stated = model.variances(samples, &start);
    start.variances = stated.into_iter().map(|variance| variance + excess).collect();
    start
}

/// The variance of each sample by rays that are off each on its own.
pub(crate) fn moved(
    design: &Design<'_>,
    coefficients: &[f64],
    jitters: &[&Common],
) -> Result<Vec<f64>, FitError> {
    let samples = design.samples();
    let mut variances = vec![0.0; samples.len()];
    let mut room = design.room();
    for common in jitters {
        let Shift::Jitter(seen) = &common.shift else { continue };
        for (i, (sample, variance)) in samples.iter().zip(&mut variances).enumerate() {
            let seen = seen(i, &sample.ray);
            *variance += design.change(i, &seen, coefficients, &mut room).powi(2);
        }
        if !variances.iter().all(|variance| variance.is_finite()) {
            return Err(FitError::Common { name: common.name.clone() });
        }
    }
    Ok(variances)
}

/// Whether the noise of any sample is left to the residuals.
pub(crate) fn has_unknown(samples: &[Sample]) -> bool {
    samples.iter().any(|s| s.noise == Noise::Unknown)
}

/// How a variance follows from a level.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Model {
    /// Of the values; 1 where all are 0.
    mean_square: f64,
}

impl Model {
    pub(crate) fn of(samples: &[Sample]) -> Self {
        let n = samples.len() as f64;
        let mean_square = samples.iter().map(|s| s.value * s.value / n).sum::<f64>();
        Self { mean_square: if mean_square > 0.0 { mean_square } else { 1.0 } }
    }

    /// The stated variance of a sample whose fitted level is this. Where nothing is stated it is
    /// no more than rounding: the excess has to say the rest.
    pub(crate) fn variance(self, noise: Noise, level: f64) -> f64 {
        match noise {
            Noise::Fixed { variance } => variance,
            Noise::Modelled { floor, per_radiance } => floor + per_radiance * level.max(0.0),
            Noise::Unknown => f64::EPSILON.powi(2) * self.mean_square,
        }
    }

    /// The standard uncertainty of a sample before anything is fitted, for what needs no more than
    /// its size. Where nothing is stated: a part in a thousand of what the samples are like.
    pub(crate) fn u_of(self, sample: &Sample) -> f64 {
        match sample.noise {
            Noise::Unknown => UNSTATED_RELATIVE * self.mean_square.sqrt(),
            noise => self.variance(noise, sample.value).sqrt(),
        }
    }

    /// What is stated of each sample: its noise at its level, and how well its ray is known.
    fn variances(self, samples: &[Sample], settled: &Settled) -> Vec<f64> {
        let parts = samples.iter().zip(&settled.levels).zip(&settled.moved);
        parts.map(|((s, level), moved)| self.variance(s.noise, *level) + moved).collect()
    }
}

/// The variance τ² that, added to the stated ones, makes Σ r²/(v + τ²) equal the dof (samples less
/// what they determine: what a penalty smooths away is in the posterior, not counted here twice); 0 where the
/// stated noise explains the residuals.
fn excess(samples: &[Sample], levels: &[f64], stated: &[f64], dof: f64) -> f64 {
    let terms: Vec<(f64, f64)> = samples
        .iter()
        .zip(levels)
        .zip(stated)
        .map(|((s, l), variance)| ((s.value - l).powi(2), *variance))
        .collect();
    let sum = |tau2: f64, power: i32| -> f64 {
        terms.iter().map(|(r2, v)| r2 / (v + tau2).powi(power)).sum()
    };
    let threshold = if has_unknown(samples) { dof } else { threshold(dof) };
    if dof <= 0.0 || sum(0.0, 1) <= threshold {
        return 0.0;
    }
    // Newton's method on 1/Σ, which is concave and rising: from 0 it rises to the root.
    let mut tau2 = 0.0;
    for _ in 0..NEWTON_MAX {
        let s = sum(tau2, 1);
        let step = (1.0 / dof - 1.0 / s) * s * s / sum(tau2, 2);
        tau2 += step;
        if step <= NEWTON_RELATIVE * tau2 {
            break;
        }
    }
    tau2
}

/// The chi² beyond which residuals of so many degrees of freedom are larger than the stated noise.
pub(crate) fn threshold(dof: f64) -> f64 {
    dof + EXCESS_SIGMA * (2.0 * dof).sqrt()
}

/// What a sample's uncertainty is taken for where only its size matters.
const UNSTATED_RELATIVE: f64 = 1e-3;
/// More passes than a fit with weights that settle needs (2 to 4).
const PASSES_MAX: usize = 8;
/// Weights are settled when no variance changes by more: the fit is stationary against its
/// weights, so that what is left is of second order.
const SETTLED_RELATIVE: f64 = 0.01;
/// The excess is taken for real beyond this many standard deviations of chi².
const EXCESS_SIGMA: f64 = 3.0;
/// More steps than Newton's method needs from any start.
const NEWTON_MAX: usize = 60;
/// The excess is as exact as this.
const NEWTON_RELATIVE: f64 = 1e-6;
