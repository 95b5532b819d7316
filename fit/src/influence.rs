//! How much each sample weighs in the exitance, so that the independent part of its uncertainty can
//! be told apart by what each sample's variance consists of. Knows no source of noise by name.

use crate::basis::dot;
use crate::beam::design::Design;
use crate::nuisance::Solved;
use crate::weights::Settled;

/// What each sample did to the exitance. Lives as long as the fit that made it; it is not stored.
#[derive(Debug, Clone, PartialEq)]
pub struct Influence {
    /// One a sample, in the order handed in: by how much the exitance grows with its value, sr. The
    /// squares times the samples' variances add to the independent variance, less what a penalty
    /// holds of it.
    pub exitance: Vec<f64>,
    /// One a sample: the part of its variance that comes from rays off the one that was meant
    /// ([`crate::Shift::Jitter`]), in the values' unit squared.
    pub moved: Vec<f64>,
    /// The part of every sample's variance that nothing explains: see
    /// [`crate::Quality::excess_rms`], squared.
    pub excess: f64,
    /// One a sample: its variance as the covariance takes it, in the values' unit squared.
    pub variances: Vec<f64>,
    /// The part of it that is stated.
    pub(crate) stated: Vec<f64>,
    /// What the samples count as having read.
    pub(crate) values: Vec<f64>,
    /// What one u of each nuisance does to them.
    pub(crate) columns: Vec<Vec<f64>>,
}

impl Influence {
    /// `factor` is the packed S of the covariance S Sᵀ: the gradient of f·c is W A S Sᵀ f,
    /// the rows A being those of the field and, where there are such, of the nuisances.
    pub(crate) fn of(
        design: &Design<'_>,
        settled: &Settled,
        solved: &Solved,
        factor: &[f64],
    ) -> Self {
        let carried = carried(design, factor);
        let nuisances = solved.carried(&carried);
        let mut room = design.room();
        let along = |i: usize| {
            let columns = settled.columns.iter().zip(&nuisances);
            columns.map(|(column, carried)| column[i] * carried).sum::<f64>()
        };
        let exitance = settled
            .variances
            .iter()
            .enumerate()
            .map(|(i, variance)| (design.level(i, &carried, &mut room) + along(i)) / variance)
            .collect();
        let excess = settled.excess;
        let stated = settled.variances.iter().zip(&settled.weights);
        Self {
            exitance,
            moved: settled.moved.clone(),
            excess,
            variances: settled.variances.clone(),
            stated: stated.map(|(variance, weight)| variance - excess / weight).collect(),
            values: settled.values.clone(),
            columns: settled.columns.clone(),
        }
    }

    /// Of the same samples under other variances.
    pub(crate) fn under(&self, variances: Vec<f64>, design: &Design<'_>, factor: &[f64]) -> Self {
        let carried = carried(design, factor);
        let mut room = design.room();
        let along = variances.iter().enumerate();
        let exitance =
            along.map(|(i, variance)| design.level(i, &carried, &mut room) / variance).collect();
        Self { exitance, variances, ..self.clone() }
    }
}

/// S Sᵀ f of the exitance.
fn carried(design: &Design<'_>, factor: &[f64]) -> Vec<f64> {
    let functional = design.basis().exitance();
    let p = functional.len();
    let column = |j: usize| &factor[j * (j + 1) / 2..][..=j];
    let mut carried = vec![0.0; p];
    for j in 0..p {
        let product = dot(column(j), &functional[..=j]);
        for (out, s) in carried.iter_mut().zip(column(j)) {
            *out += product * s;
        }
    }
    carried
}
