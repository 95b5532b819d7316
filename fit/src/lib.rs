//! Samples of radiance along rays to the field L(x, y, θ, φ) that they are samples of, with its
//! uncertainty. Knows no rig, no counts, no file and no clock.
//!
//! The field is a sum of functions of the direction ([`Angular`]: Zernike polynomials on the Nusselt
//! disk, harmonics, splines) times functions of the position over the region ([`Position`]).
//! The coefficients come from weighted least squares by a streamed orthogonal factorisation
//! ([`triangle`]): memory grows with the coefficients, never with the readings. Roughness may be held
//! against the field ([`Penalty`]); [`choose`] finds basis and penalty from the samples by leaving
//! out whole sweeps.
//!
//! What is independent from reading to reading ([`Noise`]) makes the weights. What all readings
//! share ([`Common`]: a responsivity, a dark level, an axis zero) makes none; it is carried through
//! the fit with its correlations and kept apart in every result ([`Estimate::u_independent`]).
//!
//! A reading stands for the mean of the field over the detector's beam, zero off the sample
//! ([`fit_seen`]), or where no beam is known for the radiance along one ray ([`fit`](fn@fit)). In
//! directions that were not measured the functions extrapolate, and u grows as it must.
//!
//! ```
//! use fit::{BasisSpec, Common, Noise, Ray, Region, Sample, Shift};
//! use std::f64::consts::PI;
//!
//! // A Lambertian source of 100 W·m⁻²·sr⁻¹, seen in 24 directions.
//! let ray = |i: u32| Ray {
//!     x_m: 0.0,
//!     y_m: 0.0,
//!     theta_rad: f64::from(i % 8) * 0.2,
//!     phi_rad: f64::from(i / 8) * 2.1,
//! };
//! let noise = Noise::Fixed { variance: 0.01 };
//! let samples: Vec<Sample> =
//!     (0..24).map(|i| Sample { ray: ray(i), value: 100.0, noise }).collect();
//! let region = Region::surface((-0.01, 0.01), (-0.01, 0.01), 1.4);
//! let basis = BasisSpec::zernike(2, 0);
//! let responsivity = Common { name: "responsivity".into(), u: 0.02, shift: Shift::Scale };
//!
//! let field = fit::fit(&samples, &region, basis, &[responsivity])?;
//! let exitance = field.exitance();
//! assert!((exitance.value - 100.0 * PI).abs() < 1e-11);
//! assert!(exitance.u > 2.0 * PI && exitance.u_independent < 0.2); // 2 % of 100 π, and the noise
//! assert!((field.flux().value - 100.0 * PI * 4e-4).abs() < 1e-15);
//! # Ok::<(), fit::FitError>(())
//! ```

pub use basis::{Angular, Around, BasisSpec, Fine, Position};
pub use beam::design::BeamRows;
pub use beam::{Optics, Outline};
pub use chart::{Chart, Face};
pub use choice::{
    AngularKind, Candidate, Choice, Chosen, Gleaning, Spans, SweepKind, Wish, WishClash, choose,
    choose_flown,
};
pub use coverage::Coverage;
pub use error::FitError;
pub use estimate::{Contribution, EXTRAPOLATION, Estimate, TRUNCATION};
pub use fitted::Fit;
pub use functional::Functional;
pub use influence::Influence;
pub use nonnegative::Nonnegative;
pub use parts::{CommonShift, Parts, Quality};
pub use peak::Peak;
pub use penalty::{Penalised, Penalty};
pub use pointing::Pointing;
pub use predict::{FittedField, Predicted, predict};
pub use readings::{Fitted as FittedNuisance, Readings, Weighed};
pub use resolves::{Limit, Resolves, Width};
pub use robust::Robust;
pub use rules::{Ruled, Rules, fit_known, fit_ruled, fit_valued, fit_wished};
pub use sample::{Noise, Ray, Region, Sample};
pub use shift::{Common, RayShift, Shift, ValueShift};
pub use solve::{fit, fit_flown, fit_readings, fit_seen};
pub use symmetry::{Symmetry, SymmetryError, SymmetryTest};
pub use truncation::{Truncation, Uneven};
pub use undetermined::Cause;

mod basis;
mod beam;
pub mod blocks;
mod chart;
mod check;
mod choice;
mod coverage;
pub mod derive;
mod error;
mod estimate;
mod excess;
mod extrapolation;
mod field;
mod fitted;
mod functional;
mod grid;
mod influence;
pub mod kriging;
mod limit;
mod measured;
mod nonnegative;
mod nuisance;
pub mod partial;
mod parts;
mod peak;
mod penalty;
mod pointing;
mod poses;
mod predict;
mod readings;
pub mod regression;
mod resolves;
mod robust;
mod rules;
mod sample;
#[cfg(test)]
mod scattered;
mod shift;
mod solve;
mod sparse;
mod spectral;
mod stored;
mod symmetry;
pub mod trials;
pub mod triangle;
mod truncation;
mod undetermined;
mod weights;
mod whereabouts;
