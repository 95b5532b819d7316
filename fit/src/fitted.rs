//! The fitted field and what follows from it. All derived quantities but the peak's place are linear
//! in the coefficients, and all go through one door: a functional f has the value f·c, the
//! independent variance |Sᵀf|² and the shift f·δ by each common component, whose squares add.

use crate::basis::{Basis, dot};
use crate::beam::Optics;
use crate::beam::design::readings;
use crate::estimate::INDEPENDENT;
use crate::extrapolation::Extrapolation;
use crate::functional::Along;
use crate::measured::Measured;
use crate::parts::demand;
use crate::{
    BasisSpec, BeamRows, Cause, CommonShift, Contribution, EXTRAPOLATION, Estimate, FitError,
    Functional, Influence, Parts, Penalised, Penalty, Ray, Region, TRUNCATION, Weighed, sparse,
};
use radiometry::DomainError;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

/// The fitted field L(x, y, θ, φ), with its covariance.
#[derive(Debug, Clone)]
pub struct Fit {
    basis: Basis,
    /// Of [`Truncation::beyond`].
    beyond: Option<Basis>,
    parts: Parts,
    influence: Option<Influence>,
    weighed: Option<Weighed>,
    /// Of a fit in many local functions, instead of the parts' factor.
    sparse: Option<Arc<sparse::Factor>>,
    measured: Option<Measured>,
    extrapolation: Option<Arc<Extrapolation>>,
}

impl Fit {
    /// Takes up stored parts.
    pub fn from_parts(parts: Parts) -> Result<Self, FitError> {
        let (basis, beyond) = parts.checked()?;
        Ok(Self {
            basis,
            beyond,
            parts,
            influence: None,
            weighed: None,
            measured: None,
            extrapolation: None,
            sparse: None,
        })
    }

    /// Of parts without a factor, whose covariance is the inverse of what a sparse one stands for.
    pub(crate) fn of_sparse(
        parts: Parts,
        basis: Basis,
        factor: Arc<sparse::Factor>,
    ) -> Result<Self, FitError> {
        demand("coefficients", basis.len(), &parts.coefficients)?;
        for common in &parts.shifts {
            demand("shift", basis.len(), &common.shift)?;
        }
        let sparse = Some(factor);
        Ok(Self {
            basis,
            beyond: None,
            parts,
            influence: None,
            weighed: None,
            measured: None,
            extrapolation: None,
            sparse,
        })
    }

    /// Whether the fit is one in so many local functions that its covariance is not kept as a matrix:
    /// [`covariance`](Self::covariance) then takes a solve a coefficient.
    pub fn is_sparse(&self) -> bool {
        self.sparse.is_some()
    }

    pub(crate) fn with_influence(self, influence: Influence) -> Self {
        Self { influence: Some(influence), ..self }
    }

    pub(crate) fn with_weighed(self, weighed: Weighed) -> Self {
        Self { weighed: Some(weighed), ..self }
    }

    pub(crate) fn with_measured(self, measured: Option<Measured>) -> Self {
        Self { measured, ..self }
    }

    pub(crate) fn extrapolated(self, extrapolation: Extrapolation) -> Self {
        Self { extrapolation: Some(Arc::new(extrapolation)), ..self }
    }

    /// What other functions make of where nothing was measured; `None` of a fit whose functions were
    /// pinned, and of one that was stored and taken up again.
    pub(crate) fn extrapolation(&self) -> Option<&Extrapolation> {
        self.extrapolation.as_deref()
    }

    /// Where the samples lay; `None` of a fit that was stored and taken up again, or read in blocks.
    pub(crate) fn measured(&self) -> Option<&Measured> {
        self.measured.as_ref()
    }

    /// That the meridians are too few for the functions, if so: each coefficient is determined, but
    /// what varies more often around the normal than the meridians can tell stands against other
    /// functions by its course in θ alone. `None` too where it isn't known where the samples lay.
    pub fn aliased(&self) -> Option<Cause> {
        self.measured.as_ref()?.too_few_meridians(&self.basis)
    }

