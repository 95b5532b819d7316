//! The wider model of a fit's readings: the fit's functions, what samples share, and finer functions,
//! under noise as it is stated or as the fit took it; and what the likeliest says of the fit.

use super::likeliest::{Hold, Likeliest, POWER, Shares};
use super::{Shared, Truncation};
use crate::basis::{Basis, dot};
use crate::beam::design::{Design, Room};
use crate::parts::Parts;
use crate::penalty::{Prior, Roughness};
use crate::triangle::{Solution, Triangle};
use crate::weights::has_unknown;
use crate::{Fit, FitError, Influence, Weighed};
use faer::Mat;
use glam::DVec3;
use std::ops::RangeInclusive;

/// The fit's functions and finer ones.
pub(super) struct Wider<'s> {
    pub(super) own: Design<'s>,
    /// What is held against the fit's own functions.
    pub(super) prior: Prior,
    pub(super) shared: Shared,
    /// What the samples count as having read.
    pub(super) values: &'s [f64],
    pub(super) weighed: &'s Weighed,
    pub(super) beyond: Design<'s>,
    /// The finer functions that aren't the fit's own.
    pub(super) kept: Vec<usize>,
    /// Harmonics among `beyond` that the fit's own polynomials are sums of.
    pub(super) polynomials: Vec<usize>,
}

/// Of the fit's functions, of the finer ones, and a row of these.
pub(super) type Rooms = (Room, Room, Vec<f64>);

/// All readings under some variances: a triangle of the fit's functions, what samples share, the
/// finer functions, and the values.
pub(super) struct Joint {
    pub(super) triangle: Triangle,
    /// With what is known of the fit's own functions and of what samples share.
    pub(super) solution: Solution,
    pub(super) variances: Vec<f64>,
}

