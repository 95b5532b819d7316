//! The stages of the detector that were chosen, in the order in which a current meets them.

use super::dark::{DarkCurrent, DarkDrift};
use super::drift::Drifting;
use super::flicker::FlickerNoise;
use super::gain_switching::Switching;
use super::name;
use super::noise::{ReadNoise, ShotNoise};
use super::non_linearity::NonLinearity;
use super::stray_light::StrayLight;
use crate::Compiled;
use crate::stage::Stages;

/// What joins the light on its way to the photodiode.
pub(crate) fn stray_light(compiled: &Compiled, stages: &mut Stages) {
    let fraction = compiled.simulated.detector.stray_light_fraction_of_flux;
    if compiled.chosen.has(name::STRAY_LIGHT) {
        stages.push(StrayLight::new(fraction, compiled.scene.flux(), compiled.drawn.responsivity));
    }
}

/// From the light's current to the converter.
pub(crate) fn stages(compiled: &Compiled, stages: &mut Stages) {
    let Compiled { nominal, simulated, seed, chosen, .. } = compiled;
    let (d, flaws, seed) = (&nominal.detector, &simulated.detector, *seed);
    let full_scales_a = compiled.drawn.amplifier.full_scales_a();
    if chosen.has(name::DETECTOR_DRIFT) {
        stages.push(Drifting::new(&flaws.drift, seed));
    }
    if chosen.has(name::DARK_CURRENT) {
        stages.push(DarkCurrent { dark_a: simulated.dark_current_a });
    }
    if chosen.has(name::DARK_DRIFT) {
        stages.push(DarkDrift::new(simulated.dark_current_a, flaws.dark_drift_relative_per_h));
    }
    if chosen.has(name::SHOT_NOISE) {
        stages.push(ShotNoise::new(d.adc_rate_hz, seed));
    }
    if chosen.has(name::READ_NOISE) {
        stages.push(ReadNoise::new(d.read_noise_a, seed));
    }
    if let Some(flicker) = flaws.flicker.filter(|_| chosen.has(name::FLICKER_NOISE)) {
        stages.push(FlickerNoise::new(&flicker, d.read_noise_a, d.adc_rate_hz, seed));
    }
    if let Some(switching) = flaws.gain_switching.filter(|_| chosen.has(name::GAIN_SWITCHING)) {
        stages.push(Switching::new(&switching, &full_scales_a));
    }
    if chosen.has(name::NON_LINEARITY) {
        let part = flaws.non_linearity_relative_at_full_scale;
        stages.push(NonLinearity::new(part, &full_scales_a));
    }
}
