//! coverage.csv: one cell of a coverage study a line.

use std::io::{self, Write};

use super::number::number;
use crate::study::coverage::Cell;

/// Writes coverage.csv, the cells in the order in which they are handed in. A quantity that has no
/// ray leaves its columns empty.
pub fn write_coverage(out: impl Write, cells: &[Cell]) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    csv.write_record([
        "scene",
        "scale",
        "quantity",
        "x_mm",
        "y_mm",
        "theta_deg",
        "phi_deg",
        "runs",
        "rms_error_over_u",
        "mean_error_over_u",
        "covered",
        "covered_least",
        "covered_most",
        "median_u_relative",
        "rms_error_relative",
    ])?;
    for cell in cells {
        let ray = cell.target.ray;
        let of_ray = |value: fn(&fit::Ray) -> f64| ray.map_or(String::new(), |r| number(value(&r)));
        csv.write_record([
            cell.family.name(),
            cell.scale.name(),
            cell.target.kind.name(),
            &of_ray(|ray| ray.x_m * 1e3),
            &of_ray(|ray| ray.y_m * 1e3),
            &of_ray(|ray| ray.theta_rad.to_degrees()),
            &of_ray(|ray| ray.phi_rad.to_degrees()),
            &cell.tally.scores.to_string(),
            &number(cell.tally.rms),
            &number(cell.tally.mean),
            &cell.tally.covered.to_string(),
            &cell.band.0.to_string(),
            &cell.band.1.to_string(),
            &number(cell.tally.median_u),
            &number(cell.tally.rms_error),
        ])?;
    }
    csv.flush()
}
