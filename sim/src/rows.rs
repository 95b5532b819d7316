//! The rows that tell a person what a rig was compiled to. Each number in them is taken from the
//! compiled rig.

use crate::Compiled;
use crate::detector::ELEMENTARY_CHARGE_C;
use crate::effect::{Bound, BoundUnit, EffectRow};
use crate::simulated::AXIS_NAMES;

/// One row an effect, in the order in which light and counts meet them.
pub(crate) fn write(compiled: &Compiled) -> Vec<EffectRow> {
    let mut rows = emitters(compiled);
    rows.push(beam(compiled));
    rows.extend(mechanics(compiled));
    rows.push(limit_switches(compiled));
    rows.extend(optics(compiled));
    rows.extend(currents(compiled));
    rows.extend(converter(compiled));
    rows
}

fn row(
    name: impl Into<String>,
    included: bool,
    cause: impl Into<String>,
    bound: Option<(f64, BoundUnit)>,
    how: impl Into<String>,
) -> EffectRow {
    let bound = bound.map(|(value, unit)| Bound { value, unit });
    EffectRow { name: name.into(), included, cause: cause.into(), bound, how: how.into() }
}

fn emitters(compiled: &Compiled) -> Vec<EffectRow> {
    let emitters = compiled.scene.emitters();
    if emitters.is_empty() {
        let how = "nothing emits: every reading is dark";
        return vec![row("emission", false, "the scene has no emitter", None, how)];
    }
    let each = emitters.iter().enumerate().map(|(i, emitter)| {
        let cause = format!("emitter[{i}].kind = \"{}\"", emitter.law().name());
        let how = "radiance at the true pose's ray, in closed form";
        row(format!("emission of emitter[{i}]"), true, cause, Some((1.0, BoundUnit::Relative)), how)
    });
    each.collect()
}

/// The one simplification that both sides make, said aloud.
fn beam(compiled: &Compiled) -> EffectRow {
    let spot_mm = 2e3 * compiled.nominal.detector.spot_radius_m;
    row(
        "finite beam",
        false,
        format!("detector.spot_diameter_mm = {spot_mm} would call for it"),
        None,
        "the beam is point-sampled: the reading is the radiance of the axis's ray times the \
         throughput, and the host takes it so too; not bounded: within a spot's radius of an \
         emitter's outline the difference may be the whole signal",
    )
}

fn mechanics(compiled: &Compiled) -> Vec<EffectRow> {
    let mut rows = Vec::new();
    for (i, name) in AXIS_NAMES.iter().enumerate() {
        let axis = &compiled.nominal.axes[i];
        let (unit, key, per_key) = if i < 2 {
            (BoundUnit::Radian, "deg", 180.0 / core::f64::consts::PI)
        } else {
            (BoundUnit::Metre, "mm", 1e3)
        };
        let mut drawn = |what: &str, key_name: &str, u: f64, how: &str| {
            let cause = format!("axes.{name}.{key_name}_{key} = {}", u * per_key);
            let how = if u > 0.0 { how } else { "not called for" };
            rows.push(row(format!("{name} {what}"), u > 0.0, cause, Some((u, unit)), how));
        };
        drawn("zero", "u_zero", axis.u_zero, "where the home mark stands, drawn once by the seed");
        drawn("homing", "u_homing", axis.u_homing, "drawn at each homing of a boot, by its number");
        drawn(
            "scale",
            "u_readback",
            axis.u_readback,
            "drawn for each count of the scale by the seed",
        );
        let resolution = 0.5 / axis.counts_per_unit.abs();
        let cause = format!("axes.{name}.counts_per_{key} and readback");
        let how = if axis.has_encoder {
            "the position, rounded to a count"
        } else {
            "the setpoint, rounded to a count"
        };
        rows.push(row(format!("{name} resolution"), true, cause, Some((resolution, unit)), how));
        let lag = compiled.axes[i].lag_units_max();
        let cause = format!("axes.{name}.settle_ms = {}", axis.settle_s * 1e3);
        let how = if lag > 0.0 {
            "behind after a stop by what its acceleration asks, (1 - t/settle)³, then exactly at rest"
        } else {
            "not called for"
        };
        rows.push(row(format!("{name} settling"), lag > 0.0, cause, Some((lag, unit)), how));
    }
    rows
}

