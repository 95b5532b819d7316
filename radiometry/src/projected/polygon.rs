//! A polygon by Lambert's formula, clipped by the receiver's horizon; where its terms cancel, by the
//! integral of the positive z h/r⁴ over triangles.
//!
//! Lambert (1760): Ω̃ = ½ |Σ γ Γ·n| over the edges, γ the angle that an edge subtends and Γ the unit
//! normal of its plane through the receiver. The terms are as large as the edges look, their sum as
//! large as the area: what is small, far or near the horizon loses its digits (Baum, Rushmeier and
//! Winget 1989 switch the other way, from the integral to the formula when near).

use std::cell::Cell;

use glam::DVec3;

use super::{Receiver, of_hemisphere};
use crate::domain::DomainError;
use crate::error_free::DoubleDouble;
use crate::quadrature::Sum;
use crate::quantity::ProjectedSolidAngle;
use crate::shape::Polygon;
use crate::wide::{WideVec, in_units, length, unit_exponent};

/// How much larger than their sum the terms of Lambert's formula may be: it costs so many ulp.
const CANCELLATION: f64 = 32.0;
/// Triangles that the integral may look at: slivers of 1e8 take some thousand.
const CELLS_MAX: u32 = 20_000;

/// Projected solid angle of a polygon, convex or not, in any position; 0 from its plane outside it.
/// Its vertices on the horizon count as visible. Refused: a receiver in the polygon itself. Rig: a
/// rectangular emitter's irradiance; the lecture's slide of the formula leaves out the ½.
///
/// ```
/// use glam::DVec3;
/// use radiometry::projected::{self, Receiver};
/// use radiometry::shape::Polygon;
/// // A quarter plane (nearly) from over its corner: a quarter of the hemisphere.
/// let corner = Polygon::new(vec![
///     DVec3::new(0.0, 0.0, 1.0),
///     DVec3::new(1e20, 0.0, 1.0),
///     DVec3::new(0.0, 1e20, 1.0),
/// ])?;
/// let up = Receiver::new(DVec3::ZERO, DVec3::Z)?;
/// let quarter = projected::polygon(&up, &corner)?;
/// assert!((quarter.sr() - std::f64::consts::FRAC_PI_4).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn polygon(receiver: &Receiver, polygon: &Polygon) -> Result<ProjectedSolidAngle, DomainError> {
    let corners = corners(receiver, polygon);
    if volumes(&corners).all(|volume| volume == 0.0) {
        return in_plane(&corners);
    }
    let visible = above_horizon(&corners);
    if visible.len() < 3 {
        return Ok(ProjectedSolidAngle::ZERO);
    }
    let normal_length = length(receiver.normal());
    let (sum, magnitude) = lambert(receiver.normal(), &visible)?;
    let twice = if sum.abs() * CANCELLATION >= magnitude { sum } else { 2.0 * integral(&visible) };
    of_hemisphere((twice / normal_length).abs() / 2.0)
}

/// A vertex as the receiver sees it, in units of the largest coordinate.
#[derive(Debug, Clone, Copy)]
struct Corner {
    position: WideVec,
    /// Above the horizon, times the length of the normal as given.
    height: DoubleDouble,
}

fn corners(receiver: &Receiver, polygon: &Polygon) -> Vec<Corner> {
    let points = polygon.vertices().iter().chain([&receiver.point_m]);
    let unit = unit_exponent(points.flat_map(DVec3::to_array));
    let point = in_units(receiver.point_m(), unit);
    let normal = WideVec::from_vec(receiver.normal());
    let corner = |vertex: &DVec3| {
        let position = WideVec::difference(in_units(*vertex, unit), point);
        Corner { position, height: normal.dot(position) }
    };
    polygon.vertices().iter().map(corner).collect()
}

/// Six times the volumes over the triangles of a fan, signed, as the receiver sees them.
fn volumes(corners: &[Corner]) -> impl Iterator<Item = f64> {
    let first = corners[0].position;
    corners.windows(2).map(move |pair| {
        let (a, b) = (pair[0].position.sub(first), pair[1].position.sub(first));
        first.dot(a.cross(b)).to_f64()
    })
}

/// What a receiver in the polygon's plane sees: nothing, unless it is in the polygon itself, where
/// it depends on the side. By the angles that the edges turn through about the receiver.
fn in_plane(corners: &[Corner]) -> Result<ProjectedSolidAngle, DomainError> {
    let touching = Err(DomainError::Touching { shape: "polygon" });
    let mut turned = DVec3::ZERO;
    for (a, b) in edges(corners) {
        let (cross, dot) = cross_and_dot(a, b);
        let size = length(cross.to_vec());
        if size > 0.0 {
            turned += cross.to_vec() / size * libm::atan2(size, dot);
        } else if dot <= 0.0 {
            return touching;
        }
    }
    // A multiple of a whole turn, 0 from outside.
    if length(turned) > 1.0 { touching } else { Ok(ProjectedSolidAngle::ZERO) }
}

fn edges(corners: &[Corner]) -> impl Iterator<Item = (Corner, Corner)> {
    let next = corners.iter().skip(1).chain(corners.first());
    corners.iter().copied().zip(next.copied())
}

/// Each direction by its own power of two, so that neither a near nor a far corner underflows.
fn cross_and_dot(a: Corner, b: Corner) -> (WideVec, f64) {
    let (a, b) = (a.position.normal_sized(), b.position.normal_sized());
    (a.cross(b), a.dot(b).to_f64())
}

