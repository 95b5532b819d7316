//! Fits in many local functions: splines in direction of which a reading meets few.
//!
//! The normal equations of such rows are sparse, and so is their Cholesky factor, while the triangle
//! of a dense factorisation would hold the square of the coefficients. Products square the condition
//! of the rows; so the solution is corrected by the residuals of the rows themselves (iterative
//! refinement) until the gradient of what is minimised is as small as rounding allows, and a fit for
//! which it doesn't get there is refused. Covariance is never formed: every u is a solve. How many
//! coefficients the readings determine under a penalty is estimated with random signs (Hutchinson 1990).

pub(crate) use factor::Factor;
pub(crate) use gram::Gram;

use crate::basis::{Basis, Directions};
use crate::beam::Optics;
use crate::beam::design::Design;
use crate::check::check;
use crate::penalty::sparse_roughness;
use crate::solve::{
    Rows, check_readings, levels, needs_a_side, quality, sensitivities, shifts, weighed,
};
use crate::weights::{Model, PASSES_MAX, REWEIGHING_MAX, Settled, moved, start};
use crate::{BasisSpec, Common, FitError, Penalised, Penalty, Readings, Region, Robust};
use crate::{Fit, Parts};
use faer::Mat;
use std::sync::Arc;

mod factor;
mod gram;
#[cfg(test)]
mod tests;

/// Whether a basis is one for this path: local, and with more functions than are well kept densely.
pub(crate) fn is_called_for(basis: BasisSpec) -> bool {
    basis.is_local() && basis.len() > COEFFICIENTS_FROM
}

/// That a fit of this size doesn't do what was wished for.
pub(crate) fn refusal(wish: &'static str) -> FitError {
    FitError::Sparse { wish, coefficients_from: COEFFICIENTS_FROM }
}

/// As [`fit_readings`](crate::fit_readings), but for nuisances, which are refused.
pub(crate) fn fit(
    readings: &Readings<'_>,
    region: &Region,
    model: Penalised,
    optics: Option<&Optics>,
) -> Result<Fit, FitError> {
    let Readings { samples, common, limits, .. } = *readings;
    check(samples, region, model, common)?;
    check_readings(readings)?;
    if !readings.nuisances.is_empty() {
        return Err(refusal("nuisances fitted along"));
    }
    let basis = Basis::new(model.basis, *region)?;
    let prior = Prior::new(&basis, model.penalty)?;
    let design = Design::new(samples, &basis, optics)?.in_flight(readings.flown);
    let (common, jitters): (Vec<&Common>, Vec<&Common>) =
        common.iter().partition(|common| common.shift.is_shared());
    let settled = settle(&design, &prior, readings, &jitters)?;
    let shifting: Vec<&Common> =
        common.iter().copied().filter(|c| needs_a_side(c, design.holds_constant())).collect();
    let sides = sensitivities(&design, &settled, &shifting)?;
    let Solved { mut factor, unknowns, determined } =
        solve(&design, &settled.rows(), &sides, &prior)?;
    let coefficients = unknowns[0].clone();
    let constant = design.constant();
    let shifts = shifts(&common, &coefficients, constant.as_deref(), |side| unknowns[side].clone());
    let levels = levels(&design, &coefficients);
    let settled = Settled { levels, determined, ..settled };
    let quality = quality(&design, factor.condition(), &settled, limits);
    let weighed = weighed(readings, &settled, Vec::new());
    factor.inflate(readings.robust.inflation());
    let parts = Parts {
        region: *region,
        model,
        coefficients,
        factor: Vec::new(),
        shifts,
        quality,
        truncation: None,
    };
    Fit::of_sparse(parts, basis, Arc::new(factor)).map(|fit| fit.with_weighed(weighed))
}

fn settle(
    design: &Design<'_>,
    prior: &Prior,
    readings: &Readings<'_>,
    jitters: &[&Common],
) -> Result<Settled, FitError> {
    let model = Model::of(readings.samples);
    let mut settled = start(readings, model);
    let mut passes = 0;
    for robust in readings.robust.phases() {
        let is_plain = *robust == Robust::None && readings.limits.is_empty();
        for _ in 0..if is_plain { PASSES_MAX } else { REWEIGHING_MAX } {
            let solved = solve(design, &settled.rows(), &[], prior)?;
            settled.coefficients.clone_from(&solved.unknowns[0]);
            settled.levels = levels(design, &settled.coefficients);
            settled.determined = solved.determined;
            if passes < 2 {
                settled.moved = moved(design, &settled.coefficients, jitters)?;
            }
            passes += 1;
            if settled.reweigh(readings, model, *robust) {
                break;
            }
        }
    }
    Ok(settled)
}

