//! From readings to the field by rules that a person set: basis chosen, weights settled, symmetry tested,
//! darkness kept from being darker. The one way that runs and files go.

use crate::choice::{Choice, Chosen, Wish};
use crate::solve::check_readings;
use crate::{
    Fit, FitError, Nonnegative, Optics, Penalised, Readings, Region, Robust, Sample, Symmetry,
    SymmetryError, SymmetryTest,
};

/// What holds for a fit beyond its basis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Rules {
    /// How outliers are weighed.
    pub robust: Robust,
    /// Whether the field is held above zero.
    pub nonnegative: bool,
    /// What it is said to be the same under.
    pub symmetry: Option<Symmetry>,
    /// Whether a drift is fitted along with the field; `None`: where reference readings show one. Who
    /// makes the readings knows how.
    pub drift: Option<bool>,
    /// Whether dark levels and gains of the detector's ranges are fitted along; `None`: where more
    /// than one range was used.
    pub ranges: Option<bool>,
}

/// A field, and what led to it.
#[derive(Debug, Clone)]
pub struct Ruled {
    /// The field.
    pub fit: Fit,
    /// What basis and penalty were chosen from; `None` where nothing was left to choose.
    pub choice: Option<Choice>,
    /// How well the readings bear the symmetry asked for, or why it was not used: the field is then
    /// the one without it.
    pub symmetry: Option<Result<SymmetryTest, SymmetryError>>,
    /// What holding the field above zero did, if that was asked for.
    pub nonnegative: Option<Nonnegative>,
}

/// The fit of readings in the basis that the wish pins or that they ask for, by its rules, with what
/// its functions can't follow in every u ([`Fit::with_truncation`]), and what other functions that do about as
/// well make of where nothing was measured. Limits have no part in the choice
/// of the basis; nor have, once they are known, readings that lost nearly all their weight.
pub fn fit_wished(
    readings: &Readings<'_>,
    region: &Region,
    wish: &Wish,
    optics: Option<&Optics>,
) -> Result<Ruled, FitError> {
    let (fit, choice) = fit_chosen(readings, region, wish, optics)?;
    let others = choice.as_ref().map_or_else(Vec::new, Choice::others);
    Ok(Ruled { choice, ..fit.doubted(readings, &others, &wish.rules, optics)? })
}

/// The same without what its functions can't follow in u: where the field's values are asked for alone,
/// in a fraction of the time.
pub fn fit_valued(
    readings: &Readings<'_>,
    region: &Region,
    wish: &Wish,
    optics: Option<&Optics>,
) -> Result<Ruled, FitError> {
    let (fit, choice) = fit_chosen(readings, region, wish, optics)?;
    Ok(Ruled { choice, ..fit.ruled(&wish.rules)? })
}

/// As [`fit_wished`] in a basis that is known, or was chosen from readings before.
pub fn fit_known(
    readings: &Readings<'_>,
    region: &Region,
    chosen: &Chosen,
    rules: &Rules,
    optics: Option<&Optics>,
) -> Result<Ruled, FitError> {
    let of_rules = Readings { robust: rules.robust, ..*readings };
    let fit = crate::fit_readings(&of_rules, region, chosen.model, optics)?;
    fit.doubted(readings, &chosen.others, rules, optics)
}

fn fit_chosen(
    readings: &Readings<'_>,
    region: &Region,
    wish: &Wish,
    optics: Option<&Optics>,
) -> Result<(Fit, Option<Choice>), FitError> {
    check_readings(readings)?;
    let said: Vec<Sample> = kept(readings, |i| readings.limits.binary_search(&i).is_err());
    let is_flown = readings.flown.iter().any(Option::is_some);
    let choose = if is_flown { crate::choose_flown } else { crate::choose };
    let (model, choice) = choose(&said, region, wish, optics)?;
    let robust = wish.rules.robust;
    let readings = &Readings { robust, ..*readings };
    let fit = crate::fit_readings(readings, region, model, optics)?;
    let outlying = |fit: &Fit| {
        let weighed = fit.weighed()?;
        let any = (0..weighed.weights.len()).any(|i| weighed.is_outlier(i));
        any.then(|| {
            let is_limit = |i: usize| readings.limits.binary_search(&i).is_ok();
            kept(readings, |i| !weighed.is_outlier(i) && !is_limit(i))
        })
    };
    if robust != Robust::None
        && choice.is_some()
        && let Some(said) = outlying(&fit)
    {
        let (model, choice) = choose(&said, region, wish, optics)?;
        return Ok((crate::fit_readings(readings, region, model, optics)?, choice));
    }
    Ok((fit, choice))
}

/// The same in a basis that is known, without what its functions can't follow.
pub fn fit_ruled(
    readings: &Readings<'_>,
    region: &Region,
    model: Penalised,
    rules: &Rules,
    optics: Option<&Optics>,
) -> Result<Ruled, FitError> {
    let readings = Readings { robust: rules.robust, ..*readings };
    let fit = crate::fit_readings(&readings, region, model, optics)?;
    fit.ruled(rules)
}

impl Fit {
    /// By the rules, with what its functions can't follow, and what others make of where nothing was
    /// measured. Before what the rules do to the field: only of the fit itself it is known what readings
    /// did to it.
    fn doubted(
        self,
        readings: &Readings<'_>,
        others: &[Penalised],
        rules: &Rules,
        optics: Option<&Optics>,
    ) -> Result<Ruled, FitError> {
        let Readings { samples, flown, common, .. } = *readings;
        let of_rules = Readings { robust: rules.robust, ..*readings };
        let fit = self.with_truncation(samples, flown, common, optics)?;
        fit.with_extrapolation(others, &of_rules, optics).ruled(rules)
    }

    /// The field with the symmetry asked for, if the readings bear it, and above zero.
    pub fn ruled(self, rules: &Rules) -> Result<Ruled, FitError> {
        let mut ruled = Ruled { fit: self, choice: None, symmetry: None, nonnegative: None };
        if let Some(symmetry) = rules.symmetry {
            ruled.symmetry = Some(match ruled.fit.symmetric(symmetry) {
                Ok((fit, test)) => {
                    ruled.fit = fit;
                    Ok(test)
                }
                Err(SymmetryError::Fit(error)) => return Err(error),
                Err(error) => Err(error),
            });
        }
        if rules.nonnegative {
            let (fit, bound) = ruled.fit.nonnegative()?;
            (ruled.fit, ruled.nonnegative) = (fit, Some(bound));
        }
        Ok(ruled)
    }
}

fn kept(readings: &Readings<'_>, is_kept: impl Fn(usize) -> bool) -> Vec<Sample> {
    let samples = readings.samples.iter().enumerate();
    samples.filter(|(i, _)| is_kept(*i)).map(|(_, sample)| *sample).collect()
}
