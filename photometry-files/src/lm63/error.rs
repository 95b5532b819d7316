//! Why a file was refused: the line, what was expected there, what was found.

use std::fmt;

use super::label::IntensityUnit;

/// A file that was refused, and where.
#[derive(Debug, Clone, PartialEq)]
pub struct Lm63Error {
    /// Counted from 1.
    pub line: usize,
    /// What was expected and what was found.
    pub problem: Problem,
}

/// What was expected and what was found.
#[derive(Debug, Clone, PartialEq)]
pub enum Problem {
    /// The keyword and the text of the file name different units: correct the file.
    ConflictingUnits {
        /// What was said first.
        first: IntensityUnit,
        /// What was said later.
        second: IntensityUnit,
    },
    /// A control character: not a text file.
    ControlCharacter {
        /// The byte.
        byte: u8,
    },
    /// The file is over before it is complete: it was cut, or a count is too high.
    EndOfFile {
        /// What should have come next.
        expected: String,
    },
    /// A number that cannot stand there.
    Inadmissible {
        /// Which number.
        what: String,
        /// What may stand there.
        expected: &'static str,
        /// As in the file.
        found: f64,
    },
    /// The line that names the edition is not the first: remove what stands before it.
    MisplacedVersion {
        /// As in the file, shortened.
        found: String,
    },
    /// More values are announced than the rest of the file could hold.
    MoreThanTheFileHolds {
        /// Vertical angles announced.
        gammas: usize,
        /// Horizontal angles announced.
        planes: usize,
        /// Bytes from here to the end.
        bytes_left: usize,
    },
    /// Something that is no number.
    NotANumber {
        /// Which number was expected.
        what: String,
        /// As in the file, shortened.
        found: String,
    },
    /// A line before `TILT=` that is no keyword line.
    NotAKeyword {
        /// As in the file, shortened.
        found: String,
    },
    /// Angles that don't rise.
    NotRising {
        /// Which angle.
        what: String,
        /// The angle before it, degrees.
        previous: f64,
        /// As in the file, degrees.
        found: f64,
    },
    /// Photometry of type A or B: only type C is read.
    PhotometricType {
        /// The type's letter.
        letter: char,
    },
    /// The tilt factors are in another file: include them, or write `TILT=NONE`.
    TiltFile {
        /// That file's name, shortened.
        name: String,
    },
    /// More numbers or text after the last announced value: a count is too low.
    Trailing {
        /// As in the file, shortened.
        found: String,
    },
    /// Larger than any file of this kind.
    TooLarge {
        /// The file's size.
        bytes: usize,
        /// The largest that is read.
        most: usize,
    },
    /// An intensity unit that isn't known.
    UnknownUnit {
        /// As in the file, shortened.
        found: String,
    },
    /// A first line that names an edition which isn't known.
    UnknownVersion {
        /// As in the file, shortened.
        found: String,
    },
}

impl fmt::Display for Lm63Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.problem)
    }
}

impl std::error::Error for Lm63Error {}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ConflictingUnits { first, second } => {
                write!(f, "expected intensities in {first} as said before, found {second}")
            }
            Self::ControlCharacter { byte } => {
                write!(f, "expected text, found the control character 0x{byte:02x}")
            }
            Self::EndOfFile { expected } => write!(f, "expected {expected}, found the file's end"),
            Self::Inadmissible { what, expected, found } => {
                write!(f, "expected {what} to be {expected}, found {}", plain(*found))
            }
            Self::MisplacedVersion { found } => {
                write!(f, "expected the edition on line 1, found `{found}` here")
            }
            Self::MoreThanTheFileHolds { gammas, planes, bytes_left } => write!(
                f,
                "expected {gammas} vertical x {planes} horizontal angles as announced, \
                 found only {bytes_left} bytes to the file's end"
            ),
            Self::NotANumber { what, found } => write!(f, "expected {what}, found `{found}`"),
            Self::NotAKeyword { found } => {
                write!(f, "expected `[KEYWORD] text` or `TILT=`, found `{found}`")
            }
            Self::NotRising { what, previous, found } => {
                write!(f, "expected {what} above the one before it, {previous}°, found {found}°")
            }
            Self::PhotometricType { letter } => {
                write!(f, "expected type C photometry (1), found type {letter}")
            }
            Self::TiltFile { name } => write!(
                f,
                "expected `TILT=NONE` or `TILT=INCLUDE`, found tilt factors in another file, `{name}`"
            ),
            Self::Trailing { found } => {
                write!(f, "expected the file's end after the last announced value, found `{found}`")
            }
            Self::TooLarge { bytes, most } => {
                write!(f, "expected at most {most} bytes, found {bytes}")
            }
            Self::UnknownUnit { found } => {
                write!(f, "expected intensities in cd, W/sr, mW/sr or uW/sr, found `{found}`")
            }
            Self::UnknownVersion { found } => write!(
                f,
                "expected IESNA91, IESNA:LM-63-1995, IESNA:LM-63-2002 or IES:LM-63-2019, \
                 found `{found}`"
            ),
        }
    }
}

/// Enough of a text to recognise it in an error message.
pub(super) fn shortened(text: &str) -> String {
    const MOST: usize = 40;
    let text = text.trim();
    match text.char_indices().nth(MOST) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

/// A number as a person would write it.
fn plain(number: f64) -> String {
    if number == 0.0 || (1e-5..1e16).contains(&number.abs()) {
        number.to_string()
    } else {
        format!("{number:e}")
    }
}
