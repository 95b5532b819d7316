//! If this breaks, a command is executed twice, out of order or not at all, or the host trusts a
//! device that is not the one it spoke with.

use std::time::Duration;

use crate::golden;
use crate::pair::{self, Dice, Faults, Ledger, Pair};
use firmware_protocol::{
    Cause, CommandId, Decoder, Event, HostEvent, Instant, LinkCause, MoveTo, Nonsense, PROTOCOL,
    Rejection, Reply, Request, RequestType, Said, SessionTag, SubmitError, Ticket, ToDevice,
    ToHost, frame,
};

const BOOT: u32 = golden::BOOT;

fn move_to(id: u32) -> Request {
    Request::MoveTo(MoveTo { id: CommandId(id), targets: golden::counts(&[1]) })
}

fn open(seed: u64, faults: Faults) -> Pair<Ledger> {
    let mut pair = Pair::new(seed, Ledger::new(BOOT), Faults::default());
    let ticket = pair.host.identify(pair.now);
    assert_eq!(replied(pair.next_event()), ticket);
    pair.down.faults = faults;
    pair.up.faults = faults;
    pair
}

fn replied(event: Option<HostEvent>) -> Ticket {
    match event {
        Some(HostEvent::Reply { ticket, .. }) => ticket,
        other => panic!("expected a reply, found {other:?}"),
    }
}

/// What a host heard while it had commands executed.
#[derive(Debug, Default)]
struct Heard {
    replies: Vec<Ticket>,
    started: Vec<u32>,
    done: Vec<u32>,
    acknowledge: Vec<CommandId>,
    end: Option<HostEvent>,
}

impl Heard {
    fn take(&mut self, event: HostEvent) {
        match event {
            HostEvent::Reply { ticket, .. } => self.replies.push(ticket),
            HostEvent::Event(Event::Started(id, _)) => self.started.push(id.0),
            HostEvent::Event(event) => {
                self.done.push(event.command().0);
                self.acknowledge.push(event.command());
            }
            end => self.end = Some(end),
        }
    }
}

/// Has `count` commands executed, with signs of life in between, and acknowledges each result.
fn execute(pair: &mut Pair<Ledger>, count: u32, dice: &mut Dice) -> Heard {
    let mut heard = Heard::default();
    let mut next = 1;
    let mut open = Vec::new();
    while heard.end.is_none() && (heard.done.len() < count as usize || !open.is_empty()) {
        loop {
            let (request, is_command) = match heard.acknowledge.last() {
                Some(id) => (Request::Acknowledge(*id), false),
                None if next <= count && dice.below(4) > 0 => (move_to(next), true),
                None if next <= count => (Request::KeepAlive, false),
                None => break,
            };
            let Ok(ticket) = pair.host.submit(pair.now, request) else { break };
            open.push(ticket);
            next += u32::from(is_command);
            if !is_command {
                heard.acknowledge.pop();
            }
        }
        match pair.next_event() {
            Some(event) => heard.take(event),
            None => panic!("nothing happens any more: {heard:?}"),
        }
        if let Some(ticket) = heard.replies.last() {
            open.retain(|open| open != ticket);
        }
    }
    heard
}

/// Whatever the wire does: each command at most once, in order, and nothing is told twice.
fn check_never_twice(pair: &Pair<Ledger>, heard: &Heard, seed: u64) {
    let executed: Vec<u32> =
        pair.device.executed.iter().filter_map(|request| Some(request.command()?.0)).collect();
    assert!(executed.iter().copied().eq(1..=executed.len().try_into().unwrap()), "seed {seed}");
    for told in [&heard.done, &heard.started] {
        let mut once = told.clone();
        once.sort_unstable();
        once.dedup();
        assert_eq!(once.len(), told.len(), "seed {seed}: told twice");
    }
    let mut replies = heard.replies.clone();
    replies.sort_unstable();
    replies.dedup();
    assert_eq!(replies.len(), heard.replies.len(), "seed {seed}: answered twice");
}

