//! Runs that decide on the way what they measure, as a person sees them. Would break: a target said
//! to be met that is not; a narrow feature missed in silence; a resume that decides anew, or measures
//! other things than the run that was cut off; a plan that contradicts itself; an end without a reason.

mod bench;

use bench::{Bench, Said};
use gonio::journal::{Order, Reader};
use serde_json::Value;

/// A lobe 42° wide, on an even ground.
const SCENE: &str = r#"[[emitter]]
kind = "lobes"
x_mm = [-8, 8]
y_mm = [-8, 8]
radiance_w_per_m2_sr = 100
base_weight = 0.2

[[emitter.lobes]]
theta_deg = 35
phi_deg = 30
exponent = 10
"#;

/// The fit is pinned: what is tested is not its choice, which takes its time.
const FIT: &str = "[fit]\nangular_degree = 12\nposition_degree = 0\npenalty_power = 2\n";

fn bench() -> Bench {
    let bench = Bench::of("adaptive")
        .having("scene.toml", SCENE)
        .with("plan.toml", "narrowest_feature_deg = 25", "narrowest_feature_deg = 40")
        .with("plan.toml", "theta_deg = 45", "theta_deg = 35");
    let plan = bench.text("plan.toml");
    bench.having("plan.toml", format!("{plan}\n{FIT}"))
}

fn asked(bench: Bench, relative: &str) -> Bench {
    bench.with("plan.toml", "radiance_relative = 0.02", &format!("radiance_relative = {relative}"))
}

fn run(bench: &Bench) -> (Said, Value) {
    let said = bench.gonio(&["run", "plan.toml", "--out", "out", "--json"]);
    let summary: Value = serde_json::from_str(&said.out).unwrap_or_else(|e| panic!("{e}\n{said}"));
    (said, summary)
}

