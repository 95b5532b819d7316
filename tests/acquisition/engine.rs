//! Runs over the whole road in virtual time. Would break: an idle device between steps, a reading
//! lost or taken twice around a pause, a cut link, a restart or lost frames; motion that goes on
//! by itself; axes left moving.

use std::time::Duration;

use gonio::journal::{Order, Reader};
use gonio::plan::StepTime;
use gonio::rig::{Latched, Reading};
use gonio::run::{Answer, Doubt, Fault, Happening, Job, OnFault, Outcome, Position, State, Wish};

use crate::bench::{
    Folder, device, owner, rig, steps, wait_for, wait_for_readings, wait_for_state,
};
use crate::board::counts_of;

fn readings(folder: &Folder) -> Vec<Reading> {
    Reader::open(&folder.path()).unwrap().readings(Order::Id).unwrap()
}

fn assert_whole(folder: &Folder, count: u32) {
    let readings = readings(folder);
    let ids: Vec<_> = readings.iter().map(|reading| reading.id).collect();
    assert_eq!(ids, (0..count).collect::<Vec<_>>());
    for (reading, step) in readings.iter().zip(steps(count)) {
        assert_eq!(reading.commanded, step.counts);
        assert_eq!((reading.start, reading.end), (step.counts, step.counts));
        assert!((reading.mean - f64::from(counts_of(step.id))).abs() < 1e-9);
        assert!(!reading.unsettled);
    }
}

#[tokio::test(start_paused = true)]
async fn a_run_takes_little_more_than_moving_settling_and_dwelling() {
    let (folder, steps) = (Folder::new(), steps(200));
    let owner = owner(device(sim::LinkFaults::default()).opener());
    let job = Job::new(steps.clone(), OnFault::Finish);
    let ended = owner.start(job, folder.journal(&steps)).await.unwrap().ended().await.unwrap();
    assert_eq!((ended.outcome, ended.done, ended.total), (Outcome::Complete, 200, 200));
    drop(ended.journal);
    assert_whole(&folder, 200);

    let readings = readings(&folder);
    let mut from = readings[0].commanded;
    let mut ideal_s = 0.0;
    for step in &steps[1..] {
        ideal_s += StepTime::of(&rig(), from, step).total_s();
        from = step.counts;
    }
    let (first, last) = (&readings[0], &readings[199]);
    let took_s = (last.end_us - first.end_us) as f64 * 1e-6;
    let over = took_s / ideal_s - 1.0;
    assert!((-1e-9..0.05).contains(&over), "{took_s} s for {ideal_s} s: {over}");
}

#[tokio::test(start_paused = true)]
async fn a_pause_of_hours_costs_nothing_and_loses_nothing() {
    let (folder, steps) = (Folder::new(), steps(60));
    let owner = owner(device(sim::LinkFaults::default()).opener());
    let mut events = owner.subscribe();
    let job = Job::new(steps.clone(), OnFault::Wait);
    let running = owner.start(job, folder.journal(&steps)).await.unwrap();
    wait_for_readings(&mut events, 10).await;
    assert_eq!(owner.wish(Wish::Pause).await, Some(Answer::Pausing));
    wait_for_state(&mut events, State::Paused).await;
    assert_eq!(owner.wish(Wish::Pause).await, Some(Answer::Paused));
    // What was taken is durable by now.
    assert!(readings(&folder).len() >= 10);
    tokio::time::sleep(Duration::from_hours(10)).await;
    assert_eq!(owner.status().state, State::Paused);
    assert_eq!(owner.wish(Wish::Continue).await, Some(Answer::Continuing));
    let ended = running.ended().await.unwrap();
    assert_eq!(ended.outcome, Outcome::Complete);
    drop(ended.journal);
    assert_whole(&folder, 60);
    let readings = readings(&folder);
    assert!(readings[59].time_s > 36_000.0, "the device's clock goes on: {}", readings[59].time_s);
    assert!(readings.windows(2).all(|pair| pair[0].end_us <= pair[1].start_us));
}

