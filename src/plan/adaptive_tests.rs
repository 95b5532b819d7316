//! What could break: a first round with a gap that a declared feature fits in, a place without
//! sweeps, names used twice, sweeps that a rig can't fly, terms that contradict each other.

use std::collections::BTreeSet;
use std::time::Duration;

use firmware_protocol::Shutter;
use spanned_toml::{Document, Problem, Source};

use super::*;
use crate::rig::{Approach, ReadingKind, Rig};

fn read(schedule: &str, stop: &str) -> Result<Plan, Problem> {
    let text = format!(
        "[region]\nx_mm = [-10, 10]\ny_mm = [-5, 5]\ntheta_max_deg = 80\n\
         [schedule]\nkind = \"adaptive\"\n{schedule}\n[dwell]\ndwell_ms = 25\n\
         [dark]\nmethod = \"shutter\"\n{stop}\n"
    );
    Plan::read(Document::parse(Source::new("plan.toml", &text))?)
}

const SCHEDULE: &str =
    "x_count = 3\ny_count = 2\nnarrowest_feature_deg = 12\nradiance_relative = 0.02";
const STOP: &str = "[stop]\nrig_time_s_max = 900";

fn plan() -> Plan {
    read(SCHEDULE, STOP).unwrap()
}

fn rig() -> Rig {
    Rig::built_in().unwrap()
}

/// Azimuths (of the positive side) and places of the sweeps, in counts.
fn sweeps(steps: &[Step]) -> Vec<[i32; 3]> {
    let first = |step: &&Step| step.swept.is_some_and(|swept| swept.first == step.id);
    let counts = |step: &Step| [step.counts.0[1], step.counts.0[2], step.counts.0[3]];
    steps.iter().filter(first).map(counts).collect()
}

#[test]
fn the_first_round_leaves_no_gap_as_wide_as_the_narrowest_feature() {
    let (plan, rig) = (plan(), rig());
    let sequence = plan.lay_out(&rig, None).unwrap();
    let mut phis: Vec<f64> = sweeps(&sequence.steps)
        .iter()
        .map(|counts| rig.axes[1].position(f64::from(counts[0])).to_degrees().rem_euclid(180.0))
        .collect();
    phis.sort_by(f64::total_cmp);
    let around = phis[0] + 180.0 - phis[phis.len() - 1];
    let widest = phis.windows(2).map(|pair| pair[1] - pair[0]).fold(around, f64::max);
    assert!(widest * 80_f64.to_radians().sin() <= 12.01, "{widest}");
    let arc_deg = plan.adaptive().unwrap().arc_rad(&plan, &rig).to_degrees();
    assert!(arc_deg <= 12.0 && arc_deg > 10.0, "{arc_deg}");
    // Fifteen meridians on six places, and four checks each at its own.
    let places: BTreeSet<[i32; 2]> =
        sweeps(&sequence.steps).iter().map(|counts| [counts[1], counts[2]]).collect();
    assert_eq!((phis.len(), places.len()), (19, 10));
    // It begins and ends with readings of its own.
    let kinds: Vec<ReadingKind> = sequence.steps.iter().map(|step| step.kind).collect();
    assert_eq!(kinds[..2], [ReadingKind::Dark, ReadingKind::Reference]);
    assert_eq!(closing(&sequence.steps).len(), 2);
    assert_eq!(sequence.steps.len(), kinds.len());
}

#[test]
fn rounds_follow_with_names_of_their_own_and_come_back_from_their_steps() {
    let (plan, rig) = (plan(), rig());
    let sequence = plan.lay_out(&rig, None).unwrap();
    let adaptive = plan.adaptive().unwrap();
    let wanted: Vec<Meridian> = (0..9)
        .map(|i| {
            let whole = adaptive.candidate(&plan, &rig, i);
            let theta_rad = if i % 2 == 0 { (0.3, 0.8) } else { whole.theta_rad };
            Meridian { theta_rad, ..whole }
        })
        .collect();
    let after = After::steps(&rig, &sequence.steps);
    let round = plan.lay_out_round(&rig, after, &Further::Sweeps(wanted.clone())).unwrap();
    let steps = [sequence.steps.clone(), round.steps.clone()].concat();
    assert!(steps.iter().enumerate().all(|(i, step)| step.id as usize == i));
    let all = sequence.with_steps(&rig, steps.clone());
    assert!(all.targets.iter().enumerate().all(|(i, target)| target.index as usize == i));
    assert_eq!(all.targets[..sequence.targets.len()], sequence.targets);
    // Short sweeps look where they were wanted, on their own side of the zenith.
    let short = &wanted[0];
    let (_, azimuth) = short.direction(0.5);
    let of_short = |target: &&Target| (target.pose.x_m - short.x_m).abs() < 1e-5;
    let seen: Vec<_> = all.targets.iter().filter(of_short).collect();
    assert!(seen.len() > 3);
    for target in seen {
        assert!((0.29..0.81).contains(&target.pose.theta_rad), "{target:?}");
        assert!(libm::cos(target.pose.phi_rad - azimuth) > 0.999_99, "{target:?}");
    }
    // Its time is what the whole takes longer.
    let longer = all.prediction.total_s() - sequence.prediction.total_s();
    assert!((round.seconds - longer).abs() < 1e-6, "{} {longer}", round.seconds);
}

