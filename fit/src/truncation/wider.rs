//! The wider model of a fit's readings: the fit's functions, what samples share, and finer functions,
//! under noise as it is stated or as the fit took it; and what the likeliest says of the fit.

use super::heard::{Taken, Walks};
use super::left_out::LeftOut;
use super::likeliest::{Hold, Likeliest, POWER, Shares};
use super::look::{Look, Rows};
use super::uneven::{Directions, Uneven};
use super::{Finer, Shared, Truncation};
use crate::basis::{Basis, dot};
use crate::beam::design::Design;
use crate::influence::Influence;
use crate::parts::Parts;
use crate::penalty::{Prior, Roughness};
use crate::triangle::{Solution, Triangle};
use crate::{Common, Fit, FitError, Robust, Weighed};
use faer::Mat;
use glam::DVec3;
use std::ops::RangeInclusive;

/// The fit's functions and finer ones.
#[derive(Debug)]
pub(crate) struct Wider<'f> {
    fit: &'f Fit,
    /// What is held against the fit's own functions.
    prior: Prior,
    shared: Shared,
    beyond: Basis,
    /// The finer functions that aren't the fit's own.
    kept: Vec<usize>,
    /// Harmonics among `beyond` that the fit's own polynomials are sums of.
    polynomials: Vec<usize>,
    has_unknown: bool,
    excess: f64,
    robust: Robust,
}

/// Which variances the likeliest model takes readings to have.
#[derive(Debug, Clone, Copy)]
pub(super) struct Noise {
    /// The stated ones, rather than those that the fit found.
    pub(super) is_stated: bool,
    /// Times this.
    pub(super) scale: f64,
}

/// A fit with the likeliest model's u.
#[derive(Debug)]
pub(crate) struct Widened {
    pub(crate) parts: Parts,
    /// S of the coefficients' covariance by the readings' variances alone, packed.
    pub(crate) factor: Vec<f64>,
    noise: Noise,
}

impl Widened {
    /// What the likeliest model multiplies the variances by that it was told of.
    pub(crate) fn scale(&self) -> f64 {
        self.noise.scale
    }

    /// The readings' variances as the covariance takes them, of those of the fit and what of them is stated.
    pub(crate) fn variances(
        &self,
        variances: &[f64],
        stated: &[f64],
        weighed: &Weighed,
    ) -> Vec<f64> {
        let Noise { is_stated, scale } = self.noise;
        let of = |(i, variance): (usize, &f64)| {
            if weighed.is_outlier(i) { f64::INFINITY } else { scale * variance }
        };
        let taken = if is_stated { stated } else { variances };
        taken.iter().enumerate().map(of).collect()
    }
}

/// The likeliest prior, and the likeliest of those that take finer functions to fall off otherwise.
struct Priors {
    likeliest: Likeliest,
    other: Option<Likeliest>,
}

/// Rows, with what is known of the fit's own functions and of what samples share.
struct Joint {
    rows: Rows,
    solution: Solution,
}

impl<'f> Wider<'f> {
    pub(crate) fn new(
        fit: &'f Fit,
        finer: Finer,
        taken: &Taken,
        common: &[Common],
    ) -> Result<Self, FitError> {
        let Finer { spec, kept, polynomials } = finer;
        Ok(Self {
            fit,
            prior: Prior::new(fit.functions(), fit.penalty())?,
            shared: Shared::of(fit, taken, common),
            beyond: Basis::new(spec, *fit.region())?,
            kept,
            polynomials,
            has_unknown: taken.has_unknown,
            excess: taken.excess,
            robust: taken.robust,
        })
    }

    /// Of readings that were forgotten, by what is left of them; `names` are of what they share.
    pub(super) fn of_shares(
        fit: &'f Fit,
        finer: Finer,
        names: &[String],
        (has_unknown, excess): (bool, f64),
    ) -> Result<Self, FitError> {
        let Finer { spec, kept, polynomials } = finer;
        Ok(Self {
            fit,
            prior: Prior::new(fit.functions(), fit.penalty())?,
            shared: Shared::named(fit, names),
            beyond: Basis::new(spec, *fit.region())?,
            kept,
            polynomials,
            has_unknown,
            excess,
            robust: Robust::None,
        })
    }

