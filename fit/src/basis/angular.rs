//! The functions of the direction, ready to be evaluated: one face for every kind of them.

use super::Angular;
use super::plane::SecondPlane;
use super::splines::PolarSplines;
use crate::{Chart, FitError};
use glam::DVec3;
use radiometry::DomainError;
use radiometry::basis::zernike::ansi_order;
use radiometry::basis::{HemisphericalHarmonics, SphericalHarmonics, Zernike};
use radiometry::quadrature::gauss_legendre;
use std::f64::consts::{PI, TAU};

/// The functions of a kind.
#[derive(Debug, Clone)]
pub(crate) enum Directions {
    /// Zernike polynomials, then cos θ Z(2k,0), k from 0.
    Zernike {
        zernike: Zernike,
        cosine: Option<Cosine>,
    },
    Hemispherical(HemisphericalHarmonics),
    /// All harmonics, and the places of the even ones among them, by degree.
    Even {
        all: SphericalHarmonics,
        even: Vec<usize>,
    },
    Splines(PolarSplines),
    /// Over the whole sphere, or over the hemisphere alone: there they are not orthogonal.
    Spherical {
        all: SphericalHarmonics,
        is_whole: bool,
    },
    /// Functions of the ray: see [`super::Basis::direction_of`].
    SecondPlane(SecondPlane),
}

/// cos θ times Zernike polynomials of order 0.
#[derive(Debug, Clone)]
pub(crate) struct Cosine {
    zernike: Zernike,
    columns: usize,
}

