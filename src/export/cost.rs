//! cost.csv: one run of a study of cost a line; reached.csv: one target of one scene and strategy.

use std::io::{self, Write};

use super::number::number;
use crate::study::cost::{Reached, Run};

/// Writes cost.csv, the runs in the order in which they are handed in. Errors of a fit that was not
/// possible are infinite; what a run has not is an empty field.
pub fn write_cost(out: impl Write, runs: &[Run]) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    csv.write_record([
        "scene",
        "strategy",
        "rung",
        "seed",
        "rig_s",
        "bound_s",
        "settling_s",
        "readings",
        "error_shape_rms_relative",
        "error_exitance_shape_relative",
        "factor",
        "left_out_rms",
        "resolves_deg",
        "believes",
        "basis",
        "coefficients",
        "compute_s",
    ])?;
    for run in runs {
        let (basis, coefficients) = run.basis.clone().unzip();
        csv.write_record([
            run.scene.name(),
            run.strategy.name(),
            &run.rung.name(),
            &run.seed.to_string(),
            &number(run.rig_s),
            &number(run.bound_s),
            &number(run.settling_s),
            &run.readings.to_string(),
            &number(run.radiance),
            &number(run.exitance),
            &number(run.factor),
            &run.left_out_rms.map_or(String::new(), number),
            &run.resolves_deg.map_or(String::new(), number),
            &run.believes.map_or(String::new(), |is| is.to_string()),
            &basis.unwrap_or_default(),
            &coefficients.map_or(String::new(), |count| count.to_string()),
            &number(run.compute_s),
        ])?;
    }
    csv.flush()
}

/// Writes reached.csv. Where no rung met the target, its rung, time and seeds are empty, and
/// `longest_s` says how long a rung was tried.
pub fn write_reached(out: impl Write, reached: &[Reached]) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    csv.write_record(["scene", "strategy", "target", "rung", "rig_s", "seeds", "longest_s"])?;
    for reached in reached {
        let at = reached.at;
        csv.write_record([
            reached.scene.name(),
            reached.strategy.name(),
            &reached.target.name(),
            &at.map_or(String::new(), |(rung, _, _)| rung.name()),
            &at.map_or(String::new(), |(_, rig_s, _)| number(rig_s)),
            &at.map_or(String::new(), |(_, _, seeds)| seeds.to_string()),
            &number(reached.longest_s),
        ])?;
    }
    csv.flush()
}
