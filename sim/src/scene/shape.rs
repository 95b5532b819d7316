//! Outlines on the sample's plane: what they hold, whether they overlap, and the exact area that
//! they share with a rectangle.

use super::outline::{Outline, Point, edges};

/// An outline in the sample's plane z = 0, metres.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A circle's inside.
    Disk {
        /// The centre.
        x_m: f64,
        /// The centre.
        y_m: f64,
        /// Above zero.
        radius_m: f64,
    },
    /// Any simple polygon.
    Polygon(Outline),
    /// An upright rectangle; low before high.
    Rectangle {
        /// From low to high.
        x_m: (f64, f64),
        /// From low to high.
        y_m: (f64, f64),
    },
}

impl Shape {
    /// A rectangle around a centre.
    pub fn rectangle(x_m: f64, y_m: f64, width_x_m: f64, width_y_m: f64) -> Self {
        let around = |centre: f64, width: f64| (centre - width / 2.0, centre + width / 2.0);
        Self::Rectangle { x_m: around(x_m, width_x_m), y_m: around(y_m, width_y_m) }
    }

    /// A disk around a centre.
    pub const fn disk(x_m: f64, y_m: f64, radius_m: f64) -> Self {
        Self::Disk { x_m, y_m, radius_m }
    }

    /// Whether it is finite and has an inside.
    pub(crate) fn is_sound(&self) -> bool {
        match self {
            Self::Disk { x_m, y_m, radius_m } => {
                x_m.is_finite() && y_m.is_finite() && radius_m.is_finite() && *radius_m > 0.0
            }
            Self::Polygon(outline) => {
                let area_m2 = outline.area_m2();
                area_m2.is_finite() && area_m2 > 0.0
            }
            Self::Rectangle { x_m, y_m } => [x_m, y_m]
                .iter()
                .all(|(low, high)| low.is_finite() && high.is_finite() && low < high),
        }
    }

    /// Whether the point lies inside or on the outline.
    pub fn contains(&self, x: f64, y: f64) -> bool {
        match self {
            Self::Disk { x_m, y_m, radius_m } => libm::hypot(x - x_m, y - y_m) <= *radius_m,
            Self::Polygon(outline) => outline.contains(x, y),
            Self::Rectangle { x_m, y_m } => {
                (x_m.0..=x_m.1).contains(&x) && (y_m.0..=y_m.1).contains(&y)
            }
        }
    }

    /// Square metres.
    pub fn area_m2(&self) -> f64 {
        match self {
            Self::Disk { radius_m, .. } => core::f64::consts::PI * radius_m * radius_m,
            Self::Polygon(outline) => outline.area_m2(),
            Self::Rectangle { x_m, y_m } => (x_m.1 - x_m.0) * (y_m.1 - y_m.0),
        }
    }

    /// The upright rectangle around it: x and y, each from low to high.
    pub fn bounding_box(&self) -> ((f64, f64), (f64, f64)) {
        match self {
            Self::Disk { x_m, y_m, radius_m } => {
                ((x_m - radius_m, x_m + radius_m), (y_m - radius_m, y_m + radius_m))
            }
            Self::Polygon(outline) => {
                let over = |pick: fn(&Point) -> f64| {
                    let values = outline.corners_m().iter().map(pick);
                    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                        (low.min(value), high.max(value))
                    })
                };
                (over(|p| p.0), over(|p| p.1))
            }
            Self::Rectangle { x_m, y_m } => (*x_m, *y_m),
        }
    }

    /// Whether two shapes share more than outline. Touching is not overlapping, and neither is
    /// what rounding makes of touching: a billionth of the sizes at hand.
    pub fn overlaps(&self, other: &Self) -> bool {
        match (self, other) {
            (
                Self::Disk { x_m, y_m, radius_m },
                Self::Disk { x_m: x2, y_m: y2, radius_m: radius2 },
            ) => {
                let reach = radius_m + radius2;
                libm::hypot(x_m - x2, y_m - y2) < reach * (1.0 - TOUCH)
            }
            (Self::Disk { x_m, y_m, radius_m }, flat)
            | (flat, Self::Disk { x_m, y_m, radius_m }) => {
                let reach = radius_m * (1.0 - TOUCH);
                flat.contains(*x_m, *y_m)
                    || flat.parts().iter().any(|part| distance(part, (*x_m, *y_m)) < reach)
            }
            (a, b) => {
                let others = b.parts();
                a.parts().iter().any(|part| others.iter().any(|other| share(part, other)))
            }
        }
    }

    /// Convex polygons that make it up; none for a disk.
    fn parts(&self) -> Vec<Vec<Point>> {
        match self {
            Self::Disk { .. } => Vec::new(),
            Self::Polygon(outline) => {
                outline.triangles().iter().map(|triangle| triangle.to_vec()).collect()
            }
            Self::Rectangle { x_m: xs, y_m: ys } => {
                vec![vec![(xs.0, ys.0), (xs.1, ys.0), (xs.1, ys.1), (xs.0, ys.1)]]
            }
        }
    }

    /// The area that it shares with a rectangle, square metres. Exact for every shape.
    pub fn area_within_m2(&self, xs: (f64, f64), ys: (f64, f64)) -> f64 {
        match self {
            Self::Disk { x_m, y_m, radius_m } => {
                disk_within(*radius_m, (xs.0 - x_m, xs.1 - x_m), (ys.0 - y_m, ys.1 - y_m))
            }
            Self::Polygon(outline) => outline.area_within_m2(xs, ys),
            Self::Rectangle { x_m, y_m } => {
                let shared = |a: Point, b: Point| (a.1.min(b.1) - a.0.max(b.0)).max(0.0);
                shared(*x_m, xs) * shared(*y_m, ys)
            }
        }
    }

    /// A point that it shares with a rectangle: the middle of what two rectangles share, what is
    /// nearest to a disk's centre, the middle of a large part of a polygon.
    pub(crate) fn point_within(&self, xs: (f64, f64), ys: (f64, f64)) -> Option<(f64, f64)> {
        let point = match self {
            Self::Disk { x_m, y_m, .. } => (x_m.clamp(xs.0, xs.1), y_m.clamp(ys.0, ys.1)),
            Self::Polygon(outline) => outline.point_within(xs, ys)?,
            Self::Rectangle { x_m, y_m } => {
                let middle = |a: Point, b: Point| f64::midpoint(a.0.max(b.0), a.1.min(b.1));
                (middle(*x_m, xs), middle(*y_m, ys))
            }
        };
        (self.area_within_m2(xs, ys) > 0.0 && self.contains(point.0, point.1)).then_some(point)
    }
}

