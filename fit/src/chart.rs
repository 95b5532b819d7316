//! Which four numbers name a ray, and what its throughput is in them. Knows no samples and no basis.
//!
//! | chart | a [`Ray`](crate::Ray)'s place (x, y) | its direction (θ, φ) | throughput |
//! |---|---|---|---|
//! | surface | where it leaves the plane z = 0 | from the normal +z, θ to 90° | cos θ dx dy dω |
//! | perpendicular | where it pierces the plane through the origin across it, along growing θ and φ | from +z, θ to 180° | dx dy dω |
//! | environment | none: the point is one | from the point towards where the light comes from, θ to 180° | dω |
//! | two-plane | as surface: (u, v) | as surface: it goes through (s, t) at the distance d | d²/r⁴ du dv ds dt |
//!
//! The maps to lines and back are `radiometry::chart`'s.

use crate::sample::HORIZON_RAD;
use std::f64::consts::PI;

/// In which coordinates a field is fitted, and what of them is no [`Region`](crate::Region)'s.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Chart {
    /// M² × S²: light that leaves a flat sample.
    #[default]
    Surface,
    /// S² × R²: all light that leaves an object, in all directions.
    Perpendicular {
        /// What of the region's rectangle the object fills.
        face: Face,
    },
    /// S² at one point: the light that arrives there.
    Environment,
    /// R² × R²: light from one rectangle to another one, parallel to it.
    TwoPlane {
        /// From the plane z = 0 to the second one, metres, above 0.
        distance_m: f64,
        /// From and to in the second plane, metres.
        s_m: (f64, f64),
        /// From and to in the second plane, metres.
        t_m: (f64, f64),
    },
}

/// What an object fills of the plane across a direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Face {
    /// The region's rectangle.
    Rectangle,
    /// The disk within the region's square: the shadow of a sphere around the object, the same in
    /// all directions.
    Disk,
}

impl Chart {
    /// As files and arguments write it.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Surface => "surface",
            Self::Perpendicular { .. } => "perpendicular",
            Self::Environment => "environment",
            Self::TwoPlane { .. } => "two-plane",
        }
    }

    /// Whether directions go all round, not over a hemisphere alone.
    pub const fn is_whole_sphere(&self) -> bool {
        matches!(self, Self::Perpendicular { .. } | Self::Environment)
    }

    /// The largest θ of a ray, radians, with room for a conversion's rounding.
    pub(crate) const fn theta_end_rad(&self) -> f64 {
        if self.is_whole_sphere() { PI + ROUNDING_RAD } else { HORIZON_RAD }
    }

    /// Whether its numbers are finite and in order.
    pub(crate) fn is_sound(&self) -> bool {
        let in_order = |(from, to): (f64, f64)| from.is_finite() && to.is_finite() && from < to;
        match *self {
            Self::TwoPlane { distance_m, s_m, t_m } => {
                distance_m.is_finite() && distance_m > 0.0 && in_order(s_m) && in_order(t_m)
            }
            Self::Surface | Self::Perpendicular { .. } | Self::Environment => true,
        }
    }
}

/// An angle's rounding.
const ROUNDING_RAD: f64 = 1e-9;
