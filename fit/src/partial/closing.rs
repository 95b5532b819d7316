//! From the triangle of all readings to the fit: their noise as a whole, and the covariance.

use super::{Partial, Sums, Weighting};
use crate::excess::threshold;
use crate::parts::{CommonShift, Parts, Quality};
use crate::penalty::{Penalised, Prior};
use crate::solve::left_over;
use crate::triangle::Solution;
use crate::truncation::Remembered;
use crate::undetermined::by_functions;
use crate::whereabouts::Whereabouts;
use crate::{Fit, FitError};

/// The fit of all shares.
#[derive(Debug, Clone)]
pub struct Closed {
    /// The fit.
    pub fit: Fit,
    /// By how much every stated u was multiplied, since the residuals scatter beyond them; 1 where
    /// they don't. With variances that differ from reading to reading a fit of all readings
    /// together would weigh them anew, and this one does not.
    pub u_factor: f64,
}

/// What the residuals say of the noise.
#[derive(Debug, Clone, Copy)]
struct Scatter {
    /// The variance of a row of unit weight, what it is less by what was stated, and χ² by that.
    unit: f64,
    unstated: f64,
    chi2: f64,
    u_factor: f64,
}

impl Partial {
    /// The fit of all readings taken in. `u_relative` is each reading's standard uncertainty over
    /// the root mean square of all values, where they state none; without it the residuals tell.
    pub fn fit(self, u_relative: Option<f64>) -> Result<Fit, FitError> {
        self.close(u_relative).map(|closed| closed.fit)
    }

    /// As [`fit`](Self::fit), with what was done to the stated uncertainties.
    pub fn close(self, u_relative: Option<f64>) -> Result<Closed, FitError> {
        let Self { basis, penalty, weighting, common, sums, triangle, whereabouts, finer } = self;
        let prior = Prior::new(&basis, penalty)?;
        let n_used = usize::try_from(sums.readings).unwrap_or(usize::MAX);
        check(n_used, basis.len(), &prior)?;
        let stated = match (weighting, u_relative) {
            (Weighting::Stated, _) => Some(1.0),
            (Weighting::Alike, Some(u)) => Some(u * u * sums.mean_square()),
            (Weighting::Alike, None) => None,
        };
        let mut unit = stated.unwrap_or(sums.mean_square().max(f64::MIN_POSITIVE));
        let mut pass = 0;
        loop {
            let mut whole = triangle.scaled(1.0 / unit.sqrt());
            prior.absorb_into(&mut whole, 1 + common.len());
            let solution = whole.solve().ok_or(FitError::OutOfRange)?;
            let spectrum = solution.spectrum().ok_or(FitError::OutOfRange)?;
            if prior.is_none() && spectrum.rank() < basis.len() {
                return Err(by_functions(&spectrum, |k| basis.name(k)));
            }
            let coefficients = solution.unknowns(0);
            let factor = solution.inverse();
            let determined = prior.determined_by(&solution);
            let squares = triangle.residual_squares(&coefficients);
            let scatter = scatter(squares, n_used as f64 - determined, stated, &sums)
                .ok_or(FitError::NoScatter { readings: n_used })?;
            pass += 1;
            // With the noise another one than was thought, the penalty weighs differently.
            if (scatter.unit / unit - 1.0).abs() > SETTLED_RELATIVE && pass < PASSES_MAX {
                unit = scatter.unit;
                continue;
            }
            let mean_variance = sums.readings as f64 / sums.weights;
            let quality = Quality {
                condition: spectrum.condition(),
                n_used,
                dof: left_over(n_used, determined),
                determined,
                residual_rms: (squares / sums.weights).sqrt(),
                chi2: scatter.chi2,
                excess_rms: (scatter.unstated * mean_variance).sqrt(),
                beam: None,
            };
            let shifts = shifts(&solution, common);
            let (region, model) = (*basis.region(), Penalised::new(basis.spec(), penalty));
            let truncation = None;
            let parts = Parts { region, model, coefficients, factor, shifts, quality, truncation };
            let fit = Fit::from_parts(parts).map_err(|_| FitError::OutOfRange)?;
            let closed = Closed { fit, u_factor: scatter.u_factor };
            let noise = (stated.unwrap_or(unit), stated.is_none());
            return closed.widened(finer, &whereabouts, noise);
        }
    }
}

impl Closed {
    /// With where nothing was measured, and what the functions can't follow in u. Then it is by these that
    /// readings scatter beyond what they state, as far as they explain it.
    fn widened(
        self,
        finer: Option<Remembered>,
        whereabouts: &Whereabouts,
        noise: (f64, bool),
    ) -> Result<Self, FitError> {
        let Self { mut fit, mut u_factor } = self;
        if let Some(finer) = finer
            && let Some(widened) = finer.widened(&fit, whereabouts.places(), noise, u_factor)?
        {
            u_factor = if noise.1 { 1.0 } else { widened.scale().sqrt().max(1.0) };
            fit = Fit::from_parts(widened.parts).map_err(|_| FitError::OutOfRange)?;
        }
        Ok(Self { fit: fit.with_measured(Some(whereabouts.measured())), u_factor })
    }
}

fn check(readings: usize, coefficients: usize, prior: &Prior) -> Result<(), FitError> {
    if readings == 0 {
        Err(FitError::Empty)
    } else if prior.is_none() && readings < coefficients {
        Err(FitError::FewerReadingsThanCoefficients { readings, coefficients })
    } else {
        Ok(())
    }
}

/// `squares` are those of the residuals of rows of unit weight; `stated` is the variance of such a
/// row, where it is known. `None` where neither that nor residuals tell.
fn scatter(squares: f64, dof: f64, stated: Option<f64>, sums: &Sums) -> Option<Scatter> {
    let Some(stated) = stated else {
        // Rounding is no more to go by than nothing.
        let least = f64::EPSILON.powi(2) * sums.mean_square().max(f64::MIN_POSITIVE);
        let unit = (squares / dof).max(least);
        let scatter = Scatter { unit, unstated: unit, chi2: dof, u_factor: 1.0 };
        return (dof >= 0.5).then_some(scatter);
    };
    let chi2 = squares / stated;
    let is_beyond = dof > 0.0 && chi2 > threshold(dof);
    let factor = if is_beyond { chi2 / dof } else { 1.0 };
    let unit = stated * factor;
    Some(Scatter { unit, unstated: unit - stated, chi2, u_factor: factor.sqrt() })
}

fn shifts(solution: &Solution, common: Vec<String>) -> Vec<CommonShift> {
    let shift = |(i, name)| CommonShift { name, shift: solution.unknowns(1 + i) };
    common.into_iter().enumerate().map(shift).collect()
}

/// Without a penalty the second pass is the last: the noise then leaves the coefficients alone.
const PASSES_MAX: usize = 12;
/// The noise agrees with the fit that it leads to.
const SETTLED_RELATIVE: f64 = 1e-9;
