//! Says in words what the samples leave open when a fit's coefficients are not all determined.
//! Looks at where the samples lie, not at their values.

use crate::basis::{Basis, Scratch};
use crate::triangle::{Spectrum, Triangle};
use crate::{FitError, Ray, Sample};
use std::f64::consts::PI;
use std::fmt;

/// Something that is missing from the samples.
#[derive(Debug, Clone, PartialEq)]
pub enum Cause {
    /// Too few distinct coordinates along one axis of the stage.
    Positions {
        /// `x` or `y`.
        axis: &'static str,
        /// Distinct coordinates found.
        distinct: usize,
        /// Degree of the basis in position: one more is needed.
        degree: usize,
    },
    /// Distinct coordinates are enough on each axis, but the positions lie on a line or a curve.
    PositionsTogether {
        /// Combinations of position terms that the positions determine.
        rank: usize,
        /// Position terms of the basis.
        terms: usize,
    },
    /// All readings lie in one plane through the normal.
    OneAzimuth {
        /// The plane's azimuth in [0°, 180°), radians.
        phi_rad: f64,
    },
    /// Too few planes through the normal.
    Azimuths {
        /// Distinct planes found.
        distinct: usize,
        /// Degree of the basis in direction: one more is needed.
        degree: usize,
    },
    /// Too few distinct angles from the normal.
    Polar {
        /// Distinct angles found.
        distinct: usize,
        /// Degree of the basis in direction: half of it and one more are needed.
        degree: usize,
    },
    /// The cone measured is smaller than the region's.
    Beyond {
        /// The largest angle measured, radians.
        theta_rad: f64,
    },
    /// Distinct angles are enough each for itself, but not the directions that they make up.
    DirectionsTogether {
        /// Combinations of angular terms that the directions determine.
        rank: usize,
        /// Angular terms of the basis.
        terms: usize,
    },
    /// Positions and directions are enough each for itself, but were not varied independently.
    NotCrossed,
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Positions { axis, distinct, degree } => write!(
                f,
                "only {distinct} distinct position{} in {axis}: degree {degree} needs {}",
                plural(*distinct),
                degree + 1
            ),
            Self::PositionsTogether { rank, terms } => write!(
                f,
                "the positions (x, y) determine {rank} of {terms} position terms: they lie on a \
                 line or a curve"
            ),
            Self::OneAzimuth { phi_rad } => write!(
                f,
                "all readings lie on one azimuth line (phi = {:.1}°): terms that vary with phi \
                 are not determined",
                phi_rad.to_degrees()
            ),
            Self::Azimuths { distinct, degree } => write!(
                f,
                "only {distinct} distinct azimuth lines (phi and phi + 180° count as one): degree \
                 {degree} needs {}",
                degree + 1
            ),
            Self::Polar { distinct, degree } => write!(
                f,
                "only {distinct} distinct angle{} theta: degree {degree} needs {}",
                plural(*distinct),
                degree / 2 + 1
            ),
            Self::Beyond { theta_rad } => {
                write!(f, "nothing was measured beyond {:.1}°", theta_rad.to_degrees())
            }
            Self::DirectionsTogether { rank, terms } => {
                write!(f, "the directions determine {rank} of {terms} angular terms")
            }
            Self::NotCrossed => f.write_str(
                "position and direction were not varied independently of each other: each \
                 position needs its own spread of directions",
            ),
        }
    }
}

fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}

/// The refusal, with its causes and the functions that are involved most.
pub(crate) fn refusal(samples: &[Sample], basis: &Basis, spectrum: &Spectrum) -> FitError {
    let mut by_share: Vec<(usize, f64)> =
        spectrum.undetermined_shares().into_iter().enumerate().collect();
    by_share.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let involved = by_share.iter().take(NAMES_MAX).filter(|(_, share)| *share > SHARE_MIN);
    FitError::Undetermined {
        rank: spectrum.rank(),
        coefficients: basis.len(),
        causes: causes(samples, basis),
        functions: involved.map(|(k, _)| basis.name(*k)).collect(),
    }
}

fn causes(samples: &[Sample], basis: &Basis) -> Vec<Cause> {
    let mut causes = Vec::new();
    positions(samples, basis, &mut causes);
    directions(samples, basis, &mut causes);
    if causes.is_empty() {
        causes.push(Cause::NotCrossed);
    }
    causes
}

