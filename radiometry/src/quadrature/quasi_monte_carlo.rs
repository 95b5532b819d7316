//! Randomised quasi-Monte Carlo in up to ten dimensions: Sobol's points under random digital shifts.
//! It rolls no dice, the seed is handed in; and it doesn't know the integrand.

use super::Sum;
use crate::DomainError;
use crate::domain::within;
use crate::estimate::{Estimate, EstimateError, Tolerance};

/// Primitive polynomials and first direction numbers for the dimensions from the second on
/// (Joe and Kuo 2008, new-joe-kuo-6): coefficients and m₁, m₂, ...
const DIRECTIONS: [(u32, &[u32]); 9] = [
    (0, &[1]),
    (1, &[1, 3]),
    (1, &[1, 3, 1]),
    (2, &[1, 1, 1]),
    (1, &[1, 1, 3, 3]),
    (4, &[1, 3, 5, 13]),
    (2, &[1, 1, 5, 5, 17]),
    (4, &[1, 1, 5, 5, 5]),
    (7, &[1, 1, 7, 11, 19]),
];

const DIMENSIONS_MAX: usize = DIRECTIONS.len() + 1;
const BITS: usize = 32;
/// Independent shifts, and the quantile of Student's t with one degree of freedom less: 99.9 % lie
/// within.
const SHIFTS: usize = 32;
const STUDENT: f64 = 3.633;
/// Points of the first round for each shift.
const FIRST_ROUND: usize = 64;

/// Sobol's sequence (1967) in Gray code order (Antonov and Saleev 1979), in `D` dimensions.
/// Who needs it: [`quasi_monte_carlo`].
#[derive(Debug, Clone)]
pub struct Sobol<const D: usize> {
    directions: [[u32; BITS]; D],
    point: [u32; D],
    index: u32,
}

impl<const D: usize> Sobol<D> {
    /// From its first point, 0; one to ten dimensions.
    pub fn new() -> Result<Self, DomainError> {
        within("dimensions", D as f64, 1.0, DIMENSIONS_MAX as f64)?;
        let directions = core::array::from_fn(direction_numbers);
        Ok(Self { directions, point: [0; D], index: 0 })
    }

    /// The next point, in units of 2⁻³²; the sequence starts anew after 2³² points.
    pub fn next_point(&mut self) -> [u32; D] {
        let point = self.point;
        let bit = (self.index.trailing_ones() as usize).min(BITS - 1);
        for (coordinate, directions) in self.point.iter_mut().zip(&self.directions) {
            *coordinate ^= directions[bit];
        }
        self.index = self.index.wrapping_add(1);
        if self.index == 0 {
            self.point = [0; D];
        }
        point
    }
}

fn direction_numbers(dimension: usize) -> [u32; BITS] {
    let mut numbers = [0_u32; BITS];
    if dimension == 0 {
        return core::array::from_fn(|bit| 1 << (31 - bit));
    }
    let (coefficients, first) = DIRECTIONS[dimension - 1];
    let degree = first.len();
    for (bit, m) in first.iter().enumerate() {
        numbers[bit] = m << (31 - bit);
    }
    for bit in degree..BITS {
        let mut number = numbers[bit - degree] ^ (numbers[bit - degree] >> degree);
        for k in 1..degree {
            if (coefficients >> (degree - 1 - k)) & 1 == 1 {
                number ^= numbers[bit - k];
            }
        }
        numbers[bit] = number;
    }
    numbers
}

