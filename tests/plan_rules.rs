//! What a plan may demand beside its targets, over the whole program in virtual time: that the
//! source be warm, that the run end when it is accurate enough or when its time is up; and the
//! time that it was promised to take. Would break: a gate that never opens or always does, a rule
//! that is read and not obeyed, an exit code that hides a missed target, a prediction that lies.

mod bench;

use serde_json::Value;

use bench::{Bench, Said};

/// A plan of 400 targets that fill the region evenly at any count, and a rig whose exitance is
/// limited by noise: what all readings share is far below the tenth of a per cent.
fn noisy(rules: &str) -> Bench {
    let bench = Bench::small();
    let plan = bench.text("plan.toml");
    let (head, tail) = plan.split_once("[schedule]").unwrap();
    let (_, tail) = tail.split_once("[dwell]").unwrap();
    let schedule = "kind = \"low-discrepancy\"\ncount = 400\norder = \"listed\"\n";
    let plan = format!("{head}[schedule]\n{schedule}\n[dwell]{tail}\n{rules}");
    bench
        .having("plan.toml", plan)
        .with("rig.toml", "u_responsivity_relative = 0.005", "u_responsivity_relative = 1e-5")
        .with("rig.toml", "u_distance_mm = 0.3", "u_distance_mm = 0.003")
        .with("rig.toml", "u_pupil_diameter_mm = 0.01", "u_pupil_diameter_mm = 1e-4")
        .with("rig.toml", "u_spot_diameter_mm = 0.01", "u_spot_diameter_mm = 1e-4")
        .with("rig.toml", "name = \"1 uA\"\nfull_scale_a = 1e-6\nu_relative = 0.0005", GAIN)
        .with("rig.toml", "read_noise_a = 2e-13", "read_noise_a = 2e-8")
        .with("plan.toml", "dwell_ms = 50", "dwell_ms = 2000")
}

const GAIN: &str = "name = \"1 uA\"\nfull_scale_a = 1e-6\nu_relative = 1e-5";

/// Three coefficients.
const LITTLE: &str = "angular_degree = 1\nposition_degree = 0";

fn run(bench: &Bench) -> Said {
    bench.gonio(&["run", "plan.toml", "--out", "run", "--json"])
}

/// The kinds of a run's readings as they were taken, with when, seconds.
fn kinds(bench: &Bench) -> Vec<(String, f64)> {
    let csv = bench.text("run/readings.csv");
    let mut lines = csv.lines();
    let head: Vec<_> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| head.iter().position(|column| *column == name).unwrap();
    let (kind, time) = (column("kind"), column("time_s"));
    let cells = lines.map(|line| line.split(',').collect::<Vec<_>>());
    cells.map(|cells| (cells[kind].to_owned(), cells[time].parse().unwrap())).collect()
}

fn relative(summary: &Value) -> f64 {
    let exitance = &summary["exitance_w_per_m2"];
    exitance["u"].as_f64().unwrap() / exitance["value"].as_f64().unwrap()
}

#[test]
fn a_steady_source_is_waited_for_as_long_as_the_gate_looks_back() {
    let gate = "\n[warm_up]\ntolerance_relative = 0.001\nover_s = 5\ntimeout_s = 60\n";
    let bench = Bench::small();
    let plan = bench.text("plan.toml") + gate;
    let bench = bench.having("plan.toml", plan);
    assert_eq!(run(&bench).well().json()["outcome"], "complete");
    let kinds = kinds(&bench);
    let first = kinds.iter().position(|(kind, _)| kind != "warm_up").unwrap();
    assert!(kinds[first..].iter().all(|(kind, _)| kind != "warm_up"));
    let waited_s = kinds[first].1 - kinds[0].1;
    assert!((5.0..5.5).contains(&waited_s), "{waited_s} s");
}

#[test]
fn a_tolerance_below_the_noise_is_never_met_and_says_so() {
    let gate = "\n[warm_up]\ntolerance_relative = 1e-7\nover_s = 5\ntimeout_s = 20\n";
    let bench = Bench::small();
    let plan = bench.text("plan.toml") + gate;
    let bench = bench.having("plan.toml", plan);
    let said = run(&bench).says(&["the reference still changed by", "after 20 s of warming up"]);
    assert_eq!(said.code, Some(1), "{said}");
    let said = said.says(&["gonio resume run"]);
    assert!(!said.out.contains("\"complete\""), "{said}");
}

