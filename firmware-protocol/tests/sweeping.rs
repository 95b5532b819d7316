//! What could break: a window that is not where its number says, a speed that is not constant, a
//! lost window that can't be had again, a sweep that starts without room for its windows.

mod board;

use board::{AXES, Bench, Call, dwell, move_to};
use firmware_protocol::{
    AxisCounts, BoardFault, Cause, CommandId, Event, Instant, Rejection, Reply, Request, Sweep,
    SweepMotion, WINDOWS_MAX, Window,
};

fn counts(values: [i32; 4]) -> AxisCounts {
    AxisCounts(values.into_iter().collect())
}

/// 20 windows of 50 readings of 0.5 ms, of 400 counts on axis 0 and -100 on axis 1.
fn plain(id: CommandId) -> Sweep {
    Sweep {
        id,
        reading: 7000,
        gain: 1,
        settle_us: 20_000,
        lead_us: 10_000,
        readings: 50,
        windows: 20,
        from: counts([-4000, 100, 50, 0]),
        step: counts([400, -100, 0, 0]),
    }
}

fn sweep(change: impl FnOnce(&mut Sweep)) -> impl FnOnce(CommandId) -> Request {
    move |id| {
        let mut sweep = plain(id);
        change(&mut sweep);
        Request::Sweep(sweep)
    }
}

fn windows(events: &[Event]) -> Vec<Window> {
    let window = |event: &Event| match event {
        Event::Window(window) => Some(window.clone()),
        _ => None,
    };
    events.iter().filter_map(window).collect()
}

fn refused(bench: &mut Bench, change: impl FnOnce(&mut Sweep)) -> Rejection {
    match bench.command(sweep(change)) {
        Reply::Rejected(_, rejection) => rejection,
        other => panic!("not refused: {other:?}"),
    }
}

#[test]
fn windows_follow_each_other_at_constant_speed_from_where_they_should() {
    for answers_late in [false, true] {
        let mut bench = Bench::homed();
        bench.core.board_mut().answers_late = answers_late;
        let id = bench.accept(sweep(|_| {}));
        let events = bench.run();
        let taken = windows(&events);
        assert_eq!(taken.len(), 20);
        for (k, window) in (0..).zip(&taken) {
            assert_eq!((window.id, i32::from(window.index)), (id, k));
            assert_eq!(window.duration_us, 25_000);
            let since = window.start_tick.micros_since(taken[0].start_tick);
            assert_eq!(since, k * 25_000);
            let start = [-4000 + 400 * k, 100 - 100 * k, 50, 0];
            assert_eq!(window.start, counts(start), "window {k}");
            assert_eq!(window.moved, counts([400, -100, 0, 0]));
        }
        // Started, the windows, and Done behind them, at rest beyond the last window.
        assert!(matches!(events.first(), Some(Event::Window(_) | Event::Started(..))));
        let Some(Event::Done(done)) = events.last() else { panic!("{events:?}") };
        // 16 000 counts/s and 4000 counts/s: the ramps take 1/3 s, by axis 0.
        let [theta, phi, x, y] = done.readback.0[..] else { panic!("{done:?}") };
        assert_eq!((theta, x, y), (4000 + 2667, 50, 0));
        assert_eq!(phi, 100 - 2000 - 667);
        let board = bench.core.board();
        let cruises = board.calls.iter().filter(|call| matches!(call, Call::Cruise(..)));
        let speeds: Vec<_> = cruises
            .map(|call| {
                if let Call::Cruise(_, channel, speed) = call {
                    (*channel, *speed)
                } else {
                    unreachable!()
                }
            })
            .collect();
        assert_eq!(speeds, [(0, 16_000.0), (1, -4000.0)]);
        let begun: Vec<_> = board
            .calls
            .iter()
            .filter_map(|call| match call {
                Call::BeginWindow(from, until, illumination) => {
                    assert_eq!(until.since(*from).as_micros(), 25_000);
                    Some(illumination.reading)
                }
                _ => None,
            })
            .collect();
        assert_eq!(begun, (7000..7020).collect::<Vec<_>>());
    }
}

