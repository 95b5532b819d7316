//! Plane-parallel windows, wider than everything else.

use radiometry::interface::{Interface, Window as Pane};

use super::SceneError;

/// A plate of z from `z_m` to `z_m + thickness_m`, without end to the sides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Of its lower face, metres.
    pub z_m: f64,
    /// Metres.
    pub thickness_m: f64,
    /// Of refraction, relative to what is around it.
    pub index: f64,
    /// Beer's coefficient, per metre.
    pub absorption_per_m: f64,
    /// Whose it is.
    pub belongs_to: WindowOwner,
}

/// Whose a window is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WindowOwner {
    /// The detector's: its beam passes it, the lamps' light does not, and what it does is not the
    /// sample's.
    Beam,
    /// The sample's: light from lamps above passes it too, and what leaves the sample has passed it.
    Sample,
}

/// No medium refracts visible light more.
const INDEX_MAX: f64 = 10.0;

impl Window {
    /// The plate's physics.
    pub(crate) fn pane(&self) -> Result<Pane, SceneError> {
        let refused = |_| SceneError::Window("index", self.index);
        let face = Interface::new(1.0, self.index).map_err(refused)?;
        Pane::new(face, self.thickness_m, self.absorption_per_m).map_err(refused)
    }

    pub(super) fn check(&self) -> Result<(), SceneError> {
        if !(1.0..=INDEX_MAX).contains(&self.index) {
            return Err(SceneError::Window("index", self.index));
        }
        let is_thick = self.thickness_m.is_finite() && self.thickness_m > 0.0;
        if !is_thick {
            return Err(SceneError::Window("thickness in m", self.thickness_m));
        }
        if !(self.absorption_per_m.is_finite() && self.absorption_per_m >= 0.0) {
            return Err(SceneError::Window("absorption per m", self.absorption_per_m));
        }
        if !(self.z_m.is_finite() && self.z_m >= 0.0) {
            return Err(SceneError::Below(self.z_m));
        }
        self.pane().map(|_| ())
    }
}