    /// Whether something was measured along the ray: the region covers it, and it lies in no gap
    /// of the directions, where those are known.
    pub fn is_measured(&self, ray: &Ray) -> bool {
        self.region().covers(ray) && self.is_in_no_gap(ray.theta_rad, ray.phi_rad)
    }

    pub(crate) fn is_in_no_gap(&self, theta_rad: f64, phi_rad: f64) -> bool {
        let holds = |measured: &Measured| measured.holds(theta_rad, phi_rad, self.region());
        self.measured.as_ref().is_none_or(holds)
    }

    /// Other coefficients in the same basis, with the noise of these and nothing else.
    pub(crate) fn bare(&self, coefficients: Vec<f64>) -> Self {
        let Parts { region, model, factor, quality, .. } = &self.parts;
        let parts = Parts {
            region: *region,
            model: *model,
            coefficients,
            factor: factor.clone(),
            shifts: Vec::new(),
            quality: *quality,
            truncation: None,
        };
        let (beyond, influence, weighed) = (None, None, None);
        Self {
            basis: self.basis.clone(),
            beyond,
            parts,
            influence,
            weighed,
            measured: None,
            extrapolation: None,
            sparse: None,
        }
    }

    /// The same fit with other coefficients in the same basis: what each sample did to the former ones
    /// is no longer known.
    pub(crate) fn with_parts(&self, parts: Parts) -> Self {
        Self { parts, influence: None, ..self.clone() }
    }

    /// The same fit without the scale that all samples share: of the shifts by the components named, the
    /// part that is a factor of the whole field is left out, the factor being that of the exitance. What
    /// such a component does to the field's shape stays: the blur of a wider footprint, say.
    #[must_use]
    pub fn without_scale(&self, components: &[&str]) -> Self {
        let whole = dot(self.basis.exitance(), &self.parts.coefficients);
        let mut parts = self.parts.clone();
        let is_named = |shift: &&mut CommonShift| components.contains(&shift.name.as_str());
        for CommonShift { shift, .. } in parts.shifts.iter_mut().filter(is_named) {
            let factor = dot(self.basis.exitance(), shift) / whole;
            if factor.is_finite() {
                let own = shift.iter_mut().zip(&self.parts.coefficients);
                own.for_each(|(shift, coefficient)| *shift -= factor * coefficient);
            }
        }
        self.with_parts(parts)
    }

    /// What the fit made of each sample; `None` of a fit that was stored and taken up again, or merged
    /// from shares.
    pub fn weighed(&self) -> Option<&Weighed> {
        self.weighed.as_ref()
    }

    /// What each sample did to exitance, intensity on axis and peak; `None` of a fit that was stored and
    /// taken up again, and of one that a symmetry or a bound changed since.
    pub fn influence(&self) -> Option<&Influence> {
        self.influence.as_ref()
    }

    /// The numbers that the fit consists of.
    pub fn parts(&self) -> &Parts {
        &self.parts
    }

    /// The radiance along a ray, in the unit of the samples' values. Outside the region and its
    /// cone it is extrapolated, and u says how little is known there. What the basis is known not to
    /// follow ([`Penalised::truncation`]) is in u.
    pub fn radiance(&self, ray: &Ray) -> Estimate {
        self.estimate(&self.radiance_functional(ray))
    }

    /// The radiance along a ray without its uncertainty: for maps and comparisons of many rays.
    pub fn value(&self, ray: &Ray) -> f64 {
        self.basis.value(&self.parts.coefficients, ray, &mut self.basis.scratch())
    }

    /// What readings along these rays would be, each the mean over its beam: for the level of their
    /// noise. To about a part in a thousand, and at an outline in a hundred.
    pub fn readings(&self, rays: &[Ray], optics: &Optics) -> Result<Vec<f64>, FitError> {
        readings(rays, &self.basis, &self.parts.coefficients, optics)
    }

