//! The form factor of two flat polygons past opaque bodies that stand between them.

use core::cell::Cell as Slot;

use glam::{DVec2, DVec3};

use super::UNLIKE_SIZES;
use super::events::{Plane, cells, segments};
use super::parts::{clip, convex_parts};
use super::polygons::{Faces, Facing, Pair, unhindered};
use super::sight::{Flat, Round, Sight, between};
use crate::direction::frame;
use crate::domain::DomainError;
use crate::estimate::{Estimate, EstimateError, Tolerance};
use crate::projected::Occluder;
use crate::quadrature::{Cell, cubature};
use crate::shape::{HalfPlane, Polygon};

/// Below this, in parts of the extent of the pair, a body does not reach into it.
const REACH: f64 = 1e-13;
/// Corners of the polygon whose edges stand for a curved outline in the search for cells.
const OUTLINE: usize = 8;

/// F from one polygon to another past opaque bodies, as an estimate within a tolerance: polygons, convex
/// or not, disks, balls, and horizontal half-planes. Conventions as in
/// [`polygons`](super::polygons()); both faces of a flat body are opaque.
///
/// A body behind either polygon hides nothing, nor does one that lies in the plane of either; it may
/// touch them, share edges or vertices, stand on them, or pierce them (but a ball may not). The
/// relative tolerance refers to the factor without the bodies, since what they leave may be as small
/// as it likes.
///
/// What a point of the smaller polygon sees of the larger is exact: the cones through the bodies are
/// cut out of it. Cubature over the smaller polygon does the rest, in cells within which polygons
/// look alike. Where several curved bodies shade each other, all but one count as 96-gons
/// there, and the bound says so.
///
/// For the person at the rig: baffles and stray light. Reference: Hottel and Sarofim (1967) for
/// shadowing; Nusselt (1928) for the inner integral.
///
/// ```
/// use glam::DVec3;
/// use radiometry::form_factor::{aligned_rectangles, polygons_occluded};
/// use radiometry::{Tolerance, projected::Occluder, shape::Polygon};
/// let square = |x: [f64; 2], y: [f64; 2], z: f64| {
///     let corners = [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])];
///     Polygon::new(corners.map(|(x, y)| DVec3::new(x, y, z)).to_vec())
/// };
/// // A small source under a lid that hides half of what it would see.
/// let source = square([0.4999, 0.5001], [0.4999, 0.5001], 0.0)?;
/// let target = square([0.0, 1.0], [0.0, 1.0], 1.0)?;
/// let lid = Occluder::Polygon(square([0.5, 9.0], [-9.0, 9.0], 0.5)?);
/// let seen = polygons_occluded(&source, &target, &[lid], Tolerance::from_relative(1e-6)?)?;
/// let whole = aligned_rectangles([0.4999, 0.5001], [0.4999, 0.5001], [0.0, 1.0], [0.0, 1.0], 1.0)?;
/// assert!((seen.value - whole.ratio() / 2.0).abs() <= seen.error_bound);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn polygons_occluded(
    from: &Polygon,
    to: &Polygon,
    occluders: &[Occluder],
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    let pair = Pair::new(from, to)?;
    let bodies = Bodies::new(&pair, occluders)?;
    past(&pair, Faces::Both, bodies, tolerance)
}

/// The same for the fronts of both, around which their vertices run counter-clockwise, past polygons.
pub(crate) fn between_fronts<'a>(
    from: &Polygon,
    to: &Polygon,
    others: impl Iterator<Item = &'a Polygon>,
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    let pair = Pair::new(from, to)?;
    let mut bodies = Bodies::default();
    for other in others {
        bodies.polygon(&pair, other.vertices())?;
    }
    past(&pair, Faces::Fronts, bodies, tolerance)
}

/// Occluders in the unit of a pair, convex.
#[derive(Default)]
struct Bodies {
    flats: Vec<Flat>,
    rounds: Vec<Round>,
}

