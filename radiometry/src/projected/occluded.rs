//! Sources partly hidden by one opaque body: umbra, penumbra and antumbra. It does not know how
//! bodies come to be where they are.
//!
//! What is seen of the source is a set of directions bounded by arcs of its outline, of the
//! occluder's and of the horizon. Its projected solid angle is ½ ∮ n·((u - u₀) × du) over them, a sum
//! in which the arcs need not even be in order: each is kept or dropped by what lies beside it. Circles and straight edges are exact; a disk's rim is integrated.

use core::cmp::Ordering;

use glam::DVec3;

use super::outline::Curve;
use super::seen::Seen;
use super::{Receiver, disk, polygon, sphere};
use crate::domain::DomainError;
use crate::estimate::{Estimate, EstimateError, Tolerance};
use crate::quadrature::Sum;
use crate::shape::{Disk, HalfPlane, Polygon, Sphere};
use crate::wide::{in_units, length, unit_exponent};

/// How far beside an arc to look, in parts of the source's extent: farther than rounding reaches.
const BESIDE: f64 = 1e-12;

/// Where on an arc: anywhere but at its middle, where symmetric outlines touch without crossing.
const LOOK_AT: f64 = 0.381_966;

/// What shines, uniformly.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// Both faces.
    Disk(Disk),
    /// All of it.
    Sphere(Sphere),
    /// Both faces.
    Polygon(Polygon),
}

/// What stands in the way.
#[derive(Debug, Clone, PartialEq)]
pub enum Occluder {
    /// A knife edge.
    HalfPlane(HalfPlane),
    /// A disk in any position.
    Disk(Disk),
    /// A ball.
    Sphere(Sphere),
    /// Convex or not.
    Polygon(Polygon),
}

/// Projected solid angle, sr, of the part of a source above the horizon that an opaque body leaves
/// visible: 0 in the umbra, the whole source's where nothing is hidden. A body behind the
/// source hides nothing; bodies that penetrate each other are refused. The relative tolerance refers to the unoccluded
/// source, since what a shadow leaves may be as small as it likes. Sim: baffles and shutters; the
/// lecture's penumbra.
///
/// ```
/// use glam::DVec3;
/// use radiometry::Tolerance;
/// use radiometry::projected::{Occluder, Receiver, Source, occluded};
/// use radiometry::shape::{HalfPlane, Sphere};
/// // Half of a ball behind a knife edge through its middle.
/// let up = Receiver::new(DVec3::ZERO, DVec3::Z)?;
/// let ball = Source::Sphere(Sphere::new(DVec3::new(0.0, 0.0, 2.0), 1.0)?);
/// let edge = Occluder::HalfPlane(HalfPlane::new(0.0, 0.5)?);
/// let seen = occluded(&up, &ball, &edge, Tolerance::default())?;
/// assert!((seen.value - std::f64::consts::PI / 8.0).abs() <= seen.error_bound);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn occluded(
    receiver: &Receiver,
    source: &Source,
    occluder: &Occluder,
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    let whole = whole(receiver, source)?;
    let (receiver, source, occluder) = in_one_unit(receiver, source, occluder)?;
    let hiding = match &occluder {
        Occluder::HalfPlane(half_plane) => Seen::half_plane(&receiver, half_plane),
        Occluder::Disk(disk) => Seen::disk(&receiver, disk),
        Occluder::Sphere(sphere) => Seen::sphere(&receiver, sphere)?,
        Occluder::Polygon(polygon) => Seen::polygon(&receiver, polygon),
    };
    let shining = match &source {
        Source::Disk(disk) => Seen::disk(&receiver, disk),
        Source::Sphere(sphere) => Seen::sphere(&receiver, sphere)?,
        Source::Polygon(polygon) => Seen::polygon(&receiver, polygon),
    };
    let unoccluded = Estimate::closed(whole, 1000.0);
    let (Some(shining), Some(hiding), true) = (shining, hiding, whole > 0.0) else {
        return Ok(unoccluded);
    };
    let normal = receiver.normal() / length(receiver.normal());
    if shining.is_pierced_by(&hiding) {
        return Err(DomainError::Interpenetrating.into());
    }
    let scene = Scene::new(normal, shining, hiding);
    let visible = scene.visible(whole, tolerance)?;
    let estimate = match visible {
        Visible::All => unoccluded,
        Visible::Part(part) => part.clamped(0.0, whole),
    };
    let absolute = tolerance.allowed(whole);
    estimate.within(Tolerance::new(0.0, absolute, tolerance.budget())?)
}

