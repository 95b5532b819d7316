//! What could break: an axis driven beyond its speed, acceleration or travel, or a profile whose
//! way left is noise just before the stop.

mod board;

use board::{AXES, Bench, Call, move_to};
use firmware_protocol::{Event, Instant, Request, Trapezoid};
use proptest::prelude::*;

/// Rounding of a position of 1e5 counts, with room: counts.
const ROUNDING: f64 = 1e-9;

/// Each row: distance, greatest speed and acceleration (and a time), and the answer to 17 digits
/// from 100-digit arithmetic, with the tolerance that a stable formula reaches easily.
#[test]
fn profiles_agree_with_many_digit_arithmetic() {
    for line in include_str!("data/motion.jsonl").lines() {
        let row: serde_json::Value = serde_json::from_str(line).unwrap();
        let input = |name: &str| row["inputs"][name].as_f64().unwrap();
        let profile = Trapezoid::new(input("distance"), input("vmax"), input("amax")).unwrap();
        let answer = match row["quantity"].as_str().unwrap() {
            "trapezoidal-move-time" => profile.duration_s(),
            "trapezoidal-remaining" => profile.remaining(input("time")),
            other => panic!("{other}?"),
        };
        let expected: f64 = row["expected"].as_str().unwrap().parse().unwrap();
        let tolerance =
            row["rel_tol"].as_f64().unwrap() * expected.abs() + row["abs_tol"].as_f64().unwrap();
        assert!((answer - expected).abs() <= tolerance, "{answer} from {line}");
    }
}

#[test]
fn a_move_takes_as_long_as_its_slowest_axis() {
    let mut bench = Bench::homed();
    let start = bench.now;
    bench.accept(move_to([12_000, 36_000, 0, 0]));
    bench.run();
    // Axis 0 alone would need 12000/24000 + 24000/48000 = 1 s; axis 1, a triangle, needs
    // 2 sqrt(36000 / 30000) = 2.1908902 s, rounded up to a whole microsecond.
    let slowest_us = 2_190_891;
    assert_eq!(bench.now.since(start).as_micros(), slowest_us);
}

#[test]
fn a_move_to_where_it_is_ends_at_once() {
    let mut bench = Bench::homed();
    let id = bench.accept(move_to([0; 4]));
    bench.core.handle_timeout(bench.now);
    let events = bench.events();
    assert!(matches!(events[0], Event::Started(started, _) if started == id));
    assert!(matches!(&events[1], Event::Done(done) if done.tick == bench.now.tick()));
    assert_eq!(bench.core.poll_timeout(), None);
}

proptest! {
    #[test]
    fn axes_keep_their_limits_and_arrive_together(
        from in prop::array::uniform4(0.0..=1.0_f64),
        to in prop::array::uniform4(0.0..=1.0_f64),
    ) {
        let mut bench = Bench::homed();
        let (from, to) = (Bench::targets_in_travel(from), Bench::targets_in_travel(to));
        bench.accept(move_to(from));
        bench.run();
        let start = bench.now;
        bench.core.board_mut().calls.clear();
        let id = bench.accept(move_to(to));
        let events = bench.run();
        let Some(Event::Done(done)) = events.last() else { panic!("{events:?}") };
        prop_assert_eq!(done.id, id);
        prop_assert_eq!(done.readback.0.as_slice(), &to[..]);
        check_tracks(&bench, start, from)?;
        for channel in 0..4_u8 {
            let track = track(&bench, channel);
            if let Some((at, place)) = track.last() {
                prop_assert!(place.to_bits() == f64::from(to[usize::from(channel)]).to_bits());
                prop_assert_eq!(*at, bench.now);
            }
        }
    }

    #[test]
    fn stopping_brakes_within_limits_and_keeps_the_home(
        to in prop::array::uniform4(0.0..=1.0_f64),
        stop_us in 0..6_000_000_u64,
        late in any::<bool>(),
    ) {
        stops_well(to, stop_us, late)?;
    }

    #[test]
    fn what_is_travelled_and_what_remains_make_the_whole(
        distance in 1e-3..1e6_f64,
        speed in 1e-2..1e5_f64,
        acceleration in 1e-2..1e5_f64,
        part in 0.0..=1.0_f64,
    ) {
        let profile = Trapezoid::new(distance, speed, acceleration).unwrap();
        let t = part * profile.duration_s();
        let whole = profile.travelled(t) + profile.remaining(t);
        prop_assert!((whole - distance).abs() <= 1e-14 * distance);
        prop_assert!(profile.travelled(t) <= t * speed * (1.0 + 1e-14));
    }
}

