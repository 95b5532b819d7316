//! compute.csv: one point of error against processor time a line. It does not know how it was measured.

use std::io::{self, Write};

use super::number::number;
use crate::study::arithmetic::Spot;

/// Writes compute.csv, in the order in which the points are handed in.
pub fn write_compute(out: impl Write, spots: &[Spot]) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    csv.write_record(["study", "method", "effort", "seconds", "error_relative"])?;
    for Spot { study, method, effort, seconds, error } in spots {
        csv.write_record([*study, method, effort, &number(*seconds), &number(*error)])?;
    }
    csv.flush()
}
