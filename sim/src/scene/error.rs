//! Why something can't be part of a scene.

use core::fmt;

use super::{EXPONENT_MAX, Shape};

/// Why something can't be part of a scene.
#[derive(Debug, Clone, PartialEq)]
pub enum SceneError {
    /// It reaches below the sample's plane: its lowest z, metres.
    Below(f64),
    /// The exponent of a cosine lobe.
    Exponent(f64),
    /// A level that is negative or not a number.
    Level(f64),
    /// A body without an area: what it has, square metres.
    NoArea(f64),
    /// It shares area with a patch on the sample's plane.
    Overlap {
        /// As scene.toml counts it: `emitter[0]`.
        other: String,
    },
    /// It penetrates another body.
    Penetrates {
        /// As scene.toml counts it: `occluder[0]`.
        other: String,
    },
    /// A surface that would reflect more than it receives: the parts, which sum to more than 1.
    Reflects(f64, f64),
    /// An outline without an inside.
    Shape(Shape),
    /// Something that the simulator does not compute.
    Unsupported(&'static str),
    /// A window's number that no window has: name, value.
    Window(&'static str, f64),
}

impl SceneError {
    /// What to write instead.
    pub(crate) const fn expected(&self) -> &'static str {
        match self {
            Self::Below(_) => "everything at z of 0 and above",
            Self::Exponent(_) => "an exponent of at least 0 and at most 20000",
            Self::Level(_) => "a finite level of at least 0",
            Self::NoArea(_) => "a body with an area",
            Self::Overlap { .. } => "patches that do not overlap (they may touch)",
            Self::Penetrates { .. } => "bodies that do not penetrate each other (they may touch)",
            Self::Reflects(..) => "parts of at least 0 that sum to at most 1",
            Self::Shape(_) => "an outline of finite size above 0",
            Self::Unsupported(_) => "a scene that can be simulated",
            Self::Window(..) => {
                "an index of 1 to 10, a thickness of above 0, an absorption of at least 0"
            }
        }
    }
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Below(z_m) => {
                write!(f, "it reaches below the sample's plane, down to z = {} mm", z_m * 1e3)
            }
            Self::Exponent(exponent) => {
                write!(f, "exponent {exponent} is not from 0 to {EXPONENT_MAX}")
            }
            Self::Level(level) => write!(f, "level {level} is not a finite number of at least 0"),
            Self::NoArea(area_m2) => write!(f, "its area is {area_m2} m²"),
            Self::Overlap { other } => write!(f, "it overlaps {other}"),
            Self::Penetrates { other } => write!(f, "it and {other} penetrate each other"),
            Self::Reflects(diffuse, glossy) => {
                write!(
                    f,
                    "it reflects {diffuse} diffusely and {glossy} glossily, more than 1 in all"
                )
            }
            Self::Shape(shape) => write!(f, "the outline has no inside: {shape:?}"),
            Self::Unsupported(what) => write!(f, "not supported: {what}"),
            Self::Window(name, value) => write!(f, "{name} is {value}"),
        }
    }
}

impl core::error::Error for SceneError {}
