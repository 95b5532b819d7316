//! What a horizon leaves of a pixel of an equal-area map, by its contour: with ω₀ any point, the vector
//! area ∫ ω dω is ½∮ (ω - ω₀) x dω (Stokes). Edges are short and smooth, so that a fixed Gauss rule has
//! all digits; along the horizon the integral is elementary. It does not know what else answers where it
//! can't: within a few pixels of a pole, and where an edge winds about the horizon.
//!
//! With ω₀ beside the pixel every term is of the order of its solid angle, and no digits are lost to its
//! edges' length. A crossing needs no exact place: contour and horizon meet in the point that is taken
//! for it, and what lies between is of second order in its elevation.

use core::f64::consts::FRAC_PI_2;
use std::sync::OnceLock;

use glam::DVec3;

use super::folded::{Pixel, root};
use crate::direction::normalised;
use crate::estimate::Estimate;
use crate::quadrature::gauss_legendre;
use crate::transcendental::less_its_sine;

/// Diagonals about a pole whose edges turn too much for the rules below.
const NEAR_POLE: usize = 8;
/// Diagonals beyond which the shorter rule does: on the ellipse of Bernstein that keeps away from the
/// pole and from r = √2 by half, an edge's integrand shrinks by 17.9 or more a node, here by 78.
const FAR: usize = 64;
/// Rounding, in units of 2⁻⁵² of a pixel's side: ω - ω₀ is off by an ulp or two of 1 on each edge.
const ULPS: f64 = 16.0;
/// How far an edge bulges at most, in sides of a pixel times diagonals from the pole: an eighth of
/// |ω''| <= 20.3/r.
const BULGE: f64 = 2.6;
/// How far it winds, in sides of a pixel times diagonals squared: a sixth of |ω'''| <= 60/r².
const WINDING: f64 = 10.0;
/// Elevation of a crossing, in sides of a pixel.
const CROSSING: f64 = 1e-10;

/// An edge of a pixel, from one value of r to another at azimuth πc/2r: from x, or from y if mirrored.
#[derive(Debug, Clone, Copy)]
struct Edge {
    c: f64,
    from: f64,
    to: f64,
    is_mirrored: bool,
    is_lower: bool,
}

impl Edge {
    /// Counter-clockwise from the corner nearest to a = b = 0.
    fn of(pixel: &Pixel, half: usize) -> [Self; 4] {
        let Pixel { i, j, .. } = *pixel;
        let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
        [0, 1, 2, 3].map(|edge| {
            let ((a, b), (a_to, b_to)) = (corners[edge], corners[(edge + 1) % 4]);
            let is_along_a = b == b_to;
            let fixed = if is_along_a { b } else { a };
            let is_lower = (a + b).min(a_to + b_to) >= half;
            let on = |index: usize| index as f64 / half as f64;
            let [from, to] =
                [a + b, a_to + b_to].map(|sum| on(if is_lower { 2 * half - sum } else { sum }));
            let c = on(if is_lower { half - fixed } else { fixed });
            Self { c, from, to, is_mirrored: is_along_a == is_lower, is_lower }
        })
    }

    /// ω and dω/dr.
    fn at(&self, r: f64) -> (DVec3, DVec3) {
        let slant = (2.0 - r * r).sqrt();
        let azimuth = FRAC_PI_2 * (self.c / r);
        let (sin, cos) = libm::sincos(azimuth);
        let (across, height) = (r * slant, (1.0 - r) * (1.0 + r));
        let (down, turning) = (2.0 / slant, -azimuth * slant);
        let place = [across * cos, across * sin, height];
        let step = [
            down * height * cos - turning * sin,
            down * height * sin + turning * cos,
            -down * across,
        ];
        let [place, step] = [place, step].map(|[x, y, z]| {
            let (x, y) = if self.is_mirrored { (y, x) } else { (x, y) };
            DVec3::new(x, y, if self.is_lower { -z } else { z })
        });
        (place, step)
    }

    /// ∫ (n x (ω - ω₀))·dω
    fn integral(&self, from: f64, to: f64, rule: &[(f64, f64)], sight: &Sight) -> f64 {
        let (middle, half) = (f64::midpoint(from, to), 0.5 * (to - from));
        let term = |(node, weight): &(f64, f64)| {
            let (place, step) = self.at(half.mul_add(*node, middle));
            weight * sight.normal.cross(place - sight.origin).dot(step)
        };
        half * rule.iter().map(term).sum::<f64>()
    }

