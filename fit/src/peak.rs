//! Where the fitted field is largest within its region: a grid that no lobe of the basis slips
//! through, then a search downhill in step size from the best places. Deterministic.

use crate::basis::dot;
use crate::{Chart, Estimate, Fit, Ray, Region};
use std::f64::consts::TAU;

/// The largest value of the field within the region and its cone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// The radiance there. The largest of noisy values is on average above the true largest one by
    /// a part of u, which u doesn't include.
    pub radiance: Estimate,
    /// Where it is, φ in (-π, π].
    pub ray: Ray,
}

impl Fit {
    /// The largest radiance within the region and its cone. Where several are equal, the one
    /// nearest the normal.
    pub fn peak(&self) -> Peak {
        let climbed = self.starts().into_iter().map(|start| self.climb(start));
        let place = highest(climbed).map_or(Place::CENTRE, |(place, _)| place);
        let ray = place.ray(self.region());
        Peak { radiance: self.radiance(&ray), ray }
    }

    /// The tops that the best places of the grid lead to, each once.
    pub(crate) fn tops(&self) -> Vec<Top> {
        let mut tops: Vec<Top> = Vec::new();
        for start in self.starts() {
            let place = self.climb(start).0;
            if tops.iter().all(|top| top.0.distance(place) > TOPS_APART) {
                tops.push(Top(place));
            }
        }
        tops
    }

    /// The best places of the grid, a few of them so that a second lobe has its chance.
    fn starts(&self) -> Vec<Place> {
        let basis = self.functions();
        let directions = directions(self.region(), basis.directions().fineness());
        let mut z = vec![0.0; basis.angular_len()];
        let mut folded = vec![0.0; basis.angular_len()];
        let mut scratch = basis.scratch();
        let mut starts: Vec<(Place, f64)> = Vec::new();
        for (a, b) in positions(basis.places().fineness()) {
            let position = Place { a, b, ..Place::CENTRE };
            basis.position(&position.ray(self.region()), &mut scratch);
            folded.fill(0.0);
            for (p, block) in
                scratch.position().iter().zip(self.coefficients().chunks_exact(folded.len()))
            {
                folded.iter_mut().zip(block).for_each(|(f, c)| *f += p * c);
            }
            for &(u, v) in &directions {
                let place = Place { u, v, a, b };
                let ray = place.ray(self.region());
                let value = if let Some(splines) = basis.directions().local() {
                    splines.value(&folded, ray.theta_rad, ray.phi_rad)
                } else {
                    basis.direction_of(&ray, &mut scratch, &mut z);
                    dot(&folded, &z)
                };
                keep(&mut starts, place, value);
            }
        }
        starts.into_iter().map(|(place, _)| place).collect()
    }

    /// To the top that the fitted field has near a place.
    fn climb(&self, start: Place) -> (Place, f64) {
        let basis = self.functions();
        let mut scratch = basis.scratch();
        let mut at = |ray: &Ray| basis.value(self.coefficients(), ray, &mut scratch);
        self.climb_over(start, STEP_LAST, &mut at)
    }

    /// Steps along the axes while that rises, with ever smaller steps down to the last.
    fn climb_over(
        &self,
        start: Place,
        step_last: f64,
        value_along: &mut impl FnMut(&Ray) -> f64,
    ) -> (Place, f64) {
        let r_max = match self.region().chart {
            Chart::TwoPlane { .. } => core::f64::consts::SQRT_2,
            _ => disk_radius(self.region(), self.region().theta_max_rad),
        };
        let mut at = |place: Place| value_along(&place.ray(self.region()));
        let (mut place, mut value) = (start, at(start));
        let mut step = STEP_FIRST / (self.functions().directions().fineness() + 1) as f64;
        for _ in 0..STEPS_MAX {
            let around = place.neighbours(step, r_max);
            let best = around.map(|place| (place, at(place)));
            let best = best.into_iter().fold((place, value), |a, b| if b.1 > a.1 { b } else { a });
            if best.1 > value + TIE_RELATIVE * value.abs() {
                (place, value) = best;
            } else if step < step_last {
                break;
            } else {
                step *= 0.5;
            }
        }
        (place, value)
    }
}

/// A place that a fitted field falls from to all sides.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Top(Place);

/// The largest value of another field over the same region, climbed to from the tops of the fit's.
pub(crate) fn along(fit: &Fit, tops: &[Top], value: &mut impl FnMut(&Ray) -> f64) -> (Ray, f64) {
    let climbed = tops.iter().map(|top| fit.climb_over(top.0, STEP_LAST_ROUGH, value));
    let (place, value) = highest(climbed).unwrap_or((Place::CENTRE, f64::NAN));
    (place.ray(fit.region()), value)
}

/// Of equally high places the first.
fn highest(places: impl Iterator<Item = (Place, f64)>) -> Option<(Place, f64)> {
    places.fold(None, |best: Option<(Place, f64)>, (place, value)| {
        let margin = TIE_RELATIVE * value.abs();
        let is_higher = best.is_none_or(|(_, top)| value > top + margin);
        if is_higher { Some((place, value)) } else { best }
    })
}

/// A ray by its point on the Nusselt disk (of the whole sphere on the equal-area disk, half as far
/// out) and its position scaled to [-1, 1]².
#[derive(Debug, Clone, Copy, PartialEq)]
struct Place {
    u: f64,
    v: f64,
    a: f64,
    b: f64,
}

impl Place {
    const CENTRE: Self = Self { u: 0.0, v: 0.0, a: 0.0, b: 0.0 };

