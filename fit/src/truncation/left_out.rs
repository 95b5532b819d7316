//! Readings of each direction as all others foretell them: how far they lie off without having had a say
//! themselves. It does not know what follows from that.

use super::wider::Noise;
use crate::basis::dot;
use faer::Mat;
use glam::DVec3;

/// Readings of one direction together.
#[derive(Debug, Clone, Copy)]
pub(super) struct Group {
    pub(super) count: f64,
    /// Sums of their variances: as the fit took them, and what of that is stated.
    pub(super) found: f64,
    pub(super) stated: f64,
    /// What they lie off the likeliest model on average.
    pub(super) residual: f64,
    pub(super) towards: DVec3,
}

impl Group {
    /// The sum of their weights in the fit.
    pub(super) fn weight(&self) -> f64 {
        self.count * self.count / self.found
    }

    /// The variance of their mean as the likeliest model has it.
    fn variance(&self, noise: Noise) -> f64 {
        let of = if noise.is_stated { self.stated } else { self.found };
        noise.scale * of / (self.count * self.count)
    }
}

/// All of them.
#[derive(Debug)]
pub(super) struct LeftOut {
    pub(super) groups: Vec<Group>,
    /// The mean row of each group over the fit's functions, what samples share, and the finer ones; one a
    /// column.
    pub(super) rows: Mat<f64>,
    /// What of each group's mean the model leaves open: a residual over this is what the others miss it by.
    parts: Vec<f64>,
    noise: Noise,
}

impl LeftOut {
    /// `factor` is S of the unknowns' covariance.
    pub(super) fn of(groups: Vec<Group>, rows: Mat<f64>, factor: &Mat<f64>, noise: Noise) -> Self {
        let mut parts = Vec::with_capacity(groups.len());
        for (k, some) in groups.chunks(ROWS).enumerate() {
            let fitted = factor.transpose() * rows.as_ref().subcols(k * ROWS, some.len());
            parts.extend(some.iter().enumerate().map(|(j, group)| {
                let known = fitted.col_as_slice(j);
                (1.0 - dot(known, known) / group.variance(noise)).max(PART_LEAST)
            }));
        }
        Self { groups, rows, parts, noise }
    }

    /// What all other directions miss each by, and what the square of that holds of the variance of its mean. Of
    /// what they hardly know they miss more than what lies between: for [`PART_KNOWN`] at most.
    pub(super) fn missed(&self) -> impl Iterator<Item = (f64, f64)> {
        self.groups.iter().zip(&self.parts).map(|(group, part)| {
            let known = part.max(PART_KNOWN);
            (group.residual / known, part / (known * known))
        })
    }

    /// The variance of a group's mean by noise: as stated, or as the likeliest model has it.
    pub(super) fn noise_variance(&self, group: &Group, is_unknown: bool) -> f64 {
        let stated = Noise { is_stated: true, scale: 1.0 };
        group.variance(if is_unknown { self.noise } else { stated })
    }

    /// The square of what others miss each by over what the model expects of that.
    pub(super) fn ratios(&self) -> impl Iterator<Item = (DVec3, f64)> {
        self.groups.iter().zip(&self.parts).map(|(group, part)| {
            let ratio = group.residual * group.residual / (group.variance(self.noise) * part);
            (group.towards.normalize_or(DVec3::Z), ratio)
        })
    }
}

/// Where others leave less than this part of a residual, a reading is extrapolated from afar.
const PART_KNOWN: f64 = 0.25;
/// Of readings that nothing else says anything of not less than this part is left.
const PART_LEAST: f64 = 1e-6;
/// Rows at a time.
const ROWS: usize = 256;
