//! What accuracy costs: a short study of one scene runs through wire, journal, calibration,
//! interpolation and fit, finds its runs again, and refuses what makes no sense. Would break: a grid
//! that the interpolation does not recognise, readings that don't reach it, a cache that forgets or
//! confuses.
//!
//! The long version is `gonio study cost`; docs/accuracy-cost.md has what it found.

mod bench;

use bench::Bench;
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
}
