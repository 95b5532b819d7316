//! Partial fits as files: a share of the readings, to be merged with others.
//!
//! Eight bytes of name, the version and the header's length as little-endian u32, the count of
//! numbers as u64, the header in JSON
//! (what the fit stands for: quantity, chart, region, basis, optics, weights), then the triangle as
//! little-endian f64, packed by columns, and the CRC-64/XZ of all that. Only a share with the same
//! header in these points can be merged. The layout goes with the version: another one is refused.

use std::io::{self, Write};

use crc::{CRC_64_XZ, Crc};
use fit::partial::{Partial, Parts, Sums, Weighting};
use fit::{
    Angular, Around, BasisSpec, Chart, Face, Fine, FitError, Optics, Outline, Penalty, Position,
    Region,
};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::rig::Quantity;

/// What a file of a partial fit holds.
#[derive(Debug, Clone)]
pub struct PartialFile {
    /// The share.
    pub partial: Partial,
    /// What its values are.
    pub quantity: Quantity,
    /// The beam that its rows were averaged over.
    pub optics: Option<Optics>,
    /// Whether its samples come from a simulated rig.
    pub simulated: bool,
    /// Samples that carry a flag, used or not.
    pub n_flagged: u64,
    /// Samples left out on account of their flags.
    pub n_excluded: u64,
}

/// A partial fit as it was read, with what it stands for.
#[derive(Debug, Clone)]
pub struct ReadPartial {
    /// The share.
    pub partial: Partial,
    /// What its values are.
    pub quantity: Quantity,
    /// Whether its samples come from a simulated rig.
    pub simulated: bool,
    /// Samples that carry a flag, used or not.
    pub n_flagged: u64,
    /// Samples left out on account of their flags.
    pub n_excluded: u64,
    header: Header,
}

/// Why a file can't be taken for a partial fit.
#[derive(Debug, thiserror::Error)]
pub enum PartialFileError {
    /// Give files that `gonio fit --partial` wrote.
    #[error("no partial fit: expected a file that begins with \"gonio-pf\"")]
    Foreign,
    /// Write it again with this program.
    #[error("version {found} of partial fits; expected {VERSION}")]
    Version {
        /// As the file says.
        found: u32,
    },
    /// It was cut short, or something was added. Copy it or write it again.
    #[error("{found} bytes; expected {expected}: cut short, or not all of it is one partial fit")]
    Length {
        /// By the file's own header.
        expected: u64,
        /// In the file.
        found: u64,
    },
    /// Some bit is not what was written. Copy it or write it again.
    #[error("checksum {found:016x}; expected {expected:016x}: the file is corrupt")]
    Checksum {
        /// As the file says.
        expected: u64,
        /// Of its bytes.
        found: u64,
    },
    /// The header isn't what this version writes.
    #[error("header: {0}")]
    Header(String),
    /// The numbers don't belong together.
    #[error("{0}")]
    Fit(FitError),
}

