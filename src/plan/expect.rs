//! `[expect]`: what a person expects to measure, for predictions alone. It changes no reading and
//! no fit, and is no part of the plan's hash.

use spanned_toml::{Bounds, Problem, Table};

use super::Plan;
use crate::rig::{Quantity, Rig};

const LEVEL: Bounds = Bounds::positive_up_to(1e12);
const BEAM_DEG: Bounds = Bounds::between(0.1, 179.0);
const FEATURE_DEG: Bounds = Bounds::between(0.1, 180.0);
const FEATURE_MM: Bounds = Bounds::between(0.001, 10_000.0);

/// What is expected; `None` where nothing is said.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Expect {
    /// The highest radiance, in the unit of the quantity.
    pub level: Option<(Quantity, f64)>,
    /// Full angle about the normal between the directions of half the highest radiance; `None` for
    /// a radiance that is the same in all directions.
    pub beam_angle_rad: Option<f64>,
    /// Full width at half maximum of the narrowest feature in direction, radians.
    pub narrowest_feature_rad: Option<f64>,
    /// The same in position, metres.
    pub narrowest_feature_m: Option<f64>,
}

impl Expect {
    /// `[expect]`: the highest radiance as `radiance_w_per_m2_sr`, `luminance_cd_per_m2` or
    /// `radiance_relative`, by the detector's quantity; `beam_angle_deg`, full angle at half of it;
    /// `narrowest_feature_deg` and `narrowest_feature_mm`, full widths at half maximum.
    pub(super) fn read(table: Table<'_>) -> Result<Self, Problem> {
        let mut level = None;
        for quantity in [Quantity::Radiance, Quantity::Luminance, Quantity::Relative] {
            let key = quantity.radiance_column();
            let Some(value) = table.number(key, LEVEL)? else { continue };
            if level.replace((quantity, value)).is_some() {
                let help = "state the one that the rig's detector yields";
                return Err(table.problem(key, "two levels at once", "one of them", help));
            }
        }
        let beam_angle = table.number("beam_angle_deg", BEAM_DEG)?;
        let feature_deg = table.number("narrowest_feature_deg", FEATURE_DEG)?;
        let feature_mm = table.number("narrowest_feature_mm", FEATURE_MM)?;
        table.finish()?;
        Ok(Self {
            level,
            beam_angle_rad: beam_angle.map(f64::to_radians),
            narrowest_feature_rad: feature_deg.map(f64::to_radians),
            narrowest_feature_m: feature_mm.map(|mm| mm / 1e3),
        })
    }
}

impl Plan {
    /// A level in another unit than the detector's says nothing.
    pub(super) fn check_expected(&self, rig: &Rig) -> Result<(), Problem> {
        let own = rig.detector.quantity;
        match self.expect.level {
            Some((quantity, _)) if quantity != own => Err(self.problem(
                "expect",
                quantity.radiance_column(),
                &format!("{} yields another quantity", rig.name),
                own.radiance_column(),
                "state the level in the unit of the rig's detector",
            )),
            _ => Ok(()),
        }
    }
}
