//! What a scene says: patches on the sample's plane that emit, each with an outline, an angular
//! law and a level. Built here or read from scene.toml.
//!
//! A scene does not know the rig, but for the kind of quantity that its levels are in.

mod file;
mod law;
mod photometric;
mod shape;
mod tabulated;

use core::f64::consts::{FRAC_PI_2, PI};
use core::fmt;

use glam::DVec3;

pub use file::Load;
pub use law::Law;
pub use shape::Shape;
pub use tabulated::{Tabulated, TabulatedError};

use crate::{Quantity, Region, SourceOverTime};

/// A patch of the sample that emits.
#[derive(Debug, Clone, PartialEq)]
pub struct Emitter {
    shape: Shape,
    law: Law,
    /// Radiance along the normal; one for a law that brings its own level.
    level: f64,
}

impl Emitter {
    /// The same radiance into every direction.
    pub const fn lambertian(shape: Shape, radiance: f64) -> Self {
        Self { shape, law: Law::Lambertian, level: radiance }
    }

    /// As [`Emitter::lambertian`], its level as exitance: L = M / π.
    pub const fn lambertian_exitance(shape: Shape, exitance: f64) -> Self {
        Self::lambertian(shape, exitance / PI)
    }

    /// L(θ) = L₀ cosⁿ θ, n = 0 being Lambert's law.
    pub const fn cosine_power(shape: Shape, exponent: f64, radiance: f64) -> Self {
        Self { shape, law: Law::CosinePower { exponent }, level: radiance }
    }

    /// As [`Emitter::cosine_power`], its level as exitance: L₀ = M (n + 2) / 2π.
    pub const fn cosine_power_exitance(shape: Shape, exponent: f64, exitance: f64) -> Self {
        Self::cosine_power(shape, exponent, exitance * (exponent + 2.0) / (2.0 * PI))
    }

    /// A patch that emits after a table of intensities: L = I / (A cos θ), with A the area of
    /// `shape`.
    pub fn tabulated(shape: Shape, table: Tabulated) -> Self {
        let level = 1.0 / shape.area_m2();
        Self { shape, law: Law::Tabulated(table), level }
    }

    /// Where it is.
    pub const fn shape(&self) -> &Shape {
        &self.shape
    }

    /// How its radiance goes with direction.
    pub const fn law(&self) -> &Law {
        &self.law
    }

    /// Radiance into (θ, φ), radians, in the scene's unit. Zero for θ of 90° and beyond, where a
    /// flat patch is not seen.
    pub fn radiance(&self, theta_rad: f64, phi_rad: f64) -> f64 {
        self.level * self.law.radiance(theta_rad, phi_rad)
    }

    /// As [`Emitter::radiance`], into a direction of length one.
    pub fn radiance_into(&self, direction: DVec3) -> f64 {
        self.level * self.law.radiance_into(direction)
    }

    /// Exitance into directions up to `theta_max_rad` from the normal.
    pub fn exitance_within(&self, theta_max_rad: f64) -> f64 {
        self.level * self.law.exitance_within(theta_max_rad)
    }

    /// The largest radiance up to `theta_max_rad`, with its direction (θ, φ). `None` where it
    /// grows beyond any bound, as a table does that ends above zero at 90°.
    pub fn peak_within(&self, theta_max_rad: f64) -> Option<(f64, f64, f64)> {
        let (value, theta, phi) = self.law.peak_within(theta_max_rad)?;
        Some((self.level * value, theta, phi))
    }

    fn check(&self) -> Result<(), SceneError> {
        if !self.shape.is_sound() {
            return Err(SceneError::Shape(self.shape));
        }
        if !self.level.is_finite() || self.level < 0.0 {
            return Err(SceneError::Level(self.level));
        }
        match self.law {
            Law::CosinePower { exponent } if !(0.0..=EXPONENT_MAX).contains(&exponent) => {
                Err(SceneError::Exponent(exponent))
            }
            _ => Ok(()),
        }
    }
}

/// The narrowest cosine lobe: half its peak at half a degree. A narrower one is a collimated
/// beam, which a scanning detector does not resolve.
pub const EXPONENT_MAX: f64 = 20_000.0;

/// Patches that emit, on a dark plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    quantity: Quantity,
    emitters: Vec<Emitter>,
    over_time: SourceOverTime,
    notes: Vec<String>,
}

