//! The machine against a scripted device: whatever is asked in whatever order, each reading is
//! taken over once, at its own pose, and nothing moves when the run is over.

use proptest::prelude::*;

use super::bench_tests::*;
use super::*;
use crate::plan::{RESUME_IDS_FROM, Step, WARM_UP_IDS_FROM, WarmUp};
use crate::rig::ReadingKind;

fn plain(n: u32) -> Program {
    Program { steps: steps(n), ..Program::default() }
}

#[test]
fn a_run_homes_then_takes_every_reading_in_order() {
    let mut bench = Bench::new(plain(20), OnFault::Finish);
    bench.settle();
    assert_eq!(bench.outcome, Some(Outcome::Complete));
    assert_eq!(bench.taken, steps(20));
    assert_eq!(bench.states[0], State::Homing);
    assert_eq!(bench.states.last(), Some(&State::Done));
    assert_eq!(bench.machine.progress(), (20, 20));
    assert!(bench.states.contains(&State::Moving) && bench.states.contains(&State::Settling));
}

#[test]
fn commands_are_queued_several_ahead_but_never_beyond_the_queue() {
    let mut bench = Bench::new(plain(50), OnFault::Finish);
    bench.step_until(State::Moving);
    while !bench.device.downward.is_empty() {
        bench.device.hear(false);
    }
    assert!((4..=QUEUE_DEPTH).contains(&bench.device.queue.len()), "{:?}", bench.device.queue);
}

#[test]
fn an_empty_program_is_complete_after_homing() {
    let mut bench = Bench::new(plain(0), OnFault::Finish);
    bench.settle();
    assert_eq!(bench.outcome, Some(Outcome::Complete));
}

#[test]
fn a_pause_finishes_the_dwell_that_runs_and_leaves_no_timer() {
    let mut bench = Bench::new(plain(20), OnFault::Wait);
    bench.step_until(State::Settling);
    let had = bench.taken.len();
    assert_eq!(bench.wish(Wish::Pause), Answer::Pausing);
    assert_eq!(bench.wish(Wish::Pause), Answer::Pausing);
    bench.settle();
    assert_eq!(bench.machine.state(), State::Paused);
    assert_eq!(bench.machine.poll_timeout(), None);
    assert_eq!(bench.taken.len(), had + 1);
    assert_eq!(bench.wish(Wish::Pause), Answer::Paused);
    assert_eq!(bench.wish(Wish::Continue), Answer::Continuing);
    assert_eq!(bench.states.iter().filter(|state| **state == State::Homing).count(), 1);
    bench.settle();
    assert_eq!(bench.outcome, Some(Outcome::Complete));
    assert_eq!(bench.wish(Wish::Abort), Answer::Over);
}

#[test]
fn a_limit_switch_faults_and_continuing_homes_again() {
    let mut bench = Bench::new(plain(20), OnFault::Wait);
    bench.step_until(State::Dwelling);
    bench.device.stop(Cause::LimitSwitch(2));
    bench.settle();
    assert_eq!(bench.machine.fault(), Some(&Fault::Device(Cause::LimitSwitch(2))));
    assert!(!bench.machine.position().is_trusted());
    assert_eq!(bench.wish(Wish::ClearFault), Answer::Clearing);
    bench.settle();
    assert_eq!(bench.machine.state(), State::Paused);
    bench.wish(Wish::Continue);
    bench.settle();
    assert_eq!(bench.states.iter().filter(|state| **state == State::Homing).count(), 2);
    assert_eq!((bench.outcome, bench.taken.len()), (Some(Outcome::Complete), 20));
}

#[test]
fn a_fault_ends_a_run_that_nobody_watches() {
    let mut bench = Bench::new(plain(20), OnFault::Finish);
    bench.step_until(State::Dwelling);
    bench.device.stop(Cause::Detector);
    bench.settle();
    let fault = Fault::Device(Cause::Detector);
    assert_eq!(bench.outcome, Some(Outcome::Faulted(fault)));
}

#[test]
fn what_an_earlier_run_ended_in_is_cleared_by_whoever_starts_one_by_hand_alone() {
    let latched = || Device { boot_id: 1, latched: Some(Cause::Stalled(1)), ..Device::default() };
    let mut by_hand = Bench::on(latched(), plain(20), OnFault::Finish);
    by_hand.settle();
    assert_eq!((by_hand.outcome, by_hand.taken.len()), (Some(Outcome::Complete), 20));
    let mut queued = Bench::on(latched(), plain(20), OnFault::Wait);
    queued.settle();
    assert_eq!(queued.machine.fault(), Some(&Fault::Device(Cause::Stalled(1))));
    assert!(!queued.device.has_moved);
}

