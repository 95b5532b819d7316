//! What could break: a window measured twice or never, whatever is lost, stopped or resumed on the
//! way; a device that can't sweep.

use super::bench_tests::*;
use super::*;
use crate::plan::{Step, Swept, WARM_UP_IDS_FROM};
use crate::rig::ReadingKind;

/// Three sweeps of ten windows with a reading at rest between them.
fn swept_steps() -> Vec<Step> {
    let mut steps = Vec::new();
    for sweep in 0..3_u32 {
        let first = sweep * 11;
        for id in first..first + 10 {
            let kind = ReadingKind::Target { index: id, repeat: 0 };
            let travel = Latched([100, 0, 0, 0]);
            let lead = Duration::from_millis(10);
            steps.push(Step {
                counts: Latched([100 * i32::try_from(id - first).unwrap(), 7, 10, 20]),
                dwell: Duration::from_millis(25),
                swept: Some(Swept { first, count: 10, travel, lead }),
                ..step(id, kind)
            });
        }
        steps.push(step(first + 10, ReadingKind::Reference));
    }
    steps
}

fn bench(steps: Vec<Step>, windows: u16, lost: &[u32]) -> Bench {
    let program = Program { steps, ..Program::default() };
    let mut bench = Bench::new(program, OnFault::Wait);
    bench.device.windows = windows;
    bench.device.lost = lost.to_vec();
    let connected = bench.device.identify();
    bench.tell(Input::Connected(connected));
    bench
}

fn all_taken(bench: &Bench) {
    assert_eq!(bench.outcome, Some(Outcome::Complete));
    let mut ids: Vec<u32> = bench.taken.iter().map(|step| step.id).collect();
    ids.sort_unstable();
    assert_eq!(ids, (0..33).collect::<Vec<_>>());
    assert!(ids.iter().all(|id| *id < WARM_UP_IDS_FROM));
}

#[test]
fn windows_are_taken_once_in_as_few_sweeps_as_the_device_allows() {
    for (windows, sweeps) in [(512, 3), (10, 3), (4, 9)] {
        let mut bench = bench(swept_steps(), windows, &[]);
        bench.settle();
        all_taken(&bench);
        assert_eq!(bench.device.sweeps, sweeps);
        assert!(bench.device.kept.is_empty(), "every sweep was acknowledged");
    }
}

#[test]
fn a_device_that_cant_sweep_measures_at_rest_in_the_middle() {
    let mut bench = bench(swept_steps(), 0, &[]);
    bench.settle();
    all_taken(&bench);
    assert_eq!(bench.device.sweeps, 0);
    let third = bench.taken.iter().find(|step| step.id == 2).unwrap();
    assert_eq!((third.counts, third.swept), (Latched([250, 7, 10, 20]), None));
}

#[test]
fn lost_windows_are_fetched_and_not_flown_again() {
    let mut bench = bench(swept_steps(), 512, &[0, 3, 4, 9, 20, 31]);
    bench.settle();
    all_taken(&bench);
    assert_eq!(bench.device.sweeps, 3);
}

#[test]
fn what_a_broken_sweep_lacks_is_flown_again_and_nothing_else() {
    for cut_after in 1..9_usize {
        let mut bench = bench(swept_steps(), 512, &[]);
        while bench.taken.len() < cut_after {
            bench.device.hear(false);
            bench.deliver();
            if bench.device.downward.is_empty() && bench.device.upward.is_empty() {
                bench.device.work();
            }
        }
        bench.cut();
        assert_eq!(bench.machine.state(), State::Faulted);
        bench.wish(Wish::Continue);
        bench.settle();
        all_taken(&bench);
        let again: Vec<u32> = bench.taken[cut_after..cut_after + 2].iter().map(|s| s.id).collect();
        let next = u32::try_from(cut_after).unwrap();
        assert_eq!(again, [next, next + 1]);
    }
}

#[test]
fn a_resume_flies_the_gaps_of_a_sweep_apart() {
    let had = [0, 1, 4, 5, 13, 32];
    let steps: Vec<Step> =
        swept_steps().into_iter().filter(|step| !had.contains(&step.id)).collect();
    let mut bench = bench(steps, 512, &[]);
    bench.settle();
    assert_eq!(bench.outcome, Some(Outcome::Complete));
    assert_eq!(bench.taken.len(), 33 - had.len());
    // 2-3 and 6-9; 11-12 and 14-20; 22-31.
    assert_eq!(bench.device.sweeps, 5);
}

#[test]
fn a_pause_waits_for_the_sweep_that_runs_and_goes_on_with_the_next() {
    let mut bench = bench(swept_steps(), 512, &[]);
    bench.step_until(State::Dwelling);
    bench.wish(Wish::Pause);
    bench.settle();
    assert_eq!(bench.machine.state(), State::Paused);
    let taken = bench.taken.len();
    assert!((10..33).contains(&taken), "{taken}");
    bench.wish(Wish::Continue);
    bench.settle();
    all_taken(&bench);
}
