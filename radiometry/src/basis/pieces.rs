//! Cubic B-splines span by span: where a place lies among the knots, and the four functions that are
//! not zero there as sums of Bernstein's polynomials of the span. It does not know what they span
//! together, nor of derivatives.
//!
//! A B-spline's Bézier ordinates over a span lie between 0 and 1 and are found once, as values of its
//! blossom (Ramshaw 1989, "Blossoms are polar forms") at the span's ends, by the recurrence of de Boor
//! with an argument of its own for every level. A value is then a sum of sixteen products, none of which is
//! negative: as exact as the recurrence, within a few roundings, without its divisions.

/// The spans of one sequence of knots.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pieces {
    /// Of the first cell, in the knots' unit, and cells for a unit.
    from: f64,
    cells_per_unit: f64,
    /// For each cell, of equal width over the domain, a span at its start or before.
    starts: Vec<u32>,
    /// The place of the last span that is not empty.
    last: usize,
    /// By span from the domain's start on; none of other degrees than three.
    cubic: Vec<Piece>,
}

/// One span.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Piece {
    from: f64,
    to: f64,
    /// The reciprocal of its width.
    per_unit: f64,
    /// For each of Bernstein's polynomials the ordinates of the four functions.
    ordinates: [[f64; FUNCTIONS]; FUNCTIONS],
}

impl Pieces {
    /// Of checked knots of which the domain lies from place `degree` to `end`.
    pub(super) fn new(knots: &[f64], degree: usize, end: usize) -> Self {
        let (from, to) = (knots[degree], knots[end]);
        let last = degree + knots[degree..=end].partition_point(|knot| *knot < to) - 1;
        let count = ((end - degree) * CELLS_PER_SPAN).min(CELLS_MAX);
        let cells_per_unit = count as f64 / (to - from);
        // A domain of the smallest doubles is one cell.
        let (count, cells_per_unit) =
            if cells_per_unit.is_finite() { (count, cells_per_unit) } else { (1, 0.0) };
        // Lower than a place of the cell can be by rounding.
        let edge = |cell: usize| from + (cell as f64 - MARGIN) / cells_per_unit;
        let span = |x: f64| knots[degree..=last].partition_point(|knot| *knot <= x).max(1) - 1;
        let start = |cell: usize| u32::try_from(span(edge(cell))).unwrap_or(0);
        let starts = (0..count).map(start).collect();
        let piece = |i: usize| Piece::new(&knots[i..i + 2 * DEGREE + 2]);
        let cubic =
            if degree == DEGREE { (0..=last - degree).map(piece).collect() } else { Vec::new() };
        Self { from, cells_per_unit, starts, last, cubic }
    }

    /// The last place i with tᵢ <= x < tᵢ₊₁, of x in the domain; at its end, of its last span.
    #[inline]
    pub(super) fn span(&self, knots: &[f64], degree: usize, x: f64) -> usize {
        // Saturates: a cell beyond is none.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let cell = ((x - self.from) * self.cells_per_unit) as usize;
        let start = self.starts.get(cell).or(self.starts.last()).copied().unwrap_or(0);
        let mut span = degree + start as usize;
        while span < self.last && knots[span + 1] <= x {
            span += 1;
        }
        span
    }

    /// The four functions' values at x in the span that is so many from the domain's start; `None` of
    /// other degrees, and of spans so narrow that their width has no reciprocal.
    #[inline]
    pub(super) fn values(&self, span: usize, x: f64) -> Option<[f64; FUNCTIONS]> {
        let piece = self.cubic.get(span).filter(|piece| piece.per_unit.is_finite())?;
        let (t, rest) = ((x - piece.from) * piece.per_unit, (piece.to - x) * piece.per_unit);
        let bernstein =
            [rest * rest * rest, 3.0 * t * (rest * rest), 3.0 * (t * t) * rest, t * t * t];
        let mut values = [0.0; FUNCTIONS];
        for (polynomial, ordinates) in bernstein.iter().zip(&piece.ordinates) {
            for (value, ordinate) in values.iter_mut().zip(ordinates) {
                *value += polynomial * ordinate;
            }
        }
        // A value that is all of 1 may be an ulp above it.
        Some(values.map(|value| value.min(1.0)))
    }
}

impl Piece {
    /// `knots`: the eight from the start of the first function's support on. An empty span has zeros.
    fn new(knots: &[f64]) -> Self {
        let (from, to) = (knots[DEGREE], knots[DEGREE + 1]);
        if from >= to {
            return Self { from, to, per_unit: 0.0, ordinates: Default::default() };
        }
        let at = |ends: [f64; DEGREE]| blossoms(knots, ends);
        let ordinates =
            [at([from; DEGREE]), at([from, from, to]), at([from, to, to]), at([to; DEGREE])];
        Self { from, to, per_unit: 1.0 / (to - from), ordinates }
    }
}

/// The blossoms of the four functions at three places of their common span.
fn blossoms(knots: &[f64], places: [f64; DEGREE]) -> [f64; FUNCTIONS] {
    let mut values = [1.0, 0.0, 0.0, 0.0];
    for (reached, x) in places.into_iter().enumerate() {
        let mut from_left = 0.0;
        for i in 0..=reached {
            let right = knots[DEGREE + 1 + i] - x;
            let left = x - knots[DEGREE + i - reached];
            let share = values[i] / (right + left);
            values[i] = from_left + right * share;
            from_left = left * share;
        }
        values[reached + 1] = from_left;
    }
    values
}

const DEGREE: usize = 3;
const FUNCTIONS: usize = DEGREE + 1;
/// Cells for a span, and at most: with narrower spans a place is a few steps from its cell's start.
const CELLS_PER_SPAN: usize = 2;
const CELLS_MAX: usize = 1024;
/// Of a cell's width, far above rounding.
const MARGIN: f64 = 1e-6;
