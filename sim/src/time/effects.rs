//! What time brings to the compiler: how the light of the scene goes with it.

use super::mains::Flickering;
use super::warm_up::WarmingUp;
use crate::Compiled;
use crate::compile::Setting;
use crate::effect::{Candidate, Influence};
use crate::levels::Levels;
use crate::stage::Stages;

const WARM_UP: &str = "warm-up";
pub(super) const MAINS_FLICKER: &str = "mains-flicker";

/// The candidates, in the order in which light meets them.
pub(crate) fn candidates(setting: &Setting<'_>) -> Vec<Candidate> {
    let (levels, source) = (Levels::of(setting), setting.scene.over_time());
    let not = |name: &str, key: &str| {
        Candidate::of_key(name, &format!("no source.{key}"), false, Influence::Relative(0.0), "")
    };
    let warm_up = source.warm_up.map_or_else(
        || not(WARM_UP, "warm_up"),
        |warm_up| {
            Candidate::of_key(
                WARM_UP,
                &format!("source.warm_up.amplitude_relative = {:e}", warm_up.amplitude_relative),
                warm_up.amplitude_relative != 0.0,
                Influence::Relative(warm_up.influence(&levels)),
                "a factor on all light, exponential in the device's time",
            )
        },
    );
    let flicker = source.mains_flicker.map_or_else(
        || not(MAINS_FLICKER, "mains_flicker"),
        |flicker| {
            let key = format!(
                "source.mains_flicker.depth_relative = {:e} at {} Hz",
                flicker.depth_relative, flicker.frequency_hz
            );
            Candidate::of_key(
                MAINS_FLICKER,
                &key,
                flicker.depth_relative != 0.0,
                Influence::Relative(flicker.influence(&levels)),
                "a factor on all light, a sine averaged over each ADC reading",
            )
        },
    );
    vec![warm_up, flicker]
}

/// The stages that were chosen.
pub(crate) fn stages(compiled: &Compiled, stages: &mut Stages) {
    let source = compiled.scene.over_time();
    if let Some(warm_up) = source.warm_up.filter(|_| compiled.chosen.has(WARM_UP)) {
        stages.push(WarmingUp::new(warm_up));
    }
    if let Some(flicker) = source.mains_flicker.filter(|_| compiled.chosen.has(MAINS_FLICKER)) {
        let rate_hz = compiled.nominal.detector.adc_rate_hz;
        stages.push(Flickering::new(&flicker, rate_hz, compiled.seed));
    }
}
