//! What is not known of directions where nothing was measured, of a fit whose functions were chosen from
//! the readings.
//!
//! Readings choose functions by what these foretell between readings. Beyond them no reading speaks,
//! and functions that do about as well among readings may go on quite differently: a polynomial of a
//! lamp's wings dips below darkness where splines level off. How far they go apart is then what is known.
//! Each of them is one u of an independent component: the difference of its field from the fit's where
//! nothing was measured, both no darker than darkness, and nothing elsewhere. So is what the fit's own
//! field lies below darkness there: by so much at least it is wrong.
//!
//! Where all of them go on alike it adds nothing. It does not know a kink that lies beyond all
//! readings, nor does it doubt functions that a person pinned.

use crate::basis::{Basis, dot};
use crate::choice::{Candidate, Choice, Chosen};
use crate::derive::Zone;
use crate::field::field_of;
use crate::{Chart, Fit, Optics, Penalised, Ray, Readings};
use std::f64::consts::{FRAC_PI_2, PI};

/// The fields that other functions make of the readings.
#[derive(Debug, Clone)]
pub(crate) struct Extrapolation {
    others: Vec<Other>,
}

/// A field over functions of its own.
#[derive(Debug, Clone)]
struct Other {
    basis: Basis,
    coefficients: Vec<f64>,
}

impl Fit {
    /// The fit with what is not known where nothing was measured in every u, by other functions that
    /// do about as well. To be called with what the fit was made of. Costs a fit without its u for each of them; a
    /// fit whose functions were pinned has none, and stays as it is.
    pub(crate) fn with_extrapolation(
        self,
        others: &[Penalised],
        readings: &Readings<'_>,
        optics: Option<&Optics>,
    ) -> Self {
        if !self.is_doubted_by(others) {
            return self;
        }
        let region = *self.region();
        // One that can't be fitted to all readings says nothing.
        let field = |model: &Penalised| field_of(readings, &region, *model, optics).ok();
        self.doubted_by(others.iter().filter_map(field).collect())
    }

    /// Whether other functions may say anything: directions between two planes fill no cone.
    pub(crate) fn is_doubted_by(&self, others: &[Penalised]) -> bool {
        !(others.is_empty() || matches!(self.region().chart, Chart::TwoPlane { .. }))
    }

    /// The same by other functions' fields of the same readings.
    pub(crate) fn doubted_by(self, fields: Vec<(Basis, Vec<f64>)>) -> Self {
        let other = |(basis, coefficients)| Other { basis, coefficients };
        self.extrapolated(Extrapolation { others: fields.into_iter().map(other).collect() })
    }

    /// What a sum over rays has of each component.
    pub(crate) fn unmeasured_along(&self, rays: &[(Ray, f64)]) -> Vec<f64> {
        let Some(extrapolation) = self.extrapolation() else { return Vec::new() };
        let unmeasured: Vec<&(Ray, f64)> =
            rays.iter().filter(|(ray, _)| !self.is_told(ray.theta_rad, ray.phi_rad)).collect();
        let field = |basis: &Basis, coefficients: &[f64]| -> Vec<f64> {
            let mut scratch = basis.scratch();
            let along = |(ray, _): &&(Ray, f64)| basis.value(coefficients, ray, &mut scratch);
            unmeasured.iter().map(along).collect()
        };
        let weights = unmeasured.iter().map(|(_, weight)| *weight);
        extrapolation.components(self, &weights.collect::<Vec<f64>>(), field)
    }

    /// The same of a sum over directions of the mean over the region: (θ, φ, weight).
    pub(crate) fn unmeasured_towards(&self, directions: &[(f64, f64, f64)]) -> Vec<f64> {
        let Some(extrapolation) = self.extrapolation() else { return Vec::new() };
        let unmeasured: Vec<&(f64, f64, f64)> = directions
            .iter()
            .filter(|(theta_rad, phi_rad, _)| !self.is_told(*theta_rad, *phi_rad))
            .collect();
        let field = |basis: &Basis, coefficients: &[f64]| -> Vec<f64> {
            let towards = |(theta_rad, phi_rad, _): &&(f64, f64, f64)| {
                dot(&basis.mean_over_region(*theta_rad, *phi_rad), coefficients)
            };
            unmeasured.iter().map(towards).collect()
        };
        let weights = unmeasured.iter().map(|(_, _, weight)| *weight);
        extrapolation.components(self, &weights.collect::<Vec<f64>>(), field)
    }

