//! The directions of a beam's rays, with weights: rings of equidistant spokes about the axis. The
//! places at which the rays of one direction cross the stop are its ring's ([`Lens`]).
//!
//! A ray through both disks is named by its place s on the stop and a = (p - s)/h, p being its
//! place on the pupil: its slope against the axis. Its throughput h²/r⁴ dA dA' is h²/(1 + a²)² ds da/h²:
//! it depends on the direction alone, and all s in the lens count alike. So a basis function, which
//! is one of the direction times one of the place, is averaged over places for each direction.

use std::f64::consts::{FRAC_PI_2, TAU};

use crate::spectral::Eigen;
use faer::Mat;
use radiometry::beam::Beam;
use radiometry::quadrature::gauss_legendre;

use super::lens::{Lens, Place};

/// A rule over a beam's rays.
#[derive(Debug, Clone)]
pub(crate) struct Directions {
    /// What is integrated as if it were a polynomial in the slopes has at most this degree.
    pub(crate) degree: usize,
    pub(crate) rings: Vec<Ring>,
    pub(crate) nodes: Vec<Node>,
}

/// Directions of equal slope.
#[derive(Debug, Clone)]
pub(crate) struct Ring {
    pub(crate) lens: Lens,
    pub(crate) area: f64,
    pub(crate) places: Vec<Place>,
    /// How far from the axis the places lie at most.
    pub(crate) reach_m: f64,
    /// Means over the places of the powers of what lies along the shift and across it, in reaches: by
    /// rising degree, and in each by rising power of what lies across.
    pub(crate) powers: Vec<f64>,
}

/// A direction.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node {
    /// Slopes: in the plane of incidence, leaning down, and horizontal.
    pub(crate) slope: (f64, f64),
    /// Of the slope's azimuth about the axis.
    pub(crate) cos: f64,
    pub(crate) sin: f64,
    /// All sum to one.
    pub(crate) weight: f64,
    pub(crate) ring: usize,
}

impl Directions {
    /// The rule that is exact, to rounding, for polynomials of `degree` in the slopes times
    /// polynomials of `position_degree` in the place.
    pub(crate) fn smooth(beam: &Beam, degree: usize, position_degree: usize) -> Self {
        let degrees = degree + position_degree;
        let slopes = if position_degree == 0 {
            gauss(&slopes(beam, FINE, 2 * FINE), (degree + 1).div_ceil(4))
        } else {
            // Means over places are no polynomials of the slope: they bend where the lens does.
            let inner = degrees.div_ceil(4) + 1;
            slopes(beam, inner, inner + SMOOTH_MORE)
        };
        Self::of(beam, degree, position_degree, slopes, degrees + 1)
    }

    /// A rule as fine as one of this degree, for what has kinks, so that no degree is exact. Where it
    /// is known at which slopes they begin and end, rings lie between these.
    pub(crate) fn kinked(
        beam: &Beam,
        degree: usize,
        position_degree: usize,
        breaks: &[f64],
    ) -> Self {
        let inner = degree.div_ceil(4) + 1;
        let slopes = if breaks.is_empty() {
            slopes(beam, inner, inner + KINKED_MORE)
        } else {
            slopes_between(beam, breaks, inner + KINKED_MORE)
        };
        Self::of(beam, degree, position_degree, slopes, degree + 1)
    }

    fn of(
        beam: &Beam,
        degree: usize,
        position_degree: usize,
        slopes: Vec<(f64, f64)>,
        spokes: usize,
    ) -> Self {
        let mut nodes = Vec::with_capacity(slopes.len() * spokes);
        let mut rings = Vec::with_capacity(slopes.len());
        for (at, (slope, weight)) in slopes.into_iter().enumerate() {
            for k in 0..spokes {
                let (sin, cos) = libm::sincos(TAU * (k as f64 + 0.5) / spokes as f64);
                let weight = weight / spokes as f64;
                nodes.push(Node { slope: (slope * cos, slope * sin), cos, sin, weight, ring: at });
            }
            rings.push(Ring::new(lens(beam, slope), position_degree));
        }
        Self { degree, rings, nodes }
    }
}

