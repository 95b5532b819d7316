//! What every measurement here needs: the program under test, a stopwatch with repeats, the
//! statistics of an honest answer, and a section in a document. Each measurement is a program of
//! its own in `src/bin/`, whose opening comment is its method.
//!
//! Outside the default members: `cargo test` neither builds nor runs them. They spawn the `gonio`
//! that lies beside them, so build that first: `cargo build --release`, then
//! `cargo run --release -p benches --bin kernels -- --doc docs/measured.md --date 2026-11-22`.

mod arguments;
pub mod bars;
mod cases;
mod counted;
mod dice;
mod document;
pub mod kernel;
mod machine;
mod program;
pub mod scatter;
mod statistics;
mod stopwatch;
mod table;

pub use arguments::Arguments;
pub use cases::{cases, cases_of};
pub use counted::{Bytes, Counted};
pub use dice::Dice;
pub use document::Section;
pub use gonio::study::arithmetic::Unmeasured;
pub use machine::{Machine, file_system_of};
pub use program::{Program, Run, copy_example, edit};
pub use statistics::{binomial_band, rms};
pub use stopwatch::{Spread, call_ns, call_ns_in, repeat, repeat_together, timed};
pub use table::Table;

/// Runs a measurement, hands its section out, and makes the exit code: 0 if every aim was met or
/// there was none, 1 if one was missed or nothing could be measured.
pub fn report(
    arguments: &Arguments,
    measure: impl FnOnce() -> Result<Section, Unmeasured>,
) -> std::process::ExitCode {
    let outcome = Machine::look(arguments).and_then(|machine| {
        let section = measure()?;
        section.hand_out(arguments, &machine)?;
        Ok(section.misses())
    });
    match outcome {
        Ok(0) => std::process::ExitCode::SUCCESS,
        Ok(misses) => {
            eprintln!("{misses} aims missed");
            std::process::ExitCode::FAILURE
        }
        Err(why) => {
            eprintln!("not measured: {why}");
            std::process::ExitCode::FAILURE
        }
    }
}
