//! Accuracy against time, the pure part: how good a fit is, and which plans to compare. It is
//! handed a way to run a plan; it does not know rigs, clocks or files.

mod frontier;
mod ladder;
mod score;

pub use frontier::{Coverage, FrontierPoint, FrontierRow, coverage, doubling, points};
pub use ladder::{LADDER, Rung};
pub use score::Score;
