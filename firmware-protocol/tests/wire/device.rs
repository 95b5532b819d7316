//! If this breaks, link and core do not fit together: results get lost between them, the lease
//! does not stop a rig whose host has gone, or an idle one does not rest.

use std::time::Duration;

use firmware_protocol::{
    Cause, CommandId, Device, Event, HostEvent, Instant, LEASE, LinkCause, Rejection, Reply,
    Request, Tick, WINDOW,
};

use crate::board::{TestBoard, dwell, home, move_to};
use crate::pair::{Faults, Pair};

type Gantry = Pair<Device<TestBoard>>;

fn gantry(seed: u64, begin: Instant, faults: Faults) -> Gantry {
    let mut board = TestBoard::at([-300.0, 200.0, 40.0, -100.0]);
    board.answers_late = true;
    let mut pair = Pair::new(seed, Device::new(board), faults);
    pair.now = begin;
    pair.host.identify(pair.now);
    assert!(matches!(pair.next_event(), Some(HostEvent::Reply { reply: Reply::Identity(_), .. })));
    let home = [home(0b1111)(CommandId(1))];
    check(&execute(&mut pair, &home), &home);
    pair
}

/// So many moves, each with a dwell; every other target is where the axes stand already.
fn commands(count: u32) -> Vec<Request> {
    let mut commands = Vec::new();
    for at in 0..count {
        let place = i32::try_from(at / 2).unwrap() * 50;
        commands.push(move_to([place, -place, place, -place])(CommandId(2 * at + 2)));
        commands.push(dwell(10_000, 20_000)(CommandId(2 * at + 3)));
    }
    commands
}

/// Executes the commands, a few of them queued on the device, with signs of life in between.
fn execute(pair: &mut Gantry, commands: &[Request]) -> Vec<Event> {
    let mut results: Vec<Event> = Vec::new();
    let mut acknowledge = Vec::new();
    let (mut next, mut open) = (0, 0_usize);
    while results.len() < commands.len() || !acknowledge.is_empty() || open > 0 {
        let request = match acknowledge.last() {
            Some(id) => Some(Request::Acknowledge(*id)),
            None if next < commands.len() && next < results.len() + WINDOW => {
                Some(commands[next].clone())
            }
            None if pair.alarm.is_some_and(|at| at <= pair.now) => Some(Request::KeepAlive),
            None => None,
        };
        if let Some(request) = request
            && pair.host.submit(pair.now, request.clone()).is_ok()
        {
            open += 1;
            pair.alarm = Some(pair.now + LEASE / 4);
            match request {
                Request::Acknowledge(_) => drop(acknowledge.pop()),
                Request::KeepAlive => {}
                _ => next += 1,
            }
            continue;
        }
        if pair.alarm.is_some_and(|at| at <= pair.now) {
            pair.alarm = Some(pair.now + LEASE / 4);
        }
        match pair.host.poll_event() {
            Some(HostEvent::Reply { reply: Reply::Rejected(id, why), .. }) => {
                panic!("{id:?} rejected: {why:?}")
            }
            Some(HostEvent::Reply { .. }) => open -= 1,
            Some(HostEvent::Event(Event::Started(..))) => {}
            Some(HostEvent::Event(event)) => {
                acknowledge.push(event.command());
                results.push(event);
            }
            Some(other) => panic!("{other:?}"),
            None => assert!(pair.step(), "nothing happens any more"),
        }
    }
    pair.alarm = None;
    results.sort_by_key(Event::command);
    results
}

