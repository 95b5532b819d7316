//! Carrying an interrupted run on: what is missing, and whether the sample is still the same.
//!
//! Pure: the journal's contents come in, a [`Remainder`] and a [`Comparison`] go out.

use std::collections::HashSet;
use std::sync::Arc;

use super::job::{Check, Judge, Judgement};
use super::state::Outcome;
use crate::journal::{self, Session, Verdict};
use crate::plan::{RESUME_IDS_FROM, Sequence, Step, WARM_UP_IDS_FROM};
use crate::rig::calibration::{CalibrationError, Reference, Sample, calibrate};
use crate::rig::{AxisPositions, Reading, ReadingKind, Rig};

/// Readings of the reference pose that a resume takes, and as many of the last ones before the
/// interruption that it compares them with: their noise averages out.
const CHECKS: u32 = 3;
/// The comparison holds within this many standard uncertainties of the difference.
const AGREES_U: f64 = 2.0;
/// Samples around the reference pose that say how steep the radiance is there.
const NEIGHBOURS: usize = 24;

/// What is left of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Remainder {
    /// The steps that have no reading, in the plan's order.
    pub steps: Vec<Step>,
    /// The steps that have one.
    pub done: usize,
    /// Warm-up readings that the run has.
    pub warm_ups: u32,
    /// Reading of the reference pose that earlier resumes took.
    pub checks: u32,
    /// The number of the session that carries on.
    pub session: u32,
    /// Run time at which it begins, seconds: where the last one ended.
    pub began_s: f64,
    /// The plan's rule by which the run has ended: nothing is to be measured any more.
    pub rule: Option<String>,
}

/// What the journal leaves to do.
pub fn remainder(steps: &[Step], readings: &[Reading], sessions: &[Session]) -> Remainder {
    let had: HashSet<u32> = readings.iter().map(|reading| reading.id).collect();
    let missing: Vec<_> = steps.iter().filter(|step| !had.contains(&step.id)).copied().collect();
    // One more than the highest: gaps may be readings that were not committed.
    let next = |from: u32, to: u32| {
        let taken = had.iter().filter(|id| (from..=to).contains(id)).max();
        taken.map_or(0, |id| id - from + 1)
    };
    let last_reading_s = readings.iter().map(end_s).fold(0.0, f64::max);
    let last_session_s =
        sessions.iter().filter_map(|session| session.ended.as_ref().map(|ended| ended.0));
    let last_session = sessions.iter().map(|session| session.number);
    let last_session = last_session.chain(readings.iter().map(|reading| reading.session)).max();
    Remainder {
        rule: rule_met(sessions),
        done: steps.len() - missing.len(),
        steps: missing,
        warm_ups: next(WARM_UP_IDS_FROM, RESUME_IDS_FROM - 1),
        checks: next(RESUME_IDS_FROM, u32::MAX),
        session: last_session.map_or(0, |last| last + 1),
        began_s: last_session_s.fold(last_reading_s, f64::max),
    }
}

/// The plan's rule by which the run ended, if it did.
pub fn rule_met(sessions: &[Session]) -> Option<String> {
    let last = sessions.iter().max_by_key(|session| session.number)?;
    let (_, reason) = last.ended.as_ref()?;
    Outcome::rule_in(reason).map(str::to_owned)
}

/// Run time at which a reading ended, seconds.
fn end_s(reading: &Reading) -> f64 {
    reading.time_s + (reading.end_us - reading.start_us) as f64 * 1e-6
}

/// The reference pose before and after an interruption, in the detector's quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// The mean of the last readings before.
    pub before: f64,
    /// The mean of the readings after.
    pub after: f64,
    /// Standard uncertainty of the difference by what is independent between the two, noise and
    /// finding the home marks again; what both share cancels.
    pub u_difference: f64,
}

impl Comparison {
    /// Whether |after - before| <= 2 u.
    pub fn agrees(&self) -> bool {
        (self.after - self.before).abs() <= AGREES_U * self.u_difference
    }
}

