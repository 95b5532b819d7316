//! The Cholesky factor of sparse normal equations less the square of one vector, and what it solves.
//!
//! A penalty leaves the constant field free: its matrix is that of the roughness P less the square of
//! v = P u/√(uᵀP u), u being the constant. P is sparse and v vᵀ is not; so P is factored, and the
//! rest goes by Sherman and Morrison: (K - v vᵀ)⁻¹ = K⁻¹ + K⁻¹v vᵀK⁻¹/(1 - vᵀK⁻¹v).
//! Columns are scaled so that the diagonal of the whole is 1.

use crate::FitError;
use crate::basis::dot;
use faer::linalg::solvers::SolveCore;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, MatMut, Side};

/// A symmetric positive matrix K - v vᵀ, factored.
#[derive(Debug, Clone)]
pub(crate) struct Factor {
    llt: Llt<usize, f64>,
    matrix: Matrix,
    /// K⁻¹v, and the divisor 1 - vᵀK⁻¹v.
    free: Option<(Vec<f64>, f64)>,
    /// What variances are multiplied by.
    inflation: f64,
}

/// K by the columns of its lower triangle, in scaled coordinates, and v.
#[derive(Debug, Clone)]
struct Matrix {
    columns: Vec<Vec<(usize, f64)>>,
    scale: Vec<f64>,
    free: Option<Vec<f64>>,
}

impl Factor {
    /// Of a lower triangle by columns, rows rising. `None` where it is not positive.
    pub(crate) fn new(
        columns: Vec<Vec<(usize, f64)>>,
        free: Option<Vec<f64>>,
    ) -> Result<Option<Self>, FitError> {
        let Some(matrix) = Matrix::new(columns, free) else { return Ok(None) };
        let p = matrix.columns.len();
        let entries = matrix.columns.iter().enumerate();
        let triplets: Vec<Triplet<usize, usize, f64>> = entries
            .flat_map(|(j, column)| {
                column.iter().map(move |(i, value)| Triplet::new(*i, j, *value))
            })
            .collect();
        let sparse = SparseColMat::try_new_from_triplets(p, p, &triplets)
            .map_err(|_| FitError::OutOfRange)?;
        drop(triplets);
        let symbolic = SymbolicLlt::try_new(sparse.symbolic(), Side::Lower)
            .map_err(|_| FitError::OutOfRange)?;
        let Ok(llt) = Llt::try_new_with_symbolic(symbolic, sparse.as_ref(), Side::Lower) else {
            return Ok(None);
        };
        let mut new = Self { llt, matrix, free: None, inflation: 1.0 };
        if let Some(v) = new.matrix.free.clone() {
            let mut solved = v.clone();
            new.solve_matrix(&mut solved);
            let divisor = 1.0 - dot(&v, &solved);
            if divisor.is_nan() || divisor <= f64::EPSILON {
                return Ok(None);
            }
            new.free = Some((solved, divisor));
        }
        Ok(Some(new))
    }

    pub(crate) fn len(&self) -> usize {
        self.matrix.columns.len()
    }

    /// Solves in place.
    pub(crate) fn solve(&self, side: &mut [f64]) {
        self.matrix.rescale(side);
        self.solve_scaled(side);
        self.matrix.rescale(side);
    }

    /// The variance of a functional under the covariance that the inverse is.
    pub(crate) fn variance(&self, functional: &[f64]) -> f64 {
        let mut scaled = functional.to_vec();
        self.matrix.rescale(&mut scaled);
        let mut solved = scaled.clone();
        self.solve_scaled(&mut solved);
        self.inflation * dot(&scaled, &solved).max(0.0)
    }

    /// Multiplies every variance from now on.
    pub(crate) fn inflate(&mut self, factor: f64) {
        self.inflation *= factor;
    }

    /// A row of the covariance.
    pub(crate) fn covariance(&self, k: usize) -> Vec<f64> {
        let mut row = vec![0.0; self.len()];
        row[k] = self.inflation;
        self.solve(&mut row);
        row
    }

