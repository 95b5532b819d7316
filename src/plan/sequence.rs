//! The readings of a plan, all of them, in the order in which they are taken.
//!
//! The sequence is fixed before the run, and a step's id is its place in it: a resumed run takes
//! the readings whose ids are missing, and so equals an uninterrupted one.

use std::time::Duration;

use firmware_protocol::Shutter;

use super::Prediction;
use crate::rig::{AxisPositions, Flight, Latched, Pose, ReadingKind, Rig, comes_to_rest};

/// Readings taken while the source warms up have ids from here on.
pub const WARM_UP_IDS_FROM: u32 = 0x4000_0000;
/// Reference readings that a resume takes to see whether it may go on have ids from here on.
pub const RESUME_IDS_FROM: u32 = 0x8000_0000;

/// A place where the plan wants to know the radiance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Its place in the plan's schedule, from 0, whatever the order of the visits.
    pub index: u32,
    /// Where it is.
    pub pose: Pose,
    /// The axis positions from which it is seen, inside the limits.
    pub positions: AxisPositions,
}

/// One reading to take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Its place in the sequence, and the reading's name for good.
    pub id: u32,
    /// Why it is taken.
    pub kind: ReadingKind,
    /// Where it looks; `None` where it sees no sample.
    pub pose: Option<Pose>,
    /// Where the axes shall stand. A dark reading is taken where the step before it ended.
    pub positions: AxisPositions,
    /// The same in counts.
    pub counts: Latched,
    /// Where to go first, coming from the step before: see [`crate::rig::Rig::route`], which
    /// answers for any other way.
    pub via: Option<Latched>,
    /// Rest between move and integration, coming from the step before.
    pub settle: Duration,
    /// The gain range.
    pub gain: u8,
    /// The integration.
    pub dwell: Duration,
    /// Whether the shutter is open. It stays open for a dark reading with the source off.
    pub shutter: Shutter,
    /// Whether a person must switch the source off before this reading, and on after it.
    pub source_off: bool,
    /// Of a reading that is taken in flight: the sweep that it is a window of. Its
    /// [`Step::counts`] are where the window begins, its pose and positions those of its middle.
    pub swept: Option<Swept>,
}

/// The sweep that a window belongs to: readings with ids one after the other, each where the one
/// before it ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Swept {
    /// The first window's id.
    pub first: u32,
    /// How many windows it has.
    pub count: u32,
    /// How far the axes go in each, counts.
    pub travel: Latched,
    /// At constant speed before the first.
    pub lead: Duration,
}

impl Step {
    /// The flight of this window and `windows` - 1 more.
    pub fn flight(&self, windows: u16) -> Option<Flight> {
        let Swept { travel, lead, .. } = self.swept?;
        Some(Flight { from: self.counts, travel, window: self.dwell, lead, windows })
    }

    /// The same reading taken at rest, in the middle of its window.
    #[must_use]
    pub fn at_rest(self) -> Self {
        let Some(swept) = self.swept else { return self };
        let half = Latched(swept.travel.0.map(|counts| counts / 2));
        Self { counts: self.counts.plus(half, 1), swept: None, ..self }
    }

    /// Whether it is the next window of the same sweep.
    pub fn continues(&self, before: &Self) -> bool {
        self.swept.is_some_and(|swept| {
            before.swept == Some(swept) && before.id + 1 == self.id && before.gain == self.gain
        })
    }

    /// Where the axes are when it has its reading, counts: in flight, or at rest.
    pub fn ends_at(&self) -> Latched {
        self.swept.map_or(self.counts, |swept| self.counts.plus(swept.travel, 1))
    }

    /// Where the axes come to rest after it, if it is the last window of its sweep or none.
    pub fn rests_at(&self, rig: &Rig) -> Latched {
        if rig.takes_sweeps_at_rest() {
            return self.at_rest().counts;
        }
        let is_last = |swept: &Swept| self.id + 1 == swept.first + swept.count;
        let motion = self.swept.filter(is_last).and(self.flight(1));
        let motion = motion.and_then(|flight| rig.flight(flight).ok());
        motion.map_or_else(|| self.ends_at(), |motion| comes_to_rest(&motion))
    }
}

/// Every reading of a plan on a rig.
#[derive(Debug, Clone, PartialEq)]
pub struct Sequence {
    /// The targets, in the order of the schedule.
    pub targets: Vec<Target>,
    /// The readings, in the order in which they are taken.
    pub steps: Vec<Step>,
    /// What they cost.
    pub prediction: Prediction,
    pub(super) reference: Step,
}

impl Sequence {
    /// The highest speed at which readings are taken in flight, units a second, in the order of
    /// [`crate::rig::AXES`]; zeros where all are taken at rest.
    pub fn speeds(&self, rig: &Rig) -> [f64; 4] {
        let mut speeds = [0.0_f64; 4];
        for (step, swept) in self.steps.iter().filter_map(|step| Some((step, step.swept?))) {
            for ((speed, axis), counts) in speeds.iter_mut().zip(&rig.axes).zip(swept.travel.0) {
                let units = axis.distance(f64::from(counts)).abs();
                *speed = speed.max(units / step.dwell.as_secs_f64());
            }
        }
        speeds
    }

    /// How many sweeps there are.
    pub fn sweeps(&self) -> usize {
        let is_first = |step: &&Step| step.swept.is_some_and(|swept| swept.first == step.id);
        self.steps.iter().filter(is_first).count()
    }

    /// The n-th reading while the source warms up: at the reference pose, outside the sequence.
    pub fn warm_up(&self, n: u32) -> Step {
        let id = WARM_UP_IDS_FROM.saturating_add(n).min(RESUME_IDS_FROM - 1);
        Step { id, kind: ReadingKind::WarmUp, ..self.reference }
    }

    /// The n-th reading of the reference pose that resumes have taken in this run to see whether
    /// they may go on.
    pub fn resume_check(&self, n: u32) -> Step {
        Step { id: RESUME_IDS_FROM.saturating_add(n), ..self.reference }
    }
}

/// The readings with which steps in order close, after the last target: of the reference pose and
/// of the dark. All of them if there is no target.
pub fn closing(steps: &[Step]) -> &[Step] {
    let is_target = |step: &Step| matches!(step.kind, ReadingKind::Target { .. });
    &steps[steps.iter().rposition(is_target).map_or(0, |last| last + 1)..]
}
