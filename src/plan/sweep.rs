//! Sweeps of a plan: the arm flies along meridians, at one place after the other, and readings are taken in
//! windows on the way. How far it may go in a window follows from the narrowest feature that is
//! looked for and from the beam's own width; everything that rig and wire can object to is found
//! here.
//!
//! Where the arm reaches both sides of the zenith it flies over the top, two meridians at once;
//! where its play has a side it flies that way only, and back without reading; otherwise back and
//! forth.

use std::f64::consts::{PI, TAU};
use std::time::Duration;

use firmware_protocol::{Rejection, WINDOW_WIRE_MAX, WINDOWS_MAX};
use spanned_toml::Problem;

use super::{Adaptive, Plan, Schedule, TARGETS_MAX, Target, grid};
use crate::rig::{Approach, Axis, AxisPositions, Flight, Latched, Rig, forward};

/// The part of the narrowest width that a window goes, at most. It takes ½ (w²/12)/σ² off the top
/// of a Gaussian feature, 0.9 % where w is a fifth of its full width at half maximum; the fit
/// averages over the window as well, so that this is information lost, not a bias.
const PART_OF_NARROWEST: f64 = 0.2;
/// Full width at half maximum over standard deviation, of a Gaussian: 2 √(2 ln 2).
const FWHM_PER_SIGMA: f64 = 2.354_820_045_030_949_3;
/// The part of the wire that windows may take: replies, and what is said again, need the rest.
const PART_OF_WIRE: f64 = 0.8;
/// Bits on the wire for a byte.
const BITS_PER_BYTE: f64 = 10.0;
/// How much slower a sweep is tried whose run-up has no room.
pub(super) const SLOWER: f64 = 0.9;
/// How often the plan's window is doubled where light is scarce, and up to what.
const DOUBLINGS: u32 = 5;
const WINDOW_MAX: Duration = Duration::from_secs(1);

/// One sweep of the plan.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    pub(super) flight: Flight,
    pub(super) windows: u16,
    /// The target of its lowest window.
    pub(super) lowest: u32,
    /// Whether it goes downwards.
    pub(super) is_down: bool,
}

impl Line {
    /// The target of a window.
    pub(super) fn target(&self, window: u16) -> u32 {
        let from_low = if self.is_down { self.windows - 1 - window } else { window };
        self.lowest + u32::from(from_low)
    }

    /// The same windows from the other end, where the axis may come from either side.
    pub(super) fn turned(self, rig: &Rig) -> Self {
        if rig.axes[0].approach != Approach::Either {
            return self;
        }
        flipped(self)
    }

    /// Where the axes are in the middle of the window of a target, upwards.
    fn middle(&self, rig: &Rig, from_low: u16) -> AxisPositions {
        let window = if self.is_down { self.windows - 1 - from_low } else { from_low };
        let along = f64::from(window) + 0.5;
        let Flight { from, travel, .. } = self.flight;
        AxisPositions(std::array::from_fn(|i| {
            rig.axes[i].position(f64::from(from.0[i]) + along * f64::from(travel.0[i]))
        }))
    }
}

/// The targets of sweeps: each window's middle.
pub(super) fn targets(rig: &Rig, lines: &[Line]) -> Vec<Target> {
    let mut targets: Vec<Target> = lines
        .iter()
        .flat_map(|line| {
            (0..line.windows).map(move |from_low| {
                let positions = line.middle(rig, from_low);
                let index = line.lowest + u32::from(from_low);
                Target { index, pose: forward(positions), positions }
            })
        })
        .collect();
    targets.sort_by_key(|target| target.index);
    targets
}

