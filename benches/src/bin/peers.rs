//! Peers side by side: what `benches/peers/run.sh` measured in one run, as tables and a picture. It
//! measures nothing itself. Mitsuba 3 is a renderer: it is asked for the light at a point by its own
//! light sampling, in single precision, and would answer the same for any scene of any surfaces.
//! pyviewfactor integrates form factors of polygons along their contours, as our `polygons` does.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use benches::{Arguments, Section, Spread, Table, Unmeasured, report};
use clap::Parser;
use gonio::report::{Curve, Panel, error_against_time};

/// Tables and a picture of what `benches/peers/run.sh` measured.
#[derive(Debug, Parser)]
struct Asked {
    /// What it wrote.
    measured: PathBuf,
    /// Draw error against time as SVG.
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,
    #[command(flatten)]
    arguments: Arguments,
}

fn main() -> ExitCode {
    let asked = Asked::parse();
    report(&asked.arguments, || section(&asked))
}

const OURS: &str = "radiometry";
const CLOSED: &str = "radiometry closed form";
const EASED: &str = "radiometry at the peer's error";
const MITSUBA: &str = "Mitsuba 3";
const CONTOUR: &str = "pyviewfactor";
/// What a random answer counts as right within.
const RIGHT: f64 = 0.01;

/// One answer.
#[derive(Debug, Clone)]
struct Answer {
    row: String,
    quantity: String,
    solver: String,
    effort: String,
    value: f64,
    /// Of random ones the root mean square over seeds.
    error: f64,
    /// The mean's error in units of what the case grants.
    of_tolerance: f64,
    seconds: f64,
}

fn read(path: &Path) -> Result<Vec<Answer>, Unmeasured> {
    let text = std::fs::read_to_string(path)?;
    let answer = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let [row, quantity, solver, effort, numbers @ ..] = cells.as_slice() else {
            return Err(Unmeasured::because(format!("`{line}` has too few columns")));
        };
        let numbers: Vec<f64> = numbers.iter().map(|n| n.parse()).collect::<Result<_, _>>()?;
        let [value, error, of_tolerance, seconds] = numbers[..] else {
            return Err(Unmeasured::because(format!("`{line}` has not four numbers")));
        };
        let [row, quantity, solver, effort] =
            [row, quantity, solver, effort].map(ToString::to_string);
        Ok(Answer { row, quantity, solver, effort, value, error, of_tolerance, seconds })
    };
    text.lines().skip(1).map(answer).collect()
}

/// All answers to one case.
struct Case<'a>(Vec<&'a Answer>);

impl<'a> Case<'a> {
    fn by(&self, solver: &str, effort: &str) -> Option<&'a Answer> {
        let is = |a: &&&Answer| a.solver == solver && (effort.is_empty() || a.effort == effort);
        self.0.iter().find(is).copied()
    }

    fn all_by(&self, solver: &str) -> impl Iterator<Item = &'a Answer> {
        self.0.iter().copied().filter(move |answer| answer.solver == solver)
    }
}

fn section(asked: &Asked) -> Result<Section, Unmeasured> {
    let answers = read(&asked.measured)?;
    let mut cases: BTreeMap<&str, Case<'_>> = BTreeMap::new();
    for answer in &answers {
        cases.entry(&answer.row).or_insert_with(|| Case(Vec::new())).0.push(answer);
    }
    if let Some(path) = &asked.figure {
        let title = "Peers on the same cases, one core, one run";
        std::fs::write(path, error_against_time(title, &panels(&cases), 3))?;
    }
    let mut section = Section::new("peers", "Peers side by side");
    section.say(
        "Written from one run of `benches/peers/run.sh`: Mitsuba 3.9.1 (`llvm_ad_rgb`, its own \
         light sampling at the point, single precision) and pyviewfactor 1.1.0, on the reference \
         cases, one core, processor time per value, warm. All answers: \
         [figures/peers.csv](figures/peers.csv).",
    );
    section.say(
        "![relative error against time per value of Mitsuba, pyviewfactor and radiometry, on \
         logarithmic axes](figures/peers.svg)",
    );
    light(&mut section, &cases);
    form_factors(&mut section, &cases);
    let is_right = |a: &Answer| a.of_tolerance <= 1.0 || (a.solver == MITSUBA && a.error <= RIGHT);
    let ours_miss = |case: &Case<'_>| case.by(OURS, "").is_none_or(|ours| ours.of_tolerance > 1.0);
    let lost: Vec<&str> = cases
        .iter()
        .filter(|(_, case)| ours_miss(case) && case.0.iter().any(|a| is_right(a)))
        .map(|(row, _)| *row)
        .collect();
    section.aim("no case that a peer gets right and we do not", lost.is_empty());
    if !lost.is_empty() {
        section.say(&format!("Lost: {}.", lost.join(", ")));
    }
    Ok(section)
}

