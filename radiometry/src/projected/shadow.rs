//! Which shadow a point is in, and whether a whole region of a plane is in one, without an integral.
//! It does not know how bright anything is.

use core::f64::consts::PI;

use glam::DVec3;

use super::Receiver;
use super::body::{Occluder, Source, in_one_unit};
use super::hull::{Hull, are_apart, are_beyond, disk_points};
use super::scene::{Before, Scene};
use crate::domain::DomainError;
use crate::shape::{Disk, Polygon};
use crate::wide::length;

/// What a point sees of a source with bodies before it.
/// Who needs it: the page on penumbra; the person at the rig, to place a baffle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shadow {
    /// All that its horizon leaves.
    Lit,
    /// A part of it, some of the source's outline hidden.
    Penumbra,
    /// All of the outline, a body standing before its midst.
    Antumbra,
    /// Nothing.
    Umbra,
    /// Nothing, whatever stands in the way: the source is below the horizon, seen edge-on, or has no
    /// extent.
    Unseen,
}

/// Which shadow a receiver is in. Shadows and gaps narrower than 1e-12 of the source are not seen.
/// Sim: which points need [`super::occluded_by`] at all.
/// Who needs it: the page on penumbra; the person at the rig, to place a baffle.
///
/// ```
/// use glam::DVec3;
/// use radiometry::projected::{Occluder, Receiver, Shadow, Source, shadow};
/// use radiometry::shape::Sphere;
/// // A grain before a ball.
/// let up = Receiver::new(DVec3::ZERO, DVec3::Z)?;
/// let ball = Source::Sphere(Sphere::new(DVec3::new(0.0, 0.0, 2.0), 1.0)?);
/// let grain = Occluder::Sphere(Sphere::new(DVec3::new(0.0, 0.0, 0.5), 0.1)?);
/// assert_eq!(shadow(&up, &ball, &[grain])?, Shadow::Antumbra);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn shadow(
    receiver: &Receiver,
    source: &Source,
    occluders: &[Occluder],
) -> Result<Shadow, DomainError> {
    if source.whole(receiver)? <= 0.0 {
        return Ok(Shadow::Unseen);
    }
    let (receiver, source, occluders) = in_one_unit(receiver, source, occluders)?;
    let scene = match Scene::before(&receiver, &source, &occluders)? {
        Before::Nothing => return Ok(Shadow::Lit),
        Before::Umbra => return Ok(Shadow::Umbra),
        Before::Bodies(scene) => scene,
    };
    let visible = scene.visible()?;
    Ok(match (visible.is_shadowed, visible.is_outline_hidden, visible.is_any()) {
        (false, ..) => Shadow::Lit,
        (true, _, false) => Shadow::Umbra,
        (true, false, true) => Shadow::Antumbra,
        (true, true, true) => Shadow::Penumbra,
    })
}

/// A bounded part of a plane.
/// Who needs it: the simulator, where it compiles a scene.
#[derive(Debug, Clone, PartialEq)]
pub enum Region {
    /// A rectangle, or any other simple polygon.
    Polygon(Polygon),
    /// A disk.
    Disk(Disk),
}

/// What is known of all points of a region at once.
/// Who needs it: the simulator, where it compiles a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RegionShadow {
    /// No point is shaded: nothing of the source is hidden from any.
    Lit,
    /// From no point anything of the source is seen.
    Umbra,
    /// Neither is certain: the points have to be looked at one by one.
    Mixed,
}

/// Whether one body leaves a whole region lit or puts it wholly in the umbra, whatever the normals of
/// its points. Conservative: `Lit` and `Umbra` are certain, `Mixed` is not. Lit is found by a plane
/// between the body and the convex hull of region and source; umbra where the lines from all
/// corners of the region to all points of the source go through the body, through an inscribed
/// polygon if it is round. Sim: penumbra work left out where a scene is compiled.
///
/// ```
/// use glam::DVec3;
/// use radiometry::projected::{Occluder, Region, RegionShadow, Source, region_shadow};
/// use radiometry::shape::{Disk, HalfPlane};
/// let detector = Region::Disk(Disk::new(DVec3::ZERO, DVec3::Z, 0.01)?);
/// let lamp = Source::Disk(Disk::new(DVec3::new(0.0, 0.0, 1.0), DVec3::Z, 0.05)?);
/// let edge = |x_max_m| HalfPlane::new(x_max_m, 0.5).map(Occluder::HalfPlane);
/// let found = |x_max_m| region_shadow(&detector, &lamp, &edge(x_max_m)?);
/// assert_eq!(found(-0.031)?, RegionShadow::Lit);
/// assert_eq!(found(0.031)?, RegionShadow::Umbra);
/// assert_eq!(found(0.0)?, RegionShadow::Mixed);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn region_shadow(
    region: &Region,
    source: &Source,
    occluder: &Occluder,
) -> Result<RegionShadow, DomainError> {
    const STEPS: u32 = 300;
    let anchor = match region {
        Region::Polygon(polygon) => polygon.vertices()[0],
        Region::Disk(disk) => disk.center_m(),
    };
    let reach = match region {
        Region::Polygon(polygon) => Occluder::Polygon(polygon.clone()),
        Region::Disk(disk) => Occluder::Disk(*disk),
    };
    // The region rides along as a body, for the common unit.
    let bodies = [occluder.clone(), reach];
    let (_, source, bodies) = in_one_unit(&Receiver::new(anchor, DVec3::Z)?, source, &bodies)?;
    let [occluder, region] = &bodies[..] else { return Ok(RegionShadow::Mixed) };
    let region = corners(region);
    let shining = Hull::of_source(&source);
    let is_beyond = |edge| are_beyond(&region, &shining, edge);
    let is_clear = matches!(occluder, Occluder::HalfPlane(edge) if is_beyond(edge));
    let is_lit = is_clear
        || Hull::of_occluder(occluder, &region, &shining)
            .is_none_or(|body| are_apart(&region, &shining, &body, STEPS));
    Ok(if is_lit {
        RegionShadow::Lit
    } else if is_umbra(&region, &shining, occluder) {
        RegionShadow::Umbra
    } else {
        RegionShadow::Mixed
    })
}

