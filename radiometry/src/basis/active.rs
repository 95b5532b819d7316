//! The few functions of a B-spline basis that are not zero at a place, on the stack. They do not
//! know where in the domain that is: they are handed the knots around it.

use crate::domain::DomainError;

/// The highest degree of a B-spline; cubic ones are the usual choice, and beyond ten or so
/// neighbours are nearly alike.
pub const DEGREE_MAX: usize = 15;

/// The functions that are not zero around a place, in the order of their supports, with room for
/// so many: that of any degree, or less to move about.
/// Who needs it: rows of a fit's design matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Active<const ROOM: usize = { DEGREE_MAX + 1 }> {
    first: usize,
    count: usize,
    /// Of all functions: round a circle, the place after the last is the first.
    len: usize,
    values: [f64; ROOM],
}

impl<const ROOM: usize> Active<ROOM> {
    #[inline]
    pub(super) const fn new(first: usize, degree: usize, len: usize) -> Self {
        Self { first, count: degree + 1, len, values: [0.0; ROOM] }
    }

    /// Place among all functions, and value.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f64)> {
        // Fewer than two turns: there are no fewer functions than `count`.
        let turned = |place: usize| if place < self.len { place } else { place - self.len };
        let index = move |i: usize| turned(turned(self.first) + i);
        self.values().iter().enumerate().map(move |(i, value)| (index(i), *value))
    }

    /// Of the first one: its place among all functions.
    pub fn first(&self) -> usize {
        self.first % self.len
    }

    /// The values alone; their places follow each other, round the corner where periodic.
    pub fn values(&self) -> &[f64] {
        &self.values[..self.count]
    }

    /// These values.
    #[inline]
    pub(super) fn take<const N: usize>(&mut self, values: [f64; N]) {
        self.values[..N].copy_from_slice(&values);
    }

    /// Values by the recurrence up to a degree, derivatives from there to the full degree.
    /// `knots`: from the start of the first function's support on.
    pub(super) fn raise(&mut self, knots: &[f64], x: f64, to: usize) -> Result<(), DomainError> {
        raise(&mut self.values[..self.count], knots, x, self.count - 1, to);
        if self.values().iter().all(|value| value.is_finite()) {
            Ok(())
        } else {
            Err(DomainError::Overflow { result: "a derivative of a B-spline" })
        }
    }
}

/// The recurrences of [`Active::raise`].
fn raise(values: &mut [f64], knots: &[f64], x: f64, degree: usize, to: usize) {
    values[0] = 1.0;
    // x lies between the knots at places `degree` and `degree + 1`.
    for reached in 0..to {
        let mut from_left = 0.0;
        for i in 0..=reached {
            let right = knots[degree + 1 + i] - x;
            let left = x - knots[degree + i - reached];
            // In this order, lest a width near the smallest double make a share infinite.
            let (value, width) = (values[i], right + left);
            values[i] = from_left + value * (right / width);
            from_left = value * (left / width);
        }
        values[reached + 1] = from_left;
    }
    // A value that is all of 1 may be an ulp above it.
    values[..=to].iter_mut().for_each(|value| *value = value.min(1.0));
    // B'ᵢ of degree q + 1 is (q + 1)(Bᵢ/(tᵢ₊q₊₁ - tᵢ) - Bᵢ₊₁/(tᵢ₊q₊₂ - tᵢ₊₁)) of degree q.
    for reached in to..degree {
        let mut from_left = 0.0;
        for i in 0..=reached {
            let support = knots[degree + 1 + i] - knots[degree + i - reached];
            let slope = (reached as f64 + 1.0) * (values[i] / support);
            values[i] = from_left - slope;
            from_left = slope;
        }
        values[reached + 1] = from_left;
    }
}
