//! Convex hulls by their support, and whether two of them are certainly apart. They know no light.

use core::f64::consts::{FRAC_PI_2, TAU};

use glam::DVec3;

use super::body::{Occluder, Source};
use crate::direction::frame;
use crate::shape::{Disk, HalfPlane, Polygon};
use crate::wide::length;

/// Of coordinates that are at most 2.
const ROUNDING: f64 = 1e-13;

/// A convex set, or the convex hull of a polygon.
#[derive(Debug, Clone)]
pub(super) enum Hull {
    Points(Vec<DVec3>),
    Disk { center: DVec3, axis: DVec3, radius: f64 },
    Ball { center: DVec3, radius: f64 },
}

impl Hull {
    pub(super) fn of_source(source: &Source) -> Self {
        match source {
            Source::Disk(disk) => Self::of_disk(disk),
            Source::Sphere(ball) => Self::Ball { center: ball.center_m(), radius: ball.radius_m() },
            Source::Polygon(polygon) => Self::of_polygon(polygon),
        }
    }

    /// Of a half-plane what is near the others; none if it is not.
    pub(super) fn of_occluder(
        occluder: &Occluder,
        region: &[DVec3],
        source: &Self,
    ) -> Option<Self> {
        Some(match occluder {
            Occluder::Disk(disk) => Self::of_disk(disk),
            Occluder::Sphere(ball) => {
                Self::Ball { center: ball.center_m(), radius: ball.radius_m() }
            }
            Occluder::Polygon(polygon) => Self::of_polygon(polygon),
            Occluder::HalfPlane(edge) => {
                let lowest = |axis: DVec3| {
                    let own = axis.dot(source.lowest(axis));
                    region.iter().map(|x| axis.dot(*x)).fold(own, f64::min)
                };
                // A margin beyond rounding; all lengths are at most 2.
                let (left, front) = (lowest(DVec3::X) - 1.0, lowest(DVec3::Y) - 1.0);
                let back = 1.0 - lowest(DVec3::NEG_Y);
                if edge.x_max_m() <= left {
                    return None;
                }
                let corner = |x: f64, y: f64| DVec3::new(x, y, edge.z_m());
                Self::Points(vec![
                    corner(left, front),
                    corner(edge.x_max_m(), front),
                    corner(edge.x_max_m(), back),
                    corner(left, back),
                ])
            }
        })
    }

    fn of_disk(disk: &Disk) -> Self {
        let axis = disk.axis() / length(disk.axis());
        Self::Disk { center: disk.center_m(), axis, radius: disk.radius_m() }
    }

    fn of_polygon(polygon: &Polygon) -> Self {
        Self::Points(polygon.vertices().to_vec())
    }

    /// The point that is lowest along a direction.
    pub(super) fn lowest(&self, direction: DVec3) -> DVec3 {
        match self {
            Self::Points(points) => lowest_of(points, direction),
            Self::Disk { center, axis, radius } => {
                let steepest = direction - *axis * axis.dot(direction);
                *center - steepest.normalize_or_zero() * *radius
            }
            Self::Ball { center, radius } => *center - direction.normalize_or_zero() * *radius,
        }
    }

    /// A point in its midst.
    pub(super) fn middle(&self) -> DVec3 {
        match self {
            Self::Points(points) => points.iter().sum::<DVec3>() / points.len() as f64,
            Self::Disk { center, .. } | Self::Ball { center, .. } => *center,
        }
    }

    /// How far from the hull what it stands for may be: a polygon's vertices need not be in one plane
    /// exactly.
    pub(super) fn slack(&self) -> f64 {
        match self {
            Self::Points(points) => {
                4e-6 * points.iter().map(|x| length(*x - points[0])).fold(0.0, f64::max)
            }
            Self::Disk { .. } | Self::Ball { .. } => 0.0,
        }
    }
}

fn lowest_of(points: &[DVec3], direction: DVec3) -> DVec3 {
    let height = |x: &DVec3| direction.dot(*x);
    let lower = |a: DVec3, b: &DVec3| if height(b) < height(&a) { *b } else { a };
    points.iter().fold(points[0], lower)
}

/// Points around a disk's rim, at a multiple of its radius.
pub(super) fn disk_points(disk: &Disk, count: usize, factor: f64) -> Vec<DVec3> {
    let (right, up) = frame(disk.axis() / length(disk.axis()));
    let point = |k: usize| {
        let (sin, cos) = libm::sincos(TAU * k as f64 / count as f64);
        disk.center_m() + (right * cos + up * sin) * (disk.radius_m() * factor)
    };
    (0..count).map(point).collect()
}

/// Whether a plane through the edge of a half-plane has region and source on its other side: the way to
/// the nearest points alone comes too slowly to planes that leave little room. Lengths are at most 2.
pub(super) fn are_beyond(region: &[DVec3], source: &Hull, edge: &HalfPlane) -> bool {
    const HALVINGS: u32 = 60;
    let point = DVec3::new(edge.x_max_m(), 0.0, edge.z_m());
    let (mut low, mut high) = (-FRAC_PI_2, FRAC_PI_2);
    for _ in 0..HALVINGS {
        let angle = f64::midpoint(low, high);
        let (sin, cos) = libm::sincos(angle);
        let normal = DVec3::new(cos, 0.0, sin);
        let (of_source, of_region) = (source.lowest(normal), lowest_of(region, normal));
        let lit = if normal.dot(of_source) < normal.dot(of_region) { of_source } else { of_region };
        let from_edge = lit - point;
        if normal.dot(from_edge) > ROUNDING + source.slack() {
            return true;
        }
        // Only a plane turned towards it has that point in front.
        if cos * from_edge.z > sin * from_edge.x {
            low = angle;
        } else {
            high = angle;
        }
    }
    false
}

/// Whether a plane is found between a body and the hull of region and source: the way to their nearest
/// points (Gilbert 1966), stopped as soon as the plane across it separates, or after so many steps.
/// Lengths are at most 2.
pub(super) fn are_apart(region: &[DVec3], source: &Hull, body: &Hull, steps: u32) -> bool {
    let margin = ROUNDING + body.slack() + source.slack();
    let lowest = |direction: DVec3| {
        let (of_source, of_region) = (source.lowest(direction), lowest_of(region, direction));
        let lit =
            if direction.dot(of_source) < direction.dot(of_region) { of_source } else { of_region };
        lit - body.lowest(-direction)
    };
    let mut nearest = lowest(source.middle() - body.middle());
    for _ in 0..steps {
        let size = length(nearest);
        if size <= margin {
            return false;
        }
        let next = lowest(nearest);
        if nearest.dot(next) > margin * size {
            return true;
        }
        let step = next - nearest;
        let square = step.length_squared();
        if square == 0.0 {
            return false;
        }
        nearest += step * (-nearest.dot(step) / square).clamp(0.0, 1.0);
    }
    false
}