/// The sweeps of a plan, in the order in which they are flown.
pub(super) fn lines(plan: &Plan, rig: &Rig) -> Result<Vec<Line>, Problem> {
    let Schedule::Sweep { x_count, y_count, phi_step_deg, is_interleaved, .. } = plan.schedule
    else {
        return Ok(Vec::new());
    };
    check_wire(plan, rig)?;
    let arc = Arc::of(plan, rig, phi_step_deg);
    let places = places(plan, x_count, y_count);
    let flown = if is_interleaved { 1 } else { places.len() };
    if is_interleaved && arc.tables.len() < places.len() {
        return Err(plan.problem(
            "schedule",
            "interleaved",
            &format!("{} sweeps for {} places", arc.tables.len(), places.len()),
            "at least one sweep a place",
            "lower phi_step_deg, or take fewer places",
        ));
    }
    let windows = cut(plan, rig, arc.theta, plan.dwell)?;
    let per_meridian: u64 = windows.iter().map(|(_, count)| u64::from(*count)).sum();
    let count = per_meridian * arc.tables.len() as u64 * flown as u64;
    if count > u64::from(TARGETS_MAX) {
        return Err(plan.problem(
            "schedule",
            "kind",
            &format!("the sweeps have {count} windows"),
            &format!("at most {TARGETS_MAX} targets"),
            "take fewer meridians or places, or longer windows",
        ));
    }
    let mut stops = Vec::new();
    for (place, &(x_m, y_m)) in places.iter().enumerate() {
        let is_here = |k: &usize| !is_interleaved || grid::dealt(*k, places.len()) == place;
        let here = (0..arc.tables.len()).filter(is_here);
        let mut tables: Vec<(usize, f64)> = here.map(|k| (k, arc.tables[k])).collect();
        if place % 2 == 1 {
            tables.reverse();
        }
        for (table, phi) in tables {
            let lowest = u32::try_from(per_meridian * stops.len() as u64).unwrap_or(u32::MAX);
            let at = rig.counts(AxisPositions([0.0, phi, x_m, y_m]));
            stops.push(Stop { at, place, table, lowest });
        }
    }
    let mut lines = Vec::new();
    let mut is_back = false;
    for Stop { at, mut lowest, .. } in in_order(rig, stops) {
        let mut line: Vec<Line> = Vec::new();
        for (flight, count) in &windows {
            let from = Latched([flight.from.0[0], at.0[1], at.0[2], at.0[3]]);
            let flight = Flight { from, windows: *count, ..*flight };
            line.push(Line { flight, windows: *count, lowest, is_down: false });
            lowest += u32::from(*count);
        }
        if is_back || rig.axes[0].approach == Approach::Negative {
            line.reverse();
            line = line.into_iter().map(flipped).collect();
        }
        is_back = rig.axes[0].approach == Approach::Either && !is_back;
        lines.extend(line);
    }
    check_places(plan, rig, &lines)?;
    Ok(lines)
}

/// Where a sweep is flown: at a place of the sample, at an angle of the turntable.
#[derive(Clone, Copy)]
struct Stop {
    at: Latched,
    place: usize,
    table: usize,
    /// The target of its lowest window.
    lowest: u32,
}

/// Place by place, back and forth over the angles; or angle by angle, back and forth over the places:
/// whichever way is the shorter for the axes that move.
fn in_order(rig: &Rig, by_place: Vec<Stop>) -> Vec<Stop> {
    let mut by_table = by_place.clone();
    by_table.sort_by_key(|stop| {
        let is_odd = stop.table % 2 == 1;
        (stop.table, if is_odd { usize::MAX - stop.place } else { stop.place })
    });
    let time = |stops: &[Stop]| -> u128 {
        let moves = stops.windows(2).map(|pair| rig.move_duration(pair[0].at, pair[1].at));
        moves.map(|duration| duration.as_micros()).sum()
    };
    if time(&by_table) < time(&by_place) { by_table } else { by_place }
}

/// The same windows from the other end.
pub(super) fn flipped(line: Line) -> Line {
    Line { flight: line.flight.reversed(), is_down: !line.is_down, ..line }
}

/// Where the arm flies: from one of its angles to another, and at which angles of the turntable.
struct Arc {
    theta: (f64, f64),
    tables: Vec<f64>,
}

