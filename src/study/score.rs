//! How far a fitted radiance lies from a known one. It does not know where either comes from.

use fit::{Ray, Region};

use super::{Fineness, Nodes};

/// How far a fit lies from the truth: throughput-weighted RMS over a region, each divided by the
/// truth's own, so numbers without a unit. The weight is dT = cos θ dω dA, over the region's
/// rectangle and the cone from the normal to its largest θ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// Of `fitted - truth`.
    pub rms_relative: f64,
    /// The same once the best common factor is taken out of the fit: what a calibration of the
    /// scale could not mend. 1 for a fit that has nothing of the truth.
    pub shape_rms_relative: f64,
    /// That factor: what the fit has to be multiplied by. 0 for a fit that has nothing of the truth.
    pub factor: f64,
}

impl Score {
    /// By a product rule: Gauss-Legendre in sin²θ and in thirds of x and y, the trapezoid rule
    /// in φ. Features narrower than its spacing (7.5° in φ) are seen only in part, and an
    /// emitter's outline inside the region to a sixth of the region. A truth that vanishes
    /// everywhere has no relative error: the answer is `None`.
    pub fn of(
        region: &Region,
        fitted: impl Fn(&Ray) -> f64,
        truth: impl Fn(&Ray) -> f64,
    ) -> Option<Self> {
        let nodes = Nodes::of(region, Fineness::USUAL);
        let at = |field: &dyn Fn(&Ray) -> f64| -> Vec<f64> {
            nodes.rays().map(|(ray, _)| field(&ray)).collect()
        };
        Self::of_values(&nodes, &at(&fitted), &at(&truth))
    }

    /// The same of values at the nodes' rays, in their order.
    pub fn of_values(nodes: &Nodes, fitted: &[f64], truth: &[f64]) -> Option<Self> {
        let values = || nodes.rays().map(|(_, weight)| weight).zip(fitted.iter().zip(truth));
        let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
            values().map(|(weight, (fitted, truth))| weight * f(*fitted, *truth)).sum()
        };
        let signal = sum(&|_, truth| truth * truth);
        if signal <= 0.0 {
            return None;
        }
        let size = sum(&|fitted, _| fitted * fitted);
        let factor = if size > 0.0 { sum(&|fitted, truth| fitted * truth) / size } else { 0.0 };
        let rms = |factor: f64| {
            let error = sum(&|fitted, truth| (factor * fitted - truth) * (factor * fitted - truth));
            libm::sqrt(error / signal)
        };
        Some(Self { rms_relative: rms(1.0), shape_rms_relative: rms(factor), factor })
    }
}

/// A relative number in per cent, to three digits.
pub fn percent(relative: f64) -> String {
    let percent = 100.0 * relative;
    if percent == 0.0 {
        return "0 %".to_owned();
    }
    let magnitude = libm::floor(libm::log10(percent.abs()));
    #[allow(clippy::cast_possible_truncation)] // between -308 and 310
    let decimals = usize::try_from(2 - magnitude as i32).unwrap_or(0);
    format!("{percent:.decimals$} %")
}

/// The middle of numbers, the mean of the two in the middle of an even count; `None` of none.
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    let n = values.len();
    (n > 0).then(|| 0.5 * (values[(n - 1) / 2] + values[n / 2]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const REGION: Region =
        Region::surface((-0.01, 0.03), (0.0, 0.02), core::f64::consts::FRAC_PI_2);

    #[test]
    fn a_constant_relative_error_is_itself() {
        let truth = |ray: &Ray| 3.0 + ray.x_m + libm::cos(ray.theta_rad);
        let score = Score::of(&REGION, |ray| 1.01 * truth(ray), truth).unwrap();
        assert!((score.rms_relative - 0.01).abs() < 1e-13, "{score:?}");
        assert!(score.shape_rms_relative < 1e-12, "{score:?}");
    }

    #[test]
    fn the_weight_is_throughput() {
        // RMS of cos θ under cos θ dω over the hemisphere: sqrt(∫ cos³ / ∫ cos) = sqrt(1/2).
        let score = Score::of(&REGION, |ray| 1.0 + libm::cos(ray.theta_rad), |_| 1.0).unwrap();
        assert!((score.rms_relative - libm::sqrt(0.5)).abs() < 1e-12, "{score:?}");
    }

    #[test]
    fn an_outline_inside_the_region_is_seen_to_a_sixth_of_it() {
        // A patch over the left part, fitted as if it filled the region: off by 1 on the rest.
        for share in [0.2, 0.35, 0.5, 0.65, 0.8] {
            let edge_m = REGION.x_m.0 + share * (REGION.x_m.1 - REGION.x_m.0);
            let patch = |ray: &Ray| f64::from(ray.x_m < edge_m);
            let error = Score::of(&REGION, |_| 1.0, patch).unwrap().rms_relative;
            let seen = 1.0 / (1.0 + error * error);
            assert!((seen - share).abs() < 1.0 / 6.0, "{seen} of {share}");
        }
    }

    #[test]
    fn a_dark_truth_has_no_relative_error() {
        assert_eq!(Score::of(&REGION, |_| 1.0, |_| 0.0), None);
    }
}
