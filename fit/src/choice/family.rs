//! Nested bases that share their rows: the largest one's rows are averaged over the beams once, and a
//! smaller basis takes some of their columns. Scores a basis by the readings of sweeps left out.
//!
//! With coefficients of prior covariance (λP)⁻¹ and H = A C Aᵀ for whitened rows A and posterior C,
//! a fold k of the readings, had it been left out, would have been predicted with errors
//! (1 - Hₖₖ)⁻¹ rₖ of covariance (1 - Hₖₖ)⁻¹, r being the residuals of the fit of all: exactly, and
//! without another fit (the block form of the identity for one reading, Cook and Weisberg 1982).

use super::evidence::{Evidence, Likeliest};
use crate::basis::Basis;
use crate::beam::Optics;
use crate::beam::design::Design;
use crate::grid::Grid;
use crate::penalty::{Prior, Roughness};
use crate::triangle::{Solution, Triangle};
use crate::{Angular, BasisSpec, FitError, Penalty, Position, Region, Sample, undetermined};
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, Mat, Par, Side};
use std::borrow::Cow;
use std::sync::Arc;

/// Whitened rows and values of the readings that a choice is made from.
pub(super) struct Family {
    spec: BasisSpec,
    region: Region,
    /// Readings by columns of the largest basis.
    rows: Mat<f64>,
    values: Vec<f64>,
    u: Vec<f64>,
    /// The readings' distinct coordinates.
    grid: Arc<Grid>,
}

/// How a basis does.
#[derive(Debug, Clone, Copy)]
pub(super) struct Trial {
    pub(super) penalty: Penalty,
    pub(super) coefficients: usize,
    /// Mean log density (Student's) of the readings left out, in units of their stated noise.
    pub(super) score: f64,
    /// RMS of their errors over their stated u.
    pub(super) left_out: f64,
    /// Mean square of the residuals beyond the stated noise, in the value's unit squared.
    pub(super) misfit: f64,
}

/// A penalty, with what it holds against a field, and the variance of the readings over their stated one.
struct Held {
    penalty: Penalty,
    scale: f64,
    roughness: Option<Roughness>,
}

/// What is to be tried of penalties.
#[derive(Debug, Clone, Copy)]
pub(super) struct Strengths {
    pub(super) power: Option<f64>,
    pub(super) strength: Option<f64>,
    /// The least variance of a reading over its stated one.
    pub(super) scale_min: f64,
}

impl Family {
    pub(super) fn new(
        spec: BasisSpec,
        region: &Region,
        (samples, grid): (&[Sample], Arc<Grid>),
        u: &[f64],
        optics: Option<&Optics>,
    ) -> Result<Self, FitError> {
        spec.checked_len()?;
        let basis = Basis::new(spec, *region)?;
        // Each row within a part of its own u is enough for a choice; a fit needs all of them together.
        let design = Design::of_a_share(samples, &basis, optics, 1)?;
        let (n, p) = (samples.len(), basis.len());
        let mut rows = Mat::zeros(n, p);
        let (mut room, mut row) = (design.room(), vec![0.0; p]);
        for (i, u) in u.iter().enumerate() {
            design.row(i, &mut room, &mut row);
            for (j, value) in row.iter().enumerate() {
                rows[(i, j)] = value / u;
            }
        }
        let values = samples.iter().zip(u).map(|(s, u)| s.value / u).collect();
        Ok(Self { spec, region: *region, rows, values, u: u.to_vec(), grid })
    }

    /// Scores a basis of the family with the penalty that the data ask for; and the residuals over the
    /// readings' u.
    pub(super) fn trial(
        &self,
        spec: BasisSpec,
        strengths: Strengths,
        folds: &[Vec<usize>],
    ) -> Result<Option<(Trial, Vec<f64>)>, FitError> {
        let basis = Basis::new(spec, self.region)?;
        let rows = self.columns(spec);
        let solution = triangle(&rows, &self.values).ok_or(FitError::OutOfRange)?;
        let Some(Held { penalty, scale, roughness }) =
            self.strength(&basis, &solution, strengths)?
        else {
            return Ok(None);
        };
        // In units of the readings' real noise.
        let prior = Prior::of(roughness.as_ref(), penalty.strength * scale);
        let Some(found) = self.left_out(&rows, &solution, &prior, scale, folds) else {
            return Ok(None);
        };
        let (trial, residuals) = found;
        Ok(Some((Trial { penalty, ..trial }, residuals)))
    }