#[test]
fn every_command_runs_exactly_once_under_every_single_fault() {
    let faults = [
        Faults { drop: 0.08, ..Faults::default() },
        Faults { duplicate: 0.5, ..Faults::default() },
        Faults { corrupt: 0.08, ..Faults::default() },
        Faults { delay_us: 40_000, ..Faults::default() },
        Faults { drop: 0.02, duplicate: 0.1, corrupt: 0.02, delay_us: 20_000, lose_next: 0 },
    ];
    for (at, faults) in faults.into_iter().enumerate() {
        for seed in 0..8 {
            let mut pair = open(seed, faults);
            let heard = execute(&mut pair, 150, &mut Dice::new(seed));
            assert_eq!(heard.end, None, "fault {at}, seed {seed}");
            assert_eq!(heard.done.len(), 150, "fault {at}, seed {seed}");
            assert_eq!(pair.device.executed.len(), 1 + heard.replies.len(), "once, seed {seed}");
            check_never_twice(&pair, &heard, seed);
        }
    }
}

#[test]
fn on_a_terrible_wire_the_link_may_end_but_nothing_runs_twice() {
    let faults = Faults { drop: 0.2, duplicate: 0.3, corrupt: 0.2, delay_us: 60_000, lose_next: 0 };
    let mut ends = 0;
    for seed in 0..64 {
        let mut pair = open(seed, faults);
        let heard = execute(&mut pair, 60, &mut Dice::new(seed));
        check_never_twice(&pair, &heard, seed);
        match heard.end {
            None => assert_eq!(heard.done.len(), 60),
            Some(HostEvent::LinkDown { attempts, cause: LinkCause::Unanswered, .. }) => {
                assert!(attempts >= 5, "seed {seed}: {attempts}");
                ends += 1;
            }
            Some(HostEvent::LinkDown {
                cause: LinkCause::Silent | LinkCause::Garbled { .. },
                ..
            }) => {
                ends += 1;
            }
            Some(other) => panic!("seed {seed}: {other:?}"),
        }
    }
    assert!((1..64).contains(&ends), "{ends} of 64 ended: the wire is not as bad as meant");
}

#[test]
fn sequence_numbers_wrap_many_times() {
    let mut pair = open(1, Faults { drop: 0.02, ..Faults::default() });
    for _ in 0..1000 {
        let ticket = pair.host.submit(pair.now, Request::KeepAlive).unwrap();
        assert_eq!(replied(pair.next_event()), ticket);
    }
    assert_eq!(pair.device.count(&Request::KeepAlive), 1000);
}

#[test]
fn a_lost_reply_is_said_again_and_the_command_runs_once() {
    let mut pair = open(1, Faults::default());
    pair.up.faults.lose_next = 1;
    pair.host.submit(pair.now, move_to(1)).unwrap();
    // The command runs meanwhile, so that its start comes before the reply.
    let events: Vec<_> = std::iter::from_fn(|| pair.next_event()).take(3).collect();
    let reply = events.iter().find(|event| matches!(event, HostEvent::Reply { .. }));
    let Some(HostEvent::Reply { reply, retries, request, .. }) = reply else { panic!("no reply") };
    assert_eq!((reply, *retries), (&Reply::Accepted(CommandId(1)), 1));
    assert_eq!(*request, RequestType::MoveTo);
    assert_eq!(pair.device.count(&move_to(1)), 1);
}

#[test]
fn a_damaged_request_is_asked_for_at_once() {
    let mut pair = open(1, Faults::default());
    let begin = pair.now;
    pair.host.submit(pair.now, Request::KeepAlive).unwrap();
    let mut wire = [0; frame::WIRE_MAX];
    let length = pair.host.poll_transmit(pair.now, &mut wire).unwrap();
    wire[5] ^= 0x10;
    pair.down.send(pair.now, &wire[..length]);
    replied(pair.next_event());
    // Two round trips of 2 ms and some bytes, far less than the time-out.
    assert!(pair.now.since(begin) < Duration::from_millis(15), "{:?}", pair.now.since(begin));
    assert_eq!(pair.host.statistics().resent, 1);
    assert_eq!(pair.device.link.bad().total(), 1);
}

