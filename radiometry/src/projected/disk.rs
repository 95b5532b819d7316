//! A disk in any position and tilt, clipped by the receiver's horizon.
//!
//! All of it above the horizon: the irradiance vector in closed form (Howell, Catalog of
//! configuration factors, B-12 and its perpendicular twin), its differences taken out. Cut: the
//! integral over the chords parallel to the horizon, each chord in closed form, nothing cancelling.

use core::f64::consts::{FRAC_PI_2, PI};

use super::{Receiver, of_hemisphere, smooth};
use crate::domain::{DomainError, not_negative, within};
use crate::error_free::DoubleDouble;
use crate::quantity::ProjectedSolidAngle;
use crate::shape::Disk;
use crate::wide::{WideVec, cross, in_units, length, unit_exponent};

/// Projected solid angle of a disk in any position; 0 from its plane outside it. Refused: a receiver
/// on the disk itself. Rig: the pupil seen from a tilted sample.
///
/// ```
/// use glam::DVec3;
/// use radiometry::projected::{self, Receiver};
/// use radiometry::shape::Disk;
/// let up = Receiver::new(DVec3::ZERO, DVec3::Z)?;
/// let pupil = Disk::new(DVec3::Z, DVec3::Z, 1.0)?;
/// let found = projected::disk(&up, &pupil)?;
/// assert!((found.sr() - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn disk(receiver: &Receiver, disk: &Disk) -> Result<ProjectedSolidAngle, DomainError> {
    if disk.radius_m() == 0.0 {
        return Ok(ProjectedSolidAngle::ZERO);
    }
    let view = View::of(receiver, disk);
    if view.distance == 0.0 {
        return if view.offset > view.radius {
            Ok(ProjectedSolidAngle::ZERO)
        } else {
            Err(DomainError::Touching { shape: "disk" })
        };
    }
    of_hemisphere(view.projected())
}

/// Projected solid angle of a disk parallel to the receiver, `distance_m` above it, its axis
/// `offset_m` aside: 2π r² h²/(B (B + A)), A = h² + o² - r², B the nearest times the farthest
/// distance of the rim (Howell B-12). A receiver that touches the disk sees π.
/// Who needs it: the page on projected solid angle: a lamp over a bench.
///
/// ```
/// use radiometry::projected::disk_parallel;
/// assert!((disk_parallel(1.0, 1.0, 0.0)?.sr() - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn disk_parallel(
    radius_m: f64,
    distance_m: f64,
    offset_m: f64,
) -> Result<ProjectedSolidAngle, DomainError> {
    let radius = not_negative("radius_m", radius_m)?;
    let distance = not_negative("distance_m", distance_m)?;
    let offset = not_negative("offset_m", offset_m)?;
    if radius == 0.0 {
        return Ok(ProjectedSolidAngle::ZERO);
    }
    if distance == 0.0 && (offset - radius).abs() == 0.0 {
        return Err(DomainError::Touching { shape: "disk's rim" });
    }
    let unit = unit_exponent([radius, distance, offset]);
    let scale = |length: f64| libm::scalbn(length, -unit);
    let (radius, distance, offset) = (scale(radius), scale(distance), scale(offset));
    let view = View { offset, ..View::on_axis(radius, distance, 1.0, 0.0) };
    of_hemisphere(view.uncut())
}

/// Projected solid angle of a disk whose axis goes through the receiver, the receiver's normal at
/// `normal_angle_rad` in [0, π] to the direction of the disk's centre (Howell B-13 where the horizon
/// cuts it).
/// Who needs it: the page on projected solid angle: the pupil seen from a tilted sample.
///
/// ```
/// use radiometry::projected::disk_tilted;
/// // Uncut: cos α times the one straight on.
/// let found = disk_tilted(1.0, 3.0, std::f64::consts::FRAC_PI_3)?;
/// assert!((found.sr() - std::f64::consts::PI / 20.0).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn disk_tilted(
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
    if distance == 0.0 {
        return Err(DomainError::Touching { shape: "disk" });
    }
    let unit = unit_exponent([radius, distance]);
    let (sin, cos) = libm::sincos(angle);
    let scale = |length: f64| libm::scalbn(length, -unit);
    let view = View::on_axis(scale(radius), scale(distance), cos, sin);
    of_hemisphere(view.projected())
}

