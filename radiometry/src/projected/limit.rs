//! Surfaces through the receiver that bound outlines, in the stretched frame of a view: where a linear
//! or quadratic function of the direction is zero. They know no bodies.

use glam::{DMat3, DVec3};

use super::outline::Curve;
use super::view::View;
use crate::error_free::DoubleDouble;
use crate::wide::WideVec;

/// A function of the direction that is negative inside a cone, positive inside a plane.
#[derive(Debug, Clone, Copy)]
pub(super) enum Limit {
    /// normal · x
    Plane { normal: DVec3 },
    /// |across x|² - |along x|²: exact for a cone much narrower than the source.
    Cone { across: DMat3, along: DMat3 },
    /// xᵀ K x, K's diagonal and its (xy, xz, yz): exact for a cone as wide as the source or wider.
    Quadric { diagonal: DVec3, mixed: DVec3 },
}

/// What rounding makes of a function near its zeros, in parts of its terms.
const NOISE: f64 = 8.0 * f64::EPSILON;

impl Limit {
    /// The cone |across x|² = factor² |x|² or = (factor m·x)²: `across` by its columns in the
    /// unstretched frame, `along` likewise; `width` is how wide it looks, in the view's units.
    pub(super) fn cone(view: &View, across: [WideVec; 3], along: [WideVec; 3], width: f64) -> Self {
        const NARROW: f64 = 0.5;
        let exponent = libm::ilogb(view.unit_rad());
        let stretched = |columns: [WideVec; 3]| {
            [columns[0].scaled(exponent), columns[1].scaled(exponent), columns[2]]
        };
        let (across, along) = (stretched(across), stretched(along));
        if width < NARROW {
            let matrix = |columns: [WideVec; 3]| {
                let [x, y, z] = columns.map(WideVec::to_vec);
                DMat3::from_cols(x, y, z)
            };
            return Self::Cone { across: matrix(across), along: matrix(along) };
        }
        let entry = |i: usize, j: usize| -> DoubleDouble {
            across[i].dot(across[j]).sub(along[i].dot(along[j]))
        };
        Self::Quadric {
            diagonal: DVec3::new(entry(0, 0).to_f64(), entry(1, 1).to_f64(), entry(2, 2).to_f64()),
            mixed: DVec3::new(entry(0, 1).to_f64(), entry(0, 2).to_f64(), entry(1, 2).to_f64()),
        }
    }

    pub(super) fn value(&self, x: DVec3) -> f64 {
        self.between(x, x)
    }

    /// The bilinear form whose diagonal the function is; of a plane, the function of the first.
    fn between(&self, x: DVec3, y: DVec3) -> f64 {
        match *self {
            Self::Plane { normal } => normal.dot(x),
            Self::Cone { across, along } => {
                (across * x).dot(across * y) - (along * x).dot(along * y)
            }
            Self::Quadric { diagonal, mixed } => x.dot(times(diagonal, mixed, y)),
        }
    }

    /// The function along a curve.
    pub(super) fn along(&self, curve: &Curve) -> Along {
        let [base, sine, cosine] = curve.vectors();
        if let Self::Plane { normal } = *self {
            let vectors = [base, sine, -cosine];
            let [k0, k1, k2] = vectors.map(|v| normal.dot(v));
            let [s0, s1, s2] = vectors.map(|v| normal.abs().dot(v.abs()));
            return Along::new([k0, k1, k2, 0.0, 0.0], [s0, s1, s2, 0.0, 0.0]);
        }
        let of = |x: DVec3, y: DVec3| self.between(x, y);
        let size = |x: DVec3, y: DVec3| self.size(x, y);
        // sin² t is 2 v - v² for the versine v.
        let square = of(sine, sine);
        let coefficients = [
            of(base, base),
            2.0 * of(base, sine),
            2.0 * (square - of(base, cosine)),
            -2.0 * of(sine, cosine),
            of(cosine, cosine) - square,
        ];
        let square = size(sine, sine);
        let sizes = [
            size(base, base),
            2.0 * size(base, sine),
            2.0 * (square + size(base, cosine)),
            2.0 * size(sine, cosine),
            size(cosine, cosine) + square,
        ];
        Along::new(coefficients, sizes)
    }

