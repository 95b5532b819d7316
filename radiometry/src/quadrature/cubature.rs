//! Adaptive cubature on triangles and rectangles of the plane. It doesn't know the integrand.
//!
//! A cell's integral is that of the 8 x 8 Gauss-Legendre product rule (a triangle's by Duffy's map of the
//! square onto it, 1982), its bound the difference from the 6 x 6 rule, four times that where
//! cutting the cell hardly shrank it. The cell with the largest
//! bound is cut across its longest side.

use core::cmp::Ordering;
use std::collections::BinaryHeap;
use std::sync::OnceLock;

use glam::DVec2;

use super::adaptive::{CAUTION, SMOOTH};
use super::{Sum, gauss_legendre};
use crate::domain::finite;
use crate::estimate::{Estimate, EstimateError, Tolerance};

/// Nodes a side of the rule that counts, and of the one that it is compared with.
const NODES: [usize; 2] = [8, 6];
/// Evaluations of one application of both.
const EVALUATIONS: usize = NODES[0] * NODES[0] + NODES[1] * NODES[1];
/// A weighted sum of 64 values, in units of the sum of their sizes.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// A part of the plane to integrate over; its orientation does not matter.
/// Who needs it: whoever calls [`cubature`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cell {
    /// By its vertices.
    Triangle([DVec2; 3]),
    /// By two opposite corners.
    Rectangle(DVec2, DVec2),
}

impl Cell {
    /// The point of the cell at (u, v) of the unit square, and the area element there.
    fn at(&self, u: f64, v: f64) -> (DVec2, f64) {
        match *self {
            Self::Triangle([a, b, c]) => {
                let twice_area = (b - a).perp_dot(c - a).abs();
                (a + u * ((b - a) + v * (c - b)), twice_area * u)
            }
            Self::Rectangle(a, c) => {
                let side = c - a;
                (a + DVec2::new(u, v) * side, (side.x * side.y).abs())
            }
        }
    }

    /// Both parts, cut across the longest side.
    fn halves(&self) -> [Self; 2] {
        match *self {
            Self::Triangle([a, b, c]) => {
                let sides =
                    [(b - a).length_squared(), (c - b).length_squared(), (a - c).length_squared()];
                let [a, b, c] = if sides[0] >= sides[1] && sides[0] >= sides[2] {
                    [c, a, b]
                } else if sides[1] >= sides[2] {
                    [a, b, c]
                } else {
                    [b, c, a]
                };
                let middle = b.midpoint(c);
                [Self::Triangle([a, b, middle]), Self::Triangle([a, middle, c])]
            }
            Self::Rectangle(a, c) => {
                let middle = a.midpoint(c);
                let side = (c - a).abs();
                let (b, d) = if side.x >= side.y {
                    (DVec2::new(middle.x, c.y), DVec2::new(middle.x, a.y))
                } else {
                    (DVec2::new(c.x, middle.y), DVec2::new(a.x, middle.y))
                };
                [Self::Rectangle(a, b), Self::Rectangle(d, c)]
            }
        }
    }

    fn check(&self) -> Result<(), EstimateError> {
        let corners: &[DVec2] = match self {
            Self::Triangle(corners) => corners,
            Self::Rectangle(a, c) => &[*a, *c],
        };
        for corner in corners {
            finite("a corner's x", corner.x)?;
            finite("a corner's y", corner.y)?;
        }
        Ok(())
    }
}

#[derive(Debug, Clone, Copy)]
struct Piece {
    cell: Cell,
    value: f64,
    difference: f64,
    truncation: f64,
    rounding: f64,
}

impl Piece {
    fn new(
        integrand: &mut impl FnMut(DVec2) -> f64,
        cell: Cell,
        parents_difference: f64,
    ) -> Result<Self, EstimateError> {
        let mut sums = [0.0; 2];
        let mut size = 0.0;
        for (sum, rule) in sums.iter_mut().zip(rules()) {
            size = 0.0;
            for &(u, weight_u) in rule.iter().rev() {
                for &(v, weight_v) in rule {
                    let (point, element) = cell.at(u, v);
                    let term = weight_u * weight_v * element * integrand(point);
                    *sum += term;
                    size += term.abs();
                }
            }
            if !size.is_finite() {
                return Err(EstimateError::Integrand { value: size });
            }
        }
        let difference = (sums[0] - sums[1]).abs();
        let caution = if SMOOTH * difference < parents_difference { 1.0 } else { CAUTION };
        Ok(Self {
            cell,
            value: sums[0],
            difference,
            truncation: caution * difference,
            rounding: ROUNDING * size,
        })
    }
}

