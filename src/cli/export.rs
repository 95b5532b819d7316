//! `gonio export`: a run's samples in another form, made from its journal.

use std::path::Path;
use std::process::ExitCode;

use super::args::{ExportArgs, ExportFormat};
use super::failure::{Failure, Outcome};
use super::output::write_out;
use super::results::{Results, open_run};
use crate::export::write_atomically;

/// Writes the samples to a file, or to standard output.
pub(crate) fn export(args: &ExportArgs) -> Outcome {
    let (setup, header, reader) = open_run(&args.dir)?;
    let (results, _) = Results::of_run(&setup, &reader, false)?;
    let ExportFormat::Csv = args.format;
    match args.output.as_deref().filter(|path| *path != Path::new("-")) {
        Some(path) => {
            // The numbers don't say by themselves what they are, nor that they were simulated.
            let meta = path.with_extension("meta.json");
            write_atomically(path, |out| results.write_samples(out, &setup, &reader))
                .and_then(|()| results.write_meta(&meta, &setup, &header))
                .map_err(Failure::midway)?;
        }
        None => write_out(|out| results.write_samples(out, &setup, &reader))?,
    }
    Ok(ExitCode::SUCCESS)
}
