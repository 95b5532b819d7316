//! What leaves the sample: the numbers that a fit is compared with, by the same definitions. Free of
//! detector, noise and beam. Of patches that emit they are exact; of what is lit, raised or behind
//! glass they are integrals, with a bound of their error.

use core::cell::{Cell, OnceCell};
use core::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec2;
use radiometry::direction::{angles, wrap};
use radiometry::quadrature::{self, cubature, quasi_monte_carlo};
use radiometry::{Estimate, EstimateError, Tolerance};

use crate::Scene;
use crate::field::{Field, Ray};

/// Where a fit is asked for: a rectangle of the sample and the cone of directions around its
/// normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// From low to high, metres.
    pub x_m: (f64, f64),
    /// From low to high, metres.
    pub y_m: (f64, f64),
    /// At most π/2, radians.
    pub theta_max_rad: f64,
}

impl Region {
    /// Square metres.
    pub fn area_m2(&self) -> f64 {
        (self.x_m.1 - self.x_m.0) * (self.y_m.1 - self.y_m.0)
    }
}

/// The largest radiance of a region and where it stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// In the scene's unit.
    pub value: f64,
    /// Metres.
    pub x_m: f64,
    /// Metres.
    pub y_m: f64,
    /// Radians.
    pub theta_rad: f64,
    /// Radians.
    pub phi_rad: f64,
}

/// What leaves the sample in a region.
///
/// What is integrated, is so once: ask one `Truth` for all that is wanted.
#[derive(Debug, Clone)]
pub struct Truth<'c> {
    scene: &'c Scene,
    field: &'c dyn Field,
    region: Region,
    /// Over the hemisphere.
    exitance: OnceCell<f64>,
    /// Of what goes alike into all directions: the mean radiance over the region, and the place that
    /// was asked for last, with its radiance.
    mean: OnceCell<Estimate>,
    last: Cell<Option<(DVec2, f64)>>,
}

impl<'c> Truth<'c> {
    pub(crate) const fn new(scene: &'c Scene, field: &'c dyn Field, region: Region) -> Self {
        let (exitance, mean, last) = (OnceCell::new(), OnceCell::new(), Cell::new(None));
        Self { scene, field, region, exitance, mean, last }
    }

    /// The region that it is taken over.
    pub const fn region(&self) -> &Region {
        &self.region
    }

    /// Radiance along the ray that crosses the plane at (x, y) into (θ, φ), W·m⁻²·sr⁻¹ or cd·m⁻².
    /// Zero where nothing is.
    pub fn radiance(&self, x_m: f64, y_m: f64, theta_rad: f64, phi_rad: f64) -> f64 {
        let along = || self.field.radiance(&Ray::new(x_m, y_m, theta_rad, phi_rad));
        if theta_rad > FRAC_PI_2 || !self.field.is_even() {
            return along();
        }
        let place = DVec2::new(x_m, y_m);
        match self.last.get() {
            Some((last, radiance)) if last == place => radiance,
            _ => {
                let radiance = along();
                self.last.set(Some((place, radiance)));
                radiance
            }
        }
    }

    /// Exitance into the whole hemisphere, the mean over the region's rectangle, W·m⁻² or
    /// lm·m⁻².
    pub fn exitance(&self) -> f64 {
        *self.exitance.get_or_init(|| self.exitance_up_to(FRAC_PI_2))
    }

    /// As [`Truth::exitance`], into the region's directions alone.
    pub fn exitance_within_region(&self) -> f64 {
        self.exitance_up_to(self.region.theta_max_rad)
    }

    /// Flux from the region's rectangle into the whole hemisphere, W or lm.
    pub fn flux(&self) -> f64 {
        self.exitance() * self.region.area_m2()
    }

    /// The largest radiance within the region. `None` where it has no bound: a table that ends
    /// above zero at 90°, in a region that goes so far.
    pub fn peak(&self) -> Option<Peak> {
        let Region { x_m, y_m, theta_max_rad } = self.region;
        let centre = (f64::midpoint(x_m.0, x_m.1), f64::midpoint(y_m.0, y_m.1));
        if !self.scene.is_flat_emitters() {
            return Some(self.highest());
        }
        let dark = Peak { value: 0.0, x_m: centre.0, y_m: centre.1, theta_rad: 0.0, phi_rad: 0.0 };
        self.scene.emitters().iter().try_fold(dark, |peak, emitter| {
            let Some((x_m, y_m, part)) = emitter.brightest_within(x_m, y_m) else {
                return Some(peak);
            };
            let (value, theta_rad, phi_rad) = emitter.law().peak_within(theta_max_rad)?;
            let value = part * emitter.level() * value;
            let higher = Peak { value, x_m, y_m, theta_rad, phi_rad };
            Some(if value > peak.value { higher } else { peak })
        })
    }

    fn exitance_up_to(&self, theta_max_rad: f64) -> f64 {
        let Region { x_m, y_m, .. } = self.region;
        if !self.scene.is_flat_emitters() {
            return self.integrated(theta_max_rad).value;
        }
        let flux: f64 = self
            .scene
            .emitters()
            .iter()
            .map(|emitter| {
                emitter.area_within_m2(x_m, y_m) * emitter.exitance_within(theta_max_rad)
            })
            .sum();
        flux / self.region.area_m2()
    }