impl Ring {
    fn new(lens: Lens, position_degree: usize) -> Self {
        let places = lens.rule(position_degree);
        let reach_m = places.iter().map(|p| libm::hypot(p.along, p.across)).fold(0.0, f64::max);
        let in_reaches = |length_m: f64| if reach_m > 0.0 { length_m / reach_m } else { 0.0 };
        let mut powers = Vec::new();
        for total in 0..=position_degree {
            for of_across in 0..=total {
                let power = |length_m: f64, order: usize| {
                    (0..order).fold(1.0, |p, _| p * in_reaches(length_m))
                };
                let term = |p: &Place| {
                    p.weight * power(p.along, total - of_across) * power(p.across, of_across)
                };
                powers.push(places.iter().map(term).sum());
            }
        }
        Self { lens, area: lens.area(), places, reach_m, powers }
    }
}

fn lens(beam: &Beam, slope: f64) -> Lens {
    let (stop, pupil) = (beam.stop_radius_m(), beam.pupil_radius_m());
    Lens { stop, pupil, shift: beam.separation_m() * slope }
}

/// Slopes and weights. Between the slopes up to which the lens is a whole disk and the largest, its
/// area has square roots at both ends, which a sine takes away.
fn slopes(beam: &Beam, inner_count: usize, outer_count: usize) -> Vec<(f64, f64)> {
    let (stop, pupil, h) = (beam.stop_radius_m(), beam.pupil_radius_m(), beam.separation_m());
    let (inner, outer) = ((pupil - stop).abs() / h, (pupil + stop) / h);
    let mut slopes = Vec::with_capacity(inner_count + outer_count);
    if inner > 0.0 {
        for (node, weight) in gauss_legendre(inner_count) {
            // In the slope's square: a da = dt/2.
            let square = inner * inner * f64::midpoint(1.0, node);
            slopes.push((square.sqrt(), weight * inner * inner / 4.0));
        }
    }
    between(inner, outer, outer_count, &mut slopes);
    weighted(beam, slopes)
}

/// The same with rings between given slopes, rising, as well.
fn slopes_between(beam: &Beam, breaks: &[f64], count: usize) -> Vec<(f64, f64)> {
    let (stop, pupil, h) = (beam.stop_radius_m(), beam.pupil_radius_m(), beam.separation_m());
    let (inner, outer) = ((pupil - stop).abs() / h, (pupil + stop) / h);
    let mut ends = vec![0.0, inner, outer];
    ends.extend(breaks.iter().copied().filter(|slope| *slope > 0.0 && *slope < outer));
    ends.sort_by(f64::total_cmp);
    let mut slopes = Vec::with_capacity(count * ends.len());
    for pair in ends.windows(2).filter(|pair| pair[1] > pair[0]) {
        between(pair[0], pair[1], count, &mut slopes);
    }
    weighted(beam, slopes)
}

/// a da from one slope to another, by a sine.
fn between(from: f64, to: f64, count: usize, slopes: &mut Vec<(f64, f64)>) {
    let (middle, half) = (f64::midpoint(from, to), (to - from) / 2.0);
    for (node, weight) in gauss_legendre(count) {
        let (sin, cos) = libm::sincos(FRAC_PI_2 * node);
        let slope = middle + half * sin;
        slopes.push((slope, weight * half * FRAC_PI_2 * cos * slope));
    }
}

/// Times what the rays of each slope carry; all sum to one.
fn weighted(beam: &Beam, mut slopes: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    for (slope, weight) in &mut slopes {
        let ray = 1.0 / (1.0 + *slope * *slope);
        *weight *= lens(beam, *slope).area() * ray * ray;
    }
    let sum: f64 = slopes.iter().map(|(_, weight)| weight).sum();
    for (_, weight) in &mut slopes {
        *weight /= sum;
    }
    slopes
}

