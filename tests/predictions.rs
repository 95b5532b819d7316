//! What `gonio plan` says beforehand, over the whole program: uncertainty and time against a run's,
//! and plans found for a target. Would break: a prediction that takes noise or scale from elsewhere
//! than calibration does, a search that writes what it did not look at, an impossible target that
//! ends well. The long version is the program `predictions` of the crate benches.

mod bench;

use std::fs;
use std::process::Stdio;
use std::time::{Duration, Instant};

use bench::{Bench, Said, signal};
use serde_json::Value;

fn number(said: &Value, pointer: &str) -> f64 {
    said.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} in {said}"))
}

/// The small lambertian example, which says what it expects.
fn expecting() -> Bench {
    Bench::small().with("plan.toml", "[fit]", "[expect]\nradiance_w_per_m2_sr = 50\n\n[fit]")
}

/// The same, its scale known but for the gain, and noise that shows.
fn noisy() -> Bench {
    expecting()
        .with("rig.toml", "u_responsivity_relative = 0.005", "u_responsivity_relative = 0")
        .with("rig.toml", "u_distance_mm = 0.3", "u_distance_mm = 0")
        .with("rig.toml", "u_pupil_diameter_mm = 0.01", "u_pupil_diameter_mm = 0")
        .with("rig.toml", "u_spot_diameter_mm = 0.01", "u_spot_diameter_mm = 0")
        .with("rig.toml", "read_noise_a = 2e-13", "read_noise_a = 2e-8")
}

#[test]
fn a_run_is_as_accurate_as_its_plan_said() {
    for (bench, is_noisy) in [(expecting(), false), (noisy(), true)] {
        let plan = bench.gonio(&["plan", "plan.toml", "--json"]).well().json();
        let run = bench.gonio(&["run", "plan.toml", "--out", "run", "--json"]).well().json();
        let exitance = |key: &str| number(&plan, &format!("/uncertainty/exitance_w_per_m2/{key}"));
        let value = number(&run, "/exitance_w_per_m2/value");
        let stated = number(&run, "/exitance_w_per_m2/u") / value;
        let factor = stated / exitance("u_relative");
        assert!((1.0 / 1.3..1.3).contains(&factor), "{factor} of {stated}");
        if is_noisy {
            // Elsewhere it is a part in a million, and rounding's.
            let stated = number(&run, "/exitance_w_per_m2/u_independent") / value;
            let factor = stated / exitance("independent_relative");
            assert!((1.0 / 1.3..1.3).contains(&factor), "{factor} of {stated}");
        }
        assert!(exitance("u_relative_without_scale") < exitance("u_relative"));
        let flux = number(&plan, "/uncertainty/flux_w/u_relative");
        assert!((flux / exitance("u_relative") - 1.0).abs() < 1e-12);
        let radiance = |key: &str| number(&plan, &format!("/uncertainty/radiance/{key}"));
        assert!(radiance("worst_relative") >= radiance("u_relative"));
    }
}

#[test]
fn what_the_plan_s_features_leave_is_said_with_its_range_and_what_lies_beyond_with_it() {
    let bench = expecting().with("plan.toml", "[expect]", "[expect]\nnarrowest_feature_deg = 60");
    let said = bench.gonio(&["plan", "plan.toml"]).well();
    for part in ["within 80.0°", "not foretold: 3.02 % of the exitance", "--rehearse"] {
        assert!(said.out.contains(part), "{part}: {said}");
    }
    // Of features in position alone a fit can't know that there are none in direction.
    let alone = "narrowest_feature_mm stands alone";
    assert!(!said.out.contains(alone), "{said}");
    let in_position =
        expecting().with("plan.toml", "[expect]", "[expect]\nnarrowest_feature_mm = 8");
    let said = in_position.gonio(&["plan", "plan.toml"]).well();
    assert!(said.out.contains(alone), "{said}");
    let json = bench.gonio(&["plan", "plan.toml", "--json"]).well().json();
    for quantity in ["radiance", "exitance_w_per_m2", "exitance_within_region_w_per_m2"] {
        let of = |key: &str| number(&json, &format!("/uncertainty/{quantity}/{key}"));
        let (least, most) = (of("truncation_range_relative/0"), of("truncation_range_relative/1"));
        let truncation = of("truncation_relative");
        assert!(0.0 < least && least < truncation && truncation < most, "{quantity}: {json}");
        let (low, high) = (of("u_range_relative/0"), of("u_range_relative/1"));
        assert!(low < of("u_relative") && of("u_relative") < high, "{quantity}: {json}");
        let not_shared = of("independent_relative").hypot(truncation);
        assert!((of("not_shared_relative") / not_shared - 1.0).abs() < 1e-12, "{json}");
    }
    let beyond = number(&json, "/uncertainty/exitance_beyond_region_relative");
    assert!((beyond - 10.0_f64.to_radians().sin().powi(2)).abs() < 1e-9, "{beyond}");
}

