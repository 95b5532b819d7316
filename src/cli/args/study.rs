//! `gonio frontier` and `gonio study` as written: many runs of simulated rigs.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::{EffectArgs, RigArgs};
use crate::study::Motion;

/// On densities, dwells and speeds.
const FACTORS: (f64, f64) = (0.01, 100.0);

#[derive(Debug, Args)]
pub(crate) struct FrontierArgs {
    /// The plan whose schedule and dwell are scaled, and whose readings are taken at rest and in
    /// flight.
    #[arg(required_unless_present = "compute")]
    pub(crate) plan: Option<PathBuf>,
    /// What accuracy costs in arithmetic, too (or alone, without a plan): error against processor time
    /// of kernels and of the methods that integrate, in compute.csv, compute.svg and compute.html.
    #[arg(long)]
    pub(crate) compute: bool,
    /// Peers' answers to draw beside them: a file that benches/peers/run.sh wrote.
    #[arg(long, value_name = "CSV", requires = "compute")]
    pub(crate) peers: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) rig: RigArgs,
    #[command(flatten)]
    pub(crate) effects: EffectArgs,
    /// stop-and-go, sweep or adaptive, with commas between. Default: the first two, where the plan can
    /// be flown, and the plan's own. Of an adaptive one --density divides the error that is asked for,
    /// by its square root.
    #[arg(long = "strategy", value_name = "NAMES", value_delimiter = ',', value_parser = strategy)]
    pub(crate) strategies: Vec<Motion>,
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
    /// What accuracy costs in rig time: rasters at rest and in flight, interpolated and fitted.
    ///
    /// Climbs a ladder of plans for each scene and strategy until the radiance and the exitance are
    /// right to 1 and 0.3 %, on the simulated rig in virtual time. On two cores an hour for
    /// all with --longest-fit 350, and more without.
    /// Example: gonio study cost --scenes gloss --seeds 2 --quoted-seeds 2 --cache runs
    Cost(CostArgs),
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
    /// Keep each run's scores here, and take from here what this same program found before.
    #[arg(long, value_name = "DIR")]
    pub(crate) cache: Option<PathBuf>,
    /// The folder for coverage.csv and coverage.svg; must not be there yet. Default: coverage-UTC.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) document: DocumentArgs,
    /// Print one JSON document.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Where a study writes what it found for people.
#[derive(Debug, Args)]
pub(crate) struct DocumentArgs {
    /// Replace the study's section in a Markdown document, or add it.
    #[arg(long, value_name = "FILE")]
    pub(crate) doc: Option<PathBuf>,
    /// The day, for the document. Needed with --doc.
    #[arg(long, value_name = "YYYY-MM-DD")]
    pub(crate) date: Option<String>,
    /// Where the document's figure goes. With --doc.
    #[arg(long, value_name = "FILE", requires = "doc")]
    pub(crate) figure: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct CostArgs {
    /// Scenes, by name, with commas between. Default: all.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) scenes: Vec<String>,
    /// Strategies, by name, with commas between. Default: all.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) strategies: Vec<String>,
    /// How many seeds each rung is tried with, from 1 upwards. Default: 5.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub(crate) seeds: Option<u64>,
    /// How many seeds a rung is run with that met a target. Default: 20.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub(crate) quoted_seeds: Option<u64>,
    /// Two rungs of one scene with one seed: seconds.
    #[arg(long)]
    pub(crate) short: bool,
    /// Rungs that take the rig longer than this are left out, seconds.
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub(crate) longest: Option<f64>,
    /// The same for fits alone, whose choice of a basis takes the processor longest, seconds.
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub(crate) longest_fit: Option<f64>,
    /// A folder where runs are kept and found again by plan, rig, scene, seed, strategy and the
    /// program's version. Take another one after the program itself was changed.
    #[arg(long, value_name = "DIR")]
    pub(crate) cache: Option<PathBuf>,
    /// The folder for cost.csv, reached.csv and cost.svg; must not be there yet. Default: cost-UTC.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) document: DocumentArgs,
    /// Print one JSON document.
    #[arg(long)]
    pub(crate) json: bool,
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|s: &f64| s.is_finite() && *s > 0.0);
    seconds.ok_or_else(|| "expected a number of seconds above 0".to_owned())
}

fn strategy(text: &str) -> Result<Motion, String> {
    let named = Motion::ALL.into_iter().find(|strategy| strategy.name() == text);
    named.ok_or_else(|| format!("expected one of {}", Motion::ALL.map(Motion::name).join(", ")))
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
