//! Studies of many runs, the pure part: how good a fit is, which plans to compare, what accuracy
//! costs in time, whether stated uncertainties hold. It is handed what runs found; it does not know
//! rigs, clocks or files.

pub mod coverage;
mod frontier;
mod ladder;
mod score;

pub use frontier::{Coverage, FrontierPoint, FrontierRow, coverage, doubling, points};
pub use ladder::{LADDER, Rung};
pub use score::Score;
