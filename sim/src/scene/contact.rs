//! Bodies in space: whether two of them penetrate each other, how low they reach, and where a ray
//! meets them. Touching is not penetrating: a wall may stand on a floor, a ball lie on it.

use glam::{DVec2, DVec3};
use radiometry::direction::{frame, normalised};
use radiometry::shape::{Disk, HalfPlane, Polygon, Sphere};

use super::Shape;
use super::outline::Outline;

/// Bodies closer than this part of their sizes touch: coordinates may have six digits.
const TOUCH: f64 = 1e-6;

/// What takes up space.
#[derive(Debug, Clone, PartialEq)]
pub enum Solid {
    /// Flat and round.
    Disk(Disk),
    /// All of a horizontal plane up to an edge along y.
    HalfPlane(HalfPlane),
    /// Flat.
    Polygon(Polygon),
    /// A ball.
    Sphere(Sphere),
}

impl Solid {
    /// A shape on the sample's plane as a body.
    pub(crate) fn of_shape(shape: &Shape) -> Option<Self> {
        let flat = |corners: &[(f64, f64)]| {
            let corners = corners.iter().map(|(x, y)| DVec3::new(*x, *y, 0.0)).collect();
            Polygon::new(corners).ok().map(Self::Polygon)
        };
        match shape {
            Shape::Disk { x_m, y_m, radius_m } => {
                Disk::new(DVec3::new(*x_m, *y_m, 0.0), DVec3::Z, *radius_m).ok().map(Self::Disk)
            }
            Shape::Polygon(outline) => flat(outline.corners_m()),
            Shape::Rectangle { x_m: x, y_m: y } => {
                flat(&[(x.0, y.0), (x.1, y.0), (x.1, y.1), (x.0, y.1)])
            }
        }
    }

