//! Rays, fields and noise that the tests share. Everything is drawn from a seed.

pub(crate) mod disturbed;

use fit::{Noise, Ray, Region, Sample};
use rand_core::Rng;
use rand_pcg::Pcg64;
use std::f64::consts::{PI, TAU};

/// ±20 mm by ±10 mm, off the origin, to 80°.
pub(crate) const REGION: Region = Region::surface((-0.02, 0.02), (0.005, 0.025), 80.0 * PI / 180.0);

/// A die with a name for what it is cast for.
pub(crate) struct Die(Pcg64);

impl Die {
    pub(crate) fn new(seed: u64) -> Self {
        // Odd multiples spread neighbouring seeds over the generator's period.
        let state = u128::from(seed).wrapping_mul(0x9e37_79b9_7f4a_7c15_f39c_c060_5ced_c835);
        Self(Pcg64::new(state, 0x676f_6e69_6f00))
    }

    /// In [0, 1).
    pub(crate) fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * 2f64.powi(-53)
    }

    /// Mean 0, variance 1 (Box and Muller 1958).
    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(1.0 - self.uniform())).sqrt();
        radius * libm::cos(TAU * self.uniform())
    }
}

/// Rays spread evenly in solid angle and position over the region.
pub(crate) fn spread_rays(count: usize, region: &Region, seed: u64) -> Vec<Ray> {
    let mut die = Die::new(seed);
    let cos_min = libm::cos(region.theta_max_rad);
    let between = |(from, to): (f64, f64), t: f64| from + (to - from) * t;
    (0..count)
        .map(|_| Ray {
            x_m: between(region.x_m, die.uniform()),
            y_m: between(region.y_m, die.uniform()),
            theta_rad: libm::acos(between((1.0, cos_min), die.uniform())),
            phi_rad: TAU * die.uniform() - PI,
        })
        .collect()
}

/// What a rig measures: a grid of polar angles and azimuths at each of a grid of positions.
pub(crate) fn raster_rays(region: &Region, rings: usize, spokes: usize, side: usize) -> Vec<Ray> {
    let between =
        |(from, to): (f64, f64), i: usize| from + (to - from) * (i as f64 + 0.5) / side as f64;
    let mut rays = Vec::new();
    for at in 0..side * side {
        for ring in 0..rings {
            for spoke in 0..spokes {
                rays.push(Ray {
                    x_m: between(region.x_m, at % side),
                    y_m: between(region.y_m, at / side),
                    theta_rad: region.theta_max_rad * ring as f64 / (rings - 1) as f64,
                    phi_rad: TAU * spoke as f64 / spokes as f64,
                });
            }
        }
    }
    rays
}

/// Samples of a field without error, their noise said to be small.
pub(crate) fn exact(rays: &[Ray], field: impl Fn(&Ray) -> f64) -> Vec<Sample> {
    let noise = Noise::Fixed { variance: 1e-4 };
    rays.iter().map(|ray| Sample { ray: *ray, value: field(ray), noise }).collect()
}

/// The position mapped to [-1, 1]² by hand.
pub(crate) fn scaled(ray: &Ray) -> (f64, f64) {
    (ray.x_m / 0.02, (ray.y_m - 0.015) / 0.01)
}
