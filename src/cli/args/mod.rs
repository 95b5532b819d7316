//! The command line as written: commands and flags, parsed, with nothing resolved yet. What a
//! flag means is documented here and nowhere else.

// The documentation of a flag is its help: back-ticks would show on the terminal.
#![allow(clippy::doc_markdown)]
// Flags of a command are flags.
#![allow(clippy::struct_excessive_bools)]

mod chart;
mod fit;
mod study;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

pub(crate) use chart::ChartArgs;
pub(crate) use fit::FitArgs;
pub(crate) use study::{CostArgs, CoverageArgs, DocumentArgs, FrontierArgs, Study};

/// Controller for goniometer and spherical-gantry measurement rigs.
///
/// Measures radiance L(x, y, θ, φ), keeps every reading, fits what the sample emits, and says how
/// sure it is. Exit codes: 0 complete; 1 ran, but something is missing; 2 could not start.
#[derive(Debug, Parser)]
#[command(name = "gonio", version, max_term_width = 100, arg_required_else_help = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Acquire, journal, fit, export and report: the main job.
    ///
    /// Example: gonio run examples/luminaire/plan.toml
    Run(RunArgs),
    /// Carry an interrupted run on, each target exactly once.
    ///
    /// Example: gonio resume runs/luminaire-20261122T101500Z
    Resume(ResumeArgs),
    /// Fit again, from a run's journal or from any CSV of samples.
    ///
    /// Example: gonio fit runs/luminaire-20261122T101500Z --at rays.csv
    Fit(Box<FitArgs>),
    /// Render a run's report.html again, from its journal.
    ///
    /// Example: gonio report runs/luminaire-20261122T101500Z
    Report(ReportArgs),
    /// Write a run's samples in another form.
    ///
    /// Example: gonio export runs/luminaire-20261122T101500Z --format csv -o samples.csv
    Export(ExportArgs),
    /// Check a plan and predict its cost; moves nothing.
    ///
    /// Example: gonio plan examples/luminaire/plan.toml
    Plan(PlanArgs),
    /// Show what accuracy costs in time: plans of several densities on the simulated rig.
    ///
    /// Example: gonio frontier examples/lambertian/plan.toml --out frontier
    Frontier(FrontierArgs),
    /// Answer what only many runs can: whether stated uncertainties cover the truth, and what accuracy
    /// costs in rig time.
    ///
    /// Example: gonio study coverage --short
    Study {
        #[command(subcommand)]
        study: Study,
    },
    /// Show which physical effects a scene calls for, why, and which are left out.
    ///
    /// Example: gonio explain examples/luminaire/scene.toml --rig examples/luminaire/rig.toml
    Explain(ExplainArgs),
    /// The simulated device alone, in real time, on a pseudo-terminal.
    ///
    /// Example: gonio sim --scene examples/luminaire/scene.toml --pty /tmp/rig
    Sim(SimArgs),
    /// List serial ports and open none; --probe talks to one.
    ///
    /// Example: gonio ports --probe /dev/ttyUSB0
    Ports(PortsArgs),
    /// Find the home marks of all axes.
    ///
    /// Example: gonio home --rig rig.toml
    Home(HandArgs),
    /// Move to a pose (homes first if the rig has lost its position).
    ///
    /// Example: gonio jog --rig rig.toml --theta-deg 30 --phi-deg 90
    Jog(JogArgs),
    /// Take one reading where the rig stands.
    ///
    /// Example: gonio read --rig rig.toml --dwell-ms 200
    Read(ReadArgs),
    /// Compute one quantity of radiometry, or many as JSON lines; SI units, radians.
    ///
    /// Example: gonio calc disk-solid-angle --radius 0.005 --distance 0.3
    Calc(CalcArgs),
    /// Own a rig for a long time: a queue of runs over HTTP.
    ///
    /// Example: gonio daemon --rig rig.toml --data /var/lib/gonio
    Daemon(DaemonArgs),
    /// Hand a plan to the daemon.
    ///
    /// Example: gonio submit plan.toml
    Submit(SubmitArgs),
    /// Ask the daemon how the rig and its runs are.
    ///
    /// Example: gonio status --json
    Status(StatusArgs),
    /// Follow the daemon's events.
    ///
    /// Example: gonio watch
    Watch(WatchArgs),
    /// Pause a run of the daemon; the axes come to rest.
    ///
    /// Example: gonio pause 3
    Pause(RunIdArgs),
    /// Continue a paused or interrupted run of the daemon.
    ///
    /// Example: gonio continue 3
    Continue(RunIdArgs),
    /// End a run of the daemon for good; what was measured is kept.
    ///
    /// Example: gonio abort 3
    Abort(RunIdArgs),
}

