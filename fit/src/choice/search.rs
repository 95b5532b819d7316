//! Which bases are tried, in what order, and when to stop: ever finer ones until finer ones do no
//! better, and splines finer in θ where their residuals say so.

use super::family::{Family, Strengths, Trial};
use super::{AngularKind, SweepKind, Sweeps, Taken, Wish, smallest};
use crate::beam::Optics;
use crate::grid::Grid;
use crate::weights::{Model, has_unknown};
use crate::{Angular, BasisSpec, Chart, Fine, FitError, Position, Region, Sample};
use std::sync::Arc;

/// Readings that a choice is made from at most.
pub(super) fn readings_max(optics: Option<&Optics>) -> usize {
    if optics.is_some() { AVERAGED_READINGS_MAX } else { READINGS_MAX }
}

/// The candidates tried so far.
pub(super) struct Search<'s> {
    pub(super) samples: &'s [Sample],
    region: &'s Region,
    wish: &'s Wish,
    optics: Option<&'s Optics>,
    u: Vec<f64>,
    pub(super) strengths: Strengths,
    pub(super) folds: Vec<Vec<usize>>,
    /// What is left out.
    pub(super) kind: SweepKind,
    /// How readings follow each other along a sweep.
    pub(super) taken: Taken,
    /// The samples' distinct coordinates.
    grid: Arc<Grid>,
    /// Highest degree in position that places tell apart.
    position_most: usize,
    coefficients_max: usize,
    pub(super) tried: Vec<(BasisSpec, Trial)>,
}

impl<'s> Search<'s> {
    pub(super) fn new(
        samples: &'s [Sample],
        region: &'s Region,
        wish: &'s Wish,
        optics: Option<&'s Optics>,
        sweeps: &Sweeps,
        one_by_one: bool,
    ) -> Self {
        let model = Model::of(samples);
        let grid = Grid::of(samples, region);
        let distinct = grid.x_m.len().max(grid.y_m.len());
        let most = if optics.is_some() { AVERAGED_COEFFICIENTS_MAX } else { COEFFICIENTS_MAX };
        // What the residuals have to say about noise that is not stated.
        let scale_min = if has_unknown(samples) { SCALE_LEAST } else { 1.0 };
        Self {
            samples,
            region,
            wish,
            optics,
            u: samples.iter().map(|sample| model.u_of(sample)).collect(),
            strengths: wish.strengths(scale_min),
            folds: sweeps.folds(FOLDS, one_by_one),
            kind: sweeps.kind,
            taken: Taken::AtRest,
            position_most: distinct.saturating_sub(1),
            grid: Arc::new(grid),
            coefficients_max: most.min(samples.len()),
            tried: Vec::new(),
        }
    }

    pub(super) fn run(&mut self) -> Result<(), FitError> {
        let position = match self.wish.position_spans {
            Some(spans) => Position::Splines { spans },
            None => Position::Legendre { degree: self.position()? },
        };
        let kinds: &[AngularKind] = match &self.wish.kind {
            Some(kind) => std::slice::from_ref(kind),
            None if self.wish.spans.is_some() => &[AngularKind::Splines],
            None if self.wish.angular_degree.is_some() => &[AngularKind::Zernike],
            None => &[AngularKind::Zernike, AngularKind::Spherical, AngularKind::Splines],
        };
        for kind in kinds {
            self.rising(&self.angular(*kind), position)?;
        }
        if kinds.contains(&AngularKind::Splines) && self.wish.spans.is_none() {
            self.refine(position)?;
        }
        // The best direction's basis may ask for another degree in position.
        let Some((best, _)) = self.best(|_| true) else { return Ok(()) };
        if let (Some(degree), None) = (best.position.degree(), self.wish.position_degree) {
            self.places(best.angular, degree)?;
        }
        Ok(())
    }