    /// The exitance M = ∫ L cos θ dω over the whole hemisphere, mean over the region, in the
    /// values' unit times sr: of Zernike polynomials c₀ √π. Beyond what was measured it is extrapolated.
    /// In charts other than the surface one it is no exitance but the flux over the region's area,
    /// or at the point of an environment the spherical irradiance ∫ L dω.
    pub fn exitance(&self) -> Estimate {
        self.estimate(&self.exitance_sum())
    }

    /// The exitance within the cone θ <= `theta_max_rad` about the normal, mean over the region.
    /// An angle outside [0, π/2] is refused, in charts of the whole sphere one outside [0, π].
    pub fn exitance_within(&self, theta_max_rad: f64) -> Result<Estimate, DomainError> {
        Ok(self.estimate(&self.sum_within(theta_max_rad)?))
    }

    /// The exitance within the region's own cone, mean over the region: what rests on measurement.
    pub fn exitance_within_region(&self) -> Estimate {
        self.estimate(&self.sum_within_region())
    }

    fn sum_within(&self, theta_max_rad: f64) -> Result<Functional, DomainError> {
        let own = self.basis.exitance_within(theta_max_rad)?;
        let within = |basis: &Basis| basis.exitance_within(theta_max_rad);
        let beyond = self.beyond.as_ref().map(within).transpose()?.unwrap_or_default();
        Ok(Functional::new(own, beyond).with_unmeasured(self.unmeasured_within(theta_max_rad)))
    }

    fn sum_within_region(&self) -> Functional {
        let is_whole = self.region().chart.is_whole_sphere();
        let end_rad = if is_whole { PI } else { FRAC_PI_2 };
        let theta_max_rad = self.region().theta_max_rad.min(end_rad);
        self.sum_within(theta_max_rad).unwrap_or_else(|_| self.exitance_sum())
    }

    /// The flux that leaves the region: exitance times its area, in the values' unit times m² sr.
    pub fn flux(&self) -> Estimate {
        self.exitance().times(self.region().area_m2())
    }

    /// The intensity of the region as a whole in a direction: ∫ L cos θ dA, in the values' unit
    /// times m²; of an object ∫ L dA over the plane across the direction. What the basis is known not
    /// to follow may be the same in all places, so that its whole is in u, as for
    /// [`radiance`](Self::radiance).
    pub fn intensity(&self, theta_rad: f64, phi_rad: f64) -> Estimate {
        let mean = self.estimate(&self.mean_towards(theta_rad, phi_rad));
        let is_whole = self.region().chart.is_whole_sphere();
        let projection = if is_whole { 1.0 } else { libm::cos(theta_rad) };
        mean.times(self.region().area_m2() * projection)
    }

    /// The exitance from directions that were measured over that of the hemisphere: how much of the
    /// latter rests on measurement. Measured is what lies within the region's cone and, where it is
    /// known where the samples lay, within the reach of their own mesh ([`Coverage`](crate::Coverage)):
    /// an even grid has no gaps, however sparse up to 26° from reading to mesh, a wedge of azimuth that was left out is
    /// one, to about two degrees. `None` where the exitance isn't positive.
    pub fn measured_fraction(&self) -> Option<f64> {
        let whole = self.exitance().value;
        let within = self.exitance_within_region().value - self.exitance_from_gaps();
        (whole > 0.0).then(|| within / whole)
    }

    /// What comes from gaps within the region's cone.
    fn exitance_from_gaps(&self) -> f64 {
        let Some(measured) = &self.measured else { return 0.0 };
        let is_whole = self.region().chart.is_whole_sphere();
        let (gaps, solid_angle_sr) = measured.gaps(self.region());
        let one = |(theta_rad, phi_rad): (f64, f64)| {
            let projection = if is_whole { 1.0 } else { libm::cos(theta_rad) };
            let mean = self.basis.mean_over_region(theta_rad, phi_rad);
            projection * dot(&mean, &self.parts.coefficients)
        };
        solid_angle_sr * gaps.into_iter().map(one).sum::<f64>()
    }

