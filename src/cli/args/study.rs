//! `gonio frontier` and `gonio study` as written: many runs of simulated rigs.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::{EffectArgs, RigArgs};
use crate::study::Strategy;

/// On densities, dwells and speeds.
const FACTORS: (f64, f64) = (0.01, 100.0);

#[derive(Debug, Args)]
pub(crate) struct FrontierArgs {
    /// The plan whose schedule and dwell are scaled, and whose readings are taken at rest and in
    /// flight.
    pub(crate) plan: PathBuf,
    #[command(flatten)]
    pub(crate) rig: RigArgs,
    #[command(flatten)]
    pub(crate) effects: EffectArgs,
    /// stop-and-go, sweep or adaptive, with commas between. Default: the first two, where the plan can
    /// be flown, and the plan's own. Of an adaptive one --density divides the error that is asked for,
    /// by its square root.
    #[arg(long = "strategy", value_name = "NAMES", value_delimiter = ',', value_parser = strategy)]
    pub(crate) strategies: Vec<Strategy>,
    /// Factors on the number of targets, with commas between; every combination with --dwell and
    /// --speed is run. Default: a ladder of five rungs, from half to twice the plan's targets and
    /// dwell.
    #[arg(long = "density", value_name = "FACTORS", value_delimiter = ',', value_parser = factor)]
    pub(crate) densities: Vec<f64>,
    /// Factors on the dwell; of a sweep on its windows.
    #[arg(long = "dwell", value_name = "FACTORS", value_delimiter = ',', value_parser = factor)]
    pub(crate) dwells: Vec<f64>,
    /// Factors on the speed of sweeps.
    #[arg(long = "speed", value_name = "FACTORS", value_delimiter = ',', value_parser = factor)]
    pub(crate) speeds: Vec<f64>,
    /// How many seeds each rung is run with, from --seed upwards.
    #[arg(long, default_value_t = 5, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub(crate) seeds: u64,
    /// The folder for frontier.csv, frontier.html and the pictures; must not be there yet. Default: frontier-NAME-UTC.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Print the table as JSON lines.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Study {
    /// Whether the 95 % intervals of M, flux, I and L hold the truth as often as they say.
    ///
    /// Runs scenes drawn at random on the simulated rig. Exit code 1 where a demand is not met.
    /// Example: gonio study coverage --runs 1000 --out coverage
    Coverage(CoverageArgs),
}

#[derive(Debug, Args)]
pub(crate) struct CoverageArgs {
    /// Scenes, by name, with commas between. Default: all.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) scenes: Vec<String>,
    /// Runs of each scene, on rigs of each kind. Default: 1000.
    #[arg(long, value_name = "N", value_parser = runs)]
    pub(crate) runs: Option<usize>,
    /// The seed of all that is drawn.
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub(crate) seed: u64,
    /// Leave basis and penalty to the readings instead of pinning the plans' degrees.
    #[arg(long)]
    pub(crate) unpinned: bool,
    /// A few runs of two scenes: seconds.
    #[arg(long)]
    pub(crate) short: bool,
    /// The folder for coverage.csv and coverage.svg; must not be there yet. Default: coverage-UTC.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Replace the study's section in a Markdown document, or add it.
    #[arg(long, value_name = "FILE")]
    pub(crate) doc: Option<PathBuf>,
    /// The day, for the document. Needed with --doc.
    #[arg(long, value_name = "YYYY-MM-DD")]
    pub(crate) date: Option<String>,
    /// Where the document's figure goes. With --doc.
    #[arg(long, value_name = "FILE", requires = "doc")]
    pub(crate) figure: Option<PathBuf>,
    /// Print one JSON document.
    #[arg(long)]
    pub(crate) json: bool,
}

fn strategy(text: &str) -> Result<Strategy, String> {
    let named = Strategy::ALL.into_iter().find(|strategy| strategy.name() == text);
    named.ok_or_else(|| format!("expected {}", Strategy::ALL.map(Strategy::name).join(" or ")))
}

fn factor(text: &str) -> Result<f64, String> {
    let factor = text.parse().ok().filter(|factor| (FACTORS.0..=FACTORS.1).contains(factor));
    factor.ok_or_else(|| format!("expected a factor from {} to {}", FACTORS.0, FACTORS.1))
}

fn runs(text: &str) -> Result<usize, String> {
    let expected = "expected a whole number from 2 to 1000000";
    let runs: usize = text.parse().map_err(|_| expected.to_owned())?;
    if (2..=1_000_000).contains(&runs) { Ok(runs) } else { Err(expected.to_owned()) }
}
