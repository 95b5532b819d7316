//! The exchange A₁F₁₂ of two facing polygons as a double integral along their boundaries.

use core::f64::consts::PI;

use glam::DVec3;

use super::legs::{Edge, edges, legs};
use super::polygons::Facing;
use crate::estimate::{Estimate, EstimateError, Tolerance};
use crate::quadrature::adaptive_noisy;

/// Roundings in one edge's term, in units of its parts.
const ROUNDINGS: f64 = 4.0 * f64::EPSILON;

/// A₁F₁₂ = (1/2π) ∮∮ ln r dr₁·dr₂, the loops running around the normals that face each other.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a place is not negative and at most the count of edges"
)]
pub(super) fn exchange(facing: &Facing, tolerance: Tolerance) -> Result<Estimate, EstimateError> {
    let (from, to) = (edges(&facing.from), edges(&facing.to));
    // The smaller boundary outside: the roundings of a long edge's term then count for little length.
    let around = |edges: &[Edge]| edges.iter().map(|edge| edge.length).sum::<f64>();
    let (outer, inner) = if around(&from) <= around(&to) { (from, to) } else { (to, from) };
    let legs = legs(&outer, &inner);
    let places: Vec<f64> = (0..=legs.len()).map(|place| place as f64).collect();
    let at = |place: f64| {
        let index = (place as usize).min(legs.len() - 1);
        let leg = &legs[index];
        let edge = &outer[leg.edge];
        let (share, growth) = leg.share(place - index as f64);
        let point = edge.start + edge.along * (edge.length * leg.reach.mul_add(share, leg.near));
        let (mut sum, mut noise) = (0.0, 0.0);
        for other in &inner {
            let cosine = edge.along.dot(other.along);
            if cosine != 0.0 {
                let (term, rounding) = logarithms(point, other);
                sum += cosine * term;
                noise += cosine.abs() * rounding;
            }
        }
        let scale = edge.length * leg.reach.abs() * growth / (2.0 * PI);
        (scale * sum, scale * noise)
    };
    adaptive_noisy(at, &places, tolerance)
}

/// ∫ ln r along an edge, and a bound of its rounding. With u along the edge from the foot of the
/// point and h its distance from the line: [u ln r] + h (atan(u₁/h) - atan(u₀/h)); the constant -length
/// is left out, since it vanishes around the closed loop of the points.
fn logarithms(point: DVec3, edge: &Edge) -> (f64, f64) {
    let from_start = point - edge.start;
    let (u0, h) = (-from_start.dot(edge.along), from_start.cross(edge.along).length());
    let u1 = u0 + edge.length;
    let logarithm = |u: f64| {
        let square = u.mul_add(u, h * h).max(f64::MIN_POSITIVE);
        0.5 * libm::log(square)
    };
    let (log_0, log_1) = (logarithm(u0), logarithm(u1));
    let angle = libm::atan2(h * edge.length, u0.mul_add(u1, h * h));
    let (end, start, height) = (u1 * log_1, u0 * log_0, h * angle);
    // The ends are off by a rounding of the distance to the edge's start.
    let distance = u0.abs().max(h) + edge.length;
    let off = distance * (log_0 - log_1).abs() + end.abs() + start.abs() + height;
    (end - start + height, ROUNDINGS * off)
}
