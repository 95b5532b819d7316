//! A run from its plan to its folder, and its folder read again: what scripts rely on, byte for
//! byte where the contract says so.

mod bench;

use std::process::Stdio;
use std::time::{Duration, Instant};

use bench::{Bench, Said};

const SAMPLES: &str = "index,time_s,x_mm,y_mm,theta_deg,phi_deg,radiance_w_per_m2_sr,\
                       u_radiance_w_per_m2_sr,dwell_s,flags";

/// The number at a path of keys.
#[track_caller]
fn number(document: &serde_json::Value, path: &str) -> f64 {
    let found = document.pointer(path).and_then(serde_json::Value::as_f64);
    found.unwrap_or_else(|| panic!("no number at {path} in {document}"))
}

/// The rows below a CSV's header, cut into fields.
fn rows(text: &str) -> Vec<Vec<&str>> {
    text.lines().skip(1).map(|line| line.split(',').collect()).collect()
}

#[test]
fn every_example_leaves_a_whole_folder() {
    std::thread::scope(|scope| {
        for example in ["batwing", "lambertian", "led-lobe", "luminaire", "penumbra", "sun-window"]
        {
            scope.spawn(move || leaves_a_whole_folder(example));
        }
    });
}

fn leaves_a_whole_folder(example: &str) {
    let bench = Bench::of(example);
    let said = bench.gonio(&["run", "plan.toml", "--out", "out"]).well();
    assert!(said.out.contains("simulated"), "{said}");
    let mut names = vec![
        "accuracy.csv",
        "fit.json",
        "plan.toml",
        "readings.csv",
        "report.html",
        "rig.toml",
        "run.sqlite",
        "samples.csv",
        "samples.meta.json",
        "scene.toml",
    ];
    if example == "luminaire" {
        names.push("ushio_b1.ies");
    }
    let found: Vec<String> = bench
        .names()
        .into_iter()
        .filter_map(|name| name.strip_prefix("out/").map(str::to_owned))
        .collect();
    assert_eq!(found, names, "{example}");
    for name in ["plan.toml", "rig.toml", "scene.toml"] {
        assert_eq!(bench.text(&format!("out/{name}")), bench.text(name), "as it was read");
    }
    check_samples(&bench);
    check_fit(&bench, example);
}

fn check_samples(bench: &Bench) {
    let samples = bench.text("out/samples.csv");
    assert!(samples.starts_with(SAMPLES), "{}", samples.lines().next().unwrap());
    assert!(samples.ends_with('\n') && !samples.contains('\r'));
    let meta = bench.json("out/samples.meta.json");
    assert_eq!(meta["simulated"], true);
    assert_eq!(meta["unit"], "W/(m² sr)");
    let rows = rows(&samples);
    let targets = format!("{0} of {0} targets measured", rows.len());
    assert_eq!(meta["targets"], targets);
    let columns = samples.lines().next().unwrap().split(',').count();
    let mut indices: Vec<u64> = Vec::new();
    for row in &rows {
        assert_eq!(row.len(), columns, "{row:?}");
        indices.push(row[0].parse().unwrap());
        for field in &row[1..9] {
            // Shortest text that reads back to the same number.
            let value: f64 = field.parse().unwrap();
            assert!(value.is_finite(), "{row:?}");
        }
        let (theta_deg, phi_deg): (f64, f64) = (row[4].parse().unwrap(), row[5].parse().unwrap());
        assert!((0.0..=90.0).contains(&theta_deg), "{row:?}");
        assert!(phi_deg > -180.0 && phi_deg <= 180.0, "{row:?}");
    }
    indices.sort_unstable();
    let expected: Vec<u64> = (0..rows.len() as u64).collect();
    assert_eq!(indices, expected, "each target once");
    let readings = bench.text("out/readings.csv");
    for kind in ["dark", "reference", "target"] {
        assert!(readings.contains(&format!(",{kind},")), "no {kind} reading");
    }
}

