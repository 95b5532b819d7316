//! What a cell of one surface sends to a place of another: a weight for the exitance at each of its
//! nodes. Exact for an exitance that is the cell's polynomial, but for the quadrature of cos θ cos θ'/π r²:
//! the cell is halved until each part is far away beside its size, and lies on one side of the horizon.

use glam::{DVec2, DVec3};
use radiometry::projected::{Occluder, Receiver, Source, occluded_by};
use radiometry::shape::Polygon;
use radiometry::{EstimateError, Tolerance};

use core::f64::consts::PI;

use super::chart::{Chart, Point};
use super::mesh::{Cell, NODES, OnNodes, nodes_over, spread};
use crate::scene::Solid;

/// A part is far away at this many of its radii.
const FAR: f64 = 1.5;
/// Halvings of what is near; a place next to an edge needs two for each power of two.
const NEAR_HALVINGS: u32 = 60;
/// Halvings of what a horizon or a shadow's edge crosses.
const KINK_HALVINGS: u32 = 6;
/// Of the part of a cell that is seen past bodies, relative to all of it.
const SEEN: f64 = 1e-7;
/// Of a part of a cell, what rounding makes of zero.
const LEVEL: f64 = 1e-12;

/// What may stand between two cells, as bodies and as radiometry takes them.
#[derive(Debug, Clone, Default)]
pub(super) struct Between {
    pub(super) solids: Vec<Solid>,
    pub(super) occluders: Vec<Occluder>,
}

/// Irradiance at `at` for an exitance of 1 at each node of the cell.
pub(super) fn gather(at: &Point, chart: &Chart, cell: &Cell, between: &Between) -> OnNodes {
    if let Some((origin, normal)) = chart.plane()
        && normal.dot(at.place - origin) <= LEVEL * (at.place - origin).length()
    {
        return [0.0; NODES];
    }
    let descended = |solids: &[Solid]| {
        let mut descent = Descent { at, chart, cell, solids, weights: [0.0; NODES] };
        descent.over(cell.low, cell.high, NEAR_HALVINGS, KINK_HALVINGS);
        descent.weights
    };
    let mut weights = descended(&between.solids);
    if between.solids.is_empty() || !chart.is_straight() {
        return weights;
    }
    // How much is seen of the cell is known exactly; the rays only say where.
    let Some(exact) = seen(at, chart, cell, &between.occluders) else { return weights };
    let mut sum: f64 = weights.iter().sum();
    if sum < SLIVER * exact {
        weights = descended(&[]);
        sum = weights.iter().sum();
    }
    if sum > 0.0 { weights.map(|weight| weight * (exact / sum)) } else { weights }
}

/// Where rays find so little of what is seen, they don't tell where it is.
const SLIVER: f64 = 0.1;

/// The form factor of a straight cell from a place, past bodies.
fn seen(at: &Point, chart: &Chart, cell: &Cell, occluders: &[Occluder]) -> Option<f64> {
    let polygon = Polygon::new(chart.outline(cell.low, cell.high)).ok()?;
    let receiver = Receiver::new(at.place, at.normal).ok()?;
    let tolerance = Tolerance::from_relative(SEEN).ok()?;
    match occluded_by(&receiver, &Source::Polygon(polygon), occluders, tolerance) {
        Ok(estimate) | Err(EstimateError::Unmet { estimate, .. }) => Some(estimate.value / PI),
        Err(_) => None,
    }
}

struct Descent<'d> {
    at: &'d Point,
    chart: &'d Chart,
    cell: &'d Cell,
    solids: &'d [Solid],
    weights: OnNodes,
}

/// Where a part of a cell lies.
struct Lie {
    is_far: bool,
    /// Wholly below the horizon, or turned away.
    is_unseen: bool,
    /// A horizon crosses it.
    is_crossed: bool,
    /// The longer of its sides.
    axis: usize,
}

