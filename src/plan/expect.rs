//! `[expect]`: what a person expects to measure, for predictions, and for the gain range where the plan
//! asks for the one that suits it. It changes no other reading and no fit, and is itself no part of
//! the plan's hash.

use spanned_toml::{Bounds, Problem, Table};

use super::Plan;
use crate::rig::{Quantity, Rig};

const LEVEL: Bounds = Bounds::positive_up_to(1e12);
const BEAM_DEG: Bounds = Bounds::between(0.1, 179.0);
const FEATURE_DEG: Bounds = Bounds::between(0.1, 180.0);
const FEATURE_MM: Bounds = Bounds::between(0.001, 10_000.0);

/// As the gain range of a plan that names none itself: the one that suits what is expected.
const EXPECTED: &str = "expected";
/// What is expected fills this part of a range at most: a level stated by a person is no maximum.
const FILLED_MOST: f64 = 0.6;

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
    /// The gain range of all readings: the one named, the rig's first if none is; of `"expected"` the
    /// most sensitive one that the expected level fills to 60 % at most.
    pub(super) fn gain_on(&self, rig: &Rig) -> Result<u8, Problem> {
        let Some(name) = &self.gain else { return Ok(0) };
        if let Some(gain) = rig.detector.gain_index(name) {
            return Ok(gain);
        }
        if name == EXPECTED {
            return self.expected_gain(rig);
        }
        let names: Vec<String> =
            rig.detector.gains.iter().map(|gain| format!("\"{}\"", gain.name)).collect();
        Err(self.problem(
            "dwell",
            "gain",
            &format!("{} has no gain range \"{name}\"", rig.name),
            &format!("one of {}, or \"{EXPECTED}\"", names.join(", ")),
            "name one of the rig's gain ranges, or leave the key out for the first",
        ))
    }

    fn expected_gain(&self, rig: &Rig) -> Result<u8, Problem> {
        self.check_expected(rig)?;
        let refused = |what: &str, expected: &str, help: &str| {
            Err(self.problem("dwell", "gain", what, expected, help))
        };
        let Some((_, level)) = self.expect.level else {
            return refused(
                "nothing says what level is expected",
                "a level in [expect]",
                &format!("state {} there, or name a gain range", {
                    rig.detector.quantity.radiance_column()
                }),
            );
        };
        let bears = |gain: &u8| FILLED_MOST * rig.detector.saturation_radiance(*gain) >= level;
        let ranges = (0..u8::try_from(rig.detector.gains.len()).unwrap_or(u8::MAX)).filter(bears);
        let saturation = |gain: &u8| rig.detector.saturation_radiance(*gain);
        match ranges.min_by(|a, b| saturation(a).total_cmp(&saturation(b))) {
            Some(gain) => Ok(gain),
            None => refused(
                &format!("the expected level of {level} fills every gain range beyond 60 %"),
                "a level that some range bears",
                "correct the level in [expect], dim the source, or name a gain range",
            ),
        }
    }

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
