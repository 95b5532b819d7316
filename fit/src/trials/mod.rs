//! Propagation of distributions (JCGM 101:2008): the readings that might have been, refitted.
//!
//! In each trial every reading is off by a draw of its own noise, every common component by a draw of
//! its own, and the least-squares fit of those readings takes the place of the fit that was made: the
//! same weights, the same triangle, one more right-hand side. What isn't linear in the field (where
//! it is largest, how wide it is) is then asked of each trial's field, so that its spread and its
//! asymmetry show, which the law of propagation of uncertainty can only linearise.
//!
//! All draws are normal: the noise of a reading is the sum of many causes, and of a common component
//! no more than its u is known. What a penalty holds against the field is drawn like a reading
//! (a sample of the posterior by perturbed data: Papandreou and Yuille 2010, "Gaussian sampling by
//! local perturbations"), and so is what is known beforehand of what was fitted along. What a
//! component does to the coefficients is linear, as in the fit's own u. What the functions can't
//! follow ([`Truncation`]) is a draw for each field missed, as much larger along a ray as the field is
//! rougher there; and one for each component of what is not known where nothing was measured.
//!
//! This room rolls no dice: normal deviates are handed in.

mod spread;

use crate::basis::dot;
use crate::beam::Optics;
use crate::beam::design::Design;
use crate::nuisance::Solved;
use crate::peak::{Top, along};
use crate::penalty::Prior;
use crate::solve::{Rows, solve};
use crate::{Fit, FitError, Functional, Ray, Readings, Truncation};
use faer::Mat;
pub use spread::{Interval, Spread};

/// Trials of a fit's readings, ready to be made.
#[derive(Debug)]
pub struct Trials<'f> {
    fit: &'f Fit,
    design: Design<'f>,
    /// What each reading's row is divided by; infinite of readings that count for nothing.
    sigmas: Vec<f64>,
    columns: &'f [Vec<f64>],
    prior: Prior,
    solved: Solved,
    /// Of reweighed readings: by how much more the coefficients scatter than their weights say.
    inflation: f64,
    /// One u of every common component.
    shifts: Vec<&'f [f64]>,
    tops: Vec<Top>,
}

/// One trial's field.
#[derive(Debug, Clone, Copy)]
pub struct Trial<'t> {
    trials: &'t Trials<'t>,
    /// Over the fit's own functions and those beyond.
    field: &'t [f64],
    /// What of that the fit's functions can't follow; empty where nothing is known to be missed.
    missed: &'t [f64],
    /// What is finer than all functions, along a ray.
    finer: f64,
    /// How much of each component of what is not known where nothing was measured.
    unmeasured: &'t [f64],
}

/// Where a trial's field is largest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrialPeak {
    /// The radiance there.
    pub radiance: f64,
    /// Where.
    pub ray: Ray,
}

impl Fit {
    /// Readies trials of the readings that the fit was made of, by the optics that it was made with.
    /// Costs one pass of their rows. A fit that was stored, merged from shares, made symmetric or
    /// held above zero can't be tried: its readings are not at hand, or refitting them isn't linear.
    pub fn trials<'f>(
        &'f self,
        readings: &Readings<'f>,
        optics: Option<&Optics>,
    ) -> Result<Trials<'f>, FitError> {
        let missing = |missing| FitError::Trials { missing };
        let influence = self.influence().ok_or_else(|| missing("the fit's readings"))?;
        let samples = readings.samples;
        if influence.variances.len() != samples.len() {
            return Err(missing("the readings that the fit was made of"));
        }
        let design = Design::new(samples, self.functions(), optics)?.in_flight(readings.flown);
        let prior = Prior::new(self.functions(), self.penalty())?;
        let columns = influence.columns.as_slice();
        let rows = Rows { values: &influence.values, variances: &influence.variances, columns };
        let solved = solve(&design, &rows, &[], &prior)?;
        // What is fitted along is drawn with the readings that tell of it.
        let is_fitted = |name: &str| readings.nuisances.iter().any(|common| common.name == name);
        let shifts = self.parts().shifts.iter().filter(|common| !is_fitted(&common.name));
        Ok(Trials {
            fit: self,
            design,
            sigmas: influence.variances.iter().map(|variance| variance.sqrt()).collect(),
            columns,
            prior,
            solved,
            inflation: self.weighed().map_or(1.0, |weighed| weighed.robust.inflation()),
            shifts: shifts.map(|common| common.shift.as_slice()).collect(),
            tops: self.tops(),
        })
    }

    /// The mean exitance as a functional: of what [`Fit::exitance`] is the value.
    pub fn exitance_sum(&self) -> Functional {
        let all = self.functional(|basis| basis.exitance().to_vec());
        all.with_unmeasured(self.unmeasured())
    }

    /// The flux as a functional: of what [`Fit::flux`] is the value.
    pub fn flux_sum(&self) -> Functional {
        self.throughput_sum()
    }
}

