//! How the signal drifted during a run, by the readings of the reference pose: a smooth function of
//! time, and how well it is known. Source and gain are not told apart: both scale what is read.
//!
//! A polynomial in time, in steps of its degree from none to 5 and fewer than half of the readings, of the
//! degree that explains them best for its number of terms (the Bayesian information criterion). Each power
//! is taken less its mean over the readings, so that the drift is 0 on average over them: the field is that
//! of the source as it was on average while the reference was read. Where the readings scatter about
//! the polynomial beyond their noise, its uncertainty grows with them.
//!
//! Over time it is one curve for all samples, so that what it is off by is common to them: the fit takes
//! what is left of it as nuisances.

use std::sync::Arc;

use fit::triangle::Triangle;
use fit::{Common, Shift};

use super::{Reference, Sample};

/// The drift of a run, relative to the mean over its reference readings.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedDrift {
    /// Reference readings that it rests on.
    pub readings: usize,
    /// Degree of the polynomial.
    pub degree: usize,
    /// Sum of squared deviations of the readings from it over their variances.
    pub chi2: f64,
    /// Their number less what was fitted to them.
    pub dof: usize,
    /// From when to when they were taken, s.
    pub time_s: (f64, f64),
    coefficients: Vec<f64>,
    /// The means of the powers over the readings.
    means: Vec<f64>,
    /// S of the coefficients' covariance S Sᵀ, a column each.
    spread: Vec<Vec<f64>>,
}

impl FittedDrift {
    /// Of three readings of a reference that shines, or more. Where `must` is not set: only if they show
    /// a drift.
    pub fn of(references: &[Reference], must: bool) -> Option<Self> {
        let most = MOST_DEGREE.min(references.len().saturating_sub(1) / 2);
        let constant = Self::with_degree(references, 0)?;
        let first = usize::from(must);
        let best = (first..=most)
            .filter_map(|degree| Self::with_degree(references, degree))
            .min_by(|a, b| a.criterion().total_cmp(&b.criterion()))?;
        let is_shown = constant.chi2 - best.chi2 > SHOWN * best.degree as f64;
        (best.degree > 0 && (must || is_shown)).then_some(best)
    }

    fn with_degree(references: &[Reference], degree: usize) -> Option<Self> {
        let (first, last) = (references.first()?, references.last()?);
        let time_s = (first.middle_s(), last.middle_s());
        if degree > 0 && time_s.1 <= time_s.0 {
            return None;
        }
        let mut new = Self {
            readings: references.len(),
            degree,
            chi2: 0.0,
            dof: references.len().checked_sub(degree + 1)?,
            time_s,
            coefficients: Vec::new(),
            means: vec![0.0; degree],
            spread: Vec::new(),
        };
        let mut means = vec![0.0; degree];
        for reference in references {
            let powers = new.powers(reference.middle_s());
            let share = 1.0 / references.len() as f64;
            means.iter_mut().zip(powers).for_each(|(mean, power)| *mean += share * power);
        }
        new.means = means;
        let mut triangle = Triangle::new(degree + 1, 1);
        for reference in references {
            let mut row = vec![1.0];
            row.extend(new.powers(reference.middle_s()));
            row.push(reference.value);
            for value in &mut row {
                *value /= reference.u_independent;
            }
            triangle.absorb(&row);
        }
        let solution = triangle.solve()?;
        if solution.spectrum()?.rank() <= degree {
            return None;
        }
        let unknowns = solution.unknowns(0);
        let level = unknowns[0];
        new.chi2 = solution.residual_squares(0);
        let excess = if new.dof > 0 { (new.chi2 / new.dof as f64).max(1.0).sqrt() } else { 1.0 };
        if level.is_nan() || level <= 0.0 {
            return None;
        }
        new.coefficients = unknowns[1..].iter().map(|value| value / level).collect();
        let inverse = solution.inverse();
        let entry = |i: usize, j: usize| excess / level * inverse[j * (j + 1) / 2 + i];
        new.spread = (1..=degree).map(|j| (1..=j).map(|i| entry(i, j)).collect()).collect();
        Some(new)
    }

    fn criterion(&self) -> f64 {
        self.chi2 + self.degree as f64 * libm::log(self.readings as f64)
    }

