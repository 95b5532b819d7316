//! The header of a partial fit's file: what the share stands for, in JSON, so that a person can read it, and how the
//! numbers after it are to be taken. It does not know the file's frame.

use fit::partial::{FinerParts, Parts, Sums, Weighting};
use fit::{
    Angular, Around, BasisSpec, Chart, Face, Fine, Optics, Outline, Penalty, Position, Region,
};
use radiometry::beam::Beam;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::partial_file::{PartialFile, PartialFileError};
use crate::rig::Quantity;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Header {
    program: String,
    quantity: String,
    chart: ChartHeader,
    basis: BasisHeader,
    penalty: PenaltyHeader,
    region: RegionHeader,
    optics: Option<OpticsHeader>,
    weights: String,
    common: Vec<String>,
    /// How many of the numbers say where the readings lie.
    whereabouts: usize,
    /// Of those after them; `null` where nothing was kept of finer functions.
    finer: Option<FinerHeader>,
    readings: u64,
    value_squares: f64,
    sum_of_weights: f64,
    /// `null` where there are no readings.
    variance: Option<[f64; 2]>,
    pub(super) simulated: bool,
    pub(super) n_flagged: u64,
    pub(super) n_excluded: u64,
}

/// Its kind's name, and what that kind has.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum AngularHeader {
    Zernike {
        degree: usize,
        cosine_columns: usize,
    },
    Hemispherical {
        degree: usize,
    },
    EvenHarmonics {
        degree: usize,
    },
    Splines {
        theta_spans: usize,
        phi_spans: usize,
        /// First, one after the last, and how often each is halved.
        #[serde(default)]
        fine_spans: [usize; 3],
        /// The same of φ within.
        #[serde(default, skip_serializing_if = "is_zero")]
        fine_phi_spans: [usize; 3],
    },
    Spherical {
        degree: usize,
    },
    SecondPlane {
        degree: usize,
    },
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum PositionHeader {
    Legendre { degree: usize },
    Splines { spans: usize },
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct BasisHeader {
    angular: AngularHeader,
    position: PositionHeader,
}

/// What comes last.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct FinerHeader {
    common: Vec<String>,
    numbers: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct PenaltyHeader {
    power: f64,
    strength: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct OpticsHeader {
    pupil_radius_m: f64,
    stop_radius_m: f64,
    separation_m: f64,
    stop_z_m: f64,
    outline: Option<OutlineHeader>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum OutlineHeader {
    Rectangle { x_m: [f64; 2], y_m: [f64; 2] },
    Disk { centre_m: [f64; 2], radius_m: f64 },
}

/// Its name, and what of the region that chart alone has.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum ChartHeader {
    Surface,
    Perpendicular { round: bool },
    Environment,
    TwoPlane { distance_m: f64, s_m: [f64; 2], t_m: [f64; 2] },
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct RegionHeader {
    x_m: [f64; 2],
    y_m: [f64; 2],
    theta_max_rad: f64,
}

impl ChartHeader {
    fn of(chart: Chart) -> Self {
        match chart {
            Chart::Surface => Self::Surface,
            Chart::Perpendicular { face } => Self::Perpendicular { round: face == Face::Disk },
            Chart::Environment => Self::Environment,
            Chart::TwoPlane { distance_m, s_m, t_m } => {
                Self::TwoPlane { distance_m, s_m: s_m.into(), t_m: t_m.into() }
            }
        }
    }

    fn chart(&self) -> Chart {
        match *self {
            Self::Surface => Chart::Surface,
            Self::Perpendicular { round: true } => Chart::Perpendicular { face: Face::Disk },
            Self::Perpendicular { round: false } => Chart::Perpendicular { face: Face::Rectangle },
            Self::Environment => Chart::Environment,
            Self::TwoPlane { distance_m, s_m, t_m } => {
                Chart::TwoPlane { distance_m, s_m: s_m.into(), t_m: t_m.into() }
            }
        }
    }
}

impl OpticsHeader {
    fn of(optics: &Optics) -> Self {
        let beam = optics.beam;
        let outline = optics.outline.map(|outline| match outline {
            Outline::Rectangle { x_m, y_m } => {
                OutlineHeader::Rectangle { x_m: x_m.into(), y_m: y_m.into() }
            }
            Outline::Disk { centre_m, radius_m } => {
                OutlineHeader::Disk { centre_m: centre_m.into(), radius_m }
            }
        });
        Self {
            pupil_radius_m: beam.pupil_radius_m(),
            stop_radius_m: beam.stop_radius_m(),
            separation_m: beam.separation_m(),
            stop_z_m: beam.stop_z_m(),
            outline,
        }
    }

    fn optics(&self) -> Result<Optics, PartialFileError> {
        let Self { pupil_radius_m, stop_radius_m, separation_m, stop_z_m, outline } = self;
        let beam = Beam::of_tube(*pupil_radius_m, *stop_radius_m, *separation_m, 0.0)
            .map_err(|error| PartialFileError::Header(format!("optics: {error}")))?
            .with_origin_moved(-stop_z_m);
        let outline = outline.as_ref().map(|outline| match *outline {
            OutlineHeader::Rectangle { x_m, y_m } => {
                Outline::Rectangle { x_m: x_m.into(), y_m: y_m.into() }
            }
            OutlineHeader::Disk { centre_m, radius_m } => {
                Outline::Disk { centre_m: centre_m.into(), radius_m }
            }
        });
        Ok(Optics { beam, outline })
    }
}

impl Header {
    /// Of a file and the numbers of its share.
    pub(super) fn of(file: &PartialFile, parts: &Parts) -> Self {
        let Sums { readings, value_squares, weights, variance: (low, high) } = parts.sums;
        let Region { x_m, y_m, theta_max_rad, chart } = parts.region;
        Self {
            program: format!("gonio {}", env!("CARGO_PKG_VERSION")),
            quantity: file.quantity.name().to_owned(),
            chart: ChartHeader::of(chart),
            basis: BasisHeader::of(parts.basis),
            penalty: PenaltyHeader { power: parts.penalty.power, strength: parts.penalty.strength },
            region: RegionHeader { x_m: x_m.into(), y_m: y_m.into(), theta_max_rad },
            optics: file.optics.as_ref().map(OpticsHeader::of),
            weights: weights_name(parts.weighting).to_owned(),
            common: parts.common.clone(),
            whereabouts: parts.whereabouts.len(),
            finer: parts.finer.as_ref().map(|finer| FinerHeader {
                common: finer.common.clone(),
                numbers: finer.numbers.len(),
            }),
            readings,
            value_squares,
            sum_of_weights: weights,
            variance: (readings > 0).then_some([low, high]),
            simulated: file.simulated,
            n_flagged: file.n_flagged,
            n_excluded: file.n_excluded,
        }
    }

    pub(super) fn quantity(&self) -> Result<Quantity, PartialFileError> {
        [Quantity::Radiance, Quantity::Luminance, Quantity::Relative]
            .into_iter()
            .find(|quantity| quantity.name() == self.quantity)
            .ok_or_else(|| unknown("quantity", &self.quantity))
    }

    pub(super) fn optics(&self) -> Result<Option<Optics>, PartialFileError> {
        self.optics.as_ref().map(OpticsHeader::optics).transpose()
    }

    /// What all shares of a merge have alike, by name.
    pub(super) fn points(&self) -> [(&'static str, Value); 9] {
        [
            ("quantity", json!(self.quantity)),
            ("chart", json!(self.chart)),
            ("basis", json!(self.basis)),
            ("penalty", json!(self.penalty)),
            ("region", json!(self.region)),
            ("optics", json!(self.optics)),
            ("weights", json!(self.weights)),
            ("common components", json!(self.common)),
            ("truncation", json!(if self.finer.is_some() { "kept" } else { "none" })),
        ]
    }

    /// The share, of the numbers after the header.
    pub(super) fn parts(&self, numbers: &[f64]) -> Result<Parts, PartialFileError> {
        let weighting = [Weighting::Stated, Weighting::Alike]
            .into_iter()
            .find(|weighting| weights_name(*weighting) == self.weights)
            .ok_or_else(|| unknown("weights", &self.weights))?;
        let RegionHeader { x_m, y_m, theta_max_rad } = self.region;
        let few = || PartialFileError::Header("more numbers than there are".to_owned());
        let finer = self.finer.as_ref().map_or(0, |finer| finer.numbers);
        let before = numbers.len().checked_sub(finer).ok_or_else(few)?;
        let (numbers, finer) = numbers.split_at(before);
        let before = numbers.len().checked_sub(self.whereabouts).ok_or_else(few)?;
        let (triangle, whereabouts) = numbers.split_at(before);
        Ok(Parts {
            region: Region {
                x_m: x_m.into(),
                y_m: y_m.into(),
                theta_max_rad,
                chart: self.chart.chart(),
            },
            basis: self.basis.spec(),
            penalty: Penalty { power: self.penalty.power, strength: self.penalty.strength },
            weighting,
            common: self.common.clone(),
            sums: Sums {
                readings: self.readings,
                value_squares: self.value_squares,
                weights: self.sum_of_weights,
                variance: self.variance.map_or((f64::INFINITY, 0.0), Into::into),
            },
            triangle: triangle.to_vec(),
            whereabouts: whereabouts.to_vec(),
            finer: self.finer.as_ref().map(|header| FinerParts {
                common: header.common.clone(),
                numbers: finer.to_vec(),
            }),
        })
    }
}

impl BasisHeader {
    fn of(spec: BasisSpec) -> Self {
        let angular = match spec.angular {
            Angular::Zernike { degree, cosine_columns } => {
                AngularHeader::Zernike { degree, cosine_columns }
            }
            Angular::Hemispherical { degree } => AngularHeader::Hemispherical { degree },
            Angular::EvenHarmonics { degree } => AngularHeader::EvenHarmonics { degree },
            Angular::Splines { theta_spans, phi_spans, fine } => {
                let fine_spans = [fine.from, fine.to, fine.halvings];
                let Around { from, to, halvings } = fine.around;
                let fine_phi_spans = [from, to, halvings];
                AngularHeader::Splines { theta_spans, phi_spans, fine_spans, fine_phi_spans }
            }
            Angular::Spherical { degree } => AngularHeader::Spherical { degree },
            Angular::SecondPlane { degree } => AngularHeader::SecondPlane { degree },
        };
        let position = match spec.position {
            Position::Legendre { degree } => PositionHeader::Legendre { degree },
            Position::Splines { spans } => PositionHeader::Splines { spans },
        };
        Self { angular, position }
    }

    fn spec(&self) -> BasisSpec {
        let angular = match self.angular {
            AngularHeader::Zernike { degree, cosine_columns } => {
                Angular::Zernike { degree, cosine_columns }
            }
            AngularHeader::Hemispherical { degree } => Angular::Hemispherical { degree },
            AngularHeader::EvenHarmonics { degree } => Angular::EvenHarmonics { degree },
            AngularHeader::Splines { theta_spans, phi_spans, fine_spans, fine_phi_spans } => {
                let [from, to, halvings] = fine_phi_spans;
                let around = Around { from, to, halvings };
                let [from, to, halvings] = fine_spans;
                let fine = Fine { from, to, halvings, around };
                Angular::Splines { theta_spans, phi_spans, fine }
            }
            AngularHeader::Spherical { degree } => Angular::Spherical { degree },
            AngularHeader::SecondPlane { degree } => Angular::SecondPlane { degree },
        };
        let position = match self.position {
            PositionHeader::Legendre { degree } => Position::Legendre { degree },
            PositionHeader::Splines { spans } => Position::Splines { spans },
        };
        BasisSpec { angular, position }
    }
}

fn unknown(key: &str, found: &impl ToString) -> PartialFileError {
    PartialFileError::Header(format!("{key} {}: this program knows no such", found.to_string()))
}

fn weights_name(weighting: Weighting) -> &'static str {
    match weighting {
        Weighting::Stated => "by the stated uncertainty of each sample",
        Weighting::Alike => "alike, the samples stating no uncertainty",
    }
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn is_zero(spans: &[usize; 3]) -> bool {
    *spans == [0; 3]
}
