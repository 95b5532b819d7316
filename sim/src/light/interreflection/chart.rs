//! Surfaces as images of rectangles: places by two parameters, and back. It knows no light.

use core::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};
use radiometry::direction::{frame, normalised};

use crate::scene::{Body, Outline, Solid};

/// A part of a surface, or all of it, over a rectangle of parameters from (0, 0) to (1, 1). A function
/// that is smooth on the surface is smooth in the parameters.
#[derive(Debug, Clone)]
pub(super) enum Chart {
    /// Origin and two sides.
    Parallelogram { origin: DVec3, sides: [DVec3; 2], normal: DVec3 },
    /// Gathered at its first corner (Duffy's map).
    Triangle { corners: [DVec3; 3], normal: DVec3 },
    /// Radius and angle.
    Disk { centre: DVec3, axes: [DVec3; 2], normal: DVec3, radius_m: f64 },
    /// Polar angle and azimuth.
    Ball { centre: DVec3, radius_m: f64 },
}

/// A place of a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    pub(super) place: DVec3,
    pub(super) normal: DVec3,
    /// Area for a unit of both parameters, square metres.
    pub(super) density_m2: f64,
}

impl Chart {
    /// All charts of a surface.
    pub(super) fn all_of(body: &Body) -> Vec<Self> {
        match body.solid() {
            Some(Solid::Polygon(polygon)) => {
                of_polygon(polygon.vertices(), body.normal(DVec3::ZERO))
            }
            Some(Solid::Disk(disk)) => {
                let normal = body.normal(disk.center_m());
                let (e, f) = frame(normal);
                let (centre, radius_m) = (disk.center_m(), disk.radius_m());
                vec![Self::Disk { centre, axes: [e, f], normal, radius_m }]
            }
            Some(Solid::Sphere(ball)) => {
                vec![Self::Ball { centre: ball.center_m(), radius_m: ball.radius_m() }]
            }
            Some(Solid::HalfPlane(_)) | None => Vec::new(),
        }
    }

    /// Into how many parts along each parameter it is cut to begin with.
    pub(super) const fn parts(&self) -> [u32; 2] {
        match self {
            Self::Parallelogram { .. } | Self::Triangle { .. } => [1, 1],
            Self::Disk { .. } => [1, 4],
            Self::Ball { .. } => [2, 4],
        }
    }

    /// A point and the normal of the plane that it lies in; none for a ball.
    pub(super) const fn plane(&self) -> Option<(DVec3, DVec3)> {
        match self {
            Self::Parallelogram { origin, normal, .. } => Some((*origin, *normal)),
            Self::Triangle { corners, normal } => Some((corners[0], *normal)),
            Self::Disk { centre, normal, .. } => Some((*centre, *normal)),
            Self::Ball { .. } => None,
        }
    }

    /// Whether a rectangle of parameters is a convex polygon in space.
    pub(super) const fn is_straight(&self) -> bool {
        matches!(self, Self::Parallelogram { .. } | Self::Triangle { .. })
    }

    pub(super) fn point(&self, at: DVec2) -> Point {
        match self {
            Self::Parallelogram { origin, sides: [a, b], normal } => Point {
                place: *origin + *a * at.x + *b * at.y,
                normal: *normal,
                density_m2: a.cross(*b).length(),
            },
            Self::Triangle { corners: [a, b, c], normal } => Point {
                place: *a + (*b - *a) * (at.x * (1.0 - at.y)) + (*c - *a) * (at.x * at.y),
                normal: *normal,
                density_m2: at.x * (*b - *a).cross(*c - *a).length(),
            },
            Self::Disk { centre, axes: [e, f], normal, radius_m } => {
                let (sin, cos) = libm::sincos(TAU * at.y);
                Point {
                    place: *centre + (*e * cos + *f * sin) * (radius_m * at.x),
                    normal: *normal,
                    density_m2: TAU * radius_m * radius_m * at.x,
                }
            }
            Self::Ball { centre, radius_m } => {
                let (sin, cos) = libm::sincos(PI * at.x);
                let (sin_phi, cos_phi) = libm::sincos(TAU * at.y);
                let normal = DVec3::new(sin * cos_phi, sin * sin_phi, cos);
                Point {
                    place: *centre + normal * *radius_m,
                    normal,
                    density_m2: PI * TAU * radius_m * radius_m * sin,
                }
            }
        }
    }

    /// The parameters of a place on it, and by how much they had to be moved to lie on it.
    pub(super) fn locate(&self, place: DVec3) -> (DVec2, f64) {
        let raw = match self {
            Self::Parallelogram { origin, sides, .. } => in_terms_of(place - *origin, *sides),
            Self::Triangle { corners: [a, b, c], .. } => {
                let parts = in_terms_of(place - *a, [*b - *a, *c - *a]);
                let sum = parts.x + parts.y;
                DVec2::new(sum, if sum > 0.0 { parts.y / sum } else { 0.0 })
            }
            Self::Disk { centre, axes: [e, f], radius_m, .. } => {
                let from = place - *centre;
                let turn = libm::atan2(f.dot(from), e.dot(from)) / TAU;
                DVec2::new(from.length() / radius_m, if turn < 0.0 { turn + 1.0 } else { turn })
            }
            Self::Ball { centre, .. } => {
                let normal = normalised(place - *centre).unwrap_or(DVec3::Z);
                let turn = libm::atan2(normal.y, normal.x) / TAU;
                let polar = libm::acos(normal.z.clamp(-1.0, 1.0)) / PI;
                DVec2::new(polar, if turn < 0.0 { turn + 1.0 } else { turn })
            }
        };
        let clamped = raw.clamp(DVec2::ZERO, DVec2::ONE);
        (clamped, (raw - clamped).length())
    }