/// Which rig, and which scene stands on a simulated one.
#[derive(Debug, Clone, Args)]
pub(crate) struct RigArgs {
    /// The rig: a rig.toml, or `simulated` for the built-in one. Default: what a plan names.
    #[arg(long, value_name = "RIG")]
    pub(crate) rig: Option<PathBuf>,
    /// What stands on a simulated rig. Default: what a plan names.
    #[arg(long, value_name = "SCENE")]
    pub(crate) scene: Option<PathBuf>,
    /// The seed of everything random on a simulated rig; the same seed repeats the run.
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub(crate) seed: u64,
}

/// Which of a simulated rig's effects are in and out.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct EffectArgs {
    /// How much all effects that are left out may change a reading, relative to it. Default: a
    /// tenth of the predicted noise of one dwell.
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub(crate) tolerance: Option<f64>,
    /// Simulate this effect however little it matters; may be given several times.
    #[arg(long, value_name = "EFFECT")]
    pub(crate) force: Vec<String>,
    /// Leave this effect out however much it matters; may be given several times.
    #[arg(long, value_name = "EFFECT")]
    pub(crate) without: Vec<String>,
}

#[derive(Debug, Args)]
pub(crate) struct RunArgs {
    /// The plan.
    pub(crate) plan: PathBuf,
    #[command(flatten)]
    pub(crate) rig: RigArgs,
    #[command(flatten)]
    pub(crate) effects: EffectArgs,
    /// The run's folder; must not exist yet. Default: runs/NAME-UTC.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Run a simulated rig at its own pace instead of as fast as it can.
    #[arg(long)]
    pub(crate) realtime: bool,
    /// Exit with 1 if any reading carries a flag.
    #[arg(long)]
    pub(crate) strict: bool,
    /// Read the readings again and again, in blocks, at the end, instead of keeping them: bounded memory.
    /// Default: of more than 200000 readings.
    #[arg(long)]
    pub(crate) in_blocks: bool,
    /// Print the summary as one JSON document.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct ResumeArgs {
    /// The run's folder.
    pub(crate) dir: PathBuf,
    /// Run a simulated rig at its own pace instead of as fast as it can.
    #[arg(long)]
    pub(crate) realtime: bool,
    /// Go on even if the reference pose no longer agrees; the samples are flagged `drift`.
    #[arg(long)]
    pub(crate) accept_drift: bool,
    /// Exit with 1 if any reading carries a flag.
    #[arg(long)]
    pub(crate) strict: bool,
    /// Read the readings again and again, in blocks, at the end, instead of keeping them: bounded memory.
    /// Default: of more than 200000 readings.
    #[arg(long)]
    pub(crate) in_blocks: bool,
    /// Print the summary as one JSON document.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    /// The run's folder.
    pub(crate) dir: PathBuf,
    /// Where to write it; - for standard output. Default: report.html in the run's folder.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Write every picture to this folder too, each as an SVG file of its own.
    #[arg(long, value_name = "DIR")]
    pub(crate) pictures: Option<PathBuf>,
    /// Print what was written as one JSON document.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum ExportFormat {
    /// The columns of samples.csv; beside a file FILE.csv its FILE.meta.json.
    Csv,
}

