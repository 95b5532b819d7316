//! An environment map whose pixels all have one solid angle: the octahedral map of the sphere to a square
//! that keeps areas. It does not know how exact an answer shall be: it is told.
//!
//! Source: Clarberg 2008, *Fast equal-area mapping of the (hemi)sphere using SIMD*, as in Pharr, Jakob and
//! Humphreys 2023, *Physically based rendering*, 4th ed., section 3.8.3. With u, v in [-1, 1], a = |u|,
//! b = |v| and r = 1 - |1 - a - b|, a place of the square is the direction with |z| = 1 - r², below the
//! equator where a + b > 1, and with azimuth (π/4)(1 + (b - a)/r) in the quadrant of the signs of u and v.
//!
//! Folded into one eighth of the sphere, dω = 2r dr dφ, a pixel lies between curves φ = πb/2r, and
//! everything about it is an integral over r alone.

use core::f64::consts::{FRAC_PI_2, PI};
use core::marker::PhantomData;
use std::sync::OnceLock;

use glam::DVec3;

use super::folded::Pixel;
use super::{EnvironmentError, checked, contour};
use crate::direction::normalised;
use crate::domain::{DomainError, finite_vector};
use crate::estimate::{Estimate, EstimateError, Tolerance};
use crate::quadrature::{Sum, adaptive_noisy, gauss_legendre};
use crate::quantity::{Radiance, Radiometric, SolidAngle, Weighting};

/// Rounding of a pixel's moments, in units of 2⁻⁵² of its solid angle.
const ULPS: f64 = 16.0;
/// How far apart two directions of a pixel are at most, times the side in pixels: along r the map
/// stretches a step by 2 at most, across it by π/√2, and a step of one pixel in both u and v is 2/side in
/// each.
const ACROSS: f64 = 9.2;
/// Diagonals from the pole on which a pixel's moments take the longer of two Gauss rules.
const NEAR_POLE: usize = 8;

/// Radiance by side x side pixels of 4π/side² each, row after row: u grows with the column, towards +x,
/// v with the row, towards +y; the pole +z is in the middle, -z in the corners. A pixel is uniform.
/// Who needs it: the simulator, for lit samples; the page on environment maps.
///
/// ```
/// use glam::DVec3;
/// use radiometry::Tolerance;
/// use radiometry::environment::EqualArea;
/// use radiometry::quantity::Radiance;
/// let white = EqualArea::new(4, &[Radiance::from_w_per_m2_sr(2.0); 16])?;
/// let found = white.irradiance(DVec3::new(1.0, 2.0, 3.0), Tolerance::default())?;
/// assert!((found.value - 2.0 * std::f64::consts::PI).abs() <= found.error_bound);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct EqualArea<W: Weighting = Radiometric> {
    /// Half of the side in pixels.
    half: usize,
    radiance: Vec<f64>,
    /// ∫ ω dω over the pixels of the quadrant u, v > 0: u after u, each by v.
    moments: Vec<DVec3>,
    weighting: PhantomData<W>,
}

impl<W: Weighting> EqualArea<W> {
    /// From the radiances row after row. Refused: a side that is 0, odd or more than 2¹³ pixels, another
    /// number of radiances than side², one that is negative or no finite number.
    pub fn new(side: usize, radiance: &[Radiance<W>]) -> Result<Self, EnvironmentError> {
        let radiance = checked(side, side, radiance)?;
        if side % 2 == 1 {
            return Err(EnvironmentError::Odd { side });
        }
        let half = side / 2;
        Ok(Self { half, radiance, moments: moments(half), weighting: PhantomData })
    }

    /// Pixels along each side.
    pub fn side(&self) -> usize {
        2 * self.half
    }

    /// Of every pixel, 4π/side².
    /// Who needs it: whoever adds a map up pixel by pixel.
    pub fn pixel_solid_angle(&self) -> SolidAngle {
        SolidAngle::from_sr(self.solid_angle_sr())
    }

    fn solid_angle_sr(&self) -> f64 {
        PI / (self.half * self.half) as f64
    }

