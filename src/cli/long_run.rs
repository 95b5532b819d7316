//! `gonio fit` of a long run: its journal is walked through again and again, in blocks, as a long CSV is.
//! Kept are its dark and reference readings, the positions of axes that its samples have, and whole sweeps to
//! choose a basis from.

use std::cell::RefCell;

use fit::blocks::{Asked, Blocks, Blockwise, Totals};
use fit::partial::Partial;
use fit::{
    Chosen, FitError, Gleaning, Optics, Penalised, Readings, Region, Resolves, Robust, Ruled,
    Rules, Wish,
};

use super::failure::Failure;
use super::fit::FIT_HELP;
use super::results::{fit_region, optics};
use super::setup::Setup;
use super::stream::{self, KEPT_MAX, Stopped};
use crate::export::TreatedReadings;
use crate::journal::Reader;
use crate::rig::calibration::{
    Calibrated, Calibration, Component, FirstLook, FittedDrift, Handing, IndependentParts,
    IndependentSums, Part, Reference, Sample, Spread,
};
use crate::rig::{Reading, Rig};

/// A run of more readings is read in blocks, by `gonio fit` and at its end: of this many all that is made of
/// them takes half a gigabyte.
const RUN_KEPT_MAX: u64 = 200_000;
pub(super) const IN_BLOCKS: &str = "read in blocks, its samples not all in memory at once";

/// Whether a run is read in blocks without being asked.
pub(super) fn is_long(reader: &Reader) -> Result<bool, Failure> {
    Ok(reader.reading_count()? > RUN_KEPT_MAX)
}

/// What a run's fit says that was made in blocks.
pub(super) struct LongFit {
    pub(super) ruled: Ruled,
    pub(super) resolves: Resolves,
    pub(super) drift: Option<FittedDrift>,
    pub(super) nuisances: Vec<fit::FittedNuisance>,
    pub(super) treated: TreatedReadings,
    pub(super) independent: IndependentParts,
    pub(super) n_flagged: usize,
    pub(super) n_excluded: usize,
}

/// A journal, and what three looks at it found.
pub(super) struct LongRun<'a> {
    reader: &'a Reader,
    /// Readings of it that count, in the order in which they were taken.
    until: u64,
    pub(super) calibration: Calibration<'a>,
    /// What all samples share, or all of a range or session.
    components: Vec<Component>,
    pub(super) n_samples: usize,
    /// With dark and reference readings.
    pub(super) n_readings: u64,
    /// When the last of them had been taken, in run time, seconds.
    pub(super) ended_s: f64,
    /// Whether some of them were taken in flight.
    is_flown: bool,
    /// Those that carry a flag before anything is fitted.
    n_flagged: usize,
    handing: Handing,
    totals: Totals,
    /// Whole sweeps of those that are no limits.
    gleaning: Gleaning,
    /// Those that have no part in the fit; each is flagged.
    left_out: TreatedReadings,
    n_excluded: usize,
}

/// What its readings are handed over for.
#[derive(Clone, Copy)]
enum Purpose<'r> {
    /// A fit by these rules.
    Fit(&'r Rules),
    /// A share of more readings, which is looked at once: it takes no limits, and fits nothing along.
    Share,
}

impl Purpose<'_> {
    fn is_share(self) -> bool {
        matches!(self, Self::Share)
    }
}

/// The samples of the block that is looked at, and which of them are used.
#[derive(Default)]
struct Block {
    samples: Vec<Sample>,
    places: Vec<usize>,
}

/// Fits a run by its journal, a block at a time.
pub(super) fn fit(setup: &Setup, reader: &Reader, wish: &Wish) -> Result<LongFit, Failure> {
    let run = LongRun::open(&setup.rig, reader, &wish.rules)?;
    run.fit_wished(&fit_region(setup), optics(setup).as_ref(), wish).map_err(failed)
}

/// A run's share of more readings.
pub(super) struct LongShare {
    pub(super) partial: Partial,
    pub(super) references: Vec<Reference>,
    pub(super) n_flagged: usize,
    pub(super) n_excluded: usize,
}

/// A share of a run by its journal, a block at a time.
pub(super) fn share(
    setup: &Setup,
    reader: &Reader,
    model: Penalised,
) -> Result<LongShare, Failure> {
    let run = LongRun::opened(&setup.rig, reader, Purpose::Share)?;
    let optics = optics(setup);
    let asked = Asked {
        region: fit_region(setup),
        model,
        robust: Robust::None,
        optics: optics.as_ref(),
        with_truncation: true,
        others: &[],
    };
    let block = RefCell::<Block>::default();
    let mut walk = Walk { run: &run, block: &block };
    let partial = fit::blocks::share(&mut walk, &run.totals, &asked).map_err(failed)?;
    let n_excluded = run.n_samples - run.totals.readings();
    let LongRun { calibration, n_flagged, .. } = run;
    Ok(LongShare { partial, references: calibration.references, n_flagged, n_excluded })
}

