//! Form factors of rectangles: in parallel planes, at right angles, and with a common edge at any angle.
//! They do not know how a function of a difference is integrated: that is next door, in `overlap`.

use core::f64::consts::{FRAC_PI_2, PI};
use core::ops::Range;

use super::overlap::{Edge, Overlap, kernel};
use super::{form_factor, integrated, scaled};
use crate::domain::{DomainError, finite, not_negative, positive, within};
use crate::estimate::{Estimate, EstimateError, Tolerance};
use crate::quadrature::adaptive_noisy;
use crate::quantity::FormFactor;

/// Of an integrand that is a product of a dozen positive factors and sums.
const ROUNDINGS: f64 = 12.0 * f64::EPSILON;

/// In parts of a stretch: peaks so narrow take more panels than an adaptive rule, which below the lower
/// end does not find them any more.
const ADAPTIVE: Range<f64> = 1e-12..1e-7;
/// Narrower ones take more panels than anyone waits for.
const NARROWEST: f64 = 1e-36;

/// Between two equal rectangles a x b, one right above the other at the distance c (Howell C-11). 0
/// between lines.
/// Who needs it: the page on form factors: walls of a box.
///
/// ```
/// // Opposite faces of a cube.
/// let factor = radiometry::form_factor::parallel_rectangles(1.0, 1.0, 1.0)?;
/// assert!((factor.ratio() - 0.199_824_895_698_387_36).abs() < 1e-15);
/// # Ok::<(), radiometry::EstimateError>(())
/// ```
pub fn parallel_rectangles(
    side_a_m: f64,
    side_b_m: f64,
    distance_m: f64,
) -> Result<FormFactor, EstimateError> {
    let a = [0.0, not_negative("side_a_m", side_a_m)?];
    let b = [0.0, not_negative("side_b_m", side_b_m)?];
    if side_a_m == 0.0 || side_b_m == 0.0 {
        positive("z_m", distance_m)?;
        return Ok(FormFactor::ZERO);
    }
    aligned_rectangles(a, b, a, b, distance_m)
}

/// From [x₁, x₂] x [y₁, y₂] in the plane 0 to [ξ₁, ξ₂] x [η₁, η₂] in the plane z, sides parallel (Howell
/// C-13): the sum of 16 corner terms, or where they cancel the integral over v = η - y. From a line or
/// a point that looks along z if a side of 1 has no length; 0 to a line or a point. Refused where the
/// integral is needed and z is more than 36 powers of ten below the lengths of the sides.
/// Who needs it: the page on form factors: walls of a box.
///
/// ```
/// use radiometry::form_factor::aligned_rectangles;
/// // Far apart: A₂/(π z²), which the corner terms have no digits left for.
/// let unit = [0.0, 1.0];
/// let factor = aligned_rectangles(unit, unit, unit, unit, 1e6)?.ratio();
/// assert!((factor * std::f64::consts::PI * 1e12 - 1.0).abs() < 1e-11);
/// # Ok::<(), radiometry::EstimateError>(())
/// ```
pub fn aligned_rectangles(
    x_m: [f64; 2],
    y_m: [f64; 2],
    xi_m: [f64; 2],
    eta_m: [f64; 2],
    z_m: f64,
) -> Result<FormFactor, EstimateError> {
    for (argument, side) in [("x_m", x_m), ("y_m", y_m), ("xi_m", xi_m), ("eta_m", eta_m)] {
        interval(argument, side)?;
    }
    positive("z_m", z_m)?;
    let [x1, x2, y1, y2, xi1, xi2, eta1, eta2, z] = scaled(
        [x_m[0], x_m[1], y_m[0], y_m[1], xi_m[0], xi_m[1], eta_m[0], eta_m[1], z_m]
            .map(|length| length / 8.0),
    );
    if xi1 >= xi2 || eta1 >= eta2 {
        return Ok(FormFactor::ZERO);
    }
    let along_x = Overlap::new([x1, x2], [xi1, xi2]);
    let along_y = Overlap::new([y1, y2], [eta1, eta2]);
    let area = or_one(x2 - x1) * or_one(y2 - y1);
    if let Some(corners) = along_x.corner_sum(&along_y, z) {
        return Ok(form_factor(corners / (2.0 * PI * area))?);
    }
    let narrowest = along_x.narrowness(z).min(along_y.narrowness(z));
    if narrowest < NARROWEST {
        return Err(DomainError::Lost { result: "the form factor" }.into());
    }
    let integral = if ADAPTIVE.contains(&narrowest) {
        let adaptive = |f: &dyn Fn(f64) -> f64, _| Ok(along_x.integrate(f, kernel())?.value);
        let across = |v: f64| along_x.between_strips(v, z, adaptive).unwrap_or(f64::NAN);
        along_y.integrate(across, kernel())?.value
    } else {
        let panels = |f: &dyn Fn(f64) -> f64, rho| Ok(along_x.graded(f, rho, None));
        let across = |v: f64| along_x.between_strips(v, z, panels).unwrap_or(f64::NAN);
        along_y.graded(across, z, None)
    };
    Ok(form_factor(integral / (PI * area))?)
}

