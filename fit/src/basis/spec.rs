//! Which basis: how fine in direction and in position. Names a basis; evaluates nothing.

use super::splines::{Band, PHI_SPANS_MIN, bands};
use crate::{Chart, FitError};

/// Which functions a field is a sum of: every function of direction times every one of position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BasisSpec {
    /// The functions of the direction.
    pub angular: Angular,
    /// The functions of the place on the sample.
    pub position: Position,
}

/// Functions of the direction, over the hemisphere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Angular {
    /// Zernike polynomials on the Nusselt disk up to degree n, (n + 1)(n + 2)/2 of them: smooth
    /// fields, and most others. They extrapolate better than all others between 80° and 90°.
    Zernike {
        /// The degree n.
        degree: usize,
        /// Further functions cos θ Z(2k,0), k from 0: a field that depends on cos θ itself, as limb
        /// darkening does, is no polynomial on the disk, which follows it but slowly.
        cosine_columns: usize,
    },
    /// Hemispherical harmonics up to degree l, (l + 1)² of them: lobes at grazing angles. Those
    /// that vary with φ vanish at the horizon, and readings are needed up to there.
    Hemispherical {
        /// The degree l.
        degree: usize,
    },
    /// The spherical harmonics that are even about the sample's plane (l + m even) up to degree l,
    /// (l + 1)(l + 2)/2 of them. They span what Zernike polynomials of that degree do, and
    /// are the better conditioned where directions are dense at grazing.
    EvenHarmonics {
        /// The degree l.
        degree: usize,
    },
    /// Cubic B-splines in θ times such in φ, of which there are the fewer the nearer the pole;
    /// smooth over it. For lobes that no polynomial follows.
    Splines {
        /// Equal spans of θ from the normal to the horizon.
        theta_spans: usize,
        /// Equal spans of φ round the horizon; round the cone θ about sin θ times as many.
        phi_spans: usize,
        /// Where spans are finer.
        fine: Fine,
    },
    /// Spherical harmonics up to degree l, (l + 1)² of them: directions all round, of the
    /// perpendicular and the environment chart. On the surface chart their upper half: nothing of
    /// them is bound at the horizon, and they are not independent of each other there, so that they
    /// want a [`Penalty`](crate::Penalty), under which they are a Gaussian process on the sphere.
    Spherical {
        /// The degree l.
        degree: usize,
    },
    /// Products of Legendre polynomials of the place in the second plane up to the total degree n,
    /// (n + 1)(n + 2)/2 of them: of the two-plane chart.
    SecondPlane {
        /// The total degree n.
        degree: usize,
    },
}

/// A stretch of θ whose spans are halved, for a lobe or an edge that is narrow in θ alone; and of φ,
/// for one that is narrow both ways.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fine {
    /// The first span of θ that is halved, from 0 at the normal.
    pub from: usize,
    /// The one after the last.
    pub to: usize,
    /// How often; 0 where spans of φ alone are halved.
    pub halvings: usize,
    /// Where spans of φ are halved within the stretch of θ.
    pub around: Around,
}

/// A stretch of φ whose spans are halved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Around {
    /// The first span round the horizon, from 0 at φ = 0.
    pub from: usize,
    /// The one after the last, counted on beyond a full turn where the stretch goes through φ = 0.
    pub to: usize,
    /// How often.
    pub halvings: usize,
}

impl Fine {
    /// All spans alike.
    pub const NONE: Self = Self { from: 0, to: 0, halvings: 0, around: Around::NONE };

    /// Of `[first, after_last, halvings]` among so many spans of θ and, if there is a second list, among
    /// so many of φ: whole numbers, the first below the second.
    pub fn of(
        numbers: &[f64],
        around: Option<&[f64]>,
        (theta_spans, phi_spans): (usize, usize),
    ) -> Option<Self> {
        let (from, to, halvings) = stretch(numbers)?;
        let (around, least) = match around {
            Some(around) => (Around::of(around, phi_spans)?, 0),
            None => (Around::NONE, 1),
        };
        let fine = Self { from, to, halvings, around };
        let is_sound = to <= theta_spans && (least..=HALVINGS_MAX).contains(&halvings);
        is_sound.then_some(fine)
    }

