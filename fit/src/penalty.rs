//! What is held against a field before anything is measured: roughness, the more the rougher.
//!
//! A penalty λ cᵀP c added to the squares is at the same time a prior: coefficients that scatter about
//! zero with covariance (λP)⁻¹. The coefficients' covariance after the fit is then
//! `(AᵀWA + λP)⁻¹` (Wahba 1983, "Bayesian confidence intervals for the cross-validated smoothing
//! spline"; Silverman 1985): it holds the noise, and what the smoothing takes away, and in gaps it
//! grows to what the prior allows. The constant field is never penalised.
//!
//! P is a product of one matrix for the direction and one for the position. Polynomials of degree n
//! count ((1 + n)^power)²; splines their mean square and that of their derivatives of order `power`.

use crate::basis::{Basis, Derivative, Directions, PolarSplines, dot};
use crate::sparse::Gram;
use crate::triangle::{Solution, Triangle};
use crate::{BasisSpec, FitError};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Mat, MatRef, Par, Side};

/// How roughness is held against a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Penalty {
    /// A function of degree n may be as large as 1/(1 + n)^power of one of degree 0. For
    /// splines the order of the derivative, 1 or 2.
    pub power: f64,
    /// λ: the inverse of the variance of a coefficient of weight 1, in the value's unit to the -2.
    /// 0: nothing is held against anything.
    pub strength: f64,
}

impl Penalty {
    /// Plain least squares.
    pub const NONE: Self = Self { power: 0.0, strength: 0.0 };

    /// Whether it holds anything against a field.
    pub fn is_none(&self) -> bool {
        self.strength == 0.0
    }

    pub(crate) fn check(&self) -> Result<(), FitError> {
        let is_sound = self.strength.is_finite()
            && self.strength >= 0.0
            && (0.0..=POWER_MAX).contains(&self.power);
        if is_sound { Ok(()) } else { Err(FitError::Penalty { penalty: *self }) }
    }
}

/// A basis with what is held against its fields.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Penalised {
    /// Which functions.
    pub basis: BasisSpec,
    /// What is held against them.
    pub penalty: Penalty,
    /// Standard deviation of the real field about the nearest field of the basis along any ray, in
    /// the value's unit, as far as it is known ([`choose`](crate::choose) estimates it): part of
    /// the u of every radiance. Over an integral it averages out, and is left out. 0: not known.
    pub truncation: f64,
}

impl Penalised {
    /// Of a field that the basis can follow.
    pub const fn new(basis: BasisSpec, penalty: Penalty) -> Self {
        Self { basis, penalty, truncation: 0.0 }
    }

    pub(crate) fn check(&self) -> Result<(), FitError> {
        self.penalty.check()?;
        let is_sound = self.truncation.is_finite() && self.truncation >= 0.0;
        if is_sound { Ok(()) } else { Err(FitError::Truncation { truncation: self.truncation }) }
    }
}

impl From<BasisSpec> for Penalised {
    fn from(basis: BasisSpec) -> Self {
        Self::new(basis, Penalty::NONE)
    }
}

/// A penalty at its strength over a basis; nothing where it has none.
#[derive(Debug, Clone)]
pub(crate) struct Prior {
    /// The rows that stand for it.
    rows: Option<Mat<f64>>,
}

impl Prior {
    pub(crate) fn new(basis: &Basis, penalty: Penalty) -> Result<Self, FitError> {
        if penalty.is_none() || basis.len() == 1 {
            return Ok(Self { rows: None });
        }
        Ok(Self::of(Some(&Roughness::new(basis, penalty.power)?), penalty.strength))
    }

    /// Of a roughness that is known; of none nothing.
    pub(crate) fn of(roughness: Option<&Roughness>, strength: f64) -> Self {
        let held = roughness.filter(|_| strength > 0.0);
        Self { rows: held.map(|roughness| roughness.rows(strength.sqrt())) }
    }

    pub(crate) fn is_none(&self) -> bool {
        self.rows.is_none()
    }