#[test]
fn sweeps_go_from_one_to_the_nearest_and_play_is_respected() {
    let (plan, mut rig) = (plan(), rig());
    let adaptive = *plan.adaptive().unwrap();
    let wanted: Vec<Meridian> = (0..24).map(|i| adaptive.candidate(&plan, &rig, i)).collect();
    let after = After { step: 7, target: 0, here: crate::rig::Latched::ZERO };
    let all = Further::Sweeps(wanted.clone());
    let seconds = |rig: &Rig| plan.lay_out_round(rig, after, &all).unwrap().seconds;
    let alone: f64 = wanted
        .iter()
        .map(|meridian| {
            let one = Further::Sweeps(vec![*meridian]);
            plan.lay_out_round(&rig, after, &one).unwrap().seconds
        })
        .sum();
    let both_ways = seconds(&rig);
    assert!(both_ways < 0.7 * alone, "{both_ways} s, one by one {alone} s");
    rig.axes[0].approach = Approach::Positive;
    rig.axes[0].run_up = 0.01;
    assert!(seconds(&rig) > both_ways);
    let steps = plan.lay_out_round(&rig, after, &all).unwrap().steps;
    assert!(steps.iter().filter_map(|step| step.swept).all(|swept| swept.travel.0[0] > 0));
}

#[test]
fn paces_to_choose_from_are_as_fast_as_anything_bears_or_slower() {
    let rig = rig();
    // 12 degrees bear windows of 2.4 degrees: the axis limits those of 25 ms already, and twice as long
    // ones are nearly as fast.
    let paces = plan().sweep_paces(&rig).unwrap();
    let ms: Vec<u128> = paces.iter().map(|pace| pace.window.as_millis()).collect();
    assert_eq!(ms, [25, 50, 100, 200, 400, 800]);
    assert!(paces.windows(2).all(|pair| pair[1].slower_than(&pair[0]) > 1.1), "{paces:?}");
    // Narrower ones bear less: the axis could do it faster, and does with shorter windows.
    let fine = read(&SCHEDULE.replace("= 12", "= 6"), STOP).unwrap();
    let paces = fine.sweep_paces(&rig).unwrap();
    assert_eq!(paces[0].window.as_millis(), 25);
    assert_eq!(paces[1].window.as_millis(), 21, "{paces:?}");
    assert!(paces[1].slower_than(&paces[0]) < 0.95, "{paces:?}");
    assert!((paces[2].slower_than(&paces[0]) - 2.0).abs() < 0.01, "{paces:?}");
}

#[test]
fn an_arm_that_does_not_reach_over_flies_on_one_side() {
    let (plan, mut rig) = (plan(), rig());
    rig.axes[0].travel.0 = -0.1;
    let sequence = plan.lay_out(&rig, None).unwrap();
    assert!(sequence.targets.iter().all(|target| target.positions.0[0] >= 0.0));
    assert_eq!(sweeps(&sequence.steps).len(), 30 + 4);
}

#[test]
fn what_contradicts_itself_is_refused_with_its_key() {
    let terms = |from: &str, to: &str| SCHEDULE.replace(from, to);
    for (schedule, stop, key, what) in [
        (terms("0.02", "0"), STOP, "radiance_relative", "0"),
        (terms("\nradiance_relative = 0.02", ""), STOP, "radiance_relative", "enough"),
        (terms("12", "0"), STOP, "narrowest_feature_deg", "0"),
        (terms("x_count = 3", "x_count = 0"), STOP, "x_count", "0"),
        (terms("x_count = 3", "x_count = 3\nrepeat = 2"), STOP, "repeat", "repeat"),
        (terms("x_count = 3", "x_count = 3\norder = \"travel\""), STOP, "order", "order"),
        (SCHEDULE.to_owned(), "", "stop", "limit of time"),
        (SCHEDULE.to_owned(), "[stop]", "rig_time_s_max", "limit of time"),
        (SCHEDULE.to_owned(), "[stop]\nrig_time_s_max = 0", "rig_time_s_max", "0"),
        (
            SCHEDULE.to_owned(),
            "[stop]\nrig_time_s_max = 900\nexitance_relative = 0.01",
            "exitance_relative",
            "own targets",
        ),
    ] {
        let problem = read(&schedule, stop).unwrap_err().to_string();
        assert!(problem.contains(key) && problem.contains(what), "{problem}");
    }
    for (schedule, key, sweeps) in [
        (
            terms("x_count = 3", "x_count = 64").replace("y_count = 2", "y_count = 64"),
            "x_count",
            9216,
        ),
        (terms("12", "0.5"), "narrowest_feature_deg", 399),
        (format!("{SCHEDULE}\nphi_step_deg = 0.5"), "phi_step_deg", 405),
    ] {
        let problem = read(&schedule, STOP).unwrap().lay_out(&rig(), None).unwrap_err().to_string();
        let said = format!("{sweeps} sweeps");
        assert!(problem.contains(key) && problem.contains(&said), "{problem}");
        assert!(problem.contains("at most 300"), "{problem}");
    }
    let short = read(SCHEDULE, "[stop]\nrig_time_s_max = 30").unwrap();
    let problem = short.lay_out(&rig(), None).unwrap_err().to_string();
    assert!(problem.contains("rig_time_s_max") && problem.contains("first round"), "{problem}");
}

#[test]
fn a_round_may_be_a_dark_reading_where_the_axes_stand() {
    let (plan, rig) = (plan(), rig());
    let sequence = plan.lay_out(&rig, None).unwrap();
    let after = After::steps(&rig, &sequence.steps);
    let dwell = Duration::from_millis(7_500);
    let round = plan.lay_out_round(&rig, after, &Further::Dark(dwell)).unwrap();
    let [step] = round.steps[..] else { panic!("{:?}", round.steps) };
    assert_eq!((step.id, step.dwell, step.counts), (after.step, dwell, after.here));
    assert_eq!((step.kind, step.shutter), (ReadingKind::Dark, Shutter::Closed));
    // Nothing moves.
    assert!((7.5..7.6).contains(&round.seconds), "{}", round.seconds);
}
