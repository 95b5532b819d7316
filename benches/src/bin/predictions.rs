//! Does a plan take the time that `gonio plan` says, and is it as accurate? For every example, first
//! `gonio plan --rehearse`, then `gonio run` with the seeds 1 to N, none of which the rehearsal had. Once on
//! the rig as it is and once with its scale known exactly (responsivity, lengths and gain without u): the
//! scale outweighs all the rest.
//!
//! Time is compared after homing, which takes what the axes' whereabouts make of it: the plan
//! states the most that it can take. Of the uncertainties those that fits state: of the exitance over the
//! hemisphere, of the exitance within the region, and of the radiance, RMS over the region; foretold from
//! `[expect]` alone, which knows no scene, and by the rehearsal, whose likely scene is the example's own.
//! Beside the radiance's stands how far the fits are off the simulator's truth.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use benches::scatter::{Group, Scatter};
use benches::{
    Arguments, Program, Run, Section, Table, Unmeasured, copy_example, edit, report, rms,
};
use clap::Parser;
use serde_json::Value;

const EXAMPLES: [&str; 8] = [
    "lambertian",
    "led-lobe",
    "batwing",
    "luminaire",
    "penumbra",
    "sun-window",
    "servo-arm",
    "adaptive",
];
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
/// A u below this part of a quantity is none that a rig has, and what it is a factor of says nothing.
const U_MIN: f64 = 1e-5;
/// Rehearsed with seeds from here on, measured with those from 1.
const REHEARSAL_SEED: &str = "1001";

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

/// One example on one rig: foretold, then measured.
struct Compared {
    example: &'static str,
    is_scale_known: bool,
    time_s: [f64; 2],
    quantities: [Quantity; 3],
}

/// A relative u.
struct Quantity {
    name: &'static str,
    /// From what the plan expects; `None` where readings decide what is measured.
    expected: Option<f64>,
    /// The same for the features that the basis follows better, and for the others.
    range: Option<(f64, f64)>,
    rehearsed: f64,
    /// What the runs' fits state, RMS.
    stated: f64,
    /// How far they are off the truth, RMS.
    error: f64,
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
    let runs = seeds.to_string();
    let rehearse = ["--rehearse", &runs, "--seed", REHEARSAL_SEED, "--json"];
    let said = program.well(&[&["plan", &plan][..], &rehearse].concat())?;
    // The time of what readings decide upon is known to a rehearsal alone.
    let is_open = said.number("uncertainty.radiance.u_relative").is_err();
    let foretold_s = if is_open {
        said.number("rehearsal.after_homing_s")?
    } else {
        said.number("time_s.total")? - said.number("time_s.homing")?
    };
    let mut times = Vec::new();
    let mut stated: [Vec<f64>; 2] = Default::default();
    for seed in 1..=seeds {
        let out = place.join(format!("run-{seed}"));
        let seed = seed.to_string();
        let words = ["run", &plan, "--seed", &seed, "--out", &text(out.clone()), "--json"];
        let run = program.run(&words)?;
        times.push(run.number("rig_s")? - first_reading_s(&out)?);
        let fit = std::fs::read_to_string(out.join("fit.json"))?;
        let fit: Value = serde_json::from_str(&fit).unwrap_or(Value::Null);
        for (stated, (key, _)) in stated.iter_mut().zip(QUANTITIES) {
            let of = |what: &str| fit[format!("{key}_w_per_m2")][what].as_f64();
            let u = of("u").zip(of("value")).map(|(u, value)| u / value);
            stated.push(u.ok_or_else(|| Unmeasured::because(format!("fit.json has no {key}")))?);
        }
        std::fs::remove_dir_all(out)?;
    }
    // The same runs once more: what their fits state all over the region is in no file.
    let again = ["plan", &plan, "--rehearse", &runs, "--seed", "1", "--json"];
    let again = program.well(&again)?;
    let quantity = |i: usize| -> Result<Quantity, Unmeasured> {
        let (key, name) = QUANTITIES[i];
        let unit = if key == "radiance" { "" } else { "_w_per_m2" };
        let own = |what: &str| said.number(&format!("uncertainty.{key}{unit}.{what}")).ok();
        let of = |run: &Run, what: &str| run.number(&format!("rehearsal.{key}.{what}"));
        let stated = match stated.get(i) {
            Some(stated) => rms(stated),
            None => of(&again, "u_relative")?,
        };
        Ok(Quantity {
            name,
            expected: own("u_relative"),
            range: own("u_range_relative.0").zip(own("u_range_relative.1")),
            rehearsed: of(&said, "u_relative")?,
            stated,
            error: of(&again, "error_relative")?,
        })
    };
    let measured_s = times.iter().sum::<f64>() / times.len() as f64;
    Ok(Compared {
        example,
        is_scale_known,
        time_s: [foretold_s, measured_s],
        quantities: [quantity(0)?, quantity(1)?, quantity(2)?],
    })
}