    /// The penalty's rows: readings of zero with u = 1.
    pub(crate) fn held(&self) -> Option<&Mat<f64>> {
        self.rows.as_ref()
    }

    /// Takes the penalty's rows in, with zeros for the right-hand sides.
    pub(crate) fn absorb_into(&self, triangle: &mut Triangle, sides: usize) {
        let Some(rows) = &self.rows else { return };
        let p = rows.ncols();
        let mut wide = vec![0.0; p + sides];
        for i in 0..rows.nrows() {
            for (j, value) in wide[..p].iter_mut().enumerate() {
                *value = rows[(i, j)];
            }
            triangle.absorb(&wide);
        }
    }

    /// How many coefficients the samples determine rather than the penalty: all of them less
    /// λ tr(P C), C = S Sᵀ being the covariance.
    pub(crate) fn determined_by(&self, solution: &Solution) -> f64 {
        let all = solution.len() as f64;
        let Some(rows) = &self.rows else { return all };
        let held = rows * solution.inverse_matrix();
        (all - held.squared_norm_l2()).max(0.0)
    }
}

/// The square root L of `P = LᵀL`, upper triangular and of full rank, and the direction w = L u/|L u|
/// of the constant field u, which is free: what is held against c is |(1 - w wᵀ) L c|².
#[derive(Debug, Clone)]
pub(crate) struct Roughness {
    root: Root,
    free: Vec<f64>,
}

#[derive(Debug, Clone)]
enum Root {
    Diagonal(Vec<f64>),
    Upper(Mat<f64>),
}

impl Roughness {
    /// Of a basis, at strength 1.
    pub(crate) fn new(basis: &Basis, power: f64) -> Result<Self, FitError> {
        let directions = direction_root(basis.directions(), power)?;
        let places = place_root(basis, power)?;
        let root = if let (Root::Diagonal(a), Root::Diagonal(b)) = (&directions, &places) {
            Root::Diagonal(b.iter().flat_map(|b| a.iter().map(move |a| a * b)).collect())
        } else {
            let n = directions.len();
            let entry = |i: usize, j: usize| places.at(i / n, j / n) * directions.at(i % n, j % n);
            Root::Upper(Mat::from_fn(basis.len(), basis.len(), entry))
        };
        let mut free = root.times(&basis.unity());
        let length = dot(&free, &free).sqrt();
        for value in &mut free {
            *value /= length;
        }
        Ok(Self { root, free })
    }

    /// The square root over some of the functions (of splines over all), the constant held as well.
    pub(crate) fn of_functions(&self, kept: &[usize]) -> Mat<f64> {
        Mat::from_fn(kept.len(), kept.len(), |i, j| self.root.at(kept[i], kept[j]))
    }

    /// The rows that stand for the penalty, to be taken in like readings of value 0, times `factor`.
    fn rows(&self, factor: f64) -> Mat<f64> {
        let p = self.free.len();
        match &self.root {
            // The constant is one of the functions.
            Root::Diagonal(diagonal) => Mat::from_fn(p, p, |i, j| {
                if i == j && self.free[i] == 0.0 { factor * diagonal[i] } else { 0.0 }
            }),
            Root::Upper(root) => {
                // (1 - w wᵀ) L.
                let free = Mat::from_fn(p, 1, |i, _| self.free[i]);
                let across = free.transpose() * root;
                let mut rows = root - &free * &across;
                for column in 0..p {
                    rows.col_as_slice_mut(column).iter_mut().for_each(|value| *value *= factor);
                }
                rows
            }
        }
    }

