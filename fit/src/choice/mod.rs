//! Which basis, how fine, and how strongly held: chosen from the data.
//!
//! Each candidate gets the penalty under which the data are likeliest ([`evidence`]). Candidates are
//! compared by the log density that they give to the readings of whole sweeps left out ([`sweeps`],
//! [`family`]): one that is right and knows how far it is right wins; one that follows the drift that a
//! sweep shares, or that states too small an uncertainty, loses. Never single readings, whose
//! neighbours give them away.

mod evidence;
mod family;
mod gleaning;
mod loose;
mod refining;
mod search;
mod sweeps;
mod tally;
mod wish;

use crate::beam::Optics;
use crate::check::check;
use crate::grid::Grid;
use crate::{
    Angular, BasisSpec, FitError, Penalised, Penalty, Position, Ray, Region, Sample, sparse,
};
use family::Trial;
use search::Search;

pub use gleaning::Gleaning;
pub(crate) use loose::Loose;
pub use sweeps::SweepKind;
pub(crate) use sweeps::Sweeps;
pub(crate) use tally::Tally;
pub use wish::{AngularKind, Spans, Wish, WishClash};

/// What was chosen, from what.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// How readings were taken to belong together.
    pub sweeps: SweepKind,
    /// How many sweeps there are among those readings.
    pub n_sweeps: usize,
    /// How many lines of directions they run along, where each was left out at all places together;
    /// `None` where sweeps were left out one by one.
    pub n_lines: Option<usize>,
    /// Readings that the choice was made from: of many, whole sweeps of them.
    pub n_readings: usize,
    /// All that was tried: the chosen one first, then by falling score.
    pub candidates: Vec<Candidate>,
}

/// A model that readings chose, and others that did about as well among them: beyond the readings they may go
/// on otherwise. A pinned model has none.
#[derive(Debug, Clone, PartialEq)]
pub struct Chosen {
    /// What was chosen.
    pub model: Penalised,
    /// What did about as well.
    pub others: Vec<Penalised>,
}

impl From<Penalised> for Chosen {
    fn from(model: Penalised) -> Self {
        Self { model, others: Vec::new() }
    }
}

/// A basis that was tried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// The basis, with the penalty that the data ask for in it.
    pub model: Penalised,
    /// Its coefficients.
    pub coefficients: usize,
    /// Mean log density of the readings of sweeps left out, less that of the chosen one; natural
    /// logarithms a reading. A coarser basis may do better by up to 0.05: the chosen one is the finest
    /// of its kind that does about as well as the best.
    pub score: f64,
    /// RMS error of predictions of the readings left out, over their stated u.
    pub left_out_rms: f64,
}

/// Chooses what the wish leaves open, for samples as [`fit_seen`](crate::fit_seen) takes them. `None`
/// for the choice where nothing was open.
///
/// The choice depends on the samples' order by rounding alone. It is made from at most 6000 readings,
/// whole sweeps of them, and among bases of at most 1000 coefficients (and no more than readings);
/// where rows are averaged over a beam, from 3000 and among those of 400. Splines in position and
/// splines with a patch have up to 1000, beam or not; the latter are judged by up to 8000 readings.
pub fn choose(
    samples: &[Sample],
    region: &Region,
    wish: &Wish,
    optics: Option<&Optics>,
) -> Result<(Penalised, Option<Choice>), FitError> {
    choose_read(Taken::AtRest, samples, region, wish, optics)
}

/// The same for samples that were taken in flight, one after the other along their sweeps: each is a mean over
/// its way, so that nothing narrow lies between them unseen.
pub fn choose_flown(
    samples: &[Sample],
    region: &Region,
    wish: &Wish,
    optics: Option<&Optics>,
) -> Result<(Penalised, Option<Choice>), FitError> {
    choose_read(Taken::InFlight, samples, region, wish, optics)
}

/// How samples were taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Taken {
    AtRest,
    InFlight,
}

fn choose_read(
    taken: Taken,
    samples: &[Sample],
    region: &Region,
    wish: &Wish,
    optics: Option<&Optics>,
) -> Result<(Penalised, Option<Choice>), FitError> {
    let wish = &wish.in_chart(&region.chart);
    if let Some(model) = wish.decided() {
        return Ok((model, None));
    }
    strength_can_be_chosen(wish)?;
    check(samples, region, smallest(region, 0, 0).into(), &[])?;
    one_pose(samples, region)?;
    let whole = Sweeps::of(samples, region);
    let mut sweeps = whole.clone().thinned(search::readings_max(optics));
    let mut chosen = sweeps.samples_of(samples);
    let found = |one_by_one: bool| -> Result<Vec<(BasisSpec, Trial)>, FitError> {
        let mut search = Search::new(&chosen, region, wish, optics, &sweeps, one_by_one);
        search.run()?;
        Ok(search.tried)
    };
    let mut n_lines = sweeps.shared_lines();
    let mut tried = found(n_lines.is_none())?;
    // Where nothing is held, a line less may leave nothing determined.
    if tried.is_empty() && n_lines.is_some() {
        n_lines = None;
        tried = found(true)?;
    }
    sort(&mut tried);
    if refining::calls_for_a_patch(&tried, wish) {
        // What is narrow both ways shows where sweeps are close together.
        sweeps = whole.thinned(refining::READINGS_MAX);
        chosen = sweeps.samples_of(samples);
        let mut search = Search::new(&chosen, region, wish, optics, &sweeps, n_lines.is_none());
        search.taken = taken;
        search.patch_beside(&mut tried)?;
        sort(&mut tried);
    }
    prefer_finer(&mut tried);
    let Some(&(_, best)) = tried.first() else {
        // Nothing can be left out: the mean is all there is, or what was pinned.
        let smallest = smallest(region, 0, 0);
        let angular = wish.angular().unwrap_or(smallest.angular);
        let position = wish.position().unwrap_or(smallest.position);
        let penalty = wish.penalty().unwrap_or(Penalty::NONE);
        return Ok((Penalised::new(BasisSpec { angular, position }, penalty), None));
    };
    let truncation = truncation(&tried);
    let candidates = tried.iter().map(|(spec, trial)| Candidate {
        model: Penalised::new(*spec, trial.penalty),
        coefficients: trial.coefficients,
        score: trial.score - best.score,
        left_out_rms: trial.left_out,
    });
    let candidates: Vec<Candidate> = candidates.collect();
    let choice = Choice {
        sweeps: sweeps.kind,
        n_sweeps: sweeps.members.len(),
        n_lines,
        n_readings: chosen.len(),
        candidates,
    };
    let model = Penalised { truncation, ..choice.candidates[0].model };
    Ok((model, Some(choice)))
}

