//! A polygon's outline on the sample's plane, convex or not: what it holds, its area, what it shares
//! with a rectangle, and its convex parts.

use glam::DVec3;
use radiometry::DomainError;
use radiometry::shape::Polygon;

/// A point of the plane, metres.
pub(crate) type Point = (f64, f64);

/// A simple polygon on z = 0, its corners counter-clockwise.
#[derive(Debug, Clone, PartialEq)]
pub struct Outline {
    corners_m: Vec<Point>,
}

impl Outline {
    /// In either order; refused are fewer than three distinct corners and edges that cross.
    pub fn new(mut corners_m: Vec<(f64, f64)>) -> Result<Self, DomainError> {
        corners_m.dedup();
        if corners_m.len() > 1 && corners_m.first() == corners_m.last() {
            corners_m.pop();
        }
        Polygon::new(corners_m.iter().map(|(x, y)| DVec3::new(*x, *y, 0.0)).collect())?;
        if signed_area(&corners_m) < 0.0 {
            corners_m.reverse();
        }
        Ok(Self { corners_m })
    }

    /// Counter-clockwise, metres.
    pub fn corners_m(&self) -> &[(f64, f64)] {
        &self.corners_m
    }

    /// Square metres.
    pub(crate) fn area_m2(&self) -> f64 {
        signed_area(&self.corners_m)
    }

    /// Whether the point lies inside or on an edge: by how often a ray along +x crosses the edges.
    pub(crate) fn contains(&self, x: f64, y: f64) -> bool {
        let mut is_inside = false;
        for (a, b) in edges(&self.corners_m) {
            let side = turn(a, b, (x, y));
            let within = |p: f64, q: f64, at: f64| p.min(q) <= at && at <= p.max(q);
            if side == 0.0 && within(a.0, b.0, x) && within(a.1, b.1, y) {
                return true;
            }
            if (a.1 > y) != (b.1 > y) && (side > 0.0) == (b.1 > a.1) {
                is_inside = !is_inside;
            }
        }
        is_inside
    }

    /// What a rectangle leaves of it, square metres.
    pub(crate) fn area_within_m2(&self, xs: Point, ys: Point) -> f64 {
        signed_area(&clipped(&self.corners_m, xs, ys)).max(0.0)
    }

    /// A point that it shares with a rectangle: the centre of the largest convex part of both.
    pub(crate) fn point_within(&self, xs: Point, ys: Point) -> Option<Point> {
        let parts = self.triangles().into_iter().map(|part| clipped(&part, xs, ys));
        let areas = parts.map(|part| (signed_area(&part), part));
        let (area, part) = areas.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let count = part.len() as f64;
        let sum = part.iter().fold((0.0, 0.0), |sum, p| (sum.0 + p.0, sum.1 + p.1));
        (area > 0.0).then_some((sum.0 / count, sum.1 / count))
    }

    /// Triangles that make it up, counter-clockwise, by cutting off ears (Meisters 1975).
    pub(crate) fn triangles(&self) -> Vec<[Point; 3]> {
        let mut left = self.corners_m.clone();
        let mut triangles = Vec::with_capacity(left.len() - 2);
        while left.len() > 3 {
            let count = left.len();
            let corner = |i: usize| left[i % count];
            let is_ear = |i: usize| {
                let ear = [corner(i + count - 1), corner(i), corner(i + 1)];
                let others = (2..count - 1).map(|k| corner(i + k));
                turn(ear[0], ear[1], ear[2]) > 0.0
                    && others.filter(|p| !ear.contains(p)).all(|p| !holds(ear, p))
            };
            // Straight corners have no ear and none needs them; a rounding may leave no other.
            let flat = |i: usize| turn(corner(i + count - 1), corner(i), corner(i + 1)) == 0.0;
            let cut = (0..count).find(|i| is_ear(*i)).or_else(|| (0..count).find(|i| flat(*i)));
            let cut = cut.unwrap_or(0);
            triangles.push([corner(cut + count - 1), corner(cut), corner(cut + 1)]);
            left.remove(cut);
        }
        triangles.extend(<[Point; 3]>::try_from(left));
        triangles.retain(|[a, b, c]| turn(*a, *b, *c) > 0.0);
        triangles
    }
}

