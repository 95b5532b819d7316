//! How far a run says that it is, and when its time is up, in virtual time. Would break: an
//! estimate that stands still while the rig works, time that goes back, pauses that count as work.

use std::time::Duration;

use gonio::plan::{Prediction, Step, time_of};
use gonio::rig::{Latched, ReadingKind};
use gonio::run::{
    Decider, Fault, Happening, Job, OnFault, Outcome, Progress, Said, State, Watch, Wish,
};

use crate::bench::{Folder, device, owner, rig, steps, wait_for_readings, wait_for_state};

/// Ten targets of five seconds each, then the reference pose.
fn long_steps() -> Vec<Step> {
    let mut steps = steps(10);
    for step in &mut steps {
        step.dwell = Duration::from_secs(5);
    }
    steps.push(Step { id: 10, kind: ReadingKind::Reference, ..steps[0] });
    steps
}

#[tokio::test(start_paused = true)]
async fn time_passes_second_by_second_and_what_is_left_adds_up() {
    let (folder, steps) = (Folder::new(), long_steps());
    let owner = owner(device(sim::LinkFaults::default()).opener());
    let mut events = owner.subscribe();
    let before = owner.status().progress;
    assert_eq!(before, Progress::default());
    let job = Job::new(steps.clone(), OnFault::Finish);
    let running = owner.start(job, folder.journal(&steps)).await.unwrap();
    let ended = running.ended().await.unwrap();

    let (mut told, mut last_end_s) = (Vec::new(), 0.0_f64);
    while let Ok(event) = events.try_recv() {
        match event.happening {
            Happening::Progress(progress) => told.push(progress),
            Happening::Reading(reading) => last_end_s = reading.end_us as f64 * 1e-6,
            _ => {}
        }
    }
    let homing_s = Prediction::homing_s_of(&rig());
    assert!((told[0].rest_s - homing_s - ended.rig_s).abs() < 1.0, "{:?}", told[0]);
    for pair in told.windows(2) {
        let passed_s = pair[1].rig_s - pair[0].rig_s;
        assert!((0.0..1.01).contains(&passed_s), "{pair:?}");
    }
    // This rig homes in no time at all; from then on it is known when the run will end.
    for progress in told.iter().filter(|progress| progress.rig_s > 0.5) {
        let end_s = progress.rig_s + progress.rest_s;
        assert!((end_s / ended.rig_s - 1.0).abs() < 0.01, "{progress:?}, took {} s", ended.rig_s);
    }
    assert!(told.len() > 50 && told.last().unwrap().rest_s < 0.1);
    assert!(ended.rig_s >= last_end_s && ended.rig_s < last_end_s + 0.1);
}

#[tokio::test(start_paused = true)]
async fn a_pause_is_not_time_that_the_rig_works() {
    let (folder, steps) = (Folder::new(), long_steps());
    let owner = owner(device(sim::LinkFaults::default()).opener());
    let mut events = owner.subscribe();
    let mut job = Job::new(steps.clone(), OnFault::Wait);
    job.rig_time_max = Some(Duration::from_secs(80));
    let running = owner.start(job, folder.journal(&steps)).await.unwrap();
    wait_for_readings(&mut events, 2).await;
    owner.wish(Wish::Pause).await;
    wait_for_state(&mut events, State::Paused).await;
    tokio::time::sleep(Duration::from_hours(10)).await;
    owner.wish(Wish::Continue).await;
    let ended = running.ended().await.unwrap();
    assert_eq!((ended.outcome, ended.done), (Outcome::Complete, 11));
    assert!(ended.rig_s > 36_000.0, "on the run's clock it was there all the time");
}

#[tokio::test(start_paused = true)]
async fn a_rule_sees_every_reading_and_leaves_what_the_plan_closes_with() {
    let (folder, steps) = (Folder::new(), long_steps());
    let owner = owner(device(sim::LinkFaults::default()).opener());
    let mut job = Job::new(steps.clone(), OnFault::Finish);
    let mut seen = 0;
    job.rule = Some(Watch::inline(Box::new(move |reading| {
        assert_eq!(reading.id, seen);
        seen += 1;
        match seen {
            2 => Said::SoFar("two".to_owned()),
            3 => Said::Enough("three".to_owned()),
            _ => Said::Nothing,
        }
    })));
    let mut events = owner.subscribe();
    let running = owner.start(job, folder.journal(&steps)).await.unwrap();
    let ended = running.ended().await.unwrap();
    assert_eq!(ended.outcome, Outcome::Reached("three".into()));
    let told = std::iter::from_fn(|| events.try_recv().ok());
    let accuracies = told.filter(|event| event.happening == Happening::Accuracy("two".into()));
    assert_eq!(accuracies.count(), 1);
    let reader = gonio::journal::Reader::open(&folder.path()).unwrap();
    drop(ended.journal);
    let readings = reader.readings(gonio::journal::Order::Taken).unwrap();
    let ids: Vec<_> = readings.iter().map(|reading| reading.id).collect();
    assert!((4..9).contains(&ids.len()), "{ids:?}");
    assert_eq!(ids.last(), Some(&10));
    assert_eq!(gonio::run::resume::rule_met(&reader.sessions().unwrap()), Some("three".into()));
}

#[tokio::test(start_paused = true)]
async fn what_the_plan_closes_with_is_counted_once_when_time_runs_out() {
    let steps = long_steps();
    // This rig homes in no time at all.
    let whole_s = time_of(&rig(), Latched::ZERO, &steps);
    // Room for all, though not for a second closing reading; and for all targets but the last.
    for (room_s, expected, done) in [(2.0, "complete", 11), (-4.0, "reached", 10)] {
        let folder = Folder::new();
        let owner = owner(device(sim::LinkFaults::default()).opener());
        let mut job = Job::new(steps.clone(), OnFault::Finish);
        let most_s = whole_s + room_s;
        job.rig_time_max = Some(Duration::from_secs_f64(most_s));
        let running = owner.start(job, folder.journal(&steps)).await.unwrap();
        let ended = running.ended().await.unwrap();
        assert_eq!((ended.outcome.name(), ended.done), (expected, done), "{room_s} s");
        assert!(ended.rig_s <= most_s + 1.0, "{} s of {most_s} s", ended.rig_s);
    }
}

#[tokio::test(start_paused = true)]
async fn a_run_that_nobody_decides_for_is_not_at_its_end() {
    for on_fault in [OnFault::Finish, OnFault::Wait] {
        let (folder, steps) = (Folder::new(), steps(5));
        let owner = owner(device(sim::LinkFaults::default()).opener());
        let mut job = Job::new(steps.clone(), on_fault);
        job.decider = Some(Decider::inline(Box::new(|_| Err("no more ideas".to_owned()))));
        let running = owner.start(job, folder.journal(&steps)).await.unwrap();
        let ended = running.ended().await.unwrap();
        let fault = Fault::Undecided("no more ideas".to_owned());
        assert_eq!((ended.outcome, ended.done), (Outcome::Faulted(fault), 5));
        drop(ended.journal);
        // A resume asks somebody else.
        let reader = gonio::journal::Reader::open(&folder.path()).unwrap();
        assert_eq!(gonio::run::resume::rule_met(&reader.sessions().unwrap()), None);
        assert!(reader.rounds().unwrap().is_empty());
    }
}
