//! Fields that are not darker than black: the nearest field that is nowhere below zero on a grid.
//!
//! Of all coefficients c' under which L >= 0 along the rays of the grid, those nearest to the fitted
//! ones by their independent covariance: (c' - c)ᵀ C⁻¹ (c' - c) is smallest, which for least squares is
//! the constrained least-squares fit (Lawson and Hanson 1974, "Solving Least Squares Problems", ch. 23:
//! least distance programming through its dual, whose unknowns are one force for each ray that holds the
//! field up). Rays are taken in as they are found below zero.
//!
//! u is left as it was. Where the bound holds it is too large rather than too small: that L can't be
//! negative says more than the readings do, but to one side only, which no standard uncertainty tells.

use crate::basis::{Directions, dot};
use crate::{Fit, FitError, Parts, Ray, Region, sparse};
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

/// What holding a field at zero did to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Nonnegative {
    /// The rays that hold it up, where it is now zero, by falling force; empty if it was nowhere below.
    pub held: Vec<Ray>,
    /// Rays at which it was looked at.
    pub rays: usize,
    /// The least radiance among them before, in the values' unit.
    pub least: f64,
    /// By how much the exitance grew, in the values' unit times sr.
    pub exitance: f64,
}

impl Fit {
    /// The nearest field that is not below zero along any ray of a grid over the region, finer than
    /// the basis bends; between its rays it may be, by what a basis bends between two of them.
    /// A fit in many local functions ([`is_sparse`](Self::is_sparse)) is refused, and so is a field
    /// that some ray of the grid is still below zero along in the end.
    pub fn nonnegative(&self) -> Result<(Self, Nonnegative), FitError> {
        self.nonnegative_in(ROUNDS_MAX)
    }

    fn nonnegative_in(&self, rounds: usize) -> Result<(Self, Nonnegative), FitError> {
        if self.is_sparse() {
            return Err(sparse::refusal("a field nowhere below zero"));
        }
        let rays = grid(
            self.region(),
            &rings(self.functions().directions(), self.region().theta_max_rad),
            self.functions().places().fineness(),
        );
        let size = self.coefficients().iter().fold(0.0, |size: f64, c| size.max(c.abs()));
        let tolerance = BELOW_RELATIVE * size;
        let mut held = Held::new(self);
        let mut coefficients = self.coefficients().to_vec();
        let mut values = self.along(&rays, &coefficients);
        let lowest = |values: &[f64]| values.iter().copied().fold(f64::INFINITY, f64::min);
        let least = lowest(&values);
        for _ in 0..rounds {
            let is_new = |i: &usize| values[*i] < -tolerance && !held.taken.contains(i);
            let mut below: Vec<usize> = (0..rays.len()).filter(is_new).collect();
            if below.is_empty() {
                break;
            }
            below.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
            below.truncate(TAKEN_AT_A_TIME);
            held.take(&below, &rays);
            coefficients = held.solve(self).ok_or(FitError::OutOfRange)?;
            values = self.along(&rays, &coefficients);
        }
        let left = lowest(&values);
        if left < -HELD_RELATIVE * size {
            let below = values.iter().filter(|value| **value < -HELD_RELATIVE * size).count();
            return Err(FitError::StillNegative { below, rays: rays.len(), least: left });
        }
        if held.taken.is_empty() {
            let unchanged =
                Nonnegative { held: Vec::new(), rays: rays.len(), least, exitance: 0.0 };
            return Ok((self.clone(), unchanged));
        }
        let parts = Parts { coefficients, ..self.parts().clone() };
        let fit = self.with_parts(parts);
        let exitance = fit.exitance().value - self.exitance().value;
        let held = held.rays(&rays);
        Ok((fit, Nonnegative { held, rays: rays.len(), least, exitance }))
    }

    fn along(&self, rays: &[Ray], coefficients: &[f64]) -> Vec<f64> {
        let mut scratch = self.functions().scratch();
        rays.iter().map(|ray| self.functions().value(coefficients, ray, &mut scratch)).collect()
    }
}

/// The rays that may hold the field up.
struct Held {
    fit_values: Vec<f64>,
    taken: Vec<usize>,
    /// Sᵀ g for the row g of each ray: their products are those under the covariance.
    rows: Vec<Vec<f64>>,
    forces: Vec<f64>,
    scratch: crate::basis::Scratch,
    basis: crate::basis::Basis,
    factor: Vec<f64>,
    coefficients: Vec<f64>,
}

impl Held {
    fn new(fit: &Fit) -> Self {
        Self {
            fit_values: Vec::new(),
            taken: Vec::new(),
            rows: Vec::new(),
            forces: Vec::new(),
            scratch: fit.functions().scratch(),
            basis: fit.functions().clone(),
            factor: fit.parts().factor.clone(),
            coefficients: fit.coefficients().to_vec(),
        }
    }

