//! Where the optical axis points, free of joints; and where the joints stand.

/// A ray from the sample to the detector in the surface chart. The sample's plane is z = 0, its
/// normal +z, the origin on the turntable's axis, right-handed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Where the ray leaves the sample, metres.
    pub x_m: f64,
    /// Where the ray leaves the sample, metres.
    pub y_m: f64,
    /// From the normal, radians, in [0, π/2].
    pub theta_rad: f64,
    /// From +x towards +y, radians, in (-π, π].
    pub phi_rad: f64,
}

/// An axis of the gantry by what it does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum AxisName {
    /// The arm, radians, signed: it may cross the zenith.
    Theta,
    /// The turntable, radians.
    Phi,
    /// The stage, metres.
    X,
    /// The stage, metres.
    Y,
}

/// The axes in the order in which arrays of axes are indexed (not the channels' order).
pub const AXES: [AxisName; 4] = [AxisName::Theta, AxisName::Phi, AxisName::X, AxisName::Y];

/// One position an axis, in the order of [`AXES`]: radians, radians, metres, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisPositions(pub [f64; 4]);

impl AxisName {
    /// The name in files, messages and columns.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Theta => "theta",
            Self::Phi => "phi",
            Self::X => "x",
            Self::Y => "y",
        }
    }

    /// Whether its positions are angles, in radians; else they are lengths, in metres.
    pub const fn is_rotary(self) -> bool {
        matches!(self, Self::Theta | Self::Phi)
    }

    /// The unit in the keys of files and in messages: `deg` or `mm`.
    pub const fn file_unit(self) -> &'static str {
        if self.is_rotary() { "deg" } else { "mm" }
    }

    /// A position with its unit, as messages print it: `97.500°`, `-12.000 mm`.
    pub fn in_file_unit(self, position: f64) -> String {
        if self.is_rotary() {
            format!("{:.3}°", position.to_degrees())
        } else {
            format!("{:.3} mm", position * 1e3)
        }
    }
}
