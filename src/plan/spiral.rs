//! Spirals of a plan: the turntable turns while the arm rises, and readings are taken in windows on the way.
//! A table does not turn for ever: it goes forth and back, a turn a sweep, and the arm rises in each by the
//! distance between turns; the last goes round the rim.
//!
//! A turn's speed follows from its own circle, which is the smaller the nearer the pole: so that turns
//! are a shorter way than meridians, which crowd there. How far a window may go is [`sweep`]'s matter.

use std::f64::consts::PI;
use std::time::Duration;

use firmware_protocol::{Rejection, WINDOWS_MAX};
use spanned_toml::Problem;

use super::sweep::{self, Line};
use super::{Plan, Schedule, TARGETS_MAX, grid};
use crate::rig::{Approach, AxisPositions, Flight, Latched, Rig};

/// A window turns no further: its way counts as straight (see [`fit::Readings::flown`]).
const WINDOW_TURN_RAD: f64 = PI / 18.0;
/// The turntable's place among the axes.
const TABLE: usize = 1;

/// The sweeps of a spiral plan, in the order in which they are flown.
pub(super) fn lines(plan: &Plan, rig: &Rig) -> Result<Vec<Line>, Problem> {
    let Schedule::Spiral { x_count, y_count, theta_step_deg, is_interleaved, .. } = plan.schedule
    else {
        return Ok(Vec::new());
    };
    sweep::check_wire(plan, rig)?;
    let places = sweep::places(plan, x_count, y_count);
    let turns = turns(plan.region.theta_max_rad, theta_step_deg.to_radians());
    if is_interleaved && turns.len() < places.len() {
        return Err(plan.problem(
            "schedule",
            "interleaved",
            &format!("{} turns for {} places", turns.len(), places.len()),
            "at least one turn a place",
            "lower theta_step_deg, or take fewer places",
        ));
    }
    let mut lines = Vec::new();
    let (mut lowest, mut is_back) = (0, false);
    for (place, (x_m, y_m)) in places.iter().enumerate() {
        let is_here = |k: &usize| !is_interleaved || grid::dealt(*k, places.len()) == place;
        let mut here: Vec<Turn> = (0..turns.len()).filter(is_here).map(|k| turns[k]).collect();
        // In again where the one before went out.
        let is_inward = match rig.axes[0].approach {
            Approach::Either => place % 2 == 1,
            side => side == Approach::Negative,
        };
        if is_inward {
            here = here.into_iter().rev().map(|(low, high)| (high, low)).collect();
        }
        for turn in here {
            let is_backward = match rig.axes[TABLE].approach {
                Approach::Either => is_back,
                side => side == Approach::Negative,
            };
            let at = rig.counts(AxisPositions([0.0, 0.0, *x_m, *y_m]));
            for flight in flights(plan, rig, turn, is_backward, at)? {
                let windows = flight.windows;
                lines.push(Line { flight, windows, lowest, is_down: false });
                lowest += u32::from(windows);
            }
            is_back = !is_back;
        }
        if lowest > TARGETS_MAX {
            break;
        }
    }
    if lowest > TARGETS_MAX {
        return Err(plan.problem(
            "schedule",
            "kind",
            &format!("the spirals have {lowest} windows and more"),
            &format!("at most {TARGETS_MAX} targets"),
            "take wider turns, fewer places, or longer windows",
        ));
    }
    sweep::check_places(plan, rig, &lines)?;
    Ok(lines)
}

/// The arm's angle where a turn begins, and where it ends.
type Turn = (f64, f64);

/// From the pole outwards, no further apart than the step; the last goes round the rim.
fn turns(theta_max_rad: f64, step_rad: f64) -> Vec<Turn> {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // the reader's bounds
    let count = libm::ceil(theta_max_rad / step_rad - 1e-9).max(1.0) as u32;
    let at = |k: u32| theta_max_rad * f64::from(k) / f64::from(count);
    let rising = (0..count).map(|k| (at(k), at(k + 1)));
    rising.chain([(theta_max_rad, theta_max_rad)]).collect()
}

