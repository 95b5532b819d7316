//! The detector behind its optics: what a photocurrent goes through on its way to counts. Each
//! effect is a stage of its own, with a bound on what it does to a dwell's mean. It does not know
//! where light comes from, nor which stages a rig calls for.
//!
//! Noise begins anew with every dwell and goes by the reading's name alone: a reading that is
//! taken again after a crash has the noise that it would have had. What goes with time goes by
//! the device's time.

mod converter;
mod dark;
mod drift;
mod effects;
mod flaws;
mod flicker;
mod gain_switching;
mod noise;
mod non_linearity;
mod stages;
mod stray_light;
mod wiener;

pub use drift::Drift;
pub use flaws::DetectorFlaws;
pub use flicker::Flicker;
pub use gain_switching::GainSwitching;

pub(crate) use converter::Amplifier;
pub(crate) use effects::{candidates, departing};
pub(crate) use stages::{stages, stray_light};

/// The elementary charge, coulombs; exact since 2019 (SI).
pub(crate) const ELEMENTARY_CHARGE_C: f64 = 1.602_176_634e-19;

/// Seconds in an hour.
const HOUR_S: f64 = 3600.0;

/// The effects' names, as rows and command lines have them.
mod name {
    pub(super) const DARK_CURRENT: &str = "dark-current";
    pub(super) const DARK_DRIFT: &str = "dark-drift";
    pub(super) const DETECTOR_DRIFT: &str = "detector-drift";
    pub(super) const FLICKER_NOISE: &str = "flicker-noise";
    pub(super) const GAIN_SWITCHING: &str = "gain-switching";
    pub(super) const NON_LINEARITY: &str = "non-linearity";
    pub(super) const READ_NOISE: &str = "read-noise";
    pub(super) const SHOT_NOISE: &str = "shot-noise";
    pub(super) const STRAY_LIGHT: &str = "stray-light";
}
