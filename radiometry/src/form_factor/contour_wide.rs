//! The double boundary integral in double-double, for pairs whose terms cancel: side by side, thin gaps,
//! a small polygon before a large one. Some ten times slower than in doubles, and good to
//! another fifteen digits; so are the vertices, relative to each other.

use core::cmp::Ordering;
use std::collections::BinaryHeap;
use std::sync::OnceLock;

use glam::DVec3;

use super::legs::{Leg, edges, legs};
use super::polygons::Facing;
use crate::error_free::DoubleDouble;
use crate::estimate::{Estimate, EstimateError, Tolerance};
use crate::quadrature::wide_gauss_legendre;
use crate::transcendental::{angle, logarithm};
use crate::wide::WideVec;

/// Nodes of the rule that counts, and of the one that it is compared with.
const NODES: [usize; 2] = [20, 14];
const EVALUATIONS: usize = NODES[0] + NODES[1];
/// Roundings of one edge's term, in units of its parts: 2⁻¹⁰⁴ and some hundred operations.
const ROUNDINGS: f64 = 1e-29;
/// 1/2π = this over π, by 2.
const HALVES: i32 = -1;

type Rule = Vec<(DoubleDouble, DoubleDouble)>;

struct Edge {
    start: WideVec,
    along: WideVec,
    length: DoubleDouble,
}

/// A part of a leg, by s.
struct Piece {
    leg: Leg,
    from: f64,
    to: f64,
    value: DoubleDouble,
    difference: f64,
    noise: f64,
}

/// A₁F₁₂ = (1/2π) ∮∮ ln r dr₁·dr₂.
pub(super) fn exchange(facing: &Facing, tolerance: Tolerance) -> Result<Estimate, EstimateError> {
    let rules = rules();
    let (from, to) = (edges(&facing.from), edges(&facing.to));
    let swapped = around(&facing.from) > around(&facing.to);
    let (outer, inner) = if swapped { (&to, &from) } else { (&from, &to) };
    let (wide_from, wide_to) = (wide_edges(&facing.wide_from), wide_edges(&facing.wide_to));
    let (wide_outer, wide_inner) =
        if swapped { (wide_to, wide_from) } else { (wide_from, wide_to) };
    let of = |leg: &Leg| &wide_outer[outer[leg.edge].vertex];
    let mut pieces = BinaryHeap::new();
    for leg in legs(outer, inner) {
        pieces.push(Piece::new(leg, [0.0, 1.0], of(&leg), &wide_inner, rules));
    }
    let mut evaluations = pieces.len() * EVALUATIONS;
    loop {
        let zero = DoubleDouble::from_f64(0.0);
        let sum = pieces.iter().fold(zero, |sum, piece: &Piece| sum.add(piece.value));
        let value = sum.scaled(HALVES).to_f64() / core::f64::consts::PI;
        let truncation = pieces.iter().map(|piece| piece.difference).sum::<f64>() / 6.0;
        let noise = pieces.iter().map(|piece| piece.noise).sum::<f64>() / 6.0;
        let error_bound = truncation + noise + 4.0 * f64::EPSILON * value.abs();
        let estimate = Estimate { value, error_bound, evaluations };
        if !error_bound.is_finite() {
            return Err(EstimateError::Integrand { value });
        }
        if estimate.meets(tolerance) || truncation < noise {
            return estimate.within(tolerance);
        }
        for _ in 0..=pieces.len() / 8 {
            if evaluations + 2 * EVALUATIONS > tolerance.budget() {
                return estimate.within(tolerance);
            }
            let Some(worst) = pieces.pop() else { return estimate.within(tolerance) };
            let middle = f64::midpoint(worst.from, worst.to);
            for ends in [[worst.from, middle], [middle, worst.to]] {
                pieces.push(Piece::new(worst.leg, ends, of(&worst.leg), &wide_inner, rules));
            }
            evaluations += 2 * EVALUATIONS;
        }
    }
}

fn around(vertices: &[DVec3]) -> f64 {
    edges(vertices).iter().map(|edge| edge.length).sum()
}

