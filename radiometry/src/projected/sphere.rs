//! A sphere in any position, clipped by the receiver's horizon. Everything is written for the cap of
//! directions that it fills: half angle σ about a centre at the elevation e over the horizon.

use core::f64::consts::PI;

use super::{Receiver, of_hemisphere, smooth};
use crate::domain::{DomainError, not_negative, within};
use crate::error_free::DoubleDouble;
use crate::quantity::ProjectedSolidAngle;
use crate::shape::Sphere;
use crate::wide::{WideVec, cross, in_units, length, unit_exponent};

/// How much larger than their sum the closed form's terms may be.
const CANCELLATION: f64 = 32.0;

/// Projected solid angle of a sphere, in any position, from its surface or outside: π sin² σ sin e
/// where all of it is above the horizon. Cut by it: the classic factor between an element and a
/// sphere (Howell, Catalog of configuration factors, section B), and where that cancels its integral
/// over elevation. A receiver inside is refused. Sim: a spherical source; the Sun.
/// Who needs it: the page on projected solid angle: the Sun at the horizon.
///
/// ```
/// use glam::DVec3;
/// use radiometry::projected::{self, Receiver};
/// use radiometry::shape::Sphere;
/// let up = Receiver::new(DVec3::ZERO, DVec3::Z)?;
/// let ball = Sphere::new(DVec3::new(0.0, 0.0, 2.0), 1.0)?;
/// let found = projected::sphere(&up, &ball)?;
/// assert!((found.sr() - std::f64::consts::FRAC_PI_4).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn sphere(receiver: &Receiver, sphere: &Sphere) -> Result<ProjectedSolidAngle, DomainError> {
    if sphere.radius_m() == 0.0 {
        return Ok(ProjectedSolidAngle::ZERO);
    }
    let cap = Cap::seen(receiver, sphere)?;
    of_hemisphere(cap.projected())
}

/// The same from the sphere's radius, the distance of its centre and the angle in [0, π] between the
/// receiver's normal and the direction to the centre.
/// Who needs it: the page on projected solid angle: the Sun at the horizon.
///
/// ```
/// use radiometry::projected::sphere_tilted;
/// let found = sphere_tilted(1.0, 2.0, std::f64::consts::FRAC_PI_3)?;
/// assert!((found.sr() - std::f64::consts::PI / 8.0).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn sphere_tilted(
    radius_m: f64,
    distance_m: f64,
    normal_angle_rad: f64,
) -> Result<ProjectedSolidAngle, DomainError> {
    let radius = not_negative("radius_m", radius_m)?;
    let distance = not_negative("distance_m", distance_m)?;
    let angle = within("normal_angle_rad", normal_angle_rad, 0.0, PI)?;
    if radius == 0.0 {
        return Ok(ProjectedSolidAngle::ZERO);
    }
    if distance < radius {
        return Err(DomainError::Inside { shape: "sphere", distance_m, radius_m });
    }
    let sin = radius / distance;
    let (sin_angle, cos_angle) = libm::sincos(angle);
    let cap = Cap {
        sin,
        cos: ((distance - radius) / distance * (1.0 + sin)).sqrt(),
        sin_elevation: cos_angle,
        cos_elevation: sin_angle,
    };
    of_hemisphere(cap.projected())
}

/// A cap of directions, by the sines and cosines of its half angle and of its centre's elevation.
#[derive(Debug, Clone, Copy)]
struct Cap {
    sin: f64,
    cos: f64,
    sin_elevation: f64,
    cos_elevation: f64,
}

impl Cap {
    fn seen(receiver: &Receiver, sphere: &Sphere) -> Result<Self, DomainError> {
        let (center, point) = (sphere.center_m(), receiver.point_m());
        let unit = unit_exponent(
            center.to_array().into_iter().chain(point.to_array()).chain([sphere.radius_m()]),
        );
        let center = WideVec::difference(in_units(center, unit), in_units(point, unit));
        let radius = DoubleDouble::from_f64(libm::scalbn(sphere.radius_m(), -unit));
        let distance = center.length();
        let clear = distance.sub(radius).mul(distance.add(radius)).to_f64();
        let distance = distance.to_f64();
        if clear < 0.0 || distance == 0.0 {
            return Err(DomainError::Inside {
                shape: "sphere",
                distance_m: libm::scalbn(distance, unit),
                radius_m: sphere.radius_m(),
            });
        }
        let normal = receiver.normal();
        let normal_length = length(normal);
        let height = WideVec::from_vec(normal).dot(center).to_f64();
        Ok(Self {
            sin: radius.to_f64() / distance,
            cos: clear.sqrt() / distance,
            sin_elevation: height / normal_length / distance,
            cos_elevation: length(cross(normal, center.to_vec())) / normal_length / distance,
        })
    }

    fn projected(self) -> f64 {
        let Self { sin, cos, sin_elevation, .. } = self;
        if sin_elevation >= sin {
            return PI * sin * sin * sin_elevation;
        }
        if sin_elevation <= -sin {
            return 0.0;
        }
        let half_width = ((sin - sin_elevation) * (sin + sin_elevation)).sqrt();
        let terms = [
            libm::atan2(half_width, cos),
            sin * sin * sin_elevation * libm::atan2(half_width, -cos * sin_elevation),
            -cos * half_width,
        ];
        let sum: f64 = terms.iter().sum();
        let magnitude: f64 = terms.iter().map(|term| term.abs()).sum();
        if sum * CANCELLATION >= magnitude { sum } else { self.integral() }
    }

    /// ∫ sin ε (τ + sin τ cos τ) dε over the elevation ε = e + σ cos t above the horizon, τ the half
    /// width of the cap there about the horizontal line across: cos τ = cos σ / cos(σ cos t).
    fn integral(self) -> f64 {
        let sigma = libm::atan2(self.sin, self.cos);
        let elevation = libm::atan2(self.sin_elevation, self.cos_elevation);
        let lowest = 2.0 * libm::asin(((sigma + elevation) / (2.0 * sigma)).clamp(0.0, 1.0).sqrt());
        smooth::integral(0.0, lowest, &|t| {
            let above =
                2.0 * sigma * libm::sin(f64::midpoint(lowest, t)) * libm::sin((lowest - t) / 2.0);
            let (sin_half, cos_half) = libm::sincos(t / 2.0);
            let sines =
                libm::sin(sigma * sin_half * sin_half) * libm::sin(sigma * cos_half * cos_half);
            let ratio = sines / libm::cos(sigma * libm::cos(t));
            let half_width = 2.0 * libm::asin(ratio.clamp(0.0, 1.0).sqrt());
            let (sin_width, cos_width) = libm::sincos(half_width);
            let across = sin_width.mul_add(cos_width, half_width);
            libm::sin(above) * across * sigma * libm::sin(t)
        })
    }
}
