//! B-splines over an interval or round a circle: piecewise polynomials that each live on a few knot
//! spans only, so that a sample changes few coefficients and a sharp feature stays where it is.
//!
//! For fits of fields too sharp for polynomials: over θ, x and y between given ends, over φ
//! periodic, as products of one for each coordinate. They know nothing of samples or of fitting,
//! nor what the coordinate means: x is in the unit of the knots, values are pure numbers,
//! derivatives of order m per that unit to the m.
//!
//! Values by the recurrence of Cox (1972) and de Boor (1972, "On calculating with B-splines"; BSPLVB
//! in "A Practical Guide to Splines", 1978, chapter X), which adds non-negative terms only: within
//! some `degree` roundings of the true value, whatever the knots; of cubic ones from their Bézier
//! ordinates, which that recurrence finds (`pieces`). Derivatives by differences of
//! the functions of lower degree (ibid., eq. X.15).

use super::active::{Active, DEGREE_MAX};
use super::pieces::Pieces;
use crate::domain::{DomainError, finite, within};
use crate::quadrature::gauss_legendre;

/// The B-splines of one degree on one knot sequence; together they are 1 everywhere on the domain
/// (but for unclamped knots beyond it).
///
/// Of degree p there are p + 1 non-zero ones at any place. At a knot that stands r times the
/// p - r first derivatives are continuous; at one that stands p + 1 times there is a jump, and the
/// value is that from the right (at the domain's end: from the left).
/// Who needs it: fits of fields too sharp for polynomials.
#[derive(Debug, Clone, PartialEq)]
pub struct BSpline {
    degree: usize,
    /// Round a circle, continued by `degree` knots into the turn before and the turn after.
    knots: Vec<f64>,
    len: usize,
    is_periodic: bool,
    pieces: Box<Pieces>,
}

impl BSpline {
    /// On knots as they are: `knots.len() - degree - 1` functions, over the domain from the knot at
    /// place `degree` to the one at that place from the end.
    ///
    /// Refused: a degree above [`DEGREE_MAX`]; fewer than 2 degree + 2 knots; a knot that is not
    /// finite, below the one before, or standing more than degree + 1 times; an empty domain.
    pub fn with_knots(degree: usize, knots: &[f64]) -> Result<Self, DomainError> {
        let degree = checked_degree(degree)?;
        expect_count("knots", knots.len(), 2 * degree + 2)?;
        let len = knots.len() - degree - 1;
        Self::checked(degree, checked_knots(knots)?, len, false)
    }