    pub(super) fn fit(&self) -> &Fit {
        self.fit
    }

    /// Whether nothing was stated of some readings' noise.
    pub(super) fn has_unknown(&self) -> bool {
        self.has_unknown
    }

    /// What finer functions are of.
    pub(crate) fn beyond(&self) -> &Basis {
        &self.beyond
    }

    pub(super) fn kept(&self) -> &[usize] {
        &self.kept
    }

    /// The change of every value by one u of what samples share, as the fit found it.
    pub(crate) fn kept_sides(&self, influence: &Influence) -> Result<Vec<Vec<f64>>, FitError> {
        self.shared.kept_sides(influence)
    }

    /// The same of some samples; `columns` are those of what was fitted along.
    pub(crate) fn sides(
        &self,
        own: &Design<'_>,
        columns: &[Vec<f64>],
        common: &[Common],
    ) -> Result<Vec<Vec<f64>>, FitError> {
        self.shared.sides(self.fit, own, columns, common)
    }

    /// The likeliest model of two or three walks: the fit with its u, if that differs.
    pub(crate) fn widened<W: Walks>(&self, walks: &mut W) -> Result<Option<Widened>, W::Error> {
        let columns = self.known() + self.kept.len();
        // The misfit may be what the functions can't follow, noise that isn't stated, or both.
        let mut look = Look::new(columns, self.excess != 0.0 && !self.has_unknown);
        let mut directions = Directions::new();
        walks.each(&mut |heard| {
            directions.take(heard);
            look.take(heard, &self.kept, |_, _| {})
        })?;
        self.concluded(look, |noise, solution| self.left_out(walks, noise, &directions, solution))
    }

    /// What one look at all readings says, and what of each all others foretell, as `left_out` finds out.
    pub(super) fn concluded<E: From<FitError>>(
        &self,
        look: Look,
        left_out: impl FnOnce(Noise, &Solution) -> Result<LeftOut, E>,
    ) -> Result<Option<Widened>, E> {
        let (scatter, plain) = (look.scatter, look.plain);
        let (joint, Priors { likeliest: found, other }) = self.likeliest(look)?;
        let is_wider = found.strength.is_finite();
        if !is_wider && self.excess == 0.0 {
            return Ok(None);
        }
        let solution = self.posterior(&joint, &found)?;
        let noise = Noise { is_stated: joint.rows.is_stated, scale: found.scale };
        let whole = solution.inverse();
        let p = self.own().len();
        let factor = whole[..p * (p + 1) / 2].to_vec();
        // Of reweighed readings the coefficients scatter by other than their weights say.
        let inflation = self.robust.inflation().sqrt();
        let inflated = factor.iter().map(|value| inflation * value).collect();
        let mut parts = Parts { factor: inflated, ..self.fit.parts().clone() };
        if is_wider {
            let left_out = left_out(noise, &solution)?;
            let uneven = Uneven::of(&left_out);
            let mut missed = self.missed(&solution, &whole);
            if let Some(other) = other {
                self.mix(&mut missed, &joint, (&found, &other))?;
            }
            missed.extend(self.between(&left_out));
            let beyond = self.beyond.spec();
            parts.truncation = Some(Truncation { beyond, missed, gain: found.gain, uneven });
            let all = scatter[usize::from(noise.is_stated)];
            parts.model.truncation = self.rough(found.scale * all - scatter[1], plain);
        }
        Ok(Some(Widened { parts, factor, noise }))
    }

