//! How much of a convex polygon a circle hides, in projected solid angle: a disk's rim, or the
//! outline that a ball shows. The contour of what both share consists of pieces of the polygon's edges,
//! each a term of Lambert's, and arcs of the circle, whose terms are elementary too. Positions are
//! relative to the receiver.

use core::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use super::parts::clip;
use super::sight::edge_term;
use crate::direction::frame;
use crate::quadrature::gauss_legendre;

/// A circle as a receiver sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Circle {
    pub(super) center: DVec3,
    /// Of length 1, away from the receiver.
    pub(super) axis: DVec3,
    pub(super) radius: f64,
    /// Of its plane.
    pub(super) distance: f64,
}

impl Circle {
    /// Projected solid angle of what it hides of a polygon, 2π times as much.
    pub(super) fn hides(&self, polygon: &[DVec3], normal: DVec3) -> f64 {
        // Nearer than the circle's plane nothing is hidden.
        let mut beyond = clip(polygon, self.axis, self.distance);
        if beyond.len() < 3 {
            return 0.0;
        }
        let chart = Chart::new(self);
        let mut places: Vec<DVec2> = beyond.iter().map(|corner| chart.place(*corner)).collect();
        if signed_area(&places) < 0.0 {
            places.reverse();
            beyond.reverse();
        }
        let (chords, vector) = chart.chords(&places);
        let arcs = chart.arcs(&places, &chords, normal);
        (normal.dot(vector) + arcs).abs()
    }

    /// The regular polygon around or within it, as corners.
    pub(super) fn polygon(&self, corners: usize, radius: f64) -> Vec<DVec3> {
        let (e, f) = frame(self.axis);
        let corner = |i: usize| {
            let (sin, cos) = libm::sincos(TAU * i as f64 / corners as f64);
            self.center + (e * cos + f * sin) * (self.radius * radius)
        };
        (0..corners).map(corner).collect()
    }

    /// Whether two circles' cones may share a direction.
    pub(super) fn may_overlap(&self, other: &Self) -> bool {
        let cone =
            |circle: &Self| libm::atan2(circle.radius, circle.distance.min(circle.center.length()));
        let (a, b) = (self.center, other.center);
        libm::atan2(a.cross(b).length(), a.dot(b)) <= cone(self) + cone(other)
    }
}

/// The circle's plane, in units of its radius from its centre.
struct Chart<'a> {
    circle: &'a Circle,
    /// Towards the centre from the receiver's foot.
    e: DVec3,
    f: DVec3,
    /// From the receiver's foot to the centre.
    shift: f64,
}

/// The part of an edge within the circle.
struct Chord {
    from: DVec2,
    to: DVec2,
    /// Whether the next chord begins where this one ends.
    ends_at_corner: bool,
}

impl<'a> Chart<'a> {
    fn new(circle: &'a Circle) -> Self {
        let across = circle.center - circle.axis * circle.distance;
        let shift = across.length();
        let e = if shift > 1e-14 * circle.distance { across / shift } else { frame(circle.axis).0 };
        Self { circle, e, f: circle.axis.cross(e), shift }
    }

    fn place(&self, corner: DVec3) -> DVec2 {
        let on_plane = corner * (self.circle.distance / self.circle.axis.dot(corner));
        let from_center = on_plane - self.circle.center;
        DVec2::new(from_center.dot(self.e), from_center.dot(self.f)) / self.circle.radius
    }

    fn position(&self, place: DVec2) -> DVec3 {
        self.circle.center + (self.e * place.x + self.f * place.y) * self.circle.radius
    }