impl Arc {
    fn of(plan: &Plan, rig: &Rig, phi_step_deg: f64) -> Self {
        let most = plan.region.theta_max_rad;
        let meridians = libm::round(360.0 / phi_step_deg);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // the reader's bounds
        let count = meridians as u32;
        let over_the_top = reaches_over(plan, rig) && count.is_multiple_of(2);
        let (theta, count) =
            if over_the_top { ((-most, most), count / 2) } else { ((0.0, most), count) };
        let table = |i: u32| {
            let phi = (f64::from(i) * phi_step_deg).to_radians();
            // Any turn of the table that its travel allows; the arm's sides change by half turns.
            let turn = if over_the_top { PI } else { TAU };
            let turns = [phi, phi - turn, phi - 2.0 * turn, phi + turn];
            turns.into_iter().find(|phi| rig.axes[1].check(*phi).is_ok()).unwrap_or(phi)
        };
        let mut tables: Vec<f64> = (0..count).map(table).collect();
        tables.sort_by(f64::total_cmp);
        Self { theta, tables }
    }
}

/// Whether the arm reaches both sides of the zenith.
pub(super) fn reaches_over(plan: &Plan, rig: &Rig) -> bool {
    rig.axes[0].check(-plan.region.theta_max_rad).is_ok()
}

/// Rows of places, back and forth.
pub(super) fn places(plan: &Plan, x_count: u32, y_count: u32) -> Vec<(f64, f64)> {
    let mut places = grid::places(&plan.region, x_count, y_count);
    for (column, ys) in places.chunks_mut(y_count as usize).enumerate() {
        if column % 2 == 1 {
            ys.reverse();
        }
    }
    places
}

/// The windows along the arc, each so long: upwards, in as many flights as a device can keep windows
/// of.
pub(super) fn cut(
    plan: &Plan,
    rig: &Rig,
    theta: (f64, f64),
    window: Duration,
) -> Result<Vec<(Flight, u16)>, Problem> {
    let (axis, pinned) = (&rig.axes[0], pinned_speed(plan));
    let mut travel = match pinned {
        Some(speed_deg_per_s) => pinned_travel(plan, rig, speed_deg_per_s)?,
        None => free_travel(plan, rig, window),
    };
    loop {
        let flights = cut_by(rig, theta, travel, window);
        let refused = flights.iter().find_map(|(flight, _)| {
            let up = rig.flight(*flight).err();
            let line = Line { flight: *flight, windows: flight.windows, lowest: 0, is_down: false };
            up.or_else(|| rig.flight(flipped(line).flight).err())
        });
        match refused {
            None => return Ok(flights),
            Some(Rejection::OutsideLimits(0, _)) if pinned.is_none() && travel > 1 => {
                travel = slower(travel);
            }
            Some(rejection) => return Err(no_room(plan, axis, rejection)),
        }
    }
}

#[allow(clippy::cast_possible_truncation)] // smaller than it was
fn slower(travel: i32) -> i32 {
    ((f64::from(travel) * SLOWER) as i32).max(1)
}

fn cut_by(rig: &Rig, theta: (f64, f64), travel: i32, window: Duration) -> Vec<(Flight, u16)> {
    let axis = &rig.axes[0];
    let (low, high) = (axis.counts(theta.0), axis.counts(theta.1));
    let span = high.saturating_sub(low).max(1);
    let travel = travel.min(span);
    // As many windows as cover the arc, each a whole number of counts, none longer.
    let windows = span / travel + i32::from(span % travel != 0);
    let travel = (span / windows).max(1);
    let windows = windows.min(span / travel);
    let first = low + (span - windows * travel) / 2;
    let most = i32::try_from(WINDOWS_MAX).unwrap_or(i32::MAX);
    let parts = windows / most + i32::from(windows % most != 0);
    let lead = lead(rig, axis, travel, window);
    let mut flights = Vec::new();
    let mut done = 0;
    for part in 0..parts {
        let end = windows * (part + 1) / parts;
        let count = u16::try_from(end - done).unwrap_or(u16::MAX);
        let from = Latched([first + done * travel, 0, 0, 0]);
        let travel = Latched([travel, 0, 0, 0]);
        flights.push((Flight { from, travel, window, lead, windows: count }, count));
        done = end;
    }
    flights
}

