//! The fit itself: weights that settle, one factorisation, common components carried through it.
//!
//! A penalty is a few rows more: readings of zero of what is held against the field.
//!
//! Common components stay out of the weights. Being off by one u, a component changes the values
//! by a vector; the same factorisation carries it to the coefficients as a further right-hand side.

use crate::basis::Basis;
use crate::beam::Optics;
use crate::beam::design::{Design, Through};
use crate::check::check;
use crate::fitted::Fit;
use crate::influence::Watched;
use crate::measured::Measured;
use crate::nuisance::{Solved, packed, without};
use crate::parts::{CommonShift, Parts, Quality};
use crate::penalty::{Penalised, Prior};
use crate::readings::{Readings, Weighed};
use crate::triangle::{Solution, Triangle};
use crate::weights::{Model, Settled, settle};
use crate::{
    BeamRows, Common, FitError, Influence, Noise, Ray, Region, Sample, Shift, sparse, undetermined,
};

/// Fits the field to samples: the crate's description has the method and an example.
///
/// Positions may lie off the region by 2 % of its half width, as readbacks do, and directions
/// beyond its cone. The result depends on the samples' order by rounding alone. Costs about five
/// passes of 2 n p² operations for n samples and p coefficients, and memory of 16 p² numbers.
pub fn fit(
    samples: &[Sample],
    region: &Region,
    model: impl Into<Penalised>,
    common: &[Common],
) -> Result<Fit, FitError> {
    fit_seen(samples, region, model, common, None)
}

/// As [`fit`], each sample being the mean of the field over a beam along its ray, zero off the
/// sample: the field that comes out is the one that the beam blurred. Without optics a sample is
/// the radiance along its ray alone.
///
/// Each row is the basis averaged over the beam, by as few rays as a bound allows
/// ([`Quality::beam`] counts them). What a footprint wider than the features of the field blurs
/// away comes back with the noise that its size calls for, and u says so.
///
/// ```
/// use fit::{BasisSpec, Noise, Optics, Outline, Ray, Region, Sample};
/// use radiometry::beam::Beam;
///
/// // A small Lambertian disk of 100 W·m⁻²·sr⁻¹: of a beam at 80° it fills less than half.
/// let beam = Beam::of_spot(0.00625, 0.0025, 0.3)?;
/// let outline = Some(Outline::Disk { centre_m: (0.0, 0.0), radius_m: 0.005 });
/// let ray = |theta_deg: f64| {
///     Ray { x_m: 0.0, y_m: 0.0, theta_rad: theta_deg.to_radians(), phi_rad: 0.0 }
/// };
/// let noise = Noise::Fixed { variance: 0.01 };
/// // What such a beam reads, by counting rays.
/// let read = [(0.0, 100.0), (80.0, 41.68)];
/// let samples: Vec<Sample> =
///     read.iter().map(|(t, value)| Sample { ray: ray(*t), value: *value, noise }).collect();
/// let region = Region::surface((0.0, 0.0), (0.0, 0.0), 1.4);
/// let basis = BasisSpec::zernike(0, 0);
/// let field = fit::fit_seen(&samples, &region, basis, &[], Some(&Optics { beam, outline }))?;
/// assert!((field.value(&ray(80.0)) - 100.0).abs() < 0.1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn fit_seen(
    samples: &[Sample],
    region: &Region,
    model: impl Into<Penalised>,
    common: &[Common],
    optics: Option<&Optics>,
) -> Result<Fit, FitError> {
    fit_flown(samples, &[], region, model, common, optics)
}

/// As [`fit_seen`], of readings some of which were taken in flight: see [`Readings::flown`].
pub fn fit_flown(
    samples: &[Sample],
    flown: &[Option<(Ray, Ray)>],
    region: &Region,
    model: impl Into<Penalised>,
    common: &[Common],
    optics: Option<&Optics>,
) -> Result<Fit, FitError> {
    fit_readings(&Readings { flown, common, ..Readings::of(samples) }, region, model, optics)
}

