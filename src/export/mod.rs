//! Files for people and other tools: the run's CSV and JSON files, and CSV from elsewhere.
//!
//! Text is written alike whatever the locale: `.` as the decimal mark, the fewest digits that read
//! back to the same f64, LF, UTF-8. A file is complete or it is not there ([`write_atomically`]).
//!
//! This room is handed readings, samples and fits. It does not know where they are kept, nor which
//! folder they go to.

mod accuracy;
mod atomic;
mod charted;
mod compute;
mod cost;
mod coverage;
mod derived;
mod document;
mod fit_file;
mod frontier;
mod input;
mod input_blocks;
mod monte_carlo;
mod number;
mod partial_file;
mod partial_header;
mod ray_chart;
mod readings;
mod repeats;
mod samples;
mod samples_meta;
#[cfg(test)]
mod tests;
mod treatment;

pub use accuracy::{AccuracyPoint, write_accuracy};
pub use atomic::{ExportError, cause, write_atomically};
pub use charted::{Charted, charted};
pub use compute::write_compute;
pub use cost::{write_cost, write_reached};
pub use coverage::write_coverage;
pub use derived::{DerivedKind, DerivedOutcome, DerivedQuantity, DerivedTable};
pub use document::with_section;
pub use fit_file::{FitFile, TruePeak, Truth};
pub use frontier::write_frontier;
pub use input::{
    CsvError, InputSample, InputSamples, read_rays, read_samples, read_samples_in, write_at,
};
pub use input_blocks::{BlockError, read_sample_blocks};
pub use monte_carlo::{COVERAGE_95, MonteCarlo, PeakDirection, Propagated};
pub use partial_file::{PartialFile, PartialFileError, PartialsDiffer, ReadPartial};
pub use ray_chart::{ListedRay, RayChart};
pub use readings::write_readings;
pub use samples::{RayColumns, SamplesFile, write_samples};
pub use samples_meta::SamplesMeta;
pub use treatment::{TreatedReading, TreatedReadings, Treatment, Why, write_weights};
