//! The directions of a beam's rays, wherever they start: what a field that goes with direction alone
//! is averaged over. It does not know the field.
//!
//! A ray leans by q = (p - s)/h, p on the pupil, s on the stop. Both evenly spread, |q| h has the
//! density 2πd · A(d), A being what two disks of their radii share at a distance d; with the weight
//! (1 + q²)⁻² of throughput. In q² this has a Gauss rule (Stieltjes's procedure on a fine rule, Gautschi
//! 2004), and all round equidistant azimuths (Stroud 1971, S₂).

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use super::Beam;
use crate::quadrature::gauss_legendre;

/// Halvings of an interval that holds one root, to the last bit.
const HALVINGS: usize = 60;

impl Beam {
    /// Directions (of length one, towards the detector, beam's frame) and weights, which sum to one:
    /// exact for polynomials of the leaning up to `degree`. Degree 0 and 1: the axis alone; else a
    /// quarter as many rings as the degree, and one spoke more than it.
    /// Who needs it: the simulator, where a patch fills the beam and is the same all over.
    ///
    /// ```
    /// use radiometry::beam::Beam;
    /// // The same second moment as that of all rays.
    /// let beam = Beam::of_spot(0.006, 0.0025, 0.3)?;
    /// let square: f64 = beam.directions(5).iter().map(|(at, weight)| weight * at.x * at.x).sum();
    /// assert!((square / beam.moments()?.direction - 1.0).abs() < 1e-9);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn directions(&self, degree: usize) -> Vec<(DVec3, f64)> {
        if degree <= 1 {
            return vec![(DVec3::Z, 1.0)];
        }
        let (rings, spokes) = ((degree + 1).div_ceil(4), degree + 1);
        let mut nodes = Vec::with_capacity(rings * spokes);
        for (square, weight) in gauss(&self.leanings(rings), rings) {
            let (lean, cos) = (square.sqrt(), 1.0 / (1.0 + square).sqrt());
            for k in 0..spokes {
                let (sin_phi, cos_phi) = libm::sincos(TAU * k as f64 / spokes as f64);
                let direction = DVec3::new(lean * cos_phi * cos, lean * sin_phi * cos, cos);
                nodes.push((direction, weight / spokes as f64));
            }
        }
        nodes
    }

    /// q² and its weight, finely: on both sides of the place where the smaller disk begins to look
    /// over the larger one, with a change of variable for the roots at its ends.
    fn leanings(&self, rings: usize) -> Vec<(f64, f64)> {
        let (large, small) = (
            self.pupil_radius_m.max(self.stop_radius_m),
            self.pupil_radius_m.min(self.stop_radius_m),
        );
        let rule = gauss_legendre(4 * rings + 40);
        let mut fine = Vec::with_capacity(2 * rule.len());
        for (from, to) in [(0.0, large - small), (large - small, large + small)] {
            let (middle, half) = (f64::midpoint(from, to), (to - from) / 2.0);
            for (node, weight) in &rule {
                let (sin, cos) = libm::sincos(FRAC_PI_2 * node);
                let distance = middle + half * sin;
                let square = (distance / self.separation_m) * (distance / self.separation_m);
                let shared = shared(large, small, distance) / (PI * small * small);
                let part = weight * cos * half * distance * shared;
                fine.push((square, part / ((1.0 + square) * (1.0 + square))));
            }
        }
        fine
    }
}

/// The area that two disks share, their centres this far apart.
fn shared(large: f64, small: f64, apart: f64) -> f64 {
    if apart <= large - small {
        return PI * small * small;
    }
    if apart >= large + small {
        return 0.0;
    }
    let segment = |own: f64, other: f64| {
        let along = (apart * apart + own * own - other * other) / (2.0 * apart);
        let angle = libm::acos((along / own).clamp(-1.0, 1.0));
        own * own * (angle - libm::sin(2.0 * angle) / 2.0)
    };
    (segment(large, small) + segment(small, large)).max(0.0)
}

