//! What of a fit's basis a person has decided. Knows no reading.

use super::family::Strengths;
use crate::{Angular, BasisSpec, Chart, Fine, Penalised, Penalty, Position, Rules, sparse};

/// A kind of functions of the direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AngularKind {
    /// [`Angular::Zernike`].
    Zernike,
    /// [`Angular::Hemispherical`].
    Hemispherical,
    /// [`Angular::EvenHarmonics`].
    EvenHarmonics,
    /// [`Angular::Splines`].
    Splines,
    /// [`Angular::Spherical`].
    Spherical,
    /// [`Angular::SecondPlane`].
    SecondPlane,
}

impl AngularKind {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Zernike,
        Self::Hemispherical,
        Self::EvenHarmonics,
        Self::Splines,
        Self::Spherical,
        Self::SecondPlane,
    ];
    /// Those of the surface chart.
    pub const OF_SURFACE: [Self; 5] =
        [Self::Zernike, Self::Hemispherical, Self::EvenHarmonics, Self::Spherical, Self::Splines];

    /// The one that has degrees, and is taken where a degree is named and no kind.
    pub const fn of_chart(chart: &Chart) -> Self {
        match chart {
            Chart::Surface => Self::Zernike,
            Chart::Perpendicular { .. } | Chart::Environment => Self::Spherical,
            Chart::TwoPlane { .. } => Self::SecondPlane,
        }
    }

    /// The functions of a degree; splines have none.
    pub const fn of_degree(self, degree: usize) -> Option<Angular> {
        match self {
            Self::Zernike => Some(Angular::Zernike { degree, cosine_columns: 0 }),
            Self::Hemispherical => Some(Angular::Hemispherical { degree }),
            Self::EvenHarmonics => Some(Angular::EvenHarmonics { degree }),
            Self::Spherical => Some(Angular::Spherical { degree }),
            Self::SecondPlane => Some(Angular::SecondPlane { degree }),
            Self::Splines => None,
        }
    }

    /// As plans write it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Zernike => "zernike",
            Self::Hemispherical => "hemispherical",
            Self::EvenHarmonics => "even-harmonics",
            Self::Splines => "splines",
            Self::Spherical => "spherical",
            Self::SecondPlane => "legendre",
        }
    }
}

/// How fine splines in direction are, as [`Angular::Splines`] says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Spans {
    /// Equal spans of θ from the normal to the horizon.
    pub theta: usize,
    /// Equal spans of φ round the horizon.
    pub phi: usize,
    /// Where spans of θ are finer.
    pub fine: Fine,
}

/// What a person has decided; the rest is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wish {
    /// Which functions of the direction.
    pub kind: Option<AngularKind>,
    /// Their degree; splines have none. A degree without a kind means Zernike polynomials.
    pub angular_degree: Option<usize>,
    /// Beside the degree of Zernike polynomials, their cosine columns; none unless said.
    pub cosine_columns: Option<usize>,
    /// The spans of splines in direction, which no degree goes with.
    pub spans: Option<Spans>,
    /// Total degree in the position.
    pub position_degree: Option<usize>,
    /// Spans of splines in the position, instead of a degree.
    pub position_spans: Option<usize>,
    /// [`Penalty::power`]; 0 for none.
    pub penalty_power: Option<f64>,
    /// [`Penalty::strength`]; 0 for none. Of power 2 unless another is wished for.
    pub penalty_strength: Option<f64>,
    /// What holds beyond the basis.
    pub rules: Rules,
}

impl Wish {
    /// The same for a chart: of those other than the surface one there is one kind alone.
    #[must_use]
    pub fn in_chart(self, chart: &Chart) -> Self {
        let only = (*chart != Chart::Surface).then(|| AngularKind::of_chart(chart));
        Self { kind: self.kind.or(only), ..self }
    }

    /// What can't be wished for together.
    pub fn clash(&self) -> Option<WishClash> {
        let is_splines = self.kind == Some(AngularKind::Splines);
        let is_zernike = self.kind.is_none_or(|kind| kind == AngularKind::Zernike);
        if (is_splines || self.spans.is_some()) && self.angular_degree.is_some() {
            Some(WishClash::DegreeOfSplines)
        } else if self.spans.is_some() && self.kind.is_some() && !is_splines {
            Some(WishClash::SpansOfOthers)
        } else if self.cosine_columns.is_some() && !(is_zernike && self.angular_degree.is_some()) {
            Some(WishClash::CosineColumns)
        } else if self.position_degree.is_some() && self.position_spans.is_some() {
            Some(WishClash::DegreeAndSpans)
        } else if self.splines_of_open_strength().is_some() {
            Some(WishClash::OpenStrength)
        } else {
            None
        }
    }