impl Wider<'_> {
    /// The likeliest model, with finer functions where they make the readings likelier than chance
    /// would.
    pub(super) fn likeliest(&self, influence: &Influence) -> Result<(Joint, Likeliest), FitError> {
        let Influence { variances, excess, stated, .. } = influence;
        let (variances, stated) = (&self.heard(variances), &self.heard(stated));
        let joint = self.joint(variances)?;
        if *excess == 0.0 {
            let found = self.at_scales(&joint, 1.0..=1.0)?;
            return Ok((joint, found));
        }
        // The misfit may be what the functions can't follow, noise that isn't stated, or both.
        let is_unknown = has_unknown(self.own.samples());
        let both = stated.iter().zip(variances).filter(|(_, all)| all.is_finite());
        let ratios = both.map(|(stated, all)| stated / all);
        let least = ratios.fold(1.0, f64::min);
        let least = if is_unknown { SCALE_LEAST } else { least.max(SCALE_LEAST) };
        let found = self.at_scales(&joint, least..=1.0)?;
        if is_unknown {
            return Ok((joint, found));
        }
        let other = self.joint(stated)?;
        let by_stated = self.at_scales(&other, 1.0..=SCALE_MOST)?;
        let is_better = by_stated.deviance < found.deviance;
        Ok(if is_better { (other, by_stated) } else { (joint, found) })
    }

    /// The variances with infinite ones of outliers: by their residuals they would be taken for what
    /// the functions can't follow, since Huber's weight leaves the more of their squares the larger
    /// they are.
    fn heard(&self, variances: &[f64]) -> Vec<f64> {
        let of = |(i, variance): (usize, &f64)| {
            if self.weighed.is_outlier(i) { f64::INFINITY } else { *variance }
        };
        variances.iter().enumerate().map(of).collect()
    }

    /// One pass of all rows, each divided by its standard uncertainty.
    fn joint(&self, variances: &[f64]) -> Result<Joint, FitError> {
        let (q, values) = (self.kept.len(), self.values);
        let known = self.known();
        let mut triangle = Triangle::new(known + q, 1);
        let mut rooms = self.rooms();
        let mut row = vec![0.0; known + q + 1];
        for (i, (value, variance)) in values.iter().zip(variances).enumerate() {
            let weight = 1.0 / variance.sqrt();
            if !weight.is_finite() {
                return Err(FitError::OutOfRange);
            }
            if weight == 0.0 {
                continue;
            }
            self.row(i, &mut rooms, &mut row[..known + q]);
            row[known + q] = *value;
            for value in &mut row {
                *value *= weight;
            }
            triangle.absorb(&row);
        }
        let mut held = triangle.clone();
        self.absorb_known(&mut held);
        let solution = held.solve().ok_or(FitError::OutOfRange)?;
        Ok(Joint { triangle, solution, variances: variances.to_vec() })
    }

    /// What rows are made in.
    pub(super) fn rooms(&self) -> Rooms {
        (self.own.room(), self.beyond.room(), vec![0.0; self.beyond.basis().len()])
    }

    /// A reading's row over the fit's functions, what samples share, and the finer functions.
    pub(super) fn row(&self, i: usize, (own_room, room, all): &mut Rooms, row: &mut [f64]) {
        let (own, others) = row.split_at_mut(self.own.basis().len());
        let (sides, finer) = others.split_at_mut(self.shared.sides.len());
        self.own.row(i, own_room, own);
        self.beyond.row(i, room, all);
        sides.iter_mut().zip(&self.shared.sides).for_each(|(out, side)| *out = side[i]);
        finer.iter_mut().zip(&self.kept).for_each(|(out, k)| *out = all[*k]);
    }

    /// The fit's functions and what samples share.
    fn known(&self) -> usize {
        self.own.basis().len() + self.shared.sides.len()
    }

    /// What is held against the fit's own functions, and that what samples share is one u.
    fn absorb_known(&self, triangle: &mut Triangle) {
        let (p, q, known) = (self.own.basis().len(), self.kept.len(), self.known());
        self.prior.absorb_into(triangle, known - p + q + 1);
        let mut row = vec![0.0; known + q + 1];
        for k in p..known {
            row[k] = 1.0;
            triangle.absorb(&row);
            row[k] = 0.0;
        }
    }

    /// Of the variances, and of the fit's own functions.
    fn determinants(&self, joint: &Joint) -> f64 {
        let r = joint.solution.r();
        let own = (0..self.known()).map(|i| 2.0 * libm::log(r[(i, i)].abs()));
        let counted = joint.variances.iter().filter(|variance| variance.is_finite());
        own.chain(counted.map(|variance| libm::log(*variance))).sum()
    }

    /// The likeliest power and strength, with the variances times a number within the range; no
    /// finer functions where they gain no more than chance does.
    fn at_scales(&self, joint: &Joint, scales: RangeInclusive<f64>) -> Result<Likeliest, FitError> {
        let counted = joint.variances.iter().filter(|variance| variance.is_finite());
        let (p, n) = (self.own.basis().len(), counted.count() as f64);
        let free = if self.prior.is_none() { n - p as f64 } else { n };
        let rest = joint.solution.residual_squares(0);
        let below = joint.solution.rotated(0).split_off(self.known());
        let alone = Likeliest::alone(rest + dot(&below, &below), free, &scales);
        let tried = |hold: Hold| {
            let shares = Shares::of(&joint.solution, self.known(), &self.root(hold, &self.kept)?);
            let found = shares.and_then(|shares| shares.likeliest(rest, free, &scales));
            Ok::<_, FitError>(found.map(|found| Likeliest { hold, ..found }))
        };
        let mut best = Likeliest { ..alone };
        for around in AROUND {
            best = best.or(tried(Hold { power: POWER, around })?);
        }
        for power in OTHER_POWERS {
            best = best.or(tried(Hold { power, ..best.hold })?);
        }
        let gain = alone.deviance - best.deviance;
        let mut found = if gain > GAIN_MIN { Likeliest { gain, ..best } } else { alone };
        found.deviance += self.determinants(joint);
        Ok(found)
    }

    /// The square root of what is held against some of the harmonics.
    fn root(&self, hold: Hold, harmonics: &[usize]) -> Result<Mat<f64>, FitError> {
        let basis = self.beyond.basis();
        let mut root = Roughness::new(basis, hold.power)?.of_functions(harmonics);
        for (j, k) in harmonics.iter().enumerate() {
            let (q, j_direction) = (k / basis.angular_len(), k % basis.angular_len());
            if q > 0 || basis.directions().order(j_direction) != 0 {
                root.col_as_slice_mut(j).iter_mut().for_each(|value| *value *= hold.around);
            }
        }
        Ok(root)
    }

    /// What the likeliest prior holds against the fit's own functions where the fit itself holds
    /// nothing against them: they are harmonics too, and left free they would run away where nothing
    /// was measured, the finer ones with them.
    fn absorb_own(&self, triangle: &mut Triangle, found: &Likeliest) -> Result<(), FitError> {
        let (basis, own, harmonics) = (self.beyond.basis(), self.own.basis(), &self.polynomials);
        let polynomials = harmonics.iter().filter(|k| **k < basis.angular_len()).count();
        if polynomials == 0 || !self.prior.is_none() {
            return Ok(());
        }
        let root = self.root(found.hold, harmonics)?;
        let turn = as_harmonics(own, polynomials, basis, &harmonics[..polynomials])?;
        let mut row = vec![0.0; self.known() + self.kept.len() + 1];
        for i in 0..harmonics.len() {
            let place = i / polynomials;
            let first = place * own.angular_len();
            let strength = found.strength.sqrt() * root[(i, i)];
            for (j, value) in row[first..first + polynomials].iter_mut().enumerate() {
                *value = strength * turn[j][i % polynomials];
            }
            triangle.absorb(&row);
            row[first..first + polynomials].fill(0.0);
        }
        Ok(())
    }

    /// The fit with the likeliest model's u.
    pub(super) fn widen(
        &self,
        fit: &Fit,
        joint: &Joint,
        found: &Likeliest,
    ) -> Result<Fit, FitError> {
        let (p, q, known) = (self.own.basis().len(), self.kept.len(), self.known());
        let is_wider = found.strength.is_finite();
        if !is_wider && fit.influence().is_some_and(|i| i.excess == 0.0) {
            return Ok(fit.clone());
        }
        let mut triangle = joint.triangle.scaled(1.0 / found.scale.sqrt());
        self.absorb_known(&mut triangle);
        // Without finer functions any hold on them leaves the fit's own columns alone.
        let strength = if is_wider { found.strength } else { 1.0 };
        let root = self.root(found.hold, &self.kept)?;
        let mut row = vec![0.0; known + q + 1];
        for i in 0..q {
            for j in 0..q {
                row[known + j] = strength.sqrt() * root[(i, j)];
            }
            triangle.absorb(&row);
        }
        if is_wider {
            self.absorb_own(&mut triangle, found)?;
        }
        let solution = triangle.solve().ok_or(FitError::OutOfRange)?;
        let whole = solution.inverse();
        let factor = whole[..p * (p + 1) / 2].to_vec();
        let variances: Vec<f64> =
            joint.variances.iter().map(|variance| variance * found.scale).collect();
        let rough = self.rough(fit, &variances);
        let truncation = is_wider.then(|| {
            let unknowns = solution.unknowns(0);
            let columns = known..known + q;
            let columns = columns.map(|j| self.spread(&whole[j * (j + 1) / 2..][..=j]));
            let off = self.off(fit, &unknowns);
            let missed: Vec<Vec<f64>> = std::iter::once(off).chain(columns).collect();
            let uneven = self.uneven(joint, found.scale, &solution);
            let beyond = self.beyond.basis().spec();
            Truncation { beyond, missed, gain: found.gain, uneven }
        });
        let influence =
            fit.influence().map(|influence| influence.under(variances, &self.own, &factor));
        // Of reweighed readings the coefficients scatter by other than their weights say.
        let inflation = self.weighed.robust.inflation().sqrt();
        let factor = factor.into_iter().map(|value| inflation * value).collect();
        let mut parts = Parts { factor, truncation, ..fit.parts().clone() };
        if is_wider {
            parts.model.truncation = rough;
        }
        let wider = Fit::from_parts(parts).map_err(|_| FitError::OutOfRange)?;
        let mut wider =
            wider.with_measured(fit.measured().cloned()).with_weighed(self.weighed.clone());
        if let Some(influence) = influence {
            wider = wider.with_influence(influence);
        }
        Ok(wider)
    }

    /// Standard deviation of what is left beyond the stated noise. Where finer functions are called
    /// for at all, it is taken for what is finer still: the field's own, along a ray. Each reading
    /// says as much of it as its weight is; limits say nothing.
    fn rough(&self, fit: &Fit, variances: &[f64]) -> f64 {
        let Some(influence) = fit.influence() else { return 0.0 };
        if has_unknown(self.own.samples()) {
            return 0.0;
        }
        let (mut beyond, mut count) = (0.0, 0.0_f64);
        for (i, (all, stated)) in variances.iter().zip(&influence.stated).enumerate() {
            if all.is_finite() && self.weighed.limits.binary_search(&i).is_err() {
                beyond += self.weighed.weights[i] * (all - stated);
                count += 1.0;
            }
        }
        (beyond / count.max(1.0)).max(0.0).sqrt()
    }

    /// The reported fit less the wider one, but for what the shared components do to both.
    fn off(&self, fit: &Fit, wider: &[f64]) -> Vec<f64> {
        let mut off = self.spread(&wider.iter().map(|value| -value).collect::<Vec<f64>>());
        off.iter_mut().zip(fit.coefficients()).for_each(|(off, own)| *off += own);
        for (times, shift) in wider[self.own.basis().len()..].iter().zip(&self.shared.shifts) {
            off.iter_mut().zip(shift).for_each(|(off, shift)| *off -= times * shift);
        }
        off
    }

    /// A field over the fit's functions and the kept ones as one over all functions.
    fn spread(&self, narrow: &[f64]) -> Vec<f64> {
        let p = self.own.basis().len();
        let mut wide = vec![0.0; p + self.beyond.basis().len()];
        wide[..p].copy_from_slice(&narrow[..p]);
        for (value, k) in narrow[self.known()..].iter().zip(&self.kept) {
            wide[p + k] = *value;
        }
        wide
    }
}

