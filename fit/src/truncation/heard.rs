//! Readings as the wider model hears them: all at once, or block by block, as often as it needs. It
//! knows no functions of its own.

use crate::beam::design::{Design, Room};
use crate::{FitError, Ray, Robust, Weighed};
use glam::DVec3;

/// Readings, or a block of them: as the fit took them, and the rows of finer functions.
pub(crate) struct Heard<'s> {
    pub(crate) own: &'s Design<'s>,
    pub(crate) beyond: Design<'s>,
    /// What the samples count as having read.
    pub(crate) values: &'s [f64],
    /// What each was taken to scatter by, and what of it is stated.
    pub(crate) variances: &'s [f64],
    pub(crate) stated: &'s [f64],
    pub(crate) weighed: &'s Weighed,
    /// The change of every value by one u of what samples share.
    pub(crate) sides: Vec<Vec<f64>>,
}

/// Readings that can be walked through again and again, the same each time.
pub(crate) trait Walks {
    type Error: From<FitError>;

    fn each(
        &mut self,
        take: &mut dyn FnMut(&Heard<'_>) -> Result<(), FitError>,
    ) -> Result<(), Self::Error>;
}

/// All readings as one block.
pub(super) struct Once<'a, 's>(pub(super) &'a Heard<'s>);

impl Walks for Once<'_, '_> {
    type Error = FitError;

    fn each(
        &mut self,
        take: &mut dyn FnMut(&Heard<'_>) -> Result<(), FitError>,
    ) -> Result<(), FitError> {
        take(self.0)
    }
}

/// What a fit took all readings together for.
#[derive(Debug)]
pub(crate) struct Taken {
    /// How many were fitted along.
    pub(crate) nuisances: usize,
    /// Whether an offset is a constant field.
    pub(crate) holds_constant: bool,
    pub(crate) has_unknown: bool,
    /// The variance beyond what is stated.
    pub(crate) excess: f64,
    pub(crate) robust: Robust,
}

/// Of the fit's functions, of the finer ones, and a row of these.
pub(super) type Rooms = (Room, Room, Vec<f64>);

impl Heard<'_> {
    /// A reading's variance, or what of it is stated; infinite of outliers: by their residuals they
    /// would be taken for what the functions can't follow, since Huber's weight leaves the more of
    /// their squares the larger they are.
    pub(super) fn variance(&self, i: usize, is_stated: bool) -> f64 {
        let variances = if is_stated { self.stated } else { self.variances };
        if self.weighed.is_outlier(i) { f64::INFINITY } else { variances[i] }
    }

    /// Whether a reading says what it read.
    pub(super) fn is_plain(&self, i: usize) -> bool {
        self.variance(i, false).is_finite() && self.weighed.limits.binary_search(&i).is_err()
    }

    /// What rows are made in.
    pub(super) fn rooms(&self) -> Rooms {
        (self.own.room(), self.beyond.room(), vec![0.0; self.beyond.basis().len()])
    }

    /// A reading's row over the fit's functions, what samples share, and the `kept` finer functions.
    pub(super) fn row(
        &self,
        i: usize,
        kept: &[usize],
        (own_room, room, all): &mut Rooms,
        row: &mut [f64],
    ) {
        let (own, others) = row.split_at_mut(self.own.basis().len());
        let (sides, finer) = others.split_at_mut(self.sides.len());
        self.own.row(i, own_room, own);
        self.beyond.row(i, room, all);
        sides.iter_mut().zip(&self.sides).for_each(|(out, side)| *out = side[i]);
        finer.iter_mut().zip(kept).for_each(|(out, k)| *out = all[*k]);
    }

    /// Where a reading lies.
    pub(super) fn towards(&self, i: usize) -> DVec3 {
        let Ray { theta_rad, phi_rad, .. } = self.own.samples()[i].ray;
        direction(theta_rad, phi_rad)
    }
}

/// The unit vector of a direction.
pub(super) fn direction(theta_rad: f64, phi_rad: f64) -> DVec3 {
    let (sin, cos) = (libm::sin(theta_rad), libm::cos(theta_rad));
    DVec3::new(sin * libm::cos(phi_rad), sin * libm::sin(phi_rad), cos)
}
