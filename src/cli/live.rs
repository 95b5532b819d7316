//! The fit of a long run that goes on: each reading is taken in once, in a basis that is known, and forgotten.
//! It begins with the run's first readings, which say how a reading is weighed and what its dark level is.
//! It knows no rule, and no journal: what the first readings do not say of later ones it refuses.

use std::cell::RefCell;
use std::collections::BTreeSet;

use fit::blocks::{Asked, Blocks, Live, Totals};
use fit::{Fit, FitError, Optics, Penalised, Readings, Region, Rules};

use crate::rig::calibration::{Calibrated, Handing, Part, Sample, Spread, calibrate};
use crate::rig::{Reading, Rig};

/// Readings that are taken in together.
const BLOCK_READINGS: usize = 256;

/// See the module.
pub(super) struct LiveFit {
    /// Without samples: what it takes to make some.
    calibrated: Calibrated,
    handing: Handing,
    rules: Rules,
    /// Ranges and sessions of the first readings.
    known: BTreeSet<(u8, u32)>,
    live: Live,
    waiting: Vec<Reading>,
}

/// Why a reading can't be taken in: the fit is to be made in another way from here on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Unforeseen;

impl LiveFit {
    /// Of a run's first readings. Not where they drift, since nobody knows how that goes on, and not where
    /// they can't be fitted.
    pub(super) fn begin(
        rig: &Rig,
        readings: &[Reading],
        (region, model, optics): (&Region, Penalised, Option<&Optics>),
        rules: &Rules,
    ) -> Option<Self> {
        let mut calibrated = calibrate(rig, readings).ok()?;
        let samples = std::mem::take(&mut calibrated.samples);
        let spread = Spread::of(samples.iter().filter(|sample| sample.part() != Part::None));
        let components = calibrated.components.clone();
        let handing = Handing::new(components, &calibrated.references, &spread, rules);
        if handing.drift.is_some() || rules.drift == Some(true) {
            return None;
        }
        let known = samples.iter().map(|sample| (sample.gain, sample.session)).collect();
        let mut first = First { samples: &samples, handing: &handing };
        let totals = RefCell::<Totals>::default();
        first
            .each(&mut |block| {
                totals.borrow_mut().take(block);
                Ok(())
            })
            .ok()?;
        let (region, robust) = (*region, rules.robust);
        let asked = Asked { region, model, robust, optics, with_truncation: false, others: &[] };
        let live = Live::begin(&mut first, &totals.into_inner(), &asked).ok()?;
        let (rules, waiting) = (*rules, Vec::new());
        Some(Self { calibrated, handing, rules, known, live, waiting })
    }

    /// Takes a further reading of the run.
    pub(super) fn take(&mut self, rig: &Rig, reading: &Reading) -> Result<(), Unforeseen> {
        self.waiting.push(reading.clone());
        if self.waiting.len() < BLOCK_READINGS {
            return Ok(());
        }
        self.take_in(rig)
    }

    /// The field so far by the run's rules, but for what the functions can't follow; `None` where it can't be said.
    pub(super) fn fit(&mut self, rig: &Rig) -> Result<Option<Fit>, Unforeseen> {
        self.take_in(rig)?;
        let ruled = self.live.fit().and_then(|fit| fit.ruled(&self.rules));
        Ok(ruled.ok().map(|ruled| ruled.fit))
    }

    /// Samples taken in, those with which it began included.
    #[cfg(test)]
    pub(super) fn readings(&self) -> u64 {
        self.live.readings()
    }

    /// Readings that are not taken in yet, fewer than a block.
    #[cfg(test)]
    pub(super) fn waiting(&self) -> usize {
        self.waiting.len()
    }

    fn take_in(&mut self, rig: &Rig) -> Result<(), Unforeseen> {
        let samples = self.calibrated.calibration(rig).samples(&self.waiting);
        self.waiting.clear();
        if samples.iter().any(|sample| !self.known.contains(&(sample.gain, sample.session))) {
            return Err(Unforeseen);
        }
        handed(&self.handing, &samples, &mut |block| self.live.take(block)).map_err(|_| Unforeseen)
    }
}

/// The run's first samples.
struct First<'a> {
    samples: &'a [Sample],
    handing: &'a Handing,
}

impl Blocks for First<'_> {
    type Error = FitError;

    fn each(
        &mut self,
        take: &mut dyn FnMut(&Readings<'_>) -> Result<(), FitError>,
    ) -> Result<(), FitError> {
        self.samples.chunks(BLOCK_READINGS).try_for_each(|block| handed(self.handing, block, take))
    }
}

fn handed(
    handing: &Handing,
    samples: &[Sample],
    take: &mut dyn FnMut(&Readings<'_>) -> Result<(), FitError>,
) -> Result<(), FitError> {
    let input = handing.usable(samples);
    let flown: Vec<_> = input.places.iter().map(|i| samples[*i].flown()).collect();
    take(&input.readings(&flown))
}
