//! Fields that are the same turned or mirrored: whether the readings allow it, and the field if they do.
//!
//! What the symmetry forbids are the combinations V of coefficients that it changes: of T c = c, T being
//! what turning or mirroring does to the coefficients, the row space of T - 1. T is found by evaluating the
//! functions along rays and their images, so that any basis that holds the images of its fields will do;
//! one that does not is refused. Vᵀc should be zero within its whole covariance K, the common components'
//! part and that of what the functions can't follow included (an axis that is off makes a round source look lopsided): its square by K⁻¹ follows χ² of as many
//! degrees of freedom as there are combinations. If that is not too rare, c is moved to the nearest symmetric
//! field by the independent covariance, `c - C V (VᵀC V)⁻¹ Vᵀc`, and so is the covariance: the fit in the basis of
//! symmetric fields alone.

use crate::basis::Basis;
use crate::parts::CommonShift;
use crate::spectral::Singular;
use crate::{Angular, Chart, Fit, FitError, Parts, Quality, Ray, Region, Truncation, sparse};
use faer::linalg::solvers::{Solve, SolveLstsq};
use faer::{Mat, Side};

/// What a field is said to be the same under, about the region's middle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Symmetry {
    /// Any turn about the normal.
    Rotational,
    /// A mirror that holds the normal and this azimuth, and one at right angles to it.
    Quadrant {
        /// The azimuth, radians.
        phi_rad: f64,
    },
    /// A mirror that holds the normal and this azimuth.
    Plane {
        /// The azimuth, radians.
        phi_rad: f64,
    },
}

/// How well a field bears a symmetry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SymmetryTest {
    /// Which one.
    pub symmetry: Symmetry,
    /// Combinations of coefficients that it forbids.
    pub forbidden: usize,
    /// Their squares over their covariance, all components of it.
    pub chi2: f64,
    /// How often a symmetric source would show that much or more.
    pub p: f64,
}

/// Why a symmetry is not used.
#[derive(Debug, Clone, PartialEq)]
pub enum SymmetryError {
    /// The source doesn't have it, as the readings show.
    Contradicted(SymmetryTest),
    /// The basis doesn't hold the images of its own fields. Splines know turns by their own spans
    /// alone.
    Basis {
        /// Which functions.
        kind: &'static str,
        /// Which symmetry.
        symmetry: Symmetry,
    },
    /// Only on a flat sample and at a point is it known what a turn does to a ray's coordinates.
    Chart,
    /// As of a fit.
    Fit(FitError),
}

impl std::fmt::Display for SymmetryError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Contradicted(SymmetryTest { symmetry, forbidden, chi2, p }) => write!(
                f,
                "the readings contradict {}: chi2 {chi2:.1} of {forbidden} forbidden combinations, which \
                 a symmetric source shows with a probability of {p:.1e}; expected at least {P_MIN}",
                symmetry.name()
            ),
            Self::Basis { kind, symmetry } => write!(
                f,
                "basis `{kind}` over this region doesn't hold the images of its fields under {}",
                symmetry.name()
            ),
            Self::Chart => f.write_str(
                "a symmetry can be asked for on a flat sample or at a point alone, not in this chart",
            ),
            Self::Fit(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for SymmetryError {}

impl Symmetry {
    /// All of them, mirrors at this azimuth.
    pub const fn all_at(phi_rad: f64) -> [Self; 3] {
        [Self::Rotational, Self::Quadrant { phi_rad }, Self::Plane { phi_rad }]
    }

    /// As plans write it.
    pub const fn key(self) -> &'static str {
        match self {
            Self::Rotational => "rotational",
            Self::Quadrant { .. } => "quadrant",
            Self::Plane { .. } => "plane",
        }
    }

    /// Whether it has mirrors, which stand at an azimuth.
    pub const fn has_azimuth(self) -> bool {
        !matches!(self, Self::Rotational)
    }

    /// In words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rotational => "rotational symmetry",
            Self::Quadrant { .. } => "quadrant symmetry",
            Self::Plane { .. } => "plane symmetry",
        }
    }

    /// Images of a ray that the field shall be the same along. A field that is the same turned by a
    /// radian, again and again, is the same under any turn.
    pub(crate) fn images(self, ray: &Ray, region: &Region) -> Vec<Ray> {
        let middle = |(from, to): (f64, f64)| 0.5 * (from + to);
        let (cx, cy) = (middle(region.x_m), middle(region.y_m));
        let (x, y) = (ray.x_m - cx, ray.y_m - cy);
        let turned = |angle: f64| {
            let (s, c) = libm::sincos(angle);
            Ray {
                x_m: cx + c * x - s * y,
                y_m: cy + s * x + c * y,
                phi_rad: ray.phi_rad + angle,
                ..*ray
            }
        };
        let mirrored = |phi: f64| {
            let (s, c) = libm::sincos(2.0 * phi);
            Ray {
                x_m: cx + c * x + s * y,
                y_m: cy + s * x - c * y,
                phi_rad: 2.0 * phi - ray.phi_rad,
                ..*ray
            }
        };
        match self {
            Self::Rotational => vec![turned(1.0)],
            Self::Plane { phi_rad } => vec![mirrored(phi_rad)],
            Self::Quadrant { phi_rad } => {
                vec![mirrored(phi_rad), mirrored(phi_rad + core::f64::consts::FRAC_PI_2)]
            }
        }
    }
}

