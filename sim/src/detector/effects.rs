//! What the detector brings to the compiler: what departs from its data sheet, what is added to
//! the current, and the converter.

use super::dark::{DarkCurrent, DarkDrift};
use super::flicker::FlickerNoise;
use super::gain_switching::Switching;
use super::name;
use super::noise::{ReadNoise, ShotNoise};
use super::non_linearity::NonLinearity;
use super::stray_light::StrayLight;
use crate::NominalDetector;
use crate::compile::Setting;
use crate::effect::{Bound, BoundUnit, Candidate, Chosen, Influence};
use crate::levels::Levels;

/// The detector's candidates, in the order in which a current meets them.
pub(crate) fn candidates(setting: &Setting<'_>) -> Vec<Candidate> {
    let levels = Levels::of(setting);
    let mut candidates = data_sheet(&setting.nominal.detector, &levels);
    candidates.extend(light(setting, &levels));
    candidates.extend(currents(setting, &levels));
    candidates.extend(amplifier(setting, &levels));
    candidates.extend(converter(setting));
    candidates
}

/// The detector with what was chosen of its departures.
pub(crate) fn departing(nominal: &NominalDetector, chosen: &Chosen) -> NominalDetector {
    let mut detector = nominal.clone();
    for (name, u) in [
        ("responsivity", &mut detector.u_responsivity_relative),
        ("pupil-size", &mut detector.u_pupil_radius_m),
        ("spot-size", &mut detector.u_spot_radius_m),
        ("distance", &mut detector.u_distance_m),
        (name::READ_NOISE, &mut detector.read_noise_a),
    ] {
        if !chosen.has(name) {
            *u = 0.0;
        }
    }
    for (i, gain) in detector.gains.iter_mut().enumerate() {
        if !chosen.has(&gain_name(i)) {
            gain.u_relative = 0.0;
        }
    }
    detector
}

fn gain_name(i: usize) -> String {
    format!("gain[{i}]")
}

fn data_sheet(d: &NominalDetector, levels: &Levels) -> Vec<Candidate> {
    let drawn = |name: String, key: &str, u: f64, how: &str| {
        let key = format!("{key}: {u:.3e} of the signal");
        let influence = Influence::Relative(levels.proportional(u));
        Candidate::of_key(name, &key, u > 0.0, influence, how)
    };
    let factor = "drawn once by the seed, part of one factor from radiance to current";
    // T goes with both radii squared and with the inverse square of the distance, or less.
    let optics = [
        ("responsivity", "detector.u_responsivity_relative", d.u_responsivity_relative),
        ("pupil-size", "detector.u_pupil_diameter_mm", 2.0 * d.u_pupil_radius_m / d.pupil_radius_m),
        ("spot-size", "detector.u_spot_diameter_mm", 2.0 * d.u_spot_radius_m / d.spot_radius_m),
        ("distance", "detector.u_distance_mm", 2.0 * d.u_distance_m / d.distance_m),
    ];
    let optics = optics.into_iter().map(|(name, key, u)| drawn(name.into(), key, u, factor));
    let gains = d.gains.iter().enumerate().map(|(i, gain)| {
        let key = format!("detector.gain[{i}].u_relative of \"{}\"", gain.name);
        let how = "drawn once by the seed, part of the counts an ampere";
        drawn(gain_name(i), &key, gain.u_relative, how)
    });
    optics.chain(gains).collect()
}

/// What light makes of the detector before its dark current is added.
fn light(setting: &Setting<'_>, levels: &Levels) -> Vec<Candidate> {
    let flaws = &setting.simulated.detector;
    let (fraction, drift) = (flaws.stray_light_fraction_of_flux, &flaws.drift);
    let responsivity = setting.nominal.detector.responsivity_a_per_w;
    let stray = StrayLight::new(fraction, setting.scene.flux(), responsivity);
    vec![
        Candidate::of_key(
            name::STRAY_LIGHT,
            &format!("simulated.stray_light_fraction_of_flux = {fraction:e}"),
            fraction != 0.0,
            Influence::Relative(stray.influence(levels)),
            "a part of the scene's whole flux, whatever the pose, while the shutter is open",
        ),
        Candidate::of_key(
            name::DETECTOR_DRIFT,
            &format!(
                "simulated.detector_drift: {:e} per h, {:e} per root h",
                drift.relative_per_h, drift.random_walk_relative_per_root_h
            ),
            !drift.is_none(),
            Influence::Relative(drift.influence(levels)),
            "a factor on the light's current: linear and Brownian in the device's time",
        ),
    ]
}

