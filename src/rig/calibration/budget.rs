//! What is independent from sample to sample, by source: shot noise, read noise, quantisation,
//! readbacks at positions of their own, scatter that nothing explains, and what a penalty smooths
//! away. What samples share has rows of its own in every budget.

use fit::{Contribution, Influence};

use super::{Calibrated, Fitted};

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

impl Calibrated {
    /// The samples are those that the fit was made of, restated from it.
    pub fn independent_parts(&self, fitted: &Fitted) -> IndependentParts {
        let fit = &fitted.fit;
        let Some(influence) = fit.influence() else { return IndependentParts::NONE };
        let told = |gradient: &[f64], factor: f64, rows: &[Contribution]| {
            let gradient: Vec<f64> = gradient.iter().map(|each| factor * each).collect();
            // The first row is the independent part.
            let whole = rows.first().map_or(0.0, |row| row.u);
            self.by_source(&fitted.places, influence, &gradient, whole)
        };
        let area_m2 = fit.region().area_m2();
        let normal = fit.contributions_of(&fit.mean_towards(0.0, 0.0).times(area_m2));
        let peak_ray = fit.peak().ray;
        let is_still = peak_ray == influence.peak_ray;
        let peak = if is_still { influence.peak.as_slice() } else { &[] };
        IndependentParts {
            exitance: told(&influence.exitance, 1.0, &fit.contributions()),
            intensity: told(&influence.normal, area_m2, &normal),
            peak: told(peak, 1.0, &fit.radiance_contributions(&peak_ray)),
        }
    }

    fn by_source(
        &self,
        places: &[usize],
        Influence { moved, variances, .. }: &Influence,
        gradient: &[f64],
        whole: f64,
    ) -> Vec<Contribution> {
        if gradient.len() != places.len() {
            return Vec::new();
        }
        let (mut shot, mut read, mut quantisation, mut readback, mut rest) =
            (0.0, 0.0, 0.0, 0.0, 0.0);
        for (((place, influence), moved), variance) in
            places.iter().copied().zip(gradient).zip(moved).zip(variances)
        {
            // An infinite variance is that of a sample that counts for nothing.
            if *influence == 0.0 {
                continue;
            }
            let sample = &self.samples[place];
            let square = influence * influence;
            let noise = sample.noise;
            read += square * noise.read;
            quantisation += square * noise.quantisation;
            shot += square
                * (sample.u_independent * sample.u_independent - noise.read - noise.quantisation)
                    .max(0.0);
            readback += square * moved;
            let stated = sample.u_independent * sample.u_independent + moved;
            rest += square * (variance - stated);
        }
        let whole = whole * whole;
        let smoothing = whole - (shot + read + quantisation + readback + rest);
        if smoothing < -ROUNDING * whole {
            return Vec::new();
        }
        // The levels are those of the last pass, the variances those of the one before.
        let smoothing = if smoothing > ROUNDING * whole { smoothing } else { 0.0 };
        let rows = [
            ("shot noise", shot),
            ("read noise", read),
            ("quantisation", quantisation),
            ("readback of single positions", readback),
            ("scatter beyond what is stated", rest),
            ("smoothing", smoothing),
        ];
        rows.into_iter()
            .filter(|(_, variance)| *variance > 0.0)
            .map(|(name, variance)| Contribution { name: name.to_owned(), u: libm::sqrt(variance) })
            .collect()
    }
}

/// What the weights' last change may amount to, as a part of the variance: they are settled to one
/// in a hundred.
const ROUNDING: f64 = 0.02;