/// An even field under a fit of degree 2 has no truncation, a lobe has much: of neither the plan says
/// anything.
#[test]
fn a_rehearsal_foretells_what_the_fits_of_runs_state() {
    let lobe = "kind = \"cosine-power\"\nexponent = 6";
    for lobed in [false, true] {
        let bench = if lobed {
            expecting().with("scene.toml", "kind = \"lambertian\"", lobe)
        } else {
            expecting()
        };
        let words = ["plan", "plan.toml", "--rehearse", "2", "--seed", "11", "--json"];
        let json = bench.gonio(&words).well().json();
        let run = bench.gonio(&["run", "plan.toml", "--out", "run", "--json"]).well().json();
        let fit: Value = serde_json::from_str(&bench.text("run/fit.json")).unwrap();
        assert_eq!(json["rehearsal"]["runs"], 2);
        for (quantity, said) in [("exitance", &run), ("exitance_within_region", &fit)] {
            let of = |key: &str| number(said, &format!("/{quantity}_w_per_m2/{key}"));
            let foretold = number(&json, &format!("/rehearsal/{quantity}/u_relative"));
            let factor = of("u") / of("value") / foretold;
            assert!((1.0 / 1.3..1.3).contains(&factor), "{quantity}: {factor}\n{json}");
        }
        let first = bench.text("run/readings.csv");
        let time = |line: &str| line.split(',').nth(time_column(&first)).unwrap().parse::<f64>();
        let first_s = first.lines().skip(1).map(|line| time(line).unwrap());
        let took_s = number(&run, "/rig_s") - first_s.fold(f64::INFINITY, f64::min);
        let foretold_s = number(&json, "/rehearsal/after_homing_s");
        assert!((took_s / foretold_s - 1.0).abs() < 1e-3, "{took_s} s, {foretold_s} s foretold");
        let off = |quantity: &str| number(&json, &format!("/rehearsal/{quantity}/error_relative"));
        assert_eq!(lobed, off("radiance") > 0.02, "{json}");
        if lobed {
            let plan = number(&json, "/uncertainty/exitance_w_per_m2/u_relative");
            assert!(number(&json, "/rehearsal/exitance/u_relative") > 1.3 * plan, "{json}");
        }
    }
}

fn time_column(csv: &str) -> usize {
    csv.lines().next().unwrap().split(',').position(|name| name == "time_s").unwrap()
}

#[test]
fn a_real_rig_is_rehearsed_on_its_simulated_twin() {
    let bench = Bench::small().at_port("/dev/nowhere");
    let words = ["plan", "plan.toml", "--rehearse", "1", "--scene", "scene.toml"];
    let said = bench.gonio(&words).well();
    assert!(said.out.contains("rehearsed once before scene.toml"), "{said}");
    // Without a scene there is nothing to rehearse before.
    bench.gonio(&words[..4]).refused(&["a simulated rig needs a scene", "--scene"]);
    bench.gonio(&["plan", "plan.toml", "--rehearse", "0"]).refused(&["--rehearse", "0"]);
}

