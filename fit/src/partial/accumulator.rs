//! A share of readings that come one block after the other, each forgotten once it is taken in. It knows no
//! common components: of what all readings of a CSV share nothing is stated.

use super::{Partial, PartialError, Sums, Weighting, basis_over};
use crate::beam::Optics;
use crate::beam::design::Design;
use crate::check::check_sample;
use crate::triangle::Triangle;
use crate::truncation::{Heard, Remembered};
use crate::whereabouts::Whereabouts;
use crate::{FitError, Noise, Penalised, Region, Sample, Weighed};

/// Takes readings in, in blocks of any size, and forgets them.
#[derive(Debug)]
pub struct Accumulator {
    partial: Partial,
    optics: Option<Optics>,
}

impl Accumulator {
    /// Nothing yet, of a field over a region in a basis.
    pub fn new(
        region: Region,
        model: impl Into<Penalised>,
        optics: Option<Optics>,
        weighting: Weighting,
    ) -> Result<Self, FitError> {
        let Penalised { basis, penalty, .. } = model.into();
        let basis = basis_over(basis, penalty, region)?;
        let triangle = Triangle::new(basis.len(), 1);
        let (common, sums, whereabouts) = (Vec::new(), Sums::NONE, Whereabouts::new(&region));
        let finer = None;
        let partial =
            Partial { basis, penalty, weighting, common, sums, triangle, whereabouts, finer };
        Ok(Self { partial, optics })
    }

    /// The same that keeps what readings say of finer functions, too, so that the u of the fit holds what its
    /// own can't follow, as by [`Fit::with_truncation`](crate::Fit::with_truncation). Rows are then up to 480 numbers longer. Where that
    /// looks for no finer functions, nothing is kept.
    ///
    /// # Panics
    /// When a reading was taken in before.
    pub fn with_truncation(mut self) -> Result<Self, FitError> {
        assert_eq!(self.partial.readings(), 0, "asked for before the first reading");
        self.partial.finer = Remembered::new(&self.partial.basis, Vec::new())?;
        Ok(self)
    }

    /// Takes a block in. An error leaves everything as it was before the block. Where there is a
    /// beam, the rows are as exact as a fit of ten million readings needs them.
    pub fn absorb(&mut self, samples: &[Sample]) -> Result<(), PartialError> {
        let Partial { basis, weighting, sums, triangle, whereabouts, finer, .. } =
            &mut self.partial;
        for (index, sample) in samples.iter().enumerate() {
            check_sample(index, sample, basis.region())?;
            if *weighting == Weighting::Stated && !matches!(sample.noise, Noise::Fixed { .. }) {
                return Err(PartialError::Noise { index });
            }
        }
        let optics = self.optics.as_ref();
        let design = Design::of_a_share(samples, basis, optics, READINGS_FORESEEN)?;
        let variance = |sample: &Sample| match sample.noise {
            Noise::Fixed { variance } if *weighting == Weighting::Stated => variance,
            _ => 1.0,
        };
        let variances: Vec<f64> = samples.iter().map(variance).collect();
        if let Some(finer) = finer {
            let beyond = finer.beyond();
            let beyond = Design::of_a_share(samples, &beyond, optics, READINGS_FORESEEN)?;
            let values: Vec<f64> = samples.iter().map(|sample| sample.value).collect();
            let weighed = Weighed::alike(samples.len());
            let (variances, stated) = (&variances, &variances);
            let (own, sides) = (&design, Vec::new());
            finer.take(&Heard {
                own,
                beyond,
                values: &values,
                variances,
                stated,
                weighed: &weighed,
                sides,
            })?;
        }
        let mut room = design.room();
        let mut row = vec![0.0; basis.len() + 1];
        for (i, (sample, variance)) in samples.iter().zip(variances).enumerate() {
            design.row(i, &mut room, &mut row[..basis.len()]);
            row[basis.len()] = sample.value;
            let weight = 1.0 / variance.sqrt();
            for value in &mut row {
                *value *= weight;
            }
            triangle.absorb(&row);
            sums.note(sample.value, variance);
        }
        whereabouts.take(samples);
        Ok(())
    }

    /// Ends the share.
    pub fn finish(self) -> Partial {
        self.partial
    }
}

/// How many readings the rows of a beam are made exact for.
const READINGS_FORESEEN: usize = 10_000_000;
