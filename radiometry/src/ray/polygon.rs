//! A ray against a polygon, convex or not, and against what lies in the ray's own plane.

use glam::DVec3;

use super::{Exact, Ray, determinant, dot};
use crate::domain::DomainError;
use crate::quadrature::Sum;
use crate::shape::Polygon;

impl Ray {
    /// Distance to a polygon, m, from either side; its border belongs to it, decided by exact
    /// signs. A ray within its plane meets its border first, or is on it from the start.
    ///
    /// ```
    /// use glam::DVec3;
    /// use radiometry::{ray::Ray, shape::Polygon};
    /// // An L: the ray passes the notch.
    /// let l = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)]
    ///     .map(|(x, y)| DVec3::new(x, y, 3.0));
    /// let l = Polygon::new(l.to_vec())?;
    /// let up = |x: f64, y: f64| Ray::new(DVec3::new(x, y, 0.0), DVec3::Z);
    /// assert_eq!(up(0.5, 1.5)?.polygon(&l)?, Some(3.0));
    /// assert_eq!(up(1.5, 1.5)?.polygon(&l)?, None);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn polygon(self, polygon: &Polygon) -> Result<Option<f64>, DomainError> {
        let vertices = polygon.vertices();
        let direction = self.exact_direction();
        // One scale for all, from the box that holds them.
        let most = vertices.iter().fold(DVec3::ZERO, |most, v| most.max(v.abs()));
        let scale = self.local([most], &mut []).exponent;
        let points: Vec<Exact> = vertices
            .iter()
            .map(|vertex| {
                let mut size = [libm::scalbn(1.0, scale)];
                self.local([*vertex], &mut size).points[0]
            })
            .collect();
        if !winds(&direction, &points) {
            return Ok(None);
        }
        let sides = || points.iter().zip(points.iter().cycle().skip(1));
        let along: Sum = sides().map(|(p, q)| determinant(&direction, p, q)).collect();
        if sides().all(|(p, q)| determinant(&direction, p, q) == 0.0) {
            let first = first_within_plane(&direction, &points);
            return first.map_or(Ok(None), |parameter| self.ahead(parameter, scale));
        }
        let height: Sum = sides().map(|(p, q)| determinant(&points[0], p, q)).collect();
        self.ahead(height.value() / along.value(), scale)
    }
}

/// Whether the closed path winds around the line through the origin along the direction, or meets
/// it. The winding number after Sunday (2001), with exact signs.
fn winds(direction: &Exact, points: &[Exact]) -> bool {
    let (upward, sideward) = axes(direction);
    let height = |p: &Exact| determinant(direction, &upward, p);
    let mut winding = 0;
    for (p, q) in points.iter().zip(points.iter().cycle().skip(1)) {
        let side = determinant(direction, p, q);
        let (from, to) = (height(p), height(q));
        if side == 0.0 && straddles(from, to) {
            let breadth = |p: &Exact| determinant(direction, &sideward, p);
            if straddles(breadth(p), breadth(q)) {
                return true;
            }
        }
        if from <= 0.0 && to > 0.0 && side > 0.0 {
            winding += 1;
        } else if from > 0.0 && to <= 0.0 && side < 0.0 {
            winding -= 1;
        }
    }
    winding != 0
}

/// The two coordinate axes that are least along the direction.
fn axes(direction: &Exact) -> (Exact, Exact) {
    let unit = |k: usize| core::array::from_fn(|i| (if i == k { 1.0 } else { 0.0 }, 0.0));
    let size = |k: usize| direction[k].0.abs();
    let longest = (0..3).fold(0, |best, k| if size(k) > size(best) { k } else { best });
    (unit((longest + 1) % 3), unit((longest + 2) % 3))
}

fn straddles(a: f64, b: f64) -> bool {
    (a <= 0.0 && b >= 0.0) || (a >= 0.0 && b <= 0.0)
}

/// The parameter at which a ray from the origin first meets a polygon that lies in a plane with
/// it, at or after its start.
pub(super) fn first_within_plane(direction: &Exact, points: &[Exact]) -> Option<f64> {
    let axis = viewing_axis(direction, points)?;
    let turn = |a: &Exact, b: &Exact| determinant(a, b, &axis);
    let mut crossings_behind = 0;
    let mut first: Option<f64> = None;
    let mut meet = |parameter: f64| {
        if parameter >= 0.0 && first.is_none_or(|first| parameter < first) {
            first = Some(parameter);
        }
    };
    for (p, q) in points.iter().zip(points.iter().cycle().skip(1)) {
        let (from, to) = (turn(direction, p), turn(direction, q));
        if from == 0.0 && to == 0.0 {
            let place = |p: &Exact| dot(direction, p) / dot(direction, direction);
            let (start, end) = (place(p), place(q));
            if straddles(start, end) {
                return Some(0.0);
            }
            meet(start.min(end));
        } else if straddles(from, to) {
            // t (d × (q - p)) = p × q; the difference is a sum, its terms being of two signs.
            let parameter = turn(p, q) / (to - from);
            meet(parameter);
            let is_counted = (from <= 0.0) != (to <= 0.0);
            crossings_behind += usize::from(is_counted && parameter < 0.0);
        }
    }
    if crossings_behind % 2 == 1 { Some(0.0) } else { first }
}

/// The coordinate axis along which the plane of the points is seen most openly.
fn viewing_axis(direction: &Exact, points: &[Exact]) -> Option<Exact> {
    let unit =
        |k: usize| -> Exact { core::array::from_fn(|i| (if i == k { 1.0 } else { 0.0 }, 0.0)) };
    let openness = |axis: &Exact| {
        points.iter().map(|p| determinant(direction, p, axis).abs()).fold(0.0, f64::max)
    };
    let axes = [unit(0), unit(1), unit(2)].map(|axis| (openness(&axis), axis));
    let best = axes.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    (best.0 > 0.0).then_some(best.1)
}