/// Many runs, stopped while some of them are under way: the process ends at once, and where its journals
/// were is nothing.
#[test]
fn many_runs_that_are_stopped_leave_nothing() {
    let bench = expecting();
    let temporary = bench.path("temporary");
    fs::create_dir(&temporary).unwrap();
    let before = bench.names();
    let rehearsal = "plan plan.toml --rehearse 1000";
    let frontier = "frontier plan.toml --seeds 1000 --out temporary/front";
    for (line, name) in [(rehearsal, "INT"), (rehearsal, "TERM"), (frontier, "INT")] {
        let words: Vec<&str> = line.split(' ').collect();
        let mut command = bench.command(&words);
        command.env("TMPDIR", &temporary).stdout(Stdio::piped()).stderr(Stdio::piped());
        let child = command.spawn().unwrap();
        let since = Instant::now();
        let has_entries = |folder| fs::read_dir(folder).is_ok_and(|mut all| all.next().is_some());
        // The folder of all runs is made before signals are heard, what is in it afterwards.
        while !fs::read_dir(&temporary).unwrap().any(|made| has_entries(made.unwrap().path())) {
            assert!(since.elapsed() < Duration::from_mins(2), "no run begins");
            std::thread::sleep(Duration::from_millis(5));
        }
        signal(&child, name);
        let sent = Instant::now();
        let output = child.wait_with_output().unwrap();
        assert!(sent.elapsed() < Duration::from_secs(5), "{:?}", sent.elapsed());
        let said = Said::from_output(line, &output);
        assert_eq!(said.code, Some(1), "{said}");
        // Once, and not by every run that heard it.
        assert!(said.err.starts_with("error: stopped: nothing"), "{said}");
        assert_eq!(said.err.lines().count(), 1, "{said}");
        assert_eq!(bench.names(), before);
    }
}

/// What the readings are to choose is foretold with something in its place.
#[test]
fn a_stand_in_says_what_it_stands_in_for() {
    let pinned = "angular_degree = 2\nposition_degree = 1";
    let splines = "basis = \"splines\"\ntheta_spans = 3\nphi_spans = 4\nposition_degree = 0";
    let power = "angular_degree = 2\nposition_degree = 1\npenalty_power = 2";
    for (fit, is_pinned, words) in [
        (pinned, true, "18 coefficients, all determined"),
        (
            "angular_degree = 2",
            false,
            "chosen from the readings; here stand in zernike functions of degree 2, of degree 1 in position",
        ),
        (
            splines,
            true,
            "splines of 3 x 4 spans, of degree 0 in position, their penalty chosen from the readings; here \
             stand in zernike functions of degree N, of degree 0 in position, without one",
        ),
        (
            power,
            true,
            "zernike functions of degree 2, of degree 1 in position, their penalty chosen from the \
             readings; here without one",
        ),
    ] {
        let bench = expecting().with("plan.toml", pinned, fit);
        let said = bench.gonio(&["plan", "plan.toml"]).well();
        let json = bench.gonio(&["plan", "plan.toml", "--json"]).well().json();
        let json = &json["fit"];
        let degree = json["assumed_degree"].as_u64();
        let words = words.replace('N', &degree.unwrap_or(0).to_string());
        assert!(said.out.contains(&words), "{words}\n{said}");
        assert_eq!(json["pinned"].is_string(), is_pinned, "{json}");
        assert_eq!(
            (json["stands_in"].is_string(), degree.is_some()),
            (fit != pinned, fit != pinned)
        );
    }
}

#[test]
fn an_assumed_level_says_so() {
    let bench = Bench::small();
    let said = bench.gonio(&["plan", "plan.toml"]).well();
    assert!(said.out.contains("assumed: a tenth of the gain range"), "{said}");
    assert!(said.out.contains("state expect.narrowest_feature_deg"), "{said}");
    let json = bench.gonio(&["plan", "plan.toml", "--json"]).well().json();
    assert_eq!(json["uncertainty"]["level"]["stated_in_plan"], false, "{said}");
    assert_eq!(json["uncertainty"]["radiance"]["truncation_relative"], Value::Null);
}

#[test]
fn the_plan_that_is_found_reaches_its_target_in_less_time() {
    let bench = noisy();
    let itself = bench.gonio(&["plan", "plan.toml", "--json"]).well().json();
    let u = number(&itself, "/uncertainty/exitance_w_per_m2/u_relative");
    let target = format!("exitance={}%", 100.0 * 1.5 * u);
    let words = ["plan", "plan.toml", "--target", &target, "-o", "found.toml"];
    let said = bench.gonio(&words).well();
    for part in ["considered", "cheapest:", "written to found.toml"] {
        assert!(said.out.contains(part), "{said}");
    }
    let found = bench.gonio(&["plan", "found.toml", "--json"]).well().json();
    assert!(number(&found, "/uncertainty/exitance_w_per_m2/u_relative") <= 1.5 * u);
    assert!(number(&found, "/time_s/total") < number(&itself, "/time_s/total"));
    // Comments and keys that have nothing to do with it are kept.
    let (before, after) = (bench.text("plan.toml"), bench.text("found.toml"));
    assert_eq!(before.lines().next(), after.lines().next());
    assert!(after.contains("[reference]") && after.contains("method = \"shutter\""), "{after}");
    let again = bench.gonio(&words);
    again.refused(&["found.toml: exists already; nothing is overwritten"]);
}