    /// Condition of rows with such a matrix of products, their columns of equal length: the root of
    /// the largest eigenvalue over the smallest, by power iteration to a few per cent.
    pub(crate) fn condition(&self) -> f64 {
        let largest = self.eigenvalue(|x| self.matrix.apply_scaled(x));
        let smallest = 1.0
            / self.eigenvalue(|x| {
                let mut solved = x.to_vec();
                self.solve_scaled(&mut solved);
                solved
            });
        (largest / smallest).sqrt()
    }

    /// The combination of coefficients that is determined worst.
    pub(crate) fn worst(&self) -> Vec<f64> {
        let mut x = start(self.len());
        for _ in 0..ITERATIONS {
            self.solve_scaled(&mut x);
            let length = dot(&x, &x).sqrt();
            for value in &mut x {
                *value /= length;
            }
        }
        self.matrix.rescale(&mut x);
        x
    }

    fn eigenvalue(&self, apply: impl Fn(&[f64]) -> Vec<f64>) -> f64 {
        let mut x = start(self.len());
        let mut value = 0.0;
        for _ in 0..ITERATIONS {
            x = apply(&x);
            value = dot(&x, &x).sqrt();
            for element in &mut x {
                *element /= value;
            }
        }
        value
    }

    fn solve_scaled(&self, side: &mut [f64]) {
        let across = self.free.as_ref().map(|(solved, divisor)| dot(solved, side) / divisor);
        self.solve_matrix(side);
        if let (Some((solved, _)), Some(across)) = (&self.free, across) {
            side.iter_mut().zip(solved).for_each(|(x, s)| *x += across * s);
        }
    }

    fn solve_matrix(&self, side: &mut [f64]) {
        let rows = side.len();
        let column = MatMut::from_column_major_slice_mut(side, rows, 1);
        self.llt.solve_in_place_with_conj(Conj::No, column);
    }
}

impl Matrix {
    /// `None` where a diagonal element of the whole is not positive.
    fn new(mut columns: Vec<Vec<(usize, f64)>>, free: Option<Vec<f64>>) -> Option<Self> {
        let element = |j: usize| {
            let own = columns[j].first().filter(|(i, _)| *i == j).map_or(0.0, |(_, value)| *value);
            own - free.as_ref().map_or(0.0, |v| v[j] * v[j])
        };
        let diagonal: Vec<f64> = (0..columns.len()).map(element).collect();
        if !diagonal.iter().all(|value| value.is_finite() && *value > 0.0) {
            return None;
        }
        let scale: Vec<f64> = diagonal.iter().map(|value| 1.0 / value.sqrt()).collect();
        for (j, column) in columns.iter_mut().enumerate() {
            for (i, value) in column {
                *value *= scale[j] * scale[*i];
            }
        }
        let free = free.map(|v| v.iter().zip(&scale).map(|(v, s)| v * s).collect());
        Some(Self { columns, scale, free })
    }

    fn rescale(&self, x: &mut [f64]) {
        x.iter_mut().zip(&self.scale).for_each(|(x, s)| *x *= s);
    }

    fn apply_scaled(&self, x: &[f64]) -> Vec<f64> {
        let mut out = apply(&self.columns, x);
        if let Some(v) = &self.free {
            let across = dot(v, x);
            out.iter_mut().zip(v).for_each(|(out, v)| *out -= across * v);
        }
        out
    }
}

/// A symmetric matrix, given by its lower triangle, times a vector.
pub(crate) fn apply(columns: &[Vec<(usize, f64)>], x: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; x.len()];
    for (j, column) in columns.iter().enumerate() {
        for &(i, value) in column {
            out[i] += value * x[j];
            if i != j {
                out[j] += value * x[i];
            }
        }
    }
    out
}

/// A vector that no eigenvector is likely to be orthogonal to.
fn start(p: usize) -> Vec<f64> {
    let x: Vec<f64> = (0..p).map(|i| libm::sin(1.0 + 12.9898 * i as f64)).collect();
    let length = dot(&x, &x).sqrt();
    x.into_iter().map(|value| value / length).collect()
}

/// Steps of a power iteration.
const ITERATIONS: usize = 40;