#[test]
fn requests_behind_a_lost_one_wait_for_it() {
    let mut pair = open(1, Faults::default());
    pair.down.faults.lose_next = 1;
    for id in 1..=4 {
        pair.host.submit(pair.now, move_to(id)).unwrap();
    }
    assert_eq!(pair.host.submit(pair.now, move_to(5)), Err(SubmitError::WindowFull));
    let begin = pair.now;
    for _ in 0..4 {
        pair.wait_for(|event| matches!(event, HostEvent::Reply { .. }));
    }
    let executed: Vec<_> = pair.device.executed.iter().filter_map(Request::command).collect();
    assert_eq!(executed, [1, 2, 3, 4].map(CommandId));
    assert!(pair.now.since(begin) < Duration::from_millis(25), "the gap is noticed at once");
}

#[test]
fn a_result_is_repeated_until_it_is_acknowledged_and_told_once() {
    let mut pair = open(1, Faults::default());
    pair.host.submit(pair.now, move_to(1)).unwrap();
    replied(pair.next_event());
    assert!(matches!(pair.next_event(), Some(HostEvent::Event(Event::Started(..)))));
    pair.up.faults.lose_next = 3;
    let event = pair.next_event();
    assert!(matches!(event, Some(HostEvent::Event(Event::Done(_)))), "{event:?}");
    let said = pair.up.carried.len();
    let later = pair.now + Duration::from_secs(1);
    while pair.now < later && pair.step() {}
    assert!(pair.up.carried.len() > said, "it is said again");
    assert_eq!(pair.host.poll_event(), None);
    pair.host.submit(pair.now, Request::Acknowledge(CommandId(1))).unwrap();
    replied(pair.next_event());
    while pair.step() {}
    assert_eq!(pair.host.poll_event(), None);
    assert_eq!((pair.host.poll_timeout(), pair.device.link.poll_timeout()), (None, None));
}

#[test]
fn a_restart_of_the_device_is_noticed_and_nothing_is_executed_before_a_new_session() {
    let mut pair = open(1, Faults::default());
    pair.device = Ledger::new(77);
    pair.host.submit(pair.now, move_to(1)).unwrap();
    pair.host.submit(pair.now, move_to(2)).unwrap();
    assert_eq!(pair.next_event(), Some(HostEvent::DeviceRestarted { old: BOOT, new: 77 }));
    assert_eq!(pair.host.submit(pair.now, move_to(3)), Err(SubmitError::NoSession));
    assert_eq!(pair.next_event(), None);
    assert_eq!(pair.device.executed, []);
    let ticket = pair.host.identify(pair.now);
    assert_eq!(replied(pair.next_event()), ticket);
    pair.host.submit(pair.now, move_to(1)).unwrap();
    replied(pair.next_event());
}