#[test]
fn exitance_alone_is_had_from_the_nodes_of_a_quadrature_rule() {
    // A grid keeps its nine places; the rule needs as many as the fit's degree in position.
    let bench = expecting().with("plan.toml", "x_count = 2", "x_count = 3").with(
        "plan.toml",
        "y_count = 2",
        "y_count = 3",
    );
    let words = ["plan", "plan.toml", "--target", "exitance=1%", "--json", "-o", "found.toml"];
    let found = bench.gonio(&words).well().json();
    let best = found["best"]["what"].as_str().unwrap();
    assert!(best.starts_with("quadrature 2 x 6, degree 2"), "{found}");
    let text = bench.text("found.toml");
    assert!(text.contains("kind = \"quadrature\"") && !text.contains("theta_step_deg"), "{text}");
    // It is a plan like others: it runs, and its exitance is right.
    let run = bench.gonio(&["run", "found.toml", "--out", "run", "--json"]).well().json();
    assert_eq!(run["targets_measured"], run["targets_planned"]);
    let truth = number(&run, "/truth/exitance_w_per_m2");
    assert!((number(&run, "/exitance_w_per_m2/value") / truth - 1.0).abs() < 0.014, "{run}");
    // Radiance is not a sum.
    let words = ["plan", "plan.toml", "--target", "radiance=1%", "--json"];
    let found = bench.gonio(&words).well().json();
    let considered = found["considered"].as_array().unwrap();
    let is_rule = |row: &Value| row["what"].as_str().unwrap().contains("quadrature");
    assert!(!considered.is_empty() && !considered.iter().any(is_rule), "{found}");
}

#[test]
fn dark_readings_are_lengthened_where_the_dark_level_stands_in_the_way() {
    let ends = "dwell_ms = 50\n\n[reference]";
    let bench = noisy().with("plan.toml", ends, "dwell_ms = 2\n\n[reference]");
    let words =
        ["plan", "plan.toml", "--target", "exitance=1%", "--without-scale", "-o", "found.toml"];
    let said = bench.gonio(&words).well();
    assert!(said.out.contains("cheapest:") && said.out.contains(", dark "), "{said}");
    let text = bench.text("found.toml");
    let dark = text.split("[dark]").nth(1).unwrap().split('[').next().unwrap();
    let dwell = dark.lines().find_map(|line| line.strip_prefix("dwell_ms = ")).unwrap();
    assert!(dwell.trim().parse::<f64>().unwrap() > 2.0, "{text}");
}

#[test]
fn what_no_plan_reaches_is_said_with_its_floor() {
    let bench = expecting();
    let words = ["plan", "plan.toml", "--target", "exitance=0.01%", "-o", "found.toml", "--json"];
    let said = bench.gonio(&words);
    assert_eq!(said.code, Some(1), "{said}");
    let json = said.json();
    assert_eq!(json["best"], Value::Null);
    assert_eq!(json["floor"]["largest"], "responsivity");
    assert!((number(&json, "/floor/largest_relative") - 0.005).abs() < 1e-6, "{json}");
    assert!(said.err.contains("no plan within the limits reaches exitance"), "{said}");
    assert!(said.err.contains("--without-scale"), "{said}");
    assert!(!bench.path("found.toml").exists());
}

#[test]
fn targets_that_are_none_are_refused() {
    let bench = Bench::small();
    for (target, part) in [
        ("exitance", "expected QUANTITY=U"),
        ("power=1%", "expected exitance, flux or radiance"),
        ("exitance=0", "expected more than 0"),
        ("radiance=soon", "expected a number"),
    ] {
        let said = bench.gonio(&["plan", "plan.toml", "--target", target]);
        said.refused(&[target, part, "help: write for example"]);
    }
    let twice = ["plan", "plan.toml", "--target", "flux=1%", "--target", "flux=2%"];
    bench.gonio(&twice).refused(&["another target for the same quantity"]);
    bench.gonio(&["plan", "plan.toml", "-o", "x.toml"]).refused(&["--output", "add --target"]);
}

