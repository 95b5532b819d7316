//! How far a beam reaches on a plane that it meets at an angle. It does not know weights: only
//! where rays can be.

use core::f64::consts::FRAC_PI_2;

use glam::DVec3;

use super::Beam;
use crate::domain::{DomainError, within};

/// A rectangle that holds every point where a ray of the beam meets a tilted plane through the
/// beam's origin, metres from there; all are at least 0.
/// Who needs it: the simulator, to know whether a spot runs over an edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Footprint {
    /// In the plane of incidence, on the detector's side.
    pub near_m: f64,
    /// In the plane of incidence, away from the detector.
    pub far_m: f64,
    /// To either side.
    pub across_m: f64,
}

/// The footprint of a beam on a plane through its origin whose normal is `theta_rad`, in [0, π/2],
/// from the axis. `None` where some ray never meets the plane, or not before the stop.
///
/// A ray at the place u along the plane stands u cos θ from the axis and -u sin θ along it: it
/// can't be further from the axis than the beam reaches there. With k = (R + r)/h that is, for a
/// spot at the origin, u = r/(cos θ - k sin θ) on the far side: more than the ellipse's r/cos θ,
/// which is its limit for a small pupil and spot.
/// Who needs it: the simulator, to know whether a spot runs over an edge.
///
/// ```
/// use radiometry::beam::{Beam, footprint};
/// let beam = Beam::of_spot(0.00625, 0.0025, 0.3)?;
/// let theta = 85_f64.to_radians();
/// let reach = footprint(&beam, theta)?.expect("it meets the plane");
/// let ellipse = 0.0025 / theta.cos();
/// assert!(reach.far_m > 1.4 * ellipse && reach.near_m > 1.1 * ellipse);
/// assert!(footprint(&beam, 89_f64.to_radians())?.is_none());
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn footprint(beam: &Beam, theta_rad: f64) -> Result<Option<Footprint>, DomainError> {
    let theta = within("theta_rad", theta_rad, 0.0, FRAC_PI_2)?;
    let (sin, cos) = libm::sincos(theta);
    Ok(of_tilt(beam, sin, cos))
}

/// As [`footprint`], of the sine and cosine of the angle between normal and axis.
pub(super) fn of_tilt(beam: &Beam, sin: f64, cos: f64) -> Option<Footprint> {
    // The reach along the axis is convex: three lines, with the steepest at either end.
    let (stop, pupil) = (beam.stop_radius_m(), beam.pupil_radius_m());
    let (z_stop, h) = (beam.stop_z_m(), beam.separation_m());
    let (steepest, between) = ((stop + pupil) / h, (pupil - stop) / h);
    if cos <= steepest * sin || z_stop + h <= 0.0 {
        return None;
    }
    // Where u cos θ meets the line r + slope (z - z_stop), with z = side u sin θ.
    let meet = |slope: f64, side: f64| (stop - slope * z_stop) / (cos - side * slope * sin);
    let on_side = |side: f64, first: f64, then: f64| {
        let u = meet(first, side);
        // Whether the line's part of the axis has ended before.
        let has_passed = if side > 0.0 { u * sin > z_stop } else { -u * sin < z_stop };
        if has_passed { meet(then, side) } else { u }
    };
    let far = if z_stop >= 0.0 { meet(-steepest, -1.0) } else { on_side(-1.0, between, -steepest) };
    let near = if z_stop >= 0.0 { on_side(1.0, -steepest, between) } else { meet(between, 1.0) };
    let is_before_pupil = near * sin < z_stop + h;
    if !is_before_pupil || !far.is_finite() || !near.is_finite() {
        return None;
    }
    let across_m = beam.reach_m(-far * sin).max(beam.reach_m(near * sin));
    Some(Footprint { near_m: near, far_m: far, across_m })
}

impl Footprint {
    /// Of a placed beam on the plane z = 0, from where its axis meets that: see [`footprint`].
    /// `None` also for an axis that never meets it.
    ///
    /// ```
    /// use glam::DVec3;
    /// use radiometry::beam::{Beam, Footprint};
    /// let beam = Beam::of_spot(0.00625, 0.0025, 0.3)?;
    /// // Straight from above it is the spot, also where that stands a little off the plane.
    /// let on = Footprint::on_plane(&beam, DVec3::ZERO, DVec3::Z).expect("it meets the plane");
    /// assert_eq!(on.far_m, 0.0025);
    /// let above = Footprint::on_plane(&beam, DVec3::Z * 0.01, DVec3::Z).expect("so does this");
    /// assert!((above.far_m - (0.0025 + 0.01 * 0.00875 / 0.3)).abs() < 1e-15);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn on_plane(beam: &Beam, spot: DVec3, direction: DVec3) -> Option<Self> {
        let cos = direction.z;
        if cos <= 0.0 {
            return None;
        }
        let sin = libm::hypot(direction.x, direction.y);
        // The origin, moved along the axis to where that meets the plane.
        of_tilt(&beam.with_origin_moved(-spot.z / cos), sin, cos)
    }

    /// The largest distance of any point.
    pub fn radius_m(&self) -> f64 {
        libm::hypot(self.near_m.max(self.far_m), self.across_m)
    }
}
