//! Whether a rig as stated, and the terms, are such as there can be, and whether scene and rig go
//! together. It does not know any effect.

use firmware_protocol::AXES_MAX;

use crate::simulated::AXIS_NAMES;
use crate::{CompileError, Nominal, Scene, Simulated, Terms};

/// Refuses numbers that no rig and no plan has, and what does not go together.
pub(crate) fn check(
    scene: &Scene,
    nominal: &Nominal,
    simulated: &Simulated,
    terms: &Terms,
) -> Result<(), CompileError> {
    check_together(scene, nominal, simulated)?;
    check_terms(terms)?;
    let channels: [u8; 4] = core::array::from_fn(|i| nominal.axes[i].channel);
    let mut sorted = channels;
    sorted.sort_unstable();
    if sorted != [0, 1, 2, 3] || nominal.axes.len() > AXES_MAX {
        return Err(CompileError::Channels(channels));
    }
    let positive = |name: String, value: f64| {
        let sound = value.is_finite() && value > 0.0;
        if sound { Ok(()) } else { Err(CompileError::Nominal(name, value)) }
    };
    let not_negative = |name: String, value: f64| {
        let sound = value.is_finite() && value >= 0.0;
        if sound { Ok(()) } else { Err(CompileError::Nominal(name, value)) }
    };
    for (name, axis) in AXIS_NAMES.iter().zip(&nominal.axes) {
        positive(format!("{name}: counts a unit"), axis.counts_per_unit.abs())?;
        positive(format!("{name}: speed"), f64::from(axis.speed_counts_per_s))?;
        positive(format!("{name}: acceleration"), f64::from(axis.acceleration_counts_per_s2))?;
        let travel = f64::from(axis.travel_counts.1) - f64::from(axis.travel_counts.0);
        // One that is fixed has none.
        not_negative(format!("{name}: travel"), travel)?;
        for (what, value) in [
            ("settle", axis.settle_s),
            ("u_zero", axis.u_zero),
            ("u_homing", axis.u_homing),
            ("u_readback", axis.u_readback),
        ] {
            not_negative(format!("{name}: {what}"), value)?;
        }
    }
    let detector = &nominal.detector;
    not_negative("read noise".into(), detector.read_noise_a)?;
    if simulated.detector.flicker.is_some() && detector.read_noise_a == 0.0 {
        let (key, other) = ("simulated.flicker_noise.corner_hz", "a detector.read_noise_a above 0");
        return Err(CompileError::Contradiction(key, other));
    }
    positive("adc rate".into(), f64::from(detector.adc_rate_hz))?;
    let bits = f64::from(detector.adc_bits);
    positive("adc bits".into(), if (2.0..=32.0).contains(&bits) { bits } else { -bits })?;
    positive("gain ranges".into(), detector.gains.len() as f64)?;
    for gain in &detector.gains {
        positive(format!("full scale of {}", gain.name), gain.full_scale_a)?;
    }
    Ok(())
}

fn check_together(
    scene: &Scene,
    nominal: &Nominal,
    simulated: &Simulated,
) -> Result<(), CompileError> {
    if scene.quantity() != nominal.quantity {
        let (scene, rig) = (scene.quantity(), nominal.quantity);
        return Err(CompileError::Quantity { scene, rig });
    }
    let has_stray = simulated.detector.stray_light_fraction_of_flux != 0.0;
    if has_stray && !scene.surfaces().is_empty() {
        let what = "simulated.stray_light_fraction_of_flux of a scene with surfaces";
        return Err(CompileError::Unsupported(what.to_owned()));
    }
    Ok(())
}

fn check_terms(terms: &Terms) -> Result<(), CompileError> {
    let not_negative = |name: &'static str, value: f64| {
        let sound = value.is_finite() && value >= 0.0;
        if sound { Ok(()) } else { Err(CompileError::Terms(name, value, "0 or more")) }
    };
    not_negative("tolerance", terms.tolerance.unwrap_or(0.0))?;
    not_negative("run's length", terms.run_s)?;
    if terms.dwell_s <= 0.0 {
        return Err(CompileError::Terms("dwell", terms.dwell_s, "more than 0 s"));
    }
    not_negative("dwell", terms.dwell_s)?;
    if let Some(region) = &terms.region {
        for (low, high) in [region.x_m, region.y_m] {
            not_negative("region's side", high - low)?;
        }
        let theta = region.theta_max_rad;
        if !(0.0..=core::f64::consts::FRAC_PI_2).contains(&theta) {
            return Err(CompileError::Terms("region's θ", theta, "0 to π/2 rad"));
        }
    }
    Ok(())
}
