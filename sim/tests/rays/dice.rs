//! Random numbers of the slow reference's own.

use core::f64::consts::TAU;

use glam::{DVec2, DVec3};

/// `SplitMix64` (Steele, Lea, Flood 2014).
#[derive(Debug, Clone)]
pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    /// In [0, 1).
    pub(crate) fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Evenly in a disk of radius one.
    pub(crate) fn in_disk(&mut self) -> DVec2 {
        DVec2::from_angle(TAU * self.roll()) * self.roll().sqrt()
    }

    /// Into the hemisphere of a normal, with a density of cos θ / π (Malley's method).
    pub(crate) fn around(&mut self, normal: DVec3) -> DVec3 {
        let (u, v) = normal.any_orthonormal_pair();
        let at = self.in_disk();
        u * at.x + v * at.y + normal * (1.0 - at.length_squared()).max(0.0).sqrt()
    }

    /// Evenly over the directions up to an angle from an axis.
    pub(crate) fn in_cone(&mut self, axis: DVec3, half_angle: f64) -> DVec3 {
        let (u, v) = axis.any_orthonormal_pair();
        // 1 - cos without cancellation.
        let depth = self.roll() * 2.0 * (half_angle / 2.0).sin().powi(2);
        let ring = DVec2::from_angle(TAU * self.roll()) * (depth * (2.0 - depth)).sqrt();
        u * ring.x + v * ring.y + axis * (1.0 - depth)
    }
}