    fn take(&mut self, below: &[usize], rays: &[Ray]) {
        let p = self.basis.len();
        let mut row = vec![0.0; p];
        for &i in below {
            self.basis.row(&rays[i], &mut self.scratch, &mut row);
            self.fit_values.push(dot(&row, &self.coefficients));
            let column = |j: usize| &self.factor[j * (j + 1) / 2..][..=j];
            self.rows.push((0..p).map(|j| dot(column(j), &row[..=j])).collect());
            self.taken.push(i);
            self.forces.push(0.0);
        }
    }

    /// The coefficients held up by the least forces that do: Lawson and Hanson's active set on the dual.
    fn solve(&mut self, fit: &Fit) -> Option<Vec<f64>> {
        let m = self.rows.len();
        let q = Mat::from_fn(m, m, |i, j| dot(&self.rows[i], &self.rows[j]));
        let need: Vec<f64> = self.fit_values.iter().map(|value| -value).collect();
        self.forces = least_forces(&q, &need)?;
        let p = fit.coefficients().len();
        let mut pushed = vec![0.0; p];
        for (row, force) in self.rows.iter().zip(&self.forces) {
            pushed.iter_mut().zip(row).for_each(|(sum, r)| *sum += force * r);
        }
        let mut coefficients = fit.coefficients().to_vec();
        for (j, pushed) in pushed.iter().enumerate() {
            let column = &self.factor[j * (j + 1) / 2..][..=j];
            coefficients.iter_mut().zip(column).for_each(|(c, s)| *c += s * pushed);
        }
        Some(coefficients)
    }

    fn rays(&self, rays: &[Ray]) -> Vec<Ray> {
        let mut held: Vec<(usize, f64)> =
            self.taken.iter().copied().zip(self.forces.iter().copied()).collect();
        held.retain(|(_, force)| *force > 0.0);
        held.sort_by(|a, b| b.1.total_cmp(&a.1));
        held.into_iter().map(|(i, _)| rays[i]).collect()
    }
}

/// λ >= 0 with Q λ >= b and λᵀ(Q λ - b) = 0. `None` where numbers leave their range.
fn least_forces(q: &Mat<f64>, b: &[f64]) -> Option<Vec<f64>> {
    let m = b.len();
    let largest = (0..m).map(|i| q[(i, i)]).fold(0.0, f64::max);
    let size = b.iter().fold(0.0, |size: f64, b| size.max(b.abs()));
    let mut forces = vec![0.0; m];
    let mut active: Vec<usize> = Vec::new();
    for _ in 0..3 * m + 10 {
        let short = |i: usize| b[i] - (0..m).map(|j| q[(i, j)] * forces[j]).sum::<f64>();
        let next = (0..m).filter(|i| !active.contains(i)).map(|i| (i, short(i)));
        let Some((worst, lack)) = next.max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        if lack <= SHORT_RELATIVE * size {
            break;
        }
        active.push(worst);
        loop {
            let k = active.len();
            let ridge = RIDGE * largest;
            let own = Mat::from_fn(k, k, |i, j| {
                q[(active[i], active[j])] + if i == j { ridge } else { 0.0 }
            });
            let side = Mat::from_fn(k, 1, |i, _| b[active[i]]);
            let wanted = own.llt(Side::Lower).ok()?.solve(&side);
            if (0..k).all(|i| wanted[(i, 0)] > 0.0) {
                forces.fill(0.0);
                (0..k).for_each(|i| forces[active[i]] = wanted[(i, 0)]);
                break;
            }
            // As far as the first force that would turn to pulling.
            let part = (0..k)
                .filter(|i| wanted[(*i, 0)] <= 0.0)
                .map(|i| forces[active[i]] / (forces[active[i]] - wanted[(i, 0)]))
                .fold(1.0, f64::min);
            for i in 0..k {
                let force = &mut forces[active[i]];
                *force += part * (wanted[(i, 0)] - *force);
            }
            let is_held = |i: &usize| {
                forces[*i] > SHORT_RELATIVE * forces.iter().fold(0.0, |a: f64, b| a.max(*b))
            };
            let kept: Vec<usize> = active.iter().copied().filter(is_held).collect();
            (0..m).filter(|i| !kept.contains(i)).for_each(|i| forces[i] = 0.0);
            if kept.is_empty() {
                return Some(forces);
            }
            active = kept;
        }
    }
    forces.iter().all(|force| force.is_finite()).then_some(forces)
}

/// Polar angles and how many azimuths at each: evenly, the more azimuths the farther from the pole;
/// where splines are finer in a stretch there alone.
fn rings(directions: &Directions, theta_max_rad: f64) -> Vec<(f64, usize)> {
    if let Some(rings) = directions.rings() {
        let mut rings: Vec<(f64, usize)> =
            rings.into_iter().filter(|(theta_rad, _)| *theta_rad < theta_max_rad).collect();
        let round = rings.last().map_or(1, |(_, round)| *round);
        rings.push((theta_max_rad, round));
        return rings;
    }
    let fineness = directions.fineness();
    let count = 2 * fineness + 4;
    let ring = |ring: usize| {
        let theta_rad = theta_max_rad * ring as f64 / count as f64;
        let round = 4.0 * (fineness + 1) as f64 * libm::sin(theta_rad);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a small count
        let spokes = libm::ceil(round).max(1.0) as usize;
        (theta_rad, spokes)
    };
    (0..=count).map(ring).collect()
}

