//! Where on a source polygon the visible part of a target changes its kind: along lines on which a
//! corner of the target appears on an edge of an occluder, or a corner of an occluder on an edge of
//! the target, and along those from which an occluder is seen edge-on. Cut along these, the source falls into cells within which what is seen is smooth, so
//! that cubature converges, and no shadow hides between its nodes. (Where three edges of three polygons
//! meet in sight there is a curve of higher order, which is left to the cubature.)

use glam::{DVec2, DVec3};

/// Cells at most; beyond that the cubature has to find the rest.
const CELLS_MAX: usize = 400;
/// Nearer than this to a line, in parts of the source's extent, is on it.
const ON_LINE: f64 = 1e-12;

/// A plane with coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    pub(super) origin: DVec3,
    pub(super) e: DVec3,
    pub(super) f: DVec3,
    /// To the side that sees.
    pub(super) normal: DVec3,
}

impl Plane {
    pub(super) fn place(&self, point: DVec3) -> DVec2 {
        let from_origin = point - self.origin;
        DVec2::new(from_origin.dot(self.e), from_origin.dot(self.f))
    }

    pub(super) fn point(&self, place: DVec2) -> DVec3 {
        self.origin + self.e * place.x + self.f * place.y
    }

    fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.origin)
    }

    /// The segment in which the plane is met by the lines of sight from it past a near edge to a far
    /// corner, or past a near corner to a far edge.
    fn shadow(&self, corner: DVec3, edge: [DVec3; 2], corner_is_near: bool) -> Option<[DVec2; 2]> {
        // Heights over the corner's at which lines still come down to the plane, far away.
        const LEVEL: f64 = 1e-4;
        let top = self.height(corner);
        let [mut a, mut b] = edge;
        let limit = if corner_is_near { top * (1.0 + LEVEL) } else { top * (1.0 - LEVEL) };
        let over = |x: DVec3| {
            if corner_is_near { self.height(x) - limit } else { limit - self.height(x) }
        };
        if top <= 0.0 || (over(a) < 0.0 && over(b) < 0.0) {
            return None;
        }
        for (cut, other) in [(&mut a, b), (&mut b, edge[0])] {
            let (own, others) = (over(*cut), over(other));
            if own < 0.0 {
                *cut = *cut + (other - *cut) * (own / (own - others));
            }
        }
        let down = |x: DVec3| corner + (x - corner) * (top / (top - self.height(x)));
        Some([self.place(down(a)), self.place(down(b))])
    }
}

impl Plane {
    /// The line from which a flat body is seen edge-on, as far as a source of the size of the unit of
    /// length may reach; none if it is parallel.
    pub(super) fn edge_on(&self, point: DVec3, normal: DVec3) -> Option<[DVec2; 2]> {
        const REACH: f64 = 16.0;
        let slope = DVec2::new(normal.dot(self.e), normal.dot(self.f));
        let steepness = slope.length();
        if steepness < ON_LINE {
            return None;
        }
        let foot = slope * (normal.dot(point - self.origin) / (steepness * steepness));
        let along = slope.perp() * (REACH / steepness);
        (foot.length() < REACH).then(|| [foot - along, foot + along])
    }
}

/// The segments, on the plane of the source, that a convex occluder and a convex part of the target
/// make.
pub(super) fn segments(plane: &Plane, target: &[DVec3], occluder: &[DVec3]) -> Vec<[DVec2; 2]> {
    let edges = |corners: &[DVec3]| -> Vec<[DVec3; 2]> {
        (0..corners.len()).map(|i| [corners[i], corners[(i + 1) % corners.len()]]).collect()
    };
    let mut found = Vec::with_capacity(2 * target.len() * occluder.len() + 1);
    for edge in edges(occluder) {
        // Where it stands on the source.
        if edge.iter().all(|end| plane.height(*end).abs() <= ON_LINE) {
            found.push(edge.map(|end| plane.place(end)));
        }
        found.extend(target.iter().filter_map(|corner| plane.shadow(*corner, edge, false)));
    }
    for edge in edges(target) {
        found.extend(occluder.iter().filter_map(|corner| plane.shadow(*corner, edge, true)));
    }
    found
}

