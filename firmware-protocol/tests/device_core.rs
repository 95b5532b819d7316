//! What could break: commands out of order or executed twice, a result lost, a device that goes
//! on although its host is gone, a fault that clears itself.

mod board;

use board::{Bench, Call, TestBoard, dwell, home, move_to};
use firmware_protocol::{
    AxisCounts, AxisMask, BoardFault, Cause, CommandId, DeviceCore, Dwell, Event, Home,
    Illumination, Instant, LEASE, MoveTo, QUEUE_DEPTH, RESULTS_MAX, Rejection, Reply, Request,
    Shutter, Tick,
};

fn id_of(event: &Event) -> CommandId {
    match event {
        Event::Started(id, _) | Event::Failed(id, _, _) => *id,
        Event::Done(done) => done.id,
        Event::Sampled(result) => result.id,
        Event::Window(window) => window.id,
    }
}

fn rejection(reply: &Reply) -> Rejection {
    match reply {
        Reply::Rejected(_, rejection) => *rejection,
        other => panic!("not rejected: {other:?}"),
    }
}

fn refused(bench: &mut Bench, command: impl FnOnce(CommandId) -> Request) -> Rejection {
    rejection(&bench.command(command))
}

#[test]
fn commands_run_in_order_each_from_the_end_of_the_one_before() {
    let mut bench = Bench::homed();
    let first = bench.accept(move_to([1000, 0, 0, 0]));
    let second = bench.accept(dwell(20_000, 50_000));
    let third = bench.accept(move_to([0; 4]));
    let events = bench.run();
    let ids: Vec<_> = events.iter().map(id_of).collect();
    assert_eq!(ids, [first, first, second, second, third, third]);
    let [_, Event::Done(moved), Event::Started(_, settle), Event::Sampled(read), ..] = &events[..]
    else {
        panic!("{events:?}")
    };
    assert_eq!(moved.tick, *settle);
    assert_eq!(read.start_tick.micros_since(*settle), 20_000);
    assert_eq!(read.end_tick.micros_since(read.start_tick), 50_000);
    let Event::Started(_, back) = events[4] else { panic!("{events:?}") };
    assert_eq!(back, read.end_tick);
    assert_eq!(read.start.0.as_slice(), &[1000, 0, 0, 0]);
    assert_eq!(read.end, read.start);
    assert_eq!((read.reading, read.gain, read.n), (second.0 + 1000, 1, 100));
}

#[test]
fn a_dwell_reports_its_readings_exactly() {
    let mut bench = Bench::homed();
    bench.core.board_mut().adc = (6, 3000);
    bench.accept(dwell(1, 100_100));
    let events = bench.run();
    let Some(Event::Sampled(result)) = events.last() else { panic!("{events:?}") };
    let board = bench.core.board();
    let times: Vec<_> = board
        .calls
        .iter()
        .filter_map(|call| if let Call::Convert(at) = call { Some(*at) } else { None })
        .collect();
    let begin = times[0].micros() - 333;
    let thirds: Vec<_> = (1..=300).map(|k| Instant::from_micros(begin + k * 1000 / 3)).collect();
    assert_eq!(times, thirds);

    let readings: Vec<i64> = times.iter().map(|at| i64::from(board.reading(*at))).collect();
    let n = 300_i64;
    let sum: i64 = readings.iter().sum();
    let squares: i64 = readings.iter().map(|x| x * x).sum();
    let (mean, variance) = (sum as f64 / 300.0, (n * squares - sum * sum) as f64 / (300.0 * 299.0));
    assert_eq!(result.n, 300);
    assert_eq!(result.mean.to_bits(), mean.to_bits());
    assert_eq!(result.variance.to_bits(), variance.to_bits());
    assert_eq!(i64::from(result.min), *readings.iter().min().unwrap());
    assert_eq!(i64::from(result.max), *readings.iter().max().unwrap());
    let at_ends = readings.iter().filter(|&&x| x == -32 || x == 31).count();
    assert_eq!(usize::try_from(result.saturated).unwrap(), at_ends);
    assert!(at_ends > 0);
    let illumination = Illumination { reading: result.reading, gain: 1, shutter: Shutter::Open };
    let prepared = Instant::from_micros(begin - 1);
    assert_eq!(board.calls[0], Call::Prepare(prepared, illumination));
    assert_eq!(board.calls[1], Call::BeginDwell(Instant::from_micros(begin), illumination));
}

