//! Bases in which a radiance field is written: Zernike polynomials over the hemisphere, Legendre
//! polynomials over an interval. They know nothing of samples or of fitting.

mod jacobi;
pub mod legendre;
pub mod zernike;

pub use legendre::Legendre;
pub use zernike::Zernike;