impl Directions {
    pub(crate) fn new(angular: Angular, chart: Chart) -> Result<Self, FitError> {
        let refused = |_: DomainError| FitError::Basis { kind: angular.name() };
        let foreign = || FitError::BasisOfChart { kind: angular.name(), chart: chart.name() };
        if !angular.is_of(&chart) {
            return Err(foreign());
        }
        Ok(match angular {
            Angular::Zernike { degree, cosine_columns } => Self::Zernike {
                zernike: Zernike::new(degree),
                cosine: (cosine_columns > 0).then(|| Cosine::new(cosine_columns)),
            },
            Angular::Hemispherical { degree } => {
                Self::Hemispherical(HemisphericalHarmonics::new(degree).map_err(refused)?)
            }
            Angular::EvenHarmonics { degree } => Self::Even {
                all: SphericalHarmonics::new(degree).map_err(refused)?,
                even: (0..=degree)
                    .flat_map(|l| (0..=2 * l).step_by(2).map(move |place| l * l + place))
                    .collect(),
            },
            Angular::Splines { theta_spans, phi_spans, fine } => {
                Self::Splines(PolarSplines::new(theta_spans, phi_spans, fine).map_err(refused)?)
            }
            Angular::Spherical { degree } => Self::Spherical {
                all: SphericalHarmonics::new(degree).map_err(refused)?,
                is_whole: chart.is_whole_sphere(),
            },
            Angular::SecondPlane { degree } => {
                Self::SecondPlane(SecondPlane::new(degree, chart)?.ok_or_else(foreign)?)
            }
        })
    }

    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Zernike { zernike, cosine } => {
                zernike.len() + cosine.as_ref().map_or(0, |cosine| cosine.columns)
            }
            Self::Hemispherical(harmonics) => harmonics.len(),
            Self::Even { even, .. } => even.len(),
            Self::Splines(splines) => splines.len(),
            Self::Spherical { all, .. } => all.len(),
            Self::SecondPlane(plane) => plane.len(),
        }
    }

    /// The functions of the place in the second plane.
    pub(crate) fn second_plane(&self) -> Option<&SecondPlane> {
        match self {
            Self::SecondPlane(plane) => Some(plane),
            _ => None,
        }
    }

    /// Room that an evaluation needs beside its values.
    pub(crate) fn room(&self) -> Vec<f64> {
        match self {
            Self::Zernike { cosine: Some(cosine), .. } => vec![0.0; cosine.zernike.len()],
            Self::Even { all, .. } => vec![0.0; all.len()],
            _ => Vec::new(),
        }
    }

    /// The functions that are zero but for a patch each, if they are.
    pub(crate) fn local(&self) -> Option<&PolarSplines> {
        match self {
            Self::Splines(splines) => Some(splines),
            _ => None,
        }
    }

    /// All values in a direction.
    pub(crate) fn evaluate(&self, d: DVec3, room: &mut [f64], out: &mut [f64]) {
        match self {
            Self::Zernike { zernike, cosine } => {
                zernike.evaluate_direction(d, &mut out[..zernike.len()]);
                if let Some(cosine) = cosine {
                    cosine.evaluate(d, room, &mut out[zernike.len()..]);
                }
            }
            Self::Hemispherical(harmonics) => harmonics.evaluate(d, out),
            Self::Even { all, even } => {
                all.evaluate(d, room);
                out.iter_mut().zip(even).for_each(|(out, k)| *out = room[*k]);
            }
            Self::Splines(splines) => splines.evaluate_direction(d, out),
            Self::Spherical { all, .. } => all.evaluate(d, out),
            // From the middle of the first plane, for want of a place.
            Self::SecondPlane(plane) => plane.evaluate((0.0, 0.0), d, &mut plane.lines(), out),
        }
    }

    /// ∫ cos θ dω of every function over the cone; of those over the whole sphere ∫ dω. Functions
    /// of the second plane have none.
    pub(crate) fn integrals_within(
        &self,
        theta_max_rad: f64,
        out: &mut [f64],
    ) -> Result<(), DomainError> {
        match self {
            Self::Zernike { zernike, cosine: None } => zernike.integrals_within(theta_max_rad, out),
            Self::Zernike { zernike, cosine: Some(_) } => {
                self.integrate_rounds(theta_max_rad, out);
                // In closed form where there is one.
                zernike.integrals_within(theta_max_rad, &mut out[..zernike.len()])
            }
            Self::Hemispherical(_) | Self::Even { .. } | Self::Spherical { .. } => {
                self.integrate_rounds(theta_max_rad, out);
                Ok(())
            }
            Self::SecondPlane(_) => {
                out.fill(0.0);
                Ok(())
            }
            Self::Splines(splines) => splines.integrals_within(theta_max_rad, out),
        }
    }

    /// The same for polynomials in cos θ of those functions that don't go round with φ, exact to
    /// rounding; the others have none.
    fn integrate_rounds(&self, theta_max_rad: f64, out: &mut [f64]) {
        out.fill(0.0);
        let is_whole = matches!(self, Self::Spherical { is_whole: true, .. });
        let low = libm::cos(theta_max_rad).max(if is_whole { -1.0 } else { 0.0 });
        let (middle, half) = (f64::midpoint(low, 1.0), (1.0 - low) / 2.0);
        let (mut values, mut room) = (vec![0.0; self.len()], self.room());
        for (node, weight) in gauss_legendre(self.trigonometric_degree() / 2 + 2) {
            let cos = middle + half * node;
            let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
            self.evaluate(DVec3::new(sin, 0.0, cos), &mut room, &mut values);
            let projected = if is_whole { 1.0 } else { cos };
            for (k, (out, value)) in out.iter_mut().zip(&values).enumerate() {
                if self.order(k) == 0 {
                    *out += TAU * weight * half * projected * value;
                }
            }
        }
    }

    /// Degree and order of a function of a global kind.
    fn degree_and_order(&self, k: usize) -> (usize, i64) {
        let signed = |value: usize| i64::try_from(value).unwrap_or(i64::MAX);
        match self {
            Self::Zernike { zernike, .. } if k < zernike.len() => ansi_order(k),
            Self::Zernike { zernike, .. } => (2 * (k - zernike.len()) + 1, 0),
            Self::Hemispherical(_) | Self::Spherical { .. } => {
                let l = k.isqrt();
                (l, signed(k) - signed(l * (l + 1)))
            }
            Self::SecondPlane(plane) => (plane.degree_of(k), 0),
            Self::Even { even, .. } => {
                let l = even[k].isqrt();
                (l, signed(even[k]) - signed(l * (l + 1)))
            }
            Self::Splines(_) => (0, 0),
        }
    }

    /// How often a function goes round with φ; negative of sines.
    pub(crate) fn order(&self, k: usize) -> i64 {
        self.degree_and_order(k).1
    }

    /// The degree of a function, for penalties: how often it may bend. 0 of splines, whose
    /// penalties look at their derivatives.
    pub(crate) fn degree(&self, k: usize) -> usize {
        self.degree_and_order(k).0
    }

    /// The largest degree among the functions as trigonometric polynomials of θ.
    fn trigonometric_degree(&self) -> usize {
        match self {
            Self::Zernike { zernike, cosine } => {
                zernike.degree().max(cosine.as_ref().map_or(0, |c| 2 * c.columns))
            }
            Self::Hemispherical(harmonics) => 2 * harmonics.len().isqrt(),
            Self::Even { all, .. } | Self::Spherical { all, .. } => all.degree(),
            Self::Splines(splines) => splines.fineness(),
            Self::SecondPlane(plane) => plane.degree(),
        }
    }

    /// The degree along any great circle of every field that is no larger below the horizon than
    /// above it, or that the whole sphere has; `None` where that is not so, and a bound can't rest on it.
    pub(crate) fn mirrored_degree(&self) -> Option<usize> {
        match self {
            Self::Zernike { zernike, cosine: None } => Some(zernike.degree()),
            Self::Even { all, .. } | Self::Spherical { all, is_whole: true } => Some(all.degree()),
            _ => None,
        }
    }

    /// Polar angles and how many azimuths at each tell splines' functions apart, twice; `None` of
    /// functions that are as fine everywhere.
    pub(crate) fn rings(&self) -> Option<Vec<(f64, usize)>> {
        match self {
            Self::Splines(splines) => Some(splines.rings()),
            _ => None,
        }
    }

    /// How fine a grid has to be that no lobe slips through: as for polynomials of this degree.
    pub(crate) fn fineness(&self) -> usize {
        match self {
            Self::Zernike { .. }
            | Self::Even { .. }
            | Self::Splines(_)
            | Self::Spherical { .. }
            | Self::SecondPlane(_) => self.trigonometric_degree(),
            Self::Hemispherical(harmonics) => harmonics.len().isqrt() - 1,
        }
    }

    /// Distinct azimuth lines, and distinct θ without and with the pole, that the functions need at
    /// least; `None` of splines, for which counts tell little.
    pub(crate) fn needs(&self) -> Option<Needs> {
        match self {
            Self::Zernike { zernike, cosine } => {
                let (degree, more) =
                    (zernike.degree(), cosine.as_ref().map_or(0, |cosine| cosine.columns));
                Some(Needs {
                    degree,
                    theta: degree / 2 + 1 + more,
                    theta_with_pole: degree.div_ceil(2) + 1 + more,
                })
            }
            Self::Even { all, .. } => {
                let degree = all.degree();
                let theta_with_pole = degree.div_ceil(2) + 1;
                Some(Needs { degree, theta: degree / 2 + 1, theta_with_pole })
            }
            Self::Hemispherical(harmonics) => {
                let degree = harmonics.len().isqrt() - 1;
                Some(Needs { degree, theta: degree + 1, theta_with_pole: degree + 1 })
            }
            Self::Spherical { all, .. } => {
                let degree = all.degree();
                Some(Needs { degree, theta: degree + 1, theta_with_pole: degree + 1 })
            }
            Self::Splines(_) | Self::SecondPlane(_) => None,
        }
    }

    /// What the coefficients are when the field is 1 everywhere.
    pub(crate) fn unity(&self, out: &mut [f64]) {
        out.fill(0.0);
        match self {
            Self::Zernike { .. } => out[0] = PI.sqrt(),
            Self::Hemispherical(_) => out[0] = TAU.sqrt(),
            Self::Even { .. } | Self::Spherical { .. } => out[0] = (2.0 * TAU).sqrt(),
            Self::SecondPlane(_) => out[0] = 1.0,
            Self::Splines(splines) => splines.unity(out),
        }
    }

    /// The largest value of a function over the hemisphere, or a little more.
    pub(crate) fn largest(&self, k: usize) -> f64 {
        let (degree, order) = self.degree_and_order(k);
        let degree = degree as f64;
        match self {
            Self::Zernike { zernike, .. } if k < zernike.len() => {
                let both_signs = if order == 0 { 1.0 } else { 2.0 };
                (both_signs * (degree + 1.0) / PI).sqrt()
            }
            // cos θ Z(n,0): the polynomial's own largest value.
            Self::Zernike { .. } => (degree / PI).sqrt(),
            // By the addition theorem all of a degree have squares that sum to (2l+1)/4π.
            Self::Hemispherical(_) => ((2.0 * degree + 1.0) / TAU).sqrt(),
            Self::Even { .. } | Self::Spherical { .. } => {
                ((2.0 * degree + 1.0) / (2.0 * TAU)).sqrt()
            }
            Self::SecondPlane(plane) => plane.largest(k),
            Self::Splines(_) => 1.0,
        }
    }

    /// `Z(n,m)`, `cos Z(n,0)`, `H(l,m)`, `Y(l,m)`, `P1(s)`, or where a spline is centred.
    pub(crate) fn name(&self, k: usize) -> String {
        let (n, m) = self.degree_and_order(k);
        match self {
            Self::Zernike { zernike, .. } if k < zernike.len() => format!("Z({n},{m})"),
            Self::Zernike { .. } => format!("cos Z({},0)", n - 1),
            Self::Hemispherical(_) => format!("H({n},{m})"),
            Self::Even { .. } | Self::Spherical { .. } => format!("Y({n},{m})"),
            Self::SecondPlane(plane) => plane.name(k),
            Self::Splines(splines) => splines.name(k),
        }
    }
}

/// What counts of distinct coordinates have to be.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Needs {
    /// One azimuth line more than this.
    pub(crate) degree: usize,
    pub(crate) theta: usize,
    pub(crate) theta_with_pole: usize,
}

impl Cosine {
    fn new(columns: usize) -> Self {
        Self { zernike: Zernike::new(2 * (columns - 1)), columns }
    }

    fn evaluate(&self, d: DVec3, room: &mut [f64], out: &mut [f64]) {
        self.zernike.evaluate_direction(d, room);
        for (k, out) in out.iter_mut().enumerate() {
            // (n, m) = (2k, 0) stands in the middle of its row.
            *out = d.z.max(0.0) * room[2 * k * (k + 1)];
        }
    }
}