    /// Whether all spans are alike.
    pub fn is_none(&self) -> bool {
        self.to <= self.from || (self.halvings == 0 && self.around.is_none())
    }
}

impl Around {
    /// All spans alike.
    pub const NONE: Self = Self { from: 0, to: 0, halvings: 0 };

    fn of(numbers: &[f64], phi_spans: usize) -> Option<Self> {
        let (from, to, halvings) = stretch(numbers)?;
        let is_sound =
            from < phi_spans && to - from <= phi_spans && (1..=HALVINGS_MAX).contains(&halvings);
        is_sound.then_some(Self { from, to, halvings })
    }

    /// Whether all spans are alike.
    pub fn is_none(&self) -> bool {
        self.halvings == 0 || self.to <= self.from
    }
}

/// `[first, after_last, halvings]`: whole numbers, the first below the second.
fn stretch(numbers: &[f64]) -> Option<(usize, usize, usize)> {
    let whole = |i: usize| {
        let number = *numbers.get(i)?;
        let is_whole = number.fract() == 0.0 && (0.0..=f64::from(u16::MAX)).contains(&number);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // just bounded
        is_whole.then_some(number as usize)
    };
    let (from, to, halvings) = (whole(0)?, whole(1)?, whole(2)?);
    (numbers.len() == 3 && from < to).then_some((from, to, halvings))
}

/// Functions of the place on the sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Position {
    /// Products of Legendre polynomials in x and y up to the total degree d, (d + 1)(d + 2)/2 of
    /// them. Degree 0: alike everywhere.
    Legendre {
        /// The total degree d.
        degree: usize,
    },
    /// Products of cubic B-splines in x and y, (spans + 3)² of them, for what changes within the
    /// sample more often than a polynomial bends. Along a side without length: the constant alone.
    Splines {
        /// Equal spans along each side of the region.
        spans: usize,
    },
}

impl BasisSpec {
    /// Zernike polynomials of a degree times Legendre polynomials of a total degree.
    pub const fn zernike(angular_degree: usize, position_degree: usize) -> Self {
        Self {
            angular: Angular::Zernike { degree: angular_degree, cosine_columns: 0 },
            position: Position::Legendre { degree: position_degree },
        }
    }

    /// Number of coefficients, if a dense fit may hold them.
    pub(crate) fn checked_len(&self) -> Result<usize, FitError> {
        let coefficients = self.len();
        if coefficients <= COEFFICIENTS_MAX {
            Ok(coefficients)
        } else {
            Err(FitError::TooLarge { coefficients, coefficients_max: COEFFICIENTS_MAX })
        }
    }

    /// The same, if a fit of any kind may hold them: of functions that are local in direction more.
    pub(crate) fn checked_len_of_fit(&self) -> Result<usize, FitError> {
        match self.checked_len() {
            Err(FitError::TooLarge { coefficients, .. }) if self.is_local() => {
                if coefficients <= LOCAL_COEFFICIENTS_MAX {
                    Ok(coefficients)
                } else {
                    let coefficients_max = LOCAL_COEFFICIENTS_MAX;
                    Err(FitError::TooLarge { coefficients, coefficients_max })
                }
            }
            decided => decided,
        }
    }

    /// Whether the functions of the direction are zero but for a patch each.
    pub(crate) fn is_local(&self) -> bool {
        matches!(self.angular, Angular::Splines { .. })
    }

    /// Number of coefficients at most: splines over a region without length in x or in y have fewer.
    pub fn len(&self) -> usize {
        self.angular.len().saturating_mul(self.position.len())
    }

    /// Never: the constant is always there.
    pub fn is_empty(&self) -> bool {
        false
    }
}

