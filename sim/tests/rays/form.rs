//! Where a ray meets a body, and random places on it: by the plainest means, since the reference
//! must not share a mistake with what it checks.

use core::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};
use sim::{Shape, Solid};

use crate::dice::Dice;

#[derive(Debug, Clone)]
pub(crate) enum Form {
    Disk {
        centre: DVec3,
        normal: DVec3,
        radius: f64,
    },
    Polygon {
        corners: Vec<DVec3>,
        normal: DVec3,
    },
    Ball {
        centre: DVec3,
        radius: f64,
    },
    /// All of a level plane up to an edge along y.
    HalfPlane {
        x_max: f64,
        z: f64,
    },
}

impl Form {
    pub(crate) fn of(solid: &Solid) -> Self {
        match solid {
            Solid::Disk(disk) => Self::Disk {
                centre: disk.center_m(),
                normal: disk.axis().normalize(),
                radius: disk.radius_m(),
            },
            Solid::Polygon(polygon) => Self::polygon(polygon.vertices().to_vec()),
            Solid::Sphere(ball) => Self::Ball { centre: ball.center_m(), radius: ball.radius_m() },
            Solid::HalfPlane(edge) => Self::HalfPlane { x_max: edge.x_max_m(), z: edge.z_m() },
        }
    }

    pub(crate) fn of_shape(shape: &Shape) -> Self {
        let flat = |corners: &[(f64, f64)]| {
            Self::polygon(corners.iter().map(|(x, y)| DVec3::new(*x, *y, 0.0)).collect())
        };
        match shape {
            Shape::Disk { x_m, y_m, radius_m } => Self::Disk {
                centre: DVec3::new(*x_m, *y_m, 0.0),
                normal: DVec3::Z,
                radius: *radius_m,
            },
            Shape::Polygon(outline) => flat(outline.corners_m()),
            Shape::Rectangle { x_m: x, y_m: y } => {
                flat(&[(x.0, y.0), (x.1, y.0), (x.1, y.1), (x.0, y.1)])
            }
        }
    }

    fn polygon(corners: Vec<DVec3>) -> Self {
        let normal = area_vector(&corners).normalize();
        Self::Polygon { corners, normal }
    }

    pub(crate) fn normal(&self, at: DVec3) -> DVec3 {
        match self {
            Self::Disk { normal, .. } | Self::Polygon { normal, .. } => *normal,
            Self::Ball { centre, .. } => (at - centre).normalize(),
            Self::HalfPlane { .. } => DVec3::Z,
        }
    }

    fn area(&self) -> f64 {
        match self {
            Self::Disk { radius, .. } => PI * radius * radius,
            Self::Polygon { corners, .. } => area_vector(corners).length(),
            Self::Ball { .. } | Self::HalfPlane { .. } => f64::INFINITY,
        }
    }

    /// How far along a ray the first meeting is that lies beyond a small distance.
    pub(crate) fn hit(&self, from: DVec3, direction: DVec3) -> Option<f64> {
        const NEAR: f64 = 1e-10;
        let plane = |point: DVec3, normal: DVec3| {
            let t = normal.dot(point - from) / normal.dot(direction);
            (t.is_finite() && t > NEAR).then(|| (t, from + direction * t))
        };
        match self {
            Self::Disk { centre, normal, radius } => {
                let (t, at) = plane(*centre, *normal)?;
                (at.distance(*centre) <= *radius).then_some(t)
            }
            Self::Polygon { corners, normal } => {
                let (t, at) = plane(corners[0], *normal)?;
                holds(corners, *normal, at).then_some(t)
            }
            Self::Ball { centre, radius } => {
                let (away, half) = (from - centre, (from - centre).dot(direction));
                let square = half * half - (away.length_squared() - radius * radius);
                let root = (square >= 0.0).then(|| square.sqrt())?;
                [-half - root, -half + root].into_iter().find(|t| *t > NEAR)
            }
            Self::HalfPlane { x_max, z } => {
                let (t, at) = plane(DVec3::new(0.0, 0.0, *z), DVec3::Z)?;
                (at.x < *x_max).then_some(t)
            }
        }
    }

    /// A ball that holds it.
    pub(crate) fn ball(&self) -> (DVec3, f64) {
        match self {
            Self::Disk { centre, radius, .. } | Self::Ball { centre, radius } => (*centre, *radius),
            Self::Polygon { corners, .. } => {
                let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
                (middle, corners.iter().map(|c| c.distance(middle)).fold(0.0, f64::max))
            }
            Self::HalfPlane { .. } => panic!("{self:?} has no end"),
        }
    }

    /// A place on it as seen from a point, and one over the density of its direction: of a ball
    /// evenly over the directions, of what is flat evenly over the area.
    pub(crate) fn aim(&self, from: DVec3, dice: &mut Dice) -> (DVec3, f64) {
        if let Self::Ball { centre, radius } = self {
            let away = *centre - from;
            let half_angle = (radius / away.length()).min(1.0).asin();
            let direction = dice.in_cone(away.normalize(), half_angle);
            let solid_angle = 2.0 * TAU * (half_angle / 2.0).sin().powi(2);
            // A ray along the rim may miss by a rounding: the point next to the centre's plane.
            let t = self.hit(from, direction).unwrap_or(away.dot(direction));
            return (from + direction * t, solid_angle);
        }
        let place = self.place(dice);
        let away = place - from;
        let cos = self.normal(place).dot(away.normalize()).abs();
        (place, self.area() * cos / away.length_squared())
    }

    /// A place on something flat, evenly by area.
    fn place(&self, dice: &mut Dice) -> DVec3 {
        match self {
            Self::Disk { centre, normal, radius } => {
                let (u, v) = normal.any_orthonormal_pair();
                let at = dice.in_disk() * *radius;
                *centre + u * at.x + v * at.y
            }
            Self::Polygon { corners, normal } => {
                let (u, v) = normal.any_orthonormal_pair();
                let local = |p: DVec3| DVec2::new(u.dot(p - corners[0]), v.dot(p - corners[0]));
                let low = corners.iter().map(|p| local(*p)).fold(DVec2::INFINITY, DVec2::min);
                let high = corners.iter().map(|p| local(*p)).fold(-DVec2::INFINITY, DVec2::max);
                loop {
                    let at = low + (high - low) * DVec2::new(dice.roll(), dice.roll());
                    let at = corners[0] + u * at.x + v * at.y;
                    if holds(corners, *normal, at) {
                        return at;
                    }
                }
            }
            Self::Ball { .. } | Self::HalfPlane { .. } => panic!("{self:?} has no such place"),
        }
    }
}

/// The area times the normal.
fn area_vector(corners: &[DVec3]) -> DVec3 {
    let pairs = corners.iter().zip(corners.iter().cycle().skip(1));
    pairs.map(|(a, b)| (*a - corners[0]).cross(*b - corners[0])).sum::<DVec3>() / 2.0
}

/// Whether a point of the plane is inside: by how often the outline winds around it.
fn holds(corners: &[DVec3], normal: DVec3, at: DVec3) -> bool {
    let (u, v) = normal.any_orthonormal_pair();
    let local = |p: DVec3| DVec2::new(u.dot(p - at), v.dot(p - at));
    let mut is_inside = false;
    for (a, b) in corners.iter().zip(corners.iter().cycle().skip(1)) {
        let (a, b) = (local(*a), local(*b));
        if (a.y > 0.0) != (b.y > 0.0) && a.x + (b.x - a.x) * a.y / (a.y - b.y) > 0.0 {
            is_inside = !is_inside;
        }
    }
    is_inside
}