/// Shapes that share less than this part of the smaller one, across, only touch.
const TOUCH: f64 = 1e-9;

/// Whether two convex polygons share more than outline: they do unless an edge of one has the other
/// on its far side (Gottschalk, Lin and Manocha 1996, in two dimensions).
fn share(a: &[Point], b: &[Point]) -> bool {
    edges(a).chain(edges(b)).all(|(p, q)| {
        let across = (p.1 - q.1, q.0 - p.0);
        let over = |corners: &[Point]| {
            let along = corners.iter().map(|c| (c.0 - p.0) * across.0 + (c.1 - p.1) * across.1);
            along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                (low.min(value), high.max(value))
            })
        };
        let (a, b) = (over(a), over(b));
        let shorter = (a.1 - a.0).min(b.1 - b.0);
        a.1.min(b.1) - a.0.max(b.0) > TOUCH * shorter
    })
}

/// From a point to the edges of a polygon.
fn distance(corners: &[Point], to: Point) -> f64 {
    let from_edge = |(a, b): (Point, Point)| {
        let (edge, apart) = ((b.0 - a.0, b.1 - a.1), (to.0 - a.0, to.1 - a.1));
        let square = edge.0 * edge.0 + edge.1 * edge.1;
        let part = ((edge.0 * apart.0 + edge.1 * apart.1) / square).clamp(0.0, 1.0);
        libm::hypot(apart.0 - part * edge.0, apart.1 - part * edge.1)
    };
    edges(corners).map(from_edge).fold(f64::INFINITY, f64::min)
}

/// The area that a disk around the origin shares with a rectangle: the integral over x of the
/// chord, cut off by the rectangle. Between the places where the circle meets a side's line, both
/// ends of the chord are either the circle or a side throughout, and each has an antiderivative.
fn disk_within(radius: f64, xs: (f64, f64), ys: (f64, f64)) -> f64 {
    let (low, high) = (xs.0.max(-radius), xs.1.min(radius));
    if low >= high {
        return 0.0;
    }
    let mut breaks = vec![low, high];
    for y in [ys.0, ys.1] {
        let square = radius * radius - y * y;
        if square > 0.0 {
            let x = libm::sqrt(square);
            breaks.extend([-x, x].into_iter().filter(|x| *x > low && *x < high));
        }
    }
    breaks.sort_by(f64::total_cmp);
    breaks.windows(2).map(|piece| disk_piece(radius, (piece[0], piece[1]), ys)).sum()
}