/// The disk as the receiver sees it, lengths in one unit. m: the disk's axis, pointing away from the
/// receiver; s: the steepest rise above the horizon in the disk's plane; k: across both.
#[derive(Debug, Clone, Copy)]
struct View {
    radius: f64,
    /// From the receiver to the disk's plane.
    distance: f64,
    /// From the foot of that perpendicular to the disk's centre.
    offset: f64,
    /// Of the angle between the receiver's normal and m.
    cos_tilt: f64,
    sin_tilt: f64,
    /// Of the centre, of the highest and of the lowest point of the rim above the horizon.
    center_height: f64,
    top_height: f64,
    bottom_height: f64,
    /// The foot, along s from the centre.
    foot: f64,
    /// The centre, along k from the receiver; without its sign.
    aside: f64,
}

impl View {
    fn on_axis(radius: f64, distance: f64, cos_tilt: f64, sin_tilt: f64) -> Self {
        Self {
            radius,
            distance,
            offset: 0.0,
            cos_tilt,
            sin_tilt,
            center_height: cos_tilt * distance,
            top_height: cos_tilt * distance + sin_tilt * radius,
            bottom_height: cos_tilt * distance - sin_tilt * radius,
            foot: 0.0,
            aside: 0.0,
        }
    }

    fn of(receiver: &Receiver, disk: &Disk) -> Self {
        let (center, point) = (disk.center_m(), receiver.point_m());
        let unit = unit_exponent(
            center.to_array().into_iter().chain(point.to_array()).chain([disk.radius_m()]),
        );
        let center = WideVec::difference(in_units(center, unit), in_units(point, unit));
        let radius = libm::scalbn(disk.radius_m(), -unit);
        let axis_length = length(disk.axis());
        let distance = WideVec::from_vec(disk.axis()).dot(center).to_f64() / axis_length;
        let axis = if distance < 0.0 { -disk.axis() } else { disk.axis() };

        let normal = receiver.normal();
        let normal_length = length(normal);
        let (wide_axis, wide_normal) = (WideVec::from_vec(axis), WideVec::from_vec(normal));
        let tilt = cross(axis, normal);
        let tilt_length = length(tilt);
        let center_height = wide_normal.dot(center);
        // The rim's rise over the centre, in the units of the normal as given.
        let rise = wide_normal.cross(wide_axis).length().mul(DoubleDouble::from_f64(radius));
        let rise = rise.div(wide_axis.length());
        let (foot, aside) = if tilt_length > 0.0 {
            let across = tilt / tilt_length;
            let steepest = cross(across, axis) / axis_length;
            (
                -WideVec::from_vec(steepest).dot(center).to_f64(),
                WideVec::from_vec(across).dot(center).to_f64().abs(),
            )
        } else {
            (0.0, 0.0)
        };
        Self {
            radius,
            distance: distance.abs(),
            offset: length(wide_axis.cross(center).to_vec()) / axis_length,
            cos_tilt: wide_normal.dot(wide_axis).to_f64() / normal_length / axis_length,
            sin_tilt: tilt_length / normal_length / axis_length,
            center_height: center_height.to_f64() / normal_length,
            top_height: center_height.add(rise).to_f64() / normal_length,
            bottom_height: center_height.sub(rise).to_f64() / normal_length,
            foot,
            aside,
        }
    }

    fn projected(&self) -> f64 {
        if self.bottom_height >= 0.0 {
            self.uncut()
        } else if self.top_height <= 0.0 {
            0.0
        } else {
            self.cut()
        }
    }