    /// Exitance up to θ by integration over the region, with a bound of its error.
    fn integrated(&self, theta_max_rad: f64) -> Estimate {
        let Region { x_m, y_m, .. } = self.region;
        let sin_square = libm::sin(theta_max_rad) * libm::sin(theta_max_rad);
        if self.field.is_even() {
            // The same into all directions: π sin²θ times the mean over places.
            self.mean.get_or_init(|| self.mean_over_places()).scaled(PI * sin_square)
        } else {
            // Over places and the disk of (sin θ cos φ, sin θ sin φ), in equal parts of it.
            let along = |at: &[f64; 4]| {
                let between = |(low, high): (f64, f64), part: f64| low + (high - low) * part;
                let theta = libm::asin(libm::sqrt(at[2] * sin_square).min(1.0));
                let (x, y) = (between(x_m, at[0]), between(y_m, at[1]));
                self.radiance(x, y, theta, TAU * at[3] - PI)
            };
            let tolerance = Tolerance::new(UNEVEN_RELATIVE, 0.0, BUDGET);
            let mean = tolerance.map_err(Into::into).and_then(|t| quasi_monte_carlo(along, 1, t));
            known(mean).scaled(PI * sin_square)
        }
    }

    /// The mean over the region of what goes alike into all directions.
    fn mean_over_places(&self) -> Estimate {
        let Region { x_m, y_m, .. } = self.region;
        let low = DVec2::new(x_m.0, y_m.0);
        let step = (DVec2::new(x_m.1, y_m.1) - low) / f64::from(CELLS);
        let corner = |i: u32| low + step * DVec2::new(f64::from(i % CELLS), f64::from(i / CELLS));
        let cells =
            (0..CELLS * CELLS).map(corner).map(|at| quadrature::Cell::Rectangle(at, at + step));
        let cells: Vec<quadrature::Cell> = cells.collect();
        let along = |place: DVec2| self.radiance(place.x, place.y, 0.0, 0.0);
        let tolerance = Tolerance::new(EVEN_RELATIVE, 0.0, BUDGET);
        let mean = tolerance.map_err(Into::into).and_then(|t| cubature(along, &cells, t));
        known(mean).scaled(1.0 / self.region.area_m2())
    }

    /// The brightest of the region's landmarks, and from there uphill.
    fn highest(&self) -> Peak {
        let Region { x_m, y_m, theta_max_rad } = self.region;
        let mut best = Peak {
            value: 0.0,
            x_m: f64::midpoint(x_m.0, x_m.1),
            y_m: f64::midpoint(y_m.0, y_m.1),
            theta_rad: 0.0,
            phi_rad: 0.0,
        };
        for ray in self.field.landmarks(&self.region) {
            let (theta_rad, phi_rad) = angles(ray.direction);
            let is_inside = (x_m.0..=x_m.1).contains(&ray.point.x)
                && (y_m.0..=y_m.1).contains(&ray.point.y)
                && theta_rad <= theta_max_rad;
            let value = self.field.radiance(&ray);
            if is_inside && value > best.value {
                best = Peak { value, x_m: ray.point.x, y_m: ray.point.y, theta_rad, phi_rad };
            }
        }
        let mut part = 0.1;
        while part > 1e-9 {
            let steps = [
                (x_m.1 - x_m.0, 0.0, 0.0, 0.0),
                (0.0, y_m.1 - y_m.0, 0.0, 0.0),
                (0.0, 0.0, theta_max_rad, 0.0),
                (0.0, 0.0, 0.0, PI),
            ];
            let before = best.value;
            for (dx, dy, dt, dp) in steps {
                for sign in [part, -part] {
                    let (x, y) = (best.x_m + sign * dx, best.y_m + sign * dy);
                    let (x, y) = (x.clamp(x_m.0, x_m.1), y.clamp(y_m.0, y_m.1));
                    let theta = (best.theta_rad + sign * dt).clamp(0.0, theta_max_rad);
                    let phi = wrap(best.phi_rad + sign * dp);
                    let value = self.radiance(x, y, theta, phi);
                    if value > best.value {
                        best = Peak { value, x_m: x, y_m: y, theta_rad: theta, phi_rad: phi };
                    }
                }
            }
            if best.value <= before {
                part /= 2.0;
            }
        }
        best
    }
}

/// Cells a side to begin with.
const CELLS: u32 = 4;
/// How near the mean over places comes, relative.
const EVEN_RELATIVE: f64 = 1e-6;
/// How near the mean over places and directions comes, relative.
const UNEVEN_RELATIVE: f64 = 1e-4;
/// Radiances that an integral may ask for.
const BUDGET: usize = 1 << 18;

/// The estimate as far as it came.
fn known(found: Result<Estimate, EstimateError>) -> Estimate {
    match found {
        Ok(estimate) | Err(EstimateError::Unmet { estimate, .. }) => estimate,
        Err(_) => Estimate { value: 0.0, error_bound: f64::INFINITY, evaluations: 0 },
    }
}
