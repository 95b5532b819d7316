//! samples.csv: one line a sample, in the plan's order of targets.

use std::io::{self, Write};

use super::number::number;
use crate::rig::calibration::Sample;
use crate::rig::{Pose, Quantity};

/// A ray in the units of files: millimetres and degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayColumns {
    /// Where it leaves the sample, mm.
    pub x_mm: f64,
    /// Where it leaves the sample, mm.
    pub y_mm: f64,
    /// From the sample's normal, degrees.
    pub theta_deg: f64,
    /// From +x towards +y, degrees.
    pub phi_deg: f64,
}

impl RayColumns {
    /// The columns' names, in their order.
    pub const NAMES: [&str; 4] = ["x_mm", "y_mm", "theta_deg", "phi_deg"];

    /// The numbers, in the order of the names.
    pub const fn numbers(self) -> [f64; 4] {
        [self.x_mm, self.y_mm, self.theta_deg, self.phi_deg]
    }

    /// In the units of the program.
    pub fn ray(self) -> fit::Ray {
        fit::Ray {
            x_m: self.x_mm * 1e-3,
            y_m: self.y_mm * 1e-3,
            theta_rad: self.theta_deg.to_radians(),
            phi_rad: self.phi_deg.to_radians(),
        }
    }
}

impl From<Pose> for RayColumns {
    fn from(pose: Pose) -> Self {
        Self {
            x_mm: pose.x_m * 1e3,
            y_mm: pose.y_m * 1e3,
            theta_deg: pose.theta_rad.to_degrees(),
            phi_deg: pose.phi_rad.to_degrees(),
        }
    }
}

/// Writes samples.csv. The columns of the contract come first; after them the parts of the
/// uncertainty, the repeat, and the reading in readings.csv.
pub fn write_samples(out: impl Write, quantity: Quantity, samples: &[Sample]) -> io::Result<()> {
    let mut file = SamplesFile::new(out, quantity)?;
    file.append(samples)?;
    file.close()
}

/// samples.csv, some samples after the others: for a run whose samples are not all kept.
#[derive(Debug)]
pub struct SamplesFile<W: Write>(csv::Writer<W>);

impl<W: Write> SamplesFile<W> {
    /// Begins it with its header.
    pub fn new(out: W, quantity: Quantity) -> io::Result<Self> {
        let mut csv = csv::Writer::from_writer(out);
        csv.write_record(columns(quantity.radiance_column()))?;
        Ok(Self(csv))
    }

    /// Writes a line a sample, in their order.
    pub fn append(&mut self, samples: &[Sample]) -> io::Result<()> {
        for sample in samples {
            let [x, y, theta, phi] = RayColumns::from(sample.pose).numbers().map(number);
            self.0.write_record([
                sample.index.to_string(),
                number(sample.time_s),
                x,
                y,
                theta,
                phi,
                number(sample.value),
                number(sample.u),
                number(sample.dwell_s),
                sample.flags.to_string(),
                number(sample.u_independent),
                number(sample.u_common),
                sample.repeat.to_string(),
                sample.reading.to_string(),
            ])?;
        }
        Ok(())
    }

    /// After the last one.
    pub fn close(mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// The header of samples.csv, `radiance` being the quantity's column.
fn columns(radiance: &str) -> [String; 14] {
    [
        "index",
        "time_s",
        "x_mm",
        "y_mm",
        "theta_deg",
        "phi_deg",
        radiance,
        &format!("u_{radiance}"),
        "dwell_s",
        "flags",
        &format!("u_independent_{radiance}"),
        &format!("u_common_{radiance}"),
        "repeat",
        "reading",
    ]
    .map(str::to_owned)
}
