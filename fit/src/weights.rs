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
use crate::excess::{Scatter, cut_excess, excess};
use crate::limit;
use crate::penalty::Prior;
use crate::readings::Readings;
use crate::solve::{Rows, levels, sensitivities, solve};
use crate::{Common, FitError, Noise, Robust, Sample, Shift, undetermined};

/// Weights that agree with the fit that they lead to.
pub(crate) struct Settled {
    /// The fit of the last pass.
    pub(crate) coefficients: Vec<f64>,
    /// The field's values along the samples' rays.
    pub(crate) levels: Vec<f64>,
    /// What the nuisances do to the samples, by one u each: a vector over the samples for each.
    pub(crate) columns: Vec<Vec<f64>>,
    /// What they are found to be, in u.
    pub(crate) nuisances: Vec<f64>,
    /// What the samples count as having read: their values, but for limits.
    pub(crate) values: Vec<f64>,
    /// What the samples are weighted by; infinite of those that count for nothing.
    pub(crate) variances: Vec<f64>,
    /// The part of them that is stated; of samples that count for less it counts for less as well.
    pub(crate) stated: Vec<f64>,
    /// What is left of each one's weight: 1 but for outliers and limits.
    pub(crate) weights: Vec<f64>,
    /// The part of each variance that comes from rays off the ones that were meant.
    pub(crate) moved: Vec<f64>,
    /// The part of every variance that the stated noise doesn't hold.
    pub(crate) excess: f64,
    /// What the samples determine of the coefficients.
    pub(crate) determined: f64,
}

/// Fits until the weights agree with the fit, in at most `PASSES_MAX` passes for each way of weighing.
/// `jitters` are what each sample's ray is off by on its own.
pub(crate) fn settle(
    design: &Design<'_>,
    prior: &Prior,
    readings: &Readings<'_>,
    jitters: &[&Common],
) -> Result<Settled, FitError> {
    let (samples, basis) = (design.samples(), design.basis());
    let model = Model::of(samples);
    let mut settled = start(readings, model);
    let mut passes = 0;
    for robust in readings.robust.phases() {
        let mut most = PASSES_MAX;
        if *robust != Robust::None || !readings.limits.is_empty() {
            most = REWEIGHING_MAX;
        }
        for _ in 0..most {
            let solved = solve(design, &settled.rows(), &[], prior)?;
            let solution = &solved.field;
            if passes == 0 && prior.is_none() {
                let spectrum = solution.spectrum().ok_or(FitError::OutOfRange)?;
                if spectrum.rank() < basis.len() {
                    return Err(undetermined::by_rank(samples, basis));
                }
            }
            settled.coefficients = solution.unknowns(0);
            settled.nuisances = solved.nuisances(&settled.coefficients);
            settled.levels = levels(design, &settled.coefficients);
            settled.determined = prior.determined_by(solution);
            // The field of the second pass is near enough to the last one's: this is of second order.
            if passes < 2 {
                settled.moved = moved(design, &settled.coefficients, jitters)?;
            }
            passes += 1;
            let is_settled = settled.reweigh(readings, model, *robust);
            if !readings.nuisances.is_empty() {
                let nuisances: Vec<&Common> = readings.nuisances.iter().collect();
                settled.columns = sensitivities(design, &settled, &nuisances)?;
            }
            if is_settled {
                break;
            }
        }
    }
    Ok(settled)
}

/// Before anything is fitted every sample is taken to lie at the mean of all.
pub(crate) fn start(readings: &Readings<'_>, model: Model) -> Settled {
    let samples = readings.samples;
    let mean = samples.iter().map(|s| s.value / samples.len() as f64).sum::<f64>();
    start_at(readings, model, mean, has_unknown(samples))
}

/// The same of a part of all samples, whose mean is known; `is_unknown`: the noise of some is left to
/// the residuals.
pub(crate) fn start_at(
    readings: &Readings<'_>,
    model: Model,
    mean: f64,
    is_unknown: bool,
) -> Settled {
    let samples = readings.samples;
    let n = samples.len();
    let excess = if is_unknown { model.mean_square } else { 0.0 };
    let mut start = Settled {
        coefficients: Vec::new(),
        levels: vec![mean; n],
        columns: vec![vec![0.0; n]; readings.nuisances.len()],
        nuisances: vec![0.0; readings.nuisances.len()],
        values: samples.iter().map(|sample| sample.value).collect(),
        variances: Vec::new(),
        stated: Vec::new(),
        weights: vec![1.0; n],
        moved: vec![0.0; n],
        excess,
        determined: 0.0,
    };
    start.stated = model.variances(samples, &start);
    start.variances = start.stated.iter().map(|variance| variance + excess).collect();
    start
}

impl Settled {
    /// Where level and variance of every sample are known beforehand.
    pub(crate) fn known(
        coefficients: Vec<f64>,
        levels: Vec<f64>,
        variances: Vec<f64>,
        moved: Vec<f64>,
    ) -> Self {
        Self {
            coefficients,
            columns: Vec::new(),
            nuisances: Vec::new(),
            values: levels.clone(),
            weights: vec![1.0; levels.len()],
            levels,
            stated: variances.clone(),
            variances,
            moved,
            excess: 0.0,
            determined: 0.0,
        }
    }