fn positions(samples: &[Sample], basis: &Basis, causes: &mut Vec<Cause>) {
    let degree = basis.spec().position_degree;
    let scaled = |pick: fn((f64, f64)) -> f64| {
        distinct(samples.iter().map(|s| pick(basis.region().scaled(&s.ray))), POSITION_APART)
    };
    let before = causes.len();
    for (axis, distinct) in [("x", scaled(|p| p.0)), ("y", scaled(|p| p.1))] {
        if distinct <= degree {
            causes.push(Cause::Positions { axis, distinct, degree });
        }
    }
    let terms = basis.position_len();
    let rank = rank(samples, terms, basis, |ray, scratch, row| {
        basis.position(ray, scratch);
        row.copy_from_slice(scratch.position());
    });
    if causes.len() == before && rank < terms {
        causes.push(Cause::PositionsTogether { rank, terms });
    }
}

fn directions(samples: &[Sample], basis: &Basis, causes: &mut Vec<Cause>) {
    let degree = basis.spec().angular_degree;
    let terms = basis.angular_len();
    let rank = rank(samples, terms, basis, |ray, _, row| {
        basis.direction(ray.theta_rad, ray.phi_rad, row);
    });
    if rank == terms {
        return;
    }
    let before = causes.len();
    let off_axis = samples.iter().map(|s| s.ray).filter(|ray| ray.theta_rad > ANGLE_APART);
    let lines: Vec<f64> = off_axis.map(|ray| azimuth_line(ray.phi_rad)).collect();
    let azimuths = distinct(lines.iter().copied(), ANGLE_APART);
    match lines.first() {
        Some(phi_rad) if azimuths == 1 => causes.push(Cause::OneAzimuth { phi_rad: *phi_rad }),
        _ if (1..=degree).contains(&azimuths) => {
            causes.push(Cause::Azimuths { distinct: azimuths, degree });
        }
        _ => {}
    }
    let polar = distinct(samples.iter().map(|s| s.ray.theta_rad), ANGLE_APART);
    if polar <= degree / 2 {
        causes.push(Cause::Polar { distinct: polar, degree });
    }
    let theta_rad = samples.iter().map(|s| s.ray.theta_rad).fold(0.0, f64::max);
    if theta_rad < CONE_SHARE * basis.region().theta_max_rad {
        causes.push(Cause::Beyond { theta_rad });
    }
    if causes.len() == before {
        causes.push(Cause::DirectionsTogether { rank, terms });
    }
}

/// φ as a line through the pole, in [0, π): an arm swung to the other side is on the same line.
fn azimuth_line(phi_rad: f64) -> f64 {
    let line = phi_rad.rem_euclid(PI);
    if PI - line < ANGLE_APART { 0.0 } else { line }
}

/// How many values there are when those closer than `apart` to their neighbour count as one.
fn distinct(values: impl Iterator<Item = f64>, apart: f64) -> usize {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup_by(|a, b| (*a - *b).abs() < apart);
    sorted.len()
}

/// The rank of a part of the basis over the samples.
fn rank(
    samples: &[Sample],
    terms: usize,
    basis: &Basis,
    mut fill: impl FnMut(&Ray, &mut Scratch, &mut [f64]),
) -> usize {
    let mut triangle = Triangle::new(terms, 0);
    let mut scratch = basis.scratch();
    let mut row = vec![0.0; terms];
    for sample in samples {
        fill(&sample.ray, &mut scratch, &mut row);
        triangle.absorb(&row);
    }
    triangle.solve().and_then(|solution| solution.spectrum()).map_or(terms, |s| s.rank())
}

/// Most functions that are named.
const NAMES_MAX: usize = 8;
/// A function with less than this share in the undetermined combinations isn't named.
const SHARE_MIN: f64 = 1e-3;
/// Angles closer than this (0.006°) count as one, radians: readbacks scatter so much.
const ANGLE_APART: f64 = 1e-4;
/// Positions closer than this share of the half width count as one.
const POSITION_APART: f64 = 1e-4;
/// A cone of at least this share of the region's is not to blame.
const CONE_SHARE: f64 = 0.9;