#[test]
fn a_windows_statistics_are_those_of_its_own_readings() {
    let mut bench = Bench::homed();
    bench.accept(sweep(|sweep| (sweep.readings, sweep.step) = (7, counts([56, 0, 0, 0]))));
    let taken = windows(&bench.run());
    let board = bench.core.board().clone();
    let mut at: Vec<(Instant, u32)> = Vec::new();
    let mut name = 0;
    for call in &board.calls {
        match call {
            Call::BeginWindow(_, _, illumination) => name = illumination.reading,
            Call::Convert(now) => at.push((*now, name)),
            _ => {}
        }
    }
    assert_eq!(at.len(), 140);
    for (k, window) in taken.iter().enumerate() {
        let own = &at[7 * k..7 * (k + 1)];
        assert!(own.iter().all(|(_, name)| *name == 7000 + u32::from(window.index)));
        // The board's readings go with its illumination and the time.
        assert!(window.min <= window.max && f64::from(window.min) <= window.mean);
        assert_eq!(window.duration_us, 3500);
    }
    let spread: std::collections::BTreeSet<_> = taken.iter().map(|w| w.mean.to_bits()).collect();
    assert_eq!(spread.len(), 20);
}

#[test]
fn what_no_axis_can_do_is_refused_before_anything_moves() {
    let mut bench = Bench::homed();
    assert_eq!(refused(&mut bench, |s| s.windows = 0), Rejection::Senseless);
    assert_eq!(refused(&mut bench, |s| s.readings = 0), Rejection::Senseless);
    assert_eq!(refused(&mut bench, |s| s.gain = 3), Rejection::Senseless);
    assert_eq!(refused(&mut bench, |s| s.step = counts([0; 4])), Rejection::Senseless);
    assert_eq!(refused(&mut bench, |s| s.step = AxisCounts::default()), Rejection::Senseless);
    // 24 000 counts/s are 600 in 25 ms.
    assert_eq!(refused(&mut bench, |s| s.step = counts([601, 0, 0, 0])), Rejection::TooFast(0));
    assert_eq!(
        refused(&mut bench, |s| s.windows = 513),
        Rejection::TooManyWindows(u16::try_from(WINDOWS_MAX).unwrap())
    );
    // The run-up at 400 a window is 2667 and 160 counts of lead; -38 000 is the limit.
    let from = |theta| counts([theta, 0, 50, 0]);
    let step = || counts([400, 0, 0, 0]);
    let beyond = refused(&mut bench, |s| (s.from, s.step) = (from(-35_174), step()));
    assert_eq!(beyond, Rejection::OutsideLimits(0, -38_001));
    let behind = refused(&mut bench, |s| (s.from, s.step) = (from(38_000 - 8000), step()));
    assert_eq!(behind, Rejection::OutsideLimits(0, 40_667));
    assert_eq!(refused(&mut bench, |s| s.from = from(50_000)), Rejection::OutsideLimits(0, 50_000));
    assert!(!bench.core.board().calls.iter().any(|call| matches!(call, Call::Setpoint(..))));
    bench.accept(sweep(|s| (s.from, s.step) = (from(-35_173), step())));
}

#[test]
fn a_lost_window_is_fetched_until_its_sweep_is_acknowledged() {
    let mut bench = Bench::homed();
    let id = bench.accept(sweep(|_| {}));
    let taken = windows(&bench.run());
    let fetched = bench.ask(&Request::FetchWindow(id, 13));
    assert_eq!(fetched, Reply::Fetched(taken[13].clone()));
    let gone = Reply::Rejected(id, Rejection::NoSuchWindow);
    assert_eq!(bench.ask(&Request::FetchWindow(id, 20)), gone);
    bench.acknowledge(id);
    assert_eq!(bench.ask(&Request::FetchWindow(id, 13)), gone);
}