/// One turn, as fast as the narrowest feature bears on its widest circle, the axes can, and the table's travel
/// leaves room to come to speed; in as many flights as a device can keep windows of.
fn flights(
    plan: &Plan,
    rig: &Rig,
    turn: Turn,
    is_backward: bool,
    at: Latched,
) -> Result<Vec<Flight>, Problem> {
    let mut window_rad = window_rad(plan, rig, turn);
    loop {
        let flights = cut(plan, rig, turn, is_backward, at, window_rad);
        let refused = flights.iter().find_map(|flight| rig.flight(*flight).err());
        match refused {
            None => return Ok(flights),
            Some(Rejection::OutsideLimits(0 | 1, _) | Rejection::TooFast(0))
                if window_rad > 2.0 * rig.axes[TABLE].distance(1.0) =>
            {
                window_rad *= sweep::SLOWER;
            }
            Some(rejection) => {
                return Err(sweep::no_room(plan, &rig.axes[TABLE], rejection));
            }
        }
    }
}

/// How far the table may turn in a window.
fn window_rad(plan: &Plan, rig: &Rig, (from, to): Turn) -> f64 {
    let table = &rig.axes[TABLE];
    let fastest =
        table.distance(f64::from(table.counts_per_s())) * sweep::window_s(rig, plan.dwell);
    let radius = libm::sin(from.max(to));
    (sweep::borne(plan, rig) / radius.max(f64::MIN_POSITIVE)).min(fastest).min(WINDOW_TURN_RAD)
}

fn cut(
    plan: &Plan,
    rig: &Rig,
    (from, to): Turn,
    is_backward: bool,
    at: Latched,
    window_rad: f64,
) -> Vec<Flight> {
    let [arm, table, ..] = &rig.axes;
    let span = table.counts(PI).saturating_sub(table.counts(-PI)).max(1);
    // As many windows as go once round, each a whole number of counts, none longer.
    let most = sweep::whole(table, window_rad).clamp(1, span);
    let windows = span / most + i32::from(span % most != 0);
    let travel = (span / windows).max(1);
    let windows = windows.min(span / travel);
    let rise = (arm.counts(to) - arm.counts(from)) / windows;
    let side = if is_backward { -1 } else { 1 };
    let first = -side * (windows * travel / 2);
    let parts_of = i32::try_from(WINDOWS_MAX).unwrap_or(i32::MAX);
    let parts = windows / parts_of + i32::from(windows % parts_of != 0);
    let step = Latched([rise, side * travel, 0, 0]);
    let begin = Latched([arm.counts(from), table.counts(0.0) + first, at.0[2], at.0[3]]);
    let lead = lead(plan, rig, step);
    let mut done = 0;
    let part = |part: i32| {
        let end = windows * (part + 1) / parts;
        let count = u16::try_from(end - done).unwrap_or(u16::MAX);
        let from = begin.plus(step, done);
        done = end;
        Flight { from, travel: step, window: plan.dwell, lead, windows: count }
    };
    (0..parts).map(part).collect()
}

