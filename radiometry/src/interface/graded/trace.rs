//! A ray through any field of index, to a plane or for a length, with an error bound. It knows neither
//! what the medium is nor what the ray carries.
//!
//! Steps of adapted size, then the same steps halved: the difference of both runs bounds the
//! error of the second, some thirty times too large where the steps are small enough for the order to show. If it is
//! larger than asked for, both run again with smaller ones.

use core::fmt;

use glam::DVec3;

use super::course::{Course, Run};
use super::steps::{Counted, State};
use crate::direction::normalised;
use crate::domain::{self, DomainError, finite_vector, positive};
use crate::estimate::Tolerance;

/// The index and its gradient at every place. Any `Fn(DVec3) -> (f64, DVec3)` is one.
pub trait IndexField {
    /// n, and ∇n in 1/m, at a place in metres. A gradient that is not that of n bends rays wrongly,
    /// and then |n dr/ds| is no longer n, which is found out: [`TraceError::Gradient`].
    fn at(&self, point_m: DVec3) -> (f64, DVec3);
}

impl<F: Fn(DVec3) -> (f64, DVec3)> IndexField for F {
    fn at(&self, point_m: DVec3) -> (f64, DVec3) {
        self(point_m)
    }
}

/// Where a ray is followed to.
/// Who needs it: whoever calls [`trace`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stop {
    /// Where it first crosses the plane after it started, from either side.
    Plane {
        /// A point of it.
        point_m: DVec3,
        /// Of any length.
        normal: DVec3,
    },
    /// After a length along the ray, m.
    Length(f64),
    /// After an optical path ∫ n ds, m.
    OpticalPath(f64),
}

/// Where a ray got to.
/// Who needs it: whoever calls [`trace`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Traced {
    /// Its place, m.
    pub point_m: DVec3,
    /// Its direction there, a unit vector.
    pub direction: DVec3,
    /// The index there.
    pub index: f64,
    /// Along the ray, m.
    pub length_m: f64,
    /// ∫ n ds, m.
    pub optical_path_m: f64,
    /// Bound of the distance from the true place, and of the optical path's error, m.
    pub error_bound_m: f64,
    /// Bound of the angle to the true direction, rad.
    pub direction_error_rad: f64,
    /// (n/n₀)²: what became of the radiance on the way, since L/n² stays.
    pub radiance_ratio: f64,
    /// How often the field was asked.
    pub evaluations: usize,
}

/// Why a ray has no end within the tolerance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TraceError {
    /// An argument, or the field on the ray's way, outside its domain.
    Domain(DomainError),
    /// The ray doesn't meet the plane within the length that it may have.
    Missed {
        /// How long it may be, m.
        length_max_m: f64,
    },
    /// |n dr/ds| is no longer n at the ray's end: the field's gradient is not that of its index, or the
    /// index jumps on the way (that is an interface, which refracts).
    Gradient {
        /// | |n dr/ds|/n - 1 |, 0 along every true ray.
        index_defect: f64,
    },
    /// The budget is spent, or more digits are lost to rounding than the tolerance grants. None where
    /// not even one run ended.
    Unmet {
        /// As far as it came.
        traced: Option<Traced>,
        /// What was asked for, m.
        allowed_m: f64,
    },
}

/// Follows a ray from a place, in a direction of any length, to its stop: d/ds(n dr/ds) = ∇n
/// (Born and Wolf 1999, eq. 3.2.2). Place and optical path are found within
/// `tolerance.absolute()` metres plus `tolerance.relative()` times the ray's length.
///
/// `length_max_m` is the longest that the ray may be; it also says how large a structure of the index
/// may be overlooked: no step is longer than a 32nd of it. A plane that is touched
/// and not crossed, or crossed twice within a step, is not met. The field has to go on a little beyond
/// the stop, where a last step may end.
/// Who needs it: the page on radiance along curved rays: gradient lenses, any field.
///
/// ```
/// use glam::DVec3;
/// use radiometry::Tolerance;
/// use radiometry::interface::{Stop, trace};
/// // In n² = n₀² (1 - α² y²) rays are sines: one that starts on the axis is back on it after
/// // half a period π cos γ/α, γ being its angle to the axis.
/// let (n_axis, alpha, gamma) = (1.6f64, 0.5, 0.3f64);
/// let rod = |r: DVec3| {
///     let n = n_axis * (1.0 - (alpha * r.y).powi(2)).sqrt();
///     (n, DVec3::Y * (-n_axis * n_axis * alpha * alpha * r.y / n))
/// };
/// let start = DVec3::new(gamma.cos(), gamma.sin(), 0.0);
/// let half_period = std::f64::consts::PI * gamma.cos() / alpha;
/// let stop = Stop::Plane { point_m: DVec3::X * half_period, normal: DVec3::X };
/// let end = trace(&rod, DVec3::ZERO, start, stop, 10.0, Tolerance::default())?;
/// assert!(end.point_m.distance(DVec3::X * half_period) <= end.error_bound_m);
/// assert!((end.radiance_ratio - 1.0).abs() < 1e-9); // the same index again
/// # Ok::<(), radiometry::interface::TraceError>(())
/// ```
pub fn trace(
    field: &impl IndexField,
    from_m: DVec3,
    direction: DVec3,
    stop: Stop,
    length_max_m: f64,
    tolerance: Tolerance,
) -> Result<Traced, TraceError> {
    let mut counted = Counted::new(field);
    let from_m = finite_vector("from", from_m)?;
    let direction = domain::direction("direction", direction)?;
    let (index, _) = counted.at(from_m)?;
    let start = State::new(from_m, index * normalised(direction).unwrap_or(DVec3::ZERO));
    let course = Course {
        start,
        stop: stop.checked()?,
        length_max_m: positive("length_max_m", length_max_m)?,
    };
    let (mut traced, mut allowed_m) = (None, tolerance.allowed(length_max_m));
    // A ray of a thousand steps adds up a thousand errors at worst; mostly they don't add.
    let mut step_error_m = 0.03 * allowed_m;
    loop {
        let coarse = course.adapted(&mut counted, step_error_m, tolerance.budget())?;
        let Some(coarse) = coarse else {
            return Err(TraceError::Unmet { traced, allowed_m });
        };
        let fine = course.halved(&mut counted, &coarse.steps, tolerance.budget())?;
        let Some(fine) = fine else {
            return Err(TraceError::Unmet { traced, allowed_m });
        };
        let found = compared(&coarse, &fine, &mut counted, index)?;
        allowed_m = tolerance.allowed(found.length_m);
        if found.error_bound_m <= allowed_m {
            return Ok(found);
        }
        traced = Some(found);
        let shrink = (0.5 * allowed_m / found.error_bound_m).clamp(1e-3, 0.25);
        step_error_m *= shrink;
        if step_error_m < 1e-19 * length_max_m {
            return Err(TraceError::Unmet { traced, allowed_m });
        }
    }
}

