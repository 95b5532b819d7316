//! A fit that goes on while readings come: each is taken in once and forgotten, and what all of them say so
//! far can be asked at any time, at a cost that does not go with their number.
//!
//! It begins with readings that can be walked through. Their field and their scatter decide once and for all how
//! a reading is weighed, and what a common component does to it. So it is the fit of all readings where
//! they state their noise; elsewhere it differs from it by what later readings would have changed in the weights.

use std::sync::Arc;

use super::fitting::{Fitting, Shared, check_block};
use super::passing::{Known, Pass};
use super::{Asked, Blocks, Totals};
use crate::basis::Basis;
use crate::beam::design::Design;
use crate::check::check_sample;
use crate::penalty::Prior;
use crate::solve::{absorb, sensitivities};
use crate::triangle::Triangle;
use crate::{Fit, FitError, Optics, Penalised, Readings, Region, Robust};

/// See the module. Its memory is that of a triangle of coefficients and common components.
pub struct Live {
    region: Region,
    model: Penalised,
    robust: Robust,
    optics: Option<Optics>,
    basis: Arc<Basis>,
    prior: Arc<Prior>,
    known: Known,
    shared: Shared,
    pass: Pass,
    triangle: Triangle,
    readings: u64,
}

impl Live {
    /// Of the readings that there are: as many walks as [`fit`](super::fit) without truncation, whose errors are these.
    pub fn begin<B: Blocks>(
        blocks: &mut B,
        totals: &Totals,
        asked: &Asked<'_>,
    ) -> Result<Self, B::Error> {
        let fitting = Fitting::new(totals, *asked)?;
        let (triangle, mut shared) = fitting.first(blocks, &mut |_| {})?;
        let (_, pass) = fitting.settle(blocks, triangle, &shared)?;
        // Whether an offset is a constant field for readings to come, too, is not known.
        shared.holds_constant = false;
        let sides = shared.shifting(&shared.common).len();
        let triangle = fitting.with_sides(blocks, &pass, (&shared, sides))?;
        let Fitting { basis, prior, known, .. } = fitting;
        let Asked { region, model, robust, optics, .. } = *asked;
        let (optics, readings) = (optics.copied(), totals.readings as u64);
        Ok(Self {
            region,
            model,
            robust,
            optics,
            basis,
            prior,
            known,
            shared,
            pass,
            triangle,
            readings,
        })
    }

    /// Takes a block of further readings in, whose common components and nuisances are those of the first
    /// ones. An error leaves everything as it was before the block.
    pub fn take(&mut self, block: &Readings<'_>) -> Result<(), FitError> {
        if block.samples.is_empty() {
            return Ok(());
        }
        for (index, sample) in block.samples.iter().enumerate() {
            check_sample(index, sample, &self.region)?;
        }
        check_block(block)?;
        self.shared.demand(block)?;
        let block = Readings { robust: self.robust, ..*block };
        let (optics, count) = (self.optics.as_ref(), self.known.totals.readings);
        let design = Design::of_a_share(block.samples, &self.basis, optics, count)?;
        let design = design.in_flight(block.flown);
        let settled = self.known.settled(&block, &design, Some(&self.pass))?;
        let shifting = self.shared.shifting(block.common);
        let sides = sensitivities(&design, &settled, &shifting)?;
        absorb(&mut self.triangle, &design, &settled.rows(), &sides)?;
        self.readings += block.samples.len() as u64;
        Ok(())
    }

    /// Readings taken in, those with which it began included.
    pub fn readings(&self) -> u64 {
        self.readings
    }

    /// The field so far, with its u but for what the functions can't follow. Nobody looked at residuals: of
    /// its quality the condition alone is stated.
    pub fn fit(&self) -> Result<Fit, FitError> {
        let Self { region, model, robust, known, .. } = *self;
        let asked = Asked {
            region,
            model,
            robust,
            optics: self.optics.as_ref(),
            with_truncation: false,
            others: &[],
        };
        let (basis, prior) = (Arc::clone(&self.basis), Arc::clone(&self.prior));
        let fitting = Fitting { asked, basis, prior, known };
        let sides = self.shared.shifting(&self.shared.common).len();
        Ok(fitting.stated(self.triangle.clone(), &self.pass, (&self.shared, sides))?.fit)
    }
}
