//! The field that a run's samples show: the fit of all of them, or of those taken first.

use fit::{
    Choice, Chosen, Fit, FitError, Nonnegative, Optics, Penalised, Ray, Region, Resolves, Ruled,
    Rules, SymmetryError, SymmetryTest, Wish,
};

use fit::trials::Trials;

use super::fit_input::demand_drift;
use super::{Calibrated, FitInput, FittedDrift, Flag, Sample};

/// A fit, what it was chosen from, and how many samples it does not rest on.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// The field.
    pub fit: Fit,
    /// What basis and penalty were chosen from; `None` where nothing was left to choose.
    pub choice: Option<Choice>,
    /// The narrowest feature that can be seen.
    pub resolves: Resolves,
    /// Samples that have no part in it.
    pub n_excluded: usize,
    /// Which of the run's samples the fit's own are.
    pub places: Vec<usize>,
    /// The drift by the reference readings, where it was fitted.
    pub drift: Option<FittedDrift>,
    /// How well the readings bear the symmetry asked for, or why it was not used.
    pub symmetry: Option<Result<SymmetryTest, SymmetryError>>,
    /// What holding the field above zero did.
    pub nonnegative: Option<Nonnegative>,
}

impl Calibrated {
    /// Fits the field to the usable samples, each the mean over its beam; without optics the
    /// radiance along its ray. What the wish leaves open is chosen from the samples, taken as at
    /// rest in the middle of their ways.
    pub fn fit(
        &self,
        region: &Region,
        wish: &Wish,
        optics: Option<&Optics>,
    ) -> Result<Fitted, FitError> {
        let input = self.fit_input(&wish.rules);
        demand_drift(input.drift.as_ref(), &wish.rules)?;
        let flown = self.flown(&input);
        let readings = input.readings(&flown);
        let ruled = fit::fit_wished(&readings, region, wish, optics)?;
        Ok(self.fitted(input, ruled, region, optics))
    }

    /// The same for the field's values alone: u has no part for what the functions can't follow.
    pub fn fit_valued(
        &self,
        region: &Region,
        wish: &Wish,
        optics: Option<&Optics>,
    ) -> Result<Ruled, FitError> {
        self.valued(&self.fit_input(&wish.rules), region, wish, optics)
    }

    /// The same values, with nothing in u of what readings share: to carry that along takes long.
    pub fn fit_field(
        &self,
        region: &Region,
        wish: &Wish,
        optics: Option<&Optics>,
    ) -> Result<Ruled, FitError> {
        let mut input = self.fit_input(&wish.rules);
        if wish.rules.symmetry.is_none() {
            // A symmetry is tested against all of u.
            input.common.retain(|common| !common.shift.is_shared());
        }
        self.valued(&input, region, wish, optics)
    }

    fn valued(
        &self,
        input: &FitInput,
        region: &Region,
        wish: &Wish,
        optics: Option<&Optics>,
    ) -> Result<Ruled, FitError> {
        demand_drift(input.drift.as_ref(), &wish.rules)?;
        let flown = self.flown(input);
        fit::fit_valued(&input.readings(&flown), region, wish, optics)
    }

    /// As [`fit`](Self::fit) with a basis and a penalty that are known, or were chosen before.
    pub fn fit_known(
        &self,
        region: &Region,
        chosen: &Chosen,
        rules: &Rules,
        optics: Option<&Optics>,
    ) -> Result<Fit, FitError> {
        let input = self.fit_input(rules);
        demand_drift(input.drift.as_ref(), rules)?;
        let flown = self.flown(&input);
        Ok(fit::fit_known(&input.readings(&flown), region, chosen, rules, optics)?.fit)
    }

    /// Hands over trials of the readings that a fit was made of, by the rules and the optics that it
    /// was made with.
    pub fn tried<T>(
        &self,
        fitted: &Fitted,
        rules: &Rules,
        optics: Option<&Optics>,
        make: impl FnOnce(&Trials<'_>) -> T,
    ) -> Result<T, FitError> {
        let input = self.fit_input(rules);
        let flown = self.flown(&input);
        Ok(make(&fitted.fit.trials(&input.readings(&flown), optics)?))
    }

    /// The same with a basis and a penalty that are known, and no part in u for what the functions
    /// can't follow.
    pub fn fit_as(
        &self,
        region: &Region,
        model: Penalised,
        rules: &Rules,
        optics: Option<&Optics>,
    ) -> Result<Fitted, FitError> {
        let input = self.fit_input(rules);
        let flown = self.flown(&input);
        let ruled = fit::fit_ruled(&input.readings(&flown), region, model, rules, optics)?;
        Ok(self.fitted(input, ruled, region, optics))
    }

    fn fitted(
        &self,
        input: FitInput,
        ruled: Ruled,
        region: &Region,
        optics: Option<&Optics>,
    ) -> Fitted {
        let FitInput { samples, places, drift, .. } = input;
        let Ruled { fit, choice, symmetry, nonnegative } = ruled;
        let resolves = Resolves::of(&samples, region, fit.basis(), optics);
        let n_excluded = self.samples.len() - samples.len();
        Fitted { fit, choice, resolves, n_excluded, places, drift, symmetry, nonnegative }
    }

    /// The ways of the input's samples.
    fn flown(&self, input: &FitInput) -> Vec<Option<(Ray, Ray)>> {
        input.places.iter().map(|place| self.samples[*place].flown()).collect()
    }

    /// What was known when `count` samples had been taken.
    #[must_use]
    pub fn first(&self, count: usize) -> Self {
        let mut samples: Vec<Sample> = self.samples.clone();
        samples.sort_by(|a, b| a.time_s.total_cmp(&b.time_s).then(a.reading.cmp(&b.reading)));
        samples.truncate(count);
        Self { samples, ..self.clone() }
    }

    /// States every sample's uncertainty at the level that the fit gives its reading; answers the
    /// levels, in the samples' order.
    pub fn restate_from(&mut self, fit: &Fit, optics: Option<&Optics>) -> Vec<f64> {
        let rays: Vec<Ray> = self.samples.iter().map(Sample::ray).collect();
        // What optics are wrong with has been said by the fit.
        let levels = optics.and_then(|optics| fit.readings(&rays, optics).ok());
        let levels = levels.unwrap_or_else(|| rays.iter().map(|ray| fit.value(ray)).collect());
        self.restate(|i, _| levels[i]);
        levels
    }

    /// Flags the samples whose beam reaches beyond the sample's outline, where that is known.
    pub fn flag_off_sample(&mut self, optics: &Optics) {
        for sample in &mut self.samples {
            let is_off = optics.reaches_beyond(&sample.ray());
            sample.flags.set(Flag::OffSample, is_off);
        }
    }
}