fn rounds(summary: &Value) -> &[Value] {
    summary["adaptive"]["rounds"].as_array().unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// The true error of the radiance, the scale's part left in: 0.5 % of it are everybody's.
fn truly(summary: &Value) -> f64 {
    number(&summary["truth"]["radiance_error_rms_relative"])
}

#[test]
fn a_run_ends_at_its_target_and_its_true_error_is_what_it_says() {
    let bench = asked(bench(), "0.03");
    let (said, summary) = run(&bench);
    assert_eq!(said.code, Some(0), "{said}");
    let rounds = rounds(&summary);
    let last = rounds.last().unwrap();
    assert_eq!(last["verdict"]["is_met"], Value::Bool(true), "{said}");
    let upper = number(&last["checked_upper_relative"]);
    assert!(upper <= 0.03 && number(&last["between_relative"]) <= 0.03, "{said}");
    // Below what is stated with 90 % confidence, the common scale apart; and not for nothing: a fit
    // that is much better than it says has cost too much.
    let error = truly(&summary);
    assert!(error <= libm::hypot(upper, 0.006), "{error} {upper}\n{said}");
    // fit.json and the report say the same.
    let fit = bench.json("out/fit.json");
    assert_eq!(fit["rounds"], summary["adaptive"]["rounds"]);
    let report = bench.text("out/report.html");
    assert!(report.contains("Not looked at") && report.contains("Round 1"));
    // Every target that was decided upon is measured, each once.
    assert_eq!(summary["targets_measured"], summary["targets_planned"]);
}

#[test]
fn the_curve_of_a_run_says_how_little_its_first_rounds_knew() {
    let bench = bench();
    let (_, summary) = run(&bench);
    let mut csv = csv::Reader::from_path(bench.path("out/accuracy.csv")).unwrap();
    let points: Vec<Vec<f64>> = csv
        .records()
        .map(|record| record.unwrap().iter().map(|field| field.parse().unwrap()).collect())
        .collect();
    assert!(points.len() >= 6, "{points:?}");
    let truth = number(&summary["truth"]["exitance_w_per_m2"]);
    for point in &points {
        let (exitance, u) = (point[2], point[3]);
        assert!((exitance - truth).abs() < 4.0 * u, "{point:?}, truly {truth}");
    }
    let (first, last) = (&points[0], &points[points.len() - 1]);
    assert!(first[5] > 10.0 * last[5], "{first:?} {last:?}");
}

#[test]
fn a_finer_target_takes_more_sweeps_and_gets_nearer() {
    let (coarse, coarsely) = run(&asked(bench(), "0.2"));
    let (fine, finely) = run(&asked(bench(), "0.02"));
    assert_eq!((coarse.code, fine.code), (Some(0), Some(0)), "{coarse}{fine}");
    let sweeps = |summary: &Value| number(&rounds(summary).last().unwrap()["sweeps"]);
    assert!(sweeps(&finely) > sweeps(&coarsely), "{fine}");
    assert!(truly(&finely) < truly(&coarsely), "{coarse}{fine}");
}

#[test]
fn a_fit_that_lacks_meridians_gets_whole_ones_until_the_checks_agree() {
    // Plain least squares of degree 12 wants 25 azimuths, whatever there is to see.
    let bench = asked(bench(), "0.03").with("plan.toml", "penalty_power = 2\n", "");
    let (said, summary) = run(&bench);
    assert_eq!(said.code, Some(0), "{said}");
    let rounds = rounds(&summary);
    let (first, last) = (&rounds[0], rounds.last().unwrap());
    // After the first round the interpolation is content, and the fit is not.
    assert!(number(&first["between_relative"]) <= 0.03 && first["verdict"].is_null(), "{said}");
    let arc = |round: &Value| number(&round["gaps"]["arc_deg"]);
    assert!(arc(last) < 0.8 * arc(first), "{said}");
    let upper = number(&last["checked_upper_relative"]);
    assert!(truly(&summary) <= libm::hypot(upper, 0.006), "{said}");
}

#[test]
fn a_spike_narrower_than_declared_is_not_missed_in_silence() {
    let spike = |phi_deg: f64| {
        let lobe = format!(
            "\n[[emitter.lobes]]\ntheta_deg = 50\nphi_deg = {phi_deg}\nwidth_deg = 1.6\nweight = 1\n"
        );
        asked(bench(), "0.05").having("scene.toml", format!("{SCENE}{lobe}"))
    };
    // Where no sweep comes by it is not seen, and the run says how wide a gap it has left.
    let (said, summary) = run(&spike(100.0));
    let gaps = &rounds(&summary).last().unwrap()["gaps"];
    assert!(number(&gaps["arc_deg"]) > 1.6, "{said}");
    // Where one does, the run does not believe that it is done: sweep by sweep it goes there.
    let beside = number(&rounds(&summary)[0]["between_relative"]);
    let (said, summary) = run(&spike(0.0));
    let seen = number(&rounds(&summary)[0]["between_relative"]);
    assert!(seen > 1.5 * beside, "{seen} {beside}\n{said}");
}

#[test]
fn a_dim_source_is_not_taken_for_a_good_fit() {
    let dim = asked(bench(), "0.05").with("scene.toml", "sr = 100", "sr = 0.02");
    let (said, summary) = run(&dim);
    let last = rounds(&summary).last().unwrap();
    assert!(number(&last["noise_relative"]) > 0.005, "{said}");
    if said.code == Some(0) {
        let upper = number(&last["checked_upper_relative"]);
        assert!(truly(&summary) <= libm::hypot(2.0 * upper, 0.006), "{said}");
    } else {
        assert_eq!(said.code, Some(1), "{said}");
        assert!(said.err.contains("the accuracy target was missed"), "{said}");
    }
}

/// The lengths of all windows that were flown, milliseconds.
fn windows_ms(bench: &Bench) -> Vec<f64> {
    let steps = Reader::open(&bench.path("out/run.sqlite")).unwrap().steps().unwrap();
    let flown = steps.iter().filter(|step| step.swept.is_some());
    flown.map(|step| step.dwell.as_secs_f64() * 1e3).collect()
}

#[test]
fn sweeps_are_slower_where_light_is_scarce_and_no_slower_where_it_is_not() {
    let bright = asked(bench(), "0.015");
    run(&bright);
    let windows = windows_ms(&bright);
    assert!(windows.iter().all(|ms| (ms - 25.0).abs() < 1e-9), "{windows:?}");
    // A reading's noise is a tenth of the radiance: what stands between the sweeps and 5 % is noise.
    let dim = asked(bench(), "0.05").with("scene.toml", "sr = 100", "sr = 0.008");
    let (said, summary) = run(&dim);
    assert!(number(&rounds(&summary)[0]["noise_relative"]) > 0.05, "{said}");
    let windows = windows_ms(&dim);
    let long = windows.iter().filter(|ms| **ms >= 100.0).count();
    assert!(long > 200 && windows.contains(&25.0), "{long} of {}", windows.len());
    // What lies between them is told apart from noise, so that it does not hold the run up.
    let last = rounds(&summary).last().unwrap();
    assert!(number(&last["between_relative"]) < 0.02, "{said}");
    assert!(truly(&summary) < 0.05, "{said}");
}

#[test]
fn the_dark_level_is_read_again_where_it_is_all_that_the_exitance_lacks() {
    let wanted = "radiance_relative = 0.05\nexitance_within_region_relative = 0.006";
    let bench = bench()
        .with("plan.toml", "radiance_relative = 0.02", wanted)
        .with("plan.toml", "dwell_ms = 200", "dwell_ms = 25")
        .with("scene.toml", "sr = 100", "sr = 0.05");
    let (said, summary) = run(&bench);
    assert_eq!(said.code, Some(0), "{said}");
    let rounds = rounds(&summary);
    let of = |round: &Value, key: &str| number(&round[key]);
    let last = rounds.last().unwrap();
    let u = "exitance_within_region_u_relative";
    let before = rounds.iter().find(|round| round["sweeps"] == last["sweeps"]).unwrap();
    assert!(of(before, u) > 0.006 && of(last, u) <= 0.006, "{said}");
    assert!(of(last, "dark_relative") < 0.6 * of(before, "dark_relative"), "{said}");
    // No sweep more, and no more time than the reading.
    let steps = Reader::open(&bench.path("out/run.sqlite")).unwrap().steps().unwrap();
    let dark = steps.last().unwrap();
    assert!(dark.pose.is_none() && dark.dwell.as_secs_f64() > 0.05, "{dark:?}");
    let longer = of(last, "rig_s") - of(before, "rig_s");
    assert!((longer - dark.dwell.as_secs_f64()).abs() < 0.1, "{longer} {dark:?}");
    assert_eq!(summary["targets_measured"], summary["targets_planned"]);
    // Cut off before that was decided, and carried on, it decides so again.
    let decided = u32::try_from(rounds.len()).unwrap();
    cut_off(&bench, steps.len() - 2, decided - 2);
    bench.gonio(&["resume", "out", "--accept-drift"]).well();
    let again = Reader::open(&bench.path("out/run.sqlite")).unwrap().steps().unwrap();
    let last = again.last().unwrap();
    assert!(again.len() >= steps.len() && last.pose.is_none(), "{last:?}");
}

/// With so little time that a round is broken off: what the plan foretells of its first one does not
/// know how long warming up takes.
fn short_of_time(bench: Bench, room_s: f64) -> Bench {
    let foretold: Value =
        serde_json::from_str(&bench.gonio(&["plan", "plan.toml", "--json"]).out).unwrap();
    let most_s = number(&foretold["adaptive"]["first_round_s"]) + room_s;
    let most = format!("rig_time_s_max = {most_s}");
    let gate = "[warm_up]\ntolerance_relative = 0.5\nover_s = 20\ntimeout_s = 100\n";
    let bench = bench.with("plan.toml", "rig_time_s_max = 600", &most);
    let plan = bench.text("plan.toml");
    bench.having("plan.toml", format!("{plan}\n{gate}"))
}

#[test]
fn a_run_that_its_time_breaks_off_has_a_last_word() {
    let (said, summary) = run(&short_of_time(asked(bench(), "0.02"), 1.0));
    assert_eq!(said.code, Some(1), "{said}");
    assert!(said.err.contains("the rig's time is used up after"), "{said}");
    assert!(said.err.contains("the largest part is"), "{said}");
    let broken_off = rounds(&summary);
    assert_eq!((broken_off.len(), &broken_off[0]["verdict"]["is_met"]), (1, &Value::Bool(false)));
    assert!(summary["targets_measured"].as_u64() < summary["targets_planned"].as_u64(), "{said}");
    // And if what there is by then is enough, it is.
    let bench = short_of_time(
        bench().with("plan.toml", "radiance_relative = 0.02", "exitance_relative = 0.1"),
        15.0,
    );
    let (said, summary) = run(&bench);
    assert_eq!(rounds(&summary)[0]["verdict"]["is_met"], Value::Bool(true), "{said}");
    assert_eq!(said.code, Some(0), "{said}");
    // The same from the journal alone.
    bench.gonio(&["fit", "out"]).well();
    assert_eq!(bench.json("out/fit.json")["rounds"], summary["adaptive"]["rounds"]);
}

#[test]
fn a_sweep_flown_in_parts_is_one_sweep() {
    // 150° in windows of 0.1°: more of them than a device keeps.
    let bench = bench()
        .with(
            "plan.toml",
            "narrowest_feature_deg = 40 ",
            "narrowest_feature_deg = 0.5\nphi_step_deg = 60 ",
        )
        .with("plan.toml", "dwell_ms = 25 ", "dwell_ms = 5 ")
        .with("plan.toml", "radiance_relative = 0.02", "exitance_relative = 0.001");
    let (said, summary) = run(&bench);
    // Four meridians, and four checks.
    let first = &rounds(&summary)[0];
    assert_eq!((first["sweeps"].as_u64(), first["checks"].as_u64()), (Some(8), Some(4)), "{said}");
}

/// Index and radiance of every sample, as they stand in the file.
fn samples(bench: &Bench, out: &str) -> Vec<(String, String)> {
    let text = bench.text(&format!("{out}/samples.csv"));
    let rows = text.lines().skip(1).map(|line| line.split(',').collect::<Vec<_>>());
    rows.map(|row| (row[0].to_owned(), row[6].to_owned())).collect()
}

/// The journal as it would stand had the power failed when these many readings were committed, with
/// the decisions that were made by then.
fn cut_off(bench: &Bench, readings: usize, rounds: u32) {
    let path = bench.path("out/run.sqlite");
    let kept = Reader::open(&path).unwrap().rounds().unwrap();
    let steps = Reader::open(&path).unwrap().steps().unwrap();
    let added: u32 = kept.iter().skip(rounds as usize).map(|round| round.steps).sum();
    let last_step = steps.len() - added as usize;
    assert!(readings < last_step, "{readings} of {last_step}");
    let journal = rusqlite::Connection::open(&path).unwrap();
    let script = format!(
        "DELETE FROM rounds WHERE number >= {rounds};
         DELETE FROM steps WHERE id >= {last_step};
         DELETE FROM swept_steps WHERE id >= {last_step};
         DELETE FROM readings WHERE id >= {readings};
         DELETE FROM swept_readings WHERE id >= {readings};
         UPDATE sessions SET ended_s = NULL, reason = NULL;"
    );
    journal.execute_batch(&script).unwrap();
}

#[test]
fn a_run_cut_off_in_its_second_round_is_carried_on_to_the_same_samples() {
    let bench = asked(bench(), "0.015");
    bench.gonio(&["run", "plan.toml", "--out", "whole"]);
    let reader = Reader::open(&bench.path("whole/run.sqlite")).unwrap();
    let (rounds, steps) = (reader.rounds().unwrap(), reader.steps().unwrap());
    assert!(rounds.len() >= 3, "{rounds:?}");
    let added: u32 = rounds.iter().map(|round| round.steps).sum();
    let first = steps.len() - added as usize;
    drop(reader);
    // In the middle of the second round; after its last reading, before the decision; and in the
    // first one, when nothing had been decided.
    let second = first + rounds[0].steps as usize;
    for (readings, decisions) in
        [(usize::midpoint(first, second), 1), (second - 1, 1), (first - 40, 0)]
    {
        let _ = std::fs::remove_dir_all(bench.path("out"));
        std::fs::create_dir(bench.path("out")).unwrap();
        std::fs::copy(bench.path("whole/run.sqlite"), bench.path("out/run.sqlite")).unwrap();
        cut_off(&bench, readings, decisions);
        bench.gonio(&["resume", "out", "--accept-drift"]);
        let carried = Reader::open(&bench.path("out/run.sqlite")).unwrap();
        assert_eq!(carried.rounds().unwrap()[0], rounds[0], "after {readings} readings");
        assert_eq!(carried.steps().unwrap(), steps, "after {readings} readings");
        let ids = |reader: &Reader| {
            let readings = reader.readings(Order::Id).unwrap();
            readings.into_iter().filter(|r| r.id < 0x4000_0000).map(|r| r.id).collect::<Vec<_>>()
        };
        assert!(ids(&carried).into_iter().eq(0..u32::try_from(steps.len()).unwrap()));
        assert_eq!(samples(&bench, "out"), samples(&bench, "whole"));
    }
    // A run that has ended has nothing left to measure.
    let said = bench.gonio(&["resume", "whole"]);
    assert!(said.err.contains("nothing is left to measure"), "{said}");
}

#[test]
fn killed_in_real_time_it_keeps_its_decisions() {
    let bench = asked(bench(), "0.015")
        .with("plan.toml", "dwell_ms = 25 ", "dwell_ms = 5 ")
        .with("rig.toml", "speed_deg_per_s = 60", "speed_deg_per_s = 1200")
        .with("rig.toml", "acceleration_deg_per_s2 = 120", "acceleration_deg_per_s2 = 48000")
        .with("rig.toml", "speed_mm_per_s = 100", "speed_mm_per_s = 2000")
        .with("rig.toml", "acceleration_mm_per_s2 = 500", "acceleration_mm_per_s2 = 200000")
        .with("rig.toml", "settle_ms = 50", "settle_ms = 2");
    bench.gonio(&["run", "plan.toml", "--out", "whole"]);
    let mut command = bench.command(&["run", "plan.toml", "--realtime", "--out", "out"]);
    let mut child = command.stdout(std::process::Stdio::null()).spawn().unwrap();
    let began = std::time::Instant::now();
    let kept = loop {
        let reader = Reader::open(&bench.path("out/run.sqlite"));
        let kept = reader.and_then(|reader| reader.rounds()).unwrap_or_default();
        if !kept.is_empty() || child.try_wait().unwrap().is_some() {
            break kept;
        }
        assert!(began.elapsed().as_secs() < 50, "no decision");
        std::thread::sleep(std::time::Duration::from_millis(5));
    };
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!kept.is_empty());
    bench.gonio(&["resume", "out", "--accept-drift"]);
    let carried = Reader::open(&bench.path("out/run.sqlite")).unwrap();
    assert_eq!(carried.rounds().unwrap()[..kept.len()], kept);
    assert_eq!(samples(&bench, "out"), samples(&bench, "whole"));
}

