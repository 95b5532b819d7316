//! What a plan expects to see, as fields of radiance: an even one or a lobe about the normal, and
//! features as narrow as the plan declares, one at a time. Nothing here comes from a scene.

use fit::{Ray, Region};
use radiometry::direction;

use crate::plan::Plan;
use crate::rig::{Pose, Rig};

/// Where the plan states no level: this part of the gain range, so that a source a few times as
/// bright does not saturate it.
const LEVEL_ASSUMED: f64 = 0.1;
/// Features of each shape that are tried, at places that fill the region evenly.
const FEATURES: u32 = 12;
/// From one stripe's direction to the next: the golden part of half a turn, so that they fill it evenly.
const STRIPE_TURN_RAD: f64 = core::f64::consts::PI * 0.618_033_988_749_894_8;
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

/// A Gaussian bump of radiance, as high as the expected field where it stands: narrow both ways, or drawn
/// out one way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feature {
    height: f64,
    place: Place,
}

/// Features of one kind, in direction or in position, of both shapes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Features {
    /// Narrow both ways: lobes, bright spots.
    pub spots: Vec<Feature>,
    /// Drawn out one way: rings about the normal, stripes across the sample. What most sources have: a beam's
    /// edge all round, the edge of a shadow.
    pub drawn_out: Vec<Feature>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Place {
    /// In direction, alike all over the region: where, and the full width at half maximum.
    Direction { theta_rad: f64, phi_rad: f64, width_rad: f64 },
    /// The same all round the normal.
    Ring { theta_rad: f64, width_rad: f64 },
    /// In position, in all directions.
    Position { x_m: f64, y_m: f64, width_m: f64 },
    /// In position, across one direction of the sample's plane.
    Stripe { x_m: f64, y_m: f64, across_rad: f64, width_m: f64 },
}

impl Features {
    /// All of them, spots first.
    pub fn iter(&self) -> impl Iterator<Item = &Feature> {
        self.spots.iter().chain(&self.drawn_out)
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.spots.len() + self.drawn_out.len()
    }

    /// Whether the plan declares none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
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
    pub fn in_direction(&self, plan: &Plan) -> Features {
        let Some(width_rad) = plan.expect.narrowest_feature_rad else { return Features::default() };
        let sin2_max = libm::sin(plan.region.theta_max_rad).powi(2);
        let feature = |u: [f64; 2], is_ring: bool| {
            let theta_rad = libm::asin(libm::sqrt(sin2_max * u[0]));
            let phi_rad = core::f64::consts::TAU * u[1];
            let place = if is_ring {
                Place::Ring { theta_rad, width_rad }
            } else {
                Place::Direction { theta_rad, phi_rad, width_rad }
            };
            Feature { height: self.radiance(theta_rad), place }
        };
        Features {
            spots: (1..=FEATURES).map(|k| feature(point(k), false)).collect(),
            drawn_out: (1..=FEATURES).map(|k| feature(point(k), true)).collect(),
        }
    }

    /// Features in position as narrow as the plan declares.
    pub fn in_position(&self, plan: &Plan) -> Features {
        let Some(width_m) = plan.expect.narrowest_feature_m else { return Features::default() };
        let (x, y) = (plan.region.x_m, plan.region.y_m);
        let feature = |u: [f64; 2], across_rad: Option<f64>| {
            let (x_m, y_m) = (x.0 + (x.1 - x.0) * u[0], y.0 + (y.1 - y.0) * u[1]);
            let place = match across_rad {
                Some(across_rad) => Place::Stripe { x_m, y_m, across_rad, width_m },
                None => Place::Position { x_m, y_m, width_m },
            };
            Feature { height: self.level, place }
        };
        let across = |k: u32| f64::from(k) * STRIPE_TURN_RAD;
        Features {
            spots: (1..=FEATURES).map(|k| feature(point(k), None)).collect(),
            drawn_out: (1..=FEATURES).map(|k| feature(point(k), Some(across(k)))).collect(),
        }
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
            Place::Ring { theta_rad, width_rad } => {
                // With its mirror image beyond the normal, where it would have a tip otherwise.
                let at = |angle_rad: f64| gaussian((angle_rad / width_rad).powi(2));
                let both = at(ray.theta_rad - theta_rad) + at(ray.theta_rad + theta_rad);
                return self.height * both / (1.0 + at(2.0 * theta_rad));
            }
            Place::Stripe { x_m, y_m, across_rad, width_m } => {
                let (sin, cos) = libm::sincos(across_rad);
                (((ray.x_m - x_m) * cos + (ray.y_m - y_m) * sin) / width_m).powi(2)
            }
            Place::Position { x_m, y_m, width_m } => {
                let (x, y) = ((ray.x_m - x_m) / width_m, (ray.y_m - y_m) / width_m);
                x * x + y * y
            }
        };
        self.height * gaussian(squares)
    }
}