impl Fit {
    /// The field with a symmetry, and how well the readings bear it; refused where that is less often
    /// than once in a hundred symmetric sources. Residuals and condition are those of the fit without it.
    pub fn symmetric(&self, symmetry: Symmetry) -> Result<(Self, SymmetryTest), SymmetryError> {
        if !matches!(self.region().chart, Chart::Surface | Chart::Environment) {
            return Err(SymmetryError::Chart);
        }
        if self.is_sparse() {
            return Err(SymmetryError::Fit(sparse::refusal("a symmetry")));
        }
        let p = self.coefficients().len();
        let basis = self.functions();
        let v = forbidden(basis, symmetry)?;
        let r = v.ncols();
        let s = self.factor_matrix();
        let spread = v.transpose() * &s;
        let own = &spread * spread.transpose();
        let shifts: &[CommonShift] = &self.parts().shifts;
        let common = Mat::from_fn(p, shifts.len(), |i, k| shifts[k].shift[i]);
        let along = v.transpose() * &common;
        let mut whole = &own + &along * along.transpose();
        if let Some(Truncation { missed, .. }) = &self.parts().truncation {
            let along = v.transpose() * Mat::from_fn(p, missed.len(), |i, k| missed[k][i]);
            whole += &along * along.transpose();
        }
        let c = Mat::from_fn(p, 1, |i, _| self.coefficients()[i]);
        let off = v.transpose() * &c;
        let out_of_range = || SymmetryError::Fit(FitError::OutOfRange);
        let solved = whole.llt(Side::Lower).map_err(|_| out_of_range())?.solve(&off);
        let chi2: f64 = (0..r).map(|k| off[(k, 0)] * solved[(k, 0)]).sum();
        let test = SymmetryTest { symmetry, forbidden: r, chi2, p: survival(chi2, r) };
        if r == 0 {
            return Ok((self.clone(), test));
        }
        if test.p < P_MIN {
            return Err(SymmetryError::Contradicted(test));
        }
        let inverse = own.llt(Side::Lower).map_err(|_| out_of_range())?;
        // C V (VᵀC V)⁻¹, by which what is forbidden is taken away.
        let carried = &s * spread.transpose();
        let remove = |x: &Mat<f64>| x - &carried * inverse.solve(v.transpose() * x);
        let coefficients = remove(&c).col(0).iter().copied().collect();
        let common = remove(&common);
        let shifts = shifts
            .iter()
            .enumerate()
            .map(|(k, shift)| CommonShift {
                name: shift.name.clone(),
                shift: common.col(k).iter().copied().collect(),
            })
            .collect();
        let old = self.parts().quality;
        let quality = if self.penalty().is_none() {
            let determined = (old.determined - r as f64).max(0.0);
            Quality { determined, dof: old.dof + r, ..old }
        } else {
            old
        };
        let truncation = self.parts().truncation.as_ref();
        let truncation = truncation.map(|missed| self.under(symmetry, missed, &remove));
        let parts = Parts {
            coefficients,
            factor: packed(&remove(&s)),
            shifts,
            quality,
            truncation: truncation.transpose()?,
            ..self.parts().clone()
        };
        let measured = self.measured().and_then(|all| all.under(symmetry, self.region()));
        Ok((self.with_parts(parts).with_measured(measured), test))
    }

