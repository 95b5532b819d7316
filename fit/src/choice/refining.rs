//! Finer splines where the residuals of coarser ones say so: in a stretch of θ, or in a patch of θ and
//! φ. What is tried, and when to stop; how a basis is scored it does not know.

use super::family::Trial;
use super::search::Search;
use super::{AngularKind, SweepKind, Taken, Wish};
use crate::{Angular, Around, BasisSpec, Fine, FitError, Position, Sample};
use std::f64::consts::{FRAC_PI_2, TAU};

impl Search<'_> {
    /// Halves the spans of θ in which the best splines leave residuals, again and again, while that
    /// does better. Where splines are not among the best, nothing is narrow. Where it helps,
    /// coarse splines are refined too: they follow a narrow lobe without being free elsewhere.
    pub(super) fn refine(&mut self, position: Position) -> Result<(), FitError> {
        let is_splines = |spec: &BasisSpec| matches!(spec.angular, Angular::Splines { .. });
        let (Some((spec, trial)), Some((_, all))) = (self.best(is_splines), self.best(|_| true))
        else {
            return Ok(());
        };
        if trial.score < all.score - NEAR || spec.position != position {
            return Ok(());
        }
        self.halve(spec)?;
        if self.best(is_splines).is_none_or(|(best, _)| best == spec) {
            return Ok(());
        }
        for (theta_spans, phi_spans) in COARSE {
            let angular = Angular::Splines { theta_spans, phi_spans, fine: Fine::NONE };
            let coarse = BasisSpec { angular, position };
            if coarse != spec && self.is_affordable(coarse) {
                self.halve(coarse)?;
            }
        }
        Ok(())
    }

    /// Halves spans of splines as long as that does better.
    fn halve(&mut self, start: BasisSpec) -> Result<(), FitError> {
        let first = self.family(start)?.trial(start, self.strengths, &self.folds)?;
        let Some((Trial { score, .. }, mut residuals)) = first else { return Ok(()) };
        let (mut spec, mut best, mut worse) = (start, score, 0);
        while let Some(angular) = self.finer(spec.angular, &residuals) {
            let finer = BasisSpec { angular, ..spec };
            if !self.is_affordable(finer) || self.has(finer) {
                break;
            }
            let found = self.family(finer)?.trial(finer, self.strengths, &self.folds)?;
            let Some((next, left)) = found else { break };
            self.tried.push((finer, next));
            worse = if next.score > best { 0 } else { worse + 1 };
            best = best.max(next.score);
            if worse == HALVINGS_IN_VAIN {
                break;
            }
            (spec, residuals) = (finer, left);
        }
        Ok(())
    }

    /// The same splines with the spans halved in which residuals exceed what they are elsewhere.
    fn finer(&self, angular: Angular, residuals: &[f64]) -> Option<Angular> {
        let Angular::Splines { theta_spans, phi_spans, fine } = angular else { return None };
        let theta = |sample: &Sample| Some(place(sample.ray.theta_rad, FRAC_PI_2, theta_spans));
        let (means, usual) = self.mean_squares(theta_spans, residuals, theta);
        let least = RESIDUES * usual?;
        let is_off = |mean: &f64| *mean > least;
        let (from, to) = (means.iter().position(is_off)?, means.iter().rposition(is_off)? + 1);
        // Anew each time: what is followed by now needs no finer spans.
        let fine = if fine.is_none() {
            Fine {
                from: from.saturating_sub(1),
                to: (to + 1).min(theta_spans),
                halvings: 1,
                ..Fine::NONE
            }
        } else {
            let (from, to) = (from.max(fine.from), to.min(fine.to));
            let (from, to) = if from < to { (from, to) } else { (fine.from, fine.to) };
            Fine { from, to, halvings: fine.halvings + 1, ..fine }
        };
        Some(Angular::Splines { theta_spans, phi_spans, fine })
    }

    /// Tries splines with a patch beside what was tried with fewer readings, the best of which is tried
    /// again: by what its score changes, those of the others are taken to change too.
    pub(super) fn patch_beside(
        &mut self,
        others: &mut Vec<(BasisSpec, Trial)>,
    ) -> Result<(), FitError> {
        let Some(&(spec, before)) = others.first() else { return Ok(()) };
        let again = self.family(spec)?.trial(spec, self.strengths, &self.folds)?;
        let Some((again, _)) = again else { return Ok(()) };
        self.patch(spec.position)?;
        if spec.position.degree() != Some(0) && self.is_degree_open() {
            // What no basis followed in direction may have looked like something in position.
            self.patch(Position::Legendre { degree: 0 })?;
        }
        for (_, other) in &mut *others {
            other.score += again.score - before.score;
        }
        others[0].1 = again;
        others.append(&mut self.tried);
        Ok(())
    }

    /// Follows what coarse splines leave in one patch of directions by spans that are halved there, of θ
    /// or of φ, whichever does better, as long as that does better.
    pub(super) fn patch(&mut self, position: Position) -> Result<(), FitError> {
        for (theta_spans, phi_spans) in PATCHED {
            let angular = Angular::Splines { theta_spans, phi_spans, fine: Fine::NONE };
            let coarse = BasisSpec { angular, position };
            if coarse.len() > self.patched_max() {
                continue;
            }
            let found = self.family(coarse)?.trial(coarse, self.strengths, &self.folds)?;
            let Some((_, residuals)) = found else { continue };
            if let Some(fine) = self.patch_in((theta_spans, phi_spans), &residuals) {
                self.halve_in(BasisSpec { angular: with(angular, fine), position })?;
            }
        }
        Ok(())
    }

    /// Tries splines with a patch, and finer ones in it.
    fn halve_in(&mut self, start: BasisSpec) -> Result<(), FitError> {
        let (mut next, mut best, mut worse) = (vec![start], f64::NEG_INFINITY, 0);
        while worse < HALVINGS_IN_VAIN {
            let mut found = Vec::new();
            for spec in next.drain(..).filter(|spec| self.is_followable(*spec)) {
                let trial = self.family(spec)?.trial(spec, self.strengths, &self.folds)?;
                found.extend(trial.map(|(trial, _)| (spec, trial)));
            }
            let score = |(_, trial): &&(BasisSpec, Trial)| trial.score;
            let Some(&(spec, trial)) = found.iter().max_by(|a, b| score(a).total_cmp(&score(b)))
            else {
                break;
            };
            self.tried.append(&mut found);
            worse = if trial.score > best { 0 } else { worse + 1 };
            best = best.max(trial.score);
            let Angular::Splines { fine, .. } = spec.angular else { break };
            let around = Around { halvings: fine.around.halvings + 1, ..fine.around };
            for fine in [Fine { halvings: fine.halvings + 1, ..fine }, Fine { around, ..fine }] {
                next.push(BasisSpec { angular: with(spec.angular, fine), ..spec });
            }
        }
        Ok(())
    }

    fn patched_max(&self) -> usize {
        PATCHED_COEFFICIENTS_MAX.min(self.samples.len())
    }

    /// Whether a patch's readings lie near enough over half of it at least, along θ and round φ: between
    /// lines that are further apart a narrow function would be anything.
    fn is_followable(&self, spec: BasisSpec) -> bool {
        let Angular::Splines { theta_spans, phi_spans, fine } = spec.angular else { return false };
        if spec.len() > self.patched_max() {
            return false;
        }
        let parts = |halvings: usize| f64::from(1_u32 << halvings.min(31));
        let (theta, phi) = (FRAC_PI_2 / theta_spans as f64, TAU / phi_spans as f64);
        let (from, to) = (fine.from as f64 * theta, fine.to as f64 * theta);
        let (first, around) = (fine.around.from as f64 * phi, fine.around.to - fine.around.from);
        let length = around as f64 * phi;
        let rays = self.samples.iter().map(|sample| (sample.ray.theta_rad, sample.ray.phi_rad));
        let within = rays.map(|(theta, phi)| (theta - from, (phi - first).rem_euclid(TAU)));
        let within = within.filter(|(along, round)| {
            (0.0..=to - from).contains(along) && (0.0..=length).contains(round)
        });
        let (along, round): (Vec<f64>, Vec<f64>) = within.unzip();
        let theta_max = self.theta_max_rad().min(to) - from;
        // Along a sweep nothing is left out that would tell how it is between readings at rest.
        let is_untold = |kind| self.kind == kind && self.taken == Taken::AtRest;
        let between = |kind| if is_untold(kind) { SPANS_ALONG } else { SPANS_BETWEEN };
        let (of_theta, of_phi) = (between(SweepKind::Theta), between(SweepKind::Phi));
        is_dense(along, theta_max, of_theta * theta / parts(fine.halvings))
            && is_dense(round, length, of_phi * phi / parts(fine.around.halvings))
    }

    /// The patch that holds nearly all of the residuals' squares beyond what they are elsewhere; `None`
    /// where it goes more than half way round.
    fn patch_in(
        &self,
        (theta_spans, phi_spans): (usize, usize),
        residuals: &[f64],
    ) -> Option<Fine> {
        let theta = |sample: &Sample| place(sample.ray.theta_rad, FRAC_PI_2, theta_spans);
        let phi = |sample: &Sample| place(sample.ray.phi_rad.rem_euclid(TAU), TAU, phi_spans);
        let along = self.excess(theta_spans, residuals, |sample| Some(theta(sample)));
        let (from, to) = stretch(&along, false)?;
        let around = self.excess(phi_spans, residuals, |sample| {
            (from..to).contains(&theta(sample)).then(|| phi(sample))
        });
        let round = stretch(&around, true)?;
        if 2 * (round.1 - round.0) > phi_spans {
            return None;
        }
        let around = Around { from: round.0, to: round.1, halvings: 1 };
        Some(Fine { from, to, halvings: 1, around })
    }

    /// Mean squares of residuals by bin, less their median over the bins.
    fn excess(
        &self,
        bins: usize,
        residuals: &[f64],
        bin: impl Fn(&Sample) -> Option<usize>,
    ) -> Vec<f64> {
        let (means, usual) = self.mean_squares(bins, residuals, bin);
        means.iter().map(|mean| (mean - usual.unwrap_or(0.0)).max(0.0)).collect()
    }

    /// Mean squares of residuals by bin, 0 where there are none, and the median of the others.
    fn mean_squares(
        &self,
        bins: usize,
        residuals: &[f64],
        bin: impl Fn(&Sample) -> Option<usize>,
    ) -> (Vec<f64>, Option<f64>) {
        let mut sums = vec![(0.0, 0.0); bins];
        for (sample, residual) in self.samples.iter().zip(residuals) {
            if let Some(bin) = bin(sample) {
                sums[bin].0 += residual * residual;
                sums[bin].1 += 1.0;
            }
        }
        let mean = |(sum, count): &(f64, f64)| if *count > 0.0 { sum / count } else { 0.0 };
        let means: Vec<f64> = sums.iter().map(mean).collect();
        let mut sorted: Vec<f64> = means.iter().copied().filter(|mean| *mean > 0.0).collect();
        sorted.sort_by(f64::total_cmp);
        let usual = sorted.get(sorted.len() / 2).copied();
        (means, usual)
    }
}

