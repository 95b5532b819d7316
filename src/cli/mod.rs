//! The command line: arguments, progress, exit codes. The one place where wall time is read and
//! where a simulated rig is put together; after it there are types.

mod args;
mod failure;
mod inputs;
mod nominal;

use std::process::ExitCode;

use clap::Parser;

/// Parses the process's arguments and does what they ask.
pub fn main() -> ExitCode {
    let _cli = args::Cli::parse();
    ExitCode::SUCCESS
}