    /// How many splines are pinned, where they are too many for a choice to go through strengths of
    /// their penalty and none is named.
    pub(super) fn splines_of_open_strength(&self) -> Option<usize> {
        let basis = self.basis()?;
        (self.penalty().is_none() && sparse::is_called_for(basis)).then(|| basis.len())
    }

    /// The one model that is left; `None` if there is something to choose. Who names the degree
    /// in direction gets plain least squares unless a penalty is named too; of splines, which few
    /// readings determine by themselves, the penalty is chosen unless it is named.
    pub fn decided(&self) -> Option<Penalised> {
        Some(Penalised::new(self.basis()?, self.penalty()?))
    }

    /// The basis, if all of it is pinned; its penalty may be open.
    pub fn basis(&self) -> Option<BasisSpec> {
        Some(BasisSpec { angular: self.angular()?, position: self.position()? })
    }

    /// The functions of the direction, if they are pinned.
    pub(crate) fn angular(&self) -> Option<Angular> {
        if let Some(Spans { theta, phi, fine }) = self.spans {
            return Some(Angular::Splines { theta_spans: theta, phi_spans: phi, fine });
        }
        let degree = self.angular_degree?;
        match (self.kind.unwrap_or(AngularKind::Zernike), self.cosine_columns) {
            (AngularKind::Zernike, Some(cosine_columns)) => {
                Some(Angular::Zernike { degree, cosine_columns })
            }
            (kind, _) => kind.of_degree(degree),
        }
    }

    /// The functions of the position, if they are pinned.
    pub(super) fn position(&self) -> Option<Position> {
        let splines = self.position_spans.map(|spans| Position::Splines { spans });
        splines.or(self.position_degree.map(|degree| Position::Legendre { degree }))
    }

    pub(super) fn penalty(&self) -> Option<Penalty> {
        match (self.penalty_power, self.penalty_strength) {
            (Some(0.0), _) | (_, Some(0.0)) => Some(Penalty::NONE),
            (power, Some(strength)) => Some(Penalty { power: power.unwrap_or(2.0), strength }),
            (None, None) if self.angular_degree.is_some() => Some(Penalty::NONE),
            (_, None) => None,
        }
    }

    pub(super) fn strengths(&self, scale_min: f64) -> Strengths {
        let (power, strength) = match self.penalty() {
            Some(penalty) if penalty.is_none() => (Some(0.0), Some(0.0)),
            Some(penalty) => (Some(penalty.power), Some(penalty.strength)),
            None => (self.penalty_power, None),
        };
        Strengths { power, strength, scale_min }
    }
}

/// Two wishes of which one can be had.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WishClash {
    /// Splines with a degree.
    DegreeOfSplines,
    /// Spans of functions that have a degree.
    SpansOfOthers,
    /// Cosine columns without the degree of Zernike polynomials beside which they stand.
    CosineColumns,
    /// A degree and spans, both of the position.
    DegreeAndSpans,
    /// More splines than a strength of their penalty is chosen for, and none named.
    OpenStrength,
}

impl WishClash {
    /// What would be in order.
    pub const fn expected(self) -> &'static str {
        match self {
            Self::DegreeOfSplines => "no angular degree beside splines",
            Self::SpansOfOthers => "spans of theta and phi beside splines alone",
            Self::CosineColumns => "an angular degree of Zernike polynomials beside cosine columns",
            Self::DegreeAndSpans => "a position degree, or position spans",
            Self::OpenStrength => "a penalty strength beside more than 2000 splines, 0 for none",
        }
    }

    /// What to do.
    pub const fn help(self) -> &'static str {
        match self {
            Self::DegreeOfSplines => {
                "leave it out: how many splines there are is chosen from the readings, or said by spans of \
                 theta and phi"
            }
            Self::SpansOfOthers => "leave the spans out, or ask for splines",
            Self::CosineColumns => "add the degree, or leave them to be chosen",
            Self::DegreeAndSpans => "leave one of them out",
            Self::OpenStrength => {
                "name it, as the choice in the fit.json of a coarser fit does, or ask for fewer spans"
            }
        }
    }
}

impl std::fmt::Display for WishClash {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::DegreeOfSplines => "splines have no degree to choose: they are cubic",
            Self::SpansOfOthers => "polynomials and harmonics have a degree and no spans",
            Self::CosineColumns => "cosine columns stand beside Zernike polynomials of a degree",
            Self::OpenStrength => "no strength of the penalty is chosen for so many splines",
            Self::DegreeAndSpans => "the position has polynomials of a degree or splines of spans",
        })
    }
}
