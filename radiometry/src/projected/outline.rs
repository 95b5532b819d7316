//! Outlines of bodies among the directions from a receiver: curves in the stretched frame of a view,
//! where they cross, and what an arc of one adds to a contour integral. It knows no bodies and no
//! light.

use core::f64::consts::{PI, TAU};
use std::sync::OnceLock;

use glam::{DVec2, DVec3};

use super::disk::less_sine;
use super::limit::{Along, Limit};
use super::view::View;
use crate::estimate::{Estimate, EstimateError, Tolerance};
use crate::quadrature::{adaptive, gauss_legendre};

/// The directions of base + sine·sin t - cosine·(1 - cos t), the inside on the left as seen from
/// without. Counted from its point nearest to the source, so that of a large outline that part has
/// its digits too.
#[derive(Debug, Clone, Copy)]
pub(super) struct Curve {
    base: DVec3,
    cosine: DVec3,
    sine: DVec3,
    start: f64,
    turn: f64,
    path: Path,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Path {
    /// A circle on the unit sphere of the unstretched frame. The base's third coordinate less 1.
    Circle { lift: f64 },
    /// A part of a great circle, of unit vectors of the stretched frame.
    Great,
    /// The rim of a disk.
    Rim,
}

impl Curve {
    /// A small circle through a point; `lift` is the third coordinate of that, less 1.
    pub(super) fn circle(base: DVec3, lift: f64, cosine: DVec3, sine: DVec3) -> Self {
        Self { base, cosine, sine, start: -PI, turn: TAU, path: Path::Circle { lift } }
    }

    /// From one unit vector through a perpendicular one, over an angle.
    pub(super) fn great_arc(from: DVec3, through: DVec3, turn: f64) -> Self {
        Self { base: from, cosine: from, sine: through, start: 0.0, turn, path: Path::Great }
    }

    /// The rim of a disk, from one of its points.
    pub(super) fn rim(base: DVec3, cosine: DVec3, sine: DVec3) -> Self {
        Self { base, cosine, sine, start: -PI, turn: TAU, path: Path::Rim }
    }

    /// Where it begins.
    pub(super) fn start(&self) -> f64 {
        self.start
    }

    pub(super) fn turn(&self) -> f64 {
        self.turn
    }

    /// The vectors that it is made of: base, sine, cosine.
    pub(super) fn vectors(&self) -> [DVec3; 3] {
        [self.base, self.sine, self.cosine]
    }

    pub(super) fn position_and_velocity(&self, t: f64) -> (DVec3, DVec3) {
        let (sin_half, cos_half) = libm::sincos(t / 2.0);
        let (sin, versine) = (2.0 * sin_half * cos_half, 2.0 * sin_half * sin_half);
        let position = self.base + self.sine * sin - self.cosine * versine;
        (position, self.sine * (1.0 - versine) - self.cosine * sin)
    }

    /// The direction at t, and the unit vector across the curve there, to its left.
    pub(super) fn direction_and_left(&self, t: f64) -> (DVec3, DVec3) {
        let (position, velocity) = self.position_and_velocity(t);
        let direction = position.normalize_or_zero();
        (direction, direction.cross(velocity.normalize_or_zero()).normalize_or_zero())
    }

    /// ½ ∫ n·((u - u₀) × du) over the arc, u₀ towards the source's middle, which drops out of a closed
    /// contour; near it, the terms are as small as the area. Exact for circles (a chord's triangle
    /// and the segment beyond it) and straight edges; for a rim by quadrature to an absolute
    /// tolerance.
    pub(super) fn arc(
        &self,
        ends: [f64; 2],
        view: &View,
        absolute: f64,
    ) -> Result<Estimate, EstimateError> {
        match self.path {
            Path::Circle { lift } => Ok(self.circle_arc(ends, view, lift)),
            Path::Great if !view.is_stretched() => {
                Ok(self.circle_arc(ends, view, self.base.z - 1.0))
            }
            Path::Great => Ok(self.straight_arc(ends, view)),
            Path::Rim => self.rim_arc(ends, view, absolute),
        }
    }

    fn circle_arc(&self, [from, to]: [f64; 2], view: &View, lift: f64) -> Estimate {
        let [base, sine, cosine] = self.vectors().map(|vector| view.shrunk(vector));
        let base = DVec3::new(base.x, base.y, lift);
        let at = |t: f64| {
            let (sin_half, cos_half) = libm::sincos(t / 2.0);
            base + sine * (2.0 * sin_half * cos_half) - cosine * (2.0 * sin_half * sin_half)
        };
        let normal = view.normal();
        let chord = normal.dot(at(from).cross(at(to))) / 2.0;
        let segment = normal.dot(cosine.cross(sine)) * less_sine(to - from) / 2.0;
        closed(chord + segment, chord.abs() + segment.abs())
    }

