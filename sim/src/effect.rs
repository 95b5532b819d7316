//! The physical effects as a person sees them: one row each, in or out, why, how large at most,
//! and how it is computed.

use core::fmt;

/// One effect, in or out.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectRow {
    /// What it is called, also on the command line.
    pub name: String,
    /// Whether it is a stage of the compiled rig. What is not has no code that runs.
    pub included: bool,
    /// The key of scene, rig or `[simulated]` table that calls for it, or would; or a fact found
    /// while compiling.
    pub cause: String,
    /// How large its influence is at most; for something random or drawn, its standard
    /// deviation. `None` where nothing bounds it yet, and `how` says so.
    pub bound: Option<Bound>,
    /// How it is computed, or why it is left out.
    pub how: String,
}

/// The size of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// At least zero.
    pub value: f64,
    /// What the value is.
    pub unit: BoundUnit,
}

/// What a bound is stated in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BoundUnit {
    /// Current at the detector's input, A.
    Ampere,
    /// Length, m.
    Metre,
    /// Angle, rad.
    Radian,
    /// A part of the signal, 1.
    Relative,
}

impl BoundUnit {
    /// As it is printed after the number.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Ampere => "A",
            Self::Metre => "m",
            Self::Radian => "rad",
            Self::Relative => "of the signal",
        }
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3e} {}", self.value, self.unit.symbol())
    }
}
