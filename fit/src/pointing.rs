//! How well the direction of a top is known, to first order by Newton's step: δ = -H⁻¹ δ∇f, of
//! a radiance's or an intensity's. It does not know where the top is, nor a field's other tops: where two
//! are about as high, which of them is higher is not in it ([`crate::trials`] tells).

use crate::{Chart, Fit, Functional, Peak, Ray};
use glam::DVec3;
use radiometry::direction::{angles, unit};
use std::f64::consts::FRAC_PI_2;

/// Standard uncertainties of a top's direction, radians of arc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pointing {
    /// Along growing θ.
    pub u_theta_rad: f64,
    /// Across it: along φ, times sin θ.
    pub u_across_rad: f64,
}

impl Fit {
    /// The u of the direction of [`peak`](Self::peak), at the peak's place, by all components. What is
    /// finer than all functions, and that more is missed towards some directions
    /// ([`Uneven`](crate::Uneven)), is not in it. `None` where that says nothing: of a peak at the end of
    /// the region's cone, of one so flat that it may lie anywhere within a feature of the basis, and
    /// between two planes.
    ///
    /// ```
    /// use fit::{BasisSpec, Noise, Ray, Region, Sample};
    ///
    /// // A parabola on the disk of sin θ, its top 30° off the normal: along θ it curves by -400 cos²θ.
    /// let ray = |theta_rad: f64, phi_rad: f64| Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad };
    /// let noise = Noise::Fixed { variance: 0.01 };
    /// let sample = |i: u32| {
    ///     let (theta_rad, phi_rad) = (f64::from(i % 8) * 0.18, f64::from(i / 8) * 0.5236);
    ///     let (sin, (across, along)) = (theta_rad.sin(), phi_rad.sin_cos());
    ///     let value = 100.0 - 200.0 * ((sin * along - 0.5).powi(2) + (sin * across).powi(2));
    ///     Sample { ray: ray(theta_rad, phi_rad), value, noise }
    /// };
    /// let samples: Vec<Sample> = (0..96).map(sample).collect();
    /// let region = Region::surface((-0.01, 0.01), (-0.01, 0.01), 1.3);
    /// let fit = fit::fit(&samples, &region, BasisSpec::zernike(2, 0), &[])?;
    /// let peak = fit.peak();
    /// let known = fit.pointing(&peak).ok_or("no top")?;
    /// let (top, h) = (peak.ray.theta_rad, 1e-3);
    /// let slope =
    ///     fit.weighted_rays([(ray(top + h, 0.0), 0.5 / h), (ray(top - h, 0.0), -0.5 / h)]);
    /// assert!((known.u_theta_rad / (fit.of(&slope).u / 300.0) - 1.0).abs() < 1e-3);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn pointing(&self, peak: &Peak) -> Option<Pointing> {
        if matches!(self.region().chart, Chart::TwoPlane { .. }) {
            return None;
        }
        let along = |towards: DVec3| {
            let (theta_rad, phi_rad) = angles(towards);
            let ray = Ray { theta_rad, phi_rad, ..peak.ray };
            Ok::<_, std::convert::Infallible>(self.weighted_rays([(ray, 1.0)]))
        };
        let top = unit(peak.ray.theta_rad, peak.ray.phi_rad);
        self.pointing_of(top, along).unwrap_or_else(|never| match never {})
    }

    /// The same of the top of anything that is a functional in each direction.
    pub(crate) fn pointing_of<E>(
        &self,
        top: DVec3,
        towards: impl Fn(DVec3) -> Result<Functional, E>,
    ) -> Result<Option<Pointing>, E> {
        let (along, across) = tangents(top);
        let h = STENCIL_RAD;
        let at = |a: f64, b: f64| towards((top + a * along + b * across).normalize());
        let (up, down, left, right) = (at(h, 0.0)?, at(-h, 0.0)?, at(0.0, -h)?, at(0.0, h)?);
        let value = |functional: &Functional| self.of_value(functional);
        let here = value(&at(0.0, 0.0)?);
        let haa = (value(&up) - 2.0 * here + value(&down)) / (h * h);
        let hbb = (value(&right) - 2.0 * here + value(&left)) / (h * h);
        let (pp, pm, mp, mm) = (at(h, h)?, at(h, -h)?, at(-h, h)?, at(-h, -h)?);
        let hab = (value(&pp) - value(&pm) - value(&mp) + value(&mm)) / (4.0 * h * h);
        let determinant = haa * hbb - hab * hab;
        if !(haa < 0.0 && determinant > RIDGE * haa * hbb) {
            return Ok(None);
        }
        let (da, db) =
            (up.plus(-1.0, &down).times(0.5 / h), right.plus(-1.0, &left).times(0.5 / h));
        let along = da.clone().times(-hbb / determinant).plus(hab / determinant, &db);
        let across = da.times(hab / determinant).plus(-haa / determinant, &db);
        // Where the slope isn't zero, as at the end of a cone, there is no top; a flat one lies anywhere.
        let feature_rad = 1.0 / (self.functions().directions().fineness() + 1) as f64;
        let off = libm::hypot(value(&along), value(&across));
        let [u_theta_rad, u_across_rad] = [along, across].map(|step| self.of(&step).u);
        let is_known =
            off < OFF * feature_rad && libm::hypot(u_theta_rad, u_across_rad) < FLAT * feature_rad;
        Ok(is_known.then_some(Pointing { u_theta_rad, u_across_rad }))
    }
}

/// Unit vectors along growing θ and φ; at the pole along x and y.
pub(crate) fn tangents(place: DVec3) -> (DVec3, DVec3) {
    let (theta_rad, phi_rad) = angles(place);
    let along = unit(theta_rad + FRAC_PI_2, phi_rad);
    (along, place.cross(along))
}

/// The step of differences.
pub(crate) const STENCIL_RAD: f64 = 1e-3;
/// Of the product of the curvatures: a ridge that is flatter has no top in the other direction.
const RIDGE: f64 = 1e-6;
/// Of a radian over the basis's fineness: what a top may lie off the one that was found.
const OFF: f64 = 0.02;
/// The same: a top that is known worse is flat.
const FLAT: f64 = 0.5;
