//! Why bytes are no grey image.

use core::fmt;

use super::PIXELS_MAX;

/// Why bytes are no grey image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NetpbmError {
    /// Three values a pixel.
    Colour,
    /// No pixels.
    Empty {
        /// As written.
        width: usize,
        /// As written.
        height: usize,
    },
    /// The greatest value of a PGM is not from 1 to 65535.
    Greatest(usize),
    /// Bytes behind the last pixel.
    Long {
        /// Pixels.
        expected: usize,
    },
    /// It does not begin as such a file does.
    Magic,
    /// A number of the head, or a pixel in text, is none.
    Number {
        /// Which.
        what: &'static str,
        /// Where it stands, counted from 0.
        byte: usize,
    },
    /// A pixel that is negative, not finite or above the greatest value.
    Pixel {
        /// Counted from 0 at the top left, row by row.
        pixel: usize,
        /// As it stands there.
        value: f64,
    },
    /// A PFM's scale of 0, which has no byte order.
    Scale,
    /// The file is cut short.
    Short {
        /// Whole pixels.
        found: usize,
        /// Pixels.
        expected: usize,
    },
    /// More pixels than [`PIXELS_MAX`].
    TooLarge {
        /// As written.
        width: usize,
        /// As written.
        height: usize,
    },
}

impl fmt::Display for NetpbmError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Colour => f.write_str("a colour image, expected a grey one (P2, P5 or Pf)"),
            Self::Empty { width, height } => {
                write!(f, "{width} x {height} pixels, expected at least one")
            }
            Self::Greatest(value) => {
                write!(f, "the greatest value is {value}, expected 1 to 65535")
            }
            Self::Long { expected } => {
                write!(f, "the file goes on behind the image: more than its {expected} pixels")
            }
            Self::Magic => f.write_str("no grey Netpbm image: expected to begin with P2, P5 or Pf"),
            Self::Number { what, byte } => {
                write!(f, "byte {byte}: expected {what}, a number of at most 12 digits")
            }
            Self::Pixel { pixel, value } => write!(
                f,
                "pixel {pixel} (from 0 at the top left) is {value}, expected at least 0 and not \
                 above the greatest value"
            ),
            Self::Scale => f.write_str("the scale is 0, expected its sign to tell the byte order"),
            Self::Short { found, expected } => {
                write!(f, "the file is cut short: {found} of {expected} pixels")
            }
            Self::TooLarge { width, height } => {
                write!(f, "{width} x {height} pixels, expected at most {PIXELS_MAX}")
            }
        }
    }
}

impl core::error::Error for NetpbmError {}
