//! The outline of a flat patch on the sample's plane, as a beam meets it: how far it is, and which
//! parts of a line lie inside. It does not know what the patch emits.

use glam::DVec2;

use crate::scene::Shape;

/// A closed curve in z = 0, metres, and the patch within.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Boundary {
    Circle {
        centre: DVec2,
        radius: f64,
    },
    /// Simple; either way round.
    Polygon(Vec<DVec2>),
}

impl Boundary {
    pub(crate) fn of(shape: &Shape) -> Self {
        match shape {
            Shape::Disk { x_m, y_m, radius_m } => {
                Self::Circle { centre: DVec2::new(*x_m, *y_m), radius: *radius_m }
            }
            Shape::Polygon(outline) => {
                Self::Polygon(outline.corners_m().iter().map(|c| DVec2::from(*c)).collect())
            }
            Shape::Rectangle { x_m, y_m } => Self::of_rectangle(*x_m, *y_m),
        }
    }

    pub(crate) fn of_rectangle(x: (f64, f64), y: (f64, f64)) -> Self {
        let corner = DVec2::new;
        Self::Polygon(vec![corner(x.0, y.0), corner(x.1, y.0), corner(x.1, y.1), corner(x.0, y.1)])
    }

    /// Whether a point lies within.
    pub(crate) fn holds(&self, point: DVec2) -> bool {
        match self {
            Self::Circle { centre, radius } => point.distance_squared(*centre) <= radius * radius,
            Self::Polygon(corners) => {
                let crossings = edges(corners).filter(|(a, b)| {
                    (a.y > point.y) != (b.y > point.y)
                        && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
                });
                crossings.count() % 2 == 1
            }
        }
    }

    /// A point within: the middle of the longest part of a line across its middle.
    pub(crate) fn place_within(&self) -> DVec2 {
        if let Self::Circle { centre, .. } = self {
            return *centre;
        }
        let (low, high) = self.bounds();
        // Not along an edge.
        let middle = low + (high - low) * 0.497;
        let mut ends = Vec::new();
        self.chords(middle, DVec2::X, &mut ends);
        let parts =
            ends.chunks_exact(2).map(|part| (part[1] - part[0], f64::midpoint(part[0], part[1])));
        let longest = parts.reduce(|a, b| if b.0 > a.0 { b } else { a });
        middle + DVec2::X * longest.map_or(0.0, |(_, at)| at)
    }

    /// The upright rectangle round it: its lowest and highest corner.
    pub(crate) fn bounds(&self) -> (DVec2, DVec2) {
        match self {
            Self::Circle { centre, radius } => (*centre - *radius, *centre + *radius),
            Self::Polygon(corners) => {
                let none = (DVec2::INFINITY, DVec2::NEG_INFINITY);
                corners.iter().fold(none, |(low, high), p| (low.min(*p), high.max(*p)))
            }
        }
    }

    /// How far the curve is from a point.
    pub(crate) fn distance(&self, point: DVec2) -> f64 {
        point.distance(self.nearest(point))
    }

    /// The point of the curve that is nearest to a point.
    pub(crate) fn nearest(&self, point: DVec2) -> DVec2 {
        match self {
            Self::Circle { centre, radius } => {
                *centre + (point - *centre).try_normalize().unwrap_or(DVec2::X) * *radius
            }
            Self::Polygon(corners) => {
                let on = edges(corners).map(|(a, b)| {
                    let along = b - a;
                    let t = (point - a).dot(along) / along.length_squared();
                    a + along * t.clamp(0.0, 1.0)
                });
                let nearer = |a: DVec2, b: DVec2| {
                    if b.distance_squared(point) < a.distance_squared(point) { b } else { a }
                };
                on.reduce(nearer).unwrap_or(point)
            }
        }
    }

    /// Points of it that tell where it is: a polygon's corners and middles of edges, four points
    /// of a circle.
    pub(crate) fn points(&self) -> Vec<DVec2> {
        match self {
            Self::Circle { centre, radius } => {
                let ways = [DVec2::X, DVec2::Y, DVec2::NEG_X, DVec2::NEG_Y];
                ways.map(|way| *centre + way * *radius).to_vec()
            }
            Self::Polygon(corners) => {
                edges(corners).flat_map(|(a, b)| [a, a.midpoint(b)]).collect()
            }
        }
    }

    /// Where the line origin + t along is within: the ends of its parts, rising in t, two a part.
    pub(crate) fn chords(&self, origin: DVec2, along: DVec2, ends: &mut Vec<f64>) {
        ends.clear();
        match self {
            Self::Circle { centre, radius } => {
                let (from, a) = (origin - *centre, along.length_squared());
                let b = from.dot(along) / a;
                let square = b * b - (from.length_squared() - radius * radius) / a;
                if square > 0.0 {
                    let half = libm::sqrt(square);
                    ends.extend([-b - half, -b + half]);
                }
            }
            Self::Polygon(corners) => {
                for (a, b) in edges(corners) {
                    let (side_a, side_b) = (along.perp_dot(a - origin), along.perp_dot(b - origin));
                    if (side_a > 0.0) != (side_b > 0.0) {
                        let crossing = a + (b - a) * (side_a / (side_a - side_b));
                        ends.push((crossing - origin).dot(along) / along.length_squared());
                    }
                }
                ends.sort_unstable_by(f64::total_cmp);
            }
        }
    }

