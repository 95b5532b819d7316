//! Rays through plane or spherical layers, from the invariant that the layers' symmetry gives:
//! n sin θ stays in plane ones (Snell), n r sin θ in spherical ones (Bouguer 1729). The path is then
//! an integral over the level, whose integrand has an integrable singularity where the ray turns
//! back. It knows neither what the layers are made of nor what the ray carries.
//!
//! With q = n (plane) or n r (spherical) and β the invariant, everything stands on q² - β² = (q cos θ)².
//! It is never a difference of squares here: from an anchor, where it is known (the start) or zero
//! (the turning point), it is its value there plus (q - q₀)(q + q₀), and the profile says q - q₀.
//! The anchor is the end where it is the smaller, and the integral runs in the root of the
//! distance from there, in which it is smooth.

use core::cell::Cell;
use core::f64::consts::FRAC_PI_2;

use crate::domain::{DomainError, finite, positive, within};
use crate::estimate::{Estimate, EstimateError, Tolerance};
use crate::quadrature::adaptive_noisy;

use super::checked_index;
use super::profile::IndexProfile;

/// A medium in layers of equal index.
/// Who needs it: the page on radiance along curved rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stratified<P> {
    profile: P,
    is_spherical: bool,
}

/// A ray at a level of such a medium, on its way either up or down.
/// Who needs it: the page on radiance along curved rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StratifiedRay<'a, P> {
    medium: &'a Stratified<P>,
    level_m: f64,
    sin: f64,
    /// q² - β² at the start.
    radicand: f64,
    /// q there.
    q: f64,
}

/// A ray's way to a level, or to where it turns before.
/// Who needs it: the page on radiance along curved rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leg {
    /// Where it ends, m: at the level asked for, or where the ray turns.
    pub end_level_m: f64,
    /// Bound of its error, m: 0 but where the ray turns.
    pub end_level_error_m: f64,
    /// Whether the ray turns there. It goes back as it came: mirrored.
    pub turns: bool,
    /// How far the ray gets along the layers: m for plane ones, for spherical ones the angle at their
    /// centre, rad.
    pub across: Estimate,
    /// ∫ n ds along the ray, m.
    pub optical_path_m: Estimate,
}

/// Where q² - β² is known best, and what it is there.
#[derive(Debug, Clone, Copy)]
struct Anchor {
    level_m: f64,
    radicand: f64,
    noise: f64,
    /// Of the level itself; only that of a turning point is not given.
    level_noise_m: f64,
}

impl<P: IndexProfile> Stratified<P> {
    /// Plane layers; a level is a height, m.
    pub const fn plane(profile: P) -> Self {
        Self { profile, is_spherical: false }
    }

    /// Spherical layers; a level is the distance from their centre, m, above 0.
    pub const fn spherical(profile: P) -> Self {
        Self { profile, is_spherical: true }
    }

    /// The ray through a level at an angle to the layers' normal, radians in [0, π/2]; whether it goes
    /// up or down is said when it is followed. An index outside 1 to 1000 is refused.
    ///
    /// ```
    /// use radiometry::interface::{LinearProfile, Stratified};
    /// // From n = 1.5 at 30°, thinning by 0.1 a metre: n sin θ is 0.75.
    /// let medium = Stratified::plane(LinearProfile::new(1.5, -0.1)?);
    /// let ray = medium.ray(0.0, std::f64::consts::FRAC_PI_6)?;
    /// assert!((ray.invariant() - 0.75).abs() < 1e-15);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn ray(&self, level_m: f64, theta_rad: f64) -> Result<StratifiedRay<'_, P>, DomainError> {
        let theta = within("theta_rad", theta_rad, 0.0, FRAC_PI_2)?;
        let level_m = self.checked_level(level_m)?;
        let q = checked_index(self.profile.index(level_m))? * self.radius(level_m);
        let (sin, cos) = libm::sincos(theta);
        // The double nearest π/2 stands for it: the ray along its layer.
        let cos = if theta < FRAC_PI_2 { cos } else { 0.0 };
        Ok(StratifiedRay { medium: self, level_m, sin, radicand: (q * cos) * (q * cos), q })
    }

    fn checked_level(&self, level_m: f64) -> Result<f64, DomainError> {
        if self.is_spherical { positive("level_m", level_m) } else { finite("level_m", level_m) }
    }

    /// What θ's sine is multiplied with besides the index.
    fn radius(&self, level_m: f64) -> f64 {
        if self.is_spherical { level_m } else { 1.0 }
    }

    /// q at level + rise, less q at the level, with a bound of its rounding.
    fn difference(&self, level_m: f64, rise_m: f64) -> (f64, f64) {
        let (difference, noise) = self.profile.difference(level_m, rise_m);
        if !self.is_spherical {
            return (difference, noise);
        }
        let (by_radius, by_index) =
            (self.profile.index(level_m) * rise_m, (level_m + rise_m) * difference);
        let rounding = f64::EPSILON * (by_radius.abs() + by_index.abs());
        (by_radius + by_index, rounding + (level_m + rise_m) * noise)
    }

    /// q² - β² at a rise above the anchor, with a bound of its rounding.
    fn radicand(&self, anchor: Anchor, rise_m: f64) -> (f64, f64) {
        let level_m = anchor.level_m + rise_m;
        let q = |level_m: f64| self.profile.index(level_m) * self.radius(level_m);
        let (difference, noise) = self.difference(anchor.level_m, rise_m);
        let sum = q(level_m) + q(anchor.level_m);
        let more = difference * sum;
        let rounding = 2.0 * f64::EPSILON * (anchor.radicand + more.abs());
        (anchor.radicand + more, anchor.noise + rounding + noise * sum)
    }
}

