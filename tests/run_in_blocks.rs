//! The end of a run whose readings are not kept, against that of one whose readings are: the files of a run's
//! folder, as people and scripts read them.

mod bench;

use std::fs;

use bench::Bench;
use serde_json::Value;

/// More than a block of readings, taken in another order than that of targets.
fn bench() -> Bench {
    Bench::small().with("plan.toml", "phi_step_deg = 45", "phi_step_deg = 10").with(
        "plan.toml",
        "theta_step_deg = 20",
        "theta_step_deg = 10",
    )
}

fn rows(text: &str) -> Vec<Vec<&str>> {
    text.lines().map(|line| line.split(',').collect()).collect()
}

/// The same texts, and the same numbers to rounding.
fn assert_same(file: &str, blocks: &str, kept: &str) {
    let (blocks, kept) = (rows(blocks), rows(kept));
    assert_eq!(blocks.len(), kept.len(), "{file}");
    for (i, (found, expected)) in blocks.iter().zip(&kept).enumerate() {
        assert_eq!(found.len(), expected.len(), "{file}, line {}", i + 1);
        for (found, expected) in found.iter().zip(expected) {
            let close = match (found.parse::<f64>(), expected.parse::<f64>()) {
                (Ok(found), Ok(expected)) => (found - expected).abs() <= 1e-6 * expected.abs(),
                _ => found == expected,
            };
            assert!(close, "{file}, line {}: {found} {expected}", i + 1);
        }
    }
}

fn assert_close(path: &str, blocks: &Value, kept: &Value) {
    let [found, expected] = [blocks, kept].map(|fit| fit.pointer(path).unwrap().as_f64().unwrap());
    assert!((found - expected).abs() <= 1e-3 * expected.abs(), "{path}: {found} {expected}");
}

#[test]
fn a_run_that_ends_in_blocks_leaves_the_files_of_one_that_is_kept() {
    let bench = bench();
    bench.gonio(&["run", "plan.toml", "--out", "kept"]).well();
    let said = bench.gonio(&["run", "plan.toml", "--out", "out", "--in-blocks", "--json"]);
    let said = said.well().json();
    assert_eq!(said["notes"][0], "read in blocks, its samples not all in memory at once");
    let [samples, readings, accuracy] = ["samples.csv", "readings.csv", "accuracy.csv"]
        .map(|file| [bench.text(&format!("out/{file}")), bench.text(&format!("kept/{file}"))]);
    assert!(rows(&samples[1]).len() > 1024, "{} lines", rows(&samples[1]).len());
    assert_same("samples.csv", &samples[0], &samples[1]);
    assert_eq!(readings[0], readings[1]);
    let [blocks, kept] = accuracy.each_ref().map(|text| rows(text));
    assert_eq!(blocks[0], kept[0]);
    assert_eq!(blocks.last().unwrap()[..2], kept.last().unwrap()[..2]);
    assert!(blocks.len() > 4, "{blocks:?}");
    // Half of the readings are a point of both, but for a dark or reference reading more or less; u within
    // what finer functions may say.
    let number = |text: &str| text.parse::<f64>().unwrap();
    let [half, other] = [&blocks[blocks.len() - 2], &kept[kept.len() - 3]];
    for (blocks, kept) in half.iter().zip(other) {
        let (blocks, kept) = (number(blocks), number(kept));
        assert!((blocks - kept).abs() < 0.1 * kept, "{half:?} {other:?}");
    }
    let [blocks, kept] = ["out", "kept"].map(|folder| bench.json(&format!("{folder}/fit.json")));
    for path in [
        "/exitance_w_per_m2/value",
        "/exitance_w_per_m2/u",
        "/peak_radiance/u",
        "/residual_rms",
        "/condition",
    ] {
        assert_close(path, &blocks, &kept);
    }
    for key in ["n_used", "n_flagged", "n_excluded", "truth", "resolves"] {
        assert!(!kept[key].is_null(), "{key}");
        if key != "truth" {
            assert_eq!(blocks[key], kept[key], "{key}");
        }
    }
    assert_close("/truth/exitance_w_per_m2/value", &blocks, &kept);
    let [blocks, kept] =
        ["out", "kept"].map(|folder| bench.json(&format!("{folder}/samples.meta.json")));
    for key in ["targets", "complete", "samples_flagged", "common_components", "dark", "reference"]
    {
        assert_eq!(blocks[key], kept[key], "{key}");
    }
    // All of the few samples are shown.
    let report = bench.text("out/report.html");
    assert!(report.contains("The run was read in blocks"), "{}", report.len());
    assert!(!report.contains("pictures and the table of flagged readings are of"));
}

#[test]
fn the_end_of_a_run_made_again_in_blocks_is_the_same() {
    let bench = Bench::small();
    bench.gonio(&["run", "plan.toml", "--out", "out"]).well();
    let kept = bench.text("out/samples.csv");
    fs::remove_file(bench.path("out/samples.csv")).unwrap();
    bench.gonio(&["resume", "out", "--in-blocks"]).well();
    assert_same("samples.csv", &bench.text("out/samples.csv"), &kept);
}

#[test]
fn without_a_fit_the_samples_of_a_run_in_blocks_stand() {
    // More functions than readings.
    let bench = Bench::small().with("plan.toml", "phi_step_deg = 45", "phi_step_deg = 180").with(
        "plan.toml",
        "angular_degree = 2",
        "angular_degree = 12",
    );
    for (folder, flag) in [("kept", None), ("out", Some("--in-blocks"))] {
        let arguments: Vec<&str> =
            ["run", "plan.toml", "--out", folder].into_iter().chain(flag).collect();
        bench.gonio(&arguments);
        assert!(!bench.path(&format!("{folder}/fit.json")).exists(), "{folder}");
    }
    assert_same("samples.csv", &bench.text("out/samples.csv"), &bench.text("kept/samples.csv"));
}
