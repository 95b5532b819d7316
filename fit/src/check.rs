//! What is refused before a fit is tried: numbers that make no sense, by sample and by name.

use crate::weights::has_unknown;
use crate::{Common, FitError, Noise, Penalised, Region, Sample};

pub(crate) fn check(
    samples: &[Sample],
    region: &Region,
    model: Penalised,
    common: &[Common],
) -> Result<(), FitError> {
    if !region.is_sound() {
        return Err(FitError::Region);
    }
    let coefficients = model.basis.checked_len_of_fit()?;
    model.check()?;
    if samples.is_empty() {
        return Err(FitError::Empty);
    }
    for (index, sample) in samples.iter().enumerate() {
        check_sample(index, sample, region)?;
    }
    if let Some(wrong) = common.iter().find(|c| !(c.u.is_finite() && c.u >= 0.0)) {
        return Err(FitError::Common { name: wrong.name.clone() });
    }
    let readings = samples.len();
    // What the readings leave open a penalty decides.
    let coefficients = if model.penalty.is_none() { coefficients } else { 1 };
    if readings < coefficients {
        return Err(FitError::FewerReadingsThanCoefficients { readings, coefficients });
    }
    if readings == coefficients && has_unknown(samples) {
        return Err(FitError::NoScatter { readings });
    }
    Ok(())
}

pub(crate) fn check_sample(index: usize, sample: &Sample, region: &Region) -> Result<(), FitError> {
    let ray = &sample.ray;
    let numbers = [
        ("x", ray.x_m),
        ("y", ray.y_m),
        ("theta", ray.theta_rad),
        ("phi", ray.phi_rad),
        ("value", sample.value),
    ];
    if let Some((what, _)) = numbers.into_iter().find(|(_, number)| !number.is_finite()) {
        return Err(FitError::NotFinite { index, what });
    }
    check_noise(index, sample.noise)?;
    let end_rad = region.chart.theta_end_rad();
    if !(0.0..=end_rad).contains(&ray.theta_rad) {
        return Err(FitError::Theta { index, theta_rad: ray.theta_rad, end_rad });
    }
    if !region.holds(ray) {
        return Err(FitError::OutsideRegion { index, x_m: ray.x_m, y_m: ray.y_m });
    }
    if let Some((s_m, t_m)) = region.missed_second_plane(ray) {
        return Err(FitError::OutsideSecondPlane { index, s_m, t_m });
    }
    Ok(())
}

fn check_noise(index: usize, noise: Noise) -> Result<(), FitError> {
    let (what, value, slope) = match noise {
        Noise::Fixed { variance } => ("variance", variance, 0.0),
        Noise::Modelled { floor, per_radiance } => ("variance's floor", floor, per_radiance),
        Noise::Unknown => return Ok(()),
    };
    if !value.is_finite() {
        return Err(FitError::NotFinite { index, what });
    }
    if !slope.is_finite() {
        return Err(FitError::NotFinite { index, what: "variance per radiance" });
    }
    if value <= 0.0 {
        return Err(FitError::Variance { index, what, value });
    }
    if slope < 0.0 {
        return Err(FitError::ShotNoise { index, value: slope });
    }
    Ok(())
}
