//! Samples and components as the fit takes them.

use std::sync::Arc;

use fit::{Common, Noise, Ray, Shift};

use super::{Calibrated, Component, Effect, Sample, readback};
use crate::rig::Pose;

/// What goes into a fit of a run's samples.
#[derive(Debug)]
pub struct FitInput {
    /// The samples, those left out whose value is not the radiance at their pose
    /// ([`super::Flags::excludes_from_fit`]).
    pub samples: Vec<fit::Sample>,
    /// What they share.
    pub common: Vec<Common>,
    /// Which of [`Calibrated::samples`] each of them is.
    pub places: Vec<usize>,
}

impl Calibrated {
    /// The samples as the fit takes them, with the noise that the detector's model gives, and the
    /// components that concern them.
    pub fn fit_input(&self) -> FitInput {
        let is_used = |sample: &Sample| !sample.flags.excludes_from_fit();
        let places: Vec<usize> =
            (0..self.samples.len()).filter(|&i| is_used(&self.samples[i])).collect();
        let used: Arc<[Sample]> = places.iter().map(|&i| self.samples[i].clone()).collect();
        let samples = used
            .iter()
            .map(|sample| fit::Sample {
                ray: sample.ray(),
                value: sample.value,
                noise: Noise::Modelled {
                    floor: sample.noise.floor,
                    per_radiance: sample.noise.per_radiance,
                },
            })
            .collect();
        let common = self
            .components
            .iter()
            .filter(|component| used.iter().any(|sample| component.concerns(sample)))
            .flat_map(|component| match component.effect {
                Effect::Readback { axis } => readback::components(component, axis, &used),
                _ => vec![common(component, &used)],
            })
            .collect();
        FitInput { samples, common, places }
    }
}

fn common(component: &Component, used: &Arc<[Sample]>) -> Common {
    let concerns_all = used.iter().all(|sample| component.concerns(sample));
    let (samples, own) = (Arc::clone(used), component.clone());
    let shift = match component.effect {
        Effect::Scale { .. } if concerns_all => Shift::Scale,
        Effect::Offset { .. } if concerns_all => Shift::Offset,
        Effect::Scale { .. } | Effect::Offset { .. } => {
            Shift::Value(Box::new(move |i, level| own.excess(&samples[i], level)))
        }
        Effect::Axis { .. } | Effect::Readback { .. } => {
            Shift::Ray(Box::new(move |i, _| ray(own.ray_seen(&samples[i], 1.0))))
        }
    };
    Common { name: component.name.clone(), u: component.u, shift }
}

pub(super) fn ray(pose: Pose) -> Ray {
    let Pose { x_m, y_m, theta_rad, phi_rad } = pose;
    Ray { x_m, y_m, theta_rad, phi_rad }
}
