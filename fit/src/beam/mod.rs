//! What a reading says of the field: not the radiance along one ray but its mean over a beam,
//! (1/T) ∫ L dT over all rays through pupil and spot, zero off the sample. A row of the design is
//! the basis averaged so. It does not know which reading deserves which rule: that is [`design`].
//!
//! Beyond the region the position polynomials go on, out to twice its half width (splines end with
//! it), and are constant from there: nothing was measured there, and they must not run away with a footprint that near
//! grazing is longer than any sample. Below the horizon nothing is seen: rays from there are zero.

mod bound;
mod cut;
pub(crate) mod design;
mod directions;
mod lens;
mod moments;
mod outline;
mod sight;
mod way;

use glam::DVec3;
use radiometry::beam::{Beam, footprint};

use crate::basis::{Basis, Scratch, SecondPlane};
use crate::{Chart, FitError, Ray};
use bound::Bound;
use cut::{Cuts, Cutter};
use directions::{Directions, Node};
use moments::Moments;
use sight::{Shear, Sight};

pub use outline::Outline;

/// What the detector sees of the sample: its beam, and where the sample ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Optics {
    /// The beam; its origin is the reading's place on the sample.
    pub beam: Beam,
    /// Beyond it the radiance is zero. `None`: the field goes on over the whole footprint.
    pub outline: Option<Outline>,
}

impl Optics {
    /// Whether a beam along this ray may reach beyond the sample: the rectangle around its
    /// footprint does. Never where no outline is known.
    pub fn reaches_beyond(&self, ray: &Ray) -> bool {
        let Some(outline) = &self.outline else { return false };
        corners(&self.beam, ray)
            .is_none_or(|corners| !corners.iter().all(|(x, y)| outline.holds(*x, *y)))
    }
}

/// The corners of a rectangle around the beam's footprint, on the sample; `None` where some ray
/// never meets its plane.
fn corners(beam: &Beam, ray: &Ray) -> Option<[(f64, f64); 4]> {
    let theta = ray.theta_rad.clamp(0.0, core::f64::consts::FRAC_PI_2);
    let reach = footprint(beam, theta).ok().flatten()?;
    let (sight, y) = (Sight::new(ray, Chart::Surface), reach.across_m);
    let corners = [(-reach.far_m, -y), (-reach.far_m, y), (reach.near_m, -y), (reach.near_m, y)];
    Some(corners.map(|corner| sight.place(corner)))
}

/// Where a beam's footprint lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cover {
    /// On the sample, as far as the basis goes.
    Within,
    /// Across the outline, the horizon, or the end of the position polynomials.
    Across,
    /// Off the sample.
    Off,
}

/// Averages a basis over beams.
#[derive(Debug, Clone)]
pub(crate) struct Averager {
    optics: Optics,
    chart: Chart,
    /// `None` of a basis for which rules are compared instead.
    bound: Option<Bound>,
    /// By rising degree.
    smooth: Vec<Directions>,
    /// The same, for beams that something cuts.
    across: Vec<Directions>,
    cutter: Cutter,
    /// Where the position polynomials end, by axis (true: x), for axes that they vary along.
    ends: Vec<(bool, (f64, f64))>,
}

impl Averager {
    pub(crate) fn new(optics: &Optics, basis: &Basis) -> Result<Self, FitError> {
        if let Some(outline) = &optics.outline {
            outline.check()?;
        }
        let region = basis.region();
        let is_wide = |(from, to): (f64, f64)| to > from;
        let is_even = !is_wide(region.x_m) && !is_wide(region.y_m);
        let degree = if is_even { 0 } else { basis.places().rule_degree() };
        // Of functions of the second plane as well.
        let degree = degree + basis.directions().second_plane().map_or(0, SecondPlane::degree);
        let beam = &optics.beam;
        let smooth = SMOOTH_DEGREES.iter().map(|d| Directions::smooth(beam, *d, degree));
        let breaks = breaks_of_object(optics, region.chart);
        let across = ACROSS_DEGREES.iter().map(|d| Directions::kinked(beam, *d, degree, &breaks));
        let axes = [(true, region.x_m), (false, region.y_m)];
        let limit = basis.places().continued();
        let ends = axes.into_iter().filter(|(_, axis)| degree > 0 && is_wide(*axis));
        Ok(Self {
            optics: *optics,
            chart: region.chart,
            bound: Bound::new(&optics.beam, basis),
            smooth: smooth.collect(),
            across: across.collect(),
            cutter: Cutter::new(degree),
            ends: ends.map(|(is_x, axis)| (is_x, continued(axis, limit))).collect(),
        })
    }

    /// Where the footprint of a beam along this ray lies.
    fn cover(&self, ray: &Ray) -> Cover {
        match self.chart {
            Chart::Surface | Chart::TwoPlane { .. } => corners(&self.optics.beam, ray)
                .map_or(Cover::Across, |corners| self.cover_of(&corners)),
            Chart::Environment => Cover::Within,
            Chart::Perpendicular { .. } => self.cover_across(ray),
        }
    }

