//! The mechanics as they are: where each axis really stands, and where the detector is from there.
//! Computed from the drawings, not from the host's kinematics.
//!
//! Frame: the sample's plane is z = 0, its normal +z, the origin on the turntable's axis. The arm
//! swings in the laboratory's x-z plane and holds the detector over the point where the axes
//! meet. Below it stands the turntable, on that the stage, on that the sample.

mod axis;
mod effects;
mod flaws;
mod geometry;
pub(crate) mod passing;
mod play;
mod ringing;
mod scale;
mod settling;
mod smear;
mod weigh;

pub use flaws::{AxisFlaws, EncoderError, Misalignment, MissedSteps, Ringing, Uncertain};

pub(crate) use axis::{Axis, AxisTruth};
pub(crate) use effects::{axes, candidates, kinematics, moments};
pub(crate) use geometry::Kinematics;
pub(crate) use smear::Moment;

use crate::optics;

/// A ray from the sample to the detector: where it leaves, metres, and its direction, radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenRay {
    /// In the sample's plane.
    pub x_m: f64,
    /// In the sample's plane.
    pub y_m: f64,
    /// From the normal.
    pub theta_rad: f64,
    /// From +x towards +y.
    pub phi_rad: f64,
}

impl From<optics::Axis> for SeenRay {
    /// The axis as a ray.
    fn from(axis: optics::Axis) -> Self {
        let (spot, direction) = (axis.spot, axis.direction);
        Self {
            x_m: spot.x,
            y_m: spot.y,
            theta_rad: libm::atan2(libm::hypot(direction.x, direction.y), direction.z),
            phi_rad: libm::atan2(direction.y, direction.x),
        }
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::{FRAC_PI_2, PI};

    use super::geometry::Perfect;
    use super::*;

    fn forward(joints: [f64; 4]) -> optics::Axis {
        Perfect.seen(joints)
    }

    #[test]
    fn the_arm_leans_along_x_and_the_turntable_turns_the_azimuth() {
        let close = |axis: optics::Axis, theta: f64, phi: f64| {
            let ray = SeenRay::from(axis);
            let near = |a: f64, b: f64| libm::fabs(a - b) < 1e-14;
            assert!(near(ray.theta_rad, theta) && near(ray.phi_rad, phi), "{ray:?}");
        };
        close(forward([0.4, 0.0, 0.0, 0.0]), 0.4, 0.0);
        close(forward([0.4, 1.0, 0.0, 0.0]), 0.4, 1.0);
        close(forward([0.4, -2.5, 0.0, 0.0]), 0.4, -2.5);
        // Through the zenith: an arm at -30° with the turntable at 20° sees φ = -160°.
        let (arm, turntable) = ((-30.0_f64).to_radians(), 20.0_f64.to_radians());
        close(forward([arm, turntable, 0.0, 0.0]), 30.0_f64.to_radians(), turntable - PI);
        close(forward([FRAC_PI_2, 0.2, 0.0, 0.0]), FRAC_PI_2, 0.2);
        let ray = SeenRay::from(forward([0.3, 0.9, 0.01, -0.02]));
        assert_eq!((ray.x_m, ray.y_m), (0.01, -0.02));
    }
}
