//! What a fit will know before anything is measured: the same rows, weights and factorisation as a
//! fit's, with expected radiances in the place of values. It has no noise, and so no residuals of
//! its own: what is fitted is what was expected, as far as the basis follows it.
//!
//! How far the basis follows other fields is asked along with it, as further right-hand sides.

use crate::basis::dot;
use crate::beam::Optics;
use crate::beam::design::Design;
use crate::fitted::Fit;
use crate::parts::{CommonShift, Parts, Quality};
use crate::penalty::{Penalised, Prior};
use crate::solve::{left_over, needs_a_side, ready, sensitivities, shifts, solve_readings};
use crate::triangle::Solution;
use crate::weights::{Model, Settled, moved};
use crate::{Common, FitError, Noise, Ray, Region, Sample, undetermined};

/// What a fit is going to know.
#[derive(Debug, Clone)]
pub struct Predicted {
    /// The fit of the expected radiances, with the covariance that the readings will give it. Its
    /// residuals are those of the basis, its chi2 is its degrees of freedom.
    pub fit: Fit,
    /// What the same readings make of each field, without noise.
    pub fields: Vec<FittedField>,
}

/// A field as the basis and the poses show it.
#[derive(Debug, Clone)]
pub struct FittedField {
    /// The fit to its readings. Its covariance is that of the expected radiances' fit, without
    /// common components.
    pub fit: Fit,
    /// Root mean square of reading less fit, in the field's unit: what the basis can't follow.
    pub residual_rms: f64,
}

impl Predicted {
    /// The radiance along a ray: of the expected field's fit, then of each field's. The functions are worked
    /// out once for all of them.
    pub fn values(&self, ray: &Ray) -> Vec<f64> {
        let basis = self.fit.functions();
        let mut row = vec![0.0; basis.len()];
        basis.row(ray, &mut basis.scratch(), &mut row);
        let fits = std::iter::once(&self.fit).chain(self.fields.iter().map(|field| &field.fit));
        fits.map(|fit| dot(&row, fit.coefficients())).collect()
    }
}

/// Predicts the fit of [`fit_flown`](crate::fit_flown). A sample's `value` is the radiance that is expected along
/// its ray; of a beam that reaches beyond the sample only the part on it sees that much. Its noise
/// is taken at that level. `fields` are the radiances of other fields along the same rays, one a
/// sample, of any unit.
///
/// The radiance is taken to be even within a beam: for features narrower than the beam the
/// prediction is too good. An excess over the stated noise is not foreseen; add what is known of it
/// to the variances. Refuses what [`fit_flown`](crate::fit_flown) refuses, and [`Noise::Unknown`].
///
/// ```
/// use fit::{BasisSpec, Common, Noise, Ray, Region, Sample, Shift};
///
/// // 24 directions, radiances of about 100 read to 0.1: what will the exitance be known to?
/// let ray = |i: u32| {
///     Ray { x_m: 0.0, y_m: 0.0, theta_rad: f64::from(i % 8) * 0.2, phi_rad: f64::from(i / 8) * 2.1 }
/// };
/// let noise = Noise::Fixed { variance: 0.01 };
/// let expected: Vec<Sample> =
///     (0..24).map(|i| Sample { ray: ray(i), value: 100.0, noise }).collect();
/// let region = Region::surface((-0.01, 0.01), (-0.01, 0.01), 1.4);
/// let scale = Common { name: "responsivity".into(), u: 0.02, shift: Shift::Scale };
/// let basis = BasisSpec::zernike(2, 0);
/// let predicted = fit::predict(&expected, &[], &region, basis, &[scale], None, &[])?;
/// let exitance = predicted.fit.exitance();
/// assert!((exitance.u / exitance.value - 0.02).abs() < 1e-4);
/// assert!(exitance.u_independent / exitance.value < 1e-3);
/// # Ok::<(), fit::FitError>(())
/// ```
pub fn predict(
    samples: &[Sample],
    flown: &[Option<(Ray, Ray)>],
    region: &Region,
    model: impl Into<Penalised>,
    common: &[Common],
    optics: Option<&Optics>,
    fields: &[Vec<f64>],
) -> Result<Predicted, FitError> {
    let model = model.into();
    let (basis, prior) = ready(samples, region, model, common)?;
    check_fields(samples, fields)?;
    let design = Design::new(samples, &basis, optics)?.in_flight(flown);
    let on_sample = on_sample(&design);
    let seen = |along: &mut dyn Iterator<Item = f64>| -> Vec<f64> {
        along.zip(&on_sample).map(|(value, part)| value * part).collect()
    };
    let expected = seen(&mut samples.iter().map(|sample| sample.value));
    let noise = Model::of(samples);
    let variance = |(sample, level): (&Sample, &f64)| noise.variance(sample.noise, *level);
    let mut variances: Vec<f64> = samples.iter().zip(&expected).map(variance).collect();

    let mut sides = vec![expected];
    sides.extend(fields.iter().map(|field| seen(&mut field.iter().copied())));
    let mut solution = solve_readings(&design, &variances, &sides, &prior)?;
    let spectrum = solution.spectrum().ok_or(FitError::OutOfRange)?;
    if prior.is_none() && spectrum.rank() < basis.len() {
        return Err(undetermined::by_rank(samples, &basis));
    }
    let (common, jitters): (Vec<&Common>, Vec<&Common>) =
        common.iter().partition(|common| common.shift.is_shared());
    let moved = moved(&design, &solution.unknowns(1), &jitters)?;
    if moved.iter().any(|variance| *variance > 0.0) {
        variances.iter_mut().zip(&moved).for_each(|(variance, moved)| *variance += moved);
        solution = solve_readings(&design, &variances, &sides, &prior)?;
    }
    let coefficients: Vec<Vec<f64>> =
        (1..=sides.len()).map(|side| solution.unknowns(side)).collect();
    let residuals = residual_rms(&design, &sides, &coefficients);

    let settled = Settled::known(coefficients[0].clone(), sides.swap_remove(0), variances, moved);
    let shifts = carried(&common, &design, &settled, &solution, &prior)?;
    let factor = solution.inverse();
    let determined = prior.determined_by(&solution);
    let dof = left_over(samples.len(), determined);
    let quality = Quality {
        condition: spectrum.condition(),
        n_used: samples.len(),
        dof,
        determined,
        residual_rms: residuals[0],
        chi2: dof as f64,
        excess_rms: 0.0,
        beam: design.rows(&settled.variances),
    };
    let region = *region;
    let fit = |coefficients: Vec<f64>, shifts: Vec<CommonShift>, quality: Quality| {
        let factor = factor.clone();
        let truncation = None;
        Fit::from_parts(Parts { region, model, coefficients, factor, shifts, quality, truncation })
            .map_err(|_| FitError::OutOfRange)
    };
    let mut fitted = coefficients.into_iter().zip(residuals);
    let (expected, _) = fitted.next().ok_or(FitError::Empty)?;
    let fields = fitted.map(|(coefficients, residual_rms)| {
        let quality = Quality { residual_rms, ..quality };
        Ok(FittedField { fit: fit(coefficients, Vec::new(), quality)?, residual_rms })
    });
    Ok(Predicted {
        fields: fields.collect::<Result<_, FitError>>()?,
        fit: fit(expected, shifts, quality)?,
    })
}

