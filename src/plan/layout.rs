//! From a plan to its sequence on a rig: targets checked against limits, put in order, and
//! interleaved with dark and reference readings.
//!
//! Everything that a rig can object to is found here, before anything moves.

use std::ops::Range;
use std::time::Duration;

use firmware_protocol::Shutter;
use spanned_toml::{Problem, Source};

use super::order::{self, Visit};
use super::sweep::{self, Line};
use super::{
    DarkMethod, Order, Plan, Prediction, READINGS_MAX, Region, Schedule, Sequence, Step, Swept,
    TARGETS_MAX, Target, grid, list,
};
use crate::rig::{AxisPositions, Latched, LimitError, Pose, ReadingKind, Rig};

/// A list's pose may pass the region's edge by this much: 80° are not exactly 80° in binary.
const EDGE_SLACK: f64 = 1e-12;

/// The poses of a plan, and for a list where each stands in its file.
struct Poses<'s> {
    poses: Vec<Pose>,
    places: Option<(&'s Source, Vec<Range<usize>>)>,
}

impl Plan {
    /// Every reading of the plan on `rig`, in order, and what they cost. `list` is the text of
    /// [`Plan::list_file`], for a plan that has one.
    ///
    /// The problem names the line of the plan, or of the list, that the rig can't do.
    pub fn lay_out(&self, rig: &Rig, list: Option<&Source>) -> Result<Sequence, Problem> {
        let gain = self.gain_on(rig)?;
        self.check_dwells(rig)?;
        self.check_expected(rig)?;
        let reference = self.reference_on(rig)?;
        if let Schedule::Sweep { .. } = self.schedule {
            return self.lay_out_sweeps(rig, gain, reference);
        }
        let poses = self.poses(list)?;
        self.check_readings(poses.poses.len())?;
        let candidates = self.candidates(rig, &poses)?;
        let visits = match self.order {
            Order::Listed => order::listed(rig, &candidates, reference.positions),
            Order::Travel => order::travelling(rig, &candidates, reference.positions),
        };
        let targets = targets(&poses.poses, &visits);
        let mut builder = Builder { plan: self, rig, gain, reference, steps: Vec::new() };
        builder.fill(&targets, &visits);
        let prediction = Prediction::of(rig, &targets, &builder.steps);
        let (steps, reference) = (builder.steps, builder.reference);
        let reference = step(0, ReadingKind::Reference, reference, gain, self.reference.dwell);
        Ok(Sequence { targets, steps, prediction, reference })
    }

    fn lay_out_sweeps(&self, rig: &Rig, gain: u8, reference: Place) -> Result<Sequence, Problem> {
        let lines = sweep::lines(self, rig)?;
        let targets = sweep::targets(rig, &lines);
        self.check_readings(targets.len())?;
        let mut builder = Builder { plan: self, rig, gain, reference, steps: Vec::new() };
        builder.fill_sweeps(&targets, &lines);
        let prediction = Prediction::of(rig, &targets, &builder.steps);
        let (steps, reference) = (builder.steps, builder.reference);
        let reference = step(0, ReadingKind::Reference, reference, gain, self.reference.dwell);
        Ok(Sequence { targets, steps, prediction, reference })
    }

    fn gain_on(&self, rig: &Rig) -> Result<u8, Problem> {
        let Some(name) = &self.gain else { return Ok(0) };
        rig.detector.gain_index(name).ok_or_else(|| {
            let names: Vec<String> =
                rig.detector.gains.iter().map(|gain| format!("\"{}\"", gain.name)).collect();
            self.problem(
                "dwell",
                "gain",
                &format!("{} has no gain range \"{name}\"", rig.name),
                &format!("one of {}", names.join(", ")),
                "name one of the rig's gain ranges, or leave the key out for the first",
            )
        })
    }

    /// A dwell must hold a whole ADC reading.
    fn check_dwells(&self, rig: &Rig) -> Result<(), Problem> {
        let rate_hz = rig.detector.adc.rate_hz;
        let dwells =
            [("dwell", self.dwell), ("dark", self.dark.dwell), ("reference", self.reference.dwell)];
        for (table, dwell) in dwells {
            if dwell.as_micros() * u128::from(rate_hz) < 1_000_000 {
                return Err(self.problem(
                    table,
                    "dwell_ms",
                    &format!("{dwell:?} hold no ADC reading"),
                    &format!("at least {} ms, at {rate_hz} readings a second", {
                        1e3 / f64::from(rate_hz)
                    }),
                    "lengthen the dwell",
                ));
            }
        }
        Ok(())
    }

    fn reference_on(&self, rig: &Rig) -> Result<Place, Problem> {
        let pose = self.reference.pose;
        let home = AxisPositions([0.0; 4]);
        let positions = rig.nearest(pose, home).map_err(|e| {
            let help = "move the reference pose to where the axes reach it";
            self.problem("reference", "", &e.to_string(), "a pose inside the rig's limits", help)
        })?;
        Ok(Place { pose: Some(pose), positions, counts: rig.counts(positions) })
    }

