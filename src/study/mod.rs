//! Accuracy against time, the pure part: how good a fit is, and which plans to compare. It is
//! handed a way to run a plan; it does not know rigs, clocks or files.

mod frontier;
mod score;

pub use frontier::{FrontierPoint, FrontierRow, LADDER, Rung, doubling, points};
pub use score::radiance_error_rms_relative;
