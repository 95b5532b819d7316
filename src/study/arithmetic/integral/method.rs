//! The methods that integrate what they know nothing of. Adaptive cubature is `radiometry`'s, in
//! four dimensions one within another; quasi-Monte Carlo is `radiometry`'s Sobol points under 32
//! random shifts; Monte Carlo is the mean over independent points. None of them reads a clock.

use std::cell::Cell as Counter;

use glam::DVec2;
use radiometry::quadrature::{Cell, Sum, cubature, quasi_monte_carlo};
use radiometry::{EstimateError, Tolerance};

use super::{Chart, Problem};
use crate::study::arithmetic::Unmeasured;
use crate::study::coverage::Draws;

/// A way to integrate, with what it is allowed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// Cubature to a relative tolerance, with a budget of evaluations.
    Adaptive {
        /// Relative.
        tolerance: f64,
        /// Of the integrand.
        budget: usize,
    },
    /// Points, of all shifts together: 2048 times a power of two.
    QuasiMonteCarlo(usize),
    /// Independent points.
    MonteCarlo(usize),
}

impl Method {
    /// For a legend.
    pub fn name(self) -> &'static str {
        match self {
            Self::Adaptive { .. } => "adaptive cubature",
            Self::QuasiMonteCarlo(_) => "quasi-Monte Carlo",
            Self::MonteCarlo(_) => "Monte Carlo",
        }
    }

    /// What a table calls its effort.
    pub fn effort(self) -> String {
        match self {
            Self::Adaptive { tolerance, .. } => format!("tolerance {tolerance:.0e}"),
            Self::QuasiMonteCarlo(points) | Self::MonteCarlo(points) => format!("{points} points"),
        }
    }

    /// Whether it answers otherwise for another seed.
    pub fn is_random(self) -> bool {
        !matches!(self, Self::Adaptive { .. })
    }

    /// The integral; as far as it came where the budget ended.
    pub fn integrate(self, problem: &Problem, seed: u64) -> Result<f64, Unmeasured> {
        match self {
            Self::Adaptive { tolerance, budget } => {
                let tolerance = Tolerance::new(tolerance, 0.0, budget)?;
                if problem.dimensions() == 2 {
                    square(&mut |[u, v]| problem.at_2([u, v], Chart::Smooth), tolerance)
                } else {
                    nested(problem, tolerance)
                }
            }
            Self::QuasiMonteCarlo(points) => {
                // No tolerance is ever met: the budget alone ends it.
                let all = Tolerance::new(0.0, 0.0, points)?;
                let estimate = if problem.dimensions() == 2 {
                    quasi_monte_carlo(|at| problem.at_2(*at, Chart::Even), seed, all)
                } else {
                    quasi_monte_carlo(|at| problem.at_4(*at, Chart::Even), seed, all)
                };
                value(estimate)
            }
            Self::MonteCarlo(points) => {
                let mut draws = Draws::new(seed);
                let mut sum = Sum::default();
                let is_point = problem.dimensions() == 2;
                for _ in 0..points {
                    let (u, v) = (draws.uniform(), draws.uniform());
                    sum.add(if is_point {
                        problem.at_2([u, v], Chart::Even)
                    } else {
                        problem.at_4([u, v, draws.uniform(), draws.uniform()], Chart::Even)
                    });
                }
                Ok(sum.value() / points as f64)
            }
        }
    }
}

fn square(
    integrand: &mut impl FnMut([f64; 2]) -> f64,
    tolerance: Tolerance,
) -> Result<f64, Unmeasured> {
    let whole = [Cell::Rectangle(DVec2::ZERO, DVec2::ONE)];
    value(cubature(|at| integrand(at.to_array()), &whole, tolerance))
}

/// Over the first surface the integral over the second, each to the same tolerance; the budget is
/// both's together.
fn nested(problem: &Problem, tolerance: Tolerance) -> Result<f64, Unmeasured> {
    let spent = Counter::new(0_usize);
    let outer = |first: [f64; 2]| {
        let left = tolerance.budget().saturating_sub(spent.get()).max(1);
        let inner = |second: [f64; 2]| {
            spent.set(spent.get() + 1);
            problem.at_4([first[0], first[1], second[0], second[1]], Chart::Smooth)
        };
        let within = Tolerance::new(tolerance.relative(), 0.0, left);
        within.map_or(f64::NAN, |within| square(&mut { inner }, within).unwrap_or(f64::NAN))
    };
    square(&mut { outer }, Tolerance::new(tolerance.relative(), 0.0, tolerance.budget() / 100)?)
}

fn value(estimate: Result<radiometry::Estimate, EstimateError>) -> Result<f64, Unmeasured> {
    match estimate {
        Ok(estimate) | Err(EstimateError::Unmet { estimate, .. }) => Ok(estimate.value),
        Err(error) => Err(error.into()),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// Unit squares face to face; a unit square above a point; half of a disk behind another.
    fn cases() -> Vec<(Problem, f64)> {
        let cases = crate::study::arithmetic::cases().unwrap();
        let problem = |id: &str| {
            let case = cases.iter().find(|case| case["id"] == json!(id)).unwrap();
            let exact: f64 = case["expected"].as_str().unwrap().parse().unwrap();
            (Problem::of_case(case).unwrap(), exact)
        };
        [
            "poly004",
            "disk022",
            "sph015",
            "pen029",
            "ff_par_rect01-polygons",
            "ff_polygons01-polygons",
            "ff_disk_disk_offset01",
            "ff_sphere_sphere01",
            "ff_wedge01",
        ]
        .map(problem)
        .into()
    }

    #[test]
    fn every_method_finds_what_the_reference_says() {
        for (place, (problem, exact)) in cases().into_iter().enumerate() {
            let meets = place == 8;
            for (method, within) in [
                (Method::Adaptive { tolerance: 1e-3, budget: 1_000_000 }, 1e-2),
                (Method::QuasiMonteCarlo(1 << 13), 2e-2),
                (Method::MonteCarlo(1 << 16), 5e-2),
            ] {
                // Without a bound where surfaces meet: points at random rarely see the most of it.
                if meets && method.is_random() {
                    continue;
                }
                let found = method.integrate(&problem, 1).unwrap();
                assert!((found / exact - 1.0).abs() < within, "{method:?}: {found}, not {exact}");
            }
        }
    }
}
