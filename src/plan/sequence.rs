//! The readings of a plan, all of them, in the order in which they are taken.
//!
//! The sequence is fixed before the run, and a step's id is its place in it: a resumed run takes
//! the readings whose ids are missing, and so equals an uninterrupted one.

use std::time::Duration;

use firmware_protocol::Shutter;

use super::Prediction;
use crate::rig::{AxisPositions, Latched, Pose, ReadingKind};

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
