//! Sweeps as they were measured: what each read at fixed angles θ, whatever windows it had.

use std::time::Duration;

use fit::kriging::{Knot, Place};

use super::Terms;
use crate::plan::Step;
use crate::rig::Latched;
use crate::rig::calibration::{Calibrated, Flag, Sample};

/// Fewer readings than these say nothing of a curve.
const POINTS_MIN: usize = 3;
/// A node's value is that of a parabola through the readings within so many windows of it, at least.
const REACH_WINDOWS: f64 = 1.6;
/// Nodes in θ at most.
const NODES_MAX: f64 = 32.0;

/// A reading on its way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    /// The arm's angle.
    pub(super) arm_rad: f64,
    pub(super) value: f64,
    pub(super) variance: f64,
    /// Which of the calibrated samples.
    pub(super) sample: usize,
}

/// A sweep.
#[derive(Debug, Clone)]
pub(super) struct Scan {
    pub(super) phi_rad: f64,
    pub(super) x_m: f64,
    pub(super) y_m: f64,
    pub(super) is_check: bool,
    /// How many times slower than at the plan's pace.
    pub(super) slower: f64,
    /// By rising angle.
    pub(super) points: Vec<Point>,
}

/// Angles θ at which sweeps are compared: the middles of equal parts of the region's.
#[derive(Debug, Clone)]
pub(super) struct Nodes {
    pub(super) step_rad: f64,
    pub(super) thetas_rad: Vec<f64>,
    /// sin θ cos θ dθ: throughput.
    pub(super) weights: Vec<f64>,
}

impl Nodes {
    /// Two in the narrowest feature.
    pub(super) fn of(theta_max_rad: f64, narrowest_rad: f64) -> Self {
        let wanted = libm::ceil(2.0 * theta_max_rad / narrowest_rad).clamp(4.0, NODES_MAX);
        let step_rad = theta_max_rad / wanted;
        let thetas_rad: Vec<f64> = (0..32)
            .map(|i| (f64::from(i) + 0.5) * step_rad)
            .take_while(|theta| *theta < theta_max_rad)
            .collect();
        let weight = |theta: &f64| libm::sin(*theta) * libm::cos(*theta) * step_rad;
        let weights = thetas_rad.iter().map(weight).collect();
        Self { step_rad, thetas_rad, weights }
    }
}

/// Sweeps from their samples; what is saturated or unsettled is left out.
pub(super) fn scans(terms: &Terms, steps: &[Step], calibrated: &Calibrated) -> Vec<Scan> {
    let checks = terms.checks();
    // Long ones are flown in parts, each a sweep of its own: the way is what tells them apart.
    let mut scans: Vec<([i32; 3], Scan)> = Vec::new();
    let sweep_of = |sample: &Sample| {
        let at = steps.binary_search_by_key(&sample.reading, |step| step.id).ok()?;
        let step = steps[at];
        let [_, phi, x, y] = step.counts.0;
        step.swept.map(|swept| ([phi, x, y], seconds_per_rad(terms, step.dwell, swept.travel)))
    };
    for (place, sample) in calibrated.samples.iter().enumerate() {
        let is_bad =
            sample.flags.contains(Flag::Saturated) || sample.flags.contains(Flag::Unsettled);
        let Some((counts, pace)) = sweep_of(sample).filter(|_| !is_bad) else { continue };
        let [arm_rad, phi_rad, x_m, y_m] = sample.positions.0;
        let variance = sample.u_independent * sample.u_independent;
        let point = Point { arm_rad, value: sample.value, variance, sample: place };
        if let Some((_, scan)) = scans.iter_mut().rev().find(|(known, _)| *known == counts) {
            scan.points.push(point);
        } else {
            let is_check = checks.contains(&counts);
            let (slower, points) = (pace / terms.pace().seconds_per_rad, vec![point]);
            scans.push((counts, Scan { phi_rad, x_m, y_m, is_check, slower, points }));
        }
    }
    let mut scans: Vec<Scan> = scans.into_iter().map(|(_, scan)| scan).collect();
    scans.retain(|scan| scan.points.len() >= POINTS_MIN);
    for scan in &mut scans {
        scan.points.sort_by(|a, b| a.arm_rad.total_cmp(&b.arm_rad));
    }
    scans
}

/// Of windows that go so far.
fn seconds_per_rad(terms: &Terms, window: Duration, travel: Latched) -> f64 {
    let adc = terms.rig.detector.adc;
    let window_s = f64::from(adc.readings_in(window)) / f64::from(adc.rate_hz);
    window_s / terms.rig.axes[0].distance(f64::from(travel.0[0])).abs()
}

impl Scan {
    /// The direction of an arm's angle as a place among others at the same θ: on a circle of radius
    /// sin θ, and on the sample in halves of the region.
    pub(super) fn place(&self, terms: &Terms, arm_rad: f64) -> Place {
        place(terms, arm_rad, self.phi_rad, self.x_m, self.y_m)
    }

