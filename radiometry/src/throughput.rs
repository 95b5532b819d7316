//! Throughput of a pair of surfaces: two small ones, and two coaxial disks, the beam of a spot detector
//! (entrance pupil and field stop, or pupil and spot); of two polygons it is the form factors' room
//! that knows. It does not know what light goes through.

use core::f64::consts::{FRAC_PI_2, PI};

use crate::domain::{DomainError, not_negative, positive, within};
use crate::quantity::{Area, FormFactor, Throughput};

/// Two parallel disks with one axis, apart. A disk may have no radius: nothing passes, and seen from
/// that point the form factor is the other's.
/// Who needs it: the rig, whose detector it is.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::struct_field_names, reason = "the unit stands last in the name")]
pub struct CoaxialDisks {
    radius_1_m: f64,
    radius_2_m: f64,
    distance_m: f64,
}

/// How the throughput answers to its three lengths: first derivatives, m·sr.
/// Who needs it: the rig, for the uncertainty of its throughput.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThroughputPartials {
    /// ∂T/∂r₁, not negative.
    pub per_radius_1: f64,
    /// ∂T/∂r₂, not negative.
    pub per_radius_2: f64,
    /// ∂T/∂h, not positive.
    pub per_distance: f64,
}

/// Throughput of two coaxial disks, m²·sr, in closed form: T = π A₁ F₁₂ = π A₂ F₂₁. Exact, near
/// (contact: π times the smaller disk's area) and far (A₁A₂/h²).
///
/// Source: the disk-to-disk form factor (Howell, catalog C-41; Walsh), its difference of nearly
/// equal terms rationalised: T = 2π² r₁² r₂² / (h² + r₁² + r₂² + q), q = √((r₁-r₂)²+h²) √((r₁+r₂)²+h²).
/// Who needs it: the simulator, for its detector.
///
/// ```
/// use radiometry::throughput::coaxial_disks;
/// // Two unit disks at unit distance: T = π² (3 - √5)/2.
/// let expected = std::f64::consts::PI.powi(2) * (3.0 - 5f64.sqrt()) / 2.0;
/// assert!((coaxial_disks(1.0, 1.0, 1.0)?.m2_sr() - expected).abs() < 1e-15 * 4.0);
/// assert!(coaxial_disks(1.0, 1.0, 0.0).is_err());
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn coaxial_disks(
    radius_1_m: f64,
    radius_2_m: f64,
    distance_m: f64,
) -> Result<Throughput, DomainError> {
    CoaxialDisks::new(radius_1_m, radius_2_m, distance_m)?.throughput()
}

/// Throughput of an infinitesimal beam, m²·sr: dT = dA cos θ dA' cos θ'/r², between two surfaces that
/// are small beside their distance, each by its area and the angle in [0, π/2] between its normal and
/// the beam. The lecture's definition of throughput; the rig's detector from far.
///
/// ```
/// use radiometry::quantity::Area;
/// use radiometry::throughput::infinitesimal_beam;
/// let (pupil, spot) = (Area::from_m2(2e-6), Area::from_m2(3e-6));
/// let throughput = infinitesimal_beam((pupil, 0.0), (spot, std::f64::consts::FRAC_PI_3), 0.5)?;
/// assert!((throughput.m2_sr() / 1.2e-11 - 1.0).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn infinitesimal_beam(
    (area_1, theta_1_rad): (Area, f64),
    (area_2, theta_2_rad): (Area, f64),
    distance_m: f64,
) -> Result<Throughput, DomainError> {
    let projected = |area: Area, theta: f64| {
        let area = not_negative("area_m2", area.m2())?;
        Ok(area * libm::cos(within("theta_rad", theta, 0.0, FRAC_PI_2)?))
    };
    let distance = positive("distance_m", distance_m)?;
    let (from, to) = (projected(area_1, theta_1_rad)?, projected(area_2, theta_2_rad)?);
    let throughput = (from / distance) * (to / distance);
    if throughput.is_finite() {
        Ok(Throughput::from_m2_sr(throughput))
    } else {
        Err(DomainError::Overflow { result: "throughput_m2_sr" })
    }
}

impl CoaxialDisks {
    /// The pair, if all three lengths are finite, the radii not negative and the distance positive.
    pub fn new(radius_1_m: f64, radius_2_m: f64, distance_m: f64) -> Result<Self, DomainError> {
        Ok(Self {
            radius_1_m: not_negative("radius_1_m", radius_1_m)?,
            radius_2_m: not_negative("radius_2_m", radius_2_m)?,
            distance_m: positive("distance_m", distance_m)?,
        })
    }

    /// The same pair seen from the other end.
    #[must_use]
    pub const fn reversed(self) -> Self {
        Self { radius_1_m: self.radius_2_m, radius_2_m: self.radius_1_m, ..self }
    }

