//! What a plan is going to know, before anything moves. Readings are made up of what the plan
//! expects, calibrated as real ones are, so that each has the noise and the common components that
//! the run's will have; the fit's own solver then says what they determine, and how well.
//!
//! It knows no scene. What it does not foresee: a source that drifts, and fields that differ from
//! what the plan declares.

use fit::{BasisSpec, FitError, Noise, Optics, Penalised, Predicted, Sample, Shift};

use super::parts::{Budget, Parts};
use super::prior::{Feature, Features, Prior, ray, region};
use crate::plan::{Plan, Sequence, Step};
use crate::rig::calibration::{Calibrated, Effect, FitInput, calibrate};
use crate::rig::{AxisPositions, Latched, Reading, ReadingKind, Rig, forward};

/// Readings times coefficients squared that are looked at: a second's work.
const WORK_MAX: f64 = 3e9;
/// What a basis that is chosen from the readings is taken to be.
const DEGREES_ASSUMED: [usize; 7] = [12, 10, 8, 6, 4, 2, 0];
const POSITION_ASSUMED: usize = 1;
/// A misfit below this part of the noise variance is not worth fitting again for.
const MISFIT_MIN: f64 = 0.01;

/// What a plan is going to know.
#[derive(Debug, Clone, PartialEq)]
pub struct Forecast {
    /// What was expected.
    pub prior: Prior,
    /// Coefficients of the fit.
    pub coefficients: usize,
    /// What stands in for what the plan leaves to the readings: a basis, without a penalty.
    pub stands_in: Option<BasisSpec>,
    /// Condition of the fit.
    pub condition: f64,
    /// The exitance that is expected.
    pub exitance: f64,
    /// The flux that is expected.
    pub flux: f64,
    /// Of exitance and flux, relative to them. They differ by the region's area alone. What lies beyond the
    /// region is extrapolated as far as the basis goes, and no further foretold.
    pub of_exitance: Budget,
    /// Of the exitance into the region's own cone: what rests on measurement.
    pub of_exitance_within_region: Budget,
    /// The part of the expected exitance that lies beyond it.
    pub beyond_region: f64,
    /// Of the radiance, root mean square over the region (weighted by throughput), relative to the
    /// root mean square of the expected radiance.
    pub of_radiance: Budget,
    /// The radiance's largest within the region, relative to the same; without truncation.
    pub radiance_worst: f64,
    /// The same without the scale.
    pub radiance_worst_without_scale: f64,
    /// Whether the plan declares features in position and none in direction: a fit that finds the one looks for
    /// the other, too, and states what may lie between the directions that were read.
    pub is_direction_open: bool,
    /// What the light itself leaves of the radiance's relative u, were there no other noise and no
    /// other error: √(p/N) for p coefficients from N photoelectrons, the mean over the readings of
    /// a fit of p coefficients to readings of equal noise.
    pub photon_limit: f64,
    /// Whether the expected radiance fills the gain range.
    pub saturates: bool,
}

/// Why there is no forecast.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ForecastError {
    /// The fit will be refused.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// It would take longer than a person waits.
    #[error("{readings} readings and {coefficients} coefficients are too many for a forecast")]
    TooLarge {
        /// Readings of targets.
        readings: usize,
        /// Coefficients of the fit.
        coefficients: usize,
    },
    /// Nobody knows yet what will be measured.
    #[error("readings decide what is measured, until the plan's target is met")]
    Open,
    /// The plan's readings can't be calibrated.
    #[error("{0}")]
    Calibration(String),
}

impl Forecast {
    /// Of a plan laid out on a rig. Where the plan leaves the basis to the readings, in Zernike
    /// polynomials of the highest even degree up to 12 that its poses determine.
    pub fn of(plan: &Plan, rig: &Rig, sequence: &Sequence) -> Result<Self, ForecastError> {
        if plan.adaptive().is_some() {
            return Err(ForecastError::Open);
        }
        if let Some(model) = plan.fit.decided() {
            return Self::in_model(plan, rig, sequence, model);
        }
        let mut last = None;
        for degree in DEGREES_ASSUMED {
            let angular = plan.fit.angular_degree.unwrap_or(degree);
            let position = plan.fit.position_degree.unwrap_or(POSITION_ASSUMED);
            let basis = BasisSpec::zernike(angular, position);
            match Self::in_model(plan, rig, sequence, basis.into()) {
                Ok(forecast) => return Ok(Self { stands_in: Some(basis), ..forecast }),
                Err(error) => last = Some(error),
            }
        }
        Err(last.unwrap_or(ForecastError::Fit(FitError::Empty)))
    }