/// The best first.
fn sort(tried: &mut [(BasisSpec, Trial)]) {
    tried.sort_by(|a, b| b.1.score.total_cmp(&a.1.score));
}

/// Splines that are pinned, and too many for a choice to go through strengths of their penalty.
fn strength_can_be_chosen(wish: &Wish) -> Result<(), FitError> {
    let coefficients_max = sparse::COEFFICIENTS_FROM;
    let refused = |coefficients| FitError::StrengthOpen { coefficients, coefficients_max };
    wish.splines_of_open_strength().map(refused).map_or(Ok(()), Err)
}

/// A basis of a region's chart that is taken where nothing can be chosen.
fn smallest(region: &Region, degree: usize, position_degree: usize) -> BasisSpec {
    let angular = AngularKind::of_chart(&region.chart).of_degree(degree);
    BasisSpec {
        angular: angular.unwrap_or(Angular::Zernike { degree, cosine_columns: 0 }),
        position: Position::Legendre { degree: position_degree },
    }
}

/// Refuses samples that all lie along one ray; a single sample is a pose too.
fn one_pose(samples: &[Sample], region: &Region) -> Result<(), FitError> {
    let grid = Grid::of(samples, region);
    let counts = [grid.x_m.len(), grid.y_m.len(), grid.theta_rad.len()];
    let Some(first) = samples.first() else { return Ok(()) };
    let ray = first.ray;
    let is_along = |sample: &Sample| {
        ray.theta_rad < ANGLE_OF_A_POSE
            || (sample.ray.phi_rad - ray.phi_rad).abs() < ANGLE_OF_A_POSE
    };
    if counts.iter().any(|count| *count > 1) || !samples.iter().all(is_along) {
        return Ok(());
    }
    let (readings, Ray { theta_rad, phi_rad, .. }) = (samples.len(), ray);
    Err(FitError::OnePose { readings, theta_rad, phi_rad })
}

/// Brings the finest basis of the best one's kind to the front that does about as well: what a basis
/// can't follow no uncertainty of its coefficients holds, and a penalty keeps a finer one in check.
fn prefer_finer(tried: &mut [(BasisSpec, Trial)]) {
    let Some(&(best, trial)) = tried.first() else { return };
    let is_as_good = |(spec, other): &(BasisSpec, Trial)| {
        spec.angular.name() == best.angular.name()
            && spec.position.len() >= best.position.len()
            && is_of_spans(best.angular, spec.angular)
            && !other.penalty.is_none()
            && other.score > trial.score - FINER_COST
    };
    let finest = (0..tried.len())
        .filter(|i| is_as_good(&tried[*i]))
        .max_by_key(|i| tried[*i].1.coefficients);
    if let Some(finest) = finest.filter(|i| tried[*i].1.coefficients > trial.coefficients) {
        tried[..=finest].rotate_right(1);
    }
}

/// Whether splines are compared with ones of the same spans where those of the first are finer in a
/// stretch: elsewhere, nothing has to be followed.
fn is_of_spans(first: Angular, other: Angular) -> bool {
    let spans = |angular| match angular {
        Angular::Splines { theta_spans, phi_spans, fine } => Some((theta_spans, phi_spans, fine)),
        _ => None,
    };
    let (Some((theta, phi, fine)), Some((other_theta, other_phi, _))) =
        (spans(first), spans(other))
    else {
        return true;
    };
    fine.is_none() || (theta, phi) == (other_theta, other_phi)
}

/// What the chosen basis, the first, can't follow: of the residuals beyond the stated noise the part
/// that falls as bases of its kind get finer. What stays is noise that was not stated (poses that
/// jitter, a source that wavers), which is the fit's to find. Taken to fall with the square of the
/// number of functions, as it does for fields with kinks.
fn truncation(tried: &[(BasisSpec, Trial)]) -> f64 {
    let Some(&(spec, chosen)) = tried.first() else { return 0.0 };
    let coarser = tried.iter().filter(|(other, trial)| {
        other.angular.name() == spec.angular.name()
            && other.position == spec.position
            && trial.coefficients as f64 * COARSER <= chosen.coefficients as f64
    });
    let Some((_, coarser)) = coarser.max_by_key(|(_, trial)| trial.coefficients) else {
        return 0.0;
    };
    let ratio = chosen.coefficients as f64 / coarser.coefficients as f64;
    let falling = (coarser.misfit - chosen.misfit) / (ratio * ratio - 1.0);
    falling.clamp(0.0, chosen.misfit).sqrt()
}

/// A basis with fewer functions by this factor is a coarser one.
const COARSER: f64 = 1.2;
/// What a finer basis may cost in log density a reading: a twentieth of u.
const FINER_COST: f64 = 0.05;
/// Azimuths closer than half a degree are one where all else is.
const ANGLE_OF_A_POSE: f64 = 0.009;