    /// The likeliest penalty.
    fn strength(
        &self,
        basis: &Basis,
        solution: &Solution,
        strengths: Strengths,
    ) -> Result<Option<Held>, FitError> {
        let n = self.values.len();
        let is_held = strengths.power != Some(0.0) && strengths.strength != Some(0.0);
        if !is_held || basis.len() == 1 {
            let p = basis.len();
            let spectrum = solution.spectrum().ok_or(FitError::OutOfRange)?;
            // Rows over beams may tell by rounding what the fit will refuse.
            if n <= p || spectrum.rank() < p || undetermined::lacks(&self.grid, basis) {
                return Ok(None);
            }
            let scale = (solution.residual_squares(0) / (n - p) as f64).max(strengths.scale_min);
            return Ok(Some(Held { penalty: Penalty::NONE, scale, roughness: None }));
        }
        let splines = matches!(basis.spec().angular, Angular::Splines { .. });
        let some = [strengths.power.unwrap_or(2.0)];
        let is_open = strengths.power.is_none() && !splines;
        let powers: [&[f64]; 2] = if is_open { [&SMOOTHER, &ROUGHER] } else { [&some, &[]] };
        let mut best: Option<(f64, Likeliest, Roughness)> = None;
        // The deviance has one valley over the powers: down it until it rises.
        for way in powers {
            for &power in way {
                let roughness = Roughness::new(basis, power)?;
                let evidence = Evidence::new(solution, n, strengths.scale_min, &roughness)?;
                let found = match strengths.strength {
                    Some(strength) => Some(evidence.with(strength)),
                    None => evidence.likeliest(),
                };
                let Some(found) = found else { continue };
                if best.as_ref().is_some_and(|(_, best, _)| found.deviance >= best.deviance) {
                    break;
                }
                best = Some((power, found, roughness));
            }
            if best.as_ref().is_some_and(|(power, ..)| *power > SMOOTHER[0]) {
                break;
            }
        }
        Ok(best.map(|(power, Likeliest { strength, scale, .. }, roughness)| Held {
            penalty: Penalty { power, strength },
            scale,
            roughness: Some(roughness),
        }))
    }

    /// How well readings left out fold by fold are foretold, and the residuals of all.
    fn left_out(
        &self,
        rows: &Mat<f64>,
        whole: &Solution,
        prior: &Prior,
        scale: f64,
        folds: &[Vec<usize>],
    ) -> Option<(Trial, Vec<f64>)> {
        let p = rows.ncols();
        let mut triangle = Triangle::new(p, 1);
        let z = whole.rotated(0);
        let mut row = vec![0.0; p + 1];
        for (i, z) in z.iter().enumerate() {
            for (j, out) in row[..p].iter_mut().enumerate() {
                *out = if j < i { 0.0 } else { whole.r()[(i, j)] };
            }
            row[p] = *z;
            triangle.absorb(&row);
        }
        prior.absorb_into(&mut triangle, 1);
        let solution = triangle.solve()?;
        let unknowns = solution.unknowns(0);
        let c = Mat::from_fn(p, 1, |i, _| unknowns[i]);
        let s = solution.inverse_matrix();
        let fitted = rows * &c;
        // S is upper triangular: half of the products are by nothing.
        let mut spread = Mat::zeros(rows.nrows(), p);
        triangular::matmul(
            spread.as_mut(),
            BlockStructure::Rectangular,
            Accum::Replace,
            rows.as_ref(),
            BlockStructure::Rectangular,
            s.as_ref(),
            BlockStructure::TriangularUpper,
            1.0,
            Par::Seq,
        );
        let determined_min = if prior.is_none() { DETERMINED_MIN } else { 0.0 };
        let (mut score, mut squares, mut count) = (0.0, 0.0, 0);
        for fold in folds {
            let part = Mat::from_fn(fold.len(), p, |i, j| spread[(fold[i], j)]);
            let residuals: Vec<f64> =
                fold.iter().map(|i| self.values[*i] - fitted[(*i, 0)]).collect();
            for (error, variance) in missed(&part, &residuals, determined_min)? {
                let variance = scale * variance;
                let surprise = libm::log(1.0 + error * error / (FREEDOM * variance));
                score -= 0.5 * (libm::log(variance) + (FREEDOM + 1.0) * surprise);
                squares += error * error;
                count += 1;
            }
        }
        let count = f64::from(count);
        let is_sound = count > 0.0 && f64::is_finite(score);
        is_sound.then(|| {
            let residuals = self.values.iter().enumerate().map(|(i, v)| v - fitted[(i, 0)]);
            let trial = Trial {
                penalty: Penalty::NONE,
                coefficients: p,
                score: score / count,
                left_out: (squares / count).sqrt(),
                misfit: self.misfit(&fitted, spread.squared_norm_l2()),
            };
            (trial, residuals.collect())
        })
    }