/// So few slopes that powers of their square have the same means as far as possible: Stieltjes'
/// recurrence and the eigenvalues of its matrix (Golub & Welsch 1969).
fn gauss(fine: &[(f64, f64)], count: usize) -> Vec<(f64, f64)> {
    let largest = fine.iter().map(|(slope, _)| slope * slope).fold(0.0, f64::max);
    let mut last = vec![0.0; fine.len()];
    let mut this = vec![1.0; fine.len()];
    let mut matrix = Mat::<f64>::zeros(count, count);
    for k in 0..count {
        let mean = |of: &dyn Fn(usize) -> f64| -> f64 {
            fine.iter().enumerate().map(|(i, (_, weight))| weight * of(i)).sum()
        };
        let t = |i: usize| fine[i].0 * fine[i].0 / largest;
        let middle = mean(&|i| t(i) * this[i] * this[i]);
        let back = if k > 0 { matrix[(k - 1, k)] } else { 0.0 };
        let next: Vec<f64> =
            (0..fine.len()).map(|i| (t(i) - middle) * this[i] - back * last[i]).collect();
        let length = mean(&|i| next[i] * next[i]).sqrt();
        matrix[(k, k)] = middle;
        if k + 1 < count {
            (matrix[(k, k + 1)], matrix[(k + 1, k)]) = (length, length);
        }
        last = std::mem::replace(&mut this, next.into_iter().map(|value| value / length).collect());
    }
    match Eigen::of(&matrix) {
        Some(Eigen { values, vectors }) => (0..count)
            .map(|k| {
                let square = values[k].max(0.0) * largest;
                (square.sqrt(), vectors[(0, k)].powi(2))
            })
            .collect(),
        // It always converges; if not, the fine slopes are as right.
        None => fine.to_vec(),
    }
}

/// Slopes of the inner part from which few are made.
const FINE: usize = 16;
/// More slopes where the lens narrows than where it is whole: its area is no polynomial there.
const SMOOTH_MORE: usize = 8;
/// The same where kinks err by more.
const KINKED_MORE: usize = 3;

#[cfg(test)]
mod tests {
    use super::*;

    /// Means over all rays of products of slope and place, by the rule of directions.
    fn mean(rule: &Directions, of: impl Fn((f64, f64), (f64, f64)) -> f64) -> f64 {
        let over = |node: &Node| -> f64 {
            let places = rule.rings[node.ring].places.iter();
            let turned = |p: &Place| {
                (p.along * node.cos - p.across * node.sin, p.along * node.sin + p.across * node.cos)
            };
            places.map(|place| place.weight * of(node.slope, turned(place))).sum()
        };
        rule.nodes.iter().map(|node| node.weight * over(node)).sum()
    }

    #[test]
    fn directions_first_is_the_same_beam_as_pupil_times_spot() {
        for (pupil, stop) in [(0.00625, 0.0025), (0.003, 0.003), (0.001, 0.004)] {
            let beam = Beam::of_spot(pupil, stop, 0.3).unwrap();
            let (slope, size) = ((pupil + stop) / 0.3, stop);
            let product = beam.rule(13);
            let sparse = Directions::smooth(&beam, 7, 0);
            let ours = Directions::smooth(&beam, 7, 2);
            for (i, j, k, l) in
                [(0, 0, 0, 0), (2, 0, 0, 0), (0, 0, 2, 0), (1, 0, 1, 0), (3, 0, 1, 0)]
                    .into_iter()
                    .chain([
                        (2, 0, 2, 0),
                        (1, 1, 1, 1),
                        (0, 2, 2, 0),
                        (4, 0, 2, 0),
                        (3, 2, 0, 1),
                        (4, 2, 0, 2),
                    ])
            {
                let power = |(a, b): (f64, f64), (s, t): (f64, f64)| {
                    (a / slope).powi(i)
                        * (b / slope).powi(j)
                        * (s / size).powi(k)
                        * (t / size).powi(l)
                };
                let expected = product.mean(|ray| {
                    let along = ray.direction / ray.direction.z;
                    power((along.x, along.y), (ray.point.x, ray.point.y))
                });
                let found = mean(&ours, power);
                let off = (found - expected).abs();
                assert!(off < 1e-7, "a^{i} b^{j} s^{k} t^{l}: {found} of {expected}");
                if (k, l) == (0, 0) {
                    assert!((mean(&sparse, power) - expected).abs() < 1e-12);
                    assert_eq!(sparse.nodes.len(), 16);
                }
            }
        }
    }
}