    /// Where a plane meets it along a line of one parameter: which, and at what value, its ends
    /// included.
    pub(super) fn crossed_by(&self, (at, normal): (DVec3, DVec3)) -> Option<(usize, f64)> {
        let Self::Parallelogram { origin, sides, .. } = self else { return None };
        let rises = sides.map(|side| normal.dot(side));
        let gap = normal.dot(at - *origin);
        (0..2).find_map(|axis| {
            let other = rises[1 - axis];
            let is_level = other.abs() <= LEVEL * sides[1 - axis].length();
            let value = gap / rises[axis];
            let value = if value.abs() < LEVEL { 0.0 } else { value };
            let value = if (value - 1.0).abs() < LEVEL { 1.0 } else { value };
            (is_level && (0.0..=1.0).contains(&value)).then_some((axis, value))
        })
    }

    /// The polygon in space over a rectangle of parameters, of a straight chart.
    pub(super) fn outline(&self, low: DVec2, high: DVec2) -> Vec<DVec3> {
        let corners = [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)];
        let mut outline: Vec<DVec3> = corners.map(|at| self.point(at).place).to_vec();
        outline.dedup();
        if outline.len() > 1 && outline.first() == outline.last() {
            outline.pop();
        }
        outline
    }
}

/// Lines closer to parallel than this are.
const LEVEL: f64 = 1e-9;

/// A vector of a plane by two that span it.
fn in_terms_of(v: DVec3, [a, b]: [DVec3; 2]) -> DVec2 {
    let (aa, ab, bb) = (a.dot(a), a.dot(b), b.dot(b));
    let (va, vb) = (v.dot(a), v.dot(b));
    let scale = 1.0 / (aa * bb - ab * ab);
    DVec2::new((va * bb - vb * ab) * scale, (vb * aa - va * ab) * scale)
}

/// A parallelogram as one, anything else in triangles.
fn of_polygon(corners: &[DVec3], normal: DVec3) -> Vec<Chart> {
    if let [a, b, c, d] = corners {
        let apart = (*a + *c - *b - *d).length();
        if apart <= LEVEL * (*c - *a).length() {
            return vec![Chart::Parallelogram { origin: *a, sides: [*b - *a, *d - *a], normal }];
        }
    }
    let (e, f) = frame(normal);
    let origin = corners[0];
    let flat = corners.iter().map(|v| (e.dot(*v - origin), f.dot(*v - origin))).collect();
    let Ok(outline) = Outline::new(flat) else { return Vec::new() };
    let lift = |(x, y): (f64, f64)| origin + e * x + f * y;
    let triangles = outline.triangles();
    triangles
        .into_iter()
        .map(|corners| Chart::Triangle { corners: corners.map(lift), normal })
        .collect()
}

#[cfg(test)]
mod tests {
    use radiometry::shape::{Disk, Polygon, Sphere};

    use super::*;
    use crate::scene::Shape;

    #[test]
    fn charts_cover_their_surfaces_and_lead_back() {
        let l = [(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)];
        let wall = l.map(|(x, y)| DVec3::new(0.5, x, y));
        let bodies = [
            Body::Flat(Shape::Rectangle { x_m: (-1.0, 2.0), y_m: (0.0, 0.5) }),
            Body::Raised(Solid::Polygon(Polygon::new(wall.to_vec()).unwrap())),
            Body::Raised(Solid::Disk(Disk::new(DVec3::Z, DVec3::new(1.0, 0.2, 0.3), 0.7).unwrap())),
            Body::Raised(Solid::Sphere(Sphere::new(DVec3::Z, 0.4).unwrap())),
        ];
        let rule = radiometry::quadrature::gauss_legendre(12);
        for body in bodies {
            let charts = Chart::all_of(&body);
            let mut area = 0.0;
            for chart in &charts {
                for (u, a) in &rule {
                    for (v, b) in &rule {
                        let at = DVec2::new(f64::midpoint(1.0, *u), f64::midpoint(1.0, *v));
                        let point = chart.point(at);
                        area += a * b / 4.0 * point.density_m2;
                        let (back, moved) = chart.locate(point.place);
                        assert!((back - at).length() < 1e-12 && moved < 1e-12, "{back} {at}");
                        let apart = (point.normal - body.normal(point.place)).length();
                        assert!(apart < 1e-12, "{body:?}");
                        let others = charts.iter().filter(|c| c.locate(point.place).1 < 1e-9);
                        assert_eq!(others.count(), 1, "{body:?}");
                    }
                }
            }
            assert!((area / body.area_m2() - 1.0).abs() < 1e-9, "{area} {}", body.area_m2());
        }
    }
}
