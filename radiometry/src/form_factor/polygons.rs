//! The form factor of two flat polygons, convex or not, in any position: sharing an edge or a vertex,
//! near contact, far apart, or one cut by the plane of the other.

use core::f64::consts::PI;

use glam::DVec3;

use super::{LEAST_SQUARED, UNLIKE_SIZES, contour, contour_wide, integrated, pairs};
use crate::direction::normalised;
use crate::domain::{DomainError, positive};
use crate::error_free::DoubleDouble;
use crate::estimate::{Estimate, EstimateError, Tolerance};
use crate::shape::Polygon;
use crate::wide::WideVec;

/// Nearer to a plane than this, in units of the extent of both polygons, is in it: four roundings.
const IN_PLANE: f64 = 4.0 * f64::EPSILON;

/// F from one polygon to another, nothing between them, as an estimate within a tolerance.
///
/// Each polygon acts by the face that it turns to the other. Where the plane of one cuts the other,
/// the one acts by its front alone (from there its vertices run counter-clockwise) and the part of
/// the other behind it is left out; so `polygons(a, b)` times the area of a is `polygons(b, a)` times
/// that of b. Without an area the one receives nothing; from the other it is an error.
///
/// By Stokes' theorem A₁F₁₂ = (1/2π) ∮∮ ln r dr₁·dr₂ (Sparrow 1963), the inner integral over an edge in
/// closed form, the outer by adaptive quadrature whose places crowd where the boundaries come near each
/// other. Where that cancels, far apart, cubature of the positive kernel over pairs of triangles takes
/// over; side by side, in thin gaps and at grazing sight, the same boundary integral in
/// double-double.
/// Who needs it: the person at the rig, for baffles and boxes.
///
/// ```
/// use glam::DVec3;
/// use radiometry::{Tolerance, form_factor::polygons, shape::Polygon};
/// // Floor and wall of a cube.
/// let floor = Polygon::new(vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y])?;
/// let wall = Polygon::new(vec![DVec3::ZERO, DVec3::Y, DVec3::new(0.0, 1.0, 1.0), DVec3::Z])?;
/// let factor = polygons(&floor, &wall, Tolerance::from_relative(1e-10)?)?;
/// assert!((factor.value - 0.200_043_776_075_403_15).abs() <= factor.error_bound);
/// # Ok::<(), radiometry::EstimateError>(())
/// ```
pub fn polygons(
    from: &Polygon,
    to: &Polygon,
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    let pair = Pair::new(from, to)?;
    let Some(facing) = pair.facing(Faces::Both) else { return Ok(Estimate::closed(0.0, 0.0)) };
    unhindered(&pair, &facing, tolerance)
}

/// The same for the parts that face each other.
pub(super) fn unhindered(
    pair: &Pair,
    facing: &Facing,
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    let area = pair.area_from;
    let wanted = tolerance.before_factor(1.0 / area);
    let mut best = match contour::exchange(facing, wanted) {
        Err(EstimateError::Unmet { estimate, .. }) => estimate,
        other => return integrated(other, 0.0, 1.0 / area, tolerance),
    };
    // What passes between areas below this leaves the doubles' range, and would eat the budget.
    if pair.area_from.min(pair.area_to) < LEAST_SQUARED * LEAST_SQUARED {
        return Err(UNLIKE_SIZES.into());
    }
    let mut other_ways: [Way; 2] = [contour_wide::exchange, pairs::exchange];
    // The positive kernel is smooth from afar.
    if facing.is_far() {
        other_ways.reverse();
    }
    for way in other_ways {
        let found = match way(facing, wanted) {
            Ok(estimate) | Err(EstimateError::Unmet { estimate, .. }) => estimate,
            Err(error) => return Err(error),
        };
        let evaluations = best.evaluations + found.evaluations;
        let better = if found.error_bound < best.error_bound { found } else { best };
        best = Estimate { evaluations, ..better };
        if best.meets(wanted) {
            break;
        }
    }
    integrated(Ok(best), 0.0, 1.0 / area, tolerance)
}

/// To find an exchange.
type Way = fn(&Facing, Tolerance) -> Result<Estimate, EstimateError>;