#[test]
fn what_can_not_be_is_refused_before_anything_moves() {
    for (from, to, key) in [
        ("radiance_relative = 0.02", "radiance_relative = 0", "radiance_relative"),
        ("radiance_relative = 0.02", "", "radiance_relative"),
        ("rig_time_s_max = 600", "", "rig_time_s_max"),
        ("rig_time_s_max = 600", "rig_time_s_max = 0", "rig_time_s_max"),
        ("rig_time_s_max = 600", "rig_time_s_max = 20", "first round"),
        ("rig_time_s_max = 600", "rig_time_s_max = 600\nexitance_relative = 0.01", "own targets"),
        ("narrowest_feature_deg = 40", "narrowest_feature_deg = 0", "narrowest_feature_deg"),
        ("x_count = 2", "x_count = 2\nrepeat = 3", "repeat"),
        ("dwell_ms = 25", "dwell_ms = 0.5", "windows"),
    ] {
        let bench = bench().with("plan.toml", from, to);
        for words in [["run", "plan.toml", "--out", "out"], ["plan", "plan.toml", "--seed", "1"]] {
            let said = bench.gonio(&words);
            assert_eq!(said.code, Some(2), "{said}");
            assert!(said.err.contains(key) && said.err.contains("plan.toml"), "{said}");
        }
        assert!(!bench.path("out").exists());
    }
}

