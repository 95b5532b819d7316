//! Form factors of rectangles: in parallel planes, at right angles, and with a common edge at any angle.
//!
//! Where two sides run along one axis, a pair of points counts by its difference v alone, so many times
//! as the overlap of one side with the other shifted by v; what is left is a one-dimensional integral
//! over v of a positive function.

use core::f64::consts::{FRAC_PI_2, PI};
use std::sync::OnceLock;

use super::{form_factor, integrated, scaled};
use crate::domain::{DomainError, finite, not_negative, positive, within};
use crate::estimate::{Estimate, EstimateError, Tolerance};
use crate::quadrature::{Sum, adaptive_between, adaptive_noisy, gauss_legendre};
use crate::quantity::FormFactor;

/// Sums whose terms are larger than this times the sum give way to a positive integral.
const CANCELLATION_MAX: f64 = 30.0;

/// Of a stretch: what peaks more narrowly than this takes more panels than an adaptive rule.
const FINEST: f64 = 1e-7;

/// Of an integrand that is a product of a dozen positive factors and sums.
const ROUNDINGS: f64 = 12.0 * f64::EPSILON;

/// What the integral that stands in for a closed form is asked for.
fn kernel() -> Tolerance {
    Tolerance::FINE.tightened(0.2)
}

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
/// C-13): the sum of 16 corner terms, or where they cancel the integral over v = η - y.
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
    let along_x = Overlap::new([x1, x2], [xi1, xi2]);
    let along_y = Overlap::new([y1, y2], [eta1, eta2]);
    let area = (x2 - x1) * (y2 - y1);
    if let Some(corners) = along_x.corner_sum(&along_y, z) {
        return Ok(form_factor(corners / (2.0 * PI * area))?);
    }
    let integral = if along_x.resolves(z) && along_y.resolves(z) {
        along_y.graded(
            |v| {
                along_x
                    .between_strips(v, z, |f, rho| Ok(along_x.graded(f, rho, None)))
                    .unwrap_or(f64::NAN)
            },
            z,
            None,
        )
    } else {
        let adaptive = |f: &dyn Fn(f64) -> f64, _| Ok(along_x.integrate(f, kernel())?.value);
        let across = |v: f64| along_x.between_strips(v, z, adaptive).unwrap_or(f64::NAN);
        along_y.integrate(across, kernel())?.value
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
/// ln(1 + (x₂²-x₁²)(z₂²-z₁²)/((x₁²+z₁²+v²)(x₂²+z₂²+v²)))/4π, as often as v occurs.
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
    let floor = (x2 - x1) * (x2 + x1);
    let wall = (z2 - z1) * (z2 + z1);
    let (near, far) = (x1 * x1 + z1 * z1, x2 * x2 + z2 * z2);
    let rays = |v: f64| {
        let nearest = v.mul_add(v, near).max(f64::MIN_POSITIVE);
        libm::log1p(floor / nearest * (wall / v.mul_add(v, far)))
    };
    let overlap = Overlap::new([y1, y2], [eta1, eta2]);
    let integral = if x1 > 0.0 || z1 > 0.0 {
        overlap.graded(rays, libm::hypot(x1, z1), None)
    } else {
        // With a common edge the integrand is -2 ln v but for what is smooth up to the widths.
        let reach = 0.5 * x2.min(z2);
        let (widest, across) = (x2.max(z2), libm::hypot(x2, z2));
        let rest = |v: f64| {
            let (part, slope) = (v / reach, 2.0 * widest / libm::hypot(v, across));
            libm::log(part.mul_add(part, slope * slope))
        };
        overlap.graded(rays, 0.0, Some(Edge { reach, rest: &rest }))
    };
    Ok(form_factor(integral / (4.0 * PI * (x2 - x1) * (y2 - y1)))?)
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

/// An integrand that is -2 ln(|v|/reach) + rest(v) near 0, its rest smooth up to twice the reach.
struct Edge<'a> {
    reach: f64,
    rest: &'a dyn Fn(f64) -> f64,
}