/// What the acceleration excites dies away in the axis's time to settle; and play is used up.
pub(super) fn lead(rig: &Rig, axis: &Axis, travel: i32, window: Duration) -> Duration {
    let settle = axis.settle;
    if axis.approach == Approach::Either {
        return settle;
    }
    let speed = axis.distance(f64::from(travel)) / window_s(rig, window);
    let ramp_m = 0.5 * speed * speed / axis.acceleration;
    let missing_s = ((axis.run_up - ramp_m) / speed).max(0.0);
    settle.max(Duration::from_secs_f64(missing_s))
}

pub(super) fn window_s(rig: &Rig, window: Duration) -> f64 {
    let adc = rig.detector.adc;
    f64::from(adc.readings_in(window)) / f64::from(adc.rate_hz)
}

fn pinned_travel(plan: &Plan, rig: &Rig, speed_deg_per_s: f64) -> Result<i32, Problem> {
    let axis = &rig.axes[0];
    let most_deg_per_s = axis.speed.to_degrees();
    if speed_deg_per_s > most_deg_per_s * (1.0 + 1e-9) {
        return Err(plan.problem(
            "schedule",
            "speed_deg_per_s",
            &format!(
                "a sweep at {speed_deg_per_s}°/s, but {} moves at {most_deg_per_s:.3}°/s at most",
                axis.name.name()
            ),
            &format!("at most {most_deg_per_s:.3}°/s"),
            "sweep more slowly, or leave the key out and state narrowest_feature_deg",
        ));
    }
    let travel = whole(axis, speed_deg_per_s.to_radians() * window_s(rig, plan.dwell));
    if travel == 0 {
        return Err(plan.problem(
            "schedule",
            "speed_deg_per_s",
            &format!("at {speed_deg_per_s}°/s a window of {:?} goes less than a count", plan.dwell),
            &format!("at least one of {:.0} counts a degree", axis.counts_per_unit.to_radians()),
            "sweep faster, or lengthen the windows",
        ));
    }
    Ok(travel)
}

/// As far as the narrowest feature bears, or the axis can in a window.
fn free_travel(plan: &Plan, rig: &Rig, window: Duration) -> i32 {
    let axis = &rig.axes[0];
    let fastest = axis.distance(f64::from(axis.counts_per_s())) * window_s(rig, window);
    whole(axis, borne(plan, rig).min(fastest)).max(1)
}

/// How far a window may go for the sake of the narrowest feature, radians.
pub(super) fn borne(plan: &Plan, rig: &Rig) -> f64 {
    let narrowest_feature_deg = match plan.schedule {
        Schedule::Sweep { narrowest_feature_deg, .. } => narrowest_feature_deg,
        Schedule::Adaptive(Adaptive { narrowest_feature_deg, .. })
        | Schedule::Spiral { narrowest_feature_deg, .. } => Some(narrowest_feature_deg),
        _ => return 0.0,
    };
    let detector = &rig.detector;
    let sigma =
        libm::hypot(detector.pupil_radius_m, detector.spot_radius_m) / (2.0 * detector.distance_m);
    let seen =
        libm::hypot(narrowest_feature_deg.unwrap_or_default().to_radians(), FWHM_PER_SIGMA * sigma);
    PART_OF_NARROWEST * seen
}

