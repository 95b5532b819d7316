//! What leaves the sample, exactly: the numbers that a fit is compared with, by the same
//! definitions. Free of detector, noise and beam.

use crate::Scene;

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
#[derive(Debug, Clone, Copy)]
pub struct Truth<'c> {
    scene: &'c Scene,
    region: Region,
}

impl<'c> Truth<'c> {
    pub(crate) const fn new(scene: &'c Scene, region: Region) -> Self {
        Self { scene, region }
    }

    /// The region that it is taken over.
    pub const fn region(&self) -> &Region {
        &self.region
    }

    /// Radiance from (x, y) into (θ, φ), W·m⁻²·sr⁻¹ or cd·m⁻². Zero off every emitter.
    pub fn radiance(&self, x_m: f64, y_m: f64, theta_rad: f64, phi_rad: f64) -> f64 {
        self.scene.radiance(x_m, y_m, theta_rad, phi_rad)
    }

    /// Exitance into the whole hemisphere, the mean over the region's rectangle, W·m⁻² or
    /// lm·m⁻².
    pub fn exitance(&self) -> f64 {
        self.exitance_up_to(core::f64::consts::FRAC_PI_2)
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
}