#[test]
fn a_sweep_waits_until_all_of_its_windows_have_a_place() {
    let long = |s: &mut Sweep| (s.windows, s.readings, s.step) = (300, 2, counts([16, 0, 0, 0]));
    let mut bench = Bench::homed();
    let first = bench.accept(sweep(long));
    let second = bench.accept(sweep(long));
    let keep_awake = |bench: &mut Bench| {
        for _ in 0..100 {
            bench.pass_us(100_000);
            bench.core.link_heard(bench.now);
        }
        bench.events()
    };
    let events = keep_awake(&mut bench);
    assert_eq!(windows(&events).len(), 300);
    assert!(events.iter().all(|event| event.command() == first), "the second has not started");
    bench.acknowledge(first);
    let events = bench.run();
    assert_eq!(windows(&events).iter().filter(|window| window.id == second).count(), 300);
}

#[test]
fn a_stop_in_mid_sweep_fails_it_brakes_and_says_no_more_windows() {
    for cause in [Cause::Stopped, Cause::Stalled(0), Cause::Detector, Cause::LeaseExpired] {
        let mut bench = Bench::homed();
        let id = bench.accept(sweep(|s| (s.windows, s.step) = (200, counts([40, 0, 0, 0]))));
        bench.accept(dwell(0, 50_000));
        // Into the windows, which take five seconds.
        while !bench.core.board().calls.iter().any(|call| matches!(call, Call::Convert(_))) {
            bench.pass_us(50_000);
            bench.core.link_heard(bench.now);
        }
        match cause {
            Cause::Stopped => drop(bench.ask(&Request::Stop)),
            Cause::LeaseExpired => bench.pass_us(600_000),
            Cause::Detector => {
                bench.core.board_mut().detector_dies_at = Some(bench.now);
                bench.pass_us(10_000);
            }
            _ => {
                let fault = (bench.now, BoardFault::Stalled(0));
                bench.core.board_mut().faults.push(fault);
                bench.pass_us(1);
            }
        }
        let failed = bench.events().into_iter().find_map(|event| match event {
            Event::Failed(failed, why, _) => Some((failed, why)),
            _ => None,
        });
        assert_eq!(failed, Some((id, cause)));
        bench.pass_us(2_000_000);
        assert!(windows(&bench.events()).is_empty(), "{cause:?}");
        let status = bench.core.status(bench.now);
        assert!(!status.moving && status.fault == Some(cause));
    }
}

#[test]
fn a_sweep_starts_from_rest_after_what_was_queued_before_it() {
    let mut bench = Bench::homed();
    bench.accept(move_to([3000, 0, 0, 0]));
    bench.accept(sweep(|_| {}));
    bench.accept(move_to([0; 4]));
    let events = bench.run();
    assert_eq!(windows(&events).len(), 20);
    assert_eq!(windows(&events)[0].start, counts([-4000, 100, 50, 0]));
    let done = events.iter().filter(|event| matches!(event, Event::Done(_))).count();
    assert_eq!(done, 3);
}

#[test]
fn the_motion_is_what_the_device_does() {
    let mut bench = Bench::homed();
    bench.core.board_mut().answers_late = true;
    let motion = SweepMotion::new(&AXES, 2000, &plain(CommandId(0))).unwrap();
    bench.accept(sweep(|_| {}));
    let events = bench.run();
    let Some(Event::Done(done)) = events.last() else { panic!("{events:?}") };
    let first = &windows(&events)[0];
    let set_out = u64::from(first.start_tick.0) - motion.before_us();
    assert_eq!(u64::from(done.tick.0) - set_out, motion.duration_us());
    assert_eq!(motion.reading_us(0), motion.before_us());
    assert_eq!(motion.reading_us(motion.readings()) - motion.reading_us(0), 500_000);
    for (place, cruise) in done.readback.0.iter().zip(motion.axes()) {
        assert!((f64::from(*place) - cruise.to).abs() <= 0.5);
    }
}
