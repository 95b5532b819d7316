//! `gonio frontier --compute`: error against processor time of the kernels that integrate, of the methods
//! that know only the integrand, and of peers where they were measured. Every quantity has a reference
//! value to 17 digits.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::json;

use crate::cli::failure::Failure;
use crate::cli::output::{say, write_out};
use crate::cli::stopwatch::call_s;
use crate::cli::text::table;
use crate::export::{ExportError, write_atomically, write_compute};
use crate::report::{Curve, Panel, Picture, Report, Section, Table, error_against_time};
use crate::study::arithmetic::{Effort, METHODS, STUDIES, Spot, fastest, sweep};

/// A single value takes no longer than this; a ladder ends with it.
const LONGEST_S: f64 = 0.4;
/// What a method is timed to.
const WITHIN: [f64; 3] = [1e-3, 1e-6, 1e-9];
const COLUMNS: usize = 3;
const TITLE: &str = "What accuracy costs in arithmetic";

/// What peers answered to the studies' cases: a file that `benches/peers/run.sh` writes where they are
/// installed.
pub(super) fn peers(path: &Path) -> Result<Vec<Spot>, Failure> {
    let text = std::fs::read_to_string(path).map_err(|error| {
        Failure::with_help(
            format!("--peers {}: cannot be read: {error}", path.display()),
            "give the file that benches/peers/run.sh wrote, for example docs/figures/peers.csv",
        )
    })?;
    let malformed = |line: usize, what: &str| {
        let expected = "row,quantity,solver,effort,value,relative_error,of_tolerance,seconds";
        let shown = path.display();
        Failure::with_help(
            format!("--peers {shown}: line {line}: {what}; expected {expected}"),
            "give the file that benches/peers/run.sh wrote, for example docs/figures/peers.csv",
        )
    };
    let mut spots = Vec::new();
    for (i, line) in text.lines().enumerate().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let [case, _, solver, effort, _, error, _, seconds] = cells[..] else {
            return Err(malformed(i + 1, &format!("{} columns", cells.len())));
        };
        let number = |text: &str| {
            text.parse::<f64>().map_err(|_| malformed(i + 1, &format!("`{text}` is no number")))
        };
        let (error, seconds) = (number(error)?, number(seconds)?);
        let study = STUDIES.iter().find(|(_, ids)| ids.contains(&case));
        // Ours are measured here.
        if let Some((study, _)) = study.filter(|_| !solver.starts_with("radiometry"))
            && error.is_finite()
            && seconds > 0.0
        {
            let (method, effort) = (solver.to_owned(), effort.to_owned());
            spots.push(Spot { study, method, effort, seconds, error });
        }
    }
    Ok(spots)
}

/// Measures, writes compute.csv, compute.svg and compute.html, and prints the table.
pub(super) fn compute(
    folder: &Path,
    seeds: u64,
    peers: Vec<Spot>,
    is_json: bool,
) -> Result<(), Failure> {
    let effort = Effort { seeds, longest_s: LONGEST_S };
    let mut spots =
        sweep(effort, call_s).map_err(|why| Failure::midway(format!("--compute: {why}")))?;
    spots.extend(peers);
    let svg = error_against_time(TITLE, &panels(&spots), COLUMNS);
    write(folder, &spots, &svg, seeds).map_err(Failure::midway)?;
    if is_json {
        return write_out(|out| {
            spots.iter().try_for_each(|spot| {
                let Spot { study, method, effort, seconds, error } = spot;
                let line = json!({"study": study, "method": method, "effort": effort,
                    "seconds": seconds, "error_relative": error});
                writeln!(out, "{line}")
            })
        });
    }
    let mut rows = vec![head(&spots)];
    rows.extend(cells(&spots));
    say(&format!("{}\n  {EXPLAINED}\n  folder {}\n", table(&rows), folder.display()))
}

const EXPLAINED: &str = "µs of processor time per value to a relative error of 1e-3, 1e-6, 1e-9, from \
                         which on every further effort stays within it; - where none did";