#[test]
fn a_run_ends_once_it_is_accurate_enough_and_is_over_for_good() {
    let bench = noisy("[stop]\nexitance_relative = 0.002\n");
    let summary = run(&bench).well().json();
    assert_eq!(summary["outcome"], "reached");
    let rule = summary["rule"].as_str().unwrap();
    assert!(rule.starts_with("exitance to 0.200 % after ") && rule.ends_with(" of 400 targets"));
    let measured = summary["targets_measured"].as_u64().unwrap();
    assert!((40..300).contains(&measured), "{measured}");
    // Not long after: the fit is made anew whenever there are a tenth more.
    assert!((0.0017..=0.002).contains(&relative(&summary)), "{}", relative(&summary));
    let taken = kinds(&bench);
    let last: Vec<_> = taken.iter().rev().take(3).map(|(kind, _)| kind.as_str()).collect();
    assert_eq!(last, ["dark", "reference", "target"]);

    let readings = bench.text("run/readings.csv");
    let said = bench.gonio(&["resume", "run"]).well().says(&["ended by its plan's rule: ", rule]);
    assert!(said.out.contains(&format!("stopped by the plan's rule: {rule}")), "{said}");
    assert_eq!(bench.text("run/readings.csv"), readings);
}

#[test]
fn a_run_whose_time_is_up_before_it_is_accurate_enough_has_missed_its_target() {
    let bench = noisy("[stop]\nexitance_relative = 0.002\n");
    let bench = bench.with("plan.toml", "[stop]\n", "[stop]\nrig_time_s_max = 120\n");
    let cut = bench.gonio(&["run", "plan.toml", "--out", "cut", "--json"]);
    let summary = cut.json();
    let measured = summary["targets_measured"].as_u64().unwrap();
    assert!((10..100).contains(&measured), "{measured}");
    assert_eq!((cut.code, &summary["outcome"]), (Some(1), &"reached".into()), "{cut}");
    cut.says(&["the accuracy target was missed: exitance to", "expected 0.200 %"]);
}

#[test]
fn what_all_readings_share_keeps_a_run_from_its_target_and_is_named() {
    let bench = noisy("[stop]\nexitance_relative = 0.002\n");
    let bench =
        bench.with("rig.toml", "u_responsivity_relative = 1e-5", "u_responsivity_relative = 0.01");
    let said =
        run(&bench).says(&["the accuracy target was missed", " % are shared by all targets"]);
    assert_eq!((said.code, &said.json()["outcome"]), (Some(1), &"complete".into()));
}

#[test]
fn a_run_ends_within_its_rig_time() {
    let bench = noisy("[stop]\nrig_time_s_max = 100\n");
    let summary = run(&bench).well().json();
    assert_eq!(summary["outcome"], "reached");
    assert!(summary["rule"].as_str().unwrap().starts_with("the rig's time is used up after "));
    let rig_s = summary["rig_s"].as_f64().unwrap();
    // Less than one more target would have taken.
    assert!((96.0..100.0).contains(&rig_s), "{rig_s}");
    assert_eq!(kinds(&bench).last().unwrap().0, "dark");
}

#[test]
fn in_real_time_the_rule_is_asked_beside_the_run() {
    let bench = noisy("[stop]\nexitance_relative = 0.05\n")
        .with("rig.toml", "speed_deg_per_s = 60", "speed_deg_per_s = 1000")
        .with("rig.toml", "acceleration_deg_per_s2 = 120", "acceleration_deg_per_s2 = 20000")
        .with("rig.toml", "speed_mm_per_s = 100", "speed_mm_per_s = 1000")
        .with("rig.toml", "acceleration_mm_per_s2 = 500", "acceleration_mm_per_s2 = 20000")
        .with("rig.toml", "settle_ms = 50", "settle_ms = 5")
        .with("plan.toml", "dwell_ms = 2000", "dwell_ms = 50")
        .with("plan.toml", "angular_degree = 2\nposition_degree = 1", LITTLE);
    let said = bench.gonio(&["run", "plan.toml", "--out", "run", "--json", "--realtime"]);
    let summary = said.well().json();
    assert_eq!(summary["outcome"], "reached");
    assert_eq!(summary["rule"], "exitance to 5.00 % after 6 of 400 targets");
    assert!(summary["targets_measured"].as_u64().unwrap() < 40);
}

#[test]
fn the_time_that_is_promised_is_the_time_that_it_takes() {
    for example in ["lambertian", "led-lobe", "luminaire"] {
        let bench = Bench::of(example);
        let promised = bench.gonio(&["plan", "plan.toml", "--json"]).well().json();
        let promised_s = promised["time_s"]["total"].as_f64().unwrap();
        let rig_s = run(&bench).well().json()["rig_s"].as_f64().unwrap();
        let off = promised_s / rig_s - 1.0;
        assert!(off.abs() < 0.05, "{example}: promised {promised_s} s, took {rig_s} s: {off}");
    }
}