/// Whether the best of what was tried, sorted, misses much of the readings left out.
pub(super) fn calls_for_a_patch(tried: &[(BasisSpec, Trial)], wish: &Wish) -> bool {
    let is_open = wish.angular().is_none() && wish.position_spans.is_none();
    let is_open = is_open && wish.kind.is_none_or(|kind| kind == AngularKind::Splines);
    let Some((best, trial)) = tried.first() else { return false };
    is_open && trial.left_out > LEFT_OUT_MIN && best.position.degree().is_some()
}

fn with(angular: Angular, fine: Fine) -> Angular {
    match angular {
        Angular::Splines { theta_spans, phi_spans, .. } => {
            Angular::Splines { theta_spans, phi_spans, fine }
        }
        other => other,
    }
}

/// Which of so many equal bins from 0 to `whole` a value lies in.
fn place(value: f64, whole: f64, bins: usize) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a place in a list
    let at = (value / whole * bins as f64).max(0.0) as usize;
    at.min(bins - 1)
}

/// Whether half of a length and more lies between neighbours that are no further apart than a step.
fn is_dense(mut places: Vec<f64>, length: f64, step: f64) -> bool {
    places.extend([0.0, length]);
    places.sort_by(f64::total_cmp);
    let steps = places.windows(2).map(|two| two[1] - two[0]);
    2.0 * steps.filter(|width| *width <= step).sum::<f64>() >= length
}