    /// Why the plan's fit will be refused, if it will: a part of the work, for who is about to run it.
    pub fn refusal(plan: &Plan, rig: &Rig, sequence: &Sequence) -> Option<FitError> {
        let model = plan.fit.decided()?;
        let prior = Prior::of(plan, rig, sequence.steps.first().map_or(0, |step| step.gain));
        let samples =
            expected(rig, &prior, &sequence.steps).ok()?.fit_input(&plan.fit.rules).samples;
        let work = samples.len() as f64 * (model.basis.len() as f64).powi(2);
        if work > WORK_MAX {
            return None;
        }
        fit::predict(&samples, &[], &region(plan), model, &[], None, &[]).err()
    }

    fn in_model(
        plan: &Plan,
        rig: &Rig,
        sequence: &Sequence,
        model: Penalised,
    ) -> Result<Self, ForecastError> {
        let optics = rig.detector.beam().ok().map(|beam| Optics { beam, outline: plan.sample });
        let gain = sequence.steps.first().map_or(0, |step| step.gain);
        let prior = Prior::of(plan, rig, gain);
        let calibrated = expected(rig, &prior, &sequence.steps)?;
        // Nothing drifts and nothing is saturated in a forecast; what would be fitted along is
        // carried, which says a little more.
        let none = fit::Rules { drift: Some(false), ranges: Some(false), ..plan.fit.rules };
        let FitInput { mut samples, mut common, places, .. } = calibrated.fit_input(&none);
        if prior.exponent <= 0.0 && plan.sample.is_none() {
            // Being off along an even field changes nothing.
            common.retain(|c| !matches!(c.shift, Shift::Ray(_) | Shift::Jitter(_)));
            for common in common.iter_mut().filter(|c| matches!(c.shift, Shift::Beam(_))) {
                common.shift = Shift::Scale;
            }
        }
        let flown: Vec<_> = places.iter().map(|i| calibrated.samples[*i].flown()).collect();
        let (readings, coefficients) = (samples.len(), model.basis.len());
        if readings as f64 * (coefficients as f64).powi(2) > WORK_MAX {
            return Err(ForecastError::TooLarge { readings, coefficients });
        }
        let photon_limit = libm::sqrt(coefficients as f64 / photoelectrons(&samples));
        let features = [prior.in_direction(plan), prior.in_position(plan)];
        let fields: Vec<Vec<f64>> = features
            .iter()
            .flat_map(Features::iter)
            .map(|feature| samples.iter().map(|sample| feature.radiance(&sample.ray)).collect())
            .collect();
        jitter(rig, &features, &fields, &calibrated, &mut samples);
        let (region, optics) = (region(plan), optics.as_ref());
        let mut predicted =
            fit::predict(&samples, &flown, &region, model, &common, optics, &fields)?;
        if let Some(misfit) = misfit(&predicted, &features, &samples) {
            for sample in &mut samples {
                add(&mut sample.noise, misfit);
            }
            predicted.fit =
                fit::predict(&samples, &flown, &region, model, &common, optics, &[])?.fit;
        }
        let scales = scales(&calibrated);
        let Parts { of_exitance, of_exitance_within_region, beyond_region, of_radiance, worst } =
            Parts::of(&prior, &features, &predicted, &scales);
        let fit = &predicted.fit;
        Ok(Self {
            prior,
            coefficients,
            stands_in: None,
            condition: fit.condition(),
            exitance: fit.exitance().value,
            flux: fit.flux().value,
            of_exitance,
            of_exitance_within_region,
            beyond_region,
            of_radiance,
            radiance_worst: worst[0],
            radiance_worst_without_scale: worst[1],
            is_direction_open: features[0].is_empty() && !features[1].is_empty(),
            photon_limit,
            saturates: prior.level > rig.detector.saturation_radiance(gain),
        })
    }
}

/// The readings of steps, as expected without noise or dark current, as samples.
fn expected(rig: &Rig, prior: &Prior, steps: &[Step]) -> Result<Calibrated, ForecastError> {
    let readings: Vec<Reading> = steps.iter().map(|step| reading(rig, prior, step)).collect();
    calibrate(rig, &readings).map_err(|error| ForecastError::Calibration(error.to_string()))
}

