//! How far a beam reaches on a plane that it meets at an angle. It does not know weights: only
//! where rays can be.

use core::f64::consts::FRAC_PI_2;

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
    // The reach along the axis is a line between the disks, and two beyond them.
    let (stop, pupil) = (beam.stop_radius_m(), beam.pupil_radius_m());
    let (z_stop, h) = (beam.stop_z_m(), beam.separation_m());
    let widening = (stop + pupil) / h;
    // Away from the detector, before the stop: reach = r + k (z_stop - z).
    let at_origin = stop + widening * z_stop;
    let far = at_origin / (cos - widening * sin);
    // Towards the detector: first the same line, falling; beyond the stop, from r to R.
    let before_stop = at_origin / (cos + widening * sin);
    let slope = (pupil - stop) / h;
    let near = if before_stop * sin <= z_stop {
        before_stop
    } else {
        (stop - slope * z_stop) / (cos - slope * sin)
    };
    let meets = cos > widening * sin && cos > slope * sin && near * sin < z_stop + h;
    if !meets || !far.is_finite() || !near.is_finite() {
        return Ok(None);
    }
    let across_m = beam.reach_m(-far * sin).max(beam.reach_m(near * sin));
    Ok(Some(Footprint { near_m: near, far_m: far, across_m }))
}