/// The n-th number of a stream that the seed alone decides (`SplitMix64`, Steele et al. 2014).
fn random(seed: u64, n: u64) -> u64 {
    let mut x = seed.wrapping_add(n.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Digits of the net's coordinate, shifted, as a double in (0, 1).
fn shifted(coordinate: u32, shift: u64) -> f64 {
    let digits = ((u64::from(coordinate) << 32) ^ shift) >> 12;
    (digits as f64 + 0.5) * (1.0 / (1_u64 << 52) as f64)
}

/// ∫ f over the unit cube of `D` dimensions, by as many of Sobol's points under 32 random shifts as
/// the tolerance asks for. The error bound is statistical: Student's interval of the 32 independent
/// means at 99.9 % confidence. The same seed gives the same bits.
///
/// It is for integrands that cubature does not reach: more than two dimensions, or steps (visibility).
/// The error falls about as 1/n for smooth ones, n^(-3/4) for steps in two dimensions.
/// Who needs it: the page on what accuracy costs; the tests of closed forms.
///
/// ```
/// use radiometry::{Tolerance, quadrature::quasi_monte_carlo};
/// // The ball's share of its cube: π/6.
/// let inside = |p: &[f64; 3]| f64::from(p.iter().map(|x| (2.0 * x - 1.0).powi(2)).sum::<f64>() < 1.0);
/// let share = quasi_monte_carlo(inside, 7, Tolerance::from_relative(1e-2)?)?;
/// assert!((share.value - std::f64::consts::PI / 6.0).abs() <= share.error_bound);
/// # Ok::<(), radiometry::EstimateError>(())
/// ```
pub fn quasi_monte_carlo<const D: usize>(
    mut integrand: impl FnMut(&[f64; D]) -> f64,
    seed: u64,
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    let mut sobol = Sobol::<D>::new()?;
    let shifts: [[u64; D]; SHIFTS] = core::array::from_fn(|shift| {
        core::array::from_fn(|dimension| random(seed, (shift * D + dimension) as u64))
    });
    let mut sums = [Sum::default(); SHIFTS];
    let (mut points, mut round) = (0, FIRST_ROUND);
    let mut so_far = None;
    loop {
        if (points + round).saturating_mul(SHIFTS) > tolerance.budget() {
            let nothing = Estimate { value: 0.0, error_bound: f64::INFINITY, evaluations: 0 };
            return so_far.unwrap_or(nothing).within(tolerance);
        }
        for _ in 0..round {
            let point = sobol.next_point();
            for (sum, shift) in sums.iter_mut().zip(&shifts) {
                let at = core::array::from_fn(|d| shifted(point[d], shift[d]));
                sum.add(integrand(&at));
            }
        }
        points += round;
        // Sobol's points are balanced at powers of two: double each time.
        round = points;
        let estimate = interval(sums.map(|sum| sum.value() / points as f64), points * SHIFTS)?;
        if estimate.meets(tolerance) {
            return Ok(estimate);
        }
        so_far = Some(estimate);
    }
}

/// Mean and half-width of the means of the shifts.
fn interval(means: [f64; SHIFTS], evaluations: usize) -> Result<Estimate, EstimateError> {
    let count = SHIFTS as f64;
    let value = means.into_iter().collect::<Sum>().value() / count;
    if !value.is_finite() {
        return Err(EstimateError::Integrand { value });
    }
    let squares: f64 = means.iter().map(|mean| (mean - value) * (mean - value)).sum();
    let deviation_of_mean = (squares / (count * (count - 1.0))).sqrt();
    let rounding = 4.0 * f64::EPSILON * value.abs();
    Ok(Estimate { value, error_bound: STUDENT.mul_add(deviation_of_mean, rounding), evaluations })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_dimension_puts_one_point_into_each_stratum() {
        let mut sobol = Sobol::<DIMENSIONS_MAX>::new().unwrap();
        let mut seen = [[false; 1024]; DIMENSIONS_MAX];
        for _ in 0..1024 {
            let point = sobol.next_point();
            for (strata, coordinate) in seen.iter_mut().zip(point) {
                strata[(coordinate >> 22) as usize] = true;
            }
        }
        assert!(seen.iter().flatten().all(|hit| *hit));
        assert!(Sobol::<11>::new().is_err());
        assert!(Sobol::<0>::new().is_err());
    }

    #[test]
    fn the_bound_holds_for_as_many_seeds_as_it_says() {
        // ∏ (1 + (x_k - ½)) over five dimensions is 1.
        let integrand = |p: &[f64; 5]| p.iter().map(|x| 0.5 + x).product::<f64>();
        let tolerance = Tolerance::from_relative(1e-3).unwrap();
        let misses = (0..300)
            .filter(|seed| {
                let estimate = quasi_monte_carlo(integrand, *seed, tolerance).unwrap();
                (estimate.value - 1.0).abs() > estimate.error_bound
            })
            .count();
        assert!(misses <= 2, "{misses} of 300 outside of 99.9 %");
    }

    #[test]
    fn one_seed_has_one_answer() {
        let run = |seed| {
            quasi_monte_carlo(|p: &[f64; 2]| p[0] * p[1], seed, Tolerance::default().tightened(1e5))
                .map(|estimate| estimate.value.to_bits())
        };
        assert_eq!(run(1), run(1));
        assert_ne!(run(1), run(2));
    }
}
