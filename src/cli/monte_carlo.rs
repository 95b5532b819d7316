//! `gonio fit --monte-carlo`: the readings that might have been, refitted, beside the u of the fit
//! itself. The dice are rolled here: the fit is handed deviates.

use fit::trials::{Spread, Trial, Trials};
use fit::{Chart, Estimate, Fit, FitError, Functional, Nonnegative, SymmetryError, SymmetryTest};
use radiometry::direction::unit;

use super::args::FitArgs;
use super::derive::derive;
use super::failure::Failure;
use super::text::{row, with_uncertainty};
use crate::export::{
    DerivedKind, DerivedOutcome, DerivedQuantity, MonteCarlo, PeakDirection, Propagated, charted,
};
use crate::plan::{Asked, Wanted};
use crate::rig::Quantity;
use crate::study::coverage::Draws;

/// With more, the trials' numbers no longer fit a small machine's memory.
const TRIALS_MAX: usize = 1_000_000;

/// How many trials, and the seed of their dice.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dice {
    trials: usize,
    seed: u64,
}

/// What is propagated: by a functional of its own, or asked of each trial's fit.
struct Number {
    name: String,
    unit: &'static str,
    linear: Estimate,
    functional: Option<Functional>,
    trials: Vec<f64>,
}

impl Dice {
    /// Of the command line.
    pub(super) fn of(args: &FitArgs) -> Result<Option<Self>, Failure> {
        let Some(trials) = args.monte_carlo else { return Ok(None) };
        if !(Spread::TRIALS_MIN..=TRIALS_MAX).contains(&trials) {
            return Err(Failure::with_help(
                format!(
                    "--monte-carlo: {trials} trials; expected {} to {TRIALS_MAX}",
                    Spread::TRIALS_MIN
                ),
                "10000 tell the ends of a 95 % interval to 0.03 u, 1000000 to 0.003 u",
            ));
        }
        Ok(Some(Self { trials, seed: args.seed }))
    }

    /// Makes the trials.
    pub(super) fn roll(
        self,
        fit: &Fit,
        trials: &Trials<'_>,
        quantity: Quantity,
        (wanted, derived): (&[Wanted], &[DerivedQuantity]),
    ) -> MonteCarlo {
        let peak = fit.peak();
        let mut numbers = region_numbers(fit, quantity);
        let along_peak = fit.weighted_rays([(peak.ray, 1.0)]);
        numbers.push(Number::of(
            &format!("{}_along_peak_ray", quantity.name()),
            DerivedKind::Radiance.unit(quantity),
            peak.radiance,
            Some(along_peak),
        ));
        let highest = numbers.len();
        let unit_here = DerivedKind::Radiance.unit(quantity);
        numbers.push(Number::of(quantity.peak_key(), unit_here, peak.radiance, None));
        let first_derived = numbers.len();
        numbers.extend(derived.iter().filter_map(|one| derived_number(one, quantity)));
        let shaped: Vec<Wanted> = wanted.iter().filter(|one| has_a_shape(one)).cloned().collect();
        let place = |one: &DerivedQuantity| {
            numbers.iter().skip(first_derived).position(|number| number.name == one.name)
        };
        let places: Vec<Option<usize>> =
            derived.iter().filter(|one| is_of_shape(one)).map(place).collect();
        let top = unit(peak.ray.theta_rad, peak.ray.phi_rad);
        let theta_side = unit(peak.ray.theta_rad + core::f64::consts::FRAC_PI_2, peak.ray.phi_rad);
        let across = top.cross(theta_side);
        let mut offsets: Vec<[f64; 2]> = Vec::with_capacity(self.trials);
        let mut normal = Draws::new(self.seed).normals();
        trials.run(self.trials, &mut normal, &mut |trial| {
            let found = trial.peak();
            let towards = unit(found.ray.theta_rad, found.ray.phi_rad);
            let angle = towards.angle_between(top);
            let side = [towards.dot(theta_side), towards.dot(across)];
            let length = libm::hypot(side[0], side[1]).max(f64::MIN_POSITIVE);
            offsets.push(side.map(|part| angle * part / length));
            for (k, number) in numbers.iter_mut().enumerate() {
                match &number.functional {
                    Some(functional) => number.trials.push(trial.of(functional)),
                    None if k == highest => number.trials.push(found.radiance),
                    None => {}
                }
            }
            if !shaped.is_empty() {
                reshape(trial, quantity, &shaped, (&places, &mut numbers[first_derived..]));
            }
        });
        MonteCarlo {
            trials: self.trials,
            seed: self.seed,
            peak_direction: direction(&offsets),
            numbers: numbers.into_iter().map(|number| number.spread(self.trials)).collect(),
        }
    }
}

impl Number {
    fn of(
        name: &str,
        unit: &'static str,
        linear: Estimate,
        functional: Option<Functional>,
    ) -> Self {
        Self { name: name.to_owned(), unit, linear, functional, trials: Vec::new() }
    }

    fn spread(self, count: usize) -> Propagated {
        let Self { name, unit, linear, trials, .. } = self;
        let without = count - trials.len();
        let spread = if without == 0 { Spread::of(trials) } else { None };
        Propagated { name, unit, linear, trials: spread.ok_or(without) }
    }
}

