//! What an acquisition costs beyond the motion itself: `gonio run` of a plan with 2,000 targets, in
//! virtual time, through the whole program (plan, protocol over a paced wire, simulated device,
//! journal, calibration, fit, files).
//!
//! *Rig time* is the device's: from the start of the first reading to the end of the last. The
//! *ideal* is the sum, over the same steps, of their moves by the axes' own profile, their settling
//! and their dwells, as the journal keeps the steps. What the rig takes beyond it is the wire's and
//! the program's. It is measured at several baud rates, and on a second rig that is quicker than
//! any gantry (speeds × 10, accelerations × 100, 1 ms to settle and to dwell), where motion hides
//! nothing. Homing is no part of either; its time is what the rig needs, not the program.
//!
//! *Wall time* is the process's, median of several runs after one to warm up. How it splits is told
//! by doing the parts alone: `gonio plan` of the same plan, the same readings into a fresh journal
//! in the transactions of virtual time, `gonio fit` of the finished run; the rest is simulating.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use benches::{
    Arguments, Program, Section, Spread, Table, Unmeasured, copy_example, edit, repeat_together,
    report, timed,
};
use clap::Parser;
use gonio::journal::{Journal, Order, Reader, Record};
use gonio::plan::StepTime;
use gonio::rig::{Latched, Rig};

/// Rig time over the ideal to aim at, at 1 Mbaud on the example's rig.
const AIM_RELATIVE: f64 = 0.05;
/// As the inline writer commits.
const BATCH: usize = 512;
const BAUDS: [u32; 3] = [1_000_000, 115_200, 57_600];

/// Rig time against the ideal, and wall time by part.
#[derive(Debug, Parser)]
struct Asked {
    /// Targets.
    #[arg(long, default_value_t = 2000, value_parser = clap::value_parser!(u32).range(10..=100_000))]
    targets: u32,
    /// Repeats of what is timed on the wall.
    #[arg(long, default_value_t = 5)]
    repeats: usize,
    #[command(flatten)]
    arguments: Arguments,
}

/// A run's time on the rig.
#[derive(Debug, Clone, Copy)]
struct RigTime {
    readings: usize,
    taken_s: f64,
    ideal_s: f64,
    /// The most that one step took beyond its ideal.
    worst_s: f64,
}

fn main() -> ExitCode {
    let asked = Asked::parse();
    report(&asked.arguments, || measure(&asked))
}

fn measure(asked: &Asked) -> Result<Section, Unmeasured> {
    let program = Program::find(&asked.arguments)?;
    let folder = tempfile::tempdir()?;
    let gantry = prepare(&folder.path().join("gantry"), asked.targets)?;
    let quick = prepare(&folder.path().join("quick"), asked.targets)?;
    make_quick(&quick)?;
    let mut rig_times = Table::new(&[
        "rig, wire",
        "readings",
        "rig time, s",
        "ideal, s",
        "beyond, %",
        "beyond a step, ms",
        "worst step, ms",
    ]);
    let mut beyond = Vec::new();
    for (name, place) in [("example's gantry", &gantry), ("quicker than any", &quick)] {
        for baud in BAUDS {
            edit(&place.join("rig.toml"), |line| {
                line.starts_with("baud").then(|| format!("baud = {baud}"))
            })?;
            let (_, out) = acquire(&program, place)?;
            let time = rig_time(&out)?;
            std::fs::remove_dir_all(&out)?;
            beyond.push(time.taken_s / time.ideal_s - 1.0);
            rig_times.row(row_of(&format!("{name}, {baud} baud"), time));
        }
    }
    edit(&gantry.join("rig.toml"), |line| {
        line.starts_with("baud").then(|| format!("baud = {}", BAUDS[0]))
    })?;
    let walls = walls(&program, &gantry, asked.repeats)?;
    let mut section = Section::new("acquisition", "What an acquisition costs beyond the motion");
    section.say(&format!("{} targets, scattered evenly (luminaire example).", asked.targets));
    section.show(&rig_times);
    section.aim("within 5 % of the ideal at 1 Mbaud (first row)", beyond[0].abs() <= AIM_RELATIVE);
    section.say(&format!(
        "Wall time of that run at 1 Mbaud, median (least to most) of {} after one to warm up.",
        asked.repeats
    ));
    section.show(&walls);
    section.keep(rig_times);
    Ok(section)
}

fn prepare(place: &Path, targets: u32) -> Result<PathBuf, Unmeasured> {
    copy_example("luminaire", place)?;
    edit(&place.join("plan.toml"), |line| {
        line.starts_with("count =").then(|| format!("count = {targets}"))
    })?;
    Ok(place.to_owned())
}

/// A rig whose motion hides no wire.
fn make_quick(place: &Path) -> Result<(), Unmeasured> {
    edit(&place.join("rig.toml"), |line| {
        let (key, rest) = line.split_once(" = ")?;
        let number = rest.split(' ').next()?.parse::<f64>();
        match key {
            "settle_ms" => Some("settle_ms = 1".to_owned()),
            key if key.starts_with("speed_") => Some(format!("{key} = {}", 10.0 * number.ok()?)),
            key if key.starts_with("acceleration_") => {
                Some(format!("{key} = {}", 100.0 * number.ok()?))
            }
            _ => None,
        }
    })?;
    edit(&place.join("plan.toml"), |line| {
        line.starts_with("dwell_ms").then(|| "dwell_ms = 1".to_owned())
    })
}

