//! The simulated rig: a scene compiled to just the effects that it calls for, behind the same
//! firmware core and the same wire as a real rig.
//!
//! [`Scene`] says what emits, [`Nominal`] what the rig file states.
//!
//! The crate does not know the host: not its kinematics, not its calibration, not its files. It
//! computes from its own mechanical truth, so that a wrong sign on either side shows.

mod nominal;
mod scene;

pub use nominal::{Nominal, NominalAxis, NominalDetector, NominalGain, Quantity};
pub use scene::{
    EXPONENT_MAX, Emitter, Law, Load, Scene, SceneError, Shape, Tabulated, TabulatedError,
};