/// What is always there.
fn region_numbers(fit: &Fit, quantity: Quantity) -> Vec<Number> {
    if fit.region().chart != Chart::Surface {
        let all = charted(fit, quantity).into_iter();
        let linear = all.filter_map(|one| {
            let functional = one.derived.functional?;
            Some(Number::of(one.name, one.unit, one.derived.estimate, Some(functional)))
        });
        return linear.collect();
    }
    let kinds = [DerivedKind::Exitance, DerivedKind::Flux, DerivedKind::Intensity];
    let along_normal = fit.mean_towards(0.0, 0.0).times(fit.region().area_m2());
    let sums = [fit.exitance_sum(), fit.flux_sum(), along_normal];
    kinds
        .into_iter()
        .zip(sums)
        .map(|(kind, functional)| {
            let name = match kind {
                DerivedKind::Intensity => format!("{}_along_normal", kind.quantity(quantity)),
                _ => kind.quantity(quantity).to_owned(),
            };
            let linear = fit.of(&functional);
            Number::of(&name, kind.unit(quantity), linear, Some(functional))
        })
        .collect()
}

/// What was derived, if it is one number.
fn derived_number(one: &DerivedQuantity, quantity: Quantity) -> Option<Number> {
    let Ok(DerivedOutcome::Number { derived, .. }) = &one.outcome else { return None };
    let functional = derived.functional.clone();
    Some(Number::of(&one.name, one.kind.unit(quantity), derived.estimate, functional))
}

/// Whether it is no linear functional of the field.
fn has_a_shape(wanted: &Wanted) -> bool {
    matches!(wanted.asked, Asked::BeamAngle { .. } | Asked::PeakIntensity)
}

/// Whether it came of such a wish.
fn is_of_shape(one: &DerivedQuantity) -> bool {
    let has_place = |outcome: &DerivedOutcome| matches!(outcome, DerivedOutcome::Number { further, .. } if !further.is_empty());
    one.kind == DerivedKind::Angle || one.outcome.as_ref().is_ok_and(has_place)
}

/// Asks a trial's own fit; `places` are those of the numbers asked for, in the order of the wishes.
fn reshape(
    trial: &Trial<'_>,
    quantity: Quantity,
    shaped: &[Wanted],
    (places, numbers): (&[Option<usize>], &mut [Number]),
) {
    for (found, place) in derive(&trial.fit(), quantity, shaped).into_iter().zip(places) {
        if let (Ok(DerivedOutcome::Number { derived, .. }), Some(place)) = (found.outcome, place) {
            numbers[*place].trials.push(derived.estimate.value);
        }
    }
}

/// What the trials' offsets from the fitted peak make up, radians.
fn direction(offsets: &[[f64; 2]]) -> PeakDirection {
    let n = offsets.len() as f64;
    let rms = |k: usize| (offsets.iter().map(|o| o[k] * o[k]).sum::<f64>() / n).sqrt();
    let mut angles: Vec<f64> = offsets.iter().map(|o| libm::hypot(o[0], o[1])).collect();
    angles.sort_by(f64::total_cmp);
    let within = angles.get((19 * angles.len()).div_ceil(20).saturating_sub(1));
    PeakDirection {
        u_theta_rad: rms(0),
        u_across_rad: rms(1),
        within_95_rad: within.copied().unwrap_or(0.0),
    }
}

/// Why a fit by such rules can't be tried.
pub(super) fn refusal(
    symmetry: Option<&Result<SymmetryTest, SymmetryError>>,
    nonnegative: Option<&Nonnegative>,
) -> Option<Failure> {
    let what = if matches!(symmetry, Some(Ok(_))) {
        "a symmetry"
    } else if nonnegative.is_some_and(|bound| !bound.held.is_empty()) {
        "a field held above zero"
    } else {
        return None;
    };
    Some(Failure::with_help(
        format!("--monte-carlo: trials are plain least squares, and this fit has {what}"),
        "leave --symmetry and --nonnegative out of the command and of the plan's [fit]",
    ))
}

/// A fit that can't be tried says why.
pub(super) fn failed(error: &FitError) -> Failure {
    Failure::midway(format!("--monte-carlo: {error}"))
}

/// Rows of a summary.
pub(super) fn rows(found: &MonteCarlo) -> Vec<Vec<String>> {
    let title = format!("{} trials, seed {}; 95 % intervals", found.trials, found.seed);
    let mut rows = vec![row("monte carlo", title)];
    for number in &found.numbers {
        let name = format!("  {}", number.name);
        let said = match number.trials {
            Ok(spread) => {
                let mean = with_uncertainty(spread.mean, spread.u, number.unit);
                let (linear, by_trials) = (number.linear_interval(), spread.symmetric);
                format!(
                    "{mean}; {} to {}, by u alone {} to {}",
                    end(by_trials.low, spread.u),
                    end(by_trials.high, spread.u),
                    end(linear.low, spread.u),
                    end(linear.high, spread.u)
                )
            }
            Err(0) => "not propagated".to_owned(),
            Err(without) if without == found.trials => "not propagated".to_owned(),
            Err(without) => format!("none: {without} of {} trials have no such", found.trials),
        };
        rows.push(row(&name, said));
    }
    let PeakDirection { u_theta_rad, u_across_rad, within_95_rad } = found.peak_direction;
    rows.push(row(
        "  direction of peak",
        format!(
            "u {:.2}° in theta, {:.2}° across; 95 % within {:.2}°",
            u_theta_rad.to_degrees(),
            u_across_rad.to_degrees(),
            within_95_rad.to_degrees()
        ),
    ));
    rows
}

/// An end of an interval to the second digit of u.
fn end(value: f64, u: f64) -> String {
    if !(u > 0.0 && u.is_finite()) {
        return value.to_string();
    }
    #[allow(clippy::cast_possible_truncation)] // between -308 and 308
    let exponent = libm::floor(libm::log10(u)) as i32;
    if (-6..6).contains(&exponent) {
        let decimals = usize::try_from(1 - exponent).unwrap_or(0);
        return format!("{value:.decimals$}");
    }
    format!("{value:.4e}")
}
