//! The fit itself: walk by walk until the weights agree with the field, and what is said at the end.

use std::sync::Arc;

use super::doubting::doubted;
use super::passing::{Known, Pass};
use super::sketch::Sketch;
use super::{Asked, Blocks, Blockwise, Told, Totals};
use crate::basis::Basis;
use crate::beam::design::Design;
use crate::check::check_sample;
use crate::influence::{Influence, Watched};
use crate::measured::Looked;
use crate::nuisance::{Solved, packed, without};
use crate::parts::{CommonShift, Parts};
use crate::penalty::Prior;
use crate::poses::Poses;
use crate::solve::{
    QualitySums, absorb, begun, check_readings, levels, needs_a_side, sensitivities, shifts,
    solved, weighed_by,
};
use crate::triangle::Triangle;
use crate::truncation::Widened;
use crate::undetermined::by_functions;
use crate::weights::{PASSES_MAX, REWEIGHING_MAX, SETTLED_RELATIVE, Settled, excess_by, shrink};
use crate::{Common, Fit, FitError, FittedNuisance, Readings, Resolves, Robust, Sample, Shift};

/// Fits readings that come in blocks, as [`fit_readings`](crate::fit_readings) does readings that are
/// there. Of weights that are settled, and of noise that is what it was said to be, it takes three walks, and for truncation one or two more; `told`
/// hears of every block in the last one.
pub fn fit<B: Blocks>(
    blocks: &mut B,
    totals: &Totals,
    asked: &Asked<'_>,
    told: &mut dyn FnMut(&Readings<'_>, &Told),
) -> Result<Blockwise, B::Error> {
    let fitting = Fitting::new(totals, *asked)?;
    let (mut poses, mut looked) = (Poses::new(totals.readings, &asked.region), Looked::new());
    let (triangle, shared) = fitting.first(blocks, &mut |samples| {
        poses.take(samples);
        looked.take(samples);
    })?;
    let (triangle, pass) = fitting.settle(blocks, triangle, &shared)?;
    let mut tally = poses.tally();
    let (fit, nuisances) =
        fitting.close(blocks, triangle, &pass, (&shared, &poses), &mut |block, of_block| {
            tally.take(block.samples);
            told(block, of_block);
        })?;
    let fit = doubted(fit.with_measured(Some(looked.measured())), blocks, totals, asked)?;
    let Asked { region, model, optics, .. } = asked;
    let resolves = Resolves::by(&poses, tally.kind(), region, model.basis, *optics);
    Ok(Blockwise { fit, nuisances, resolves })
}

pub(super) struct Fitting<'a> {
    pub(super) asked: Asked<'a>,
    pub(super) basis: Arc<Basis>,
    pub(super) prior: Arc<Prior>,
    pub(super) known: Known,
}

/// What a triangle says.
pub(super) struct Stated {
    /// Without truncation, and without what residuals say of its quality.
    pub(super) fit: Fit,
    nuisances: Vec<FittedNuisance>,
    solved: Solved,
    whole: Vec<f64>,
    condition: f64,
}

/// What all blocks share.
pub(super) struct Shared {
    /// The components, without what they do to single readings.
    pub(super) common: Vec<Common>,
    pub(super) nuisances: Vec<Common>,
    has_jitter: bool,
    /// Whether an offset is a constant field.
    pub(super) holds_constant: bool,
}

impl<'a> Fitting<'a> {
    pub(super) fn new(totals: &Totals, asked: Asked<'a>) -> Result<Self, FitError> {
        let Asked { region, model, .. } = asked;
        if !region.is_sound() {
            return Err(FitError::Region);
        }
        let coefficients = model.basis.checked_len()?;
        model.check()?;
        let readings = totals.readings;
        if readings == 0 {
            return Err(FitError::Empty);
        }
        let coefficients = if model.penalty.is_none() { coefficients } else { 1 };
        if readings < coefficients {
            return Err(FitError::FewerReadingsThanCoefficients { readings, coefficients });
        }
        if readings == coefficients && totals.has_unknown {
            return Err(FitError::NoScatter { readings });
        }
        if totals.limits == readings {
            return Err(FitError::OnlyLimits { readings });
        }
        let basis = Arc::new(Basis::new(model.basis, region)?);
        let prior = Arc::new(Prior::new(&basis, model.penalty)?);
        Ok(Self { asked, basis, prior, known: Known::new(*totals) })
    }