/// One for each vertex, with a length of 0 where two coincide.
fn wide_edges(vertices: &[WideVec]) -> Vec<Edge> {
    let ends = (0..vertices.len()).map(|i| (vertices[i], vertices[(i + 1) % vertices.len()]));
    ends.map(|(start, end)| {
        let step = end.sub(start);
        let length = step.length();
        let inverse = if length.to_f64() > 0.0 {
            DoubleDouble::from_f64(1.0).div(length)
        } else {
            DoubleDouble::from_f64(0.0)
        };
        Edge { start, along: step.times(inverse), length }
    })
    .collect()
}

impl Piece {
    fn new(leg: Leg, [from, to]: [f64; 2], edge: &Edge, inner: &[Edge], rules: &[Rule; 2]) -> Self {
        let of = DoubleDouble::from_f64;
        let span = to - from;
        let cosines: Vec<(DoubleDouble, &Edge)> = inner
            .iter()
            .filter(|other| other.length.to_f64() > 0.0)
            .map(|other| (edge.along.dot(other.along), other))
            .filter(|(cosine, _)| cosine.to_f64().abs() > 1e-28)
            .collect();
        let whole = edge.length.mul(of(leg.reach.abs() * span));
        let mut sums = [of(0.0); 2];
        let mut noise = 0.0;
        for (sum, rule) in sums.iter_mut().zip(rules) {
            noise = 0.0;
            for (node, weight) in rule {
                // The ends are dyadic, so this loses nothing that counts.
                let s = of(from).add(node.mul(of(span)));
                let (share, growth) = share(&leg, s);
                let t = of(leg.near).add(share.mul(of(leg.reach)));
                let point = edge.start.add(edge.along.times(edge.length.mul(t)));
                let weight = weight.mul(growth);
                for (cosine, other) in &cosines {
                    let (term, rounding) = logarithms(point, other);
                    *sum = sum.add(weight.mul(cosine.mul(term)));
                    noise += weight.to_f64() * rounding;
                }
            }
        }
        let difference = sums[0].sub(sums[1]).mul(whole).to_f64().abs();
        let noise = noise * whole.to_f64();
        Self { leg, from, to, value: sums[0].mul(whole), difference, noise }
    }
}

/// As [`Leg::share`].
fn share(leg: &Leg, s: DoubleDouble) -> (DoubleDouble, DoubleDouble) {
    if !leg.is_graded {
        return (s, DoubleDouble::from_f64(1.0));
    }
    let square = s.mul(s);
    let fourth = square.mul(square);
    (fourth.mul(s), fourth.mul(DoubleDouble::from_f64(5.0)))
}

/// ∫ ln r along an edge but for its length, as in doubles.
fn logarithms(point: WideVec, edge: &Edge) -> (DoubleDouble, f64) {
    let zero = DoubleDouble::from_f64(0.0);
    let from_start = point.sub(edge.start);
    let from_end = from_start.sub(edge.along.times(edge.length));
    let u0 = from_start.dot(edge.along).neg();
    let u1 = u0.add(edge.length);
    let height = from_start.cross(edge.along).length();
    let part = |u: DoubleDouble, away: WideVec| {
        let square = away.dot(away);
        if square.to_f64() < f64::MIN_POSITIVE {
            return zero;
        }
        u.mul(logarithm(square)).scaled(-1)
    };
    let (start, end) = (part(u0, from_start), part(u1, from_end));
    let turned = angle(height.mul(edge.length), u0.mul(u1).add(height.mul(height)));
    let across = height.mul(turned);
    let off = u0.to_f64().abs()
        + edge.length.to_f64()
        + height.to_f64()
        + start.to_f64().abs()
        + end.to_f64().abs();
    (end.sub(start).add(across), ROUNDINGS * off)
}

fn rules() -> &'static [Rule; 2] {
    static RULES: OnceLock<[Rule; 2]> = OnceLock::new();
    RULES.get_or_init(|| NODES.map(wide_gauss_legendre))
}

impl Ord for Piece {
    fn cmp(&self, other: &Self) -> Ordering {
        self.difference.total_cmp(&other.difference)
    }
}

impl PartialOrd for Piece {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Piece {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Piece {}