    /// The exitance's uncertainty by source, the independent part first.
    pub fn contributions(&self) -> Vec<Contribution> {
        self.budget(&self.exitance_sum())
    }

    /// The same of the exitance within the region's own cone.
    pub fn contributions_within_region(&self) -> Vec<Contribution> {
        self.budget(&self.sum_within_region())
    }

    /// The uncertainty of the radiance along a ray by source, the independent part first.
    pub fn radiance_contributions(&self, ray: &Ray) -> Vec<Contribution> {
        self.budget(&self.radiance_functional(ray))
    }

    /// One a function, in the order of [`names`](Self::names).
    pub fn coefficients(&self) -> &[f64] {
        &self.parts.coefficients
    }

    /// The coefficients' covariance by all components but truncation, which is no field of the basis;
    /// rows of a symmetric matrix.
    pub fn covariance(&self) -> Vec<Vec<f64>> {
        let p = self.basis.len();
        let mut covariance = vec![vec![0.0; p]; p];
        if let Some(factor) = &self.sparse {
            for (k, row) in covariance.iter_mut().enumerate() {
                *row = factor.covariance(k);
            }
        }
        let shifts = self.parts.shifts.iter().map(|common| common.shift.as_slice());
        for outer in self.factor_columns().chain(shifts) {
            for (i, a) in outer.iter().enumerate() {
                for (out, b) in covariance[i].iter_mut().zip(outer) {
                    *out += a * b;
                }
            }
        }
        covariance
    }

    /// The functions: `Z(n,m)` on the Nusselt disk, times Legendre polynomials `P1(x)`, `P2(y)`.
    pub fn names(&self) -> Vec<String> {
        (0..self.basis.len()).map(|k| self.basis.name(k)).collect()
    }

    /// Which functions.
    pub fn basis(&self) -> BasisSpec {
        self.parts.model.basis
    }

    /// What was held against rough fields.
    pub fn penalty(&self) -> Penalty {
        self.parts.model.penalty
    }

    /// Which functions and what was held against them: to fit other samples alike.
    pub fn model(&self) -> Penalised {
        self.parts.model
    }

    /// See [`Quality::determined`](crate::Quality::determined).
    pub fn determined(&self) -> f64 {
        self.parts.quality.determined
    }

    /// What the fit stands for.
    pub fn region(&self) -> &Region {
        &self.parts.region
    }

    /// See [`Quality::condition`](crate::Quality::condition).
    pub fn condition(&self) -> f64 {
        self.parts.quality.condition
    }

    /// See [`Quality::dof`](crate::Quality::dof).
    pub fn dof(&self) -> usize {
        self.parts.quality.dof
    }

    /// See [`Quality::n_used`](crate::Quality::n_used).
    pub fn n_used(&self) -> usize {
        self.parts.quality.n_used
    }

    /// See [`Quality::residual_rms`](crate::Quality::residual_rms).
    pub fn residual_rms(&self) -> f64 {
        self.parts.quality.residual_rms
    }

    /// See [`Quality::chi2`](crate::Quality::chi2).
    pub fn chi2(&self) -> f64 {
        self.parts.quality.chi2
    }

    /// See [`Quality::excess_rms`](crate::Quality::excess_rms).
    pub fn excess_rms(&self) -> f64 {
        self.parts.quality.excess_rms
    }

    /// See [`Quality::beam`](crate::Quality::beam).
    pub fn beam(&self) -> Option<BeamRows> {
        self.parts.quality.beam
    }

    pub(crate) fn functions(&self) -> &Basis {
        &self.basis
    }

