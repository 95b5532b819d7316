//! Solid angle of cones, rings, disks, spheres, triangles and polygons, and the projected solid angle
//! of a cone about the receiver's normal. Written without the difference 1 - cos, which has no digits
//! left for small cones. Orientation of the receiver beyond that is the room next door, `projected`. For
//! the page on solid angle, and whatever here is seen under one.

mod disk;
mod elliptic;
mod triangle;

use core::f64::consts::{FRAC_PI_2, PI};

use crate::domain::{DomainError, not_negative, within};
use crate::quantity::{ProjectedSolidAngle, SolidAngle};

pub use disk::{disk_from, disk_off_axis};
pub use triangle::{polygon, triangle, triangle_signed};

/// The largest solid angle: 4π sr.
const WHOLE_SPHERE: f64 = 4.0 * PI;

/// Solid angle of a cone: 4π sin²(h/2), h the half angle in [0, π].
/// Who needs it: the page on solid angle.
///
/// ```
/// use radiometry::solid_angle::cone;
/// assert_eq!(cone(std::f64::consts::PI)?.sr(), 4.0 * std::f64::consts::PI);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn cone(half_angle_rad: f64) -> Result<SolidAngle, DomainError> {
    let half_angle = within("half_angle_rad", half_angle_rad, 0.0, PI)?;
    let chord = 2.0 * libm::sin(half_angle / 2.0);
    Ok(SolidAngle::from_sr(PI * chord * chord))
}

/// Projected solid angle of a cone about the receiver's normal: π sin² h; the hemisphere's π from
/// h = π/2 on, since the horizon cuts the rest off.
/// Who needs it: the page on projected solid angle: π sin² h.
///
/// ```
/// use radiometry::solid_angle::cone_projected;
/// let quarter = cone_projected(std::f64::consts::FRAC_PI_6)?;
/// assert!((quarter.sr() - std::f64::consts::PI / 4.0).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn cone_projected(half_angle_rad: f64) -> Result<ProjectedSolidAngle, DomainError> {
    let half_angle = within("half_angle_rad", half_angle_rad, 0.0, PI)?;
    let sin = libm::sin(half_angle.min(FRAC_PI_2));
    Ok(ProjectedSolidAngle::from_sr(PI * sin * sin))
}

/// Half angle of the cone of a solid angle in [0, 4π] sr: 2 asin √(Ω/4π).
/// Who needs it: the page on solid angle: how wide a source of so many steradians is.
///
/// ```
/// use radiometry::{quantity::SolidAngle, solid_angle::cone_half_angle};
/// let hemisphere = SolidAngle::from_sr(2.0 * std::f64::consts::PI);
/// assert!((cone_half_angle(hemisphere)? - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn cone_half_angle(solid_angle: SolidAngle) -> Result<f64, DomainError> {
    let solid_angle = within("solid_angle_sr", solid_angle.sr(), 0.0, WHOLE_SPHERE)?;
    Ok(2.0 * libm::asin((solid_angle / WHOLE_SPHERE).sqrt().min(1.0)))
}

/// Solid angle between two cones about one axis: 4π sin((a+b)/2) sin((b-a)/2), half angles
/// 0 <= a <= b <= π.
/// Who needs it: the page on solid angle: zones of a goniometer.
///
/// ```
/// use radiometry::solid_angle::annulus;
/// // From the horizon to 120°: 2π (cos 90° - cos 120°).
/// let zone = annulus(std::f64::consts::FRAC_PI_2, 2.0 * std::f64::consts::FRAC_PI_3)?;
/// assert!((zone.sr() - std::f64::consts::PI).abs() < 1e-14);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn annulus(inner_rad: f64, outer_rad: f64) -> Result<SolidAngle, DomainError> {
    let outer = within("outer_rad", outer_rad, 0.0, PI)?;
    let inner = within("inner_rad", inner_rad, 0.0, outer)?;
    let middle = libm::sin(f64::midpoint(inner, outer));
    Ok(SolidAngle::from_sr(WHOLE_SPHERE * middle * libm::sin((outer - inner) / 2.0)))
}

/// Solid angle of a disk seen from its axis: 2π r²/(s(s+d)), s = √(r²+d²). A disk of no radius
/// has none, from any distance; one touched by the receiver fills the hemisphere. From beside the
/// axis: [`disk_off_axis`].
/// Who needs it: the page on solid angle: a pupil from its axis.
///
/// ```
/// use radiometry::solid_angle::disk;
/// // 2π (1 - d/s) with the sides 3, 4 and 5.
/// assert!((disk(3.0, 4.0)?.sr() - 0.4 * std::f64::consts::PI).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn disk(radius_m: f64, distance_m: f64) -> Result<SolidAngle, DomainError> {
    let radius = not_negative("radius_m", radius_m)?;
    let distance = not_negative("distance_m", distance_m)?;
    if radius == 0.0 {
        return Ok(SolidAngle::ZERO);
    }
    // By quarters, so that neither slant nor slant + distance overflows.
    let (radius, distance) = (radius / 4.0, distance / 4.0);
    let slant = libm::hypot(radius, distance);
    Ok(SolidAngle::from_sr(2.0 * PI * (radius / slant) * (radius / (slant + distance))))
}

/// Solid angle of a sphere from a point at `distance_m` from its centre, on its surface or outside:
/// 4π sin²(σ/2) = 2π (r/d)²/(1 + cos σ) with cos σ = √((d-r)(d+r))/d. 2π on the surface; from inside,
/// which is refused, it would be all directions.
/// Who needs it: the page on solid angle: the Sun.
///
/// ```
/// use radiometry::solid_angle::sphere;
/// // 2π (1 - cos σ) with the sides 3, 4 and 5.
/// assert!((sphere(3.0, 5.0)?.sr() - 0.4 * std::f64::consts::PI).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn sphere(radius_m: f64, distance_m: f64) -> Result<SolidAngle, DomainError> {
    let radius = not_negative("radius_m", radius_m)?;
    let distance = not_negative("distance_m", distance_m)?;
    if radius == 0.0 {
        return Ok(SolidAngle::ZERO);
    }
    if distance < radius {
        return Err(DomainError::Inside { shape: "sphere", distance_m, radius_m });
    }
    let sin = radius / distance;
    let cos = ((distance - radius) / distance * (1.0 + sin)).sqrt();
    Ok(SolidAngle::from_sr(2.0 * PI * sin * (sin / (1.0 + cos))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::float_cmp, reason = "the claim is exactness")]
    fn whole_cones_have_whole_answers() {
        assert_eq!(cone_projected(FRAC_PI_2).unwrap().sr(), PI);
        assert_eq!(cone_projected(3.0).unwrap().sr(), PI);
        assert_eq!(cone_half_angle(SolidAngle::from_sr(WHOLE_SPHERE)).unwrap(), PI);
        assert_eq!(disk(1.0, 0.0).unwrap().sr(), 2.0 * PI);
        assert_eq!(disk(0.0, 0.0).unwrap(), SolidAngle::ZERO);
    }

    #[test]
    fn what_has_no_meaning_is_refused_with_its_value() {
        assert_eq!(
            cone(-0.1),
            Err(DomainError::Outside {
                argument: "half_angle_rad",
                value: -0.1,
                low: 0.0,
                high: PI
            })
        );
        assert!(annulus(0.2, 0.1).is_err());
        assert!(disk(f64::NAN, 1.0).is_err());
        assert!(disk(1.0, f64::INFINITY).is_err());
    }
}