/// As [`fit_seen`], of readings with all that is known of them: lower limits among them, what is to be
/// fitted along, how outliers are weighed. [`Fit::weighed`] says what became of each.
pub fn fit_readings(
    readings: &Readings<'_>,
    region: &Region,
    model: impl Into<Penalised>,
    optics: Option<&Optics>,
) -> Result<Fit, FitError> {
    let model = model.into();
    if sparse::is_called_for(model.basis) {
        return sparse::fit(readings, region, model, optics);
    }
    let Readings { samples, common, nuisances, limits, .. } = *readings;
    let (basis, prior) = ready(samples, region, model, common)?;
    check_readings(readings)?;
    let design = Design::new(samples, &basis, optics)?.in_flight(readings.flown);
    let (common, jitters): (Vec<&Common>, Vec<&Common>) =
        common.iter().partition(|common| common.shift.is_shared());
    let settled = settle(&design, &prior, readings, &jitters)?;
    let holds_constant = design.holds_constant();
    let needs_a_side = |common: &Common| needs_a_side(common, holds_constant);
    let shifting: Vec<&Common> = common.iter().copied().filter(|c| needs_a_side(c)).collect();
    let sides = sensitivities(&design, &settled, &shifting)?;
    let solved = solve(&design, &settled.rows(), &sides, &prior)?;
    let solution = &solved.field;
    let coefficients = solution.unknowns(0);
    let constant = design.constant();
    let mut shifts =
        shifts(&common, &coefficients, constant.as_deref(), |side| solution.unknowns(side));
    let own: Vec<Vec<f64>> =
        (0..nuisances.len()).map(|k| solution.unknowns(1 + sides.len() + k)).collect();
    let inverse = solution.inverse_matrix();
    let independent = without(&inverse, solution.r(), &own).ok_or(FitError::OutOfRange)?;
    let factor = packed(&independent, readings.robust.inflation().sqrt());
    let fitted = solved.fitted(nuisances, &coefficients, &inverse);
    let settled = Settled {
        nuisances: solved.nuisances(&coefficients),
        levels: levels(&design, &coefficients),
        determined: prior.determined_by(solution),
        ..settled
    };
    let spectrum = solution.spectrum().ok_or(FitError::OutOfRange)?;
    let quality = quality(&design, spectrum.condition(), &settled, limits);
    if prior.is_none() && settled.weights.contains(&0.0) {
        all_determined(&design, solution, &settled)?;
    }
    let weighed = weighed(readings, &settled, fitted);
    let own = nuisances.iter().zip(own);
    shifts.extend(own.map(|(c, shift)| CommonShift { name: c.name.clone(), shift }));
    let (region, truncation) = (*region, None);
    let parts = Parts { region, model, coefficients, factor, shifts, quality, truncation };
    let fit = Fit::from_parts(parts).map_err(|_| FitError::OutOfRange)?;
    let (watched, whole) = (Watched::of(&fit), packed(&inverse, 1.0));
    let sides = shifting.iter().map(|common| common.name.clone()).zip(sides).collect();
    let influence = Influence::of(&design, &settled, &solved, &whole, watched).with_sides(sides);
    let measured = Some(Measured::of(samples));
    Ok(fit.with_influence(influence).with_weighed(weighed).with_measured(measured))
}

/// What readings came with that makes no sense.
pub(crate) fn check_readings(readings: &Readings<'_>) -> Result<(), FitError> {
    let Readings { samples, nuisances, limits, .. } = *readings;
    let is_sound = |c: &&Common| c.shift.is_shared() && c.u.is_finite() && c.u >= 0.0;
    if let Some(wrong) = nuisances.iter().find(|c| !is_sound(c)) {
        return Err(FitError::Common { name: wrong.name.clone() });
    }
    let is_rising = limits.windows(2).all(|pair| pair[0] < pair[1]);
    match limits.last() {
        Some(&last) if !is_rising || last >= samples.len() => {
            let found = limits.iter().filter(|limit| **limit < samples.len()).count();
            Err(FitError::Parts { what: "limits", expected: limits.len(), found })
        }
        Some(_) if limits.len() == samples.len() => {
            Err(FitError::OnlyLimits { readings: samples.len() })
        }
        _ => Ok(()),
    }
}