    /// R in coordinates in which the penalty is that of the identity on all but the first, which is
    /// free: R L⁻¹ H, H being the reflection that takes w to the first axis.
    pub(crate) fn standard(&self, r: MatRef<'_, f64>) -> Mat<f64> {
        let p = self.free.len();
        let mut out = match &self.root {
            Root::Diagonal(d) => Mat::from_fn(r.nrows(), p, |i, j| r[(i, j)] / d[j]),
            Root::Upper(root) => {
                // X L = R, so Lᵀ Xᵀ = Rᵀ.
                let mut turned = r.transpose().to_owned();
                let lower = root.transpose();
                solve_lower_triangular_in_place(lower, turned.as_mut(), Par::Seq);
                turned.transpose().to_owned()
            }
        };
        // H = 1 - 2 v vᵀ/|v|², v = w - e.
        let mut v = self.free.clone();
        let sign = if v[0] > 0.0 { -1.0 } else { 1.0 };
        v[0] -= sign;
        let square = dot(&v, &v);
        let mut products = vec![0.0; out.nrows()];
        for (j, v) in v.iter().enumerate() {
            let column = out.col_as_slice(j);
            products.iter_mut().zip(column).for_each(|(product, x)| *product += x * v);
        }
        for (j, v) in v.iter().enumerate() {
            let factor = 2.0 * v / square;
            let column = out.col_as_slice_mut(j);
            column.iter_mut().zip(&products).for_each(|(x, product)| *x -= factor * product);
        }
        out
    }
}

impl Root {
    fn len(&self) -> usize {
        match self {
            Self::Diagonal(diagonal) => diagonal.len(),
            Self::Upper(upper) => upper.nrows(),
        }
    }

    fn at(&self, i: usize, j: usize) -> f64 {
        match self {
            Self::Diagonal(diagonal) if i == j => diagonal[i],
            Self::Upper(upper) if i <= j => upper[(i, j)],
            Self::Diagonal(_) | Self::Upper(_) => 0.0,
        }
    }

    fn times(&self, x: &[f64]) -> Vec<f64> {
        let p = self.len();
        (0..p).map(|i| (i..p).map(|j| self.at(i, j) * x[j]).sum()).collect()
    }

    /// Of a symmetric positive matrix, row by row.
    fn of(matrix: &Mat<f64>) -> Result<Self, FitError> {
        let cholesky = matrix.llt(Side::Lower).map_err(|_| FitError::OutOfRange)?;
        Ok(Self::Upper(cholesky.L().transpose().to_owned()))
    }
}

fn direction_root(directions: &Directions, power: f64) -> Result<Root, FitError> {
    if let Directions::Splines(splines) = directions {
        return spline_root(splines, power);
    }
    let weight = |j: usize| libm::pow(1.0 + directions.degree(j) as f64, power);
    Ok(Root::Diagonal((0..directions.len()).map(weight).collect()))
}

fn place_root(basis: &Basis, power: f64) -> Result<Root, FitError> {
    let places = basis.places();
    if places.is_polynomial() {
        let weight = |q: usize| libm::pow(1.0 + places.degree(q) as f64, power);
        return Ok(Root::Diagonal((0..places.len()).map(weight).collect()));
    }
    Root::of(&place_roughness(basis, power)?)
}

/// What is held against the functions of the position.
fn place_roughness(basis: &Basis, power: f64) -> Result<Mat<f64>, FitError> {
    let (places, n) = (basis.places(), basis.places().len());
    if places.is_polynomial() {
        let weight = |q: usize| libm::pow(1.0 + places.degree(q) as f64, 2.0 * power);
        return Ok(Mat::from_fn(n, n, |p, q| if p == q { weight(q) } else { 0.0 }));
    }
    let grams = places.grams()?;
    Ok(Mat::from_fn(n, n, |p, q| grams.of(p, q).1))
}

fn spline_root(splines: &PolarSplines, power: f64) -> Result<Root, FitError> {
    let n = splines.len();
    let mut matrix = Mat::<f64>::zeros(n, n);
    spline_forms(splines, power, |form, weight| form.add_square(weight, &mut matrix))?;
    Root::of(&matrix)
}