/// Two shares that don't stand for the same.
#[derive(Debug, thiserror::Error)]
#[error("{key}: {found}; expected {expected}, as in the first")]
pub struct PartialsDiffer {
    key: &'static str,
    expected: String,
    found: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Header {
    program: String,
    quantity: String,
    chart: ChartHeader,
    basis: BasisHeader,
    penalty: PenaltyHeader,
    region: RegionHeader,
    optics: Value,
    weights: String,
    common: Vec<String>,
    readings: u64,
    value_squares: f64,
    sum_of_weights: f64,
    /// `null` where there are no readings.
    variance: Option<[f64; 2]>,
    simulated: bool,
    n_flagged: u64,
    n_excluded: u64,
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

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct PenaltyHeader {
    power: f64,
    strength: f64,
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

impl PartialFile {
    /// Writes it.
    pub fn write(&self, mut out: impl Write) -> io::Result<()> {
        let parts = self.partial.parts();
        let header = serde_json::to_vec(&self.header(&parts))?;
        let mut bytes = NAME.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend(u32::try_from(header.len()).map_err(io::Error::other)?.to_le_bytes());
        bytes.extend((parts.triangle.len() as u64).to_le_bytes());
        bytes.extend(header);
        for value in &parts.triangle {
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend(CRC.checksum(&bytes).to_le_bytes());
        out.write_all(&bytes)
    }

    fn header(&self, parts: &Parts) -> Header {
        let Sums { readings, value_squares, weights, variance: (low, high) } = parts.sums;
        let Region { x_m, y_m, theta_max_rad, chart } = parts.region;
        Header {
            program: format!("gonio {}", env!("CARGO_PKG_VERSION")),
            quantity: self.quantity.name().to_owned(),
            chart: ChartHeader::of(chart),
            basis: BasisHeader::of(parts.basis),
            penalty: PenaltyHeader { power: parts.penalty.power, strength: parts.penalty.strength },
            region: RegionHeader { x_m: x_m.into(), y_m: y_m.into(), theta_max_rad },
            optics: self.optics.as_ref().map_or(Value::Null, optics_json),
            weights: weights_name(parts.weighting).to_owned(),
            common: parts.common.clone(),
            readings,
            value_squares,
            sum_of_weights: weights,
            variance: (readings > 0).then_some([low, high]),
            simulated: self.simulated,
            n_flagged: self.n_flagged,
            n_excluded: self.n_excluded,
        }
    }
}

impl ReadPartial {
    /// Reads what [`PartialFile::write`] wrote.
    pub fn read(bytes: &[u8]) -> Result<Self, PartialFileError> {
        let (header, numbers) = sections(bytes)?;
        let header: Header = serde_json::from_slice(header)
            .map_err(|error| PartialFileError::Header(error.to_string()))?;
        let quantity = [Quantity::Radiance, Quantity::Luminance, Quantity::Relative]
            .into_iter()
            .find(|quantity| quantity.name() == header.quantity)
            .ok_or_else(|| unknown("quantity", &header.quantity))?;
        let weighting = [Weighting::Stated, Weighting::Alike]
            .into_iter()
            .find(|weighting| weights_name(*weighting) == header.weights)
            .ok_or_else(|| unknown("weights", &header.weights))?;
        let RegionHeader { x_m, y_m, theta_max_rad } = header.region;
        let parts = Parts {
            region: Region {
                x_m: x_m.into(),
                y_m: y_m.into(),
                theta_max_rad,
                chart: header.chart.chart(),
            },
            basis: header.basis.spec(),
            penalty: Penalty { power: header.penalty.power, strength: header.penalty.strength },
            weighting,
            common: header.common.clone(),
            sums: Sums {
                readings: header.readings,
                value_squares: header.value_squares,
                weights: header.sum_of_weights,
                variance: header.variance.map_or((f64::INFINITY, 0.0), Into::into),
            },
            triangle: numbers.chunks_exact(8).map(number).collect(),
        };
        let Header { simulated, n_flagged, n_excluded, .. } = header;
        let partial = Partial::from_parts(parts).map_err(PartialFileError::Fit)?;
        Ok(Self { partial, quantity, simulated, n_flagged, n_excluded, header })
    }

    /// Whether another share stands for the same.
    pub fn check(&self, other: &Self) -> Result<(), PartialsDiffer> {
        let points = |header: &Header| {
            [
                ("quantity", json!(header.quantity)),
                ("chart", json!(header.chart)),
                ("basis", json!(header.basis)),
                ("penalty", json!(header.penalty)),
                ("region", json!(header.region)),
                ("optics", header.optics.clone()),
                ("weights", json!(header.weights)),
                ("common components", json!(header.common)),
            ]
        };
        for ((key, expected), (_, found)) in
            points(&self.header).into_iter().zip(points(&other.header))
        {
            if expected != found {
                let (expected, found) = (expected.to_string(), found.to_string());
                return Err(PartialsDiffer { key, expected, found });
            }
        }
        Ok(())
    }
}

/// The header and the numbers of a file whose name, version, length and checksum are right.
fn sections(bytes: &[u8]) -> Result<(&[u8], &[u8]), PartialFileError> {
    let length = |expected| PartialFileError::Length { expected, found: bytes.len() as u64 };
    let rest = bytes.strip_prefix(NAME).ok_or(PartialFileError::Foreign)?;
    let least = || length((NAME.len() + 24) as u64);
    let (version, rest) = rest.split_first_chunk::<4>().ok_or_else(least)?;
    let found = u32::from_le_bytes(*version);
    if found != VERSION {
        return Err(PartialFileError::Version { found });
    }
    let (header, rest) = rest.split_first_chunk::<4>().ok_or_else(least)?;
    let (numbers, rest) = rest.split_first_chunk::<8>().ok_or_else(least)?;
    let (header, numbers) = (u32::from_le_bytes(*header), u64::from_le_bytes(*numbers));
    let before = (bytes.len() - rest.len()) as u64 + u64::from(header);
    let expected = numbers.saturating_mul(8).saturating_add(before + 8);
    if expected != bytes.len() as u64 {
        return Err(length(expected));
    }
    let (header, rest) = rest.split_at_checked(header as usize).ok_or_else(least)?;
    let (numbers, sum) = rest.split_last_chunk::<8>().ok_or_else(least)?;
    let expected = u64::from_le_bytes(*sum);
    let found = CRC.checksum(&bytes[..bytes.len() - sum.len()]);
    if found == expected {
        Ok((header, numbers))
    } else {
        Err(PartialFileError::Checksum { expected, found })
    }
}

fn number(bytes: &[u8]) -> f64 {
    f64::from_le_bytes(bytes.try_into().unwrap_or_default())
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn is_zero(spans: &[usize; 3]) -> bool {
    *spans == [0; 3]
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

fn optics_json(optics: &Optics) -> Value {
    let beam = optics.beam;
    let outline = match optics.outline {
        None => Value::Null,
        Some(Outline::Rectangle { x_m, y_m }) => json!({"x_m": x_m, "y_m": y_m}),
        Some(Outline::Disk { centre_m, radius_m }) => {
            json!({"centre_m": centre_m, "radius_m": radius_m})
        }
    };
    json!({
        "pupil_radius_m": beam.pupil_radius_m(),
        "stop_radius_m": beam.stop_radius_m(),
        "separation_m": beam.separation_m(),
        "stop_z_m": beam.stop_z_m(),
        "outline": outline,
    })
}

const NAME: &[u8] = b"gonio-pf";
const VERSION: u32 = 1;
static CRC: Crc<u64> = Crc::<u64>::new(&CRC_64_XZ);

#[cfg(test)]
#[path = "partial_file_tests.rs"]
mod tests;