    /// Where the horizon crosses it, by the elevations of its ends; nothing if that can't be told.
    fn crossings(&self, ends: [f64; 2], step: f64, normal: DVec3) -> Option<[Option<f64>; 2]> {
        let diagonals = self.from.min(self.to) / step;
        let [low, high] = [ends[0].abs().min(ends[1].abs()), ends[0].abs().max(ends[1].abs())];
        // Without an azimuth it is a great circle, which meets another one once.
        let is_straight = self.c == 0.0;
        if !is_straight && high * diagonals * diagonals <= WINDING * step {
            return None;
        }
        let elevation = |r: f64| normal.dot(self.at(r).0);
        let slope = |r: f64| normal.dot(self.at(r).1);
        let (from, to) = ((self.from, ends[0]), (self.to, ends[1]));
        let enough = CROSSING * step;
        if (ends[0] >= 0.0) != (ends[1] >= 0.0) {
            return Some([Some(root(from, to, enough, &elevation)), None]);
        }
        if is_straight || low * diagonals > BULGE * step {
            return Some([None, None]);
        }
        let slopes = [slope(self.from), slope(self.to)];
        if slopes[0] * slopes[1] >= 0.0 {
            return Some([None, None]);
        }
        // Of the elevation only the sign matters there.
        let turn = root((self.from, slopes[0]), (self.to, slopes[1]), CROSSING, &slope);
        let extreme = (turn, elevation(turn));
        if (extreme.1 >= 0.0) == (ends[0] >= 0.0) {
            return Some([None, None]);
        }
        Some([
            Some(root(from, extreme, enough, &elevation)),
            Some(root(extreme, to, enough, &elevation)),
        ])
    }
}

/// From where it is looked: the receiver's normal, and a point of the horizon beside the pixel.
struct Sight {
    normal: DVec3,
    origin: DVec3,
}

impl Sight {
    /// ψ - sin ψ, ψ from the origin to a point along the horizon.
    fn segment(&self, place: DVec3) -> f64 {
        let psi = libm::atan2(self.normal.cross(self.origin).dot(place), self.origin.dot(place));
        libm::copysign(less_its_sine(psi.abs()), psi)
    }
}

/// The projected solid angle of what is above the horizon of a folded normal, out of the whole pixel's.
/// Nothing if the contour can't tell.
pub(super) fn visible(
    pixel: &Pixel,
    half: usize,
    whole: Estimate,
    normal: DVec3,
) -> Option<Estimate> {
    let diagonals = (pixel.i + pixel.j).min(2 * (half - 1) - pixel.i - pixel.j);
    if diagonals < NEAR_POLE {
        return None;
    }
    let step = 1.0 / half as f64;
    let edges = Edge::of(pixel, half);
    let corners = edges.map(|edge| edge.at(edge.from).0);
    let elevations = corners.map(|corner| normal.dot(corner));
    let mut crossings = [[None; 2]; 4];
    for (edge, found) in crossings.iter_mut().enumerate() {
        let ends = [elevations[edge], elevations[(edge + 1) % 4]];
        *found = edges[edge].crossings(ends, step, normal)?;
    }
    if crossings.iter().flatten().all(Option::is_none) {
        let is_above = elevations[0] >= 0.0;
        return Some(if is_above { whole } else { Estimate::closed(0.0, 0.0) });
    }
    let middle: DVec3 = corners.into_iter().sum();
    let origin = normalised(middle - normal * normal.dot(middle))?;
    let sight = Sight { normal, origin };
    let rule = rule(diagonals);
    let (mut twice, mut evaluations) = (0.0, 0);
    for ((edge, crossings), elevation) in edges.iter().zip(crossings).zip(elevations) {
        let (mut from, mut is_above) = (edge.from, elevation >= 0.0);
        let ends = crossings.into_iter().flatten().map(|crossing| (crossing, true));
        for (to, is_crossing) in ends.chain([(edge.to, false)]) {
            if is_above {
                twice += edge.integral(from, to, rule, &sight);
                evaluations += rule.len();
            }
            if is_crossing {
                let segment = sight.segment(edge.at(to).0);
                twice += if is_above { -segment } else { segment };
            }
            (from, is_above) = (to, !is_above);
        }
    }
    let error_bound = ULPS * f64::EPSILON * step;
    Some(Estimate { value: (0.5 * twice).max(0.0), error_bound, evaluations })
}

fn rule(diagonals: usize) -> &'static [(f64, f64)] {
    static RULES: OnceLock<[Vec<(f64, f64)>; 2]> = OnceLock::new();
    let [short, long] = RULES.get_or_init(|| [gauss_legendre(5), gauss_legendre(8)]);
    if diagonals >= FAR { short } else { long }
}