fn acquire(program: &Program, place: &Path) -> Result<(Duration, PathBuf), Unmeasured> {
    let (plan, out) = (place.join("plan.toml"), place.join("run"));
    let words =
        ["run".as_ref(), plan.as_os_str(), "--json".as_ref(), "--out".as_ref(), out.as_os_str()];
    let run = program.well(&words)?;
    Ok((run.wall, out))
}

/// Taken and ideal, from the journal alone.
fn rig_time(out: &Path) -> Result<RigTime, Unmeasured> {
    let rig = Rig::read(spanned_toml::Document::read(&out.join("rig.toml"))?)?;
    let reader = Reader::open(&out.join("run.sqlite"))?;
    let (steps, readings) = (reader.steps()?, reader.readings(Order::Id)?);
    if steps.len() != readings.len() {
        return Err(Unmeasured::because("the run is not complete"));
    }
    let first = readings.first().ok_or_else(|| Unmeasured::because("a run without readings"))?;
    let mut time = RigTime { readings: readings.len(), taken_s: 0.0, ideal_s: 0.0, worst_s: 0.0 };
    let mut here = Latched([0; 4]);
    let mut free_us = first.start_us;
    for (i, (step, reading)) in steps.iter().zip(&readings).enumerate() {
        let ideal = StepTime::of(&rig, here, step);
        // Before the first reading stands homing.
        let ideal_s = if i == 0 { ideal.dwelling_s } else { ideal.total_s() };
        let taken_s = (reading.end_us - free_us) as f64 * 1e-6;
        time.taken_s += taken_s;
        time.ideal_s += ideal_s;
        time.worst_s = time.worst_s.max(taken_s - ideal_s);
        (here, free_us) = (step.counts, reading.end_us);
    }
    Ok(time)
}

fn row_of(name: &str, time: RigTime) -> Vec<String> {
    let beyond_s = time.taken_s - time.ideal_s;
    vec![
        name.to_owned(),
        time.readings.to_string(),
        format!("{:.2}", time.taken_s),
        format!("{:.2}", time.ideal_s),
        thousandths(100.0 * beyond_s / time.ideal_s),
        thousandths(1e3 * beyond_s / time.readings as f64),
        thousandths(1e3 * time.worst_s),
    ]
}

/// Three places, and no sign before a zero.
fn thousandths(number: f64) -> String {
    format!("{:.3}", (1e3 * number).round() / 1e3 + 0.0)
}

fn walls(program: &Program, place: &Path, repeats: usize) -> Result<Table, Unmeasured> {
    let plan = place.join("plan.toml");
    let plan_words = ["plan".as_ref(), plan.as_os_str(), "--json".as_ref()];
    // All parts in turn, so that whatever else the machine does slows them alike.
    let [whole, planning, journalling, fitting] = repeat_together(repeats, || {
        let (whole, out) = acquire(program, place)?;
        let planning = program.well(&plan_words)?.wall;
        let journalling = replay(&out)?;
        let fit_words = ["fit".as_ref(), out.as_os_str(), "--json".as_ref()];
        let fitting = program.well(&fit_words)?.wall;
        std::fs::remove_dir_all(out)?;
        Ok([whole, planning, journalling, fitting])
    })?;
    let parts = planning.median() + fitting.median() + journalling.median();
    let mut table = Table::new(&["part", "s", "of the whole"]);
    let total = whole.median();
    let share = |seconds: f64| format!("{:.0} %", 100.0 * seconds / total);
    let mut row = |name: &str, time: &Spread| {
        table.row([name.to_owned(), format!("{time:.3}"), share(time.median())]);
    };
    row("the whole of `gonio run`", &whole);
    row("plan: read, lay out, order", &planning);
    row("journal: create, append", &journalling);
    row("calibrate and fit, 12 times, and fit.json", &fitting);
    let rest = total - parts;
    table.row(["the rest: simulating, wire, files".to_owned(), format!("{rest:.3}"), share(rest)]);
    Ok(table)
}

/// The run's journal written once more, as virtual time commits.
fn replay(out: &Path) -> Result<Duration, Unmeasured> {
    let reader = Reader::open(&out.join("run.sqlite"))?;
    let (header, inputs, steps) = (reader.header()?, reader.inputs()?, reader.steps()?);
    let records: Vec<Record> =
        reader.readings(Order::Taken)?.into_iter().map(Record::Reading).collect();
    let folder = tempfile::tempdir_in(out)?;
    let (time, ()) = timed(|| {
        let path = folder.path().join("run.sqlite");
        let mut journal = Journal::create(&path, &header, &inputs, &steps)?;
        for batch in records.chunks(BATCH) {
            journal.append(batch)?;
        }
        Ok(journal.close()?)
    })?;
    Ok(time)
}