/// Both rules on [0, 1].
fn rules() -> &'static [Vec<(f64, f64)>; 2] {
    static RULES: OnceLock<[Vec<(f64, f64)>; 2]> = OnceLock::new();
    RULES.get_or_init(|| {
        NODES.map(|nodes| {
            let onto_unit = |(node, weight)| (f64::midpoint(1.0, node), 0.5 * weight);
            gauss_legendre(nodes).into_iter().map(onto_unit).collect()
        })
    })
}

impl Ord for Piece {
    fn cmp(&self, other: &Self) -> Ordering {
        self.truncation.total_cmp(&other.truncation)
    }
}

impl PartialOrd for Piece {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Piece {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Piece {}

/// ∬ f dA over all cells, to the tolerance. Peaks should lie on corners of cells: a rule of 64 nodes
/// cannot know of one between them. Kinks and steps should lie on edges: where one cuts a corner off a
/// cell between the nodes the error can be several times the bound.
/// Who needs it: form factors past occluders; the tests of closed forms.
///
/// ```
/// use glam::DVec2;
/// use radiometry::{Tolerance, quadrature::{Cell, cubature}};
/// // The mean distance of the unit square's points from its corner: (√2 + asinh 1)/3.
/// let square = Cell::Rectangle(DVec2::ZERO, DVec2::ONE);
/// let mean = cubature(|point| point.length(), &[square], Tolerance::from_relative(1e-8)?)?;
/// let exact = (2.0_f64.sqrt() + 1.0_f64.asinh()) / 3.0;
/// assert!((mean.value - exact).abs() <= mean.error_bound && mean.error_bound < 1e-8);
/// # Ok::<(), radiometry::EstimateError>(())
/// ```
pub fn cubature(
    mut integrand: impl FnMut(DVec2) -> f64,
    cells: &[Cell],
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    let mut pieces = BinaryHeap::with_capacity(cells.len());
    for cell in cells {
        cell.check()?;
        pieces.push(Piece::new(&mut integrand, *cell, 0.0)?);
    }
    let mut evaluations = cells.len() * EVALUATIONS;
    loop {
        let value = pieces.iter().map(|piece| piece.value).collect::<Sum>().value();
        let truncation = pieces.iter().map(|piece| piece.truncation).sum::<f64>();
        let rounding = pieces.iter().map(|piece| piece.rounding).sum::<f64>();
        let estimate = Estimate { value, error_bound: truncation + rounding, evaluations };
        let hopeless = rounding > tolerance.allowed(value) && truncation < rounding;
        if estimate.meets(tolerance) || hopeless {
            return estimate.within(tolerance);
        }
        for _ in 0..=pieces.len() / 8 {
            if evaluations + 2 * EVALUATIONS > tolerance.budget() {
                return estimate.within(tolerance);
            }
            let Some(worst) = pieces.pop() else { return estimate.within(tolerance) };
            for half in worst.cell.halves() {
                pieces.push(Piece::new(&mut integrand, half, worst.difference)?);
            }
            evaluations += 2 * EVALUATIONS;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_takes_one_application() {
        let triangle = Cell::Triangle([DVec2::ZERO, DVec2::X, DVec2::Y]);
        // ∬ x² y³ over the unit triangle: 2! 3!/7!.
        let estimate =
            cubature(|p| p.x.powi(2) * p.y.powi(3), &[triangle], Tolerance::FINE).unwrap();
        assert_eq!(estimate.evaluations, EVALUATIONS);
        assert!((estimate.value - 12.0 / 5040.0).abs() <= estimate.error_bound);
    }

    #[test]
    fn cells_cut_in_two_keep_their_area() {
        let cells = [
            Cell::Triangle([DVec2::new(0.1, 0.2), DVec2::new(3.0, -1.0), DVec2::new(0.5, 2.0)]),
            Cell::Rectangle(DVec2::new(2.0, 1.0), DVec2::new(-1.0, 7.0)),
        ];
        for cell in cells {
            let area = |cells: &[Cell]| cubature(|_| 1.0, cells, Tolerance::FINE).unwrap().value;
            assert!((area(&[cell]) - area(&cell.halves())).abs() < 1e-14);
        }
    }

    #[test]
    fn the_bound_holds_for_a_peak_at_a_corner() {
        // ∬ 1/r over the unit square from its corner: 2 asinh 1.
        for relative in [1e-3, 1e-6] {
            let tolerance = Tolerance::from_relative(relative).unwrap();
            let square = Cell::Rectangle(DVec2::ZERO, DVec2::ONE);
            let estimate = cubature(|p| 1.0 / p.length(), &[square], tolerance).unwrap();
            let error = (estimate.value - 2.0 * 1.0_f64.asinh()).abs();
            assert!(error <= estimate.error_bound, "{error:e}, {estimate:?}");
        }
    }
}
