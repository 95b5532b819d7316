//! Form factors of disks and spheres.

use core::f64::consts::{FRAC_PI_2, PI};

use super::{form_factor, integrated, scaled};
use crate::domain::{DomainError, not_negative, positive, within};
use crate::estimate::{Estimate, EstimateError, Tolerance};
use crate::quadrature::adaptive_between;
use crate::quantity::FormFactor;
use crate::solid_angle;
use crate::throughput::CoaxialDisks;
use crate::transcendental::less_its_sine;

/// From disk 1 to disk 2, parallel and on one axis (Howell C-41); see
/// [`CoaxialDisks::form_factor`]. A disk 1 of no radius is a point that looks along the axis.
/// Who needs it: the page on form factors: stops that face each other.
///
/// ```
/// let factor = radiometry::form_factor::coaxial_disks(1.0, 1.0, 1.0)?;
/// assert!((factor.ratio() - (3.0 - 5.0_f64.sqrt()) / 2.0).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn coaxial_disks(
    radius_1_m: f64,
    radius_2_m: f64,
    distance_m: f64,
) -> Result<FormFactor, DomainError> {
    Ok(CoaxialDisks::new(radius_1_m, radius_2_m, distance_m)?.form_factor())
}

/// From disk 1 to disk 2 in parallel planes, the axes apart by an offset. Integral over the distance ρ
/// from axis 2 of the factor of a point of disk 1, 2 r₂²h²/(B(B+A)) / 2 with A = h² + ρ² - r₂² and B
/// the product of the slants to the nearest and the farthest rim point, over the arcs that disk 1
/// has at ρ: positive throughout. A disk 1 of no radius is a point that looks along its axis.
/// Who needs it: the page on form factors: stops that are misaligned.
///
/// ```
/// use radiometry::{Tolerance, form_factor::{coaxial_disks, parallel_disks}};
/// let aligned = parallel_disks(1.0, 2.0, 0.5, 0.0, Tolerance::FINE)?;
/// let closed = coaxial_disks(1.0, 2.0, 0.5)?.ratio();
/// assert!((aligned.value - closed).abs() < 1e-14);
/// # Ok::<(), radiometry::EstimateError>(())
/// ```
pub fn parallel_disks(
    radius_1_m: f64,
    radius_2_m: f64,
    distance_m: f64,
    offset_m: f64,
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    not_negative("radius_1_m", radius_1_m)?;
    not_negative("radius_2_m", radius_2_m)?;
    positive("distance_m", distance_m)?;
    not_negative("offset_m", offset_m)?;
    let [radius_1, radius_2, distance, offset] =
        scaled([radius_1_m, radius_2_m, distance_m, offset_m].map(|length| length / 4.0));
    if radius_1 == 0.0 || radius_2 == 0.0 {
        let at_point = form_factor(disk_from_point(offset, radius_2, distance))?.ratio();
        return Ok(Estimate::closed(at_point, 16.0));
    }
    // The larger the disk that is looked at as a whole, the smoother the rest: by reciprocity.
    if radius_1 > radius_2 {
        let ratio = radius_2 / radius_1;
        let there = disk_average(radius_2, radius_1, distance, offset, tolerance)?;
        return Ok(there.scaled(ratio * ratio));
    }
    disk_average(radius_1, radius_2, distance, offset, tolerance)
}