fn limit_switches(compiled: &Compiled) -> EffectRow {
    let margin = compiled.simulated.limit_margin;
    row(
        "limit switches",
        true,
        format!("simulated.limit_margin_fraction_of_travel = {margin}"),
        None,
        "open when a setpoint passes them, to the microsecond: a search for a home mark turns \
         round, any other motion ends in a fault; no reading is taken there",
    )
}

fn optics(compiled: &Compiled) -> Vec<EffectRow> {
    let d = &compiled.nominal.detector;
    // T goes with both radii squared and with the inverse square of the distance, or less.
    let drawn = [
        ("responsivity", "detector.u_responsivity_relative", d.u_responsivity_relative),
        ("pupil size", "detector.u_pupil_diameter_mm", 2.0 * d.u_pupil_radius_m / d.pupil_radius_m),
        ("spot size", "detector.u_spot_diameter_mm", 2.0 * d.u_spot_radius_m / d.spot_radius_m),
        ("distance", "detector.u_distance_mm", 2.0 * d.u_distance_m / d.distance_m),
    ];
    let mut rows: Vec<EffectRow> = drawn
        .into_iter()
        .map(|(name, key, u)| {
            drawn_row(
                name,
                key,
                u,
                "drawn once by the seed, part of one factor from radiance to current",
            )
        })
        .collect();
    rows.extend(d.gains.iter().map(|gain| {
        let name = format!("gain {}", gain.name);
        drawn_row(
            &name,
            "detector.gain.u_relative",
            gain.u_relative,
            "drawn once by the seed, part of the counts an ampere",
        )
    }));
    rows
}

fn drawn_row(name: &str, key: &str, u_relative: f64, how: &str) -> EffectRow {
    let included = u_relative > 0.0;
    let cause = format!("{key}: {u_relative:.3e} of the signal");
    let how = if included { how } else { "not called for" };
    row(name, included, cause, Some((u_relative, BoundUnit::Relative)), how)
}

fn currents(compiled: &Compiled) -> Vec<EffectRow> {
    let d = &compiled.nominal.detector;
    let dark_a = compiled.simulated.dark_current_a;
    let has_dark = dark_a != 0.0;
    let brightest_a = compiled.brightest_a() + dark_a.abs();
    let shot_a = libm::sqrt(ELEMENTARY_CHARGE_C * brightest_a * f64::from(d.adc_rate_hz));
    let not = |included: bool, how: &'static str| if included { how } else { "not called for" };
    vec![
        row(
            "dark current",
            has_dark,
            format!("simulated.dark_current_a = {dark_a:e}"),
            Some((dark_a.abs(), BoundUnit::Ampere)),
            not(has_dark, "added to the light's current, shutter open or closed"),
        ),
        row(
            "shot noise",
            true,
            "charge comes in electrons",
            Some((shot_a, BoundUnit::Ampere)),
            "normal, variance q I times the ADC's rate, keyed by the reading's name",
        ),
        row(
            "read noise",
            d.read_noise_a > 0.0,
            format!("detector.read_noise_a = {:e}", d.read_noise_a),
            Some((d.read_noise_a, BoundUnit::Ampere)),
            not(
                d.read_noise_a > 0.0,
                "normal, one number an ADC reading, keyed by the reading's name",
            ),
        ),
    ]
}

fn converter(compiled: &Compiled) -> Vec<EffectRow> {
    let d = &compiled.nominal.detector;
    let coarsest_a = compiled.amplifier.counts_a().fold(0.0, f64::max);
    let over: Vec<&str> = d
        .gains
        .iter()
        .filter(|gain| gain.full_scale_a < compiled.brightest_a())
        .map(|gain| gain.name.as_str())
        .collect();
    let reached = if over.is_empty() {
        "no gain range's full scale is reached up to θ = 89°".to_owned()
    } else {
        format!("the brightest ray up to θ = 89° exceeds the full scale of {}", over.join(", "))
    };
    vec![
        row(
            "quantisation",
            true,
            format!("detector.adc.bits = {}", d.adc_bits),
            Some((coarsest_a / libm::sqrt(12.0), BoundUnit::Ampere)),
            "rounded to a count; the bound is the coarsest range's",
        ),
        row("saturation", true, reached, None, "counts end where the converter's range does"),
    ]
}
