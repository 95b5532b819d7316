//! Coordinates about a source as a receiver sees it: the frame with its third axis towards the
//! source's middle, the first two stretched until the source is about 1 across. It knows no bodies.
//!
//! Directions to what looks small differ in their last digits alone. A linear map changes neither
//! what hides what nor the degree of any outline, so everything is decided in the stretched frame,
//! where the source has its full 16 digits however small it looks; positions come there in
//! double-double, before anything is rounded.

use glam::DVec3;

use crate::direction::frame;
use crate::wide::{WideVec, in_units};

/// What looks wider than this, in radians, is not stretched.
const WIDE: f64 = 1.0 / 16.0;
/// Squares of smaller angles are near the smallest doubles.
const SMALLEST_EXPONENT: i32 = -240;

/// A receiver's view of a source.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    point: DVec3,
    axes: [WideVec; 3],
    /// The first two coordinates count in units of two to this power.
    exponent: i32,
    /// The receiver's unit normal in the unstretched frame.
    normal: DVec3,
}

impl View {
    /// Towards a middle relative to the receiver, of something that looks as wide as `extent` about
    /// it, in radians. None if there is no direction, or nothing that a double could hold.
    pub(super) fn towards(
        point: DVec3,
        normal: DVec3,
        middle: WideVec,
        extent: f64,
    ) -> Option<Self> {
        let ahead = middle.unit()?;
        let right = WideVec::from_vec(frame(ahead.to_vec()).0);
        let up = ahead.cross(right).unit()?;
        let right = up.cross(ahead);
        if !extent.is_finite() || extent <= 0.0 {
            return None;
        }
        let exponent = if extent > WIDE { 0 } else { libm::ilogb(extent) + 1 };
        if exponent < SMALLEST_EXPONENT {
            return None;
        }
        let mut view = Self { point, axes: [right, up, ahead], exponent, normal };
        view.normal = view.turned(WideVec::from_vec(normal).unit()?).to_vec();
        Some(view)
    }

    /// A point, relative to the receiver, without loss.
    pub(super) fn relative(&self, point: DVec3) -> WideVec {
        WideVec::difference(point, self.point)
    }

    /// A vector in the unstretched frame.
    pub(super) fn turned(&self, vector: WideVec) -> WideVec {
        let [right, up, ahead] = self.axes;
        WideVec::new(right.dot(vector), up.dot(vector), ahead.dot(vector))
    }

    /// A point of the unstretched frame in the stretched one.
    pub(super) fn stretched(&self, turned: WideVec) -> DVec3 {
        let [x, y, z] = turned.components();
        WideVec::new(x.scaled(-self.exponent), y.scaled(-self.exponent), z).to_vec()
    }

    /// The normal of a plane through the receiver, from the unstretched frame to the stretched one.
    pub(super) fn plane(&self, turned: WideVec) -> DVec3 {
        let [x, y, z] = turned.components();
        WideVec::new(x.scaled(self.exponent), y.scaled(self.exponent), z).to_vec()
    }

    /// Back from the stretched frame, rounded.
    pub(super) fn shrunk(&self, stretched: DVec3) -> DVec3 {
        let across = in_units(stretched, -self.exponent);
        DVec3::new(across.x, across.y, stretched.z)
    }

    /// The receiver's unit normal in the unstretched frame.
    pub(super) fn normal(&self) -> DVec3 {
        self.normal
    }

    /// The receiver's horizon as a plane of the stretched frame, with all digits.
    pub(super) fn horizon(&self, normal: DVec3) -> DVec3 {
        self.plane(self.turned(WideVec::from_vec(normal)))
    }

    /// One unit across, in radians.
    pub(super) fn unit_rad(&self) -> f64 {
        libm::scalbn(1.0, self.exponent)
    }

    pub(super) fn is_stretched(&self) -> bool {
        self.exponent != 0
    }
}
