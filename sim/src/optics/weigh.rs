//! What the finite beam amounts to in a region.
//!
//! The bound: 1 where an outline crosses the region, for with the axis on an outline a beam may
//! see all or half; exactly 0 where the widest footprint stays within even patches, or off all;
//! else the largest departure over rays that are spaced by a quarter of the beam's own angle and,
//! where outlines come near, stand as near to them as the region goes, with a margin; of what goes with
//! the place or has outlines above the plane, over places and directions of all the region, its details
//! and uphill from there.

use std::sync::Arc;

use glam::DVec2;
use radiometry::beam::Beam;

use super::beams::{ByDirections, Degrees};
use super::forms::{Form, MARGIN, Off, Seen, choose};
use super::poses::{across_rays, anywhere_rays, inside_rays, uphill, widest_m};
use super::{Axis, Optics, PointSampled};
use crate::Region;
use crate::compile::Setting;
use crate::field::{Field, Goes, OfPlace, Patch, Ray};

/// Degrees by which departures are judged.
const JUDGED: Degrees = Degrees { directions: 9, rays: (9, 3), pupil: 5, chords: (8, 4) };
/// Degrees over stop and pupil by which departures are sought anywhere, and by which slivers are.
const COARSE: (usize, usize) = (5, 3);
const FINE: (usize, usize) = (20, 5);
/// How many of the worst rays are climbed from, and how many are asked for slivers.
const CLIMBS: usize = 5;
const SLIVERS_SOUGHT: usize = 60;
/// What part of either, and of the rays, is looked at in slow fields.
const SLOW: usize = 4;
/// The degree of the pupil's rule that sees slivers of a beam.
const SLIVERS: usize = 25;
/// From here on a dozen points of the pupil tell as much.
const NO_SLIVER: f64 = 1e-2;
/// What even that may miss of a beam that reaches an outline: the outermost hundredth of the
/// pupil, which looks over it with less than a thousandth of the stop.
const SLIVER: f64 = 1e-9;

/// The finite beam, weighed.
#[derive(Debug)]
pub(crate) struct Weighed {
    /// Of |averaged - axis alone| / max(either, noise floor).
    pub(crate) bound: f64,
    /// What makes it so.
    pub(crate) fact: String,
    beam: Beam,
    seen: Seen,
}

impl Weighed {
    pub(crate) fn new(setting: &Setting<'_>, beam: Beam) -> Self {
        let seen = Seen::tabled(setting, &beam);
        let (bound, fact) = match setting.field.patches() {
            Some(patches) => over_patches(setting, &beam, &seen, &patches),
            None => (
                anywhere(setting, &beam, &seen),
                "what is seen, more than flat patches, goes with place and direction".to_owned(),
            ),
        };
        Self { bound: bound.min(1.0), fact, beam, seen }
    }

    /// The cheapest form whose error stays within half the tolerance, as far as it can be had,
    /// and that error.
    pub(crate) fn form(&self, setting: &Setting<'_>) -> (Form, Off) {
        choose(setting, self.beam, &self.seen)
    }

    /// `is_whole`: whether all is in that the light of the scene calls for.
    pub(crate) fn build(
        &self,
        setting: &Setting<'_>,
        form: Form,
        is_whole: bool,
    ) -> Arc<dyn Optics> {
        self.seen.again(setting, is_whole).build(self.beam, form)
    }
}

fn over_patches(
    setting: &Setting<'_>,
    beam: &Beam,
    seen: &Seen,
    patches: &[Patch],
) -> (f64, String) {
    let Region { x_m, y_m, theta_max_rad } = setting.region;
    let reach = widest_m(beam, theta_max_rad);
    let distance = |patch: &Patch| patch.boundary.distance_to_rectangle(x_m, y_m);
    if let Some(crossing) = patches.iter().find(|patch| distance(patch) <= 0.0) {
        return (1.0, format!("the outline of {} crosses the region", crossing.name));
    }
    let near: Vec<&Patch> = patches.iter().filter(|patch| distance(patch) <= reach).collect();
    let mm = reach * 1e3;
    let mut bound = 0.0_f64;
    let mut fact = format!("the footprint, up to {mm:.1} mm wide, stays within even patches");
    let place = DVec2::new(x_m.0, y_m.0);
    // No outline crosses the region: one patch at most holds all of it.
    let holding = patches.iter().enumerate().find(|(_, patch)| patch.boundary.holds(place));
    match holding.map(|(i, patch)| (i, patch, patch.goes)) {
        Some((i, patch, Goes::WithDirection { is_round })) => {
            let (field, rays) = (of_patch(setting, i, patch), inside_rays(setting, beam, is_round));
            let directions = beam.directions(JUDGED.directions);
            let optics = ByDirections { field: Arc::clone(&field), directions };
            bound = largest(setting, &optics, &PointSampled(field), &rays);
            fact = String::from("radiance goes with direction within the beam");
        }
        Some((_, _, Goes::WithPlace | Goes::WithBoth)) => {
            bound = anywhere(setting, beam, seen);
            fact = String::from("radiance goes with the place within the beam");
        }
        Some((_, _, Goes::Even(_))) | None => {}
    }
    if let Some(first) = near.first() {
        // What is slow is not looked at over outlines: all of it may be behind one.
        let is_slow = setting.field.is_slow();
        let across = if is_slow { 1.0 } else { largest_across(setting, beam, seen, patches) };
        bound = bound.max(across);
        fact =
            format!("the footprint, up to {mm:.1} mm wide, reaches the outline of {}", first.name);
    }
    (bound, fact)
}

