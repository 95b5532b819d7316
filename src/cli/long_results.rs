//! What a long run says at its end, made from its journal a block at a time. Of its samples as many are kept
//! as pictures show; samples.csv is written by another walk, in the order of targets.

use std::io::{self, Write};

use fit::{Fit, FittedNuisance, Optics, Robust, Wish};

use super::accuracy;
use super::long_run::{BLOCK_READINGS, IN_BLOCKS, LongFit, LongRun};
use super::results::{Results, compare, fit_region, optics};
use super::setup::Setup;
use super::stream::Stopped;
use super::tally::Tally;
use super::{derive, failure::Failure};
use crate::export::{SamplesFile, TreatedReadings, Treatment};
use crate::journal::{Order, Reader};
use crate::rig::calibration::{Calibrated, Fitted, IndependentParts, Sample};
use crate::rig::{Reading, ReadingKind};

/// Samples that pictures show at most, about: more dots are one blot.
const SHOWN_MAX: usize = 20_000;

/// What the results of a run in blocks have instead of its samples.
#[derive(Debug)]
pub(super) struct InBlocks {
    robust: Robust,
    treated: TreatedReadings,
    nuisances: Vec<FittedNuisance>,
    /// For fit.json.
    notes: [String; 1],
}

impl InBlocks {
    fn of(made: &LongFit, robust: Robust) -> Self {
        let (treated, nuisances) = (made.treated.clone(), made.nuisances.clone());
        Self { robust, treated, nuisances, notes: [IN_BLOCKS.to_owned()] }
    }

    fn without_fit() -> Self {
        let (treated, nuisances) = (TreatedReadings::default(), Vec::new());
        Self { robust: Robust::None, treated, nuisances, notes: [IN_BLOCKS.to_owned()] }
    }

    /// What became of readings that are no plain ones.
    pub(super) fn treatment(&self) -> Treatment<'_> {
        Treatment::of_readings(self.robust, self.treated.clone(), &self.nuisances)
    }

    /// What fit.json must say.
    pub(super) fn notes(&self) -> &[String] {
        &self.notes
    }
}

/// Some samples of a long run, each with its level where there is a fit, and all readings that are no
/// target's.
#[derive(Default)]
struct Kept {
    tally: Tally,
    samples: Vec<(Sample, Option<f64>)>,
    others: Vec<Reading>,
}

impl Results {
    /// Calibrates and fits a run by its journal, and hands over the readings beside its targets', at most
    /// so many samples kept. Errors as of [`Results::of`].
    pub(super) fn in_blocks(
        setup: &Setup,
        wish: &Wish,
        reader: &Reader,
    ) -> Result<(Self, Vec<Reading>), Failure> {
        let run = LongRun::open(&setup.rig, reader, &wish.rules)?;
        let (region, optics) = (fit_region(setup), optics(setup));
        let made = match run.fit_wished(&region, optics.as_ref(), wish) {
            Ok(made) => Ok(made),
            Err(Stopped::Fit(error)) => Err(error),
            Err(Stopped::Source(failure)) => return Err(failure),
        };
        let fit = made.as_ref().ok().map(|made| &made.ruled.fit);
        let Kept { tally, samples, others } = keep(&run, fit, optics.as_ref())?;
        let compared = fit.and_then(|fit| compare(setup, &region, fit));
        let (truth, score) = compared.unzip();
        let derived = fit.map_or_else(Vec::new, |fit| {
            derive::derive(fit, setup.rig.detector.quantity, &setup.plan.derive)
        });
        let blocks = made
            .as_ref()
            .map_or_else(|_| InBlocks::without_fit(), |made| InBlocks::of(made, wish.rules.robust));
        let accuracy = match &made {
            Ok(made) => {
                let (seen, whole) = ((&region, optics.as_ref()), &made.ruled);
                accuracy::course_in_blocks(&run, seen, whole, &wish.rules)?
            }
            Err(_) => Vec::new(),
        };
        let independent =
            made.as_ref().map_or(IndependentParts::NONE, |made| made.independent.clone());
        let levels = samples.iter().filter_map(|(_, level)| *level).collect();
        let samples = samples.into_iter().map(|(sample, _)| sample).collect();
        let results = Self {
            calibrated: Calibrated { samples, ..run.calibrated() },
            tally,
            fitted: made.map(fitted),
            truth,
            score: score.flatten(),
            accuracy,
            levels,
            independent,
            derived,
            blocks: Some(blocks),
        };
        Ok((results, others))
    }

    /// What a reader of the summary or the report must know of a run in blocks, one sentence each.
    pub(super) fn remarks(&self) -> Vec<String> {
        let Some(blocks) = &self.blocks else { return Vec::new() };
        let (shown, all) = (self.calibrated.samples.len(), self.tally.measured);
        let mut remarks = blocks.notes.to_vec();
        if shown < all {
            remarks.push(format!(
                "pictures and the table of flagged readings are of {shown} samples of {all}; samples.csv has all"
            ));
        }
        remarks
    }
}