#[test]
fn another_host_takes_the_device_over() {
    let mut pair = open(1, Faults::default());
    let other =
        ToDevice { session: SessionTag(9), seq: 0, request: Request::Identify(0x0009_0009) };
    let mut wire = [0; frame::WIRE_MAX];
    let length = other.encode(&mut wire).unwrap();
    pair.down.send(pair.now, &wire[..length]);
    while pair.step() {}
    pair.host.submit(pair.now, Request::KeepAlive).unwrap();
    match pair.next_event() {
        Some(HostEvent::LinkDown { request, cause: LinkCause::SessionLost, .. }) => {
            assert_eq!(request, RequestType::KeepAlive);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_late_identify_of_a_past_session_does_not_bring_it_back() {
    let mut pair = open(1, Faults::default());
    let late = pair.down.carried[0].clone();
    pair.host.identify(pair.now);
    replied(pair.next_event());
    pair.host.submit(pair.now, move_to(1)).unwrap();
    replied(pair.next_event());
    pair.down.send(pair.now, &late);
    pair.down.send(pair.now, &late);
    pair.host.submit(pair.now, Request::KeepAlive).unwrap();
    pair.wait_for(|event| matches!(event, HostEvent::Reply { .. }));
    assert_eq!(pair.device.executed.len(), 4, "two sessions, a move, a sign of life");
}

#[test]
fn stop_goes_first_past_a_full_window_and_needs_no_session() {
    let mut pair = open(1, Faults::default());
    for id in 1..=4 {
        pair.host.submit(pair.now, move_to(id)).unwrap();
    }
    let stop = pair.host.submit(pair.now, Request::Stop).unwrap();
    assert_eq!(pair.host.submit(pair.now, Request::Stop), Ok(stop));
    assert_eq!(replied(pair.next_event()), stop);
    assert_eq!(pair.device.executed[1], Request::Stop);

    let mut pair = Pair::new(1, Ledger::new(BOOT), Faults::default());
    pair.down.faults.lose_next = 4;
    let stop = pair.host.submit(pair.now, Request::Stop).unwrap();
    assert_eq!(replied(pair.next_event()), stop);
    assert_eq!(pair.device.executed, [Request::Stop]);
}

#[test]
fn a_stop_behind_new_requests_is_executed_after_them() {
    let mut pair = open(1, Faults::default());
    let stop = pair.host.submit(pair.now, Request::Stop).unwrap();
    pair.send();
    pair.host.submit(pair.now, Request::ClearFault).unwrap();
    pair.host.submit(pair.now, move_to(1)).unwrap();
    pair.send();
    // The answer to the first is still on its way.
    assert_eq!(pair.host.submit(pair.now, Request::Stop), Ok(stop));
    while pair.step() {}
    assert_eq!(pair.device.executed.last(), Some(&Request::Stop));
    let mut stopped = 0;
    while let Some(event) = pair.host.poll_event() {
        stopped += u32::from(matches!(event, HostEvent::Reply { reply: Reply::Stopping, .. }));
    }
    assert_eq!((stopped, pair.host.poll_timeout()), (1, None));
}

#[test]
fn a_stop_answered_in_a_new_session_is_not_sent_again() {
    let mut pair = open(1, Faults::default());
    let stop = pair.host.submit(pair.now, Request::Stop).unwrap();
    pair.send();
    let identify = pair.host.identify(pair.now);
    assert_eq!(replied(pair.next_event()), stop);
    assert_eq!(replied(pair.next_event()), identify);
    pair.host.submit(pair.now, move_to(1)).unwrap();
    while pair.step() {}
    assert_eq!(pair.device.count(&Request::Stop), 1);
}

#[test]
fn a_stop_is_not_undone_by_a_clear_fault_from_before_it() {
    // Lost and sent again, or never sent yet: either way it comes after the stop.
    for lose_next in [1, 0] {
        let mut pair = open(1, Faults::default());
        pair.down.faults.lose_next = lose_next;
        pair.host.submit(pair.now, Request::ClearFault).unwrap();
        if lose_next > 0 {
            pair.send();
        }
        pair.host.submit(pair.now, move_to(1)).unwrap();
        pair.host.submit(pair.now, Request::Stop).unwrap();
        while pair.step() {}
        assert_eq!(pair.device.count(&Request::Stop), 1);
        assert_eq!(pair.device.count(&Request::ClearFault), 0);
        let refused = Rejection::Faulted(Cause::Stopped);
        pair.wait_for(|event| {
            matches!(event, HostEvent::Reply { request: RequestType::ClearFault,
                reply: Reply::Rejected(_, why), .. } if *why == refused)
        });
        // One from behind it counts, and so it does when the numbers have wrapped.
        for _ in 0..300 {
            pair.host.submit(pair.now, Request::ClearFault).unwrap();
            pair.wait_for(|event| matches!(event, HostEvent::Reply { reply: Reply::Cleared, .. }));
        }
    }
}

#[test]
fn stops_and_sessions_that_nobody_polls_stay_few_and_none_is_lost() {
    let mut pair = open(1, Faults::default());
    let link = &mut pair.device.link;
    let mut last = 0;
    for session in 0x100..0x120 {
        for request in [Request::Identify(session), Request::Stop] {
            let mut wire = [0; frame::WIRE_MAX];
            let down = ToDevice { session: SessionTag::of(session), seq: 0, request };
            let length = down.encode(&mut wire).unwrap();
            link.handle_bytes(pair.now, &wire[..length]);
        }
        last = session;
    }
    let polled: Vec<_> = std::iter::from_fn(|| link.poll_event()).map(|one| one.request).collect();
    assert_eq!(polled, [Request::Stop, Request::Identify(last), Request::Stop]);
}

#[test]
fn a_silent_device_is_given_up_after_five_tries_of_doubled_patience() {
    let mut pair = open(1, Faults::default());
    for _ in 0..50 {
        pair.host.submit(pair.now, Request::KeepAlive).unwrap();
        replied(pair.next_event());
    }
    pair.down.faults.drop = 1.0;
    pair.host.submit(pair.now, move_to(1)).unwrap();
    let Some(HostEvent::LinkDown { request, attempts, elapsed, cause }) = pair.next_event() else {
        panic!("the link is down")
    };
    assert_eq!((request, attempts, cause), (RequestType::MoveTo, 5, LinkCause::Silent));
    // 25 ms and the wire time of a request and the longest reply, 24 ms: doubled four times.
    let ideal = Duration::from_millis(49 * 31);
    assert!(elapsed > ideal.mul_f64(0.9) && elapsed < ideal.mul_f64(1.1), "{elapsed:?}");
    assert_eq!(pair.host.submit(pair.now, move_to(2)), Err(SubmitError::NoSession));
    assert_eq!(pair.host.poll_timeout(), None);
}

#[test]
fn a_device_that_talks_gibberish_is_told_from_a_silent_one() {
    let mut pair = Pair::new(1, Ledger::new(BOOT), Faults::default());
    pair.down.faults.drop = 1.0;
    pair.host.identify(pair.now);
    pair.up.send(pair.now, b"grbl 1.1h ['$' for help]\r\n");
    match pair.next_event() {
        Some(HostEvent::LinkDown { cause: LinkCause::Garbled { bytes: 26 }, .. }) => {}
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_newer_device_is_named_with_both_versions() {
    let mut pair = Pair::new(1, Ledger::new(BOOT), Faults::default());
    pair.down.faults.drop = 1.0;
    pair.host.identify(pair.now);
    pair.up.send(pair.now, &golden::bytes("foreign-identity"));
    let expected = HostEvent::VersionMismatch { device: (2, Some(7)), host: PROTOCOL };
    assert_eq!(pair.next_event(), Some(expected));
    assert_eq!(pair.host.submit(pair.now, Request::KeepAlive), Err(SubmitError::NoSession));
}

#[test]
fn a_newer_host_gets_the_identity_or_a_nak_and_its_stop_is_obeyed() {
    let mut device = Ledger::new(BOOT);
    let mut answer = |name: &str| {
        let mut wire = [0; frame::WIRE_MAX];
        pair::Peer::handle_bytes(&mut device, Instant::ZERO, &golden::bytes(name));
        let length = pair::Peer::poll_transmit(&mut device, Instant::ZERO, &mut wire).unwrap();
        let mut decoder = Decoder::default();
        let frame = decoder.next_frame(&mut &wire[..length]).unwrap().unwrap();
        ToHost::decode(&frame).unwrap()
    };
    assert!(matches!(answer("foreign-identify").message, Said::Reply(Reply::Identity(_))));
    let stopping = answer("foreign-stop");
    assert_eq!((stopping.seq, stopping.message), (9, Said::Reply(Reply::Stopping)));
    assert_eq!(device.executed, [Request::Stop]);
}

#[test]
fn an_answer_that_is_none_is_reported_and_the_right_one_still_taken() {
    let mut pair = open(1, Faults::default());
    let ticket = pair.host.submit(pair.now, move_to(1)).unwrap();
    let wrong = ToHost {
        session: SessionTag::of(golden::SESSION),
        boot_id: BOOT,
        seq: 0,
        message: Said::Reply(Reply::Accepted(CommandId(8))),
    };
    let mut wire = [0; frame::WIRE_MAX];
    let length = wrong.encode(&mut wire).unwrap();
    pair.up.send(pair.now, &wire[..length]);
    let problem = Nonsense::Answer(RequestType::MoveTo);
    assert_eq!(pair.next_event(), Some(HostEvent::Garbage { type_byte: 0x42, problem }));
    assert_eq!(replied(pair.next_event()), ticket);
}