    /// Mean square of the residuals beyond the stated noise.
    fn misfit(&self, fitted: &Mat<f64>, determined: f64) -> f64 {
        let n = self.values.len() as f64;
        let (mut squares, mut stated) = (0.0, 0.0);
        for (i, (value, u)) in self.values.iter().zip(&self.u).enumerate() {
            squares += (u * (value - fitted[(i, 0)])).powi(2);
            stated += u * u / n;
        }
        (squares / (n - determined).max(1.0) - stated).max(0.0)
    }

    /// The columns of a smaller basis.
    fn columns(&self, spec: BasisSpec) -> Cow<'_, Mat<f64>> {
        if spec == self.spec {
            return Cow::Borrowed(&self.rows);
        }
        let width = self.spec.angular.len();
        let angular = angular_columns(self.spec.angular, spec.angular);
        let places = match (self.spec.position, spec.position) {
            (Position::Legendre { .. }, Position::Legendre { .. }) => spec.position.len(),
            _ => self.rows.ncols() / width,
        };
        let columns: Vec<usize> =
            (0..places).flat_map(|q| angular.iter().map(move |j| q * width + j)).collect();
        let entry = |i, j: usize| self.rows[(i, columns[j])];
        Cow::Owned(Mat::from_fn(self.rows.nrows(), columns.len(), entry))
    }
}

/// The errors by which the readings of a fold would be missed without it, and their variances over a
/// reading's: (1 - U Uᵀ)⁻¹ r and that matrix's diagonal, `part` being U, A S of the fold. Of more readings
/// than coefficients through the smaller of the two triangles: (1 - U Uᵀ)⁻¹ = 1 + U (1 - Uᵀ U)⁻¹ Uᵀ (Woodbury 1950).
/// `None` where without the fold less than `determined_min` is left of what determines a combination.
fn missed(part: &Mat<f64>, residuals: &[f64], determined_min: f64) -> Option<Vec<(f64, f64)>> {
    let is_tall = part.nrows() > part.ncols();
    let gram = if is_tall { part.transpose() * part } else { part * part.transpose() };
    let size = gram.nrows();
    let kept = Mat::from_fn(size, size, |i, j| f64::from(u8::from(i == j)) - gram[(i, j)]);
    let kept = kept.llt(Side::Lower).ok()?;
    if (0..size).any(|i| kept.L()[(i, i)].powi(2) < determined_min) {
        return None;
    }
    // (1 - G)⁻¹ = WᵀW.
    let mut w =
        if is_tall { part.transpose().to_owned() } else { Mat::<f64>::identity(size, size) };
    solve_lower_triangular_in_place(kept.L(), w.as_mut(), Par::Seq);
    let r = Mat::from_fn(residuals.len(), 1, |i, _| residuals[i]);
    let errors = w.transpose() * (&w * &r);
    let own = if is_tall { 1.0 } else { 0.0 };
    let of = |i: usize| (errors[(i, 0)] + own * residuals[i], own + w.col(i).squared_norm_l2());
    Some((0..residuals.len()).map(of).collect())
}

/// Places of a smaller basis's functions among a larger one's: both are ordered by degree, Zernike
/// polynomials followed by their cosine columns.
fn angular_columns(from: Angular, to: Angular) -> Vec<usize> {
    match (from, to) {
        (Angular::Zernike { degree: most, .. }, Angular::Zernike { degree, cosine_columns }) => {
            let polynomials = |degree: usize| (degree + 1) * (degree + 2) / 2;
            (0..polynomials(degree))
                .chain(polynomials(most)..polynomials(most) + cosine_columns)
                .collect()
        }
        _ => (0..to.len()).collect(),
    }
}

fn triangle(rows: &Mat<f64>, values: &[f64]) -> Option<Solution> {
    let p = rows.ncols();
    let mut triangle = Triangle::new(p, 1);
    let mut row = vec![0.0; p + 1];
    for (i, value) in values.iter().enumerate() {
        for (j, out) in row[..p].iter_mut().enumerate() {
            *out = rows[(i, j)];
        }
        row[p] = *value;
        triangle.absorb(&row);
    }
    triangle.solve()
}

/// Degrees of freedom of Student's density by which predictions are scored. A lobe narrower than the
/// gap that a left-out sweep leaves surprises every basis: under a normal density the winner
/// would be who calls all of the lobe noise.
const FREEDOM: f64 = 4.0;
/// Less is left by rounding of what only the readings left out determine, where nothing is held.
const DETERMINED_MIN: f64 = 1e-10;
/// Powers of the degree that a penalty is tried with: from middling fields to very smooth ones, and
/// for fields with edges.
const SMOOTHER: [f64; 6] = [2.0, 3.0, 5.0, 8.0, 12.0, 18.0];
const ROUGHER: [f64; 1] = [1.0];
