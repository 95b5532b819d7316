//! frontier.csv: one scored run a line.

use std::io::{self, Write};

use super::number::number;
use crate::study::FrontierRow;

/// Writes frontier.csv, the rows in the order in which they are handed in.
pub fn write_frontier(out: impl Write, rows: &[FrontierRow]) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    csv.write_record([
        "scene",
        "strategy",
        "parameters",
        "seed",
        "rig_s",
        "readings",
        "error_radiance_rms_relative",
        "error_exitance_relative",
        "error_flux_relative",
        "u_exitance_relative",
        "compute_s",
        "error_shape_rms_relative",
    ])?;
    for row in rows {
        csv.write_record([
            &row.scene,
            &row.strategy,
            &row.parameters,
            &row.seed.to_string(),
            &number(row.rig_s),
            &row.readings.to_string(),
            &number(row.error_radiance_rms_relative),
            &number(row.error_exitance_relative),
            &number(row.error_flux_relative),
            &number(row.u_exitance_relative),
            &number(row.compute_s),
            &number(row.error_shape_rms_relative),
        ])?;
    }
    csv.flush()
}
