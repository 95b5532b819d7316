//! Form factors of surfaces that are infinitely long in one direction: strips and cylinders, known by
//! their cross-section.

use core::f64::consts::PI;

use glam::DVec2;

use super::{form_factor, scaled};
use crate::domain::{DomainError, finite, not_negative, positive, within};
use crate::error_free::DoubleDouble;
use crate::quantity::FormFactor;

/// From the strip p₀p₁ to the strip q₀q₁, infinite across the plane of the points, by Hottel's crossed
/// strings (1954; Howell C-1 to C-5): (crossed - uncrossed)/(2 |p₀p₁|). The strips may share an edge;
/// neither may cross the line of the other. In double-double and rationalised twice, so that strips far
/// apart keep their digits.
///
/// ```
/// use glam::dvec2;
/// // Two unit strips at unit distance: √2 - 1.
/// let factor = radiometry::form_factor::strips(
///     [dvec2(0.0, 0.0), dvec2(1.0, 0.0)],
///     [dvec2(0.0, 1.0), dvec2(1.0, 1.0)],
/// )?;
/// assert!((factor.ratio() - (2.0_f64.sqrt() - 1.0)).abs() < 1e-15);
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
    let (p0, p1, q0, q1) = (point(p0x, p0y), point(p1x, p1y), point(q0x, q0y), point(q1x, q1y));
    let (along_p, along_q) = (between(p0, p1), between(q0, q1));
    let width = length(along_p).to_f64();
    positive("width_from_m", width)?;
    positive("width_to_m", length(along_q).to_f64())?;
    let cross = |a: Vector, b: Vector| a[0].mul(b[1]).sub(a[1].mul(b[0])).to_f64();
    facing("from", cross(along_q, between(q0, p0)), cross(along_q, between(q0, p1)))?;
    facing("to", cross(along_p, between(p0, q0)), cross(along_p, between(p0, q1)))?;

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

/// Both ends of a strip on one side of the other's line.
fn facing(argument: &'static str, start: f64, end: f64) -> Result<(), DomainError> {
    if (start < 0.0 && end > 0.0) || (start > 0.0 && end < 0.0) {
        let expected = "a strip on one side of the other's plane";
        return Err(DomainError::Placing { argument, expected });
    }
    Ok(())
}

/// Between two equal, parallel, infinite cylinders (Howell C-63): (√(X²-1) + asin(1/X) - X)/π with
/// X = d/2r, d the distance of the axes, 2r at least; rationalised. 0 between lines.
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
