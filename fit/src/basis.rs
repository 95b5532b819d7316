//! The functions that a fit is made of: Zernike polynomials on the Nusselt disk (r = sin θ) times
//! products of Legendre polynomials in the position over the region, of limited total degree.
//!
//! Function k = q · angular + j is the j-th Zernike polynomial times the q-th position term. The
//! positions' terms other than the first have mean zero over the region, and the Zernike
//! polynomials other than the first have no exitance: that is why derived quantities are short sums.

use crate::{FitError, Ray, Region};
use glam::DVec3;
use radiometry::DomainError;
use radiometry::basis::zernike::ansi_order;
use radiometry::basis::{Legendre, Zernike};
use std::f64::consts::PI;

/// Which basis: how fine in direction and in position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BasisSpec {
    /// Degree n of the Zernike polynomials: (n + 1)(n + 2)/2 of them.
    pub angular_degree: usize,
    /// Total degree d of the polynomials in x and y: (d + 1)(d + 2)/2 of them.
    pub position_degree: usize,
}

impl BasisSpec {
    /// Number of coefficients, if a dense fit may hold them.
    pub(crate) fn checked_len(&self) -> Result<usize, FitError> {
        let coefficients = self.len();
        if coefficients <= COEFFICIENTS_MAX {
            Ok(coefficients)
        } else {
            Err(FitError::TooLarge { coefficients, coefficients_max: COEFFICIENTS_MAX })
        }
    }

    /// Number of coefficients.
    pub fn len(&self) -> usize {
        triangular(self.angular_degree).saturating_mul(triangular(self.position_degree))
    }

    /// Never: the constant is always there.
    pub fn is_empty(&self) -> bool {
        false
    }
}

/// The functions of a spec over a region, ready to be evaluated.
#[derive(Debug, Clone)]
pub(crate) struct Basis {
    zernike: Zernike,
    legendre: Legendre,
    /// Degrees in x and y of the position terms, by total degree.
    terms: Vec<(usize, usize)>,
    region: Region,
    spec: BasisSpec,
}

/// Scratch of one evaluation.
#[derive(Debug)]
pub(crate) struct Scratch {
    direction: Vec<f64>,
    x: Vec<f64>,
    y: Vec<f64>,
    position: Vec<f64>,
}

impl Scratch {
    /// The position terms evaluated last.
    pub(crate) fn position(&self) -> &[f64] {
        &self.position
    }
}

impl Basis {
    pub(crate) fn new(spec: BasisSpec, region: Region) -> Self {
        let degree = spec.position_degree;
        let terms = (0..=degree).flat_map(|total| (0..=total).map(move |y| (total - y, y)));
        Self {
            zernike: Zernike::new(spec.angular_degree),
            legendre: Legendre::new(degree),
            terms: terms.collect(),
            region,
            spec,
        }
    }

    pub(crate) fn spec(&self) -> BasisSpec {
        self.spec
    }

    pub(crate) fn region(&self) -> &Region {
        &self.region
    }

    pub(crate) fn len(&self) -> usize {
        self.angular_len() * self.terms.len()
    }

    pub(crate) fn angular_len(&self) -> usize {
        self.zernike.len()
    }

    pub(crate) fn position_len(&self) -> usize {
        self.terms.len()
    }

    pub(crate) fn scratch(&self) -> Scratch {
        Scratch {
            direction: vec![0.0; self.angular_len()],
            x: vec![0.0; self.spec.position_degree + 1],
            y: vec![0.0; self.spec.position_degree + 1],
            position: vec![0.0; self.terms.len()],
        }
    }

    /// The Zernike polynomials in a direction.
    pub(crate) fn direction(&self, theta_rad: f64, phi_rad: f64, out: &mut [f64]) {
        self.zernike.evaluate(theta_rad, phi_rad, out);
    }

    /// The position terms at the ray's foot.
    pub(crate) fn position(&self, ray: &Ray, scratch: &mut Scratch) {
        self.position_at(self.region.scaled(ray), scratch);
    }

    fn position_at(&self, (x, y): (f64, f64), scratch: &mut Scratch) {
        self.legendre.evaluate(x, &mut scratch.x);
        self.legendre.evaluate(y, &mut scratch.y);
        for (out, &(a, b)) in scratch.position.iter_mut().zip(&self.terms) {
            *out = scratch.x[a] * scratch.y[b];
        }
    }