    /// With X and Y on the tangent plane at the source's middle, in radians, and (a, b, c) n's parts
    /// there: ½ ∫ (c (X dY - Y dX) + R² (a dY - b dX))/(1 + R²). R is small: the rule is exact to
    /// rounding.
    fn straight_arc(&self, [from, to]: [f64; 2], view: &View) -> Estimate {
        static RULE: OnceLock<Vec<(f64, f64)>> = OnceLock::new();
        let (a, b) = (self.on_tangent_plane(from, view), self.on_tangent_plane(to, view));
        let (edge, normal) = (b - a, view.normal());
        let (twist, slant) = (normal.z * a.perp_dot(edge), normal.x * edge.y - normal.y * edge.x);
        let term = |(node, weight): &(f64, f64)| {
            let square = (a + edge * f64::midpoint(1.0, *node)).length_squared();
            weight * slant.mul_add(square, twist) / (1.0 + square)
        };
        let rule = RULE.get_or_init(|| gauss_legendre(10));
        let value = rule.iter().map(term).sum::<f64>() / 4.0 + from_tangent_plane(a, b, normal);
        closed(value, twist.abs() + slant.abs() * a.length_squared().max(b.length_squared()))
    }

    fn rim_arc(
        &self,
        [from, to]: [f64; 2],
        view: &View,
        absolute: f64,
    ) -> Result<Estimate, EstimateError> {
        let normal = view.normal();
        let unit = view.unit_rad();
        // The small factor is taken out: squares of stars' angles must not spoil the tolerance.
        let stretched = |t: f64| {
            let (position, velocity) = self.position_and_velocity(t);
            let cross = position.cross(velocity);
            let square = position.truncate().length_squared();
            let tilt = normal.x.mul_add(cross.x, normal.y * cross.y);
            let tilt = unit * (square / position.z / position.z) * tilt;
            (normal.z * cross.z - tilt)
                / (2.0 * position.z.mul_add(position.z, unit * unit * square))
        };
        let wide = |t: f64| {
            let (position, velocity) = self.position_and_velocity(t);
            let distance = position.length();
            let direction = position / distance;
            let turning = (velocity - direction * direction.dot(velocity)) / distance;
            normal.dot((direction - DVec3::Z).cross(turning)) / 2.0
        };
        let factor = unit * unit;
        let allowed = (absolute / factor).min(f64::MAX);
        let tolerance = Tolerance::new(0.0, allowed, Tolerance::default().budget())?;
        let (found, correction) = if view.is_stretched() {
            let (a, b) = (self.on_tangent_plane(from, view), self.on_tangent_plane(to, view));
            (adaptive(stretched, from, to, tolerance), from_tangent_plane(a, b, normal))
        } else {
            (adaptive(wide, from, to, tolerance), 0.0)
        };
        // A bound that is too wide is counted with the others.
        let found = match found {
            Err(EstimateError::Unmet { estimate, .. }) => estimate,
            other => other?,
        };
        let arc = found.scaled(factor);
        Ok(Estimate { value: arc.value + correction, ..arc })
    }

    /// X and Y on the tangent plane at the source's middle, in radians.
    fn on_tangent_plane(&self, t: f64, view: &View) -> DVec2 {
        let position = self.position_and_velocity(t).0;
        view.shrunk(position / position.z).truncate()
    }

    /// Where the curve crosses a limit, rising. Two crossings within 1e-6 of the source's size are a
    /// touch and left out, on either curve alike: between them there is nothing to see.
    pub(super) fn crossings(&self, limit: &Limit) -> Vec<f64> {
        const TOUCHING: f64 = 1e-6;
        let along = limit.along(self);
        if along.is_zero || along.is_clear() {
            return Vec::new();
        }
        let speed = self.sine.abs().max_element() / self.base.abs().max_element();
        let ends = [self.start, self.start + self.turn];
        let seam = self.is_closed().then_some(ends);
        let search = Search { along, close: 1e-8 / speed.max(1.0), seam };
        let mut found = Vec::new();
        if let Some(turning) = along.turning_point() {
            search.run_between(turning, ends, &mut found);
        } else {
            let mut halvings_left = HALVINGS_MAX;
            search.run(ends, &mut halvings_left, &mut found);
        }
        if found.is_empty() {
            return found;
        }
        let touching = |a: f64, b: f64| {
            let apart = self.direction_and_left(a).0 - self.direction_and_left(b).0;
            apart.length() < TOUCHING
        };
        let mut apart: Vec<f64> = Vec::with_capacity(found.len());
        for t in found {
            match apart.last() {
                Some(last) if touching(*last, t) => {
                    apart.pop();
                }
                _ => apart.push(t),
            }
        }
        if let [first, .., last] = apart[..]
            && self.is_closed()
            && touching(first, last)
        {
            apart.pop();
            apart.remove(0);
        }
        apart
    }