impl Scene {
    /// A dark plane; levels to come are in the quantity's unit.
    pub const fn new(quantity: Quantity) -> Self {
        let over_time = SourceOverTime { warm_up: None, mains_flicker: None };
        Self { quantity, emitters: Vec::new(), over_time, notes: Vec::new() }
    }

    /// The scene with light that goes so with time.
    #[must_use]
    pub fn over_time_as(mut self, over_time: SourceOverTime) -> Self {
        self.over_time = over_time;
        self
    }

    /// The scene and one emitter more.
    pub fn with(mut self, emitter: Emitter) -> Result<Self, SceneError> {
        self.add(emitter)?;
        Ok(self)
    }

    /// Adds an emitter. Emitters do not overlap: which of two would be seen is not defined.
    pub fn add(&mut self, emitter: Emitter) -> Result<(), SceneError> {
        emitter.check()?;
        let clash = self.emitters.iter().position(|other| other.shape.overlaps(&emitter.shape));
        if let Some(other) = clash {
            return Err(SceneError::Overlap { other });
        }
        self.emitters.push(emitter);
        Ok(())
    }

    /// What the levels are.
    pub const fn quantity(&self) -> Quantity {
        self.quantity
    }

    /// The patches, in the order of the file.
    pub fn emitters(&self) -> &[Emitter] {
        &self.emitters
    }

    /// How all light goes with time.
    pub const fn over_time(&self) -> &SourceOverTime {
        &self.over_time
    }

    /// What all emitters send into the whole hemisphere, W or lm.
    pub fn flux(&self) -> f64 {
        let of_emitter =
            |emitter: &Emitter| emitter.shape.area_m2() * emitter.exitance_within(FRAC_PI_2);
        self.emitters.iter().map(of_emitter).sum()
    }

    /// What a person should know about the files that the scene refers to: irregularities that
    /// were handled, and light that the scene leaves out.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The bounding rectangle of all patches, with directions up to 80°. Of a dark scene, the
    /// square centimetre around the origin.
    pub(crate) fn bounding_region(&self) -> Region {
        let around = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
        let boxes = self.emitters.iter().map(|emitter| emitter.shape.bounding_box());
        let all = boxes.reduce(|a, b| (around(a.0, b.0), around(a.1, b.1)));
        let (x_m, y_m) = all.unwrap_or(((-0.005, 0.005), (-0.005, 0.005)));
        Region { x_m, y_m, theta_max_rad: 80.0 / 180.0 * PI }
    }

    /// Radiance from (x, y), metres, into (θ, φ), radians. Zero off every patch. On an outline
    /// that two patches share, the first is seen.
    pub fn radiance(&self, x_m: f64, y_m: f64, theta_rad: f64, phi_rad: f64) -> f64 {
        self.emitters
            .iter()
            .find(|emitter| emitter.shape.contains(x_m, y_m))
            .map_or(0.0, |emitter| emitter.radiance(theta_rad, phi_rad))
    }
}

/// Why an emitter can't be part of a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SceneError {
    /// The exponent of a cosine lobe.
    Exponent(f64),
    /// A level that is negative or not a number.
    Level(f64),
    /// It shares area with the emitter of this index.
    Overlap {
        /// From 0, in the order in which they were added.
        other: usize,
    },
    /// An outline without an inside.
    Shape(Shape),
}

impl SceneError {
    /// What to write instead.
    pub(crate) const fn expected(&self) -> &'static str {
        match self {
            Self::Exponent(_) => "an exponent of at least 0 and at most 20000",
            Self::Level(_) => "a finite level of at least 0",
            Self::Overlap { .. } => "emitters that do not overlap (they may touch)",
            Self::Shape(_) => "an outline of finite size above 0",
        }
    }
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Exponent(exponent) => {
                write!(f, "exponent {exponent} is not from 0 to {EXPONENT_MAX}")
            }
            Self::Level(level) => write!(f, "level {level} is not a finite number of at least 0"),
            Self::Overlap { other } => write!(f, "the emitter overlaps emitter[{other}]"),
            Self::Shape(shape) => write!(f, "the outline has no inside: {shape:?}"),
        }
    }
}

impl core::error::Error for SceneError {}