    /// All chords, and the sum of their terms.
    fn chords(&self, places: &[DVec2]) -> (Vec<Chord>, DVec3) {
        let mut chords: Vec<Chord> = Vec::with_capacity(places.len());
        let mut vector = DVec3::ZERO;
        for (i, start) in places.iter().enumerate() {
            let end = places[(i + 1) % places.len()];
            let along = end - *start;
            let (square, half) = (along.length_squared(), start.dot(along));
            // How far within the circle the line comes: no cancellation by its distance.
            let distance = start.perp_dot(along);
            let inside = square - distance * distance;
            if inside <= 0.0 || square == 0.0 {
                continue;
            }
            let root = inside.sqrt();
            let (enters, leaves) = ((-half - root) / square, (-half + root) / square);
            if enters >= 1.0 || leaves <= 0.0 {
                continue;
            }
            let at = |t: f64| *start + along * t;
            let from = if enters > 0.0 { at(enters) } else { *start };
            let to = if leaves < 1.0 { at(leaves) } else { end };
            vector += edge_term(self.position(from), self.position(to));
            chords.push(Chord { from, to, ends_at_corner: leaves >= 1.0 });
        }
        (chords, vector)
    }

    /// The arcs from where the outline leaves the circle to where it enters again.
    fn arcs(&self, places: &[DVec2], chords: &[Chord], normal: DVec3) -> f64 {
        let contains_center = || {
            (0..places.len()).all(|i| {
                let (a, b) = (places[i], places[(i + 1) % places.len()]);
                (b - a).perp_dot(-a) >= 0.0
            })
        };
        if chords.is_empty() {
            return if contains_center() { self.arc(-PI, TAU, normal) } else { 0.0 };
        }
        let mut sum = 0.0;
        for (i, chord) in chords.iter().enumerate() {
            let next = &chords[(i + 1) % chords.len()];
            if chord.ends_at_corner && next.from == chord.to {
                continue;
            }
            let (start, end) =
                (libm::atan2(chord.to.y, chord.to.x), libm::atan2(next.from.y, next.from.x));
            let turn = if end >= start { end - start } else { end - start + TAU };
            // A touch: the ends have changed places by rounding.
            if turn > TAU - 1e-6 && !contains_center() {
                continue;
            }
            sum += self.arc(start, turn, normal);
        }
        sum
    }

    /// ∫ n·(r × dr)/r² along the arc. With r² = A + B cos t and a numerator
    /// α + β cos t + γ sin t it is elementary; by quadrature where B vanishes.
    fn arc(&self, start: f64, turn: f64, normal: DVec3) -> f64 {
        let (h, s, rho) = (self.circle.distance, self.shift, self.circle.radius);
        let [along, across, aside] =
            [self.circle.axis, self.e, self.f].map(|axis| normal.dot(axis));
        let constant = rho * rho * along;
        let cosine = rho * (s * along - h * across);
        let sine = -rho * h * aside;
        let (a, b) = (h * h + s * s + rho * rho, 2.0 * rho * s);
        if b < 0.1 * a {
            let pieces = libm::ceil(turn / 0.8).max(1.0);
            let step = turn / pieces;
            let mut sum = 0.0;
            let mut from = start;
            while from < start + turn - 0.5 * step {
                for (node, weight) in rule() {
                    let (sin, cos) = libm::sincos(from + step * f64::midpoint(1.0, *node));
                    sum += weight * (constant + cosine * cos + sine * sin) / (a + b * cos);
                }
                from += step;
            }
            return 0.5 * step * sum;
        }
        let (near, far) = (libm::hypot(h, s - rho), libm::hypot(h, s + rho));
        // tan(angle) = near/far tan(t/2), counted on beyond a right angle.
        let angle = |t: f64| {
            let (sin, cos) = libm::sincos(t / 2.0);
            let angle = libm::atan2(near * sin, far * cos);
            if t > TAU { angle + TAU } else { angle }
        };
        let end = start + turn;
        let mut swept = angle(end) - angle(start);
        if swept < 0.0 {
            swept += TAU;
        }
        let inverse = 2.0 * swept / (near * far);
        let logarithm = libm::log((a + b * libm::cos(end)) / (a + b * libm::cos(start)));
        constant * inverse + cosine * (turn - a * inverse) / b - sine * logarithm / b
    }
}

fn signed_area(places: &[DVec2]) -> f64 {
    (0..places.len()).map(|i| places[i].perp_dot(places[(i + 1) % places.len()])).sum()
}

/// On [-1, 1].
fn rule() -> &'static [(f64, f64)] {
    use std::sync::OnceLock;
    static RULE: OnceLock<Vec<(f64, f64)>> = OnceLock::new();
    RULE.get_or_init(|| gauss_legendre(10))
}
