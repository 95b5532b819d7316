//! Error against time of closed form, adaptive cubature, quasi-Monte Carlo and Monte Carlo, for the
//! same quantities. The kernel answers as it does in `gonio calc`; where it integrates along
//! contours itself, at one tolerance after another. The other methods are handed the integrand
//! cos θ cos θ'/r² over the surfaces and know nothing else. Truth is a reference case's, with 17
//! digits. An error of a random method is the root mean square over seeds; time is this thread's
//! processor time for one value.

use std::hint::black_box;
use std::path::PathBuf;
use std::process::ExitCode;

use benches::integral::{Method, Problem};
use benches::kernel;
use benches::picture::{Curve, Panel, error_against_time};
use benches::{Arguments, Section, Table, Unmeasured, call_ns_in, cases, report, rms};
use clap::Parser;
use serde_json::{Value, json};

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

/// What is computed: a title, the case with the closed form or the contour integral, and the case
/// that says which integral the other methods do, where that is another of the same value.
const STUDIES: [(&str, &[&str]); 9] = [
    ("square, 1 above its middle", &["poly004"]),
    ("disk, oblique receiver", &["disk022"]),
    ("ball, receiver tilted by 45°", &["sph015"]),
    ("disk behind a disk (penumbra)", &["pen029"]),
    ("rectangle behind a disk", &["pen056"]),
    ("disk to disk", &["ff_coax_disks01"]),
    ("square to square, face to face", &["ff_par_rect01-polygons", "ff_par_rect01"]),
    ("square to square, common edge", &["ff_perp_rect01-polygons", "ff_perp_rect01"]),
    ("triangle to triangle", &["ff_polygons01-polygons"]),
];

const CLOSED: &str = "radiometry: closed form";
const CONTOUR: &str = "radiometry: contour integral";
/// Relative, asked of what integrates to a tolerance.
const TOLERANCES: [f64; 7] = [1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12];
/// A single value takes no longer than this; a ladder ends with it.
const LONGEST_S: f64 = 0.4;

/// One point of a curve.
struct Spot {
    study: &'static str,
    method: String,
    effort: String,
    seconds: f64,
    error: f64,
}

fn measure(asked: &Asked) -> Result<Section, Unmeasured> {
    let cases = cases()?;
    let find = |id: &str| {
        let found = cases.iter().find(|case| case["id"] == json!(id));
        found.ok_or_else(|| Unmeasured::because(format!("no reference case {id}")))
    };
    let mut spots = Vec::new();
    for (study, ids) in STUDIES {
        for id in ids {
            kernel_spots(study, find(id)?, &mut spots)?;
        }
        let case = find(ids[0])?;
        let (problem, exact) = (Problem::of_case(case)?, exact(case)?);
        for ladder in ladders() {
            for method in ladder {
                let spot = method_spot(study, &problem, exact, method, asked.seeds)?;
                let seconds = spot.seconds;
                spots.push(spot);
                if seconds > LONGEST_S {
                    break;
                }
            }
        }
    }
    if let Some(path) = &asked.figure {
        let title = "One value by closed form, adaptive, quasi-Monte Carlo and Monte Carlo";
        std::fs::write(path, error_against_time(title, &panels(&spots), 3))?;
    }
    Ok(section(&spots, asked))
}

fn exact(case: &Value) -> Result<f64, Unmeasured> {
    Ok(case["expected"].as_str().unwrap_or_default().parse()?)
}

/// The kernel itself: once, or for each tolerance where it takes one.
fn kernel_spots(
    study: &'static str,
    case: &Value,
    spots: &mut Vec<Spot>,
) -> Result<(), Unmeasured> {
    let exact = exact(case)?;
    let quantity = case["quantity"].as_str().unwrap_or_default();
    let mut spot = |inputs: &Value, method: &str, effort: String| {
        let call = kernel::call(quantity, inputs)?;
        let call = call.ok_or_else(|| Unmeasured::because(format!("no kernel {quantity}")))?;
        let error = (call.answer() / exact - 1.0).abs();
        let seconds = 1e-9 * call_ns_in(11, || black_box(call.answer()));
        spots.push(Spot { study, method: method.to_owned(), effort, seconds, error });
        Ok::<_, Unmeasured>(())
    };
    if case["inputs"]["relative_tolerance"].is_null() {
        return spot(&case["inputs"], CLOSED, String::new());
    }
    for tolerance in TOLERANCES {
        let mut inputs = case["inputs"].clone();
        inputs["relative_tolerance"] = json!(tolerance);
        spot(&inputs, CONTOUR, format!("tolerance {tolerance:.0e}"))?;
    }
    Ok(())
}

fn ladders() -> [Vec<Method>; 3] {
    let adaptive = |tolerance| Method::Adaptive { tolerance, budget: 10_000_000 };
    [
        TOLERANCES.map(adaptive).to_vec(),
        (11..=21).step_by(2).map(|power| Method::QuasiMonteCarlo(1 << power)).collect(),
        (6..=22).step_by(2).map(|power| Method::MonteCarlo(1 << power)).collect(),
    ]
}

fn method_spot(
    study: &'static str,
    problem: &Problem,
    exact: f64,
    method: Method,
    seeds: u64,
) -> Result<Spot, Unmeasured> {
    let seeds = if method.is_random() { seeds } else { 1 };
    let error = |seed| Ok(method.integrate(problem, seed)? / exact - 1.0);
    let errors: Vec<f64> = (0..seeds).map(error).collect::<Result<_, Unmeasured>>()?;
    let seconds = 1e-9 * call_ns_in(3, || black_box(method.integrate(problem, 0)));
    let (method, effort) = (method.name().to_owned(), method.effort());
    Ok(Spot { study, method, effort, seconds, error: rms(&errors) })
}

fn panels(spots: &[Spot]) -> Vec<Panel> {
    let curve = |study: &str, method: &str| {
        let points = spots.iter().filter(|spot| spot.study == study && spot.method == method);
        let points: Vec<_> = points.map(|spot| (spot.seconds, spot.error)).collect();
        (!points.is_empty()).then(|| Curve { name: method.to_owned(), points, is_joined: true })
    };
    let methods = [CLOSED, CONTOUR, "adaptive cubature", "quasi-Monte Carlo", "Monte Carlo"];
    let panel = |(study, _): &(&str, _)| Panel {
        title: (*study).to_owned(),
        curves: methods.iter().filter_map(|method| curve(study, method)).collect(),
    };
    STUDIES.iter().map(panel).collect()
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
    let methods = [CLOSED, CONTOUR, "adaptive cubature", "quasi-Monte Carlo", "Monte Carlo"];
    let mut shown =
        Table::new(&["µs to 1e-3, 1e-6, 1e-9"].iter().chain(&methods).copied().collect::<Vec<_>>());
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
        shown.row(std::iter::once(study.to_owned()).chain(methods.map(of)));
    }
    let mut section = Section::new(
        "error_against_time",
        "Error against time: closed form, adaptive, quasi-Monte Carlo, Monte Carlo",
    );
    section.say("![nine panels, relative error against time per value on logarithmic axes: the \
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
        let ours = fastest(spots, study, CLOSED, 1e-3).or(fastest(spots, study, CONTOUR, 1e-3));
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

/// The shortest time from which on every further effort of a method stays within the error.
fn fastest(spots: &[Spot], study: &str, method: &str, within: f64) -> Option<f64> {
    let of = spots.iter().filter(|spot| spot.study == study && spot.method == method);
    let reached = of.rev().take_while(|spot| spot.error <= within);
    reached.map(|spot| spot.seconds).min_by(f64::total_cmp)
}
