//! A share of more readings, which is fitted by itself first, in blocks.

use super::fitting::Fitting;
use super::{Asked, Blocks, Totals};
use crate::beam::design::Design;
use crate::partial::{Partial, Sums};
use crate::solve::{absorb, begun, sensitivities};
use crate::truncation::{Heard, Remembered, shows};
use crate::whereabouts::Whereabouts;
use crate::{Common, FitError, Weighed};

/// A share of the readings: each the mean over its way, weighted by their own fit, which tells its level and
/// so its noise, every common component carried along. Three walks where they scatter as they say. Of
/// `asked` region, model, optics and truncation count, the last of them for the merge; limits and nuisances are refused.
pub fn share<B: Blocks>(
    blocks: &mut B,
    totals: &Totals,
    asked: &Asked<'_>,
) -> Result<Partial, B::Error> {
    let fitting = Fitting::new(totals, *asked)?;
    let (triangle, shared) = fitting.first(blocks, &mut |_| {})?;
    let (_, pass) = fitting.settle(blocks, triangle, &shared)?;
    let mut triangle = begun(0, fitting.basis.len(), shared.common.len());
    let (mut sums, mut whereabouts) = (Sums::NONE, Whereabouts::new(&asked.region));
    let mut finer = None;
    if asked.with_truncation {
        let shown = shared.common.iter().filter(|common| shows(common, shared.holds_constant));
        let names = shown.map(|common| common.name.clone()).collect();
        finer = Remembered::new(&fitting.basis, names)?;
    }
    fitting.walk(blocks, |block, design| {
        if !(block.nuisances.is_empty() && block.limits.is_empty()) {
            let (what, found) =
                ("limits and nuisances of a share", block.limits.len() + block.nuisances.len());
            return Err(FitError::Parts { what, expected: 0, found });
        }
        let settled = fitting.known.settled(block, design, Some(&pass))?;
        let common: Vec<&Common> = block.common.iter().filter(|c| c.shift.is_shared()).collect();
        let sides = sensitivities(design, &settled, &common)?;
        if let Some(finer) = &mut finer {
            let beyond = finer.beyond();
            let beyond = Design::of_a_share(block.samples, &beyond, asked.optics, totals.readings)?;
            let named = common.iter().zip(&sides).filter(|(c, _)| finer.names().contains(&c.name));
            finer.take(&Heard {
                sides: named.map(|(_, side)| side.clone()).collect(),
                own: design,
                beyond: beyond.in_flight(block.flown),
                values: &settled.values,
                variances: &settled.variances,
                stated: &settled.stated,
                weighed: &Weighed::alike(block.samples.len()),
            })?;
        }
        whereabouts.take(block.samples);
        for (sample, variance) in block.samples.iter().zip(&settled.variances) {
            sums.note(sample.value, *variance);
        }
        absorb(&mut triangle, design, &settled.rows(), &sides)
    })?;
    let common = shared.common.into_iter().map(|common| common.name).collect();
    let functions = ((*fitting.basis).clone(), asked.model.penalty);
    Ok(Partial::weighted(functions, common, (sums, triangle), whereabouts, finer))
}
