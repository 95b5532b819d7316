//! The numbers that a fit consists of, and whether stored ones can be taken up again. What follows
//! from them is the fitted field's business.

use crate::basis::Basis;
use crate::{BeamRows, FitError, Penalised, Region, Truncation};

/// The numbers that a fit consists of, to be stored and taken up again.
#[derive(Debug, Clone, PartialEq)]
pub struct Parts {
    /// What the fit stands for.
    pub region: Region,
    /// Which functions, and what was held against them.
    pub model: Penalised,
    /// One a function, in the value's unit.
    pub coefficients: Vec<f64>,
    /// The upper triangular S of the independent covariance S Sᵀ (with a penalty the posterior's, see
    /// [`Penalty`](crate::Penalty)), packed by columns: S₀₀, S₀₁, S₁₁,
    /// S₀₂, ... Empty where [`Fit::is_sparse`](crate::Fit::is_sparse): such parts can't be taken up again.
    pub factor: Vec<f64>,
    /// The coefficients' shift by one u of each common component.
    pub shifts: Vec<CommonShift>,
    /// How good the fit is.
    pub quality: Quality,
    /// What the functions can't follow, as far as the readings tell; see
    /// [`Fit::with_truncation`](crate::Fit::with_truncation). The factor is then that of the noise beside it.
    pub truncation: Option<Truncation>,
}

/// The coefficients' shift by one standard uncertainty of a common component.
#[derive(Debug, Clone, PartialEq)]
pub struct CommonShift {
    /// The component.
    pub name: String,
    /// One number a coefficient.
    pub shift: Vec<f64>,
}

/// What tells a good fit from a bad one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Condition number of the weighted design matrix, its columns scaled to equal length.
    pub condition: f64,
    /// Samples used.
    pub n_used: usize,
    /// Samples less coefficients, or less what the samples determine of them where a penalty helps.
    pub dof: usize,
    /// How many coefficients the samples determine: all of them without a penalty, fewer with one
    /// (the trace of the matrix from values to fitted values).
    pub determined: f64,
    /// Root mean square of value - fitted, unweighted, in the value's unit.
    pub residual_rms: f64,
    /// Sum of squared residuals over the samples' stated variance; about `dof` where noise and
    /// basis are right. Samples of unknown noise count with the excess.
    pub chi2: f64,
    /// Standard deviation of scatter beyond the stated noise, in the value's unit: what the basis
    /// can't follow, pose jitter, drift. 0 unless chi2 exceeds its dof by 3 of its standard
    /// deviations (or the noise was unknown). It is part of the weights and of every u, taken as
    /// independent from reading to reading, as far as
    /// [`Fit::with_truncation`](crate::Fit::with_truncation) does not find another reason for it.
    pub excess_rms: f64,
    /// How the rows stand for the detector's beam; `None` where none was known.
    pub beam: Option<BeamRows>,
}

impl Parts {
    /// The functions that the numbers belong to, and those beyond them; an error where the numbers
    /// are not of one fit.
    pub(crate) fn checked(&self) -> Result<(Basis, Option<Basis>), FitError> {
        if !self.region.is_sound() {
            return Err(FitError::Region);
        }
        self.model.basis.checked_len()?;
        self.model.check()?;
        let basis = Basis::new(self.model.basis, self.region)?;
        let p = basis.len();
        demand("coefficients", p, &self.coefficients)?;
        demand("factor", p * (p + 1) / 2, &self.factor)?;
        for common in &self.shifts {
            demand("shift", p, &common.shift)?;
        }
        let beyond = self.truncation.as_ref().map(|t| beyond(t, p, self.region)).transpose()?;
        Ok((basis, beyond))
    }
}

/// The finer functions of a truncation that is sound beside p functions.
fn beyond(truncation: &Truncation, p: usize, region: Region) -> Result<Basis, FitError> {
    truncation.beyond.checked_len()?;
    let basis = Basis::new(truncation.beyond, region)?;
    for field in &truncation.missed {
        demand("missed field", p + basis.len(), field)?;
    }
    Ok(basis)
}

pub(crate) fn demand(what: &'static str, expected: usize, numbers: &[f64]) -> Result<(), FitError> {
    let found = numbers.iter().filter(|number| number.is_finite()).count();
    if found == expected && numbers.len() == expected {
        Ok(())
    } else {
        Err(FitError::Parts { what, expected, found })
    }
}