impl Bodies {
    fn new(pair: &Pair, occluders: &[Occluder]) -> Result<Self, EstimateError> {
        let mut bodies = Self::default();
        for occluder in occluders {
            match occluder {
                Occluder::Polygon(polygon) => bodies.polygon(pair, polygon.vertices())?,
                Occluder::HalfPlane(half_plane) => bodies.half_plane(pair, half_plane)?,
                Occluder::Disk(disk) => bodies.rounds.push(Round::Disk {
                    center: in_range(pair.near(disk.center_m()))?,
                    axis: disk.axis() / disk.axis().length(),
                    radius: pair.in_unit(disk.radius_m()),
                }),
                Occluder::Sphere(ball) => bodies.rounds.push(Round::Sphere {
                    center: in_range(pair.near(ball.center_m()))?,
                    radius: pair.in_unit(ball.radius_m()),
                }),
            }
        }
        let fits = |round: &Round| round.ball().1 < LARGEST;
        if bodies.rounds.iter().all(fits) { Ok(bodies) } else { Err(UNLIKE_SIZES.into()) }
    }

    fn polygon(&mut self, pair: &Pair, vertices_m: &[DVec3]) -> Result<(), EstimateError> {
        let mut vertices = Vec::with_capacity(vertices_m.len());
        for vertex in vertices_m {
            vertices.push(in_range(pair.near(*vertex))?);
        }
        let first = vertices[0];
        let fan = vertices.windows(2).map(|edge| (edge[0] - first).cross(edge[1] - first));
        let area = fan.fold(DVec3::ZERO, |sum, triangle| sum + triangle);
        // Without an area it hides nothing.
        if let Some(normal) = crate::direction::normalised(area) {
            let parts = convex_parts(&vertices, normal).into_iter();
            self.flats.extend(parts.map(|corners| Flat { corners, normal }));
        }
        Ok(())
    }

    /// As much of it as the pair can notice.
    fn half_plane(&mut self, pair: &Pair, half_plane: &HalfPlane) -> Result<(), EstimateError> {
        let edge = in_range(pair.near(DVec3::new(half_plane.x_max_m(), 0.0, half_plane.z_m())))?;
        let all = || pair.from.iter().chain(&pair.to);
        let low = all().fold(DVec3::INFINITY, |low, x| low.min(*x)) - DVec3::ONE;
        let high = all().fold(DVec3::NEG_INFINITY, |high, x| high.max(*x)) + DVec3::ONE;
        let x_max = edge.x.min(high.x);
        if x_max > low.x {
            let corner = |x: f64, y: f64| DVec3::new(x, y, edge.z);
            let corners = vec![
                corner(low.x, low.y),
                corner(x_max, low.y),
                corner(x_max, high.y),
                corner(low.x, high.y),
            ];
            self.flats.push(Flat { corners, normal: DVec3::Z });
        }
        Ok(())
    }
}

/// Larger than this beside the pair, squares leave the doubles' range.
const LARGEST: f64 = 1e100;

fn in_range(point: DVec3) -> Result<DVec3, EstimateError> {
    // So written that NaN is refused too.
    if point.abs().max_element() < LARGEST { Ok(point) } else { Err(UNLIKE_SIZES.into()) }
}