fn check(results: &[Event], commands: &[Request]) {
    for (result, command) in results.iter().zip(commands) {
        assert_eq!(Some(result.command()), command.command());
        match (result, command) {
            (Event::Done(done), Request::MoveTo(target)) => {
                assert_eq!(done.readback, target.targets);
            }
            (Event::Sampled(result), Request::Dwell(dwell)) => {
                assert_eq!((result.reading, result.n), (dwell.reading, 40));
                let took = result.end_tick.micros_since(result.start_tick);
                assert_eq!(took, 20_000, "across a wrap too");
            }
            (Event::Done(_), Request::Home(_)) => {}
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn a_whole_run_has_every_result_once_on_a_good_and_on_a_bad_wire() {
    let bad = Faults { drop: 0.03, duplicate: 0.1, corrupt: 0.03, delay_us: 5000, lose_next: 0 };
    for (seed, faults) in [(0, Faults::default()), (1, bad), (2, bad), (3, bad), (4, bad)] {
        let mut pair = gantry(seed, Instant::ZERO, faults);
        let commands = commands(40);
        let results = execute(&mut pair, &commands);
        assert_eq!(results.len(), commands.len(), "seed {seed}");
        check(&results, &commands);
        while pair.step() {}
        assert_eq!(pair.device.poll_timeout(), None, "an idle device rests");
        assert_eq!(pair.host.poll_timeout(), None, "an idle host rests");
    }
}

#[test]
fn ticks_wrap_in_the_middle_of_a_run() {
    // Homing takes 13.7 s; the wrap comes 1.3 s later.
    let begin = Instant::from_micros((1 << 32) - 15_000_000);
    let mut pair = gantry(5, begin, Faults::default());
    let commands = commands(40);
    let results = execute(&mut pair, &commands);
    check(&results, &commands);
    let ticks: Vec<Tick> = results
        .iter()
        .filter_map(|result| match result {
            Event::Sampled(result) => Some(result.end_tick),
            _ => None,
        })
        .collect();
    assert!(ticks.windows(2).all(|pair| pair[0].is_before(pair[1])));
    assert!(ticks.windows(2).any(|pair| pair[0].0 > pair[1].0), "the run does span the wrap");
}

#[test]
fn a_host_that_goes_silent_has_the_device_stop_and_finds_it_stopped() {
    let mut pair = gantry(6, Instant::ZERO, Faults::default());
    execute(&mut pair, &commands(1));
    for id in 10..14 {
        let request = move_to([20_000 + id, 0, 0, 0])(CommandId(id.unsigned_abs()));
        pair.host.submit(pair.now, request).unwrap();
    }
    pair.wait_for(|event| matches!(event, HostEvent::Event(Event::Started(..))));
    // The cable is pulled.
    (pair.down.faults.drop, pair.up.faults.drop) = (1.0, 1.0);
    let end = pair.now + LEASE + Duration::from_millis(100);
    while pair.now < end && pair.step() {}
    (pair.down.faults.drop, pair.up.faults.drop) = (0.0, 0.0);
    let failed: Vec<_> = std::iter::from_fn(|| pair.next_event())
        .filter_map(|event| match event {
            HostEvent::Event(Event::Failed(id, cause, _)) => Some((id.0, cause)),
            _ => None,
        })
        .take(4)
        .collect();
    assert_eq!(failed, [10, 11, 12, 13].map(|id| (id, Cause::LeaseExpired)));
    pair.host.submit(pair.now, move_to([0; 4])(CommandId(20))).unwrap();
    let faulted = Reply::Rejected(CommandId(20), Rejection::Faulted(Cause::LeaseExpired));
    pair.wait_for(|event| matches!(event, HostEvent::Reply { reply, .. } if *reply == faulted));
}

#[test]
fn results_that_nobody_acknowledges_hold_up_new_commands_and_nothing_is_lost() {
    let mut pair = gantry(7, Instant::ZERO, Faults::default());
    let mut accepted = Vec::new();
    let mut told = Vec::new();
    for id in 2..=41 {
        pair.host.submit(pair.now, dwell(0, 1000)(CommandId(id))).unwrap();
        loop {
            match pair.next_event() {
                Some(HostEvent::Reply { reply: Reply::Accepted(id), .. }) => {
                    accepted.push(id);
                    break;
                }
                Some(HostEvent::Reply { reply: Reply::Rejected(_, why), .. }) => {
                    assert_eq!(why, Rejection::QueueFull);
                    break;
                }
                Some(HostEvent::Event(Event::Started(..))) => {}
                Some(HostEvent::Event(event)) => told.push(event.command()),
                other => panic!("{other:?}"),
            }
        }
    }
    assert_eq!(accepted.len(), 16);
    let later = pair.now + Duration::from_secs(2);
    while pair.now < later && pair.step() {}
    while let Some(event) = pair.host.poll_event() {
        if let HostEvent::Event(event @ Event::Sampled(_)) = event {
            told.push(event.command());
        }
    }
    assert_eq!(told, accepted);
}

#[test]
fn a_pulled_cable_is_told_as_silence() {
    let mut pair = gantry(8, Instant::ZERO, Faults::default());
    (pair.down.faults.drop, pair.up.faults.drop) = (1.0, 1.0);
    pair.host.submit(pair.now, Request::KeepAlive).unwrap();
    let event = pair.next_event();
    assert!(
        matches!(event, Some(HostEvent::LinkDown { cause: LinkCause::Silent, .. })),
        "{event:?}"
    );
}