/// Throughput of all rays from one polygon to another, m²·sr: π A₁ F₁₂; conventions as in
/// [`polygons`].
/// Who needs it: the page on the throughput of two surfaces.
///
/// ```
/// use glam::DVec3;
/// use radiometry::{Tolerance, form_factor::throughput_of_polygons, shape::Polygon};
/// let stop = |z: f64| {
///     let corner = |x: f64, y: f64| DVec3::new(x, y, z);
///     Polygon::new(vec![corner(0.0, 0.0), corner(1e-3, 0.0), corner(1e-3, 1e-3), corner(0.0, 1e-3)])
/// };
/// let beam = throughput_of_polygons(&stop(0.0)?, &stop(1.0)?, Tolerance::from_relative(1e-8)?)?;
/// assert!((beam.value / 1e-12 - 1.0).abs() < 1e-5); // A₁A₂/d²
/// # Ok::<(), radiometry::EstimateError>(())
/// ```
pub fn throughput_of_polygons(
    from: &Polygon,
    to: &Polygon,
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    let pair = Pair::new(from, to)?;
    let area_m2 = libm::scalbn(pair.area_from, 2 * pair.exponent);
    if !area_m2.is_finite() {
        return Err(DomainError::Overflow { result: "area_m2" }.into());
    }
    Ok(polygons(from, to, tolerance)?.scaled(PI * area_m2))
}

/// Both polygons in a unit of length that is a power of two, near the first one's first vertex.
pub(super) struct Pair {
    pub(super) from: Vec<DVec3>,
    pub(super) to: Vec<DVec3>,
    /// Twice the area long, counter-clockwise around it.
    pub(super) normal_from: DVec3,
    pub(super) normal_to: DVec3,
    pub(super) area_from: f64,
    pub(super) area_to: f64,
    /// Without the rounding of the differences from the origin.
    wide_from: Vec<WideVec>,
    wide_to: Vec<WideVec>,
    /// The first vertex, in eighths.
    origin: DVec3,
    exponent: i32,
}

/// Which faces of polygons act.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Faces {
    /// Those that they turn to each other.
    Both,
    /// Those around which their vertices run counter-clockwise.
    Fronts,
}

/// What takes part of two polygons, in their order around the normals that they turn to each other.
pub(super) struct Facing {
    pub(super) from: Vec<DVec3>,
    pub(super) to: Vec<DVec3>,
    /// The same vertices with all their digits.
    pub(super) wide_from: Vec<WideVec>,
    pub(super) wide_to: Vec<WideVec>,
    /// Of length 1.
    pub(super) normal_from: DVec3,
    pub(super) normal_to: DVec3,
}

impl Pair {
    pub(super) fn new(from: &Polygon, to: &Polygon) -> Result<Self, DomainError> {
        // By eighths, so that no difference overflows.
        let eighths = |polygon: &Polygon| polygon.vertices().iter().map(|v| *v / 8.0).collect();
        let (from, to): (Vec<DVec3>, Vec<DVec3>) = (eighths(from), eighths(to));
        let origin = from[0];
        let extent = from.iter().chain(&to).map(|v| (*v - origin).abs().max_element());
        let extent = positive("extent_m", extent.fold(0.0, f64::max))?;
        let exponent = libm::ilogb(extent);
        let near = |vertices: &[DVec3]| -> Vec<WideVec> {
            let relative = |vertex: &DVec3| WideVec::difference(*vertex, origin).scaled(-exponent);
            vertices.iter().map(relative).collect()
        };
        let (wide_from, wide_to) = (near(&from), near(&to));
        let (twice_from, from) = (vector_area(&wide_from), rounded(&wide_from));
        let (twice_to, to) = (vector_area(&wide_to), rounded(&wide_to));
        let (normal_from, normal_to) = (twice_from.to_vec(), twice_to.to_vec());
        positive("area_from_m2", normal_from.length())?;
        let area_from = twice_from.length().to_f64() / 2.0;
        let area_to = twice_to.length().to_f64() / 2.0;
        Ok(Self {
            from,
            to,
            normal_from,
            normal_to,
            area_from,
            area_to,
            wide_from,
            wide_to,
            origin,
            exponent: exponent + 3,
        })
    }

    /// Another point in the same unit and place.
    pub(super) fn near(&self, point_m: DVec3) -> DVec3 {
        let from_origin = point_m / 8.0 - self.origin;
        DVec3::from_array(from_origin.to_array().map(|x| libm::scalbn(x, 3 - self.exponent)))
    }

    /// Another length in the same unit.
    pub(super) fn in_unit(&self, length_m: f64) -> f64 {
        libm::scalbn(length_m, -self.exponent)
    }