/// Compares the readings that a resume took with the last ones before it. `None` if there are
/// none, or no dark reading yet that would make either a radiance.
pub fn compare(
    rig: &Rig,
    before: &[Reading],
    checks: &[Reading],
) -> Result<Option<Comparison>, CalibrationError> {
    let all: Vec<Reading> = before.iter().chain(checks).cloned().collect();
    let calibrated = match calibrate(rig, &all) {
        Ok(calibrated) => calibrated,
        Err(CalibrationError::NoDark { .. }) => return Ok(None),
        Err(error) => return Err(error),
    };
    let is_check = |reference: &&Reference| checks.iter().any(|check| check.id == reference.id);
    let after: Vec<_> = calibrated.references.iter().filter(is_check).copied().collect();
    let last: Vec<_> = calibrated
        .references
        .iter()
        .rev()
        .filter(|reference| !is_check(reference))
        .take(CHECKS as usize)
        .copied()
        .collect();
    if after.is_empty() || last.is_empty() {
        return Ok(None);
    }
    let (before_value, u_before) = mean(&last);
    let (after_value, u_after) = mean(&after);
    let at = checks.iter().find(|check| check.kind == ReadingKind::Reference);
    let u_homing = at.map_or(0.0, |at| {
        let positions = rig.positions(at.commanded);
        u_rehoming(rig, &calibrated.samples, positions)
    });
    let u_difference = libm::hypot(libm::hypot(u_before, u_after), u_homing);
    Ok(Some(Comparison { before: before_value, after: after_value, u_difference }))
}

/// The plain mean, and its standard uncertainty by noise.
fn mean(references: &[Reference]) -> (f64, f64) {
    let n = references.len() as f64;
    let sum: f64 = references.iter().map(|reference| reference.value).sum();
    let variance: f64 = references.iter().map(|reference| reference.u_independent.powi(2)).sum();
    (sum / n, libm::sqrt(variance) / n)
}

/// How much the reading may change because both sessions found the home marks anew: the slope of
/// the radiance along each axis, from the samples around, times sqrt(2) of the homing's
/// uncertainty.
fn u_rehoming(rig: &Rig, samples: &[Sample], at: AxisPositions) -> f64 {
    let slopes = slopes(rig, samples, at);
    let variance: f64 = rig
        .axes
        .iter()
        .zip(slopes)
        .map(|(axis, slope)| 2.0 * (slope * axis.u_homing).powi(2))
        .sum();
    libm::sqrt(variance)
}

/// The slopes along the axes of the plane that fits the nearest samples best, per radian and per
/// metre; zero along an axis on which they do not differ.
fn slopes(rig: &Rig, samples: &[Sample], at: AxisPositions) -> [f64; 4] {
    // An axis counts by its travel, so that metres and radians compare.
    let scaled = |sample: &Sample| -> [f64; 4] {
        std::array::from_fn(|i| (sample.positions.0[i] - at.0[i]) / span(rig, i))
    };
    let mut near: Vec<([f64; 4], f64)> =
        samples.iter().map(|sample| (scaled(sample), sample.value)).collect();
    let distance = |offset: &[f64; 4]| offset.iter().map(|x| x * x).sum::<f64>();
    near.sort_by(|a, b| distance(&a.0).total_cmp(&distance(&b.0)));
    near.truncate(NEIGHBOURS);
    if near.len() <= 4 {
        return [0.0; 4];
    }
    let slopes = plane(&near);
    std::array::from_fn(|i| slopes[i] / span(rig, i))
}

/// How far an axis goes; a fixed one has no way to compare.
fn span(rig: &Rig, i: usize) -> f64 {
    let (low, high) = rig.axes[i].travel;
    if rig.axes[i].fixed.is_some() { 1.0 } else { high - low }
}

/// Least squares of value = a + b·offset, by normal equations about the means: b. Directions in
/// which the offsets do not differ get 0.
fn plane(points: &[([f64; 4], f64)]) -> [f64; 4] {
    let n = points.len() as f64;
    let centre: [f64; 4] =
        std::array::from_fn(|i| points.iter().map(|point| point.0[i]).sum::<f64>() / n);
    let level = points.iter().map(|point| point.1).sum::<f64>() / n;
    let mut rows = [[0.0; 5]; 4];
    for (offset, value) in points {
        for i in 0..4 {
            let along = offset[i] - centre[i];
            for j in 0..4 {
                rows[i][j] += along * (offset[j] - centre[j]);
            }
            rows[i][4] += along * (value - level);
        }
    }
    // A little of the trace on the diagonal takes directions without information to zero.
    let trace: f64 = (0..4).map(|i| rows[i][i]).sum();
    for (i, row) in rows.iter_mut().enumerate() {
        row[i] += 1e-9 * trace + f64::MIN_POSITIVE;
    }
    eliminate(rows)
}