fn past(
    pair: &Pair,
    faces: Faces,
    bodies: Bodies,
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    let Some(facing) = pair.facing(faces) else { return Ok(Estimate::closed(0.0, 0.0)) };
    let bodies = in_the_way(&facing, bodies);
    if bodies.flats.is_empty() && bodies.rounds.is_empty() {
        return unhindered(pair, &facing, tolerance);
    }
    apart(&facing, &bodies.rounds)?;
    let whole = match unhindered(pair, &facing, Tolerance::from_relative(1e-3)?) {
        Ok(estimate) | Err(EstimateError::Unmet { estimate, .. }) => estimate,
        Err(error) => return Err(error),
    };
    let most = (whole.value + whole.error_bound).min(1.0);
    let allowed = tolerance.allowed(most);
    let wanted = Tolerance::new(0.0, allowed, tolerance.budget())?;

    let (area_from, area_to) = (pair.area_from, pair.area_to);
    let parts = |vertices: &[DVec3], normal: DVec3, own: DVec3, other: (DVec3, DVec3)| {
        let (point, facing) = other;
        // Parts of the whole polygon, since what is clipped may hang together by bare edges.
        let turned: Vec<DVec3> = if normal.dot(own) < 0.0 {
            vertices.iter().rev().copied().collect()
        } else {
            vertices.to_vec()
        };
        let parts = convex_parts(&turned, normal).into_iter();
        parts
            .map(|part| clip(&part, facing, facing.dot(point)))
            .filter(|part| part.len() > 2)
            .collect::<Vec<_>>()
    };
    let plane_from = (pair.from[0], facing.normal_from);
    let plane_to = (pair.to[0], facing.normal_to);
    let from = parts(&pair.from, facing.normal_from, pair.normal_from, plane_to);
    let to = parts(&pair.to, facing.normal_to, pair.normal_to, plane_from);
    // The smaller outside, where what is seen varies less.
    let (outer, inner, plane) =
        if area_from <= area_to { (from, to, plane_from) } else { (to, from, plane_to) };
    let sight = Sight { target: inner, flats: bodies.flats, rounds: bodies.rounds };
    let exchange = over(&outer, plane, &sight, wanted, area_from)?;
    // What is seen is no more than without the bodies.
    exchange.scaled(1.0 / area_from).clamped(0.0, most).within(wanted)
}

/// The integral over the source of what its points see.
fn over(
    source: &[Vec<DVec3>],
    (origin, normal): (DVec3, DVec3),
    sight: &Sight,
    wanted: Tolerance,
    area: f64,
) -> Result<Estimate, EstimateError> {
    let (e, f) = frame(normal);
    let plane = Plane { origin, e, f, normal };
    let events = events(&plane, sight);
    let mut triangles = Vec::new();
    for part in source {
        let part: Vec<DVec2> = part.iter().map(|corner| plane.place(*corner)).collect();
        for cell in cells(part, &events) {
            let fan = cell.windows(2).skip(1);
            triangles.extend(fan.map(|edge| Cell::Triangle([cell[0], edge[0], edge[1]])));
        }
    }
    let noise = Slot::new(0.0_f64);
    let at = |place: DVec2| {
        let seen = sight.from(plane.point(place), normal);
        noise.set(noise.get().max(seen.noise));
        seen.factor
    };
    let integral = match cubature(at, &triangles, wanted.before_factor(1.0 / area)) {
        Ok(estimate) | Err(EstimateError::Unmet { estimate, .. }) => estimate,
        Err(error) => return Err(error),
    };
    let total: f64 = source.iter().map(|part| area_of(part, normal)).sum();
    let error_bound = integral.error_bound + noise.get() * total;
    Ok(Estimate { error_bound, ..integral })
}

fn area_of(part: &[DVec3], normal: DVec3) -> f64 {
    let fan = part.windows(2).map(|edge| (edge[0] - part[0]).cross(edge[1] - part[0]));
    fan.fold(DVec3::ZERO, |sum, triangle| sum + triangle).dot(normal) / 2.0
}

/// Segments of all bodies.
fn events(plane: &Plane, sight: &Sight) -> Vec<[DVec2; 2]> {
    let mut events = Vec::new();
    let front = (plane.origin, plane.normal);
    events
        .extend(sight.flats.iter().filter_map(|flat| plane.edge_on(flat.corners[0], flat.normal)));
    events.extend(sight.rounds.iter().filter_map(|round| match round {
        Round::Disk { center, axis, .. } => plane.edge_on(*center, *axis),
        Round::Sphere { .. } => None,
    }));
    for part in &sight.target {
        let corner = part[0];
        let normal = (part[1] - corner).cross(part[2] - corner).normalize_or_zero();
        for flat in &sight.flats {
            if let Some(body) = between(flat, [front, (corner, normal)]) {
                events.extend(segments(plane, part, &body.corners));
            }
        }
        for round in &sight.rounds {
            let (center, radius) = round.ball();
            let towards = match round {
                Round::Disk { axis, .. } => *axis,
                Round::Sphere { .. } => plane.normal,
            };
            let (e, f) = frame(towards);
            let corners = (0..OUTLINE).map(|i| {
                let turn = core::f64::consts::TAU * i as f64 / OUTLINE as f64;
                let (sin, cos) = libm::sincos(turn);
                center + (e * cos + f * sin) * radius
            });
            let outline = Flat { corners: corners.collect(), normal: towards };
            if let Some(body) = between(&outline, [front, (corner, normal)]) {
                events.extend(segments(plane, part, &body.corners));
            }
        }
    }
    events
}

