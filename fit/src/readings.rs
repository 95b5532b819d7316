//! What is known of a set of readings beyond their values, and how they shall be weighed: handed to a
//! fit as a whole.

use crate::{Common, Ray, Robust, Sample};

/// Readings as a fit takes them. What is left out (`..Readings::of(samples)`) asks for nothing.
#[derive(Debug, Clone, Copy)]
pub struct Readings<'s> {
    /// The readings.
    pub samples: &'s [Sample],
    /// Of readings taken in flight, sample by sample, the rays at their beginning and end, and
    /// `None` of one at rest; samples beyond its end are at rest. The sample's own ray is that of the
    /// middle. What a reading in flight says is the field's mean over its way, but for beams that
    /// the sample's outline cuts: those count as at rest.
    pub flown: &'s [Option<(Ray, Ray)>],
    /// Which samples are lower limits, rising: saturated ones, which say "at least this much". A limit
    /// that the field exceeds anyway says nothing; one that it does not holds it up.
    pub limits: &'s [usize],
    /// What the samples share: carried through the fit, not fitted.
    pub common: &'s [Common],
    /// What they share and tell themselves: each is a coefficient more, in units of its u, whose
    /// prior is 0 ± 1. What the samples leave of its uncertainty is carried on as that of a common
    /// component of its name. [`Shift::Jitter`](crate::Shift::Jitter) can't be one.
    pub nuisances: &'s [Common],
    /// How outliers are weighed.
    pub robust: Robust,
}

impl<'s> Readings<'s> {
    /// Samples at rest, each as good as its noise says.
    pub const fn of(samples: &'s [Sample]) -> Self {
        Self { samples, flown: &[], limits: &[], common: &[], nuisances: &[], robust: Robust::None }
    }
}

/// What the fit made of each sample. Lives as long as the fit that made it; it is not stored.
#[derive(Debug, Clone, PartialEq)]
pub struct Weighed {
    /// How outliers were weighed.
    pub robust: Robust,
    /// One a sample, what the reweighing left of its weight, 0 to 1; of a limit, the part of a
    /// reading's information that it holds at the fitted level.
    pub weights: Vec<f64>,
    /// One a sample, (value - fitted)/u, u being that of a residual. Of readings that were not
    /// reweighed too: one of many far beyond 5 is a disturbance, or the basis is too coarse there.
    pub residuals: Vec<f64>,
    /// The samples that are limits, rising.
    pub limits: Vec<usize>,
    /// What was fitted along.
    pub nuisances: Vec<Fitted>,
}

impl Weighed {
    /// Of so many samples that all say what they read.
    pub(crate) fn alike(samples: usize) -> Self {
        Self {
            robust: Robust::None,
            weights: vec![1.0; samples],
            residuals: Vec::new(),
            limits: Vec::new(),
            nuisances: Vec::new(),
        }
    }

    /// Whether a sample lost nearly all of its weight for its residual: it has no say in what
    /// functions the others ask for.
    pub(crate) fn is_outlier(&self, sample: usize) -> bool {
        self.weights[sample] < OUTLYING && self.limits.binary_search(&sample).is_err()
    }
}

/// A sample with less of its weight left is an outlier.
const OUTLYING: f64 = 0.1;

/// A nuisance as it came out.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    /// The component.
    pub name: String,
    /// By how many of its prior u it is off.
    pub value: f64,
    /// The standard uncertainty that is left, in prior u; 1 where the samples say nothing.
    pub u: f64,
}
