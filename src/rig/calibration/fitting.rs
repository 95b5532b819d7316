//! The field that a run's samples show: the fit of all of them, or of those taken first.

use fit::{BasisSpec, Fit, FitError, Region};

use super::{Calibrated, FitInput, Sample};

/// A fit, and how many samples it does not rest on.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// The field.
    pub fit: Fit,
    /// Samples left out because their value is not the radiance at their pose.
    pub n_excluded: usize,
}

impl Calibrated {
    /// Fits the field to the usable samples.
    pub fn fit(&self, region: &Region, basis: BasisSpec) -> Result<Fitted, FitError> {
        let FitInput { samples, common, .. } = self.fit_input();
        let fit = fit::fit(&samples, region, basis, &common)?;
        Ok(Fitted { fit, n_excluded: self.samples.len() - samples.len() })
    }

    /// What was known when `count` samples had been taken.
    #[must_use]
    pub fn first(&self, count: usize) -> Self {
        let mut samples: Vec<Sample> = self.samples.clone();
        samples.sort_by(|a, b| a.time_s.total_cmp(&b.time_s).then(a.reading.cmp(&b.reading)));
        samples.truncate(count);
        Self { samples, ..self.clone() }
    }

    /// States every sample's uncertainty at the level that the fit gives it.
    pub fn restate_from(&mut self, fit: &Fit) {
        self.restate(|_, sample| {
            let pose = sample.pose;
            fit.value(&fit::Ray {
                x_m: pose.x_m,
                y_m: pose.y_m,
                theta_rad: pose.theta_rad,
                phi_rad: pose.phi_rad,
            })
        });
    }
}