impl<P: IndexProfile> StratifiedRay<'_, P> {
    /// n sin θ of a ray in plane layers; n r sin θ, m, in spherical ones. The same all along.
    pub fn invariant(&self) -> f64 {
        self.q * self.sin
    }

    /// The angle between the ray and the layers' normal at another level, radians in [0, π/2]; none
    /// if the ray turns before.
    ///
    /// ```
    /// use radiometry::interface::{LinearProfile, Stratified};
    /// let medium = Stratified::plane(LinearProfile::new(1.5, -0.1)?);
    /// let ray = medium.ray(0.0, std::f64::consts::FRAC_PI_6)?;
    /// assert!((ray.angle_at(3.0)?.unwrap() - (0.75f64 / 1.2).asin()).abs() < 1e-15);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn angle_at(&self, level_m: f64) -> Result<Option<f64>, DomainError> {
        let level_m = self.medium.checked_level(level_m)?;
        checked_index(self.medium.profile.index(level_m))?;
        let (radicand, _) = self.medium.radicand(self.start(), level_m - self.level_m);
        Ok((radicand >= 0.0).then(|| libm::atan2(self.invariant(), radicand.sqrt())))
    }

    /// Where the ray turns back on its way to a level, m; none if it gets there. The profile has to
    /// be such that q (the index, times the radius for spherical layers) falls all the way where it
    /// falls at all: of several turning points one would be found, not always the first.
    pub fn turning_level_m(&self, limit_m: f64) -> Result<Option<f64>, DomainError> {
        let limit_m = self.medium.checked_level(limit_m)?;
        checked_index(self.medium.profile.index(limit_m))?;
        let at = |level_m: f64| self.medium.radicand(self.start(), level_m - self.level_m).0;
        if limit_m.to_bits() == self.level_m.to_bits() || at(limit_m) > 0.0 {
            return Ok(None);
        }
        if self.radicand == 0.0 && at(limit_m) == 0.0 {
            let expected = "an index that changes along its way";
            return Err(DomainError::Placing { argument: "the ray", expected });
        }
        let (mut open, mut shut) = (self.level_m, limit_m);
        loop {
            let middle = f64::midpoint(open, shut);
            if middle <= open.min(shut) || middle >= open.max(shut) {
                return Ok(Some(open));
            }
            if at(middle) > 0.0 {
                open = middle;
            } else {
                shut = middle;
            }
        }
    }

    /// Follows the ray to a level, or to where it turns before (see
    /// [`turning_level_m`](Self::turning_level_m) for what is asked of the profile). Each integral to
    /// the tolerance, each with up to its budget.
    ///
    /// Errors: levels and indices outside their domain; a ray along a layer in which the index does
    /// not vary, which gets nowhere; a profile that turns the ray at several levels; a tolerance that is not met.
    ///
    /// ```
    /// use radiometry::Tolerance;
    /// use radiometry::interface::{LinearProfile, Stratified};
    /// // Over a hot road: the index rises by g with height, the ray at grazing comes up again.
    /// let (n, g) = (1.0003, 1e-5);
    /// let air = Stratified::plane(LinearProfile::new(n, g)?);
    /// let leg = air.ray(1.0, 1.568)?.leg(0.0, Tolerance::default())?;
    /// // A catenary: x = (β/g) acosh(n/β) from the turning point on.
    /// let beta = (n + g) * 1.568f64.sin();
    /// let expected = beta / g * ((n + g) / beta).acosh();
    /// assert!(leg.turns && (leg.across.value / expected - 1.0).abs() < 1e-9);
    /// # Ok::<(), radiometry::EstimateError>(())
    /// ```
    pub fn leg(&self, limit_m: f64, tolerance: Tolerance) -> Result<Leg, EstimateError> {
        let turning = self.turning_level_m(limit_m)?;
        let end_level_m = turning.unwrap_or(limit_m);
        let way = end_level_m - self.level_m;
        let (radicand, noise) = self.medium.radicand(self.start(), way);
        let (anchor, rise) = if turning.is_some() {
            (self.turning_anchor(end_level_m), -way)
        } else if radicand < self.radicand {
            (Anchor { level_m: end_level_m, radicand, noise, level_noise_m: 0.0 }, -way)
        } else {
            (self.start(), way)
        };
        let across = self.integral(anchor, rise, tolerance, |ray, level_m| {
            ray.invariant() / ray.medium.radius(level_m)
        })?;
        let optical_path_m = self.integral(anchor, rise, tolerance, |ray, level_m| {
            let index = ray.medium.profile.index(level_m);
            index * (index * ray.medium.radius(level_m))
        })?;
        let end_level_error_m = if turning.is_some() { anchor.level_noise_m } else { 0.0 };
        Ok(Leg { end_level_m, end_level_error_m, turns: turning.is_some(), across, optical_path_m })
    }

    fn start(&self) -> Anchor {
        let noise = 4.0 * f64::EPSILON * self.radicand;
        Anchor { level_m: self.level_m, radicand: self.radicand, noise, level_noise_m: 0.0 }
    }

    /// There, q² - β² is nothing; that it is there and not a little beside is counted to first
    /// order, by the slope over the last thousandth of the way.
    fn turning_anchor(&self, level_m: f64) -> Anchor {
        let anchor = Anchor { level_m, radicand: 0.0, noise: 0.0, level_noise_m: 0.0 };
        let back = (self.level_m - level_m) / 1000.0;
        let (_, noise) = self.medium.radicand(self.start(), level_m - self.level_m);
        let (risen, _) = self.medium.radicand(anchor, back);
        let by_slope = if risen > 0.0 { noise / risen * back.abs() } else { 0.0 };
        Anchor { level_noise_m: by_slope + f64::EPSILON * level_m.abs(), ..anchor }
    }

    /// ∫ f/√(q² - β²) over the levels from the anchor to a rise above it.
    fn integral(
        &self,
        anchor: Anchor,
        rise_m: f64,
        tolerance: Tolerance,
        numerator: impl Fn(&Self, f64) -> f64,
    ) -> Result<Estimate, EstimateError> {
        if rise_m == 0.0 {
            return Ok(Estimate { value: 0.0, error_bound: 0.0, evaluations: 0 });
        }
        let refused = Cell::new(None);
        let refuse = |error: DomainError| {
            refused.set(Some(error));
            (f64::NAN, 0.0)
        };
        let integrand = |root: f64| {
            let rise = (root * root).copysign(rise_m);
            let level_m = anchor.level_m + rise;
            if let Err(error) = checked_index(self.medium.profile.index(level_m)) {
                return refuse(error);
            }
            let (radicand, noise) = self.medium.radicand(anchor, rise);
            if radicand <= 0.0 {
                return refuse(DomainError::Placing {
                    argument: "the ray",
                    expected: "an index that changes along its way, with one turning point",
                });
            }
            let value = 2.0 * root * numerator(self, level_m) / radicand.sqrt();
            (value, value * (0.5 * noise / radicand + 4.0 * f64::EPSILON))
        };
        let ends = [0.0, rise_m.abs().sqrt()];
        let found = adaptive_noisy(integrand, &ends, tolerance);
        if let Some(error) = refused.take() {
            return Err(error.into());
        }
        let found = found?;
        let misplaced = 2.0 * found.value * (anchor.level_noise_m / rise_m).abs();
        Estimate { error_bound: found.error_bound + misplaced, ..found }.within(tolerance)
    }
}