#[tokio::test(start_paused = true)]
async fn the_first_stop_ends_after_a_dwell_and_an_abort_at_once() {
    for wish in [Wish::Stop, Wish::Abort] {
        let (folder, steps) = (Folder::new(), steps(60));
        let device = device(sim::LinkFaults::default());
        let owner = owner(device.opener());
        let mut events = owner.subscribe();
        let job = Job::new(steps.clone(), OnFault::Finish);
        let running = owner.start(job, folder.journal(&steps)).await.unwrap();
        wait_for_readings(&mut events, 10).await;
        assert_eq!(owner.wish(wish).await, Some(Answer::Ending));
        let ended = running.ended().await.unwrap();
        let expected = if wish == Wish::Stop { Outcome::Stopped } else { Outcome::Aborted };
        assert_eq!(ended.outcome, expected);
        assert!((10..60).contains(&ended.done));
        drop(ended.journal);
        assert_eq!(readings(&folder).len(), ended.done);
        let stand = owner.look().await.unwrap();
        tokio::time::sleep(Duration::from_mins(1)).await;
        assert_eq!(owner.look().await.unwrap().counts, stand.counts, "it still moves");
        assert_eq!(owner.wish(Wish::Continue).await, None);
    }
}

#[tokio::test(start_paused = true)]
async fn a_cut_link_stops_the_rig_and_only_continue_moves_it_again() {
    for restarts in [false, true] {
        let (folder, steps) = (Folder::new(), steps(60));
        let device = device(sim::LinkFaults::default());
        let owner = owner(device.opener());
        let mut events = owner.subscribe();
        let job = Job::new(steps.clone(), OnFault::Wait);
        let running = owner.start(job, folder.journal(&steps)).await.unwrap();
        wait_for_readings(&mut events, 10).await;
        device.cut();
        wait_for_state(&mut events, State::Faulted).await;
        assert!(matches!(owner.status().fault, Some(Fault::LinkLost(_))));
        assert_eq!(owner.status().position, Position::Untrusted(Doubt::LinkLost));
        if restarts {
            device.restart().await;
        }
        tokio::time::sleep(Duration::from_hours(1)).await;
        assert_eq!(device.opened(), 1);
        assert_eq!(owner.wish(Wish::Continue).await, Some(Answer::Reconnecting));
        if restarts {
            wait_for_state(&mut events, State::Homing).await;
        }
        let ended = running.ended().await.unwrap();
        assert_eq!((ended.outcome, device.opened()), (Outcome::Complete, 2));
        drop(ended.journal);
        assert_whole(&folder, 60);
        let homed = Reader::open(&folder.path()).unwrap().events().unwrap();
        let homed = homed.iter().filter(|event| event.kind.name() == "homed").count();
        assert_eq!(homed, 2, "trusted at first, and again after the cut");
    }
}

#[tokio::test(start_paused = true)]
async fn a_rig_that_is_not_there_begins_nothing() {
    let folder = Folder::new();
    let steps = steps(3);
    let missing = gonio::device::opener(|| async {
        Err(gonio::device::SerialError::Missing { port: "/dev/ttyUSB9".into() })
    });
    let owner = owner(missing);
    let job = Job::new(steps.clone(), OnFault::Finish);
    let ended = owner.start(job, folder.journal(&steps)).await.unwrap().ended().await.unwrap();
    assert!(matches!(ended.outcome, Outcome::Faulted(Fault::LinkLost(_))));
    assert!(ended.unreached.unwrap().to_string().starts_with("/dev/ttyUSB9: no such port"));
}

#[tokio::test(start_paused = true)]
async fn lost_and_broken_frames_cost_time_but_no_reading() {
    let (folder, steps) = (Folder::new(), steps(200));
    let faults = sim::LinkFaults { drop_rate: 5e-4, corrupt_rate: 5e-4 };
    let owner = owner(device(faults).opener());
    let job = Job::new(steps.clone(), OnFault::Finish);
    let ended = owner.start(job, folder.journal(&steps)).await.unwrap().ended().await.unwrap();
    assert_eq!(ended.outcome, Outcome::Complete);
    drop(ended.journal);
    assert_whole(&folder, 200);
    assert!(readings(&folder).iter().any(|reading| reading.link_retries > 0));
}

