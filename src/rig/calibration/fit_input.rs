//! Samples and components as the fit takes them.

use std::sync::Arc;

use fit::{Common, FitError, Noise, Ray, Readings, Rules, Shift};

use super::readback::{self, Shared};
use super::{Calibrated, Component, Effect, FittedDrift, Part, Reference, Sample, Spread};
use crate::rig::{AxisName, Pose};

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
        let used = self.samples.iter().filter(|sample| sample.part() != Part::None);
        let spread = Spread::of(used);
        Handing::new(self.components.clone(), &self.references, &spread, rules)
            .usable(&self.samples)
    }
}

/// How samples are handed to the fit, all or some of them: what they share is known of all.
#[derive(Debug, Clone)]
pub struct Handing {
    /// The drift by the reference readings, where it is fitted.
    pub drift: Option<FittedDrift>,
    /// Each with whether it is fitted along, and whether it concerns all samples alike.
    components: Vec<(Component, bool, bool)>,
    /// By axis.
    shared: Vec<(AxisName, Shared)>,
    /// Whether limits have no part.
    are_values_alone: bool,
}

impl Handing {
    /// For samples of such a spread; of the components those that concern none are left out.
    pub fn new(
        components: Vec<Component>,
        references: &[Reference],
        spread: &Spread,
        rules: &Rules,
    ) -> Self {
        let drift = match rules.drift {
            Some(false) => None,
            must => FittedDrift::of(references, must == Some(true)),
        };
        let fits_ranges = rules.ranges.unwrap_or(spread.gains.len() > 1);
        let handed = |component: Component| {
            let is_range =
                matches!(component.effect, Effect::Scale { gain: Some(_) } | Effect::Offset { .. });
            let is_alike = spread.is_concerned_alike(&component);
            (component, is_range && fits_ranges, is_alike)
        };
        let components = components.into_iter().filter(|component| spread.is_concerned(component));
        let components: Vec<_> = components.map(handed).collect();
        let axes = components.iter().filter_map(|(component, _, _)| match component.effect {
            Effect::Readback { axis } => Some((axis, Shared::of(spread, axis))),
            _ => None,
        });
        Self { drift, shared: axes.collect(), components, are_values_alone: false }
    }

    /// The same for a share of more readings, of such a spread of those that are values: nothing is fitted
    /// along, and limits are left out.
    pub fn of_share(components: Vec<Component>, spread: &Spread) -> Self {
        let rules = Rules { drift: Some(false), ranges: Some(false), ..Rules::default() };
        Self { are_values_alone: true, ..Self::new(components, &[], spread, &rules) }
    }

    /// Whether a sample is handed on.
    pub fn takes(&self, sample: &Sample) -> bool {
        match sample.part() {
            Part::None => false,
            Part::Limit => !self.are_values_alone,
            Part::Value => true,
        }
    }

    /// Refuses a drift that is asked for where the references don't tell it.
    pub fn demand(&self, rules: &Rules) -> Result<(), FitError> {
        demand_drift(self.drift.as_ref(), rules)
    }

    /// The samples of a part of the spread as the fit takes them, but those that have no part in it.
    pub fn usable(&self, samples: &[Sample]) -> FitInput {
        let places: Vec<usize> = (0..samples.len()).filter(|&i| self.takes(&samples[i])).collect();
        let used: Arc<[Sample]> = places.iter().map(|&i| samples[i].clone()).collect();
        let limits = (0..used.len()).filter(|&i| used[i].part() == Part::Limit).collect();
        let drift = self.drift.as_ref();
        let mut nuisances = drift.map_or_else(Vec::new, |drift| drift.nuisances(&used));
        let mut shared = Vec::new();
        for (component, is_fitted, is_alike) in &self.components {
            match component.effect {
                Effect::Readback { axis } => {
                    let of = self.shared.iter().filter(|(name, _)| *name == axis);
                    shared.extend(
                        of.flat_map(|(_, of)| readback::components(component, axis, &used, of)),
                    );
                }
                _ if *is_fitted => nuisances.push(common(component, &used, *is_alike)),
                _ => shared.push(common(component, &used, *is_alike)),
            }
        }
        let samples = used.iter().map(|sample| self.sample(sample)).collect();
        FitInput { samples, limits, common: shared, nuisances, drift: self.drift.clone(), places }
    }

    fn sample(&self, sample: &Sample) -> fit::Sample {
        let gain = 1.0 + self.drift.as_ref().map_or(0.0, |drift| drift.at(sample.middle_s()));
        fit::Sample {
            ray: sample.ray(),
            value: sample.value / gain,
            noise: Noise::Modelled {
                floor: sample.noise.floor / (gain * gain),
                per_radiance: sample.noise.per_radiance / gain,
            },
        }
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

pub(super) fn demand_drift(drift: Option<&FittedDrift>, rules: &Rules) -> Result<(), FitError> {
    if rules.drift != Some(true) || drift.is_some() {
        return Ok(());
    }
    let missing = "it takes three reference readings or more, at different times, of a reference \
                   that shines";
    Err(FitError::Nuisance { name: "drift", missing })
}

fn common(component: &Component, used: &Arc<[Sample]>, concerns_all: bool) -> Common {
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