/// From the floor w x l to the wall h x l that stands on its edge l (Howell C-14). From the edge alone,
/// a floor of no width, the wall fills half of the view.
/// Who needs it: the page on form factors: walls of a box.
///
/// ```
/// // Faces of a cube with a common edge.
/// let factor = radiometry::form_factor::perpendicular_rectangles(1.0, 1.0, 1.0)?;
/// assert!((factor.ratio() - 0.200_043_776_075_403_15).abs() < 1e-15);
/// # Ok::<(), radiometry::EstimateError>(())
/// ```
pub fn perpendicular_rectangles(
    width_m: f64,
    height_m: f64,
    edge_m: f64,
) -> Result<FormFactor, EstimateError> {
    let edge = [0.0, not_negative("edge_m", edge_m)?];
    let floor = [0.0, not_negative("width_m", width_m)?];
    let wall = [0.0, not_negative("height_m", height_m)?];
    if edge_m == 0.0 || height_m == 0.0 {
        return Ok(FormFactor::ZERO);
    }
    if width_m == 0.0 {
        return Ok(FormFactor::from_ratio(0.5));
    }
    perpendicular_offset_rectangles(floor, edge, wall, edge)
}

/// From [x₁, x₂] x [y₁, y₂] in the plane z = 0 to y in [η₁, η₂], z in [z₁, z₂] in the plane x = 0 (Howell
/// C-15); x₁ and z₁ not negative. The integral over v = η - y of
/// ln(1 + (x₂²-x₁²)(z₂²-z₁²)/((x₁²+z₁²+v²)(x₂²+z₂²+v²)))/4π, as often as v occurs. From a line or a
/// point that looks along z if a side of 1 has no length: at the foot of the wall the limit from in front
/// of it, half of what of the line lies along the wall (a point at its end counts half). 0 to a wall
/// without a width or height.
/// Who needs it: the page on form factors: walls of a box.
///
/// ```
/// use radiometry::form_factor::{perpendicular_offset_rectangles, perpendicular_rectangles};
/// let offset = perpendicular_offset_rectangles([0.0, 2.0], [5.0, 8.0], [0.0, 0.5], [5.0, 8.0])?;
/// let edge = perpendicular_rectangles(2.0, 0.5, 3.0)?;
/// assert!((offset / edge - 1.0).abs() < 1e-14);
/// # Ok::<(), radiometry::EstimateError>(())
/// ```
pub fn perpendicular_offset_rectangles(
    x_m: [f64; 2],
    y_m: [f64; 2],
    z_m: [f64; 2],
    eta_m: [f64; 2],
) -> Result<FormFactor, EstimateError> {
    for (argument, side) in [("x_m", x_m), ("y_m", y_m), ("z_m", z_m), ("eta_m", eta_m)] {
        interval(argument, side)?;
    }
    not_negative("x_m", x_m[0])?;
    not_negative("z_m", z_m[0])?;
    let [x1, x2, y1, y2, z1, z2, eta1, eta2] = scaled(
        [x_m[0], x_m[1], y_m[0], y_m[1], z_m[0], z_m[1], eta_m[0], eta_m[1]]
            .map(|length| length / 8.0),
    );
    let along_y = Overlap::new([y1, y2], [eta1, eta2]);
    if z1 >= z2 || eta1 >= eta2 {
        return Ok(FormFactor::ZERO);
    }
    if x2 == 0.0 && z1 == 0.0 {
        return Ok(form_factor(0.5 * along_y.share_at_zero() / or_one(y2 - y1))?);
    }
    // Of a line, divided by its width: the logarithm of all but 1 is what exceeds 1.
    let is_line = x1 >= x2;
    let floor = if is_line { x1 + x2 } else { (x2 - x1) * (x2 + x1) };
    let wall = (z2 - z1) * (z2 + z1);
    let (near, far) = (x1 * x1 + z1 * z1, x2 * x2 + z2 * z2);
    let rays = |v: f64| {
        let nearest = v.mul_add(v, near).max(f64::MIN_POSITIVE);
        let excess = floor / nearest * (wall / v.mul_add(v, far));
        if is_line { excess } else { libm::log1p(excess) }
    };
    let integral = if x1 > 0.0 || z1 > 0.0 {
        along_y.graded(rays, libm::hypot(x1, z1), None)
    } else {
        // With a common edge the integrand is -2 ln v but for what is smooth up to the widths.
        let reach = 0.5 * x2.min(z2);
        let (widest, across) = (x2.max(z2), libm::hypot(x2, z2));
        let rest = |v: f64| {
            let (part, slope) = (v / reach, 2.0 * widest / libm::hypot(v, across));
            libm::log(part.mul_add(part, slope * slope))
        };
        along_y.graded(rays, 0.0, Some(&Edge { reach, rest: &rest }))
    };
    Ok(form_factor(integral / (4.0 * PI * or_one(x2 - x1) * or_one(y2 - y1)))?)
}

