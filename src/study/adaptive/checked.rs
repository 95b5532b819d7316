//! What sweeps say of a fit that has not seen them.

use fit::{Choice, Chosen, Fit, Optics, Ruled};

use super::Terms;
use super::scans::Scan;
use crate::rig::calibration::{Calibrated, Sample};

/// Fewer checks than these have no mean worth stating.
pub(super) const CHECKS_MIN: usize = 4;
/// The normal distribution's 90 % quantile.
const Z_90: f64 = 1.281_551_565_544_600_4;

/// An error estimated from checks, relative to the radiance's root mean square.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Checked {
    /// The basis that the other sweeps asked for.
    pub(super) chosen: Chosen,
    pub(super) relative: f64,
    /// What it is below with a confidence of 90 %, by the scatter among the checks.
    pub(super) upper_relative: f64,
}

/// Fits what is not a check, in the basis that those readings ask for, and asks the checks.
/// `mean_square` is that of the radiance over the region. An error is the fit's own.
pub(super) fn checked(
    terms: &Terms,
    calibrated: &Calibrated,
    scans: &[Scan],
    mean_square: f64,
) -> Result<Option<Checked>, fit::FitError> {
    let checks: Vec<&Scan> = scans.iter().filter(|scan| scan.is_check).collect();
    if checks.len() < CHECKS_MIN {
        return Ok(None);
    }
    let is_held = |place: usize| {
        checks.iter().any(|scan| scan.points.iter().any(|point| point.sample == place))
    };
    let samples = calibrated.samples.iter().enumerate();
    let seen: Vec<Sample> =
        samples.filter(|(place, _)| !is_held(*place)).map(|(_, sample)| sample.clone()).collect();
    let rest = Calibrated { samples: seen, ..calibrated.clone() };
    let ruled = rest.fit_field(&terms.region, &terms.plan.fit, terms.optics.as_ref())?;
    let Ruled { fit, choice, .. } = ruled;
    let squares: Vec<f64> = checks
        .iter()
        .filter_map(|scan| mean_square_error(&fit, terms.optics.as_ref(), calibrated, scan))
        .collect();
    if squares.len() < CHECKS_MIN {
        return Ok(None);
    }
    let (mean, upper) = mean_and_upper(&squares);
    let relative = |square: f64| libm::sqrt(square.max(0.0) / mean_square);
    let (relative, upper_relative) = (relative(mean), relative(upper));
    let chosen = choice.as_ref().and_then(Choice::chosen);
    let chosen = chosen.unwrap_or_else(|| fit.model().into());
    Ok(Some(Checked { chosen, relative, upper_relative }))
}

/// Of a sweep, weighted with throughput, its readings' own noise taken out.
fn mean_square_error(
    fit: &Fit,
    optics: Option<&Optics>,
    calibrated: &Calibrated,
    scan: &Scan,
) -> Option<f64> {
    let rays: Vec<fit::Ray> =
        scan.points.iter().map(|point| calibrated.samples[point.sample].ray()).collect();
    let levels = optics.and_then(|optics| fit.readings(&rays, optics).ok());
    let levels = levels.unwrap_or_else(|| rays.iter().map(|ray| fit.value(ray)).collect());
    let (mut sum, mut weights) = (0.0, 0.0);
    for ((point, ray), level) in scan.points.iter().zip(&rays).zip(levels) {
        let weight = libm::sin(ray.theta_rad) * libm::cos(ray.theta_rad);
        let error = point.value - level;
        sum += weight * (error * error - point.variance);
        weights += weight;
    }
    (weights > 0.0).then(|| sum / weights)
}

/// The mean, and what it is below with a confidence of 90 %: Student's, by Cornish and Fisher's
/// expansion about the normal quantile, to 1 % from three degrees of freedom on.
fn mean_and_upper(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let (z, freedom) = (Z_90, n - 1.0);
    let first = (z.powi(3) + z) / (4.0 * freedom);
    let second = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * freedom * freedom);
    (mean, mean.max(0.0) + (z + first + second) * libm::sqrt(variance / n))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_is_students() {
        // Quantiles 1.638, 1.533, 1.383 of 3, 4 and 9 degrees of freedom.
        for (n, quantile) in [(4_u32, 1.638), (5, 1.533), (10, 1.383)] {
            let values: Vec<f64> = (0..n).map(|i| 10.0 + f64::from(i)).collect();
            let (mean, upper) = mean_and_upper(&values);
            let square = |value: &f64| (value - mean).powi(2);
            let count = f64::from(n);
            let sd = libm::sqrt(values.iter().map(square).sum::<f64>() / (count - 1.0));
            let found = (upper - mean) / (sd / libm::sqrt(count));
            assert!((found / quantile - 1.0).abs() < 0.01, "{n}: {found}");
        }
    }
}
