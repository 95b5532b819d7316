//! Why a fit is refused, each with its own sentence. Indices count the samples from 0, as they
//! were handed in.

use crate::Penalty;
use crate::undetermined::Cause;
use std::fmt;

/// Why there is no fit.
#[derive(Debug, Clone, PartialEq)]
pub enum FitError {
    /// There is not one sample. Measure something, or look why everything was left out.
    Empty,
    /// The region's ends are not finite or out of order, or its cone exceeds the hemisphere.
    Region,
    /// The sample's outline has ends that are not finite or not in order, or no area.
    Outline,
    /// The basis has more functions than a dense fit may hold. Ask for lower degrees.
    TooLarge {
        /// Coefficients of the basis asked for.
        coefficients: usize,
        /// Most that are taken.
        coefficients_max: usize,
    },
    /// A basis of another chart: directions below the horizon, say, or places in a second plane.
    BasisOfChart {
        /// Which functions.
        kind: &'static str,
        /// The region's chart.
        chart: &'static str,
    },
    /// Two planes so near to each other, for their size, that the throughput between them can't be
    /// integrated.
    PlanesTooNear {
        /// From one to the other, metres.
        distance_m: f64,
    },
    /// A ray that misses the second rectangle of the two-plane chart.
    OutsideSecondPlane {
        /// The sample.
        index: usize,
        /// Where it pierces the second plane, metres.
        s_m: f64,
        /// Where it pierces the second plane, metres.
        t_m: f64,
    },
    /// What a fit in many local functions doesn't do: ask for fewer spans.
    Sparse {
        /// What was asked for.
        wish: &'static str,
        /// With more coefficients than this.
        coefficients_from: usize,
    },
    /// So many splines, and the strength of their penalty left open: it isn't chosen for that many.
    StrengthOpen {
        /// Coefficients of the basis asked for.
        coefficients: usize,
        /// Most that a strength is chosen for.
        coefficients_max: usize,
    },
    /// A basis out of its range: harmonics beyond degree 200, say.
    Basis {
        /// Which functions.
        kind: &'static str,
    },
    /// A penalty whose strength is negative or not finite, or whose power the basis doesn't know.
    Penalty {
        /// As handed in.
        penalty: Penalty,
    },
    /// A field that is below zero somewhere however it was held up. Ask for a lower degree, or for no
    /// bound at zero.
    StillNegative {
        /// Rays of the grid along which it is.
        below: usize,
        /// All rays of the grid.
        rays: usize,
        /// The least radiance among them, in the values' unit.
        least: f64,
    },
    /// A truncation that is negative or not finite.
    Truncation {
        /// As handed in.
        truncation: f64,
    },
    /// A number of a sample is NaN or infinite. Leave the sample out, or mend its source.
    NotFinite {
        /// The sample.
        index: usize,
        /// Which of its numbers.
        what: &'static str,
    },
    /// A variance is zero or negative, which would be infinite weight.
    Variance {
        /// The sample.
        index: usize,
        /// Which of its numbers.
        what: &'static str,
        /// As handed in.
        value: f64,
    },
    /// Shot noise that falls as the level rises, which there isn't.
    ShotNoise {
        /// The sample.
        index: usize,
        /// Variance per radiance as handed in.
        value: f64,
    },
    /// A direction below the sample's plane, which the surface chart doesn't have; or beyond the
    /// nadir, which no chart has.
    Theta {
        /// The sample.
        index: usize,
        /// From the normal, radians.
        theta_rad: f64,
        /// The chart's largest, radians.
        end_rad: f64,
    },
    /// A position off the region. Polynomials extrapolate badly: widen the region instead.
    OutsideRegion {
        /// The sample.
        index: usize,
        /// Where it lies, metres.
        x_m: f64,
        /// Where it lies, metres.
        y_m: f64,
    },
    /// Fewer samples than coefficients. Measure more, or ask for lower degrees.
    FewerReadingsThanCoefficients {
        /// Samples handed in.
        readings: usize,
        /// Coefficients of the basis asked for.
        coefficients: usize,
    },
    /// As many samples as coefficients, and no word on their noise: no residual is left to tell.
    NoScatter {
        /// Samples handed in, and coefficients.
        readings: usize,
    },
    /// All samples are lower limits: the field may be anything above them. Measure with a less
    /// sensitive range, or a shorter integration.
    OnlyLimits {
        /// Samples handed in.
        readings: usize,
    },
    /// The samples leave combinations of coefficients open.
    Undetermined {
        /// How many combinations are determined.
        rank: usize,
        /// Coefficients of the basis asked for.
        coefficients: usize,
        /// What is missing, in words.
        causes: Vec<Cause>,
        /// The functions that are involved most, at most eight.
        functions: Vec<String>,
    },
    /// A common component's u is negative or not finite, or its shift yields such a number.
    Common {
        /// The component.
        name: String,
    },
    /// All samples lie along one ray, and no basis is named: nothing tells how the field changes. Measure
    /// other poses, or say that it is constant.
    OnePose {
        /// Samples handed in.
        readings: usize,
        /// Their angle from the normal, radians.
        theta_rad: f64,
        /// Their azimuth, radians.
        phi_rad: f64,
    },
    /// Something was to be fitted along that the readings know nothing of.
    Nuisance {
        /// What.
        name: &'static str,
        /// What is missing.
        missing: &'static str,
    },
    /// A fit whose readings can't be drawn again.
    Trials {
        /// What is missing.
        missing: &'static str,
    },
    /// The numbers are so large or so small that squares leave the range of f64.
    OutOfRange,
    /// Stored parts of a fit don't belong together.
    Parts {
        /// Which part.
        what: &'static str,
        /// Numbers that the basis calls for.
        expected: usize,
        /// Numbers found (finite ones).
        found: usize,
    },
}