/// The longer of both axes'.
fn lead(plan: &Plan, rig: &Rig, step: Latched) -> Duration {
    let of = |i: usize| sweep::lead(rig, &rig.axes[i], step.0[i].abs().max(1), plan.dwell);
    of(0).max(of(TABLE))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{Sequence, Step};
    use spanned_toml::{Document, Source};

    const PLAN: &str = "
[region]
x_mm = [-5, 5]
y_mm = [-5, 5]
theta_max_deg = 80
[schedule]
kind = \"spiral\"
x_count = 2
y_count = 1
theta_step_deg = 15
narrowest_feature_deg = 20
[dwell]
dwell_ms = 50
[dark]
method = \"shutter\"
[fit]
angular_degree = 4
position_degree = 0
";

    fn laid_out(changes: &[(&str, &str)]) -> Result<Sequence, Problem> {
        let change = |text: String, (from, to): &(&str, &str)| {
            assert!(text.contains(from), "{from}");
            text.replace(from, to)
        };
        let text = changes.iter().fold(PLAN.to_owned(), change);
        let plan = Plan::read(Document::parse(Source::new("plan.toml", &text)).unwrap())?;
        plan.lay_out(&Rig::built_in().unwrap(), None)
    }

    fn windows(sequence: &Sequence) -> Vec<&Step> {
        sequence.steps.iter().filter(|step| step.swept.is_some()).collect()
    }

    #[test]
    fn the_table_goes_forth_and_back_while_the_arm_rises_from_the_pole_to_the_rim() {
        let sequence = laid_out(&[]).unwrap();
        let rig = Rig::built_in().unwrap();
        // Six turns of 13 1/3° and the rim, at two places.
        assert_eq!(sequence.sweeps(), 14);
        let mut seen = vec![0; sequence.targets.len()];
        let mut turns: Vec<(f64, f64, f64, f64)> = Vec::new();
        for step in windows(&sequence) {
            let crate::rig::ReadingKind::Target { index, .. } = step.kind else { panic!() };
            seen[index as usize] += 1;
            let swept = step.swept.unwrap();
            let [begin, end] = [step.counts, step.ends_at()].map(|c| rig.positions(c).0);
            let [arm, table] = [0, 1].map(|i| (begin[i].to_degrees(), end[i].to_degrees()));
            if swept.first == step.id {
                turns.push((arm.0, arm.1, table.0, table.1));
            }
            let turn = turns.last_mut().unwrap();
            (turn.1, turn.3) = (arm.1, table.1);
            // No window goes further than a fifth of the feature and the beam together.
            let way =
                libm::hypot((table.1 - table.0) * libm::sin(arm.1.to_radians()), arm.1 - arm.0);
            assert!(way < 0.2 * libm::hypot(20.0, 5.0), "{way}° in a window");
        }
        assert!(seen.iter().all(|times| *times == 1));
        for (k, (low, high, begin, end)) in turns.iter().enumerate() {
            let forth = if k % 2 == 0 { 1.0 } else { -1.0 };
            assert!((end - begin - forth * 360.0).abs() < 0.2, "{begin}° to {end}°");
            let step = if k % 7 == if k < 7 { 6 } else { 0 } { 0.0 } else { 80.0 / 6.0 };
            let rises = if k < 7 { 1.0 } else { -1.0 };
            // Whole counts a window: a turn of 240 windows may fall 0.24° short.
            assert!((high - low - rises * step).abs() < 0.3, "turn {k}: {low}° to {high}°");
        }
        assert!(turns[0].0.abs() < 1e-9 && (turns[6].1 - 80.0).abs() < 0.3);
        assert!((turns[7].0 - 80.0).abs() < 0.2 && turns[13].1.abs() < 0.3);
    }

    #[test]
    fn turns_near_the_pole_are_quicker_and_none_leaves_the_travel() {
        let long = ("dwell_ms = 50", "dwell_ms = 150");
        let narrow = ("narrowest_feature_deg = 20", "narrowest_feature_deg = 4");
        let sequence = laid_out(&[narrow, long]).unwrap();
        let rig = Rig::built_in().unwrap();
        let turned = |step: &&Step| step.swept.unwrap().travel.0[1].abs();
        let windows = windows(&sequence);
        let first: Vec<i32> =
            windows.iter().filter(|s| s.swept.unwrap().first == s.id).map(turned).collect();
        assert!(first[0] > 2 * first[6], "{first:?}");
        assert!(first[..7].windows(2).all(|pair| pair[0] >= pair[1]), "{first:?}");
        for step in &sequence.steps {
            let rests = rig.positions(step.rests_at(&rig)).0;
            for (axis, at) in rig.axes.iter().zip(rests) {
                assert!(axis.check(at).is_ok(), "{at}");
            }
        }
    }

    #[test]
    fn turns_that_are_dealt_out_are_flown_once() {
        let all = laid_out(&[]).unwrap();
        let dealt = laid_out(&[("theta_step_deg", "interleaved = true\ntheta_step_deg")]).unwrap();
        assert_eq!((all.sweeps(), dealt.sweeps()), (14, 7));
        let xs = windows(&dealt).iter().map(|step| step.counts.0[2]).collect::<Vec<_>>();
        assert!(xs.contains(&-5000) && xs.contains(&5000), "{xs:?}");
    }

    #[test]
    fn what_can_not_be_flown_is_refused_with_a_remedy() {
        for (changes, parts) in [
            (("theta_step_deg = 15", "theta_step_deg = 90\ninterleaved = true"), "2 turns"),
            (("narrowest_feature_deg = 20", ""), "nothing says how fast to turn"),
            (("theta_step_deg = 15", ""), "theta_step_deg"),
            (("dwell_ms = 50", "dwell_ms = 1"), "the wire carries"),
            (("theta_step_deg = 15", "theta_step_deg = 0.01"), "targets"),
        ] {
            let more =
                ("x_count = 2", if parts == "2 turns" { "x_count = 3" } else { "x_count = 2" });
            let problem = laid_out(&[changes, more]).unwrap_err().to_string();
            assert!(problem.contains(parts), "{parts}: {problem}");
        }
    }
}
