//! Interrupted runs, carried on. Would break: a target measured twice or not at all, a resumed run
//! that differs from an uninterrupted one, a moved sample that nobody notices.

use std::time::Duration;

use gonio::device::{SerialSettings, serial_opener};
use gonio::journal::{Journal, Order, Reader, Writer};
use gonio::plan::{RESUME_IDS_FROM, Step};
use gonio::rig::{Reading, ReadingKind};
use gonio::run::resume::remainder;
use gonio::run::{Check, Fault, Job, Judgement, OnFault, Outcome, Wish};

use crate::bench::{BAUD, Folder, device, owner, rig, steps, wait_for_readings};
use crate::board::TestBoard;

const COUNT: u32 = 60;

fn readings(folder: &Folder) -> Vec<Reading> {
    Reader::open(&folder.path()).unwrap().readings(Order::Id).unwrap()
}

/// A run that somebody stopped after some readings.
async fn stopped(folder: &Folder) -> usize {
    let steps = steps(COUNT);
    let owner = owner(device(sim::LinkFaults::default()).opener());
    let mut events = owner.subscribe();
    let job = Job::new(steps.clone(), OnFault::Finish);
    let running = owner.start(job, folder.journal(&steps)).await.unwrap();
    wait_for_readings(&mut events, 20).await;
    owner.wish(Wish::Stop).await;
    let ended = running.ended().await.unwrap();
    assert_eq!(ended.outcome, Outcome::Stopped);
    ended.done
}

fn rest_of(folder: &Folder) -> (Journal, Job) {
    let journal = Journal::open(&folder.path()).unwrap();
    let reader = journal.reader();
    let taken = reader.readings(Order::Taken).unwrap();
    let left = remainder(&reader.steps().unwrap(), &taken, &reader.sessions().unwrap());
    let mut job = Job::new(left.steps, OnFault::Finish);
    job.done_before = left.done;
    job.session = left.session;
    job.session_began_s = left.began_s;
    (journal, job)
}

#[tokio::test(start_paused = true)]
async fn a_resumed_run_equals_an_uninterrupted_one() {
    let (whole, parts) = (Folder::new(), Folder::new());
    let steps = steps(COUNT);
    let first = owner(device(sim::LinkFaults::default()).opener());
    let job = Job::new(steps.clone(), OnFault::Finish);
    let running = first.start(job, whole.journal(&steps)).await.unwrap();
    drop(running.ended().await.unwrap());

    let had = stopped(&parts).await;
    let (journal, job) = rest_of(&parts);
    assert_eq!((job.steps.len(), job.session), (COUNT as usize - had, 1));
    let began_s = job.session_began_s;
    let again = owner(device(sim::LinkFaults::default()).opener());
    let running = again.start(job, Writer::inline(journal)).await.unwrap();
    let ended = running.ended().await.unwrap();
    assert_eq!((ended.outcome, ended.done), (Outcome::Complete, COUNT as usize));
    drop(ended.journal);

    let (whole, parts) = (readings(&whole), readings(&parts));
    assert_eq!(whole.len(), parts.len());
    for (n, (a, b)) in whole.iter().zip(&parts).enumerate() {
        assert_eq!((a.id, a.mean.to_bits(), a.n), (b.id, b.mean.to_bits(), b.n));
        assert_eq!((a.commanded, a.start, a.end), (b.commanded, b.start, b.end));
        assert_eq!(b.session, u32::from(n >= had));
        assert!(n < had || b.time_s >= began_s);
    }
}

#[tokio::test(start_paused = true)]
async fn a_reference_that_moved_refuses_the_rest() {
    let folder = Folder::new();
    let had = stopped(&folder).await;
    let (journal, mut job) = rest_of(&folder);
    let reference = Step { id: RESUME_IDS_FROM, kind: ReadingKind::Reference, ..steps(1)[0] };
    job.check = Some(Check {
        steps: vec![reference],
        judge: Box::new(|checks| {
            assert_eq!(checks.len(), 1);
            Judgement { check: None, go_on: Err("it reads otherwise".into()) }
        }),
    });
    let owner = owner(device(sim::LinkFaults::default()).opener());
    let running = owner.start(job, Writer::inline(journal)).await.unwrap();
    let ended = running.ended().await.unwrap();
    assert_eq!(ended.outcome, Outcome::Faulted(Fault::ReferenceMoved("it reads otherwise".into())));
    drop(ended.journal);
    assert_eq!(readings(&folder).len(), had + 1);
}

/// Real time, a real pseudo-terminal, a device in a thread of its own.
#[test]
fn over_a_serial_port_it_is_the_same() {
    let (opened, port) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let pty = sim::Pty::open(None).unwrap();
            opened.send(pty.path().display().to_string()).unwrap();
            let mut device = firmware_protocol::Device::new(TestBoard::new(&rig(), 3));
            let boot = tokio::time::Instant::now();
            let _ = sim::serve(pty, &mut device, boot, sim::Wire::new(BAUD)).await;
        });
    });
    let port = port.recv().unwrap();
    let settings =
        SerialSettings { port, baud: BAUD, reset_on_open: false, boot_wait: Duration::ZERO };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        let (folder, steps) = (Folder::new(), steps(4));
        let owner = owner(serial_opener(settings));
        let job = Job::new(steps.clone(), OnFault::Finish);
        let running = owner.start(job, folder.journal(&steps)).await.unwrap();
        let ended = running.ended().await.unwrap();
        assert_eq!((ended.outcome, ended.done), (Outcome::Complete, 4));
        drop(ended.journal);
        assert_eq!(readings(&folder).len(), 4);
    });
}
