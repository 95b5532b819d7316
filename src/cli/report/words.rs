//! The words and units of a report, by what the detector measures: nothing photometric or relative
//! is called by a radiometric name.

use crate::rig::Quantity;

/// What the quantities are called, and their units.
#[derive(Debug, Clone, Copy)]
pub(super) struct Words {
    pub(super) radiance: &'static str,
    pub(super) exitance: &'static str,
    pub(super) flux: &'static str,
    pub(super) intensity: &'static str,
    pub(super) radiance_unit: &'static str,
    pub(super) exitance_unit: &'static str,
    pub(super) flux_unit: &'static str,
    pub(super) intensity_unit: &'static str,
}

impl Words {
    pub(super) const fn of(quantity: Quantity) -> Self {
        let [radiance_unit, exitance_unit, flux_unit] = quantity.units();
        let (radiance, exitance, flux, intensity, intensity_unit) = match quantity {
            Quantity::Radiance => {
                ("radiance", "radiant exitance", "radiant flux", "radiant intensity", "W/sr")
            }
            Quantity::Luminance => {
                ("luminance", "luminous exitance", "luminous flux", "luminous intensity", "cd")
            }
            Quantity::Relative => (
                "relative radiance",
                "relative exitance",
                "relative flux",
                "relative intensity",
                "",
            ),
        };
        Self {
            radiance,
            exitance,
            flux,
            intensity,
            radiance_unit,
            exitance_unit,
            flux_unit,
            intensity_unit,
        }
    }

    /// The letter that goes with the radiance: `luminance L`.
    pub(super) fn radiance_symbol(&self) -> String {
        format!("{} L", self.radiance)
    }

    /// An axis's label: the name with its unit, if it has one.
    pub(super) fn with_unit(name: &str, unit: &str) -> String {
        if unit.is_empty() { name.to_owned() } else { format!("{name} in {unit}") }
    }
}