/// Of the square of a distance over the full width at half maximum.
fn gaussian(squares: f64) -> f64 {
    libm::exp(-4.0 * core::f64::consts::LN_2 * squares)
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

#[cfg(test)]
mod tests {
    use super::*;

    const PRIOR: Prior = Prior { level: 50.0, is_declared: true, exponent: 0.0 };

    fn toward(theta_deg: f64, phi_deg: f64) -> Ray {
        let (theta_rad, phi_rad) = (theta_deg.to_radians(), phi_deg.to_radians());
        Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad }
    }

    #[test]
    fn a_ring_is_as_wide_as_declared_all_round_and_has_no_tip_on_the_normal() {
        let ring = |theta_deg: f64| Feature {
            height: 50.0,
            place: Place::Ring {
                theta_rad: theta_deg.to_radians(),
                width_rad: 20.0_f64.to_radians(),
            },
        };
        for phi_deg in [0.0, 77.0, 180.0] {
            assert!((ring(50.0).radiance(&toward(50.0, phi_deg)) - 50.0).abs() < 1e-9);
            assert!((ring(50.0).radiance(&toward(60.0, phi_deg)) - 25.0).abs() < 1e-9);
        }
        // Half a degree to either side of the normal is the same direction but for φ; the slope is none.
        let on = ring(8.0).radiance(&toward(0.0, 0.0));
        let beside = ring(8.0).radiance(&toward(0.01, 0.0));
        assert!((beside / on - 1.0).abs() < 1e-5, "{on} and {beside}");
    }

    #[test]
    fn a_stripe_is_as_wide_as_declared_across_and_endless_along() {
        let (across_rad, width_m) = (0.5, 0.04);
        let place = Place::Stripe { x_m: 0.01, y_m: 0.0, across_rad, width_m };
        let stripe = Feature { height: 50.0, place };
        let (sin, cos) = libm::sincos(across_rad);
        let at = |across: f64, along: f64| Ray {
            x_m: 0.01 + across * cos - along * sin,
            y_m: across * sin + along * cos,
            theta_rad: 1.0,
            phi_rad: 2.0,
        };
        for along in [-0.5, 0.0, 3.0] {
            assert!((stripe.radiance(&at(0.0, along)) - 50.0).abs() < 1e-9);
            assert!((stripe.radiance(&at(0.02, along)) - 25.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_plan_has_features_of_the_kinds_that_it_declares() {
        let plan = |expect: &str| {
            let schedule = "kind = \"low-discrepancy\"\ncount = 10";
            super::super::plan_by(schedule, &format!("[expect]\n{expect}"))
        };
        let both = plan("narrowest_feature_deg = 20\nnarrowest_feature_mm = 1");
        for features in [PRIOR.in_direction(&both), PRIOR.in_position(&both)] {
            assert_eq!((features.spots.len(), features.drawn_out.len()), (12, 12));
            assert_eq!(features.iter().count(), features.len());
        }
        assert!(PRIOR.in_direction(&plan("narrowest_feature_mm = 1")).is_empty());
        assert!(PRIOR.in_position(&plan("narrowest_feature_deg = 20")).is_empty());
    }
}
