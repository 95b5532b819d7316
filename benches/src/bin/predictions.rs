//! Does a plan take the time that `gonio plan` says, and is it as accurate? For every example,
//! `gonio plan` first, then `gonio run` with the seeds 1 to N. Once on the rig as it is and once
//! with its scale known exactly (responsivity, lengths and gain without u): the scale outweighs all
//! the rest, and its draw is each seed's own.
//!
//! Time is compared after homing, which takes what the axes' whereabouts make of it: the plan
//! states the most that it can take. Of the uncertainties three are compared: the exitance's u as
//! the run's fit states it; the same without what readings share; and, where the scale is known,
//! the RMS error of the radiance against the simulator's truth, RMS over the seeds.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use benches::scatter::{Group, Scatter};
use benches::{Arguments, Program, Section, Table, Unmeasured, copy_example, edit, report, rms};
use clap::Parser;

const EXAMPLES: [&str; 6] =
    ["lambertian", "led-lobe", "batwing", "luminaire", "penumbra", "sun-window"];
const SCALE_KEYS: [&str; 5] = [
    "u_distance_mm",
    "u_pupil_diameter_mm",
    "u_spot_diameter_mm",
    "u_responsivity_relative",
    "u_relative",
];
/// Relative, of time after homing.
const TIME_AIM: f64 = 0.02;
/// Factor, either way, of an uncertainty.
const U_AIM: f64 = 1.3;

/// Whether predictions of time and uncertainty hold.
#[derive(Debug, Parser)]
struct Asked {
    /// Seeds an example.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    /// Draw measured over predicted as SVG.
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,
    #[command(flatten)]
    arguments: Arguments,
}

/// One example on one rig: predicted, then measured.
struct Compared {
    example: &'static str,
    is_scale_known: bool,
    time_s: [f64; 2],
    exitance: [f64; 2],
    independent: [f64; 2],
    radiance: [f64; 2],
    has_truncation: bool,
}

fn main() -> ExitCode {
    let asked = Asked::parse();
    report(&asked.arguments, || measure(&asked))
}

fn measure(asked: &Asked) -> Result<Section, Unmeasured> {
    let program = Program::find(&asked.arguments)?;
    let folder = tempfile::tempdir()?;
    let mut rows = Vec::new();
    for is_scale_known in [false, true] {
        for example in EXAMPLES {
            let place = folder.path().join(format!("{example}-{is_scale_known}"));
            copy_example(example, &place)?;
            if is_scale_known {
                know_the_scale(&place.join("rig.toml"))?;
            }
            rows.push(compare(&program, &place, (example, is_scale_known), asked.seeds)?);
        }
    }
    if let Some(path) = &asked.figure {
        std::fs::write(path, figure(&rows).svg())?;
    }
    Ok(section(&rows, asked.seeds))
}