/// What no longer counts may have been all that was known of a coefficient.
pub(crate) fn all_determined(
    design: &Design<'_>,
    solution: &Solution,
    settled: &Settled,
) -> Result<(), FitError> {
    let spectrum = solution.spectrum().ok_or(FitError::OutOfRange)?;
    if spectrum.rank() == design.basis().len() {
        return Ok(());
    }
    let samples = design.samples().iter().zip(&settled.weights);
    let kept: Vec<Sample> = samples.filter(|(_, w)| **w > 0.0).map(|(s, _)| *s).collect();
    Err(undetermined::by_rank(&kept, design.basis()))
}

pub(crate) fn weighed(
    readings: &Readings<'_>,
    settled: &Settled,
    nuisances: Vec<crate::FittedNuisance>,
) -> Weighed {
    weighed_by(readings, settled, nuisances, (Model::of(readings.samples), settled.shrink()))
}

/// The same of a part of all samples, by what is known of all.
pub(crate) fn weighed_by(
    readings: &Readings<'_>,
    settled: &Settled,
    nuisances: Vec<crate::FittedNuisance>,
    (model, shrink): (Model, f64),
) -> Weighed {
    let residuals = readings.samples.iter().zip(settled.expected()).enumerate();
    let residuals = residuals.map(|(i, (sample, expected))| {
        let stated = model.variance(sample.noise, settled.levels[i]) + settled.moved[i];
        (sample.value - expected) / ((stated + settled.excess) * shrink).sqrt()
    });
    Weighed {
        robust: readings.robust,
        weights: settled.weights.clone(),
        residuals: residuals.collect(),
        limits: readings.limits.to_vec(),
        nuisances,
    }
}

/// The basis and what is held against rough fields, for samples that can be fitted: sound ones, and
/// as many as the basis needs where nothing else determines it.
pub(crate) fn ready(
    samples: &[Sample],
    region: &Region,
    model: Penalised,
    common: &[Common],
) -> Result<(Basis, Prior), FitError> {
    check(samples, region, model, common)?;
    let basis = Basis::new(model.basis, *region)?;
    let prior = Prior::new(&basis, model.penalty)?;
    let refusal = if prior.is_none() { undetermined::by_count(samples, &basis) } else { None };
    refusal.map_or(Ok((basis, prior)), Err)
}

/// What the field makes of the samples' readings.
pub(crate) fn levels(design: &Design<'_>, coefficients: &[f64]) -> Vec<f64> {
    let mut room = design.room();
    (0..design.samples().len()).map(|i| design.level(i, coefficients, &mut room)).collect()
}

/// What a pass of all rows is made of, sample by sample.
#[derive(Clone, Copy)]
pub(crate) struct Rows<'r> {
    pub(crate) values: &'r [f64],
    /// Infinite of samples that count for nothing.
    pub(crate) variances: &'r [f64],
    /// The nuisances' columns.
    pub(crate) columns: &'r [Vec<f64>],
}

/// What one pass of all rows determines, with the penalty's. Each nuisance has a further side after
/// `sides`: its prior being off by one.
pub(crate) fn solve(
    design: &Design<'_>,
    rows: &Rows<'_>,
    sides: &[Vec<f64>],
    prior: &Prior,
) -> Result<Solved, FitError> {
    solved(triangle(design, rows, sides)?, (rows.columns.len(), sides.len()), prior)
}

/// What a triangle of all rows determines, which has columns of so many nuisances and so many sides.
pub(crate) fn solved(
    triangle: Triangle,
    (nuisances, sides): (usize, usize),
    prior: &Prior,
) -> Result<Solved, FitError> {
    Solved::of(triangle, nuisances, |field| prior.absorb_into(field, 1 + sides + nuisances))
}