    /// Between two ends, clamped: the breaks from one end to the other, the ends once. The first and
    /// the last function alone are 1 at an end. An inner break that stands twice or more
    /// takes a derivative's continuity each time. `breaks.len() - 1 + degree` functions.
    ///
    /// ```
    /// use radiometry::basis::BSpline;
    /// let quadratic = BSpline::open(2, &[0.0, 1.0])?;
    /// // Without inner breaks: Bernstein's polynomials (1-x)², 2x(1-x), x².
    /// assert_eq!(quadratic.nonzero(0.25)?.values(), [0.5625, 0.375, 0.0625]);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn open(degree: usize, breaks: &[f64]) -> Result<Self, DomainError> {
        let degree = checked_degree(degree)?;
        expect_count("breaks", breaks.len(), 2)?;
        let breaks = checked_knots(breaks)?;
        let (first, last) = (breaks[0], breaks[breaks.len() - 1]);
        let mut knots = vec![first; degree];
        knots.extend(&breaks);
        knots.extend(std::iter::repeat_n(last, degree));
        let len = knots.len() - degree - 1;
        Self::checked(degree, knots, len, false)
    }

    /// Round a circle: the breaks over one turn, the last being the first again, a period on. Any
    /// finite x is meant modulo the period. `breaks.len() - 1` functions; at least degree + 1.
    ///
    /// ```
    /// use radiometry::basis::BSpline;
    /// let tau = std::f64::consts::TAU;
    /// let round = BSpline::periodic(1, &[0.0, tau / 3.0, 2.0 * tau / 3.0, tau])?;
    /// // Half-way down the hat over the seam, half-way up the next.
    /// let found: Vec<_> = round.nonzero(tau / 6.0)?.iter().collect();
    /// assert_eq!(found.iter().map(|(index, _)| *index).collect::<Vec<_>>(), [0, 1]);
    /// assert!(found.iter().all(|(_, value)| (value - 0.5).abs() < 1e-15));
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn periodic(degree: usize, breaks: &[f64]) -> Result<Self, DomainError> {
        let degree = checked_degree(degree)?;
        expect_count("breaks", breaks.len(), degree + 2)?;
        let breaks = checked_knots(breaks)?;
        let len = breaks.len() - 1;
        let (first, last) = (breaks[0], breaks[len]);
        let before = breaks[len - degree..len].iter().map(|knot| first - (last - knot));
        let after = breaks[1..=degree].iter().map(|knot| last + (knot - first));
        let knots: Vec<f64> = before.chain(breaks.iter().copied()).chain(after).collect();
        Self::checked(degree, checked_knots(&knots)?, len, true)
    }

    /// The degree p of the pieces.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// How many functions there are.
    #[expect(clippy::len_without_is_empty, reason = "there is always one")]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether the last function's neighbour is the first.
    pub fn is_periodic(&self) -> bool {
        self.is_periodic
    }

    /// Both ends of the domain, in the knots' unit; of a periodic one, of the turn as given.
    pub fn domain(&self) -> (f64, f64) {
        (self.knots[self.degree], self.knots[self.end()])
    }

    /// The stretches of the domain, rising, on each of which every function is one polynomial: what a
    /// Gauss rule has to be broken at. Empty ones are left out.
    pub fn spans(&self) -> impl Iterator<Item = (f64, f64)> {
        self.knots[self.degree..=self.end()]
            .windows(2)
            .filter(|ends| ends[0] < ends[1])
            .map(|ends| (ends[0], ends[1]))
    }

    /// The degree + 1 functions that are not zero around x, with their values in [0, 1], without a
    /// heap: what a row of a fit's design matrix is made of.
    ///
    /// x in the domain, both ends included; outside, it is an error, but round a circle.
    pub fn nonzero(&self, x: f64) -> Result<Active, DomainError> {
        self.nonzero_derivatives(x, 0)
    }

    /// The same for the derivatives of an order; 0 all of them above the degree. Where a derivative
    /// jumps it is that from the right (at the domain's end: from the left). An error where it is
    /// beyond the largest double.
    pub fn nonzero_derivatives(&self, x: f64, order: usize) -> Result<Active, DomainError> {
        self.active(x, order)
    }

    /// The same with as much room as the caller asks for, who knows the degree: more than that, or it
    /// panics.
    #[inline]
    pub fn active<const ROOM: usize>(
        &self,
        x: f64,
        order: usize,
    ) -> Result<Active<ROOM>, DomainError> {
        assert!(self.degree < ROOM, "room for all functions that are not zero");
        let x = self.reduced(x)?;
        let span = self.pieces.span(&self.knots, self.degree, x);
        let first = span - self.degree;
        let mut active = Active::new(first, self.degree, self.len);
        if order == 0
            && let Some(values) = self.pieces.values(first, x)
        {
            active.take(values);
        } else if order <= self.degree {
            active.raise(&self.knots[span - self.degree..], x, self.degree - order)?;
        }
        Ok(active)
    }

    /// All values at x, zeros among them, into `values` (of length [`len`](Self::len), or it
    /// panics).
    pub fn evaluate(&self, x: f64, values: &mut [f64]) -> Result<(), DomainError> {
        assert_eq!(values.len(), self.len, "one value a function");
        let active = self.nonzero(x)?;
        values.fill(0.0);
        for (index, value) in active.iter() {
            values[index] = value;
        }
        Ok(())
    }

    /// ∫ Bᵢ dx from `from` to `to` within the domain, of every function, in the knots' unit, into
    /// `values` (of length [`len`](Self::len), or it panics). By a Gauss-Legendre rule on every span,
    /// exact but for rounding.
    ///
    /// ```
    /// let linear = radiometry::basis::BSpline::open(1, &[0.0, 1.0, 3.0])?;
    /// let mut areas = [0.0; 3];
    /// linear.integrals(0.0, 3.0, &mut areas)?;
    /// // Triangles of height 1: half their bases.
    /// assert!((areas[0] - 0.5).abs() + (areas[1] - 1.5).abs() + (areas[2] - 1.0).abs() < 1e-15);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn integrals(&self, from: f64, to: f64, values: &mut [f64]) -> Result<(), DomainError> {
        assert_eq!(values.len(), self.len, "one value a function");
        let (low, high) = self.domain();
        let from = within("from", from, low, high)?;
        let to = within("to", to, from, high)?;
        values.fill(0.0);
        let rule = gauss_legendre(self.degree / 2 + 1);
        for (low, high) in self.spans() {
            let (low, high) = (low.max(from), high.min(to));
            if low < high {
                for (x, weight) in placed(&rule, low, high) {
                    for (index, value) in self.nonzero(x)?.iter() {
                        values[index] += weight * value;
                    }
                }
            }
        }
        Ok(())
    }

    /// ∫ Bᵢ⁽ᵐ⁾ Bⱼ⁽ᵐ⁾ dx over the domain: the Gram matrix for m = 0, the penalty on slope for 1, on
    /// curvature for 2 (Eilers and Marx 1996; O'Sullivan 1986). `len`² numbers, row by row,
    /// symmetric, zero further than `degree` from the diagonal (round the corner, if periodic); in the
    /// knots' unit to the power 1 - 2m. By a Gauss-Legendre rule on every span, exact but for
    /// rounding.
    ///
    /// ```
    /// let linear = radiometry::basis::BSpline::open(1, &[0.0, 0.5])?;
    /// // Slopes -2 and 2 over half a unit.
    /// assert_eq!(linear.gram(1)?, [2.0, -2.0, -2.0, 2.0]);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn gram(&self, order: usize) -> Result<Vec<f64>, DomainError> {
        let mut gram = vec![0.0; self.len * self.len];
        if order > self.degree {
            return Ok(gram);
        }
        let rule = gauss_legendre(self.degree - order + 1);
        for (low, high) in self.spans() {
            for (x, weight) in placed(&rule, low, high) {
                let active = self.nonzero_derivatives(x, order)?;
                for (i, a) in active.iter() {
                    for (j, b) in active.iter() {
                        gram[i * self.len + j] += weight * (a * b);
                    }
                }
            }
        }
        if gram.iter().all(|entry| entry.is_finite()) {
            Ok(gram)
        } else {
            Err(DomainError::Overflow { result: "the Gram matrix of a B-spline" })
        }
    }

    /// The place of the domain's end among the knots.
    fn end(&self) -> usize {
        self.knots.len() - 1 - self.degree
    }

    /// x within the domain: as it is, or a whole number of turns away.
    fn reduced(&self, x: f64) -> Result<f64, DomainError> {
        let (from, to) = self.domain();
        if !self.is_periodic {
            return within("x", x, from, to);
        }
        let x = finite("x", x)?;
        if (from..to).contains(&x) {
            return Ok(x);
        }
        let period = to - from;
        // Both remainders are exact, and so is their difference but for one rounding.
        let turned = libm::fmod(x, period) - libm::fmod(from, period);
        let turned = if turned < 0.0 { turned + period } else { turned };
        let turned = if turned >= period { turned - period } else { turned };
        Ok((from + turned.max(0.0)).min(to))
    }

    /// No knot stands too often, and there is a domain.
    fn checked(
        degree: usize,
        knots: Vec<f64>,
        len: usize,
        is_periodic: bool,
    ) -> Result<Self, DomainError> {
        let most = degree + 1;
        for run in knots.chunk_by(|a, b| a >= b) {
            if run.len() > most {
                return Err(DomainError::Repeated { knot: run[0], times: run.len(), most });
            }
        }
        // Lest a difference of knots be infinite.
        finite("the knots' extent", knots[knots.len() - 1] - knots[0])?;
        let end = knots.len() - 1 - degree;
        let extent = knots[end] - knots[degree];
        if extent > 0.0 {
            let pieces = Box::new(Pieces::new(&knots, degree, end));
            Ok(Self { degree, knots, len, is_periodic, pieces })
        } else {
            Err(DomainError::NotPositive { argument: "the domain's extent", value: extent })
        }
    }
}

fn checked_degree(degree: usize) -> Result<usize, DomainError> {
    within("degree", degree as f64, 0.0, DEGREE_MAX as f64)?;
    Ok(degree)
}

fn expect_count(argument: &'static str, found: usize, least: usize) -> Result<(), DomainError> {
    if found >= least { Ok(()) } else { Err(DomainError::TooFew { argument, found, least }) }
}

/// Finite, and none below the one before.
fn checked_knots(knots: &[f64]) -> Result<Vec<f64>, DomainError> {
    for knot in knots {
        finite("knot", *knot)?;
    }
    match knots.windows(2).position(|pair| pair[1] < pair[0]) {
        None => Ok(knots.to_vec()),
        Some(place) => Err(DomainError::Falling {
            argument: "knots",
            index: place + 1,
            value: knots[place + 1],
            before: knots[place],
        }),
    }
}

/// The rule's nodes and weights on an interval.
fn placed(rule: &[(f64, f64)], from: f64, to: f64) -> impl Iterator<Item = (f64, f64)> {
    let (middle, half) = (f64::midpoint(from, to), (to - from) / 2.0);
    rule.iter()
        .map(move |(node, weight)| (half.mul_add(*node, middle).clamp(from, to), half * weight))
}