fn compare(
    program: &Program,
    place: &Path,
    (example, is_scale_known): (&'static str, bool),
    seeds: u64,
) -> Result<Compared, Unmeasured> {
    let text = |path: PathBuf| path.to_string_lossy().into_owned();
    let plan = text(place.join("plan.toml"));
    let said = program.well(&["plan", &plan, "--json"])?;
    let exitance = |key: &str| said.number(&format!("uncertainty.exitance_w_per_m2.{key}"));
    let radiance = |key: &str| said.number(&format!("uncertainty.radiance.{key}"));
    let predicted_s = said.number("time_s.total")? - said.number("time_s.homing")?;
    let (mut times, mut us, mut independents, mut errors) = (vec![], vec![], vec![], vec![]);
    for seed in 1..=seeds {
        let out = place.join(format!("run-{seed}"));
        let seed = seed.to_string();
        let words = ["run", &plan, "--seed", &seed, "--out", &text(out.clone()), "--json"];
        let run = program.run(&words)?;
        let value = run.number("exitance_w_per_m2.value")?;
        times.push(run.number("rig_s")? - first_reading_s(&out)?);
        us.push(run.number("exitance_w_per_m2.u")? / value);
        independents.push(run.number("exitance_w_per_m2.u_independent")? / value);
        errors.push(run.number("truth.radiance_error_rms_relative")?);
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    Ok(Compared {
        example,
        is_scale_known,
        time_s: [predicted_s, mean(&times)],
        exitance: [exitance("u_relative")?, rms(&us)],
        independent: [exitance("independent_relative")?, rms(&independents)],
        radiance: [radiance("u_relative")?, rms(&errors)],
        has_truncation: radiance("truncation_relative").is_ok(),
    })
}

/// When the first reading began: the axes were at home, and it was taken there.
fn first_reading_s(run: &Path) -> Result<f64, Unmeasured> {
    let csv = std::fs::read_to_string(run.join("readings.csv"))?;
    let mut lines = csv.lines();
    let head: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let column = head.iter().position(|name| *name == "time_s");
    let column = column.ok_or_else(|| Unmeasured::because("readings.csv has no time_s"))?;
    let times = lines.filter_map(|line| line.split(',').nth(column)?.parse::<f64>().ok());
    Ok(times.fold(f64::INFINITY, f64::min))
}

fn section(rows: &[Compared], seeds: u64) -> Section {
    let mut section = Section::new("predictions", "Do predictions of time and accuracy hold?");
    section.say(&format!(
        "{seeds} seeds an example. Predicted by `gonio plan` from the plan and the rig alone, then \
         measured; relative uncertainties in per cent. \"Exitance\" is the u that the fit states, \
         \"independent\" its part that readings do not share. \"Radiance\" is predicted as RMS of \
         u over the region and measured as RMS error against the simulator's truth, on rigs whose \
         scale is known exactly: with the scale drawn, five seeds would tell little."
    ));
    let mut table = Table::new(&[
        "example, scale",
        "time after homing, s",
        "measured",
        "exitance, %",
        "stated",
        "independent, %",
        "stated",
        "radiance, %",
        "error",
        "missed",
    ]);
    let mut misses = Vec::new();
    for row in rows {
        let missed = row.missed();
        let scale = if row.is_scale_known { "known" } else { "drawn" };
        let radiance = if row.is_scale_known {
            row.radiance.map(percent)
        } else {
            [percent(row.radiance[0]), String::new()]
        };
        let pairs = [row.time_s.map(|s| format!("{s:.1}")), row.exitance.map(percent)];
        let cells = pairs.into_iter().chain([row.independent.map(percent), radiance]).flatten();
        let cells = std::iter::once(format!("{}, {scale}", row.example)).chain(cells);
        table.row(cells.chain([missed.join("; ")]));
        misses.extend(missed.into_iter().map(|what| format!("{} ({what})", row.example)));
    }
    section.show(&table);
    let time = rows.iter().all(|row| (row.time_s[1] / row.time_s[0] - 1.0).abs() <= TIME_AIM);
    section.aim("time after homing within 2 % of the prediction", time);
    let stated = rows.iter().filter(|row| !row.is_scale_known).all(|row| within(row.exitance));
    section.aim("exitance's stated u within a factor 1.3, scale drawn", stated);
    let radiance = rows.iter().filter(|row| row.is_scale_known).all(|row| within(row.radiance));
    section.aim("radiance's error within a factor 1.3 of its u, scale known", radiance);
    let undeclared: Vec<&str> = rows
        .iter()
        .filter(|row| !row.has_truncation && row.is_scale_known)
        .map(|r| r.example)
        .collect();
    if !undeclared.is_empty() {
        let names = undeclared.join(", ");
        section
            .say(&format!("No feature is declared, and so no truncation predicted, for {names}."));
    }
    section.keep(raw(rows));
    section
}

impl Compared {
    /// What of it lies beyond its aim.
    fn missed(&self) -> Vec<String> {
        let mut missed = Vec::new();
        if (self.time_s[1] / self.time_s[0] - 1.0).abs() > TIME_AIM {
            missed.push("time".to_owned());
        }
        let mut add = |name: &str, pair: [f64; 2]| {
            if !within(pair) {
                missed.push(format!("{name} {:.2}x", pair[1] / pair[0]));
            }
        };
        add("exitance", self.exitance);
        add("independent", self.independent);
        if self.is_scale_known {
            add("radiance", self.radiance);
        }
        missed
    }
}

fn within([predicted, measured]: [f64; 2]) -> bool {
    (1.0 / U_AIM..=U_AIM).contains(&(measured / predicted))
}

fn percent(relative: f64) -> String {
    format!("{:.2e}", 100.0 * relative)
}

fn figure(rows: &[Compared]) -> Scatter {
    let ratio = |[predicted, measured]: [f64; 2]| (predicted, measured / predicted);
    let of = |name: &str, is_known: bool, pair: fn(&Compared) -> [f64; 2]| {
        let rows = rows.iter().filter(|row| row.is_scale_known == is_known);
        Group { name: name.to_owned(), points: rows.map(|row| ratio(pair(row))).collect() }
    };
    Scatter {
        title: "Measured over predicted uncertainty, every example".to_owned(),
        x_label: "predicted, relative".to_owned(),
        y_label: "measured / predicted".to_owned(),
        levels: vec![1.0 / U_AIM, U_AIM],
        groups: vec![
            of("exitance, u stated", false, |row| row.exitance),
            of("exitance, scale known", true, |row| row.exitance),
            of("exitance, independent", true, |row| row.independent),
            of("radiance, error, scale known", true, |row| row.radiance),
        ],
    }
}

fn raw(rows: &[Compared]) -> Table {
    let mut raw = Table::new(&["example", "scale_known", "quantity", "predicted", "measured"]);
    for row in rows {
        for (name, [predicted, measured]) in [
            ("time_after_homing_s", row.time_s),
            ("u_exitance_relative", row.exitance),
            ("u_independent_exitance_relative", row.independent),
            ("radiance_rms_relative", row.radiance),
        ] {
            let known = row.is_scale_known.to_string();
            let cells = [row.example.to_owned(), known, name.to_owned()];
            raw.row(cells.into_iter().chain([format!("{predicted:e}"), format!("{measured:e}")]));
        }
    }
    raw
}

/// Takes the uncertainty out of all that scales every reading alike.
fn know_the_scale(rig: &Path) -> Result<(), Unmeasured> {
    edit(rig, |line| {
        let (key, _) = line.split_once('=')?;
        SCALE_KEYS.contains(&key.trim()).then(|| format!("{key}= 0"))
    })
}