    /// The lowest and the highest z, metres.
    pub fn heights_m(&self) -> (f64, f64) {
        match self {
            Self::Disk(disk) => {
                let axis = normalised(disk.axis()).unwrap_or(DVec3::Z);
                let rise = disk.radius_m() * libm::hypot(axis.x, axis.y);
                (disk.center_m().z - rise, disk.center_m().z + rise)
            }
            Self::HalfPlane(edge) => (edge.z_m(), edge.z_m()),
            Self::Polygon(polygon) => {
                let heights = polygon.vertices().iter().map(|v| v.z);
                heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| {
                    (low.min(z), high.max(z))
                })
            }
            Self::Sphere(ball) => {
                (ball.center_m().z - ball.radius_m(), ball.center_m().z + ball.radius_m())
            }
        }
    }

    /// A length that its details are small against, metres; 0 for a half-plane, which has none.
    pub(crate) fn extent_m(&self) -> f64 {
        match self {
            Self::Disk(disk) => disk.radius_m(),
            Self::HalfPlane(_) => 0.0,
            Self::Polygon(polygon) => {
                let first = polygon.vertices()[0];
                polygon.vertices().iter().map(|v| (*v - first).length()).fold(0.0, f64::max)
            }
            Self::Sphere(ball) => ball.radius_m(),
        }
    }

    /// Whether two bodies share more than a touch.
    pub fn penetrates(&self, other: &Self) -> bool {
        let touch = TOUCH * self.extent_m().max(other.extent_m());
        match (self, other) {
            (Self::Sphere(ball), Self::Sphere(other)) => {
                let apart = (ball.center_m() - other.center_m()).length();
                apart < ball.radius_m() + other.radius_m() - touch
            }
            (Self::Sphere(ball), body) | (body, Self::Sphere(ball)) => {
                body.distance_m(ball.center_m()) < ball.radius_m() - touch
            }
            _ => flats_penetrate(self, other, touch),
        }
    }

    /// From a point to the nearest of it.
    fn distance_m(&self, point: DVec3) -> f64 {
        let (at, normal) = self.plane();
        let above = normal.dot(point - at);
        let foot = point - normal * above;
        match self {
            Self::Disk(disk) => {
                libm::hypot(above, ((foot - at).length() - disk.radius_m()).max(0.0))
            }
            Self::HalfPlane(edge) => libm::hypot(above, (point.x - edge.x_max_m()).max(0.0)),
            Self::Polygon(polygon) => {
                if self.holds(foot, 0.0) {
                    return above.abs();
                }
                libm::hypot(above, distance_to_edges(polygon, foot))
            }
            Self::Sphere(ball) => ((point - ball.center_m()).length() - ball.radius_m()).max(0.0),
        }
    }

    /// A point and the unit normal of the plane that a flat body lies in.
    pub(crate) fn plane(&self) -> (DVec3, DVec3) {
        match self {
            Self::Disk(disk) => (disk.center_m(), normalised(disk.axis()).unwrap_or(DVec3::Z)),
            Self::HalfPlane(edge) => (DVec3::new(edge.x_max_m(), 0.0, edge.z_m()), DVec3::Z),
            Self::Polygon(polygon) => (polygon.vertices()[0], polygon_normal(polygon)),
            Self::Sphere(ball) => (ball.center_m(), DVec3::Z),
        }
    }

    /// Whether a point of its plane lies inside a flat body by more than a margin.
    fn holds(&self, point: DVec3, margin: f64) -> bool {
        match self {
            Self::Disk(disk) => (point - disk.center_m()).length() < disk.radius_m() - margin,
            Self::HalfPlane(edge) => point.x < edge.x_max_m() - margin,
            Self::Polygon(polygon) => {
                let (e, f) = frame(polygon_normal(polygon));
                let flat = |v: DVec3| DVec2::new(e.dot(v - point), f.dot(v - point));
                let corners: Vec<DVec2> = polygon.vertices().iter().map(|v| flat(*v)).collect();
                winds(&corners) && (margin <= 0.0 || distance_to_edges(polygon, point) > margin)
            }
            Self::Sphere(_) => false,
        }
    }

    /// The places, along a line in the plane of a flat body, where the line may enter or leave it.
    fn ends_along(&self, from: DVec3, along: DVec3, ends: &mut Vec<f64>) {
        match self {
            Self::Disk(disk) => {
                let middle = along.dot(disk.center_m() - from);
                let beside = (disk.center_m() - from - along * middle).length();
                let square = disk.radius_m() * disk.radius_m() - beside * beside;
                if square > 0.0 {
                    ends.extend([middle - libm::sqrt(square), middle + libm::sqrt(square)]);
                }
            }
            Self::HalfPlane(edge) => {
                if along.x != 0.0 {
                    ends.push((edge.x_max_m() - from.x) / along.x);
                }
            }
            Self::Polygon(polygon) => {
                let across = polygon_normal(polygon).cross(along);
                let vertices = polygon.vertices();
                for (i, a) in vertices.iter().enumerate() {
                    let b = vertices[(i + 1) % vertices.len()];
                    let (side_a, side_b) = (across.dot(*a - from), across.dot(b - from));
                    ends.push(along.dot(*a - from));
                    if (side_a > 0.0) != (side_b > 0.0) {
                        let part = side_a / (side_a - side_b);
                        ends.push(along.dot(*a + (b - *a) * part - from));
                    }
                }
            }
            Self::Sphere(_) => {}
        }
    }

    /// How far along a ray (unit direction) it is last met between two distances, metres. On an edge
    /// it is met.
    pub(crate) fn last_hit(
        &self,
        origin: DVec3,
        direction: DVec3,
        (from_m, to_m): (f64, f64),
    ) -> Option<f64> {
        let is_between = |at: &f64| *at > from_m && *at < to_m;
        if let Self::Sphere(ball) = self {
            let to_center = ball.center_m() - origin;
            let middle = direction.dot(to_center);
            let beside = (to_center - direction * middle).length_squared();
            let square = ball.radius_m() * ball.radius_m() - beside;
            let half = libm::sqrt((square >= 0.0).then_some(square)?);
            return [middle + half, middle - half].into_iter().find(is_between);
        }
        let (at, normal) = self.plane();
        let rise = normal.dot(direction);
        if rise == 0.0 {
            return None;
        }
        let distance = normal.dot(at - origin) / rise;
        let is_met = is_between(&distance) && self.holds(origin + direction * distance, 0.0);
        is_met.then_some(distance)
    }

    /// A ball that holds it: its centre and radius; none for a half-plane.
    pub(crate) fn bounding_ball(&self) -> Option<(DVec3, f64)> {
        match self {
            Self::Disk(disk) => Some((disk.center_m(), disk.radius_m())),
            Self::HalfPlane(_) => None,
            Self::Polygon(polygon) => {
                let count = polygon.vertices().len() as f64;
                let middle = polygon.vertices().iter().sum::<DVec3>() / count;
                let radius = polygon.vertices().iter().map(|v| (*v - middle).length());
                Some((middle, radius.fold(0.0, f64::max)))
            }
            Self::Sphere(ball) => Some((ball.center_m(), ball.radius_m())),
        }
    }

    /// Its middle, and places within it near its outline.
    pub(crate) fn points(&self) -> Vec<DVec3> {
        const INSIDE: f64 = 0.99;
        let round = |centre: DVec3, e: DVec3, f: DVec3| {
            let at = move |i: u32| {
                let (sin, cos) = libm::sincos(core::f64::consts::TAU * f64::from(i) / 12.0);
                centre + (e * cos + f * sin) * INSIDE
            };
            core::iter::once(centre).chain((0..12).map(at)).collect::<Vec<_>>()
        };
        match self {
            Self::Disk(disk) => {
                let (e, f) = frame(normalised(disk.axis()).unwrap_or(DVec3::Z));
                round(disk.center_m(), e * disk.radius_m(), f * disk.radius_m())
            }
            Self::HalfPlane(edge) => {
                vec![DVec3::new(edge.x_max_m() - 1e-6, 0.0, edge.z_m())]
            }
            Self::Polygon(polygon) => {
                let Some((middle, _)) = self.bounding_ball() else { return Vec::new() };
                let near = polygon.vertices().iter().map(|v| middle + (*v - middle) * INSIDE);
                core::iter::once(middle).chain(near).collect()
            }
            Self::Sphere(ball) => {
                let radius = ball.radius_m();
                round(ball.center_m(), DVec3::X * radius, DVec3::Y * radius)
            }
        }
    }
}