fn currents(setting: &Setting<'_>, levels: &Levels) -> Vec<Candidate> {
    let (d, dark_a) = (&setting.nominal.detector, setting.simulated.dark_current_a);
    let per_h = setting.simulated.detector.dark_drift_relative_per_h;
    let drift = DarkDrift::new(dark_a, per_h);
    vec![
        Candidate::of_key(
            name::DARK_CURRENT,
            &format!("simulated.dark_current_a = {dark_a:e}"),
            dark_a != 0.0,
            Influence::Relative(DarkCurrent::influence(dark_a, levels)),
            "added to the light's current, shutter open or closed",
        ),
        Candidate::of_key(
            name::DARK_DRIFT,
            &format!("simulated.dark_drift_relative_per_h = {per_h:e}"),
            per_h != 0.0 && dark_a != 0.0,
            Influence::Relative(drift.influence(levels)),
            "the dark current's change, linear in the device's time",
        ),
        Candidate::of_key(
            name::SHOT_NOISE,
            "charge comes in electrons",
            true,
            Influence::Relative(ShotNoise::influence(dark_a, levels)),
            "normal, variance q I times the ADC's rate, keyed by the reading's name",
        ),
        Candidate::of_key(
            name::READ_NOISE,
            &format!("detector.read_noise_a = {:e}", d.read_noise_a),
            d.read_noise_a > 0.0,
            Influence::Relative(ReadNoise::influence(d.read_noise_a, levels)),
            "normal, one number an ADC reading, keyed by the reading's name",
        ),
        flicker(setting, levels),
    ]
}

fn flicker(setting: &Setting<'_>, levels: &Levels) -> Candidate {
    let d = &setting.nominal.detector;
    let Some(flicker) = &setting.simulated.detector.flicker else {
        let key = "no simulated.flicker_noise";
        let none = Influence::Relative(0.0);
        return Candidate::of_key(name::FLICKER_NOISE, key, false, none, "");
    };
    let noise = FlickerNoise::new(flicker, d.read_noise_a, d.adc_rate_hz, 0);
    Candidate::of_key(
        name::FLICKER_NOISE,
        &format!("simulated.flicker_noise.corner_hz = {}", flicker.corner_hz),
        d.read_noise_a > 0.0,
        Influence::Relative(noise.influence(levels)),
        "1/f within a dwell: a sum of relaxation processes, keyed by the reading's name",
    )
}

fn amplifier(setting: &Setting<'_>, levels: &Levels) -> Vec<Candidate> {
    let flaws = &setting.simulated.detector;
    let gains = &setting.nominal.detector.gains;
    let full_scales_a: Vec<f64> = gains.iter().map(|gain| gain.full_scale_a).collect();
    let switching = flaws.gain_switching.as_ref().map_or_else(
        || {
            let key = "no simulated.gain_switching";
            let none = Influence::Relative(0.0);
            Candidate::of_key(name::GAIN_SWITCHING, key, false, none, "")
        },
        |switching| {
            let stage = Switching::new(switching, &full_scales_a);
            Candidate::of_key(
                name::GAIN_SWITCHING,
                &format!(
                    "simulated.gain_switching.step_relative = {:e}, of {} gain ranges",
                    switching.step_relative,
                    gains.len()
                ),
                switching.step_relative != 0.0 && gains.len() > 1,
                Influence::Relative(stage.influence(&full_scales_a, levels)),
                "an offset after a change of range that decays exponentially",
            )
        },
    );
    let part = flaws.non_linearity_relative_at_full_scale;
    let stage = NonLinearity::new(part, &full_scales_a);
    let linearity = Candidate::of_key(
        name::NON_LINEARITY,
        &format!("simulated.non_linearity_relative_at_full_scale = {part:e}"),
        part != 0.0,
        Influence::Relative(stage.influence(&full_scales_a, levels)),
        "a compression in proportion to the reading's part of full scale",
    );
    vec![switching, linearity]
}

fn converter(setting: &Setting<'_>) -> Vec<Candidate> {
    let d = &setting.nominal.detector;
    let count_a = |full_scale_a: f64| full_scale_a / libm::scalbn(1.0, i32::from(d.adc_bits) - 1);
    let coarsest_a = d.gains.iter().map(|gain| count_a(gain.full_scale_a)).fold(0.0, f64::max);
    let value = coarsest_a / libm::sqrt(12.0);
    let over: Vec<&str> = d
        .gains
        .iter()
        .filter(|gain| gain.full_scale_a < setting.brightest_a())
        .map(|gain| gain.name.as_str())
        .collect();
    let reached = if over.is_empty() {
        "no gain range's full scale is reached in the region".to_owned()
    } else {
        format!("the region's brightest ray exceeds the full scale of {}", over.join(", "))
    };
    vec![
        Candidate::of_key(
            "quantisation",
            &format!("detector.adc.bits = {}", d.adc_bits),
            true,
            Influence::Mandatory(Some(Bound { value, unit: BoundUnit::Ampere })),
            "rounded to a count; the bound is the coarsest range's",
        ),
        Candidate::of_key(
            "saturation",
            &reached,
            true,
            Influence::Mandatory(None),
            "counts end where the converter's range does",
        ),
    ]
}