/// What is held against rough fields: λP less what the constant has of it.
struct Prior {
    /// λP, the lower triangle by columns; empty where nothing is held.
    columns: Vec<Vec<(usize, f64)>>,
    free: Option<Vec<f64>>,
}

impl Prior {
    fn new(basis: &Basis, penalty: Penalty) -> Result<Self, FitError> {
        let Directions::Splines(splines) = basis.directions() else {
            return Err(FitError::Basis { kind: basis.spec().angular.name() });
        };
        if penalty.is_none() {
            return Ok(Self { columns: Vec::new(), free: None });
        }
        let mut columns = sparse_roughness(basis, splines, penalty.power)?;
        for column in &mut columns {
            for (_, value) in column {
                *value *= penalty.strength;
            }
        }
        let unity = basis.unity();
        let mut free = factor::apply(&columns, &unity);
        let length = crate::basis::dot(&free, &unity).sqrt();
        for value in &mut free {
            *value /= length;
        }
        Ok(Self { columns, free: Some(free) })
    }

    fn is_none(&self) -> bool {
        self.free.is_none()
    }

    fn apply(&self, x: &[f64]) -> Vec<f64> {
        let Some(free) = &self.free else { return vec![0.0; x.len()] };
        let across = crate::basis::dot(free, x);
        let mut out = factor::apply(&self.columns, x);
        out.iter_mut().zip(free).for_each(|(out, v)| *out -= across * v);
        out
    }
}

/// What a pass determines.
struct Solved {
    factor: Factor,
    /// By side, the values first.
    unknowns: Vec<Vec<f64>>,
    determined: f64,
}

/// Factors, solves, and corrects by the rows' own residuals.
fn solve(
    design: &Design<'_>,
    rows: &Rows<'_>,
    sides: &[Vec<f64>],
    prior: &Prior,
) -> Result<Solved, FitError> {
    let p = design.basis().len();
    let zeros = vec![vec![0.0; p]; 1 + sides.len()];
    // Without a prior they determine all.
    let mut signs = vec![0.0; if prior.is_none() { 0 } else { PROBES }];
    let (mut gram, mut dice) = (Gram::new(p, signs.len()), Signs(1));
    let first = pass(design, rows, sides, &zeros, |row| {
        signs.fill_with(|| dice.next());
        gram.absorb(row, &signs);
    })?;
    let (mut columns, probed) = gram.finish();
    if prior.is_none()
        && let Some(refused) = unmeasured(&columns, design.basis())
    {
        return Err(refused);
    }
    for (own, held) in columns.iter_mut().zip(&prior.columns) {
        gram::add(own, held);
    }
    let Some(factor) = Factor::new(columns.clone(), prior.free.clone())? else {
        return Err(weakest(columns, prior, design.basis()));
    };
    if prior.is_none() && factor.condition() > CONDITION_MAX {
        return Err(named(&factor.worst(), design.basis()));
    }
    let mut unknowns = zeros;
    let mut gradients = first.clone();
    for round in 0..=REFINEMENTS {
        for (unknowns, gradient) in unknowns.iter_mut().zip(&gradients) {
            let mut step = gradient.clone();
            factor.solve(&mut step);
            unknowns.iter_mut().zip(&step).for_each(|(x, step)| *x += step);
        }
        gradients = pass(design, rows, sides, &unknowns, |_| ())?;
        for (gradient, unknowns) in gradients.iter_mut().zip(&unknowns) {
            let held = prior.apply(unknowns);
            gradient.iter_mut().zip(&held).for_each(|(g, held)| *g -= held);
        }
        // In units of each functional's own uncertainty.
        let is_within = |part: f64| {
            let pairs = gradients.iter().zip(&first);
            pairs.into_iter().all(|(g, f)| factor.variance(g) <= part * part * factor.variance(f))
        };
        if is_within(ROUNDING) {
            break;
        }
        if round == REFINEMENTS && !is_within(SOLVED) {
            return Err(FitError::OutOfRange);
        }
    }
    if !unknowns.iter().flatten().all(|x| x.is_finite()) {
        return Err(FitError::OutOfRange);
    }
    let determined = if prior.is_none() { p as f64 } else { determined(&factor, &probed) };
    Ok(Solved { factor, unknowns, determined })
}

