//! Form factors of pairs of finite diffuse surfaces, F₁₂: the part of the flux leaving 1 that reaches 2
//! directly. The reference families in closed form or as a one-dimensional integral of a positive
//! function, any two flat polygons by a boundary integral, past occluders by cubature of what each point
//! sees. Reciprocity: A₁F₁₂ = A₂F₂₁.
//!
//! Howell's catalog (*A Catalog of Radiation Heat Transfer Configuration Factors*) numbers the
//! families C-1 and so on. Its closed forms cancel by the square to the fourth power of gap over size;
//! the forms here do not, or give way to an integral that does not where they do.
//!
//! Who needs them: the page on form factors, and the person at the rig for baffles, enclosures and
//! stray light. (The detector's beam is next door, in `throughput`.)

mod contour;
mod contour_wide;
mod events;
mod legs;
mod long;
mod occluded;
mod overlap;
mod pairs;
mod parts;
mod polygons;
mod rectangles;
mod rim;
mod round;
mod sight;

pub use long::{parallel_cylinders, strips};
pub(crate) use occluded::between_fronts;
pub use occluded::polygons_occluded;
pub use polygons::{polygons, throughput_of_polygons};
pub use rectangles::{
    aligned_rectangles, parallel_rectangles, perpendicular_offset_rectangles,
    perpendicular_rectangles, wedge_rectangles,
};
pub use round::{coaxial_disks, concentric_spheres, parallel_disks, sphere_disk, spheres};

use crate::domain::DomainError;
use crate::estimate::{Estimate, EstimateError, Tolerance};
use crate::quantity::FormFactor;

/// Lengths so far from each other in size that their squares leave the doubles' range.
const UNLIKE_SIZES: DomainError = DomainError::Placing {
    argument: "the pair of surfaces",
    expected: "lengths within 150 powers of ten of each other",
};

/// The least length, in units of the largest, whose square has digits.
const LEAST_SQUARED: f64 = 1e-150;

/// A form factor whose last rounding may have left [0, 1].
fn form_factor(ratio: f64) -> Result<FormFactor, DomainError> {
    if ratio.is_nan() {
        return Err(UNLIKE_SIZES);
    }
    Ok(FormFactor::from_ratio(ratio.clamp(0.0, 1.0)))
}

/// The same for one that was integrated, `scale` times a part known in closed form and an integral. The
/// scale's own roundings count: a handful of products under it and one with it.
fn integrated(
    integral: Result<Estimate, EstimateError>,
    known: f64,
    scale: f64,
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    let integral = match integral {
        Ok(estimate) | Err(EstimateError::Unmet { estimate, .. }) => estimate,
        Err(error) => return Err(error),
    };
    let known = Estimate::closed(known, 8.0);
    let factor = Estimate {
        value: known.value + integral.value,
        error_bound: known.error_bound + integral.error_bound,
        ..integral
    }
    .scaled(scale);
    let factor = Estimate {
        error_bound: 4.0f64.mul_add(f64::EPSILON * factor.value.abs(), factor.error_bound),
        ..factor
    };
    if factor.value.is_nan() {
        return Err(UNLIKE_SIZES.into());
    }
    factor.clamped(0.0, 1.0).within(tolerance)
}

/// Lengths in a unit that is a power of two, the largest in [1, 2): no square overflows, no digit
/// changes. A form factor has no unit to lose.
fn scaled<const N: usize>(lengths: [f64; N]) -> [f64; N] {
    let largest = lengths.into_iter().map(f64::abs).fold(0.0, f64::max);
    if largest == 0.0 {
        return lengths;
    }
    let exponent = libm::ilogb(largest);
    lengths.map(|length| libm::scalbn(length, -exponent))
}
