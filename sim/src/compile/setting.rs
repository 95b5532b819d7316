//! What every effect is weighed by: what can be seen where readings will be taken, the noise that
//! one of them will have, and from that how much may be left out. It does not know any effect.

use std::sync::Arc;

use radiometry::throughput::coaxial_disks;

use super::CompileError;
use crate::detector::ELEMENTARY_CHARGE_C;
use crate::field::Field;
use crate::light::{self, Scenery};
use crate::{Nominal, Region, Scene, Simulated, Terms};

/// What every candidate is weighed by. Nothing in it is drawn: what a rig is compiled to does not
/// depend on the seed.
#[derive(Debug)]
pub(crate) struct Setting<'s> {
    pub(crate) scene: &'s Scene,
    pub(crate) scenery: &'s Scenery,
    pub(crate) nominal: &'s Nominal,
    pub(crate) simulated: &'s Simulated,
    pub(crate) terms: &'s Terms,
    /// Where readings will be taken.
    pub(crate) region: Region,
    /// What can be seen there.
    pub(crate) field: Arc<dyn Field>,
    /// Photocurrent per radiance as stated.
    pub(crate) current_per_radiance: f64,
    /// The largest radiance of the region.
    pub(crate) brightest: f64,
    /// The noise floor: the standard deviation of a dwell's mean in the dark, as a radiance.
    pub(crate) floor: f64,
    /// How much all that is left out may amount to, relative.
    pub(crate) tolerance: f64,
}

/// What is left out must not show beside the noise of one dwell.
pub(crate) const PART_OF_NOISE: f64 = 0.1;

impl<'s> Setting<'s> {
    pub(super) fn new(
        scenery: &'s Scenery,
        nominal: &'s Nominal,
        simulated: &'s Simulated,
        terms: &'s Terms,
    ) -> Result<Self, CompileError> {
        let detector = &nominal.detector;
        let throughput =
            coaxial_disks(detector.pupil_radius_m, detector.spot_radius_m, detector.distance_m)
                .map_err(|_| CompileError::Drawn("throughput", detector.distance_m))?;
        let scene = &*scenery.scene;
        let region = terms.region.unwrap_or_else(|| scene.bounding_region());
        let field = light::field(scenery, Some(detector.distance_m), &|_| true)?;
        let mut setting = Self {
            scene,
            scenery,
            nominal,
            simulated,
            terms,
            region,
            current_per_radiance: detector.responsivity_a_per_w * throughput.m2_sr(),
            brightest: field.brightest(&region),
            field,
            floor: 0.0,
            tolerance: 0.0,
        };
        setting.floor = setting.noise_a(0.0) / setting.current_per_radiance;
        let default = setting.relative_noise() * PART_OF_NOISE;
        setting.tolerance = terms.tolerance.unwrap_or(default);
        Ok(setting)
    }

    /// The largest photocurrent of the region, amperes.
    pub(crate) fn brightest_a(&self) -> f64 {
        self.brightest * self.current_per_radiance
    }

    /// Predicted standard deviation of a dwell's mean at a radiance, as a radiance.
    pub(crate) fn noise(&self, radiance: f64) -> f64 {
        self.noise_a(radiance * self.current_per_radiance) / self.current_per_radiance
    }

    /// Predicted standard deviation of a dwell's mean at a photocurrent, amperes: shot noise, read
    /// noise and the converter's steps.
    fn noise_a(&self, current_a: f64) -> f64 {
        let detector = &self.nominal.detector;
        let rate_hz = f64::from(detector.adc_rate_hz);
        let count_a = self.full_scale_a() / libm::scalbn(1.0, i32::from(detector.adc_bits) - 1);
        let variance = ELEMENTARY_CHARGE_C * current_a * rate_hz
            + detector.read_noise_a * detector.read_noise_a
            + count_a * count_a / 12.0;
        libm::sqrt(variance / (self.terms.dwell_s * rate_hz).max(1.0))
    }

    /// Of the range that a person would choose: the finest that the brightest ray does not fill.
    fn full_scale_a(&self) -> f64 {
        let ranges = self.nominal.detector.gains.iter().map(|gain| gain.full_scale_a);
        let coarsest = ranges.clone().fold(0.0, f64::max);
        let brightest_a = self.brightest_a();
        ranges.filter(|full_scale_a| *full_scale_a > brightest_a).fold(coarsest, f64::min)
    }

    /// Predicted relative noise of one dwell on the region's brightest ray.
    fn relative_noise(&self) -> f64 {
        let brightest_a = self.brightest_a();
        self.noise_a(brightest_a) / brightest_a.max(self.noise_a(0.0))
    }
}
