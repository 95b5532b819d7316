//! Chance for tests that sample: a seeded generator, directions, and what a sampled mean may be off by.
//! It shares nothing with the kernels.
#![allow(dead_code, unreachable_pub)] // each test takes what it needs

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

/// `SplitMix64` (Steele, Lea and Flood 2014).
pub struct Dice(pub u64);

impl Dice {
    /// Evenly in [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * (-53f64).exp2()
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Evenly over the sphere.
    pub fn direction(&mut self) -> DVec3 {
        let (z, phi) = (self.between(-1.0, 1.0), self.between(-PI, PI));
        let across = (1.0 - z * z).sqrt();
        DVec3::new(across * phi.cos(), across * phi.sin(), z)
    }

    /// Cosine-weighted about a unit normal.
    pub fn ray(&mut self, normal: DVec3) -> DVec3 {
        let (x, y) = normal.any_orthonormal_pair();
        let square = self.unit();
        let across = DVec2::from_angle(TAU * self.unit()) * square.sqrt();
        x * across.x + y * across.y + normal * (1.0 - square).sqrt()
    }
}

/// One in 10^7 by chance.
pub const SIGMAS: f64 = 5.3;

/// The mean of samples, and its standard deviation.
pub fn mean(samples: u32, mut sample: impl FnMut() -> f64) -> (f64, f64) {
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..samples {
        let value = sample();
        sum += value;
        squares += value * value;
    }
    let count = f64::from(samples);
    let mean = sum / count;
    (mean, ((squares / count - mean * mean) / count).sqrt())
}