impl Angular {
    /// Number of functions.
    #[expect(clippy::len_without_is_empty, reason = "there is always one")]
    pub fn len(&self) -> usize {
        match *self {
            Self::Zernike { degree, cosine_columns } => {
                triangular(degree).saturating_add(cosine_columns)
            }
            Self::Hemispherical { degree } | Self::Spherical { degree } => {
                degree.saturating_add(1).saturating_pow(2)
            }
            Self::EvenHarmonics { degree } | Self::SecondPlane { degree } => triangular(degree),
            // Counting the functions of so many spans takes long, and they are too many anyway.
            Self::Splines { theta_spans, phi_spans, fine }
                if spans(theta_spans, fine) > THETA_SPANS_MAX
                    || phi_spans > LOCAL_COEFFICIENTS_MAX
                    || fine.around.halvings > HALVINGS_MAX =>
            {
                usize::MAX
            }
            Self::Splines { theta_spans, phi_spans, fine } => {
                bands(theta_spans, phi_spans, fine).map(Band::len).sum()
            }
        }
    }

    /// Whether they are functions of that chart's rays.
    pub const fn is_of(&self, chart: &Chart) -> bool {
        match self {
            Self::Spherical { .. } => chart.is_whole_sphere() || matches!(chart, Chart::Surface),
            Self::SecondPlane { .. } => matches!(chart, Chart::TwoPlane { .. }),
            _ => matches!(chart, Chart::Surface),
        }
    }

    /// The degree of polynomials; `None` of splines.
    pub fn degree(&self) -> Option<usize> {
        match *self {
            Self::Zernike { degree, .. }
            | Self::Hemispherical { degree }
            | Self::EvenHarmonics { degree }
            | Self::Spherical { degree }
            | Self::SecondPlane { degree } => Some(degree),
            Self::Splines { .. } => None,
        }
    }

    /// The kind's name, as plans write it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Zernike { .. } => "zernike",
            Self::Hemispherical { .. } => "hemispherical",
            Self::EvenHarmonics { .. } => "even-harmonics",
            Self::Splines { .. } => "splines",
            Self::Spherical { .. } => "spherical",
            Self::SecondPlane { .. } => "legendre",
        }
    }
}

impl Position {
    /// Number of functions over a region with length in x and in y.
    #[expect(clippy::len_without_is_empty, reason = "there is always one")]
    pub fn len(&self) -> usize {
        match *self {
            Self::Legendre { degree } => triangular(degree),
            Self::Splines { spans } => spans.saturating_add(3).saturating_pow(2),
        }
    }

    /// The total degree of polynomials; `None` of splines.
    pub fn degree(&self) -> Option<usize> {
        match *self {
            Self::Legendre { degree } => Some(degree),
            Self::Splines { .. } => None,
        }
    }
}

/// Spans of θ, the halved ones counted as they are.
fn spans(theta_spans: usize, fine: Fine) -> usize {
    let halved = fine.to.min(theta_spans).saturating_sub(fine.from);
    if fine.halvings > HALVINGS_MAX {
        return usize::MAX;
    }
    theta_spans.saturating_add(halved.saturating_mul((1 << fine.halvings) - 1))
}

/// 1 + 2 + .. + (degree + 1).
fn triangular(degree: usize) -> usize {
    degree.saturating_add(1).saturating_mul(degree.saturating_add(2)) / 2
}

/// Beyond it the triangle alone takes 134 MB, and the factorisation minutes.
const COEFFICIENTS_MAX: usize = 4096;
/// Of local functions: their factor takes about a gigabyte.
const LOCAL_COEFFICIENTS_MAX: usize = 32_768;
/// Of θ: nearly every band holds [`PHI_SPANS_MIN`] functions or more.
const THETA_SPANS_MAX: usize = LOCAL_COEFFICIENTS_MAX / PHI_SPANS_MIN;
/// Spans beyond it are narrower than any encoder tells.
const HALVINGS_MAX: usize = 8;