fn disk_piece(radius: f64, xs: (f64, f64), ys: (f64, f64)) -> f64 {
    let middle = f64::midpoint(xs.0, xs.1);
    let half_chord = libm::sqrt((radius * radius - middle * middle).max(0.0));
    if ys.0 >= half_chord || ys.1 <= -half_chord {
        return 0.0;
    }
    let under_circle = |x: f64| {
        let x = x.clamp(-radius, radius);
        let y = libm::sqrt((radius * radius - x * x).max(0.0));
        f64::midpoint(x * y, radius * radius * libm::asin(x / radius))
    };
    let circle = under_circle(xs.1) - under_circle(xs.0);
    let side = |y: f64| y * (xs.1 - xs.0);
    let top = if ys.1 < half_chord { side(ys.1) } else { circle };
    let bottom = if ys.0 > -half_chord { side(ys.0) } else { -circle };
    (top - bottom).max(0.0)
}

#[cfg(test)]
mod tests {
    use core::f64::consts::PI;

    use super::*;

    fn near(found: f64, expected: f64) {
        assert!(libm::fabs(found - expected) < 1e-14, "{found} beside {expected}");
    }

    #[test]
    fn a_disk_shares_known_areas_with_rectangles() {
        let disk = Shape::disk(0.0, 0.0, 1.0);
        near(disk.area_within_m2((-2.0, 2.0), (-2.0, 2.0)), PI);
        near(disk.area_within_m2((0.0, 2.0), (-2.0, 2.0)), PI / 2.0);
        near(disk.area_within_m2((0.0, 2.0), (0.0, 2.0)), PI / 4.0);
        near(disk.area_within_m2((-0.1, 0.1), (-0.2, 0.2)), 0.08);
        near(disk.area_within_m2((1.0, 2.0), (0.0, 1.0)), 0.0);
        // A circular segment beyond x = 1/2: π/3 - sqrt(3)/4.
        near(disk.area_within_m2((0.5, 2.0), (-2.0, 2.0)), PI / 3.0 - libm::sqrt(3.0) / 4.0);
        // A corner beyond (1/2, 1/2): a square less two segment strips; π/12 + (1 - sqrt 3)/4.
        near(
            disk.area_within_m2((0.5, 2.0), (0.5, 2.0)),
            PI / 12.0 + (1.0 - libm::sqrt(3.0)) / 4.0,
        );
    }

    #[test]
    fn parts_of_a_disk_add_up_wherever_it_is_cut() {
        let disk = Shape::disk(0.3, -0.2, 0.7);
        for cut in [-0.39, -0.2, 0.1, 0.3, 0.55, 0.99] {
            for level in [-0.85, -0.3, -0.2, 0.2, 0.45] {
                let (x, y) = ((-5.0, cut), (-5.0, level));
                let (x2, y2) = ((cut, 5.0), (level, 5.0));
                let sum: f64 = [(x, y), (x, y2), (x2, y), (x2, y2)]
                    .iter()
                    .map(|(xs, ys)| disk.area_within_m2(*xs, *ys))
                    .sum();
                near(sum, disk.area_m2());
            }
        }
    }

    #[test]
    fn touching_shapes_do_not_overlap() {
        let left = Shape::Rectangle { x_m: (-1.0, 0.0), y_m: (0.0, 1.0) };
        let right = Shape::Rectangle { x_m: (0.0, 0.1 + 0.2), y_m: (0.0, 1.0) };
        let next = Shape::Rectangle { x_m: (0.3, 0.6), y_m: (0.0, 1.0) };
        assert!(!left.overlaps(&right) && !right.overlaps(&left));
        assert!(!right.overlaps(&next), "rounding is not an overlap");
        let disk = Shape::disk(1.0, 0.5, 0.4);
        assert!(!disk.overlaps(&next) && disk.overlaps(&Shape::disk(1.7, 0.5, 0.4)));
        assert!(Shape::disk(0.7, 0.5, 0.2).overlaps(&next));
        assert!(!Shape::disk(0.7, 1.1, 0.12).overlaps(&next), "near a corner, outside it");
        let polygon =
            |corners: &[(f64, f64)]| Shape::Polygon(Outline::new(corners.into()).unwrap());
        let l = polygon(&[(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)]);
        let notch = Shape::Rectangle { x_m: (1.0, 2.0), y_m: (1.0, 2.0) };
        assert!(!l.overlaps(&notch) && !notch.overlaps(&l), "it fills the L's corner");
        assert!(l.overlaps(&right));
        assert!(!l.overlaps(&left), "they share an edge");
        assert!(
            !l.overlaps(&Shape::disk(1.5, 1.5, 0.5)) && l.overlaps(&Shape::disk(1.5, 1.5, 0.6))
        );
        assert!(l.overlaps(&Shape::disk(0.5, 0.5, 0.01)), "a disk within it");
        assert!(l.overlaps(&polygon(&[(0.9, 0.9), (1.5, 1.2), (1.2, 1.5)])), "across the corner");
        assert!(!l.overlaps(&polygon(&[(1.0, 1.0), (1.5, 1.2), (1.2, 1.5)])), "at the corner");
    }
}
