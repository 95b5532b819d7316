//! What an owner is given to run, and what it gives back.

use std::time::Duration;

use super::decider::Decider;
use super::hardware::ReachError;
use super::machine::OnFault;
use super::rule::Watch;
use super::state::Outcome;
use crate::journal::{JournalError, ReferenceCheck, Writer};
use crate::plan::{Step, WarmUp};
use crate::rig::Reading;

/// Judges the readings of the reference pose that a resume took.
pub type Judge = Box<dyn FnMut(&[Reading]) -> Judgement + Send>;

/// What came of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// For the journal; `None` if there was nothing to compare with.
    pub check: Option<ReferenceCheck>,
    /// Go on, or why not.
    pub go_on: Result<(), String>,
}

/// The reference pose, measured again before a resumed run goes on.
pub struct Check {
    /// The readings to take.
    pub steps: Vec<Step>,
    /// What to make of them.
    pub judge: Judge,
}

/// A run, or what is left of one.
pub struct Job {
    /// The steps that have no reading yet, in order.
    pub steps: Vec<Step>,
    /// Steps of the plan that have their reading from earlier sessions.
    pub done_before: usize,
    /// Waiting for stability: the gate, the reading to take again and again (its id is replaced),
    /// and how many warm-up readings the run has already.
    pub warm_up: Option<(WarmUp, Step, u32)>,
    /// For a resumed run.
    pub check: Option<Check>,
    /// 0, and one more after every resume.
    pub session: u32,
    /// Run time at which this session begins, seconds.
    pub session_began_s: f64,
    /// Home even where the device is homed: yes for a run, and for its resume.
    pub home_first: bool,
    /// Whether anybody is there to say continue after a fault.
    pub on_fault: OnFault,
    /// Measure no further target where the run, closed as the plan closes it, would take longer
    /// than that. Time at a standstill, paused or faulted, doesn't count.
    pub rig_time_max: Option<Duration>,
    /// Measure no further target once this says so.
    pub rule: Option<Watch>,
    /// Decides what follows once all steps are measured; without it the run is then complete.
    pub decider: Option<Decider>,
}

impl Job {
    /// A whole run from its beginning.
    pub fn new(steps: Vec<Step>, on_fault: OnFault) -> Self {
        Self {
            steps,
            done_before: 0,
            warm_up: None,
            check: None,
            session: 0,
            session_began_s: 0.0,
            home_first: true,
            on_fault,
            rig_time_max: None,
            rule: None,
            decider: None,
        }
    }
}

/// How a run ended, with its journal.
#[derive(Debug)]
pub struct Ended {
    /// Why.
    pub outcome: Outcome,
    /// Steps of the plan that have their reading now, those of earlier sessions included.
    pub done: usize,
    /// Steps of the plan.
    pub total: usize,
    /// Rig time, seconds, of all sessions.
    pub rig_s: f64,
    /// The journal; everything that could be made durable is.
    pub journal: Writer,
    /// Why some readings are not durable, if so.
    pub lost: Option<JournalError>,
    /// Why the rig was never reached, if so: nothing has moved, and no session began.
    pub unreached: Option<ReachError>,
}
