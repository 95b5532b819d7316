//! What a kernel says about an argument outside its domain. It does not know whose number it was:
//! the caller prefixes that.

use core::fmt;

/// An argument that has no meaning for the kernel; the name carries the unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DomainError {
    /// A quantity that cannot be below zero is.
    Negative {
        /// The argument and its unit.
        argument: &'static str,
        /// As given.
        value: f64,
    },
    /// NaN or an infinity.
    NotFinite {
        /// The argument and its unit.
        argument: &'static str,
        /// As given.
        value: f64,
    },
    /// A size that has to be there is zero or below.
    NotPositive {
        /// The argument and its unit.
        argument: &'static str,
        /// As given.
        value: f64,
    },
    /// The answer is beyond the largest double: choose a larger unit of length.
    Overflow {
        /// The quantity and its unit.
        result: &'static str,
    },
    /// The arguments are so far apart in size that no digit is left. Bring them closer.
    Lost {
        /// The quantity and its unit.
        result: &'static str,
    },
    /// Outside a closed interval.
    Outside {
        /// The argument and its unit.
        argument: &'static str,
        /// As given.
        value: f64,
        /// The interval's lower end, included.
        low: f64,
        /// The interval's upper end, included.
        high: f64,
    },
    /// Surfaces that do not lie to each other as the kernel asks for.
    Placing {
        /// Which of them.
        argument: &'static str,
        /// What it should be.
        expected: &'static str,
    },
    /// A direction that has no length.
    ZeroVector {
        /// The argument.
        argument: &'static str,
    },
    /// The receiver lies on the surface that it looks at: what it sees depends on the side from
    /// which it came there.
    Touching {
        /// What it lies on.
        shape: &'static str,
    },
    /// The receiver is within a body.
    Inside {
        /// Which body.
        shape: &'static str,
        /// From the body's centre to the receiver.
        distance_m: f64,
        /// The body's radius.
        radius_m: f64,
    },
    /// A source and an occluder of which neither is in front of the other.
    Interpenetrating,
    /// A polygon of fewer than three distinct vertices.
    TooFewVertices {
        /// How many distinct ones there are.
        distinct: usize,
    },
    /// A polygon whose vertices are in no plane.
    NotPlanar {
        /// The vertex farthest from the mean plane, counted from 0.
        vertex: usize,
        /// Its distance from that plane.
        off_plane_m: f64,
    },
    /// A sequence that has to rise, or stay, falls.
    Falling {
        /// Which sequence.
        argument: &'static str,
        /// Where, counted from 0.
        index: usize,
        /// What stands there.
        value: f64,
        /// What stands before it.
        before: f64,
    },
    /// A knot that stands more often than a spline of its degree can answer.
    Repeated {
        /// The knot.
        knot: f64,
        /// How often it stands there, repetitions at clamped ends included.
        times: usize,
        /// How often it may.
        most: usize,
    },
    /// Too short a list.
    TooFew {
        /// Which list.
        argument: &'static str,
        /// How many there are.
        found: usize,
        /// How many there have to be.
        least: usize,
    },
    /// A polygon two of whose edges cross.
    SelfIntersecting {
        /// One edge, by its first vertex, counted from 0.
        edge: usize,
        /// The other.
        other: usize,
    },
}