    /// The parts that can see each other; none if there are none.
    pub(super) fn facing(&self, faces: Faces) -> Option<Facing> {
        // What has no area turns no face to anything.
        let normal_to = normalised(self.normal_to)?;
        let normal_from = self.normal_from.normalize();
        let (turn_from, turn_to) = match faces {
            Faces::Fronts => {
                let in_front = |point, normal, others| side(point, normal, others) == Some(1.0);
                let is_seen = in_front(self.from[0], normal_from, &self.to)
                    && in_front(self.to[0], normal_to, &self.from);
                if !is_seen {
                    return None;
                }
                (1.0, 1.0)
            }
            Faces::Both => (
                side(self.from[0], normal_from, &self.to)?,
                side(self.to[0], normal_to, &self.from)?,
            ),
        };
        let turned = |vertices: &[WideVec], sign: f64| {
            let mut vertices = vertices.to_vec();
            if sign < 0.0 {
                vertices.reverse();
            }
            vertices
        };
        let (facing_from, facing_to) = (turn_from * normal_from, turn_to * normal_to);
        let wide_from = in_front(self.to[0], facing_to, &turned(&self.wide_from, turn_from));
        let wide_to = in_front(self.from[0], facing_from, &turned(&self.wide_to, turn_to));
        let (from, to) = (rounded(&wide_from), rounded(&wide_to));
        let enough = from.len() > 2 && to.len() > 2;
        let (normal_from, normal_to) = (facing_from, facing_to);
        enough.then_some(Facing { from, to, wide_from, wide_to, normal_from, normal_to })
    }
}

impl Facing {
    /// Whether the polygons are farther from each other than they are large.
    fn is_far(&self) -> bool {
        let ball = |vertices: &[DVec3]| {
            let sum = vertices.iter().fold(DVec3::ZERO, |sum, x| sum + *x);
            let center = sum / vertices.len() as f64;
            let radius = vertices.iter().map(|x| x.distance(center)).fold(0.0, f64::max);
            (center, radius)
        };
        let ((from, from_radius), (to, to_radius)) = (ball(&self.from), ball(&self.to));
        from.distance(to) > 3.0 * (from_radius + to_radius)
    }
}

fn rounded(vertices: &[WideVec]) -> Vec<DVec3> {
    vertices.iter().map(|vertex| vertex.to_vec()).collect()
}

/// The vector area, doubled (Newell), from the first vertex.
fn vector_area(vertices: &[WideVec]) -> WideVec {
    let first = vertices[0];
    let fan = vertices.windows(2).map(|edge| edge[0].sub(first).cross(edge[1].sub(first)));
    fan.fold(WideVec::from_vec(DVec3::ZERO), WideVec::add)
}

fn height(point: DVec3, normal: DVec3, vertex: DVec3) -> f64 {
    let height = normal.dot(vertex - point);
    if height.abs() <= IN_PLANE { 0.0 } else { height }
}

/// 1 if there is anything in front of the plane, -1 if all is behind, nothing if all is in it.
fn side(point: DVec3, normal: DVec3, vertices: &[DVec3]) -> Option<f64> {
    let heights = || vertices.iter().map(|vertex| height(point, normal, *vertex));
    if heights().any(|height| height > 0.0) {
        Some(1.0)
    } else {
        heights().any(|height| height < 0.0).then_some(-1.0)
    }
}

/// The part of a polygon in front of a plane (Sutherland and Hodgman 1974). Of one that is not convex
/// the parts stay joined by edges in the plane, there and back, which the boundary integral does not
/// notice.
fn in_front(point: DVec3, normal: DVec3, vertices: &[WideVec]) -> Vec<WideVec> {
    let above = |vertex: &WideVec| height(point, normal, vertex.to_vec());
    let mut kept = Vec::with_capacity(vertices.len() + 2);
    for (i, end) in vertices.iter().enumerate() {
        let start = &vertices[(i + vertices.len() - 1) % vertices.len()];
        let (above_start, above_end) = (above(start), above(end));
        if (above_start < 0.0 && above_end > 0.0) || (above_start > 0.0 && above_end < 0.0) {
            let part = DoubleDouble::from_f64(above_start / (above_start - above_end));
            kept.push(start.add(end.sub(*start).times(part)));
        }
        if above_end >= 0.0 {
            kept.push(*end);
        }
    }
    kept
}
