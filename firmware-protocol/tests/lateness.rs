//! What could break: a rig whose time depends on how coarsely its host's timers tick. The same
//! requests at the same moments give the same events, however late the core is called.

mod board;

use board::{AXES, Bench, TestBoard, dwell, home, move_to};
use firmware_protocol::{
    BoardFault, CommandId, DeviceCore, Event, Instant, LEASE, Reply, Request, Shutter,
};
use proptest::prelude::*;

/// When the core is called besides when a request comes.
#[derive(Debug, Clone, Copy)]
enum Calls {
    AsAskedFor,
    Every { us: u64 },
    Never,
}

/// A request and how long after the one before it comes.
type Script = Vec<(u64, Request)>;

fn play(script: &Script, faults: &[(Instant, BoardFault)], late: bool, calls: Calls) -> Vec<Event> {
    let mut board = TestBoard::at([200.0, -300.0, 1000.0, -5.0]);
    board.answers_late = late;
    board.faults = faults.to_vec();
    let mut core = DeviceCore::new(board);
    let mut now = Instant::ZERO;
    let mut events = Vec::new();
    for (gap_us, request) in script {
        let at = Instant::from_micros(now.micros() + gap_us);
        wait(&mut core, now, at, calls);
        now = at;
        let reply = core.handle_request(now, request);
        if let Reply::Status(status) = reply {
            // Encoders are read at that moment too.
            events
                .push(Event::Started(CommandId(status.readback.0[0].unsigned_abs()), status.tick));
        }
        events.extend(std::iter::from_fn(|| core.poll_event()));
        let said: Vec<_> = core.pending_results().cloned().collect();
        for event in said {
            if let Event::Sampled(result) = event {
                core.handle_request(now, &Request::Acknowledge(result.id));
            }
        }
    }
    wait(&mut core, now, Instant::from_micros(now.micros() + 30_000_000), calls);
    core.handle_timeout(Instant::from_micros(now.micros() + 60_000_000));
    events.extend(std::iter::from_fn(|| core.poll_event()));
    events
}

fn wait(core: &mut DeviceCore<TestBoard>, from: Instant, to: Instant, calls: Calls) {
    let mut now = from;
    loop {
        let next = match calls {
            Calls::AsAskedFor => core.poll_timeout(),
            Calls::Every { us } => Some(Instant::from_micros(now.micros() + us)),
            Calls::Never => None,
        };
        let Some(next) = next.filter(|next| *next < to) else { return };
        now = next.max(now);
        core.handle_timeout(now);
    }
}

/// A request whose number is still to be given.
fn request() -> impl Strategy<Value = Request> {
    let id = CommandId(0);
    prop_oneof![
        prop::array::uniform4(0.0..=1.0_f64)
            .prop_map(move |to| move_to(Bench::targets_in_travel(to))(id)),
        (0..50_000_u32, 500..80_000_u32)
            .prop_map(move |(settle_us, duration_us)| dwell(settle_us, duration_us)(id)),
        (1..16_u8).prop_map(move |axes| home(axes)(id)),
        Just(Request::ReadStatus),
        Just(Request::KeepAlive),
        Just(Request::Stop),
        Just(Request::ClearFault),
    ]
}

fn numbered(mut request: Request, number: u32) -> Request {
    match &mut request {
        Request::Home(home) => home.id = CommandId(number),
        Request::MoveTo(move_to) => move_to.id = CommandId(number),
        Request::Dwell(dwell) => dwell.id = CommandId(number),
        _ => {}
    }
    request
}

prop_compose! {
    fn script()(
        steps in prop::collection::vec((0..400_000_u64, request()), 1..40),
    ) -> Script {
        // A homing that ends surely, and then anything.
        let mut script = vec![(0, home(0b1111)(CommandId(1)))];
        script.extend((0..100).map(|_| (40_000, Request::KeepAlive)));
        script.extend((2..).zip(steps).map(|(id, (gap_us, request))| (gap_us, numbered(request, id))));
        script
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn events_do_not_depend_on_when_the_core_is_called(
        script in script(),
        us in 1_000..700_000_u64,
        fault_us in 0..40_000_000_u64,
        channel in 0..4_u8,
    ) {
        let faults = [(Instant::from_micros(fault_us), BoardFault::Stalled(channel))];
        let exact = play(&script, &faults, false, Calls::AsAskedFor);
        prop_assert_eq!(&play(&script, &faults, true, Calls::AsAskedFor), &exact);
        prop_assert_eq!(&play(&script, &faults, true, Calls::Every { us }), &exact);
        prop_assert_eq!(&play(&script, &faults, false, Calls::Every { us }), &exact);
        prop_assert_eq!(&play(&script, &faults, true, Calls::Never), &exact);
    }
}

#[test]
fn a_board_that_answers_late_is_woken_only_when_something_ends() {
    let mut bench = Bench::homed();
    bench.core.board_mut().answers_late = true;
    let target = AXES[0].high;
    bench.accept(move_to([target, 0, 0, 0]));
    bench.accept(dwell(50_000, 200_000));
    let mut wakes = 0;
    while let Some(at) = bench.core.poll_timeout() {
        let sign_of_life = bench.now + LEASE / 4;
        bench.now = at.min(sign_of_life);
        bench.core.link_heard(bench.now);
        wakes += usize::from(bench.now == at);
    }
    assert_eq!(wakes, 3, "the move's end, the settling's, the dwell's");
    let result = bench.events().into_iter().find_map(|event| match event {
        Event::Sampled(result) => Some(result),
        _ => None,
    });
    assert_eq!(result.map(|result| (result.n, result.start.0[0])), Some((400, target)));
}

#[test]
fn a_dwell_is_asked_for_with_its_shutter() {
    let mut bench = Bench::homed();
    bench.accept(|id| {
        let shutter = Shutter::Closed;
        Request::Dwell(firmware_protocol::Dwell {
            id,
            reading: 0x8000_0000,
            gain: 2,
            shutter,
            settle_us: 0,
            duration_us: 1000,
        })
    });
    bench.run();
    let shut = bench.core.board().calls.iter().any(|call| {
        matches!(call, board::Call::BeginDwell(_, light)
            if light.shutter == Shutter::Closed && light.reading == 0x8000_0000 && light.gain == 2)
    });
    assert!(shut);
}