impl fmt::Display for DomainError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Negative { argument, value } => {
                write!(f, "{argument} is {value}, expected 0 or more")
            }
            Self::NotFinite { argument, value } => {
                write!(f, "{argument} is {value}, expected a finite number")
            }
            Self::NotPositive { argument, value } => {
                write!(f, "{argument} is {value}, expected more than 0")
            }
            Self::Lost { result } => {
                write!(f, "{result} has no digits at arguments so far apart in size")
            }
            Self::Overflow { result } => write!(f, "{result} is beyond the largest double"),
            // The largest double stands for no limit.
            Self::Outside { argument, value, low, high: f64::MAX } => {
                write!(f, "{argument} is {value}, expected {low} or more")
            }
            Self::Outside { argument, value, low, high } => {
                write!(f, "{argument} is {value}, expected {low} to {high}")
            }
            Self::Placing { argument, expected } => {
                write!(f, "{argument} is out of place, expected {expected}")
            }
            Self::ZeroVector { argument } => {
                write!(f, "{argument} has length 0, expected a direction")
            }
            Self::Touching { shape } => {
                write!(f, "the receiver lies on the {shape}, expected a point off it")
            }
            Self::Inside { shape, distance_m, radius_m } => write!(
                f,
                "the receiver is {distance_m} m from the centre of the {shape} of radius \
                 {radius_m} m, expected a point outside"
            ),
            Self::Interpenetrating => {
                write!(f, "source and occluder penetrate each other, expected bodies apart")
            }
            Self::TooFewVertices { distinct } => {
                write!(f, "the polygon has {distinct} distinct vertices, expected 3 or more")
            }
            Self::NotPlanar { vertex, off_plane_m } => write!(
                f,
                "vertex {vertex} is {off_plane_m} m off the polygon's plane, expected vertices in \
                 one plane"
            ),
            Self::Falling { argument, index, value, before } => write!(
                f,
                "number {index} of {argument} is {value} after {before}, expected no less than that"
            ),
            Self::Repeated { knot, times, most } => {
                write!(f, "the knot {knot} stands {times} times, expected at most {most}")
            }
            Self::TooFew { argument, found, least } => {
                write!(f, "{found} {argument} are given, expected {least} or more")
            }
            Self::SelfIntersecting { edge, other } => write!(
                f,
                "the edges from vertex {edge} and from vertex {other} cross, expected a simple \
                 polygon"
            ),
        }
    }
}

impl core::error::Error for DomainError {}

/// The value, if it is a finite number.
pub(crate) fn finite(argument: &'static str, value: f64) -> Result<f64, DomainError> {
    if value.is_finite() { Ok(value) } else { Err(DomainError::NotFinite { argument, value }) }
}

/// The value, if it is finite and above zero.
pub(crate) fn positive(argument: &'static str, value: f64) -> Result<f64, DomainError> {
    let value = finite(argument, value)?;
    if value > 0.0 { Ok(value) } else { Err(DomainError::NotPositive { argument, value }) }
}

/// The value, if it is finite and not below zero.
pub(crate) fn not_negative(argument: &'static str, value: f64) -> Result<f64, DomainError> {
    let value = finite(argument, value)?;
    if value >= 0.0 { Ok(value) } else { Err(DomainError::Negative { argument, value }) }
}

/// The value, if it lies in the closed interval.
pub(crate) fn within(
    argument: &'static str,
    value: f64,
    low: f64,
    high: f64,
) -> Result<f64, DomainError> {
    let value = finite(argument, value)?;
    if (low..=high).contains(&value) {
        Ok(value)
    } else {
        Err(DomainError::Outside { argument, value, low, high })
    }
}

/// The vector, if its components are finite numbers.
pub(crate) fn finite_vector(
    argument: &'static str,
    vector: glam::DVec3,
) -> Result<glam::DVec3, DomainError> {
    for value in vector.to_array() {
        finite(argument, value)?;
    }
    Ok(vector)
}

/// The vector's direction, scaled by a power of two to a largest component in [1, 2): no digit
/// changes, and neither its squares nor its products can overflow.
pub(crate) fn direction(
    argument: &'static str,
    vector: glam::DVec3,
) -> Result<glam::DVec3, DomainError> {
    let vector = finite_vector(argument, vector)?;
    if vector == glam::DVec3::ZERO {
        return Err(DomainError::ZeroVector { argument });
    }
    let exponent = -libm::ilogb(vector.abs().max_element());
    Ok(glam::DVec3::from_array(vector.to_array().map(|value| libm::scalbn(value, exponent))))
}
