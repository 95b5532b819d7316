//! What the machine is told, and what it answers: plain data.

use std::sync::Arc;

use firmware_protocol::{AxisMask, Cause, CommandId, DwellResult, Event, Rejection, Request};

use crate::plan::Step;
use crate::rig::Rig;
use crate::run::state::{Fault, Outcome, Position, State};

/// Whether the person's source shines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// It doesn't: how dark readings are taken where there is no shutter.
    Off,
    /// It does.
    On,
}

/// What a fault leads to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnFault {
    /// The end of the run.
    Finish,
    /// Standing still until somebody says continue.
    Wait,
}

/// The rig as the machine sees it, and how to begin.
#[derive(Debug, Clone)]
pub struct Setup {
    /// Its axes, their channels and their ways.
    pub rig: Arc<Rig>,
    /// Home at the start even where the device says that it is homed.
    pub home_first: bool,
    /// What a fault leads to.
    pub on_fault: OnFault,
}

/// What the device said when a session began.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Connected {
    /// Its boot.
    pub boot_id: u32,
    /// Commands that can wait behind the running one.
    pub queue_depth: u8,
    /// Channels homed in this boot.
    pub homed: AxisMask,
    /// The last command number that it accepted in this boot.
    pub last_id: Option<CommandId>,
    /// Its latched fault.
    pub fault: Option<Cause>,
    /// The most windows that a sweep of it can have; 0: it can't sweep, and what the plan would
    /// take in flight is taken at rest.
    pub windows: u16,
}

/// What happens to a run.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// A session began, at the start or after [`Action::Reconnect`].
    Connected(Connected),
    /// The device took a command into its queue.
    Accepted(CommandId),
    /// It did not.
    Rejected(CommandId, Rejection),
    /// The answer to `ClearFault`.
    Cleared,
    /// The other answer to it: the cause persists.
    ClearRefused(Rejection),
    /// The answer to `Stop`.
    Stopping,
    /// The device said something unasked, or again what it was asked for.
    Event(Event),
    /// The device has forgotten a window of this sweep.
    WindowGone(CommandId),
    /// The checks were judged: go on, or why not.
    Judged(Result<(), String>),
    /// It was decided what is measured next.
    Decided(Vec<Step>),
    /// It was decided that nothing more is measured, and why.
    Enough(String),
    /// Something outside the machine is wrong: the link, the journal.
    Fault(Fault),
}

/// What is to be done for a run.
#[derive(Debug, Clone, PartialEq)]
pub enum Action {
    /// Send this to the device.
    Send(Request),
    /// Keep this reading.
    Record(Box<Taken>),
    /// The state changed.
    Became(State),
    /// The trust in the position changed.
    Position(Position),
    /// Something is wrong.
    Fault(Fault),
    /// Ask the person to switch the source, and then to continue.
    AskSource(Source),
    /// Judge the checks' readings; [`Input::Judged`] is the answer.
    Judge,
    /// Decide what is measured next; [`Input::Decided`] or [`Input::Enough`] is the answer.
    Decide,
    /// Open another session.
    Reconnect,
    /// The run is over. Nothing follows.
    Finish(Outcome),
}

/// A reading as it came.
#[derive(Debug, Clone, PartialEq)]
pub struct Taken {
    /// What was asked for.
    pub step: Step,
    /// The command that it was.
    pub id: CommandId,
    /// What the device reported.
    pub result: DwellResult,
}