/// Of a region or of a polygon around it.
fn corners(region: &Occluder) -> Vec<DVec3> {
    const COUNT: usize = 24;
    match region {
        Occluder::Polygon(polygon) => polygon.vertices().to_vec(),
        Occluder::Disk(disk) => {
            let around = 1.0 / libm::cos(PI / COUNT as f64);
            disk_points(disk, COUNT, around * (1.0 + 4.0 * f64::EPSILON))
        }
        Occluder::HalfPlane(_) | Occluder::Sphere(_) => Vec::new(),
    }
}

/// A convex flat piece of a body: a point and the normal of its plane, and its edges by a point
/// and the unit vector inwards.
struct Piece {
    point: DVec3,
    normal: DVec3,
    edges: Vec<(DVec3, DVec3)>,
    /// How far its boundary may be from where it should be.
    slack: f64,
}

fn is_umbra(region: &[DVec3], source: &Hull, occluder: &Occluder) -> bool {
    let Some(piece) = piece(occluder, region, source) else { return false };
    let height = |x: DVec3| piece.normal.dot(x - piece.point);
    // The region below, the source above.
    let lowest = height(source.lowest(piece.normal));
    let is_between = lowest > piece.slack && region.iter().all(|x| height(*x) < -piece.slack);
    // The line from x to y meets the plane at (x h(y) + y d(x))/(h(y) + d(x)); an edge's distance there,
    // times the denominator, is linear in either.
    let is_inside = |x: DVec3, (point, inward): (DVec3, DVec3)| {
        let (from_edge, depth) = (inward.dot(x - point) - piece.slack, -height(x));
        let slope = piece.normal * from_edge + inward * depth;
        let y = source.lowest(slope);
        let to_edge = inward.dot(y - point) - piece.slack;
        from_edge * height(y) + to_edge * depth > 0.0
    };
    is_between && region.iter().all(|x| piece.edges.iter().all(|edge| is_inside(*x, *edge)))
}

/// None if the body has none that is certain. The normal points from region to source.
fn piece(occluder: &Occluder, region: &[DVec3], source: &Hull) -> Option<Piece> {
    const COUNT: usize = 32;
    const ROUNDING: f64 = 1e-13;
    let toward = |point: DVec3, normal: DVec3| {
        let up = normal * (1.0 / length(normal));
        if up.dot(source.middle() - point) < 0.0 { -up } else { up }
    };
    match occluder {
        Occluder::HalfPlane(edge) => {
            let point = DVec3::new(edge.x_max_m(), 0.0, edge.z_m());
            let normal = toward(point, DVec3::Z);
            Some(Piece { point, normal, edges: vec![(point, DVec3::NEG_X)], slack: ROUNDING })
        }
        Occluder::Disk(disk) => {
            let normal = toward(disk.center_m(), disk.axis());
            convex(&disk_points(disk, COUNT, 1.0), normal, ROUNDING)
        }
        Occluder::Sphere(ball) => {
            let middle = region.iter().sum::<DVec3>() / region.len() as f64;
            let disk =
                Disk::new(ball.center_m(), source.middle() - middle, ball.radius_m()).ok()?;
            let normal = toward(disk.center_m(), disk.axis());
            convex(&disk_points(&disk, COUNT, 1.0), normal, ROUNDING)
        }
        Occluder::Polygon(polygon) => {
            let corners = polygon.vertices();
            let first = corners[0];
            let fan = corners.windows(2).map(|pair| (pair[0] - first).cross(pair[1] - first));
            let area: DVec3 = fan.sum();
            let size = length(area);
            if size == 0.0 {
                return None;
            }
            let extent = corners.iter().map(|c| length(*c - first)).fold(0.0, f64::max);
            // As far off its plane as a polygon may be.
            convex(corners, toward(first, area), 4e-6 * extent + ROUNDING)
        }
    }
}

/// The polygon's edges with their inward normals; none if it is not convex.
fn convex(corners: &[DVec3], normal: DVec3, slack: f64) -> Option<Piece> {
    let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
    let mut edges = Vec::with_capacity(corners.len());
    for (i, a) in corners.iter().enumerate() {
        let along = corners[(i + 1) % corners.len()] - *a;
        let across = normal.cross(along);
        let size = length(across);
        if size == 0.0 {
            continue;
        }
        let inward = across * (if across.dot(middle - *a) < 0.0 { -1.0 } else { 1.0 } / size);
        if corners.iter().any(|c| inward.dot(*c - *a) < -slack) {
            return None;
        }
        edges.push((*a, inward));
    }
    (edges.len() >= 3).then(|| Piece { point: corners[0], normal, edges, slack })
}
