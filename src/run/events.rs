//! What a run tells whoever listens: numbered, so that a listener who fell behind notices.

use std::sync::atomic::{AtomicU64, Ordering};

use firmware_protocol::LinkStatistics;
use tokio::sync::broadcast;

use super::machine::Source;
use super::state::{Fault, Outcome, Position, State};
use crate::journal::ReferenceCheck;
use crate::rig::Reading;

/// Events that a listener may fall behind before it loses some.
const BEHIND_MAX: usize = 4096;

/// Something happened.
#[derive(Debug, Clone, PartialEq)]
pub struct RunEvent {
    /// One more than that of the event before it, for as long as the owner lives.
    pub sequence: u64,
    /// What.
    pub happening: Happening,
}

/// What can happen.
#[derive(Debug, Clone, PartialEq)]
pub enum Happening {
    /// How accurate the readings so far make the result, in words.
    Accuracy(String),
    /// A person is asked to switch the source, and then to continue.
    AskSource(Source),
    /// Something is wrong.
    Fault(Fault),
    /// The run is over.
    Finished(Outcome),
    /// The link, as far as it was counted.
    Link(LinkStatistics),
    /// Whether the position is trusted, and why.
    Position(Position),
    /// How far the run is.
    Progress(Progress),
    /// A reading was taken over by the journal. What it means in radiance is calibration's to
    /// say.
    Reading(Box<Reading>),
    /// The reference pose was measured again after an interruption.
    ReferenceCheck(ReferenceCheck),
    /// The state changed.
    State(State),
}

/// How far a run is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Progress {
    /// Steps of the plan that have their reading, those of earlier sessions included.
    pub done: usize,
    /// Steps of the plan.
    pub total: usize,
    /// Rig time so far, seconds, on the run's clock: homing and standstills included, and at the
    /// end until the axes are at rest.
    pub rig_s: f64,
    /// Rig time that is left, seconds, homing included where it is to come: predicted, and scaled
    /// by how the prediction fared so far.
    pub rest_s: f64,
    /// The same at most, where readings decide on the way what is measured: up to the plan's limit of
    /// rig time. `None` where all is fixed, or nothing limits it.
    pub rest_most_s: Option<f64>,
}

/// Numbers events and hands them to the listeners there are.
#[derive(Debug, Clone)]
pub struct Events {
    sender: broadcast::Sender<RunEvent>,
    next: std::sync::Arc<AtomicU64>,
}

impl Default for Events {
    fn default() -> Self {
        Self { sender: broadcast::Sender::new(BEHIND_MAX), next: std::sync::Arc::default() }
    }
}

impl Events {
    /// Listens from now on.
    pub fn subscribe(&self) -> broadcast::Receiver<RunEvent> {
        self.sender.subscribe()
    }

    pub(super) fn tell(&self, happening: Happening) {
        let sequence = self.next.fetch_add(1, Ordering::Relaxed);
        // Nobody has to listen.
        let _ = self.sender.send(RunEvent { sequence, happening });
    }
}
