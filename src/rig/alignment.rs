//! How a rig's axes may stand to each other other than drawn, and what that does to the ray that is
//! seen. To first order in each: what is larger wants measuring and correcting, not a standard
//! uncertainty.
//!
//! Nothing here corrects anything, and nothing knows how large a misalignment is: rig.toml states
//! standard uncertainties alone.

use glam::DVec3;
use radiometry::direction;

use super::{AxisPositions, Pose, forward};

/// The standard uncertainties of how a rig's axes stand to each other; 0 where the file says nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Alignment {
    /// Of where the beam's axis passes the arm's axis, from where the turntable's axis meets the
    /// sample's plane: across the arm's axis, along it, up. Metres.
    pub u_offset_m: [f64; 3],
    /// Of the arm's axis's lean out of the horizontal, radians.
    pub u_arm_axis_rad: f64,
    /// Of the beam's lean out of the plane in which the arm swings, radians.
    pub u_beam_rad: f64,
    /// Of the tilt of the turntable's top against its axis, towards anywhere, radians. Along each of x
    /// and y it has 1/√2 of it.
    pub u_tilt_rad: f64,
}

/// One way in which a rig can stand askew.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Misalignment {
    /// The beam passes the turntable's axis, across the arm's axis.
    OffsetX,
    /// The same along the arm's axis.
    OffsetY,
    /// The beam meets the turntable's axis above the sample's plane.
    OffsetZ,
    /// The arm's axis leans out of the horizontal.
    ArmAxis,
    /// The beam leans out of the plane in which the arm swings.
    Beam,
    /// The sample's normal leans towards the sample's +x, and turns with it.
    TiltX,
    /// The same towards +y.
    TiltY,
}

impl Alignment {
    /// Each misalignment with its standard uncertainty, metres or radians.
    pub fn parts(&self) -> [(Misalignment, f64); 7] {
        let [x, y, z] = self.u_offset_m;
        let each = self.u_tilt_rad * std::f64::consts::FRAC_1_SQRT_2;
        [
            (Misalignment::OffsetX, x),
            (Misalignment::OffsetY, y),
            (Misalignment::OffsetZ, z),
            (Misalignment::ArmAxis, self.u_arm_axis_rad),
            (Misalignment::Beam, self.u_beam_rad),
            (Misalignment::TiltX, each),
            (Misalignment::TiltY, each),
        ]
    }
}