    /// A walk.
    pub(super) fn walk<B: Blocks>(
        &self,
        blocks: &mut B,
        mut each: impl FnMut(&Readings<'_>, &Design<'_>) -> Result<(), FitError>,
    ) -> Result<(), B::Error> {
        let Asked { optics, robust, .. } = self.asked;
        blocks.each(&mut |block| {
            if block.samples.is_empty() {
                return Ok(());
            }
            let block = Readings { robust, ..*block };
            let readings = self.known.totals.readings;
            let design = Design::of_a_share(block.samples, &self.basis, optics, readings)?;
            each(&block, &design.in_flight(block.flown))
        })
    }

    /// The walk that looks whether the readings make sense: its rows are those before anything is fitted.
    pub(super) fn first<B: Blocks>(
        &self,
        blocks: &mut B,
        look: &mut dyn FnMut(&[Sample]),
    ) -> Result<(Triangle, Shared), B::Error> {
        let mut begun_at: Option<(Triangle, Shared)> = None;
        self.walk(blocks, |block, design| {
            for (index, sample) in block.samples.iter().enumerate() {
                check_sample(index, sample, &self.asked.region)?;
            }
            check_block(block)?;
            look(block.samples);
            let (triangle, shared) = begun_at.get_or_insert_with(|| {
                let triangle = begun(block.nuisances.len(), self.basis.len(), 0);
                (triangle, Shared::of(block))
            });
            shared.demand(block)?;
            shared.holds_constant &= design.holds_constant();
            let settled = self.known.settled(block, design, None)?;
            absorb(triangle, design, &settled.rows(), &[])
        })?;
        Ok(begun_at.ok_or(FitError::Empty)?)
    }

    /// Walks until the weights agree with the fit: their triangle, and what they follow from.
    pub(super) fn settle<B: Blocks>(
        &self,
        blocks: &mut B,
        mut triangle: Triangle,
        shared: &Shared,
    ) -> Result<(Triangle, Pass), B::Error> {
        let totals = &self.known.totals;
        let count = shared.nuisances.len();
        let mut pass: Option<Pass> = None;
        let mut passes = 0;
        for robust in self.asked.robust.phases() {
            let mut most = PASSES_MAX;
            if *robust != Robust::None || totals.limits > 0 {
                most = REWEIGHING_MAX;
            }
            for _ in 0..most {
                let solved = solved(triangle.clone(), (count, 0), &self.prior)?;
                if passes == 0 {
                    self.demand_rank(&solved)?;
                }
                let mut next = self.next(&solved, pass.as_ref(), passes, *robust);
                passes += 1;
                next.excess = self.excess(blocks, pass.as_ref(), &next)?;
                let before = pass.as_ref().map_or(self.known.first_excess(), |pass| pass.excess);
                // What no level changes need not be walked through again.
                let is_steady = *robust == Robust::None
                    && !(totals.has_modelled || totals.limits > 0 || shared.has_jitter)
                    && count == 0
                    && (next.excess - before).abs() <= 0.0;
                let mut change = 0.0;
                if !is_steady {
                    (triangle, change) = self.reweigh(blocks, pass.as_ref(), &next)?;
                }
                pass = Some(next);
                if change < SETTLED_RELATIVE {
                    break;
                }
            }
        }
        let pass = pass.ok_or(FitError::OutOfRange)?;
        Ok((triangle, pass))
    }

    /// The functions and their coefficients alone, without any u.
    pub(super) fn field<B: Blocks>(self, blocks: &mut B) -> Result<(Basis, Vec<f64>), B::Error> {
        let (triangle, shared) = self.first(blocks, &mut |_| {})?;
        let (triangle, _) = self.settle(blocks, triangle, &shared)?;
        let solved = solved(triangle, (shared.nuisances.len(), 0), &self.prior)?;
        self.demand_rank(&solved)?;
        Ok((Arc::unwrap_or_clone(self.basis), solved.field.unknowns(0)))
    }

    fn next(&self, solved: &Solved, before: Option<&Pass>, passes: usize, robust: Robust) -> Pass {
        let coefficients: Arc<[f64]> = solved.field.unknowns(0).into();
        // The field of the second pass is near enough to the last one's: this is of second order.
        let moved_by = before.filter(|_| passes >= 2).map(|pass| Arc::clone(&pass.moved_by));
        Pass {
            columns_by: before.map(|pass| Arc::clone(&pass.coefficients)),
            moved_by: moved_by.unwrap_or_else(|| Arc::clone(&coefficients)),
            nuisances: solved.nuisances(&coefficients),
            determined: self.prior.determined_by(&solved.field),
            excess: 0.0,
            robust,
            coefficients,
        }
    }

