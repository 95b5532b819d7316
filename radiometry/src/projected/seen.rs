//! Bodies as a receiver sees them: which directions they fill, how far away they are there, and their
//! outline. Positions are relative to the receiver. It does not know who hides whom.

use core::f64::consts::PI;

use glam::DVec3;

use super::Receiver;
use super::outline::{Cone, Curve, Limit};
use crate::direction::normalised;
use crate::domain::DomainError;
use crate::shape::{Disk, HalfPlane, Polygon, Sphere};
use crate::wide::{WideVec, cross, length};

/// A set of directions with its outline.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    fill: Fill,
    pub(super) curves: Vec<Curve>,
    pub(super) limits: Vec<Limit>,
    /// A direction in the midst of it.
    pub(super) middle: DVec3,
}

#[derive(Debug, Clone)]
enum Fill {
    /// All below the horizon of a unit normal.
    Below {
        normal: DVec3,
    },
    Sphere {
        center: DVec3,
        radius: f64,
    },
    /// The axis points away from the receiver, to whose plane it is `distance`.
    Disk {
        center: DVec3,
        axis: DVec3,
        distance: f64,
        radius: f64,
    },
    Polygon {
        corners: Vec<DVec3>,
        normal: DVec3,
    },
    HalfPlane {
        x_max: f64,
        z: f64,
    },
}

impl Seen {
    /// What the horizon hides: like a body that is nearer than any other.
    pub(super) fn below(normal: DVec3) -> Self {
        let curves = vec![Curve::small_circle(-normal, 1.0, 0.0)];
        let limits = vec![Limit::Plane { normal }];
        Self { fill: Fill::Below { normal }, curves, limits, middle: -normal }
    }

    /// None if it has no extent. A receiver inside is refused.
    pub(super) fn sphere(
        receiver: &Receiver,
        sphere: &Sphere,
    ) -> Result<Option<Self>, DomainError> {
        let radius = sphere.radius_m();
        let center = WideVec::difference(sphere.center_m(), receiver.point_m()).to_vec();
        let distance = length(center);
        if distance < radius || distance == 0.0 {
            let (distance_m, radius_m) = (distance, radius);
            return Err(DomainError::Inside { shape: "sphere", distance_m, radius_m });
        }
        if radius == 0.0 {
            return Ok(None);
        }
        let (axis, sin) = (center / distance, radius / distance);
        let cos = ((distance - radius) / distance * (1.0 + sin)).sqrt();
        Ok(Some(Self {
            fill: Fill::Sphere { center, radius },
            curves: vec![Curve::small_circle(axis, sin, cos)],
            limits: vec![Limit::Cone { kind: Cone::Circular { axis, sin } }],
            middle: axis,
        }))
    }

    /// None if it has no extent or is seen edge-on.
    pub(super) fn disk(receiver: &Receiver, disk: &Disk) -> Option<Self> {
        let center = WideVec::difference(disk.center_m(), receiver.point_m());
        let axis_length = length(disk.axis());
        let distance = WideVec::from_vec(disk.axis()).dot(center).to_f64() / axis_length;
        let axis = disk.axis() / axis_length * distance.signum();
        let (center, distance, radius) = (center.to_vec(), distance.abs(), disk.radius_m());
        if radius == 0.0 || distance == 0.0 {
            return None;
        }
        Some(Self {
            fill: Fill::Disk { center, axis, distance, radius },
            curves: vec![Curve::rim(center, axis, radius)],
            limits: vec![Limit::Cone { kind: Cone::Rim { center, axis, distance, radius } }],
            middle: normalised(center)?,
        })
    }

    /// None if it has no extent or is seen edge-on.
    pub(super) fn polygon(receiver: &Receiver, polygon: &Polygon) -> Option<Self> {
        let mut corners: Vec<DVec3> = polygon
            .vertices()
            .iter()
            .map(|vertex| WideVec::difference(*vertex, receiver.point_m()).to_vec())
            .collect();
        corners.dedup();
        let first = *corners.first()?;
        let fan = corners.windows(2).map(|pair| cross(pair[0] - first, pair[1] - first));
        let normal = normalised(fan.sum())?;
        let distance = normal.dot(first);
        if distance == 0.0 {
            return None;
        }
        // Left-hand inside, as seen from without the unit sphere.
        if distance < 0.0 {
            corners.reverse();
        }
        let normal = normal * distance.signum();
        let (mut curves, mut limits) = (Vec::new(), Vec::new());
        let mut middle = DVec3::ZERO;
        for (i, a) in corners.iter().enumerate() {
            let b = corners[(i + 1) % corners.len()];
            middle += normalised(*a)?;
            let (from, across) = (normalised(*a)?, cross(*a, b));
            let Some(across) = normalised(across) else { continue };
            let turn = crate::direction::angle_between(*a, b);
            curves.push(Curve::great_arc(from, across.cross(from).normalize_or_zero(), turn));
            limits.push(Limit::Plane { normal: across });
        }
        let middle = normalised(middle).unwrap_or(normal);
        Some(Self { fill: Fill::Polygon { corners, normal }, curves, limits, middle })
    }

