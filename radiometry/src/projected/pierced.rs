//! Whether bodies penetrate each other, as far as a ball is concerned. Flat ones show it where one is
//! seen in front of the other and behind.

use glam::DVec3;

use super::body::{Occluder, Source};
use crate::shape::{Polygon, Sphere};
use crate::wide::{cross, length};

/// Whether a ball is closer to the other body than its radius; false if neither is a ball. Bodies
/// that touch are apart.
pub(super) fn is_pierced(source: &Source, occluder: &Occluder) -> bool {
    let (ball, distance) = match (source, occluder) {
        (Source::Sphere(ball), other) => (ball, to_occluder(ball.center_m(), other)),
        (other, Occluder::Sphere(ball)) => (ball, to_source(ball.center_m(), other)),
        _ => return false,
    };
    distance < ball.radius_m() * (1.0 - 1e-9)
}

fn to_occluder(point: DVec3, body: &Occluder) -> f64 {
    match body {
        Occluder::Sphere(sphere) => to_sphere(point, sphere),
        Occluder::Disk(disk) => to_disk(point, disk.center_m(), disk.axis(), disk.radius_m()),
        Occluder::Polygon(polygon) => to_polygon(point, polygon),
        Occluder::HalfPlane(edge) => {
            libm::hypot(point.z - edge.z_m(), (point.x - edge.x_max_m()).max(0.0))
        }
    }
}

fn to_source(point: DVec3, body: &Source) -> f64 {
    match body {
        Source::Sphere(sphere) => to_sphere(point, sphere),
        Source::Disk(disk) => to_disk(point, disk.center_m(), disk.axis(), disk.radius_m()),
        Source::Polygon(polygon) => to_polygon(point, polygon),
    }
}

fn to_sphere(point: DVec3, sphere: &Sphere) -> f64 {
    length(sphere.center_m() - point) - sphere.radius_m()
}

fn to_disk(point: DVec3, center: DVec3, axis: DVec3, radius: f64) -> f64 {
    let axis = axis / length(axis);
    let apart = point - center;
    let above = axis.dot(apart);
    let beside = length(apart - axis * above);
    libm::hypot(above, (beside - radius).max(0.0))
}

fn to_polygon(point: DVec3, polygon: &Polygon) -> f64 {
    let around: Vec<DVec3> = polygon.vertices().iter().map(|vertex| *vertex - point).collect();
    let first = around[0];
    let area: DVec3 = around.windows(2).map(|pair| cross(pair[0] - first, pair[1] - first)).sum();
    let size = length(area);
    let normal = area / size;
    if size > 0.0 && is_over(&around, normal) {
        return normal.dot(first).abs();
    }
    let to_edge = |(i, a): (usize, &DVec3)| {
        let edge = around[(i + 1) % around.len()] - *a;
        let square = edge.length_squared();
        let part = if square > 0.0 { (-a.dot(edge) / square).clamp(0.0, 1.0) } else { 0.0 };
        length(*a + edge * part)
    };
    around.iter().enumerate().map(to_edge).fold(f64::INFINITY, f64::min)
}

/// Whether the foot of the perpendicular from the origin is in the polygon: by crossings of a ray in
/// its plane.
fn is_over(corners: &[DVec3], normal: DVec3) -> bool {
    let right = normal.any_orthonormal_vector();
    let up = normal.cross(right);
    let mut inside = false;
    for (i, a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        let (low, high) = (up.dot(*a), up.dot(b));
        if (low > 0.0) != (high > 0.0) {
            let beyond = normal.dot(cross(*a, b));
            inside ^= (beyond > 0.0) == (high > low);
        }
    }
    inside
}