    /// The irradiance vector along the normal. With S = h² + o² + r², A = S - 2r² and
    /// B² = S² - 4r²o² = A² + 4r²h², its part along m is (π/2)(1 - A/B), that from the foot
    /// towards the centre 2π r² h o/(B (S + B)).
    fn uncut(&self) -> f64 {
        let Self { radius, distance, offset, cos_tilt, center_height, .. } = *self;
        let slants =
            libm::hypot(distance, offset - radius) * libm::hypot(distance, offset + radius);
        let a = distance.mul_add(distance, (offset - radius) * (offset + radius));
        let s = distance.mul_add(distance, offset.mul_add(offset, radius * radius));
        let view = 2.0 * PI * radius * (radius * (distance / slants));
        let along = cos_tilt * distance;
        if a > 0.0 {
            let square = 2.0 * radius * (radius / (slants + a));
            view * (center_height + along * square) / (slants + s)
        } else {
            FRAC_PI_2 * cos_tilt * (1.0 - a / slants)
                + view * (center_height - along) / (slants + s)
        }
    }

    /// ∫ sin ε dε ∫ cos² τ dτ: ε the elevation of the half-plane through a chord, τ the angle from
    /// its middle. The chord at s = r cos t; angles count from the foot if it is near, so that a
    /// receiver close to the disk resolves it.
    fn cut(&self) -> f64 {
        let Self { radius, distance, foot, .. } = *self;
        let lowest_part = self.top_height / (2.0 * self.sin_tilt * radius);
        let lowest = 2.0 * libm::asin(lowest_part.clamp(0.0, 1.0).sqrt());
        if foot.abs() >= radius || distance > 0.1 * radius {
            return smooth::integral(0.0, lowest, &|t| {
                let above =
                    radius * libm::sin(f64::midpoint(lowest, t)) * libm::sin((lowest - t) / 2.0);
                let (sin_half, sin) = (libm::sin(t / 2.0), libm::sin(t));
                let from_foot = (radius - foot) - 2.0 * radius * sin_half * sin_half;
                self.chord(2.0 * self.sin_tilt * above, from_foot, radius * sin)
            });
        }
        let start = libm::acos(foot / radius);
        let foot_over_horizon = self.cos_tilt * distance / self.sin_tilt;
        let reach = foot_over_horizon / (2.0 * radius * libm::sin(f64::midpoint(lowest, start)));
        let reach = 2.0 * libm::asin(reach.clamp(-1.0, 1.0));
        let at = |turn: f64| {
            let (sin_half, sin) = (libm::sin(turn / 2.0), libm::sin(start + turn));
            let from_foot = -2.0 * radius * libm::sin(start + turn / 2.0) * sin_half;
            let height = self.cos_tilt.mul_add(distance, self.sin_tilt * from_foot).max(0.0);
            self.chord(height, from_foot, radius * sin)
        };
        smooth::integral(-start, reach.min(0.0), &at) + smooth::integral(0.0, reach, &at)
    }

    /// The integrand at one chord, by t: its height above the horizon, its distance along s from
    /// the foot, half its length.
    fn chord(&self, height: f64, from_foot: f64, half_length: f64) -> f64 {
        let distance = libm::hypot(self.distance, from_foot);
        // Angles from k, the near end's the larger.
        let near = libm::atan2(distance, self.aside - half_length);
        let far = libm::atan2(distance, self.aside + half_length);
        let square =
            distance.mul_add(distance, (self.aside - half_length) * (self.aside + half_length));
        let angle = libm::atan2(2.0 * half_length * distance, square);
        let sin_middle = libm::sin(f64::midpoint(near, far));
        let width = less_sine(angle) / 2.0 + libm::sin(angle) * sin_middle * sin_middle;
        let slant = distance * distance * distance;
        height * self.distance * half_length / slant * width
    }
}

/// x - sin x for x not below 0, without the difference where it cancels.
pub(super) fn less_sine(x: f64) -> f64 {
    if x > 1.0 {
        return x - libm::sin(x);
    }
    // x³/3! - x⁵/5! + …, to x²¹.
    let square = x * x;
    let mut sum = 1.0;
    for k in (1..=9).rev() {
        let k = f64::from(k);
        sum = 1.0 - square / ((2.0 * k + 2.0) * (2.0 * k + 3.0)) * sum;
    }
    x * square / 6.0 * sum
}