/// Writes samples.csv from a journal: what is stated of each is made again from the results' fit.
pub(super) fn write_samples(
    out: impl Write,
    setup: &Setup,
    results: &Results,
    reader: &Reader,
) -> io::Result<()> {
    let calibration = results.calibrated.calibration(&setup.rig);
    let fit = results.fitted.as_ref().ok().map(|fitted| &fitted.fit);
    let optics = optics(setup);
    let mut file = SamplesFile::new(out, setup.rig.detector.quantity)?;
    let mut append = |readings: &mut Vec<Reading>| {
        let (samples, _) = stated(calibration.samples(readings), fit, optics.as_ref());
        readings.clear();
        file.append(&samples)
    };
    let mut block = Vec::new();
    let mut outcome = Ok(());
    let walked = reader.for_each_reading(Order::Target, |reading| {
        block.push(reading);
        if outcome.is_ok() && block.len() >= BLOCK_READINGS as usize {
            outcome = append(&mut block);
        }
        // After a failure there is nothing to keep.
        if outcome.is_err() {
            block.clear();
        }
    });
    outcome?;
    walked.map_err(io::Error::other)?;
    append(&mut block)?;
    file.close()
}

/// The readings of a journal as they were taken, a block of them in memory. What goes wrong is the last
/// item.
pub(super) fn readings_taken(reader: &Reader) -> impl Iterator<Item = io::Result<Reading>> {
    let (mut last, mut is_over) = (0, false);
    let mut block = Vec::new().into_iter();
    std::iter::from_fn(move || {
        if is_over {
            return None;
        }
        if block.len() == 0 {
            match reader.readings_after(last, BLOCK_READINGS) {
                Ok(next) => block = next.into_iter(),
                Err(error) => {
                    is_over = true;
                    return Some(Err(io::Error::other(error)));
                }
            }
        }
        let (position, reading) = block.next()?;
        last = position;
        Some(Ok(reading))
    })
}

/// Counts all samples, and keeps those that are shown.
fn keep(run: &LongRun<'_>, fit: Option<&Fit>, optics: Option<&Optics>) -> Result<Kept, Failure> {
    let mut kept = Kept::default();
    run.each(|readings| {
        let (samples, levels) = stated(run.calibration.samples(readings), fit, optics);
        for (i, sample) in samples.into_iter().enumerate() {
            kept.tally.take(&sample);
            if is_shown(sample.reading, run.n_samples) {
                kept.samples.push((sample, levels.get(i).copied()));
            }
        }
        let is_other = |reading: &&Reading| !matches!(reading.kind, ReadingKind::Target { .. });
        kept.others.extend(readings.iter().filter(is_other).cloned());
    })?;
    kept.samples.sort_by_key(|(sample, _)| (sample.index, sample.repeat, sample.reading));
    Ok(kept)
}

/// Samples as they are stated where all are there, and their levels; these are empty without a fit.
fn stated(
    samples: Vec<Sample>,
    fit: Option<&Fit>,
    optics: Option<&Optics>,
) -> (Vec<Sample>, Vec<f64>) {
    let (components, references, darks) = (Vec::new(), Vec::new(), Vec::new());
    let mut block = Calibrated { samples, components, references, darks };
    let levels = fit.map_or_else(Vec::new, |fit| block.restate_from(fit, optics));
    if let Some(optics) = optics {
        block.flag_off_sample(optics);
    }
    (block.samples, levels)
}

/// Whether a sample of so many is shown: by its reading's id, evenly over the run whatever the rhythm of its
/// plan.
fn is_shown(reading: u32, of: usize) -> bool {
    (f64::from(reading) * GOLDEN).fract() * (of as f64) < SHOWN_MAX as f64
}

fn fitted(made: LongFit) -> Fitted {
    let fit::Ruled { fit, choice, symmetry, nonnegative } = made.ruled;
    let (resolves, n_excluded, drift) = (made.resolves, made.n_excluded, made.drift);
    let places = Vec::new();
    Fitted { fit, choice, resolves, n_excluded, places, drift, symmetry, nonnegative }
}

/// The golden ratio's fraction: its multiples fall evenly into any part of [0, 1).
const GOLDEN: f64 = 0.618_033_988_749_894_9;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_that_are_shown_lie_evenly_over_a_run_and_its_sweeps() {
        assert!((0..20_000).all(|id| is_shown(id, SHOWN_MAX)));
        let shown: Vec<u32> = (0..1_000_000).filter(|id| is_shown(*id, 1_000_000)).collect();
        // A fiftieth.
        assert!(shown.len().abs_diff(SHOWN_MAX) < 20, "{}", shown.len());
        let tenth = shown.iter().filter(|id| (300_000..400_000).contains(*id)).count();
        assert!(tenth.abs_diff(2_000) < 20, "{tenth}");
        // Sweeps of 100 readings: each place of them is seen.
        for place in 0..100 {
            let of = shown.iter().filter(|id| *id % 100 == place).count();
            assert!(of.abs_diff(200) < 40, "{place}: {of}");
        }
    }
}