impl Misalignment {
    /// As a budget's row names it; what stands after the @ shares a row.
    pub const fn name(self) -> &'static str {
        match self {
            Self::OffsetX => "axis offset x",
            Self::OffsetY => "axis offset y",
            Self::OffsetZ => "axis offset z",
            Self::ArmAxis => "arm axis tilt",
            Self::Beam => "beam tilt",
            Self::TiltX => "table tilt @ x",
            Self::TiltY => "table tilt @ y",
        }
    }

    /// Whether it is an angle, in radians; else it is a length, in metres.
    pub const fn is_angle(self) -> bool {
        !matches!(self, Self::OffsetX | Self::OffsetY | Self::OffsetZ)
    }

    /// The ray that is seen with the axes at `positions` by a rig that is off by `size`, radians or
    /// metres.
    ///
    /// The laboratory's x is across the arm's axis, its z the turntable's axis; at φ the sample stands
    /// turned by -φ. An offset moves the place where the beam meets the sample, one upwards by
    /// `size` tan θ, without bound towards the horizon. A small rotation by the vector r moves the
    /// direction d by r × d: the arm's axis by x̂, the sample's tilt by the other way round.
    pub fn ray_seen(self, positions: AxisPositions, size: f64) -> Pose {
        let AxisPositions([arm, table, x_m, y_m]) = positions;
        let (sin, cos) = libm::sincos(arm);
        let direction = DVec3::new(sin, 0.0, cos);
        let (turned_sin, turned_cos) = libm::sincos(table);
        let on_sample = |v: DVec3| {
            DVec3::new(
                turned_cos * v.x - turned_sin * v.y,
                turned_sin * v.x + turned_cos * v.y,
                v.z,
            )
        };
        let moved = |offset: DVec3| {
            let offset = on_sample(offset);
            Pose { x_m: x_m + offset.x, y_m: y_m + offset.y, ..forward(positions) }
        };
        let turned = |towards: DVec3| {
            let (theta_rad, phi_rad) = direction::angles(towards);
            Pose { x_m, y_m, theta_rad, phi_rad }
        };
        let straight = on_sample(direction);
        match self {
            Self::OffsetX => moved(DVec3::new(size, 0.0, 0.0)),
            Self::OffsetY => moved(DVec3::new(0.0, size, 0.0)),
            Self::OffsetZ => moved(DVec3::new(-size * sin / cos, 0.0, 0.0)),
            Self::ArmAxis => turned(on_sample(direction + size * DVec3::X.cross(direction))),
            Self::Beam => turned(on_sample(direction - size * DVec3::Y)),
            Self::TiltX => turned(straight - size * DVec3::Y.cross(straight)),
            Self::TiltY => turned(straight + size * DVec3::X.cross(straight)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use radiometry::direction::{angle_between, unit};

    const SIZE: f64 = 1e-4;

    fn positions(arm_deg: f64, table_deg: f64) -> AxisPositions {
        AxisPositions([arm_deg.to_radians(), table_deg.to_radians(), 0.01, -0.02])
    }

    fn seen(part: Misalignment, at: AxisPositions) -> DVec3 {
        let pose = part.ray_seen(at, SIZE);
        unit(pose.theta_rad, pose.phi_rad)
    }

    #[test]
    fn nothing_moves_by_nothing() {
        for (part, _) in Alignment::default().parts() {
            for at in [positions(30.0, 50.0), positions(-70.0, -170.0), positions(0.0, 10.0)] {
                let (straight, seen) = (forward(at), part.ray_seen(at, 0.0));
                assert!((seen.x_m - straight.x_m).abs() + (seen.y_m - straight.y_m).abs() < 1e-15);
                let angle = angle_between(
                    unit(seen.theta_rad, seen.phi_rad),
                    unit(straight.theta_rad, straight.phi_rad),
                );
                assert!(angle < 1e-15, "{part:?} {at:?}");
            }
        }
    }

    #[test]
    fn an_offset_draws_a_circle_on_the_turning_sample_and_height_moves_away_from_the_arm() {
        for table_deg in [0.0_f64, 90.0, -130.0] {
            let at = positions(40.0, table_deg);
            let (sin, cos) = libm::sincos(table_deg.to_radians());
            let place = |part: Misalignment| {
                let pose = part.ray_seen(at, SIZE);
                (pose.x_m - 0.01, pose.y_m + 0.02)
            };
            let close = |(a, b): (f64, f64), (c, d): (f64, f64)| {
                assert!((a - c).abs() + (b - d).abs() < 1e-15, "{table_deg}: {a} {b}, {c} {d}");
            };
            close(place(Misalignment::OffsetX), (SIZE * cos, SIZE * sin));
            close(place(Misalignment::OffsetY), (-SIZE * sin, SIZE * cos));
            let away = -SIZE * libm::tan(40.0_f64.to_radians());
            close(place(Misalignment::OffsetZ), (away * cos, away * sin));
        }
    }

    #[test]
    fn leaning_axes_turn_the_beam_by_what_they_should() {
        let at = positions(60.0, 25.0);
        let (theta, phi) = (60.0_f64.to_radians(), 25.0_f64.to_radians());
        // Across the swing: the beam by its lean anywhere, the arm's axis by it at the zenith and
        // not at all at the horizon.
        let across = |part: Misalignment, at: AxisPositions| {
            let AxisPositions([_, phi, ..]) = at;
            seen(part, at).dot(DVec3::new(-libm::sin(phi), libm::cos(phi), 0.0))
        };
        assert!((across(Misalignment::Beam, at) + SIZE).abs() < 1e-10);
        assert!((across(Misalignment::ArmAxis, at) + SIZE * libm::cos(theta)).abs() < 1e-10);
        assert!((across(Misalignment::ArmAxis, positions(0.0, 25.0)) + SIZE).abs() < 1e-10);
        // Seen from a normal that leans towards +x, an arm on that side stands nearer to it.
        let pose = Misalignment::TiltX.ray_seen(at, SIZE);
        assert!((pose.theta_rad - (theta - SIZE * libm::cos(phi))).abs() < 1e-7);
        let pose = Misalignment::TiltY.ray_seen(at, SIZE);
        assert!((pose.theta_rad - (theta - SIZE * libm::sin(phi))).abs() < 1e-7);
    }
}
