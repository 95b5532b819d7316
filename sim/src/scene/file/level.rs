//! How bright something is: the keys of levels, in the rig's unit.

use spanned_toml::{Bounds, Problem, Table};

use super::LEVEL_MAX;
use crate::Quantity;

/// The keys of a level: as radiance, as exitance, as flux.
const fn keys(quantity: Quantity) -> [&'static str; 3] {
    match quantity {
        Quantity::Luminance => {
            ["luminance_cd_per_m2", "luminous_exitance_lm_per_m2", "luminous_flux_lm"]
        }
        Quantity::Radiance | Quantity::Relative => {
            ["radiance_w_per_m2_sr", "exitance_w_per_m2", "flux_w"]
        }
    }
}

/// What a level is worth: per radiance, per exitance, and per flux where that can be stated.
pub(super) struct Worth {
    /// Mean exitance, over the surface, of a level of 1.
    pub(super) exitance: f64,
    /// Square metres that emit; `None` where a flux can't be stated.
    pub(super) area_m2: Option<f64>,
}

/// The level, from whichever key it is written in.
pub(super) fn read(table: &Table<'_>, quantity: Quantity, worth: &Worth) -> Result<f64, Problem> {
    let keys = keys(quantity);
    refuse_foreign(table, quantity)?;
    let stated = if worth.area_m2.is_some() { &keys[..] } else { &keys[..2] };
    let list = stated.join(" or ");
    let bounds = Bounds::between(0.0, LEVEL_MAX);
    let mut found: Option<(usize, f64)> = None;
    for (i, key) in stated.iter().enumerate() {
        let Some(level) = table.number(key, bounds)? else { continue };
        if found.is_some() {
            let expected = format!("one of {list}");
            return Err(table.problem(key, "the level is stated twice", &expected, "keep one"));
        }
        found = Some((i, level));
    }
    let Some((i, level)) = found else {
        return Err(table.problem(keys[0], "missing key", &list, "add the level"));
    };
    let worth_of = [1.0, worth.exitance, worth.exitance * worth.area_m2.unwrap_or(1.0)][i];
    if level == 0.0 {
        return Ok(0.0);
    }
    // What emits nothing at a level of 1 has no exitance to be scaled to.
    if worth_of > 0.0 && (level / worth_of).is_finite() {
        return Ok(level / worth_of);
    }
    let what = format!("nothing emits {level} here: at a level of 1 it is {worth_of}");
    Err(table.problem(keys[i], &what, "a level that the image or the law can have", ""))
}

/// Refuses a level in the other unit.
pub(super) fn refuse_foreign(table: &Table<'_>, quantity: Quantity) -> Result<(), Problem> {
    let other = match quantity {
        Quantity::Luminance => Quantity::Radiance,
        Quantity::Radiance | Quantity::Relative => Quantity::Luminance,
    };
    let keys = keys(quantity);
    for foreign in self::keys(other) {
        if table.has(foreign) {
            table.leave(foreign);
            return Err(table.problem(
                foreign,
                &format!("the rig's detector is calibrated for {}", quantity.name()),
                &keys.join(" or "),
                "one can't be had from the other without a spectrum: state the level in the \
                 rig's unit, or use another rig",
            ));
        }
    }
    Ok(())
}
