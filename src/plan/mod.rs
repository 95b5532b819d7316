//! What to measure: the plan as people write it, the targets that it means, the order in which
//! they are visited, and what that costs in time.
//!
//! A plan becomes a [`Sequence`] before anything moves: every reading that will be taken, with its
//! place and its name. This room reads no clock, does no I/O, and does not know whether hardware
//! exists.

mod adaptive;
#[cfg(test)]
mod adaptive_tests;
mod allocation;
mod bound;
mod builder;
mod cost;
#[cfg(test)]
mod example_tests;
mod expect;
#[cfg(test)]
mod expect_tests;
mod file;
#[cfg(test)]
mod file_tests;
mod fitting;
mod grid;
mod hash;
mod layout;
#[cfg(test)]
mod layout_tests;
mod list;
mod order;
mod rewrite;
mod round;
mod sequence;
mod spiral;
mod sweep;
#[cfg(test)]
mod sweep_tests;
mod terms;
mod tour;
mod tree;
mod wanted;

pub use adaptive::{Adaptive, SWEEPS_MAX};
pub use allocation::Allocation;
pub use bound::Way;
pub use cost::{Prediction, StepTime, TimeLeft, time_of};
pub use expect::Expect;
pub use hash::{PlanHash, fnv1a64};
pub use rewrite::{Change, rewrite};
pub use round::{After, Further, Meridian, Round, SweepPace};
pub use sequence::{RESUME_IDS_FROM, Sequence, Step, Swept, Target, WARM_UP_IDS_FROM, closing};
pub use terms::{Dark, DarkMethod, Order, Plan, Reference, Region, Schedule, Stop, WarmUp};
pub use wanted::{Asked, Wanted};

/// The most targets that a plan may have. At a second each they take twelve days.
pub const TARGETS_MAX: u32 = 1_000_000;
/// The most readings of all kinds that a plan may make, its repeats included.
pub const READINGS_MAX: u32 = 2_000_000;
/// The largest list of poses worth reading, in bytes: some hundred bytes a pose.
pub const LIST_BYTES_MAX: u64 = 100 << 20;