    fn distance(self, other: Self) -> f64 {
        let across = libm::hypot(self.u - other.u, self.v - other.v);
        libm::hypot(across, libm::hypot(self.a - other.a, self.b - other.b))
    }

    fn ray(self, region: &Region) -> Ray {
        let between = |t: f64, (from, to): (f64, f64)| 0.5 * ((1.0 - t) * from + (1.0 + t) * to);
        if let Chart::TwoPlane { distance_m, s_m, t_m } = region.chart {
            // The disk holds the second rectangle, scaled to [-1, 1]².
            let first = (between(self.a, region.x_m), between(self.b, region.y_m));
            let [s, t] = [self.u, self.v].map(|t| t.clamp(-1.0, 1.0));
            return Ray::between(first, (between(s, s_m), between(t, t_m)), distance_m);
        }
        Ray {
            x_m: between(self.a, region.x_m),
            y_m: between(self.b, region.y_m),
            theta_rad: theta_of(region, libm::hypot(self.u, self.v)),
            phi_rad: libm::atan2(self.v, self.u),
        }
    }

    /// The places a step away along each axis and diagonally on the disk, brought back within the
    /// cone and the region. The diagonals and the turns follow ridges that the axes miss.
    fn neighbours(self, step: f64, r_max: f64) -> [Self; 14] {
        const AXES: [(f64, f64); 8] = [
            (1.0, 0.0),
            (-1.0, 0.0),
            (0.0, 1.0),
            (0.0, -1.0),
            (0.7, 0.7),
            (-0.7, 0.7),
            (0.7, -0.7),
            (-0.7, -0.7),
        ];
        let disk = |(u, v): (f64, f64)| {
            let outside = (libm::hypot(u, v) / r_max).max(1.0);
            Self { u: u / outside, v: v / outside, ..self }
        };
        let side = |t: f64| t.clamp(-1.0, 1.0);
        let mut places = [self; 14];
        for (place, (du, dv)) in places.iter_mut().zip(AXES) {
            *place = disk((self.u + step * du, self.v + step * dv));
        }
        for (place, turn) in places[8..].iter_mut().zip([step, -step]) {
            let (sin, cos) = libm::sincos(turn);
            *place = disk((self.u * cos - self.v * sin, self.u * sin + self.v * cos));
        }
        for (place, sign) in places[10..].iter_mut().zip([1.0, -1.0]) {
            *place = Self { a: side(self.a + sign * step), ..self };
        }
        for (place, sign) in places[12..].iter_mut().zip([1.0, -1.0]) {
            *place = Self { b: side(self.b + sign * step), ..self };
        }
        places
    }
}

/// Points on the disk within the cone, the centre first, rings outwards; dense at the rim, where
/// polynomials turn fastest.
fn directions(region: &Region, degree: usize) -> Vec<(f64, f64)> {
    let rings = 2 * (degree + 1);
    let spokes = 4 * (degree + 1);
    let mut points = vec![(0.0, 0.0)];
    for ring in 1..=rings {
        let part = ring as f64 / rings as f64;
        let r = match region.chart {
            Chart::TwoPlane { .. } => core::f64::consts::SQRT_2 * part,
            _ => disk_radius(region, region.theta_max_rad * part),
        };
        for spoke in 0..spokes {
            let (sin, cos) = libm::sincos(TAU * spoke as f64 / spokes as f64);
            points.push((r * cos, r * sin));
        }
    }
    points
}

/// Where a direction lies on the disk.
fn disk_radius(region: &Region, theta_rad: f64) -> f64 {
    if region.chart.is_whole_sphere() { libm::sin(0.5 * theta_rad) } else { libm::sin(theta_rad) }
}

fn theta_of(region: &Region, radius: f64) -> f64 {
    let angle_rad = libm::asin(radius.min(1.0));
    if region.chart.is_whole_sphere() { 2.0 * angle_rad } else { angle_rad }
}

/// Positions in [-1, 1]², the centre first.
fn positions(degree: usize) -> Vec<(f64, f64)> {
    let half = degree.cast_signed();
    let t = |i: isize| if half == 0 { 0.0 } else { i as f64 / half as f64 };
    let mut positions: Vec<(f64, f64)> =
        (-half..=half).flat_map(|i| (-half..=half).map(move |j| (t(i), t(j)))).collect();
    positions.sort_by(|p, q| p.0.hypot(p.1).total_cmp(&q.0.hypot(q.1)));
    positions
}

/// Keeps the best places in falling order; of equal ones the earlier.
fn keep(starts: &mut Vec<(Place, f64)>, place: Place, value: f64) {
    let at = starts.partition_point(|(_, kept)| *kept >= value - TIE_RELATIVE * value.abs());
    if at < STARTS {
        starts.truncate(STARTS - 1);
        starts.insert(at, (place, value));
    }
}

/// From how many grid points the search starts.
const STARTS: usize = 6;
/// First step of the search times degree + 1: about the grid's spacing.
const STEP_FIRST: f64 = 0.5;
/// The search ends at this step on the unit disk: 3e-5 degrees.
const STEP_LAST: f64 = 5e-7;
/// And where many searches are made at this: a thousandth of a degree.
const STEP_LAST_ROUGH: f64 = 1e-5;
/// Searches that end closer than this came to the same top.
const TOPS_APART: f64 = 1e-3;
/// Most steps of one search.
const STEPS_MAX: usize = 400;
/// Values closer than this are equal: rounding must not choose the place.
const TIE_RELATIVE: f64 = 1e-12;