/// What the samples' own values determine under these variances.
pub(crate) fn solve_readings(
    design: &Design<'_>,
    variances: &[f64],
    sides: &[Vec<f64>],
    prior: &Prior,
) -> Result<Solution, FitError> {
    let values: Vec<f64> = design.samples().iter().map(|sample| sample.value).collect();
    let rows = Rows { values: &values, variances, columns: &[] };
    Ok(solve(design, &rows, sides, prior)?.field)
}

/// One pass of all rows. `sides` are further right-hand sides, one vector over the samples each.
fn triangle(
    design: &Design<'_>,
    rows: &Rows<'_>,
    sides: &[Vec<f64>],
) -> Result<Triangle, FitError> {
    let mut triangle = begun(rows.columns.len(), design.basis().len(), sides.len());
    absorb(&mut triangle, design, rows, sides)?;
    Ok(triangle)
}

/// The triangle of no sample yet: the priors of so many nuisances.
pub(crate) fn begun(nuisances: usize, coefficients: usize, sides: usize) -> Triangle {
    let (q, p, s) = (nuisances, coefficients, sides);
    let mut triangle = Triangle::new(q + p, 1 + s + q);
    let mut row = vec![0.0; q + p + 1 + s + q];
    for k in 0..q {
        row.fill(0.0);
        (row[k], row[q + p + 1 + s + k]) = (1.0, 1.0);
        triangle.absorb(&row);
    }
    triangle
}

/// Takes the rows of samples in, each divided by its standard uncertainty.
pub(crate) fn absorb(
    triangle: &mut Triangle,
    design: &Design<'_>,
    rows: &Rows<'_>,
    sides: &[Vec<f64>],
) -> Result<(), FitError> {
    let (q, p, s) = (rows.columns.len(), design.basis().len(), sides.len());
    let mut room = design.room();
    let mut row = vec![0.0; q + p + 1 + s + q];
    for (i, (value, variance)) in rows.values.iter().zip(rows.variances).enumerate() {
        if *variance == f64::INFINITY {
            continue;
        }
        for (out, column) in row.iter_mut().zip(rows.columns) {
            *out = column[i];
        }
        design.row(i, &mut room, &mut row[q..q + p]);
        row[q + p] = *value;
        for (out, side) in row[q + p + 1..].iter_mut().zip(sides) {
            *out = side[i];
        }
        row[q + p + 1 + s..].fill(0.0);
        let weight = 1.0 / variance.sqrt();
        if !weight.is_finite() || weight == 0.0 {
            return Err(FitError::OutOfRange);
        }
        for value in &mut row {
            *value *= weight;
        }
        triangle.absorb(&row);
    }
    Ok(())
}

/// Whether a component's effect has to go through the factorisation. A scale and an offset don't:
/// the fit is linear and holds the constant, so that their effect on the coefficients is known;
/// only that an offset of beams that are cut is no constant field.
pub(crate) fn needs_a_side(common: &Common, holds_constant: bool) -> bool {
    match common.shift {
        Shift::Scale | Shift::Jitter(_) => false,
        Shift::Offset => !holds_constant,
        Shift::Ray(_) | Shift::Value(_) | Shift::Beam(_) => true,
    }
}

/// The change of every value by one u of each component.
pub(crate) fn sensitivities(
    design: &Design<'_>,
    settled: &Settled,
    common: &[&Common],
) -> Result<Vec<Vec<f64>>, FitError> {
    let samples = design.samples();
    let Settled { coefficients, levels, .. } = settled;
    let mut room = design.room();
    // Along the samples' own rays, once for all components that see others.
    let is_seen = |common: &&Common| matches!(common.shift, Shift::Ray(_) | Shift::Jitter(_));
    let mut own = Vec::new();
    if common.iter().any(is_seen) {
        let along = |(i, s): (usize, &Sample)| design.along(i, &s.ray, coefficients, &mut room);
        own.extend(samples.iter().enumerate().map(along));
    }
    let mut change = |common: &Common, through: Option<&mut Through>, i: usize| match &common.shift
    {
        Shift::Scale => common.u * levels[i],
        Shift::Beam(_) => {
            let blurred =
                through.map_or(0.0, |through| design.seen(i, through, coefficients, &mut room));
            common.u * levels[i] + (1.0 + common.u) * blurred
        }
        Shift::Offset => common.u,
        Shift::Value(excess) => excess(i, levels[i]),
        Shift::Ray(seen) | Shift::Jitter(seen) => {
            let (ray, seen) = (&samples[i].ray, seen(i, &samples[i].ray));
            let is_same = seen == *ray;
            if is_same { 0.0 } else { design.along(i, &seen, coefficients, &mut room) - own[i] }
        }
    };
    let mut sides = Vec::with_capacity(common.len());
    for common in common {
        let mut through = match &common.shift {
            Shift::Beam(beam) => design.through(beam)?,
            _ => None,
        };
        let side = (0..samples.len()).map(|i| change(common, through.as_mut(), i));
        let side: Vec<f64> = side.collect();
        if !side.iter().all(|value| value.is_finite()) {
            return Err(FitError::Common { name: common.name.clone() });
        }
        sides.push(side);
    }
    Ok(sides)
}