/// The mean over disk 1 of the factor of its points to disk 2. Whole circles about axis 2 make a
/// coaxial disk; over the arcs, ρ = low + (high - low) sin²(τ/2), which takes up the square roots at
/// their ends.
fn disk_average(
    radius_1: f64,
    radius_2: f64,
    distance: f64,
    offset: f64,
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    let whole = (radius_1 - offset).max(0.0);
    let inner = if whole > 0.0 {
        whole * whole * CoaxialDisks::new(whole, radius_2, distance)?.form_factor().ratio()
    } else {
        0.0
    };
    let low = (offset - radius_1).abs();
    let span = 2.0 * offset.min(radius_1);
    let arcs = |tau: f64| {
        let (sin, cos) = (libm::sin(0.5 * tau), libm::cos(0.5 * tau));
        let (from_low, from_high) = (span * sin * sin, span * cos * cos);
        let rho = low + from_low;
        // Half angle ψ of the arc: tan²(ψ/2) = (r₁² - (ρ-o)²)/((ρ+o)² - r₁²).
        let beyond = from_low + 2.0 * low;
        let (top, bottom) = if offset < radius_1 { (beyond, from_low) } else { (from_low, beyond) };
        let half_angle = 2.0
            * libm::atan2((from_high * top).sqrt(), (bottom * (rho + offset + radius_1)).sqrt());
        2.0 * half_angle * rho * span * sin * cos * disk_from_point(rho, radius_2, distance)
    };
    let radius_2_at = ((radius_2 - low) / span).clamp(0.0, 1.0);
    let kink = 2.0 * libm::asin(radius_2_at.sqrt());
    let scale = 1.0 / (PI * radius_1 * radius_1);
    let wanted = tolerance.before_factor(scale);
    let outer = if span > 0.0 {
        adaptive_between(arcs, &[0.0, kink, PI], wanted)
    } else {
        Ok(Estimate::closed(0.0, 0.0))
    };
    integrated(outer, inner * PI, scale, tolerance)
}

/// The factor of a point at ρ from the axis of a parallel disk: (1 - A/B)/2 with
/// A = h² + ρ² - r², B² - A² = 4r²h².
fn disk_from_point(rho: f64, radius: f64, distance: f64) -> f64 {
    let b = libm::hypot(distance, rho - radius) * libm::hypot(distance, rho + radius);
    let a = distance.mul_add(distance, (rho - radius) * (rho + radius));
    if a > 0.0 {
        2.0 * radius * radius * (distance / b) * (distance / (b + a))
    } else {
        0.5 * (1.0 - a / b)
    }
}

/// From a sphere to a disk whose axis goes through the sphere's centre, that at the distance h >= r₁
/// from the disk (Howell C-44 kind): r₂²/(2s(s + h)), s = √(h² + r₂²), whatever the sphere's radius,
/// 0 included.
/// Who needs it: the page on form factors: a bulb over a stop.
///
/// ```
/// // The half space: ½ for a huge disk.
/// let factor = radiometry::form_factor::sphere_disk(1.0, 2.0, 1e12)?;
/// assert!((factor.ratio() - 0.5).abs() < 1e-11);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn sphere_disk(
    sphere_radius_m: f64,
    distance_m: f64,
    disk_radius_m: f64,
) -> Result<FormFactor, DomainError> {
    not_negative("sphere_radius_m", sphere_radius_m)?;
    within("distance_m", distance_m, sphere_radius_m, f64::MAX)?;
    if not_negative("disk_radius_m", disk_radius_m)? == 0.0 {
        return Ok(FormFactor::ZERO);
    }
    let [distance, radius] = scaled([distance_m / 4.0, disk_radius_m / 4.0]);
    let slant = libm::hypot(distance, radius);
    form_factor(0.5 * (radius / slant) * (radius / (slant + distance)))
}

/// From the outer of two concentric spheres to the inner: (r₁/r₂)², r₁ <= r₂. What is left of 1
/// meets the outer sphere itself.
/// Who needs it: the page on form factors: a source in an integrating sphere.
///
/// ```
/// assert_eq!(radiometry::form_factor::concentric_spheres(1.0, 2.0)?.ratio(), 0.25);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn concentric_spheres(
    inner_radius_m: f64,
    outer_radius_m: f64,
) -> Result<FormFactor, DomainError> {
    positive("outer_radius_m", outer_radius_m)?;
    let ratio = within("inner_radius_m", inner_radius_m, 0.0, outer_radius_m)? / outer_radius_m;
    form_factor(ratio * ratio)
}