/// The coefficients' shift by one u of each component.
fn carried(
    common: &[&Common],
    design: &Design<'_>,
    settled: &Settled,
    solution: &Solution,
    prior: &Prior,
) -> Result<Vec<CommonShift>, FitError> {
    let shifting: Vec<&Common> =
        common.iter().copied().filter(|c| needs_a_side(c, design.holds_constant())).collect();
    let constant = design.constant();
    let constant = constant.as_deref();
    if shifting.is_empty() {
        return Ok(shifts(common, &settled.coefficients, constant, |side| solution.unknowns(side)));
    }
    let sides = sensitivities(design, settled, &shifting)?;
    let carried = solve_readings(design, &settled.variances, &sides, prior)?;
    Ok(shifts(common, &settled.coefficients, constant, |side| carried.unknowns(side)))
}

fn check_fields(samples: &[Sample], fields: &[Vec<f64>]) -> Result<(), FitError> {
    if let Some(index) = samples.iter().position(|sample| sample.noise == Noise::Unknown) {
        return Err(FitError::Variance { index, what: "stated noise", value: 0.0 });
    }
    for field in fields {
        let found = field.iter().filter(|value| value.is_finite()).count();
        if found != samples.len() || field.len() != samples.len() {
            return Err(FitError::Parts { what: "field", expected: samples.len(), found });
        }
    }
    Ok(())
}

/// How much of each beam sees the sample.
fn on_sample(design: &Design<'_>) -> Vec<f64> {
    if design.holds_constant() {
        return vec![1.0; design.samples().len()];
    }
    let unity = design.basis().unity();
    let mut room = design.room();
    (0..design.samples().len()).map(|i| design.level(i, &unity, &mut room)).collect()
}

/// Root mean square of reading less fit, of each side. To make a beam's row costs far more than to
/// multiply it by every side's coefficients.
fn residual_rms(design: &Design<'_>, sides: &[Vec<f64>], coefficients: &[Vec<f64>]) -> Vec<f64> {
    let (mut room, mut row) = (design.room(), vec![0.0; design.basis().len()]);
    let readings = design.samples().len();
    let mut squares = vec![0.0; sides.len()];
    for i in 0..readings {
        design.row(i, &mut room, &mut row);
        for ((squares, side), own) in squares.iter_mut().zip(sides).zip(coefficients) {
            *squares += (side[i] - dot(&row, own)).powi(2);
        }
    }
    squares.into_iter().map(|squares| (squares / readings as f64).sqrt()).collect()
}