    /// The size of the terms of the bilinear form.
    fn size(&self, x: DVec3, y: DVec3) -> f64 {
        match *self {
            Self::Plane { normal } => normal.abs().dot(x.abs()),
            Self::Cone { across, along } => {
                let square = across.to_cols_array().iter().map(|a| a * a).sum::<f64>()
                    + along.to_cols_array().iter().map(|a| a * a).sum::<f64>();
                square * x.length() * y.length()
            }
            Self::Quadric { diagonal, mixed } => {
                x.abs().dot(times(diagonal.abs(), mixed.abs(), y.abs()))
            }
        }
    }
}

/// A limit's function along a curve: k₀ + k₁ sin t + k₂ v + k₃ v sin t + k₄ v², v = 1 - cos t.
#[derive(Debug, Clone, Copy)]
pub(super) struct Along {
    coefficients: [f64; 5],
    /// Whether the curve runs along the limit, to rounding.
    pub(super) is_zero: bool,
}

impl Along {
    fn new(coefficients: [f64; 5], sizes: [f64; 5]) -> Self {
        let is_zero = coefficients.iter().zip(sizes).all(|(k, size)| k.abs() <= NOISE * size);
        Self { coefficients, is_zero }
    }

    /// Whether the curve is nowhere near the limit, wherever it may begin and end: by the sizes of the
    /// Fourier series' terms.
    pub(super) fn is_clear(&self) -> bool {
        const MARGIN: f64 = 1e-12;
        let [k0, k1, k2, k3, k4] = self.coefficients;
        let mean = k0 + k2 + 1.5 * k4;
        let (once, twice) = ([k1 + k3, k2 + 2.0 * k4], [k3 / 2.0, k4 / 2.0]);
        let size = |[a, b]: [f64; 2]| a.mul_add(a, b * b).sqrt();
        let terms: f64 = self.coefficients.iter().map(|k| k.abs()).sum();
        mean.abs() > size(once) + size(twice) + MARGIN * terms
    }

    /// Where a plane's function turns: there and half a turn on, and nowhere else. None of another's.
    pub(super) fn turning_point(&self) -> Option<f64> {
        let [_, k1, k2, k3, k4] = self.coefficients;
        (k3 == 0.0 && k4 == 0.0).then(|| libm::atan2(-k1, k2))
    }

    pub(super) fn value_and_slope(&self, t: f64) -> (f64, f64) {
        let [k0, k1, k2, k3, k4] = self.coefficients;
        let (sin_half, cos_half) = libm::sincos(t / 2.0);
        let (sin, versine) = (2.0 * sin_half * cos_half, 2.0 * sin_half * sin_half);
        let swing = k3.mul_add(versine, k1);
        let value = k0 + sin * swing + versine * k4.mul_add(versine, k2);
        let slope = (1.0 - versine) * swing + sin * (sin * k3 + 2.0_f64.mul_add(k4 * versine, k2));
        (value, slope)
    }

    /// A bound of the second derivative over |t| <= `reach`.
    pub(super) fn bend(&self, reach: f64) -> f64 {
        let [_, k1, k2, k3, k4] = self.coefficients.map(f64::abs);
        let (sin, versine) = (reach.min(1.0), (reach * reach / 2.0).min(2.0));
        k1 * sin + k2 + k3 * sin * (versine + 3.0) + k4 * 2.0 * sin.mul_add(sin, versine)
    }
}

/// A symmetric matrix times a vector.
fn times(diagonal: DVec3, mixed: DVec3, x: DVec3) -> DVec3 {
    let DVec3 { x: xy, y: xz, z: yz } = mixed;
    diagonal * x
        + DVec3::new(
            xy.mul_add(x.y, xz * x.z),
            xy.mul_add(x.x, yz * x.z),
            xz.mul_add(x.x, yz * x.y),
        )
}