    pub(crate) fn rows(&self) -> Rows<'_> {
        Rows { values: &self.values, variances: &self.variances, columns: &self.columns }
    }

    /// What each sample should have read, by the field and the nuisances.
    pub(crate) fn expected(&self) -> Vec<f64> {
        let mut expected = self.levels.clone();
        for (column, times) in self.columns.iter().zip(&self.nuisances) {
            expected.iter_mut().zip(column).for_each(|(sum, z)| *sum += times * z);
        }
        expected
    }

    /// How many samples say what they read.
    pub(crate) fn kept(&self, limits: &[usize]) -> usize {
        let is_kept =
            |(i, weight): (usize, &f64)| *weight > 0.0 && limits.binary_search(&i).is_err();
        self.weights.iter().enumerate().filter(|each| is_kept(*each)).count()
    }

    /// The variance of a residual over that of its sample: on average the coefficients take as much of
    /// it as there are coefficients for a sample.
    pub(crate) fn shrink(&self) -> f64 {
        shrink(self.determined, self.levels.len())
    }

    /// The weights by this fit; whether they are about as they were.
    pub(crate) fn reweigh(
        &mut self,
        readings: &Readings<'_>,
        model: Model,
        robust: Robust,
    ) -> bool {
        let terms = self.terms(readings, model);
        let dof = (terms.len() as f64 - self.determined).max(0.0);
        self.excess = excess_by(&terms, dof, has_unknown(readings.samples), robust);
        self.weigh(readings, model, robust, self.shrink()) < SETTLED_RELATIVE
    }

    /// The squared residual and the stated variance of the samples that say what they read.
    pub(crate) fn terms(&self, readings: &Readings<'_>, model: Model) -> Vec<(f64, f64)> {
        let (samples, limits) = (readings.samples, readings.limits);
        let expected = self.expected();
        let stated = model.variances(samples, self);
        (0..samples.len())
            .filter(|i| self.weights[*i] > 0.0 && limits.binary_search(i).is_err())
            .map(|i| ((samples[i].value - expected[i]).powi(2), stated[i]))
            .collect()
    }

    /// The weights under the excess that is known; by how much the largest change of them changes.
    pub(crate) fn weigh(
        &mut self,
        readings: &Readings<'_>,
        model: Model,
        robust: Robust,
        shrink: f64,
    ) -> f64 {
        let (samples, limits) = (readings.samples, readings.limits);
        let expected = self.expected();
        let stated = model.variances(samples, self);
        let is_limit = |i: usize| limits.binary_search(&i).is_ok();
        let mut change = 0.0_f64;
        for (i, stated) in stated.into_iter().enumerate() {
            let variance = stated + self.excess;
            let (old_variance, old_value) = (self.variances[i], self.values[i]);
            let old_weight = self.weights[i];
            if is_limit(i) {
                let working = limit::working(samples[i].value, expected[i], variance);
                // One far above all that is around it is a disturbance too.
                let z = (samples[i].value - expected[i]).max(0.0) / (variance * shrink).sqrt();
                self.weights[i] = robust.weight(z) * variance / working.variance;
                (self.values[i], self.variances[i]) = (working.value, variance / self.weights[i]);
                let moved = (working.value - old_value) / variance.sqrt();
                change = change.max(moved.abs() * self.weights[i].sqrt());
            } else {
                let z = (samples[i].value - expected[i]) / (variance * shrink).sqrt();
                self.weights[i] = robust.weight(z);
                self.variances[i] = variance / self.weights[i];
                if old_weight > 0.0 && self.weights[i] > 0.0 {
                    let old = old_variance * old_weight;
                    change = change.max((variance / old - 1.0).abs());
                }
            }
            // Nothing is left to be divided of a weight of 0.
            self.stated[i] =
                if self.weights[i] > 0.0 { stated / self.weights[i] } else { f64::INFINITY };
            change = change.max((self.weights[i] - old_weight).abs());
        }
        change
    }
}

/// See [`Settled::shrink`].
pub(crate) fn shrink(determined: f64, samples: usize) -> f64 {
    (1.0 - determined / samples as f64).max(SHRINK_MIN)
}

/// The scatter beyond what is stated, outliers weighed like this.
pub(crate) fn excess_by(terms: &impl Scatter, dof: f64, is_unknown: bool, robust: Robust) -> f64 {
    if robust == Robust::None {
        excess(terms, dof, is_unknown)
    } else {
        cut_excess(terms, dof, is_unknown)
    }
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
        Self::of_mean_square(samples.iter().map(|s| s.value * s.value / n).sum::<f64>())
    }

    /// Of samples of which no more is known.
    pub(crate) fn of_mean_square(mean_square: f64) -> Self {
        Self { mean_square: if mean_square > 0.0 { mean_square } else { 1.0 } }
    }

    pub(crate) fn mean_square(self) -> f64 {
        self.mean_square
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

/// What a sample's uncertainty is taken for where only its size matters.
const UNSTATED_RELATIVE: f64 = 1e-3;
/// More passes than a fit with weights that settle needs (2 to 4).
pub(crate) const PASSES_MAX: usize = 8;
/// Outliers and limits need more: what is downweighted shows how large the others are.
pub(crate) const REWEIGHING_MAX: usize = 40;
/// Weights are settled when no variance changes by more: the fit is stationary against its
/// weights, so that what is left is of second order.
pub(crate) const SETTLED_RELATIVE: f64 = 0.01;
/// A residual is not taken for smaller than this part of its sample's variance would make it.
const SHRINK_MIN: f64 = 0.05;