impl Edge<'_> {
    /// From 0 to that fraction of a stretch, which is no more than the reach.
    fn add(&self, stretch: &Stretch, fraction: f64, sum: &mut Sum) {
        let length = stretch.reach.abs() * fraction;
        // ∫ -2 ln t dt = 2, ∫ -2 t ln t dt = 1/2, and the logarithm of the reach in lengths.
        let step = stretch.weight_step * fraction;
        let beyond = 2.0 * libm::log(self.reach / length);
        sum.add(length * (2.0 * stretch.weight_near + 0.5 * step));
        sum.add(length * beyond * (stretch.weight_near + 0.5 * step));
        for (node, weight) in panel() {
            let level = stretch.weight_near + step * node;
            sum.add(length * weight * level * (self.rest)(length * node));
        }
    }
}

/// Twelve Gauss nodes and weights on [0, 1].
fn panel() -> &'static [(f64, f64)] {
    static RULE: OnceLock<Vec<(f64, f64)>> = OnceLock::new();
    RULE.get_or_init(|| {
        let onto_unit = |(node, weight)| (f64::midpoint(1.0, node), 0.5 * weight);
        gauss_legendre(12).into_iter().map(onto_unit).collect()
    })
}

/// Finite, and rising.
fn interval(argument: &'static str, ends: [f64; 2]) -> Result<(), DomainError> {
    finite(argument, ends[0])?;
    finite(argument, ends[1])?;
    positive(argument, ends[1] - ends[0]).map(|_| ())
}

/// How often a difference v = b - a occurs between a in one interval and b in another: rising from the
/// first of four breaks to the second, level to the third, falling to the fourth.
struct Overlap {
    breaks: [f64; 4],
    level: f64,
}

/// A stretch of v: from its end nearest to 0 to the other one, and the weight at both.
struct Stretch {
    near: f64,
    reach: f64,
    weight_near: f64,
    weight_step: f64,
}

impl Overlap {
    fn new(a: [f64; 2], b: [f64; 2]) -> Self {
        let (first, second) = (b[0] - a[0], b[1] - a[1]);
        let level = (a[1] - a[0]).min(b[1] - b[0]);
        Self { breaks: [b[0] - a[1], first.min(second), first.max(second), b[1] - a[0]], level }
    }

    fn stretches(&self) -> Vec<Stretch> {
        let [start, level_start, level_end, end] = self.breaks;
        let mut stretches = Vec::with_capacity(6);
        let mut push = |near: f64, reach: f64, weight_near: f64, weight_step: f64| {
            if reach != 0.0 {
                stretches.push(Stretch { near, reach, weight_near, weight_step });
            }
        };
        for (from, reach, weight, step) in [
            (start, self.level, 0.0, self.level),
            (level_start, level_end - level_start, self.level, 0.0),
            (end - self.level, self.level, self.level, -self.level),
        ] {
            let to = from + reach;
            if from < 0.0 && to > 0.0 {
                let at_zero = weight + step * (-from / reach);
                push(0.0, from, at_zero, weight - at_zero);
                push(0.0, to, at_zero, weight + step - at_zero);
            } else if from >= 0.0 {
                push(from, reach, weight, step);
            } else {
                push(if to > -0.0 { 0.0 } else { to }, -reach, weight + step, -step);
            }
        }
        stretches
    }