    /// What comes from a direction (of any length but 0): its pixel's radiance.
    /// Who needs it: the simulator, for what a sample reflects.
    pub fn radiance(&self, towards: DVec3) -> Result<Radiance<W>, DomainError> {
        let towards = unit("direction", towards)?;
        let across = towards.x * towards.x + towards.y * towards.y;
        // 1 - |z| without a difference.
        let r = (across / (1.0 + towards.z.abs())).sqrt();
        let b = libm::atan2(towards.y.abs(), towards.x.abs()) / FRAC_PI_2 * r;
        let a = r - b;
        let (a, b) = if towards.z < 0.0 { (1.0 - b, 1.0 - a) } else { (a, b) };
        let place = |along: f64, sign: f64| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "0 to side"
            )]
            let index = ((1.0 + libm::copysign(along, sign)) * self.half as f64) as usize;
            index.min(self.side() - 1)
        };
        let (column, row) = (place(a, towards.x), place(b, towards.y));
        Ok(Radiance::from_amount(self.radiance[row * self.side() + column]))
    }

    /// Irradiance ∫ L cos θ dω, W·m⁻² (of a map of luminance lx), on a receiver with a normal of any
    /// length but 0. Pixels above the horizon are known to rounding, and what the horizon leaves of the
    /// others to some ulp of the whole; where that is not enough it is integrated, and the tolerance
    /// is for the whole.
    /// Who needs it: the simulator, for lit samples; the page on environment maps.
    pub fn irradiance(
        &self,
        normal: DVec3,
        tolerance: Tolerance,
    ) -> Result<Estimate, EstimateError> {
        let normal = unit("normal", normal)?;
        let (above, cut) = self.sorted(normal);
        let quick = self.with_contours(above, &cut, normal, tolerance)?;
        if quick.meets(tolerance) {
            return Ok(quick);
        }
        let fine = self.with_integrals(above, &cut, normal, tolerance)?;
        let best = if fine.error_bound < quick.error_bound { fine } else { quick };
        best.within(tolerance)
    }

    /// What is above the horizon, and of the other pixels what their contours tell.
    fn with_contours(
        &self,
        above: Estimate,
        cut: &[Pixel],
        normal: DVec3,
        tolerance: Tolerance,
    ) -> Result<Estimate, EstimateError> {
        let (mut total, mut left) = (Total::new(above), Vec::new());
        for pixel in cut {
            let folded = pixel.folded(normal);
            let moment = self.moments[pixel.i * self.half + pixel.j];
            let error_bound = ULPS * f64::EPSILON * self.solid_angle_sr();
            let whole = Estimate { value: folded.dot(moment), error_bound, evaluations: 0 };
            match contour::visible(pixel, self.half, whole, folded) {
                Some(seen) => total.add(seen, pixel.radiance),
                None => left.push(*pixel),
            }
        }
        self.with_integrals(total.estimate()?, &left, normal, tolerance)
    }

    /// The same with integrals over the pixels, each to its share of the tolerance.
    fn with_integrals(
        &self,
        above: Estimate,
        cut: &[Pixel],
        normal: DVec3,
        tolerance: Tolerance,
    ) -> Result<Estimate, EstimateError> {
        let bright: f64 = cut.iter().map(|pixel| pixel.radiance).sum();
        let share = tolerance.allowed(above.value) / bright;
        let mut total = Total::new(above);
        for pixel in cut {
            let budget = tolerance.budget().saturating_sub(total.evaluations).max(1);
            let wanted =
                Tolerance::new(0.5 * tolerance.relative(), (0.5 * share).min(f64::MAX), budget)?;
            match self.visible(pixel, normal, wanted) {
                Ok(seen) | Err(EstimateError::Unmet { estimate: seen, .. }) => {
                    total.add(seen, pixel.radiance);
                }
                Err(error) => return Err(error),
            }
        }
        Ok(total.estimate()?)
    }

    /// The irradiance from the pixels wholly above the horizon, and those that it may cut.
    fn sorted(&self, normal: DVec3) -> (Estimate, Vec<Pixel>) {
        let solid_angle = self.solid_angle_sr();
        let side = self.side();
        let doubtful = ACROSS / side as f64;
        let (mut sum, mut bright, mut cut) = (Sum::default(), Sum::default(), Vec::new());
        for (row, radiances) in self.radiance.chunks(side).enumerate() {
            for (column, radiance) in radiances.iter().enumerate().filter(|(_, l)| **l > 0.0) {
                let pixel = Pixel::new(row, column, self.half, *radiance);
                let moment = self.moments[pixel.i * self.half + pixel.j];
                let seen = pixel.folded(normal).dot(moment);
                let is_above = seen > doubtful * solid_angle || {
                    let is_below = seen < -doubtful * solid_angle;
                    // From its middle no direction is farther than half of that.
                    let elevation =
                        if is_below { -1.0 } else { normal.dot(pixel.middle(self.half)) };
                    if elevation.abs() <= 0.5 * doubtful {
                        cut.push(pixel);
                    }
                    elevation > 0.5 * doubtful
                };
                if is_above {
                    sum.add(radiance * seen);
                    bright.add(*radiance);
                }
            }
        }
        let error_bound = ULPS * f64::EPSILON * solid_angle * bright.value();
        (Estimate { value: sum.value(), error_bound, evaluations: 0 }, cut)
    }

    /// The projected solid angle of the part of a pixel above the horizon.
    fn visible(
        &self,
        pixel: &Pixel,
        normal: DVec3,
        tolerance: Tolerance,
    ) -> Result<Estimate, EstimateError> {
        let folded = pixel.folded(normal);
        let triangles = pixel.triangles(self.half);
        let over = |t: f64| {
            let (mut value, mut noise) = (0.0, 0.0);
            for triangle in &triangles {
                let (part, its_noise) = triangle.visible(t, folded);
                value += part;
                noise += its_noise;
            }
            (value, noise)
        };
        let mut points = Vec::with_capacity(12);
        for triangle in &triangles {
            triangle.breaks(folded, 1.0 / self.half as f64, &mut points);
        }
        points.extend([0.0, 1.0 / self.half as f64]);
        points.sort_by(f64::total_cmp);
        points.dedup();
        adaptive_noisy(over, &points, tolerance)
    }
}