/// Sends all axes to parts of their travel, and stops them on the way.
fn stops_well(to: [f64; 4], stop_us: u64, late: bool) -> Result<(), TestCaseError> {
    let mut bench = Bench::homed();
    let start = bench.now;
    let to = Bench::targets_in_travel(to);
    bench.core.board_mut().answers_late = late;
    bench.accept(move_to(to));
    for _ in 0..stop_us / 100_000 {
        bench.pass_us(100_000);
        bench.ask(&Request::KeepAlive);
    }
    bench.pass_us(stop_us % 100_000);
    bench.core.board_mut().answers_late = false;
    bench.ask(&Request::Stop);
    bench.run();
    let status = bench.core.status(bench.now);
    prop_assert!(!status.moving && status.homed.0 == 0b1111);
    if !late {
        check_tracks(&bench, start, [0; 4])?;
    }
    for (channel, &target) in to.iter().enumerate() {
        let place = bench.core.board().places[channel];
        let target = f64::from(target);
        prop_assert!(place >= target.min(0.0) && place <= target.max(0.0));
    }
    Ok(())
}

#[test]
fn an_axis_that_comes_to_rest_within_the_last_microsecond_keeps_its_limits() {
    let to = [0.568_518_498_763_548, 0.762_492_037_287_291_6, 0.0, 0.021_545_642_195_131_94];
    stops_well(to, 5_094_152, false).unwrap();
}

/// The setpoints that an axis got, with their times.
fn track(bench: &Bench, channel: u8) -> Vec<(Instant, f64)> {
    let of_channel = |call: &Call| match call {
        Call::Setpoint(at, of, counts) if *of == channel => Some((*at, *counts)),
        _ => None,
    };
    let mut track: Vec<_> = bench.core.board().calls.iter().filter_map(of_channel).collect();
    track.dedup_by_key(|(at, _)| *at);
    track
}

/// Between two setpoints the mean speed, and between two such stretches the mean acceleration,
/// cannot exceed the greatest if the path never does.
fn check_tracks(bench: &Bench, start: Instant, from: [i32; 4]) -> Result<(), TestCaseError> {
    for (channel, axis) in (0_u8..).zip(&AXES) {
        let mut track = track(bench, channel);
        track.retain(|(at, _)| *at > start);
        track.insert(0, (start, f64::from(from[usize::from(channel)])));
        let mut before: Option<(f64, f64)> = None;
        for pair in track.windows(2) {
            let seconds = pair[1].0.since(pair[0].0).as_secs_f64();
            let velocity = (pair[1].1 - pair[0].1) / seconds;
            prop_assert!(velocity.abs() <= f64::from(axis.speed) + ROUNDING / seconds);
            let (velocity_before, seconds_before) = before.unwrap_or((0.0, 0.0));
            let between = 0.5 * (seconds + seconds_before);
            let change = (velocity - velocity_before).abs();
            let allowed = f64::from(axis.acceleration) * between;
            let rounding = ROUNDING / seconds + ROUNDING / seconds_before.max(seconds);
            // A path ends within a microsecond, and is said to have ended at its end: over the last
            // stretch it was faster than its mean by as much.
            let rounding = rounding + velocity.abs() * 1e-6 / seconds;
            prop_assert!(change <= allowed + rounding, "channel {channel}: {change} > {allowed}");
            let is_within = pair[1].1 >= f64::from(axis.low) && pair[1].1 <= f64::from(axis.high);
            prop_assert!(is_within, "channel {channel} at {}", pair[1].1);
            before = Some((velocity, seconds));
        }
    }
    Ok(())
}
