//! Bases in which a radiance field is written: Zernike polynomials over the hemisphere, spherical
//! harmonics over the sphere, Legendre polynomials over an interval, B-splines over an interval or
//! round a circle. They know nothing of samples or of fitting.

mod active;
pub mod bspline;
pub mod harmonics;
mod jacobi;
pub mod legendre;
mod pieces;
pub mod zernike;

pub use active::{Active, DEGREE_MAX};
pub use bspline::BSpline;
pub use harmonics::{HemisphericalHarmonics, SphericalHarmonics};
pub use legendre::{Legendre, LegendreProducts};
pub use zernike::Zernike;