    /// See [`coaxial_disks`]. An error only where the answer is beyond the largest double.
    pub fn throughput(self) -> Result<Throughput, DomainError> {
        let (unit_exponent, disks) = self.in_units_of_the_largest();
        let areas = disks.radius_1_m * disks.radius_2_m;
        let scaled = 2.0 * PI * PI * areas * (areas / disks.denominator());
        let throughput = libm::scalbn(scaled, 2 * unit_exponent);
        if throughput.is_finite() {
            Ok(Throughput::from_m2_sr(throughput))
        } else {
            Err(DomainError::Overflow { result: "throughput_m2_sr" })
        }
    }

    /// F₁₂, the part of the diffuse flux from disk 1 that meets disk 2, in [0, 1]:
    /// 2 r₂² / (h² + r₁² + r₂² + q).
    ///
    /// ```
    /// use radiometry::throughput::CoaxialDisks;
    /// // Equal disks one radius apart: (3 - √5) / 2.
    /// let factor = CoaxialDisks::new(1.0, 1.0, 1.0)?.form_factor();
    /// assert!((factor.ratio() - (3.0 - 5.0_f64.sqrt()) / 2.0).abs() < 1e-15);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn form_factor(self) -> FormFactor {
        let (_, disks) = self.in_units_of_the_largest();
        let radius_2 = disks.radius_2_m;
        let factor = 2.0 * radius_2 * (radius_2 / disks.denominator());
        // q >= |r₂² - r₁²| + ..., so F <= 1 but for the last rounding.
        FormFactor::from_ratio(factor.min(1.0))
    }

    /// First derivatives of the throughput, for the propagation of uncertainty:
    /// ∂T/∂h = -2hT/q, ∂T/∂r₁ = π² r₁ (q - g)/q with g = h² + r₁² - r₂²; since
    /// q² - g² = 4 r₂² h², the difference is 4 r₂² h²/(q + g) where it would cancel.
    ///
    /// ```
    /// use radiometry::throughput::CoaxialDisks;
    /// // Far apart T = π² r₁² r₂²/h², so that ∂T/∂h = -2T/h.
    /// let far = CoaxialDisks::new(1.0, 2.0, 1e6)?;
    /// let slope = far.partials()?.per_distance;
    /// assert!((slope / (-2.0 * far.throughput()?.m2_sr() / 1e6) - 1.0).abs() < 1e-10);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn partials(self) -> Result<ThroughputPartials, DomainError> {
        let (unit_exponent, disks) = self.in_units_of_the_largest();
        let q = disks.product_of_slants();
        let areas = disks.radius_1_m * disks.radius_2_m;
        let distance = disks.distance_m;
        let throughput = 2.0 * PI * PI * areas * (areas / disks.denominator());
        let scale = |partial: f64| libm::scalbn(partial, unit_exponent);
        let partials = ThroughputPartials {
            per_radius_1: scale(disks.per_radius_1()),
            per_radius_2: scale(disks.reversed().per_radius_1()),
            per_distance: scale(-2.0 * (distance / q) * throughput),
        };
        let finite = partials.per_radius_1.is_finite()
            && partials.per_radius_2.is_finite()
            && partials.per_distance.is_finite();
        if finite {
            Ok(partials)
        } else {
            Err(DomainError::Overflow { result: "derivative of throughput_m2_sr" })
        }
    }

    fn per_radius_1(self) -> f64 {
        let Self { radius_1_m: radius_1, radius_2_m: radius_2, distance_m: distance } = self;
        let q = self.product_of_slants();
        let g = distance.mul_add(distance, (radius_1 - radius_2) * (radius_1 + radius_2));
        let difference_over_q = if g > 0.0 {
            let twice = 2.0 * radius_2 * (distance / q);
            twice * (2.0 * radius_2 * (distance / (q + g)))
        } else {
            (q - g) / q
        };
        PI * PI * radius_1 * difference_over_q
    }

    /// h² + r₁² + r₂² + q, the same to the bit from either end.
    fn denominator(self) -> f64 {
        let radii = self.radius_1_m * self.radius_1_m + self.radius_2_m * self.radius_2_m;
        radii + self.distance_m * self.distance_m + self.product_of_slants()
    }

    /// q: nearest times farthest distance between the rims.
    fn product_of_slants(self) -> f64 {
        libm::hypot(self.radius_1_m - self.radius_2_m, self.distance_m)
            * libm::hypot(self.radius_1_m + self.radius_2_m, self.distance_m)
    }

    /// The pair in a unit of length that is a power of two, the largest length in [1, 2): squares
    /// can neither overflow nor all underflow, and no digit changes.
    fn in_units_of_the_largest(self) -> (i32, Self) {
        let exponent = libm::ilogb(self.radius_1_m.max(self.radius_2_m).max(self.distance_m));
        let scale = |length: f64| libm::scalbn(length, -exponent);
        let scaled = Self {
            radius_1_m: scale(self.radius_1_m),
            radius_2_m: scale(self.radius_2_m),
            distance_m: scale(self.distance_m),
        };
        (exponent, scaled)
    }
}