#[derive(Debug, Args)]
pub(crate) struct ExportArgs {
    /// The run's folder.
    pub(crate) dir: PathBuf,
    /// The form.
    #[arg(long, value_enum)]
    pub(crate) format: ExportFormat,
    /// The file to write. Default: standard output.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct PlanArgs {
    /// The plan.
    pub(crate) plan: PathBuf,
    #[command(flatten)]
    pub(crate) rig: RigArgs,
    /// Look for the cheapest plan that reaches this: exitance=0.5%, flux=1%, radiance=2%
    /// (relative standard uncertainty, k = 1; of the radiance RMS over the region). May be repeated.
    #[arg(long, value_name = "QUANTITY=U")]
    pub(crate) target: Vec<String>,
    /// Targets are meant without the scale that is common to all readings.
    #[arg(long)]
    pub(crate) without_scale: bool,
    /// Write the plan that was found; must not exist yet.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Rehearse the plan so many times before a scene that is likely (--scene, or the plan's own): whole runs
    /// on a simulated twin of the rig, in virtual time, and what their fits state. Also of a real rig.
    #[arg(long, value_name = "RUNS", conflicts_with = "target", value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub(crate) rehearse: Option<u64>,
    /// Print one JSON document.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct ExplainArgs {
    /// The scene.
    pub(crate) scene: PathBuf,
    /// The rig that looks at it. Default: the plan's, or the built-in one.
    #[arg(long, value_name = "RIG")]
    pub(crate) rig: Option<PathBuf>,
    /// The plan that measures it: effects are weighed in its region, for its dwell and length.
    #[arg(long, value_name = "PLAN")]
    pub(crate) plan: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) effects: EffectArgs,
    /// Print one JSON document.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct SimArgs {
    #[command(flatten)]
    pub(crate) rig: RigArgs,
    #[command(flatten)]
    pub(crate) effects: EffectArgs,
    /// Speak as a device of another make, or as several that share one bench, divided by commas.
    /// Default: the devices of the rig file, or gonio's own controller.
    #[arg(long = "as", value_name = "MAKE", value_delimiter = ',')]
    pub(crate) makes: Vec<Make>,
    /// Make a symlink here that leads to the pseudo-terminal; one a device, divided by commas.
    #[arg(long, value_name = "LINK", value_delimiter = ',')]
    pub(crate) pty: Vec<PathBuf>,
    /// The wire's speed, bits a second. Default: what the rig's link says.
    #[arg(long, value_name = "BAUD", value_parser = clap::value_parser!(u32).range(1200..=12_000_000))]
    pub(crate) baud: Option<u32>,
}

/// A make of device that the simulated bench can hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Make {
    /// Dynamixel servos of the X series on a bus.
    Dynamixel,
    /// A board with grbl 1.1.
    Grbl,
    /// A Keithley 6485 picoammeter.
    Keithley,
    /// gonio's own controller.
    Native,
    /// A Newport 1830-C power meter.
    Newport,
    /// The SCPI meter of the rig file; a Keithley 6485 where it has none.
    Scpi,
    /// A Thorlabs PM100D power meter.
    Thorlabs,
}

#[derive(Debug, Args)]
pub(crate) struct PortsArgs {
    /// Open this port and ask who is there; this may reset a board.
    #[arg(long, value_name = "PORT")]
    pub(crate) probe: Option<String>,
    /// The speed to probe at, bits a second.
    #[arg(long, default_value_t = 1_000_000, value_name = "BAUD", value_parser = clap::value_parser!(u32).range(1200..=12_000_000))]
    pub(crate) baud: u32,
    /// Print one JSON document.
    #[arg(long)]
    pub(crate) json: bool,
}

