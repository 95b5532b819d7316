//! Solid angle of a disk from beside its axis: complete elliptic integrals of the first and the third
//! kind (Paxton 1959, "Solid angle calculation for a circular disk", Rev. Sci. Instrum. 30:254), in
//! Carlson's form; where their terms cancel, the same solid angle as an integral of something
//! positive. It does not know the receiver's orientation: that is `projected`.

use core::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

use super::elliptic::{rf, rj};
use crate::domain::{DomainError, finite_vector, not_negative};
use crate::projected::smooth;
use crate::quantity::SolidAngle;
use crate::shape::Disk;
use crate::wide::{WideVec, in_units, unit_exponent};

/// Solid angle of a disk from a point `distance_m` off its plane and `offset_m` off its axis, in [0,
/// 2π] sr. A disk of no radius has none; edge-on, it is 0 outside the rim and 2π, the limit from
/// either side, inside; on the rim itself it depends on the way there, and is refused. Within some
/// 1e-14 of itself. Who needs it: the page on solid angle; the rig's pupil seen from beside its axis.
///
/// ```
/// use radiometry::solid_angle::disk_off_axis;
/// use std::f64::consts::PI;
/// // On the axis 2π (1 - d/s), with the sides 3, 4 and 5; far away πr² cos θ/d².
/// assert!((disk_off_axis(3.0, 4.0, 0.0)?.sr() - 0.4 * PI).abs() < 1e-14);
/// let far = disk_off_axis(1e-6, 3.0, 4.0)?.sr();
/// assert!((far / (PI * 1e-12 * 0.6 / 25.0) - 1.0).abs() < 1e-12);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn disk_off_axis(
    radius_m: f64,
    distance_m: f64,
    offset_m: f64,
) -> Result<SolidAngle, DomainError> {
    let radius = not_negative("radius_m", radius_m)?;
    let distance = not_negative("distance_m", distance_m)?;
    let offset = not_negative("offset_m", offset_m)?;
    if radius == 0.0 {
        return Ok(SolidAngle::ZERO);
    }
    let unit = unit_exponent([radius, distance, offset]);
    let scaled = |length: f64| libm::scalbn(length, -unit);
    let (radius, distance, offset) = (scaled(radius), scaled(distance), scaled(offset));
    View { radius, distance, offset, past_rim: offset - radius }.solid_angle()
}

/// Solid angle of a disk in any position, seen from `point`; as [`disk_off_axis`].
/// Who needs it: as [`disk_off_axis`].
///
/// ```
/// use glam::DVec3;
/// use radiometry::{shape::Disk, solid_angle::disk_from};
/// let disk = Disk::new(DVec3::new(1.0, 2.0, 7.0), DVec3::Z, 3.0)?;
/// let found = disk_from(DVec3::new(1.0, 2.0, 3.0), &disk)?;
/// assert!((found.sr() - 0.4 * std::f64::consts::PI).abs() < 1e-14);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn disk_from(point: DVec3, disk: &Disk) -> Result<SolidAngle, DomainError> {
    finite_vector("point", point)?;
    if disk.radius_m() == 0.0 {
        return Ok(SolidAngle::ZERO);
    }
    let (center, radius) = (disk.center_m(), disk.radius_m());
    let lengths = center.to_array().into_iter().chain(point.to_array()).chain([radius]);
    let unit = unit_exponent(lengths);
    let apart = WideVec::difference(in_units(center, unit), in_units(point, unit));
    let axis = WideVec::from_vec(disk.axis());
    let axis_length = axis.length();
    let distance = apart.dot(axis).div(axis_length).to_f64().abs();
    let offset = apart.cross(axis).length().div(axis_length);
    let radius = crate::error_free::DoubleDouble::from_f64(libm::scalbn(radius, -unit));
    let past_rim = offset.sub(radius).to_f64();
    View { radius: radius.to_f64(), distance, offset: offset.to_f64(), past_rim }.solid_angle()
}

/// The disk as the point sees it, lengths in one unit.
#[derive(Debug, Clone, Copy)]
struct View {
    radius: f64,
    /// From the point to the disk's plane.
    distance: f64,
    /// From the point to the disk's axis.
    offset: f64,
    /// offset - radius, which may be known better than either.
    past_rim: f64,
}

