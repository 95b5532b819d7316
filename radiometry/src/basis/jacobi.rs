//! Jacobi polynomials Pₖ^(0,β) by their recurrence in difference form.
//!
//! Carrying Pₖ and Δₖ = Pₖ₊₁ - Pₖ, with 1 - x handed in rather than x, nothing cancels at
//! x = 1, where all of them are 1 and the textbook recurrence subtracts nearly equal numbers; a
//! sum over factorials has 7 digits left at degree 20 and none at 40. From Szegő (1939), eq. 4.5.1:
//! A Δₖ = D Δₖ₋₁ - B (1-x) Pₖ, with s = 2k+β, A = 2(k+1)(k+β+1)s, B = s(s+1)(s+2),
//! D = 2k(k+β)(s+2); for k = 0 the common factor s goes.

#![expect(
    clippy::inline_always,
    reason = "code for a kind of processor is what was inlined into it"
)]

/// One step of the recurrence: `Δₖ = carry · Δₖ₋₁ - pull · (1-x) · Pₖ`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Step {
    carry: f64,
    pull: f64,
}

/// The step from Pₖ to Pₖ₊₁.
pub(super) fn step(k: usize, beta: usize) -> Step {
    let (k, beta) = (k as f64, beta as f64);
    if k == 0.0 {
        return Step { carry: 0.0, pull: f64::midpoint(beta, 2.0) };
    }
    let s = 2.0f64.mul_add(k, beta);
    let a = 2.0 * (k + 1.0) * (k + beta + 1.0) * s;
    Step { carry: 2.0 * k * (k + beta) * (s + 2.0) / a, pull: s * (s + 1.0) * (s + 2.0) / a }
}

/// Where the recurrence stands: Pₖ, and Δₖ₋₁ that led there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Recurrence {
    one_minus_x: f64,
    value: f64,
    difference: f64,
}

impl Recurrence {
    /// At P₀ = 1.
    pub(super) const fn new(one_minus_x: f64) -> Self {
        Self { one_minus_x, value: 1.0, difference: 0.0 }
    }

    /// Pₖ.
    pub(super) const fn value(self) -> f64 {
        self.value
    }

    /// Pₖ - Pₖ₋₁; 0 at k = 0.
    pub(super) const fn difference(self) -> f64 {
        self.difference
    }

    /// On to Pₖ₊₁.
    #[inline(always)]
    pub(super) fn advance(&mut self, step: Step) {
        let pull = step.pull * self.one_minus_x * self.value;
        self.difference = step.carry.mul_add(self.difference, -pull);
        self.value += self.difference;
    }
}

/// Pₖ^(0,β) at 1 - x.
pub(super) fn polynomial(k: usize, beta: usize, one_minus_x: f64) -> f64 {
    let mut recurrence = Recurrence::new(one_minus_x);
    for index in 0..k {
        recurrence.advance(step(index, beta));
    }
    recurrence.value()
}
