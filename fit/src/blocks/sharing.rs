//! A share of more readings, which is fitted by itself first, in blocks.

use super::fitting::Fitting;
use super::{Asked, Blocks, Totals};
use crate::partial::{Partial, Sums};
use crate::solve::{absorb, begun, sensitivities};
use crate::{Common, FitError};

/// A share of the readings: each the mean over its way, weighted by their own fit, which tells its level and
/// so its noise, every common component carried along. Three walks where they scatter as they say. Of
/// `asked` region, model and optics count; limits and nuisances are refused.
pub fn share<B: Blocks>(
    blocks: &mut B,
    totals: &Totals,
    asked: &Asked<'_>,
) -> Result<Partial, B::Error> {
    let fitting = Fitting::new(totals, *asked)?;
    let (triangle, shared) = fitting.first(blocks, &mut |_| {})?;
    let (_, pass) = fitting.settle(blocks, triangle, &shared)?;
    let mut triangle = begun(0, fitting.basis.len(), shared.common.len());
    let mut sums = Sums::NONE;
    fitting.walk(blocks, |block, design| {
        if !(block.nuisances.is_empty() && block.limits.is_empty()) {
            let (what, found) =
                ("limits and nuisances of a share", block.limits.len() + block.nuisances.len());
            return Err(FitError::Parts { what, expected: 0, found });
        }
        let settled = fitting.known.settled(block, design, Some(&pass))?;
        let common: Vec<&Common> = block.common.iter().filter(|c| c.shift.is_shared()).collect();
        let sides = sensitivities(design, &settled, &common)?;
        for (sample, variance) in block.samples.iter().zip(&settled.variances) {
            sums.note(sample.value, *variance);
        }
        absorb(&mut triangle, design, &settled.rows(), &sides)
    })?;
    let common = shared.common.into_iter().map(|common| common.name).collect();
    Ok(Partial::weighted((*fitting.basis).clone(), asked.model.penalty, common, sums, triangle))
}
