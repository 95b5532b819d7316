//! What accuracy costs: a short study of one scene runs through wire, journal, calibration,
//! interpolation and fit, finds its runs again, and refuses what makes no sense. Would break: a grid
//! that the interpolation does not recognise, readings that don't reach it, a cache that forgets or
//! confuses, a study that can't be stopped, or forgets what it did before.
//!
//! The long version is `gonio study cost`; docs/accuracy-cost.md has what it found.

mod bench;

use std::collections::BTreeMap;
use std::fs;
use std::process::Stdio;
use std::time::{Duration, Instant};

use bench::{Bench, Said, signal};
use serde_json::Value;

fn short(bench: &Bench, out: &str) -> Value {
    let words = ["study", "cost", "--short", "--json", "--cache", "kept", "--out", out];
    bench.gonio(&words).well().json()
}

#[test]
fn a_short_study_reaches_what_is_smooth_and_finds_its_runs_again() {
    let bench = Bench::empty();
    let said = short(&bench, "found");
    // Two rungs, four strategies, one seed; a strategy that is done climbs no further. (Adaptive runs
    // take their own time, and have tests of their own.)
    let runs = said["runs"].as_u64().unwrap();
    assert!((4..=8).contains(&runs), "{said}");
    let rows = said["reached"].as_array().unwrap();
    assert_eq!(rows.len(), 4 * 5);
    let time = |strategy: &str, target: &str| {
        let row = rows.iter().find(|r| r["strategy"] == strategy && r["target"] == target);
        row.unwrap()["rig_s"].as_f64()
    };
    // A slope and cos²: splines through four meridians and two places hold them to a few per cent.
    let (rest, flight) =
        (time("stop-and-go+interpolation", "L 5 %"), time("sweeps+interpolation", "L 5 %"));
    assert!(rest.unwrap() > 0.0 && flight.unwrap() < rest.unwrap(), "{said}");
    assert!(time("sweeps+fit", "L 5 %").is_some(), "{said}");
    let csv = bench.text("found/cost.csv");
    assert_eq!(csv.lines().count(), 1 + usize::try_from(runs).unwrap());
    assert!(csv.contains("gradient,sweeps+fit,"), "{csv}");
    assert!(bench.text("found/cost.svg").contains("<svg"));

    // Nothing is run again: the same numbers, the time that they took to compute included.
    assert_eq!(short(&bench, "again"), said);
    assert_eq!(bench.text("again/cost.csv"), csv);
}

/// The runs that are kept, whole ones.
fn kept(bench: &Bench) -> BTreeMap<String, String> {
    let Ok(entries) = fs::read_dir(bench.path("kept")) else { return BTreeMap::new() };
    let paths = entries.map(|entry| entry.unwrap().path());
    let whole = paths.filter(|path| path.extension().is_some_and(|extension| extension == "json"));
    whole.map(|path| (path.display().to_string(), fs::read_to_string(&path).unwrap())).collect()
}

#[test]
fn a_study_that_is_stopped_ends_soon_and_the_same_command_goes_on() {
    let bench = Bench::empty();
    let line = "study cost --scenes gradient --strategies sweeps+interpolation,sweeps+fit --seeds 2 \
                --quoted-seeds 2 --longest 60 --longest-fit 50 --json --cache kept --out found";
    let words: Vec<&str> = line.split_whitespace().collect();
    for name in ["TERM", "INT"] {
        let before = kept(&bench).len();
        let child =
            bench.command(&words).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let since = Instant::now();
        while kept(&bench).len() == before {
            assert!(since.elapsed() < Duration::from_mins(2), "nothing is kept");
            std::thread::sleep(Duration::from_millis(20));
        }
        signal(&child, name);
        let sent = Instant::now();
        let output = child.wait_with_output().unwrap();
        assert!(sent.elapsed() < Duration::from_secs(5), "{:?}", sent.elapsed());
        let said = Said::from_output("gonio study cost", &output);
        assert_eq!(said.code, Some(1), "{said}");
        said.says(&["stopped", "kept", "the same command goes on"]);
        // The folder is nobody's: the same command may make it.
        assert!(!bench.path("found").exists());
    }
    let before = kept(&bench);
    let said = bench.gonio(&words);
    let runs = said.json()["runs"].as_u64().unwrap();
    let after = kept(&bench);
    assert_eq!(after.len(), usize::try_from(runs).unwrap(), "{said}");
    assert!(before.len() < after.len(), "all was done before it was stopped: {said}");
    // What was kept was not run again.
    assert!(before.iter().all(|(path, text)| after.get(path) == Some(text)), "{said}");
}

#[test]
fn what_makes_no_sense_is_refused_before_anything_is_run() {
    let bench = Bench::empty();
    let study = |words: &[&str]| bench.gonio(&[&["study", "cost"], words].concat());
    study(&["--scenes", "batwings"]).refused(&["no `batwings`", "gloss"]);
    study(&["--strategies", "magic"]).refused(&["no `magic`", "sweeps+fit"]);
    study(&["--seeds", "3", "--quoted-seeds", "2"]).refused(&["--quoted-seeds 2", "at least"]);
    study(&["--doc", "cost.md"]).refused(&["--doc", "--date"]);
    study(&["--longest", "0"]).refused(&["above 0"]);
    assert_eq!(bench.names(), Vec::<String>::new());
    // A file is where the cache should be: nothing is made for a study that can't keep its runs.
    fs::write(bench.path("kept"), "").unwrap();
    study(&["--short", "--cache", "kept", "--out", "found"]).refused(&["--cache kept", "choose"]);
    assert_eq!(bench.names(), ["kept"]);
}
