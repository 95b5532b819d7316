//! What a fit's functions can't follow, in the u of everything that follows from the fit.
//!
//! Beside the reported fit stands a wider model of the same readings: the fit's functions, as free as
//! they are in the fit, and harmonics on the sphere beyond them, held by a prior in which one of degree
//! n has the variance (1 + n)^(-2 power)/λ: a field that varies as much everywhere. Power and λ are those
//! under which the readings are likeliest (restricted maximum likelihood, as for [`crate::choose`]); what
//! a smoother and a rougher prior say is mixed, as far as the readings bear each out, since between
//! readings and beyond them they differ by far more than what tells them apart. The same prior then holds the fit's own polynomials too where the fit itself holds nothing against them:
//! free, they would run away where nothing was measured. Given the readings, the field is then
//! normal about the wider model's mean with its covariance Σ, and the reported fit lies off that mean
//! by a known field. A linear functional f of the reported fit has the mean square error
//!
//! ```text
//! (f(fit) - f(wider))² + f Σ fᵀ
//! ```
//!
//! Σ = S Sᵀ with S upper triangular, the fit's own functions first: its first columns are what noise
//! does to the fit, the others are fields that the fit misses. These and the difference of the two
//! fits are the *missed fields*, one u of an independent component each. Along a ray they count for more
//! where the readings around it are foretold worse by all the others than the model expects: see [`Uneven`].
//!
//! What all these functions don't foretell of a reading from the others is missed, too, by what lies between readings:
//! changes of the fit's own coefficients, among the missed fields.
//!
//! Where finer functions make the readings no likelier there is no truncation to speak of, and the
//! fit stays as it is. What is finer than all readings nothing here can know.

mod between;
mod heard;
mod left_out;
mod likeliest;
mod look;
mod remembered;
mod uneven;
mod wider;

use crate::beam::Optics;
use crate::beam::design::Design;
use crate::grid::Grid;
use crate::influence::Influence;
use crate::solve::{levels, needs_a_side, sensitivities};
use crate::weights::{Settled, has_unknown};
use crate::{Angular, BasisSpec, Common, Fit, FitError, Position, Ray, Region, Sample};
use heard::Once;
pub(crate) use heard::{Heard, Taken, Walks};
pub(crate) use remembered::Remembered;
pub use uneven::Uneven;
pub(crate) use wider::{Widened, Wider};

/// What a fit misses.
#[derive(Debug, Clone, PartialEq)]
pub struct Truncation {
    /// The finer functions.
    pub beyond: BasisSpec,
    /// One u of an independent component each: numbers over the fit's functions, then over the finer
    /// ones. The field that they make is what the reported fit may be off by.
    pub missed: Vec<Vec<f64>>,
    /// How much likelier the readings are with the finer functions: twice the logarithm of the ratio
    /// of marginal likelihoods.
    pub gain: f64,
    /// Where more is missed than elsewhere: in the u of what is along one direction alone. Over sums
    /// it averages out.
    pub uneven: Uneven,
}

impl Fit {
    /// The fit with what its functions can't follow in every u. To be called with what
    /// [`fit_flown`](crate::fit_flown) made the fit of. A fit that nothing finer makes likelier is
    /// left without [`Parts::truncation`](crate::Parts::truncation); one that was stored and taken up again stays as it is, as
    /// does one in a chart other than the surface one, and one so fine that what is finer has more
    /// than 480 functions even where it is the same in all places: from degree 119 on.
    /// Costs one or two passes of a design that is two to five times as wide as the fit's.
    pub fn with_truncation(
        self,
        samples: &[Sample],
        flown: &[Option<(Ray, Ray)>],
        common: &[Common],
        optics: Option<&Optics>,
    ) -> Result<Self, FitError> {
        let (Some(influence), Some(weighed)) = (self.influence(), self.weighed()) else {
            return Ok(self);
        };
        let grid = Grid::of(samples, self.region());
        let places = grid.x_m.len().max(grid.y_m.len());
        let Some(finer) = Finer::of(self.basis(), self.region(), places) else { return Ok(self) };
        if influence.variances.len() != samples.len() {
            return Ok(self);
        }
        let own = Design::new(samples, self.functions(), optics)?.in_flight(flown);
        let known = Taken {
            nuisances: influence.columns.len(),
            holds_constant: own.holds_constant(),
            has_unknown: has_unknown(samples),
            excess: influence.excess,
            robust: weighed.robust,
        };
        let wider = Wider::new(&self, finer, &known, common)?;
        let beyond = Design::new(samples, wider.beyond(), optics)?.in_flight(flown);
        let (variances, stated) = (&influence.variances, &influence.stated);
        let heard = Heard {
            sides: wider.kept_sides(influence)?,
            own: &own,
            beyond,
            values: &influence.values,
            weighed,
            variances,
            stated,
        };
        let Some(widened) = wider.widened(&mut Once(&heard))? else { return Ok(self) };
        let variances = widened.variances(variances, stated, weighed);
        let influence = influence.under(variances, &own, &widened.factor);
        let fit = Fit::from_parts(widened.parts).map_err(|_| FitError::OutOfRange)?;
        let (measured, weighed) = (self.measured().cloned(), weighed.clone());
        Ok(fit.with_measured(measured).with_weighed(weighed).with_influence(influence))
    }
}