impl Descent<'_> {
    fn over(&mut self, low: DVec2, high: DVec2, near: u32, kinks: u32) {
        let lie = self.lie(low, high);
        if lie.is_unseen {
            return;
        }
        if !lie.is_far && near > 0 {
            return self.halves(low, high, lie.axis, (near - 1, kinks));
        }
        if lie.is_crossed && kinks > 0 {
            return self.halves(low, high, lie.axis, (near, kinks - 1));
        }
        let nodes = nodes_over(self.chart, low, high);
        let is_seen = nodes.map(|point| self.is_seen(point.place));
        let count = is_seen.iter().filter(|is_seen| **is_seen).count();
        if count > 0 && count < NODES && kinks > 0 {
            return self.halves(low, high, lie.axis, (near, kinks - 1));
        }
        let mut parts = [0.0; NODES];
        for (k, point) in nodes.iter().enumerate().filter(|(k, _)| is_seen[*k]) {
            parts[k] = self.kernel(point) * point.density_m2;
        }
        if low == self.cell.low && high == self.cell.high {
            self.weights = parts;
        } else {
            let within = |at: DVec2| (at - self.cell.low) / (self.cell.high - self.cell.low);
            spread(&parts, (within(low), within(high)), &mut self.weights);
        }
    }

    fn halves(&mut self, low: DVec2, high: DVec2, axis: usize, (near, kinks): (u32, u32)) {
        let (mut middle_low, mut middle_high) = (low, high);
        middle_low[axis] = f64::midpoint(low[axis], high[axis]);
        middle_high[axis] = middle_low[axis];
        self.over(low, middle_high, near, kinks);
        self.over(middle_low, high, near, kinks);
    }

    /// cos θ cos θ'/π r².
    fn kernel(&self, from: &Point) -> f64 {
        let ray = from.place - self.at.place;
        let square = ray.length_squared();
        let cosines = self.at.normal.dot(ray).max(0.0) * (-from.normal.dot(ray)).max(0.0);
        if square > 0.0 { cosines / (PI * square * square) } else { 0.0 }
    }

    fn is_seen(&self, place: DVec3) -> bool {
        let ray = place - self.at.place;
        let length = ray.length();
        // Bodies that touch a surface do not hide the place itself.
        let inside = (BESIDE * length, (1.0 - BESIDE) * length);
        let hides = |solid: &Solid| solid.last_hit(self.at.place, ray / length, inside).is_some();
        !self.solids.iter().any(hides)
    }

    fn lie(&self, low: DVec2, high: DVec2) -> Lie {
        let at = |x: f64, y: f64| self.chart.point(DVec2::new(x, y));
        let corners = [at(low.x, low.y), at(high.x, low.y), at(high.x, high.y), at(low.x, high.y)];
        let middle = (low + high) / 2.0;
        let centre = self.chart.point(middle);
        let reach = corners.iter().map(|corner| (corner.place - centre.place).length());
        // The sides of a curved part bulge beyond its corners.
        let bulge = if self.chart.is_straight() { 1.0 } else { BULGE };
        let radius = bulge * reach.fold(0.0, f64::max);
        let away = centre.place - self.at.place;
        let height = |place: DVec3| self.at.normal.dot(place - self.at.place);
        let (lowest, highest) = if self.chart.is_straight() {
            let heights = corners.map(|corner| height(corner.place));
            (
                heights.iter().copied().fold(f64::INFINITY, f64::min),
                heights.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            )
        } else {
            (height(centre.place) - radius, height(centre.place) + radius)
        };
        let (turned, facing) = self.faces(&centre, &corners);
        let level = LEVEL * (radius + away.length());
        let side = |a: usize, b: usize| (corners[a].place - corners[b].place).length();
        let (along, across) = (side(0, 1).max(side(3, 2)), side(0, 3).max(side(1, 2)));
        Lie {
            is_far: away.length() >= FAR * radius,
            is_unseen: highest <= level || facing <= 0.0,
            is_crossed: lowest < -level || (turned < 0.0 && facing > 0.0),
            axis: usize::from(across > along),
        }
    }

    /// The least and the greatest of cos θ' over a part of a ball, times a length; both above zero for
    /// what is flat.
    fn faces(&self, centre: &Point, corners: &[Point; 4]) -> (f64, f64) {
        let Chart::Ball { centre: middle, radius_m } = self.chart else { return (1.0, 1.0) };
        let towards = self.at.place - *middle;
        let length = towards.length();
        let angle = |a: DVec3, b: DVec3| libm::acos(a.dot(b).clamp(-1.0, 1.0));
        let aside = angle(centre.normal, towards / length);
        let spread = corners.iter().map(|corner| angle(centre.normal, corner.normal));
        let spread = BULGE * spread.fold(0.0, f64::max);
        let face = |aside: f64| length * libm::cos(aside.clamp(0.0, PI)) - radius_m;
        (face(aside + spread), face(aside - spread))
    }
}