    fn poses<'s>(&self, list: Option<&'s Source>) -> Result<Poses<'s>, Problem> {
        if let Schedule::List { file } = &self.schedule {
            let source = list.ok_or_else(|| {
                let what = format!("the list {file} was not read");
                self.problem("schedule", "file", &what, "a CSV file of poses", "check the path")
            })?;
            let (poses, places) = list::read(source)?.into_iter().unzip();
            return Ok(Poses { poses, places: Some((source, places)) });
        }
        let count = grid::count(&self.schedule, &self.region);
        if count > u64::from(TARGETS_MAX) {
            return Err(self.problem(
                "schedule",
                "kind",
                &format!("the schedule has {count} targets"),
                &format!("at most {TARGETS_MAX} targets"),
                "take larger steps or fewer places",
            ));
        }
        Ok(Poses { poses: grid::poses(&self.schedule, &self.region), places: None })
    }

    fn check_readings(&self, targets: usize) -> Result<(), Problem> {
        let visits = targets as u64 * u64::from(self.repeat);
        let checks = visits / u64::from(self.dark.every) + visits / u64::from(self.reference.every);
        if visits + checks <= u64::from(READINGS_MAX) {
            return Ok(());
        }
        Err(self.problem(
            "schedule",
            "repeat",
            &format!("{targets} targets, {} times, make {} readings", self.repeat, visits + checks),
            &format!("at most {READINGS_MAX} readings"),
            "repeat less often, or measure fewer targets",
        ))
    }

    /// For each pose the axis positions that see it.
    fn candidates(&self, rig: &Rig, poses: &Poses<'_>) -> Result<Vec<Vec<AxisPositions>>, Problem> {
        let candidates = poses.poses.iter().enumerate().map(|(index, pose)| {
            if poses.places.is_some() {
                check_inside(&self.region, pose).map_err(|what| {
                    let help = "widen the region, or move or leave out the pose";
                    self.refused(poses, index, &what, "a pose in the region", help)
                })?;
            }
            rig.reachable(*pose).map_err(|e: LimitError| {
                let help =
                    "shrink the region, move or leave out the pose, or check the rig's travel";
                self.refused(poses, index, &e.to_string(), "a pose inside the rig's limits", help)
            })
        });
        candidates.collect()
    }

    fn refused(
        &self,
        poses: &Poses<'_>,
        index: usize,
        why: &str,
        expected: &str,
        help: &str,
    ) -> Problem {
        let what = format!("pose {index}: {why}");
        match &poses.places {
            Some((source, places)) => {
                Problem::at(source, places[index].clone(), "", &what, expected, help)
            }
            None => self.problem("schedule", "kind", &what, expected, help),
        }
    }

    /// A problem at a key of a table, or as near to it as the file has anything.
    pub(super) fn problem(
        &self,
        table: &str,
        key: &str,
        what: &str,
        expected: &str,
        help: &str,
    ) -> Problem {
        let root = self.document().root();
        match root.table(table) {
            Ok(Some(table)) => table.problem(key, what, expected, help),
            _ => root.problem(table, what, expected, help),
        }
    }
}

fn check_inside(region: &Region, pose: &Pose) -> Result<(), String> {
    let is_inside =
        |(low, high): (f64, f64), at: f64| at >= low - EDGE_SLACK && at <= high + EDGE_SLACK;
    let outside = |name: &str, (low, high): (f64, f64), at: f64, unit: &str| {
        Err(format!("{name}: {at:.3}{unit} is outside the region's {low:.3} to {high:.3}{unit}"))
    };
    let mm = |(low, high): (f64, f64)| (low * 1e3, high * 1e3);
    let thetas = (0.0, region.theta_max_rad);
    if !is_inside(region.x_m, pose.x_m) {
        outside("x", mm(region.x_m), pose.x_m * 1e3, " mm")
    } else if !is_inside(region.y_m, pose.y_m) {
        outside("y", mm(region.y_m), pose.y_m * 1e3, " mm")
    } else if !is_inside(thetas, pose.theta_rad) {
        let thetas = (0.0, thetas.1.to_degrees());
        outside("theta", thetas, pose.theta_rad.to_degrees(), "°")
    } else {
        Ok(())
    }
}

/// Targets in the order of the schedule, with the positions that the visits chose.
fn targets(poses: &[Pose], visits: &[Visit]) -> Vec<Target> {
    let mut targets: Vec<Target> = visits
        .iter()
        .filter_map(|visit| {
            let pose = *poses.get(visit.target as usize)?;
            Some(Target { index: visit.target, pose, positions: visit.positions })
        })
        .collect();
    targets.sort_by_key(|target| target.index);
    targets
}

/// Where a reading is taken.
#[derive(Debug, Clone, Copy)]
struct Place {
    pose: Option<Pose>,
    positions: AxisPositions,
    counts: Latched,
}

/// Puts readings one after the other.
struct Builder<'p> {
    plan: &'p Plan,
    rig: &'p Rig,
    gain: u8,
    reference: Place,
    steps: Vec<Step>,
}

