//! Outlines of bodies among the directions from a receiver: curves on the unit sphere, where they
//! cross, and what an arc of one adds to a contour integral. It knows no bodies and no light.

use core::f64::consts::TAU;

use glam::DVec3;

use super::disk::less_sine;
use crate::direction::frame;
use crate::estimate::{Estimate, EstimateError, Tolerance};
use crate::quadrature::adaptive;

/// The directions of center + cosine·cos t + sine·sin t for t in [0, turn], the inside on the left
/// as seen from without the unit sphere. A small circle, an arc of a great circle, or the rim of a
/// disk.
#[derive(Debug, Clone, Copy)]
pub(super) struct Curve {
    center: DVec3,
    cosine: DVec3,
    sine: DVec3,
    turn: f64,
    /// Whether the points are unit vectors as they are.
    on_unit_sphere: bool,
}

impl Curve {
    /// All directions at the angle with this sine and cosine to a unit axis.
    pub(super) fn small_circle(axis: DVec3, sin: f64, cos: f64) -> Self {
        let (e, f) = frame(axis);
        Self { center: axis * cos, cosine: e * sin, sine: f * sin, turn: TAU, on_unit_sphere: true }
    }

    /// From one unit vector through a perpendicular one, over an angle.
    pub(super) fn great_arc(from: DVec3, through: DVec3, turn: f64) -> Self {
        Self { center: DVec3::ZERO, cosine: from, sine: through, turn, on_unit_sphere: true }
    }

    /// The rim of a disk whose unit axis points away from the receiver.
    pub(super) fn rim(center: DVec3, axis: DVec3, radius: f64) -> Self {
        let (e, f) = frame(axis);
        Self { center, cosine: e * radius, sine: f * radius, turn: TAU, on_unit_sphere: false }
    }

    pub(super) fn turn(&self) -> f64 {
        self.turn
    }

    fn position(&self, t: f64) -> DVec3 {
        let (sin, cos) = libm::sincos(t);
        self.center + self.cosine * cos + self.sine * sin
    }

    fn velocity(&self, t: f64) -> DVec3 {
        let (sin, cos) = libm::sincos(t);
        self.sine * cos - self.cosine * sin
    }

    /// The direction at t, and the unit vector across the curve there, to its left.
    pub(super) fn direction_and_left(&self, t: f64) -> (DVec3, DVec3) {
        let direction = self.position(t).normalize_or_zero();
        (direction, direction.cross(self.velocity(t)).normalize_or_zero())
    }

    /// ½ ∫ n·((u - u₀) × du) over the arc. The origin u₀ drops out of a closed contour; near it, the
    /// terms are as small as the area. Exact for circles (a chord's triangle and the segment beyond
    /// it); for a rim by quadrature to an absolute tolerance.
    pub(super) fn arc(
        &self,
        [from, to]: [f64; 2],
        normal: DVec3,
        origin: DVec3,
        absolute: f64,
    ) -> Result<Estimate, EstimateError> {
        if self.on_unit_sphere {
            let (start, end) = (self.position(from) - origin, self.position(to) - origin);
            let segment = self.cosine.cross(self.sine) * less_sine(to - from);
            return Ok(Estimate::closed(normal.dot(start.cross(end) + segment) / 2.0, 8.0));
        }
        let integrand = |t: f64| {
            let (position, velocity) = (self.position(t), self.velocity(t));
            let distance = position.length();
            let direction = position / distance;
            let turning = (velocity - direction * direction.dot(velocity)) / distance;
            normal.dot((direction - origin).cross(turning)) / 2.0
        };
        let tolerance = Tolerance::new(0.0, absolute, Tolerance::default().budget())?;
        match adaptive(integrand, from, to, tolerance) {
            // Its bound is counted with the others.
            Err(EstimateError::Unmet { estimate, .. }) => Ok(estimate),
            other => other,
        }
    }

