//! What an axis does under its errors, one at a time.

use super::*;
use crate::mechanics::flaws::{EncoderError, MissedSteps, Ringing};

const NONE: AxisFlaws = AxisFlaws {
    backlash: 0.0,
    encoder_error: None,
    ringing: None,
    missed_steps: None,
    settle_s: None,
    latch_jitter_s: Some(0.0),
};

fn axis() -> NominalAxis {
    NominalAxis {
        channel: 0,
        home: 0.0,
        counts_per_unit: 1000.0,
        travel_counts: (-1000, 1000),
        speed_counts_per_s: 500,
        acceleration_counts_per_s2: 9000,
        settle_s: 0.03,
        has_encoder: true,
        u_zero: 0.01,
        u_homing: 0.001,
        u_readback: 0.0,
    }
}

fn at(ms: u64) -> Instant {
    Instant::from_micros(ms * 1000)
}

#[test]
fn an_axis_stands_still_after_its_settle_time_and_not_before() {
    let mut nominal = axis();
    nominal.u_zero = 0.0;
    nominal.u_homing = 0.0;
    let truth = AxisTruth::draw("theta", &nominal, &NONE, Some(0.5), 0.01, 1);
    let mut axis = Axis::at_boot(&truth);
    axis.set_setpoint(at(100), 200.0);
    // 9000 counts/s² for (10 ms)²: 0.9 counts behind, and on its way.
    assert!((axis.value(at(100)) - 0.1991).abs() < 1e-12);
    assert!(axis.value(at(115)) < 0.2 && axis.value(at(115)) > 0.1998);
    assert_eq!(axis.rests_at(), at(130));
    assert_eq!(axis.value(at(130)).to_bits(), 0.2_f64.to_bits());
    assert_eq!((axis.readback(at(100), true), axis.readback(at(100), false)), (199, 200));
}

#[test]
fn a_homed_axis_is_off_by_what_was_drawn() {
    let truth = AxisTruth::draw("theta", &axis(), &NONE, None, 0.01, 3);
    let mut axis = Axis::at_boot(&truth);
    axis.begin_search();
    assert_eq!(axis.home_mark(), None);
    axis.set_setpoint(at(1), -truth.start_counts - 100.0);
    axis.set_setpoint(at(2), -truth.start_counts + 100.0);
    let mark = axis.home_mark().expect("it was passed");
    axis.set_setpoint(at(3), mark);
    axis.set_home();
    let off = axis.value(at(1000));
    assert!((off - truth.mark_found(0) / 1000.0).abs() < 1e-15);
    assert!(off != 0.0 && off.abs() < 0.06, "{off}");
    assert!((truth.mark_found(0) - truth.mark_found(1)).abs() < 8.0);
    assert!(truth.mark_found(0).to_bits() != truth.mark_found(1).to_bits());
}

#[test]
fn zeros_and_scales_spread_as_stated() {
    let mut nominal = axis();
    nominal.u_homing = 0.0;
    nominal.u_readback = 0.002;
    let rms = |values: &dyn Fn(u64) -> f64| {
        libm::sqrt((0..4000).map(|i| values(i) * values(i)).sum::<f64>() / 4000.0)
    };
    let zero = rms(&|seed| AxisTruth::draw("phi", &nominal, &NONE, None, 0.01, seed).mark_counts);
    assert!((zero / 10.0 - 1.0).abs() < 0.05, "{zero}");
    let truth = AxisTruth::draw("phi", &nominal, &NONE, None, 0.01, 9);
    let scale = rms(&|line| truth.scale_error(line as f64 - 2000.0));
    assert!((scale / 2.0 - 1.0).abs() < 0.05, "{scale}");
}

/// An exact axis with these flaws, homed by a search that way: +1 upwards.
fn homed(flaws: &AxisFlaws, way: f64) -> Axis {
    let mut nominal = axis();
    (nominal.u_zero, nominal.u_homing, nominal.settle_s) = (0.0, 0.0, 0.0);
    let truth = AxisTruth::draw("theta", &nominal, flaws, Some(0.5), 0.01, 1);
    let mut axis = Axis::at_boot(&truth);
    axis.set_setpoint(at(1), -300.0 * way);
    axis.begin_search();
    axis.set_setpoint(at(2), 300.0 * way);
    let mark = axis.home_mark().expect("it was passed");
    axis.set_setpoint(at(3), mark);
    axis.set_home();
    axis
}

#[test]
fn backlash_shows_by_the_side_that_an_axis_comes_from() {
    let flaws = AxisFlaws { backlash: 0.004, ..NONE };
    for way in [1.0, -1.0] {
        let mut axis = homed(&flaws, way);
        // From the side of the search the play is as it was at the mark; from the other the
        // load is further by all of it.
        axis.set_setpoint(at(10), -400.0 * way);
        axis.set_setpoint(at(11), 200.0 * way);
        assert!((axis.value(at(11)) - 0.2 * way).abs() < 1e-15, "{}", axis.value(at(11)));
        axis.set_setpoint(at(12), 500.0 * way);
        axis.set_setpoint(at(13), 200.0 * way);
        assert!((axis.value(at(13)) - 0.204 * way).abs() < 1e-15, "{}", axis.value(at(13)));
        #[allow(clippy::cast_possible_truncation)]
        let sign = way as i32;
        assert_eq!(axis.readback(at(13), true), 204 * sign, "an encoder on the load shows it");
        assert_eq!(axis.readback(at(13), false), 200 * sign);
    }
}

