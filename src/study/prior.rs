//! What a plan expects to see, as fields of radiance: an even one or a lobe about the normal, and
//! features as narrow as the plan declares, one at a time. Nothing here comes from a scene.

use fit::{Ray, Region};
use radiometry::direction;

use crate::plan::Plan;
use crate::rig::{Pose, Rig};

/// Where the plan states no level: this part of the gain range, so that a source a few times as
/// bright does not saturate it.
const LEVEL_ASSUMED: f64 = 0.1;
/// Features of each kind that are tried, at places that fill the region evenly.
const FEATURES: u32 = 12;
/// Steps of the R2 sequence (Roberts 2018): from the root of x³ = x + 1.
const R2: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_2];

/// The field that is expected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Its highest radiance, in the unit of the detector's quantity.
    pub level: f64,
    /// Whether the plan states it; else it is a tenth of the gain range.
    pub is_declared: bool,
    /// The power of the cosine: 0 for an even one.
    pub exponent: f64,
}

/// A Gaussian bump of radiance, as high as the expected field where it stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feature {
    height: f64,
    place: Place,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Place {
    /// In direction, alike all over the region: where, and the full width at half maximum.
    Direction { theta_rad: f64, phi_rad: f64, width_rad: f64 },
    /// In position, in all directions.
    Position { x_m: f64, y_m: f64, width_m: f64 },
}

impl Prior {
    /// Of a plan on a rig, read in a gain range.
    pub fn of(plan: &Plan, rig: &Rig, gain: u8) -> Self {
        let declared = plan.expect.level.map(|(_, level)| level);
        let level =
            declared.unwrap_or_else(|| LEVEL_ASSUMED * rig.detector.saturation_radiance(gain));
        Self { level, is_declared: declared.is_some(), exponent: plan.expect.exponent() }
    }

    /// The radiance in a direction.
    pub fn radiance(&self, theta_rad: f64) -> f64 {
        if self.exponent > 0.0 {
            self.level * libm::pow(libm::cos(theta_rad).max(0.0), self.exponent)
        } else {
            self.level
        }
    }

    /// Features in direction as narrow as the plan declares.
    pub fn in_direction(&self, plan: &Plan) -> Vec<Feature> {
        let Some(width_rad) = plan.expect.narrowest_feature_rad else { return Vec::new() };
        let sin2_max = libm::sin(plan.region.theta_max_rad).powi(2);
        let feature = |u: [f64; 2]| {
            let theta_rad = libm::asin(libm::sqrt(sin2_max * u[0]));
            let phi_rad = core::f64::consts::TAU * u[1];
            let place = Place::Direction { theta_rad, phi_rad, width_rad };
            Feature { height: self.radiance(theta_rad), place }
        };
        (1..=FEATURES).map(|k| feature(point(k))).collect()
    }

    /// Features in position as narrow as the plan declares.
    pub fn in_position(&self, plan: &Plan) -> Vec<Feature> {
        let Some(width_m) = plan.expect.narrowest_feature_m else { return Vec::new() };
        let (x, y) = (plan.region.x_m, plan.region.y_m);
        let feature = |u: [f64; 2]| {
            let (x_m, y_m) = (x.0 + (x.1 - x.0) * u[0], y.0 + (y.1 - y.0) * u[1]);
            Feature { height: self.level, place: Place::Position { x_m, y_m, width_m } }
        };
        (1..=FEATURES).map(|k| feature(point(k))).collect()
    }
}

impl Feature {
    /// Its radiance along a ray.
    pub fn radiance(&self, ray: &Ray) -> f64 {
        let squares = match self.place {
            Place::Direction { theta_rad, phi_rad, width_rad } => {
                let toward = direction::unit(theta_rad, phi_rad);
                let cosine = toward.dot(direction::unit(ray.theta_rad, ray.phi_rad));
                (libm::acos(cosine.clamp(-1.0, 1.0)) / width_rad).powi(2)
            }
            Place::Position { x_m, y_m, width_m } => {
                let (x, y) = ((ray.x_m - x_m) / width_m, (ray.y_m - y_m) / width_m);
                x * x + y * y
            }
        };
        self.height * libm::exp(-4.0 * core::f64::consts::LN_2 * squares)
    }
}

/// The k-th point of the R2 sequence.
fn point(k: u32) -> [f64; 2] {
    R2.map(|step| (0.5 + f64::from(k) * step) % 1.0)
}

/// A pose as the fit takes it.
pub(super) fn ray(pose: Pose) -> Ray {
    let Pose { x_m, y_m, theta_rad, phi_rad } = pose;
    Ray { x_m, y_m, theta_rad, phi_rad }
}

/// What the plan's fit stands for.
pub(super) fn region(plan: &Plan) -> Region {
    let region = plan.region;
    Region::surface(region.x_m, region.y_m, region.theta_max_rad)
}