impl FitError {
    /// The sample that is wrong, where it is one.
    pub fn index(&self) -> Option<usize> {
        match *self {
            Self::NotFinite { index, .. }
            | Self::Variance { index, .. }
            | Self::ShotNoise { index, .. }
            | Self::Theta { index, .. }
            | Self::OutsideRegion { index, .. }
            | Self::OutsideSecondPlane { index, .. } => Some(index),
            _ => None,
        }
    }
}

impl fmt::Display for FitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StillNegative { below, rays, least } => still_negative(f, *below, *rays, *least),
            Self::Empty => f.write_str("no samples: there is nothing to fit"),
            Self::Region => f.write_str(
                "region: ends must be finite and in order, theta_max above 0° and at most 90° (180° \
                 where a chart has all directions)",
            ),
            Self::Outline => f.write_str(
                "outline of the sample: ends must be finite and in order, a radius above 0",
            ),
            Self::TooLarge { coefficients, coefficients_max } => {
                write!(f, "{coefficients} coefficients are more than {coefficients_max}")
            }
            Self::Sparse { wish, coefficients_from } => write!(
                f,
                "{wish}: not with more than {coefficients_from} splines; expected fewer spans, or to go \
                 without"
            ),
            Self::StrengthOpen { coefficients, coefficients_max } => {
                strength_open(f, *coefficients, *coefficients_max)
            }
            Self::BasisOfChart { kind, chart } => basis_of_chart(f, kind, chart),
            Self::PlanesTooNear { distance_m } => planes_too_near(f, distance_m * 1e3),
            Self::OutsideSecondPlane { index, s_m, t_m } => {
                let (s_mm, t_mm) = (s_m * 1e3, t_m * 1e3);
                write!(
                    f,
                    "sample {index}: (s, t) = ({s_mm:.3}, {t_mm:.3}) mm lies outside the second \
                     rectangle"
                )
            }
            Self::Basis { kind } => {
                write!(f, "basis `{kind}`: its degree or spans are beyond what it is good for")
            }
            Self::Truncation { truncation } => {
                write!(f, "truncation {truncation}: expected a finite number of 0 or more")
            }
            Self::Penalty { penalty } => unsound_penalty(f, penalty),
            Self::NotFinite { index, what } => write!(f, "sample {index}: {what} is not finite"),
            Self::Variance { index, what, value } => {
                write!(f, "sample {index}: {what} {value:e}, expected more than 0")
            }
            Self::ShotNoise { index, value } => {
                write!(f, "sample {index}: variance per radiance {value:e}, expected 0 or more")
            }
            Self::Theta { index, theta_rad, end_rad } => {
                let (theta_deg, end_deg) = (theta_rad.to_degrees(), end_rad.to_degrees());
                write!(f, "sample {index}: theta {theta_deg:.3}° is outside 0° to {end_deg:.0}°")
            }
            Self::OutsideRegion { index, x_m, y_m } => {
                let (x_mm, y_mm) = (x_m * 1e3, y_m * 1e3);
                write!(f, "sample {index}: ({x_mm:.3}, {y_mm:.3}) mm lies outside the region")
            }
            Self::FewerReadingsThanCoefficients { readings, coefficients } => {
                write!(f, "{readings} readings are fewer than the {coefficients} coefficients")
            }
            Self::NoScatter { readings } => write!(
                f,
                "{readings} readings of unknown noise for as many coefficients: no residual tells \
                 the noise"
            ),
            Self::OnlyLimits { readings } => only_limits(f, *readings),
            Self::Undetermined { rank, coefficients, causes, functions } => {
                undetermined(f, *rank, *coefficients, causes, functions)
            }
            Self::Common { name } => {
                write!(f, "common component `{name}`: u or its shift is negative or not finite")
            }
            Self::OnePose { readings, theta_rad, phi_rad } => {
                one_pose(f, *readings, theta_rad.to_degrees(), phi_rad.to_degrees())
            }
            Self::Nuisance { name, missing } => write!(f, "{name} can't be fitted: {missing}"),
            Self::Trials { missing } => {
                write!(f, "no trials of this fit's readings: {missing} are not at hand")
            }
            Self::OutOfRange => f.write_str("values or variances leave the range of numbers"),
            Self::Parts { what, expected, found } => {
                write!(f, "stored fit: {what}: expected {expected} finite numbers, found {found}")
            }
        }
    }
}