impl Trials<'_> {
    /// Makes so many trials and hands each one over. `normal` yields independent standard normal
    /// deviates; the same deviates make the same trials.
    pub fn run(
        &self,
        count: usize,
        normal: &mut dyn FnMut() -> f64,
        each: &mut dyn FnMut(&Trial<'_>),
    ) {
        let p = self.fit.coefficients().len();
        let whole = p + self.missed().map_or(0, |missed| missed.first().map_or(0, Vec::len) - p);
        let most = (NUMBERS_MAX / (2 * whole + self.columns.len())).clamp(1, BLOCK_MAX);
        let components = self.fit.weighted_rays([]).unmeasured().len();
        let mut left = count;
        while left > 0 {
            let block = left.min(most);
            let Block { fields, missed } = self.block(block, whole, normal);
            for t in 0..block {
                let finer = self.fit.parts().model.truncation;
                let finer = if finer > 0.0 { finer * normal() } else { 0.0 };
                let missed = missed.as_ref().map_or(&[][..], |missed| missed.col_as_slice(t));
                let unmeasured: Vec<f64> = (0..components).map(|_| normal()).collect();
                let (trials, field) = (self, fields.col_as_slice(t));
                each(&Trial { trials, field, missed, finer, unmeasured: &unmeasured });
            }
            left -= block;
        }
    }

    /// Fields of so many trials but for the scale: a column each, over all functions.
    fn block(&self, count: usize, whole: usize, normal: &mut dyn FnMut() -> f64) -> Block {
        let coefficients = self.fit.coefficients();
        let p = coefficients.len();
        let refitted = self.refitted(count, normal);
        let factor = self.inflation.sqrt();
        let mut fields = Mat::from_fn(whole, count, |i, t| {
            if i < p { coefficients[i] + factor * refitted[(i, t)] } else { 0.0 }
        });
        if !self.shifts.is_empty() {
            let shifts = Mat::from_fn(whole, self.shifts.len(), |i, k| {
                self.shifts[k].get(i).copied().unwrap_or(0.0)
            });
            fields += shifts * draws(self.shifts.len(), count, normal);
        }
        let missed = self.missed().map(|missed| {
            let missed_fields = Mat::from_fn(whole, missed.len(), |i, k| missed[k][i]);
            missed_fields * draws(missed.len(), count, normal)
        });
        if let Some(missed) = &missed {
            fields += missed;
        }
        Block { fields, missed }
    }

    /// What the noise of so many trials does to the coefficients: a column each.
    fn refitted(&self, count: usize, normal: &mut dyn FnMut() -> f64) -> Mat<f64> {
        let (q, p) = (self.columns.len(), self.fit.coefficients().len());
        let mut sides = Mat::<f64>::zeros(q + p, count);
        let mut room = self.design.room();
        let kept: Vec<usize> =
            (0..self.sigmas.len()).filter(|i| self.sigmas[*i].is_finite()).collect();
        let mut row = vec![0.0; p];
        for some in kept.chunks(ROWS) {
            let mut rows = Mat::<f64>::zeros(q + p, some.len());
            for (k, &i) in some.iter().enumerate() {
                let out = rows.col_as_slice_mut(k);
                self.design.row(i, &mut room, &mut row);
                out[q..].copy_from_slice(&row);
                for (out, column) in out.iter_mut().zip(self.columns) {
                    *out = column[i];
                }
                for value in out {
                    *value /= self.sigmas[i];
                }
            }
            sides += rows * draws(some.len(), count, normal);
        }
        if q > 0 {
            // What is known of the nuisances beforehand: 0 ± 1.
            let prior = draws(q, count, normal);
            for t in 0..count {
                for k in 0..q {
                    sides[(k, t)] += prior[(k, t)];
                }
            }
        }
        if let Some(held) = self.prior.held() {
            let held = held.transpose() * draws(held.nrows(), count, normal);
            for t in 0..count {
                for i in 0..p {
                    sides[(q + i, t)] += held[(i, t)];
                }
            }
        }
        self.solved.refitted(&sides)
    }

    fn missed(&self) -> Option<&[Vec<f64>]> {
        let missed = |truncation: &Truncation| !truncation.missed.is_empty();
        let truncation = self.fit.parts().truncation.as_ref().filter(|t| missed(t))?;
        Some(&truncation.missed)
    }
}

