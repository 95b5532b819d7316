//! Where the detector stands in the sample's frame when the joints stand at given values: of a rig
//! as drawn on paper, and of one whose axes do not meet as they should.

use core::fmt;

use glam::{DMat3, DVec3};

use crate::optics;

/// From joints θ, φ, x, y (radians, metres) to where the detector stands.
pub(crate) trait Kinematics: fmt::Debug + Send + Sync {
    fn seen(&self, joints: [f64; 4]) -> optics::Axis;
}

/// A rig as drawn on paper.
///
/// With the arm at θ the detector is at Ry(θ) ẑ from the point where it looks. The turntable at φ
/// has turned the sample by -φ about z, so that in the sample's frame the detector stands at
/// Rz(φ) Ry(θ) ẑ. The stage at (x, y) has carried the sample's point (x, y) to the axis.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Perfect;

impl Kinematics for Perfect {
    fn seen(&self, [theta, phi, x, y]: [f64; 4]) -> optics::Axis {
        let turntable = DMat3::from_rotation_z(-phi);
        let to_detector = DMat3::from_rotation_y(theta) * DVec3::Z;
        let stage = DVec3::new(-x, -y, 0.0);
        optics::Axis { spot: -stage, direction: turntable.transpose() * to_detector }
    }
}

/// A rig whose axes do not meet, or not at right angles. The laboratory's z is the turntable's
/// axis, its origin where the sample's plane meets that.
///
/// In the laboratory the detector's axis passes through `meets` along Rx(α) Ry(θ) Rx(β) ẑ: α is
/// the tilt of the arm's axis out of the horizontal, β that of the beam out of the plane in which
/// the arm swings (a theodolite's trunnion-axis tilt and collimation error). The laboratory sees
/// the sample's point P at Rz(-φ) W (P - (x, y, 0)), with W the tilt of the turntable's top, which
/// turns with it and so wobbles once a turn. Every matrix is exact: nothing is taken as small.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Misaligned {
    /// The point of the arm's axis through which the beam's axis passes, metres; the laboratory's
    /// origin in a perfect rig.
    pub(crate) meets_m: DVec3,
    /// α, radians.
    pub(crate) arm_axis_rad: f64,
    /// β, radians.
    pub(crate) beam_rad: f64,
    /// By how much the turntable's top is tilted, radians.
    pub(crate) wobble_rad: f64,
    /// Towards where its normal leans, from +x towards +y of the turntable's top, radians.
    pub(crate) wobble_towards_rad: f64,
}

impl Kinematics for Misaligned {
    fn seen(&self, [theta, phi, x, y]: [f64; 4]) -> optics::Axis {
        let arm = DMat3::from_rotation_x(self.arm_axis_rad)
            * DMat3::from_rotation_y(theta)
            * DMat3::from_rotation_x(self.beam_rad);
        let towards = DMat3::from_rotation_z(self.wobble_towards_rad);
        let top = towards * DMat3::from_rotation_y(self.wobble_rad) * towards.transpose();
        let to_sample = (DMat3::from_rotation_z(-phi) * top).transpose();
        optics::Axis {
            spot: to_sample * self.meets_m + DVec3::new(x, y, 0.0),
            direction: to_sample * (arm * DVec3::Z),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Ray;

    const JOINTS: [f64; 4] = [0.7, -1.9, 0.01, -0.02];

    fn ray(rig: &Misaligned, joints: [f64; 4]) -> Ray {
        let axis = rig.seen(joints);
        Ray::through(axis.spot, axis.direction).unwrap()
    }

    #[test]
    fn without_any_error_it_is_the_perfect_rig() {
        let (perfect, found) = (Perfect.seen(JOINTS), Misaligned::default().seen(JOINTS));
        assert!((perfect.spot - found.spot).length() < 1e-17);
        assert!((perfect.direction - found.direction).length() < 1e-15);
    }

    #[test]
    fn an_arm_above_the_sample_looks_beside_the_axis_by_its_height_times_tan_theta() {
        let rig = Misaligned { meets_m: DVec3::new(0.0, 0.0, 1e-3), ..Misaligned::default() };
        let seen = ray(&rig, [0.7, 0.0, 0.0, 0.0]);
        assert!((seen.point.x + 1e-3 * libm::tan(0.7)).abs() < 1e-17, "{seen:?}");
        // On the other side of the zenith it looks beside it the other way.
        let seen = ray(&rig, [-0.7, 0.0, 0.0, 0.0]);
        assert!((seen.point.x - 1e-3 * libm::tan(0.7)).abs() < 1e-17, "{seen:?}");
    }

    #[test]
    fn an_eccentric_arm_draws_a_circle_on_the_turning_sample() {
        let rig = Misaligned { meets_m: DVec3::new(2e-3, 0.0, 0.0), ..Misaligned::default() };
        for phi in [0.0, 0.5, 2.0, -3.0] {
            let seen = ray(&rig, [0.3, phi, 0.0, 0.0]).point;
            let (sin, cos) = libm::sincos(phi);
            assert!((seen - 2e-3 * DVec3::new(cos, sin, 0.0)).length() < 1e-17, "{seen}");
        }
    }

    #[test]
    fn a_tilted_arm_axis_leans_the_plane_in_which_the_arm_swings() {
        // The arm's axis is Rx(α) ŷ; the swing's plane is at a right angle to it.
        let rig = Misaligned { arm_axis_rad: 0.02, ..Misaligned::default() };
        let (sin, cos) = libm::sincos(0.02);
        let arm_axis = DVec3::new(0.0, cos, sin);
        for theta in [-1.2, 0.0, 0.4, 1.5] {
            let direction = rig.seen([theta, 0.0, 0.0, 0.0]).direction;
            assert!(direction.dot(arm_axis).abs() < 1e-16);
            assert!((direction.z - cos * libm::cos(theta)).abs() < 1e-15);
        }
    }

    #[test]
    fn a_tilted_beam_draws_a_cone_about_the_arm_axis() {
        let rig = Misaligned { beam_rad: 0.03, ..Misaligned::default() };
        for theta in [-1.2, 0.0, 0.4, 1.5] {
            let direction = rig.seen([theta, 0.0, 0.0, 0.0]).direction;
            assert!((direction.dot(DVec3::Y) + libm::sin(0.03)).abs() < 1e-16);
        }
    }

    #[test]
    fn a_wobble_leans_with_the_turntable_and_not_with_the_laboratory() {
        let tilt = 0.01;
        let rig = Misaligned { wobble_rad: tilt, wobble_towards_rad: 0.4, ..Misaligned::default() };
        // Where the laboratory's vertical stands in the sample's frame: against the lean, at any
        // turn. The sample's normal in the laboratory goes round once a turn.
        for phi in [0.0, 1.0, -2.5] {
            let up = rig.seen([0.0, phi, 0.0, 0.0]).direction;
            let (sin, cos) = libm::sincos(0.4);
            let expected =
                DVec3::new(-cos, -sin, 0.0) * libm::sin(tilt) + DVec3::Z * libm::cos(tilt);
            assert!((up - expected).length() < 1e-15, "{up} at {phi}");
        }
        // An arm that leans in the lean's own plane sees θ smaller by just the tilt.
        let seen = rig.seen([0.5, 0.4, 0.0, 0.0]).direction;
        assert!((libm::acos(seen.z) - (0.5 - tilt)).abs() < 1e-14, "{seen}");
    }
}
