//! The functions that a fit is made of: functions of the direction times functions of the position
//! over the region.
//!
//! Function k = q · angular + j is the j-th function of the direction times the q-th of the position.
//! Legendre terms other than the first have mean zero over the region, and Zernike polynomials other
//! than the first have no exitance: there derived quantities are short sums. It knows no samples.

mod angular;
mod place;
mod plane;
mod spec;
mod splines;

use crate::{FitError, Ray, Region};
use glam::DVec3;
use radiometry::{DomainError, direction};
use std::f64::consts::{FRAC_PI_2, PI};

pub(crate) use angular::Directions;
pub(crate) use place::Places;
pub(crate) use plane::SecondPlane;
pub use spec::{Angular, Around, BasisSpec, Fine, Position};
pub(crate) use splines::{Derivative, PolarSplines};

/// The functions of a spec over a region, ready to be evaluated.
#[derive(Debug, Clone)]
pub(crate) struct Basis {
    directions: Directions,
    places: Places,
    region: Region,
    spec: BasisSpec,
    /// Of every function, over all directions of the chart.
    exitance: Vec<f64>,
}

/// Scratch of one evaluation.
#[derive(Debug)]
pub(crate) struct Scratch {
    direction: Vec<f64>,
    room: Vec<f64>,
    lines: [Vec<f64>; 2],
    /// Of the second plane.
    beyond: [Vec<f64>; 2],
    position: Vec<f64>,
}

impl Scratch {
    /// The position terms evaluated last.
    pub(crate) fn position(&self) -> &[f64] {
        &self.position
    }
}

impl Basis {
    pub(crate) fn new(spec: BasisSpec, region: Region) -> Result<Self, FitError> {
        let directions = Directions::new(spec.angular, region.chart)?;
        let places = Places::new(spec.position, &region)?;
        let mut new = Self { directions, places, region, spec, exitance: Vec::new() };
        let refused = |_: DomainError| FitError::Basis { kind: spec.angular.name() };
        let end_rad = if region.chart.is_whole_sphere() { PI } else { FRAC_PI_2 };
        new.exitance = match new.directions.second_plane() {
            Some(plane) => plane.throughput(&new.places, &region)?,
            None => new.exitance_within(end_rad).map_err(refused)?,
        };
        Ok(new)
    }

    pub(crate) fn spec(&self) -> BasisSpec {
        self.spec
    }

    pub(crate) fn region(&self) -> &Region {
        &self.region
    }

    pub(crate) fn directions(&self) -> &Directions {
        &self.directions
    }

    pub(crate) fn places(&self) -> &Places {
        &self.places
    }

    pub(crate) fn len(&self) -> usize {
        self.angular_len() * self.places.len()
    }

    pub(crate) fn angular_len(&self) -> usize {
        self.directions.len()
    }

    pub(crate) fn position_len(&self) -> usize {
        self.places.len()
    }

    pub(crate) fn scratch(&self) -> Scratch {
        let (x, y) = self.places.lines();
        Scratch {
            direction: vec![0.0; self.angular_len()],
            room: self.directions.room(),
            lines: [vec![0.0; x], vec![0.0; y]],
            beyond: self.directions.second_plane().map(SecondPlane::lines).unwrap_or_default(),
            position: vec![0.0; self.places.len()],
        }
    }

    /// Whether a function of the direction needs the place as well: then a row is a product of both
    /// at each ray, but no average over places times one over directions.
    pub(crate) fn is_joint(&self) -> bool {
        self.directions.second_plane().is_some()
    }

    /// The functions of the direction along a ray.
    pub(crate) fn direction_of(&self, ray: &Ray, scratch: &mut Scratch, out: &mut [f64]) {
        let d = direction::unit(ray.theta_rad, ray.phi_rad);
        self.direction_from((ray.x_m, ray.y_m), d, scratch, out);
    }

    fn direction_from(
        &self,
        place_m: (f64, f64),
        d: DVec3,
        scratch: &mut Scratch,
        out: &mut [f64],
    ) {
        match self.directions.second_plane() {
            Some(plane) => plane.evaluate(place_m, d, &mut scratch.beyond, out),
            None => self.directions.evaluate(d, &mut scratch.room, out),
        }
    }

    /// All functions along the ray from a place, continued beyond the region.
    pub(crate) fn row_from(
        &self,
        place_m: (f64, f64),
        d: DVec3,
        scratch: &mut Scratch,
        out: &mut [f64],
    ) {
        let mut along = std::mem::take(&mut scratch.direction);
        self.direction_from(place_m, d, scratch, &mut along);
        self.position_continued(place_m.0, place_m.1, scratch);
        for (p, block) in scratch.position.iter().zip(out.chunks_exact_mut(along.len())) {
            block.iter_mut().zip(&along).for_each(|(out, z)| *out = p * z);
        }
        scratch.direction = along;
    }

    /// The functions of the direction at a unit vector, wherever the ray begins.
    pub(crate) fn direction_along(&self, d: DVec3, scratch: &mut Scratch, out: &mut [f64]) {
        self.directions.evaluate(d, &mut scratch.room, out);
    }

    /// The position terms at the ray's foot.
    pub(crate) fn position(&self, ray: &Ray, scratch: &mut Scratch) {
        self.position_at(self.region.scaled(ray), scratch);
    }

    fn position_at(&self, place: (f64, f64), scratch: &mut Scratch) {
        self.places.evaluate(place, &mut scratch.lines, &mut scratch.position);
    }

