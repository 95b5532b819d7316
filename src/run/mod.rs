//! The run: a machine that decides, an engine that pumps link, machine and journal, and the owner
//! that holds a rig for one of them at a time.
//!
//! The machine and the decisions of a resume are pure; only the engine and the owner know tasks
//! and tokio's clock.

mod channels;
pub mod machine;
mod state;
mod warm_up;

pub use machine::{Answer, Wish};
pub use state::{Doubt, Fault, LEGAL, Outcome, Position, State};
