//! The fit itself: weights that settle, one factorisation, common components carried through it.
//!
//! A penalty is a few rows more: readings of zero of what is held against the field.
//!
//! Common components stay out of the weights. Being off by one u, a component changes the values
//! by a vector; the same factorisation carries it to the coefficients as a further right-hand side.

use crate::basis::Basis;
use crate::beam::Optics;
use crate::beam::design::Design;
use crate::check::check;
use crate::fitted::{CommonShift, Fit, Parts, Quality};
use crate::penalty::{Penalised, Prior};
use crate::triangle::{Solution, Triangle};
use crate::weights::{Model, Settled, settle};
use crate::{Common, FitError, Influence, Noise, Ray, Region, Sample, Shift, undetermined};

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

/// As [`fit_seen`], of readings some of which were taken in flight: `flown` holds, sample by sample,
/// the rays at the reading's beginning and end, and `None` for one at rest; samples beyond its end
/// are at rest. The sample's own ray is that of the middle. What a reading in flight says is the
/// field's mean over its way, but for beams that the sample's outline cuts: those count as at rest.
pub fn fit_flown(
    samples: &[Sample],
    flown: &[Option<(Ray, Ray)>],
    region: &Region,
    model: impl Into<Penalised>,
    common: &[Common],
    optics: Option<&Optics>,
) -> Result<Fit, FitError> {
    let model = model.into();
    let (basis, prior) = ready(samples, region, model, common)?;
    let design = Design::new(samples, &basis, optics)?.in_flight(flown);
    let (common, jitters): (Vec<&Common>, Vec<&Common>) =
        common.iter().partition(|common| common.shift.is_shared());
    let settled = settle(&design, &prior, &jitters)?;
    let needs_a_side = |common: &Common| needs_a_side(common, &design);
    let shifting: Vec<&Common> = common.iter().copied().filter(|c| needs_a_side(c)).collect();
    let sides = sensitivities(&design, &settled, &shifting)?;
    let solution = solve(&design, &settled.variances, &sides, &prior)?;
    let coefficients = solution.unknowns(0);
    let shifts = shifts(&common, &coefficients, &design, &solution);
    let levels = levels(&design, &coefficients);
    let factor = solution.inverse();
    let determined = prior.determined_by(&solution);
    let quality = quality(&design, &levels, (&solution, determined), &settled)?;
    let influence = Influence::of(&design, &settled, &factor);
    Fit::from_parts(Parts { region: *region, model, coefficients, factor, shifts, quality })
        .map(|fit| fit.with_influence(influence))
        .map_err(|_| FitError::OutOfRange)
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

/// The triangle of samples weighted by what their own fit says, every common component a side of its
/// own, without the penalty; and their variances.
pub(crate) fn weighted(
    samples: &[Sample],
    region: &Region,
    model: Penalised,
    common: &[Common],
    optics: Option<&Optics>,
) -> Result<(Triangle, Vec<f64>), FitError> {
    let (basis, prior) = ready(samples, region, model, common)?;
    let design = Design::new(samples, &basis, optics)?;
    let (common, jitters): (Vec<&Common>, Vec<&Common>) =
        common.iter().partition(|common| common.shift.is_shared());
    let settled = settle(&design, &prior, &jitters)?;
    let sides = sensitivities(&design, &settled, &common)?;
    let triangle = triangle(&design, &settled.variances, &sides)?;
    Ok((triangle, settled.variances))
}

/// What the field makes of the samples' readings.
pub(crate) fn levels(design: &Design<'_>, coefficients: &[f64]) -> Vec<f64> {
    let mut room = design.room();
    (0..design.samples().len()).map(|i| design.level(i, coefficients, &mut room)).collect()
}

/// What one pass of all rows determines, with the penalty's.
pub(crate) fn solve(
    design: &Design<'_>,
    variances: &[f64],
    sides: &[Vec<f64>],
    prior: &Prior,
) -> Result<Solution, FitError> {
    let mut triangle = triangle(design, variances, sides)?;
    prior.absorb_into(&mut triangle, sides.len() + 1);
    triangle.solve().ok_or(FitError::OutOfRange)
}

/// One pass of all rows, each divided by its standard uncertainty. `sides` are further right-hand
/// sides, one vector over the samples each.
fn triangle(
    design: &Design<'_>,
    variances: &[f64],
    sides: &[Vec<f64>],
) -> Result<Triangle, FitError> {
    let p = design.basis().len();
    let mut triangle = Triangle::new(p, 1 + sides.len());
    let mut room = design.room();
    let mut row = vec![0.0; p + 1 + sides.len()];
    for (i, (sample, variance)) in design.samples().iter().zip(variances).enumerate() {
        design.row(i, &mut room, &mut row[..p]);
        row[p] = sample.value;
        for (out, side) in row[p + 1..].iter_mut().zip(sides) {
            *out = side[i];
        }
        let weight = 1.0 / variance.sqrt();
        if !weight.is_finite() || weight == 0.0 {
            return Err(FitError::OutOfRange);
        }
        for value in &mut row {
            *value *= weight;
        }
        triangle.absorb(&row);
    }
    Ok(triangle)
}

/// Whether a component's effect has to go through the factorisation. A scale and an offset don't:
/// the fit is linear and holds the constant, so that their effect on the coefficients is known;
/// only that an offset of beams that are cut is no constant field.
pub(crate) fn needs_a_side(common: &Common, design: &Design<'_>) -> bool {
    match common.shift {
        Shift::Scale | Shift::Jitter(_) => false,
        Shift::Offset => !design.holds_constant(),
        Shift::Ray(_) | Shift::Value(_) => true,
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
    let mut change = |common: &Common, i: usize| match &common.shift {
        Shift::Scale => common.u * levels[i],
        Shift::Offset => common.u,
        Shift::Value(excess) => excess(i, levels[i]),
        Shift::Ray(seen) | Shift::Jitter(seen) => {
            let seen = seen(i, &samples[i].ray);
            design.change(i, &seen, coefficients, &mut room)
        }
    };
    let mut sides = Vec::with_capacity(common.len());
    for common in common {
        let side: Vec<f64> = (0..samples.len()).map(|i| change(common, i)).collect();
        if !side.iter().all(|value| value.is_finite()) {
            return Err(FitError::Common { name: common.name.clone() });
        }
        sides.push(side);
    }
    Ok(sides)
}

/// The coefficients' shift by one u of each component, in the order handed in.
pub(crate) fn shifts(
    common: &[&Common],
    coefficients: &[f64],
    design: &Design<'_>,
    solution: &Solution,
) -> Vec<CommonShift> {
    let mut side = 0;
    let mut shift = |c: &Common| match c.shift {
        Shift::Scale => coefficients.iter().map(|value| c.u * value).collect(),
        Shift::Offset if design.holds_constant() => {
            design.basis().unity().iter().map(|value| c.u * value).collect()
        }
        Shift::Offset | Shift::Ray(_) | Shift::Jitter(_) | Shift::Value(_) => {
            side += 1;
            solution.unknowns(side)
        }
    };
    common.iter().map(|c| CommonShift { name: c.name.clone(), shift: shift(c) }).collect()
}

fn quality(
    design: &Design<'_>,
    levels: &[f64],
    (solution, determined): (&Solution, f64),
    settled: &Settled,
) -> Result<Quality, FitError> {
    let (samples, excess) = (design.samples(), settled.excess);
    let spectrum = solution.spectrum().ok_or(FitError::OutOfRange)?;
    let model = Model::of(samples);
    let n = samples.len() as f64;
    let (mut squares, mut chi2) = (0.0, 0.0);
    for ((sample, level), moved) in samples.iter().zip(levels).zip(&settled.moved) {
        let square = (sample.value - level).powi(2);
        let unstated = if sample.noise == Noise::Unknown { excess } else { 0.0 };
        squares += square;
        chi2 += square / (model.variance(sample.noise, *level) + moved + unstated);
    }
    Ok(Quality {
        condition: spectrum.condition(),
        n_used: samples.len(),
        dof: left_over(samples.len(), determined),
        determined,
        residual_rms: (squares / n).sqrt(),
        chi2,
        excess_rms: excess.sqrt(),
        beam: design.rows(&settled.variances),
    })
}

/// Samples less what they determine of the coefficients, to the nearest number.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between zero and a count
pub(crate) fn left_over(samples: usize, determined: f64) -> usize {
    libm::round(samples as f64 - determined).max(0.0) as usize
}