#[test]
fn senseless_and_impossible_commands_are_refused() {
    let mut bench = Bench::homed();
    let at = |gain, duration_us| {
        move |id| {
            let (reading, shutter) = (0, Shutter::Closed);
            Request::Dwell(Dwell { id, reading, gain, shutter, settle_us: 0, duration_us })
        }
    };
    assert_eq!(refused(&mut bench, at(0, 499)), Rejection::Senseless);
    assert_eq!(refused(&mut bench, at(3, 1000)), Rejection::Senseless);
    assert_eq!(refused(&mut bench, home(0)), Rejection::Senseless);
    assert_eq!(refused(&mut bench, home(0b1_0001)), Rejection::Senseless);
    let short = |id| Request::MoveTo(MoveTo { id, targets: AxisCounts::default() });
    assert_eq!(refused(&mut bench, short), Rejection::Senseless);
    let beyond = move_to([0, 0, 50_001, 0]);
    assert_eq!(refused(&mut bench, beyond), Rejection::OutsideLimits(2, 50_001));
    let below = move_to([i32::MIN, 0, 0, 0]);
    assert_eq!(refused(&mut bench, below), Rejection::OutsideLimits(0, i32::MIN));
    bench.accept(at(2, 500));
}

#[test]
fn limits_are_inclusive() {
    let mut bench = Bench::homed();
    bench.accept(move_to([-38_000, 72_000, 50_000, -40_000]));
}

#[test]
fn numbers_rise_and_refused_ones_are_not_used_up() {
    let mut bench = Bench::homed();
    let request = |id| dwell(0, 500)(CommandId(id));
    assert_eq!(bench.ask(&request(100)), Reply::Accepted(CommandId(100)));
    assert_eq!(rejection(&bench.ask(&request(100))), Rejection::IdReused);
    assert_eq!(rejection(&bench.ask(&request(99))), Rejection::IdReused);
    let far = move_to([i32::MAX; 4])(CommandId(200));
    assert_eq!(rejection(&bench.ask(&far)), Rejection::OutsideLimits(0, i32::MAX));
    assert_eq!(bench.core.status(bench.now).last_id, Some(CommandId(100)));
    assert_eq!(bench.ask(&request(101)), Reply::Accepted(CommandId(101)));
}

#[test]
fn the_queue_holds_what_it_says_behind_the_running_command() {
    let mut bench = Bench::homed();
    for _ in 0..=QUEUE_DEPTH {
        bench.accept(dwell(0, 1000));
    }
    assert_eq!(refused(&mut bench, dwell(0, 1000)), Rejection::QueueFull);
    assert_eq!(usize::from(bench.core.identity().queue_depth), QUEUE_DEPTH);
    assert_eq!(usize::from(bench.core.status(bench.now).queued), QUEUE_DEPTH);
    bench.pass_us(1000);
    bench.accept(dwell(0, 1000));
}

#[test]
fn results_stay_until_acknowledged_and_keep_their_place() {
    let mut bench = Bench::homed();
    let mut ids = Vec::new();
    for _ in 0..RESULTS_MAX {
        ids.push(bench.accept(dwell(0, 500)));
        bench.pass_us(500);
    }
    assert_eq!(bench.core.pending_results().count(), 0, "nobody was told of them yet");
    let said = bench.events();
    assert_eq!(said.len(), 2 * RESULTS_MAX);
    assert_eq!(refused(&mut bench, dwell(0, 500)), Rejection::QueueFull);
    let pending: Vec<_> = bench.core.pending_results().map(id_of).collect();
    assert_eq!(pending, ids);
    bench.acknowledge(ids[3]);
    bench.acknowledge(ids[3]);
    assert_eq!(bench.core.pending_results().count(), RESULTS_MAX - 1);
    assert_eq!(usize::from(bench.core.status(bench.now).unacknowledged), RESULTS_MAX - 1);
    bench.accept(dwell(0, 500));
    assert_eq!(refused(&mut bench, dwell(0, 500)), Rejection::QueueFull);
}

