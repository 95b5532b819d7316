//! Clear media whose index varies continuously: rays curve, and L/n² stays along each of them.
//!
//! Two ways: layers (plane or spherical), where an invariant gives the path as an integral
//! ([`Stratified`]); and any field of index, where the ray equation d/ds(n dr/ds) = ∇n is
//! integrated ([`trace`](fn@trace)). Both know rays only: no wavelength, no absorption, no partial
//! reflection, which a smooth index does not cause as long as it varies little over a wavelength.
//! Indices below 1 are refused, as clear media for light have none.
//!
//! Who needs it: the page of the subject on radiance along curved rays (mirage, atmosphere, gradient
//! lenses); the simulator for air whose index is not the same everywhere.

mod course;
mod profile;
mod steps;
mod stratified;
mod trace;

use crate::domain::{DomainError, within};
use crate::quantity::Radiance;

pub use profile::{ExponentialProfile, IndexProfile, LinearProfile};
pub use stratified::{Leg, Stratified, StratifiedRay};
pub use trace::{IndexField, Stop, TraceError, Traced, trace};

/// Beyond this a medium is opaque or not a medium.
const INDEX_MAX: f64 = 1e3;

fn checked_index(index: f64) -> Result<f64, DomainError> {
    within("n", index, 1.0, INDEX_MAX)
}

/// Basic radiance L/n², W·m⁻²·sr⁻¹: what a ray carries unchanged through every lossless medium and
/// interface (Nicodemus 1963; Clausius 1864 for black-body light). n in 1 to 1000.
/// Who needs it: the page on the n² law.
///
/// ```
/// use radiometry::interface::basic_radiance;
/// use radiometry::quantity::Radiance;
/// let in_glass = Radiance::from_w_per_m2_sr(9.0);
/// assert_eq!(basic_radiance(in_glass, 1.5)?, Radiance::from_w_per_m2_sr(4.0));
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn basic_radiance(radiance: Radiance, index: f64) -> Result<Radiance, DomainError> {
    let index = checked_index(index)?;
    Ok(radiance / (index * index))
}

/// The other way: n² times the basic radiance, which is what a detector within the medium would
/// measure.
/// Who needs it: the page on the n² law.
///
/// ```
/// use radiometry::interface::radiance_in_medium;
/// use radiometry::quantity::Radiance;
/// let basic = Radiance::from_w_per_m2_sr(4.0);
/// assert_eq!(radiance_in_medium(basic, 1.5)?, Radiance::from_w_per_m2_sr(9.0));
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn radiance_in_medium(basic: Radiance, index: f64) -> Result<Radiance, DomainError> {
    let index = checked_index(index)?;
    Ok(basic * (index * index))
}
