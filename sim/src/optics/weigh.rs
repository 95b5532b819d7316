//! What the finite beam amounts to in a region, and the cheapest form that gives it: no form at
//! all, rays, or cuts along outlines.
//!
//! The bound: 1 where an outline crosses the region, for with the axis on an outline a beam may
//! see all or half; exactly 0 where the widest footprint stays within even patches, or off all;
//! else the largest departure over rays that are spaced by a quarter of the beam's own angle and,
//! where outlines come near, stand as near to them as the region goes, with a margin.

use core::f64::consts::TAU;
use std::sync::Arc;

use glam::DVec2;
use radiometry::beam::{Beam, footprint};

use super::beams::{ByRays, OverPatches};
use super::{Axis, Optics, PointSampled};
use crate::Region;
use crate::compile::Setting;
use crate::field::{Field, OfPlace, Patch, Ray};

/// What sampling may miss of a supremum.
const MARGIN: f64 = 1.5;
/// Degrees of rules, cheapest first, and the one that they are compared with.
const DEGREES: [usize; 5] = [3, 5, 7, 9, 14];
const FINEST: usize = 20;
/// The degree of the pupil's rule that sees slivers of a beam.
const SLIVERS: usize = 25;
/// From here on a dozen points of the pupil tell as much.
const NO_SLIVER: f64 = 1e-2;
/// What even that may miss of a beam that reaches an outline: the outermost hundredth of the
/// pupil, which looks over it with less than a thousandth of the stop.
const SLIVER: f64 = 1e-9;
/// How much farther off than from the finest rule another rule may be next to outlines.
const OUTLINES: f64 = 2.0;
/// Of the field's landmarks at most, and rays elsewhere, of what is more than flat patches.
const LANDMARKS: usize = 400;
const ANYWHERE: u32 = 400;
/// Directions round the normal.
const AZIMUTHS: u32 = 32;
/// Polar angles at most.
const POLAR_MAX: f64 = 400.0;
/// How many of the strongest departures are looked at again with finer rules.
const WORST: usize = 8;

/// How the beam will be averaged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Form {
    /// By the rays of a rule of this degree.
    Rays(usize),
    /// Along outlines; the degree of the rule inside a patch and that of the pupil's.
    Patches(usize, usize),
}

impl Form {
    /// For a person.
    pub(crate) fn how(self, error: f64) -> String {
        let rays = |degree: usize| {
            let disk = radiometry::beam::disk_rule(degree).len();
            disk * disk
        };
        match self {
            Self::Rays(degree) => {
                format!(
                    "mean over {} rays of pupil and spot, error at most {error:.0e}",
                    rays(degree)
                )
            }
            Self::Patches(inside, pupil) => {
                let points = radiometry::beam::disk_rule(pupil).len();
                format!(
                    "where one patch fills the beam, its radiance (mean over {} rays if that goes \
                     with direction); across an outline, cut along it as {points} points of the \
                     pupil see it; error at most {error:.0e}",
                    rays(inside)
                )
            }
        }
    }
}

/// The finite beam, weighed.
#[derive(Debug)]
pub(crate) struct Weighed {
    /// Of |averaged - axis alone| / max(either, noise floor).
    pub(crate) bound: f64,
    /// What makes it so.
    pub(crate) fact: String,
    beam: Beam,
}

impl Weighed {
    pub(crate) fn new(setting: &Setting<'_>, beam: Beam) -> Self {
        let (bound, fact) = match setting.field.patches() {
            Some(patches) => over_patches(setting, &beam, &patches),
            // What has outlines anywhere is not looked through.
            None => (1.0, "what is seen is more than flat patches".to_owned()),
        };
        Self { bound: bound.min(1.0), fact, beam }
    }

    /// The cheapest form whose error stays within half the tolerance, as far as it can be had,
    /// and that error.
    pub(crate) fn form(&self, setting: &Setting<'_>) -> (Form, f64) {
        let Some(patches) = setting.field.patches() else {
            let rays = anywhere_rays(setting);
            let build = |degree| self.build(setting, Form::Rays(degree));
            // Next to an outline the finest rule is off as well, by less.
            let (degree, error) = cheapest(setting, &rays, build);
            return (Form::Rays(degree), error * OUTLINES);
        };
        let (mut inside, mut inside_error) = (DEGREES[0], 0.0_f64);
        for patch in patches.iter().filter(|patch| patch.uniform.is_none()) {
            let field = of_patch(setting, patch);
            let rays = inside_rays(setting, &self.beam, patch.is_round);
            let (degree, error) = cheapest(setting, &rays, |degree| {
                Arc::new(ByRays::new(Arc::clone(&field), self.beam, degree))
            });
            (inside, inside_error) = (inside.max(degree), inside_error.max(error));
        }
        let across = across_rays(setting, &self.beam, &patches);
        let build = |pupil| self.build(setting, Form::Patches(inside, pupil));
        let (pupil, error) = cheapest(setting, &across, build);
        (Form::Patches(inside, pupil), error.max(inside_error))
    }

