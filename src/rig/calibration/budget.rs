//! What is independent from sample to sample, by source: shot noise, read noise, quantisation,
//! readbacks at positions of their own, scatter that nothing explains, and what a penalty smooths
//! away. What samples share has rows of its own in every budget.

use fit::{Contribution, Influence};

use super::{Calibrated, Fitted};

impl Calibrated {
    /// The independent part of the exitance's u by source; the squares add to its square. The
    /// samples are those that the fit was made of, restated from it. Empty for a fit that no longer
    /// knows what its samples did.
    pub fn independent_budget(&self, Fitted { fit, places, .. }: &Fitted) -> Vec<Contribution> {
        let Some(Influence { exitance, moved, variances, .. }) = fit.influence() else {
            return Vec::new();
        };
        if exitance.len() != places.len() {
            return Vec::new();
        }
        let (mut shot, mut read, mut quantisation, mut readback, mut rest) =
            (0.0, 0.0, 0.0, 0.0, 0.0);
        for (((place, influence), moved), variance) in
            places.iter().copied().zip(exitance).zip(moved).zip(variances)
        {
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
        let parts = fit.contributions();
        let missed = parts.iter().find(|part| part.name == "truncation").map_or(0.0, |part| part.u);
        let whole = fit.exitance().u_independent.powi(2) - missed * missed;
        let smoothing = whole - (shot + read + quantisation + readback + rest);
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
