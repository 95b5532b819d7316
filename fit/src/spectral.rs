//! Singular values and eigenvectors by faer, tried a second time from another side where its iteration
//! comes to no end: on ordinary well-conditioned matrices it now and then doesn't, by an accident of
//! rounding (one triangle of 120 in some ten thousand; scaled by 1 + 1e-15 it converged). The same
//! matrix turned round has the same spectrum and other roundings. Knows nothing of what the matrices
//! stand for.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::svd;
use faer::{Mat, MatRef, Par, Side, Spec};

/// Eigenvalues of a symmetric matrix, the smallest first, and eigenvectors as columns in that order.
#[derive(Debug, Clone)]
pub(crate) struct Eigen {
    pub(crate) values: Vec<f64>,
    pub(crate) vectors: Mat<f64>,
}

impl Eigen {
    /// Of the lower half of a symmetric matrix. `None` if there is no end to it from either side.
    pub(crate) fn of(matrix: &Mat<f64>) -> Option<Self> {
        Self::once(matrix.as_ref()).or_else(|| Self::from_the_end(matrix.as_ref()))
    }

    fn once(matrix: MatRef<'_, f64>) -> Option<Self> {
        let eigen = matrix.self_adjoint_eigen(Side::Lower).ok()?;
        let values = eigen.S().column_vector().iter().copied().collect();
        Some(Self { values, vectors: eigen.U().to_owned() })
    }

    /// With the unknowns in the other order.
    fn from_the_end(matrix: MatRef<'_, f64>) -> Option<Self> {
        let last = matrix.nrows().checked_sub(1)?;
        let half = |i: usize, j: usize| matrix[(i.max(j), i.min(j))];
        let turned = Mat::from_fn(last + 1, last + 1, |i, j| half(last - i, last - j));
        let Self { values, vectors } = Self::once(turned.as_ref())?;
        let vectors = Mat::from_fn(last + 1, last + 1, |i, k| vectors[(last - i, k)]);
        Some(Self { values, vectors })
    }
}

/// Singular values, the largest first, and right singular vectors as columns if they were asked for.
#[derive(Debug, Clone)]
pub(crate) struct Singular {
    pub(crate) values: Vec<f64>,
    /// Without columns if only values were asked for.
    pub(crate) right: Mat<f64>,
}

impl Singular {
    /// The values alone of a square matrix: that needs no other p² of memory. `None` if there is no end
    /// to it from either side.
    pub(crate) fn values(matrix: &Mat<f64>) -> Option<Vec<f64>> {
        let transposed = || once(matrix.transpose().to_owned().as_ref(), [false; 2]);
        Some(once(matrix.as_ref(), [false; 2]).or_else(transposed)?.0)
    }

    /// Of a matrix with at least as many rows as columns.
    pub(crate) fn of(matrix: &Mat<f64>) -> Option<Self> {
        let once = once(matrix.as_ref(), [false, true]).map(|(values, _, right)| (values, right));
        let (values, right) = once.or_else(|| right_of_transposed(matrix.as_ref()))?;
        Some(Self { values, right })
    }
}

/// The left singular vectors of the transpose are the right ones.
fn right_of_transposed(matrix: MatRef<'_, f64>) -> Option<(Vec<f64>, Mat<f64>)> {
    let transposed = matrix.transpose().to_owned();
    once(transposed.as_ref(), [true, false]).map(|(values, left, _)| (values, left))
}

/// Values, and as many left and right vectors as there are values, where wanted.
fn once(matrix: MatRef<'_, f64>, wanted: [bool; 2]) -> Option<(Vec<f64>, Mat<f64>, Mat<f64>)> {
    let (m, n) = matrix.shape();
    let count = m.min(n);
    let vectors = |wanted| {
        if wanted { svd::ComputeSvdVectors::Thin } else { svd::ComputeSvdVectors::No }
    };
    let scratch = svd::svd_scratch::<f64>(
        m,
        n,
        vectors(wanted[0]),
        vectors(wanted[1]),
        Par::Seq,
        Spec::default(),
    );
    let mut values = faer::diag::Diag::<f64>::zeros(count);
    let columns = |wanted| if wanted { count } else { 0 };
    let mut left = Mat::zeros(m, columns(wanted[0]));
    let mut right = Mat::zeros(n, columns(wanted[1]));
    svd::svd(
        matrix,
        values.as_mut(),
        wanted[0].then(|| left.as_mut()),
        wanted[1].then(|| right.as_mut()),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Spec::default(),
    )
    .ok()?;
    Some((values.column_vector().iter().copied().collect(), left, right))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers without a pattern (Roberts' sequence), as any matrix of a fit.
    fn any(m: usize, n: usize) -> Mat<f64> {
        Mat::from_fn(m, n, |i, j| {
            let part = 0.754_877_666_246_693 * (i + 1) as f64 + 0.569_840_290_998_053 * j as f64;
            part.fract() - 0.5 + f64::from(u8::from(i == j))
        })
    }

    #[test]
    fn from_the_other_side_it_is_the_same_spectrum() {
        let tall = any(9, 6);
        let gram = tall.transpose() * &tall;
        let (first, second) = (Eigen::of(&gram), Eigen::from_the_end(gram.as_ref()));
        let (Some(first), Some(second)) = (first, second) else { panic!("no end") };
        let singular = Singular::of(&tall).map(|found| (found.values, found.right));
        let (Some(one), Some(other)) = (singular, right_of_transposed(tall.as_ref())) else {
            panic!("no end")
        };
        for k in 0..6 {
            assert!((first.values[k] - second.values[k]).abs() < 1e-13);
            assert!((one.0[k] - other.0[k]).abs() < 1e-13);
            assert!((one.0[k].powi(2) - first.values[5 - k]).abs() < 1e-12);
            // Vectors to a sign; of A v = λ v each entry is checked.
            for vectors in [&first.vectors, &second.vectors] {
                let image = &gram * vectors.col(k);
                assert!(
                    (0..6).all(|i| (image[i] - first.values[k] * vectors[(i, k)]).abs() < 1e-12)
                );
            }
            for right in [&one.1, &other.1] {
                let image = tall.transpose() * (&tall * right.col(k));
                assert!(
                    (0..6).all(|i| (image[i] - one.0[k].powi(2) * right[(i, k)]).abs() < 1e-12)
                );
            }
        }
        let square = any(6, 6);
        let alone = Singular::values(&square).map(|values| values[5]);
        assert!(alone.is_some_and(|least| least > 0.0));
        assert!(
            Singular::of(&square)
                .is_some_and(|found| (found.values[5] / alone.unwrap_or(0.0) - 1.0).abs() < 1e-12)
        );
    }

    #[test]
    fn what_is_no_number_has_no_spectrum() {
        let broken = Mat::from_fn(4, 4, |i, j| if i == j { f64::NAN } else { 0.0 });
        assert!(Singular::values(&broken).is_none_or(|values| values.iter().any(|v| v.is_nan())));
    }
}
