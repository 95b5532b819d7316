//! The same plan on three kinds of rig, and what happens to the axes when a device dies.
//!
//! The example `servo-arm` is run, in simulated time, on a controller of gonio's own, on a board
//! with grbl and a picoammeter, and on Dynamixel servos and a picoammeter: the same axes, speeds
//! and plan, so that what differs is how the devices are spoken to. Its rig file is rewritten here
//! for each. Readings are compared target by target with those of gonio's own controller, in units
//! of the uncertainty that is not common to all readings.
//!
//! Then devices die in the midst of runs (`[[simulated.fault]]`), each fault in several moves or
//! readings: from that moment until the last axis came to rest, as the simulated devices say it.
//! That goes by real time, over pseudo-terminals, so that what others do on the machine is in it.
//! Of gonio's own controller the host dies: it stops in mid-move without a word, comes back, and
//! reads the device's own clock off the failure that it kept.

mod native;
mod ports;
mod rigs;

use std::path::Path;
use std::process::ExitCode;

use benches::{Arguments, Program, Section, Spread, Table, Unmeasured, report, rms};
use clap::Parser;
use rigs::{METER, RIGS, Rig};

/// Moves or readings of a run into which each fault falls in turn.
const NTH: std::ops::RangeInclusive<u32> = 5..=7;
/// After a move began, or a reading: the axes are on their way.
const IN_MOVE_MS: u32 = 200;
const AFTER_READING_MS: u32 = 300;

/// The same plan on three kinds of rig.
#[derive(Debug, Parser)]
struct Asked {
    #[command(flatten)]
    arguments: Arguments,
}

fn main() -> ExitCode {
    let asked = Asked::parse();
    report(&asked.arguments, || measure(&asked.arguments))
}

fn measure(arguments: &Arguments) -> Result<Section, Unmeasured> {
    let program = Program::find(arguments)?;
    let folder = tempfile::tempdir()?;
    let mut section = Section::new("devices", "The same plan on three kinds of rig");
    same_plan(&program, folder.path(), &mut section)?;
    dead_devices(&program, folder.path(), &mut section)?;
    Ok(section)
}

/// What a run of the plan came to.
struct Course {
    rig_s: f64,
    /// When the first reading began, and the last ended: since the start of the run.
    first_s: f64,
    last_s: f64,
    targets: usize,
    radiance: Vec<f64>,
    u: Vec<f64>,
}

fn same_plan(program: &Program, folder: &Path, section: &mut Section) -> Result<(), Unmeasured> {
    let mut courses = Vec::new();
    for rig in RIGS {
        let place = folder.join(rig.name);
        rigs::write(&rig, &place, "")?;
        courses.push((rig, run(program, &place)?));
    }
    let Some((_, own)) = courses.first() else {
        return Err(Unmeasured::because("no rig was run"));
    };
    let mut table = Table::new(&[
        "rig",
        "rig time, s",
        "until the first reading, s",
        "a target, s",
        "more than gonio's own, ms",
        "off, RMS u",
        "worst, u",
        "off, RMS %",
    ]);
    let pace = |course: &Course| (course.last_s - course.first_s) / course.targets as f64;
    for (rig, course) in &courses {
        if course.radiance.len() != own.radiance.len() {
            return Err(Unmeasured::because(format!("{}: other targets", rig.name)));
        }
        let pairs = || course.radiance.iter().zip(&own.radiance);
        let us = course.u.iter().zip(&own.u).map(|(a, b)| a.hypot(*b));
        let in_u: Vec<f64> = pairs().zip(us).map(|((a, b), u)| (a - b).abs() / u).collect();
        let relative: Vec<f64> = pairs().map(|(a, b)| 100.0 * (a / b - 1.0)).collect();
        table.row([
            rig.title.to_owned(),
            format!("{:.1}", course.rig_s),
            format!("{:.1}", course.first_s),
            format!("{:.3}", pace(course)),
            format!("{:.0}", 1e3 * (pace(course) - pace(own))),
            format!("{:.2}", rms(&in_u)),
            format!("{:.2}", in_u.iter().copied().fold(0.0, f64::max)),
            format!("{:.4}", rms(&relative)),
        ]);
    }
    section.say(&format!(
        "{} targets of `examples/servo-arm`, in simulated time. The first column of times holds \
         homing, which servos with absolute encoders do not need; u is what readings do not share.",
        own.targets
    ));
    section.show(&table);
    section.keep(table);
    Ok(())
}

fn run(program: &Program, place: &Path) -> Result<Course, Unmeasured> {
    let path = |name: &str| place.join(name).to_string_lossy().into_owned();
    let words = ["run", &path("plan.toml"), "--out", &path("run"), "--json"];
    let rig_s = program.well(&words)?.number("rig_s")?;
    let readings = std::fs::read_to_string(place.join("run/readings.csv"))?;
    let samples = std::fs::read_to_string(place.join("run/samples.csv"))?;
    let [begins, ends] = ["start_us", "end_us"].map(|name| column(&readings, name));
    let radiance = column(&samples, "radiance_w_per_m2_sr")?;
    Ok(Course {
        rig_s,
        first_s: 1e-6 * begins?.into_iter().fold(f64::INFINITY, f64::min),
        last_s: 1e-6 * ends?.into_iter().fold(0.0, f64::max),
        targets: radiance.len(),
        radiance,
        u: column(&samples, "u_independent_radiance_w_per_m2_sr")?,
    })
}