    /// The scatter that a field leaves, readings that lost all weight before left out.
    fn excess<B: Blocks>(
        &self,
        blocks: &mut B,
        before: Option<&Pass>,
        next: &Pass,
    ) -> Result<f64, B::Error> {
        let mut sketch = Sketch::new(next.robust != Robust::None);
        let mut count = 0;
        self.walk(blocks, |block, design| {
            let mut settled = self.known.settled(block, design, before)?;
            next.put_into(&mut settled, block, design)?;
            let terms = settled.terms(block, self.known.model);
            count += terms.len();
            sketch.take(&terms);
            Ok(())
        })?;
        let dof = (count as f64 - next.determined).max(0.0);
        Ok(excess_by(&sketch, dof, self.known.totals.has_unknown, next.robust))
    }

    /// The rows by a pass, and by how much the most changed weight changed.
    fn reweigh<B: Blocks>(
        &self,
        blocks: &mut B,
        before: Option<&Pass>,
        next: &Pass,
    ) -> Result<(Triangle, f64), B::Error> {
        let mut triangle = begun(next.nuisances.len(), self.basis.len(), 0);
        let mut change = 0.0_f64;
        self.walk(blocks, |block, design| {
            let mut settled = self.known.settled(block, design, before)?;
            change = change.max(self.known.advance(&mut settled, block, design, next)?);
            absorb(&mut triangle, design, &settled.rows(), &[])
        })?;
        Ok((triangle, change))
    }

    /// The same rows with what the components do to them.
    pub(super) fn with_sides<B: Blocks>(
        &self,
        blocks: &mut B,
        pass: &Pass,
        (shared, sides): (&Shared, usize),
    ) -> Result<Triangle, B::Error> {
        let mut triangle = begun(pass.nuisances.len(), self.basis.len(), sides);
        self.walk(blocks, |block, design| {
            let settled = self.known.settled(block, design, Some(pass))?;
            let shifting = shared.shifting(block.common);
            let sides = sensitivities(design, &settled, &shifting)?;
            absorb(&mut triangle, design, &settled.rows(), &sides)
        })?;
        Ok(triangle)
    }