    pub(crate) fn build(&self, setting: &Setting<'_>, form: Form) -> Arc<dyn Optics> {
        let field = &setting.field;
        match form {
            Form::Rays(degree) => Arc::new(ByRays::new(Arc::clone(field), self.beam, degree)),
            Form::Patches(inside, pupil) => {
                let patches = field.patches().unwrap_or_default();
                Arc::new(OverPatches::new(field, patches, self.beam, inside, pupil))
            }
        }
    }
}

fn over_patches(setting: &Setting<'_>, beam: &Beam, patches: &[Patch]) -> (f64, String) {
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
    let holding = patches.iter().find(|patch| patch.boundary.holds(place));
    if let Some(patch) = holding.filter(|patch| patch.uniform.is_none()) {
        let (field, rays) = (of_patch(setting, patch), inside_rays(setting, beam, patch.is_round));
        let optics = ByRays::new(Arc::clone(&field), *beam, DEGREES[1]);
        bound = largest(setting, &optics, &PointSampled(field), &rays);
        fact = String::from("radiance goes with direction within the beam");
    }
    if let Some(first) = near.first() {
        bound = bound.max(largest_across(setting, beam, patches));
        fact =
            format!("the footprint, up to {mm:.1} mm wide, reaches the outline of {}", first.name);
    }
    (bound, fact)
}

/// What leaves a patch, as if it had no end.
fn of_patch(setting: &Setting<'_>, patch: &Patch) -> Arc<dyn Field> {
    Arc::new(OfPlace { field: Arc::clone(&setting.field), place: patch.place.extend(0.0) })
}

/// How far the footprint of any direction of the region reaches, metres.
fn widest_m(beam: &Beam, theta_max_rad: f64) -> f64 {
    let footprint = footprint(beam, theta_max_rad).ok().flatten();
    footprint.map_or(f64::INFINITY, |footprint| footprint.radius_m())
}

/// The largest departure along some rays, with the margin.
fn largest(setting: &Setting<'_>, optics: &dyn Optics, point: &dyn Optics, rays: &[Ray]) -> f64 {
    let departures = rays.iter().map(|ray| departure(setting, optics, point, ray));
    MARGIN * departures.fold(0.0, f64::max)
}

/// The same over outlines, with so many points of the pupil that even a sliver of the beam is
/// seen. Where all of them see nothing, no more than that: a rim of the pupil that sees a little.
fn largest_across(setting: &Setting<'_>, beam: &Beam, patches: &[Patch]) -> f64 {
    let over = |pupil| OverPatches::new(&setting.field, patches.to_vec(), *beam, DEGREES[1], pupil);
    let point = PointSampled(Arc::clone(&setting.field));
    let rays = across_rays(setting, beam, patches);
    let coarse = largest(setting, &over(DEGREES[1]), &point, &rays);
    if coarse > NO_SLIVER {
        return coarse;
    }
    largest(setting, &over(SLIVERS), &point, &rays).max(SLIVER)
}

/// The rays of which `of` says most.
fn worst(rays: &[Ray], count: usize, of: impl Fn(&Ray) -> f64) -> Vec<&Ray> {
    let mut worst: Vec<(f64, &Ray)> = rays.iter().map(|ray| (of(ray), ray)).collect();
    worst.sort_by(|a, b| b.0.total_cmp(&a.0));
    worst.into_iter().take(count).map(|(_, ray)| ray).collect()
}

/// |a - b| / max(a, b, noise floor).
fn departure(setting: &Setting<'_>, a: &dyn Optics, b: &dyn Optics, ray: &Ray) -> f64 {
    let axis = Axis { spot: ray.point, direction: ray.direction };
    let (a, b) = (a.radiance(&axis), b.radiance(&axis));
    let reading = a.max(b).max(setting.floor);
    if reading > 0.0 { (a - b).abs() / reading } else { 0.0 }
}

