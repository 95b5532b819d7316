//! What cones and planes around whole bodies make certain, without a look at any outline: that a body
//! can't be in the way, or that nothing gets past it. It does not know what is seen in between.

use glam::DVec3;

use super::body::{Occluder, Source};
use super::hull::{Hull, are_apart};
use crate::direction::angle_between;
use crate::wide::length;

/// Of angles and lengths: more than rounding, less than matters.
const MARGIN: f64 = 1e-9;
/// Of coordinates up to 2.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// The cone and the hull around a source. Lengths are at most 2.
pub(super) struct Around {
    point: DVec3,
    middle: DVec3,
    /// The sine of the cone's half angle; 1 where that is no cone.
    extent: f64,
    source: Hull,
}

impl Around {
    /// `middle` relative to the receiver's point.
    pub(super) fn new(point: DVec3, source: &Source, middle: DVec3, extent: f64) -> Self {
        Self { point, middle, extent, source: Hull::of_source(source) }
    }

    /// Whether the body certainly neither hides anything nor reaches into the source: the cones are
    /// apart, or a plane is found between the body and all lines from the receiver to the source.
    pub(super) fn is_clear_of(&self, occluder: &Occluder) -> bool {
        /// What is not found soon is better looked at.
        const STEPS: u32 = 6;
        self.is_beside(occluder)
            || Hull::of_occluder(occluder, &[self.point], &self.source)
                .is_none_or(|body| are_apart(&[self.point], &self.source, &body, STEPS))
    }

    /// The cones alone.
    fn is_beside(&self, occluder: &Occluder) -> bool {
        let Self { point, middle, extent, .. } = *self;
        // Half of the circle, at least, is no cone.
        if extent >= 1.0 {
            return false;
        }
        let (center, radius) = match occluder {
            Occluder::Disk(disk) => (disk.center_m(), disk.radius_m()),
            Occluder::Sphere(ball) => (ball.center_m(), ball.radius_m()),
            Occluder::Polygon(polygon) => {
                let corners = polygon.vertices();
                let center = corners.iter().sum::<DVec3>() / corners.len() as f64;
                (center, corners.iter().map(|c| length(*c - center)).fold(0.0, f64::max))
            }
            Occluder::HalfPlane(edge) => {
                let (x, z) = (edge.x_max_m() - point.x, edge.z_m() - point.z);
                let size = libm::hypot(x, z);
                // Inwards from the edge.
                let across = (x * middle.z - z * middle.x) * libm::copysign(1.0, z);
                let reach = extent * (1.0 + MARGIN) * size + ROUNDING * (size + 2.0);
                return across < -reach * length(middle);
            }
        };
        let toward = center - point;
        let distance = length(toward);
        let sine = radius / distance;
        if sine >= 1.0 {
            return false;
        }
        let reach = libm::asin(sine) + libm::asin(extent);
        angle_between(middle, toward)
            > reach.mul_add(1.0 + MARGIN, ROUNDING * (1.0 + 2.0 / distance))
    }

    /// Whether the body certainly hides all of the source and is nowhere near it. A body with a
    /// boundary that is not convex is never certain.
    pub(super) fn is_behind(&self, occluder: &Occluder) -> bool {
        match occluder {
            Occluder::Sphere(ball) => {
                let center = ball.center_m() - self.point;
                let distance = length(center);
                let sine = ball.radius_m() / distance;
                let slack = ROUNDING * (1.0 + 2.0 / distance);
                let ahead = center / distance;
                sine < 1.0
                    && self.cones().iter().all(|(toward, extent)| {
                        let reach = angle_between(*toward, center) + libm::asin(*extent);
                        let nearest = ahead.dot(*toward) - extent * length(*toward);
                        reach < libm::asin(sine).mul_add(1.0 - MARGIN, -slack)
                            && nearest > (distance + ball.radius_m()) * (1.0 + MARGIN) + ROUNDING
                    })
            }
            Occluder::Disk(disk) => {
                let center = disk.center_m() - self.point;
                let normal = disk.axis() / length(disk.axis());
                let height = normal.dot(center);
                let (normal, height) = (normal * height.signum(), height.abs());
                let slack = ROUNDING * (1.0 + 2.0 / height);
                self.cones().iter().all(|(toward, sine)| {
                    let (away, along) = (length(*toward), normal.dot(*toward));
                    let (hit, cosine) = (*toward * (height / along), along / away);
                    // How far off its axis the cone meets the plane, at most.
                    let sum = cosine * (1.0 - sine * sine).sqrt()
                        - (1.0 - cosine * cosine).max(0.0).sqrt() * sine;
                    let spread = length(hit) * sine / sum;
                    along - sine * away > height * (1.0 + MARGIN) + ROUNDING
                        && sum > MARGIN
                        && length(hit - center) + spread < disk.radius_m() * (1.0 - MARGIN) - slack
                })
            }
            Occluder::HalfPlane(edge) => {
                let (x, z) = (edge.x_max_m() - self.point.x, edge.z_m() - self.point.z);
                let away = DVec3::new(0.0, 0.0, z.signum());
                let inwards = DVec3::new(-z.abs(), 0.0, x * z.signum());
                self.is_beyond(away, z.abs(), z.abs()) && self.is_beyond(inwards, 0.0, z.abs())
            }
            Occluder::Polygon(polygon) => {
                let corners: Vec<DVec3> =
                    polygon.vertices().iter().map(|vertex| *vertex - self.point).collect();
                self.is_through(&corners)
            }
        }
    }

    /// Whether all lines to the source go through a convex polygon that is nearer.
    fn is_through(&self, corners: &[DVec3]) -> bool {
        let middle = corners.iter().sum::<DVec3>();
        let next = |i: usize| corners[(i + 1) % corners.len()];
        let area: DVec3 = (1..corners.len() - 1)
            .map(|i| (corners[i] - corners[0]).cross(corners[i + 1] - corners[0]))
            .sum();
        let area = area * area.dot(middle).signum();
        let highest = corners.iter().map(|corner| area.dot(*corner)).fold(0.0, f64::max);
        let height = highest / length(area);
        self.is_beyond(area, highest, height)
            && corners.iter().enumerate().all(|(i, corner)| {
                let across = corner.cross(next(i));
                let across = across * across.dot(middle).signum();
                let is_convex = corners
                    .iter()
                    .all(|other| across.dot(*other) >= -ROUNDING * length(across) * length(*other));
                is_convex && self.is_beyond(across, 0.0, height)
            })
    }

    /// Whether normal · x is certainly larger than a number all over the source, where the plane that
    /// it stands for was found from points no nearer than `height`.
    fn is_beyond(&self, normal: DVec3, least: f64, height: f64) -> bool {
        let lowest = normal.dot(self.source.lowest(normal) - self.point);
        let slack = (1e-13 + self.source.slack()) * (1.0 + 1.0 / height);
        lowest > least + slack * length(normal)
    }

    /// Cones that the source is in the convex hull of: towards, and the sine of the half angle, of balls
    /// at that distance. None that could be in anything where there is no cone.
    fn cones(&self) -> Vec<(DVec3, f64)> {
        match &self.source {
            Hull::Points(points) => points.iter().map(|x| (*x - self.point, 0.0)).collect(),
            Hull::Disk { .. } | Hull::Ball { .. } => vec![(self.middle, self.extent.min(1.0))],
        }
    }
}
