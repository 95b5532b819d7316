//! Light on rays: quantities with units, directions, throughput, solid angle, bases, quadrature.
//!
//! Pure mathematics, SI and radians. It reads no clock and no file, logs nothing, rolls no dice and
//! knows neither rig nor plan. Transcendental functions come from `libm`, and everything else is
//! correctly rounded by IEEE 754, so that an answer has the same bits on every machine.
//!
//! Frame, everywhere: a surface lies in z = 0 with its outward normal +z; θ is counted from +z, φ
//! from +x towards +y.

pub mod basis;
pub mod beam;
pub mod chart;
pub mod convex;
pub mod direction;
pub mod enclosure;
pub mod environment;
pub mod form_factor;
pub mod interface;
pub mod irradiance;
pub mod moments;
pub mod projected;
pub mod quadrature;
pub mod quantity;
pub mod ray;
pub mod shape;
pub mod solid_angle;
pub mod throughput;

mod domain;
mod error_free;
mod estimate;
mod polynomial;
mod transcendental;
mod wide;

pub use domain::DomainError;
pub use estimate::{Estimate, EstimateError, Tolerance};