    /// Whether it ends where it began.
    pub(super) fn is_closed(&self) -> bool {
        self.turn >= TAU
    }
}

/// Four crossings at most, each of which is closed in on from either side: more are no search.
const HALVINGS_MAX: u32 = 1000;

/// A search for crossings, and how near to each other two of them are not told apart.
#[derive(Debug, Clone, Copy)]
struct Search {
    along: Along,
    close: f64,
    /// Where a closed curve begins and ends: one point.
    seam: Option<[f64; 2]>,
}

impl Search {
    /// A parameter with the function there. It has one value where a closed curve meets itself, and
    /// is never zero: so that a crossing at the seam, or where two intervals meet, is found once.
    fn at(&self, t: f64) -> (f64, f64) {
        let place = match self.seam {
            Some([start, end]) if t >= end => start,
            _ => t,
        };
        let (value, _) = self.along.value_and_slope(place);
        (t, if value == 0.0 { f64::MIN_POSITIVE } else { value })
    }

    /// Looks where the function rises or falls throughout: between the turning points, which are half a
    /// turn apart.
    fn run_between(&self, turning: f64, [start, end]: [f64; 2], found: &mut Vec<f64>) {
        let mut from = self.at(start);
        let turns = (-2..=3).map(|half| f64::from(half).mul_add(PI, turning));
        for t in turns.filter(|t| start < *t && *t < end).chain([end]) {
            let to = self.at(t);
            found.extend(self.root(from, to));
            from = to;
        }
    }

    /// Halves an interval until it holds no crossing or exactly one, by bounds of the function: none
    /// is missed but two that are too close.
    fn run(&self, [from, to]: [f64; 2], halvings_left: &mut u32, found: &mut Vec<f64>) {
        let (middle, half) = (f64::midpoint(from, to), (to - from) / 2.0);
        let (value, slope) = self.along.value_and_slope(middle);
        let bend = self.along.bend(from.abs().max(to.abs()));
        let change = slope.abs() * half + bend * half * half / 2.0;
        // Extremes of magnitude may leave no number to go by.
        if !change.is_finite() || value.abs() > change {
            return;
        }
        if slope.abs() > bend * half {
            found.extend(self.root(self.at(from), self.at(to)));
        } else if half > self.close && *halvings_left > 0 {
            *halvings_left -= 1;
            self.run([from, middle], halvings_left, found);
            self.run([middle, to], halvings_left, found);
        }
    }

    /// The crossing in an interval where the function rises or falls throughout, if there is one: by
    /// Newton's method, by halving where that leaves the bracket.
    fn root(&self, (from, sign): (f64, f64), (to, other): (f64, f64)) -> Option<f64> {
        if (sign > 0.0) == (other > 0.0) {
            return None;
        }
        let (mut from, mut to) = (from, to);
        let mut t = f64::midpoint(from, to);
        for _ in 0..80 {
            let (value, slope) = self.along.value_and_slope(t);
            if (value > 0.0) == (sign > 0.0) {
                from = t;
            } else {
                to = t;
            }
            let newton = t - value / slope;
            let next = if newton > from && newton < to { newton } else { f64::midpoint(from, to) };
            let settled = (next - t).abs() <= f64::EPSILON * t.abs().max(1e-300);
            t = next;
            if settled {
                break;
            }
        }
        Some(t)
    }
}

/// What is dropped as adding up to nothing over a closed contour is ½ n·(u₀ × du), the same along
/// curves of any kind; with dX and dY in the place of u's parts it is short of that by this.
fn from_tangent_plane(from: DVec2, to: DVec2, normal: DVec3) -> f64 {
    let excess = |plane: DVec2| {
        let square = plane.length_squared();
        let secant = (1.0 + square).sqrt();
        plane * (square / (secant * (1.0 + secant)))
    };
    let change = excess(to) - excess(from);
    (normal.y * change.x - normal.x * change.y) / 2.0
}

/// A value with what its terms lose to rounding.
fn closed(value: f64, magnitude: f64) -> Estimate {
    Estimate { value, error_bound: 8.0 * f64::EPSILON * magnitude, evaluations: 0 }
}