/// The windows that a sweep may have instead of the plan's: the shortest in which the axis at its
/// fastest goes as far as the narrowest feature bears, and that the wire carries; and longer ones by
/// factors of two.
pub(super) fn windows(plan: &Plan, rig: &Rig) -> Vec<Duration> {
    let adc = rig.detector.adc;
    let whole = |seconds: f64| {
        Duration::from_secs_f64(
            libm::ceil(seconds * f64::from(adc.rate_hz) - 1e-6) / f64::from(adc.rate_hz),
        )
    };
    let axis = &rig.axes[0];
    let fastest = axis.distance(f64::from(axis.counts_per_s()));
    let shortest = whole((borne(plan, rig) / fastest).max(1.0 / carried_per_s(rig)));
    let shorter = [shortest].into_iter().filter(|window| *window < plan.dwell);
    let longer = (1..=DOUBLINGS).map(|n| plan.dwell * (1 << n)).filter(|w| *w <= WINDOW_MAX);
    shorter.chain(longer).collect()
}

/// Windows a second that the wire carries.
fn carried_per_s(rig: &Rig) -> f64 {
    PART_OF_WIRE * f64::from(rig.link.baud()) / BITS_PER_BYTE / WINDOW_WIRE_MAX as f64
}

fn pinned_speed(plan: &Plan) -> Option<f64> {
    match plan.schedule {
        Schedule::Sweep { speed_deg_per_s, .. } => speed_deg_per_s,
        _ => None,
    }
}

/// Whole counts, none too many.
#[allow(clippy::cast_possible_truncation)] // saturates
pub(super) fn whole(axis: &Axis, units: f64) -> i32 {
    libm::floor(units * axis.counts_per_unit * (1.0 + 1e-9)) as i32
}

/// Windows must not come faster than the wire takes them.
pub(super) fn check_wire(plan: &Plan, rig: &Rig) -> Result<(), Problem> {
    let per_s = 1.0 / window_s(rig, plan.dwell);
    let carried = carried_per_s(rig);
    if per_s <= carried {
        return Ok(());
    }
    let is_here = plan
        .document()
        .root()
        .table("schedule")
        .is_ok_and(|table| table.is_some_and(|table| table.has("window_ms")));
    let (table, key) = if is_here { ("schedule", "window_ms") } else { ("dwell", "dwell_ms") };
    Err(plan.problem(
        table,
        key,
        &format!(
            "windows of {:?} are {per_s:.0} a second, and the wire carries {carried:.0} of them",
            plan.dwell
        ),
        &format!("windows of at least {:.2} ms at {} baud", 1e3 / carried, rig.link.baud()),
        "lengthen the windows, or raise the baud rate in the rig file",
    ))
}

/// Every sweep can be flown where it is, by the rule that the device follows.
pub(super) fn check_places(plan: &Plan, rig: &Rig, lines: &[Line]) -> Result<(), Problem> {
    for line in lines {
        let at = rig.positions(line.flight.from);
        for (axis, position) in rig.axes.iter().zip(at.0).skip(1) {
            axis.check(position).map_err(|error| {
                let help = "shrink the region, or check the rig's travel";
                plan.problem(
                    "schedule",
                    "kind",
                    &error.to_string(),
                    "sweeps inside the limits",
                    help,
                )
            })?;
        }
        rig.flight(line.flight).map_err(|rejection| no_room(plan, &rig.axes[0], rejection))?;
    }
    Ok(())
}

pub(super) fn no_room(plan: &Plan, axis: &Axis, rejection: Rejection) -> Problem {
    let what = match rejection {
        Rejection::OutsideLimits(_, counts) => format!(
            "{}: coming to speed and to rest, a sweep would reach {}, outside the travel from {} to {}",
            axis.name.name(),
            axis.name.in_file_unit(axis.position(f64::from(counts))),
            axis.name.in_file_unit(axis.travel.0),
            axis.name.in_file_unit(axis.travel.1),
        ),
        other => format!("the sweep can't be flown: {other:?}"),
    };
    let key = if pinned_speed(plan).is_some() { "speed_deg_per_s" } else { "kind" };
    plan.problem(
        "schedule",
        key,
        &what,
        "sweeps inside the limits, run-up and run-out included",
        "sweep more slowly, lower theta_max_deg, or check the rig's travel",
    )
}
