//! Scatter beyond the stated noise, of readings that are read again rather than kept: the variance that
//! a fit of all of them at once would add to each ([`crate::Quality::excess_rms`]), a step a pass.
//!
//! Newton's method on 1/Σ r²/(v + τ²), as there; the residuals of a pass are those from the fit of the
//! pass before, so that weights and excess settle together.

use super::{Accumulator, Closed, PartialError, READINGS_FORESEEN, Weighting};
use crate::beam::design::Design;
use crate::weights::threshold;
use crate::{Fit, FitError, Noise, Optics, Parts, Penalised, Quality, Region, Sample};

/// Fits readings of stated noise that come again and again, in blocks: pass by pass.
#[derive(Debug)]
pub struct Passes {
    region: Region,
    model: Penalised,
    optics: Option<Optics>,
    excess: f64,
    last: Option<Fit>,
    chi2: f64,
    sums: Scatter,
    share: Accumulator,
    is_stated: bool,
}

/// Sums over the residuals from the last pass's fit.
#[derive(Debug, Clone, Copy, Default)]
struct Scatter {
    /// Σ r²/(v + τ²) and Σ r²/(v + τ²)².
    squares: (f64, f64),
    /// Σ r²/v.
    stated: f64,
}

/// What the end of a pass says.
#[derive(Debug)]
pub enum Pass {
    /// The readings are wanted once more.
    Again,
    /// The fit.
    Done(Box<Closed>),
}

impl Passes {
    /// Before the first pass.
    pub fn new(
        region: Region,
        model: impl Into<Penalised>,
        optics: Option<Optics>,
        weighting: Weighting,
    ) -> Result<Self, FitError> {
        let model = model.into();
        let share = Accumulator::new(region, model, optics, weighting)?;
        Ok(Self {
            region,
            model,
            optics,
            excess: 0.0,
            last: None,
            chi2: 0.0,
            sums: Scatter::default(),
            share,
            is_stated: weighting == Weighting::Stated,
        })
    }

    /// Takes a block in. An error leaves everything as it was before the block.
    pub fn absorb(&mut self, samples: &[Sample]) -> Result<(), PartialError> {
        let Some(last) = &self.last else { return self.share.absorb(samples) };
        let levels = self.levels(last, samples)?;
        let mut sums = self.sums;
        let mut widened = Vec::with_capacity(samples.len());
        for (index, (sample, level)) in samples.iter().zip(levels).enumerate() {
            let Noise::Fixed { variance: stated } = sample.noise else {
                return Err(PartialError::Noise { index });
            };
            let (square, variance) = ((sample.value - level).powi(2), stated + self.excess);
            sums.stated += square / stated;
            sums.squares.0 += square / variance;
            sums.squares.1 += square / (variance * variance);
            widened.push(Sample { noise: Noise::Fixed { variance }, ..*sample });
        }
        self.share.absorb(&widened)?;
        self.sums = sums;
        Ok(())
    }

    fn levels(&self, fit: &Fit, samples: &[Sample]) -> Result<Vec<f64>, FitError> {
        let basis = fit.functions();
        let design = Design::of_a_share(samples, basis, self.optics.as_ref(), READINGS_FORESEEN)?;
        Ok(crate::solve::levels(&design, fit.coefficients()))
    }

    /// Ends a pass. `u_relative` as of [`Partial::close`](super::Partial::close).
    pub fn end(&mut self, u_relative: Option<f64>) -> Result<Pass, FitError> {
        let weighting = if self.is_stated { Weighting::Stated } else { Weighting::Alike };
        let next = Accumulator::new(self.region, self.model, self.optics, weighting)?;
        let share = std::mem::replace(&mut self.share, next);
        let closed = share.finish().close(u_relative)?;
        let dof = closed.fit.dof() as f64;
        let is_first = self.last.is_none();
        if !self.is_stated || (is_first && closed.u_factor <= 1.0) {
            return Ok(Pass::Done(Box::new(closed)));
        }
        let sums = std::mem::take(&mut self.sums);
        if is_first {
            self.last = Some(closed.fit);
            return Ok(Pass::Again);
        }
        self.chi2 = sums.stated;
        let (s, slope) = sums.squares;
        let before = self.excess;
        if before > 0.0 || s > threshold(dof) {
            self.excess = (before + (1.0 / dof - 1.0 / s) * s * s / slope).max(0.0);
        }
        let is_settled = (self.excess - before).abs() <= SETTLED_RELATIVE * self.excess;
        if !is_settled {
            self.last = Some(closed.fit);
            return Ok(Pass::Again);
        }
        let parts = closed.fit.parts().clone();
        let quality = Quality { chi2: self.chi2, excess_rms: before.sqrt(), ..parts.quality };
        let fit = Fit::from_parts(Parts { quality, ..parts }).map_err(|_| FitError::OutOfRange)?;
        Ok(Pass::Done(Box::new(Closed { fit, ..closed })))
    }
}

/// The excess has settled when it changes by less.
const SETTLED_RELATIVE: f64 = 1e-3;
