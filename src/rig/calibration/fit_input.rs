//! Samples and components as the fit takes them.

use std::sync::Arc;

use fit::{Common, Noise, Ray, Readings, Rules, Shift};

use super::{Calibrated, Component, Effect, FittedDrift, Part, Sample, readback};
use crate::rig::Pose;

/// What goes into a fit of a run's samples.
#[derive(Debug)]
pub struct FitInput {
    /// The samples but those that have no part in it ([`Part::None`]), the drift taken out.
    pub samples: Vec<fit::Sample>,
    /// Which of them are lower limits.
    pub limits: Vec<usize>,
    /// What they share.
    pub common: Vec<Common>,
    /// What of it is fitted along.
    pub nuisances: Vec<Common>,
    /// The drift by the reference readings, where it is fitted.
    pub drift: Option<FittedDrift>,
    /// Which of [`Calibrated::samples`] each of them is.
    pub places: Vec<usize>,
}

impl Calibrated {
    /// The samples as the fit takes them, with the noise that the detector's model gives, and the
    /// components that concern them.
    pub fn fit_input(&self, rules: &Rules) -> FitInput {
        self.input(rules, |part| part != Part::None)
    }

    /// The same for a share of more readings, which is looked at once: values alone, nothing fitted
    /// along.
    pub fn share_input(&self) -> FitInput {
        let rules = Rules { drift: Some(false), ranges: Some(false), ..Rules::default() };
        self.input(&rules, |part| part == Part::Value)
    }

    fn input(&self, rules: &Rules, is_used: impl Fn(Part) -> bool) -> FitInput {
        let places: Vec<usize> =
            (0..self.samples.len()).filter(|&i| is_used(self.samples[i].part())).collect();
        let used: Arc<[Sample]> = places.iter().map(|&i| self.samples[i].clone()).collect();
        let drift = match rules.drift {
            Some(false) => None,
            must => FittedDrift::of(&self.references, must == Some(true)),
        };
        let sample = |sample: &Sample| {
            let gain = 1.0 + drift.as_ref().map_or(0.0, |drift| drift.at(sample.middle_s()));
            fit::Sample {
                ray: sample.ray(),
                value: sample.value / gain,
                noise: Noise::Modelled {
                    floor: sample.noise.floor / (gain * gain),
                    per_radiance: sample.noise.per_radiance / gain,
                },
            }
        };
        let samples = used.iter().map(sample).collect();
        let limits = (0..used.len()).filter(|&i| used[i].part() == Part::Limit).collect();
        let first = used.first().map(|sample| sample.gain);
        let has_ranges = used.iter().any(|sample| Some(sample.gain) != first);
        let fits_ranges = rules.ranges.unwrap_or(has_ranges);
        let mut nuisances: Vec<Common> =
            drift.as_ref().map_or_else(Vec::new, |drift| drift.nuisances(&used));
        let mut shared = Vec::new();
        for component in &self.components {
            if !used.iter().any(|sample| component.concerns(sample)) {
                continue;
            }
            match component.effect {
                Effect::Readback { axis } => {
                    shared.extend(readback::components(component, axis, &used));
                }
                Effect::Scale { gain: Some(_) } | Effect::Offset { .. } if fits_ranges => {
                    nuisances.push(common(component, &used));
                }
                _ => shared.push(common(component, &used)),
            }
        }
        FitInput { samples, limits, common: shared, nuisances, drift, places }
    }
}

impl FitInput {
    /// As the fit takes them; `flown` are the ways of the samples.
    pub fn readings<'s>(&'s self, flown: &'s [Option<(Ray, Ray)>]) -> Readings<'s> {
        Readings {
            flown,
            limits: &self.limits,
            common: &self.common,
            nuisances: &self.nuisances,
            ..Readings::of(&self.samples)
        }
    }
}

fn common(component: &Component, used: &Arc<[Sample]>) -> Common {
    let concerns_all = used.iter().all(|sample| component.concerns(sample));
    let (samples, own) = (Arc::clone(used), component.clone());
    let shift = match component.effect {
        Effect::Scale { .. } if concerns_all => Shift::Scale,
        Effect::Beam { beam } => Shift::Beam(beam),
        Effect::Offset { .. } if concerns_all => Shift::Offset,
        Effect::Scale { .. } | Effect::Offset { .. } => {
            Shift::Value(Box::new(move |i, level| own.excess(&samples[i], level)))
        }
        Effect::Axis { .. } | Effect::Readback { .. } | Effect::Alignment { .. } => {
            Shift::Ray(Box::new(move |i, _| ray(own.ray_seen(&samples[i], 1.0))))
        }
    };
    Common { name: component.name.clone(), u: component.u, shift }
}

pub(super) fn ray(pose: Pose) -> Ray {
    let Pose { x_m, y_m, theta_rad, phi_rad } = pose;
    Ray { x_m, y_m, theta_rad, phi_rad }
}