#[test]
fn a_lost_link_never_moves_by_itself_and_trust_depends_on_the_boot() {
    for restarts in [false, true] {
        let mut bench = Bench::new(plain(20), OnFault::Wait);
        bench.step_until(State::Dwelling);
        bench.cut();
        assert_eq!(bench.machine.state(), State::Faulted);
        assert!(!bench.machine.position().is_trusted());
        if restarts {
            bench.device.restart();
        }
        bench.settle();
        assert_eq!(bench.machine.state(), State::Faulted);
        assert_eq!(bench.wish(Wish::Continue), Answer::Reconnecting);
        bench.settle();
        let homings = bench.states.iter().filter(|state| **state == State::Homing).count();
        assert_eq!(homings, if restarts { 2 } else { 1 });
        assert_eq!((bench.outcome, bench.taken.len()), (Some(Outcome::Complete), 20));
    }
}

#[test]
fn checks_are_judged_before_any_step() {
    let check = step(RESUME_IDS_FROM, ReadingKind::Reference);
    let mut bench = Bench::new(Program { checks: vec![check], ..plain(3) }, OnFault::Finish);
    bench.settle();
    assert_eq!(bench.taken[0], check);
    assert_eq!((bench.outcome, bench.taken.len()), (Some(Outcome::Complete), 4));
}

#[test]
fn a_reference_that_moved_stops_the_run_and_continue_accepts_it() {
    let check = step(RESUME_IDS_FROM, ReadingKind::Reference);
    let mut bench = Bench::new(Program { checks: vec![check], ..plain(3) }, OnFault::Wait);
    bench.verdict = Err("it moved".into());
    bench.settle();
    assert_eq!(bench.machine.fault(), Some(&Fault::ReferenceMoved("it moved".into())));
    bench.wish(Wish::Continue);
    bench.settle();
    assert_eq!((bench.outcome, bench.taken.len()), (Some(Outcome::Complete), 4));
}

#[test]
fn warming_up_ends_when_stable_and_is_no_step() {
    let asked = WarmUp {
        tolerance_relative: 0.01,
        over: Duration::from_secs(1),
        timeout: Duration::from_secs(10),
    };
    let template = step(WARM_UP_IDS_FROM, ReadingKind::WarmUp);
    let mut bench =
        Bench::new(Program { warm_up: Some((asked, template, 5)), ..plain(3) }, OnFault::Finish);
    bench.settle();
    let warm_ups = bench.taken.iter().filter(|step| step.kind == ReadingKind::WarmUp);
    assert!(warm_ups.clone().count() >= 10);
    assert!(warm_ups.clone().all(|step| step.id >= WARM_UP_IDS_FROM + 5));
    assert_eq!((bench.outcome, bench.machine.progress()), (Some(Outcome::Complete), (3, 3)));
}

#[test]
fn a_dark_with_the_source_off_asks_and_waits() {
    let mut program = plain(3);
    program.steps[1].source_off = true;
    let mut bench = Bench::new(program, OnFault::Finish);
    bench.settle();
    assert_eq!((bench.machine.state(), bench.asked.clone()), (State::Paused, vec![Source::Off]));
    bench.wish(Wish::Continue);
    bench.settle();
    assert_eq!(
        (bench.machine.state(), bench.asked.clone()),
        (State::Paused, vec![Source::Off, Source::On])
    );
    bench.wish(Wish::Continue);
    bench.settle();
    assert_eq!(bench.outcome, Some(Outcome::Complete));
}

/// Twenty targets, then the reference pose and a dark reading.
fn closed(source_off: bool) -> Program {
    let mut program = plain(20);
    program.steps.push(step(20, ReadingKind::Reference));
    program.steps.push(Step { source_off, ..step(21, ReadingKind::Dark) });
    program
}

#[test]
fn a_rule_ends_the_targets_and_the_run_closes_without_a_stop() {
    for source_off in [false, true] {
        let mut bench = Bench::new(closed(source_off), OnFault::Finish);
        bench.step_until(State::Dwelling);
        bench.machine.conclude(NOW, "enough".into());
        bench.machine.conclude(NOW, "and again".into());
        bench.act();
        bench.settle();
        assert_eq!(bench.outcome, Some(Outcome::Reached("enough".into())));
        let mut ids: Vec<_> = bench.taken.iter().map(|step| step.id).collect();
        let closing: &[u32] = if source_off { &[20] } else { &[20, 21] };
        let at = ids.len() - closing.len();
        assert_eq!(ids.split_off(at), closing);
        // Those that the device had in its queue, and no more.
        assert!(ids.len() < 8 && ids.iter().copied().eq((0..20).take(ids.len())), "{ids:?}");
        assert!(!bench.states.contains(&State::Stopping) && bench.asked.is_empty());
    }
}

