//! Integrals over the differences of two intervals. Where a side of each of two rectangles runs along one
//! axis, a pair of points counts by its difference v alone, so many times as the overlap of one side
//! with the other shifted by v; what is left is a one-dimensional integral over v of a positive
//! function. It does not know what the function means.

use std::sync::OnceLock;

use crate::estimate::{Estimate, EstimateError, Tolerance};
use crate::quadrature::{Sum, adaptive_between, gauss_legendre};

/// Sums whose terms are larger than this times the sum give way to a positive integral.
const CANCELLATION_MAX: f64 = 30.0;

/// What the integral that stands in for a closed form is asked for.
pub(super) fn kernel() -> Tolerance {
    Tolerance::FINE.tightened(0.2)
}

/// An integrand that is -2 ln(|v|/reach) + rest(v) near 0, its rest smooth up to twice the reach.
pub(super) struct Edge<'a> {
    pub(super) reach: f64,
    pub(super) rest: &'a dyn Fn(f64) -> f64,
}

impl Edge<'_> {
    /// From 0 to that fraction of a stretch, which is no more than the reach.
    fn add(&self, stretch: &Stretch, fraction: f64, sum: &mut Sum) {
        let length = stretch.reach.abs() * fraction;
        // ∫ -2 ln t dt = 2, ∫ -2 t ln t dt = 1/2, and the logarithm of the reach in lengths.
        let step = stretch.weight_step * fraction;
        let beyond = 2.0 * libm::log(self.reach / length);
        sum.add(length * (2.0 * stretch.weight_near + 0.5 * step));
        sum.add(length * beyond * (stretch.weight_near + 0.5 * step));
        for (node, weight) in panel() {
            let level = stretch.weight_near + step * node;
            sum.add(length * weight * level * (self.rest)(length * node));
        }
    }
}

/// Twelve Gauss nodes and weights on [0, 1].
fn panel() -> &'static [(f64, f64)] {
    static RULE: OnceLock<Vec<(f64, f64)>> = OnceLock::new();
    RULE.get_or_init(|| {
        let onto_unit = |(node, weight)| (f64::midpoint(1.0, node), 0.5 * weight);
        gauss_legendre(12).into_iter().map(onto_unit).collect()
    })
}

/// How often a difference v = b - a occurs between a in one interval and b in another: rising from the
/// first of four breaks to the second, level to the third, falling to the fourth. From a single a, once
/// for each b.
pub(super) struct Overlap {
    breaks: [f64; 4],
    /// How far it rises, and falls.
    ramp: f64,
    level: f64,
}

/// A stretch of v: from its end nearest to 0 to the other one, and the weight at both.
struct Stretch {
    near: f64,
    reach: f64,
    weight_near: f64,
    weight_step: f64,
}

impl Overlap {
    pub(super) fn new(a: [f64; 2], b: [f64; 2]) -> Self {
        let (first, second) = (b[0] - a[0], b[1] - a[1]);
        let width = a[1] - a[0];
        let ramp = width.min(b[1] - b[0]);
        let level = if width > 0.0 { ramp } else { 1.0 };
        let breaks = [b[0] - a[1], first.min(second), first.max(second), b[1] - a[0]];
        Self { breaks, ramp, level }
    }

    /// How often v = 0 occurs; half as often where that jumps.
    pub(super) fn share_at_zero(&self) -> f64 {
        let [start, level_start, level_end, end] = self.breaks;
        if self.ramp == 0.0 && (start == 0.0 || end == 0.0) {
            return 0.5 * self.level;
        }
        if start >= 0.0 || end <= 0.0 {
            0.0
        } else if level_start > 0.0 {
            -start
        } else if level_end < 0.0 {
            end
        } else {
            self.level
        }
    }

    fn stretches(&self) -> Vec<Stretch> {
        let [start, level_start, level_end, end] = self.breaks;
        let mut stretches = Vec::with_capacity(6);
        let mut push = |near: f64, reach: f64, weight_near: f64, weight_step: f64| {
            if reach != 0.0 {
                stretches.push(Stretch { near, reach, weight_near, weight_step });
            }
        };
        // Both ends as they are: an end near 0 is lost in the sum of the other and the reach.
        for (from, to, reach, weight, step) in [
            (start, level_start, self.ramp, 0.0, self.level),
            (level_start, level_end, level_end - level_start, self.level, 0.0),
            (end - self.ramp, end, self.ramp, self.level, -self.level),
        ] {
            if from < 0.0 && to > 0.0 {
                let at_zero = weight + step * (-from / reach);
                push(0.0, from, at_zero, weight - at_zero);
                push(0.0, to, at_zero, weight + step - at_zero);
            } else if from >= 0.0 {
                push(from, reach, weight, step);
            } else {
                push(if to > -0.0 { 0.0 } else { to }, -reach, weight + step, -step);
            }
        }
        stretches
    }

