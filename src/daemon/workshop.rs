//! What the daemon leaves to others: how files become a run, and a run's readings become results.
//! The command line knows, for it can put a simulated rig together; the daemon does not.

use std::path::Path;

use crate::journal::Writer;
use crate::rig::Rig;
use crate::run::Job;

/// Why something that was asked for is not done, for a person.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Refusal {
    /// What is wrong with which thing.
    pub error: String,
    /// What would have been right.
    pub expected: Option<String>,
    /// What to do about it.
    pub help: Option<String>,
}

impl Refusal {
    /// One that needs no more words.
    pub fn new(error: impl Into<String>) -> Self {
        Self { error: error.into(), ..Self::default() }
    }

    /// Adds what to do.
    #[must_use]
    pub fn with_help(self, help: impl Into<String>) -> Self {
        Self { help: Some(help.into()), ..self }
    }

    /// Adds what would have been right.
    #[must_use]
    pub fn expecting(self, expected: impl Into<String>) -> Self {
        Self { expected: Some(expected.into()), ..self }
    }
}

/// A bundle that can be run as it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Checked {
    /// The plan's name.
    pub name: String,
    /// Poses to measure.
    pub targets: u32,
    /// Readings to take, dark and reference ones included.
    pub readings: u32,
    /// The rig time that they are predicted to take, seconds.
    pub predicted_s: f64,
    /// What a person should know about how it will be run; may be empty.
    pub notes: Vec<String>,
}

/// What is left of a run to do.
pub enum Prepared {
    /// Every step has its reading: only the results are missing.
    Measured,
    /// This, for the rig's owner.
    ToMeasure {
        /// What it is to do.
        job: Box<Job>,
        /// The run's journal.
        journal: Box<Writer>,
    },
}

/// What became of a run's results.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finished {
    /// Whether every target was measured.
    pub is_complete: bool,
    /// One line for people.
    pub summary: String,
}

/// Turns bundles into runs and readings into results. Called from threads that may wait.
pub trait Workshop: Send + Sync + 'static {
    /// The daemon's rig.
    fn rig(&self) -> &Rig;

    /// The wall time now, RFC 3339.
    fn utc_now(&self) -> String;

    /// Checks completely what a client sent, and promises that it can be run.
    fn check(&self, bundle: &[u8]) -> Result<Checked, Refusal>;

    /// Makes the run's folder and journal, or opens those that are there to carry the run on.
    fn prepare(&self, bundle: &[u8], folder: &Path) -> Result<Prepared, Refusal>;

    /// Writes the results of whatever the journal holds into the run's folder.
    fn finish(&self, folder: &Path) -> Result<Finished, Refusal>;
}
