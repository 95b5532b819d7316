//! Fits of readings that come in blocks, again and again, rather than all at once: memory is that of the
//! coefficients' triangle and of a block. Knows no file: [`Blocks`] is whatever can hand its readings over
//! once more.
//!
//! A walk is one look at all blocks. What it leaves behind is a field, the nuisances and the scatter beyond
//! the stated noise; from these the next walk makes each reading's weight anew: outliers', limits', and of
//! noise that goes with the level. Each pass of a fit in memory is two walks, one for the scatter and one for
//! the rows, with the same functions; so both come to the same field. They differ by rounding, by the
//! sums that stand for single residuals where there is scatter beyond the stated noise, and over a
//! beam by the rule that averages a row, which goes with the block's readings (a tenth of u at most).
//!
//! ```
//! use fit::blocks::{self, Asked, Blocks, Totals};
//! use fit::{BasisSpec, FitError, Noise, Ray, Readings, Region, Robust, Sample};
//!
//! /// Readings of 100, every hundredth twice as large, never all of them there.
//! struct Source;
//!
//! impl Blocks for Source {
//!     type Error = FitError;
//!
//!     fn each(
//!         &mut self,
//!         take: &mut dyn FnMut(&Readings<'_>) -> Result<(), FitError>,
//!     ) -> Result<(), FitError> {
//!         let sample = |i: u32| Sample {
//!             ray: Ray { x_m: 0.0, y_m: 0.0, theta_rad: f64::from(i % 8) * 0.2, phi_rad: 0.1 },
//!             value: if i % 100 == 0 { 200.0 } else { 99.5 + f64::from(i % 3) * 0.5 },
//!             noise: Noise::Fixed { variance: 0.25 },
//!         };
//!         for from in (0..100_000_u32).step_by(10_000) {
//!             let samples: Vec<Sample> = (from..from + 10_000).map(sample).collect();
//!             take(&Readings::of(&samples))?;
//!         }
//!         Ok(())
//!     }
//! }
//!
//! let mut totals = Totals::default();
//! Source.each(&mut |block| {
//!     totals.take(block);
//!     Ok(())
//! })?;
//! let asked = Asked {
//!     region: Region::surface((0.0, 0.0), (0.0, 0.0), 1.4),
//!     model: BasisSpec::zernike(0, 0).into(),
//!     robust: Robust::Tukey,
//!     optics: None,
//!     with_truncation: true,
//!     others: &[],
//! };
//! let field = blocks::fit(&mut Source, &totals, &asked, &mut |_, _| {})?.fit;
//! let ray = Ray { x_m: 0.0, y_m: 0.0, theta_rad: 0.3, phi_rad: 0.0 };
//! assert!((field.value(&ray) - 100.0).abs() < 0.01);
//! assert_eq!(field.n_used(), 99_000);
//! # Ok::<(), FitError>(())
//! ```

pub use fitting::fit;
pub use live::Live;
pub use sharing::share;

use crate::{
    Fit, FitError, FittedNuisance, Influence, Noise, Optics, Penalised, Readings, Region, Resolves,
    Robust, Weighed,
};

mod doubting;
mod fitting;
mod live;
mod passing;
mod sharing;
mod sketch;
#[cfg(test)]
mod tests;
mod widening;

/// Readings that can be walked through again and again.
pub trait Blocks {
    /// Why they could not be had, or not be fitted.
    type Error: From<FitError>;

    /// Hands all of them over, block by block, the same each time; some may hold none. Of every block the common components
    /// and the nuisances are the same ones, in the same order; indices are the block's own, those of an
    /// error too. How outliers are weighed [`Asked`] says.
    fn each(
        &mut self,
        take: &mut dyn FnMut(&Readings<'_>) -> Result<(), FitError>,
    ) -> Result<(), Self::Error>;
}

/// What has to be known of all readings before any of them is fitted: by a first look at them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Totals {
    readings: usize,
    limits: usize,
    values: f64,
    squares: f64,
    has_unknown: bool,
    has_modelled: bool,
}

impl Totals {
    /// Takes a block in.
    pub fn take(&mut self, block: &Readings<'_>) {
        self.readings += block.samples.len();
        self.limits += block.limits.len();
        for sample in block.samples {
            self.values += sample.value;
            self.squares += sample.value * sample.value;
            self.has_unknown |= sample.noise == Noise::Unknown;
            self.has_modelled |= matches!(sample.noise, Noise::Modelled { .. });
        }
    }

    /// The same of readings whose noise was not known at the first look, and is now.
    #[must_use]
    pub fn known(self) -> Self {
        Self { has_unknown: false, ..self }
    }

    /// How many readings there are.
    pub fn readings(&self) -> usize {
        self.readings
    }
}

/// What is to be fitted.
#[derive(Debug, Clone, Copy)]
pub struct Asked<'a> {
    /// What the field stands for.
    pub region: Region,
    /// Which functions, and what is held against them.
    pub model: Penalised,
    /// How outliers are weighed.
    pub robust: Robust,
    /// The detector's beam, where it is known.
    pub optics: Option<&'a Optics>,
    /// Whether u holds what the functions can't follow, as by [`Fit::with_truncation`]: one or two more
    /// walks, with rows that are two to five times as wide.
    pub with_truncation: bool,
    /// Functions that do about as well as the model ([`Choice::chosen`](crate::Choice::chosen)): what they make of directions where
    /// nothing was measured is in u, too. Each takes as many walks as a fit's field.
    pub others: &'a [Penalised],
}

/// A fit of readings that are forgotten.
#[derive(Debug, Clone)]
pub struct Blockwise {
    /// The field. It does not know what single readings did ([`Fit::weighed`], [`Fit::influence`]).
    pub fit: Fit,
    /// What was fitted along.
    pub nuisances: Vec<FittedNuisance>,
    /// The narrowest feature that can be seen.
    pub resolves: Resolves,
}

/// What became of a block's readings, of each in its order.
#[derive(Debug)]
pub struct Told {
    /// Weights and residuals; what was fitted along is said with the fit.
    pub weighed: Weighed,
    /// What they did to some quantities.
    pub influence: Influence,
    /// What the field gives each reading.
    pub levels: Vec<f64>,
}