/// Without the bodies that a plane parts from all lines between the polygons: their own planes, and
/// those through an edge of one and a corner of the other that have both on one side.
fn in_the_way(facing: &Facing, bodies: Bodies) -> Bodies {
    let planes = shaft(facing);
    let reaches = |farthest: &dyn Fn(DVec3) -> f64| {
        planes.iter().all(|(point, normal)| farthest(*normal) - normal.dot(*point) > REACH)
    };
    let reaches_flat = |flat: &Flat| {
        reaches(&|normal| {
            flat.corners.iter().map(|x| normal.dot(*x)).fold(f64::NEG_INFINITY, f64::max)
        })
    };
    let reaches_round = |round: &Round| {
        let (center, radius) = round.ball();
        reaches(&|normal| normal.dot(center) + radius)
    };
    let Bodies { mut flats, mut rounds } = bodies;
    flats.retain(reaches_flat);
    rounds.retain(reaches_round);
    Bodies { flats, rounds }
}

/// Planes that have both polygons on the side that their unit normals point to.
fn shaft(facing: &Facing) -> Vec<(DVec3, DVec3)> {
    let (from, to) = (&facing.from, &facing.to);
    let mut planes = vec![(from[0], facing.normal_from), (to[0], facing.normal_to)];
    for (edges, corners) in [(from, to), (to, from)] {
        for (i, a) in edges.iter().enumerate() {
            let along = edges[(i + 1) % edges.len()] - *a;
            for corner in corners {
                let Some(normal) = crate::direction::normalised(along.cross(*corner - *a)) else {
                    continue;
                };
                let heights = || from.iter().chain(to).map(|x| normal.dot(*x - *a));
                if heights().all(|height| height >= -REACH) {
                    planes.push((*a, normal));
                } else if heights().all(|height| height <= REACH) {
                    planes.push((*a, -normal));
                }
            }
        }
    }
    planes
}

/// No ball is pierced by a polygon.
fn apart(facing: &Facing, rounds: &[Round]) -> Result<(), DomainError> {
    for round in rounds {
        let Round::Sphere { center, radius } = *round else { continue };
        let within = radius * (1.0 - 1e-9);
        for (polygon, normal) in
            [(&facing.from, facing.normal_from), (&facing.to, facing.normal_to)]
        {
            let height = normal.dot(center - polygon[0]);
            if height.abs() >= within {
                continue;
            }
            let foot = center - normal * height;
            let reach = ((within - height) * (within + height)).sqrt();
            if meets_circle(polygon, normal, foot, reach) {
                return Err(DomainError::Interpenetrating);
            }
        }
    }
    Ok(())
}

/// Whether a polygon has a point within a circle in its plane: by its edges, or the centre inside.
fn meets_circle(polygon: &[DVec3], normal: DVec3, center: DVec3, radius: f64) -> bool {
    let mut turned = 0.0;
    for (i, start) in polygon.iter().enumerate() {
        let end = polygon[(i + 1) % polygon.len()];
        let (a, b) = (*start - center, end - center);
        let along = b - a;
        let square = along.length_squared();
        let t = if square > 0.0 { (-a.dot(along) / square).clamp(0.0, 1.0) } else { 0.0 };
        if (a + along * t).length() < radius {
            return true;
        }
        turned += libm::atan2(a.cross(b).dot(normal), a.dot(b));
    }
    turned.abs() > 1.0
}
