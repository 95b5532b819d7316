//! The field that readings tell of, and nothing of how well they do: for what asks many of them.

use crate::basis::Basis;
use crate::beam::Optics;
use crate::beam::design::Design;
use crate::readings::Readings;
use crate::solve::{all_determined, check_readings, ready, solve};
use crate::weights::settle;
use crate::{Common, FitError, Penalised, Region, sparse};

/// The functions and their coefficients alone: what [`fit_readings`](crate::fit_readings) finds, without any u.
pub(crate) fn field_of(
    readings: &Readings<'_>,
    region: &Region,
    model: Penalised,
    optics: Option<&Optics>,
) -> Result<(Basis, Vec<f64>), FitError> {
    if sparse::is_called_for(model.basis) {
        let fit = sparse::fit(readings, region, model, optics)?;
        return Ok((fit.functions().clone(), fit.coefficients().to_vec()));
    }
    let Readings { samples, common, .. } = *readings;
    let (basis, prior) = ready(samples, region, model, common)?;
    check_readings(readings)?;
    let design = Design::new(samples, &basis, optics)?.in_flight(readings.flown);
    let jitters: Vec<&Common> = common.iter().filter(|c| !c.shift.is_shared()).collect();
    let settled = settle(&design, &prior, readings, &jitters)?;
    let solved = solve(&design, &settled.rows(), &[], &prior)?;
    if prior.is_none() && settled.weights.contains(&0.0) {
        all_determined(&design, &solved.field, &settled)?;
    }
    let coefficients = solved.field.unknowns(0);
    Ok((basis, coefficients))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scattered::{BASIS, REGION, reading};
    use crate::{Noise, Penalty, Robust, Sample, Shift, fit_readings};

    #[test]
    fn the_field_is_that_of_the_fit_with_all_its_u() {
        let sample = |i: usize| {
            let (ray, value) = reading(i);
            let off = if i.is_multiple_of(50) { 9.0 } else { 0.0 };
            Sample { ray, value: value + off, noise: Noise::Unknown }
        };
        let samples: Vec<Sample> = (0..600).map(sample).collect();
        let component = |name: &str, shift: Shift| Common { name: name.to_owned(), u: 0.1, shift };
        let tilted =
            |_: usize, ray: &crate::Ray| crate::Ray { phi_rad: ray.phi_rad + 0.01, ..*ray };
        let common = [
            component("scale", Shift::Scale),
            component("tilt", Shift::Ray(Box::new(tilted))),
            component("jitter", Shift::Jitter(Box::new(tilted))),
        ];
        let ramp = |i: usize, _: f64| 0.01 * i as f64;
        let nuisances = [component("drift", Shift::Value(Box::new(ramp)))];
        let held = Penalty { power: 2.0, strength: 1e-4 };
        for (robust, penalty) in [(Robust::None, Penalty::NONE), (Robust::Tukey, held)] {
            let readings = Readings {
                common: &common,
                nuisances: &nuisances,
                robust,
                ..Readings::of(&samples)
            };
            let model = Penalised::new(BASIS, penalty);
            let fit = fit_readings(&readings, &REGION, model, None).unwrap();
            let (basis, coefficients) = field_of(&readings, &REGION, model, None).unwrap();
            assert_eq!(basis.len(), coefficients.len());
            for (alone, with) in coefficients.iter().zip(fit.coefficients()) {
                assert!((alone - with).abs() < 1e-11 * (1.0 + with.abs()), "{alone} {with}");
            }
        }
    }
}
