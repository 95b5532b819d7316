//! What could break: an axis that does not find its home mark from where it happens to stand, or
//! counts from somewhere else; a search that runs through a limit switch or for ever.

mod board;

use board::{AXES, Bench, Call, TestBoard, home, move_to};
use firmware_protocol::{BoardFault, Cause, Event, Instant, Rejection, Reply, Request};
use proptest::prelude::*;

/// Places in the travel, by fractions of it.
fn places(fractions: [f64; 4]) -> [f64; 4] {
    std::array::from_fn(|i| {
        f64::from(AXES[i].low) + fractions[i] * f64::from(AXES[i].high - AXES[i].low)
    })
}

fn is_done(events: &[Event]) -> bool {
    matches!(events.last(), Some(Event::Done(_)))
}

proptest! {
    #[test]
    fn the_mark_is_found_from_anywhere_in_the_travel(
        fractions in prop::array::uniform4(0.0..=1.0_f64),
        with_switches in any::<bool>(),
        to in prop::array::uniform4(0.0..=1.0_f64),
    ) {
        let mut board = TestBoard::at(places(fractions));
        if with_switches {
            // Just outside the travel; the search would go beyond where it starts to a side.
            for (switch, axis) in board.switches.iter_mut().zip(&AXES) {
                *switch = Some((f64::from(axis.low) - 500.0, f64::from(axis.high) + 500.0));
            }
        }
        let mut bench = Bench::new(board);
        bench.accept(home(0b1111));
        let events = bench.run();
        prop_assert!(is_done(&events), "{events:?}");
        let status = bench.core.status(bench.now);
        prop_assert_eq!(status.homed.0, 0b1111);
        prop_assert_eq!(status.readback.0.as_slice(), &[0; 4]);
        // Back and forth over the whole travel at a quarter of the speed is the worst.
        prop_assert!(bench.now.micros() < 60_000_000, "{:?}", bench.now);
        // From now on counts are places: targets are met where the mark says.
        bench.core.board_mut().switches = vec![None; 4];
        let to = Bench::targets_in_travel(to);
        bench.accept(move_to(to));
        prop_assert!(is_done(&bench.run()));
        for (place, target) in bench.core.board().places.iter().zip(to) {
            prop_assert!((place - f64::from(target)).abs() < 1e-9);
        }
    }

    #[test]
    fn homing_again_ends_on_the_same_mark(fractions in prop::array::uniform4(0.0..=1.0_f64)) {
        let mut bench = Bench::homed();
        bench.accept(move_to(Bench::targets_in_travel(fractions)));
        bench.run();
        let start = bench.now;
        bench.accept(home(0b1111));
        prop_assert!(is_done(&bench.run()));
        for place in &bench.core.board().places {
            prop_assert!(place.abs() < 1e-9);
        }
        // It knows the way: no search to the wrong side.
        prop_assert!(bench.now.since(start).as_secs_f64() < 22.0, "{:?}", bench.now.since(start));
    }
}

#[test]
fn an_axis_that_stands_on_its_mark_is_home_at_once() {
    let mut bench = Bench::new(TestBoard::at([0.0; 4]));
    bench.accept(home(0b0100));
    assert!(is_done(&bench.run()));
    assert_eq!(bench.now, Instant::ZERO);
    assert_eq!(bench.core.status(bench.now).homed.0, 0b0100);
}

#[test]
fn a_missing_mark_is_a_fault_that_names_the_axis() {
    let mut board = TestBoard::at([100.0; 4]);
    board.has_mark[1] = false;
    let mut bench = Bench::new(board);
    let id = bench.accept(home(0b0011));
    let events = bench.run();
    let Some(Event::Failed(failed, Cause::HomingMissed(1), _)) = events.last() else {
        panic!("{events:?}")
    };
    assert_eq!(*failed, id);
    let status = bench.core.status(bench.now);
    assert_eq!((status.homed.0, status.moving), (0b0001, false));
    let faulted = Rejection::Faulted(Cause::HomingMissed(1));
    assert!(matches!(bench.command(home(0b1)), Reply::Rejected(_, why) if why == faulted));
}

#[test]
fn limit_switches_on_both_sides_end_the_search() {
    let mut board = TestBoard::at([5_000.0, 0.0, 0.0, 0.0]);
    board.has_mark[0] = false;
    board.switches[0] = Some((-39_000.0, 39_000.0));
    let mut bench = Bench::new(board);
    bench.accept(home(0b1));
    let events = bench.run();
    assert!(
        matches!(events.last(), Some(Event::Failed(_, Cause::LimitSwitch(0), _))),
        "{events:?}"
    );
    // Braking from homing speed, 6000²/(2 · 48000) = 375 counts, ends shortly behind the switch.
    assert!((bench.core.board().places[0] - 39_400.0).abs() < 100.0);
}

#[test]
fn unhomed_axes_refuse_to_move() {
    let mut bench = Bench::new(TestBoard::at([10.0; 4]));
    bench.accept(home(0b1011));
    bench.run();
    let reply = bench.command(move_to([0; 4]));
    assert!(matches!(reply, Reply::Rejected(_, Rejection::Unhomed(2))), "{reply:?}");
}

#[test]
fn a_stop_while_homing_leaves_only_what_was_found() {
    let mut bench = Bench::new(TestBoard::at([0.0, 50_000.0, 0.0, 0.0]));
    bench.accept(home(0b1111));
    bench.pass_us(300_000);
    assert_eq!(bench.ask(&Request::Stop), Reply::Stopping);
    bench.run();
    let status = bench.core.status(bench.now);
    assert_eq!((status.homed.0, status.moving), (0b1101, false));
    assert_eq!(bench.ask(&Request::ClearFault), Reply::Cleared);
    bench.accept(home(0b0010));
    assert!(is_done(&bench.run()));
    assert!(bench.core.board().places[1].abs() < 1e-9);
}

#[test]
fn a_switch_or_a_stall_takes_the_home_away() {
    for (fault, cause) in [
        (BoardFault::LimitSwitch(2), Cause::LimitSwitch(2)),
        (BoardFault::Stalled(2), Cause::Stalled(2)),
    ] {
        let mut bench = Bench::homed();
        let at = Instant::from_micros(bench.now.micros() + 70_000);
        bench.core.board_mut().faults = vec![(at, fault)];
        bench.accept(move_to([1000, 1000, 9000, 900]));
        let events = bench.run();
        let failed = events.last();
        assert!(
            matches!(failed, Some(Event::Failed(_, why, tick)) if *why == cause && *tick == at.tick()),
            "{events:?}"
        );
        let status = bench.core.status(bench.now);
        assert_eq!((status.homed.0, status.fault), (0b1011, Some(cause)));
    }
}

#[test]
fn axes_are_set_home_at_rest() {
    let mut bench = Bench::new(TestBoard::at([-1234.5, 777.25, 4.0, -9.0]));
    bench.accept(home(0b1111));
    bench.run();
    let calls = &bench.core.board().calls;
    for channel in 0..4 {
        let set_home =
            calls.iter().position(|call| matches!(call, Call::SetHome(_, of) if *of == channel));
        let after = calls[set_home.unwrap()..]
            .iter()
            .any(|call| matches!(call, Call::Setpoint(_, of, _) if *of == channel));
        assert!(!after, "channel {channel} moved after it was home");
    }
}