    /// Where the curve crosses a limit, rising. Two crossings within 1e-6 of the `extent` of the scene
    /// are a touch and left out, on either curve alike: between them there is nothing to see.
    pub(super) fn crossings(&self, limit: &Limit, extent: f64) -> Vec<f64> {
        let search = Search {
            bend: limit.bend(self),
            noise: limit.noise(self),
            close: (1e-7 * extent).max(4.0 * f64::EPSILON),
        };
        let mut found = Vec::new();
        self.search(limit, search, [0.0, self.turn], &mut found);
        let touching = |a: f64, b: f64| {
            let apart = self.direction_and_left(a).0 - self.direction_and_left(b).0;
            apart.length() < 1e-6 * extent
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

    /// Halves an interval until it holds no crossing or exactly one, by bounds of the function: none
    /// is missed but two that are too close. Where the curve runs along the limit to rounding, there is
    /// none.
    fn search(&self, limit: &Limit, search: Search, [from, to]: [f64; 2], found: &mut Vec<f64>) {
        let Search { bend, noise, close } = search;
        let (middle, half) = (f64::midpoint(from, to), (to - from) / 2.0);
        let (value, slope) = self.value_and_slope(limit, middle);
        let change = slope.abs() * half + bend * half * half / 2.0;
        // Extremes of magnitude may leave no number to go by.
        if !change.is_finite() || value.abs() > change || value.abs() + change <= noise {
            return;
        }
        if slope.abs() > bend * half {
            if let Some(root) = self.root(limit, [from, to]) {
                found.push(root);
            }
        } else if half > close {
            self.search(limit, search, [from, middle], found);
            self.search(limit, search, [middle, to], found);
        }
    }

    /// The crossing in an interval where the function rises or falls throughout, if there is one: by
    /// Newton's method, by halving where that leaves the bracket.
    fn root(&self, limit: &Limit, [mut from, mut to]: [f64; 2]) -> Option<f64> {
        let sign = self.value_and_slope(limit, from).0;
        if sign * self.value_and_slope(limit, to).0 > 0.0 {
            return None;
        }
        let mut t = f64::midpoint(from, to);
        for _ in 0..80 {
            let (value, slope) = self.value_and_slope(limit, t);
            if value * sign > 0.0 {
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

    fn value_and_slope(&self, limit: &Limit, t: f64) -> (f64, f64) {
        let (position, velocity) = (self.position(t), self.velocity(t));
        match limit {
            Limit::Plane { normal } => (normal.dot(position), normal.dot(velocity)),
            Limit::Cone { .. } => {
                let (across, along) = limit.parts(position);
                let (across_rate, along_rate) = limit.parts(velocity);
                (
                    across.length_squared() - along.length_squared(),
                    2.0 * (across.dot(across_rate) - along.dot(along_rate)),
                )
            }
        }
    }
}

/// What a search for crossings goes by: a bound of the function's second derivative, what rounding
/// makes of its zeros, and how near to each other two of them are not told apart.
#[derive(Debug, Clone, Copy)]
struct Search {
    bend: f64,
    noise: f64,
    close: f64,
}

/// A surface through the receiver that bounds a body's outline: where a function of the direction is
/// zero.
#[derive(Debug, Clone, Copy)]
pub(super) enum Limit {
    /// normal · x
    Plane { normal: DVec3 },
    /// |across|² - |along|², both linear in x.
    Cone { kind: Cone },
}

/// The two cones that outlines lie on.
#[derive(Debug, Clone, Copy)]
pub(super) enum Cone {
    /// Of the directions at an angle to a unit axis.
    Circular { axis: DVec3, sin: f64 },
    /// Through the rim of a disk: its centre, its unit axis, the distance of its plane.
    Rim { center: DVec3, axis: DVec3, distance: f64, radius: f64 },
}

impl Limit {
    /// The linear maps of x whose squared lengths differ by the cone's function: across the cone's
    /// axis, and what that may be at most.
    fn parts(&self, x: DVec3) -> (DVec3, DVec3) {
        match *self {
            Self::Plane { normal } => (normal * normal.dot(x), DVec3::ZERO),
            Self::Cone { kind: Cone::Circular { axis, sin } } => (axis.cross(x), x * sin),
            Self::Cone { kind: Cone::Rim { center, axis, distance, radius } } => {
                let along = axis.dot(x);
                (x * distance - center * along, DVec3::new(radius * along, 0.0, 0.0))
            }
        }
    }

    /// What rounding makes of the function where it is zero.
    fn noise(&self, curve: &Curve) -> f64 {
        let vectors = [curve.center, curve.cosine, curve.sine];
        let reach: f64 = vectors.iter().map(|x| x.length()).sum();
        let sizes: f64 =
            vectors.iter().map(|x| self.parts(*x)).map(|(a, b)| a.length() + b.length()).sum();
        8.0 * f64::EPSILON
            * match self {
                Self::Plane { .. } => reach,
                Self::Cone { kind: Cone::Circular { .. } } => reach * sizes,
                Self::Cone { kind: Cone::Rim { center, distance, .. } } => {
                    reach * (center.length() + distance) * sizes
                }
            }
    }

    /// A bound of the function's second derivative along a curve.
    fn bend(&self, curve: &Curve) -> f64 {
        if let Self::Plane { normal } = self {
            return normal.dot(curve.cosine).abs() + normal.dot(curve.sine).abs();
        }
        let parts = [curve.center, curve.cosine, curve.sine].map(|x| self.parts(x));
        let of = |lengths: [f64; 3]| {
            let swing = lengths[1] + lengths[2];
            2.0 * swing * (2.0 * swing + lengths[0])
        };
        let across = of(parts.map(|(across, _)| across.length()));
        if curve.on_unit_sphere && matches!(self, Self::Cone { kind: Cone::Circular { .. } }) {
            // |x| is 1 all along.
            return across;
        }
        across + of(parts.map(|(_, along)| along.length()))
    }
}
