//! Axes at which a beam is tried: over a region and all its directions, near outlines, at the field's
//! landmarks, and uphill from the best of them. It does not know what is tried there.

use core::f64::consts::TAU;

use glam::DVec2;
use radiometry::beam::{Beam, footprint};
use radiometry::direction::angles;

use crate::Region;
use crate::compile::Setting;
use crate::field::{Patch, Ray};

/// Of the field's landmarks at most, and rays elsewhere.
const LANDMARKS: usize = 400;
const ANYWHERE: u32 = 400;
/// What part of either is looked at in slow fields.
const SLOW: u32 = 5;
/// Directions round the normal.
const AZIMUTHS: u32 = 32;
/// Parts of the region that a climb begins and ends with.
const STEPS: (f64, f64) = (0.1, 1e-4);
/// Polar angles at most.
const POLAR_MAX: f64 = 400.0;

/// How far the footprint of any direction of the region reaches, metres.
pub(super) fn widest_m(beam: &Beam, theta_max_rad: f64) -> f64 {
    let footprint = footprint(beam, theta_max_rad).ok().flatten();
    footprint.map_or(f64::INFINITY, |footprint| footprint.radius_m())
}

/// Some of the field's landmarks, and rays at places and directions that lie in line with nothing: a
/// rule that is symmetric to an outline through the beam's middle has no error there.
pub(super) fn anywhere_rays(setting: &Setting<'_>) -> Vec<Ray> {
    // Powers of the root of t⁵ = t + 1: evenly in four dimensions (Roberts 2018).
    const ROOT: f64 = 1.167_303_978_261_418_7;
    let Region { x_m, y_m, theta_max_rad } = setting.region;
    let landmarks = setting.field.landmarks(&setting.region);
    let part = if setting.field.is_slow() { SLOW } else { 1 };
    let every = landmarks.len().div_ceil(LANDMARKS / part as usize).max(1);
    let mut rays: Vec<Ray> = landmarks.into_iter().step_by(every).collect();
    for i in 1..=ANYWHERE / part {
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

/// Uphill from a ray within the region, by ever finer steps: the largest that `of` says there.
pub(super) fn uphill(setting: &Setting<'_>, from: &Ray, of: &dyn Fn(&Ray) -> f64) -> f64 {
    let Region { x_m, y_m, theta_max_rad } = setting.region;
    let (theta, phi) = angles(from.direction);
    let mut at = [from.point.x, from.point.y, theta, phi];
    let spans = [x_m.1 - x_m.0, y_m.1 - y_m.0, theta_max_rad, TAU / 2.0];
    let ray = |at: &[f64; 4]| Ray::new(at[0], at[1], at[2], at[3]);
    let (mut best, mut part) = (of(from), STEPS.0);
    while part > STEPS.1 {
        let mut has_risen = false;
        for (k, span) in spans.iter().enumerate() {
            for step in [part * span, -part * span] {
                let mut next = at;
                next[k] += step;
                next[0] = next[0].clamp(x_m.0, x_m.1);
                next[1] = next[1].clamp(y_m.0, y_m.1);
                next[2] = next[2].clamp(0.0, theta_max_rad);
                let found = of(&ray(&next));
                if found > best {
                    (best, at, has_risen) = (found, next, true);
                }
            }
        }
        if !has_risen {
            part /= 3.0;
        }
    }
    best
}

/// From the region's middle into all its directions, a quarter of the beam's angle apart; into one
/// azimuth where all are alike.
pub(super) fn inside_rays(setting: &Setting<'_>, beam: &Beam, is_round: bool) -> Vec<Ray> {
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
pub(super) fn across_rays(setting: &Setting<'_>, beam: &Beam, patches: &[Patch]) -> Vec<Ray> {
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
                // to the other side. What leaves the patch need not be alike on both sides.
                let turns = [0.0, 0.125, 0.25, 0.5, 0.75, 0.875].map(|part| part * TAU);
                let turns = if theta > 0.0 { &turns[..] } else { &turns[..1] };
                rays.extend(
                    turns.iter().map(|turn| Ray::new(place.x, place.y, theta, lean + turn)),
                );
            }
        }
    }
    rays
}