fn check_fit(bench: &Bench, example: &str) {
    let fit = bench.json("out/fit.json");
    for key in [
        "basis",
        "coefficients",
        "covariance",
        "condition",
        "residual_rms",
        "dof",
        "n_used",
        "n_flagged",
    ] {
        assert!(fit.get(key).is_some(), "{example}: no {key}");
    }
    for key in ["exitance_w_per_m2", "flux_w", "intensity_on_axis_w_per_sr", "peak_radiance"] {
        let squares = |budget: &str| -> f64 {
            let rows = fit[key][budget].as_array().unwrap();
            rows.iter().map(|row| row["u"].as_f64().unwrap().powi(2)).sum()
        };
        let u = number(&fit, &format!("/{key}/u"));
        assert!((squares("budget") / (u * u) - 1.0).abs() < 1e-9, "{example} {key}");
        let independent = fit[key]["budget"][0]["u"].as_f64().unwrap().powi(2);
        let part = squares("budget_independent") / independent;
        assert!((part - 1.0).abs() < 0.021, "{example} {key}: {part}");
    }
    for key in ["exitance_w_per_m2", "exitance_within_region_w_per_m2", "flux_w", "peak_radiance"] {
        let (value, u) =
            (number(&fit, &format!("/{key}/value")), number(&fit, &format!("/{key}/u")));
        assert!(value > 0.0 && u > 0.0 && u < 0.1 * value, "{example}: {key} {value} ± {u}");
        let truth = number(&fit, &format!("/truth/{key}/value"));
        // The peak is where noise and lack of fit add up; the others are means.
        let allowed = if key == "peak_radiance" { 0.1 } else { 0.03 };
        assert!((value / truth - 1.0).abs() < allowed, "{example}: {key} {value}, true {truth}");
    }
    let accuracy = bench.text("out/accuracy.csv");
    let course = rows(&accuracy);
    assert!(accuracy.starts_with("rig_s,readings,exitance_w_per_m2,u_exitance_w_per_m2"));
    let last: f64 = course.last().unwrap()[2].parse().unwrap();
    assert!((last / number(&fit, "/exitance_w_per_m2/value") - 1.0).abs() < 1e-9, "{example}");
}

#[test]
fn a_seed_repeats_a_run_and_another_one_does_not() {
    let bench = Bench::small();
    for (seed, out) in [("1", "first"), ("1", "again"), ("2", "other")] {
        bench.gonio(&["run", "plan.toml", "--seed", seed, "--out", out]).well();
    }
    bench.gonio(&["run", "plan.toml", "--out", "default"]).well();
    let samples = |out: &str| bench.text(&format!("{out}/samples.csv"));
    assert!(samples("first") == samples("again") && samples("first") == samples("default"));
    assert_eq!(bench.text("first/readings.csv"), bench.text("again/readings.csv"));
    assert!(samples("first") != samples("other"));
}

#[test]
fn a_runs_samples_are_input_for_a_fit_of_their_own() {
    let bench = Bench::small();
    bench.gonio(&["run", "plan.toml", "--out", "out"]).well();
    let run = bench.json("out/fit.json");
    let degrees = ["--angular-degree", "2", "--position-degree", "1"];
    let csv = [&["fit", "out/samples.csv"][..], &degrees, &["--json"]].concat();
    let fit = bench.gonio(&csv).well().json();
    let (value, u) =
        (number(&run, "/exitance_w_per_m2/value"), number(&run, "/exitance_w_per_m2/u"));
    let again = number(&fit, "/exitance_w_per_m2/value");
    assert!((again - value).abs() < 0.1 * u, "{again}, in the run {value} ± {u}");
    // The CSV's own uncertainties hold what all samples share: as independent they average out.
    assert!(number(&fit, "/exitance_w_per_m2/u") < u);
    assert!(fit["notes"][0].as_str().unwrap().contains("independent"), "{}", fit["notes"]);
}

#[test]
fn a_complete_run_is_not_carried_on() {
    let bench = Bench::small();
    bench.gonio(&["run", "plan.toml", "--out", "out"]).well();
    let contents = || {
        let names = bench.names().into_iter().filter(|name| name.starts_with("out/"));
        names.map(|name| (std::fs::read(bench.path(&name)).unwrap(), name)).collect::<Vec<_>>()
    };
    let before = contents();
    let said = bench.gonio(&["resume", "out"]).well();
    assert!(said.err.contains("complete; nothing is left to measure"), "{said}");
    assert!(contents() == before, "resume changed a complete run");
}

#[test]
fn an_interrupted_run_is_carried_on_to_the_same_values() {
    let bench = Bench::small()
        .with("rig.toml", "speed_deg_per_s = 60", "speed_deg_per_s = 600")
        .with("rig.toml", "acceleration_deg_per_s2 = 120", "acceleration_deg_per_s2 = 6000")
        .with("rig.toml", "speed_mm_per_s = 100", "speed_mm_per_s = 1000")
        .with("rig.toml", "acceleration_mm_per_s2 = 500", "acceleration_mm_per_s2 = 10000")
        .with("rig.toml", "settle_ms = 50", "settle_ms = 1");
    bench.gonio(&["run", "plan.toml", "--out", "whole"]).well();

    let mut command = bench.command(&["run", "plan.toml", "--out", "out", "--realtime"]);
    let run = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let began = Instant::now();
    while !bench.path("out/run.sqlite").exists() {
        assert!(began.elapsed() < Duration::from_secs(30), "the run does not begin");
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_secs(4));
    bench::signal(&run, "INT");
    let said = Said::from_output("gonio run --realtime", &run.wait_with_output().unwrap());
    assert_eq!(said.code, Some(1), "{said}");
    let said = said.says(&["`gonio resume out`"]);
    let measured = bench.json("out/samples.meta.json")["targets_measured"].as_u64().unwrap();
    assert!((1..132).contains(&measured), "{said}");
    assert!(!said.err.contains("error: error"), "{said}");

    let said = bench.gonio(&["resume", "out"]).well();
    assert!(said.out.contains("132 of 132 measured"), "{said}");
    let (whole, out) = (bench.text("whole/samples.csv"), bench.text("out/samples.csv"));
    let (whole, out) = (rows(&whole), rows(&out));
    assert_eq!(whole.len(), out.len());
    for (one, other) in whole.iter().zip(&out) {
        assert_eq!(one[0], other[0], "each target once, in order");
        let (a, b): (f64, f64) = (one[6].parse().unwrap(), other[6].parse().unwrap());
        // Noise belongs to the reading, whenever it is taken; homed anew, an axis may stand a
        // homing's scatter elsewhere, which an even patch hardly shows.
        assert!((a / b - 1.0).abs() < 1e-7, "target {}: {a}, after the break {b}", one[0]);
    }
    let meta = bench.json("out/samples.meta.json");
    assert_eq!(meta["targets"], "132 of 132 targets measured");
}