/// Sutherland and Hodgman 1974, against the horizon; signs as exact as the double-doubles.
fn above_horizon(corners: &[Corner]) -> Vec<Corner> {
    let mut visible = Vec::with_capacity(corners.len() + 4);
    for (a, b) in edges(corners) {
        let (from, to) = (a.height.to_f64(), b.height.to_f64());
        if from >= 0.0 {
            visible.push(a);
        }
        if (from > 0.0 && to < 0.0) || (from < 0.0 && to > 0.0) {
            let part = a.height.div(a.height.sub(b.height));
            let position = a.position.add(b.position.sub(a.position).times(part));
            visible.push(Corner { position, height: DoubleDouble::from_f64(0.0) });
        }
    }
    visible
}

/// The sum of Lambert's terms and that of their sizes, times the length of the normal.
fn lambert(normal: DVec3, corners: &[Corner]) -> Result<(f64, f64), DomainError> {
    let normal = WideVec::from_vec(normal);
    let (mut sum, mut magnitude) = (Sum::default(), 0.0);
    for (a, b) in edges(corners) {
        let (cross, dot) = cross_and_dot(a, b);
        let size = length(cross.to_vec());
        if size == 0.0 {
            // An edge towards the receiver, or none; one that runs through it does not end here.
            if dot < 0.0 || a.position.exponent().is_none() {
                return Err(DomainError::Touching { shape: "polygon's edge" });
            }
            continue;
        }
        let term = libm::atan2(size, dot) * (normal.dot(cross).to_f64() / size);
        sum.add(term);
        magnitude += term.abs();
    }
    Ok((sum.value(), magnitude))
}

/// ∫ z h/r⁴ dA over the polygon, signed by its sense, times the length of the normal.
fn integral(corners: &[Corner]) -> f64 {
    let spots: Vec<Spot> = corners
        .iter()
        .map(|corner| Spot { position: corner.position.to_vec(), height: corner.height.to_f64() })
        .collect();
    let mut sum = Sum::default();
    let cells_left = Cell::new(CELLS_MAX);
    for (volume, pair) in volumes(corners).zip(spots.windows(2)) {
        if volume != 0.0 {
            sum.add(volume * mean_over([spots[0], pair[0], pair[1]], 0, &cells_left));
        }
    }
    sum.value()
}

/// A point of the polygon, and its height above the horizon (which its position no longer gives).
#[derive(Debug, Clone, Copy)]
struct Spot {
    position: DVec3,
    height: f64,
}

/// ∫ z/r⁴ over the unit simplex of a triangle's barycentric coordinates, halving the longest edge
/// until it is short as seen from the receiver. NaN where that takes too many.
fn mean_over(corners: [Spot; 3], depth: u32, cells_left: &Cell<u32>) -> f64 {
    /// Of an edge by the distance: 12 x 12 Gauss points then leave rounding alone.
    const SHORT: f64 = 0.5;
    /// Halvings of the area after which the rest of it cannot matter.
    const DEPTH_MAX: u32 = 160;
    if cells_left.get() == 0 {
        return f64::NAN;
    }
    cells_left.set(cells_left.get() - 1);
    let [a, b, c] = corners;
    let (ab, bc, ca) = (
        length(b.position - a.position),
        length(c.position - b.position),
        length(a.position - c.position),
    );
    let longest = ab.max(bc).max(ca);
    let distance = corners.map(|spot| length(spot.position)).into_iter().fold(f64::MAX, f64::min);
    if longest <= SHORT * distance {
        return gauss(corners, longest / distance);
    }
    // A corner at the receiver has no direction; the plane through it shows nothing.
    if depth == DEPTH_MAX || distance <= 0.0 || !longest.is_finite() {
        return 0.0;
    }
    // Rotated so that the longest edge is the first.
    let [a, b, c] = if ab >= bc.max(ca) {
        [a, b, c]
    } else if bc >= ca {
        [b, c, a]
    } else {
        [c, a, b]
    };
    let middle = Spot {
        position: (a.position + b.position) / 2.0,
        height: f64::midpoint(a.height, b.height),
    };
    let halves = [[a, middle, c], [middle, b, c]];
    halves.into_iter().map(|half| mean_over(half, depth + 1, cells_left)).sum::<f64>() / 2.0
}

/// The product rule on a triangle collapsed from a square; fewer points the smaller it looks.
fn gauss(corners: [Spot; 3], extent: f64) -> f64 {
    let rule = if extent < 0.02 { rules::five() } else { rules::twelve() };
    let [a, b, c] = corners;
    let mut sum = 0.0;
    for (u, u_weight) in rule {
        for (v, v_weight) in rule {
            let (along_b, along_c) = (u, v * (1.0 - u));
            let along_a = (1.0 - u) * (1.0 - v);
            let position = a.position * along_a + b.position * *along_b + c.position * along_c;
            let height = a.height * along_a + b.height * along_b + c.height * along_c;
            let square = position.length_squared();
            sum += u_weight * v_weight * (1.0 - u) * (height / square / square);
        }
    }
    sum
}

/// Gauss-Legendre rules on [0, 1], made once.
mod rules {
    use std::sync::OnceLock;

    use crate::quadrature::gauss_legendre;

    static FIVE: OnceLock<Vec<(f64, f64)>> = OnceLock::new();
    static TWELVE: OnceLock<Vec<(f64, f64)>> = OnceLock::new();

    pub(super) fn five() -> &'static [(f64, f64)] {
        FIVE.get_or_init(|| on_unit_interval(5))
    }

    pub(super) fn twelve() -> &'static [(f64, f64)] {
        TWELVE.get_or_init(|| on_unit_interval(12))
    }

    fn on_unit_interval(n: usize) -> Vec<(f64, f64)> {
        let rule = gauss_legendre(n).into_iter();
        rule.map(|(node, weight)| (f64::midpoint(1.0, node), weight / 2.0)).collect()
    }
}
