//! What the mechanics bring to the compiler: an effect for each way in which an axis is not where
//! it is thought to be.

use crate::compile::Setting;
use crate::effect::{Bound, BoundUnit, Candidate, Chosen, Influence};
use crate::mechanics::AxisTruth;
use crate::simulated::AXIS_NAMES;
use crate::{Nominal, NominalAxis, Simulated};

/// The axes' candidates, and the limit switches'.
pub(crate) fn candidates(setting: &Setting<'_>) -> Vec<Candidate> {
    let axes = AXIS_NAMES.iter().zip(&setting.nominal.axes).enumerate();
    let mut candidates: Vec<Candidate> =
        axes.flat_map(|(i, (name, axis))| of_axis(name, axis, i < 2)).collect();
    let margin = setting.simulated.limit_margin;
    candidates.push(Candidate::of_key(
        "limit-switches",
        &format!("simulated.limit_margin_fraction_of_travel = {margin}"),
        true,
        Influence::Mandatory(None),
        "open when a setpoint passes them, to the microsecond: a search for a home mark turns \
         round, any other motion ends in a fault; no reading is taken there",
    ));
    candidates
}

/// The axes as they are, with what was chosen of them.
pub(crate) fn axes(
    nominal: &Nominal,
    simulated: &Simulated,
    seed: u64,
    chosen: &Chosen,
) -> [AxisTruth; 4] {
    core::array::from_fn(|i| {
        let (name, mut axis) = (AXIS_NAMES[i], nominal.axes[i].clone());
        for (what, value) in [
            ("zero", &mut axis.u_zero),
            ("homing", &mut axis.u_homing),
            ("scale", &mut axis.u_readback),
            ("settling", &mut axis.settle_s),
        ] {
            if !chosen.has(&format!("{name}-{what}")) {
                *value = 0.0;
            }
        }
        AxisTruth::draw(name, &axis, simulated.start[i], simulated.limit_margin, seed)
    })
}

fn of_axis(name: &str, axis: &NominalAxis, is_angle: bool) -> Vec<Candidate> {
    let (unit, key, per_key) = if is_angle {
        (BoundUnit::Radian, "deg", 180.0 / core::f64::consts::PI)
    } else {
        (BoundUnit::Metre, "mm", 1e3)
    };
    let sized = |value: f64| Influence::Sized(Bound { value, unit });
    let drawn = |what: &str, key_name: &str, u: f64, how: &str| {
        let cause = format!("axes.{name}.{key_name}_{key} = {}", u * per_key);
        Candidate::of_key(format!("{name}-{what}"), &cause, u > 0.0, sized(u), how)
    };
    let resolution = Bound { value: 0.5 / axis.counts_per_unit.abs(), unit };
    let rounded = if axis.has_encoder {
        "the position, rounded to a count"
    } else {
        "the setpoint, rounded to a count"
    };
    let lag = AxisTruth::lag_units_max(axis);
    vec![
        drawn("zero", "u_zero", axis.u_zero, "where the home mark stands, drawn once by the seed"),
        drawn("homing", "u_homing", axis.u_homing, "drawn at each homing of a boot, by its number"),
        drawn(
            "scale",
            "u_readback",
            axis.u_readback,
            "drawn for each count of the scale by the seed",
        ),
        Candidate::of_key(
            format!("{name}-resolution"),
            &format!("axes.{name}.counts_per_{key} and readback"),
            true,
            Influence::Mandatory(Some(resolution)),
            rounded,
        ),
        Candidate::of_key(
            format!("{name}-settling"),
            &format!("axes.{name}.settle_ms = {}", axis.settle_s * 1e3),
            lag > 0.0,
            sized(lag),
            "behind after a stop by what its acceleration asks, (1 - t/settle)³, then exactly at rest",
        ),
    ]
}
