//! The beam of a spot detector: every ray through two coaxial disks. What a detector reads is the
//! mean radiance over these rays, weighted with their throughput, times the throughput of all.
//!
//! The two disks are the entrance pupil and the field stop's image (the spot, at the stated distance
//! across the axis), or the two apertures of a tube. It does not know where the beam points, nor what
//! the rays meet. For the page on the spot detector and whoever averages a field over its footprint.
//!
//! Frame of a beam: the axis is +z towards the detector; the origin is the point of the axis at
//! which the detector looks. Lengths in metres.

mod directions;
mod footprint;
mod rule;

use glam::{DMat3, DVec3};

use crate::domain::{DomainError, finite, positive};
use crate::quantity::Throughput;
use crate::throughput::CoaxialDisks;

pub use footprint::{Footprint, footprint};
pub use rule::{BeamRay, BeamRule, Moments, disk_rule};

/// Two coaxial disks, and where the beam is looked at.
/// Who needs it: the detector's model: the rig's, the simulator's and the fit's.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::struct_field_names, reason = "the unit stands last in the name")]
pub struct Beam {
    pupil_radius_m: f64,
    stop_radius_m: f64,
    /// From the stop to the pupil, along the axis.
    separation_m: f64,
    /// Of the stop, from the origin.
    stop_z_m: f64,
}

impl Beam {
    /// The rays through an entrance pupil and a spot of these radii, at this distance from each
    /// other. All positive and finite. The origin is the spot's centre.
    ///
    /// ```
    /// use radiometry::beam::Beam;
    /// let beam = Beam::of_spot(0.00625, 0.0025, 0.3)?;
    /// // Nearly A₁A₂/h².
    /// let far = (std::f64::consts::PI * 0.00625 * 0.0025 / 0.3).powi(2);
    /// assert!((beam.throughput()?.m2_sr() / far - 1.0).abs() < 1e-3);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn of_spot(
        pupil_radius_m: f64,
        spot_radius_m: f64,
        distance_m: f64,
    ) -> Result<Self, DomainError> {
        Ok(Self {
            pupil_radius_m: positive("pupil_radius_m", pupil_radius_m)?,
            stop_radius_m: positive("spot_radius_m", spot_radius_m)?,
            separation_m: positive("distance_m", distance_m)?,
            stop_z_m: 0.0,
        })
    }

    /// The rays through the two apertures of a tube: the rear one at the detector, the front one
    /// `separation_m` before it, the origin `distance_m` before the front one (0 for a tube that
    /// touches it).
    ///
    /// ```
    /// use radiometry::beam::Beam;
    /// // A tube that touches its spot is a spot detector.
    /// let tube = Beam::of_tube(0.01, 0.002, 0.2, 0.0)?;
    /// assert_eq!(tube, Beam::of_spot(0.01, 0.002, 0.2)?);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn of_tube(
        rear_radius_m: f64,
        front_radius_m: f64,
        separation_m: f64,
        distance_m: f64,
    ) -> Result<Self, DomainError> {
        let distance_m = finite("distance_m", distance_m)?;
        if distance_m < 0.0 {
            return Err(DomainError::Negative { argument: "distance_m", value: distance_m });
        }
        Ok(Self {
            pupil_radius_m: positive("rear_radius_m", rear_radius_m)?,
            stop_radius_m: positive("front_radius_m", front_radius_m)?,
            separation_m: positive("separation_m", separation_m)?,
            stop_z_m: distance_m,
        })
    }

    /// The same beam, its origin moved along the axis towards the detector (away for a negative
    /// number).
    #[must_use]
    pub fn with_origin_moved(self, towards_detector_m: f64) -> Self {
        Self { stop_z_m: self.stop_z_m - towards_detector_m, ..self }
    }

    /// Of the disk at the detector, metres.
    pub const fn pupil_radius_m(&self) -> f64 {
        self.pupil_radius_m
    }

    /// Of the other disk, metres.
    pub const fn stop_radius_m(&self) -> f64 {
        self.stop_radius_m
    }

    /// From the stop to the pupil, metres.
    pub const fn separation_m(&self) -> f64 {
        self.separation_m
    }

    /// The stop's place on the axis, metres from the origin.
    pub const fn stop_z_m(&self) -> f64 {
        self.stop_z_m
    }

    /// The pupil's place on the axis, metres from the origin.
    pub const fn pupil_z_m(&self) -> f64 {
        self.stop_z_m + self.separation_m
    }

    /// Its throughput T, m²·sr, in closed form: [`crate::throughput::coaxial_disks`].
    pub fn throughput(&self) -> Result<Throughput, DomainError> {
        CoaxialDisks::new(self.pupil_radius_m, self.stop_radius_m, self.separation_m)?.throughput()
    }

    /// How wide the beam can be across the axis at a place on the axis, metres: no ray is further
    /// from the axis. Between the disks it goes from one radius to the other; beyond them it
    /// widens with the sum of both.
    pub fn reach_m(&self, z_m: f64) -> f64 {
        let t = (z_m - self.stop_z_m) / self.separation_m;
        self.stop_radius_m * (1.0 - t).abs() + self.pupil_radius_m * t.abs()
    }
}

/// Where a beam looks: its frame in a scene's.
/// Who needs it: the simulator and the fit, to average a field over a reading's beam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    origin: DVec3,
    axes: DMat3,
}

impl Placed {
    /// A beam that looks at `spot` from along `direction` (of length one, from the spot to the
    /// detector). Its x axis lies in the plane of `direction` and z, leaning downwards; its y axis
    /// is horizontal. Since the disks are round, how it is turned about its axis says nothing but
    /// in which order rays are taken.
    pub fn new(spot: DVec3, direction: DVec3) -> Self {
        let across = DVec3::new(-direction.y, direction.x, 0.0);
        let length = across.length();
        // Straight from above any horizontal direction is across.
        let y = if length > 1e-150 { across / length } else { DVec3::Y };
        let x = y.cross(direction);
        Self { origin: spot, axes: DMat3::from_cols(x, y, direction) }
    }

    /// A point of the beam's frame, in the scene's.
    pub fn point(&self, point: DVec3) -> DVec3 {
        self.origin + self.axes * point
    }

    /// A direction of the beam's frame, in the scene's.
    pub fn direction(&self, direction: DVec3) -> DVec3 {
        self.axes * direction
    }

    /// The beam's axes in the scene: x (in the plane of incidence), y (horizontal), z (along the
    /// axis, to the detector).
    pub const fn axes(&self) -> [DVec3; 3] {
        [self.axes.x_axis, self.axes.y_axis, self.axes.z_axis]
    }
}