/// Pairs of neighbours, once round.
pub(crate) fn edges(corners: &[Point]) -> impl Iterator<Item = (Point, Point)> {
    corners.iter().copied().zip(corners.iter().copied().cycle().skip(1))
}

/// Twice the area of the triangle a, b, c; above zero if it runs counter-clockwise.
fn turn(a: Point, b: Point, c: Point) -> f64 {
    (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0)
}

fn holds([a, b, c]: [Point; 3], p: Point) -> bool {
    turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0
}

fn signed_area(corners: &[Point]) -> f64 {
    let Some(origin) = corners.first() else { return 0.0 };
    edges(corners).map(|(a, b)| turn(*origin, a, b)).sum::<f64>() / 2.0
}

/// What a rectangle leaves of a polygon, side by side (Sutherland and Hodgman 1974). Of one that is
/// not convex the parts may hang together by edges without area.
fn clipped(corners: &[Point], xs: Point, ys: Point) -> Vec<Point> {
    let depths: [&dyn Fn(Point) -> f64; 4] =
        [&|p| p.0 - xs.0, &|p| xs.1 - p.0, &|p| p.1 - ys.0, &|p| ys.1 - p.1];
    depths.iter().fold(corners.to_vec(), |corners, depth| {
        let mut left = Vec::with_capacity(corners.len() + 2);
        for (a, b) in edges(&corners) {
            let (from, to) = (depth(a), depth(b));
            if from >= 0.0 {
                left.push(a);
            }
            if (from > 0.0 && to < 0.0) || (from < 0.0 && to > 0.0) {
                let part = from / (from - to);
                left.push((a.0 + part * (b.0 - a.0), a.1 + part * (b.1 - a.1)));
            }
        }
        left
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An L of area 3 without its inner corner's square.
    fn l_shape() -> Outline {
        let corners = [(0.0, 0.0), (0.0, 2.0), (1.0, 2.0), (1.0, 1.0), (2.0, 1.0), (2.0, 0.0)];
        Outline::new(corners.to_vec()).unwrap()
    }

    #[test]
    fn an_l_has_its_area_however_it_is_cut() {
        let outline = l_shape();
        assert!((outline.area_m2() - 3.0).abs() < 1e-15);
        let sum: f64 = outline.triangles().iter().map(|[a, b, c]| turn(*a, *b, *c) / 2.0).sum();
        assert!((sum - 3.0).abs() < 1e-15);
        for cut in [-1.0, 0.0, 0.3, 1.0, 1.7, 2.0, 3.0] {
            let left = outline.area_within_m2((-9.0, cut), (-9.0, 9.0));
            let right = outline.area_within_m2((cut, 9.0), (-9.0, 9.0));
            assert!((left + right - 3.0).abs() < 1e-14, "{cut}");
        }
        assert!((outline.area_within_m2((0.5, 1.5), (0.5, 1.5)) - 0.75).abs() < 1e-15);
        assert!(outline.area_within_m2((1.0, 2.0), (1.0, 2.0)).abs() < 1e-15);
    }

    #[test]
    fn inside_and_edge_belong_to_it() {
        let outline = l_shape();
        for (x, y) in [(0.5, 0.5), (1.0, 1.5), (1.5, 1.0), (1.0, 1.0), (2.0, 0.0), (0.0, 1.0)] {
            assert!(outline.contains(x, y), "{x} {y}");
        }
        for (x, y) in [(1.5, 1.5), (-1e-9, 0.5), (2.1, 0.0), (1.0, 2.1), (3.0, 1.0)] {
            assert!(!outline.contains(x, y), "{x} {y}");
        }
        let (x, y) = outline.point_within((1.2, 9.0), (-9.0, 9.0)).unwrap();
        assert!(outline.contains(x, y) && x > 1.2);
        assert_eq!(outline.point_within((1.2, 1.8), (1.2, 1.8)), None);
    }

    #[test]
    fn crossed_edges_are_refused() {
        let crossed = vec![(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)];
        assert!(Outline::new(crossed).is_err());
        assert!(Outline::new(vec![(0.0, 0.0), (1.0, 1.0), (0.0, 0.0)]).is_err());
    }
}