/// The shortest stretch of bins that holds nearly all of the sum; round a circle it may go through its
/// end. The first, and the one after the last.
fn stretch(excess: &[f64], is_round: bool) -> Option<(usize, usize)> {
    let (all, bins) = (excess.iter().sum::<f64>(), excess.len());
    if all <= 0.0 {
        return None;
    }
    for length in 1..=bins {
        let starts = if is_round { bins } else { bins + 1 - length };
        let held = |from: usize| -> f64 { (from..from + length).map(|k| excess[k % bins]).sum() };
        let best = (0..starts).max_by(|a, b| held(*a).total_cmp(&held(*b)))?;
        if held(best) >= HELD * all {
            return Some((best, best + length));
        }
    }
    None
}

/// Readings that a choice among patches is made from at most.
pub(super) const READINGS_MAX: usize = 8000;
/// Readings left out that are missed by less, in u, ask for no patch.
const LEFT_OUT_MIN: f64 = 3.0;
/// Spans of splines that are finer in a patch.
const PATCHED: [(usize, usize); 2] = [(7, 12), (10, 16)];
/// The patch holds this part of what the residuals' squares are more than elsewhere.
const HELD: f64 = 0.97;
/// Coefficients of splines with a patch at most, whether averaged over a beam or not.
const PATCHED_COEFFICIENTS_MAX: usize = 1000;
/// Splines that score less than the best by more than this are not refined.
const NEAR: f64 = 0.3;
/// Squared residuals over their median over θ that call for finer spans.
const RESIDUES: f64 = 1.5;
/// Halving may do no better this often before it is given up.
const HALVINGS_IN_VAIN: usize = 2;
/// Splines that a narrow lobe is followed with where the rest is smooth.
const COARSE: [(usize, usize); 2] = [(4, 8), (7, 12)];
/// Readings of a patch lie no further apart than this many of its spans: at two, 24 meridians left a lobe
/// of 15° that a finer patch follows; four meridians gave a field off by all of it at eight.
const SPANS_BETWEEN: f64 = 4.0;
/// The same of readings at rest along a sweep.
const SPANS_ALONG: f64 = 2.0;