    /// ∫ weight(v) f(v) dv. f may have its peak, or a logarithm, at 0: the places crowd there with
    /// the fourth power.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a place is not negative and at most the count of stretches"
    )]
    fn integrate(
        &self,
        mut integrand: impl FnMut(f64) -> f64,
        tolerance: Tolerance,
    ) -> Result<Estimate, EstimateError> {
        let stretches = self.stretches();
        let points: Vec<f64> = (0..=stretches.len()).map(|place| place as f64).collect();
        let at = |place: f64| {
            let index = (place as usize).min(stretches.len() - 1);
            let stretch = &stretches[index];
            let fraction = place - index as f64;
            let cube = fraction * fraction * fraction;
            let fourth = cube * fraction;
            let weight = stretch.weight_near + stretch.weight_step * fourth;
            let value = integrand(stretch.near + stretch.reach * fourth);
            4.0 * cube * stretch.reach.abs() * weight * value
        };
        adaptive_between(at, &points, tolerance)
    }

    /// Whether the panels find a peak of that width around 0.
    fn resolves(&self, width: f64) -> bool {
        let is_wide = |s: &Stretch| libm::hypot(s.near, width) >= FINEST * s.reach.abs();
        self.stretches().iter().all(is_wide)
    }

    /// ∫ weight(v) f(v) dv to rounding, for a positive f that is smooth but for poles or branches at
    /// ±i `scale` and beyond: Gauss panels no longer than 0.8 of the distance from there to where
    /// they begin, which twelve nodes integrate to 1e-17 (Bernstein's ellipse has semi-axes that
    /// add up to 5.5 half panels, and 5.5^-24 is left).
    fn graded(
        &self,
        mut integrand: impl FnMut(f64) -> f64,
        scale: f64,
        edge: Option<Edge<'_>>,
    ) -> f64 {
        const PANEL: f64 = 0.8;
        let mut sum = Sum::default();
        for stretch in self.stretches() {
            let length = stretch.reach.abs();
            let mut done = 0.0;
            if let Some(edge) = edge.as_ref().filter(|_| stretch.near == 0.0) {
                done = edge.reach.min(length);
                edge.add(&stretch, done / length, &mut sum);
            }
            while done < length {
                let rest = length - done;
                let from = stretch.near.abs() + done;
                let step = (PANEL * libm::hypot(from, scale))
                    .max(1e-70 * length)
                    .max(f64::MIN_POSITIVE)
                    .min(rest);
                for (node, weight) in panel() {
                    let part = (done + step * node) / length;
                    let level = stretch.weight_near + stretch.weight_step * part;
                    sum.add(step * weight * level * integrand(stretch.near + stretch.reach * part));
                }
                // The last panel ends where the stretch does, whatever the roundings.
                done = if step < rest { done + step } else { length };
            }
        }
        sum.value()
    }

    /// The corner terms of C-13, unless they cancel.
    fn corner_sum(&self, other: &Self, z: f64) -> Option<f64> {
        let (mut sum, mut size) = (Sum::default(), 0.0);
        for (i, u) in self.breaks.into_iter().enumerate() {
            for (j, v) in other.breaks.into_iter().enumerate() {
                // + at the outer breaks, - at the inner ones.
                let sign = if (i == 0 || i == 3) == (j == 0 || j == 3) { 1.0 } else { -1.0 };
                let (slant_u, slant_v) = (libm::hypot(u, z), libm::hypot(v, z));
                let ratio = (u / z) * (u / z) + (v / z) * (v / z);
                for term in [
                    u * slant_v * libm::atan2(u, slant_v),
                    v * slant_u * libm::atan2(v, slant_u),
                    -0.5 * z * z * libm::log1p(ratio),
                ] {
                    sum.add(sign * term);
                    size += term.abs();
                }
            }
        }
        let value = sum.value();
        (size < CANCELLATION_MAX * value).then_some(value)
    }

    /// ∬ z²/((ξ-x)² + v² + z²)² dξ dx.
    fn between_strips(
        &self,
        v: f64,
        z: f64,
        integrate: impl Fn(&dyn Fn(f64) -> f64, f64) -> Result<f64, EstimateError>,
    ) -> Result<f64, EstimateError> {
        let rho = libm::hypot(v, z);
        let factor = z / rho * (z / rho) / (2.0 * rho);
        let terms = self.breaks.map(|u| u * libm::atan2(u, rho));
        let sum = [terms[0], -terms[1], -terms[2], terms[3]].into_iter().collect::<Sum>().value();
        let size: f64 = terms.iter().sum();
        if size < CANCELLATION_MAX * sum {
            return Ok(factor * sum);
        }
        let kernel_at = |u: f64| {
            let ratio = z / u.mul_add(u, rho * rho);
            ratio * ratio
        };
        integrate(&kernel_at, rho)
    }
}