/// The largest departure over all the region, its details and uphill from the worst; of what has outlines
/// anywhere, with so many rays that a sliver is seen.
fn anywhere(setting: &Setting<'_>, beam: &Beam, seen: &Seen) -> f64 {
    let point = PointSampled(Arc::clone(&seen.field));
    let part = if setting.field.is_slow() { SLOW } else { 1 };
    let mut rays = anywhere_rays(setting);
    rays.extend(setting.field.details(&setting.region).into_iter().step_by(part));
    let by = |(stop, pupil)| seen.build(*beam, Form::Rays(stop, pupil));
    let coarse = by(COARSE);
    let off = |ray: &Ray| departure(setting, &*coarse, &point, ray);
    let mut tried: Vec<(f64, &Ray)> = rays.iter().map(|ray| (off(ray), ray)).collect();
    tried.sort_by(|a, b| b.0.total_cmp(&a.0));
    let climbs = CLIMBS.div_ceil(part);
    let found = tried.iter().take(climbs).map(|(_, ray)| uphill(setting, ray, &off));
    let found = found.fold(0.0, f64::max);
    if found > NO_SLIVER {
        return MARGIN * found;
    }
    let fine = by(FINE);
    let every = rays.len().div_ceil(SLIVERS_SOUGHT / part).max(1);
    let some = tried.iter().take(climbs).chain(tried.iter().step_by(every));
    let fine = some.map(|(_, ray)| departure(setting, &*fine, &point, ray)).fold(found, f64::max);
    MARGIN * fine
}

/// What leaves a patch, as if it had no end.
pub(super) fn of_patch(setting: &Setting<'_>, i: usize, patch: &Patch) -> Arc<dyn Field> {
    let place = patch.place.extend(0.0);
    Arc::new(OfPlace { field: Arc::clone(&setting.field), patch: i, place })
}

/// The largest departure along some rays, with the margin.
fn largest(setting: &Setting<'_>, optics: &dyn Optics, point: &dyn Optics, rays: &[Ray]) -> f64 {
    let departures = rays.iter().map(|ray| departure(setting, optics, point, ray));
    MARGIN * departures.fold(0.0, f64::max)
}

/// The same over outlines, with so many points of the pupil that even a sliver of the beam is
/// seen. Where all of them see nothing, no more than that: a rim of the pupil that sees a little.
fn largest_across(setting: &Setting<'_>, beam: &Beam, seen: &Seen, patches: &[Patch]) -> f64 {
    let over = |pupil| seen.build(*beam, Form::Patches(Degrees { pupil, ..JUDGED }, 0));
    let point = PointSampled(Arc::clone(&seen.field));
    let rays = across_rays(setting, beam, patches);
    let coarse = largest(setting, &*over(JUDGED.pupil), &point, &rays);
    if coarse > NO_SLIVER {
        return coarse;
    }
    largest(setting, &*over(SLIVERS), &point, &rays).max(SLIVER)
}

/// |a - b| / max(a, b, noise floor).
pub(super) fn departure(setting: &Setting<'_>, a: &dyn Optics, b: &dyn Optics, ray: &Ray) -> f64 {
    let axis = Axis { spot: ray.point, direction: ray.direction };
    let (a, b) = (a.radiance(&axis), b.radiance(&axis));
    let reading = a.max(b).max(setting.floor);
    if reading > 0.0 { (a - b).abs() / reading } else { 0.0 }
}