    /// The powers at a time, each less its mean over the readings: Legendre's, of the time mapped to
    /// [-1, 1].
    fn powers(&self, time_s: f64) -> Vec<f64> {
        let (from, to) = self.time_s;
        let t = if to > from { (2.0 * time_s - from - to) / (to - from) } else { 0.0 };
        let (mut before, mut now) = (1.0, t);
        let mut powers = Vec::with_capacity(self.degree);
        for n in 1..=self.degree {
            powers.push(now - self.means.get(n - 1).copied().unwrap_or(0.0));
            let k = n as f64;
            (before, now) = (now, ((2.0 * k + 1.0) * t * now - k * before) / (k + 1.0));
        }
        powers
    }

    /// By which part more is read at a time than on average.
    pub fn at(&self, time_s: f64) -> f64 {
        self.powers(time_s).iter().zip(&self.coefficients).map(|(p, c)| p * c).sum()
    }

    /// The same with its standard uncertainty, by the reference readings alone.
    pub fn at_with_u(&self, time_s: f64) -> (f64, f64) {
        let squares = (0..self.degree).map(|k| self.direction(k, time_s).powi(2));
        (self.at(time_s), libm::sqrt(squares.sum()))
    }

    /// What being off by one of its independent uncertainties does at a time.
    fn direction(&self, k: usize, time_s: f64) -> f64 {
        self.spread[k].iter().zip(self.powers(time_s)).map(|(s, p)| s * p).sum()
    }

    /// What is not known of it, for samples whose values were divided by 1 + [`at`](Self::at).
    pub(super) fn nuisances(&self, samples: &Arc<[Sample]>) -> Vec<Common> {
        let drift = Arc::new(self.clone());
        (0..self.degree)
            .map(|k| {
                let (samples, drift) = (Arc::clone(samples), Arc::clone(&drift));
                let shift = move |i: usize, level: f64| {
                    let at = samples[i].middle_s();
                    level * drift.direction(k, at) / (1.0 + drift.at(at))
                };
                let shift = Shift::Value(Box::new(shift));
                Common { name: format!("drift @ {}", k + 1), u: 1.0, shift }
            })
            .collect()
    }
}

/// A drift that bends more often than this is none that a polynomial follows.
const MOST_DEGREE: usize = 5;
/// A drift is shown when chi2 falls by more than this for each of its terms: of readings without one,
/// once in 2700.
const SHOWN: f64 = 13.3;

#[cfg(test)]
mod tests {
    use super::*;

    fn references(drift: impl Fn(f64) -> f64, noise: f64, seed: u64) -> Vec<Reference> {
        let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let mut uniform = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 * 2f64.powi(-53)
        };
        // Twelve uniform numbers less six: normal enough.
        let mut normal = || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        (0..21_u32)
            .map(|i| {
                let time_s = 30.0 * f64::from(i);
                let value = 50.0 * (1.0 + drift(time_s)) + noise * normal();
                Reference { id: i, session: 0, time_s, dwell_s: 0.0, value, u_independent: noise }
            })
            .collect()
    }

    #[test]
    fn a_drift_is_found_relative_to_its_mean_and_known_as_well_as_it_says() {
        let true_drift = |t: f64| 0.02 * libm::exp(-t / 200.0) - 1e-5 * t;
        let (mut squares, mut count) = (0.0, 0.0);
        for seed in 1..200 {
            let readings = references(true_drift, 0.01, seed);
            let mean = readings.iter().map(|r| true_drift(r.time_s)).sum::<f64>() / 21.0;
            let drift = FittedDrift::of(&readings, false).unwrap();
            assert!((2..=5).contains(&drift.degree));
            for t in [10.0, 200.0, 450.0] {
                let (found, u) = drift.at_with_u(t);
                let expected = (1.0 + true_drift(t)) / (1.0 + mean) - 1.0;
                squares += ((found - expected) / u).powi(2);
                count += 1.0;
            }
        }
        let rms = libm::sqrt(squares / count);
        // The polynomial follows the exponential to a part of its u.
        assert!((0.85..1.3).contains(&rms), "{rms}");
    }

    #[test]
    fn no_drift_is_seen_where_there_is_none_and_three_readings_are_enough_to_insist() {
        let seen = (1..300)
            .filter(|seed| FittedDrift::of(&references(|_| 0.0, 0.01, *seed), false).is_some());
        assert!(seen.count() <= 2);
        let flat = references(|_| 0.0, 0.01, 7);
        assert_eq!(FittedDrift::of(&flat, true).unwrap().degree, 1);
        assert_eq!(FittedDrift::of(&flat[..3], true).unwrap().degree, 1);
        assert_eq!(FittedDrift::of(&flat[..2], true), None);
        let dark: Vec<_> = flat.iter().map(|r| Reference { value: -1.0, ..*r }).collect();
        assert_eq!(FittedDrift::of(&dark, true), None);
    }
}
