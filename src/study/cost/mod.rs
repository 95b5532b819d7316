//! What accuracy costs in rig time, strategy against strategy: scenes, ladders of plans, the habits
//! that plans are compared with, and what many scored runs say together. It does not know how a
//! run is made: it is handed what the runs found.

mod aims;
mod interpolant;
mod rung;
mod scene;
mod spline;
mod verdict;

pub use aims::{Aim, aims};
pub use interpolant::{NoGrid, interpolate};
pub use rung::{Rung, Strategy, ladder};
pub use scene::{Scene, SceneFiles};
pub use verdict::{Climb, Compared, Reached, Run, Target, compared};