    /// The same where each direction has a plane of its own. All rays come as near to the axis's
    /// place as the beam reaches, and lean no more than its slope; planes turn, distances from the
    /// origin don't.
    fn cover_across(&self, ray: &Ray) -> Cover {
        let beam = &self.optics.beam;
        let reach_m = beam.reach_m(0.0);
        let slope = (beam.stop_radius_m() + beam.pupil_radius_m()) / beam.separation_m();
        let place_m = libm::hypot(ray.x_m, ray.y_m);
        let nearest_m = (place_m - reach_m).max(0.0) / libm::hypot(1.0, slope);
        let farthest_m = place_m + reach_m;
        let ends = self.ends.iter().map(|(_, (low, high))| low.abs().min(high.abs()));
        let is_beyond_ends = farthest_m > ends.fold(f64::INFINITY, f64::min);
        match self.optics.outline {
            Some(Outline::Disk { centre_m: (0.0, 0.0), radius_m }) if nearest_m > radius_m => {
                Cover::Off
            }
            Some(Outline::Disk { centre_m: (0.0, 0.0), radius_m })
                if farthest_m <= radius_m && !is_beyond_ends =>
            {
                Cover::Within
            }
            None if !is_beyond_ends => Cover::Within,
            _ => Cover::Across,
        }
    }

    /// Where the convex hull of places lies.
    fn cover_of(&self, places: &[(f64, f64)]) -> Cover {
        let is_beyond = |(is_x, (low, high)): &(bool, (f64, f64))| {
            let at = |(x, y): &(f64, f64)| if *is_x { *x } else { *y };
            places.iter().any(|place| at(place) < *low || at(place) > *high)
        };
        match &self.optics.outline {
            Some(outline) if outline.misses(places) => Cover::Off,
            Some(outline) if !places.iter().all(|(x, y)| outline.holds(*x, *y)) => Cover::Across,
            _ if self.ends.iter().any(is_beyond) => Cover::Across,
            _ => Cover::Within,
        }
    }

    /// The basis averaged over a beam that nothing cuts.
    fn smooth_row(
        &self,
        rule: &Directions,
        ray: &Ray,
        basis: &Basis,
        scratch: &mut Means,
        out: &mut [f64],
    ) {
        if !self.row_of_moments(rule, ray, basis, scratch, out) {
            self.row_of_places(rule, ray, basis, scratch, out);
        }
    }

    /// The same, place by place.
    fn row_of_places(
        &self,
        rule: &Directions,
        ray: &Ray,
        basis: &Basis,
        scratch: &mut Means,
        out: &mut [f64],
    ) {
        out.fill(0.0);
        let sight = Sight::new(ray, self.chart);
        for node in &rule.nodes {
            let Some(direction) = sight.direction(node.slope) else { continue };
            let shear = sight.shear(&self.optics.beam, node);
            scratch.aim(direction);
            self.whole(rule, node, (&sight, &shear), basis, scratch);
            scratch.direction_along(direction, basis);
            scratch.add(node.weight, out);
        }
    }

    /// The position terms' mean over all rays of a direction.
    fn whole(
        &self,
        rule: &Directions,
        node: &Node,
        (sight, shear): (&Sight, &Shear),
        basis: &Basis,
        scratch: &mut Means,
    ) {
        if self.ends.is_empty() && !basis.is_joint() {
            scratch.add_place(1.0, basis, (0.0, 0.0));
            return;
        }
        for place in &rule.rings[node.ring].places {
            let s1 = place.along * node.cos - place.across * node.sin;
            let s2 = place.along * node.sin + place.across * node.cos;
            scratch.add_place(place.weight, basis, sight.place(shear.place((s1, s2))));
        }
    }

    /// The basis averaged over a beam that something cuts.
    fn across_row(
        &self,
        rule: &Directions,
        ray: &Ray,
        basis: &Basis,
        scratch: &mut Means,
        out: &mut [f64],
    ) {
        out.fill(0.0);
        let (sight, beam) = (Sight::new(ray, self.chart), &self.optics.beam);
        for node in &rule.nodes {
            let Some(direction) = sight.direction(node.slope) else { continue };
            let shear = sight.shear(beam, node);
            scratch.aim(direction);
            let ring = &rule.rings[node.ring];
            let (low, high) = ring.lens.box_of(node.cos, node.sin);
            let corners = [(low.0, low.1), (low.0, high.1), (high.0, low.1), (high.0, high.1)];
            let corners = corners.map(|corner| sight.place(shear.place(corner)));
            let is_above = !sight.has_horizon()
                || beam.pupil_z_m() * sight.cos
                    > (high.0 + beam.separation_m() * node.slope.0) * sight.sin;
            match self.cover_of(&corners) {
                Cover::Off => continue,
                Cover::Within if is_above => {
                    self.whole(rule, node, (&sight, &shear), basis, scratch);
                }
                Cover::Within | Cover::Across => {
                    let outline = self.optics.outline.as_ref();
                    let cuts = Cuts::new(&sight, &shear, beam, node, outline, &self.ends);
                    self.cutter.places(ring, node, &shear, &cuts, |place, weight| {
                        scratch.add_place(weight, basis, sight.place(shear.place(place)));
                    });
                }
            }
            scratch.direction_along(direction, basis);
            scratch.add(node.weight, out);
        }
    }
}