    /// The least distance between the curve and an upright rectangle (its inside included).
    pub(crate) fn distance_to_rectangle(&self, x: (f64, f64), y: (f64, f64)) -> f64 {
        let clamped = |p: DVec2| DVec2::new(p.x.clamp(x.0, x.1), p.y.clamp(y.0, y.1));
        let corners = [(x.0, y.0), (x.1, y.0), (x.1, y.1), (x.0, y.1)].map(DVec2::from);
        match self {
            Self::Circle { centre, radius } => {
                let nearest = centre.distance(clamped(*centre));
                let farthest = corners.map(|corner| centre.distance(corner));
                let farthest = farthest.into_iter().fold(0.0, f64::max);
                (nearest - radius).max(radius - farthest).max(0.0)
            }
            Self::Polygon(own) => {
                let crosses =
                    edges(own).any(|(a, b)| edges(&corners).any(|(c, d)| cross(a, b, c, d)));
                if crosses {
                    return 0.0;
                }
                let to_rectangle = own.iter().map(|p| p.distance(clamped(*p)));
                let to_corners = corners.iter().map(|p| self.distance(*p));
                to_rectangle.chain(to_corners).fold(f64::INFINITY, f64::min)
            }
        }
    }
}

/// A closed polygon's edges.
pub(crate) fn edges(corners: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> {
    corners.iter().copied().zip(corners.iter().copied().cycle().skip(1))
}

fn cross(a: DVec2, b: DVec2, c: DVec2, d: DVec2) -> bool {
    let side = |p: DVec2, q: DVec2, r: DVec2| (q - p).perp_dot(r - p);
    side(a, b, c) * side(a, b, d) <= 0.0 && side(c, d, a) * side(c, d, b) <= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: f64, expected: f64) {
        assert!(libm::fabs(found - expected) < 1e-14, "{found} beside {expected}");
    }

    fn shapes() -> [Boundary; 3] {
        let l = [(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)];
        [
            Boundary::of_rectangle((-1.0, 2.0), (0.5, 1.5)),
            Boundary::Circle { centre: DVec2::new(0.5, 0.3), radius: 1.2 },
            Boundary::Polygon(l.map(DVec2::from).to_vec()),
        ]
    }

    #[test]
    fn the_parts_of_a_line_inside_are_those_whose_points_are() {
        let mut ends = Vec::new();
        for shape in shapes() {
            for k in 0..40 {
                let along = DVec2::from_angle(0.157 * f64::from(k)) * 0.7;
                let origin = DVec2::new(0.07 * f64::from(k) - 1.003, 0.9 - 0.03 * f64::from(k));
                shape.chords(origin, along, &mut ends);
                assert_eq!(ends.len() % 2, 0);
                for i in -400..400 {
                    let t = 0.0123 * f64::from(i);
                    let inside = ends.chunks(2).any(|part| part[0] < t && t < part[1]);
                    assert_eq!(inside, shape.holds(origin + along * t), "{shape:?} {k} {t}");
                }
            }
        }
    }

    #[test]
    fn distances_are_to_the_curve() {
        let [rectangle, circle, l] = shapes();
        close(rectangle.distance(DVec2::new(0.0, 1.0)), 0.5);
        close(rectangle.distance(DVec2::new(5.0, 5.5)), 5.0);
        close(circle.distance(DVec2::new(0.5, 0.3)), 1.2);
        close(circle.distance(DVec2::new(3.5, 0.3)), 1.8);
        close(l.distance(DVec2::new(2.0, 3.0)), 2.0_f64.sqrt());
        close(rectangle.distance_to_rectangle((0.0, 1.0), (0.8, 1.2)), 0.3);
        close(rectangle.distance_to_rectangle((0.0, 5.0), (0.8, 1.2)), 0.0);
        close(rectangle.distance_to_rectangle((-9.0, 9.0), (-9.0, 9.0)), 0.0);
        close(circle.distance_to_rectangle((0.4, 0.6), (0.2, 0.4)), 1.2 - 0.1 * 2.0_f64.sqrt());
        close(circle.distance_to_rectangle((2.0, 3.0), (0.0, 1.0)), 0.3);
        close(l.distance_to_rectangle((1.5, 2.5), (1.5, 1.8)), 0.5);
        close(l.distance_to_rectangle((0.2, 0.8), (-1.0, 5.0)), 0.0);
    }
}