    /// The position terms at a place; beyond [`Places::continued`] they are constant.
    pub(crate) fn position_continued(&self, x_m: f64, y_m: f64, scratch: &mut Scratch) {
        if self.places.rule_degree() == 0 {
            // Of the one term there is.
            scratch.position.fill(1.0);
            return;
        }
        let limit = self.places.continued();
        let (x, y) = Places::scaled(&self.region, x_m, y_m);
        self.position_at((x.clamp(-limit, limit), y.clamp(-limit, limit)), scratch);
    }

    /// The largest value of a function within region and hemisphere.
    pub(crate) fn largest(&self, k: usize) -> f64 {
        self.directions.largest(k % self.angular_len())
    }

    /// All functions along a ray.
    pub(crate) fn row(&self, ray: &Ray, scratch: &mut Scratch, out: &mut [f64]) {
        self.evaluate(ray, scratch);
        for (q, p) in scratch.position.iter().enumerate() {
            let block = &mut out[q * scratch.direction.len()..][..scratch.direction.len()];
            for (out, z) in block.iter_mut().zip(&scratch.direction) {
                *out = p * z;
            }
        }
    }

    /// The value of the field with these coefficients along a ray.
    pub(crate) fn value(&self, coefficients: &[f64], ray: &Ray, scratch: &mut Scratch) -> f64 {
        if let Some(splines) = self.directions.local() {
            self.position(ray, scratch);
            let (width, mut sum) = (self.angular_len(), 0.0);
            let hand = |j: usize, z: f64| {
                let places = scratch.position.iter().enumerate();
                let at: f64 = places.map(|(q, p)| p * coefficients[q * width + j]).sum();
                sum += at * z;
            };
            if (0.0..=FRAC_PI_2).contains(&ray.theta_rad) {
                splines.each_towards(ray.theta_rad, ray.phi_rad, hand);
            } else {
                splines.each_along(direction::unit(ray.theta_rad, ray.phi_rad), hand);
            }
            return sum;
        }
        self.evaluate(ray, scratch);
        let blocks = coefficients.chunks_exact(scratch.direction.len());
        scratch.position.iter().zip(blocks).map(|(p, c)| p * dot(c, &scratch.direction)).sum()
    }

    fn evaluate(&self, ray: &Ray, scratch: &mut Scratch) {
        let mut along = std::mem::take(&mut scratch.direction);
        self.direction_of(ray, scratch, &mut along);
        scratch.direction = along;
        self.position(ray, scratch);
    }

    /// The exitance within a cone about the normal, mean over the region, as a linear functional:
    /// the sum of its elements times the coefficients. Over the whole sphere without the cosine;
    /// between two planes all of it, whatever the angle. Elsewhere an angle below 0, beyond the
    /// chart's own end or NaN is refused.
    pub(crate) fn exitance_within(&self, theta_max_rad: f64) -> Result<Vec<f64>, DomainError> {
        if self.is_joint() {
            return Ok(self.exitance.clone());
        }
        let end_rad = if self.region.chart.is_whole_sphere() { PI } else { FRAC_PI_2 };
        if !(0.0..=end_rad).contains(&theta_max_rad) {
            let (argument, value) = ("theta_max_rad", theta_max_rad);
            return Err(DomainError::Outside { argument, value, low: 0.0, high: end_rad });
        }
        let mut over_cone = vec![0.0; self.angular_len()];
        self.directions.integrals_within(theta_max_rad, &mut over_cone)?;
        Ok(self.over_region(&over_cone))
    }

    /// The exitance of the whole hemisphere, mean over the region; in other charts the flux in all
    /// their directions over the region's area.
    pub(crate) fn exitance(&self) -> &[f64] {
        &self.exitance
    }

    /// What the coefficients are when the field is 1 everywhere.
    pub(crate) fn unity(&self) -> Vec<f64> {
        let mut everywhere = vec![0.0; self.angular_len()];
        self.directions.unity(&mut everywhere);
        let unity = |q: usize| self.places.unity(q);
        self.product(unity, &everywhere)
    }

    /// The mean over the region of the value in a direction, as a linear functional. Of functions that
    /// need the place as well those from the region's middle count.
    pub(crate) fn mean_over_region(&self, theta_rad: f64, phi_rad: f64) -> Vec<f64> {
        let mut values = vec![0.0; self.angular_len()];
        let Region { x_m, y_m, .. } = self.region;
        let (x_m, y_m) = (f64::midpoint(x_m.0, x_m.1), f64::midpoint(y_m.0, y_m.1));
        let ray = Ray { x_m, y_m, theta_rad, phi_rad };
        self.direction_of(&ray, &mut self.scratch(), &mut values);
        self.over_region(&values)
    }

    fn over_region(&self, directions: &[f64]) -> Vec<f64> {
        self.product(|q| self.places.mean(q), directions)
    }

    fn product(&self, places: impl Fn(usize) -> f64, directions: &[f64]) -> Vec<f64> {
        let blocks = (0..self.places.len()).map(places);
        blocks.flat_map(|p| directions.iter().map(move |d| p * d)).collect()
    }

    /// The function's name: of the direction's, and what varies with the position.
    pub(crate) fn name(&self, k: usize) -> String {
        let (q, j) = (k / self.angular_len(), k % self.angular_len());
        format!("{}{}", self.directions.name(j), self.places.name(q))
    }
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
