//! Accuracy against time, the pure part: how good a fit is, and which plans to compare. It is
//! handed a way to run a plan; it does not know rigs, clocks or files.

mod frontier;
mod ladder;
mod score;

pub use frontier::{FrontierPoint, FrontierRow, doubling, points};
pub use ladder::{LADDER, Rung};
pub use score::radiance_error_rms_relative;
