//! Puts readings one after the other: targets and windows, with dark and reference readings between.
//!
//! It checks nothing: what comes here can be done.

use std::time::Duration;

use firmware_protocol::Shutter;

use super::order::Visit;
use super::sweep::Line;
use super::{DarkMethod, Plan, Step, Swept, Target};
use crate::rig::{AxisPositions, Latched, Pose, ReadingKind, Rig};

/// Where a reading is taken.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) pose: Option<Pose>,
    pub(super) positions: AxisPositions,
    pub(super) counts: Latched,
}

/// Puts readings one after the other.
pub(super) struct Builder<'p> {
    plan: &'p Plan,
    rig: &'p Rig,
    gain: u8,
    pub(super) reference: Place,
    // The first step's id, and where the axes rest before it.
    first: u32,
    here: Latched,
    pub(super) steps: Vec<Step>,
}

impl<'p> Builder<'p> {
    /// Of a sequence that begins at home.
    pub(super) fn new(plan: &'p Plan, rig: &'p Rig, gain: u8, reference: Place) -> Self {
        Self { plan, rig, gain, reference, first: 0, here: Latched::ZERO, steps: Vec::new() }
    }

    /// Of steps that follow others.
    pub(super) fn following(self, first: u32, here: Latched) -> Self {
        Self { first, here, ..self }
    }

    /// A dark reading and a reference one; the targets, with more of both between; a reference
    /// reading and a dark one. Every other repeat runs backwards, which saves the way back.
    pub(super) fn fill(&mut self, targets: &[Target], visits: &[Visit], dwells: &[Duration]) {
        self.dark();
        self.reference();
        let last = visits.len() as u64 * u64::from(self.plan.repeat);
        let mut visited = 0;
        for repeat in 0..self.plan.repeat {
            for place in 0..visits.len() {
                let place = if repeat % 2 == 0 { place } else { visits.len() - 1 - place };
                let index = visits[place].target as usize;
                self.target(&targets[index], repeat, dwells[index]);
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

    /// As [`Self::fill`], sweep by sweep: what is due in between comes after a sweep. Steps that follow
    /// others open with nothing of their own.
    pub(super) fn fill_sweeps(&mut self, targets: &[Target], lines: &[Line]) {
        if self.first == 0 {
            self.dark();
            self.reference();
        }
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
        let first = self.next_id();
        let flight = line.flight;
        let (travel, lead) = (flight.travel, flight.lead);
        let swept = Swept { first, count: line.windows.into(), travel, lead };
        let route = self.rig.flight(flight).ok().map(|motion| {
            let from = self.rests_at();
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
            let step = step(id, kind, place, self.gain, flight.window);
            self.steps.push(Step { via, settle, swept: Some(swept), ..step });
        }
    }

    fn target(&mut self, target: &Target, repeat: u32, dwell: Duration) {
        let positions = target.positions;
        let counts = self.rig.counts(positions);
        let place = Place { pose: Some(target.pose), positions, counts };
        let kind = ReadingKind::Target { index: target.index, repeat };
        self.push(kind, place, dwell);
    }

    fn reference(&mut self) {
        self.push(ReadingKind::Reference, self.reference, self.plan.reference.dwell);
    }

    /// Nothing but a dark reading, so long.
    pub(super) fn dark_alone(mut self, dwell: Duration) -> Vec<Step> {
        self.dark();
        if let Some(step) = self.steps.last_mut() {
            step.dwell = dwell;
        }
        self.steps
    }

    /// Where the axes stand already; at home to begin with.
    fn dark(&mut self) {
        let here = (self.rig.positions(self.here), self.here);
        let (positions, counts) = self.steps.last().map_or(here, |step| {
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

    fn next_id(&self) -> u32 {
        // READINGS_MAX is far below 2^32.
        self.first + u32::try_from(self.steps.len()).unwrap_or(u32::MAX)
    }

    fn rests_at(&self) -> Latched {
        self.steps.last().map_or(self.here, |step| step.rests_at(self.rig))
    }

    fn push(&mut self, kind: ReadingKind, place: Place, dwell: Duration) {
        let from = self.rests_at();
        let route = self.rig.route(from, place.counts);
        let id = self.next_id();
        let step = step(id, kind, place, self.gain, dwell);
        self.steps.push(Step { via: route.via, settle: route.settle, ..step });
    }
}

pub(super) fn step(id: u32, kind: ReadingKind, place: Place, gain: u8, dwell: Duration) -> Step {
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