fn failed(stopped: Stopped) -> Failure {
    match stopped {
        Stopped::Source(failure) => failure,
        Stopped::Fit(error) => refused(&error),
    }
}

/// What the last walk sums up.
struct Closing {
    sums: IndependentSums,
    treated: TreatedReadings,
    n_flagged: usize,
}

impl<'a> LongRun<'a> {
    pub(super) fn open(rig: &'a Rig, reader: &'a Reader, rules: &Rules) -> Result<Self, Failure> {
        Self::opened(rig, reader, Purpose::Fit(rules))
    }

    fn opened(rig: &'a Rig, reader: &'a Reader, purpose: Purpose<'_>) -> Result<Self, Failure> {
        let mut look = FirstLook::default();
        each_block(reader, u64::MAX, |block| {
            block.iter().try_for_each(|reading| look.take(rig, reading)).map_err(Failure::midway)
        })?;
        let calibration = look.calibration(rig).map_err(Failure::midway)?;
        Self::calibrated_by(calibration, reader, u64::MAX, purpose)
    }

    /// Its first readings alone, by the dark levels and the reference readings of all.
    pub(super) fn first(&self, until: u64, rules: &Rules) -> Result<Self, Failure> {
        let calibration = self.calibration.clone();
        Self::calibrated_by(calibration, self.reader, until, Purpose::Fit(rules))
    }

    /// The second look, at what samples say, and the third, at those that a fit uses.
    fn calibrated_by(
        calibration: Calibration<'a>,
        reader: &'a Reader,
        until: u64,
        purpose: Purpose<'_>,
    ) -> Result<Self, Failure> {
        let (mut spread, mut whole) = (Spread::default(), Spread::default());
        each_block::<Failure>(reader, until, |block| {
            let samples = calibration.samples(block);
            for sample in &samples {
                whole.take(sample);
                let is_limit = sample.part() == Part::Limit;
                if sample.part() != Part::None && !(is_limit && purpose.is_share()) {
                    spread.take(sample);
                }
            }
            Ok(())
        })?;
        let components = calibration.components(&spread);
        let handing = match purpose {
            Purpose::Fit(rules) => {
                Handing::new(components, &calibration.references, &spread, rules)
            }
            Purpose::Share => Handing::of_share(components, &spread),
        };
        let mut run = Self {
            reader,
            until,
            components: calibration.components(&whole),
            calibration,
            n_samples: 0,
            n_readings: 0,
            ended_s: 0.0,
            is_flown: false,
            n_flagged: 0,
            handing,
            totals: Totals::default(),
            gleaning: Gleaning::new(KEPT_MAX),
            left_out: TreatedReadings::default(),
            n_excluded: 0,
        };
        each_block::<Failure>(reader, until, |block| {
            run.count(block);
            Ok(())
        })?;
        Ok(run)
    }

    fn count(&mut self, block: &[Reading]) {
        let samples = self.calibration.samples(block);
        self.n_readings += block.len() as u64;
        self.n_samples += samples.len();
        let ends_s = samples.iter().map(|sample| sample.time_s + sample.dwell_s);
        self.ended_s = ends_s.fold(self.ended_s, f64::max);
        self.is_flown |= samples.iter().any(|sample| sample.flown().is_some());
        self.n_flagged += samples.iter().filter(|sample| !sample.flags.is_empty()).count();
        let input = self.handing.usable(&samples);
        self.totals.take(&input.readings(&[]));
        let is_limit = |i: usize| input.limits.binary_search(&i).is_ok();
        let plain = input.samples.iter().enumerate().filter(|(i, _)| !is_limit(*i));
        self.gleaning.take(&plain.map(|(_, sample)| *sample).collect::<Vec<_>>());
        for sample in samples.iter().filter(|sample| sample.part() == Part::None) {
            self.left_out.leave_out(u64::from(sample.reading), sample.ray(), sample.value);
            self.n_excluded += 1;
        }
    }

    /// What all of its samples share, and none of them.
    pub(super) fn calibrated(&self) -> Calibrated {
        Calibrated {
            samples: Vec::new(),
            components: self.components.clone(),
            references: self.calibration.references.clone(),
            darks: self.calibration.darks.clone(),
        }
    }

    /// Hands its readings over, as they were taken, block by block.
    pub(super) fn each(&self, mut take: impl FnMut(&[Reading])) -> Result<(), Failure> {
        each_block::<Failure>(self.reader, self.until, |block| {
            take(block);
            Ok(())
        })
    }

    /// Fits it as a plan or a person wishes.
    pub(super) fn fit_wished(
        &self,
        region: &Region,
        optics: Option<&Optics>,
        wish: &Wish,
    ) -> Result<LongFit, Stopped> {
        self.handing.demand(&wish.rules)?;
        let samples = self.gleaning.clone().into_samples();
        let (model, choice) = stream::chosen((&samples, self.is_flown), region, wish, optics)?;
        let others = choice.as_ref().map_or_else(Vec::new, fit::Choice::others);
        let made = self.fit_known(region, optics, &Chosen { model, others }, &wish.rules)?;
        Ok(LongFit { ruled: Ruled { choice, ..made.ruled }, ..made })
    }

