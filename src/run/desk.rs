//! What the owner of a rig is asked, and what it shows.

use tokio::sync::{oneshot, watch};

use super::events::{Events, Happening, Progress};
use super::hand::{HandError, Stand, TakeOne};
use super::job::{Ended, Job};
use super::machine::{Answer, Source, Wish};
use super::state::{Doubt, Fault, Position, State};
use crate::journal::Writer;
use crate::rig::{Latched, Reading};

/// What can be asked of an owner.
pub(super) enum Order {
    /// Run this to the end.
    Start(Box<Job>, Box<Writer>, oneshot::Sender<Result<Ended, Box<Writer>>>),
    /// Something about the run that goes on; `None` if there is none.
    Wish(Wish, oneshot::Sender<Option<Answer>>),
    /// Find the home marks.
    Home(oneshot::Sender<Result<Stand, HandError>>),
    /// Go there.
    Jog(Latched, oneshot::Sender<Result<Stand, HandError>>),
    /// Take a reading where the axes stand.
    Take(TakeOne, oneshot::Sender<Result<Reading, HandError>>),
    /// Where are the axes?
    Look(oneshot::Sender<Result<Stand, HandError>>),
    /// Come to rest, let go of the rig, and end.
    ShutDown,
}

impl Order {
    /// Not while a run goes on.
    pub(super) fn refuse(self) {
        match self {
            Self::Start(_, journal, reply) => {
                let _ = reply.send(Err(journal));
            }
            Self::Home(reply) | Self::Jog(_, reply) | Self::Look(reply) => {
                let _ = reply.send(Err(HandError::Busy));
            }
            Self::Take(_, reply) => {
                let _ = reply.send(Err(HandError::Busy));
            }
            Self::Wish(_, reply) => {
                let _ = reply.send(None);
            }
            Self::ShutDown => {}
        }
    }
}

/// How a rig is, as its owner last knew.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnerStatus {
    /// Whether a run goes on.
    pub is_running: bool,
    /// What the rig does, or did last.
    pub state: State,
    /// Whether the position is trusted, and why.
    pub position: Position,
    /// What the rig stands still for.
    pub fault: Option<Fault>,
    /// What a person is asked to switch, before saying continue.
    pub asked: Option<Source>,
    /// How far the run is.
    pub progress: Progress,
    /// How accurate its result is so far, in words; empty as long as nobody has said.
    pub accuracy: String,
}

/// The owner's side: events out, status shown.
pub(super) struct Desk {
    pub(super) events: Events,
    pub(super) status: watch::Sender<OwnerStatus>,
    /// The owner is to end.
    pub(super) is_closing: bool,
}

impl Desk {
    pub(super) fn new() -> Self {
        let status = OwnerStatus {
            is_running: false,
            state: State::Idle,
            position: Position::Untrusted(Doubt::NotHomed),
            fault: None,
            asked: None,
            progress: Progress::default(),
            accuracy: String::new(),
        };
        Self { events: Events::default(), status: watch::Sender::new(status), is_closing: false }
    }

    pub(super) fn begin(&mut self, progress: Progress) {
        self.status.send_modify(|status| {
            *status = OwnerStatus {
                is_running: true,
                state: State::Idle,
                fault: None,
                asked: None,
                progress,
                accuracy: String::new(),
                ..status.clone()
            };
        });
    }

    pub(super) fn state(&self) -> State {
        self.status.borrow().state
    }

    /// Shows it, and tells the listeners.
    pub(super) fn tell(&mut self, happening: Happening) {
        self.status.send_modify(|status| match &happening {
            Happening::Accuracy(text) => status.accuracy.clone_from(text),
            Happening::Fault(fault) => status.fault = Some(fault.clone()),
            Happening::Finished(_) => status.is_running = false,
            Happening::Position(position) => status.position = *position,
            Happening::Progress(progress) => status.progress = *progress,
            Happening::State(state) => {
                status.state = *state;
                if state.is_active() {
                    status.fault = None;
                    status.asked = None;
                }
            }
            Happening::AskSource(source) => status.asked = Some(*source),
            Happening::Link(_) | Happening::Reading(_) | Happening::ReferenceCheck(_) => {}
        });
        self.events.tell(happening);
    }
}