/// A column of numbers, by its head.
fn column(csv: &str, name: &str) -> Result<Vec<f64>, Unmeasured> {
    let mut lines = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let heads = lines.next().unwrap_or_default();
    let none = || Unmeasured::because(format!("no column {name}"));
    let place = heads.iter().position(|head| *head == name).ok_or_else(none)?;
    let number = |row: Vec<&str>| row.get(place).and_then(|cell| cell.parse().ok());
    lines.map(|row| number(row).ok_or_else(none)).collect()
}

fn dead_devices(program: &Program, folder: &Path, section: &mut Section) -> Result<(), Unmeasured> {
    let mut table = Table::new(&[
        "rig",
        "what dies in mid-move",
        "axes stand after, s (median)",
        "longest",
        "moves",
        "who stops them",
        "what the run ends with",
    ]);
    let stopped = native::host_dies(program, &folder.join("silent"))?;
    let row = |times: &Spread, moves: usize| {
        let s = |value: f64| format!("{value:.3}");
        [s(times.median()), s(times.quantile(1.0)), moves.to_string()]
    };
    let [median, longest, moves] = row(&Spread::of(stopped.clone()), stopped.len());
    let own = "gonio's own";
    let says = "the lease expired".to_owned();
    let braking = |s: String| format!("{s} + braking");
    let (median, longest) = (braking(median), braking(longest));
    let cells = [own.to_owned(), "the host".to_owned(), median, longest, moves];
    table.row(cells.into_iter().chain(["its lease, 500 ms".to_owned(), says]));
    for rig in RIGS {
        for (device, kind, who) in rig.faults {
            let (times, says) = die(program, folder, &rig, device, kind)?;
            let what = format!("{device}: {kind}");
            let moves = times.len();
            let [median, longest, moves] = row(&Spread::of(times), moves);
            let cells = [rig.title.to_owned(), what, median, longest, moves];
            table.row(cells.into_iter().chain([(*who).to_owned(), says]));
        }
    }
    section.say(
        &format!(
            "From the moment of the fault until the last axis came to rest, in real time over \
             pseudo-terminals: {IN_MOVE_MS} ms into a move, or {AFTER_READING_MS} ms after a reading \
             of the meter began, when the axes are on their way again. For this the arm and the \
             turntable go at half their speed, in steps of 40 and 60 degrees: the time of the board \
             that is unplugged is what is left of such a move."
        ),
    );
    section.show(&table);
    Ok(())
}

/// How long the axes went on, for each move that the fault fell into; and what the last run said.
fn die(
    program: &Program,
    folder: &Path,
    rig: &Rig,
    device: &str,
    kind: &str,
) -> Result<(Vec<f64>, String), Unmeasured> {
    let one = |nth: u32| {
        let place = folder.join(format!("{}-{device}-{kind}-{nth}", rig.name));
        let after_ms = if device == METER { AFTER_READING_MS } else { IN_MOVE_MS };
        let servo = if kind == "overload" { "servo = 1\n" } else { "" };
        let fault = format!(
            "\n[[simulated.fault]]\ndevice = \"{device}\"\nkind = \"{kind}\"\nnth = {nth}\n\
             after_ms = {after_ms}\n{servo}"
        );
        rigs::write(rig, &place, &fault)?;
        rigs::slow_down(&place)?;
        let (noted, said) = ports::run(program, &place, rig.driver)?;
        let at = |what: &str| {
            let line = noted.lines().find(|line| line.ends_with(what))?;
            line.split(' ').next()?.parse::<f64>().ok()
        };
        let time = at(kind).zip(at("the axes stand")).map(|(began, stood)| stood - began);
        let words = said.lines().find_map(|line| line.strip_prefix("error: the run stopped: "));
        let folder = format!("{}/", place.display());
        Ok::<_, Unmeasured>((time, words.unwrap_or_default().replace(&folder, "")))
    };
    // They wait for the devices more than they work: all moves at once.
    let ended = std::thread::scope(|scope| {
        let runs: Vec<_> =
            NTH.map(|nth| scope.spawn(move || one(nth).map_err(|e| e.to_string()))).collect();
        runs.into_iter()
            .map(|run| run.join().map_err(|_| "a run panicked".to_owned()))
            .collect::<Vec<_>>()
    });
    let mut times = Vec::new();
    let mut says = String::new();
    for run in ended {
        let (time, words) = run.flatten().map_err(Unmeasured::because)?;
        // What is wrong, without what to do about it.
        words.split(';').next().unwrap_or_default().clone_into(&mut says);
        times.extend(time.filter(|s| *s >= 0.0));
    }
    if times.is_empty() {
        return Err(Unmeasured::because(format!("{device}, {kind}: no move that it fell into")));
    }
    Ok((times, says))
}
