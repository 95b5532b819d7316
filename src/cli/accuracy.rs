//! How the uncertainty of a run's exitance came down with rig time: fits of the readings taken first, ever
//! more of them. It does not know where the curve is written or drawn.

use fit::{Choice, Chosen, Fit, Optics, Penalised, Region, Ruled, Rules};

use super::failure::Failure;
use super::long_run::LongRun;
use super::stream::Stopped;
use crate::export::AccuracyPoint;
use crate::rig::calibration::{Calibrated, Fitted};

/// Points of the curve at most: each is a fit of its own.
const POINTS_MAX: u32 = 12;
/// Beyond this condition a least-squares fit asks for regularisation rather than for digits: an
/// error of 1e-4 may be one of the order of 1.
const CONDITION_MAX: f64 = 1e4;

/// Fits of the first readings in the basis that all of them chose, ever more of them: half as many
/// for two points further back; the last is the fit of all, which is there. What the functions can't follow
/// is in each one's u as in that of the whole.
/// Readings in the order of travel cover the region only in the end; a fit that rests on a corner
/// of it is determined by its noise and its truncation alone, and is no point of the curve. Rows
/// along the axes alone tell that beforehand, at a small part of the cost of beams that are cut.
pub(super) fn course(
    calibrated: &Calibrated,
    region: &Region,
    fitted: &Fitted,
    rules: &Rules,
    optics: Option<&Optics>,
) -> Vec<AccuracyPoint> {
    let whole = &fitted.fit;
    let chosen = chosen(whole, fitted.choice.as_ref());
    let total = calibrated.samples.len();
    let mut counts: Vec<usize> = (0..POINTS_MAX)
        .map(|k| (total as f64 * libm::exp2(-0.5 * f64::from(k))).round())
        // Between zero and the count of samples.
        .map(|count| {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let count = count as usize;
            count
        })
        .collect();
    counts.sort_unstable();
    counts.dedup();
    let after = |count: usize| {
        let known = calibrated.first(count);
        let last = known.samples.iter().map(|sample| sample.time_s + sample.dwell_s);
        let fit = if count == total {
            whole.clone()
        } else {
            // A penalty makes a point of any.
            let is_open = chosen.model.penalty.is_none();
            if is_open && !is_point(&known.fit_as(region, chosen.model, rules, None).ok()?.fit) {
                return None;
            }
            known.fit_known(region, &chosen, rules, optics).ok()?
        };
        point(&fit, last.fold(0.0, f64::max), count)
    };
    counts.into_iter().filter_map(after).collect()
}

/// The same of a run that is read in blocks: half as many readings for each point further back, so that all of
/// them together take as long as the whole did.
pub(super) fn course_in_blocks(
    run: &LongRun<'_>,
    (region, optics): (&Region, Option<&Optics>),
    whole: &Ruled,
    rules: &Rules,
) -> Result<Vec<AccuracyPoint>, Failure> {
    let chosen = chosen(&whole.fit, whole.choice.as_ref());
    let mut points: Vec<AccuracyPoint> = Vec::new();
    points.extend(point(&whole.fit, run.ended_s, run.n_samples));
    let mut until = run.n_readings;
    for _ in 1..POINTS_MAX {
        until /= 2;
        let known = run.first(until, rules)?;
        let made = match known.fit_known(region, optics, &chosen, rules) {
            Ok(made) => made,
            // Too few readings for the functions; so are fewer.
            Err(Stopped::Fit(_)) => break,
            Err(Stopped::Source(failure)) => return Err(failure),
        };
        points.extend(point(&made.ruled.fit, known.ended_s, known.n_samples));
    }
    points.reverse();
    Ok(points)
}

/// What all points are fitted in.
fn chosen(whole: &Fit, choice: Option<&Choice>) -> Chosen {
    let model = || Penalised::new(whole.basis(), whole.penalty());
    choice.and_then(Choice::chosen).unwrap_or_else(|| model().into())
}

/// The point of a fit of so many readings; none of a fit that rests on what its poses hardly determine.
fn point(fit: &Fit, rig_s: f64, readings: usize) -> Option<AccuracyPoint> {
    let (exitance, flux, readings) = (fit.exitance(), fit.flux(), readings as u64);
    is_point(fit).then_some(AccuracyPoint { rig_s, readings, exitance, flux })
}

/// Where a penalty holds what poses do not determine, u says how little that is.
fn is_point(fit: &Fit) -> bool {
    !fit.penalty().is_none() || fit.condition() <= CONDITION_MAX
}