#[test]
fn a_result_nobody_was_told_of_cannot_be_acknowledged_away() {
    let mut bench = Bench::homed();
    let id = bench.accept(dwell(0, 500));
    bench.pass_us(500);
    bench.acknowledge(id);
    assert_eq!(bench.events().len(), 2);
    assert_eq!(bench.core.pending_results().count(), 1);
}

#[test]
fn a_silent_host_ends_motion_exactly_when_the_lease_runs_out() {
    let mut bench = Bench::homed();
    let start = bench.now;
    let running = bench.accept(move_to([38_000, 0, 0, 0]));
    let waiting = bench.accept(dwell(0, 500));
    bench.pass_us(3_000_000);
    let expiry = (start + LEASE).tick();
    let events = bench.events();
    assert_eq!(events[1], Event::Failed(running, Cause::LeaseExpired, expiry));
    assert_eq!(events[2], Event::Failed(waiting, Cause::LeaseExpired, expiry));
    let status = bench.core.status(bench.now);
    assert_eq!((status.fault, status.homed.0), (Some(Cause::LeaseExpired), 0b1111));
    assert!(!status.moving);
    // 0.5 s at 48000 counts/s² to 24000 counts/s and as long to stop: 6000 + 6000 counts.
    assert_eq!(status.readback.0[0], 12_000);
    assert_eq!(bench.core.poll_timeout(), None);
    let why = refused(&mut bench, dwell(0, 500));
    assert_eq!(why, Rejection::Faulted(Cause::LeaseExpired));
    bench.ask(&Request::ClearFault);
    bench.accept(move_to([0; 4]));
}

#[test]
fn an_idle_device_has_no_lease() {
    let mut bench = Bench::homed();
    assert_eq!(bench.core.poll_timeout(), None);
    bench.pass_us(3_600_000_000);
    bench.accept(dwell(0, 499_000));
    bench.pass_us(3_600_000_000);
    assert_eq!(bench.core.status(bench.now).fault, None);
    assert_eq!(bench.events().len(), 2);
}

#[test]
fn a_command_that_ends_with_the_lease_has_ended() {
    let mut bench = Bench::homed();
    bench.accept(dwell(0, 500_000));
    bench.pass_us(1_000_000);
    assert!(matches!(bench.events()[..], [_, Event::Sampled(_)]));
    assert_eq!(bench.core.status(bench.now).fault, None);
}

#[test]
fn any_frame_renews_the_lease() {
    let mut bench = Bench::homed();
    bench.accept(dwell(0, 5_000_000));
    for _ in 0..20 {
        bench.pass_us(499_999);
        bench.core.link_heard(bench.now);
    }
    assert!(matches!(bench.events()[..], [_, Event::Sampled(_)]));
}

#[test]
fn stop_latches_until_cleared_even_at_rest() {
    let mut bench = Bench::homed();
    assert_eq!(bench.ask(&Request::Stop), Reply::Stopping);
    let why = refused(&mut bench, dwell(0, 500));
    assert_eq!(why, Rejection::Faulted(Cause::Stopped));
    assert_eq!(bench.ask(&Request::ClearFault), Reply::Cleared);
    bench.accept(dwell(0, 500));
}

#[test]
fn after_a_stop_the_next_command_waits_until_the_axes_rest() {
    let mut bench = Bench::homed();
    let start = bench.now;
    bench.accept(move_to([38_000, 0, 0, 0]));
    bench.pass_us(250_000);
    bench.ask(&Request::Stop);
    bench.ask(&Request::ClearFault);
    assert!(bench.core.status(bench.now).moving);
    bench.events();
    bench.accept(dwell(0, 500));
    let events = bench.run();
    let rest = Instant::from_micros(start.micros() + 500_000);
    assert!(matches!(events[0], Event::Started(_, tick) if tick == rest.tick()), "{events:?}");
}

