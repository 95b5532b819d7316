//! What the detector brings to the compiler: what departs from its data sheet, what is added to
//! the current, and the converter.

use crate::compile::Setting;
use crate::detector::ELEMENTARY_CHARGE_C;
use crate::effect::{Bound, BoundUnit, Candidate, Chosen, Influence};
use crate::{NominalDetector, Simulated};

/// The detector's candidates, in the order in which a current meets them.
pub(crate) fn candidates(setting: &Setting<'_>) -> Vec<Candidate> {
    let mut candidates = data_sheet(&setting.nominal.detector);
    candidates.extend(currents(setting));
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
        ("read-noise", &mut detector.read_noise_a),
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

/// The dark current, if it was chosen.
pub(crate) fn dark_current_a(simulated: &Simulated, chosen: &Chosen) -> f64 {
    if chosen.has("dark-current") { simulated.dark_current_a } else { 0.0 }
}

fn gain_name(i: usize) -> String {
    format!("gain[{i}]")
}

fn data_sheet(d: &NominalDetector) -> Vec<Candidate> {
    let relative = |value: f64| Influence::Sized(Bound { value, unit: BoundUnit::Relative });
    let drawn = |name: String, key: &str, u: f64, how: &str| {
        let key = format!("{key}: {u:.3e} of the signal");
        Candidate::of_key(name, &key, u > 0.0, relative(u), how)
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

fn currents(setting: &Setting<'_>) -> Vec<Candidate> {
    let (d, dark_a) = (&setting.nominal.detector, setting.simulated.dark_current_a);
    let ampere = |value: f64| Influence::Sized(Bound { value, unit: BoundUnit::Ampere });
    let brightest_a = setting.brightest_a() + dark_a.abs();
    let shot_a = libm::sqrt(ELEMENTARY_CHARGE_C * brightest_a * f64::from(d.adc_rate_hz));
    vec![
        Candidate::of_key(
            "dark-current",
            &format!("simulated.dark_current_a = {dark_a:e}"),
            dark_a != 0.0,
            ampere(dark_a.abs()),
            "added to the light's current, shutter open or closed",
        ),
        Candidate::of_key(
            "shot-noise",
            "charge comes in electrons",
            true,
            ampere(shot_a),
            "normal, variance q I times the ADC's rate, keyed by the reading's name",
        ),
        Candidate::of_key(
            "read-noise",
            &format!("detector.read_noise_a = {:e}", d.read_noise_a),
            d.read_noise_a > 0.0,
            ampere(d.read_noise_a),
            "normal, one number an ADC reading, keyed by the reading's name",
        ),
    ]
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
