//! What lights the surfaces.

use glam::DVec3;

use super::{Image, SceneError, Solid};

/// A lamp of uniform radiance, or a surrounding that shines.
///
/// A lamp that has a place is an opaque body which shines alike from all its surface, a flat one from
/// both faces: where it stands in the detector's beam, the detector sees it and not what lies below.
/// The Sun and a surrounding are far beyond the detector, whose head shades nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct Lamp {
    source: LampSource,
    /// In the scene's unit; of a surrounding, where its image is 1.
    radiance: f64,
}

/// What a lamp is.
#[derive(Debug, Clone, PartialEq)]
pub enum LampSource {
    /// A disk, polygon or ball.
    Body(Solid),
    /// A disk at infinity, as the Sun.
    Distant {
        /// The unit vector towards its centre.
        towards: DVec3,
        /// Half of what it subtends, radians.
        half_angle_rad: f64,
    },
    /// All directions: θ down from +z over the image's rows (the first row at θ = 0), φ over its
    /// columns from -π to π.
    Surrounding(Image),
}

impl Lamp {
    /// A lamp and its radiance.
    pub const fn new(source: LampSource, radiance: f64) -> Self {
        Self { source, radiance }
    }

    /// What it is.
    pub const fn source(&self) -> &LampSource {
        &self.source
    }

    /// In the scene's unit; of a surrounding, where its image is 1.
    pub const fn radiance(&self) -> f64 {
        self.radiance
    }

    /// The body, of a lamp that has a place.
    pub const fn solid(&self) -> Option<&Solid> {
        match &self.source {
            LampSource::Body(solid) => Some(solid),
            LampSource::Distant { .. } | LampSource::Surrounding(_) => None,
        }
    }

    /// What scene.toml calls its kind.
    pub const fn kind(&self) -> &'static str {
        match &self.source {
            LampSource::Body(Solid::Disk(_)) => "disk",
            LampSource::Body(Solid::HalfPlane(_)) => "half-plane",
            LampSource::Body(Solid::Polygon(_)) => "polygon",
            LampSource::Body(Solid::Sphere(_)) => "sphere",
            LampSource::Distant { .. } => "sun",
            LampSource::Surrounding(_) => "environment",
        }
    }

    pub(super) fn check(&self) -> Result<(), SceneError> {
        if !self.radiance.is_finite() || self.radiance < 0.0 {
            return Err(SceneError::Level(self.radiance));
        }
        match &self.source {
            LampSource::Body(Solid::HalfPlane(_)) => {
                Err(SceneError::Unsupported("a half-plane that shines"))
            }
            LampSource::Body(solid) if solid.extent_m() <= 0.0 => Err(SceneError::NoArea(0.0)),
            LampSource::Distant { towards, .. } if towards.z <= 0.0 => {
                Err(SceneError::Below(towards.z))
            }
            LampSource::Body(_) | LampSource::Distant { .. } | LampSource::Surrounding(_) => Ok(()),
        }
    }
}
