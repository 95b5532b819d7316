//! How much each sample weighs in the exitance, in the radiance along the normal and at the peak, so that
//! the independent part of their uncertainties can be told apart by what each sample's variance consists of. Knows no source of noise by name.

use crate::basis::dot;
use crate::beam::design::Design;
use crate::nuisance::Solved;
use crate::weights::Settled;
use crate::{Chart, Fit, Ray};

/// What each sample did to some quantities. Lives as long as the fit that made it; it is not stored.
#[derive(Debug, Clone, PartialEq)]
pub struct Influence {
    /// One a sample, in the order handed in: by how much the exitance grows with its value, sr. The
    /// squares times the samples' variances add to the independent variance, less what a penalty
    /// holds of it.
    pub exitance: Vec<f64>,
    /// The same of the mean over the region along its normal: of the intensity on axis, over the
    /// region's area. Empty in charts other than the surface one.
    pub normal: Vec<f64>,
    /// The same of the radiance at the peak.
    pub peak: Vec<f64>,
    /// Where the peak was then.
    pub peak_ray: Ray,
    /// One a sample: the part of its variance that comes from rays off the one that was meant
    /// ([`crate::Shift::Jitter`]), in the values' unit squared.
    pub moved: Vec<f64>,
    /// The part of every sample's variance that nothing explains: see
    /// [`crate::Quality::excess_rms`], squared.
    pub excess: f64,
    /// One a sample: its variance as the covariance takes it, in the values' unit squared.
    pub variances: Vec<f64>,
    /// The part of it that is stated; infinite of samples that count for nothing.
    pub(crate) stated: Vec<f64>,
    /// What the samples count as having read.
    pub(crate) values: Vec<f64>,
    /// What one u of each nuisance does to them.
    pub(crate) columns: Vec<Vec<f64>>,
    /// The same of each component that was carried along, by name.
    pub(crate) sides: Vec<(String, Vec<f64>)>,
    watched: Watched,
}

impl Influence {
    /// `factor` is the packed S of the covariance S Sᵀ: the gradient of f·c is W A S Sᵀ f,
    /// the rows A being those of the field and, where there are such, of the nuisances.
    pub(crate) fn of(
        design: &Design<'_>,
        settled: &Settled,
        solved: &Solved,
        factor: &[f64],
        watched: Watched,
    ) -> Self {
        let carried = watched.carried(factor);
        let nuisances = carried.each_ref().map(|carried| solved.carried(carried));
        let along = |k: usize, i: usize| {
            let columns = settled.columns.iter().zip(&nuisances[k]);
            columns.map(|(column, carried)| column[i] * carried).sum::<f64>()
        };
        let [exitance, normal, peak] = grown(design, &settled.variances, &carried, along);
        Self {
            exitance,
            normal,
            peak,
            peak_ray: watched.peak_ray,
            moved: settled.moved.clone(),
            excess: settled.excess,
            variances: settled.variances.clone(),
            stated: settled.stated.clone(),
            values: settled.values.clone(),
            columns: settled.columns.clone(),
            sides: Vec::new(),
            watched,
        }
    }

    /// With what one u of each component that was carried along does to the samples.
    pub(crate) fn with_sides(self, sides: Vec<(String, Vec<f64>)>) -> Self {
        Self { sides, ..self }
    }

    /// Of the same samples under other variances.
    pub(crate) fn under(&self, variances: Vec<f64>, design: &Design<'_>, factor: &[f64]) -> Self {
        let carried = self.watched.carried(factor);
        let [exitance, normal, peak] = grown(design, &variances, &carried, |_, _| 0.0);
        Self { exitance, normal, peak, variances, ..self.clone() }
    }
}

/// The functionals that are told apart: exitance, mean along the normal, radiance at the peak.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Watched {
    rows: [Vec<f64>; 3],
    peak_ray: Ray,
}

impl Watched {
    pub(crate) fn of(fit: &Fit) -> Self {
        let (basis, peak_ray) = (fit.functions(), fit.peak().ray);
        let is_surface = fit.region().chart == Chart::Surface;
        let normal = if is_surface { basis.mean_over_region(0.0, 0.0) } else { Vec::new() };
        let mut peak = vec![0.0; basis.len()];
        basis.row(&peak_ray, &mut basis.scratch(), &mut peak);
        Self { rows: [basis.exitance().to_vec(), normal, peak], peak_ray }
    }

    /// S Sᵀ f of each; nothing of one that there is not.
    fn carried(&self, factor: &[f64]) -> [Vec<f64>; 3] {
        self.rows.each_ref().map(|row| {
            let mut carried = vec![0.0; row.len()];
            for j in 0..row.len() {
                let column = &factor[j * (j + 1) / 2..][..=j];
                let product = dot(column, &row[..=j]);
                for (out, s) in carried.iter_mut().zip(column) {
                    *out += product * s;
                }
            }
            carried
        })
    }
}

/// By how much each grows with each sample's value; every row is made once.
fn grown(
    design: &Design<'_>,
    variances: &[f64],
    carried: &[Vec<f64>; 3],
    along: impl Fn(usize, usize) -> f64,
) -> [Vec<f64>; 3] {
    let mut grown = [const { Vec::new() }; 3];
    let (mut room, mut row) = (design.room(), vec![0.0; design.basis().len()]);
    for (i, variance) in variances.iter().enumerate() {
        design.row(i, &mut room, &mut row);
        for (k, (out, carried)) in grown.iter_mut().zip(carried).enumerate() {
            if !carried.is_empty() {
                out.push((dot(&row, carried) + along(k, i)) / variance);
            }
        }
    }
    grown
}