/// ∫ (f² + roughness) dω/2π as weighted squares of forms: of order 1 the squared gradient on the
/// sphere, of order 2 the squared second derivatives `f_θθ`, `(f_θφ - cot θ f_φ)/sin θ` (twice) and
/// `f_φφ/sin² θ + cot θ f_θ`, which are finite at the pole for what is smooth there.
fn spline_forms(
    splines: &PolarSplines,
    power: f64,
    mut hand: impl FnMut(&Form, f64),
) -> Result<(), FitError> {
    let is_order = |order: f64| (power - order).abs() < 1e-9;
    if !is_order(1.0) && !is_order(2.0) {
        return Err(FitError::Penalty { penalty: Penalty { power, strength: 1.0 } });
    }
    let mut form = Form { dense: vec![0.0; splines.len()], touched: Vec::new() };
    for (theta, phi, weight) in splines.nodes() {
        let (sin, cos) = libm::sincos(theta);
        let (over, cot) = (1.0 / sin, cos / sin);
        let forms: &[&[(usize, usize, f64)]] = if is_order(1.0) {
            &[&[(0, 0, 1.0)], &[(1, 0, 1.0)], &[(0, 1, over)]]
        } else {
            let sqrt2 = core::f64::consts::SQRT_2;
            &[
                &[(0, 0, 1.0)],
                &[(2, 0, 1.0)],
                &[(1, 1, sqrt2 * over), (0, 1, -sqrt2 * over * cot)],
                &[(0, 2, over * over), (1, 0, cot)],
            ]
        };
        for terms in forms {
            form.fill(splines, (theta, phi), terms)?;
            hand(&form, weight / core::f64::consts::TAU);
        }
    }
    Ok(())
}

/// P itself, the lower triangle by columns, where the functions of the direction are splines.
pub(crate) fn sparse_roughness(
    basis: &Basis,
    splines: &PolarSplines,
    power: f64,
) -> Result<Vec<Vec<(usize, f64)>>, FitError> {
    let n = splines.len();
    let mut gram = Gram::new(n, 0);
    spline_forms(splines, power, |form, weight| {
        let root = weight.sqrt();
        gram.absorb(form.touched.iter().map(|k| (*k, root * form.dense[*k])).collect(), &[]);
    })?;
    let (lower, _) = gram.finish();
    let mut whole = lower.clone();
    for (j, column) in lower.iter().enumerate() {
        column.iter().filter(|(i, _)| *i != j).for_each(|(i, value)| whole[*i].push((j, *value)));
    }
    for column in &mut whole {
        column.sort_unstable_by_key(|(i, _)| *i);
    }
    let places = place_roughness(basis, power)?;
    let mut out = Vec::with_capacity(basis.len());
    for q in 0..places.ncols() {
        for j in 0..n {
            let mut column = Vec::new();
            for r in (q..places.nrows()).filter(|r| places[(*r, q)] != 0.0) {
                let direction = if r == q { &lower[j] } else { &whole[j] };
                let product = |(i, value): &(usize, f64)| (r * n + i, places[(r, q)] * value);
                column.extend(direction.iter().map(product));
            }
            out.push(column);
        }
    }
    Ok(out)
}

/// A linear form over the functions, of which few are not zero.
struct Form {
    dense: Vec<f64>,
    touched: Vec<usize>,
}

impl Form {
    /// The sum of derivatives, each times a factor: (order in θ, order in φ, factor).
    fn fill(
        &mut self,
        splines: &PolarSplines,
        (theta, phi): (f64, f64),
        terms: &[(usize, usize, f64)],
    ) -> Result<(), FitError> {
        let Self { dense, touched } = self;
        for k in touched.drain(..) {
            dense[k] = 0.0;
        }
        for &(along, around, factor) in terms {
            let order = Derivative { theta: along, phi: around };
            let taken = splines.each(theta, phi, order, |k, value| {
                if dense[k] == 0.0 {
                    touched.push(k);
                }
                dense[k] += factor * value;
            });
            taken.map_err(|_| FitError::OutOfRange)?;
        }
        touched.sort_unstable();
        touched.dedup();
        Ok(())
    }

    fn add_square(&self, weight: f64, matrix: &mut Mat<f64>) {
        for &j in &self.touched {
            let factor = weight * self.dense[j];
            for &i in &self.touched {
                matrix[(i, j)] += factor * self.dense[i];
            }
        }
    }
}

/// Beyond it nothing but the constant would be left.
const POWER_MAX: f64 = 18.0;