fn write(folder: &Path, spots: &[Spot], svg: &str, seeds: u64) -> Result<(), ExportError> {
    write_atomically(&folder.join("compute.csv"), |out| write_compute(out, spots))?;
    write_atomically(&folder.join("compute.svg"), |out| out.write_all(svg.as_bytes()))?;
    let page = page(spots, svg, seeds);
    write_atomically(&folder.join("compute.html"), |out| page.write(out))
}

/// Every method that answered, ours first, in the order of [`METHODS`].
fn methods(spots: &[Spot]) -> Vec<&str> {
    let mut names: Vec<&str> = METHODS.to_vec();
    for spot in spots {
        if !names.contains(&&*spot.method) {
            names.push(&spot.method);
        }
    }
    names
}

/// A panel for each quantity, a curve for each method: the kernel's, the others, and peers.
pub fn panels(spots: &[Spot]) -> Vec<Panel> {
    let curve = |study: &str, method: &str| {
        // A peer may have several ways to answer; each is a curve's mark, and time rises along it.
        let points = spots.iter().filter(|spot| spot.study == study && spot.method == method);
        let points: Vec<_> = points.map(|spot| (spot.seconds, spot.error)).collect();
        (!points.is_empty()).then(|| Curve { name: method.to_owned(), points, is_joined: true })
    };
    let panel = |(study, _): &(&str, _)| Panel {
        title: (*study).to_owned(),
        curves: methods(spots).iter().filter_map(|method| curve(study, method)).collect(),
    };
    STUDIES.iter().map(panel).collect()
}

fn head(spots: &[Spot]) -> Vec<String> {
    let names = methods(spots).into_iter().map(str::to_owned);
    std::iter::once("case".to_owned()).chain(names).collect()
}

fn cells(spots: &[Spot]) -> Vec<Vec<String>> {
    let counts: BTreeMap<(&str, &str), usize> = spots.iter().fold(BTreeMap::new(), |mut map, s| {
        *map.entry((s.study, &*s.method)).or_default() += 1;
        map
    });
    let cell = |study: &str, method: &str| {
        if !counts.contains_key(&(study, method)) {
            return String::new();
        }
        let reached = WITHIN.map(|within| fastest(spots, study, method, within));
        reached.map(|s| s.map_or("-".to_owned(), micro)).join(" / ")
    };
    let row = |(study, _): &(&str, _)| {
        let cells = methods(spots).into_iter().map(|method| cell(study, method));
        std::iter::once((*study).to_owned()).chain(cells).collect()
    };
    STUDIES.iter().map(row).collect()
}

/// Seconds as µs with two digits.
fn micro(seconds: f64) -> String {
    let micro = 1e6 * seconds;
    if micro >= 10.0 { format!("{micro:.0}") } else { format!("{micro:.2}") }
}

fn page(spots: &[Spot], svg: &str, seeds: u64) -> Report {
    let fact = |name: &str, text: String| (name.to_owned(), text);
    let element = svg.find("<svg").map_or(String::new(), |at| svg[at..].to_owned());
    let picture = Picture {
        name: "compute",
        title: TITLE.to_owned(),
        caption: format!(
            "Relative error against processor time per value, a panel a reference case. Errors of \
             random methods are root mean squares over {seeds} seeds; an error below 1e-16 is drawn \
             there. Efforts end with a value that takes {LONGEST_S} s. The methods beside ours know \
             only the integrand; peers were measured by themselves, on the machine that their file \
             is of."
        ),
        svg: element,
    };
    Report {
        title: TITLE.to_owned(),
        banners: Vec::new(),
        facts: vec![
            fact("cases", format!("{}, with reference values to 17 digits", STUDIES.len())),
            fact("answers", spots.len().to_string()),
        ],
        sections: vec![
            Section {
                title: "Error against time".to_owned(),
                pictures: vec![picture],
                ..Section::default()
            },
            Section {
                title: "Time to an error".to_owned(),
                paragraphs: vec![format!("{EXPLAINED}.")],
                table: Table { columns: head(spots), rows: cells(spots) },
                ..Section::default()
            },
        ],
    }
}