fn whole(receiver: &Receiver, source: &Source) -> Result<f64, DomainError> {
    Ok(match source {
        Source::Disk(shape) => disk(receiver, shape)?.sr(),
        Source::Sphere(shape) => sphere(receiver, shape)?.sr(),
        Source::Polygon(shape) => polygon(receiver, shape)?.sr(),
    })
}

/// Everything in a unit of length that is a power of two, so that no square overflows.
fn in_one_unit(
    receiver: &Receiver,
    source: &Source,
    occluder: &Occluder,
) -> Result<(Receiver, Source, Occluder), DomainError> {
    let mut lengths = receiver.point_m().to_array().to_vec();
    let disk_lengths = |disk: &Disk| [disk.center_m().abs().max_element(), disk.radius_m()];
    let sphere_lengths = |ball: &Sphere| [ball.center_m().abs().max_element(), ball.radius_m()];
    match source {
        Source::Disk(disk) => lengths.extend(disk_lengths(disk)),
        Source::Sphere(sphere) => lengths.extend(sphere_lengths(sphere)),
        Source::Polygon(polygon) => {
            lengths.extend(polygon.vertices().iter().flat_map(DVec3::to_array));
        }
    }
    match occluder {
        Occluder::HalfPlane(edge) => lengths.extend([edge.x_max_m(), edge.z_m()]),
        Occluder::Disk(disk) => lengths.extend(disk_lengths(disk)),
        Occluder::Sphere(sphere) => lengths.extend(sphere_lengths(sphere)),
        Occluder::Polygon(polygon) => {
            lengths.extend(polygon.vertices().iter().flat_map(DVec3::to_array));
        }
    }
    let unit = unit_exponent(lengths);
    let scale = |length: f64| libm::scalbn(length, -unit);
    let scaled_disk = |disk: &Disk| {
        Disk::new(in_units(disk.center_m(), unit), disk.axis(), scale(disk.radius_m()))
    };
    let scaled_sphere =
        |ball: &Sphere| Sphere::new(in_units(ball.center_m(), unit), scale(ball.radius_m()));
    let source = match source {
        Source::Disk(disk) => Source::Disk(scaled_disk(disk)?),
        Source::Sphere(sphere) => Source::Sphere(scaled_sphere(sphere)?),
        Source::Polygon(polygon) => Source::Polygon(polygon.in_units(unit)),
    };
    let occluder = match occluder {
        Occluder::HalfPlane(edge) => {
            Occluder::HalfPlane(HalfPlane::new(scale(edge.x_max_m()), scale(edge.z_m()))?)
        }
        Occluder::Disk(disk) => Occluder::Disk(scaled_disk(disk)?),
        Occluder::Sphere(sphere) => Occluder::Sphere(scaled_sphere(sphere)?),
        Occluder::Polygon(polygon) => Occluder::Polygon(polygon.in_units(unit)),
    };
    let point = in_units(receiver.point_m(), unit);
    Ok((Receiver::new(point, receiver.normal())?, source, occluder))
}

/// What is left of the source.
enum Visible {
    All,
    Part(Estimate),
}

struct Scene {
    normal: DVec3,
    source: Seen,
    /// The horizon first.
    hiding: [Seen; 2],
    /// The source's angular radius, about.
    extent: f64,
}

impl Scene {
    fn new(normal: DVec3, source: Seen, occluder: Seen) -> Self {
        let middle = source.middle;
        let extent = source
            .curves
            .iter()
            .flat_map(|curve| {
                [0.0, 0.25, 0.5, 0.75].map(|part| part * curve.turn()).map(|t| (curve, t))
            })
            .map(|(curve, t)| length(curve.direction_and_left(t).0 - middle))
            .fold(0.0, f64::max);
        Self { normal, source, hiding: [Seen::below(normal), occluder], extent }
    }