    /// The value at an angle, with its noise; `None` where nothing was read on both sides of it.
    pub(super) fn at(&self, arm_rad: f64, reach_rad: f64) -> Option<(f64, f64)> {
        let (first, last) = (self.points.first()?.arm_rad, self.points.last()?.arm_rad);
        let window = (last - first) / (self.points.len() - 1) as f64;
        if arm_rad < first - 0.6 * window || arm_rad > last + 0.6 * window {
            return None;
        }
        let reach = reach_rad.max(REACH_WINDOWS * window);
        let near = self.points.iter().filter(|point| (point.arm_rad - arm_rad).abs() <= reach);
        let near: Vec<(f64, &Point)> =
            near.map(|point| ((point.arm_rad - arm_rad) / reach, point)).collect();
        parabola(&near)
    }
}

/// A place of [`fit::kriging`].
pub(super) fn place(terms: &Terms, arm_rad: f64, phi_rad: f64, x_m: f64, y_m: f64) -> Place {
    let region = &terms.plan.region;
    let part = |(low, high): (f64, f64), at: f64| {
        let half = 0.5 * (high - low);
        if half > 0.0 { (at - 0.5 * (low + high)) / half } else { 0.0 }
    };
    let sin = libm::sin(arm_rad);
    [
        sin * libm::cos(phi_rad),
        sin * libm::sin(phi_rad),
        part(region.x_m, x_m),
        part(region.y_m, y_m),
    ]
}

/// What the sweeps read at a node, on either side of the zenith; and the noise's variance of such a
/// value, had all of them the plan's pace.
pub(super) fn knots(terms: &Terms, scans: &[Scan], nodes: &Nodes, node: usize) -> (Vec<Knot>, f64) {
    let theta = nodes.thetas_rad[node];
    let mut noise = 0.0;
    let mut knots = Vec::new();
    for scan in scans {
        for arm in [theta, -theta] {
            let Some((value, variance)) = scan.at(arm, 0.5 * nodes.step_rad) else { continue };
            noise += scan.slower * variance;
            knots.push(Knot { at: scan.place(terms, arm), value, variance });
        }
    }
    let count = knots.len().max(1) as f64;
    (knots, noise / count)
}

/// Least squares of a + b t + c t² at t = 0, and the variance of a. Exact for three points.
fn parabola(points: &[(f64, &Point)]) -> Option<(f64, f64)> {
    if points.len() < POINTS_MIN {
        return None;
    }
    let moment = |power: i32| points.iter().map(|(t, _)| libm::pow(*t, f64::from(power))).sum();
    let m: [f64; 5] = [moment(0), moment(1), moment(2), moment(3), moment(4)];
    // The first row of the inverse, by cofactors.
    let cofactors =
        [m[2] * m[4] - m[3] * m[3], m[2] * m[3] - m[1] * m[4], m[1] * m[3] - m[2] * m[2]];
    let determinant = m[0] * cofactors[0] + m[1] * cofactors[1] + m[2] * cofactors[2];
    if determinant.abs() < 1e-12 {
        return None;
    }
    let (mut value, mut variance) = (0.0, 0.0);
    for (t, point) in points {
        let weight = (cofactors[0] + cofactors[1] * t + cofactors[2] * t * t) / determinant;
        value += weight * point.value;
        variance += weight * weight * point.variance;
    }
    Some((value, variance))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_comes_back_with_the_noise_of_its_readings() {
        let point = |arm: f64| Point {
            arm_rad: arm,
            value: 2.0 - arm + 3.0 * arm * arm,
            variance: 0.04,
            sample: 0,
        };
        let points = [-0.3, -0.15, 0.02, 0.1, 0.31].map(point);
        let scan = Scan {
            phi_rad: 0.0,
            x_m: 0.0,
            y_m: 0.0,
            is_check: false,
            slower: 1.0,
            points: points.to_vec(),
        };
        let (value, variance) = scan.at(0.05, 1.0).unwrap();
        assert!((value - (2.0 - 0.05 + 3.0 * 0.0025)).abs() < 1e-12, "{value}");
        // Five readings, three unknowns: less than one reading's, more than a fifth of it.
        assert!((0.008..0.04).contains(&variance), "{variance}");
        assert!(scan.at(0.5, 1.0).is_none() && scan.at(-0.5, 1.0).is_none());
    }

    #[test]
    fn nodes_cover_the_region_with_its_throughput() {
        let nodes = Nodes::of(1.4, 0.2);
        let whole: f64 = nodes.weights.iter().sum();
        let expected = 0.5 * libm::sin(1.4) * libm::sin(1.4);
        assert!((whole / expected - 1.0).abs() < 1e-2 && nodes.thetas_rad.len() == 14);
        assert_eq!(Nodes::of(1.4, 0.01).thetas_rad.len(), 32);
    }
}