#[test]
fn the_first_cause_stays_the_reason() {
    let mut bench = Bench::homed();
    bench.accept(move_to([38_000, 0, 0, 0]));
    bench.pass_us(100_000);
    bench.ask(&Request::Stop);
    let at = Instant::from_micros(bench.now.micros() + 1000);
    bench.core.board_mut().faults = vec![(at, BoardFault::LimitSwitch(0))];
    bench.run();
    let status = bench.core.status(bench.now);
    assert_eq!((status.fault, status.homed.0), (Some(Cause::Stopped), 0b1110));
}

#[test]
fn a_dead_detector_fails_the_dwell_at_its_moment() {
    let mut bench = Bench::homed();
    let dies = Instant::from_micros(bench.now.micros() + 10_000);
    bench.core.board_mut().detector_dies_at = Some(dies);
    let id = bench.accept(dwell(250, 50_000));
    let events = bench.run();
    let at = Instant::from_micros(dies.micros() + 250); // the end of the first reading after it
    assert_eq!(events[1], Event::Failed(id, Cause::Detector, at.tick()));
    assert_eq!(bench.core.status(bench.now).homed.0, 0b1111);
}

#[test]
fn a_new_session_stops_and_forgets_but_an_old_one_goes_on() {
    let mut bench = Bench::homed();
    assert!(matches!(bench.ask(&Request::Identify(5)), Reply::Identity(_)));
    let last = bench.accept(move_to([38_000, 0, 0, 0]));
    bench.pass_us(100_000);
    bench.ask(&Request::Identify(5));
    assert_eq!(bench.core.status(bench.now).running, Some(last));
    bench.ask(&Request::Identify(6));
    let status = bench.core.status(bench.now);
    assert_eq!((status.running, status.fault, status.moving), (None, None, true));
    assert_eq!((status.last_id, status.homed), (Some(last), AxisMask(0b1111)));
    assert!(bench.run().is_empty());
    assert!(!bench.core.status(bench.now).moving);
}

#[test]
fn a_fault_survives_a_new_session() {
    let mut bench = Bench::homed();
    bench.ask(&Request::Stop);
    bench.ask(&Request::Identify(9));
    assert_eq!(bench.core.status(bench.now).fault, Some(Cause::Stopped));
}

#[test]
fn ticks_wrap_without_a_trace() {
    let mut core = DeviceCore::new(TestBoard::at([0.0; 4]));
    let start = Instant::from_micros((1 << 32) - 10_000);
    let home = Home { id: CommandId(1), axes: AxisMask(0b1111) };
    core.handle_request(start, &Request::Home(home));
    core.handle_request(start, &move_to([10, 0, 0, 0])(CommandId(2)));
    core.handle_request(start, &dwell(0, 20_000)(CommandId(3)));
    while let Some(at) = core.poll_timeout() {
        core.handle_timeout(at);
    }
    let events: Vec<_> = std::iter::from_fn(|| core.poll_event()).collect();
    assert_eq!(events[0], Event::Started(CommandId(1), start.tick()));
    let Some(Event::Sampled(result)) = events.last() else { panic!("{events:?}") };
    assert!(result.end_tick.0 < 60_000, "{:?}", result.end_tick);
    assert_eq!(result.end_tick.micros_since(result.start_tick), 20_000);
    assert!(Tick(u32::MAX).is_before(result.end_tick));
}

#[test]
fn time_does_not_go_back() {
    let mut bench = Bench::homed();
    let later = Instant::from_micros(bench.now.micros() + 1_000_000);
    bench.core.handle_timeout(later);
    let status = bench.core.status(bench.now);
    assert_eq!(status.tick, later.tick());
}