/// Microseconds of the device from the first integration's begin to the last one's end.
fn span_us(readings: &str) -> f64 {
    let header: Vec<&str> = readings.lines().next().unwrap().split(',').collect();
    let column = |name: &str| header.iter().position(|column| *column == name).unwrap();
    let (start, end) = (column("start_us"), column("end_us"));
    let at = |row: &[&str], column: usize| row[column].parse::<f64>().unwrap();
    let rows = rows(readings);
    let first = rows.iter().map(|row| at(row, start)).fold(f64::INFINITY, f64::min);
    rows.iter().map(|row| at(row, end)).fold(0.0, f64::max) - first
}

#[test]
fn a_plan_of_sweeps_is_flown_in_the_time_that_was_predicted() {
    let bench = Bench::of("led-lobe");
    let plan = bench.gonio(&["plan", "sweep.toml", "--json"]).well().json();
    assert_eq!(number(&plan, "/sweeps/count").to_bits(), 12.0_f64.to_bits());
    let said = bench.gonio(&["run", "sweep.toml", "--out", "out"]).well();
    assert!(said.out.contains("720 of 720 measured"), "{said}");
    check_samples(&bench);
    let predicted_s = number(&plan, "/time_s/total") - number(&plan, "/time_s/homing");
    let took_s = span_us(&bench.text("out/readings.csv")) * 1e-6;
    assert!((took_s / predicted_s - 1.0).abs() < 1e-3, "{took_s} s, predicted {predicted_s} s");
    let fit = bench.json("out/fit.json");
    let exitance = |path: &str| number(&fit, &format!("{path}/exitance_w_per_m2/value"));
    assert!((exitance("") / exitance("/truth") - 1.0).abs() < 0.03);
    bench.gonio(&["run", "sweep.toml", "--out", "again"]).well();
    assert!(bench.text("again/samples.csv") == bench.text("out/samples.csv"));

    let fast = "speed_deg_per_s = 61";
    let bench = bench.with("sweep.toml", "narrowest_feature_deg = 40", fast);
    let said = bench.gonio(&["plan", "sweep.toml"]);
    assert_eq!(said.code, Some(2), "{said}");
    let _ = said.says(&["speed_deg_per_s", "at most 60.000°/s"]);
    assert!(!bench.names().iter().any(|name| name.starts_with("runs")), "nothing was begun");
}

#[test]
fn a_run_killed_in_flight_is_carried_on_to_the_same_samples() {
    let bench = Bench::of("led-lobe")
        .with("rig.toml", "speed_deg_per_s = 60", "speed_deg_per_s = 600")
        .with("rig.toml", "acceleration_deg_per_s2 = 120", "acceleration_deg_per_s2 = 6000")
        .with("sweep.toml", "angular_degree = 10", "angular_degree = 4");
    bench.gonio(&["run", "sweep.toml", "--out", "whole"]).well();
    let mut command = bench.command(&["run", "sweep.toml", "--out", "out", "--realtime"]);
    let mut run = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    // Homing takes three seconds, all sweeps some fifteen.
    std::thread::sleep(Duration::from_secs(8));
    run.kill().unwrap();
    run.wait().unwrap();
    bench.gonio(&["resume", "out"]).well();
    let (whole, out) = (bench.text("whole/samples.csv"), bench.text("out/samples.csv"));
    let (whole, out) = (rows(&whole), rows(&out));
    assert_eq!(whole.len(), out.len());
    for (one, other) in whole.iter().zip(&out) {
        assert_eq!((one[0], one[6]), (other[0], other[6]), "each window once, with its own noise");
    }
    let sessions = bench.text("out/readings.csv");
    let flown = |session: &str| {
        rows(&sessions).iter().filter(|row| row[1] == "target" && row[4] == session).count()
    };
    assert!(flown("0") > 0 && flown("1") > 0, "{} and {}", flown("0"), flown("1"));
}