    /// ∫ weight(v) f(v) dv. f may have its peak, or a logarithm, at 0: the places crowd there with
    /// the fourth power.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a place is not negative and at most the count of stretches"
    )]
    pub(super) fn integrate(
        &self,
        mut integrand: impl FnMut(f64) -> f64,
        tolerance: Tolerance,
    ) -> Result<Estimate, EstimateError> {
        let stretches = self.stretches();
        let points: Vec<f64> = (0..=stretches.len()).map(|place| place as f64).collect();
        let at = |place: f64| {
            let index = (place as usize).min(stretches.len() - 1);
            let stretch = &stretches[index];
            let fraction = place - index as f64;
            let cube = fraction * fraction * fraction;
            let fourth = cube * fraction;
            let weight = stretch.weight_near + stretch.weight_step * fourth;
            let value = integrand(stretch.near + stretch.reach * fourth);
            4.0 * cube * stretch.reach.abs() * weight * value
        };
        adaptive_between(at, &points, tolerance)
    }

    /// How narrow a peak of that width around 0 is, in parts of the stretch that it is narrowest in.
    pub(super) fn narrowness(&self, width: f64) -> f64 {
        let narrow = |s: Stretch| libm::hypot(s.near, width) / s.reach.abs();
        self.stretches().into_iter().map(narrow).fold(f64::INFINITY, f64::min)
    }

    /// ∫ weight(v) f(v) dv to rounding, for a positive f that is smooth but for poles or branches at
    /// ±i `scale` and beyond: Gauss panels no longer than 0.8 of the distance from there to where
    /// they begin, which twelve nodes integrate to 1e-17 (Bernstein's ellipse has semi-axes that
    /// add up to 5.5 half panels, and 5.5^-24 is left).
    pub(super) fn graded(
        &self,
        mut integrand: impl FnMut(f64) -> f64,
        scale: f64,
        edge: Option<&Edge<'_>>,
    ) -> f64 {
        const PANEL: f64 = 0.8;
        let mut sum = Sum::default();
        for stretch in self.stretches() {
            let length = stretch.reach.abs();
            let mut done = 0.0;
            if let Some(edge) = edge.filter(|_| stretch.near == 0.0) {
                done = edge.reach.min(length);
                edge.add(&stretch, done / length, &mut sum);
            }
            while done < length {
                let rest = length - done;
                let from = stretch.near.abs() + done;
                let step = (PANEL * libm::hypot(from, scale))
                    .max(1e-70 * length)
                    .max(f64::MIN_POSITIVE)
                    .min(rest);
                for (node, weight) in panel() {
                    let part = (done + step * node) / length;
                    let level = stretch.weight_near + stretch.weight_step * part;
                    sum.add(step * weight * level * integrand(stretch.near + stretch.reach * part));
                }
                // The last panel ends where the stretch does, whatever the roundings.
                done = if step < rest { done + step } else { length };
            }
        }
        sum.value()
    }

    /// The corner terms of C-13, unless they cancel.
    pub(super) fn corner_sum(&self, other: &Self, z: f64) -> Option<f64> {
        let (mut sum, mut size) = (Sum::default(), 0.0);
        for (i, u) in self.breaks.into_iter().enumerate() {
            for (j, v) in other.breaks.into_iter().enumerate() {
                // + at the outer breaks, - at the inner ones.
                let sign = if (i == 0 || i == 3) == (j == 0 || j == 3) { 1.0 } else { -1.0 };
                let (slant_u, slant_v) = (libm::hypot(u, z), libm::hypot(v, z));
                // Where that overflows, z² takes the logarithm to 0.
                let ratio = ((u / z) * (u / z) + (v / z) * (v / z)).min(f64::MAX);
                for term in [
                    u * slant_v * libm::atan2(u, slant_v),
                    v * slant_u * libm::atan2(v, slant_u),
                    -0.5 * z * z * libm::log1p(ratio),
                ] {
                    sum.add(sign * term);
                    size += term.abs();
                }
            }
        }
        let value = sum.value();
        (size < CANCELLATION_MAX * value).then_some(value)
    }

    /// ∬ z²/((ξ-x)² + v² + z²)² dξ dx.
    pub(super) fn between_strips(
        &self,
        v: f64,
        z: f64,
        integrate: impl Fn(&dyn Fn(f64) -> f64, f64) -> Result<f64, EstimateError>,
    ) -> Result<f64, EstimateError> {
        let rho = libm::hypot(v, z);
        let factor = z / rho * (z / rho) / (2.0 * rho);
        let terms = self.breaks.map(|u| u * libm::atan2(u, rho));
        let sum = [terms[0], -terms[1], -terms[2], terms[3]].into_iter().collect::<Sum>().value();
        let size: f64 = terms.iter().sum();
        if size < CANCELLATION_MAX * sum {
            return Ok(factor * sum);
        }
        let kernel_at = |u: f64| {
            let ratio = z / u.mul_add(u, rho * rho);
            ratio * ratio
        };
        integrate(&kernel_at, rho)
    }
}
