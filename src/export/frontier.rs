//! frontier.csv: one scored run a line.

use std::io::{self, Write};

use super::number::number;
use crate::study::{ForetoldUncertainty, FrontierRow};

/// Writes frontier.csv, the rows in the order in which they are handed in. What was not foretold is
/// an empty field.
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
        "error_exitance_shape_relative",
        "predicted_rig_s",
        "predicted_u_radiance_relative",
        "predicted_u_shape_relative",
        "predicted_u_exitance_relative",
        "predicted_u_exitance_shape_relative",
        "way_s",
        "dwelling_s",
        "photon_limit_relative",
    ])?;
    for row in rows {
        let known = row.foretold;
        let foretold = |value: fn(&ForetoldUncertainty) -> f64| {
            known.uncertainty.as_ref().map(|u| number(value(u))).unwrap_or_default()
        };
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
            &number(row.error_exitance_shape_relative),
            &number(known.rig_s),
            &foretold(|u| u.radiance),
            &foretold(|u| u.shape),
            &foretold(|u| u.exitance),
            &foretold(|u| u.exitance_shape),
            &number(known.way_s),
            &number(known.dwelling_s),
            &foretold(|u| u.photon_limit),
        ])?;
    }
    csv.flush()
}
