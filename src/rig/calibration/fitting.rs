//! From a run's samples to the field that they are samples of: which enter, with which noise, and
//! what they share. The fit itself is the fit crate's.

use std::sync::Arc;

use fit::{BasisSpec, Common, Fit, FitError, Noise, Ray, Region, Shift};

use super::{Calibrated, Component, Effect, Flag, Sample};
use crate::rig::Pose;

/// Samples that carry one of these say nothing of the radiance along the pose that they state.
const EXCLUDING: [Flag; 2] = [Flag::Saturated, Flag::Unsettled];

/// A fit, and which samples it rests on.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// The field.
    pub fit: Fit,
    /// How many samples were left out because they were saturated or unsettled.
    pub n_excluded: usize,
}

impl From<Pose> for Ray {
    fn from(pose: Pose) -> Self {
        Self {
            x_m: pose.x_m,
            y_m: pose.y_m,
            theta_rad: pose.theta_rad,
            phi_rad: pose.phi_rad,
        }
    }
}

impl Sample {
    /// Whether it enters a fit.
    pub fn is_usable(&self) -> bool {
        !EXCLUDING.iter().any(|flag| self.flags.contains(*flag))
    }
}

impl Calibrated {
    /// Fits the field to the usable samples. Saturated and unsettled ones are left out and
    /// counted; components that samples share are carried through the fit.
    pub fn fit(&self, region: &Region, basis: BasisSpec) -> Result<Fitted, FitError> {
        self.fit_first(self.samples.len(), region, basis)
    }

    /// The same from the `count` samples that were taken first: what a run knew by then.
    pub fn fit_first(
        &self,
        count: usize,
        region: &Region,
        basis: BasisSpec,
    ) -> Result<Fitted, FitError> {
        let mut taken: Vec<&Sample> = self.samples.iter().collect();
        taken.sort_by(|a, b| a.time_s.total_cmp(&b.time_s).then(a.reading.cmp(&b.reading)));
        taken.truncate(count);
        let n_taken = taken.len();
        let used: Arc<[Sample]> =
            taken.into_iter().filter(|sample| sample.is_usable()).cloned().collect();
        let samples: Vec<fit::Sample> = used.iter().map(as_fit_sample).collect();
        let common: Vec<Common> =
            self.components.iter().map(|component| as_common(component, &used)).collect();
        let fit = fit::fit(&samples, region, basis, &common)?;
        Ok(Fitted { fit, n_excluded: n_taken - used.len() })
    }

    /// States every sample's uncertainty at the level that the fit gives it.
    pub fn restate_from(&mut self, fit: &Fit) {
        self.restate(|_, sample| fit.value(&sample.pose.into()));
    }
}

fn as_fit_sample(sample: &Sample) -> fit::Sample {
    let noise = Noise::Modelled {
        floor: sample.noise.floor,
        per_radiance: sample.noise.per_radiance,
    };
    fit::Sample { ray: sample.pose.into(), value: sample.value, noise }
}

fn as_common(component: &Component, used: &Arc<[Sample]>) -> Common {
    let (name, u) = (component.name.clone(), component.u);
    let (component, used) = (component.clone(), Arc::clone(used));
    let shift = match component.effect {
        Effect::Scale { gain: None } => Shift::Scale,
        Effect::Axis { .. } => {
            Shift::Ray(Box::new(move |index, _| component.ray_seen(&used[index]).into()))
        }
        Effect::Offset { .. } | Effect::Scale { gain: Some(_) } => {
            Shift::Value(Box::new(move |index, level| component.excess(&used[index], level)))
        }
    };
    Common { name, u, shift }
}
