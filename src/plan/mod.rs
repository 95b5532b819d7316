//! What to measure: the plan as people write it, the targets that it means, the order in which
//! they are visited, and what that costs in time.
//!
//! A plan becomes a [`Sequence`] before anything moves: every reading that will be taken, with its
//! place and its name. This room reads no clock, does no I/O, and does not know whether hardware
//! exists.

mod cost;
mod file;
mod sequence;
mod terms;

pub use cost::Prediction;
pub use sequence::{RESUME_IDS_FROM, Sequence, Step, Target, WARM_UP_IDS_FROM};
pub use terms::{
    Dark, DarkMethod, FitSpec, Order, Plan, Reference, Region, Schedule, Stop, WarmUp,
};

/// The most targets that a plan may have. At a second each they take twelve days.
pub const TARGETS_MAX: u32 = 1_000_000;
