//! A compiled rig: what it holds, what can be asked of it, and the same rig with one effect less.

use std::sync::Arc;

use super::drawn::Drawn;
use crate::effect::{Chosen, EffectRow};
use crate::field::{Field, Ray};
use crate::light::Scenery;
use crate::optics::{Axis, FINITE_BEAM, Optics, PointSampled};
use crate::stage::Stages;
use crate::{Nominal, Region, Scene, Simulated, Truth, detector, light, time};

/// A rig as it is: what the host will never see but through its readings.
#[derive(Debug, Clone)]
pub struct Compiled {
    pub(crate) scene: Arc<Scene>,
    pub(crate) nominal: Nominal,
    pub(crate) simulated: Simulated,
    pub(crate) seed: u64,
    pub(crate) drawn: Drawn,
    /// What the detector sees along a ray.
    pub(super) seen: Arc<dyn Field>,
    /// What leaves the sample.
    pub(super) field: Arc<dyn Field>,
    /// The names of the effects of light: without one of them, something else is seen.
    pub(super) light: Vec<String>,
    pub(super) scenery: Scenery,
    pub(crate) optics: Arc<dyn Optics>,
    pub(crate) chosen: Chosen,
    pub(super) region: Region,
    pub(super) tolerance: f64,
}

impl Compiled {
    /// One row an effect, in or out.
    pub fn effects(&self) -> &[EffectRow] {
        &self.chosen.rows
    }

    /// The same rig with one of its effects left out, and nothing else changed: to see what that
    /// effect does, or what it costs. `None` for what is not in, or is part of what a reading is.
    pub fn less(&self, effect: &str) -> Option<Self> {
        let mut less = self.clone();
        less.chosen = self.chosen.less(effect)?;
        // What was drawn before was sound; less of it is.
        less.drawn = Drawn::new(&self.nominal, &self.simulated, self.seed, &less.chosen).ok()?;
        if self.light.iter().any(|name| name == effect) {
            let is_in = |name: &str| less.chosen.has(name);
            let distance_m = Some(self.nominal.detector.distance_m);
            less.seen = light::field(&self.scenery, distance_m, &is_in).ok()?;
            less.field = light::field(&self.scenery, None, &is_in).ok()?;
            less.optics = self.optics.looking_at(Arc::clone(&less.seen));
        }
        if !less.chosen.has(FINITE_BEAM) {
            less.optics = Arc::new(PointSampled(Arc::clone(&less.seen)));
        }
        Some(less)
    }

    /// What emits.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Where the effects were weighed.
    pub const fn region(&self) -> &Region {
        &self.region
    }

    /// How much all that was left out may change a reading, relative to it.
    pub const fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// Radiance along a ray, as it leaves the sample.
    pub fn radiance(&self, ray: &Ray) -> f64 {
        self.field.radiance(ray)
    }

    /// What the detector sees from there: the mean radiance of its beam, or the radiance along its
    /// axis if the beam was left out.
    pub fn seen_radiance(&self, axis: &Axis) -> f64 {
        self.optics.radiance(axis)
    }

    /// What leaves the sample, over a region.
    pub fn truth(&self, region: Region) -> Truth<'_> {
        Truth::new(&self.scene, &*self.field, region)
    }

    /// ADC readings a second.
    pub fn adc_rate_hz(&self) -> u32 {
        self.nominal.detector.adc_rate_hz
    }

    /// Photocurrent per radiance as drawn, A per W·m⁻²·sr⁻¹ (or per cd·m⁻²).
    pub fn current_per_radiance(&self) -> f64 {
        self.drawn.current_per_radiance
    }

    /// The stages that a photocurrent goes through on its way to the converter.
    pub(crate) fn stages(&self) -> Stages {
        let mut stages = Stages::default();
        detector::stray_light(self, &mut stages);
        time::stages(self, &mut stages);
        detector::stages(self, &mut stages);
        stages
    }
}
