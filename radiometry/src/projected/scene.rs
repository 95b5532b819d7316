//! A source with bodies in front of it, as the receiver sees them: which arcs of whose outlines bound
//! what is left of the source. It does not know what the arcs are for.

use core::cmp::Ordering;

use glam::DVec3;

use super::Receiver;
use super::around::Around;
use super::body::{Occluder, Source};
use super::limit::Limit;
use super::outline::Curve;
use super::pierced::is_pierced;
use super::seen::Seen;
use super::view::View;
use crate::direction::normalised;
use crate::domain::DomainError;
use crate::estimate::{Estimate, EstimateError, Tolerance};
use crate::quadrature::Sum;
use crate::shape::Polygon;
use crate::wide::{WideVec, length};

/// How far beside an arc to look, in parts of the source's extent: farther than rounding reaches.
const BESIDE: f64 = 1e-12;

/// Where on an arc: anywhere but at its middle, where symmetric outlines touch without crossing.
const LOOK_AT: f64 = 0.381_966;

/// What stands before a source.
pub(super) enum Before {
    /// Nothing that hides any of it, or it is not seen.
    Nothing,
    /// A body that hides all of it.
    Umbra,
    /// Bodies that have to be looked at.
    Bodies(Box<Scene>),
}

pub(super) struct Scene {
    view: View,
    source: Seen,
    hiding: Vec<Seen>,
    /// Where the source and a body, both flat, are equally far away.
    levels: Vec<Limit>,
    /// Whether the first of these is the horizon.
    has_horizon: bool,
}

/// What bounds the visible part of the source.
pub(super) struct Visible<'a> {
    scene: &'a Scene,
    /// Sign, curve and its ends.
    arcs: Vec<(f64, &'a Curve, [f64; 2])>,
    /// Whether an occluder hides anything of the source above the horizon.
    pub(super) is_shadowed: bool,
    /// Whether it hides a part of the source's outline.
    pub(super) is_outline_hidden: bool,
}

impl Scene {
    /// All lengths in one unit.
    pub(super) fn before(
        receiver: &Receiver,
        source: &Source,
        occluders: &[Occluder],
    ) -> Result<Before, DomainError> {
        let Some((middle, extent)) = middle_and_extent(receiver, source) else {
            return Ok(Before::Nothing);
        };
        let cone = Around::new(receiver.point_m(), source, middle.to_vec(), extent);
        let occluders: Vec<&Occluder> =
            occluders.iter().filter(|occluder| !cone.is_clear_of(occluder)).collect();
        match occluders[..] {
            [] => return Ok(Before::Nothing),
            [one] if cone.is_behind(one) => return Ok(Before::Umbra),
            _ => {}
        }
        let view = View::towards(receiver.point_m(), receiver.normal(), middle, extent)
            .ok_or(DomainError::Lost { result: "projected solid angle (sr)" })?;
        let shining = match source {
            Source::Disk(disk) => Seen::disk(&view, disk),
            Source::Sphere(sphere) => Seen::sphere(&view, sphere)?,
            Source::Polygon(polygon) => Seen::polygon(&view, polygon),
        };
        let mut hiding = Vec::with_capacity(occluders.len() + 1);
        for occluder in occluders {
            let seen = match occluder {
                Occluder::HalfPlane(half_plane) => Seen::half_plane(&view, half_plane),
                Occluder::Disk(disk) => Seen::disk(&view, disk),
                Occluder::Sphere(sphere) => Seen::sphere(&view, sphere)?,
                Occluder::Polygon(polygon) => Seen::polygon(&view, polygon),
            };
            hiding.extend(seen);
            if is_pierced(source, occluder) {
                return Err(DomainError::Interpenetrating);
            }
        }
        let Some(source) = shining else { return Ok(Before::Nothing) };
        if hiding.is_empty() {
            return Ok(Before::Nothing);
        }
        let horizon = Seen::below(&view, receiver.normal()).filter(|below| {
            source.curves.iter().any(|c| !c.crossings(&below.limits[0]).is_empty())
        });
        let has_horizon = horizon.is_some();
        hiding.splice(0..0, horizon);
        let levels = hiding.iter().filter_map(|seen| source.level_with(seen)).collect();
        let scene = Self { view, source, hiding, levels, has_horizon };
        Ok(Before::Bodies(Box::new(scene)))
    }

