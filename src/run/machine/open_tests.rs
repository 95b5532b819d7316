//! Runs that are decided upon on the way: rounds follow one another, and nothing is measured while
//! somebody thinks, whatever people and links do meanwhile.

use super::bench_tests::*;
use super::*;
use crate::plan::Step;
use crate::rig::ReadingKind;

/// Three targets and a reference reading, from an id on.
fn round(first: u32) -> Vec<Step> {
    let target = |id| step(id, ReadingKind::Target { index: id, repeat: 0 });
    (first..first + 3).map(target).chain([step(first + 3, ReadingKind::Reference)]).collect()
}

fn open(on_fault: OnFault) -> Bench {
    let program = Program { steps: round(0), is_open: true, ..Program::default() };
    let mut bench = Bench::new(program, on_fault);
    bench.settle();
    assert_eq!((bench.decisions, bench.outcome.as_ref(), bench.taken.len()), (1, None, 4));
    bench
}

fn ids(bench: &Bench) -> Vec<u32> {
    bench.taken.iter().map(|step| step.id).collect()
}

#[test]
fn rounds_follow_until_it_is_enough() {
    let mut bench = open(OnFault::Finish);
    assert_eq!(bench.machine.poll_timeout(), None);
    bench.tell(Input::Decided(round(4)));
    bench.settle();
    assert_eq!((bench.decisions, bench.machine.progress()), (2, (8, 8)));
    bench.tell(Input::Enough("met".into()));
    bench.settle();
    assert_eq!(bench.outcome, Some(Outcome::Reached("met".into())));
    assert!(ids(&bench).into_iter().eq(0..8) && !bench.states.contains(&State::Stopping));
}

#[test]
fn a_resumed_run_that_lacks_nothing_but_a_decision_asks_for_it() {
    let mut bench = Bench::new(Program { is_open: true, ..Program::default() }, OnFault::Finish);
    bench.settle();
    assert_eq!((bench.decisions, bench.outcome.as_ref()), (1, None));
    bench.tell(Input::Decided(round(4)));
    bench.settle();
    assert_eq!(ids(&bench), [4, 5, 6, 7]);
}

#[test]
fn a_pause_while_somebody_thinks_holds_until_continue() {
    let mut bench = open(OnFault::Wait);
    assert_eq!(bench.wish(Wish::Pause), Answer::Pausing);
    bench.settle();
    assert_eq!(bench.machine.state(), State::Paused);
    // To go on before the answer is there waits for the answer.
    bench.wish(Wish::Continue);
    bench.settle();
    assert_eq!((bench.machine.state(), bench.taken.len()), (State::Paused, 4));
    bench.tell(Input::Decided(round(4)));
    bench.settle();
    assert_eq!((bench.decisions, bench.taken.len()), (2, 8));
    // And the other way round.
    bench.wish(Wish::Pause);
    bench.settle();
    bench.tell(Input::Decided(round(8)));
    bench.settle();
    assert_eq!((bench.machine.state(), bench.taken.len()), (State::Paused, 8));
    bench.wish(Wish::Continue);
    bench.settle();
    assert_eq!(bench.taken.len(), 12);
}

#[test]
fn a_link_that_is_lost_while_somebody_thinks_costs_no_reading() {
    let mut bench = open(OnFault::Wait);
    bench.cut();
    bench.tell(Input::Decided(round(4)));
    bench.settle();
    assert_eq!((bench.machine.state(), bench.taken.len()), (State::Faulted, 4));
    bench.wish(Wish::Continue);
    bench.settle();
    assert!(ids(&bench).into_iter().eq(0..8) && bench.decisions == 2);
}

#[test]
fn a_rule_in_a_later_round_closes_as_that_round_closes() {
    let mut bench = open(OnFault::Finish);
    bench.tell(Input::Decided(round(4)));
    bench.step_until(State::Dwelling);
    bench.machine.conclude(NOW, "no time".into());
    bench.act();
    bench.settle();
    assert_eq!(bench.outcome, Some(Outcome::Reached("no time".into())));
    assert_eq!((bench.decisions, ids(&bench).last()), (1, Some(&7)));
}

#[test]
fn whoever_stops_while_somebody_thinks_ends_the_run() {
    for (wish, outcome) in [(Wish::Stop, Outcome::Stopped), (Wish::Abort, Outcome::Aborted)] {
        let mut bench = open(OnFault::Wait);
        bench.wish(wish);
        bench.settle();
        assert_eq!(bench.outcome, Some(outcome));
        bench.tell(Input::Decided(round(4)));
        bench.settle();
        assert_eq!(bench.taken.len(), 4);
    }
}
