//! accuracy.csv: what was reached, against the rig time that it took.

use std::io::{self, Write};

use fit::Estimate;

use super::number::number;
use crate::rig::Quantity;

/// The uncertainty after a part of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AccuracyPoint {
    /// Rig time so far, seconds.
    pub rig_s: f64,
    /// Target readings so far.
    pub readings: u64,
    /// The exitance fitted to them.
    pub exitance: Estimate,
    /// The flux fitted to them.
    pub flux: Estimate,
}

/// Writes accuracy.csv, one line a point. Relative uncertainties of an exitance that is not
/// positive are left empty.
pub fn write_accuracy(
    out: impl Write,
    quantity: Quantity,
    points: &[AccuracyPoint],
) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    let (exitance, flux) = (quantity.exitance_key(), quantity.flux_key());
    csv.write_record([
        "rig_s",
        "readings",
        exitance,
        &format!("u_{exitance}"),
        &format!("u_independent_{exitance}"),
        "u_exitance_relative",
        flux,
        &format!("u_{flux}"),
    ])?;
    for point in points {
        let Estimate { value, u, u_independent } = point.exitance;
        csv.write_record([
            number(point.rig_s),
            point.readings.to_string(),
            number(value),
            number(u),
            number(u_independent),
            if value > 0.0 { number(u / value) } else { String::new() },
            number(point.flux.value),
            number(point.flux.u),
        ])?;
    }
    csv.flush()
}
