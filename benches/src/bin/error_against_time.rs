//! Error against time of closed form, the kernels' own integrals, adaptive cubature, quasi-Monte Carlo
//! and Monte Carlo, for the same quantities: `gonio frontier --compute` as a section of a document. The
//! kernel answers as it does in `gonio calc`; where it integrates itself, at one tolerance after
//! another. The other methods are handed the integrand cos θ cos θ'/r² over the surfaces and know
//! nothing else. Truth is a reference case's, with 17 digits. An error of a random method is the
//! root mean square over seeds; time is this thread's processor time for one value.

use std::path::PathBuf;
use std::process::ExitCode;

use benches::{Arguments, Section, Table, Unmeasured, report};
use clap::Parser;
use gonio::cli::arithmetic_panels;
use gonio::cli::stopwatch::call_s;
use gonio::report::error_against_time;
use gonio::study::arithmetic::{Effort, METHODS, STUDIES, Spot, fastest, sweep};

/// Error against time of closed form, adaptive, quasi-Monte Carlo and Monte Carlo.
#[derive(Debug, Parser)]
struct Asked {
    /// Draw the curves as SVG.
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,
    /// Seeds of each random method.
    #[arg(long, default_value_t = 8)]
    seeds: u64,
    #[command(flatten)]
    arguments: Arguments,
}

fn main() -> ExitCode {
    let asked = Asked::parse();
    report(&asked.arguments, || measure(&asked))
}

/// A single value takes no longer than this; a ladder ends with it.
const LONGEST_S: f64 = 0.4;

fn measure(asked: &Asked) -> Result<Section, Unmeasured> {
    let spots = sweep(Effort { seeds: asked.seeds, longest_s: LONGEST_S }, call_s)?;
    if let Some(path) = &asked.figure {
        let title = "One value by closed form, adaptive, quasi-Monte Carlo and Monte Carlo";
        std::fs::write(path, error_against_time(title, &arithmetic_panels(&spots), 3))?;
    }
    Ok(section(&spots, asked))
}

fn section(spots: &[Spot], asked: &Asked) -> Section {
    let mut raw = Table::new(&["study", "method", "effort", "seconds", "relative_error"]);
    for spot in spots {
        raw.row([
            spot.study.replace(',', ";"),
            spot.method.clone(),
            spot.effort.clone(),
            format!("{:.3e}", spot.seconds),
            format!("{:.2e}", spot.error),
        ]);
    }
    let mut shown =
        Table::new(&["µs to 1e-3, 1e-6, 1e-9"].iter().chain(&METHODS).copied().collect::<Vec<_>>());
    for (study, _) in STUDIES {
        let of = |method: &str| {
            let reached = [1e-3, 1e-6, 1e-9].map(|aim| fastest(spots, study, method, aim));
            if reached.iter().all(Option::is_none)
                && !spots.iter().any(|s| s.study == study && s.method == method)
            {
                return String::new();
            }
            reached.map(|s| s.map_or("-".into(), |s| format!("{:.3}", Micro(s)))).join(" / ")
        };
        shown.row(std::iter::once(study.to_owned()).chain(METHODS.map(of)));
    }
    let mut section = Section::new(
        "error_against_time",
        "Error against time: closed form, adaptive, quasi-Monte Carlo, Monte Carlo",
    );
    section.say("![twelve panels, relative error against time per value on logarithmic axes: the \
                 closed forms stand alone in the lower left corner](figures/error-against-time.svg)");
    section.say(&format!(
        "Each panel is one reference case. Errors of the random methods are root mean squares over \
         {} seeds; an error below 1e-16 is drawn there. The table has the shortest time per value, \
         in µs, from which on a method is and stays at or below a relative error; \"-\" where none \
         of its efforts got there within {LONGEST_S} s. All points: \
         [figures/error-against-time.csv](figures/error-against-time.csv).",
        asked.seeds
    ));
    section.show(&shown);
    let slower = |study: &str| {
        let ours = fastest(spots, study, METHODS[0], 1e-3)
            .or_else(|| fastest(spots, study, METHODS[1], 1e-3));
        let dice = fastest(spots, study, "Monte Carlo", 1e-3);
        ours.zip(dice).is_some_and(|(ours, dice)| dice < 10.0 * ours)
    };
    section.aim(
        "at an error of 1e-3, ten times faster than Monte Carlo, in every panel",
        !STUDIES.iter().any(|(study, _)| slower(study)),
    );
    section.keep(raw);
    section
}

/// Seconds as µs with two digits.
struct Micro(f64);

impl std::fmt::Display for Micro {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let micro = 1e6 * self.0;
        if micro >= 10.0 { write!(f, "{micro:.0}") } else { write!(f, "{micro:.2}") }
    }
}