    /// As [`direction`](Self::direction), at a unit vector.
    pub(crate) fn direction_along(&self, direction: DVec3, out: &mut [f64]) {
        self.zernike.evaluate_direction(direction, out);
    }

    /// The position terms at a place; beyond `limit` half widths of the region they are constant.
    pub(crate) fn position_continued(&self, x_m: f64, y_m: f64, limit: f64, scratch: &mut Scratch) {
        if self.terms.len() == 1 {
            scratch.position[0] = 1.0;
            return;
        }
        let (x, y) = self.region.scaled(&Ray { x_m, y_m, theta_rad: 0.0, phi_rad: 0.0 });
        self.position_at((x.clamp(-limit, limit), y.clamp(-limit, limit)), scratch);
    }

    /// The largest value of a function within region and hemisphere.
    pub(crate) fn largest(&self, k: usize) -> f64 {
        let (n, m) = ansi_order(k % self.angular_len());
        let both_signs = if m == 0 { 1.0 } else { 2.0 };
        (both_signs * (n as f64 + 1.0) / PI).sqrt()
    }

    /// All functions along a ray.
    pub(crate) fn row(&self, ray: &Ray, scratch: &mut Scratch, out: &mut [f64]) {
        self.zernike.evaluate(ray.theta_rad, ray.phi_rad, &mut scratch.direction);
        self.position(ray, scratch);
        for (q, p) in scratch.position.iter().enumerate() {
            let block = &mut out[q * scratch.direction.len()..][..scratch.direction.len()];
            for (out, z) in block.iter_mut().zip(&scratch.direction) {
                *out = p * z;
            }
        }
    }

    /// The value of the field with these coefficients along a ray.
    pub(crate) fn value(&self, coefficients: &[f64], ray: &Ray, scratch: &mut Scratch) -> f64 {
        self.zernike.evaluate(ray.theta_rad, ray.phi_rad, &mut scratch.direction);
        self.position(ray, scratch);
        let blocks = coefficients.chunks_exact(scratch.direction.len());
        scratch.position.iter().zip(blocks).map(|(p, c)| p * dot(c, &scratch.direction)).sum()
    }

    /// The exitance within a cone about the normal, mean over the region, as a linear functional:
    /// the sum of its elements times the coefficients. Only the first position term has a mean.
    pub(crate) fn exitance_within(&self, theta_max_rad: f64) -> Result<Vec<f64>, DomainError> {
        let mut functional = vec![0.0; self.len()];
        let over_region = &mut functional[..self.angular_len()];
        self.zernike.integrals_within(theta_max_rad, over_region)?;
        Ok(functional)
    }

    /// The exitance of the whole hemisphere, mean over the region: c₀ √π.
    pub(crate) fn exitance(&self) -> Vec<f64> {
        let mut functional = vec![0.0; self.len()];
        functional[0] = PI.sqrt();
        functional
    }

    /// What the coefficients are when the field is 1 everywhere.
    pub(crate) fn unity(&self) -> Vec<f64> {
        let mut coefficients = vec![0.0; self.len()];
        coefficients[0] = PI.sqrt();
        coefficients
    }

    /// The mean over the region of the value in a direction, as a linear functional.
    pub(crate) fn mean_over_region(&self, theta_rad: f64, phi_rad: f64) -> Vec<f64> {
        let mut functional = vec![0.0; self.len()];
        self.direction(theta_rad, phi_rad, &mut functional[..self.angular_len()]);
        functional
    }

    /// The function's name: `Z(n,m)`, and degrees in x and y where it varies with them.
    pub(crate) fn name(&self, k: usize) -> String {
        let (n, m) = ansi_order(k % self.angular_len());
        let factor = |axis: &str, degree: usize| match degree {
            0 => String::new(),
            degree => format!(" P{degree}({axis})"),
        };
        let (a, b) = self.terms[k / self.angular_len()];
        format!("Z({n},{m}){}{}", factor("x", a), factor("y", b))
    }
}

/// 1 + 2 + .. + (degree + 1).
fn triangular(degree: usize) -> usize {
    degree.saturating_add(1).saturating_mul(degree.saturating_add(2)) / 2
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Beyond it the triangle alone takes 134 MB, and the factorisation minutes.
const COEFFICIENTS_MAX: usize = 4096;