#[test]
fn lost_steps_show_in_an_encoder_and_end_with_homing() {
    let missed = MissedSteps { probability_per_move: 0.25, counts: 4.0 };
    let flaws = AxisFlaws { missed_steps: Some(missed), ..NONE };
    let mut axis = homed(&flaws, 1.0);
    let mut moves = 0;
    while axis.readback(at(20), true) == 10 * moves {
        moves += 1;
        axis.begin_motion(at(20), f64::from(10 * moves));
        axis.set_setpoint(at(20), f64::from(10 * moves));
        assert!(moves < 60, "a quarter of the moves lose steps");
    }
    assert_eq!(axis.readback(at(20), true), 10 * moves - 4, "short of where it was sent");
    assert_eq!(axis.readback(at(20), false), 10 * moves, "nobody knows");
    axis.begin_search();
    axis.set_setpoint(at(30), -20.0);
    let mark = axis.home_mark().expect("it was passed");
    assert!((mark - 4.0).abs() < 1e-12, "the mark comes late: {mark}");
    axis.set_setpoint(at(31), mark);
    axis.set_home();
    assert!(axis.value(at(31)).abs() < 1e-15);
    let lost = (1..=20_000).filter(|number| axis.truth.missed(*number) > 0.0).count();
    // The standard error of 5000 is 61.
    assert!((4750..5250).contains(&lost), "{lost}");
}

#[test]
fn an_axis_rings_after_a_stop_and_is_at_rest_when_that_is_over() {
    let ringing = Ringing { amplitude: 0.01, frequency_hz: 20.0, damping_ratio: 0.1 };
    let flaws = AxisFlaws { ringing: Some(ringing), ..NONE };
    let mut axis = homed(&flaws, 1.0);
    axis.set_setpoint(at(1000), 500.0);
    assert!((axis.value(at(1000)) - 0.51).abs() < 1e-15);
    assert!(axis.value(at(1025)) < 0.5, "half a period later");
    assert_eq!(axis.readback(at(1025), true), 493);
    let rests_at = axis.rests_at();
    assert!(rests_at > at(1700) && rests_at < at(1800), "{rests_at:?}");
    assert_eq!(axis.value(rests_at).to_bits(), 0.5_f64.to_bits());
}

#[test]
fn the_periodic_error_of_a_scale_is_in_the_position_and_not_in_the_readback() {
    let error = EncoderError { amplitude: 0.002, period: 0.5 };
    let mut axis = homed(&AxisFlaws { encoder_error: Some(error), ..NONE }, 1.0);
    let mut largest = 0.0_f64;
    for (i, counts) in (0_u32..).zip([0, 100, 200, 300, 400]) {
        let now = at(100 + u64::from(i));
        axis.set_setpoint(now, f64::from(counts));
        largest = largest.max((axis.value(now) - f64::from(counts) / 1000.0).abs());
        assert_eq!(axis.readback(now, true), counts);
    }
    assert!((0.0019..=0.002).contains(&largest), "{largest}");
}

#[test]
fn in_flight_an_encoder_is_latched_a_little_early_or_late_and_at_rest_it_does_not_matter() {
    let jitter_s = 1e-3;
    let latch = |jitter_s: f64| {
        let mut axis = homed(&AxisFlaws { latch_jitter_s: Some(jitter_s), ..NONE }, 1.0);
        let began = at(1000);
        axis.begin_cruise(began, 400.0, 0.1);
        let read = |ms: u64, axis: &mut Axis| {
            let now = at(1000 + ms);
            axis.set_setpoint(now, 400.0 * seconds(now.since(began)));
            (f64::from(axis.readback(now, true)), axis.setpoint_counts())
        };
        // Whatever the start excites is over by then.
        (500..1500).map(|ms| read(ms, &mut axis)).map(|(found, meant)| found - meant).collect()
    };
    let rms = |errors: &[f64]| {
        libm::sqrt(errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64)
    };
    let (late, exact): (Vec<f64>, Vec<f64>) = (latch(jitter_s), latch(0.0));
    // Rounding to whole counts, and 400 counts a second times a millisecond beside it.
    assert!(exact.iter().all(|error| error.abs() <= 0.5 + 1e-9), "{exact:?}");
    let more = libm::sqrt(rms(&late).powi(2) - rms(&exact).powi(2));
    assert!((0.3..0.55).contains(&more), "{more}");
    let mean = late.iter().sum::<f64>() / late.len() as f64;
    assert!(mean.abs() < 0.1, "{mean}");
}
