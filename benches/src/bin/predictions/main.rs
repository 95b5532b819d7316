//! Does a plan take the time that `gonio plan` says, and is it as accurate? For every example runs with the
//! seeds 1 to N, what `gonio plan` foretells from the plan and the rig alone, and what `gonio plan --rehearse`
//! foretells with other seeds, before the example's own scene. Once on the rig as it is and once with its scale
//! known exactly (responsivity, lengths and gain without u): the scale outweighs all the rest.
//!
//! Time is compared after homing, which takes what the axes' whereabouts make of it: the plan
//! states the most that it can take. Of the uncertainties those that fits state: of the exitance over the
//! hemisphere, of the exitance within the region, and of the radiance, RMS over the region. Beside them stands
//! how far the fits are off the simulator's truth.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};

use benches::{Arguments, Program, Run, Section, Unmeasured, copy_example, edit, report};
use clap::Parser;
use serde_json::Value;

mod words;

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
/// Relative: a run and its rehearsal differ by rounding alone.
const SAME: f64 = 1e-9;
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
    /// After homing, by the plan; `None` where readings decide what is measured.
    foretold_s: Option<f64>,
    /// The same by the rehearsal.
    rehearsed_s: f64,
    /// By the runs, on the mean.
    measured_s: f64,
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
    let all: Vec<(&str, bool)> =
        [false, true].iter().flat_map(|known| EXAMPLES.map(|example| (example, *known))).collect();
    let one = |&(example, is_scale_known): &(&'static str, bool)| {
        let place = folder.path().join(format!("{example}-{is_scale_known}"));
        copy_example(example, &place)?;
        if is_scale_known {
            know_the_scale(&place.join("rig.toml"))?;
        }
        compare(&program, &place, (example, is_scale_known), asked.seeds)
    };
    let rows = two_at_once(&all, one).into_iter().collect::<Result<Vec<_>, Unmeasured>>()?;
    if let Some(path) = &asked.figure {
        std::fs::write(path, words::figure(&rows).svg())?;
    }
    Ok(words::section(&rows, asked.seeds))
}

/// Answers in the entries' order. A run has one thread and a rehearsal as many as there are cores: two examples
/// at once leave few cores idle, and rig time is the same beside whatever else there is.
fn two_at_once<E: Sync, T: Send>(entries: &[E], one: impl Fn(&E) -> T + Sync) -> Vec<T> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        loop {
            let taken = next.fetch_add(1, Ordering::Relaxed);
            // The last ones take longest.
            let Some(place) = entries.len().checked_sub(1 + taken) else { return done };
            let entry = &entries[place];
            done.push((place, one(entry)));
        }
    };
    let mut done: Vec<(usize, T)> = std::thread::scope(|scope| {
        let threads = [(); 2].map(|()| scope.spawn(work));
        threads.into_iter().flat_map(|thread| thread.join().expect("no panic")).collect()
    });
    done.sort_by_key(|(place, _)| *place);
    done.into_iter().map(|(_, answer)| answer).collect()
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
    // The time of what readings decide upon nobody can foretell from the plan.
    let is_open = said.number("uncertainty.radiance.u_relative").is_err();
    let total_s = said.number("time_s.total")? - said.number("time_s.homing")?;
    let foretold_s = (!is_open).then_some(total_s);
    // What a run's fit states all over the region is in no file of its folder: the runs are rehearsed by their
    // own seeds, the first one by itself, which shows that it is the run.
    let seeds_from = |first: u64, count: u64| {
        let (first, count) = (first.to_string(), count.to_string());
        program.well(&["plan", &plan, "--rehearse", &count, "--seed", &first, "--json"])
    };
    let first = seeds_from(1, 1)?;
    demand_same(program, &plan, &place.join("run"), &first)?;
    let mut all = vec![(1.0, first)];
    if seeds > 1 {
        all.push(((seeds - 1) as f64, seeds_from(2, seeds - 1)?));
    }
    let mean = |of: &dyn Fn(&Run) -> Result<f64, Unmeasured>| -> Result<f64, Unmeasured> {
        let parts = all.iter().map(|(count, run)| Ok(count * of(run)?));
        Ok(parts.sum::<Result<f64, Unmeasured>>()? / seeds as f64)
    };
    let measured_s = mean(&|run| run.number("rehearsal.after_homing_s"))?;
    let rehearsed_s = said.number("rehearsal.after_homing_s")?;
    let quantity = |i: usize| -> Result<Quantity, Unmeasured> {
        let (key, name) = QUANTITIES[i];
        let unit = if key == "radiance" { "" } else { "_w_per_m2" };
        let own = |what: &str| said.number(&format!("uncertainty.{key}{unit}.{what}")).ok();
        let rehearsed = |run: &Run, what: &str| run.number(&format!("rehearsal.{key}.{what}"));
        let measured = |what: &str| -> Result<f64, Unmeasured> {
            Ok(mean(&|run| Ok(rehearsed(run, what)?.powi(2)))?.sqrt())
        };
        Ok(Quantity {
            name,
            expected: own("u_relative"),
            range: own("u_range_relative.0").zip(own("u_range_relative.1")),
            rehearsed: rehearsed(&said, "u_relative")?,
            stated: measured("u_relative")?,
            error: measured("error_relative")?,
        })
    };
    Ok(Compared {
        example,
        is_scale_known,
        foretold_s,
        rehearsed_s,
        measured_s,
        quantities: [quantity(0)?, quantity(1)?, quantity(2)?],
    })
}

/// Refuses a rehearsal by the seed 1 that is not `gonio run` by the seed 1: in time, and in what its fit states.
fn demand_same(
    program: &Program,
    plan: &str,
    out: &Path,
    rehearsed: &Run,
) -> Result<(), Unmeasured> {
    let words = ["run", plan, "--seed", "1", "--out", &out.to_string_lossy(), "--json"];
    let run = program.run(&words)?;
    let took_s = run.number("rig_s")? - first_reading_s(out)?;
    let fit = std::fs::read_to_string(out.join("fit.json"))?;
    let fit: Value = serde_json::from_str(&fit).unwrap_or(Value::Null);
    std::fs::remove_dir_all(out)?;
    let mut pairs = vec![(took_s, rehearsed.number("rehearsal.after_homing_s")?)];
    for (key, _) in &QUANTITIES[..2] {
        let of = |what: &str| fit[format!("{key}_w_per_m2")][what].as_f64();
        let u = of("u").zip(of("value")).map(|(u, value)| u / value);
        let u = u.ok_or_else(|| Unmeasured::because(format!("fit.json has no {key}")))?;
        pairs.push((u, rehearsed.number(&format!("rehearsal.{key}.u_relative"))?));
    }
    match pairs.into_iter().find(|(run, rehearsed)| (run / rehearsed - 1.0).abs() > SAME) {
        None => Ok(()),
        Some((run, rehearsed)) => Err(Unmeasured::because(format!(
            "{plan}: a rehearsal by the seed of a run says {rehearsed}, and the run {run}"
        ))),
    }
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

/// Takes the uncertainty out of all that scales every reading alike.
fn know_the_scale(rig: &Path) -> Result<(), Unmeasured> {
    edit(rig, |line| {
        let (key, _) = line.split_once('=')?;
        SCALE_KEYS.contains(&key.trim()).then(|| format!("{key}= 0"))
    })
}
