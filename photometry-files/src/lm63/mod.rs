//! IES LM-63, the photometric file of North America: luminous (or radiant) intensity over
//! directions (C, γ), with the size of the luminous opening.
//!
//! Written after ANSI/IES LM-63-2002 and LM-63-2019, and for older files after the 1986, 1991 and
//! 1995 editions where they differ (signs of the opening, the ballast-lamp factor). Only type C
//! photometry is read; a file of type A or B is refused by that name.
//!
//! # Directions
//! γ is counted from the photometric zero, the luminaire's downward vertical; C counter-clockwise
//! about the vertical *as seen from above*, from the photometric horizontal C = 0. Seen from above
//! is seen along the emission. In a frame whose +z is the emission, φ from +x towards +y turns
//! clockwise for who looks along +z; so C = -φ modulo 360°, if +x is C = 0. Nothing here applies
//! that: directions stay (C, γ).
//!
//! # Dimensions
//! The opening's *length* lies along C0-C180 and its *width* along C90-C270, although the file gives
//! the width first ([`Opening::outline`] is the one place that says so). EULUMDAT does it the other
//! way round.

mod error;
mod label;
mod note;
mod numbers;
mod opening;
mod photometry;
mod read;

pub use error::{Lm63Error, Problem};
pub use label::{IntensityUnit, Keyword, Version};
pub use note::Note;
pub use opening::{Opening, Outline, OutlineError};
pub use photometry::{Photometry, Symmetry, Tilt};
pub use read::read;