impl View {
    fn solid_angle(self) -> Result<SolidAngle, DomainError> {
        if self.distance == 0.0 && self.past_rim == 0.0 {
            return Err(DomainError::Touching { shape: "disk's rim" });
        }
        let found = self.closed().unwrap_or_else(|| {
            if self.past_rim > 0.0 { self.beyond_rim() } else { self.within_rim() }
        });
        if (0.0..=2.0 * PI + 1e-9).contains(&found) {
            return Ok(SolidAngle::from_sr(found.min(2.0 * PI)));
        }
        Err(DomainError::Lost { result: "solid angle of a disk (sr)" })
    }

    /// With L the largest distance to the rim, c = |o - r|/(o + r) and k' the ratio of the smallest
    /// to the largest: outside the rim (2h/L)(cΠ - K), inside 2π - (2h/L)(cΠ + K), where Π = K +
    /// (1 - c²)/3 RJ(0, k'², 1, c²). None where that cancels by more than a digit or so.
    fn closed(self) -> Option<f64> {
        const CANCELLED: f64 = 0.05;
        let Self { radius, distance, offset, past_rim } = self;
        let largest = libm::hypot(distance, offset + radius);
        let ratio = libm::hypot(distance, past_rim) / largest;
        let k_squared = ratio * ratio;
        // A k' that vanishes comes with a distance that does, and their product is nothing.
        let first = if k_squared > 0.0 { rf(0.0, k_squared, 1.0) } else { 0.0 };
        let reach = 2.0 * (distance / largest);
        let c = past_rim.abs() / (offset + radius);
        // 1 - c without a difference.
        let rest = 2.0 * offset.min(radius) / (offset + radius);
        // On the cylinder over the rim both have one limit: half of the hemisphere less that.
        let third = if c * c == 0.0 {
            FRAC_PI_2
        } else {
            reach * (c * rest * (1.0 + c) / 3.0) * rj(0.0, k_squared, 1.0, c * c)
        };
        let (found, terms) = if c * c == 0.0 {
            (PI - reach * first, PI)
        } else if past_rim > 0.0 {
            (third - reach * rest * first, third)
        } else {
            (2.0 * PI - (third + reach * (1.0 + c) * first), 2.0 * PI)
        };
        (found > CANCELLED * terms).then_some(found)
    }

    /// Sector by sector of the foot's plane, h (1/s₁ - 1/s₂) dφ, s₁ and s₂ the distances of the near
    /// and of the far rim, in the angle t with r sin t = o sin φ: 8 h r² ∫ cos² t/(s₁ s₂ (s₁ + s₂)) dt.
    fn beyond_rim(self) -> f64 {
        let Self { radius, distance, offset, past_rim } = self;
        let size = libm::hypot(distance, offset + radius);
        let integral = smooth::integral(0.0, FRAC_PI_2, &|t| {
            let (sin, cos) = libm::sincos(t);
            let half_turn = libm::sin((FRAC_PI_2 - t) / 2.0);
            // o - r sin t
            let beside = past_rim + 2.0 * radius * half_turn * half_turn;
            let middle = (beside * (offset + radius * sin)).sqrt();
            let far = middle + radius * cos;
            let near = past_rim * ((offset + radius) / far);
            let (near, far) =
                (libm::hypot(distance, near) / size, libm::hypot(distance, far) / size);
            cos * cos / (near * far * (near + far))
        });
        8.0 * (distance / size) * (radius / size) * (radius / size) * integral
    }

    /// Along the rim, by its angle ψ: the foot's sector dφ = r (r - o cos ψ)/ρ² dψ, times
    /// 1 - h/s = ρ²/(s (s + h)).
    fn within_rim(self) -> f64 {
        let Self { radius, distance, offset, past_rim } = self;
        let size = libm::hypot(distance, offset + radius);
        let integral = smooth::integral(0.0, PI, &|psi| {
            let half_turn = libm::sin(psi / 2.0);
            let chord = 2.0 * half_turn * half_turn * offset;
            let rim = libm::hypot(past_rim, 2.0 * half_turn * (radius * offset).sqrt());
            let slant = libm::hypot(distance, rim);
            (chord - past_rim) / size / (slant / size * ((slant + distance) / size))
        });
        2.0 * (radius / size) * integral
    }
}