impl Builder<'_> {
    /// A dark reading and a reference one; the targets, with more of both between; a reference
    /// reading and a dark one. Every other repeat runs backwards, which saves the way back.
    fn fill(&mut self, targets: &[Target], visits: &[Visit]) {
        self.dark();
        self.reference();
        let last = visits.len() as u64 * u64::from(self.plan.repeat);
        let mut visited = 0;
        for repeat in 0..self.plan.repeat {
            for place in 0..visits.len() {
                let place = if repeat % 2 == 0 { place } else { visits.len() - 1 - place };
                self.target(&targets[visits[place].target as usize], repeat);
                visited += 1;
                if visited % u64::from(self.plan.reference.every) == 0 || visited == last {
                    self.reference();
                }
                if visited % u64::from(self.plan.dark.every) == 0 || visited == last {
                    self.dark();
                }
            }
        }
    }

    /// As [`Self::fill`], sweep by sweep: what is due in between comes after a sweep.
    fn fill_sweeps(&mut self, targets: &[Target], lines: &[Line]) {
        self.dark();
        self.reference();
        let is_due = |before: u64, after: u64, every: u32| {
            before / u64::from(every) != after / u64::from(every)
        };
        let all: u64 = lines.iter().map(|line| u64::from(line.windows)).sum();
        let last = all * u64::from(self.plan.repeat);
        let mut visited = 0;
        for repeat in 0..self.plan.repeat {
            for place in 0..lines.len() {
                let line = if repeat % 2 == 0 {
                    lines[place]
                } else {
                    lines[lines.len() - 1 - place].turned(self.rig)
                };
                self.windows(targets, &line, repeat);
                let before = visited;
                visited += u64::from(line.windows);
                if is_due(before, visited, self.plan.reference.every) || visited == last {
                    self.reference();
                }
                if is_due(before, visited, self.plan.dark.every) || visited == last {
                    self.dark();
                }
            }
        }
    }

    /// The windows of one sweep.
    fn windows(&mut self, targets: &[Target], line: &Line, repeat: u32) {
        let first = u32::try_from(self.steps.len()).unwrap_or(u32::MAX);
        let flight = line.flight;
        let (travel, lead) = (flight.travel, flight.lead);
        let swept = Swept { first, count: line.windows.into(), travel, lead };
        let route = self.rig.flight(flight).ok().map(|motion| {
            let from = self.steps.last().map_or(Latched::ZERO, |step| step.rests_at(self.rig));
            self.rig.route_to_flight(from, flight, &motion)
        });
        for window in 0..line.windows {
            let Some(target) = targets.get(line.target(window) as usize) else { continue };
            let counts = flight.from.plus(travel, window.into());
            let place = Place { pose: Some(target.pose), positions: target.positions, counts };
            let kind = ReadingKind::Target { index: target.index, repeat };
            let id = first + u32::from(window);
            let (via, settle) = match route.filter(|_| window == 0) {
                Some(route) => (route.via, route.settle),
                None => (None, Duration::ZERO),
            };
            let step = step(id, kind, place, self.gain, self.plan.dwell);
            self.steps.push(Step { via, settle, swept: Some(swept), ..step });
        }
    }

    fn target(&mut self, target: &Target, repeat: u32) {
        let positions = target.positions;
        let counts = self.rig.counts(positions);
        let place = Place { pose: Some(target.pose), positions, counts };
        let kind = ReadingKind::Target { index: target.index, repeat };
        self.push(kind, place, self.plan.dwell);
    }

    fn reference(&mut self) {
        self.push(ReadingKind::Reference, self.reference, self.plan.reference.dwell);
    }

    /// Where the axes stand already; at home to begin with.
    fn dark(&mut self) {
        let home = AxisPositions([0.0; 4]);
        let (positions, counts) = self.steps.last().map_or((home, Latched::ZERO), |step| {
            if step.swept.is_none() {
                return (step.positions, step.counts);
            }
            let rests = step.rests_at(self.rig);
            (self.rig.positions(rests), rests)
        });
        let place = Place { pose: None, positions, counts };
        self.push(ReadingKind::Dark, place, self.plan.dark.dwell);
        if let Some(step) = self.steps.last_mut() {
            match self.plan.dark.method {
                DarkMethod::Shutter => step.shutter = Shutter::Closed,
                DarkMethod::SourceOff => step.source_off = true,
            }
        }
    }

    fn push(&mut self, kind: ReadingKind, place: Place, dwell: Duration) {
        let from = self.steps.last().map_or(Latched::ZERO, |step| step.rests_at(self.rig));
        let route = self.rig.route(from, place.counts);
        // READINGS_MAX is far below 2^32.
        let id = u32::try_from(self.steps.len()).unwrap_or(u32::MAX);
        let step = step(id, kind, place, self.gain, dwell);
        self.steps.push(Step { via: route.via, settle: route.settle, ..step });
    }
}

fn step(id: u32, kind: ReadingKind, place: Place, gain: u8, dwell: Duration) -> Step {
    Step {
        id,
        kind,
        pose: place.pose,
        positions: place.positions,
        counts: place.counts,
        via: None,
        settle: Duration::ZERO,
        gain,
        dwell,
        shutter: Shutter::Open,
        source_off: false,
        swept: None,
    }
}