#[test]
fn a_fault_after_a_rule_brings_no_target_back() {
    let mut bench = Bench::new(closed(false), OnFault::Wait);
    bench.step_until(State::Dwelling);
    bench.machine.conclude(NOW, "enough".into());
    bench.act();
    bench.cut();
    let had = bench.taken.len();
    bench.wish(Wish::Continue);
    bench.settle();
    assert_eq!(bench.outcome, Some(Outcome::Reached("enough".into())));
    let after: Vec<_> = bench.taken[had..].iter().map(|step| step.id).collect();
    assert_eq!(after, [20, 21]);
}

#[test]
fn a_rule_that_is_met_before_the_first_step_ends_the_run_at_rest() {
    let check = step(RESUME_IDS_FROM, ReadingKind::Reference);
    let mut bench = Bench::new(Program { checks: vec![check], ..closed(false) }, OnFault::Wait);
    bench.step_until(State::Homing);
    bench.machine.conclude(NOW, "no time".into());
    bench.act();
    bench.settle();
    assert_eq!(bench.outcome, Some(Outcome::Reached("no time".into())));
    assert!(bench.device.queue.is_empty() && bench.taken.is_empty());
}

#[test]
fn a_full_queue_is_waited_for_and_voids_what_came_after() {
    let mut bench = Bench::new(plain(20), OnFault::Finish);
    bench.step_until(State::Moving);
    // The device refuses a move, but takes the dwell behind it.
    let at = bench.device.downward.iter().position(|r| matches!(r, Request::MoveTo(_))).unwrap();
    let refused = id_of(&bench.device.downward.remove(at).unwrap());
    bench.device.upward.push_back(Input::Rejected(refused, Rejection::QueueFull));
    bench.settle();
    assert_eq!(bench.taken, steps(20));
    assert_eq!(bench.outcome, Some(Outcome::Complete));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn every_reading_is_taken_once_whatever_happens(deeds in prop::collection::vec(0_u8..100, 1..400)) {
        let mut bench = Bench::new(plain(12), OnFault::Wait);
        for deed in deeds {
            if bench.outcome.is_some() {
                break;
            }
            match deed {
                0..30 => bench.device.hear(deed % 2 == 0),
                30..60 => bench.deliver(),
                60..82 => bench.device.work(),
                86..89 => { bench.wish(Wish::Pause); }
                89..93 => { bench.wish(Wish::Continue); }
                93 => { bench.wish(Wish::ClearFault); }
                94 => bench.device.stop(Cause::Stalled(1)),
                95 => bench.device.stop(Cause::LeaseExpired),
                96 if bench.is_linked => bench.cut(),
                97 if bench.is_linked => { bench.device.restart(); bench.is_linked = false; bench.tell(Input::Fault(Fault::Restarted)); }
                98 if bench.reconnects > 0 => {
                    bench.reconnects = 0;
                    bench.is_linked = true;
                    let connected = bench.device.identify();
                    bench.tell(Input::Connected(connected));
                }
                _ => bench.time_out(),
            }
        }
        for _ in 0..100 {
            bench.settle();
            if bench.outcome.is_some() {
                break;
            }
            bench.wish(Wish::Continue);
        }
        prop_assert_eq!(bench.outcome, Some(Outcome::Complete));
        let mut ids: Vec<_> = bench.taken.iter().map(|step| step.id).collect();
        ids.sort_unstable();
        prop_assert_eq!(ids, (0..12).collect::<Vec<_>>());
    }

    #[test]
    fn every_end_leaves_the_axes_at_rest(deeds in prop::collection::vec(0_u8..90, 1..300), at_once: bool) {
        let mut bench = Bench::new(plain(12), OnFault::Finish);
        for deed in deeds {
            match deed {
                0..30 => bench.device.hear(deed % 2 == 0),
                30..60 => bench.deliver(),
                60..80 => bench.device.work(),
                80 => bench.device.stop(Cause::Stalled(1)),
                81 => { bench.wish(Wish::Pause); }
                82 => { bench.wish(Wish::Continue); }
                _ => bench.time_out(),
            }
        }
        bench.wish(if at_once { Wish::Abort } else { Wish::Stop });
        bench.settle();
        prop_assert!(bench.outcome.is_some());
        prop_assert!(bench.device.queue.is_empty() && bench.device.downward.is_empty());
    }
}