    /// Fits it in a basis that is known, by a plan's or a person's rules.
    pub(super) fn fit_known(
        &self,
        region: &Region,
        optics: Option<&Optics>,
        chosen: &Chosen,
        rules: &Rules,
    ) -> Result<LongFit, Stopped> {
        let Chosen { model, others } = chosen;
        let asked = Asked {
            region: *region,
            model: *model,
            robust: rules.robust,
            optics,
            with_truncation: true,
            others,
        };
        let (Blockwise { fit, nuisances, resolves }, closing) = self.fit(&asked)?;
        let ruled = fit.clone().ruled(rules)?;
        let is_as_fitted = ruled.fit.coefficients() == fit.coefficients();
        let independent = closing.sums.parts(&ruled.fit);
        Ok(LongFit {
            ruled,
            resolves,
            drift: self.handing.drift.clone(),
            nuisances,
            treated: closing.treated,
            independent: if is_as_fitted { independent } else { IndependentParts::NONE },
            n_flagged: closing.n_flagged,
            n_excluded: self.n_excluded,
        })
    }

    fn fit(&self, asked: &Asked<'_>) -> Result<(Blockwise, Closing), Stopped> {
        let mut closing = Closing {
            sums: IndependentSums::default(),
            treated: self.left_out.clone(),
            n_flagged: self.n_excluded,
        };
        let block = RefCell::<Block>::default();
        let mut walk = Walk { run: self, block: &block };
        let fitted = fit::blocks::fit(&mut walk, &self.totals, asked, &mut |_, told| {
            let Block { samples, places } = &mut *block.borrow_mut();
            // As they are stated where all are there: at the level of the fit.
            for (place, level) in places.iter().zip(&told.levels) {
                samples[*place].state_at(*level);
            }
            closing.sums.take(places.iter().map(|place| &samples[*place]), &told.influence);
            let named = |sample: &Sample| (u64::from(sample.reading), sample.ray(), sample.value);
            closing.treated.take(&told.weighed, |i| named(&samples[places[i]]));
            let is_flagged =
                |sample: &Sample| !sample.flags.is_empty() || is_off_sample(asked.optics, sample);
            let flagged = places.iter().filter(|place| is_flagged(&samples[**place]));
            closing.n_flagged += flagged.count();
        });
        Ok((fitted?, closing))
    }
}

fn is_off_sample(optics: Option<&Optics>, sample: &Sample) -> bool {
    optics.is_some_and(|optics| optics.reaches_beyond(&sample.ray()))
}

fn refused(error: &FitError) -> Failure {
    Failure::midway(format!("fit: {error}\n  help: {FIT_HELP}"))
}

/// A journal's readings as the fit takes them.
struct Walk<'a> {
    run: &'a LongRun<'a>,
    block: &'a RefCell<Block>,
}

impl Blocks for Walk<'_> {
    type Error = Stopped;

    fn each(
        &mut self,
        take: &mut dyn FnMut(&Readings<'_>) -> Result<(), FitError>,
    ) -> Result<(), Stopped> {
        each_block(self.run.reader, self.run.until, |readings| {
            let samples = self.run.calibration.samples(readings);
            let input = self.run.handing.usable(&samples);
            let flown: Vec<_> = input.places.iter().map(|i| samples[*i].flown()).collect();
            let place = |i: usize| input.places[i];
            let ids: Vec<u32> = samples.iter().map(|sample| sample.reading).collect();
            self.block.replace(Block { places: input.places.clone(), samples });
            take(&input.readings(&flown)).map_err(|error| match error.index() {
                Some(i) => Stopped::Source(Failure::midway(format!(
                    "fit: reading {}: {error}\n  help: {FIT_HELP}",
                    ids[place(i)]
                ))),
                None => Stopped::Fit(error),
            })
        })
    }
}

/// Hands a journal's first readings on, as they were taken.
fn each_block<E: From<Failure>>(
    reader: &Reader,
    until: u64,
    mut take: impl FnMut(&[Reading]) -> Result<(), E>,
) -> Result<(), E> {
    let (mut last, mut left) = (0, until);
    loop {
        let count = u32::try_from(left).map_or(BLOCK_READINGS, |left| left.min(BLOCK_READINGS));
        let block = reader.readings_after(last, count).map_err(Failure::from)?;
        let Some((position, _)) = block.last() else { return Ok(()) };
        last = *position;
        left -= block.len() as u64;
        let readings: Vec<Reading> = block.into_iter().map(|(_, reading)| reading).collect();
        take(&readings)?;
    }
}

/// Enough for what a block costs beside its rows, few enough for a hundred components' effects on each: a
/// megabyte.
pub(super) const BLOCK_READINGS: u32 = 1024;