/// In parts of a ray, what touches its ends.
const BESIDE: f64 = 1e-9;
/// How much farther than its corners a curved part may reach.
const BULGE: f64 = 1.5;

#[cfg(test)]
mod tests {
    use radiometry::projected;
    use radiometry::shape::{Disk, Sphere};

    use super::super::mesh::Mesh;
    use super::*;
    use crate::scene::Body;

    fn point(place: [f64; 3], normal: [f64; 3]) -> Point {
        let (place, normal) = (DVec3::from_array(place), DVec3::from_array(normal).normalize());
        Point { place, normal, density_m2: 1.0 }
    }

    /// Of all cells of a body.
    fn whole(at: &Point, body: &Body, between: &Between) -> f64 {
        let mesh = Mesh::new(&[body]);
        let of = |cell: &usize| gather(at, mesh.chart(*cell), &mesh.cells[*cell], between);
        mesh.leaves.iter().map(|cell| of(cell).iter().sum::<f64>()).sum()
    }

    #[test]
    fn an_even_surface_sends_its_projected_solid_angle() {
        let wall = [[0.0, 0.0], [0.0, 2.0], [1.5, 3.0], [1.0, 0.5]];
        let wall = wall.map(|[y, z]| DVec3::new(0.0, y, z)).to_vec();
        let polygon = Polygon::new(wall).unwrap();
        let disk = Disk::new(DVec3::new(0.0, 0.0, 1.0), DVec3::new(1.0, 0.2, -0.4), 0.8).unwrap();
        let ball = Sphere::new(DVec3::new(-1.0, 0.2, 1.0), 1.0).unwrap();
        let facing =
            super::super::chart::Chart::all_of(&Body::Raised(Solid::Polygon(polygon.clone())))[0]
                .plane()
                .unwrap()
                .1;
        let places = [
            point([0.5, 0.3, 0.0], [0.0, 0.0, 1.0]),
            point([1e-5, 0.3, 0.0], [0.0, 0.0, 1.0]),
            point([0.7, 0.3, 0.9], [-0.5, 0.1, 1.0]),
            point([0.2, -0.3, 0.4], [-0.2, 0.9, 0.1]),
        ];
        for at in places {
            let receiver = Receiver::new(at.place, at.normal).unwrap();
            let checks = [
                (Solid::Polygon(polygon.clone()), projected::polygon(&receiver, &polygon)),
                (Solid::Disk(disk), projected::disk(&receiver, &disk)),
                (Solid::Sphere(ball), projected::sphere(&receiver, &ball)),
            ];
            for (solid, expected) in checks {
                let Ok(expected) = expected else { continue };
                let is_before = match &solid {
                    Solid::Polygon(_) => facing.x > 0.0,
                    Solid::Disk(disk) => disk.axis().dot(at.place - disk.center_m()) > 0.0,
                    _ => true,
                };
                let expected = if is_before { expected.sr() / PI } else { 0.0 };
                let found = whole(&at, &Body::Raised(solid.clone()), &Between::default());
                println!("{} {found} {expected} {:e}", at.place, found - expected);
                assert!((found - expected).abs() < 2e-5, "{found} {expected} {solid:?}");
            }
        }
    }
}
