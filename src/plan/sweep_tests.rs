//! What could break: a window off its target, a sweep that leaves the travel, a prediction that
//! forgets a ramp, a message without a remedy.

use spanned_toml::{Document, Source};

use super::*;
use crate::rig::{Approach, Latched, ReadingKind, Rig, forward};

const PLAN: &str = "
[region]
x_mm = [-5, 5]
y_mm = [-5, 5]
theta_max_deg = 80
[schedule]
kind = \"sweep\"
x_count = 2
y_count = 2
phi_step_deg = 30
speed_deg_per_s = 20
[dwell]
dwell_ms = 25
[dark]
method = \"shutter\"
every = 1000
[reference]
every = 500
[fit]
angular_degree = 4
position_degree = 1
";

fn plan(text: &str) -> Plan {
    Plan::read(Document::parse(Source::new("plan.toml", text)).unwrap()).unwrap()
}

fn with(from: &str, to: &str) -> String {
    assert!(PLAN.contains(from), "{from}");
    PLAN.replace(from, to)
}

fn windows(sequence: &Sequence) -> Vec<&Step> {
    sequence.steps.iter().filter(|step| step.swept.is_some()).collect()
}

#[test]
fn windows_cover_the_arc_over_the_top_each_target_once() {
    let rig = Rig::built_in().unwrap();
    let sequence = plan(PLAN).lay_out(&rig, None).unwrap();
    // Four places, six planes of two meridians, 320 windows of 0.5°.
    assert_eq!((sequence.targets.len(), sequence.sweeps()), (24 * 320, 24));
    let mut seen = vec![0; sequence.targets.len()];
    for step in windows(&sequence) {
        let ReadingKind::Target { index, repeat: 0 } = step.kind else { panic!("{step:?}") };
        seen[index as usize] += 1;
        let swept = step.swept.unwrap();
        assert_eq!(swept.travel.0.map(i32::abs), [500, 0, 0, 0]);
        assert_eq!(swept.count, 320);
        let ends = [step.counts, step.ends_at()].map(|counts| rig.positions(counts).0);
        let target = sequence.targets[index as usize];
        for (i, position) in target.positions.0.iter().enumerate() {
            let middle = 0.5 * (ends[0][i] + ends[1][i]);
            assert!((middle - position).abs() < 1e-12);
        }
        assert_eq!(step.pose, Some(target.pose));
        assert_eq!(forward(target.positions), target.pose);
        assert!(target.pose.theta_rad < 80.0_f64.to_radians());
    }
    assert!(seen.iter().all(|count| *count == 1));
    let speeds = sequence.speeds(&rig);
    assert!((speeds[0].to_degrees() - 20.0).abs() < 1e-9 && speeds[1] == 0.0, "{speeds:?}");
}

#[test]
fn sweeps_go_back_and_forth_and_continue_window_by_window() {
    let rig = Rig::built_in().unwrap();
    let sequence = plan(PLAN).lay_out(&rig, None).unwrap();
    for pair in sequence.steps.windows(2) {
        if pair[1].continues(&pair[0]) {
            assert_eq!(pair[0].ends_at(), pair[1].counts);
        }
    }
    let firsts: Vec<&Step> = windows(&sequence)
        .into_iter()
        .filter(|step| step.swept.unwrap().first == step.id)
        .collect();
    let ways: Vec<i32> =
        firsts.iter().map(|step| step.swept.unwrap().travel.0[0].signum()).collect();
    assert!(ways.windows(2).all(|pair| pair[0] == -pair[1]), "{ways:?}");
    // The stage is quicker than the table: all places of a plane, and then the next, a step further.
    let tables: Vec<i32> = firsts.iter().map(|step| step.counts.0[1]).collect();
    assert!(tables.chunks(4).all(|plane| plane.iter().all(|at| *at == plane[0])), "{tables:?}");
    assert!(tables.chunks(4).zip(tables.chunks(4).skip(1)).all(|(a, b)| b[0] - a[0] == 30_000));
    // One axis moves at a time.
    let moved = |a: &Step, b: &Step| (1..4).filter(|i| a.counts.0[*i] != b.counts.0[*i]).count();
    assert!(firsts.windows(2).all(|pair| moved(pair[0], pair[1]) == 1));
}