/// The unit normal from which a polygon's corners run counter-clockwise; +z for one without area.
pub(crate) fn polygon_normal(polygon: &Polygon) -> DVec3 {
    let vertices = polygon.vertices();
    let origin = vertices[0];
    let fans = vertices.windows(2).map(|pair| (pair[0] - origin).cross(pair[1] - origin));
    normalised(fans.sum()).unwrap_or(DVec3::Z)
}

/// Square metres.
pub(crate) fn polygon_area_m2(polygon: &Polygon) -> f64 {
    let vertices = polygon.vertices();
    let origin = vertices[0];
    let fans = vertices.windows(2).map(|pair| (pair[0] - origin).cross(pair[1] - origin));
    fans.sum::<DVec3>().length() / 2.0
}

/// Whether a closed path in a plane goes around the origin.
fn winds(corners: &[DVec2]) -> bool {
    let mut is_inside = false;
    for (i, a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        if (a.y > 0.0) != (b.y > 0.0) && ((a.x * b.y - a.y * b.x) > 0.0) == (b.y > a.y) {
            is_inside = !is_inside;
        }
    }
    is_inside
}

fn distance_to_edges(polygon: &Polygon, point: DVec3) -> f64 {
    let vertices = polygon.vertices();
    let to_edge = |(i, a): (usize, &DVec3)| {
        let edge = vertices[(i + 1) % vertices.len()] - *a;
        let square = edge.length_squared();
        let apart = point - *a;
        let part = if square > 0.0 { (apart.dot(edge) / square).clamp(0.0, 1.0) } else { 0.0 };
        (apart - edge * part).length()
    };
    vertices.iter().enumerate().map(to_edge).fold(f64::INFINITY, f64::min)
}

/// Two flat bodies: in one plane they must not overlap; else no place on the line that their planes
/// share may lie inside both.
fn flats_penetrate(a: &Solid, b: &Solid, touch: f64) -> bool {
    let ((at, normal), (other_at, other_normal)) = (a.plane(), b.plane());
    let line = normal.cross(other_normal);
    if line.length() < TOUCH {
        let is_level = normal.dot(other_at - at).abs() <= touch;
        return is_level && overlap_in_plane(a, b, at, normal, touch);
    }
    let along = line.normalize();
    // The point of the line nearest to the middle of both.
    let middle = at.midpoint(other_at);
    let (da, db) = (normal.dot(at - middle), other_normal.dot(other_at - middle));
    let cos = normal.dot(other_normal);
    let scale = 1.0 / (1.0 - cos * cos);
    let from =
        middle + normal * ((da - db * cos) * scale) + other_normal * ((db - da * cos) * scale);
    let mut ends = Vec::new();
    a.ends_along(from, along, &mut ends);
    b.ends_along(from, along, &mut ends);
    ends.sort_by(f64::total_cmp);
    // Beyond the ends of the bounded ones lies nothing but half-planes, which are level.
    ends.windows(2).any(|pair| {
        let place = from + along * f64::midpoint(pair[0], pair[1]);
        a.holds(place, touch) && b.holds(place, touch)
    })
}

