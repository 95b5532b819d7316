//! Light from everywhere: radiance L(θ, φ) around a point as a grid of pixels, each uniform, and the
//! irradiance that it causes on a receiver with any normal. It does not know how a map was taken, nor
//! what stands in the way of its light.
//!
//! A direction points from the receiver towards the light. θ is counted from +z, φ from +x towards +y,
//! as everywhere. For lit samples in the simulator, and the lecture's page on environment maps: the
//! two-dimensional chart (θ, φ) with dΩ̃ = cos θ dω at a point.

mod contour;
mod equal_area;
mod folded;
mod horizon;
mod lat_long;

use core::fmt;

use crate::domain::DomainError;
use crate::quantity::{Radiance, Weighting};

pub use equal_area::EqualArea;
pub use lat_long::LatLong;

/// Pixels that a map may have: more is taken for a mistake.
const PIXELS_MAX: usize = 1 << 26;

/// Why a grid of pixels is no map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EnvironmentError {
    /// No rows or no columns, or more pixels than 2²⁶.
    Size {
        /// As given.
        rows: usize,
        /// As given.
        columns: usize,
    },
    /// An equal-area map's side that no axis halves.
    Odd {
        /// In pixels.
        side: usize,
    },
    /// Another number of radiances than pixels.
    Count {
        /// How many were given.
        found: usize,
        /// Rows times columns.
        expected: usize,
    },
    /// A radiance that is none.
    Pixel {
        /// From the first pixel, 0, row after row.
        index: usize,
        /// What is wrong with it.
        error: DomainError,
    },
}

impl fmt::Display for EnvironmentError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size { rows, columns } => write!(
                f,
                "the map has {rows} rows and {columns} columns, expected 1 or more and at most \
                 {PIXELS_MAX} pixels"
            ),
            Self::Odd { side } => {
                write!(f, "the map has {side} pixels on a side, expected an even number")
            }
            Self::Count { found, expected } => {
                write!(f, "the map has {found} radiances, expected {expected}, one for each pixel")
            }
            Self::Pixel { index, error } => write!(f, "pixel {index}: {error}"),
        }
    }
}

impl core::error::Error for EnvironmentError {}

/// The numbers, if there is one for each pixel and each is a radiance.
fn checked<W: Weighting>(
    rows: usize,
    columns: usize,
    radiance: &[Radiance<W>],
) -> Result<Vec<f64>, EnvironmentError> {
    let size = EnvironmentError::Size { rows, columns };
    let expected =
        rows.checked_mul(columns).filter(|n| (1..=PIXELS_MAX).contains(n)).ok_or(size)?;
    if radiance.len() != expected {
        return Err(EnvironmentError::Count { found: radiance.len(), expected });
    }
    let number = |(index, radiance): (usize, &Radiance<W>)| {
        crate::domain::not_negative("radiance", radiance.amount())
            .map_err(|error| EnvironmentError::Pixel { index, error })
    };
    radiance.iter().enumerate().map(number).collect()
}
