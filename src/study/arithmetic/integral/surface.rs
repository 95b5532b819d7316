//! Flat surfaces, and the cone of directions to a ball, laid onto the unit square. They do not
//! know what is integrated over them.

use std::f64::consts::PI;

use glam::DVec3;
use radiometry::direction;

use super::Chart;
use crate::study::arithmetic::Unmeasured;

/// A surface that the unit square is laid onto.
#[derive(Debug, Clone, Copy)]
pub enum Surface {
    /// A corner, both edges from it, the unit normal.
    Parallelogram([DVec3; 4]),
    /// A corner, the edge from it, the edge that follows, the unit normal.
    Triangle([DVec3; 4]),
    /// Two axes across and the unit normal.
    Disk { center_m: DVec3, frame: [DVec3; 3], radius_m: f64 },
    /// The whole of a ball's surface, whose light goes outwards.
    Ball { center_m: DVec3, radius_m: f64 },
    /// The directions from a point to a ball: axes across, its axis, and 1 - cos of its half angle.
    Cone { apex_m: DVec3, frame: [DVec3; 3], versine: f64 },
}

impl Surface {
    pub(super) fn disk(center_m: DVec3, axis: DVec3, radius_m: f64) -> Result<Self, Unmeasured> {
        Ok(Self::Disk { center_m, frame: frame(axis)?, radius_m })
    }

    pub(super) fn sphere(
        apex_m: DVec3,
        center_m: DVec3,
        radius_m: f64,
    ) -> Result<Self, Unmeasured> {
        let sine = radius_m / center_m.distance(apex_m);
        let cosine = ((1.0 - sine) * (1.0 + sine)).sqrt();
        let versine = sine * sine / (1.0 + cosine);
        Ok(Self::Cone { apex_m, frame: frame(center_m - apex_m)?, versine })
    }

    pub(super) fn ball(center_m: DVec3, radius_m: f64) -> Self {
        Self::Ball { center_m, radius_m }
    }

    /// Triangles and parallelograms alone.
    pub(super) fn polygon(vertices: &[DVec3]) -> Result<Self, Unmeasured> {
        let (corner, first) = (vertices[0], vertices[1] - vertices[0]);
        match vertices {
            [_, b, c] => {
                let normal = first.cross(c - b).normalize();
                Ok(Self::Triangle([corner, first, c - b, normal]))
            }
            [_, b, c, d] if (c - b).abs_diff_eq(d - corner, 1e-12) => {
                let second = d - corner;
                Ok(Self::Parallelogram([corner, first, second, first.cross(second).normalize()]))
            }
            other => Err(Unmeasured::because(format!(
                "no integral over a polygon of {} corners that is no parallelogram",
                other.len()
            ))),
        }
    }

    /// How much a way from one of its points has along the normal there, metres: on either side of
    /// what is flat, off a ball outwards alone.
    pub(super) fn facing(&self, at: DVec3, way: DVec3) -> f64 {
        match self {
            Self::Parallelogram([.., normal]) | Self::Triangle([.., normal]) => {
                way.dot(*normal).abs()
            }
            Self::Disk { frame, .. } | Self::Cone { frame, .. } => way.dot(frame[2]).abs(),
            Self::Ball { center_m, radius_m } => (way.dot(at - center_m) / radius_m).max(0.0),
        }
    }

    /// In m²; of a cone in sr.
    pub(super) fn area(&self) -> f64 {
        match self {
            Self::Parallelogram([_, first, second, _]) => first.cross(*second).length(),
            Self::Triangle([_, first, second, _]) => 0.5 * first.cross(*second).length(),
            Self::Disk { radius_m, .. } => PI * radius_m * radius_m,
            Self::Ball { radius_m, .. } => 4.0 * PI * radius_m * radius_m,
            Self::Cone { versine, .. } => 2.0 * PI * versine,
        }
    }

    /// The point under a point of the unit square, and the area that a unit of the square is there.
    pub(super) fn at(&self, [u, v]: [f64; 2], chart: Chart) -> (DVec3, f64) {
        let is_even = chart == Chart::Even;
        // The part of a radius for an even one, and how much the element differs from the mean.
        let (part, share) = if is_even { (u.sqrt(), 1.0) } else { (u, 2.0 * u) };
        match self {
            Self::Parallelogram([corner, first, second, _]) => {
                (*corner + u * *first + v * *second, self.area())
            }
            Self::Triangle([corner, first, second, _]) => {
                (*corner + part * (*first + v * *second), share * self.area())
            }
            Self::Disk { center_m, frame, radius_m } => {
                let (sin, cos) = libm::sincos(2.0 * PI * v);
                let across = cos * frame[0] + sin * frame[1];
                (*center_m + part * radius_m * across, share * self.area())
            }
            Self::Ball { center_m, radius_m } => {
                // Even in the height (Archimedes), whatever the chart.
                let height = 2.0 * u - 1.0;
                let (sin, cos) = libm::sincos(2.0 * PI * v);
                let across = ((1.0 - height) * (1.0 + height)).sqrt();
                let way = DVec3::new(across * cos, across * sin, height);
                (*center_m + *radius_m * way, self.area())
            }
            Self::Cone { apex_m, frame, versine } => {
                // 1 - cos of the angle to the axis, in proportion to the part's square.
                let part = part * part * versine;
                let (sin, cos) = libm::sincos(2.0 * PI * v);
                let across = (part * (2.0 - part)).sqrt() * (cos * frame[0] + sin * frame[1]);
                (*apex_m + (1.0 - part) * frame[2] + across, share * self.area())
            }
        }
    }

    /// Whether the segment from a point to another passes through it; disks alone stand in the way.
    pub(super) fn is_between(&self, from: DVec3, to: DVec3) -> bool {
        let Self::Disk { center_m, frame, radius_m } = self else { return false };
        let (before, after) = ((from - center_m).dot(frame[2]), (to - center_m).dot(frame[2]));
        if before * after > 0.0 {
            return false;
        }
        let through = from + (to - from) * (before / (before - after));
        through.distance_squared(*center_m) <= radius_m * radius_m
    }
}

fn frame(axis: DVec3) -> Result<[DVec3; 3], Unmeasured> {
    let axis =
        direction::normalised(axis).ok_or_else(|| Unmeasured::because("an axis of no length"))?;
    let (first, second) = direction::frame(axis);
    Ok([first, second, axis])
}
