//! Form factors of surfaces that are infinitely long in one direction: strips and cylinders, known by
//! their cross-section.

use core::f64::consts::PI;

use glam::DVec2;

use super::{form_factor, scaled};
use crate::domain::{DomainError, finite, not_negative, positive, within};
use crate::error_free::DoubleDouble;
use crate::quantity::FormFactor;

/// From the strip p₀p₁ to the strip q₀q₁, infinite across the plane of the points, by Hottel's crossed
/// strings (1954; Howell C-1 to C-5): (crossed - uncrossed)/(2 |p₀p₁|). In double-double and rationalised
/// twice, so that strips far apart keep their digits.
///
/// Each strip acts by the face that it turns to the other. Where the plane of one cuts the other, the
/// one acts by its left alone (going from its first edge to its second) and the part of the other on
/// its right is left out, as if the strings were wrapped around its edge. The strips may touch; refused
/// are strips that run through each other. A second strip without width receives nothing.
/// Who needs it: the page on form factors (crossed strings).
///
/// ```
/// use glam::dvec2;
/// // Two unit strips at unit distance: √2 - 1.
/// let factor = radiometry::form_factor::strips(
///     [dvec2(0.0, 0.0), dvec2(1.0, 0.0)],
///     [dvec2(0.0, 1.0), dvec2(1.0, 1.0)],
/// )?;
/// assert!((factor.ratio() - (2.0_f64.sqrt() - 1.0)).abs() < 1e-15);
/// // A wall beside the floor, of which the half below it is not seen: 1 + 1 - √2, halved.
/// let sunk = radiometry::form_factor::strips(
///     [dvec2(0.0, 0.0), dvec2(1.0, 0.0)],
///     [dvec2(0.0, -1.0), dvec2(0.0, 1.0)],
/// )?;
/// assert!((sunk.ratio() - (1.0 - 0.5_f64.sqrt())).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn strips(from: [DVec2; 2], to: [DVec2; 2]) -> Result<FormFactor, DomainError> {
    let numbers = [from[0], from[1], to[0], to[1]].map(|point| point.to_array());
    for number in numbers.as_flattened() {
        finite("a strip's edge", *number)?;
    }
    // By eighths, so that no difference overflows.
    let eighths = core::array::from_fn::<_, 8, _>(|i| numbers.as_flattened()[i] / 8.0);
    let [p0x, p0y, p1x, p1y, q0x, q0y, q1x, q1y] = scaled(eighths);
    let point = |x: f64, y: f64| [DoubleDouble::from_f64(x), DoubleDouble::from_f64(y)];
    let (p, q) = ([point(p0x, p0y), point(p1x, p1y)], [point(q0x, q0y), point(q1x, q1y)]);
    let width = length(between(p[0], p[1])).to_f64();
    positive("width_from_m", width)?;
    let ([p0, p1], [q0, q1]) = match (straddles(p, q), straddles(q, p)) {
        (true, true) => return Err(CROSSING),
        (true, false) => (to_the_left(p, q), q),
        (false, true) => (p, to_the_left(q, p)),
        (false, false) => (p, q),
    };
    let (along_p, along_q) = (between(p0, p1), between(q0, q1));

    // Strings from p₀ to q₁ and q₀ (a, b), from p₁ likewise (c, d).
    let [a, b, c, d] = [between(p0, q1), between(p0, q0), between(p1, q1), between(p1, q0)];
    let (from_p0, from_p1) = (length(a).add(length(b)), length(c).add(length(d)));
    if from_p0.to_f64() == 0.0 || from_p1.to_f64() == 0.0 {
        return Ok(FormFactor::ZERO);
    }
    // |a| - |b| = (a-b)·(a+b)/(|a|+|b|), and once more between p₀ and p₁.
    let shared = slope(along_p, a, c).add(slope(along_p, b, d));
    let two = DoubleDouble::from_f64(2.0);
    let numerator = two
        .mul(dot(along_q, along_p))
        .mul(from_p0)
        .sub(dot(along_q, [a[0].add(b[0]), a[1].add(b[1])]).mul(shared));
    let crossed_less_uncrossed = numerator.div(from_p0.mul(from_p1)).to_f64();
    form_factor(crossed_less_uncrossed.abs() / (2.0 * width))
}

type Vector = [DoubleDouble; 2];

fn between(from: Vector, to: Vector) -> Vector {
    [to[0].sub(from[0]), to[1].sub(from[1])]
}

fn dot(a: Vector, b: Vector) -> DoubleDouble {
    a[0].mul(b[0]).add(a[1].mul(b[1]))
}

fn length(a: Vector) -> DoubleDouble {
    dot(a, a).sqrt()
}

/// (|a| - |b|), a - b = `step`.
fn slope(step: Vector, a: Vector, b: Vector) -> DoubleDouble {
    let lengths = length(a).add(length(b));
    if lengths.to_f64() == 0.0 {
        return lengths;
    }
    dot(step, [a[0].add(b[0]), a[1].add(b[1])]).div(lengths)
}

const CROSSING: DomainError = DomainError::Placing {
    argument: "to",
    expected: "a strip that does not run through the other",
};

/// How far to the left of a strip's line a point is, times its width.
fn left_of(strip: [Vector; 2], x: Vector) -> DoubleDouble {
    let (along, away) = (between(strip[0], strip[1]), between(strip[0], x));
    along[0].mul(away[1]).sub(along[1].mul(away[0]))
}

/// Whether a strip lies on both sides of the other's line.
fn straddles(strip: [Vector; 2], other: [Vector; 2]) -> bool {
    let [start, end] = strip.map(|x| left_of(other, x).to_f64());
    (start < 0.0 && end > 0.0) || (start > 0.0 && end < 0.0)
}

/// The part of a strip to the left of the line of the other, which it straddles.
fn to_the_left(strip: [Vector; 2], other: [Vector; 2]) -> [Vector; 2] {
    let [start, end] = strip.map(|x| left_of(other, x));
    let part = start.div(start.sub(end));
    let along = between(strip[0], strip[1]);
    let crossing = [0, 1].map(|i| strip[0][i].add(along[i].mul(part)));
    if start.to_f64() > 0.0 { [strip[0], crossing] } else { [crossing, strip[1]] }
}

/// Between two equal, parallel, infinite cylinders (Howell C-63): (√(X²-1) + asin(1/X) - X)/π with
/// X = d/2r, d the distance of the axes, 2r at least; rationalised. 0 between lines.
/// Who needs it: the page on form factors (crossed strings).
///
/// ```
/// // In contact: ½ - 1/π.
/// let factor = radiometry::form_factor::parallel_cylinders(1.0, 2.0)?;
/// assert!((factor.ratio() - (0.5 - 1.0 / std::f64::consts::PI)).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn parallel_cylinders(radius_m: f64, axis_distance_m: f64) -> Result<FormFactor, DomainError> {
    not_negative("radius_m", radius_m)?;
    within("axis_distance_m", axis_distance_m, 2.0 * radius_m, f64::MAX)?;
    if radius_m == 0.0 {
        return Ok(FormFactor::ZERO);
    }
    let [radius, half] = scaled([radius_m / 2.0, axis_distance_m / 4.0]);
    let tangent = ((half - radius) * (half + radius)).sqrt();
    // √(X²-1) - X = -1/(X + √(X²-1))
    let angle = libm::atan2(radius, tangent);
    form_factor((angle - radius / (half + tangent)) / PI)
}