#[test]
fn a_target_below_what_all_readings_share_is_given_up_with_the_floor() {
    let bench = bench().with("plan.toml", "radiance_relative = 0.02", "exitance_relative = 0.001");
    let (said, summary) = run(&bench);
    assert_eq!(said.code, Some(1), "{said}");
    assert!(said.err.contains("can't be reached: what all readings share is"), "{said}");
    assert!(said.err.contains("the largest part is responsivity"), "{said}");
    assert_eq!(rounds(&summary).len(), 1);
}

#[test]
fn what_all_readings_share_is_that_of_the_target_s_own_directions() {
    let wanted = "exitance_within_region_relative = 0.00001";
    // A basis that readings choose goes on beyond the region as it may.
    let bench = Bench::of("adaptive").with("plan.toml", "radiance_relative = 0.02", wanted);
    let (said, _) = run(&bench);
    assert_eq!(said.code, Some(1), "{said}");
    let (_, shared) = said.err.split_once("what all readings share is ").unwrap();
    let shared = 0.01 * shared.split_once(" %").unwrap().0.parse::<f64>().unwrap();
    // Of the hemisphere it is more: what poses do to a fit grows where nothing was measured.
    let exitance = &bench.json("out/fit.json")["exitance_w_per_m2"];
    let is_shape = |name: &str| {
        let others = ["independent", "truncation", "extrapolation", "responsivity", "throughput"];
        !others.contains(&name) && !name.starts_with("gain ")
    };
    let rows = exitance["budget"].as_array().unwrap().iter();
    let rows = rows.filter(|row| is_shape(row["name"].as_str().unwrap()));
    let squares: f64 = rows.map(|row| number(&row["u"]).powi(2)).sum();
    let hemisphere = squares.sqrt() / number(&exitance["value"]);
    assert!(shared > 1e-5 && shared < 0.6 * hemisphere, "{shared} {hemisphere}");
}

#[test]
fn a_plan_says_what_its_first_round_takes_and_how_long_at_most() {
    let bench = bench();
    let said = bench.gonio(&["plan", "plan.toml"]);
    assert_eq!(said.code, Some(0), "{said}");
    assert!(said.out.contains("this is the first round") && said.out.contains("10 min"), "{said}");
    let said = bench.gonio(&["plan", "plan.toml", "--json"]);
    let plan: Value = serde_json::from_str(&said.out).unwrap();
    assert!(number(&plan["adaptive"]["at_most_s"]) > number(&plan["adaptive"]["first_round_s"]));
}
