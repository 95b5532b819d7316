//! How much an error of the mechanics changes a reading at most: tried out, at poses over the
//! region and at those where the field changes most.
//!
//! What is tried is the radiance along the detector's axis, which changes no less than the mean
//! over a beam around it. Poses: a grid over the region with its corners and largest θ, the
//! field's own landmarks, and from the worst of them a search downhill of ever finer steps. An
//! outline is found between neighbouring poses of scans and closed in upon, and poses are tried
//! that the error carries across it. What still may be missed is in the margin.

use core::f64::consts::{PI, TAU};

use super::geometry::{Kinematics, Perfect};
use crate::Region;
use crate::compile::Setting;
use crate::field::Ray;
use crate::optics::Axis;

/// What trying may miss of a supremum.
const MARGIN: f64 = 1.5;
/// Places that the grid has along each side of the region, polar angles and azimuths.
const PLACES: u32 = 3;
const POLAR: u32 = 8;
const AZIMUTHS: u32 = 8;
/// Landmarks of the field's own that are tried.
const LANDMARKS: usize = 200;
/// Emitters whose brightest poses are.
const PEAKS: usize = 64;
/// Steps of a scan for outlines, and outlines that are kept.
const SCAN: u32 = 48;
const OUTLINES: usize = 256;
/// From how many poses the search goes on, and how often its steps are halved.
const STARTS: usize = 6;
const HALVINGS: u32 = 12;
/// Two readings that differ by more than this may have an outline between them.
const JUMP: f64 = 0.5;
/// So many halvings close in on an outline to 1e-12 of the scan's step.
const CLOSING: u32 = 40;

/// θ, φ, x, y; radians and metres.
pub(super) type Joints = [f64; 4];

/// Where the detector stands with an error; several, over which a reading averages.
pub(super) type Departing<'d> = &'d dyn Fn(Joints) -> Vec<Axis>;

/// Poses at which errors are tried.
pub(super) struct Trials<'s> {
    setting: &'s Setting<'s>,
    poses: Vec<Joints>,
    /// On outlines, with the joint along which they are crossed.
    outlines: Vec<(Joints, usize)>,
}

impl<'s> Trials<'s> {
    pub(super) fn new(setting: &'s Setting<'s>) -> Self {
        let mut poses = grid(&setting.region);
        let landmarks = setting.field.landmarks(&setting.region);
        let stride = landmarks.len().div_ceil(LANDMARKS).max(1);
        poses.extend(landmarks.iter().step_by(stride).map(joints));
        let radiance = |ray: &&Ray| setting.field.radiance(ray);
        let brightest = landmarks.iter().max_by(|a, b| radiance(a).total_cmp(&radiance(b)));
        let bright: Vec<Joints> = brightest.map(joints).into_iter().chain(peaks(setting)).collect();
        poses.extend(&bright);
        // The arm comes to every direction from either side of the zenith.
        let beyond: Vec<Joints> = poses.iter().map(|[t, p, x, y]| [-t, p - PI, *x, *y]).collect();
        let mut trials = Self { setting, poses, outlines: Vec::new() };
        trials.find_outlines(&bright);
        trials.poses.extend(beyond);
        trials
    }

