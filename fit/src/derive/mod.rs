//! What follows from a fitted field, each with its uncertainty: exitance at a place, intensity, flux
//! into cones, irradiance at a receiver, beam angles, the environment seen from a point, the
//! two-plane light field; and all of these with a window in front of the sample, or the medium
//! that it is immersed in, removed. Knows no file and no unit beside metre and radian.
//!
//! What is linear in the field is a sum of radiances along rays, and goes through
//! [`Fit::weighted_rays`]; its rule is made finer until the quadrature changes the value by a small
//! part of u. What isn't linear (an angle at half the peak) has its u by the law of propagation to
//! first order (JCGM 100, 5.1.2), and says where that is too little.
//!
//! ```
//! use fit::derive::Field;
//! use fit::{BasisSpec, Noise, Ray, Region, Sample};
//! use std::f64::consts::{FRAC_PI_3, PI};
//!
//! // A Lambertian field of 100 W·m⁻²·sr⁻¹.
//! let ray = |i: u32| Ray {
//!     x_m: 0.0,
//!     y_m: 0.0,
//!     theta_rad: f64::from(i % 8) * 0.2,
//!     phi_rad: f64::from(i / 8) * 2.1,
//! };
//! let noise = Noise::Fixed { variance: 0.01 };
//! let samples: Vec<Sample> =
//!     (0..24).map(|i| Sample { ray: ray(i), value: 100.0, noise }).collect();
//! let region = Region::surface((-0.01, 0.01), (-0.01, 0.01), 1.4);
//! let fit = fit::fit(&samples, &region, BasisSpec::zernike(2, 0), &[])?;
//!
//! let field = Field::of(&fit);
//! let exitance = field.exitance_at(0.002, -0.003, fit::derive::HEMISPHERE)?;
//! assert!((exitance.estimate.value / (100.0 * PI) - 1.0).abs() < 1e-9);
//! // Half the peak intensity is at cos θ = 1/2: 120° from side to side.
//! let beam = field.beam_angle(0.0, 0.5, fit::derive::Reference::PlanePeak)?;
//! assert!((beam.estimate.value - 2.0 * FRAC_PI_3).abs() < 1e-6 && beam.estimate.u < 1e-2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::{Chart, Contribution, Estimate, Fit, Functional};
use std::f64::consts::{FRAC_PI_2, PI};

pub use arriving::PointReceiver;
pub use directions::{Cone, Zone};
pub use error::{DeriveError, Remark};
pub use irradiance::Received;
pub use map::{Cells, EnvironmentCell, EnvironmentMap, TwoPlaneGrid, TwoPlaneRay};
pub use medium::{Layer, Medium, Uncertain};
pub use peak_intensity::PeakIntensity;
pub use receiver::Receiver;
pub use width::Reference;

mod arriving;
mod directions;
mod error;
mod exitance;
mod irradiance;
mod map;
mod medium;
mod patch;
mod peak_intensity;
mod receiver;
mod sum;
mod width;

/// All directions above the sample's plane.
pub const HEMISPHERE: Zone = Zone { from_rad: 0.0, to_rad: FRAC_PI_2 };

/// All directions of the chart, whatever they are.
pub const ALL_DIRECTIONS: Zone = Zone { from_rad: 0.0, to_rad: PI };

/// A fitted field as it leaves the sample, what stood in front of it removed.
#[derive(Debug, Clone, Copy)]
pub struct Field<'f> {
    fit: &'f Fit,
    medium: Medium,
}

/// A quantity that follows from the field.
#[derive(Debug, Clone, PartialEq)]
pub struct Derived {
    /// The value and its uncertainty.
    pub estimate: Estimate,
    /// The uncertainty by source, the independent part first. Parts' squares add to u's.
    pub budget: Vec<Contribution>,
    /// How much of the value comes along rays within the region and its cone, that is from where
    /// something was measured; `None` where the value isn't a positive sum over rays.
    pub measured_fraction: Option<f64>,
    /// What it is of the fit's coefficients, where it is linear in them and no layer's number has a
    /// part in its u.
    pub functional: Option<Functional>,
    /// How far the quadrature may be off, by its change at the last refinement; in the value's
    /// unit. Not part of u.
    pub quadrature_bound: f64,
    /// What a reader must know.
    pub remarks: Vec<Remark>,
}

