//! The run: a machine that decides, an engine that pumps link, machine and journal, and the owner
//! that holds a rig for one of them at a time.
//!
//! The machine and the decisions of a resume are pure; only the engine and the owner know tasks
//! and tokio's clock. Nothing here knows files' formats, HTTP or the command line.

mod channels;
mod clock;
mod course;
mod decider;
mod desk;
mod engine;
mod events;
mod hand;
mod hardware;
mod job;
pub mod machine;
mod owner;
mod pace;
mod reading;
pub mod resume;
mod rule;
mod state;
mod warm_up;

pub use decider::{Decide, Decided, Decider, Next};
pub use desk::OwnerStatus;
pub use events::{Events, Happening, Progress, RunEvent};
pub use hand::{HandError, Stand, TakeOne};
pub use hardware::ReachError;
pub use job::{Check, Ended, Job, Judge, Judgement};
pub use machine::{Answer, OnFault, Source, Wish};
pub use owner::{OwnerHandle, Running, StartError, own};
pub use rule::{Rule, Said, Watch};
pub use state::{Doubt, Fault, LEGAL, Outcome, Position, State};
