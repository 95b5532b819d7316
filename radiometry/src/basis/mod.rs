//! Bases in which a radiance field is written: Zernike polynomials over the hemisphere, spherical
//! harmonics over the sphere, Legendre polynomials over an interval. They know nothing of samples or of fitting.

pub mod harmonics;
mod jacobi;
pub mod legendre;
pub mod zernike;

pub use harmonics::{HemisphericalHarmonics, SphericalHarmonics};
pub use legendre::Legendre;
pub use zernike::Zernike;
