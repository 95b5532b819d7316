//! Steps along a ray in a field of index: the ray equation as a system of first order, and the pair of
//! Runge-Kutta formulas of Dormand and Prince (1980, order 5 with an error estimate of order 4). It does
//! not know where the ray shall end, nor how well.
//!
//! With the optical direction p = n dr/ds and dt = ds/n: dr/dt = p, dp/dt = n ∇n, and |p| = n stays
//! (Sharma, Kumar and Ghatak 1982). The optical path (n² dt) and the length (n dt) run along.

use glam::DVec3;

use super::checked_index;
use super::trace::IndexField;
use crate::domain::{DomainError, finite_vector};
use crate::error_free::two_sum;

/// Place (m), n times the direction, optical path (m) and length (m).
const PLACE: usize = 0;
const DIRECTION: usize = 3;
const OPTICAL_PATH: usize = 6;
const LENGTH: usize = 7;
const SIZE: usize = 8;

/// How each of them changes with t.
type Slope = [f64; SIZE];

/// Where a ray is, and how it got there; with what rounding dropped, so that many small steps don't
/// add up more of it than few large ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct State {
    rounded: [f64; SIZE],
    rest: [f64; SIZE],
}

impl State {
    pub(super) fn new(point_m: DVec3, optical_direction: DVec3) -> Self {
        let [x, y, z] = point_m.to_array();
        let [p, q, r] = optical_direction.to_array();
        Self { rounded: [x, y, z, p, q, r, 0.0, 0.0], rest: [0.0; SIZE] }
    }

    pub(super) fn point_m(&self) -> DVec3 {
        DVec3::from_slice(&self.rounded[PLACE..])
    }

    /// n times the unit direction.
    pub(super) fn optical_direction(&self) -> DVec3 {
        DVec3::from_slice(&self.rounded[DIRECTION..])
    }

    pub(super) fn optical_path_m(&self) -> f64 {
        self.rounded[OPTICAL_PATH]
    }

    pub(super) fn length_m(&self) -> f64 {
        self.rounded[LENGTH]
    }

    /// On by a step times a weighted sum of slopes.
    fn stepped(&self, step: f64, weights: &[f64], slopes: &[Slope]) -> Self {
        let by = weighted(step, weights, slopes);
        let sums: [_; SIZE] =
            core::array::from_fn(|i| two_sum(self.rounded[i], by[i] + self.rest[i]));
        Self { rounded: sums.map(|(rounded, _)| rounded), rest: sums.map(|(_, rest)| rest) }
    }
}

fn weighted(step: f64, weights: &[f64], slopes: &[Slope]) -> Slope {
    let mut sum = [0.0; SIZE];
    for (weight, slope) in weights.iter().zip(slopes).filter(|(weight, _)| **weight != 0.0) {
        for (sum, slope) in sum.iter_mut().zip(slope) {
            *sum += weight * slope;
        }
    }
    sum.map(|sum| step * sum)
}

/// The stages' weights, row by row; the last row is the formula of order 5 itself.
const STAGES: [&[f64]; 6] = [
    &[1.0 / 5.0],
    &[3.0 / 40.0, 9.0 / 40.0],
    &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
    &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
    &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
    &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
/// The formula of order 5 less that of order 4.
const DIFFERENCE: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339_200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];
/// Evaluations of the field that a step takes.
pub(super) const EVALUATIONS: usize = 7;

/// A field with a count of how often it was asked.
pub(super) struct Counted<'a, F> {
    field: &'a F,
    pub(super) evaluations: usize,
}

impl<'a, F: IndexField> Counted<'a, F> {
    pub(super) const fn new(field: &'a F) -> Self {
        Self { field, evaluations: 0 }
    }

    /// n and ∇n, checked.
    pub(super) fn at(&mut self, point_m: DVec3) -> Result<(f64, DVec3), DomainError> {
        self.evaluations += 1;
        let (index, gradient) = self.field.at(point_m);
        Ok((checked_index(index)?, finite_vector("the index's gradient", gradient)?))
    }

    fn slope(&mut self, state: &State) -> Result<Slope, DomainError> {
        let (index, gradient) = self.at(finite_vector("the ray's position", state.point_m())?)?;
        let ([x, y, z], [p, q, r]) =
            (state.optical_direction().to_array(), (index * gradient).to_array());
        Ok([x, y, z, p, q, r, index * index, index])
    }

    /// One step in t, m; with the estimates of its error in place and optical path, m, and in
    /// direction.
    pub(super) fn step(
        &mut self,
        state: State,
        step: f64,
    ) -> Result<(State, f64, f64), DomainError> {
        let mut slopes = [self.slope(&state)?; EVALUATIONS];
        let mut next = state;
        for (stage, weights) in STAGES.into_iter().enumerate() {
            next = state.stepped(step, weights, &slopes);
            slopes[stage + 1] = self.slope(&next)?;
        }
        let error = weighted(step, &DIFFERENCE, &slopes);
        let place = DVec3::from_slice(&error[PLACE..]).length();
        let turn = DVec3::from_slice(&error[DIRECTION..]).length();
        Ok((next, place.max(error[OPTICAL_PATH].abs()), turn))
    }
}
