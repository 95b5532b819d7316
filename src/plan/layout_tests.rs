//! Plans laid out on the built-in rig: what is measured, when, and what is refused.

use std::collections::HashMap;
use std::time::Duration;

use firmware_protocol::Shutter;
use spanned_toml::{Document, Problem, Source};

use super::*;
use crate::rig::{Approach, Latched, ReadingKind, Rig, forward};

const BASE: &str = "
[region]
x_mm = [-20, 20]
y_mm = [-20, 20]
theta_max_deg = 80
[schedule]
kind = \"low-discrepancy\"
count = 25
[dwell]
dwell_ms = 50
[dark]
every = 10
dwell_ms = 200
method = \"shutter\"
[reference]
every = 5
dwell_ms = 100
[fit]
angular_degree = 4
position_degree = 1
";

fn plan(text: &str) -> Result<Plan, Problem> {
    Plan::read(Document::parse(Source::new("plan.toml", text))?)
}

/// The base plan with some words replaced.
fn changed(changes: &[(&str, &str)]) -> Result<Plan, Problem> {
    let mut text = BASE.to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    plan(&text)
}

fn rig() -> Rig {
    Rig::built_in().unwrap()
}

fn kinds(steps: &[Step]) -> String {
    let letter = |step: &Step| match step.kind {
        ReadingKind::Dark => 'D',
        ReadingKind::Reference => 'R',
        ReadingKind::WarmUp => 'W',
        ReadingKind::Target { .. } => '.',
    };
    steps.iter().map(letter).collect()
}

#[test]
fn dark_and_reference_readings_stand_at_fixed_places() {
    let sequence = plan(BASE).unwrap().lay_out(&rig(), None).unwrap();
    assert_eq!(kinds(&sequence.steps), "DR.....R.....RD.....R.....RD.....RD");
    for (id, step) in (0..).zip(&sequence.steps) {
        assert_eq!(step.id, id);
    }
}

#[test]
fn every_target_is_taken_once_a_repeat_and_looks_along_its_pose() {
    let plan = changed(&[("count = 25", "count = 25\nrepeat = 3")]).unwrap();
    let rig = rig();
    let sequence = plan.lay_out(&rig, None).unwrap();
    let mut taken = HashMap::new();
    for step in &sequence.steps {
        if let ReadingKind::Target { index, repeat } = step.kind {
            *taken.entry((index, repeat)).or_insert(0) += 1;
            let target = sequence.targets[index as usize];
            assert_eq!((target.index, Some(target.pose)), (index, step.pose));
            let seen = forward(rig.positions(step.counts));
            assert!((seen.theta_rad - target.pose.theta_rad).abs() < 1e-5);
            assert!((seen.x_m - target.pose.x_m).abs() < 1e-6);
        }
    }
    assert_eq!(taken.len(), 75);
    assert!(taken.values().all(|times| *times == 1));
}

#[test]
fn dark_readings_stay_where_the_axes_are() {
    let sequence = plan(BASE).unwrap().lay_out(&rig(), None).unwrap();
    let mut here = Latched([0; 4]);
    for step in &sequence.steps {
        if step.kind == ReadingKind::Dark {
            assert_eq!((step.counts, step.settle, step.via), (here, Duration::ZERO, None));
            assert_eq!((step.shutter, step.pose), (Shutter::Closed, None));
        } else {
            assert_eq!(step.shutter, Shutter::Open);
        }
        here = step.counts;
    }
}

#[test]
fn source_off_asks_for_it_and_leaves_the_shutter_open() {
    let plan = changed(&[("\"shutter\"", "\"source-off\"")]).unwrap();
    let sequence = plan.lay_out(&rig(), None).unwrap();
    for step in &sequence.steps {
        assert_eq!(step.source_off, step.kind == ReadingKind::Dark);
        assert_eq!(step.shutter, Shutter::Open);
    }
}

#[test]
fn the_prediction_is_the_sum_of_its_steps() {
    let mut rig = rig();
    rig.axes[1].approach = Approach::Positive;
    rig.axes[1].run_up = 0.5_f64.to_radians();
    let sequence = plan(BASE).unwrap().lay_out(&rig, None).unwrap();
    assert!(sequence.steps.iter().any(|step| step.via.is_some()));
    let prediction = sequence.prediction;
    assert_eq!((prediction.targets, prediction.readings), (25, 35));
    assert!((prediction.dwelling_s - 25.0 * 0.05).abs() < 1e-12);
    assert!((prediction.checking_s - (4.0 * 0.2 + 6.0 * 0.1)).abs() < 1e-12);
    let left = TimeLeft::of(&rig, &sequence.steps);
    let rest_s = prediction.total_s() - prediction.homing_s;
    assert!((left.at(0).as_secs_f64() - rest_s).abs() < 1e-6);
    assert_eq!(left.at(sequence.steps.len()), Duration::ZERO);
    assert!(prediction.travel.iter().all(|way| *way > 0.0));
}