/// Solves a symmetric positive definite system, the right side in the last column: Gauss, where
/// no pivoting is needed.
fn eliminate(mut rows: [[f64; 5]; 4]) -> [f64; 4] {
    for i in 0..4 {
        let pivot = rows[i];
        for (j, row) in rows.iter_mut().enumerate() {
            if j != i {
                let factor = row[i] / pivot[i];
                row.iter_mut().zip(pivot).for_each(|(x, p)| *x -= factor * p);
            }
        }
    }
    std::array::from_fn(|i| rows[i][4] / rows[i][i])
}

/// The check with which a resumed run begins. `before` is every reading that the run has;
/// `accepts` says that the person goes on with a reference that has moved, its samples flagged.
pub fn check(
    rig: Arc<Rig>,
    sequence: &Sequence,
    remainder: &Remainder,
    before: Vec<Reading>,
    accepts: bool,
) -> Check {
    let steps = (0..CHECKS).map(|n| sequence.resume_check(remainder.checks + n)).collect();
    let session = remainder.session;
    let judge: Judge =
        Box::new(move |checks: &[Reading]| judge(&rig, session, &before, checks, accepts));
    Check { steps, judge }
}

fn judge(
    rig: &Rig,
    session: u32,
    before: &[Reading],
    checks: &[Reading],
    accepts: bool,
) -> Judgement {
    let comparison = match compare(rig, before, checks) {
        Ok(Some(comparison)) => comparison,
        Ok(None) => return Judgement { check: None, go_on: Ok(()) },
        Err(error) => return Judgement { check: None, go_on: Err(error.to_string()) },
    };
    let verdict = match (comparison.agrees(), accepts) {
        (true, _) => Verdict::Agrees,
        (false, true) => Verdict::Flagged,
        (false, false) => Verdict::Refused,
    };
    let Comparison { before, after, u_difference } = comparison;
    let reading = checks.last().map_or(RESUME_IDS_FROM, |check| check.id);
    let check = journal::ReferenceCheck { session, reading, before, after, u_difference, verdict };
    let go_on = match verdict {
        Verdict::Agrees | Verdict::Flagged => Ok(()),
        Verdict::Refused => Err(refusal(rig, &comparison)),
    };
    Judgement { check: Some(check), go_on }
}

