//! The exchange A₁F₁₂ of two facing polygons as an integral over pairs of triangles. The integrand is
//! positive, so that nothing cancels; but it peaks where the polygons come near each other.

use core::cmp::Ordering;
use core::f64::consts::PI;
use std::collections::BinaryHeap;
use std::sync::OnceLock;

use glam::DVec3;

use super::polygons::Facing;
use crate::estimate::{Estimate, EstimateError, Tolerance};
use crate::quadrature::{Sum, gauss_legendre};

/// Nodes a side of the rule that counts, and of the one that it is compared with: for all pairs at
/// first, and for those that are not far enough apart for that.
const NODES: [[usize; 2]; 2] = [[5, 4], [8, 6]];
const EVALUATIONS: [usize; 2] = [625 + 256, 4096 + 1296];
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// The bound in units of the difference of the rules.
const CAUTION: f64 = 4.0;

/// A triangle; clockwise if it is to be taken off.
type Triangle = [DVec3; 3];

struct Piece {
    triangles: [Triangle; 2],
    value: f64,
    bound: f64,
    rounding: f64,
}

/// A₁F₁₂ = ∬ cos θ₁ cos θ₂/(π r²) dA₁ dA₂ by product Gauss rules on pairs of triangles, the pair with the
/// largest bound cut across its longest edge. The polygons are taken as signed fans, which stay
/// within their convex hulls and so in front of each other.
pub(super) fn exchange(facing: &Facing, tolerance: Tolerance) -> Result<Estimate, EstimateError> {
    let [first, further] = rules();
    let mut pieces = BinaryHeap::new();
    for from in fan(&facing.from) {
        for to in fan(&facing.to) {
            pieces.push(Piece::new([from, to], facing, first)?);
        }
    }
    let mut evaluations = pieces.len() * EVALUATIONS[0];
    loop {
        let value = pieces.iter().map(|piece| piece.value).collect::<Sum>().value();
        let bound = pieces.iter().map(|piece| piece.bound).sum::<f64>();
        let rounding = pieces.iter().map(|piece| piece.rounding).sum::<f64>();
        let estimate = Estimate { value, error_bound: bound + rounding, evaluations };
        if estimate.meets(tolerance) {
            return Ok(estimate);
        }
        for _ in 0..=pieces.len() / 8 {
            if evaluations + 2 * EVALUATIONS[1] > tolerance.budget() {
                return estimate.within(tolerance);
            }
            let Some(worst) = pieces.pop() else { return estimate.within(tolerance) };
            for half in worst.halves() {
                pieces.push(Piece::new(half, facing, further)?);
            }
            evaluations += 2 * EVALUATIONS[1];
        }
    }
}

/// On [0, 1].
type Rules = [Vec<(f64, f64)>; 2];

fn rules() -> &'static [Rules; 2] {
    static RULES: OnceLock<[Rules; 2]> = OnceLock::new();
    RULES.get_or_init(|| {
        let onto_unit = |(node, weight)| (f64::midpoint(1.0, node), 0.5 * weight);
        let rule = |nodes| gauss_legendre(nodes).into_iter().map(onto_unit).collect();
        NODES.map(|both| both.map(rule))
    })
}

fn fan(vertices: &[DVec3]) -> impl Iterator<Item = Triangle> + '_ {
    vertices.windows(2).skip(1).map(|edge| [vertices[0], edge[0], edge[1]])
}

impl Piece {
    fn new(
        triangles: [Triangle; 2],
        facing: &Facing,
        rules: &Rules,
    ) -> Result<Self, EstimateError> {
        let mut sums = [0.0; 2];
        for (sum, rule) in sums.iter_mut().zip(rules) {
            let from = places(&triangles[0], facing.normal_from, rule);
            let to = places(&triangles[1], facing.normal_to, rule);
            for (point, weight) in &from {
                for (other, other_weight) in &to {
                    let ray = *other - *point;
                    let square = ray.length_squared();
                    let cosines = facing.normal_from.dot(ray) * -facing.normal_to.dot(ray);
                    *sum += weight * other_weight * cosines.max(0.0) / (square * square);
                }
            }
            *sum /= PI;
        }
        let value = sums[0];
        if !value.is_finite() {
            return Err(EstimateError::Integrand { value });
        }
        let bound = CAUTION * (value - sums[1]).abs();
        Ok(Self { triangles, value, bound, rounding: ROUNDING * value.abs() })
    }

    fn halves(&self) -> [[Triangle; 2]; 2] {
        let longest = |triangle: &Triangle| {
            (0..3)
                .map(|i| ((triangle[(i + 1) % 3] - triangle[i]).length_squared(), i))
                .fold((0.0, 0), |longest, edge| if edge.0 > longest.0 { edge } else { longest })
        };
        let [from, to] = self.triangles;
        let (edge_from, edge_to) = (longest(&from), longest(&to));
        if edge_from.0 >= edge_to.0 {
            cut(from, edge_from.1).map(|half| [half, to])
        } else {
            cut(to, edge_to.1).map(|half| [from, half])
        }
    }
}

fn cut(triangle: Triangle, edge: usize) -> [Triangle; 2] {
    let [a, b, c] = [triangle[edge], triangle[(edge + 1) % 3], triangle[(edge + 2) % 3]];
    let middle = a.midpoint(b);
    [[a, middle, c], [middle, b, c]]
}

/// Points of a triangle and their weights in area, by Duffy's map.
fn places(triangle: &Triangle, normal: DVec3, rule: &[(f64, f64)]) -> Vec<(DVec3, f64)> {
    let [a, b, c] = *triangle;
    let twice_area = (b - a).cross(c - a).dot(normal);
    let mut places = Vec::with_capacity(rule.len() * rule.len());
    for (u, weight_u) in rule {
        for (v, weight_v) in rule {
            let point = a + *u * ((b - a) + *v * (c - b));
            places.push((point, weight_u * weight_v * twice_area * *u));
        }
    }
    places
}

impl Ord for Piece {
    fn cmp(&self, other: &Self) -> Ordering {
        self.bound.total_cmp(&other.bound)
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