/// One pass of all rows, each divided by its standard uncertainty: Aᵀ(b - A x) for every side; rows
/// are handed on.
fn pass(
    design: &Design<'_>,
    rows: &Rows<'_>,
    sides: &[Vec<f64>],
    unknowns: &[Vec<f64>],
    mut hand: impl FnMut(Vec<(usize, f64)>),
) -> Result<Vec<Vec<f64>>, FitError> {
    let p = design.basis().len();
    let mut products = vec![vec![0.0; p]; unknowns.len()];
    let (mut room, mut dense) = (design.room(), vec![0.0; p]);
    for (i, (read, variance)) in rows.values.iter().zip(rows.variances).enumerate() {
        if *variance == f64::INFINITY {
            continue;
        }
        let weight = 1.0 / variance.sqrt();
        if !weight.is_finite() || weight == 0.0 {
            return Err(FitError::OutOfRange);
        }
        design.row(i, &mut room, &mut dense);
        let places = dense.iter().enumerate().filter(|(_, value)| **value != 0.0);
        let row: Vec<(usize, f64)> = places.map(|(j, value)| (j, weight * value)).collect();
        for (k, (product, unknowns)) in products.iter_mut().zip(unknowns).enumerate() {
            let value = if k == 0 { *read } else { sides[k - 1][i] };
            let fitted: f64 = row.iter().map(|(j, a)| a * unknowns[*j]).sum();
            let residual = weight * value - fitted;
            for (j, a) in &row {
                product[*j] += a * residual;
            }
        }
        hand(row);
    }
    Ok(products)
}

/// tr(A C Aᵀ): how many coefficients the rows determine, by vectors of random signs over the rows whose
/// products with Aᵀ these are. Off by about √(2/`PROBES`) of its root, never more than there are rows, since
/// no eigenvalue of A C Aᵀ exceeds 1.
fn determined(factor: &Factor, probed: &Mat<f64>) -> f64 {
    let count = probed.ncols();
    let sum: f64 = (0..count).map(|k| factor.variance(probed.col_as_slice(k))).sum();
    (sum / count as f64).clamp(1.0, factor.len() as f64)
}

/// Signs of equal odds, the same ones each time.
struct Signs(u64);

impl Signs {
    fn next(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        if self.0 >> 63 == 0 { 1.0 } else { -1.0 }
    }
}

/// Functions that no reading meets.
fn unmeasured(columns: &[Vec<(usize, f64)>], basis: &Basis) -> Option<FitError> {
    let is_met = |j: &usize| columns[*j].first().is_some_and(|(i, value)| i == j && *value > 0.0);
    let missing: Vec<usize> = (0..columns.len()).filter(|j| !is_met(j)).collect();
    (!missing.is_empty()).then(|| FitError::Undetermined {
        rank: columns.len() - missing.len(),
        coefficients: columns.len(),
        causes: Vec::new(),
        functions: missing.iter().take(NAMES_MAX).map(|j| basis.name(*j)).collect(),
    })
}

/// The functions in the combination that is determined least, where the matrix has no factor.
fn weakest(mut columns: Vec<Vec<(usize, f64)>>, prior: &Prior, basis: &Basis) -> FitError {
    for column in &mut columns {
        if let Some((_, diagonal)) = column.first_mut() {
            *diagonal *= 1.0 + RIDGE;
        }
    }
    let Ok(Some(factor)) = Factor::new(columns, None) else { return FitError::OutOfRange };
    if !prior.is_none() {
        return FitError::OutOfRange;
    }
    named(&factor.worst(), basis)
}

/// A combination of coefficients that is not determined, by its largest functions.
fn named(combination: &[f64], basis: &Basis) -> FitError {
    let coefficients = combination.len();
    let share = |k: usize| combination[k].abs();
    let mut by_share: Vec<usize> = (0..coefficients).collect();
    by_share.sort_by(|a, b| share(*b).total_cmp(&share(*a)).then(a.cmp(b)));
    FitError::Undetermined {
        rank: coefficients - 1,
        coefficients,
        causes: Vec::new(),
        functions: by_share.iter().take(NAMES_MAX).map(|k| basis.name(*k)).collect(),
    }
}

/// Splines with more functions than this are fitted here: a dense triangle of as many takes 32 MB.
pub(crate) const COEFFICIENTS_FROM: usize = 2000;
/// Corrections by the rows' residuals at most; one is enough up to a condition of 1e6.
const REFINEMENTS: usize = 4;
/// What of the gradient is aimed at, and what may be left.
const ROUNDING: f64 = 1e-14;
const SOLVED: f64 = 1e-9;
/// Vectors of random signs.
const PROBES: usize = 48;
/// Lifts a matrix without a factor just enough to have one.
const RIDGE: f64 = 1e-9;
/// Rows of a worse condition leave no digit of their products.
const CONDITION_MAX: f64 = 1e7;
/// Most functions that are named.
const NAMES_MAX: usize = 8;