/// What samples share, as far as it shows in the residuals: what it explains is neither noise nor
/// truncation.
#[derive(Debug)]
struct Shared {
    /// Of those that were not fitted along.
    names: Vec<String>,
    /// The fit's shift by one u of each component, of those that were fitted along first.
    shifts: Vec<Vec<f64>>,
}

impl Shared {
    fn of(fit: &Fit, known: &Taken, common: &[Common]) -> Self {
        // What was fitted along, the fit is already corrected for.
        let none = vec![0.0; fit.functions().len()];
        let mut shared = Self { names: Vec::new(), shifts: vec![none; known.nuisances] };
        for common in common.iter().filter(|c| shows(c, known.holds_constant)) {
            // One that changes no reading changes no coefficient.
            let shift = shift_of(fit, &common.name);
            if let Some(shift) = shift.filter(|shift| shift.iter().any(|value| *value != 0.0)) {
                shared.names.push(common.name.clone());
                shared.shifts.push(shift.to_vec());
            }
        }
        shared
    }

    /// Of components that are known by their names alone.
    fn named(fit: &Fit, names: &[String]) -> Self {
        let none = || vec![0.0; fit.functions().len()];
        let shift = |name: &String| shift_of(fit, name).map_or_else(none, <[f64]>::to_vec);
        Self { names: names.to_vec(), shifts: names.iter().map(shift).collect() }
    }

    /// The change of every value by one u of each, as the fit found it.
    fn kept_sides(&self, influence: &Influence) -> Result<Vec<Vec<f64>>, FitError> {
        let named = |name: &String| {
            let side = influence.sides.iter().find(|(own, _)| own == name);
            side.map(|(_, side)| side.clone()).ok_or(FitError::Common { name: name.clone() })
        };
        influence.columns.iter().cloned().map(Ok).chain(self.names.iter().map(named)).collect()
    }

    /// The same of some samples; `columns` are those of what was fitted along.
    fn sides(
        &self,
        fit: &Fit,
        own: &Design<'_>,
        columns: &[Vec<f64>],
        common: &[Common],
    ) -> Result<Vec<Vec<f64>>, FitError> {
        let coefficients = fit.coefficients().to_vec();
        let levels = levels(own, &coefficients);
        let settled = Settled::known(coefficients, levels, Vec::new(), Vec::new());
        let named = |name: &String| common.iter().find(|common| common.name == *name);
        let common: Vec<&Common> = self.names.iter().filter_map(named).collect();
        let sides = sensitivities(own, &settled, &common)?;
        Ok(columns.iter().cloned().chain(sides).collect())
    }
}

/// Whether a component shows in residuals: one that all samples share, and that the fit's functions can't do.
pub(crate) fn shows(common: &Common, holds_constant: bool) -> bool {
    common.shift.is_shared() && needs_a_side(common, holds_constant)
}

fn shift_of<'f>(fit: &'f Fit, name: &str) -> Option<&'f [f64]> {
    let found = fit.parts().shifts.iter().find(|shift| shift.name == name)?;
    Some(&found.shift)
}

/// What follows what a fit's own functions can't.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Finer {
    /// Harmonics on the sphere: under their prior a field that varies as much everywhere.
    spec: BasisSpec,
    /// Those that the fit doesn't have itself.
    kept: Vec<usize>,
    /// Those that are the same fields as the fit's polynomials on the disk; none of other functions.
    polynomials: Vec<usize>,
}

