//! Says in words what the samples leave open when a fit's coefficients are not all determined.
//! Looks at where the samples lie, not at their values, and at poses as they were meant: readings
//! of one azimuth scatter about it, and arithmetic would take that scatter for information.

use crate::basis::{Basis, Scratch};
use crate::grid::Grid;
use crate::triangle::{Spectrum, Triangle};
use crate::{FitError, Ray, Sample};
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
    /// Too few meridians, φ and φ + 180° being two: what varies as the degree does around the normal
    /// looks on them like what varies more slowly.
    Meridians {
        /// Distinct meridians found.
        distinct: usize,
        /// Degree of the basis in direction.
        degree: usize,
        /// Distinct meridians that the degree needs.
        needed: usize,
    },
    /// Too few distinct angles from the normal.
    Polar {
        /// Distinct angles found.
        distinct: usize,
        /// Degree of the basis in direction.
        degree: usize,
        /// Distinct angles that the degree needs.
        needed: usize,
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
            Self::Meridians { distinct, degree, needed } => write!(
                f,
                "only {distinct} meridian{} (phi and phi + 180° count as two): what varies {degree} \
                 times around the normal needs {needed}, and is told from slower changes by its course \
                 in theta alone",
                plural(*distinct)
            ),
            Self::Polar { distinct, degree, needed } => write!(
                f,
                "only {distinct} distinct angle{} theta: degree {degree} needs {needed}",
                plural(*distinct)
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

/// The refusal of samples that leave coefficients open for want of distinct coordinates, whatever
/// their scatter seems to tell.
pub(crate) fn by_count(samples: &[Sample], basis: &Basis) -> Option<FitError> {
    let grid = Grid::of(samples, basis.region());
    let rays = || samples.iter().map(|s| grid.snap(&s.ray)).collect::<Vec<Ray>>();
    lacks(&grid, basis).then(|| refusal(&rays(), &grid, basis))
}

/// Whether there are fewer distinct coordinates than the basis needs where nothing is held against it.
pub(crate) fn lacks(grid: &Grid, basis: &Basis) -> bool {
    !positions(grid, basis).is_empty() || !directions(grid, basis).is_empty()
}

/// The refusal of samples whose factorisation lacks rank.
pub(crate) fn by_rank(samples: &[Sample], basis: &Basis) -> FitError {
    let rays: Vec<Ray> = samples.iter().map(|s| s.ray).collect();
    refusal(&rays, &Grid::of(samples, basis.region()), basis)
}

/// The refusal, with its causes and the functions that are involved most.
fn refusal(rays: &[Ray], grid: &Grid, basis: &Basis) -> FitError {
    let Some(spectrum) = spectrum(rays, basis.len(), basis, |ray, scratch, row| {
        basis.row(ray, scratch, row);
    }) else {
        return FitError::OutOfRange;
    };
    let mut by_share: Vec<(usize, f64)> =
        spectrum.undetermined_shares().iter().copied().enumerate().collect();
    by_share.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let involved = by_share.iter().take(NAMES_MAX).filter(|(_, share)| *share > SHARE_MIN);
    FitError::Undetermined {
        rank: spectrum.rank(),
        coefficients: basis.len(),
        causes: causes(rays, grid, basis),
        functions: involved.map(|(k, _)| basis.name(*k)).collect(),
    }
}

fn causes(rays: &[Ray], grid: &Grid, basis: &Basis) -> Vec<Cause> {
    let mut causes = positions(grid, basis);
    let terms = basis.position_len();
    let rank = rank(rays, terms, basis, |ray, scratch, row| {
        basis.position(ray, scratch);
        row.copy_from_slice(scratch.position());
    });
    if causes.is_empty() && rank < terms {
        causes.push(Cause::PositionsTogether { rank, terms });
    }
    causes.extend(angular_causes(rays, grid, basis));
    if causes.is_empty() {
        causes.push(Cause::NotCrossed);
    }
    causes
}

fn angular_causes(rays: &[Ray], grid: &Grid, basis: &Basis) -> Vec<Cause> {
    let terms = basis.angular_len();
    let rank = rank(rays, terms, basis, |ray, scratch, row| {
        basis.direction_of(ray, scratch, row);
    });
    if rank == terms {
        return Vec::new();
    }
    let mut causes = directions(grid, basis);
    let theta_rad = rays.iter().map(|ray| ray.theta_rad).fold(0.0, f64::max);
    if theta_rad < CONE_SHARE * basis.region().theta_max_rad {
        causes.push(Cause::Beyond { theta_rad });
    }
    if causes.is_empty() {
        causes.push(Cause::DirectionsTogether { rank, terms });
    }
    causes
}

/// A product of d factors x - xᵢ is a polynomial of degree d that vanishes at d positions.
fn positions(grid: &Grid, basis: &Basis) -> Vec<Cause> {
    // As many functions along a side as a polynomial of this degree has.
    let (x, y) = basis.places().lines();
    let axes = [("x", grid.x_m.len(), x - 1), ("y", grid.y_m.len(), y - 1)].into_iter();
    axes.filter(|(_, distinct, degree)| distinct <= degree)
        .map(|(axis, distinct, degree)| Cause::Positions { axis, distinct, degree })
        .collect()
}

/// A product of lines through the pole vanishes on as many azimuth lines as it has factors; a
/// product of circles, of degree 2 each, on as many angles from the normal. A line more takes in
/// the pole.
fn directions(grid: &Grid, basis: &Basis) -> Vec<Cause> {
    let mut causes = Vec::new();
    let Some(needs) = basis.directions().needs() else { return causes };
    let degree = needs.degree;
    match grid.azimuth_lines_rad.as_slice() {
        [phi_rad] if degree > 0 => causes.push(Cause::OneAzimuth { phi_rad: *phi_rad }),
        lines if (1..=degree).contains(&lines.len()) => {
            causes.push(Cause::Azimuths { distinct: lines.len(), degree });
        }
        _ => {}
    }
    let distinct = grid.theta_rad.len();
    let needed = if grid.has_pole() { needs.theta_with_pole } else { needs.theta };
    if distinct < needed {
        causes.push(Cause::Polar { distinct, degree, needed });
    }
    causes
}

/// The rank of a part of the basis over the rays.
fn rank(
    rays: &[Ray],
    terms: usize,
    basis: &Basis,
    fill: impl FnMut(&Ray, &mut Scratch, &mut [f64]),
) -> usize {
    spectrum(rays, terms, basis, fill).map_or(terms, |spectrum| spectrum.rank())
}

fn spectrum(
    rays: &[Ray],
    terms: usize,
    basis: &Basis,
    mut fill: impl FnMut(&Ray, &mut Scratch, &mut [f64]),
) -> Option<Spectrum> {
    let mut triangle = Triangle::new(terms, 0);
    let mut scratch = basis.scratch();
    let mut row = vec![0.0; terms];
    let mut largest = vec![0.0_f64; terms];
    for ray in rays {
        fill(ray, &mut scratch, &mut row);
        for (largest, value) in largest.iter_mut().zip(&row) {
            *largest = largest.max(value.abs());
        }
    }
    for ray in rays {
        fill(ray, &mut scratch, &mut row);
        // sin 2φ on the lines φ = 0 and 90° is what the sine's last digit leaves, and columns are
        // compared by direction, whatever their length.
        for (value, largest) in row.iter_mut().zip(&largest) {
            *value = if *largest < ROUNDING { 0.0 } else { *value };
        }
        triangle.absorb(&row);
    }
    triangle.solve()?.spectrum()
}

/// Where the rays are forgotten only the functions can be named.
pub(crate) fn by_functions(spectrum: &Spectrum, name: impl Fn(usize) -> String) -> FitError {
    let shares = spectrum.undetermined_shares();
    let mut by_share: Vec<usize> = (0..shares.len()).collect();
    by_share.sort_by(|a, b| shares[*b].total_cmp(&shares[*a]).then(a.cmp(b)));
    FitError::Undetermined {
        rank: spectrum.rank(),
        coefficients: shares.len(),
        causes: Vec::new(),
        functions: by_share.into_iter().take(NAMES_MAX).map(name).collect(),
    }
}

/// A basis function, which is of order 1, vanishes on the rays where it stays below this.
const ROUNDING: f64 = 1e-12;
/// Most functions that are named.
const NAMES_MAX: usize = 8;
/// A function with less than this share in the undetermined combinations isn't named.
const SHARE_MIN: f64 = 1e-3;
/// A cone of at least this share of the region's is not to blame.
const CONE_SHARE: f64 = 0.9;