    /// The likeliest model, with finer functions where they make the readings likelier than chance
    /// would.
    fn likeliest(&self, look: Look) -> Result<(Joint, Priors), FitError> {
        let Look { found, stated, least, most, .. } = look;
        let joint = self.joint(found)?;
        if self.excess == 0.0 {
            let found = self.at_scales(&joint, 1.0..=1.0)?;
            return Ok((joint, found));
        }
        let least = if self.has_unknown { SCALE_LEAST } else { least.max(SCALE_LEAST) };
        let found = self.at_scales(&joint, least..=most)?;
        let Some(stated) = stated else { return Ok((joint, found)) };
        let other = self.joint(stated)?;
        let by_stated = self.at_scales(&other, 1.0..=SCALE_MOST)?;
        let is_better = by_stated.likeliest.deviance < found.likeliest.deviance;
        Ok(if is_better { (other, by_stated) } else { (joint, found) })
    }

    fn joint(&self, rows: Rows) -> Result<Joint, FitError> {
        let mut held = rows.triangle.clone();
        self.absorb_known(&mut held);
        let solution = held.solve().ok_or(FitError::OutOfRange)?;
        Ok(Joint { rows, solution })
    }

    /// The fit's own functions.
    fn own(&self) -> &Basis {
        self.fit.functions()
    }

    /// The fit's functions and what samples share.
    fn known(&self) -> usize {
        self.own().len() + self.shared.shifts.len()
    }

    /// What is held against the fit's own functions, and that what samples share is one u.
    fn absorb_known(&self, triangle: &mut Triangle) {
        let (p, q, known) = (self.own().len(), self.kept.len(), self.known());
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
        own.sum::<f64>() + joint.rows.logs
    }

    /// The likeliest power and strength, with the variances times a number within the range; no
    /// finer functions where they gain no more than chance does. And the likeliest of the other power.
    fn at_scales(&self, joint: &Joint, scales: RangeInclusive<f64>) -> Result<Priors, FitError> {
        let (p, n) = (self.own().len(), joint.rows.counted);
        let free = if self.prior.is_none() { n - p as f64 } else { n };
        let rest = joint.solution.residual_squares(0);
        let below = joint.solution.rotated(0).split_off(self.known());
        let alone = Likeliest::alone(rest + dot(&below, &below), free, &scales);
        let of_power = |power: f64| {
            let mut best = Likeliest { ..alone };
            for around in AROUND {
                let hold = Hold { power, around };
                let root = self.root(hold, &self.kept)?;
                let shares = Shares::of(&joint.solution, self.known(), &root);
                let found = shares.and_then(|shares| shares.likeliest(rest, free, &scales));
                best = best.or(found.map(|found| Likeliest { hold, ..found }));
            }
            Ok::<_, FitError>(best)
        };
        let (smooth, rough) = (of_power(POWER)?, of_power(ROUGHER_POWER)?);
        let is_rough = rough.deviance < smooth.deviance;
        let (best, other) = if is_rough { (rough, smooth) } else { (smooth, rough) };
        let gain = alone.deviance - best.deviance;
        let determinants = self.determinants(joint);
        let stated = |found: Likeliest| {
            let gain = alone.deviance - found.deviance;
            Likeliest { gain, deviance: found.deviance + determinants, ..found }
        };
        if gain <= GAIN_MIN {
            return Ok(Priors { likeliest: stated(alone), other: None });
        }
        let other = other.strength.is_finite().then(|| stated(other));
        Ok(Priors { likeliest: stated(best), other })
    }