fn only_limits(f: &mut fmt::Formatter<'_>, readings: usize) -> fmt::Result {
    write!(
        f,
        "all {readings} readings are lower limits (saturated), which say no more than that the field is \
         at least so large; expected readings within the range: measure with a less sensitive one"
    )
}

fn strength_open(f: &mut fmt::Formatter<'_>, found: usize, most: usize) -> fmt::Result {
    write!(
        f,
        "{found} splines and no strength of their penalty, which is chosen for {most} at most; expected a \
         strength, or fewer spans"
    )
}

fn planes_too_near(f: &mut fmt::Formatter<'_>, distance_mm: f64) -> fmt::Result {
    write!(
        f,
        "planes {distance_mm} mm apart are too near to each other for their size: the throughput \
         between them can't be integrated"
    )
}

fn unsound_penalty(f: &mut fmt::Formatter<'_>, penalty: &Penalty) -> fmt::Result {
    let Penalty { power, strength } = penalty;
    write!(
        f,
        "penalty of power {power} and strength {strength}: expected a finite strength of 0 or more \
         and a power of 0 to 18 (of splines 1 or 2)"
    )
}

fn one_pose(
    f: &mut fmt::Formatter<'_>,
    readings: usize,
    theta_deg: f64,
    phi_deg: f64,
) -> fmt::Result {
    write!(
        f,
        "all {readings} readings are of one pose (theta {theta_deg:.3}°, phi {phi_deg:.3}°), which \
         tells nothing of other directions and places; a field that is the same everywhere is degree 0 \
         in both"
    )
}

fn undetermined(
    f: &mut fmt::Formatter<'_>,
    rank: usize,
    coefficients: usize,
    causes: &[Cause],
    functions: &[String],
) -> fmt::Result {
    write!(f, "{rank} of {coefficients} coefficients are determined")?;
    for cause in causes {
        write!(f, "; {cause}")?;
    }
    write!(f, "; most involved: {}", functions.join(", "))
}

impl std::error::Error for FitError {}

fn still_negative(
    f: &mut fmt::Formatter<'_>,
    below: usize,
    rays: usize,
    least: f64,
) -> fmt::Result {
    write!(
        f,
        "the field stays below zero along {below} of {rays} rays, down to {least:.3e}, however it is held \
         up; expected a basis that can be zero there: ask for a lower degree, or for no bound at zero"
    )
}

fn basis_of_chart(f: &mut fmt::Formatter<'_>, kind: &str, chart: &str) -> fmt::Result {
    let expected = match chart {
        "surface" => "zernike, hemispherical, even-harmonics or splines",
        "two-plane" => "legendre",
        _ => "spherical",
    };
    write!(f, "basis `{kind}`: it has no functions of the {chart} chart; expected {expected}")
}