fn reading(rig: &Rig, prior: &Prior, step: &Step) -> Reading {
    let detector = &rig.detector;
    let n = detector.adc.readings_in(step.dwell);
    let is_dark = step.kind == ReadingKind::Dark;
    let radiance =
        step.pose.filter(|_| !is_dark).map_or(0.0, |pose| prior.radiance(pose.theta_rad));
    let travel = step.swept.map_or(Latched::ZERO, |swept| swept.travel);
    Reading {
        id: step.id,
        kind: step.kind,
        gain: step.gain,
        n,
        mean: radiance * detector.a_per_radiance() / detector.lsb_a(step.gain),
        variance: 0.0,
        min: 0,
        max: 0,
        saturated: 0,
        commanded: step.counts,
        travel,
        start: step.counts,
        end: step.counts.plus(travel, 1),
        start_us: 0,
        end_us: i64::try_from(step.dwell.as_micros()).unwrap_or(i64::MAX),
        time_s: f64::from(step.id),
        session: 0,
        device_times: crate::rig::DeviceTimes::default(),
        link_retries: 0,
        unsettled: false,
    }
}

/// How many the expected radiance frees in all readings: shot noise is their Poisson noise.
fn photoelectrons(samples: &[Sample]) -> f64 {
    let of = |sample: &Sample| match sample.noise {
        Noise::Modelled { per_radiance, .. } if per_radiance > 0.0 => {
            sample.value.max(0.0) / per_radiance
        }
        _ => 0.0,
    };
    samples.iter().map(of).sum()
}

/// Each position is known to its axis's readback alone: where a feature is steep that is noise. What it
/// does to the expected field is among the components. `fields` are the features' radiances along the
/// samples' rays, in the features' order.
fn jitter(
    rig: &Rig,
    features: &[Features; 2],
    fields: &[Vec<f64>],
    calibrated: &Calibrated,
    samples: &mut [Sample],
) {
    for (i, (sample, own)) in samples.iter_mut().zip(&calibrated.samples).enumerate() {
        let AxisPositions(at) = own.positions;
        let mut variance = 0.0;
        for (axis, of) in rig.axes.iter().enumerate() {
            let mut moved = at;
            moved[axis] += of.u_readback;
            let seen = ray(forward(AxisPositions(moved)));
            let mut fields = fields.iter();
            for kind in features.iter().filter(|kind| !kind.is_empty()) {
                let pairs = kind.iter().zip(fields.by_ref().take(kind.len()));
                let change = |(feature, field): (&Feature, &Vec<f64>)| {
                    (feature.radiance(&seen) - field[i]).powi(2)
                };
                variance += pairs.map(change).sum::<f64>() / kind.len() as f64;
            }
        }
        add(&mut sample.noise, variance);
    }
}

/// The variance that the basis leaves of what is expected, where it shows beside the noise: the
/// expected field's own, and the mean over the features of each kind.
fn misfit(predicted: &Predicted, features: &[Features; 2], samples: &[Sample]) -> Option<f64> {
    let mut variance = predicted.fit.residual_rms().powi(2);
    let mut fields = predicted.fields.iter();
    for kind in features.iter().filter(|kind| !kind.is_empty()) {
        let squares = fields.by_ref().take(kind.len()).map(|field| field.residual_rms.powi(2));
        variance += squares.sum::<f64>() / kind.len() as f64;
    }
    let noise = |sample: &Sample| match sample.noise {
        Noise::Modelled { floor, per_radiance } => floor + per_radiance * sample.value.max(0.0),
        Noise::Fixed { variance } => variance,
        Noise::Unknown => 0.0,
    };
    let mean = samples.iter().map(noise).sum::<f64>() / samples.len() as f64;
    (variance > MISFIT_MIN * mean).then_some(variance)
}

fn add(noise: &mut Noise, more: f64) {
    match noise {
        Noise::Modelled { floor, .. } => *floor += more,
        Noise::Fixed { variance } => *variance += more,
        Noise::Unknown => {}
    }
}

/// The components that are a factor common to all readings, as a budget's rows name them.
fn scales(calibrated: &Calibrated) -> Vec<String> {
    let is_scale = |effect: Effect| matches!(effect, Effect::Scale { .. } | Effect::Beam { .. });
    let scales = calibrated.components.iter().filter(|component| is_scale(component.effect));
    let row = |name: &str| name.split_once(" @ ").map_or(name, |(row, _)| row).to_owned();
    scales.map(|component| row(&component.name)).collect()
}
