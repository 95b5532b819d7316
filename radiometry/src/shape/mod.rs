//! The shapes that light comes from and that stand in its way, in metres, checked when they are
//! made. They know no light and no receiver.

mod polygon;

use glam::DVec3;

use crate::domain::{DomainError, direction, finite, finite_vector, not_negative};

pub use polygon::Polygon;

/// A flat circular disk; both faces are alike.
/// Who needs it: sources and occluders here; the simulator's scenes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disk {
    center_m: DVec3,
    axis: DVec3,
    radius_m: f64,
}

impl Disk {
    /// The axis may have any length and either sign; the radius is not negative.
    pub fn new(center_m: DVec3, axis: DVec3, radius_m: f64) -> Result<Self, DomainError> {
        Ok(Self {
            center_m: finite_vector("center", center_m)?,
            axis: direction("axis", axis)?,
            radius_m: not_negative("radius", radius_m)?,
        })
    }

    /// Its centre.
    pub fn center_m(&self) -> DVec3 {
        self.center_m
    }

    /// Along the normal to its plane; the length means nothing.
    pub fn axis(&self) -> DVec3 {
        self.axis
    }

    /// Its radius.
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }
}

/// A ball with its surface.
/// Who needs it: sources and occluders here; the simulator's scenes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    center_m: DVec3,
    radius_m: f64,
}

impl Sphere {
    /// The radius is not negative.
    pub fn new(center_m: DVec3, radius_m: f64) -> Result<Self, DomainError> {
        Ok(Self {
            center_m: finite_vector("center", center_m)?,
            radius_m: not_negative("radius", radius_m)?,
        })
    }

    /// Its centre.
    pub fn center_m(&self) -> DVec3 {
        self.center_m
    }

    /// Its radius.
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }
}

/// A horizontal half-plane: all points at height `z_m` with x <= `x_max_m`. A knife edge.
/// Who needs it: occluders here; the simulator's scenes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfPlane {
    x_max_m: f64,
    z_m: f64,
}

impl HalfPlane {
    /// The edge runs along y.
    pub fn new(x_max_m: f64, z_m: f64) -> Result<Self, DomainError> {
        Ok(Self { x_max_m: finite("x_max", x_max_m)?, z_m: finite("z", z_m)? })
    }

    /// Where it ends.
    pub fn x_max_m(&self) -> f64 {
        self.x_max_m
    }

    /// Its height.
    pub fn z_m(&self) -> f64 {
        self.z_m
    }
}