/// Scratch of one average: the position terms' mean over places, and the functions of direction; and
/// what averages before have found out.
#[derive(Debug)]
pub(crate) struct Means {
    place: Scratch,
    position: Vec<f64>,
    direction: Vec<f64>,
    /// Of local functions those that may not be zero, instead of all.
    near: Option<Vec<(usize, f64)>>,
    /// Of functions that are no product: the row's mean over the places of one direction, and room.
    joint: Option<(Vec<f64>, Vec<f64>)>,
    towards: DVec3,
    moments: Moments,
}

impl Means {
    pub(crate) fn new(basis: &Basis) -> Self {
        Self {
            place: basis.scratch(),
            position: vec![0.0; basis.position_len()],
            direction: vec![0.0; basis.angular_len()],
            near: basis.directions().local().map(|_| Vec::new()),
            joint: basis.is_joint().then(|| (vec![0.0; basis.len()], vec![0.0; basis.len()])),
            towards: DVec3::Z,
            moments: Moments::default(),
        }
    }

    /// Begins with another direction.
    fn aim(&mut self, towards: DVec3) {
        self.towards = towards;
        self.clear();
    }

    fn direction_along(&mut self, direction: DVec3, basis: &Basis) {
        if self.joint.is_some() {
            return;
        }
        match (&mut self.near, basis.directions().local()) {
            (Some(near), Some(splines)) => {
                near.clear();
                splines.each_along(direction, |j, value| near.push((j, value)));
            }
            _ => basis.direction_along(direction, &mut self.place, &mut self.direction),
        }
    }

    fn clear(&mut self) {
        self.position.fill(0.0);
        if let Some((mean, _)) = &mut self.joint {
            mean.fill(0.0);
        }
    }

    fn add_place(&mut self, weight: f64, basis: &Basis, (x_m, y_m): (f64, f64)) {
        if let Some((mean, row)) = &mut self.joint {
            basis.row_from((x_m, y_m), self.towards, &mut self.place, row);
            mean.iter_mut().zip(row).for_each(|(mean, value)| *mean += weight * *value);
            return;
        }
        // The constant needs no place.
        if let [mean] = &mut self.position[..] {
            *mean += weight;
            return;
        }
        basis.position_continued(x_m, y_m, &mut self.place);
        for (mean, term) in self.position.iter_mut().zip(self.place.position()) {
            *mean += weight * term;
        }
    }

    fn add(&self, weight: f64, out: &mut [f64]) {
        if let Some((mean, _)) = &self.joint {
            out.iter_mut().zip(mean).for_each(|(out, mean)| *out += weight * mean);
            return;
        }
        for (mean, block) in self.position.iter().zip(out.chunks_exact_mut(self.direction.len())) {
            let factor = weight * mean;
            if let Some(near) = &self.near {
                for (j, z) in near {
                    block[*j] += factor * z;
                }
                continue;
            }
            block.iter_mut().zip(&self.direction).for_each(|(out, z)| *out += factor * z);
        }
    }
}

/// The slopes at which the rays of a beam that looks at a round object's middle begin to miss it, and
/// end: where the place and the pupil's shadow meet its edge. Nothing of other outlines.
fn breaks_of_object(optics: &Optics, chart: Chart) -> Vec<f64> {
    let (Chart::Perpendicular { .. }, Some(Outline::Disk { radius_m, .. })) =
        (chart, optics.outline)
    else {
        return Vec::new();
    };
    let (beam, h) = (&optics.beam, optics.beam.pupil_z_m());
    let pupil = beam.pupil_radius_m();
    if pupil >= beam.stop_radius_m() || h <= radius_m + pupil {
        return Vec::new();
    }
    // (h a ± r)/√(1 + a²) = R, by iteration: each step takes R a/h of the error away.
    let slope = |side: f64| {
        let step = |a: f64| (radius_m * libm::hypot(1.0, a) - side * pupil) / h;
        (0..ITERATIONS).fold(0.0, |a, _| step(a))
    };
    vec![slope(1.0), slope(-1.0)]
}

/// An interval stretched about its middle.
fn continued((from, to): (f64, f64), limit: f64) -> (f64, f64) {
    let (middle, half) = (f64::midpoint(from, to), (to - from) / 2.0);
    (middle - limit * half, middle + limit * half)
}

/// Degrees in the slopes of rules for beams that nothing cuts.
const SMOOTH_DEGREES: [usize; 6] = [3, 5, 7, 9, 13, 21];
/// Of a slope: R/h is below one half or so.
const ITERATIONS: usize = 60;
/// Degrees of rules for beams that something cuts: what is averaged has kinks.
const ACROSS_DEGREES: [usize; 3] = [7, 13, 25];