#[tokio::test(start_paused = true)]
async fn the_same_run_twice_is_the_same_to_the_last_bit() {
    let mut runs = Vec::new();
    for _ in 0..2 {
        let (folder, steps) = (Folder::new(), steps(50));
        let faults = sim::LinkFaults { drop_rate: 1e-3, corrupt_rate: 0.0 };
        let owner = owner(device(faults).opener());
        let job = Job::new(steps.clone(), OnFault::Finish);
        let running = owner.start(job, folder.journal(&steps)).await.unwrap();
        drop(running.ended().await.unwrap().journal);
        runs.push(readings(&folder));
    }
    assert_eq!(runs[0], runs[1]);
}

#[tokio::test(start_paused = true)]
async fn progress_and_eta_are_told_and_come_true() {
    let (folder, steps) = (Folder::new(), steps(100));
    let owner = owner(device(sim::LinkFaults::default()).opener());
    let mut events = owner.subscribe();
    let job = Job::new(steps.clone(), OnFault::Finish);
    let running = owner.start(job, folder.journal(&steps)).await.unwrap();
    let halfway = wait_for(
        &mut events,
        |happening| matches!(happening, Happening::Progress(progress) if progress.done == 50),
    )
    .await;
    let Happening::Progress(halfway) = halfway else { unreachable!() };
    let ended = running.ended().await.unwrap();
    let took_s = ended.rig_s - halfway.rig_s;
    assert!((halfway.rest_s / took_s - 1.0).abs() < 0.05, "{} s, {took_s} s", halfway.rest_s);
}

#[tokio::test(start_paused = true)]
async fn by_hand_the_rig_homes_jogs_and_reads_but_not_during_a_run() {
    let owner = owner(device(sim::LinkFaults::default()).opener());
    let to = Latched([1000, -2000, 500, 0]);
    assert!(owner.jog(to).await.is_err(), "moved before homing");
    assert!(owner.home().await.unwrap().is_homed);
    assert_eq!(owner.jog(to).await.unwrap().counts, to);
    let beyond = owner.jog(Latched([200_000, 0, 0, 0])).await.unwrap_err();
    assert_eq!(beyond.to_string(), "theta: 200.000° is above the upper limit 95.000°");
    let one = gonio::run::TakeOne {
        gain: 0,
        dwell: Duration::from_millis(20),
        shutter: firmware_protocol::Shutter::Closed,
    };
    let reading = owner.take(one).await.unwrap();
    assert_eq!((reading.start, reading.max), (to, 0));

    let (folder, steps) = (Folder::new(), steps(20));
    let job = Job::new(steps.clone(), OnFault::Finish);
    let running = owner.start(job, folder.journal(&steps)).await.unwrap();
    assert!(matches!(owner.home().await, Err(gonio::run::HandError::Busy)));
    assert_eq!(running.ended().await.unwrap().outcome, Outcome::Complete);
    assert!(owner.home().await.is_ok());
}

#[tokio::test(start_paused = true)]
async fn dropping_the_owner_ends_the_run_with_a_stop() {
    let (folder, steps) = (Folder::new(), steps(60));
    let device = device(sim::LinkFaults::default());
    let (handle, task) = gonio::run::own(rig(), device.opener(), 1);
    let mut events = handle.subscribe();
    let job = Job::new(steps.clone(), OnFault::Wait);
    let running = handle.start(job, folder.journal(&steps)).await.unwrap();
    wait_for_readings(&mut events, 5).await;
    drop(handle);
    assert_eq!(running.ended().await.unwrap().outcome, Outcome::Aborted);
    task.await.unwrap();
}
