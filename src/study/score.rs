//! How far a fitted radiance lies from a known one. It does not know where either comes from.

use fit::{Ray, Region};
use radiometry::quadrature::gauss_legendre;

/// Nodes in sin²θ; the azimuth takes the trapezoid rule, which is exact for harmonics below half
/// its count.
const THETA_NODES: usize = 32;
const PHI_NODES: u32 = 48;
/// Equal parts of each of x and y, and the nodes in each. A polynomial would do with fewer; an
/// emitter that ends inside the region is seen the better the more evenly they stand.
const POSITION_PARTS: u32 = 3;
const POSITION_NODES: usize = 2;

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
        let pairs = pairs(region, fitted, truth);
        let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
            pairs.iter().map(|(weight, fitted, truth)| weight * f(*fitted, *truth)).sum()
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

/// Weight, fitted and true radiance at every node.
fn pairs(
    region: &Region,
    fitted: impl Fn(&Ray) -> f64,
    truth: impl Fn(&Ray) -> f64,
) -> Vec<(f64, f64, f64)> {
    let sin_max = libm::sin(region.theta_max_rad);
    let scale = |(low, high): (f64, f64), t: f64| low + (high - low) * 0.5 * (1.0 + t);
    let (positions, polar) = (position_nodes(), gauss_legendre(THETA_NODES));
    let mut pairs = Vec::new();
    // Place by place: what is the same into all directions is then known from the last.
    for (tx, weight_x) in &positions {
        for (ty, weight_y) in &positions {
            let (x_m, y_m) = (scale(region.x_m, *tx), scale(region.y_m, *ty));
            for (t, weight_theta) in &polar {
                let theta_rad = libm::asin(libm::sqrt(scale((0.0, sin_max * sin_max), *t)));
                for k in 0..PHI_NODES {
                    let turn = (f64::from(k) + 0.5) / f64::from(PHI_NODES);
                    let phi_rad = (2.0 * turn - 1.0) * core::f64::consts::PI;
                    let ray = Ray { x_m, y_m, theta_rad, phi_rad };
                    let weight = weight_theta * weight_x * weight_y;
                    pairs.push((weight, fitted(&ray), truth(&ray)));
                }
            }
        }
    }
    pairs
}

/// Nodes in [-1, 1] and their weights.
fn position_nodes() -> Vec<(f64, f64)> {
    let part = 2.0 / f64::from(POSITION_PARTS);
    let nodes = gauss_legendre(POSITION_NODES);
    let in_part = |i: u32| {
        let low = f64::from(i) * part - 1.0;
        nodes.iter().map(move |(t, weight)| (low + part * 0.5 * (1.0 + t), part * 0.5 * weight))
    };
    (0..POSITION_PARTS).flat_map(in_part).collect()
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
