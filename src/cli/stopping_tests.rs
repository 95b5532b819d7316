//! What is said of a run that goes on without its readings, against what is said of all of them.

use tempfile::TempDir;

use super::folder::JOURNAL;
use super::setup::Setup;
use super::stopping::{Form, Target};
use super::virtual_run::{Texts, VirtualRun};
use crate::rig::{Reading, ReadingKind};
use crate::study::Trend;

/// Fewer than the run has by far.
const KEPT: usize = 300;

/// A run of a thousand readings that are over in a moment: their noise is to be seen.
fn run(folder: &TempDir) -> VirtualRun {
    let plan = include_str!("../../examples/lambertian/plan.toml")
        .replace("theta_step_deg = 15", "theta_step_deg = 8")
        .replace("phi_step_deg = 30", "phi_step_deg = 15")
        .replace("dwell_ms = 50", "dwell_ms = 1");
    let texts = Texts {
        plan: &plan,
        rig: include_str!("../../examples/lambertian/rig.toml"),
        scene: include_str!("../../examples/lambertian/scene.toml"),
        attachments: &[],
    };
    VirtualRun::kept(texts.setup(1).unwrap(), &folder.path().join("run")).unwrap()
}

fn target(setup: &Setup, folder: &TempDir, kept_max: usize) -> Target {
    Target::new(setup, &folder.path().join("run").join(JOURNAL), kept_max)
}

fn shown(mut target: Target, readings: &[Reading]) -> Target {
    for reading in readings {
        target.take(reading);
    }
    target
}

fn assert_near(found: Trend, expected: Trend, part: f64) {
    for (found, expected) in
        [(found.lasting, expected.lasting), (found.independent, expected.independent)]
    {
        assert!((found / expected - 1.0).abs() < part, "{found} {expected}");
    }
}

#[test]
fn beyond_what_is_kept_a_run_is_said_to_be_as_accurate_as_by_all_its_readings() {
    let folder = TempDir::new().unwrap();
    let VirtualRun { setup, readings, rig_s } = run(&folder);
    assert!(readings.len() > 3 * KEPT, "{}", readings.len());
    let mut kept = shown(target(&setup, &folder, usize::MAX), &readings);
    let mut live = shown(target(&setup, &folder, KEPT), &readings);
    let whole = kept.trend(rig_s).unwrap();
    let found = live.trend(rig_s).unwrap();
    // Each reading went in once, and none is there any more.
    let is_target = |reading: &&Reading| matches!(reading.kind, ReadingKind::Target { .. });
    let targets = readings.iter().filter(is_target).count() as u64;
    let Form::Live(fit) = &live.form else { panic!("not live") };
    assert_eq!((fit.readings(), fit.waiting()), (targets, 0));
    // Early dark readings know their level a little less well.
    assert_near(found, whole, 0.02);
    let first = shown(target(&setup, &folder, usize::MAX), &readings[..KEPT]).trend(rig_s).unwrap();
    assert!(found.independent < 0.7 * first.independent, "{found:?} {first:?}");
}

#[test]
fn readings_that_do_not_determine_the_fit_yet_are_kept_for_longer() {
    let folder = TempDir::new().unwrap();
    let VirtualRun { setup, readings, rig_s } = run(&folder);
    let coefficients = setup.plan.fit.decided().unwrap().basis.len();
    let first = coefficients / 2;
    let early = shown(target(&setup, &folder, first), &readings[..=first]);
    assert!(matches!(&early.form, Form::Kept(kept) if kept.len() == first + 1));
    let mut late = shown(target(&setup, &folder, first), &readings);
    assert!(matches!(late.form, Form::Live(_)));
    let whole = shown(target(&setup, &folder, usize::MAX), &readings).trend(rig_s).unwrap();
    assert_near(late.trend(rig_s).unwrap(), whole, 0.1);
}

#[test]
fn what_first_readings_do_not_foretell_and_the_last_word_are_the_journals() {
    let folder = TempDir::new().unwrap();
    let VirtualRun { setup, mut readings, rig_s } = run(&folder);
    let mut enough = setup.clone();
    enough.plan.stop.exitance_relative = Some(0.5);
    let whole = shown(target(&enough, &folder, usize::MAX), &readings).trend(rig_s).unwrap();
    let mut live = shown(target(&enough, &folder, KEPT), &readings);
    assert_near(live.trend(rig_s).unwrap(), whole, 1e-3);
    assert!(matches!(live.form, Form::Live(_)));
    // Another session has home marks of its own.
    readings.last_mut().unwrap().session = 1;
    let is_target = |reading: &&mut Reading| matches!(reading.kind, ReadingKind::Target { .. });
    readings.iter_mut().rev().find(is_target).unwrap().session = 1;
    let mut other = shown(target(&setup, &folder, KEPT), &readings);
    assert_near(other.trend(rig_s).unwrap(), whole, 1e-3);
    assert!(matches!(other.form, Form::Journalled));
}