    /// The same of the exitance within a cone about the normal, mean over the region.
    pub(crate) fn unmeasured_within(&self, theta_max_rad: f64) -> Vec<f64> {
        if self.extrapolation().is_none() {
            return Vec::new();
        }
        let region = self.region();
        let is_whole = region.chart.is_whole_sphere();
        let mut directions = Vec::new();
        if theta_max_rad > region.theta_max_rad {
            let beyond = Zone { from_rad: region.theta_max_rad, to_rad: theta_max_rad };
            directions = beyond.weighted(is_whole, RINGS, SPOKES);
        }
        if let Some(measured) = self.measured() {
            let (gaps, solid_angle_sr) = measured.gaps(region);
            let within = gaps.into_iter().filter(|(theta_rad, _)| *theta_rad <= theta_max_rad);
            directions.extend(within.map(|(theta_rad, phi_rad)| {
                let projection = if is_whole { 1.0 } else { libm::cos(theta_rad) };
                (theta_rad, phi_rad, projection * solid_angle_sr)
            }));
        }
        self.unmeasured_towards(&directions)
    }

    /// The same of all directions of the chart.
    pub(crate) fn unmeasured(&self) -> Vec<f64> {
        let is_whole = self.region().chart.is_whole_sphere();
        self.unmeasured_within(if is_whole { PI } else { FRAC_PI_2 })
    }

    /// Whether readings tell of a direction.
    fn is_told(&self, theta_rad: f64, phi_rad: f64) -> bool {
        theta_rad <= self.region().theta_max_rad + ROUNDING_RAD
            && self.is_in_no_gap(theta_rad, phi_rad)
    }
}

impl Extrapolation {
    /// One for each of the other fields, and one for what lies below darkness.
    fn components(
        &self,
        fit: &Fit,
        weights: &[f64],
        field: impl Fn(&Basis, &[f64]) -> Vec<f64>,
    ) -> Vec<f64> {
        if weights.is_empty() {
            return vec![0.0; self.others.len() + 1];
        }
        let own = field(fit.functions(), fit.coefficients());
        let of_other = |other: &Other| {
            let theirs = field(&other.basis, &other.coefficients);
            let apart = |(theirs, own): (&f64, &f64)| theirs.max(0.0) - own.max(0.0);
            let apart = theirs.iter().zip(&own).map(apart);
            apart.zip(weights).map(|(apart, weight)| weight * apart).sum()
        };
        let below = own.iter().zip(weights).map(|(value, weight)| weight * (-value).max(0.0)).sum();
        self.others.iter().map(of_other).chain([below]).collect()
    }
}

impl Choice {
    /// The chosen model, and of what was tried beside it the best of each kind of functions of direction
    /// that foretold the readings left out about as well.
    pub fn chosen(&self) -> Option<Chosen> {
        Some(Chosen { model: self.candidates.first()?.model, others: self.others() })
    }

    /// Those beside the chosen model.
    pub fn others(&self) -> Vec<Penalised> {
        let Some((chosen, others)) = self.candidates.split_first() else { return Vec::new() };
        let mut others: Vec<&Candidate> =
            others.iter().filter(|other| other.score > -AS_LIKELY).collect();
        others.sort_by(|a, b| b.score.total_cmp(&a.score));
        let mut found: Vec<Penalised> = Vec::new();
        for other in others {
            let angular = other.model.basis.angular;
            let is_known = |known: &Penalised| known.basis.angular.name() == angular.name();
            if angular != chosen.model.basis.angular && !found.iter().any(is_known) {
                found.push(other.model);
            }
        }
        found
    }
}

/// How much less in log density a reading does about as well: by u of foretold readings that are up to
/// two thirds wider. Readings do not tell how functions go on beyond them.
const AS_LIKELY: f64 = 0.5;
/// Of the rule over what lies beyond the region's cone.
const RINGS: usize = 8;
const SPOKES: usize = 48;
/// An angle's rounding.
const ROUNDING_RAD: f64 = 1e-9;
