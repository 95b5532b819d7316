//! Irradiance from uniform sources, and the Sun. Radiance times projected solid angle: the geometry
//! is next door, in `projected`. It knows no spectrum and no atmosphere.

use crate::domain::{DomainError, positive};
use crate::estimate::{Estimate, EstimateError, Tolerance};
use crate::projected::{self, Occluder, Receiver, Source};
use crate::quantity::{Exitance, Irradiance, ProjectedSolidAngle, Radiance, Weighting};
use crate::shape::{Disk, Polygon, Sphere};
use crate::solid_angle;

/// Irradiance from a disk of uniform radiance: E = L Ω̃. Rig: a sample under a lamp's port.
///
/// ```
/// use glam::DVec3;
/// use radiometry::{irradiance, projected::Receiver, quantity::Radiance, shape::Disk};
/// // Under a wide ceiling: π L.
/// let up = Receiver::new(DVec3::ZERO, DVec3::Z)?;
/// let ceiling = Disk::new(DVec3::Z, DVec3::Z, 1e12)?;
/// let found = irradiance::from_disk(&up, &ceiling, Radiance::from_w_per_m2_sr(2.0))?;
/// assert!((found.w_per_m2() - 2.0 * std::f64::consts::PI).abs() < 1e-14);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn from_disk<W: Weighting>(
    receiver: &Receiver,
    source: &Disk,
    radiance: Radiance<W>,
) -> Result<Irradiance<W>, DomainError> {
    Ok(radiance * projected::disk(receiver, source)?)
}

/// Irradiance from a sphere of uniform radiance: E = L Ω̃.
/// Who needs it: the page on irradiance; `gonio calc`.
///
/// ```
/// use glam::DVec3;
/// use radiometry::{irradiance, projected::Receiver, quantity::Radiance, shape::Sphere};
/// // π L (r/d)².
/// let up = Receiver::new(DVec3::ZERO, DVec3::Z)?;
/// let ball = Sphere::new(DVec3::new(0.0, 0.0, 2.0), 1.0)?;
/// let found = irradiance::from_sphere(&up, &ball, Radiance::from_w_per_m2_sr(4.0))?;
/// assert!((found.w_per_m2() - std::f64::consts::PI).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn from_sphere<W: Weighting>(
    receiver: &Receiver,
    source: &Sphere,
    radiance: Radiance<W>,
) -> Result<Irradiance<W>, DomainError> {
    Ok(radiance * projected::sphere(receiver, source)?)
}

/// Irradiance from a polygon of uniform radiance: E = L Ω̃.
/// Who needs it: the page on Lambert's formula; `gonio calc`.
///
/// ```
/// use glam::DVec3;
/// use radiometry::{irradiance, projected::Receiver, quantity::Radiance, shape::Polygon};
/// // A wall from the floor up, infinitely long and high (nearly): π L/2.
/// let up = Receiver::new(DVec3::ZERO, DVec3::Z)?;
/// let wall = Polygon::new(vec![
///     DVec3::new(1.0, -1e12, 0.0),
///     DVec3::new(1.0, 1e12, 0.0),
///     DVec3::new(1.0, 1e12, 1e12),
///     DVec3::new(1.0, -1e12, 1e12),
/// ])?;
/// let found = irradiance::from_polygon(&up, &wall, Radiance::from_w_per_m2_sr(1.0))?;
/// assert!((found.w_per_m2() - std::f64::consts::FRAC_PI_2).abs() < 1e-11);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn from_polygon<W: Weighting>(
    receiver: &Receiver,
    source: &Polygon,
    radiance: Radiance<W>,
) -> Result<Irradiance<W>, DomainError> {
    Ok(radiance * projected::polygon(receiver, source)?)
}

/// Irradiance, W·m⁻² (illuminance, lx, where a luminance is given), from a source of uniform radiance
/// behind an occluder; see [`projected::occluded`] for the tolerance.
/// Who needs it: the page on umbra and penumbra; `gonio calc`.
pub fn from_occluded<W: Weighting>(
    receiver: &Receiver,
    source: &Source,
    occluder: &Occluder,
    radiance: Radiance<W>,
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    let projected = projected::occluded(receiver, source, occluder, tolerance)?;
    Ok(projected.scaled(radiance.amount()))
}

/// A uniformly bright Sun: the irradiance that it causes on a surface facing it, and the half angle
/// under which it is seen.
/// Who needs it: the simulator's lamps; the lecture's figures of the Sun.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sun {
    irradiance: Irradiance,
    projected: ProjectedSolidAngle,
    half_angle_rad: f64,
}

