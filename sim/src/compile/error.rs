//! Why a scene, a rig and a plan's terms make no simulated rig.

use core::fmt;

use radiometry::DomainError;

use crate::Quantity;

/// Why a scene and a rig don't make a simulated rig.
#[derive(Debug, Clone, PartialEq)]
pub enum CompileError {
    /// Pupil, spot and distance make no beam.
    Beam(DomainError),
    /// The axes' channels are not 0 to 3, each once.
    Channels([u8; 4]),
    /// Keys that contradict each other: the one, and what it asks of the other.
    Contradiction(&'static str, &'static str),
    /// A length of the detector, or its responsivity, came out of the draw at or below zero: its
    /// uncertainty is as large as itself. Name, value drawn.
    Drawn(&'static str, f64),
    /// A wish for an effect that can't be granted.
    Effect {
        /// The effect.
        name: String,
        /// Whether it was to be in.
        is_forced: bool,
        /// Why not.
        why: String,
    },
    /// A number of the rig that no rig has: name, value.
    Nominal(String, f64),
    /// What the scene says makes no sense together.
    Scene(String),
    /// The scene's levels are in another quantity than the detector is calibrated for.
    Quantity {
        /// The scene's.
        scene: Quantity,
        /// The rig's.
        rig: Quantity,
    },
    /// A number of the terms that makes no sense: name, value, what was expected.
    Terms(&'static str, f64, &'static str),
    /// A wish for an effect that is none.
    UnknownEffect {
        /// As it was written.
        name: String,
        /// What was meant, perhaps.
        nearest: Option<String>,
        /// All that there are.
        known: Vec<String>,
    },
    /// The scene calls for something that is not simulated.
    Unsupported(String),
}

impl fmt::Display for CompileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Beam(error) => write!(f, "detector: {error}"),
            Self::Channels(found) => {
                write!(f, "the axes are on channels {found:?}, expected 0 to 3, each once")
            }
            Self::Contradiction(key, other) => write!(f, "{key} without {other}"),
            Self::Drawn(name, value) => write!(
                f,
                "{name}: drawn as {value}, expected above 0: its stated uncertainty is too large"
            ),
            Self::Effect { name, is_forced, why } => {
                let wish = if *is_forced { "forced in" } else { "left out" };
                write!(f, "effect {name} can't be {wish}: {why}")
            }
            Self::Nominal(name, value) => write!(f, "{name}: {value} is not what a rig has"),
            Self::Quantity { scene, rig } => write!(
                f,
                "the scene's levels are {}, the rig's detector is calibrated for {}",
                scene.name(),
                rig.name()
            ),
            Self::Scene(what) => f.write_str(what),
            Self::Terms(name, value, expected) => {
                write!(f, "{name} is {value}, expected {expected}")
            }
            Self::UnknownEffect { name, nearest, known } => {
                write!(f, "no effect is called {name}")?;
                match nearest {
                    Some(nearest) => write!(f, "; did you mean {nearest}?")?,
                    None => f.write_str(";")?,
                }
                write!(f, " the effects here: {}", known.join(", "))
            }
            Self::Unsupported(what) => write!(f, "not simulated: {what}"),
        }
    }
}

impl core::error::Error for CompileError {}