    /// The square root of what is held against some of the harmonics.
    fn root(&self, hold: Hold, harmonics: &[usize]) -> Result<Mat<f64>, FitError> {
        let basis = &self.beyond;
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
        let (basis, own, harmonics) = (&self.beyond, self.own(), &self.polynomials);
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

    /// What all rows and priors determine under the likeliest model.
    fn posterior(&self, joint: &Joint, found: &Likeliest) -> Result<Solution, FitError> {
        let (q, known) = (self.kept.len(), self.known());
        let is_wider = found.strength.is_finite();
        let mut triangle = joint.rows.triangle.scaled(1.0 / found.scale.sqrt());
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
        triangle.solve().ok_or(FitError::OutOfRange)
    }

    /// The missed fields: how far the fit lies off the wider one, and what of the finer functions is open.
    fn missed(&self, solution: &Solution, whole: &[f64]) -> Vec<Vec<f64>> {
        let known = self.known();
        let columns = known..known + self.kept.len();
        let columns = columns.map(|j| self.spread(&whole[j * (j + 1) / 2..][..=j]));
        std::iter::once(self.off(&solution.unknowns(0))).chain(columns).collect()
    }

    /// What the fit misses under either of two priors, each as far as it is to be believed: the fields of
    /// both, whose variances come together as those of a mixture of what they say do.
    fn mix(
        &self,
        missed: &mut Vec<Vec<f64>>,
        joint: &Joint,
        (likeliest, other): (&Likeliest, &Likeliest),
    ) -> Result<(), FitError> {
        let behind = other.deviance - likeliest.deviance;
        let part = 1.0 / (1.0 + libm::exp(0.5 * behind / DOUBT));
        if part < PART_LEAST {
            return Ok(());
        }
        let solution = self.posterior(joint, other)?;
        let mut further = self.missed(&solution, &solution.inverse());
        for (fields, part) in [(&mut *missed, 1.0 - part), (&mut further, part)] {
            fields.iter_mut().flatten().for_each(|value| *value *= part.sqrt());
        }
        missed.append(&mut further);
        Ok(())
    }

    /// Standard deviation of what is left beyond the stated noise. Where finer functions are called
    /// for at all, it is taken for what is finer still: the field's own, along a ray. Each reading
    /// says as much of it as its weight is; limits say nothing.
    fn rough(&self, beyond: f64, plain: f64) -> f64 {
        if self.has_unknown { 0.0 } else { (beyond / plain.max(1.0)).max(0.0).sqrt() }
    }

    /// The reported fit less the wider one, but for what the shared components do to both.
    fn off(&self, wider: &[f64]) -> Vec<f64> {
        let mut off = self.spread(&wider.iter().map(|value| -value).collect::<Vec<f64>>());
        off.iter_mut().zip(self.fit.coefficients()).for_each(|(off, own)| *off += own);
        for (times, shift) in wider[self.own().len()..].iter().zip(&self.shared.shifts) {
            off.iter_mut().zip(shift).for_each(|(off, shift)| *off -= times * shift);
        }
        off
    }

    /// A field over the fit's functions and the kept ones as one over all functions.
    fn spread(&self, narrow: &[f64]) -> Vec<f64> {
        let p = self.own().len();
        let mut wide = vec![0.0; p + self.beyond.len()];
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
/// The other power that is tried.
const ROUGHER_POWER: f64 = 2.0;
/// How much less the readings' word on two priors counts than a likelihood says, neither being true: a
/// power posterior (Grünwald 2012). Two of lamps that differed by 1 in -2 log L gave u of M that differed
/// tenfold; by 4, 10 and 30 they were covered alike, by 1 not.
const DOUBT: f64 = 10.0;
/// A prior that is believed less changes no u by one part in a thousand, unless it is the larger by far:
/// then the readings have said that it isn't so.
const PART_LEAST: f64 = 1e-3;
/// See [`Hold::around`].
const AROUND: [f64; 4] = [1.0, 10.0, 100.0, 1e4];
/// A gain that chance rarely gives: several priors are tried, and at 8 the scatter of two runs in five
/// of an example was taken for structure.
const GAIN_MIN: f64 = 12.0;
/// Of variances that nothing was stated about.
const SCALE_LEAST: f64 = 1e-12;
/// Of stated ones: who states a noise knows it to a factor of ten. What is beyond that the functions
/// can't follow, or it is as large in the dark as in the light.
pub(super) const SCALE_MOST: f64 = 100.0;