/// The coefficients' shift by one u of each component, in the order handed in; `unknowns` are those of
/// a side, of which the first is the values'. `constant` is the field of 1, where that is what an
/// offset looks like.
pub(crate) fn shifts(
    common: &[&Common],
    coefficients: &[f64],
    constant: Option<&[f64]>,
    unknowns: impl Fn(usize) -> Vec<f64>,
) -> Vec<CommonShift> {
    let mut side = 0;
    let mut shift = |c: &Common| match (&c.shift, constant) {
        (Shift::Scale, _) => coefficients.iter().map(|value| c.u * value).collect(),
        (Shift::Offset, Some(constant)) => constant.iter().map(|value| c.u * value).collect(),
        _ => {
            side += 1;
            unknowns(side)
        }
    };
    common.iter().map(|c| CommonShift { name: c.name.clone(), shift: shift(c) }).collect()
}

pub(crate) fn quality(
    design: &Design<'_>,
    condition: f64,
    settled: &Settled,
    limits: &[usize],
) -> Quality {
    let mut sums = QualitySums::default();
    sums.take(design, settled, limits, Model::of(design.samples()));
    sums.quality(condition, settled.determined, settled.excess)
}

/// What tells how good a fit is, summed over samples.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct QualitySums {
    squares: f64,
    chi2: f64,
    /// Samples that say what they read, and those that have any weight.
    kept: usize,
    used: usize,
    beam: Option<BeamRows>,
}

impl QualitySums {
    pub(crate) fn take(
        &mut self,
        design: &Design<'_>,
        settled: &Settled,
        limits: &[usize],
        model: Model,
    ) {
        let (samples, excess) = (design.samples(), settled.excess);
        for (i, (sample, expected)) in samples.iter().zip(settled.expected()).enumerate() {
            let weight = settled.weights[i];
            if weight == 0.0 || limits.binary_search(&i).is_ok() {
                continue;
            }
            let square = (sample.value - expected).powi(2);
            let unstated = if sample.noise == Noise::Unknown { excess } else { 0.0 };
            let stated = model.variance(sample.noise, settled.levels[i]) + settled.moved[i];
            self.squares += square;
            self.chi2 += weight * square / (stated + unstated);
        }
        self.kept += settled.kept(limits);
        self.used += settled.weights.iter().filter(|weight| **weight > 0.0).count();
        let rows = design.rows(&settled.variances);
        self.beam = self.beam.map_or(rows, |beam| rows.map(|rows| beam.and(rows)));
    }

    pub(crate) fn quality(&self, condition: f64, determined: f64, excess: f64) -> Quality {
        Quality {
            condition,
            n_used: self.used,
            dof: left_over(self.kept, determined),
            determined,
            residual_rms: (self.squares / self.kept.max(1) as f64).sqrt(),
            chi2: self.chi2,
            excess_rms: excess.sqrt(),
            beam: self.beam,
        }
    }
}

/// Samples less what they determine of the coefficients, to the nearest number.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between zero and a count
pub(crate) fn left_over(samples: usize, determined: f64) -> usize {
    libm::round(samples as f64 - determined).max(0.0) as usize
}