    fn close<B: Blocks>(
        &self,
        blocks: &mut B,
        mut triangle: Triangle,
        pass: &Pass,
        (shared, poses): (&Shared, &Poses),
        told: &mut dyn FnMut(&Readings<'_>, &Told),
    ) -> Result<(Fit, Vec<FittedNuisance>), B::Error> {
        let sides = shared.shifting(&shared.common).len();
        if sides > 0 {
            triangle = self.with_sides(blocks, pass, (shared, sides))?;
        }
        let Stated { fit, nuisances, solved, whole, condition } =
            self.stated(triangle, pass, (shared, sides))?;
        let widened = self.widened(blocks, &fit, pass, (shared, poses))?;
        let closed = (pass, &solved, widened.as_ref());
        let sums = self.tell(blocks, closed, (&fit, &whole), told)?;
        let quality = sums.quality(condition, fit.determined(), pass.excess);
        let parts = widened.map_or_else(|| fit.parts().clone(), |widened| widened.parts);
        let fit = Fit::from_parts(Parts { quality, ..parts });
        Ok((fit.map_err(|_| FitError::OutOfRange)?, nuisances))
    }

    /// What a triangle of all rows with their sides says, before anybody looks at single readings.
    pub(super) fn stated(
        &self,
        triangle: Triangle,
        pass: &Pass,
        (shared, sides): (&Shared, usize),
    ) -> Result<Stated, FitError> {
        let count = shared.nuisances.len();
        let solved = solved(triangle, (count, sides), &self.prior)?;
        self.demand_rank(&solved)?;
        let solution = &solved.field;
        let coefficients = solution.unknowns(0);
        let inverse = solution.inverse_matrix();
        let own: Vec<Vec<f64>> = (0..count).map(|k| solution.unknowns(1 + sides + k)).collect();
        let independent = without(&inverse, solution.r(), &own).ok_or(FitError::OutOfRange)?;
        let common: Vec<&Common> = shared.common.iter().collect();
        let constant = shared.holds_constant.then(|| self.basis.unity());
        let unknowns = |side| solution.unknowns(side);
        let mut shifts = shifts(&common, &coefficients, constant.as_deref(), unknowns);
        let own = shared.nuisances.iter().zip(own);
        shifts.extend(own.map(|(c, shift)| CommonShift { name: c.name.clone(), shift }));
        let nuisances = solved.fitted(&shared.nuisances, &coefficients, &inverse);
        let determined = self.prior.determined_by(solution);
        let condition = solution.spectrum().ok_or(FitError::OutOfRange)?.condition();
        let parts = Parts {
            region: self.asked.region,
            model: self.asked.model,
            factor: packed(&independent, self.asked.robust.inflation().sqrt()),
            shifts,
            quality: QualitySums::default().quality(condition, determined, pass.excess),
            truncation: None,
            coefficients,
        };
        let whole = packed(&inverse, 1.0);
        let fit = Fit::from_parts(parts).map_err(|_| FitError::OutOfRange)?;
        Ok(Stated { fit, nuisances, solved, whole, condition })
    }

    /// The last walk: how good the fit is, and what each reading did.
    fn tell<B: Blocks>(
        &self,
        blocks: &mut B,
        (pass, solved, widened): (&Pass, &Solved, Option<&Widened>),
        (fit, whole): (&Fit, &[f64]),
        told: &mut dyn FnMut(&Readings<'_>, &Told),
    ) -> Result<QualitySums, B::Error> {
        let (watched, coefficients) = (Watched::of(fit), fit.coefficients());
        let determined = fit.determined();
        let shrink = shrink(determined, self.known.totals.readings);
        let mut sums = QualitySums::default();
        self.walk(blocks, |block, design| {
            let settled = Settled {
                nuisances: solved.nuisances(coefficients),
                levels: levels(design, coefficients),
                determined,
                ..self.known.settled(block, design, Some(pass))?
            };
            sums.take(design, &settled, block.limits, self.known.model);
            let by = (self.known.model, shrink);
            let weighed = weighed_by(block, &settled, Vec::new(), by);
            let mut influence = Influence::of(design, &settled, solved, whole, watched.clone());
            if let Some(widened) = widened {
                let by = widened.variances(&settled.variances, &settled.stated, &weighed);
                influence = influence.under(by, design, &widened.factor);
            }
            told(block, &Told { weighed, influence, levels: settled.levels });
            Ok(())
        })?;
        Ok(sums)
    }

    /// What no longer counts may have been all that was known of a coefficient.
    fn demand_rank(&self, solved: &Solved) -> Result<(), FitError> {
        if !self.prior.is_none() {
            return Ok(());
        }
        let spectrum = solved.field.spectrum().ok_or(FitError::OutOfRange)?;
        if spectrum.rank() == self.basis.len() {
            return Ok(());
        }
        Err(by_functions(&spectrum, |k| self.basis.name(k)))
    }
}

impl Shared {
    fn of(block: &Readings<'_>) -> Self {
        let common = block.common.iter().filter(|common| common.shift.is_shared());
        Self {
            common: common.map(lasting).collect(),
            nuisances: block.nuisances.iter().map(lasting).collect(),
            has_jitter: block.common.iter().any(|common| !common.shift.is_shared()),
            holds_constant: true,
        }
    }

    /// Those whose effect has to go through the factorisation.
    pub(super) fn shifting<'c>(&self, common: &'c [Common]) -> Vec<&'c Common> {
        common.iter().filter(|common| needs_a_side(common, self.holds_constant)).collect()
    }

    /// A block whose components are other ones is no block of these readings.
    pub(super) fn demand(&self, block: &Readings<'_>) -> Result<(), FitError> {
        let shared = block.common.iter().filter(|common| common.shift.is_shared());
        demand_same("common components of a block", &self.common, shared)?;
        demand_same("nuisances of a block", &self.nuisances, block.nuisances.iter())
    }
}

fn demand_same<'c>(
    what: &'static str,
    own: &[Common],
    found: impl Iterator<Item = &'c Common>,
) -> Result<(), FitError> {
    let found: Vec<&str> = found.map(|common| common.name.as_str()).collect();
    let same = own.iter().zip(&found).filter(|(own, found)| own.name == **found).count();
    if same == own.len() && same == found.len() {
        return Ok(());
    }
    Err(FitError::Parts { what, expected: own.len(), found: same })
}

/// What of a component outlasts its block: all but what it does to single readings.
fn lasting(common: &Common) -> Common {
    let shift = match common.shift {
        Shift::Scale => Shift::Scale,
        Shift::Offset => Shift::Offset,
        _ => Shift::Value(Box::new(|_, _| 0.0)),
    };
    Common { name: common.name.clone(), u: common.u, shift }
}

/// A block of limits alone is none that a fit refuses: there are others.
pub(super) fn check_block(block: &Readings<'_>) -> Result<(), FitError> {
    if let Some(wrong) = block.common.iter().find(|c| !(c.u.is_finite() && c.u >= 0.0)) {
        return Err(FitError::Common { name: wrong.name.clone() });
    }
    match check_readings(block) {
        Err(FitError::OnlyLimits { .. }) => Ok(()),
        other => other,
    }
}