#[test]
fn the_prediction_is_windows_ramps_leads_and_turns() {
    let rig = Rig::built_in().unwrap();
    let text = with("x_count = 2\ny_count = 2", "x_count = 1\ny_count = 1");
    let text = text.replace("every = 500", "every = 5000").replace("every = 1000", "every = 5000");
    let sequence = plan(&text).lay_out(&rig, None).unwrap();
    let prediction = &sequence.prediction;
    assert!((prediction.dwelling_s - 6.0 * 8.0).abs() < 1e-9);
    // Each sweep: ramps of 1/6 s up and down, a lead of 50 ms; between two of six a turn of 30° in
    // a second, which ends in the sweep's own run-up.
    let sweeps = 6.0 * (2.0 / 6.0 + 0.05);
    let turns = 5.0;
    assert!(prediction.moving_s > sweeps + turns);
    // To the first sweep the arm goes 83°; from the last one to the reference the table 150°.
    let ways = 83.0 / 60.0 + 0.5 + 150.0 / 60.0 + 0.5;
    assert!((prediction.moving_s - sweeps - turns - ways).abs() < 0.1, "{}", prediction.moving_s);
    let left = TimeLeft::of(&rig, &sequence.steps).at(0).as_secs_f64();
    assert!((left + prediction.homing_s - prediction.total_s()).abs() < 1e-6);
}

#[test]
fn the_narrowest_feature_sets_the_speed_and_the_axis_bounds_it() {
    let rig = Rig::built_in().unwrap();
    let speed = |narrowest: f64| {
        let text = with("speed_deg_per_s = 20", &format!("narrowest_feature_deg = {narrowest}"));
        plan(&text).lay_out(&rig, None).unwrap().speeds(&rig)[0].to_degrees()
    };
    let detector = &rig.detector;
    let sigma = detector.pupil_radius_m.hypot(detector.spot_radius_m) / (2.0 * detector.distance_m);
    let beam_deg = 2.354_82 * sigma.to_degrees();
    for narrowest in [0.5, 2.0, 4.0] {
        let expected = 0.2 * f64::hypot(narrowest, beam_deg) / 0.025;
        let found = speed(narrowest);
        assert!(found <= expected * (1.0 + 1e-6) && found > 0.95 * expected, "{found}, {expected}");
    }
    assert!(speed(60.0) <= 60.0 && speed(60.0) > 50.0);
}

#[test]
fn an_arm_with_one_side_flies_one_way_and_one_without_the_other_side_from_the_pole() {
    let mut rig = Rig::built_in().unwrap();
    rig.axes[0].approach = Approach::Positive;
    rig.axes[0].run_up = 2.0_f64.to_radians();
    let sequence = plan(PLAN).lay_out(&rig, None).unwrap();
    assert!(windows(&sequence).iter().all(|step| step.swept.unwrap().travel.0[0] == 500));
    let step = windows(&sequence)[0];
    let motion = rig.flight(step.flight(1).unwrap()).unwrap();
    let run_up = f64::from(step.counts.0[0]) - motion.axes()[0].from;
    assert!(run_up >= 2000.0 - 1.0, "{run_up}");

    let mut rig = Rig::built_in().unwrap();
    rig.axes[0].travel = ((-5.0_f64).to_radians(), 95.0_f64.to_radians());
    let sequence = plan(PLAN).lay_out(&rig, None).unwrap();
    assert_eq!((sequence.targets.len(), sequence.sweeps()), (4 * 12 * 160, 48));
    assert!(sequence.targets.iter().all(|target| target.positions.0[0] > 0.0));
}

#[test]
fn a_window_measured_at_rest_stands_in_its_middle() {
    let rig = Rig::built_in().unwrap();
    let sequence = plan(PLAN).lay_out(&rig, None).unwrap();
    let step = *windows(&sequence)[7];
    let at_rest = step.at_rest();
    assert_eq!(at_rest.counts, Latched(rig.counts(step.positions).0));
    assert!(at_rest.swept.is_none() && at_rest.id == step.id && at_rest.pose == step.pose);
}

