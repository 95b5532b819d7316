//! The keys of `[simulated]` that say what is wrong with the detector.

use spanned_toml::{Bounds, Problem, Table};

use super::{Drift, Flicker, GainSwitching};

/// What a rig file can't know of a real detector. Everything absent is an effect absent.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DetectorFlaws {
    /// By what part of itself the dark current changes in an hour.
    pub dark_drift_relative_per_h: f64,
    /// 1/f noise.
    pub flicker: Option<Flicker>,
    /// What a change of the gain range does.
    pub gain_switching: Option<GainSwitching>,
    /// By what part a reading at full scale is short; zero for none.
    pub non_linearity_relative_at_full_scale: f64,
    /// The part of the scene's whole flux that reaches the detector beside its beam.
    pub stray_light_fraction_of_flux: f64,
    /// How the responsivity drifts.
    pub drift: Drift,
}

/// A dark current that changes faster needs no simulation.
const DARK_DRIFT_MAX: f64 = 100.0;
const FREQUENCY_HZ_MAX: f64 = 1e6;
/// One over the time between two dark readings, about: two minutes.
const LOWEST_HZ: f64 = 0.01;
const NON_LINEARITY_MAX: f64 = 0.5;

impl DetectorFlaws {
    pub(crate) fn read(table: &Table<'_>) -> Result<Self, Problem> {
        let dark_drift = Bounds::between(-DARK_DRIFT_MAX, DARK_DRIFT_MAX);
        let linearity = Bounds::between(0.0, NON_LINEARITY_MAX);
        let number = |key, bounds| table.number(key, bounds).map(Option::unwrap_or_default);
        Ok(Self {
            dark_drift_relative_per_h: number("dark_drift_relative_per_h", dark_drift)?,
            flicker: read_flicker(table)?,
            gain_switching: table.table("gain_switching")?.map(GainSwitching::read).transpose()?,
            non_linearity_relative_at_full_scale: number(
                "non_linearity_relative_at_full_scale",
                linearity,
            )?,
            stray_light_fraction_of_flux: number(
                "stray_light_fraction_of_flux",
                Bounds::between(0.0, 1.0),
            )?,
            drift: table.table("detector_drift")?.map(Drift::read).transpose()?.unwrap_or_default(),
        })
    }
}

fn read_flicker(table: &Table<'_>) -> Result<Option<Flicker>, Problem> {
    let Some(table) = table.table("flicker_noise")? else { return Ok(None) };
    let frequency = Bounds::positive_up_to(FREQUENCY_HZ_MAX);
    let corner_hz = table.required_number("corner_hz", frequency)?;
    let lowest = Bounds::between(LOWEST_HZ_MIN, FREQUENCY_HZ_MAX);
    let lowest_hz = table.number("lowest_hz", lowest)?.unwrap_or(LOWEST_HZ);
    table.finish()?;
    Ok(Some(Flicker { corner_hz, lowest_hz }))
}

/// Slower than once in a hundred years no noise is told from drift.
const LOWEST_HZ_MIN: f64 = 3e-10;