/// An irradiance that grows by pixels.
struct Total {
    sum: Sum,
    error_bound: f64,
    evaluations: usize,
}

impl Total {
    fn new(above: Estimate) -> Self {
        let mut sum = Sum::default();
        sum.add(above.value);
        Self { sum, error_bound: above.error_bound, evaluations: above.evaluations }
    }

    fn add(&mut self, seen: Estimate, radiance: f64) {
        self.sum.add(radiance * seen.value);
        self.error_bound += radiance * seen.error_bound;
        self.evaluations += seen.evaluations;
    }

    fn estimate(&self) -> Result<Estimate, DomainError> {
        let (value, error_bound) = (self.sum.value().max(0.0), self.error_bound);
        if value.is_finite() && error_bound.is_finite() {
            Ok(Estimate { value, error_bound, evaluations: self.evaluations })
        } else {
            Err(DomainError::Overflow { result: "irradiance" })
        }
    }
}

fn unit(argument: &'static str, vector: DVec3) -> Result<DVec3, DomainError> {
    normalised(finite_vector(argument, vector)?).ok_or(DomainError::ZeroVector { argument })
}

/// ∫ ω dω over every pixel of the quadrant.
fn moments(half: usize) -> Vec<DVec3> {
    static RULES: OnceLock<[Vec<(f64, f64)>; 2]> = OnceLock::new();
    let [short, long] = RULES.get_or_init(|| [gauss_legendre(8), gauss_legendre(16)]);
    let step = 1.0 / half as f64;
    let mut moments = Vec::with_capacity(half * half);
    for (i, j) in (0..half).flat_map(|i| (0..half).map(move |j| (i, j))) {
        let pixel = Pixel { sign_x: 1.0, sign_y: 1.0, i, j, radiance: 0.0 };
        let from_pole = (i + j).min(2 * (half - 1) - i - j);
        let rule = if from_pole < NEAR_POLE { long } else { short };
        let mut sums = [Sum::default(); 3];
        for triangle in pixel.triangles(half) {
            for (node, weight) in rule {
                let t = 0.5 * step * (1.0 + node);
                let part = triangle.moment(t) * (0.5 * step * weight);
                part.to_array().iter().zip(&mut sums).for_each(|(part, sum)| sum.add(*part));
            }
        }
        moments.push(DVec3::from_array(sums.map(Sum::value)));
    }
    moments
}
