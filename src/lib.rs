//! `gonio` measures radiance L(x, y, θ, φ) with a goniometer or spherical gantry, keeps every
//! reading, fits the radiance that the sample emits, and says how sure it is.
//!
//! The rooms stand in the order in which a measurement flows; each imports only what stands
//! above it in this list (`ARCHITECTURE.md` has the picture, `tests/tidy.rs` holds the rules):
//! [`rig`] what the rig is and what it yields · [`plan`] what to measure, and what it costs ·
//! [`study`] accuracy against time · [`journal`] readings, durable before they count · [`device`]
//! how hardware is spoken to · [`export`] files for other tools · [`report`] pictures · [`run`]
//! the run machine and the engine that pumps it · [`daemon`] the owner of a rig over HTTP ·
//! [`cli`] the command line.

pub mod cli;
pub mod daemon;
pub mod device;
pub mod export;
pub mod journal;
pub mod plan;
pub mod report;
pub mod rig;
pub mod run;
pub mod study;
