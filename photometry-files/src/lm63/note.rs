//! What is irregular about a file that could be read all the same, and what was done about it.

use std::fmt;

use super::label::IntensityUnit;

/// One irregularity.
#[derive(Debug, Clone, PartialEq)]
pub enum Note {
    /// Light at or beyond the opening's horizon, γ >= 90°, which no flat opening sends there:
    /// kept, never divided by a cosine.
    AtOrBeyondHorizon {
        /// The largest such intensity, in the file's unit.
        largest: f64,
        /// Where it is, degrees.
        c_deg: f64,
        /// Where it is, degrees.
        gamma_deg: f64,
        /// The flux beyond 90° by the whole flux.
        flux_fraction: f64,
    },
    /// The opening's dimensions are in feet: converted.
    Feet,
    /// The field that the 2002 edition keeps at 1 for future use has another value: not applied.
    FutureUse {
        /// As in the file.
        found: f64,
    },
    /// Lines beyond the standard's 256 characters.
    LongLines {
        /// The first of them.
        first_line: usize,
        /// The longest, characters.
        longest: usize,
    },
    /// The planes meet in one direction (γ = 0 or 180°) and disagree there: averaged over C.
    PlanesDisagree {
        /// 0 or 180.
        gamma_deg: f64,
        /// The lowest, in the file's unit.
        low: f64,
        /// The highest, in the file's unit.
        high: f64,
        /// What stands for all of them.
        mean: f64,
    },
    /// The planes C = 0 and C = 360° are one plane and disagree: averaged.
    SeamDisagrees {
        /// The largest difference, in the file's unit.
        largest: f64,
        /// Where it is, degrees.
        gamma_deg: f64,
    },
    /// Tilt factors are included: kept, not applied (they depend on how the luminaire is hung).
    TiltNotApplied,
    /// No unit is stated: the standard's is taken.
    UnitAssumed {
        /// That unit.
        unit: IntensityUnit,
    },
    /// The signs of the opening's dimensions stand in none of the edition's shapes.
    UnlistedOpening,
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AtOrBeyondHorizon { largest, c_deg, gamma_deg, flux_fraction } => write!(
                f,
                "intensity up to {largest} at or beyond 90° (at C {c_deg}°, γ {gamma_deg}°), \
                 {:.3} % of the flux",
                flux_fraction * 100.0
            ),
            Self::Feet => f.write_str("dimensions in feet, converted to metres"),
            Self::FutureUse { found } => {
                write!(f, "{found} in the field kept at 1 for future use, not applied")
            }
            Self::LongLines { first_line, longest } => write!(
                f,
                "lines of up to {longest} characters from line {first_line} on, \
                 the standard has at most 256"
            ),
            Self::PlanesDisagree { gamma_deg, low, high, mean } => write!(
                f,
                "planes disagree at γ {gamma_deg}°: {low} to {high} ({:.2} %), averaged to {mean}",
                (high - low) / mean * 100.0
            ),
            Self::SeamDisagrees { largest, gamma_deg } => write!(
                f,
                "planes C 0° and C 360° differ by up to {largest} (at γ {gamma_deg}°), averaged"
            ),
            Self::TiltNotApplied => f.write_str("tilt factors included, not applied"),
            Self::UnitAssumed { unit } => write!(f, "no unit of intensity stated, {unit} assumed"),
            Self::UnlistedOpening => {
                f.write_str("the opening's dimensions are none of the standard's shapes")
            }
        }
    }
}
