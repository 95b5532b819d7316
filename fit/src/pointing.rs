//! How well the direction of a peak is known, to first order: the top of a parabola whose slope
//! there isn't quite zero. It does not know where the peak is, nor a field's other tops: where two are
//! about as high, which of them is higher is not in it ([`crate::trials`] tells).

use crate::{Chart, Fit, Functional, Peak, Ray};
use glam::{DMat2, DVec2, DVec3};
use radiometry::direction::{angles, unit};
use std::f64::consts::FRAC_PI_2;

/// Standard uncertainties of a peak's direction, radians of arc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pointing {
    /// Along θ.
    pub u_theta_rad: f64,
    /// Across it: along φ, times sin θ.
    pub u_across_rad: f64,
}

impl Fit {
    /// The u of the direction of [`peak`](Self::peak), at the peak's place, by all components: with the field's
    /// slope g and curvature H along two arcs through the peak, H⁻¹ cov(g) H⁻¹. `None` where that says
    /// nothing: of a peak at the end of the region's cone, of one so flat that it may lie anywhere
    /// within a feature of the basis, and between two planes.
    ///
    /// ```
    /// use fit::{BasisSpec, Noise, Ray, Region, Sample};
    ///
    /// // L = 100 (1 - 4 α²) about a direction 30° off the normal, α the sine of the angle from it.
    /// let axis = radiometry::direction::unit(0.5236, 0.0);
    /// let field = |d: glam::DVec3| 100.0 * (1.0 - 4.0 * d.cross(axis).length_squared());
    /// let noise = Noise::Fixed { variance: 0.01 };
    /// let sample = |i: u32| {
    ///     let (theta_rad, phi_rad) = (f64::from(i % 8) * 0.18, f64::from(i / 8) * 0.5236);
    ///     let ray = Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad };
    ///     Sample { ray, value: field(radiometry::direction::unit(theta_rad, phi_rad)), noise }
    /// };
    /// let samples: Vec<Sample> = (0..96).map(sample).collect();
    /// let region = Region::surface((-0.01, 0.01), (-0.01, 0.01), 1.3);
    /// let fit = fit::fit(&samples, &region, BasisSpec { angular: fit::Angular::Hemispherical { degree: 4 },
    ///     position: fit::Position::Legendre { degree: 0 } }, &[])?;
    /// let peak = fit.peak();
    /// let pointing = fit.pointing(&peak).ok_or("no top")?;
    /// // The slope is known to about 0.1 a radian, the curvature is 800: a tenth of a milliradian.
    /// assert!(pointing.u_theta_rad > 2e-5 && pointing.u_theta_rad < 1e-3, "{pointing:?}");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn pointing(&self, peak: &Peak) -> Option<Pointing> {
        if matches!(self.region().chart, Chart::TwoPlane { .. }) {
            return None;
        }
        let feature_rad = 1.0 / (self.functions().directions().fineness() + 1) as f64;
        let arcs = Arcs::through(&peak.ray, STEP * feature_rad);
        let curvature = arcs.curvature(|ray| self.value(ray));
        let [along, across] = arcs.slopes(self);
        let slope = DVec2::new(self.of_value(&along), self.of_value(&across));
        let is_top = curvature.determinant() > 0.0 && curvature.x_axis.x < 0.0;
        let back = is_top.then(|| curvature.inverse()).filter(DMat2::is_finite)?;
        // A top has no slope; what was found at the end of the cone is no top.
        if (back * slope).length() > OFF * feature_rad {
            return None;
        }
        let variance = |functional: &Functional| self.of(functional).u.powi(2);
        let (a, b) = (variance(&along), variance(&across));
        let both = 0.5 * (variance(&along.clone().plus(1.0, &across)) - a - b);
        let scatter = DMat2::from_cols(DVec2::new(a, both), DVec2::new(both, b));
        let moved = back * scatter * back.transpose();
        let u = |variance: f64| variance.max(0.0).sqrt();
        let (u_theta_rad, u_across_rad) = (u(moved.x_axis.x), u(moved.y_axis.y));
        let is_known = libm::hypot(u_theta_rad, u_across_rad) < FLAT * feature_rad;
        is_known.then_some(Pointing { u_theta_rad, u_across_rad })
    }
}

/// Rays about one, along two great circles that cross there.
struct Arcs {
    ray: Ray,
    step_rad: f64,
}

impl Arcs {
    fn through(ray: &Ray, step_rad: f64) -> Self {
        Self { ray: *ray, step_rad }
    }

    /// So many steps along θ, and across.
    fn at(&self, (along, across): (f64, f64)) -> Ray {
        let Ray { theta_rad, phi_rad, .. } = self.ray;
        let (axis, theta) = (unit(theta_rad, phi_rad), unit(theta_rad + FRAC_PI_2, phi_rad));
        let side: DVec3 = axis.cross(theta);
        let (sin, cos) = libm::sincos(self.step_rad * libm::hypot(along, across));
        let off = (along * theta + across * side).normalize_or_zero();
        let (theta_rad, phi_rad) = angles(cos * axis + sin * off);
        Ray { theta_rad, phi_rad, ..self.ray }
    }

    /// The slopes along θ and across, a radian, as functionals: of values a step to both sides.
    fn slopes(&self, fit: &Fit) -> [Functional; 2] {
        let weight = 0.5 / self.step_rad;
        [(1.0, 0.0), (0.0, 1.0)].map(|(along, across)| {
            let (ahead, behind) = (self.at((along, across)), self.at((-along, -across)));
            fit.weighted_rays([(ahead, weight), (behind, -weight)])
        })
    }

    /// Second derivatives, a radian squared.
    fn curvature(&self, value: impl Fn(&Ray) -> f64) -> DMat2 {
        let at = |along: f64, across: f64| value(&self.at((along, across)));
        let top = at(0.0, 0.0);
        let square = self.step_rad * self.step_rad;
        let along = (at(1.0, 0.0) + at(-1.0, 0.0) - 2.0 * top) / square;
        let across = (at(0.0, 1.0) + at(0.0, -1.0) - 2.0 * top) / square;
        let mixed = at(1.0, 1.0) + at(-1.0, -1.0) - at(1.0, -1.0) - at(-1.0, 1.0);
        let mixed = 0.25 * mixed / square;
        DMat2::from_cols(DVec2::new(along, mixed), DVec2::new(mixed, across))
    }
}

/// Of a radian over the basis's fineness: the step of differences, which err by about its square.
const STEP: f64 = 0.1;
/// The same: what a top may lie off the peak that was found.
const OFF: f64 = 0.02;
/// The same: from here on a peak is flat.
const FLAT: f64 = 0.5;