/// What the fine run found, with its distance from the coarse one as the bound.
fn compared<F: IndexField>(
    coarse: &Run,
    fine: &Run,
    counted: &mut Counted<'_, F>,
    index_at_start: f64,
) -> Result<Traced, TraceError> {
    /// Of the sums along the way, which are compensated, and of the slopes that they are of.
    const ROUNDING: f64 = 16.0 * f64::EPSILON;
    /// What a gradient by differences may be off by.
    const DEFECT_MAX: f64 = 1e-6;
    let (end, other) = (&fine.end, &coarse.end);
    let (place, towards) = (end.point_m(), end.optical_direction());
    let (index, gradient) = counted.at(place)?;
    let size = place.abs().max_element() + end.optical_path_m();
    let apart = (place - other.point_m())
        .length()
        .max((end.optical_path_m() - other.optical_path_m()).abs());
    let error_bound_m = apart + ROUNDING * size;
    let direction_error_rad = (towards - other.optical_direction()).length() / index + ROUNDING;
    let index_defect = (towards.length() / index - 1.0).abs();
    let by_place = error_bound_m * gradient.length() / index;
    if index_defect > 10.0f64.mul_add(direction_error_rad + by_place, DEFECT_MAX) {
        return Err(TraceError::Gradient { index_defect });
    }
    let ratio = index / index_at_start;
    Ok(Traced {
        point_m: place,
        direction: normalised(towards).unwrap_or(DVec3::ZERO),
        index,
        length_m: end.length_m(),
        optical_path_m: end.optical_path_m(),
        error_bound_m,
        direction_error_rad,
        radiance_ratio: ratio * ratio,
        evaluations: counted.evaluations,
    })
}

impl Stop {
    fn checked(self) -> Result<Self, DomainError> {
        Ok(match self {
            Self::Plane { point_m, normal } => {
                let normal = domain::direction("the plane's normal", normal)?;
                Self::Plane {
                    point_m: finite_vector("the plane's point", point_m)?,
                    normal: normalised(normal).unwrap_or(DVec3::ZERO),
                }
            }
            Self::Length(length_m) => Self::Length(positive("length_m", length_m)?),
            Self::OpticalPath(path_m) => Self::OpticalPath(positive("optical_path_m", path_m)?),
        })
    }

    /// 0 at the stop; it changes its sign there.
    pub(super) fn side(&self, state: &State) -> f64 {
        match self {
            Self::Plane { point_m, normal } => normal.dot(state.point_m() - *point_m),
            Self::Length(length_m) => state.length_m() - length_m,
            Self::OpticalPath(path_m) => state.optical_path_m() - path_m,
        }
    }
}

impl From<DomainError> for TraceError {
    fn from(error: DomainError) -> Self {
        Self::Domain(error)
    }
}

impl fmt::Display for TraceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Domain(error) => error.fmt(f),
            Self::Missed { length_max_m } => {
                write!(f, "the ray does not meet its stop within {length_max_m} m")
            }
            Self::Gradient { index_defect } => write!(
                f,
                "the ray's n dr/ds is off its index by {index_defect:e} of it, expected a field whose \
                 gradient is that of its index, without jumps"
            ),
            Self::Unmet { traced: Some(traced), allowed_m } => write!(
                f,
                "the ray's end is known within {:e} m after {} evaluations, expected within \
                 {allowed_m:e} m",
                traced.error_bound_m, traced.evaluations
            ),
            Self::Unmet { traced: None, allowed_m } => {
                write!(
                    f,
                    "the budget is spent before the ray's end, expected within {allowed_m:e} m"
                )
            }
        }
    }
}

impl core::error::Error for TraceError {}