/// From sphere 1 to sphere 2, apart or in contact. There is no elementary form. By Crofton's measure of
/// lines: A₁F₁₂ = 2 ∫ sin γ S(d sin γ) dγ, S the area that the shadows of both spheres share along
/// the directions at γ to the line of centres; positive throughout. From a sphere of no radius it is
/// the part of all directions that sphere 2 takes up.
/// Who needs it: the page on form factors.
///
/// ```
/// use radiometry::{Tolerance, form_factor::spheres};
/// // A small sphere sees the large one under sin² of half its half angle.
/// let factor = spheres(1e-6, 1.0, 2.0, Tolerance::FINE)?;
/// assert!((factor.value - (std::f64::consts::PI / 12.0).sin().powi(2)).abs() < 1e-12);
/// # Ok::<(), radiometry::EstimateError>(())
/// ```
pub fn spheres(
    radius_1_m: f64,
    radius_2_m: f64,
    center_distance_m: f64,
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    not_negative("radius_1_m", radius_1_m)?;
    not_negative("radius_2_m", radius_2_m)?;
    within("center_distance_m", center_distance_m, radius_1_m + radius_2_m, f64::MAX)?;
    if radius_1_m == 0.0 || radius_2_m == 0.0 {
        let taken_up = solid_angle::sphere(radius_2_m, center_distance_m)?.sr() / (4.0 * PI);
        return Ok(Estimate::closed(form_factor(taken_up)?.ratio(), 16.0));
    }
    let [radius_1, radius_2, distance] =
        scaled([radius_1_m, radius_2_m, center_distance_m].map(|length| length / 4.0));
    let (sum, difference) = (radius_1 + radius_2, (radius_1 - radius_2).abs());
    // γ₁: the shadows touch from outside; γ₀: from inside. Cosines by the distance.
    let cos_1 = ((distance - sum).max(0.0) * (distance + sum)).sqrt();
    let cos_0 = ((distance - difference) * (distance + difference)).sqrt();
    let gamma_0 = libm::atan2(difference, cos_0);
    let span = libm::atan2(
        4.0 * radius_1 * radius_2 * distance * (distance / (sum * cos_0 + difference * cos_1)),
        cos_0 * cos_1 + sum * difference,
    );
    let smaller = radius_1.min(radius_2);
    let half = libm::sin(0.5 * gamma_0);
    let eclipsed = 2.0 * PI * half * half * smaller * smaller;
    let shared = |tau: f64| {
        let (sin, cos) = (libm::sin(0.5 * tau), libm::cos(0.5 * tau));
        let (from_0, from_1) = (0.5 * span * sin * sin, 0.5 * span * cos * cos);
        let below = libm::sin(from_1);
        let rim = 2.0 * below * (cos_1 * libm::cos(from_1) + sum * below);
        let above = libm::sin(from_0);
        let inner = 2.0 * above * (cos_0 * libm::cos(from_0) - difference * above);
        let lens = lens(radius_1, radius_2, difference + inner, rim.max(0.0), inner.max(0.0));
        libm::sin(gamma_0 + 2.0 * from_0) * lens * span * sin * cos
    };
    let scale = 1.0 / (2.0 * PI * radius_1 * radius_1);
    let wanted = tolerance.before_factor(scale);
    let shared = adaptive_between(shared, &[0.0, FRAC_PI_2, PI], wanted);
    integrated(shared, eclipsed, scale, tolerance)
}

/// Area shared by two disks whose centres are ρ apart: both segments. `rim` = r₁ + r₂ - ρ and
/// `inner` = ρ - |r₁ - r₂| are handed in, since their digits cannot be had from ρ.
fn lens(radius_1: f64, radius_2: f64, rho: f64, rim: f64, inner: f64) -> f64 {
    let difference = (radius_1 - radius_2).abs();
    let beyond = inner + 2.0 * difference;
    let segment = |radius: f64, smaller: bool| {
        // tan²(φ/2) = (R² - (ρ-r)²)/((ρ+r)² - R²), R the other radius.
        let (top, bottom) = if smaller { (beyond, inner) } else { (inner, beyond) };
        let half = libm::atan2((rim * top).sqrt(), (bottom * (rho + radius_1 + radius_2)).sqrt());
        radius * radius * 0.5 * less_its_sine(4.0 * half)
    };
    segment(radius_1, radius_1 <= radius_2) + segment(radius_2, radius_1 > radius_2)
}