/// Mitsuba: the ladders, and every case that it can be asked.
fn light(section: &mut Section, cases: &BTreeMap<&str, Case<'_>>) {
    section.say(
        "**Light at a point, against Mitsuba.** Error (root mean square over 8 seeds) and time. \
         Mitsuba solves the more general problem: any scene, any material, many bounces; here it is \
         asked for one diffuse source and at most one body in front of it.",
    );
    let mut ladder = Table::new(&[
        "case",
        "radiometry",
        "2^8 samples",
        "2^12 samples",
        "2^16 samples",
        "2^20 samples",
        "slower at equal error, times",
    ]);
    let mut least = f64::INFINITY;
    for (row, case) in cases {
        let (Some(ours), Some(_)) = (case.by(OURS, ""), case.by(MITSUBA, "2^8 samples")) else {
            continue;
        };
        let at = |effort: &str| case.by(MITSUBA, effort).map_or(String::new(), cell);
        // At no larger an error; the closed forms have but one.
        let like = |peer: &Answer| case.by(EASED, &peer.effort).unwrap_or(ours);
        let slower = |peer: &Answer| {
            if peer.error >= like(peer).error { peer.seconds / like(peer).seconds } else { 0.0 }
        };
        let ratio = case.all_by(MITSUBA).map(slower).fold(f64::INFINITY, f64::min);
        least = least.min(ratio);
        let head = [(*row).to_owned(), cell(ours)].into_iter();
        let efforts = [8, 12, 16, 20].map(|power| at(&format!("2^{power} samples")));
        ladder.row(head.chain(efforts).chain([format!("{ratio:.0} or more")]));
    }
    section.show(&ladder);
    section.say(
        "\"Slower\" is the least over its efforts: its time over that of ours whose error is no \
         larger. Much of its time at 2^8 samples is the start of a kernel, which it needs once for \
         many points.",
    );
    section.aim("at equal error ten times faster than the Monte Carlo peer", least >= 10.0);
    every_case(section, cases);
}

/// Mitsuba at one effort, by quantity.
fn every_case(section: &mut Section, cases: &BTreeMap<&str, Case<'_>>) {
    let mut all = Table::new(&[
        "quantity",
        "cases",
        "Mitsuba within 1 %",
        "1 to 50 % off",
        "further off, 0 or NaN",
        "its median",
        "radiometry within the case's tolerance",
        "its worst error",
        "its median time",
    ]);
    let mut quantities: BTreeMap<&str, Vec<(&Answer, &Answer)>> = BTreeMap::new();
    for case in cases.values() {
        let pair = case.by(MITSUBA, "2^16 samples").zip(case.by(OURS, ""));
        if let Some((peer, ours)) = pair {
            quantities.entry(&peer.quantity).or_default().push((peer, ours));
        }
    }
    for (quantity, pairs) in &quantities {
        let count =
            |is: &dyn Fn(&Answer) -> bool| pairs.iter().filter(|(peer, _)| is(peer)).count();
        let right = count(&|a| a.error <= RIGHT);
        let near = count(&|a| a.error > RIGHT && a.error <= 0.5);
        let met = pairs.iter().filter(|(_, ours)| ours.of_tolerance <= 1.0).count();
        let worst = pairs.iter().map(|(_, ours)| ours.error).fold(0.0, f64::max);
        let median = |of: &dyn Fn(&(&Answer, &Answer)) -> f64| {
            time(Spread::of(pairs.iter().map(of).collect()).median())
        };
        all.row([
            (*quantity).to_owned(),
            pairs.len().to_string(),
            right.to_string(),
            near.to_string(),
            (pairs.len() - right - near).to_string(),
            median(&|(peer, _)| peer.seconds),
            met.to_string(),
            format!("{worst:.0e}"),
            median(&|(_, ours)| ours.seconds),
        ]);
    }
    section.say(
        "Every case that it can be asked (no half-planes, no polygons with notches), at 2^16 samples. \
         Most of what it gets wrong lies beyond single precision (tiny or far sources, receivers \
         almost on a source) or is hardly ever sampled (slivers above the horizon).",
    );
    section.show(&all);
}

