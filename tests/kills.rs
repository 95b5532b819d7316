//! Killed at any moment, a run keeps what it committed and is carried on to the same numbers. Would
//! break: a reading lost, altered or taken twice; a target twice in samples.csv; a resume that can't
//! be killed itself; a run killed after its last reading that never gets its files.
//!
//! The long version, at random moments, is `benches/src/bin/kills.rs`.

mod bench;

use std::time::{Duration, Instant};

use bench::Bench;
use gonio::journal::{Order, Reader};
use gonio::rig::Reading;

const PATIENCE: Duration = Duration::from_mins(1);

/// The small plan on a rig so quick that it takes some seconds in real time.
fn quick() -> Bench {
    Bench::small()
        .with("rig.toml", "speed_deg_per_s = 60", "speed_deg_per_s = 1200")
        .with("rig.toml", "acceleration_deg_per_s2 = 120", "acceleration_deg_per_s2 = 48000")
        .with("rig.toml", "speed_mm_per_s = 100", "speed_mm_per_s = 2000")
        .with("rig.toml", "acceleration_mm_per_s2 = 500", "acceleration_mm_per_s2 = 200000")
        .with("rig.toml", "settle_ms = 50", "settle_ms = 2")
}

fn committed(bench: &Bench) -> Vec<Reading> {
    let reader = Reader::open(&bench.path("out/run.sqlite"));
    reader.and_then(|reader| reader.readings(Order::Id)).unwrap_or_default()
}

/// Runs the program until so many readings are committed, and kills it; returns what was committed
/// just before.
fn killed_at(bench: &Bench, words: &[&str], readings: usize) -> Vec<Reading> {
    let began = Instant::now();
    let mut child = bench.command(words).stdout(std::process::Stdio::null()).spawn().unwrap();
    let had = loop {
        let had = committed(bench);
        if had.len() >= readings && Reader::open(&bench.path("out/run.sqlite")).is_ok() {
            break had;
        }
        assert!(child.try_wait().unwrap().is_none(), "ended with {} readings", had.len());
        assert!(began.elapsed() < PATIENCE, "{} readings after {PATIENCE:?}", had.len());
        std::thread::sleep(Duration::from_millis(2));
    };
    child.kill().unwrap();
    child.wait().unwrap();
    had
}

/// Index and radiance of every sample, as they stand in the file.
fn samples(bench: &Bench, out: &str) -> Vec<(String, String)> {
    let text = bench.text(&format!("{out}/samples.csv"));
    let rows = text.lines().skip(1).map(|line| line.split(',').collect::<Vec<_>>());
    rows.map(|row| (row[0].to_owned(), row[6].to_owned())).collect()
}

fn carried_on_after(kills: &[usize]) {
    let bench = quick();
    bench.gonio(&["run", "plan.toml", "--out", "whole"]).well();
    let run = ["run", "plan.toml", "--realtime", "--out", "out"];
    // Chance alone makes some references differ by more than 2 u; not what is asked here.
    let resume = ["resume", "out", "--realtime", "--accept-drift"];
    let mut seen = killed_at(&bench, &run, kills[0]);
    for &readings in &kills[1..] {
        seen.extend(killed_at(&bench, &resume, readings));
    }
    bench.gonio(&resume).well();
    let readings = committed(&bench);
    for reading in &seen {
        assert!(readings.contains(reading), "{reading:?} is gone");
    }
    let steps = Reader::open(&bench.path("out/run.sqlite")).unwrap().steps().unwrap();
    for step in steps {
        let times = readings.iter().filter(|reading| reading.id == step.id).count();
        assert_eq!(times, 1, "step {}", step.id);
    }
    assert_eq!(samples(&bench, "out"), samples(&bench, "whole"));
}

#[test]
fn a_run_killed_before_its_first_reading_is_carried_on() {
    carried_on_after(&[0]);
}

#[test]
fn a_run_killed_and_a_resume_killed_in_turn_are_carried_on() {
    carried_on_after(&[5, 40, 60]);
}

#[test]
fn a_run_killed_after_its_last_reading_gets_its_files_from_a_resume() {
    let bench = quick();
    bench.gonio(&["run", "plan.toml", "--out", "whole"]).well();
    bench.gonio(&["run", "plan.toml", "--out", "out"]).well();
    for name in [
        "samples.csv",
        "samples.meta.json",
        "readings.csv",
        "fit.json",
        "accuracy.csv",
        "report.html",
    ] {
        std::fs::remove_file(bench.path("out").join(name)).unwrap();
    }
    let said = bench.gonio(&["resume", "out", "--json"]).well().says(&["nothing is left"]);
    assert_eq!(said.json()["outcome"], "complete");
    for name in ["samples.csv", "readings.csv", "fit.json", "accuracy.csv"] {
        let (found, expected) = (format!("out/{name}"), format!("whole/{name}"));
        assert_eq!(bench.text(&found), bench.text(&expected), "{name}");
    }
}