#[test]
fn what_a_rig_or_its_wire_can_t_do_is_said_with_what_to_do() {
    let rig = Rig::built_in().unwrap();
    let refused = |text: &str| plan(text).lay_out(&rig, None).unwrap_err().to_string();
    let fast = refused(&with("speed_deg_per_s = 20", "speed_deg_per_s = 61"));
    assert!(fast.contains("speed_deg_per_s") && fast.contains("at most 60"), "{fast}");
    let short = refused(&with("dwell_ms = 25", "dwell_ms = 1").replace("= 20", "= 10"));
    assert!(short.contains("the wire carries"), "{short}");
    let far = refused(&with("theta_max_deg = 80", "theta_max_deg = 90").replace("= 20", "= 60"));
    assert!(far.contains("run-up") && far.contains("95.000°"), "{far}");
    // Where the speed is free, it is lowered until the run-up fits.
    let free = with("theta_max_deg = 80", "theta_max_deg = 90");
    let free = plan(&free.replace("speed_deg_per_s = 20", "narrowest_feature_deg = 60"));
    let speed = free.lay_out(&rig, None).unwrap().speeds(&rig)[0].to_degrees();
    assert!(speed > 25.0 && speed < 35.0, "{speed}");
    let read = |text: &str| {
        Plan::read(Document::parse(Source::new("plan.toml", text)).unwrap())
            .unwrap_err()
            .to_string()
    };
    // What the plan expects of the field says how fast to sweep, too.
    let own = plan(&with("speed_deg_per_s = 20", "narrowest_feature_deg = 30"));
    let expect = "\n[expect]\nnarrowest_feature_deg = 30\n";
    let expected = plan(&format!("{}{expect}", with("speed_deg_per_s = 20\n", "")));
    let [own, expected] =
        [own, expected].map(|plan| plan.lay_out(&rig, None).unwrap().speeds(&rig)[0]);
    assert!(own > 0.0 && (own / expected - 1.0).abs() < 1e-9, "{own} {expected}");
    let nothing = read(&with("speed_deg_per_s = 20\n", ""));
    assert!(nothing.contains("narrowest_feature_deg"), "{nothing}");
    let zero = read(&with("speed_deg_per_s = 20", "speed_deg_per_s = 0"));
    assert!(zero.contains("above 0"), "{zero}");
}

#[test]
fn repeats_turn_back_and_the_hash_knows_the_flight() {
    let rig = Rig::built_in().unwrap();
    let twice = plan(&with("phi_step_deg = 30", "phi_step_deg = 30\nrepeat = 2"));
    let sequence = twice.lay_out(&rig, None).unwrap();
    assert_eq!(windows(&sequence).len(), 2 * sequence.targets.len());
    let once = plan(PLAN);
    let slow = plan(&with("speed_deg_per_s = 20", "speed_deg_per_s = 20\nwindow_ms = 50"));
    let hash = |plan: &Plan| plan.hash(&plan.lay_out(&rig, None).unwrap());
    assert_ne!(hash(&once), hash(&slow));
}

#[test]
fn interleaved_meridians_are_flown_once_each_at_all_places_alike() {
    let rig = Rig::built_in().unwrap();
    let interleaved = with("phi_step_deg = 30", "phi_step_deg = 15\ninterleaved = true");
    let sequence = plan(&interleaved).lay_out(&rig, None).unwrap();
    // Twelve planes over four places, instead of 48.
    assert_eq!((sequence.targets.len(), sequence.sweeps()), (12 * 320, 12));
    let mut seen: Vec<([i32; 2], i32)> = windows(&sequence)
        .into_iter()
        .filter(|step| step.swept.unwrap().first == step.id)
        .map(|step| ([step.counts.0[2], step.counts.0[3]], step.counts.0[1]))
        .collect();
    seen.sort_by_key(|(_, table)| *table);
    let turns: Vec<i32> = seen.windows(2).map(|pair| pair[1].1 - pair[0].1).collect();
    assert!(turns.iter().all(|turn| *turn == 15_000), "{turns:?}");
    assert!(seen.windows(2).all(|pair| pair[0].0 != pair[1].0), "{seen:?}");
    for place in seen.iter().map(|(place, _)| *place) {
        assert_eq!(seen.iter().filter(|(other, _)| *other == place).count(), 3);
    }
    // A place without a sweep is no place.
    let few = plan(&interleaved.replace("phi_step_deg = 15", "phi_step_deg = 60"));
    let refused = few.lay_out(&rig, None).unwrap_err().to_string();
    assert!(refused.contains("interleaved") && refused.contains("3 sweeps for 4"), "{refused}");
}

#[test]
fn the_order_of_sweeps_is_set_against_the_least_that_any_order_takes() {
    let rig = Rig::built_in().unwrap();
    let way = |text: &str| {
        let plan = plan(text);
        let sequence = plan.lay_out(&rig, None).unwrap();
        plan.way(&rig, &sequence).unwrap()
    };
    // 24 sweeps: five turns of the table by 30°, a second each, and 18 moves of the stage by 10 mm, 0.2 s
    // of the way there and 0.2 s to rest; and the ways from and to the reference.
    let serpentine = way(PLAN);
    assert!(serpentine.least_s > 9.0 && serpentine.seconds < 20.0, "{serpentine:?}");
    assert!(serpentine.gap() > 0.0 && serpentine.gap() < 0.2, "{serpentine:?}");
    // Flown one way only, the arm has to come back each time: the bound knows that no better.
    let mut one_way = rig.clone();
    one_way.axes[0].approach = Approach::Positive;
    let plan = plan(PLAN);
    let back = plan.way(&one_way, &plan.lay_out(&one_way, None).unwrap()).unwrap();
    assert!(back.seconds > serpentine.seconds + 20.0, "{back:?}");
}
