//! What is independent from sample to sample, by source: shot noise, read noise, quantisation,
//! readbacks at positions of their own, scatter that nothing explains, and what a penalty smooths
//! away. What samples share has rows of its own in every budget.

use fit::{Contribution, Fit, Influence, Ray};

use super::{Calibrated, Fitted, Sample};

/// The independent part of some quantities' u by source; the squares add to its square. Empty where
/// that is not known: of a fit that no longer knows what its samples did, or that a symmetry or a
/// bound changed since.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct IndependentParts {
    /// Of the exitance; of the flux times the region's area.
    pub exitance: Vec<Contribution>,
    /// Of the intensity along the normal.
    pub intensity: Vec<Contribution>,
    /// Of the radiance at the peak. Truncation is no part of it, and has a row of its own.
    pub peak: Vec<Contribution>,
}

impl IndependentParts {
    /// Where nothing is known.
    pub const NONE: Self = Self { exitance: Vec::new(), intensity: Vec::new(), peak: Vec::new() };
}

/// The same on the way: sums over the samples, those of some of them at a time.
#[derive(Debug, Clone, Default)]
pub struct IndependentSums {
    exitance: Variances,
    normal: Variances,
    peak: Variances,
    /// Where the peak was when the fit was made.
    peak_ray: Option<Ray>,
}

/// What adds to the variance of one quantity.
#[derive(Debug, Clone, Copy, Default)]
struct Variances {
    shot: f64,
    read: f64,
    quantisation: f64,
    readback: f64,
    rest: f64,
}

impl Calibrated {
    /// The samples are those that the fit was made of, restated from it.
    pub fn independent_parts(&self, fitted: &Fitted) -> IndependentParts {
        let fit = &fitted.fit;
        let Some(influence) = fit.influence() else { return IndependentParts::NONE };
        let mut sums = IndependentSums::default();
        sums.take(fitted.places.iter().map(|place| &self.samples[*place]), influence);
        sums.parts(fit)
    }
}

impl IndependentSums {
    /// Takes samples in that a fit was made of, restated from it, and what they did to it.
    pub fn take<'s>(
        &mut self,
        samples: impl Iterator<Item = &'s Sample>,
        Influence { exitance, normal, peak, peak_ray, moved, variances, .. }: &Influence,
    ) {
        self.peak_ray = Some(*peak_ray);
        for (i, sample) in samples.enumerate() {
            let whole = (moved[i], variances[i]);
            for (sums, influence) in
                [(&mut self.exitance, exitance), (&mut self.normal, normal), (&mut self.peak, peak)]
            {
                if let Some(influence) = influence.get(i) {
                    sums.take(sample, *influence, whole);
                }
            }
        }
    }

    /// By source, of the fit that all of the samples led to.
    pub fn parts(&self, fit: &Fit) -> IndependentParts {
        // The first row is the independent part.
        let whole = |rows: &[Contribution]| rows.first().map_or(0.0, |row| row.u);
        let area_m2 = fit.region().area_m2();
        let normal = fit.contributions_of(&fit.mean_towards(0.0, 0.0).times(area_m2));
        let peak_ray = fit.peak().ray;
        let peak = if self.peak_ray == Some(peak_ray) {
            self.peak.rows(1.0, whole(&fit.radiance_contributions(&peak_ray)))
        } else {
            Vec::new()
        };
        IndependentParts {
            exitance: self.exitance.rows(1.0, whole(&fit.contributions())),
            intensity: self.normal.rows(area_m2, whole(&normal)),
            peak,
        }
    }
}

impl Variances {
    fn take(&mut self, sample: &Sample, influence: f64, (moved, variance): (f64, f64)) {
        // An infinite variance is that of a sample that counts for nothing.
        if influence == 0.0 {
            return;
        }
        let square = influence * influence;
        let noise = sample.noise;
        let independent = sample.u_independent * sample.u_independent;
        self.read += square * noise.read;
        self.quantisation += square * noise.quantisation;
        self.shot += square * (independent - noise.read - noise.quantisation).max(0.0);
        self.readback += square * moved;
        self.rest += square * (variance - (independent + moved));
    }

    /// Those of the quantity times `factor`, whose independent part of u is `whole`.
    fn rows(&self, factor: f64, whole: f64) -> Vec<Contribution> {
        let Self { shot, read, quantisation, readback, rest } = *self;
        let sources = [shot, read, quantisation, readback, rest].map(|v| factor * factor * v);
        let sum: f64 = sources.iter().sum();
        let whole = whole * whole;
        // Nothing was summed, or it is of another fit.
        if sum <= 0.0 || whole - sum < -ROUNDING * whole {
            return Vec::new();
        }
        // The levels are those of the last pass, the variances those of the one before.
        let smoothing = if whole - sum > ROUNDING * whole { whole - sum } else { 0.0 };
        let rows = NAMES.into_iter().zip(sources).chain([("smoothing", smoothing)]);
        rows.filter(|(_, variance)| *variance > 0.0)
            .map(|(name, variance)| Contribution { name: name.to_owned(), u: libm::sqrt(variance) })
            .collect()
    }
}

/// As budgets name the sources.
const NAMES: [&str; 5] = [
    "shot noise",
    "read noise",
    "quantisation",
    "readback of single positions",
    "scatter beyond what is stated",
];
/// What the weights' last change may amount to, as a part of the variance: they are settled to one
/// in a hundred.
const ROUNDING: f64 = 0.02;
