//! `gonio export`: a run's samples in another form, made from its journal.

use std::path::Path;
use std::process::ExitCode;

use super::args::{ExportArgs, ExportFormat};
use super::failure::{Failure, Outcome};
use super::output::write_out;
use super::results::{Results, read_run};
use crate::export::{write_atomically, write_samples};

/// Writes the samples to a file, or to standard output.
pub(crate) fn export(args: &ExportArgs) -> Outcome {
    let (setup, header, readings) = read_run(&args.dir)?;
    let results = Results::of(&setup, setup.plan.fit, &readings)?;
    let (quantity, samples) = (setup.rig.detector.quantity, &results.calibrated.samples);
    let ExportFormat::Csv = args.format;
    match args.output.as_deref().filter(|path| *path != Path::new("-")) {
        Some(path) => {
            // The numbers don't say by themselves what they are, nor that they were simulated.
            let meta = path.with_extension("meta.json");
            write_atomically(path, |out| write_samples(out, quantity, samples))
                .and_then(|()| results.write_meta(&meta, &setup, &header))
                .map_err(Failure::midway)?;
        }
        None => write_out(|out| write_samples(out, quantity, samples))?,
    }
    Ok(ExitCode::SUCCESS)
}