    /// What the symmetric fit misses of a symmetric source: of every missed field what the fit's own
    /// functions have of it goes the way of the coefficients, of the finer functions the symmetric
    /// ones stay. Where they don't hold the images of their fields, over a region that is no
    /// square, all of them stay: too much rather than too little.
    fn under(
        &self,
        symmetry: Symmetry,
        truncation: &Truncation,
        remove: &impl Fn(&Mat<f64>) -> Mat<f64>,
    ) -> Result<Truncation, SymmetryError> {
        let Some(beyond) = self.beyond() else { return Ok(truncation.clone()) };
        let (p, q, missed) = (self.coefficients().len(), beyond.len(), &truncation.missed);
        let own = remove(&Mat::from_fn(p, missed.len(), |i, k| missed[k][i]));
        let mut finer = Mat::from_fn(q, missed.len(), |i, k| missed[k][p + i]);
        match forbidden(beyond, symmetry) {
            Ok(v) => finer = &finer - &v * (v.transpose() * &finer),
            Err(SymmetryError::Basis { .. }) => {}
            Err(error) => return Err(error),
        }
        let field = |k: usize| own.col(k).iter().chain(finer.col(k).iter()).copied().collect();
        let uneven = truncation.uneven.under(symmetry);
        Ok(Truncation {
            missed: (0..missed.len()).map(field).collect(),
            uneven,
            ..truncation.clone()
        })
    }

    /// S of the coefficients' covariance, upper triangular.
    pub(crate) fn factor_matrix(&self) -> Mat<f64> {
        let factor = &self.parts().factor;
        let p = self.coefficients().len();
        Mat::from_fn(p, p, |i, j| if i <= j { factor[j * (j + 1) / 2 + i] } else { 0.0 })
    }
}

/// The packed upper triangle S' with S' S'ᵀ = M Mᵀ: of M turned upside down the transpose's Q R, turned back.
fn packed(m: &Mat<f64>) -> Vec<f64> {
    let p = m.nrows();
    let turned = Mat::from_fn(p, p, |i, j| m[(p - 1 - j, i)]);
    let r = turned.qr().R().to_owned();
    (0..p)
        .flat_map(|j| (0..=j).map(move |i| (i, j)))
        .map(|(i, j)| r[(p - 1 - j, p - 1 - i)])
        .collect()
}

/// The combinations of coefficients that a symmetry changes: orthonormal columns.
fn forbidden(basis: &Basis, symmetry: Symmetry) -> Result<Mat<f64>, SymmetryError> {
    let p = basis.len();
    let rays = rays(basis, 2 * p + 60);
    let rows = |image: &dyn Fn(&Ray) -> Ray| {
        let mut scratch = basis.scratch();
        let mut row = vec![0.0; p];
        let mut all = Mat::zeros(rays.len(), p);
        for (i, ray) in rays.iter().enumerate() {
            basis.row(&image(ray), &mut scratch, &mut row);
            row.iter().enumerate().for_each(|(j, value)| all[(i, j)] = *value);
        }
        all
    };
    let own = rows(&|ray| *ray);
    let qr = own.qr();
    let mut changes = Mat::zeros(0, p);
    let count = symmetry.images(&rays[0], basis.region()).len();
    for k in 0..count {
        let images = rows(&|ray| symmetry.images(ray, basis.region())[k]);
        let t = qr.solve_lstsq(&images);
        let missed = (&images - &own * &t).norm_max();
        let is_held = missed < CLOSED * images.norm_max();
        if !is_held {
            let kind = basis.spec().angular.name();
            return Err(SymmetryError::Basis { kind, symmetry });
        }
        let done = changes.nrows();
        changes = Mat::from_fn(done + p, p, |i, j| {
            if i < done {
                changes[(i, j)]
            } else {
                t[(i - done, j)] - f64::from(u8::from(i - done == j))
            }
        });
    }
    let Singular { values, right } =
        Singular::of(&changes).ok_or(SymmetryError::Fit(FitError::OutOfRange))?;
    let rank = values.iter().filter(|value| **value > RANK).count();
    Ok(right.get(.., ..rank).to_owned())
}

