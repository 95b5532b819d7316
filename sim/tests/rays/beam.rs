//! The detector by brute force: a ray from a place of the pupil through a place of the spot, again and
//! again, each with the throughput of its two area elements.

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
    let mut dice = Dice(seed);
    let (u, v) = axis.direction.any_orthonormal_pair();
    let mut across = |radius: f64| {
        let at = dice.in_disk() * radius;
        u * at.x + v * at.y
    };
    let ends: Vec<(DVec3, DVec3)> = (0..rays)
        .map(|_| {
            let spot = axis.spot + across(detector.spot_radius_m);
            let pupil =
                axis.spot + axis.direction * detector.distance_m + across(detector.pupil_radius_m);
            (spot, pupil)
        })
        .collect();
    let mut sums = Sums::default();
    for (spot, pupil) in ends {
        let along = spot - pupil;
        let direction = along.normalize();
        // dG = cos θ cos θ' dA dA' / r².
        let weight = direction.dot(axis.direction).powi(2) / along.length_squared();
        // A pupil below the plane sees nothing of the sample.
        let is_above = pupil.z > 0.0 && direction.z < 0.0;
        let value = if is_above { world.look(pupil, direction, &mut dice) } else { 0.0 };
        sums.add(value, weight);
    }
    sums.mean()
}

/// The radiance along the axis alone, a tenth of a millimetre above its spot.
pub(crate) fn along_axis(world: &World, axis: &Axis, paths: u32, seed: u64) -> Mean {
    let mut dice = Dice(seed);
    let mut sums = Sums::default();
    let above = axis.spot + axis.direction * 1e-4;
    for _ in 0..paths {
        sums.add(world.look(above, -axis.direction, &mut dice), 1.0);
    }
    sums.mean()
}