    /// Refused: a body that is in front of the source and behind.
    pub(super) fn visible(&self) -> Result<Visible<'_>, DomainError> {
        let mut visible =
            Visible { scene: self, arcs: Vec::new(), is_shadowed: false, is_outline_hidden: false };
        let mut places = vec![(false, false); self.hiding.len()];
        for (owner, curve) in self.curves() {
            for [from, to] in self.pieces(owner, curve) {
                let (direction, left) = curve.direction_and_left(LOOK_AT.mul_add(to - from, from));
                let (inner, outer) = (direction + left * BESIDE, direction - left * BESIDE);
                for probe in [inner, outer] {
                    self.note_places(probe, &mut places);
                }
                match owner {
                    None if self.hiders(inner, None).any(|body| !self.is_horizon(body)) => {
                        visible.is_outline_hidden = true;
                        visible.is_shadowed = true;
                    }
                    None if self.hiders(inner, None).next().is_some() => {}
                    None => visible.arcs.push((1.0, curve, [from, to])),
                    Some(body) if self.bounds_shadow(body, inner, outer) => {
                        visible.is_shadowed |= !self.is_horizon(body);
                        visible.arcs.push((-1.0, curve, [from, to]));
                    }
                    Some(_) => {}
                }
            }
        }
        if places.contains(&(true, true)) {
            return Err(DomainError::Interpenetrating);
        }
        Ok(visible)
    }

    fn is_horizon(&self, body: usize) -> bool {
        self.has_horizon && body == 0
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
        let mut ends = Vec::new();
        let mut cross = |limit: &Limit| ends.extend(curve.crossings(limit));
        if owner.is_some() {
            self.source.limits.iter().for_each(&mut cross);
        }
        for (body, seen) in self.hiding.iter().enumerate() {
            if owner != Some(body) {
                seen.limits.iter().for_each(&mut cross);
            }
        }
        self.levels.iter().for_each(&mut cross);
        ends.sort_by(f64::total_cmp);
        if let (true, Some(first)) = (curve.is_closed(), ends.first().copied()) {
            // Once round, from the first crossing to itself.
            ends.push(first + curve.turn());
        } else {
            ends.insert(0, curve.start());
            ends.push(curve.start() + curve.turn());
        }
        ends.windows(2).map(|pair| [pair[0], pair[1]]).filter(|[from, to]| from < to).collect()
    }

    /// The bodies in front of the source in a direction; of one body it is known that it is there.
    fn hiders(&self, direction: DVec3, known: Option<usize>) -> impl Iterator<Item = usize> {
        let far = self.source.distance(direction);
        self.hiding.iter().enumerate().filter_map(move |(body, seen)| {
            let near =
                if known == Some(body) { seen.reach(direction) } else { seen.distance(direction) };
            (near? < far?).then_some(body)
        })
    }

    /// Whether an arc of a body's outline bounds what is visible: through the source's inside, the one
    /// side hidden by this body, the other by none. Where outlines coincide, the first body's counts.
    fn bounds_shadow(&self, body: usize, inner: DVec3, outer: DVec3) -> bool {
        let is_open = self.source.distance(outer).is_some()
            && self.hiders(outer, None).all(|other| other == body);
        is_open && self.hiders(inner, Some(body)).next() == Some(body)
    }

    /// Whether the bodies are nearer or farther than the source, where both are seen and the
    /// difference is no rounding.
    fn note_places(&self, probe: DVec3, places: &mut [(bool, bool)]) {
        const ALIKE: f64 = 1e-9;
        let Some(far) = self.source.distance(probe) else { return };
        for (body, (in_front, behind)) in places.iter_mut().enumerate() {
            if self.is_horizon(body) {
                continue;
            }
            let Some(near) = self.hiding[body].distance(probe) else { continue };
            if (near - far).abs() > ALIKE * far {
                match near.partial_cmp(&far) {
                    Some(Ordering::Less) => *in_front = true,
                    Some(Ordering::Greater) => *behind = true,
                    _ => {}
                }
            }
        }
    }
}

