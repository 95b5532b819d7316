//! Lobes around axes off the normal: L = b + Σ wᵢ cosⁿγᵢ, where γᵢ is the angle to the lobe's axis; a
//! lobe ends at 90° from its axis.

use core::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use radiometry::direction::{angles, frame, normalised};
use radiometry::quadrature::adaptive_between;
use radiometry::{EstimateError, Tolerance};

use super::cosine;

/// A lobe that ends with a kink at 90° from its axis has no curvature there: none is wider.
pub const LOBE_EXPONENT_MIN: f64 = 2.0;

/// How near to the largest radiance a search comes, as a part of it.
const PEAK_FOUND: f64 = 1e-12;

/// One of several lobes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lobe {
    /// A unit vector at most 90° from the normal +z.
    pub axis: DVec3,
    /// n, at least [`LOBE_EXPONENT_MIN`].
    pub exponent: f64,
    /// Along its axis; at least 0.
    pub weight: f64,
}

impl Lobe {
    /// n of a lobe of this full width at half maximum, radians: cosⁿ(w/2) = 1/2.
    pub fn exponent_of_width(width_rad: f64) -> f64 {
        -core::f64::consts::LN_2 / libm::log(libm::cos(width_rad / 2.0))
    }

    fn value(&self, direction: DVec3) -> f64 {
        let cos = self.axis.dot(direction);
        if cos <= 0.0 { 0.0 } else { self.weight * libm::pow(cos.min(1.0), self.exponent) }
    }

    fn tilt_rad(&self) -> f64 {
        angles(self.axis).0
    }

    /// The angles to its axis of all directions up to θ from the normal.
    fn gammas(&self, theta_rad: f64) -> (f64, f64) {
        let tilt = self.tilt_rad();
        ((tilt - theta_rad).clamp(0.0, FRAC_PI_2), (tilt + theta_rad).min(FRAC_PI_2))
    }

    /// ∫ cosⁿγ cos θ dω over directions up to θ from the normal: rings around the lobe's axis, of
    /// which the part inside is in closed form.
    fn exitance_within(&self, theta_rad: f64) -> f64 {
        let tilt = self.tilt_rad();
        if tilt == 0.0 {
            return cosine::exitance_within(self.exponent, theta_rad);
        }
        let (sin_tilt, cos_tilt) = libm::sincos(tilt);
        let cos_max = if theta_rad >= FRAC_PI_2 { 0.0 } else { libm::cos(theta_rad) };
        // On the ring, cos θ = a + b cos ψ; inside is where that is above cos θ max.
        let ring = |gamma: f64| {
            let (sin, cos) = libm::sincos(gamma);
            let (a, b) = (cos_tilt * cos, sin_tilt * sin);
            let inside = if a - b >= cos_max {
                2.0 * PI * a
            } else if a + b <= cos_max {
                0.0
            } else {
                let psi = libm::acos(((cos_max - a) / b).clamp(-1.0, 1.0));
                2.0 * (a * psi + b * libm::sin(psi))
            };
            libm::pow(cos, self.exponent) * sin * inside
        };
        let (from, to) = self.gammas(theta_rad);
        let width = 1.0 / libm::sqrt(self.exponent);
        let kinks = [(theta_rad - tilt).abs(), theta_rad + tilt, width, 4.0 * width];
        let mut points = vec![from, to];
        points.extend(kinks.into_iter().filter(|gamma| *gamma > from && *gamma < to));
        points.sort_by(f64::total_cmp);
        points.dedup();
        if points.len() < 2 {
            return 0.0;
        }
        let tolerance = Tolerance::default().tightened(1e-2);
        match adaptive_between(ring, &points, tolerance) {
            Ok(estimate) | Err(EstimateError::Unmet { estimate, .. }) => estimate.value,
            // The integrand is finite wherever it is asked for.
            Err(_) => 0.0,
        }
    }
}

/// Several lobes on a base that is the same everywhere.
#[derive(Debug, Clone, PartialEq)]
pub struct Lobes {
    base: f64,
    lobes: Vec<Lobe>,
}

impl Lobes {
    /// A base of at least 0 and at least one lobe; axes are brought to length 1. `None` outside
    /// what [`Lobe`] says.
    pub fn new(base: f64, mut lobes: Vec<Lobe>) -> Option<Self> {
        for lobe in &mut lobes {
            lobe.axis = normalised(lobe.axis)?;
            let is_sound = lobe.axis.z >= -1e-12
                && (LOBE_EXPONENT_MIN..=crate::EXPONENT_MAX).contains(&lobe.exponent)
                && lobe.weight >= 0.0
                && lobe.weight.is_finite();
            if !is_sound {
                return None;
            }
        }
        (base >= 0.0 && base.is_finite() && !lobes.is_empty()).then_some(Self { base, lobes })
    }

    /// In their order.
    pub fn lobes(&self) -> &[Lobe] {
        &self.lobes
    }

    pub(super) fn value(&self, direction: DVec3) -> f64 {
        self.base + self.lobes.iter().map(|lobe| lobe.value(direction)).sum::<f64>()
    }

