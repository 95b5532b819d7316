//! What one walk leaves to the next, and what it makes of a block: the weights of its readings.

use std::sync::Arc;

use crate::beam::design::Design;
use crate::solve::{levels, sensitivities};
use crate::weights::{Model, Settled, moved, shrink, start_at};
use crate::{Common, FitError, Readings, Robust};

use super::Totals;

/// What is known of all readings, and of none in particular.
#[derive(Debug, Clone, Copy)]
pub(super) struct Known {
    pub(super) totals: Totals,
    pub(super) model: Model,
}

/// What the weights follow from.
#[derive(Debug, Clone)]
pub(super) struct Pass {
    pub(super) coefficients: Arc<[f64]>,
    /// The field whose levels say what nuisances did to the readings: that of the pass before.
    pub(super) columns_by: Option<Arc<[f64]>>,
    /// The field by which rays off the meant ones matter.
    pub(super) moved_by: Arc<[f64]>,
    pub(super) nuisances: Vec<f64>,
    pub(super) determined: f64,
    pub(super) excess: f64,
    pub(super) robust: Robust,
}

impl Known {
    pub(super) fn new(totals: Totals) -> Self {
        let model = Model::of_mean_square(totals.squares / totals.readings as f64);
        Self { totals, model }
    }

    /// What counts as scatter before anything is fitted.
    pub(super) fn first_excess(&self) -> f64 {
        if self.totals.has_unknown { self.model.mean_square() } else { 0.0 }
    }

    /// A block's weights by a pass; `None` before the first one.
    pub(super) fn settled(
        &self,
        block: &Readings<'_>,
        design: &Design<'_>,
        pass: Option<&Pass>,
    ) -> Result<Settled, FitError> {
        let mean = self.totals.values / self.totals.readings as f64;
        let mut settled = start_at(block, self.model, mean, self.totals.has_unknown);
        if let Some(pass) = pass {
            if let Some(by) = &pass.columns_by {
                settled.coefficients = by.to_vec();
                settled.levels = levels(design, by);
                renew_columns(&mut settled, block, design)?;
            }
            self.advance(&mut settled, block, design, pass)?;
        }
        Ok(settled)
    }

    /// From a block's weights by one pass to those by the next; how much the most changed one changes.
    pub(super) fn advance(
        &self,
        settled: &mut Settled,
        block: &Readings<'_>,
        design: &Design<'_>,
        pass: &Pass,
    ) -> Result<f64, FitError> {
        pass.put_into(settled, block, design)?;
        settled.excess = pass.excess;
        let shrink = shrink(pass.determined, self.totals.readings);
        let change = settled.weigh(block, self.model, pass.robust, shrink);
        renew_columns(settled, block, design)?;
        Ok(change)
    }
}

impl Pass {
    /// The field, and what it makes of a block, before weights follow from it.
    pub(super) fn put_into(
        &self,
        settled: &mut Settled,
        block: &Readings<'_>,
        design: &Design<'_>,
    ) -> Result<(), FitError> {
        settled.coefficients = self.coefficients.to_vec();
        settled.nuisances.clone_from(&self.nuisances);
        settled.levels = levels(design, &self.coefficients);
        settled.determined = self.determined;
        let jitters: Vec<&Common> = block.common.iter().filter(|c| !c.shift.is_shared()).collect();
        if !jitters.is_empty() {
            settled.moved = moved(design, &self.moved_by, &jitters)?;
        }
        Ok(())
    }
}

fn renew_columns(
    settled: &mut Settled,
    block: &Readings<'_>,
    design: &Design<'_>,
) -> Result<(), FitError> {
    if !block.nuisances.is_empty() {
        let nuisances: Vec<&Common> = block.nuisances.iter().collect();
        settled.columns = sensitivities(design, settled, &nuisances)?;
    }
    Ok(())
}