impl Visible<'_> {
    /// Whether anything of the source is left.
    pub(super) fn is_any(&self) -> bool {
        !self.arcs.is_empty()
    }

    /// ½ ∮ n·((u - u₀) × du) over the arcs, in any order.
    pub(super) fn contour(
        &self,
        whole: f64,
        tolerance: Tolerance,
    ) -> Result<Estimate, EstimateError> {
        /// Of the tolerance, for each of the arcs' quadratures.
        const SHARE: f64 = 0.01;
        let absolute = SHARE * tolerance.allowed(whole);
        let lost = DomainError::Lost { result: "projected solid angle (sr)" };
        let (mut sum, mut magnitude) = (Sum::default(), 0.0);
        let (mut bound, mut evaluations) = (0.0, 0);
        for (sign, curve, ends) in &self.arcs {
            let arc = match curve.arc(*ends, &self.scene.view, absolute) {
                Err(EstimateError::Integrand { .. }) => return Err(lost.into()),
                other => other?,
            };
            sum.add(sign * arc.value);
            magnitude += arc.value.abs();
            bound += arc.error_bound;
            evaluations += arc.evaluations;
        }
        // Ends of arcs that should meet miss each other by a rounding of a direction.
        let rounding = 128.0 * f64::EPSILON * (magnitude + whole);
        let unseen = 4.0 * BESIDE * whole;
        let (value, error_bound) = (sum.value(), bound + rounding + unseen);
        if !(value + error_bound).is_finite() {
            return Err(lost.into());
        }
        Ok(Estimate { value, error_bound, evaluations })
    }
}

/// Where a source is as seen from the receiver, and how wide it looks about there, in radians. None if
/// it has no extent.
fn middle_and_extent(receiver: &Receiver, source: &Source) -> Option<(WideVec, f64)> {
    let round = |center: DVec3, radius: f64| {
        let middle = WideVec::difference(center, receiver.point_m());
        (radius > 0.0).then(|| (middle, radius / length(middle.to_vec())))
    };
    match source {
        Source::Disk(disk) => round(disk.center_m(), disk.radius_m()),
        Source::Sphere(sphere) => round(sphere.center_m(), sphere.radius_m()),
        Source::Polygon(polygon) => of_polygon(receiver, polygon),
    }
}

fn of_polygon(receiver: &Receiver, polygon: &Polygon) -> Option<(WideVec, f64)> {
    let relative = |vertex: &DVec3| WideVec::difference(*vertex, receiver.point_m()).to_vec();
    let corners: Vec<DVec3> = polygon.vertices().iter().map(relative).collect();
    let mean = corners.iter().sum::<DVec3>() / corners.len() as f64;
    let reach = corners.iter().map(|corner| length(*corner - mean)).fold(0.0, f64::max);
    let extent = reach / length(mean);
    if extent < 0.5 {
        return Some((WideVec::from_vec(mean), extent));
    }
    let directions = corners.iter().filter_map(|corner| normalised(*corner));
    let first = corners[0];
    let across = corners.windows(2).map(|pair| (pair[0] - first).cross(pair[1] - first));
    let middle = normalised(directions.sum()).or_else(|| normalised(across.sum()))?;
    Some((WideVec::from_vec(middle), 1.0))
}
