//! The fit itself: weights that settle, one factorisation, common components carried through it.
//!
//! Common components stay out of the weights. Being off by one u, a component changes the values
//! by a vector; the same factorisation carries it to the coefficients as a further right-hand side.

use crate::basis::Basis;
use crate::check::check;
use crate::fitted::{CommonShift, Fit, Parts, Quality};
use crate::triangle::{Solution, Triangle};
use crate::weights::{Model, Settled, settle};
use crate::{BasisSpec, Common, FitError, Noise, Region, Sample, Shift, undetermined};

/// Fits the field to samples: the crate's description has the method and an example.
///
/// Positions may lie off the region by 2 % of its half width, as readbacks do, and directions
/// beyond its cone. The result depends on the samples' order by rounding alone. Costs about five
/// passes of 2 n p² operations for n samples and p coefficients, and memory of 16 p² numbers.
pub fn fit(
    samples: &[Sample],
    region: &Region,
    basis: BasisSpec,
    common: &[Common],
) -> Result<Fit, FitError> {
    check(samples, region, basis, common)?;
    let basis = Basis::new(basis, *region);
    if let Some(refusal) = undetermined::by_count(samples, &basis) {
        return Err(refusal);
    }
    let settled = settle(samples, &basis, samples.len() - basis.len())?;
    let shifting: Vec<&Common> = common.iter().filter(|c| needs_a_side(c)).collect();
    let sides = sensitivities(samples, &basis, &settled, &shifting)?;
    let solution = solve(samples, &basis, &settled.variances, &sides)?;
    let coefficients = solution.unknowns(0);
    let shifts = shifts(common, &coefficients, &basis, &solution);
    let levels = levels(samples, &basis, &coefficients);
    let quality = quality(samples, &levels, &solution, settled.excess)?;
    Fit::from_parts(Parts {
        region: *region,
        basis: basis.spec(),
        coefficients,
        factor: solution.inverse(),
        shifts,
        quality,
    })
    .map_err(|_| FitError::OutOfRange)
}

/// The field's values along the samples' rays.
pub(crate) fn levels(samples: &[Sample], basis: &Basis, coefficients: &[f64]) -> Vec<f64> {
    let mut scratch = basis.scratch();
    samples.iter().map(|s| basis.value(coefficients, &s.ray, &mut scratch)).collect()
}

/// One pass of all rows, each divided by its standard uncertainty. `sides` are further right-hand
/// sides, one vector over the samples each.
pub(crate) fn solve(
    samples: &[Sample],
    basis: &Basis,
    variances: &[f64],
    sides: &[Vec<f64>],
) -> Result<Solution, FitError> {
    let p = basis.len();
    let mut triangle = Triangle::new(p, 1 + sides.len());
    let mut scratch = basis.scratch();
    let mut row = vec![0.0; p + 1 + sides.len()];
    for (i, (sample, variance)) in samples.iter().zip(variances).enumerate() {
        basis.row(&sample.ray, &mut scratch, &mut row[..p]);
        row[p] = sample.value;
        for (out, side) in row[p + 1..].iter_mut().zip(sides) {
            *out = side[i];
        }
        let weight = 1.0 / variance.sqrt();
        if !weight.is_finite() || weight == 0.0 {
            return Err(FitError::OutOfRange);
        }
        for value in &mut row {
            *value *= weight;
        }
        triangle.absorb(&row);
    }
    triangle.solve().ok_or(FitError::OutOfRange)
}

/// Whether a component's effect has to go through the factorisation. A scale and an offset don't:
/// the fit is linear and holds the constant, so that their effect on the coefficients is known.
fn needs_a_side(common: &Common) -> bool {
    matches!(common.shift, Shift::Ray(_) | Shift::Value(_))
}

/// The change of every value by one u of each component.
fn sensitivities(
    samples: &[Sample],
    basis: &Basis,
    settled: &Settled,
    common: &[&Common],
) -> Result<Vec<Vec<f64>>, FitError> {
    let Settled { coefficients, levels, .. } = settled;
    let mut scratch = basis.scratch();
    let mut change = |common: &Common, i: usize| match &common.shift {
        Shift::Scale => common.u * levels[i],
        Shift::Offset => common.u,
        Shift::Value(excess) => excess(i, levels[i]),
        Shift::Ray(seen) => {
            let seen = seen(i, &samples[i].ray);
            basis.value(coefficients, &seen, &mut scratch) - levels[i]
        }
    };
    let mut sides = Vec::with_capacity(common.len());
    for common in common {
        let side: Vec<f64> = (0..samples.len()).map(|i| change(common, i)).collect();
        if !side.iter().all(|value| value.is_finite()) {
            return Err(FitError::Common { name: common.name.clone() });
        }
        sides.push(side);
    }
    Ok(sides)
}

/// The coefficients' shift by one u of each component, in the order handed in.
fn shifts(
    common: &[Common],
    coefficients: &[f64],
    basis: &Basis,
    solution: &Solution,
) -> Vec<CommonShift> {
    let mut side = 0;
    let mut shift = |c: &Common| match c.shift {
        Shift::Scale => coefficients.iter().map(|value| c.u * value).collect(),
        Shift::Offset => basis.unity().iter().map(|value| c.u * value).collect(),
        Shift::Ray(_) | Shift::Value(_) => {
            side += 1;
            solution.unknowns(side)
        }
    };
    common.iter().map(|c| CommonShift { name: c.name.clone(), shift: shift(c) }).collect()
}

fn quality(
    samples: &[Sample],
    levels: &[f64],
    solution: &Solution,
    excess: f64,
) -> Result<Quality, FitError> {
    let spectrum = solution.spectrum().ok_or(FitError::OutOfRange)?;
    let model = Model::of(samples);
    let n = samples.len() as f64;
    let (mut squares, mut chi2) = (0.0, 0.0);
    for (sample, level) in samples.iter().zip(levels) {
        let square = (sample.value - level).powi(2);
        let unstated = if sample.noise == Noise::Unknown { excess } else { 0.0 };
        squares += square;
        chi2 += square / (model.variance(sample.noise, *level) + unstated);
    }
    Ok(Quality {
        condition: spectrum.condition(),
        n_used: samples.len(),
        dof: samples.len() - solution.len(),
        residual_rms: (squares / n).sqrt(),
        chi2,
        excess_rms: excess.sqrt(),
    })
}
