//! Whether stated uncertainties are honest: over many runs, each of which draws scene, rig and noise
//! anew, errors in units of u scatter like normal numbers. Would break: a component drawn and not
//! stated, stated and not drawn, averaged away though readings share it, or a bias.
//!
//! The long version is `gonio study coverage` without `--short`; docs/measured.md has what it found.

mod bench;

use bench::Bench;
use serde_json::Value;

#[test]
fn what_is_stated_covers_the_truth_with_and_without_the_scale() {
    let bench = Bench::empty();
    let words = ["study", "coverage", "--scenes", "lambertian,lobe", "--short", "--out", "found"];
    // The seed is fixed, so that this passes always or never.
    let said = bench.gonio(&[&words[..], &["--json"]].concat()).well().json();
    let number = |pool: &Value, key: &str| pool[key].as_f64().unwrap();
    let pools = said["pools"].as_array().unwrap();
    // Two scenes and both together, on rigs of two kinds, five quantities each.
    assert_eq!(pools.len(), 3 * 2 * 5);
    for pool in pools.iter().filter(|pool| pool["scene"].is_null()) {
        let rms = number(pool, "rms_error_over_u");
        assert!((0.5..1.6).contains(&rms), "{pool}");
    }
    assert!(said["demands"].as_array().unwrap().iter().all(|d| d["met"] == true), "{said}");
    let csv = bench.text("found/coverage.csv");
    assert!(csv.starts_with("scene,scale,quantity,x_mm,"), "{csv}");
    // M, M within, flux, four I, twenty L.
    assert_eq!(csv.lines().count(), 1 + 2 * 2 * 27);
    assert!(bench.text("found/coverage.svg").contains("lobe"));
}

#[test]
fn what_makes_no_sense_is_refused_before_anything_is_run() {
    let bench = Bench::empty();
    let study = |words: &[&str]| bench.gonio(&[&["study", "coverage"], words].concat());
    study(&["--scenes", "lambertain"]).refused(&["no `lambertain`", "lambertian, lobe"]);
    study(&["--doc", "measured.md", "--short"]).refused(&["--doc", "--date"]);
    study(&["--runs", "1"]).refused(&["from 2 to 1000000"]);
    assert_eq!(bench.names(), Vec::<String>::new());
}
