//! Projected solid angle ∫ cos θ dω of disks, spheres and polygons in any position, as seen by a
//! receiver with a normal: the irradiance per radiance of a uniform source. What lies below the
//! receiver's horizon is cut off. Both faces of a flat source emit.
//!
//! Closed forms where they keep their digits; where they cancel, the same positive integrand by Gauss
//! quadrature. It knows no radiance and no rig. For the pages on projected solid angle, Lambert's
//! formula, umbra and penumbra, and for `irradiance` next door.

mod around;
mod body;
mod disk;
mod hull;
mod limit;
mod occluded;
mod outline;
mod pierced;
mod polygon;
mod scene;
mod seen;
mod shadow;
pub(crate) mod smooth;
mod sphere;
mod view;

use core::f64::consts::PI;

use glam::DVec3;

use crate::domain::{DomainError, direction, finite_vector};
use crate::quantity::ProjectedSolidAngle;

pub use body::{Occluder, Source};
pub use disk::{disk, disk_parallel, disk_tilted};
pub use occluded::{occluded, occluded_by};
pub use polygon::polygon;
pub use shadow::{Region, RegionShadow, Shadow, region_shadow, shadow};
pub use sphere::{sphere, sphere_tilted};

/// A point with the normal of the surface that it belongs to.
/// Who needs it: every kernel here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Receiver {
    point_m: DVec3,
    normal: DVec3,
}

impl Receiver {
    /// The normal may have any length but 0.
    pub fn new(point_m: DVec3, normal: DVec3) -> Result<Self, DomainError> {
        Ok(Self { point_m: finite_vector("point", point_m)?, normal: direction("normal", normal)? })
    }

    /// Where it is.
    pub fn point_m(&self) -> DVec3 {
        self.point_m
    }

    /// Along its normal; the length means nothing.
    pub fn normal(&self) -> DVec3 {
        self.normal
    }
}

/// No more than the hemisphere: the kernels' last rounding may lie beyond it, nothing else. A
/// kernel that lost itself between the extremes of its arguments has no answer.
fn of_hemisphere(sr: f64) -> Result<ProjectedSolidAngle, DomainError> {
    if (-1e-9..PI + 1e-9).contains(&sr) {
        return Ok(ProjectedSolidAngle::from_sr(sr.clamp(0.0, PI)));
    }
    Err(DomainError::Lost { result: "projected solid angle (sr)" })
}
