//! Why a quantity can't be derived, and what must be said beside one that can.

use std::fmt;

/// Why there is no such quantity.
#[derive(Debug, Clone, PartialEq)]
pub enum DeriveError {
    /// Another chart's quantity.
    OfChart {
        /// The quantity.
        what: &'static str,
        /// The fit's chart.
        chart: &'static str,
        /// What the chart has.
        instead: &'static str,
    },
    /// The region is a single place or a line: nothing can be integrated over it.
    NoArea,
    /// A receiver lies below the sample's plane, or touches it.
    BelowPlane {
        /// Its lowest point's height, m.
        height_m: f64,
    },
    /// A receiver comes so near to the sample's plane that a quadrature over both isn't possible.
    TooNear {
        /// Its lowest point's height, m.
        height_m: f64,
    },
    /// A receiver without an area, or one that isn't flat, or whose outline crosses itself.
    Receiver {
        /// What is wrong, and with what.
        what: String,
    },
    /// A number outside its domain.
    Domain {
        /// Which number, with its unit.
        what: &'static str,
        /// As given.
        value: f64,
        /// What it may be.
        expected: &'static str,
    },
    /// A layer's number outside its domain.
    Layer {
        /// Which number.
        what: &'static str,
        /// As given.
        value: f64,
        /// What it may be.
        expected: &'static str,
    },
    /// The quantity is one in air, and the medium ends below it.
    InAir {
        /// The quantity.
        what: &'static str,
    },
    /// Nothing of this direction came out of the layer: the radiance there is unmeasured.
    NothingThrough {
        /// From the normal, radians.
        theta_rad: f64,
    },
    /// The rule that the bound asks for has too many rays. Narrower or farther receivers need less.
    TooFine {
        /// Rays at most.
        rays_max: usize,
        /// Change of the value at the last refinement.
        bound: f64,
        /// What was asked for.
        wanted: f64,
    },
    /// The intensity isn't positive anywhere: there is no peak to take half of.
    NoPeak,
    /// The intensity does not fall to the level within the cone that was measured.
    NotReached {
        /// The level, as a share of the reference intensity.
        level: f64,
        /// From the normal to here, radians.
        theta_max_rad: f64,
    },
}

impl fmt::Display for DeriveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OfChart { what, chart, instead } => {
                write!(f, "a fit in the {chart} chart has no {what}; it has {instead}")
            }
            Self::NoArea => f.write_str(
                "the fit's region has no area: it has radiance and exitance, but no intensity, flux \
                 or irradiance",
            ),
            Self::BelowPlane { height_m } => write!(
                f,
                "the receiver's lowest point has z = {} mm; expected all of it above the sample's \
                 plane z = 0",
                // To a picometre: what lies below it is rounding.
                (height_m * 1e12).round() / 1e9
            ),
            Self::TooNear { height_m } => write!(
                f,
                "the receiver's lowest point, {:e} mm above the sample's plane, is too near for its \
                 size",
                height_m * 1e3
            ),
            Self::Receiver { what } => write!(f, "the receiver: {what}"),
            Self::Domain { what, value, expected } | Self::Layer { what, value, expected } => {
                write!(f, "{what} is {value}; expected {expected}")
            }
            Self::InAir { what } => {
                write!(f, "{what} lies in air, but the field asked for is the one in the medium")
            }
            Self::NothingThrough { theta_rad } => write!(
                f,
                "nothing comes out of the layer at {:.3}° from the normal: the radiance there is \
                 unmeasured",
                theta_rad.to_degrees()
            ),
            Self::TooFine { rays_max, bound, wanted } => write!(
                f,
                "{rays_max} rays are not enough: the quadrature still changes by {bound:.2e}, \
                 expected at most {wanted:.2e}"
            ),
            Self::NoPeak => f.write_str("the intensity is not positive anywhere in the cone"),
            Self::NotReached { level, theta_max_rad } => write!(
                f,
                "the intensity does not fall to {:.3} % of its reference within {:.1}°, the cone \
                 that was measured",
                100.0 * level,
                theta_max_rad.to_degrees()
            ),
        }
    }
}

impl std::error::Error for DeriveError {}

/// What a reader of a derived quantity must know.
#[derive(Debug, Clone, PartialEq)]
pub enum Remark {
    /// Part of the value is extrapolated beyond the region or its cone.
    Extrapolated,
    /// All of the light arrives at the receiver's back.
    FaceAway,
    /// Directions beyond the critical angle don't come out, and not all of the others were measured;
    /// the integral ends before them.
    Unmeasured {
        /// Where it ends, radians inside.
        end_rad: f64,
        /// The critical angle inside, radians.
        critical_rad: f64,
    },
    /// Rays that next to nothing of came through were left out.
    Grazing,
    /// Another lobe is as high within its uncertainty: which is the peak isn't known, the larger
    /// of the two is too large on average, and u to first order is that of the one named.
    Tie,
    /// The intensity falls below the level between the two outermost directions that reach it.
    Dips,
    /// The curve bends within u, so that u to first order is too small or too large.
    Bent,
    /// The peak lies at the rim of the cone that was measured: beyond there may be more.
    AtRim,
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Extrapolated => {
                f.write_str("part of it is extrapolated beyond what was measured")
            }
            Self::FaceAway => f.write_str(
                "the receiver's face is turned away from the sample: turn its normal, or the order \
                 of its vertices, round",
            ),
            Self::Unmeasured { end_rad, critical_rad } => write!(
                f,
                "unmeasured beyond {:.2}° inside, and not included; beyond the critical angle of \
                 {:.2}° nothing comes out",
                end_rad.to_degrees(),
                critical_rad.to_degrees()
            ),
            Self::Grazing => f.write_str(
                "rays so grazing that next to nothing of them came through are not included",
            ),
            Self::Tie => f.write_str(
                "another lobe is as high within its uncertainty; u is that of the one named",
            ),
            Self::Dips => {
                f.write_str("the intensity falls below the level in between; outermost directions")
            }
            Self::Bent => f.write_str("the curve bends within u; u to first order is approximate"),
            Self::AtRim => f.write_str("the peak lies at the rim of the cone that was measured"),
        }
    }
}