/// The first functions of direction of a fit, each as a sum of harmonics that span the same fields: by
/// least squares over directions all over the hemisphere, exact to rounding.
fn as_harmonics(
    own: &Basis,
    polynomials: usize,
    basis: &Basis,
    harmonics: &[usize],
) -> Result<Vec<Vec<f64>>, FitError> {
    let mut triangle = Triangle::new(polynomials, polynomials);
    let (mut own_room, mut room) = (own.scratch(), basis.scratch());
    let mut values = vec![0.0; own.angular_len()];
    let mut all = vec![0.0; basis.angular_len()];
    let mut row = vec![0.0; 2 * polynomials];
    let count = DIRECTIONS_EACH * polynomials;
    for i in 0..count {
        // As many a solid angle everywhere, the next a golden angle further round.
        let cos = (i as f64 + 0.5) / count as f64;
        let (sin, phi) = ((1.0 - cos * cos).sqrt(), GOLDEN_ANGLE_RAD * i as f64);
        let d = DVec3::new(sin * libm::cos(phi), sin * libm::sin(phi), cos);
        own.direction_along(d, &mut own_room, &mut values);
        basis.direction_along(d, &mut room, &mut all);
        row[..polynomials].iter_mut().zip(harmonics).for_each(|(out, k)| *out = all[*k]);
        row[polynomials..].copy_from_slice(&values[..polynomials]);
        triangle.absorb(&row);
    }
    let solution = triangle.solve().ok_or(FitError::OutOfRange)?;
    Ok((0..polynomials).map(|j| solution.unknowns(j)).collect())
}

/// Directions that tell harmonics apart, for each of them.
const DIRECTIONS_EACH: usize = 4;
/// π (3 - √5).
const GOLDEN_ANGLE_RAD: f64 = 2.399_963_229_728_653;
/// Other powers that are tried.
const OTHER_POWERS: [f64; 1] = [2.0];
/// See [`Hold::around`].
const AROUND: [f64; 4] = [1.0, 10.0, 100.0, 1e4];
/// A gain that chance gives once in some hundred fits.
const GAIN_MIN: f64 = 8.0;
/// Of variances that nothing was stated about.
const SCALE_LEAST: f64 = 1e-12;
/// Of stated ones: who states a noise knows it to a factor of ten. What is beyond that the functions
/// can't follow, or it is as large in the dark as in the light.
const SCALE_MOST: f64 = 100.0;