fn refusal(rig: &Rig, comparison: &Comparison) -> String {
    let [unit, ..] = rig.detector.quantity.units();
    let Comparison { before, after, u_difference } = comparison;
    format!(
        "the reference pose reads {after:.6} {unit}, before the interruption it read {before:.6} \
         {unit}: expected a difference of at most {:.6} {unit} (2 u). Has the source warmed up, \
         has the sample been moved?",
        AGREES_U * u_difference
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::Latched;

    fn rig() -> Rig {
        Rig::built_in().unwrap()
    }

    fn reading(id: u32, kind: ReadingKind, session: u32, mean: f64) -> Reading {
        Reading {
            id,
            kind,
            gain: 0,
            n: 200,
            mean,
            variance: 1.0,
            min: 0,
            max: 1,
            saturated: 0,
            commanded: Latched([0; 4]),
            travel: Latched([0; 4]),
            start: Latched([0; 4]),
            end: Latched([0; 4]),
            start_us: i64::from(id % 1000) * 1_000_000,
            end_us: i64::from(id % 1000) * 1_000_000 + 100_000,
            time_s: f64::from(session) * 1e4 + f64::from(id % 1000),
            session,
            device_times: crate::rig::DeviceTimes::default(),
            link_retries: 0,
            unsettled: false,
        }
    }

    /// A dark, references of 50,000 counts, and targets on a slope along theta.
    fn before(slope_per_count: f64) -> Vec<Reading> {
        let dark = reading(0, ReadingKind::Dark, 0, 0.0);
        let references = (1..5).map(|id| reading(id, ReadingKind::Reference, 0, 50_000.0));
        let targets = (0..40).map(|n| {
            let theta = 100 * (i32::try_from(n).unwrap() - 20);
            let at = Latched([theta, 0, 0, 0]);
            let mean = 50_000.0 + slope_per_count * f64::from(theta);
            let kind = ReadingKind::Target { index: n, repeat: 0 };
            Reading { commanded: at, start: at, end: at, ..reading(10 + n, kind, 0, mean) }
        });
        std::iter::once(dark).chain(references).chain(targets).collect()
    }

    fn checks(mean: f64) -> Vec<Reading> {
        (0..3).map(|n| reading(RESUME_IDS_FROM + n, ReadingKind::Reference, 1, mean)).collect()
    }

    #[test]
    fn what_is_missing_is_what_has_no_reading() {
        let step = |id| Step {
            id,
            kind: ReadingKind::Reference,
            pose: None,
            positions: AxisPositions([0.0; 4]),
            counts: Latched([0; 4]),
            via: None,
            settle: std::time::Duration::ZERO,
            gain: 0,
            dwell: std::time::Duration::from_millis(50),
            shutter: firmware_protocol::Shutter::Open,
            source_off: false,
            swept: None,
        };
        let steps: Vec<_> = (0..6).map(step).collect();
        let had = [0, 1, 3, WARM_UP_IDS_FROM + 4, RESUME_IDS_FROM + 2];
        let readings: Vec<_> =
            had.into_iter().map(|id| reading(id, ReadingKind::Reference, 1, 0.0)).collect();
        let left = remainder(&steps, &readings, &[]);
        assert_eq!(left.steps.iter().map(|step| step.id).collect::<Vec<_>>(), [2, 4, 5]);
        assert_eq!((left.done, left.warm_ups, left.checks, left.session), (3, 5, 3, 2));
        let last_s = readings.iter().map(end_s).fold(0.0, f64::max);
        assert!((left.began_s - last_s).abs() < 1e-9);
        let fresh = remainder(&steps, &[], &[]);
        assert_eq!((fresh.steps.len(), fresh.session), (6, 0));
    }

    #[test]
    fn a_reference_that_stayed_agrees_and_one_that_moved_does_not() {
        let rig = rig();
        let same = compare(&rig, &before(0.0), &checks(50_000.0)).unwrap().unwrap();
        assert!(same.agrees() && same.u_difference > 0.0);
        let moved = compare(&rig, &before(0.0), &checks(50_500.0)).unwrap().unwrap();
        assert!(!moved.agrees());
        assert!((moved.after / moved.before - 1.01).abs() < 1e-9);
        // Just inside and just outside of twice the uncertainty.
        let per_count = same.before / 50_000.0;
        for (by, agrees) in [(1.9, true), (2.1, false)] {
            let mean = 50_000.0 + by * same.u_difference / per_count;
            let comparison = compare(&rig, &before(0.0), &checks(mean)).unwrap().unwrap();
            assert_eq!(comparison.agrees(), agrees, "{by} u");
        }
    }

    #[test]
    fn on_a_slope_finding_the_home_mark_again_widens_the_comparison() {
        let rig = rig();
        let flat = compare(&rig, &before(0.0), &checks(50_000.0)).unwrap().unwrap();
        let steep = compare(&rig, &before(5.0), &checks(50_000.0)).unwrap().unwrap();
        // 5 counts of signal a count of position, in the detector's unit; sqrt(2) of u_homing.
        let axis = &rig.axes[0];
        let slope = 5.0 * (flat.before / 50_000.0) * axis.counts_per_unit;
        let expected = libm::sqrt(2.0) * slope * axis.u_homing;
        let widened = libm::sqrt(steep.u_difference.powi(2) - flat.u_difference.powi(2));
        assert!((widened / expected - 1.0).abs() < 1e-3, "{widened}, expected {expected}");
    }

    #[test]
    fn nothing_to_compare_with_is_no_refusal() {
        let rig = rig();
        assert_eq!(compare(&rig, &[], &checks(50_000.0)), Ok(None));
        let dark = [reading(0, ReadingKind::Dark, 0, 0.0)];
        assert_eq!(compare(&rig, &dark, &checks(50_000.0)), Ok(None));
    }

    #[test]
    fn a_refusal_carries_the_numbers_and_an_acceptance_is_flagged() {
        let (rig, had) = (rig(), before(0.0));
        let refused = judge(&rig, 1, &had, &checks(50_500.0), false);
        assert_eq!(refused.check.unwrap().verdict, Verdict::Refused);
        let text = refused.go_on.unwrap_err();
        assert!(text.starts_with("the reference pose reads ") && text.contains("W/(m² sr)"));
        let accepted = judge(&rig, 1, &had, &checks(50_500.0), true);
        assert_eq!(accepted.check.unwrap().verdict, Verdict::Flagged);
        assert_eq!(accepted.go_on, Ok(()));
    }
}