#[test]
fn readings_outside_the_sequence_have_their_own_ids() {
    let sequence = plan(BASE).unwrap().lay_out(&rig(), None).unwrap();
    let warm_up = sequence.warm_up(3);
    assert_eq!((warm_up.id, warm_up.kind), (0x4000_0003, ReadingKind::WarmUp));
    let check = sequence.resume_check(1);
    assert_eq!((check.id, check.kind), (0x8000_0001, ReadingKind::Reference));
    assert_eq!(warm_up.counts, sequence.steps[1].counts);
}

#[test]
fn the_hash_follows_what_is_measured_and_not_how_the_file_looks() {
    let hash = |plan: &Plan| plan.hash(&plan.lay_out(&rig(), None).unwrap());
    let base = hash(&plan(BASE).unwrap());
    assert_eq!(hash(&plan(&format!("# a remark\nname = \"other\"\n{BASE}")).unwrap()), base);
    for (from, to) in [("50", "51"), ("every = 5", "every = 6"), ("80", "79"), ("= 4", "= 5")] {
        assert_ne!(hash(&changed(&[(from, to)]).unwrap()), base, "{from} {to}");
    }
}

#[test]
fn a_listed_order_is_kept() {
    let plan = changed(&[("count = 25", "count = 25\norder = \"listed\"")]).unwrap();
    let sequence = plan.lay_out(&rig(), None).unwrap();
    let order: Vec<u32> = sequence
        .steps
        .iter()
        .filter_map(|step| match step.kind {
            ReadingKind::Target { index, .. } => Some(index),
            _ => None,
        })
        .collect();
    assert_eq!(order, (0..25).collect::<Vec<u32>>());
}

#[test]
fn a_list_is_measured_and_its_line_named_where_the_rig_refuses() {
    let plan = changed(&[
        ("kind = \"low-discrepancy\"", "kind = \"list\""),
        ("count = 25", "file = \"p.csv\""),
    ])
    .unwrap();
    assert_eq!(plan.list_file(), Some("p.csv"));
    let list = |lines: &str| Source::new("p.csv", &format!("x_mm,y_mm,theta_deg,phi_deg\n{lines}"));
    let sequence = plan.lay_out(&rig(), Some(&list("0,0,80,10\n20,-20,0,0\n"))).unwrap();
    assert_eq!(sequence.targets.len(), 2);
    let problem = plan.lay_out(&rig(), Some(&list("0,0,1,10\n\n0,0,81,10\n"))).unwrap_err();
    assert_eq!(problem.file(), "p.csv");
    assert_eq!(problem.line_and_column().map(|at| at.0), Some(4), "{problem}");
    assert!(problem.what().contains("pose 1: theta: 81.000° is outside"), "{problem}");
    let mut small = rig();
    small.axes[2].travel = (-0.01, 0.01);
    let problem = plan.lay_out(&small, Some(&list("15,0,1,10\n"))).unwrap_err();
    let expected = "pose 0: x: 15.000 mm is above the upper limit 10.000 mm";
    assert_eq!(problem.what(), expected);
    assert!(plan.lay_out(&rig(), None).is_err());
}

#[test]
fn what_the_rig_cannot_do_is_refused_at_its_key() {
    let mut narrow = rig();
    narrow.axes[0].travel = ((-10.0_f64).to_radians(), 10.0_f64.to_radians());
    let problem = plan(BASE).unwrap().lay_out(&narrow, None).unwrap_err();
    assert!(problem.what().contains("is above the upper limit 10.000°"), "{problem}");
    assert_eq!(problem.key(), "schedule.kind");
    for (from, to, key) in [
        ("dwell_ms = 50", "dwell_ms = 50\ngain = \"1 mA\"", "dwell.gain"),
        ("dwell_ms = 50", "dwell_ms = 0.4", "dwell.dwell_ms"),
        ("dwell_ms = 200", "dwell_ms = 0.4", "dark.dwell_ms"),
        ("[reference]", "[reference]\nx_mm = 51", "reference"),
    ] {
        let problem = changed(&[(from, to)]).unwrap().lay_out(&rig(), None).unwrap_err();
        assert!(problem.key().starts_with(key), "{problem}");
        assert!(problem.line_and_column().is_some_and(|at| at.0 > 1), "{problem}");
    }
}

#[test]
fn bounds_hold_before_anything_is_made() {
    let raster = "kind = \"raster\"\nx_count = 1000\ny_count = 1000\ntheta_step_deg = 0.01\n\
                  phi_step_deg = 0.01";
    let plan = changed(&[("kind = \"low-discrepancy\"\ncount = 25", raster)]).unwrap();
    let problem = plan.lay_out(&rig(), None).unwrap_err();
    assert!(problem.what().contains("targets"), "{problem}");
    let plan = changed(&[("count = 25", "count = 1000000\nrepeat = 3")]).unwrap();
    assert_eq!(plan.lay_out(&rig(), None).unwrap_err().key(), "schedule.repeat");
}
