//! The command line: arguments, progress, exit codes. The one place where wall time is read and
//! where a simulated rig is put together; after it there are types.

mod accuracy;
mod acquire;
mod adapting;
mod args;
pub mod calc;
mod chart;
mod client;
mod daemon;
mod derive;
mod explain;
mod export;
mod failure;
mod fit;
mod folder;
mod frontier;
mod halt;
mod hand;
mod inputs;
mod live;
mod long_results;
mod long_run;
mod monte_carlo;
mod nominal;
mod outlook;
mod output;
mod parallel;
mod partial;
mod picture;
mod plan;
mod ports;
mod progress;
mod rehearsal;
mod remote;
mod report;
mod results;
mod resume;
mod run;
mod session;
mod setup;
mod shop;
mod simulated;
mod stopping;
#[cfg(test)]
mod stopping_tests;
pub mod stopwatch;
mod stream;
mod study;
mod summary;
mod tally;
mod target;
mod text;
mod twins;
mod virtual_run;
mod wished;

use std::process::ExitCode;

use clap::Parser as _;

use args::{Cli, Command, Study};
pub use frontier::panels as arithmetic_panels;

/// Parses the process's arguments and does what they ask.
pub fn main() -> ExitCode {
    let outcome = match Cli::parse().command {
        Command::Explain(args) => explain::explain(&args),
        Command::Sim(args) => simulated::sim(&args),
        Command::Ports(args) => ports::ports(&args),
        Command::Fit(args) => fit::fit(&args),
        Command::Report(args) => report::report(&args),
        Command::Export(args) => export::export(&args),
        Command::Run(args) => run::run(&args),
        Command::Frontier(args) => frontier::frontier(&args),
        Command::Study { study: Study::Coverage(args) } => study::coverage(&args),
        Command::Study { study: Study::Cost(args) } => study::cost(&args),
        Command::Resume(args) => resume::resume(&args),
        Command::Home(args) => hand::home(&args),
        Command::Jog(args) => hand::jog(&args),
        Command::Read(args) => hand::read(&args),
        Command::Plan(args) => plan::plan(&args),
        Command::Calc(args) => calc::calc(&args),
        Command::Daemon(args) => daemon::daemon(&args),
        Command::Submit(args) => remote::submit(&args),
        Command::Status(args) => remote::status(&args),
        Command::Watch(args) => remote::watch(&args),
        Command::Pause(args) => remote::ask(&args, "pause"),
        Command::Continue(args) => remote::ask(&args, "continue"),
        Command::Abort(args) => remote::ask(&args, "abort"),
    };
    halt::take_last_word();
    outcome.unwrap_or_else(|failure| failure.report())
}