impl Trial<'_> {
    /// What a functional of the fit is in this trial.
    ///
    /// # Panics
    /// If the functional has another number of coefficients, and so is of another fit.
    pub fn of(&self, functional: &Functional) -> f64 {
        assert_eq!(
            functional.row().len(),
            self.coefficients().len(),
            "a functional of another fit"
        );
        functional.times_field(self.field)
            + self.along_one(functional)
            + dot(functional.unmeasured(), self.unmeasured)
    }

    /// What is in a functional of one direction alone beside the field: what is finer than all
    /// functions, and all that is missed as much larger as it is there.
    fn along_one(&self, functional: &Functional) -> f64 {
        let Some(along) = functional.along() else { return 0.0 };
        let times = self.trials.fit.unevenness(along).sqrt();
        let more = if self.missed.is_empty() { 0.0 } else { functional.times_field(self.missed) };
        (times - 1.0) * more + times * along.weight * self.finer
    }

    /// The radiance along a ray.
    pub fn radiance(&self, ray: &Ray) -> f64 {
        self.of(&self.trials.fit.weighted_rays([(*ray, 1.0)]))
    }

    /// Where the field is largest: climbed to from all the tops of the fit's own field. A lobe that
    /// no top of the fit was near is not found.
    pub fn peak(&self) -> TrialPeak {
        let fit = self.trials.fit;
        let (coefficients, beyond) = self.field.split_at(fit.coefficients().len());
        let mut finer = fit.beyond().map(|basis| (basis, basis.scratch()));
        let mut own = fit.functions().scratch();
        let mut value = |ray: &Ray| {
            let mut value = fit.functions().value(coefficients, ray, &mut own);
            if let Some((basis, scratch)) = &mut finer {
                value += basis.value(beyond, ray, scratch);
            }
            value
        };
        let (ray, radiance) = along(fit, &self.trials.tops, &mut value);
        let there = fit.weighted_rays([(ray, 1.0)]);
        TrialPeak { radiance: radiance + self.along_one(&there), ray }
    }

    /// The coefficients of the fit's own functions.
    pub fn coefficients(&self) -> &[f64] {
        &self.field[..self.trials.fit.coefficients().len()]
    }

    /// The fit as this trial would have reported it, with the independent part of its u alone: for what
    /// is derived from a whole fit. What the functions can't follow is not in it.
    pub fn fit(&self) -> Fit {
        self.trials.fit.bare(self.coefficients().to_vec())
    }
}

/// Fields of several trials, a column each.
struct Block {
    /// Over all functions.
    fields: Mat<f64>,
    /// What of them the fit's functions can't follow.
    missed: Option<Mat<f64>>,
}

fn draws(rows: usize, columns: usize, normal: &mut dyn FnMut() -> f64) -> Mat<f64> {
    let mut draws = Mat::zeros(rows, columns);
    for t in 0..columns {
        for value in draws.col_as_slice_mut(t) {
            *value = normal();
        }
    }
    draws
}

/// Numbers of a block's fields: 16 MB.
const NUMBERS_MAX: usize = 1 << 21;
/// Trials of a block.
const BLOCK_MAX: usize = 4096;
/// Readings taken at a time.
const ROWS: usize = 64;