    /// The degree in position that a middling basis of the direction does best with: as fine a
    /// basis as the degree leaves room for.
    fn position(&self) -> Result<usize, FitError> {
        if let Some(degree) = self.wish.position_degree {
            return Ok(degree);
        }
        let mut best = (0, f64::NEG_INFINITY);
        for middling in MIDDLING {
            let degree = self.wish.angular_degree.unwrap_or(middling).min(middling);
            let angular = match (&self.region.chart, self.wish.angular_degree) {
                (Chart::Surface, None) => {
                    Angular::Zernike { degree, cosine_columns: COSINE_COLUMNS }
                }
                _ => smallest(self.region, degree, 0).angular,
            };
            let spec = |degree| BasisSpec { angular, position: Position::Legendre { degree } };
            let affordable =
                |degree: &usize| *degree <= self.position_most && self.is_affordable(spec(*degree));
            let degrees: Vec<usize> = POSITION.into_iter().filter(affordable).collect();
            let Some(most) = degrees.last().filter(|most| **most > 0) else { continue };
            let family = self.family(spec(*most))?;
            let mut worse = 0;
            for &degree in &degrees {
                let Some((trial, _)) = family.trial(spec(degree), self.strengths, &self.folds)?
                else {
                    break;
                };
                // What is even in x is not told by degree 1, and so on.
                worse = if trial.score > best.1 { 0 } else { worse + 1 };
                if trial.score > best.1 {
                    best = (degree, trial.score);
                }
                if worse == WORSE_MAX {
                    break;
                }
            }
        }
        Ok(best.0)
    }

    /// Candidates of a kind, rising.
    fn angular(&self, kind: AngularKind) -> Vec<Angular> {
        if let Some(angular) = self.wish.angular() {
            return vec![angular];
        }
        match kind {
            AngularKind::Zernike => ZERNIKE
                .into_iter()
                .map(|degree| Angular::Zernike { degree, cosine_columns: COSINE_COLUMNS })
                .collect(),
            AngularKind::Hemispherical => {
                HEMISPHERICAL.into_iter().map(|degree| Angular::Hemispherical { degree }).collect()
            }
            AngularKind::EvenHarmonics => {
                ZERNIKE.into_iter().map(|degree| Angular::EvenHarmonics { degree }).collect()
            }
            AngularKind::Spherical => {
                SPHERICAL.into_iter().map(|degree| Angular::Spherical { degree }).collect()
            }
            AngularKind::SecondPlane => {
                SECOND_PLANE.into_iter().map(|degree| Angular::SecondPlane { degree }).collect()
            }
            AngularKind::Splines => SPLINES
                .into_iter()
                .map(|(theta_spans, phi_spans)| Angular::Splines {
                    theta_spans,
                    phi_spans,
                    fine: Fine::NONE,
                })
                .collect(),
        }
    }

    /// Tries ever finer bases until finer ones do no better.
    fn rising(&mut self, list: &[Angular], position: Position) -> Result<(), FitError> {
        let affordable = |angular: &&Angular| {
            self.is_affordable(BasisSpec { angular: **angular, position })
                || self.wish.angular().is_some()
        };
        let list: Vec<Angular> = list.iter().filter(affordable).copied().collect();
        let (mut best, mut worse) = (f64::NEG_INFINITY, 0);
        let mut at = 0;
        while at < list.len() && worse < WORSE_MAX {
            // Splines are not nested; of the others a few at a time share rows.
            let nested = list[at].degree().is_some();
            let end = if nested { (at + SHARING).min(list.len()) } else { at + 1 };
            let family = self.family(BasisSpec { angular: list[end - 1], position })?;
            for angular in &list[at..end] {
                let spec = BasisSpec { angular: *angular, position };
                if worse == WORSE_MAX || self.has(spec) {
                    continue;
                }
                let Some((trial, _)) = family.trial(spec, self.strengths, &self.folds)? else {
                    worse += 1;
                    continue;
                };
                self.tried.push((spec, trial));
                worse = if trial.score > best { 0 } else { worse + 1 };
                best = best.max(trial.score);
            }
            at = end;
        }
        Ok(())
    }

    /// Tries other functions of the position with a basis of the direction: polynomials of a degree less,
    /// and of ever higher ones while these do better.
    fn places(&mut self, angular: Angular, degree: usize) -> Result<(), FitError> {
        let at = POSITION.iter().position(|d| *d == degree).unwrap_or(0);
        if let Some(below) = at.checked_sub(1) {
            self.rising(&[angular], Position::Legendre { degree: POSITION[below] })?;
        }
        for degree in POSITION.into_iter().skip(at + 1) {
            let position = Position::Legendre { degree };
            if degree > self.position_most {
                break;
            }
            self.rising(&[angular], position)?;
            if self.best(|_| true).is_none_or(|(best, _)| best.position != position) {
                break;
            }
        }
        let best = self.best(|_| true).and_then(|(best, _)| best.position.degree());
        let degree = best.unwrap_or(degree);
        if degree >= POSITION_SPLINES_FROM { self.splines_of_places() } else { Ok(()) }
    }

