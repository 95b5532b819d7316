//! Do stated uncertainties cover the truth? Scenes whose numbers are drawn anew for every run (noise
//! alone can't test what a basis leaves out), the errors of the runs in units of their u, and what is
//! demanded of them. It does not know how a run is made: it is handed what the runs found.

mod band;
mod demand;
mod draws;
mod family;
mod lamp;
mod target;

pub use band::{binomial_band, rms_band};
pub use demand::{Cell, Demand, Pool, SENSITIVE_RUNS, Tally, demands, tally};
pub use draws::Draws;
pub(super) use family::ramp;
pub use family::{Attachment, Drawn, FAMILIES, Family, Scale};
pub use lamp::Lamp;
pub use target::{Answer, Kind, Run, Score, Target, targets};