/// The Gauss rule with `n` nodes of a discrete measure, its weights summing to one.
fn gauss(measure: &[(f64, f64)], n: usize) -> Vec<(f64, f64)> {
    // Orthogonal polynomials pₖ₊₁ = (x - aₖ) pₖ - bₖ pₖ₋₁, on x = the place in units of the largest.
    let unit = measure.iter().map(|(place, _)| *place).fold(f64::MIN_POSITIVE, f64::max);
    let total: f64 = measure.iter().map(|(_, weight)| weight).sum();
    let (mut before, mut now) = (vec![0.0; measure.len()], vec![1.0; measure.len()]);
    let (mut recurrence, mut norm_before) = (Vec::with_capacity(n), 1.0);
    for k in 0..n {
        let (mut norm, mut first) = (0.0, 0.0);
        for ((place, weight), value) in measure.iter().zip(&now) {
            let part = weight / total * value * value;
            norm += part;
            first += part * place / unit;
        }
        let (a, b) = (first / norm, if k == 0 { 0.0 } else { norm / norm_before });
        recurrence.push((a, b));
        for (i, (place, _)) in measure.iter().enumerate() {
            let next = (place / unit - a) * now[i] - b * before[i];
            before[i] = now[i];
            now[i] = next;
        }
        norm_before = norm;
    }
    roots(&recurrence).into_iter().map(|x| (x * unit, christoffel(&recurrence, x))).collect()
}

/// pₖ at x, k being the recurrence's length.
fn polynomial(recurrence: &[(f64, f64)], x: f64) -> f64 {
    let (mut before, mut now) = (0.0, 1.0);
    for (a, b) in recurrence {
        (before, now) = (now, (x - a) * now - b * before);
    }
    now
}

/// Of the last polynomial, in [0, 1]: the roots of each lie between those of the one before.
fn roots(recurrence: &[(f64, f64)]) -> Vec<f64> {
    let mut between = Vec::new();
    for k in 1..=recurrence.len() {
        let own = &recurrence[..k];
        let ends = [&[0.0], &between[..], &[1.0]].concat();
        let within = ends.windows(2).map(|pair| {
            let (mut low, mut high) = (pair[0], pair[1]);
            let is_below = polynomial(own, low) > 0.0;
            for _ in 0..HALVINGS {
                let middle = f64::midpoint(low, high);
                if (polynomial(own, middle) > 0.0) == is_below {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            f64::midpoint(low, high)
        });
        between = within.collect();
    }
    between
}

/// One over Σ pₖ(x)²/‖pₖ‖².
fn christoffel(recurrence: &[(f64, f64)], x: f64) -> f64 {
    let (mut before, mut now, mut norm, mut sum) = (0.0, 1.0, 1.0, 0.0);
    for (k, (a, b)) in recurrence.iter().enumerate() {
        if k > 0 {
            norm *= b;
        }
        sum += now * now / norm;
        (before, now) = (now, (x - a) * now - b * before);
    }
    1.0 / sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the mean over all rays, of fields that a polynomial does not exhaust.
    #[test]
    fn means_over_directions_are_those_over_all_rays() {
        for (pupil, spot) in [(0.006_25, 0.002_5), (0.002, 0.008), (0.005, 0.005), (0.03, 0.001)] {
            let beam = Beam::of_spot(pupil, spot, 0.3).unwrap();
            let fields: [fn(DVec3) -> f64; 4] = [
                |_| 1.0,
                |at| at.z.powi(40),
                |at| libm::exp(12.0 * at.x - 7.0 * at.y),
                |at| 1.0 / (1.2 + at.x),
            ];
            let rays = beam.rule(14);
            for (i, field) in fields.iter().enumerate() {
                let all = rays.mean(|ray| field(ray.direction));
                for degree in [14, 39] {
                    let nodes = beam.directions(degree);
                    let mean: f64 = nodes.iter().map(|(at, weight)| weight * field(*at)).sum();
                    assert!((mean / all - 1.0).abs() < 2e-8, "{pupil} {spot} {i} {degree}");
                }
            }
        }
    }

    /// A step in direction: the part of the rays that lean to one side is half.
    #[test]
    fn half_of_the_directions_lean_to_each_side() {
        let beam = Beam::of_spot(0.006_25, 0.002_5, 0.3).unwrap();
        for degree in [3, 9, 39, 119] {
            let nodes = beam.directions(degree);
            let all: f64 = nodes.iter().map(|(_, weight)| weight).sum();
            assert!((all - 1.0).abs() < 1e-12, "{degree}: {all}");
            assert!(nodes.iter().all(|(_, weight)| *weight > 0.0), "{degree}");
            let mean: f64 = nodes.iter().map(|(at, weight)| weight * at.y).sum();
            assert!(mean.abs() < 1e-15, "{degree}: {mean}");
        }
    }
}
