//! What arrives at the point of an environment: the irradiance of a face, from both sides of a
//! cylinder and from all sides. Integrals over the sphere of directions by `radiance · weight`.

use super::sum::{Node, Terms};
use super::{DeriveError, Derived, Field};
use crate::Ray;
use glam::DVec3;
use radiometry::direction::{angles, frame, normalised};
use radiometry::quadrature::gauss_legendre;
use std::f64::consts::{PI, TAU};

/// What light arrives at, at the point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PointReceiver {
    /// A face with a normal of any length but 0: ∫ L cos θ dω over the directions before it.
    Face {
        /// Into the half-space that light arrives from.
        normal: DVec3,
    },
    /// The curved surface of a small cylinder: (1/π) ∫ L sin θ dω, θ from its axis (CIE 17-21-040,
    /// cylindrical irradiance).
    Cylinder {
        /// Of any length but 0.
        axis: DVec3,
    },
    /// A small sphere: ∫ L dω over all directions, without a cosine (CIE 17-21-037, spherical
    /// irradiance: four times the mean over the sphere's surface).
    Sphere,
}

impl PointReceiver {
    fn axis(&self) -> Result<DVec3, DeriveError> {
        let axis = match *self {
            Self::Face { normal } => normal,
            Self::Cylinder { axis } => axis,
            Self::Sphere => DVec3::Z,
        };
        normalised(axis).ok_or_else(|| DeriveError::Receiver {
            what: "its normal or axis has no direction; expected three finite numbers, not all 0"
                .to_owned(),
        })
    }

    /// Halves of the sphere, from where to where cos θ goes, that it receives from.
    fn halves(&self) -> &'static [(f64, f64)] {
        match self {
            Self::Face { .. } => &[(0.0, 1.0)],
            Self::Cylinder { .. } | Self::Sphere => &[(-1.0, 0.0), (0.0, 1.0)],
        }
    }

    fn weight(&self, cos: f64) -> f64 {
        match self {
            Self::Face { .. } => cos,
            Self::Cylinder { .. } => ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt() / PI,
            Self::Sphere => 1.0,
        }
    }
}

impl Field<'_> {
    /// The irradiance of a receiver at the point, in the values' unit times sr. Of the environment
    /// chart alone; light from beyond the region's cone is extrapolated, and said so.
    pub fn irradiance_at_point(&self, receiver: &PointReceiver) -> Result<Derived, DeriveError> {
        self.demand_environment("the irradiance at the point")?;
        let axis = receiver.axis()?;
        let (t, b) = frame(axis);
        let lines = self.lines();
        let rule = |level: usize| -> Terms<'_> {
            let spokes = lines + 7 + 4 * level;
            let rings = gauss_legendre(lines / 2 + 4 + 2 * level);
            let halves = receiver.halves().iter();
            let rings = halves.flat_map(move |&(low, high)| {
                // Steps of the angle: the cylinder's sine leaves the axis like a square root.
                let (from, to) = (libm::acos(high), libm::acos(low));
                let ring = move |&(node, weight): &(f64, f64)| {
                    let theta = f64::midpoint(from, to) + 0.5 * node * (to - from);
                    (theta, 0.5 * weight * (to - from))
                };
                rings.iter().map(ring).collect::<Vec<_>>()
            });
            Box::new(rings.flat_map(move |(theta, step)| {
                let (sin, cos) = libm::sincos(theta);
                let weight = step * sin * TAU / spokes as f64 * receiver.weight(cos);
                (0..spokes).map(move |k| {
                    let (s, c) = libm::sincos(TAU * k as f64 / spokes as f64);
                    let towards = cos * axis + sin * (c * t + s * b);
                    let (theta_rad, phi_rad) = angles(towards);
                    let ray = Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad };
                    (Node::Along(ray), weight)
                })
            }))
        };
        self.refined(rule)
    }
}