    fn visible(&self, whole: f64, tolerance: Tolerance) -> Result<Visible, EstimateError> {
        /// Of the tolerance, for each of the arcs' quadratures.
        const SHARE: f64 = 0.01;
        let absolute = SHARE * tolerance.allowed(whole);
        let (mut sum, mut magnitude) = (Sum::default(), 0.0);
        let (mut bound, mut evaluations) = (0.0, 0);
        let (mut kept, mut shadowed) = (0, false);
        let (mut in_front, mut behind) = (false, false);
        let beside = (BESIDE * self.extent).max(16.0 * f64::EPSILON);
        for (owner, curve) in self.curves() {
            for [from, to] in self.pieces(owner, curve) {
                let (direction, left) = curve.direction_and_left(LOOK_AT.mul_add(to - from, from));
                let (inner, outer) = (direction + left * beside, direction - left * beside);
                for probe in [inner, outer] {
                    match self.order(probe) {
                        Some(Ordering::Less) => in_front = true,
                        Some(Ordering::Greater) => behind = true,
                        _ => {}
                    }
                }
                let verdict = self.verdict(owner, inner, outer);
                shadowed |=
                    verdict == Verdict::Shadow || (owner == Some(1) && verdict == Verdict::Kept);
                if verdict != Verdict::Kept {
                    continue;
                }
                let arc = curve.arc([from, to], self.normal, self.source.middle, absolute)?;
                let sign = if owner.is_none() { 1.0 } else { -1.0 };
                sum.add(sign * arc.value);
                magnitude += arc.value.abs();
                bound += arc.error_bound;
                evaluations += arc.evaluations;
                kept += 1;
            }
        }
        if in_front && behind {
            return Err(DomainError::Interpenetrating.into());
        }
        if !shadowed {
            return Ok(Visible::All);
        }
        // Ends of arcs that should meet miss each other by a rounding of a direction.
        let rounding = 8.0 * f64::EPSILON * (magnitude + whole) * (1.0 + 1.0 / self.extent);
        let unseen = 4.0 * BESIDE * whole;
        let value = if kept == 0 { 0.0 } else { sum.value() };
        Ok(Visible::Part(Estimate { value, error_bound: bound + rounding + unseen, evaluations }))
    }

    /// All curves, with whose they are: the source's or that of a hiding body.
    fn curves(&self) -> impl Iterator<Item = (Option<usize>, &Curve)> {
        let own = self.source.curves.iter().map(|curve| (None, curve));
        own.chain(
            self.hiding
                .iter()
                .enumerate()
                .flat_map(|(body, seen)| seen.curves.iter().map(move |curve| (Some(body), curve))),
        )
    }

    /// A curve between its crossings with what is not its own.
    fn pieces(&self, owner: Option<usize>, curve: &Curve) -> Vec<[f64; 2]> {
        let bodies = [(None, &self.source), (Some(0), &self.hiding[0]), (Some(1), &self.hiding[1])];
        let others = bodies.into_iter().filter(|(body, _)| *body != owner);
        let limits = others.flat_map(|(_, seen)| &seen.limits);
        let level = self.source.level_with(&self.hiding[1]);
        let mut ends: Vec<f64> =
            limits.chain(&level).flat_map(|limit| curve.crossings(limit, self.extent)).collect();
        ends.sort_by(f64::total_cmp);
        if let (true, Some(first)) = (curve.is_closed(), ends.first().copied()) {
            // Once round, from the first crossing to itself.
            ends.push(first + curve.turn());
        } else {
            ends.insert(0, 0.0);
            ends.push(curve.turn());
        }
        ends.windows(2).map(|pair| [pair[0], pair[1]]).filter(|[from, to]| from < to).collect()
    }

    /// Whether an arc bounds what is visible of the source, by the directions inside and outside the
    /// curve that it belongs to.
    fn verdict(&self, owner: Option<usize>, inner: DVec3, outer: DVec3) -> Verdict {
        let Some(body) = owner else {
            return if self.hidden(1, inner) {
                Verdict::Shadow
            } else if self.hidden(0, inner) {
                Verdict::Dropped
            } else {
                Verdict::Kept
            };
        };
        let other = 1 - body;
        // Through the source's inside, the one side hidden by this body, the other by none.
        let through = self.source.distance(outer).is_some() && self.hidden(body, inner);
        if through && !self.hidden(other, outer) { Verdict::Kept } else { Verdict::Dropped }
    }

    /// Whether the occluder is nearer or farther than the source, where both are seen and the
    /// difference is no rounding.
    fn order(&self, direction: DVec3) -> Option<Ordering> {
        const ALIKE: f64 = 1e-9;
        let near = self.hiding[1].distance(direction)?;
        let far = self.source.distance(direction)?;
        if (near - far).abs() <= ALIKE * far { None } else { near.partial_cmp(&far) }
    }

    /// Whether a body is there in front of the source.
    fn hidden(&self, body: usize, direction: DVec3) -> bool {
        let nearer = |near: f64| self.source.distance(direction).is_some_and(|far| near < far);
        self.hiding[body].distance(direction).is_some_and(nearer)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Verdict {
    Kept,
    Dropped,
    /// The source's outline, but the occluder is before it.
    Shadow,
}