impl Sun {
    /// The lecture's: 1353 W/m² under a half angle of 0.25°.
    ///
    /// ```
    /// // The slide rounds to 2.25e7 W·m⁻²·sr⁻¹ and 6e-5 sr.
    /// let sun = radiometry::irradiance::Sun::lecture();
    /// assert!((sun.radiance().w_per_m2_sr() / 2.262_121_500_238_614e7 - 1.0).abs() < 1e-15);
    /// assert!((sun.projected_solid_angle().sr() / 5.981_111_093_534_464e-5 - 1.0).abs() < 1e-15);
    /// ```
    pub fn lecture() -> Self {
        let half_angle_rad = 0.25f64.to_radians();
        let sin = libm::sin(half_angle_rad);
        Self::of(1353.0, sin * sin, half_angle_rad)
    }

    /// The nominal one (IAU 2015 Resolution B3: 3.828e26 W, radius 695 700 km) from a distance
    /// between centres beyond its radius. One astronomical unit is 149 597 870 700 m.
    pub fn nominal(distance_m: f64) -> Result<Self, DomainError> {
        const FLUX_W: f64 = 3.828e26;
        const RADIUS_M: f64 = 6.957e8;
        let distance = positive("distance_m", distance_m)?;
        // Refuses a receiver inside.
        solid_angle::sphere(RADIUS_M, distance)?;
        let sin = RADIUS_M / distance;
        let sphere_m2 = 4.0 * core::f64::consts::PI * distance * distance;
        Ok(Self::of(FLUX_W / sphere_m2, sin * sin, libm::asin(sin)))
    }

    fn of(irradiance: f64, sin_square: f64, half_angle_rad: f64) -> Self {
        Self {
            irradiance: Irradiance::from_w_per_m2(irradiance),
            projected: ProjectedSolidAngle::from_sr(core::f64::consts::PI * sin_square),
            half_angle_rad,
        }
    }

    /// On a surface that faces it.
    pub fn irradiance(&self) -> Irradiance {
        self.irradiance
    }

    /// On a surface whose normal makes an angle in [0, π] with the direction to the centre of the Sun: less
    /// by the cosine while all of it is up, by the part that is up while it sets, 0 after.
    ///
    /// ```
    /// use radiometry::irradiance::Sun;
    /// let sun = Sun::lecture();
    /// let slanting = sun.irradiance_at(std::f64::consts::FRAC_PI_3)?;
    /// assert!((slanting / sun.irradiance() - 0.5).abs() < 1e-14);
    /// assert!(sun.irradiance_at(1.57)?.w_per_m2() > 0.0 && sun.irradiance_at(1.58)?.w_per_m2() == 0.0);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn irradiance_at(&self, normal_angle_rad: f64) -> Result<Irradiance, DomainError> {
        let sin = libm::sin(self.half_angle_rad);
        Ok(self.radiance() * projected::sphere_tilted(sin, 1.0, normal_angle_rad)?)
    }

    /// Half of what it subtends.
    pub fn half_angle_rad(&self) -> f64 {
        self.half_angle_rad
    }

    /// Seen from a surface that faces it.
    pub fn projected_solid_angle(&self) -> ProjectedSolidAngle {
        self.projected
    }

    /// The same from everywhere.
    pub fn radiance(&self) -> Radiance {
        self.irradiance / self.projected
    }

    /// Of its surface, a diffuse emitter's: π L.
    pub fn exitance(&self) -> Exitance {
        self.radiance().exitance_into(ProjectedSolidAngle::HEMISPHERE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: f64, expected: f64) {
        assert!((found / expected - 1.0).abs() < 1e-14, "found {found:e}, expected {expected:e}");
    }

    #[test]
    fn the_lectures_sun_has_the_slides_figures() {
        let sun = Sun::lecture();
        close(sun.half_angle_rad(), 4.363_323_129_985_824e-3);
        close(sun.projected_solid_angle().sr(), 5.981_111_093_534_464e-5);
        close(sun.radiance().w_per_m2_sr(), 2.262_121_500_238_614e7);
        close(sun.exitance().w_per_m2(), 7.106_664_286_677_152e7);
    }

    #[test]
    fn the_nominal_sun_is_as_bright_from_anywhere() {
        let earth = Sun::nominal(149_597_870_700.0).unwrap();
        close(earth.irradiance().w_per_m2(), 1.361_166_465_408_575_5e3);
        close(earth.half_angle_rad(), 4.650_484_023_614_976e-3);
        close(earth.projected_solid_angle().sr(), 6.794_273_971_369_406e-5);
        close(earth.radiance().w_per_m2_sr(), 2.003_402_381_394_15e7);
        close(earth.exitance().w_per_m2(), 6.293_874_203_572_157e7);
        let mars = Sun::nominal(2.279e11).unwrap();
        close(mars.radiance() / earth.radiance(), 1.0);
        assert!(Sun::nominal(1e8).is_err());
    }
}
