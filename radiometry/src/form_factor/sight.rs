//! What a point sees of a polygon past opaque bodies: exact clipping, point by point.
//!
//! The cone from the point through a convex occluder is cut out of the polygon plane by plane; what is
//! left is a set of convex pieces that do not overlap, each with a positive share by Lambert's formula.
//! So nothing is ever negative, nor more than without occluders, and rounding only moves the edges
//! of pieces. It does not know where the point comes from.

use core::f64::consts::PI;

use glam::DVec3;

use super::parts::{clip, split};
use super::rim::Circle;

/// Corners of the polygons that stand for curved bodies where one shades another.
const CORNERS: usize = 96;
/// Radius of the regular polygon with the area of the circle, in radii.
const AREA_ALIKE: f64 = 1.000_357_1;
/// Of the shadow that such a polygon casts, what may be wrong.
const POLYGONAL: f64 = PI * PI / (CORNERS * CORNERS) as f64;

/// A convex flat body.
#[derive(Debug, Clone)]
pub(super) struct Flat {
    pub(super) corners: Vec<DVec3>,
    /// Counter-clockwise around it, of length 1.
    pub(super) normal: DVec3,
}

/// A body with a curved outline.
#[derive(Debug, Clone, Copy)]
pub(super) enum Round {
    /// Its axis is of length 1.
    Disk { center: DVec3, axis: DVec3, radius: f64 },
    /// A ball.
    Sphere { center: DVec3, radius: f64 },
}

/// A polygon in convex parts and what stands before it.
#[derive(Debug, Default)]
pub(super) struct Sight {
    pub(super) target: Vec<Vec<DVec3>>,
    pub(super) flats: Vec<Flat>,
    pub(super) rounds: Vec<Round>,
}

/// A form factor from a point, with a bound of its own error.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    pub(super) factor: f64,
    pub(super) noise: f64,
}

impl Sight {
    /// The form factor from a point with a unit normal, in front of which the target lies.
    pub(super) fn from(&self, point: DVec3, normal: DVec3) -> Seen {
        let nothing = Seen { factor: 0.0, noise: 0.0 };
        let relative = |corners: &[DVec3]| corners.iter().map(|x| *x - point).collect::<Vec<_>>();
        let mut pieces: Vec<Vec<DVec3>> = self.target.iter().map(|part| relative(part)).collect();
        for flat in &self.flats {
            pieces = without(pieces, &relative(&flat.corners), flat.normal);
            if pieces.is_empty() {
                return nothing;
            }
        }
        let mut circles = Vec::with_capacity(self.rounds.len());
        for round in &self.rounds {
            match round.outline(point) {
                Outline::Around => return nothing,
                Outline::Nothing => {}
                Outline::Circle(circle) => circles.push(circle),
            }
        }
        let mut noise = 0.0;
        for i in 0..circles.len() {
            let shades = circles[i + 1..].iter().any(|other| circles[i].may_overlap(other));
            if shades {
                let circle = circles[i];
                let hidden: f64 = pieces.iter().map(|piece| circle.hides(piece, normal)).sum();
                noise += POLYGONAL * hidden;
                pieces = without(pieces, &circle.polygon(CORNERS, AREA_ALIKE), circle.axis);
            }
        }
        let last = |i: usize| circles[i + 1..].iter().all(|other| !circles[i].may_overlap(other));
        let exact: Vec<Circle> =
            (0..circles.len()).filter(|i| last(*i)).map(|i| circles[i]).collect();
        let mut factor = 0.0;
        for piece in &pieces {
            let (whole, rounding) = lambert(piece, normal);
            let hidden: f64 = exact.iter().map(|circle| circle.hides(piece, normal)).sum();
            factor += (whole - hidden).max(0.0);
            noise += rounding + if hidden > 0.0 { ROUNDING * (whole + hidden) } else { 0.0 };
        }
        Seen { factor: factor / (2.0 * PI), noise: noise / (2.0 * PI) }
    }
}

/// Of terms of order one.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// γ Γ of Lambert's formula: the angle that an edge subtends, along the normal of its plane through
/// the origin.
pub(super) fn edge_term(a: DVec3, b: DVec3) -> DVec3 {
    let cross = a.cross(b);
    let size = cross.length();
    if size == 0.0 { DVec3::ZERO } else { cross * (libm::atan2(size, a.dot(b)) / size) }
}

/// 2π times the form factor to a convex polygon in front, and a bound of its rounding.
fn lambert(piece: &[DVec3], normal: DVec3) -> (f64, f64) {
    let (mut sum, mut size) = (0.0, 0.0);
    for (i, a) in piece.iter().enumerate() {
        let term = normal.dot(edge_term(*a, piece[(i + 1) % piece.len()]));
        sum += term;
        size += term.abs();
    }
    (sum.abs(), ROUNDING * size)
}

/// Pieces without what lies behind a convex polygon, as the origin sees it.
fn without(pieces: Vec<Vec<DVec3>>, corners: &[DVec3], normal: DVec3) -> Vec<Vec<DVec3>> {
    let height = normal.dot(corners[0]);
    // Edge-on it hides nothing.
    if height == 0.0 {
        return pieces;
    }
    let sign = height.signum();
    let mut left = Vec::with_capacity(pieces.len() + 4);
    for piece in pieces {
        let [mut inside, before] = split(&piece, normal * sign, height.abs());
        let mut outside = vec![before];
        for (i, a) in corners.iter().enumerate() {
            if inside.len() < 3 {
                break;
            }
            let across = a.cross(corners[(i + 1) % corners.len()]) * sign;
            let [within, beside] = split(&inside, across, 0.0);
            inside = within;
            outside.push(beside);
        }
        if inside.len() < 3 {
            left.push(piece);
        } else {
            left.extend(outside.into_iter().filter(|piece| piece.len() > 2));
        }
    }
    left
}

enum Outline {
    Circle(Circle),
    /// Edge-on, or without extent.
    Nothing,
    /// The point is within.
    Around,
}

impl Round {
    fn outline(&self, point: DVec3) -> Outline {
        match *self {
            Self::Disk { center, axis, radius } => {
                let center = center - point;
                let height = axis.dot(center);
                if height == 0.0 || radius == 0.0 {
                    return Outline::Nothing;
                }
                let axis = axis * height.signum();
                Outline::Circle(Circle { center, axis, radius, distance: height.abs() })
            }
            Self::Sphere { center, radius } => {
                let center = center - point;
                let distance = center.length();
                if radius == 0.0 {
                    return Outline::Nothing;
                }
                if distance <= radius {
                    return Outline::Around;
                }
                // Where the rays that touch it do so.
                let axis = center / distance;
                let (sin, square) = (radius / distance, (distance - radius) * (distance + radius));
                let to_plane = square / distance;
                let rim = sin * square.sqrt();
                Outline::Circle(Circle {
                    center: axis * to_plane,
                    axis,
                    radius: rim,
                    distance: to_plane,
                })
            }
        }
    }

    /// Its middle, and how far it reaches from there.
    pub(super) fn ball(&self) -> (DVec3, f64) {
        match *self {
            Self::Disk { center, radius, .. } | Self::Sphere { center, radius } => (center, radius),
        }
    }
}

/// The part of a flat body between two planes, given by a point and a unit normal each.
pub(super) fn between(flat: &Flat, planes: [(DVec3, DVec3); 2]) -> Option<Flat> {
    let mut corners = flat.corners.clone();
    for (point, normal) in planes {
        corners = clip(&corners, normal, normal.dot(point));
    }
    (corners.len() > 2).then_some(Flat { corners, normal: flat.normal })
}