impl Finer {
    /// Of a degree beyond the fit's own, and where places tell more of the position. Where they would be
    /// too many, finer ones of the direction matter more: as fine in position as leaves room for two
    /// degrees more in direction. Where even the same everywhere they are too many, those of the fit's
    /// own degrees are left out; `None` where they still are, see [`Fit::with_truncation`].
    /// `places`: distinct positions along the axis that has more of them.
    pub(crate) fn of(own: BasisSpec, region: &Region, places: usize) -> Option<Self> {
        let degree = match own.angular {
            Angular::Zernike { degree, .. }
            | Angular::EvenHarmonics { degree }
            | Angular::Hemispherical { degree } => degree,
            Angular::Spherical { degree } if !region.chart.is_whole_sphere() => degree,
            Angular::Splines { .. } => OF_SPLINES,
            Angular::Spherical { .. } | Angular::SecondPlane { .. } => return None,
        };
        let most = most_of_position(own, places);
        let all = (0..=most).rev().map(|position| (position, 0)).chain([(0, degree + 1)]);
        let tried = all.flat_map(|(position, least)| {
            let degrees = (degree + 2..=degree + DEGREES).rev();
            degrees.map(move |degree| (degree, position, least))
        });
        tried
            .map(|(degree, position, least)| {
                let angular = Angular::Spherical { degree };
                (BasisSpec { angular, position: Position::Legendre { degree: position } }, least)
            })
            .filter(|(spec, _)| spec.checked_len().is_ok())
            .map(|(spec, least)| Self::within(own, spec, least))
            .find(|finer| finer.kept.len() <= FUNCTIONS_MAX)
    }

    /// The same as fine in position alone as so many places tell; which of the kept functions are left.
    fn narrowed(&self, own: BasisSpec, places: usize) -> (Self, Vec<bool>) {
        let most = most_of_position(own, places);
        let degree = self.spec.position.degree().map_or(most, |degree| degree.min(most));
        let position = Position::Legendre { degree };
        let width = self.spec.angular.len();
        let is_left: Vec<bool> = self.kept.iter().map(|k| k / width < position.len()).collect();
        let left = self.kept.iter().zip(&is_left).filter(|(_, is_left)| **is_left);
        let kept = left.map(|(k, _)| *k).collect();
        (Self { spec: BasisSpec { position, ..self.spec }, kept, ..self.clone() }, is_left)
    }

    /// Of harmonics that the fit doesn't have those from a degree on.
    fn within(own: BasisSpec, spec: BasisSpec, least: usize) -> Self {
        let width = spec.angular.len();
        let degree = |k: usize| (k % width).isqrt();
        // l + m is even where a harmonic is a polynomial on the disk.
        let is_even = |k: usize| (k % width - degree(k) * degree(k)).is_multiple_of(2);
        let is_own = |k: &usize| {
            let is_direction = match own.angular {
                Angular::Zernike { degree: own, .. } | Angular::EvenHarmonics { degree: own } => {
                    is_even(*k) && degree(*k) <= own
                }
                Angular::Spherical { degree: own } => degree(*k) <= own,
                _ => false,
            };
            let is_polynomial = matches!(own.position, Position::Legendre { .. });
            is_direction && is_polynomial && k / width < own.position.len()
        };
        let (held, others): (Vec<usize>, Vec<usize>) = (0..spec.len()).partition(is_own);
        let kept = others.into_iter().filter(|k| degree(*k) >= least).collect();
        let is_harmonic = matches!(own.angular, Angular::Spherical { .. });
        Self { spec, kept, polynomials: if is_harmonic { Vec::new() } else { held } }
    }
}

/// The highest degree of position that tells more than the fit's own functions do, of so many distinct places.
fn most_of_position(own: BasisSpec, places: usize) -> usize {
    let position = own.position.degree().unwrap_or(0);
    position.max((position + 1).min(places.saturating_sub(1)))
}

/// Degrees beyond the fit's own at most.
const DEGREES: usize = 8;
/// Of the finer functions beside splines.
const OF_SPLINES: usize = 12;
/// Finer functions at most that the fit doesn't have itself.
const FUNCTIONS_MAX: usize = 480;
