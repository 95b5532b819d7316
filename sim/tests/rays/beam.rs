//! The detector by brute force: a ray from a place of the pupil through a place of the spot, again and
//! again, each with the throughput of its two area elements.

use core::f64::consts::PI;

use glam::DVec3;
use sim::{Axis, NominalDetector};

use crate::dice::Dice;
use crate::world::World;

/// A mean and its standard error.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mean {
    pub(crate) value: f64,
    pub(crate) error: f64,
}

/// Of (value, weight) pairs.
#[derive(Default)]
struct Sums {
    count: f64,
    weights: f64,
    values: f64,
    squares: f64,
    crossed: f64,
    weights_squared: f64,
}

impl Sums {
    fn add(&mut self, value: f64, weight: f64) {
        self.count += 1.0;
        self.weights += weight;
        self.values += weight * value;
        self.squares += (weight * value).powi(2);
        self.crossed += weight * weight * value;
        self.weights_squared += weight * weight;
    }

    /// The quotient of two means; its error to first order.
    fn mean(&self) -> Mean {
        let value = self.values / self.weights;
        let squares =
            self.squares - 2.0 * value * self.crossed + value * value * self.weights_squared;
        Mean { value, error: squares.max(0.0).sqrt() / self.weights }
    }
}

/// The mean radiance of a detector's beam.
pub(crate) fn reading(
    world: &World,
    detector: &NominalDetector,
    axis: &Axis,
    rays: u32,
    seed: u64,
) -> Mean {
    let mut sums = Sums::default();
    sample(world, detector, axis, (rays, seed), |value, weight| sums.add(value, weight));
    sums.mean()
}

/// The flux through pupil and spot: the integral over both areas.
pub(crate) fn flux(
    world: &World,
    detector: &NominalDetector,
    axis: &Axis,
    rays: u32,
    seed: u64,
) -> Mean {
    let area = |radius: f64| PI * radius * radius;
    let areas = area(detector.pupil_radius_m) * area(detector.spot_radius_m);
    let mut sums = Sums::default();
    sample(world, detector, axis, (rays, seed), |value, weight| {
        sums.add(value * weight * areas, 1.0);
    });
    sums.mean()
}

/// Radiances of random rays, each with the throughput of a unit of both areas.
fn sample(
    world: &World,
    detector: &NominalDetector,
    axis: &Axis,
    (rays, seed): (u32, u64),
    mut each: impl FnMut(f64, f64),
) {
    let mut dice = Dice(seed);
    let (u, v) = axis.direction.any_orthonormal_pair();
    let across = |dice: &mut Dice, radius: f64| {
        let at = dice.in_disk() * radius;
        u * at.x + v * at.y
    };
    for _ in 0..rays {
        let spot = axis.spot + across(&mut dice, detector.spot_radius_m);
        let pupil = axis.spot
            + axis.direction * detector.distance_m
            + across(&mut dice, detector.pupil_radius_m);
        let along = spot - pupil;
        let direction = along.normalize();
        // dG = cos θ cos θ' dA dA' / r².
        let weight = direction.dot(axis.direction).powi(2) / along.length_squared();
        // A pupil below the plane sees nothing of the sample.
        let is_above = pupil.z > 0.0 && direction.z < 0.0;
        let value = if is_above { world.look(pupil, direction, &mut dice) } else { 0.0 };
        each(value, weight);
    }
}

/// The radiance along the axis alone, a tenth of a millimetre above its spot.
pub(crate) fn along_axis(world: &World, axis: &Axis, paths: u32, seed: u64) -> Mean {
    along(world, axis.spot + axis.direction * 1e-4, -axis.direction, paths, seed)
}

/// What arrives at a point against a direction.
pub(crate) fn along(world: &World, from: DVec3, into: DVec3, paths: u32, seed: u64) -> Mean {
    let mut dice = Dice(seed);
    let mut sums = Sums::default();
    for _ in 0..paths {
        sums.add(world.look(from, into, &mut dice), 1.0);
    }
    sums.mean()
}