    /// Bound on |with - without| / max(either, noise floor) over the region, for the worst of
    /// some errors.
    pub(super) fn largest(&self, errors: &[Departing<'_>]) -> f64 {
        let of = errors.iter().map(|departing| self.largest_of(*departing));
        (MARGIN * of.fold(0.0, f64::max)).min(1.0)
    }

    fn largest_of(&self, departing: Departing<'_>) -> f64 {
        let influence = |pose: &Joints| self.influence(*pose, departing);
        let mut tried: Vec<(f64, Joints)> =
            self.poses.iter().map(|pose| (influence(pose), *pose)).collect();
        for (outline, joint) in &self.outlines {
            tried.extend(self.across(*outline, *joint, departing));
        }
        tried.sort_by(|a, b| b.0.total_cmp(&a.0));
        let worst = tried.first().map_or(0.0, |(influence, _)| *influence);
        if worst >= 1.0 || worst == 0.0 {
            return worst;
        }
        let found = tried.iter().take(STARTS).map(|start| self.search(*start, departing));
        found.fold(worst, f64::max)
    }

    /// Goes to where the influence is larger, by steps that halve.
    fn search(&self, (mut best, mut pose): (f64, Joints), departing: Departing<'_>) -> f64 {
        let Region { x_m, y_m, theta_max_rad } = self.setting.region;
        let mut steps = [
            theta_max_rad / f64::from(POLAR),
            TAU / f64::from(AZIMUTHS),
            (x_m.1 - x_m.0) / f64::from(PLACES),
            (y_m.1 - y_m.0) / f64::from(PLACES),
        ];
        for _ in 0..HALVINGS {
            for joint in 0..4 {
                for sign in [-1.0, 1.0] {
                    let mut to = pose;
                    to[joint] += sign * steps[joint];
                    let influence = self.influence(to, departing);
                    if influence > best {
                        (best, pose) = (influence, to);
                    }
                }
            }
            steps = steps.map(|step| step / 2.0);
        }
        best
    }

    /// At poses that the error may carry across an outline.
    fn across(
        &self,
        outline: Joints,
        joint: usize,
        departing: Departing<'_>,
    ) -> Vec<(f64, Joints)> {
        let size = displacement(outline, joint, departing);
        let parts = [-0.98, -0.5, -0.02, 0.02, 0.5, 0.98];
        let mut tried = Vec::new();
        if size > 0.0 {
            for part in parts {
                let mut pose = outline;
                pose[joint] += part * size;
                tried.push((self.influence(pose, departing), pose));
            }
        }
        tried
    }

    fn influence(&self, pose: Joints, departing: Departing<'_>) -> f64 {
        if !self.is_inside(pose) {
            return 0.0;
        }
        let without = self.seen(&Perfect.seen(pose));
        let axes = departing(pose);
        let sum: f64 = axes.iter().map(|axis| self.seen(axis)).sum();
        self.departure(sum / axes.len().max(1) as f64, without)
    }

    fn departure(&self, a: f64, b: f64) -> f64 {
        let reading = a.max(b).max(self.setting.floor);
        if reading > 0.0 { (a - b).abs() / reading } else { 0.0 }
    }

    fn seen(&self, axis: &Axis) -> f64 {
        let ray = Ray::through(axis.spot, axis.direction);
        ray.map_or(0.0, |ray| self.setting.field.radiance(&ray))
    }

    fn is_inside(&self, [theta, _, x, y]: Joints) -> bool {
        let Region { x_m, y_m, theta_max_rad } = self.setting.region;
        let within = |value: f64, (low, high): (f64, f64)| (low..=high).contains(&value);
        theta.abs() <= theta_max_rad && within(x, x_m) && within(y, y_m)
    }

    fn find_outlines(&mut self, bright: &[Joints]) {
        let Region { x_m, y_m, theta_max_rad } = self.setting.region;
        let spans = [(0.0, theta_max_rad), (-PI, PI), x_m, y_m];
        let mut through = bright.to_vec();
        let slanted = theta_max_rad / 2.0;
        for (x, y) in places(&self.setting.region) {
            through.extend([[0.0, 0.0, x, y], [slanted, 1.0, x, y], [slanted, -2.0, x, y]]);
        }
        for pose in through {
            for (joint, span) in spans.into_iter().enumerate() {
                self.scan(pose, joint, span);
            }
        }
    }

    fn scan(&mut self, pose: Joints, joint: usize, (low, high): (f64, f64)) {
        let at = |value: f64| {
            let mut pose = pose;
            pose[joint] = value;
            pose
        };
        let seen = |value: f64| self.seen(&Perfect.seen(at(value)));
        // The pose itself is one of the steps: it may stand on something smaller than a step.
        let step = |i: u32| low + (high - low) * f64::from(i) / f64::from(SCAN);
        let mut steps: Vec<f64> = (0..=SCAN).map(step).chain([pose[joint]]).collect();
        steps.sort_by(f64::total_cmp);
        let mut found = Vec::new();
        for pair in steps.windows(2) {
            let (mut a, mut b) = (pair[0], pair[1]);
            let (mut of_a, mut of_b) = (seen(a), seen(b));
            if self.departure(of_a, of_b) < JUMP {
                continue;
            }
            for _ in 0..CLOSING {
                let middle = f64::midpoint(a, b);
                let of_middle = seen(middle);
                // Towards the side of the larger jump.
                if self.departure(of_a, of_middle) > self.departure(of_middle, of_b) {
                    (b, of_b) = (middle, of_middle);
                } else {
                    (a, of_a) = (middle, of_middle);
                }
            }
            if self.departure(of_a, of_b) > JUMP / 2.0 {
                found.push((at(f64::midpoint(a, b)), joint));
            }
        }
        self.outlines.extend(found);
        self.outlines.truncate(OUTLINES);
    }
}

/// Where each flat emitter is brightest.
fn peaks(setting: &Setting<'_>) -> Vec<Joints> {
    let Region { x_m, y_m, theta_max_rad } = setting.region;
    let emitters = setting.scene.emitters().iter();
    let peaks = emitters.filter_map(|emitter| {
        let (x, y, _) = emitter.brightest_within(x_m, y_m)?;
        let (_, theta, phi) = emitter.peak_within(theta_max_rad)?;
        Some([theta, phi, x, y])
    });
    peaks.take(PEAKS).collect()
}

/// By how much an error displaces the ray, in the unit of a joint that would displace it so.
fn displacement(pose: Joints, joint: usize, departing: Departing<'_>) -> f64 {
    let Some(without) = through(&Perfect.seen(pose)) else { return 0.0 };
    let sizes = departing(pose).into_iter().filter_map(|axis| through(&axis)).map(|with| {
        if joint >= 2 {
            return (with.point - without.point).length();
        }
        let angle = (with.direction - without.direction).length();
        if joint == 0 { angle } else { angle / libm::sin(pose[0]).abs().max(1e-3) }
    });
    sizes.fold(0.0, f64::max)
}

fn through(axis: &Axis) -> Option<Ray> {
    Ray::through(axis.spot, axis.direction)
}

/// The joints of a perfect rig whose detector's axis is a ray.
fn joints(ray: &Ray) -> Joints {
    let direction = ray.direction;
    let theta = libm::atan2(libm::hypot(direction.x, direction.y), direction.z);
    [theta, libm::atan2(direction.y, direction.x), ray.point.x, ray.point.y]
}

fn places(region: &Region) -> Vec<(f64, f64)> {
    let between =
        |(low, high): (f64, f64), i: u32| low + (high - low) * f64::from(i) / f64::from(PLACES - 1);
    let all = 0..PLACES * PLACES;
    all.map(|i| (between(region.x_m, i / PLACES), between(region.y_m, i % PLACES))).collect()
}

fn grid(region: &Region) -> Vec<Joints> {
    let mut poses = Vec::new();
    for (x, y) in places(region) {
        poses.push([0.0, 0.0, x, y]);
        for i in 1..=POLAR {
            let theta = region.theta_max_rad * f64::from(i) / f64::from(POLAR);
            let ring = (0..AZIMUTHS).map(|j| TAU * f64::from(j) / f64::from(AZIMUTHS) - PI);
            poses.extend(ring.map(|phi| [theta, phi, x, y]));
        }
    }
    poses
}