    /// None if it is seen edge-on.
    pub(super) fn half_plane(receiver: &Receiver, half_plane: &HalfPlane) -> Option<Self> {
        let x_max = half_plane.x_max_m() - receiver.point_m().x;
        let z = half_plane.z_m() - receiver.point_m().z;
        let edge = normalised(DVec3::new(x_max, 0.0, z))?;
        if z == 0.0 {
            return None;
        }
        let middle = normalised(edge + DVec3::NEG_X)?;
        // Half great circles between the ends of the y axis: the edge, and infinitely far away.
        let half = |through: DVec3| {
            let from = DVec3::NEG_Y;
            let inside_left = from.cross(through).dot(middle) > 0.0;
            Curve::great_arc(if inside_left { from } else { -from }, through, PI)
        };
        Some(Self {
            fill: Fill::HalfPlane { x_max, z },
            curves: vec![half(edge), half(DVec3::NEG_X)],
            limits: vec![
                Limit::Plane { normal: edge.cross(DVec3::Y) },
                Limit::Plane { normal: DVec3::Z },
            ],
            middle,
        })
    }

    /// How far away the body is in a direction; none if it is not there at all.
    pub(super) fn distance(&self, direction: DVec3) -> Option<f64> {
        match &self.fill {
            Fill::Below { normal } => (normal.dot(direction) < 0.0).then_some(0.0),
            Fill::Sphere { center, radius } => {
                let along = center.dot(direction);
                let miss = center.cross(direction).length();
                let inside = (radius - miss) * (radius + miss);
                (along > 0.0 && inside > 0.0).then(|| along - inside.sqrt())
            }
            Fill::Disk { center, axis, distance, radius } => {
                let along = axis.dot(direction);
                if along <= 0.0 {
                    return None;
                }
                let reach = distance / along;
                ((direction * reach - *center).length() < *radius).then_some(reach)
            }
            Fill::Polygon { corners, normal } => {
                let along = normal.dot(direction);
                if along <= 0.0 {
                    return None;
                }
                let reach = normal.dot(corners[0]) / along;
                surrounds(corners, direction, *normal).then_some(reach)
            }
            Fill::HalfPlane { x_max, z } => {
                let reach = z / direction.z;
                (reach > 0.0 && reach.is_finite() && reach * direction.x < *x_max).then_some(reach)
            }
        }
    }
}

impl Seen {
    /// Where the planes of two flat bodies are equally far away; none if one is not flat. Which of
    /// them is nearer changes there alone.
    pub(super) fn level_with(&self, other: &Self) -> Option<Limit> {
        let ((normal, distance), (other_normal, other_distance)) = (self.plane()?, other.plane()?);
        let normal = normalised(normal * other_distance - other_normal * distance)?;
        Some(Limit::Plane { normal })
    }

    /// The unit normal away from the receiver, and the distance.
    fn plane(&self) -> Option<(DVec3, f64)> {
        match &self.fill {
            Fill::Below { .. } | Fill::Sphere { .. } => None,
            Fill::Disk { axis, distance, .. } => Some((*axis, *distance)),
            Fill::Polygon { corners, normal } => Some((*normal, normal.dot(corners[0]))),
            Fill::HalfPlane { z, .. } => Some((DVec3::Z * z.signum(), z.abs())),
        }
    }

    /// Whether a sphere is closer to another body than its radius; false if neither is a sphere.
    pub(super) fn is_pierced_by(&self, other: &Self) -> bool {
        let ((Fill::Sphere { center, radius }, body) | (body, Fill::Sphere { center, radius })) =
            (&self.fill, &other.fill)
        else {
            return false;
        };
        let distance = match body {
            Fill::Below { .. } => return false,
            Fill::Sphere { center: other, radius } => length(*other - *center) - radius,
            Fill::Disk { center: middle, axis, radius, .. } => {
                let apart = *center - *middle;
                let above = axis.dot(apart);
                let beside = length(apart - *axis * above);
                libm::hypot(above, (beside - radius).max(0.0))
            }
            Fill::Polygon { corners, normal } => distance_to_polygon(*center, corners, *normal),
            Fill::HalfPlane { x_max, z } => libm::hypot(center.z - z, (center.x - x_max).max(0.0)),
        };
        // Bodies that touch are apart.
        distance < radius * (1.0 - 1e-9)
    }
}

fn distance_to_polygon(point: DVec3, corners: &[DVec3], normal: DVec3) -> f64 {
    let around: Vec<DVec3> = corners.iter().map(|corner| *corner - point).collect();
    if surrounds(&around, normal, normal) {
        return normal.dot(around[0]).abs();
    }
    let to_edge = |(i, a): (usize, &DVec3)| {
        let edge = around[(i + 1) % around.len()] - *a;
        let square = edge.length_squared();
        let part = if square > 0.0 { (-a.dot(edge) / square).clamp(0.0, 1.0) } else { 0.0 };
        length(*a + edge * part)
    };
    around.iter().enumerate().map(to_edge).fold(f64::INFINITY, f64::min)
}

/// Whether a polygon that faces the receiver has the direction inside it: how often the edges'
/// planes are crossed on the way to one side.
fn surrounds(corners: &[DVec3], direction: DVec3, normal: DVec3) -> bool {
    // A half-plane from the direction sideways; an edge counts if its ends are on either side of
    // the half-plane's plane and it passes beyond the direction.
    let sideways = normal.any_orthonormal_vector();
    let wall = direction.cross(sideways);
    let mut inside = false;
    for (i, a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        let (a_side, b_side) = (wall.dot(*a), wall.dot(b));
        if (a_side > 0.0) != (b_side > 0.0) {
            let beyond = direction.dot(cross(*a, b));
            inside ^= (beyond > 0.0) == (b_side > a_side);
        }
    }
    inside
}
