//! The field that a run's samples show: the fit of all of them, or of those taken first.

use fit::{Choice, Fit, FitError, Optics, Penalised, Ray, Region, Resolves, Wish};

use super::{Calibrated, FitInput, Flag, Sample};

/// A fit, what it was chosen from, and how many samples it does not rest on.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// The field.
    pub fit: Fit,
    /// What basis and penalty were chosen from; `None` where nothing was left to choose.
    pub choice: Option<Choice>,
    /// The narrowest feature that can be seen.
    pub resolves: Resolves,
    /// Samples left out because their value is not the radiance at their pose.
    pub n_excluded: usize,
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
        let input = self.fit_input();
        let (model, choice) = fit::choose(&input.samples, region, wish, optics)?;
        let fitted = self.fit_input_as(input, region, model, optics)?;
        Ok(Fitted { choice, ..fitted })
    }

    /// The same with a basis and a penalty that are known.
    pub fn fit_as(
        &self,
        region: &Region,
        model: Penalised,
        optics: Option<&Optics>,
    ) -> Result<Fitted, FitError> {
        self.fit_input_as(self.fit_input(), region, model, optics)
    }

    fn fit_input_as(
        &self,
        input: FitInput,
        region: &Region,
        model: Penalised,
        optics: Option<&Optics>,
    ) -> Result<Fitted, FitError> {
        let FitInput { samples, common, places } = input;
        let flown: Vec<_> = places.iter().map(|place| self.samples[*place].flown()).collect();
        let fit = fit::fit_flown(&samples, &flown, region, model, &common, optics)?;
        let resolves = Resolves::of(&samples, region, model.basis, optics);
        let n_excluded = self.samples.len() - samples.len();
        Ok(Fitted { fit, choice: None, resolves, n_excluded })
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
