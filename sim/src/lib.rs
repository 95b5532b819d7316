//! The simulated rig: a scene compiled to just the effects that it calls for, behind the same
//! firmware core and the same wire as a real rig.
//!
//! [`Scene`] says what emits, [`Nominal`] what the rig file states, [`Simulated`] what a real rig
//! would keep to itself. On given [`Terms`], [`compile()`] turns them into a [`Compiled`] rig: its rows of
//! effects, its truth, and the [`SimulatedBoard`] that the device core drives. [`serve()`] puts a
//! device on a byte stream paced like a [`Wire`], and [`Pty`] is such a stream for other programs.
//! Devices of other makes are [`Twin`]s around the same board, on a [`Bench`].
//!
//! The crate does not know the host: not its kinematics, not its calibration, not its files. It
//! computes from its own mechanical truth, so that a wrong sign on either side shows.

mod bench;
mod board;
mod chance;
mod check;
mod compile;
mod detector;
mod dynamixel;
mod effect;
mod faults;
mod field;
mod grbl;
mod levels;
mod light;
mod mechanics;
mod meter;
mod nominal;
mod optics;
mod pty;
mod sampler;
mod scene;
mod serve;
mod simulated;
mod stage;
mod switches;
mod terms;
mod time;
mod truth;
mod twin;
mod wire;

pub use bench::{Bench, Note};
pub use board::SimulatedBoard;
pub use compile::{CompileError, Compiled, compile};
pub use detector::{DetectorFlaws, Drift, Flicker, GainSwitching};
pub use dynamixel::{DynamixelBus, ServoFault, ServoLoad, ServoSetting};
pub use effect::{Bound, BoundUnit, EffectRow};
pub use faults::{DeviceFault, FaultKind};
pub use field::Ray;
pub use grbl::GrblTwin;
pub use mechanics::{
    AxisFlaws, EncoderError, Misalignment, MissedSteps, Ringing, SeenRay, Uncertain,
};
pub use meter::{MeterMake, MeterTwin, ScpiWords};
pub use nominal::{Nominal, NominalAxis, NominalDetector, NominalGain, Quantity};
pub use optics::Axis;
pub use pty::Pty;
pub use sampler::Sampler;
pub use scene::{
    Batwing, Body, EXPONENT_MAX, Emitter, Image, LOBE_EXPONENT_MIN, Lamp, LampSource, Law, Load,
    Lobe, Lobes, Outline, Reflection, SHARPNESS_MAX, Scene, SceneError, Shape, Solid, Surface,
    Tabulated, TabulatedError, Window, WindowOwner,
};
pub use serve::{serve, serve_bench, serve_bench_at};
pub use simulated::{LinkFaults, Simulated};
pub use terms::Terms;
pub use time::{MainsFlicker, SourceOverTime, WarmUp};
pub use truth::{Peak, Region, Truth};
pub use twin::Twin;
pub use wire::Wire;