fn overlap_in_plane(a: &Solid, b: &Solid, at: DVec3, normal: DVec3, touch: f64) -> bool {
    let lowest_x = |body: &Solid| match body {
        Solid::Disk(disk) => disk.center_m().x - disk.radius_m(),
        Solid::Polygon(polygon) => {
            polygon.vertices().iter().map(|v| v.x).fold(f64::INFINITY, f64::min)
        }
        Solid::HalfPlane(_) | Solid::Sphere(_) => f64::NEG_INFINITY,
    };
    if let (Solid::HalfPlane(edge), body) | (body, Solid::HalfPlane(edge)) = (a, b) {
        return lowest_x(body) < edge.x_max_m() - touch;
    }
    let (e, f) = frame(normal);
    let flat = |v: DVec3| (e.dot(v - at), f.dot(v - at));
    let shape = |body: &Solid| match body {
        Solid::Disk(disk) => {
            let (x, y) = flat(disk.center_m());
            Some(Shape::disk(x, y, disk.radius_m()))
        }
        Solid::Polygon(polygon) => {
            let corners = polygon.vertices().iter().map(|v| flat(*v)).collect();
            Outline::new(corners).ok().map(Shape::Polygon)
        }
        Solid::HalfPlane(_) | Solid::Sphere(_) => None,
    };
    matches!((shape(a), shape(b)), (Some(a), Some(b)) if a.overlaps(&b))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(corners: &[[f64; 3]]) -> Solid {
        let corners = corners.iter().map(|c| DVec3::from_array(*c)).collect();
        Solid::Polygon(Polygon::new(corners).unwrap())
    }

    fn floor() -> Solid {
        polygon(&[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    }

    fn wall(x: f64, low: f64) -> Solid {
        polygon(&[[x, -1.0, low], [x, 1.0, low], [x, 1.0, 1.0], [x, -1.0, 1.0]])
    }

    fn disk(center: [f64; 3], axis: DVec3, radius: f64) -> Solid {
        Solid::Disk(Disk::new(DVec3::from_array(center), axis, radius).unwrap())
    }

    #[test]
    fn bodies_may_touch_in_every_way_and_not_penetrate() {
        let ball = |z: f64| Solid::Sphere(Sphere::new(DVec3::new(0.2, 0.1, z), 0.5).unwrap());
        let knife = |x: f64, z: f64| Solid::HalfPlane(HalfPlane::new(x, z).unwrap());
        let cases = [
            (floor(), wall(1.0, 0.0), false),
            (floor(), wall(0.3, 0.0), false),
            (floor(), wall(0.3, -0.1), true),
            (floor(), ball(0.5), false),
            (floor(), ball(0.4), true),
            (ball(0.5), ball(1.2), true),
            (ball(0.5), ball(1.6), false),
            (floor(), disk([0.0, 0.0, 0.3], DVec3::X, 0.3), false),
            (floor(), disk([0.0, 0.0, 0.3], DVec3::X, 0.31), true),
            (floor(), disk([1.2, 0.0, 0.0], DVec3::Z, 0.3), true),
            (floor(), disk([1.3, 0.0, 0.0], DVec3::Z, 0.3), false),
            (disk([0.0, 0.0, 1.0], DVec3::Z, 1.0), disk([0.0, 0.0, 1.0], DVec3::X, 0.5), true),
            (disk([0.0, 0.0, 1.0], DVec3::Z, 1.0), disk([0.0, 0.0, 2.0], DVec3::X, 0.5), false),
            (knife(0.0, 0.5), wall(-0.3, 0.0), true),
            (knife(0.0, 0.5), wall(0.3, 0.0), false),
            (knife(0.0, 0.0), floor(), true),
            (knife(-1.0, 0.0), floor(), false),
            (knife(0.0, 0.5), ball(0.6), true),
        ];
        for (i, (a, b, expected)) in cases.iter().enumerate() {
            assert_eq!(a.penetrates(b), *expected, "{i}: {a:?} {b:?}");
            assert_eq!(b.penetrates(a), *expected, "{i}: {b:?} {a:?}");
        }
    }

    #[test]
    fn rays_meet_what_stands_nearest_to_their_end() {
        let (origin, up) = (DVec3::new(0.1, 0.2, -1.0), DVec3::Z);
        assert!((floor().last_hit(origin, up, (0.0, 9.0)).unwrap() - 1.0).abs() < 1e-15);
        assert_eq!(floor().last_hit(origin, up, (1.5, 9.0)), None);
        assert_eq!(floor().last_hit(DVec3::new(1.1, 0.0, -1.0), up, (0.0, 9.0)), None);
        let ball = Solid::Sphere(Sphere::new(DVec3::new(0.1, 0.2, 1.0), 0.5).unwrap());
        assert!((ball.last_hit(origin, up, (0.0, 9.0)).unwrap() - 2.5).abs() < 1e-15);
        assert!((ball.last_hit(origin, up, (0.0, 2.0)).unwrap() - 1.5).abs() < 1e-15);
        assert_eq!(ball.heights_m(), (0.5, 1.5));
    }
}