/// Convex cells that a convex polygon falls into along segments; each segment is drawn out to the
/// borders of the cells that it runs through.
pub(super) fn cells(polygon: Vec<DVec2>, segments: &[[DVec2; 2]]) -> Vec<Vec<DVec2>> {
    let extent = polygon.iter().map(|x| x.distance(polygon[0])).fold(0.0, f64::max);
    let near = ON_LINE * extent;
    let mut cells = vec![polygon];
    for segment in segments {
        let along = (segment[1] - segment[0]).normalize_or_zero();
        if along == DVec2::ZERO || !along.is_finite() {
            continue;
        }
        let mut next = Vec::with_capacity(cells.len() + 8);
        for cell in cells {
            match halves(&cell, *segment, along, near) {
                Some([left, right]) if next.len() < CELLS_MAX => next.extend([left, right]),
                _ => next.push(cell),
            }
        }
        cells = next;
    }
    cells
}

/// Both sides of a cell, if the segment runs through it.
fn halves(cell: &[DVec2], segment: [DVec2; 2], along: DVec2, near: f64) -> Option<[Vec<DVec2>; 2]> {
    let height = |x: DVec2| {
        let height = along.perp_dot(x - segment[0]);
        if height.abs() <= near { 0.0 } else { height }
    };
    let (mut left, mut right) = (Vec::with_capacity(6), Vec::with_capacity(6));
    let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut crossed = |x: DVec2| {
        let place = along.dot(x - segment[0]);
        first = first.min(place);
        last = last.max(place);
    };
    for (i, start) in cell.iter().enumerate() {
        let end = cell[(i + 1) % cell.len()];
        let (from, to) = (height(*start), height(end));
        if from >= 0.0 {
            left.push(*start);
        }
        if from <= 0.0 {
            right.push(*start);
        }
        if from == 0.0 {
            crossed(*start);
        }
        if (from < 0.0 && to > 0.0) || (from > 0.0 && to < 0.0) {
            let crossing = *start + (end - *start) * (from / (from - to));
            crossed(crossing);
            left.push(crossing);
            right.push(crossing);
        }
    }
    let length = along.dot(segment[1] - segment[0]);
    let is_met = last > near && first < length - near && last - first > near;
    let is_cut = |side: &[DVec2]| side.len() > 2 && side.iter().any(|x| height(*x) != 0.0);
    (is_met && is_cut(&left) && is_cut(&right)).then_some([left, right])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plate_over_a_square_draws_its_shadow_lines() {
        let plane = Plane { origin: DVec3::ZERO, e: DVec3::X, f: DVec3::Y, normal: DVec3::Z };
        let square = |z: f64| {
            [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| DVec3::new(x, y, z))
        };
        let found = segments(&plane, &square(2.0), &square(1.0));
        // From the corner (1, 0, 2) past the edge from (0, 0, 1) to (1, 0, 1).
        let expected = [DVec2::new(-1.0, 0.0), DVec2::new(1.0, 0.0)];
        let is_expected =
            |segment: &[DVec2; 2]| segment.iter().zip(expected).all(|(a, b)| a.distance(b) < 1e-15);
        assert_eq!(found.len(), 32);
        assert!(found.iter().any(is_expected));
    }

    #[test]
    fn cells_keep_the_area_and_a_short_segment_cuts_its_own_cell_alone() {
        let square = vec![DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
        let across = [DVec2::new(0.3, -1.0), DVec2::new(0.3, 2.0)];
        let short = [DVec2::new(0.5, 0.5), DVec2::new(0.6, 0.5)];
        let cells = cells(square, &[across, short]);
        assert_eq!(cells.len(), 3);
        let area = |cell: &Vec<DVec2>| {
            let fan = cell.windows(2).map(|w| (w[0] - cell[0]).perp_dot(w[1] - cell[0]) / 2.0);
            fan.sum::<f64>()
        };
        let sum: f64 = cells.iter().map(area).sum();
        assert!((sum - 1.0).abs() < 1e-15);
    }
}