/// As the program's JSON says them, and the table.
const QUANTITIES: [(&str, &str); 3] = [
    ("exitance", "exitance"),
    ("exitance_within_region", "within region"),
    ("radiance", "radiance"),
];

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
        "{seeds} runs an example; relative standard uncertainties in per cent, RMS over the runs. \"Stated\" is \
         what the fits of the runs say. \"Expected\" is foretold by `gonio plan` from the plan and the rig alone, \
         \"from\" and \"to\" for features that the basis follows better and worse; \"rehearsed\" by \
         `gonio plan --rehearse {seeds}` with other seeds, before the example's own scene: what a person foretells \
         who knows the source. \"Error\" is how far the fits are off the simulator's truth. Once with the scale as \
         it is, once with it known exactly. Where readings decide what is measured the time is the rehearsal's."
    ));
    let mut times = Table::new(&["example", "foretold after homing, s", "measured, s"]);
    for row in rows.iter().filter(|row| !row.is_scale_known) {
        let [foretold, measured] = row.time_s.map(|s| format!("{s:.1}"));
        times.row([row.example.to_owned(), foretold, measured]);
    }
    section.show(&times);
    let mut table = Table::new(&[
        "example, scale",
        "quantity",
        "expected, %",
        "from",
        "to",
        "rehearsed, %",
        "stated, %",
        "stated / expected",
        "stated / rehearsed",
        "error, %",
    ]);
    for row in rows {
        for quantity in &row.quantities {
            table.row([row.name()].into_iter().chain(quantity.cells()));
        }
    }
    section.show(&table);
    let time = rows.iter().all(|row| (row.time_s[1] / row.time_s[0] - 1.0).abs() <= TIME_AIM);
    section.aim("time after homing within 2 % of the prediction", time);
    let missed = |of: fn(&Quantity) -> Option<f64>| -> Vec<String> {
        let pairs = rows.iter().flat_map(|row| row.quantities.iter().map(move |q| (row, q)));
        let missed =
            pairs.filter(|(_, q)| of(q).is_some_and(|foretold| !within(foretold, q.stated)));
        missed.map(|(row, q)| format!("{} of {}", q.name, row.name())).collect()
    };
    for (how, missed) in [
        ("by a rehearsal", missed(|q| Some(q.rehearsed))),
        ("from what the plan expects", missed(|q| q.expected)),
    ] {
        let aim = format!("u stated within a factor 1.3 of that foretold {how}");
        section.aim(&aim, missed.is_empty());
        if !missed.is_empty() {
            section.say(&format!("Beyond it: {}.", missed.join("; ")));
        }
    }
    section.say("Where both are below 0.001 % they count as the same.");
    section.keep(raw(rows));
    section
}

impl Compared {
    fn name(&self) -> String {
        let scale = if self.is_scale_known { "known" } else { "drawn" };
        format!("{}, {scale}", self.example)
    }
}

impl Quantity {
    fn cells(&self) -> [String; 9] {
        let or_none = |value: Option<f64>| value.map_or_else(String::new, percent);
        let ratio = |foretold: f64| format!("{:.2}", self.stated / foretold);
        [
            self.name.to_owned(),
            or_none(self.expected),
            or_none(self.range.map(|range| range.0)),
            or_none(self.range.map(|range| range.1)),
            percent(self.rehearsed),
            percent(self.stated),
            self.expected.map_or_else(String::new, ratio),
            ratio(self.rehearsed),
            percent(self.error),
        ]
    }
}

fn within(foretold: f64, stated: f64) -> bool {
    let is_none = foretold < U_MIN && stated < U_MIN;
    is_none || (1.0 / U_AIM..=U_AIM).contains(&(stated / foretold))
}

fn percent(relative: f64) -> String {
    format!("{:.2e}", 100.0 * relative)
}

fn figure(rows: &[Compared]) -> Scatter {
    let of = |name: &str, is_known: bool, foretold: fn(&Quantity) -> Option<f64>| {
        let rows = rows.iter().filter(|row| row.is_scale_known == is_known);
        let all = rows.flat_map(|row| &row.quantities);
        let points = all.filter_map(|q| Some((foretold(q)?, q.stated / foretold(q)?)));
        Group { name: name.to_owned(), points: points.collect() }
    };
    Scatter {
        title: "Stated over foretold uncertainty, every example".to_owned(),
        x_label: "foretold, relative".to_owned(),
        y_label: "stated / foretold".to_owned(),
        levels: vec![1.0 / U_AIM, U_AIM],
        groups: vec![
            of("expected", false, |q| q.expected),
            of("expected, scale known", true, |q| q.expected),
            of("rehearsed", false, |q| Some(q.rehearsed)),
            of("rehearsed, scale known", true, |q| Some(q.rehearsed)),
        ],
    }
}

fn raw(rows: &[Compared]) -> Table {
    let mut raw = Table::new(&[
        "example",
        "scale_known",
        "quantity",
        "expected",
        "rehearsed",
        "measured",
        "error",
    ]);
    for row in rows {
        let known = row.is_scale_known.to_string();
        let [foretold, measured] = row.time_s.map(|s| format!("{s:e}"));
        let own = [row.example.to_owned(), known.clone()];
        let time = ["time_after_homing_s".to_owned(), foretold, String::new(), measured];
        raw.row(own.into_iter().chain(time).chain([String::new()]));
        for quantity in &row.quantities {
            let Quantity { name, expected, rehearsed, stated, error, .. } = quantity;
            let expected = expected.map_or_else(String::new, |u| format!("{u:e}"));
            let own = [row.example.to_owned(), known.clone(), format!("u {name}"), expected];
            raw.row(own.into_iter().chain([rehearsed, stated, error].map(|u| format!("{u:e}"))));
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