/// Rays spread evenly (Roberts' sequence) over the directions and a disk within the region. Harmonics
/// of the whole sphere are told apart on the whole of it alone.
fn rays(basis: &Basis, count: usize) -> Vec<Ray> {
    let region = basis.region();
    let middle = |(from, to): (f64, f64)| 0.5 * (from + to);
    let half = |(from, to): (f64, f64)| 0.5 * (to - from);
    let radius = half(region.x_m).min(half(region.y_m));
    let theta_max = match basis.spec().angular {
        Angular::Spherical { .. } => core::f64::consts::PI,
        _ => region.theta_max_rad.max(core::f64::consts::FRAC_PI_2),
    };
    // The powers of the inverse of x⁵ = x + 1's root.
    let part = |i: usize, power: i32| {
        let step = libm::pow(1.167_303_978_261_418_7, -f64::from(power));
        (0.5 + step * (i + 1) as f64).fract()
    };
    (0..count)
        .map(|i| {
            let (at, turn) = (radius * part(i, 3).sqrt(), core::f64::consts::TAU * part(i, 4));
            let (s, c) = libm::sincos(turn);
            Ray {
                x_m: middle(region.x_m) + at * c,
                y_m: middle(region.y_m) + at * s,
                theta_rad: theta_max * part(i, 1),
                phi_rad: core::f64::consts::TAU * part(i, 2),
            }
        })
        .collect()
}

/// The probability that χ² of so many degrees of freedom is larger: the regularised incomplete gamma
/// function Q(k/2, χ²/2), by its series or its continued fraction (DLMF 8.7.1, 8.9.2), to 1e-12 or so.
pub(crate) fn survival(chi2: f64, dof: usize) -> f64 {
    let (a, x) = (0.5 * dof as f64, 0.5 * chi2);
    if dof == 0 || x <= 0.0 {
        return 1.0;
    }
    let front = libm::exp(a * libm::log(x) - x - libm::lgamma(a));
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * f64::EPSILON {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return (1.0 - front * sum).max(0.0);
    }
    // Lentz's method.
    let (mut b, mut c) = (x + 1.0 - a, 1e300);
    let mut d = 1.0 / b;
    let mut h = d;
    for i in 1..10_000 {
        let i = f64::from(i);
        let an = -i * (i - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        let factor = c * d;
        h *= factor;
        if (factor - 1.0).abs() < f64::EPSILON {
            break;
        }
    }
    front * h
}

/// A symmetric source is refused once in so many.
const P_MIN: f64 = 0.01;
/// An image that the basis holds is met to rounding, its columns' condition included.
const CLOSED: f64 = 1e-7;
/// A turn by a radian changes fields that go round m times, m to 43, by 0.018 at least.
const RANK: f64 = 1e-5;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chi_squares_tail_is_the_tables() {
        // Abramowitz and Stegun, table 26.8.
        let table =
            [(3.841_46, 1, 0.05), (6.634_90, 1, 0.01), (18.307_0, 10, 0.05), (23.209_3, 10, 0.01)];
        for (chi2, dof, p) in table.into_iter().chain([(124.342, 100, 0.05), (77.929_5, 100, 0.95)])
        {
            assert!((survival(chi2, dof) / p - 1.0).abs() < 2e-5, "{chi2} {dof}");
        }
        assert!((survival(2.0, 2) - libm::exp(-1.0)).abs() < 1e-14);
        assert!(survival(1e6, 5) >= 0.0 && (survival(0.0, 5) - 1.0).abs() < 1e-15);
    }
}