/// A rig driven by hand: the daemon's, or one opened for this command.
#[derive(Debug, Clone, Args)]
pub(crate) struct HandArgs {
    #[command(flatten)]
    pub(crate) rig: RigArgs,
    #[command(flatten)]
    pub(crate) daemon: DaemonAddress,
    /// Print one JSON document.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct JogArgs {
    #[command(flatten)]
    pub(crate) hand: HandArgs,
    /// Direction to the detector from the sample's normal, in [0, 90].
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub(crate) theta_deg: Option<f64>,
    /// Direction's azimuth, from +x towards +y.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub(crate) phi_deg: Option<f64>,
    /// Place on the sample.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub(crate) x_mm: Option<f64>,
    /// Place on the sample.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub(crate) y_mm: Option<f64>,
}

#[derive(Debug, Args)]
pub(crate) struct ReadArgs {
    #[command(flatten)]
    pub(crate) hand: HandArgs,
    /// How long to integrate.
    #[arg(long, default_value_t = 100.0, value_name = "MS")]
    pub(crate) dwell_ms: f64,
    /// The gain range, by its name in rig.toml. Default: the rig's first.
    #[arg(long, value_name = "NAME")]
    pub(crate) gain: Option<String>,
}

#[derive(Debug, Args)]
pub(crate) struct CalcArgs {
    /// Show every quantity, its inputs with their units, and an example of each.
    #[arg(long)]
    pub(crate) list: bool,
    /// Answer JSON lines from standard input; with a QUANTITY or --list, print JSON.
    #[arg(long)]
    pub(crate) json: bool,
    /// The quantity, and its inputs: a value is a number, numbers between commas, or JSON.
    #[arg(
        value_name = "QUANTITY [--name value ...]",
        trailing_var_arg = true,
        allow_hyphen_values = true
    )]
    pub(crate) words: Vec<String>,
}

/// Where the daemon listens.
#[derive(Debug, Clone, Args)]
pub(crate) struct DaemonAddress {
    /// The daemon: unix:PATH or ADDR:PORT. Default: gonio.sock in $XDG_RUNTIME_DIR or gonio-data.
    #[arg(long, value_name = "ADDRESS")]
    pub(crate) daemon: Option<String>,
}

#[derive(Debug, Args)]
pub(crate) struct DaemonArgs {
    /// The rig that the daemon owns.
    #[arg(long, value_name = "RIG")]
    pub(crate) rig: PathBuf,
    /// What stands on a simulated rig.
    #[arg(long, value_name = "SCENE")]
    pub(crate) scene: Option<PathBuf>,
    /// The seed of everything random on a simulated rig.
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub(crate) seed: u64,
    #[command(flatten)]
    pub(crate) effects: EffectArgs,
    /// Where runs and the queue are kept.
    #[arg(long, default_value = "gonio-data", value_name = "DIR")]
    pub(crate) data: PathBuf,
    /// Where to listen: unix:PATH or ADDR:PORT (loopback only).
    #[arg(long, value_name = "ADDRESS")]
    pub(crate) listen: Option<String>,
}

#[derive(Debug, Args)]
pub(crate) struct SubmitArgs {
    /// The plan; what it refers to is sent along.
    pub(crate) plan: PathBuf,
    #[command(flatten)]
    pub(crate) address: DaemonAddress,
    /// Print one JSON document.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct StatusArgs {
    #[command(flatten)]
    pub(crate) address: DaemonAddress,
    /// Print one JSON document.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct WatchArgs {
    #[command(flatten)]
    pub(crate) address: DaemonAddress,
    /// Begin after this event.
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub(crate) after: u64,
    /// Print JSON lines.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct RunIdArgs {
    /// The run's number, as `submit` and `status` show it.
    pub(crate) id: u64,
    #[command(flatten)]
    pub(crate) address: DaemonAddress,
    /// Print one JSON document.
    #[arg(long)]
    pub(crate) json: bool,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_line_is_consistent_and_every_command_shows_an_example() {
        let command = Cli::command();
        command.clone().debug_assert();
        for sub in command.get_subcommands() {
            let long = sub.get_long_about().unwrap_or_default().to_string();
            assert!(long.contains("Example: gonio "), "{} shows no example", sub.get_name());
        }
    }
}