/// From the rectangle a x l to the rectangle b x l that shares its edge l at an angle φ (Howell C-16),
/// given by its cosine, -1 (in one plane) up to below 1. As an integral over the direction β, across
/// the edge, of the lines between the faces:
/// ∫ sin β sin(φ+β) Q(R(β)) dβ/(π a sin φ), Q(R) = R atan(l/R) + (l/2) ln(1 + R²/l²), R the longest such
/// line. Positive throughout. From the edge alone, a = 0, it is (1 + cos φ)/2.
/// Who needs it: the page on form factors: walls of a box.
///
/// ```
/// use radiometry::{Tolerance, form_factor::{perpendicular_rectangles, wedge_rectangles}};
/// let wedge = wedge_rectangles(1.0, 2.0, 3.0, 0.0, Tolerance::FINE)?;
/// assert!((wedge.value - perpendicular_rectangles(1.0, 2.0, 3.0)?.ratio()).abs() < 1e-14);
/// # Ok::<(), radiometry::EstimateError>(())
/// ```
pub fn wedge_rectangles(
    width_from_m: f64,
    width_to_m: f64,
    edge_m: f64,
    cos_phi: f64,
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    not_negative("width_from_m", width_from_m)?;
    not_negative("width_to_m", width_to_m)?;
    not_negative("edge_m", edge_m)?;
    within("cos_phi", cos_phi, -1.0, 1.0 - f64::EPSILON / 2.0)?;
    if width_to_m == 0.0 || edge_m == 0.0 {
        return Ok(Estimate::closed(0.0, 0.0));
    }
    if width_from_m == 0.0 {
        return Ok(Estimate::closed(0.5 * (1.0 + cos_phi), 2.0));
    }
    let sin_phi = ((1.0 - cos_phi) * (1.0 + cos_phi)).sqrt();
    if sin_phi == 0.0 {
        return Ok(Estimate::closed(0.0, 0.0));
    }
    let [a, b, l] = scaled([width_from_m, width_to_m, edge_m].map(|length| length / 4.0));
    let phi = libm::atan2(sin_phi, cos_phi);
    // Lines that end at the far edge of a, and those that end at the far edge of b: π - φ together.
    let ends = [
        libm::atan2(b * sin_phi, (-b).mul_add(cos_phi, a)),
        libm::atan2(a * sin_phi, (-a).mul_add(cos_phi, b)),
    ];
    let lines = |place: f64| {
        let (width, beta_max, other, fraction) = if place < 1.0 {
            (a, ends[0], ends[1], place)
        } else {
            (b, ends[1], ends[0], place - 1.0)
        };
        let beta = beta_max * fraction;
        // sin(φ + β) by the angle or its supplement, a sum of positive terms either way.
        let turned = phi + beta;
        let acute = if turned < FRAC_PI_2 { turned } else { other + beta_max * (1.0 - fraction) };
        let sin = libm::sin(acute);
        let longest = width * sin_phi / sin;
        let value = beta_max * libm::sin(beta) * sin * lines_along(longest, l);
        (value, ROUNDINGS * value.abs())
    };
    let scale = 1.0 / (PI * a * sin_phi);
    let wanted = tolerance.before_factor(scale);
    integrated(adaptive_noisy(lines, &[0.0, 1.0, 2.0], wanted), 0.0, scale, tolerance)
}

/// Q(R) = ∫ atan(l/r) dr from 0 to R.
fn lines_along(longest: f64, edge: f64) -> f64 {
    let ratio = longest / edge;
    longest * libm::atan2(edge, longest) + 0.5 * edge * libm::log1p(ratio * ratio)
}

/// Finite, and not falling.
fn interval(argument: &'static str, ends: [f64; 2]) -> Result<(), DomainError> {
    let from = finite(argument, ends[0])?;
    within(argument, ends[1], from, f64::MAX).map(|_| ())
}

/// A length to divide by; what has none is not divided by it.
fn or_one(length: f64) -> f64 {
    if length == 0.0 { 1.0 } else { length }
}