impl<'f> Field<'f> {
    /// The field as it was measured.
    pub fn of(fit: &'f Fit) -> Self {
        Self { fit, medium: Medium::Air }
    }

    /// The field below the layer that stood between it and the air, the layer removed.
    pub fn without(fit: &'f Fit, medium: Medium) -> Result<Self, DeriveError> {
        medium.check()?;
        if medium != Medium::Air && fit.region().chart.is_whole_sphere() {
            return Err(of_chart("window or medium to remove", &fit.region().chart));
        }
        Ok(Self { fit, medium })
    }

    /// What it is the field of.
    pub fn fit(&self) -> &'f Fit {
        self.fit
    }

    /// What is removed.
    pub fn medium(&self) -> &Medium {
        &self.medium
    }

    /// Refuses what only light from a flat sample has.
    fn demand_surface(&self, what: &'static str) -> Result<(), DeriveError> {
        let chart = &self.fit.region().chart;
        if matches!(chart, Chart::Surface) { Ok(()) } else { Err(of_chart(what, chart)) }
    }

    /// Refuses what only light has that leaves something in directions of its own.
    fn demand_leaving(&self, what: &'static str) -> Result<(), DeriveError> {
        let chart = &self.fit.region().chart;
        match chart {
            Chart::Surface | Chart::Perpendicular { .. } => Ok(()),
            Chart::Environment | Chart::TwoPlane { .. } => Err(of_chart(what, chart)),
        }
    }

    fn demand_environment(&self, what: &'static str) -> Result<(), DeriveError> {
        let chart = &self.fit.region().chart;
        if matches!(chart, Chart::Environment) { Ok(()) } else { Err(of_chart(what, chart)) }
    }

    /// By what a part of the plane counts in a direction: dA cos θ on a sample, and all of it
    /// across the direction.
    fn projection(&self, theta_rad: f64) -> f64 {
        if self.fit.region().chart.is_whole_sphere() { 1.0 } else { libm::cos(theta_rad) }
    }

    /// The largest θ of the chart.
    fn theta_end_rad(&self) -> f64 {
        if self.fit.region().chart.is_whole_sphere() { PI } else { FRAC_PI_2 }
    }

    /// The region's area, m²; a region without one has radiance and exitance alone.
    fn area_m2(&self) -> Result<f64, DeriveError> {
        let area_m2 = self.fit.region().area_m2();
        if area_m2 > 0.0 { Ok(area_m2) } else { Err(DeriveError::NoArea) }
    }
}

impl Derived {
    /// An angle's radians as degrees.
    #[must_use]
    pub fn in_degrees(self) -> Self {
        self.times(1f64.to_degrees())
    }

    /// Times a factor, not negative, without uncertainty.
    fn times(mut self, factor: f64) -> Self {
        self.estimate = self.estimate.times(factor);
        self.budget.iter_mut().for_each(|part| part.u *= factor);
        self.quadrature_bound *= factor;
        self
    }
}

fn of_chart(what: &'static str, chart: &Chart) -> DeriveError {
    let instead = match chart {
        Chart::Surface => "radiance, exitance, intensity, flux, irradiance at a receiver",
        Chart::Perpendicular { .. } => "radiance, intensity and flux",
        Chart::Environment => "radiance, an environment map and the irradiance at its point",
        Chart::TwoPlane { .. } => {
            "radiance, the flux through both rectangles and a resampled table"
        }
    };
    DeriveError::OfChart { what, chart: chart.name(), instead }
}