/// Rays over the region along these rings.
fn grid(region: &Region, rings: &[(f64, usize)], places: usize) -> Vec<Ray> {
    let side = 2 * places + 1;
    let between = |(from, to): (f64, f64), i: usize| {
        if side == 1 {
            0.5 * (from + to)
        } else {
            from + (to - from) * i as f64 / (side - 1) as f64
        }
    };
    let mut rays = Vec::new();
    for &(theta_rad, spokes) in rings {
        for spoke in 0..spokes {
            let phi_rad = core::f64::consts::TAU * spoke as f64 / spokes as f64;
            for at in 0..side * side {
                let (x_m, y_m) = (between(region.x_m, at % side), between(region.y_m, at / side));
                let ray = Ray { x_m, y_m, theta_rad, phi_rad };
                if region.holds(&ray) {
                    rays.push(ray);
                }
            }
        }
    }
    rays
}

/// Less below zero than this part of the largest coefficient is rounding.
const BELOW_RELATIVE: f64 = 1e-9;
/// What a field may stay below zero along a ray that holds it up, as a part of the largest coefficient:
/// forces push to no more digits.
const HELD_RELATIVE: f64 = 1e-6;
/// Rays taken in before the forces are found anew.
const TAKEN_AT_A_TIME: usize = 20;
/// Rounds at most.
const ROUNDS_MAX: usize = 60;
/// A need that is met to this part of the largest one is met.
const SHORT_RELATIVE: f64 = 1e-10;
/// Keeps neighbouring rays apart, as a part of the largest variance.
const RIDGE: f64 = 1e-13;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Angular, BasisSpec, Fine, Noise, Position, Sample};

    /// A narrow lobe on a dark floor, which plain splines undershoot.
    fn undershooting(angular: Angular) -> Fit {
        let region = Region::surface((0.0, 0.0), (0.0, 0.0), 1.4);
        let noise = Noise::Fixed { variance: 1e-6 };
        let mut samples = Vec::new();
        for ring in 0..=140 {
            for spoke in 0..24 {
                let theta_rad = 0.01 * f64::from(ring);
                let phi_rad = core::f64::consts::TAU * f64::from(spoke) / 24.0;
                let ray = Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad };
                let value = libm::exp(-(theta_rad / 0.08).powi(2));
                samples.push(Sample { ray, value, noise });
            }
        }
        let basis = BasisSpec { angular, position: Position::Legendre { degree: 0 } };
        crate::fit(&samples, &region, basis, &[]).unwrap()
    }

    #[test]
    fn what_is_not_held_in_time_is_no_answer() {
        let fit = undershooting(Angular::Zernike { degree: 8, cosine_columns: 0 });
        let Err(FitError::StillNegative { below, rays, least }) = fit.nonnegative_in(1) else {
            panic!("held by one round")
        };
        assert!(below > 0 && rays > below && least < 0.0, "{below} of {rays}, {least}");
        let (held, bound) = fit.nonnegative().unwrap();
        assert!(bound.least < -1e-3 && !bound.held.is_empty());
        assert!(bound.held.iter().all(|ray| held.value(ray) > -1e-5));
    }

    #[test]
    fn refined_splines_are_looked_at_finely_where_they_are_fine() {
        let fine = Fine { from: 0, to: 1, halvings: 4, ..Fine::NONE };
        let splines = Angular::Splines { theta_spans: 6, phi_spans: 6, fine };
        let fit = undershooting(splines);
        let (held, bound) = fit.nonnegative().unwrap();
        // As finely everywhere there would be 45,000.
        assert!((500..8000).contains(&bound.rays), "{}", bound.rays);
        for step in 0..2800 {
            let theta_rad = 5e-4 * f64::from(step);
            let value = held.value(&Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad: 0.7 });
            assert!(value > 0.3 * bound.least.min(-1e-4), "{theta_rad}: {value} {}", bound.least);
        }
    }

    #[test]
    fn forces_push_where_there_is_need_and_nowhere_else() {
        let q = Mat::from_fn(3, 3, |i, j| if i == j { 2.0 } else { 1.0 });
        // Holding the first lifts the second by 0.5, more than it needs.
        let forces = least_forces(&q, &[1.0, 0.4, -1.0]).unwrap();
        assert!((forces[0] - 0.5).abs() < 1e-9 && forces[1] == 0.0 && forces[2] == 0.0);
        let forces = least_forces(&q, &[1.0, 0.8, -1.0]).unwrap();
        assert!((forces[0] - 0.4).abs() < 1e-9 && (forces[1] - 0.2).abs() < 1e-9);
        assert!(least_forces(&q, &[-1.0, -2.0, -0.1]).unwrap().iter().all(|f| *f == 0.0));
    }
}