fn form_factors(section: &mut Section, cases: &BTreeMap<&str, Case<'_>>) {
    section.say(
        "**Form factors of polygons, against pyviewfactor.** Both integrate along contours; \
         ours to the tolerance that the case asks for (1e-8 for most) with an error bound, \
         pyviewfactor with 30 nodes an edge and no bound; \"to the peer's error\" is ours at the tolerance, of 0.1 to \
         1e-12, at which it is quickest and its error no larger than pyviewfactor's. Its bare kernel is timed on plain arrays, \
         its public function with what it makes of its meshes. The last column is our closed \
         form, where the case is a pair of rectangles that has one.",
    );
    let mut table = Table::new(&[
        "case",
        "F",
        "pyviewfactor, bare kernel",
        "public function",
        "radiometry, integrated",
        "to the peer's error",
        "closed form",
    ]);
    let (mut quicker, mut eased, mut right, mut rows) = (0, 0, 0, 0);
    let mut nearer = Vec::new();
    for (row, case) in cases {
        let Some((peer, ours)) = case.by(CONTOUR, "bare kernel").zip(case.by(OURS, "")) else {
            continue;
        };
        rows += 1;
        right += usize::from(peer.of_tolerance <= 1.0);
        quicker += usize::from(peer.seconds < ours.seconds);
        let at_equal_error = case.by(EASED, "bare kernel");
        eased += usize::from(at_equal_error.is_some_and(|ours| peer.seconds < ours.seconds));
        if peer.error < ours.error {
            nearer.push(format!("{row} ({:.0e} against {:.0e})", peer.error, ours.error));
        }
        table.row([
            (*row).to_owned(),
            format!("{:.4e}", ours.value),
            cell(peer),
            case.by(CONTOUR, "public function").map_or(String::new(), cell),
            cell(ours),
            at_equal_error.map_or(String::new(), cell),
            case.by(CLOSED, "").map_or(String::new(), cell),
        ]);
    }
    section.show(&table);
    section.say(&format!(
        "Of {rows} cases pyviewfactor is within the case's tolerance in {right}, radiometry's \
         integral in {}. Its bare kernel is quicker than our integral in {quicker}, mostly touching or \
         nearly touching pairs, where ours goes on until the tolerance is met; at no \
         larger an error than its own, it is quicker in {eased}. It is nearer to the truth in {}: {}.",
        cases.values().filter(|case| {
            case.by(CONTOUR, "").is_some() && case.by(OURS, "").is_some_and(|a| a.of_tolerance <= 1.0)
        }).count(),
        nearer.len(),
        nearer.join(", ")
    ));
}

/// Error and time.
fn cell(answer: &Answer) -> String {
    let error = if answer.error == 0.0 { "0".to_owned() } else { format!("{:.0e}", answer.error) };
    format!("{error} in {}", time(answer.seconds))
}

fn time(seconds: f64) -> String {
    if seconds < 1e-6 {
        format!("{:.0} ns", 1e9 * seconds)
    } else if seconds < 1e-5 {
        format!("{:.1} µs", 1e6 * seconds)
    } else if seconds < 1e-3 {
        format!("{:.0} µs", 1e6 * seconds)
    } else {
        format!("{:.1} ms", 1e3 * seconds)
    }
}

fn panels(cases: &BTreeMap<&str, Case<'_>>) -> Vec<Panel> {
    let of = |answers: Vec<&Answer>| -> Vec<(f64, f64)> {
        let finite = answers.into_iter().filter(|answer| answer.error.is_finite());
        finite.map(|answer| (answer.seconds, answer.error.min(1.0))).collect()
    };
    let curve = |name: &str, points: Vec<(f64, f64)>, is_joined: bool| {
        (!points.is_empty()).then(|| Curve { name: name.to_owned(), points, is_joined })
    };
    let ladders = cases.iter().filter(|(_, case)| case.by(MITSUBA, "2^8 samples").is_some());
    let mut panels: Vec<Panel> = ladders
        .map(|(row, case)| Panel {
            title: format!("{row}: {}", case.0[0].quantity.replace('-', " ")),
            curves: [
                curve(OURS, of(case.all_by(OURS).collect()), false),
                curve(MITSUBA, of(case.all_by(MITSUBA).collect()), true),
            ]
            .into_iter()
            .flatten()
            .collect(),
        })
        .collect();
    let form = || cases.values().filter(|case| case.by(CONTOUR, "").is_some());
    let each = |solver: &str, effort: &str| {
        of(form().filter_map(|case| case.by(solver, effort)).collect())
    };
    let curves = [
        curve(OURS, each(OURS, ""), false),
        curve(CLOSED, each(CLOSED, ""), false),
        curve("pyviewfactor, bare kernel", each(CONTOUR, "bare kernel"), false),
        curve("pyviewfactor, public function", each(CONTOUR, "public function"), false),
    ];
    panels.push(Panel {
        title: "form factors of polygons, all cases".to_owned(),
        curves: curves.into_iter().flatten().collect(),
    });
    panels
}
