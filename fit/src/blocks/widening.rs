//! The walks that look for what the functions can't follow. What is done with them is that of readings
//! in memory.

use super::Blocks;
use super::fitting::{Fitting, Shared};
use super::passing::Pass;
use crate::beam::design::Design;
use crate::poses::Poses;
use crate::truncation::{Finer, Heard, Taken, Walks, Widened, Wider};
use crate::{Fit, FitError, Weighed};

impl Fitting<'_> {
    /// The fit with what its functions can't follow in u, if that is asked for and there is any.
    pub(super) fn widened<B: Blocks>(
        &self,
        blocks: &mut B,
        fit: &Fit,
        pass: &Pass,
        (shared, poses): (&Shared, &Poses),
    ) -> Result<Option<Widened>, B::Error> {
        if !self.asked.with_truncation {
            return Ok(None);
        }
        let finer = Finer::of(fit.basis(), fit.region(), poses.places());
        let Some(finer) = finer else { return Ok(None) };
        let taken = Taken {
            nuisances: shared.nuisances.len(),
            holds_constant: shared.holds_constant,
            has_unknown: self.known.totals.has_unknown,
            excess: pass.excess,
            robust: self.asked.robust,
        };
        let wider = Wider::new(fit, finer, &taken, &shared.common)?;
        wider.widened(&mut Hearing { fitting: self, blocks, pass, wider: &wider })
    }
}

/// Blocks as the wider model hears them.
struct Hearing<'h, 'f, B> {
    fitting: &'h Fitting<'f>,
    blocks: &'h mut B,
    pass: &'h Pass,
    wider: &'h Wider<'h>,
}

impl<B: Blocks> Walks for Hearing<'_, '_, B> {
    type Error = B::Error;

    fn each(
        &mut self,
        take: &mut dyn FnMut(&Heard<'_>) -> Result<(), FitError>,
    ) -> Result<(), B::Error> {
        let Self { fitting, blocks, pass, wider } = self;
        let (optics, readings) = (fitting.asked.optics, fitting.known.totals.readings);
        fitting.walk(*blocks, |block, own| {
            let settled = fitting.known.settled(block, own, Some(pass))?;
            let beyond = Design::of_a_share(block.samples, wider.beyond(), optics, readings)?;
            let weighed = Weighed {
                robust: block.robust,
                weights: settled.weights.clone(),
                residuals: Vec::new(),
                limits: block.limits.to_vec(),
                nuisances: Vec::new(),
            };
            take(&Heard {
                own,
                beyond: beyond.in_flight(block.flown),
                values: &settled.values,
                variances: &settled.variances,
                stated: &settled.stated,
                weighed: &weighed,
                sides: wider.sides(own, &settled.columns, block.common)?,
            })
        })
    }
}