    pub(super) fn exitance_within(&self, theta_rad: f64) -> f64 {
        let sin = libm::sin(theta_rad);
        let lobes = self.lobes.iter().map(|lobe| lobe.weight * lobe.exitance_within(theta_rad));
        PI * sin * sin * self.base + lobes.sum::<f64>()
    }

    pub(super) fn slope_bound(&self, theta_rad: f64) -> f64 {
        let of =
            |lobe: &Lobe| lobe.weight * cosine::slope_bound(lobe.exponent, lobe.gammas(theta_rad));
        self.lobes.iter().map(of).sum()
    }

    pub(super) fn curvature_bound(&self, theta_rad: f64) -> f64 {
        let of = |lobe: &Lobe| {
            lobe.weight * cosine::curvature_bound(lobe.exponent, lobe.gammas(theta_rad))
        };
        self.lobes.iter().map(of).sum()
    }

    /// The largest value up to θ from the normal: by halving cells of directions that could hold a
    /// larger one than is found, after what slope and curvature allow.
    pub(super) fn peak_within(&self, theta_rad: f64) -> (f64, f64, f64) {
        let curvature = self.curvature_bound(FRAC_PI_2.min(theta_rad));
        let mut best = Best { value: self.value(DVec3::Z), theta: 0.0, phi: 0.0 };
        for lobe in &self.lobes {
            let (tilt, phi) = angles(lobe.axis);
            best.offer(self, tilt.min(theta_rad), phi);
        }
        // Cells in θ and φ; the first row of halvings parts the whole.
        let mut open = vec![Cell { theta: (0.0, theta_rad), phi: (-PI, PI) }];
        let mut steps = 0;
        while let Some(cell) = open.pop() {
            let (theta, phi) = cell.middle();
            best.offer(self, theta, phi);
            let reach = cell.reach();
            let slope = self.slope_at(theta, phi) * reach;
            let most = self.at(theta, phi) + slope + curvature * reach * reach / 2.0;
            steps += 1;
            if most > best.value * (1.0 + PEAK_FOUND) && reach > 1e-9 && steps < CELLS_MAX {
                open.extend(cell.halves());
            }
        }
        best.climb(self, theta_rad);
        (best.value, best.theta, best.phi)
    }

    fn at(&self, theta: f64, phi: f64) -> f64 {
        self.value(radiometry::direction::unit(theta, phi))
    }

    fn slope_at(&self, theta: f64, phi: f64) -> f64 {
        self.gradient(radiometry::direction::unit(theta, phi)).length()
    }

    /// Along the sphere.
    fn gradient(&self, direction: DVec3) -> DVec3 {
        let of = |lobe: &Lobe| {
            let cos = lobe.axis.dot(direction);
            if cos <= 0.0 {
                return DVec3::ZERO;
            }
            let slope = lobe.weight * lobe.exponent * libm::pow(cos, lobe.exponent - 1.0);
            (lobe.axis - direction * cos) * slope
        };
        self.lobes.iter().map(of).sum()
    }
}

/// Far more cells than a search of a few lobes opens.
const CELLS_MAX: usize = 400_000;

struct Best {
    value: f64,
    theta: f64,
    phi: f64,
}

impl Best {
    fn offer(&mut self, lobes: &Lobes, theta: f64, phi: f64) {
        let value = lobes.at(theta, phi);
        if value > self.value {
            *self = Self { value, theta, phi };
        }
    }

    /// The last digits, by steps uphill that halve where they fail.
    fn climb(&mut self, lobes: &Lobes, theta_max: f64) {
        let mut step = 1e-4;
        while step > 1e-12 {
            let before = self.value;
            let here = radiometry::direction::unit(self.theta, self.phi);
            let (e, f) = frame(here);
            for across in [e, -e, f, -f] {
                let (theta, phi) = angles(here + across * step);
                self.offer(lobes, theta.min(theta_max), phi);
            }
            if self.value <= before {
                step /= 2.0;
            }
        }
    }
}

struct Cell {
    theta: (f64, f64),
    phi: (f64, f64),
}

impl Cell {
    fn middle(&self) -> (f64, f64) {
        (f64::midpoint(self.theta.0, self.theta.1), f64::midpoint(self.phi.0, self.phi.1))
    }

    /// The angle from the middle to any place in it, at most: along the meridian, then along the
    /// widest parallel.
    fn reach(&self) -> f64 {
        let across = libm::sin(self.theta.1.min(FRAC_PI_2)) * (self.phi.1 - self.phi.0);
        f64::midpoint(self.theta.1 - self.theta.0, across)
    }

    fn halves(&self) -> [Self; 2] {
        let (theta, phi) = self.middle();
        let across = libm::sin(self.theta.1.min(FRAC_PI_2)) * (self.phi.1 - self.phi.0);
        if self.theta.1 - self.theta.0 > across {
            [
                Self { theta: (self.theta.0, theta), phi: self.phi },
                Self { theta: (theta, self.theta.1), phi: self.phi },
            ]
        } else {
            [
                Self { theta: self.theta, phi: (self.phi.0, phi) },
                Self { theta: self.theta, phi: (phi, self.phi.1) },
            ]
        }
    }
}
