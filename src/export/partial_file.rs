//! Partial fits as files: a share of the readings, to be merged with others.
//!
//! Eight bytes of name, the version and the header's length as little-endian u32, the count of
//! numbers as u64, the header in JSON
//! (what the fit stands for: quantity, chart, region, basis, optics, weights), then as
//! little-endian f64 the triangle, packed by columns, where the readings lie, and what they say of finer functions,
//! and the CRC-64/XZ of all that. Only a share with the same
//! header in these points can be merged. The layout goes with the version: another one is refused.

use std::io::{self, Write};

use crc::{CRC_64_XZ, Crc};
use fit::partial::Partial;
use fit::{FitError, Optics};

use super::partial_header::Header;
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
    /// The beam that its rows were averaged over.
    pub optics: Option<Optics>,
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
    #[error(
        "version {found} of partial fits; expected {VERSION}: write it again with this program"
    )]
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

impl PartialFile {
    /// Writes it.
    pub fn write(&self, mut out: impl Write) -> io::Result<()> {
        let parts = self.partial.parts();
        let header = serde_json::to_vec(&Header::of(self, &parts))?;
        let mut bytes = NAME.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend(u32::try_from(header.len()).map_err(io::Error::other)?.to_le_bytes());
        let finer = parts.finer.as_ref().map_or(&[][..], |finer| &finer.numbers);
        let numbers = [&parts.triangle, &parts.whereabouts, finer].concat();
        bytes.extend((numbers.len() as u64).to_le_bytes());
        bytes.extend(header);
        for value in numbers {
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend(CRC.checksum(&bytes).to_le_bytes());
        out.write_all(&bytes)
    }
}

impl ReadPartial {
    /// Reads what [`PartialFile::write`] wrote.
    pub fn read(bytes: &[u8]) -> Result<Self, PartialFileError> {
        let (header, numbers) = sections(bytes)?;
        let header: Header = serde_json::from_slice(header)
            .map_err(|error| PartialFileError::Header(error.to_string()))?;
        let number = |bytes: &[u8; 8]| f64::from_le_bytes(*bytes);
        let numbers: Vec<f64> = numbers.as_chunks().0.iter().map(number).collect();
        let (quantity, optics, parts) =
            (header.quantity()?, header.optics()?, header.parts(&numbers)?);
        let Header { simulated, n_flagged, n_excluded, .. } = header;
        let partial = Partial::from_parts(parts).map_err(PartialFileError::Fit)?;
        Ok(Self { partial, quantity, optics, simulated, n_flagged, n_excluded, header })
    }

    /// Whether another share stands for the same.
    pub fn check(&self, other: &Self) -> Result<(), PartialsDiffer> {
        for ((key, expected), (_, found)) in
            self.header.points().into_iter().zip(other.header.points())
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

const NAME: &[u8] = b"gonio-pf";
const VERSION: u32 = 2;
static CRC: Crc<u64> = Crc::<u64>::new(&CRC_64_XZ);

#[cfg(test)]
#[path = "partial_file_tests.rs"]
mod tests;