#[test]
fn a_frontier_sets_flights_beside_stops_with_what_was_foretold() {
    let bench = expecting();
    let frontier = ["frontier", "plan.toml", "--out", "front", "--seeds", "2", "--density", "1,2"];
    let said = bench.gonio(&frontier).well();
    assert!(said.out.contains("sweep") && said.out.contains("stop-and-go"), "{said}");
    let csv = bench.text("front/frontier.csv");
    let mut rows = csv.lines();
    let columns: Vec<&str> = rows.next().unwrap().split(',').collect();
    assert_eq!(columns[..3], ["scene", "strategy", "parameters"]);
    let column = |name: &str| columns.iter().position(|column| *column == name).unwrap();
    let rows: Vec<Vec<&str>> = rows.map(|row| row.split(',').collect()).collect();
    assert_eq!(rows.len(), 8, "two strategies, two densities, two seeds\n{csv}");
    let value = |row: &[&str], name: &str| row[column(name)].parse::<f64>().unwrap();
    for row in &rows {
        let (rig_s, way_s) = (value(row, "rig_s"), value(row, "way_s"));
        assert!(way_s < rig_s, "{rig_s} s, and the way alone {way_s} s");
        assert!(value(row, "predicted_rig_s") > way_s);
        assert!(value(row, "photon_limit_relative") > 0.0);
    }
    let per_reading = |strategy: &str| {
        let row = rows.iter().find(|row| row[1] == strategy).unwrap();
        value(row, "rig_s") / value(row, "readings")
    };
    assert!(per_reading("sweep") < 0.2 * per_reading("stop-and-go"));
    for file in ["frontier.svg", "frontier-exitance.svg", "frontier.html"] {
        assert!(bench.text(&format!("front/{file}")).contains("</svg>"), "{file}");
    }
    // Every run's folder holds the plan that it ran, and is fitted by it again.
    let flown = bench.text("front/runs/rung2-seed1/plan.toml");
    assert!(flown.contains("kind = \"sweep\""), "{flown}");
    bench.gonio(&["fit", "front/runs/rung2-seed1"]).well();
}

#[test]
fn a_frontier_says_what_can_not_be_swept() {
    let bench = expecting();
    let frontier =
        |more: &[&str]| bench.gonio(&[&["frontier", "plan.toml", "--out", "f"], more].concat());
    frontier(&["--strategy", "crawl"]).refused(&["crawl", "stop-and-go, sweep, adaptive"]);
    frontier(&["--density", "0"]).refused(&["--density", "a factor from 0.01 to 100"]);
    // Windows of two readings come faster than the wire takes them.
    frontier(&["--strategy", "sweep", "--dwell", "0.05"]).refused(&["windows", "the wire carries"]);
    assert!(!bench.path("f").exists());
}

/// Two axes move at once while readings are taken; the fit knows where they were.
#[test]
fn a_spiral_is_flown_as_its_plan_says() {
    let spiral = "kind = \"spiral\"\nx_count = 2\ny_count = 2\ninterleaved = true\ntheta_step_deg = 20\n\
                  narrowest_feature_deg = 40";
    let raster = "kind = \"raster\"\nx_count = 2\ny_count = 2\ntheta_step_deg = 20\n\
                  phi_step_deg = 45\norder = \"travel\"";
    let long = "dwell_ms = 200\ngain";
    let bench = expecting().with("plan.toml", "dwell_ms = 20\ngain", long);
    let bench = bench.with("plan.toml", raster, spiral).with(
        "scene.toml",
        "kind = \"lambertian\"",
        "kind = \"cosine-power\"\nexponent = 2",
    );
    let plan = bench.gonio(&["plan", "plan.toml", "--json"]).well().json();
    let foretold_s = number(&plan, "/time_s/total") - number(&plan, "/time_s/homing");
    // Four turns and the rim, dealt out over four places.
    assert_eq!(plan["sweeps"]["count"], 5);
    let run = bench.gonio(&["run", "plan.toml", "--out", "run", "--json"]).well().json();
    let csv = bench.text("run/readings.csv");
    let time = |line: &str| line.split(',').nth(time_column(&csv)).unwrap().parse::<f64>();
    let first_s = csv.lines().skip(1).map(|line| time(line).unwrap());
    let took_s = number(&run, "/rig_s") - first_s.fold(f64::INFINITY, f64::min);
    assert!((took_s / foretold_s - 1.0).abs() < 1e-3, "{took_s} s, {foretold_s} s foretold");
    assert_eq!(run["targets_measured"], run["targets_planned"]);
    // Even cosines are polynomials on the disk: what is left is the scale's 0.5 %, and zeros of axes.
    assert!(number(&run, "/truth/radiance_error_rms_relative") < 0.02, "{run}");
}