    /// Tries ever more spans in position, each with the best functions of the direction that they leave
    /// room for: what is narrow in position may need none but coarse ones. Beam or not, up to as many
    /// coefficients: under a spot wider than what is looked for nothing else follows it.
    fn splines_of_places(&mut self) -> Result<(), FitError> {
        self.coefficients_max = COEFFICIENTS_MAX.min(self.samples.len());
        let (mut best, mut worse) = (f64::NEG_INFINITY, 0);
        for spans in POSITION_SPLINES {
            if spans > self.position_most {
                break;
            }
            let position = Position::Splines { spans };
            let fits = |spec: &BasisSpec| {
                self.is_affordable(BasisSpec { angular: spec.angular, position })
            };
            let Some((spec, _)) = self.best(fits) else { break };
            self.rising(&[spec.angular], position)?;
            let Some((_, trial)) = self.best(|spec| spec.position == position) else { continue };
            worse = if trial.score > best { 0 } else { worse + 1 };
            best = best.max(trial.score);
            if worse == SPANS_IN_VAIN {
                break;
            }
        }
        Ok(())
    }

    pub(super) fn family(&self, spec: BasisSpec) -> Result<Family, FitError> {
        let samples = (self.samples, Arc::clone(&self.grid));
        Family::new(spec, self.region, samples, &self.u, self.optics)
    }

    pub(super) fn best(&self, of: impl Fn(&BasisSpec) -> bool) -> Option<(BasisSpec, Trial)> {
        let among = self.tried.iter().filter(|(spec, _)| of(spec));
        among.max_by(|a, b| a.1.score.total_cmp(&b.1.score)).copied()
    }

    pub(super) fn has(&self, spec: BasisSpec) -> bool {
        self.tried.iter().any(|(tried, _)| *tried == spec)
    }

    pub(super) fn is_degree_open(&self) -> bool {
        self.wish.position_degree.is_none()
    }

    pub(super) fn theta_max_rad(&self) -> f64 {
        self.region.theta_max_rad
    }

    pub(super) fn is_affordable(&self, spec: BasisSpec) -> bool {
        spec.len() <= self.coefficients_max
    }
}

/// Readings that a choice is made from at most, and where rows are averaged over a beam.
const READINGS_MAX: usize = 6000;
const AVERAGED_READINGS_MAX: usize = 3000;
/// Coefficients of a basis that is chosen at most: what is finer has to be asked for by name.
const COEFFICIENTS_MAX: usize = 1000;
/// The same where rows are averaged over a beam, which costs milliseconds a row beyond; of splines in
/// position as many as without.
const AVERAGED_COEFFICIENTS_MAX: usize = 400;
/// Folds that the sweeps are dealt into.
const FOLDS: usize = 16;
/// Total degrees tried in position.
const POSITION: [usize; 9] = [0, 1, 2, 3, 4, 6, 8, 11, 14];
/// Spans of splines tried in position, and the degree from which on they are.
const POSITION_SPLINES: [usize; 4] = [4, 6, 9, 12];
const POSITION_SPLINES_FROM: usize = 4;
/// More spans may do no better this often before still more are given up.
const SPANS_IN_VAIN: usize = 2;
/// Degrees in direction while that in position is looked for.
const MIDDLING: [usize; 2] = [6, 2];
/// Of every Zernike basis that is tried.
const COSINE_COLUMNS: usize = 2;
/// A basis has to fail this often before finer ones are given up.
const WORSE_MAX: usize = 3;
/// Bases that share rows.
const SHARING: usize = 5;
const ZERNIKE: [usize; 10] = [0, 2, 4, 6, 8, 10, 13, 16, 20, 24];
const HEMISPHERICAL: [usize; 8] = [2, 4, 6, 8, 10, 12, 15, 18];
const SPHERICAL: [usize; 12] = [0, 1, 2, 4, 6, 8, 10, 12, 15, 18, 22, 26];
const SECOND_PLANE: [usize; 9] = [0, 1, 2, 3, 4, 6, 8, 10, 12];
/// Spans of θ, and of φ round the horizon.
const SPLINES: [(usize, usize); 10] = [
    (4, 8),
    (7, 12),
    (12, 8),
    (10, 16),
    (20, 10),
    (14, 20),
    (20, 16),
    (20, 26),
    (36, 12),
    (36, 20),
];
/// Of variances that nothing was stated about, in units of what they are taken for.
const SCALE_LEAST: f64 = 1e-12;