    /// The functions beyond the fit's own, where it knows what it misses.
    pub(crate) fn beyond(&self) -> Option<&Basis> {
        self.beyond.as_ref()
    }

    /// The functional that a function makes of a basis.
    pub(crate) fn functional(&self, over: impl Fn(&Basis) -> Vec<f64>) -> Functional {
        Functional::new(over(&self.basis), self.beyond.as_ref().map(over).unwrap_or_default())
    }

    fn radiance_functional(&self, ray: &Ray) -> Functional {
        self.weighted_rays([(*ray, 1.0)])
    }

    /// The one door from coefficients to a number with its uncertainty.
    pub(crate) fn estimate(&self, functional: &Functional) -> Estimate {
        let independent = self.noise_variance(functional)
            + self.missed_variance(functional)
            + functional.unmeasured_variance();
        let common = self.common_shifts(functional).map(|(_, shift)| shift * shift);
        Estimate {
            value: dot(functional.row(), &self.parts.coefficients),
            u: (independent + common.sum::<f64>()).sqrt(),
            u_independent: independent.sqrt(),
        }
    }

    pub(crate) fn budget(&self, functional: &Functional) -> Vec<Contribution> {
        let independent = self.noise_variance(functional).sqrt();
        let mut budget = vec![Contribution { name: INDEPENDENT.to_owned(), u: independent }];
        let missed = self.missed_variance(functional);
        if self.parts.truncation.is_some() || missed > 0.0 {
            let u = missed.sqrt();
            budget.push(Contribution { name: TRUNCATION.to_owned(), u });
        }
        let unmeasured = functional.unmeasured_variance();
        if unmeasured > 0.0 {
            let u = unmeasured.sqrt();
            budget.push(Contribution { name: EXTRAPOLATION.to_owned(), u });
        }
        let commons = budget.len();
        for (name, shift) in self.common_shifts(functional) {
            let source = name.split_once(" @ ").map_or(name, |(source, _)| source);
            match budget.iter_mut().skip(commons).find(|row| row.name == source) {
                Some(row) => row.u = libm::hypot(row.u, shift),
                None => budget.push(Contribution { name: source.to_owned(), u: shift.abs() }),
            }
        }
        budget
    }

    /// By what noise does to the fit.
    fn noise_variance(&self, functional: &Functional) -> f64 {
        if let Some(factor) = &self.sparse {
            return factor.variance(functional.row());
        }
        self.factor_columns().map(|column| dot(column, functional.row()).powi(2)).sum()
    }

    /// By what the functions can't follow.
    fn missed_variance(&self, functional: &Functional) -> f64 {
        let missed = self.parts.truncation.iter().flat_map(|truncation| &truncation.missed);
        let missed = missed.map(|field| functional.times_field(field).powi(2)).sum::<f64>();
        let Some(along) = functional.along() else { return missed };
        let finer = along.weight * self.parts.model.truncation;
        self.unevenness(along) * (missed + finer * finer)
    }

    /// What the variance of all that is missed is multiplied by towards a direction.
    pub(crate) fn unevenness(&self, along: Along) -> f64 {
        let uneven = self.parts.truncation.as_ref().map(|truncation| &truncation.uneven);
        uneven.map_or(1.0, |uneven| uneven.times(along.theta_rad, along.phi_rad))
    }

    fn common_shifts(&self, functional: &Functional) -> impl Iterator<Item = (&str, f64)> {
        let shift = move |c: &CommonShift| dot(functional.row(), &c.shift);
        self.parts.shifts.iter().map(move |c| (c.name.as_str(), shift(c)))
    }

    /// The columns of S down to the diagonal.
    fn factor_columns(&self) -> impl Iterator<Item = &[f64]> {
        let dense = if self.sparse.is_some() { 0 } else { self.basis.len() };
        (0..dense).map(|j| &self.parts.factor[j * (j + 1) / 2..][..=j])
    }
}