/// The cheapest degree whose error is within half the tolerance on the worst of the rays, or the
/// best; and its error.
fn cheapest(
    setting: &Setting<'_>,
    rays: &[Ray],
    build: impl Fn(usize) -> Arc<dyn Optics>,
) -> (usize, f64) {
    let (coarse, finest) = (build(DEGREES[0]), build(FINEST));
    let point = PointSampled(Arc::clone(&setting.field));
    let worst = worst(rays, WORST, |ray| departure(setting, &*coarse, &point, ray));
    let mut best = (DEGREES[0], f64::INFINITY);
    for degree in DEGREES {
        let optics = build(degree);
        let errors = worst.iter().map(|ray| departure(setting, &*optics, &*finest, ray));
        let error = MARGIN * errors.fold(0.0, f64::max);
        if error <= setting.tolerance / 2.0 {
            return (degree, error);
        }
        if error < best.1 {
            best = (degree, error);
        }
    }
    best
}

/// Some of the field's landmarks, and rays at places and directions that lie in line with nothing: a
/// rule that is symmetric to an outline through the beam's middle has no error there.
fn anywhere_rays(setting: &Setting<'_>) -> Vec<Ray> {
    // Powers of the root of t⁵ = t + 1: evenly in four dimensions (Roberts 2018).
    const ROOT: f64 = 1.167_303_978_261_418_7;
    let Region { x_m, y_m, theta_max_rad } = setting.region;
    let landmarks = setting.field.landmarks(&setting.region);
    let every = landmarks.len().div_ceil(LANDMARKS).max(1);
    let mut rays: Vec<Ray> = landmarks.into_iter().step_by(every).collect();
    for i in 1..=ANYWHERE {
        let part = |k: i32| {
            let at = f64::from(i) * libm::pow(ROOT, -f64::from(k));
            at - libm::floor(at)
        };
        let between = |(low, high): (f64, f64), part: f64| low + part * (high - low);
        let (x, y) = (between(x_m, part(1)), between(y_m, part(2)));
        rays.push(Ray::new(x, y, theta_max_rad * libm::sqrt(part(3)), TAU * part(4)));
    }
    rays
}

/// From the region's middle into all its directions, a quarter of the beam's angle apart; into one
/// azimuth where all are alike.
fn inside_rays(setting: &Setting<'_>, beam: &Beam, is_round: bool) -> Vec<Ray> {
    let Region { x_m, y_m, theta_max_rad } = setting.region;
    let angle = (beam.pupil_radius_m() + beam.stop_radius_m()) / beam.separation_m();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most 400
    let polar = libm::ceil(theta_max_rad / (angle / 4.0)).clamp(1.0, POLAR_MAX) as u32;
    let (x, y) = (f64::midpoint(x_m.0, x_m.1), f64::midpoint(y_m.0, y_m.1));
    let azimuths = if is_round { 1 } else { AZIMUTHS };
    let mut rays = vec![Ray::new(x, y, 0.0, 0.0)];
    for i in 1..=polar {
        let theta = theta_max_rad * f64::from(i) / f64::from(polar);
        let ring = (0..azimuths).map(|j| TAU * f64::from(j) / f64::from(azimuths));
        rays.extend(ring.map(|phi| Ray::new(x, y, theta, phi)));
    }
    rays
}

/// From the places of the region nearest to outlines, leaning over them and away.
fn across_rays(setting: &Setting<'_>, beam: &Beam, patches: &[Patch]) -> Vec<Ray> {
    let Region { x_m, y_m, theta_max_rad } = setting.region;
    let reach = widest_m(beam, theta_max_rad);
    let clamped = |p: DVec2| DVec2::new(p.x.clamp(x_m.0, x_m.1), p.y.clamp(y_m.0, y_m.1));
    let corners = [(x_m.0, y_m.0), (x_m.1, y_m.0), (x_m.1, y_m.1), (x_m.0, y_m.1)];
    let mut rays = Vec::new();
    for patch in patches {
        let own = patch.boundary.points().into_iter().map(clamped);
        for place in own.chain(corners.map(DVec2::from)) {
            let edge = patch.boundary.nearest(place);
            if place.distance(edge) > reach {
                continue;
            }
            let lean = (place - edge).try_normalize().unwrap_or(DVec2::X).to_angle();
            for theta in [theta_max_rad, theta_max_rad / 2.0, 0.0] {
                // The footprint is longest away from the detector: over the edge if that leans
                // to the other side.
                let turns = [0.0, TAU / 8.0, TAU / 4.0, TAU / 2.0];
                let turns = if theta > 0.0 { &turns[..] } else { &turns[..1] };
                rays.extend(
                    turns.iter().map(|turn| Ray::new(place.x, place.y, theta, lean + turn)),
                );
            }
        }
    }
    rays
}
