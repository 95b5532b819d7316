//! What a scene says: what emits, what is lit and by what, what stands in the way of light. Built
//! here or read from scene.toml.
//!
//! Everything stands in the sample's frame, turns and travels with it, and lies at z of 0 or above.
//! A scene does not know the rig, but for the kind of quantity that its levels are in, and it computes
//! no light: it only says what is there, and that it can be there.

mod contact;
mod emitter;
mod error;
mod file;
mod image;
mod lamp;
mod law;
mod outline;
mod shape;
mod surface;
mod window;

use core::f64::consts::PI;

pub use contact::Solid;
pub use emitter::{Body, Emitter};
pub use error::SceneError;
pub use file::Load;
pub use image::Image;
pub use lamp::{Lamp, LampSource};
pub use law::{
    Batwing, LOBE_EXPONENT_MIN, Law, Lobe, Lobes, SHARPNESS_MAX, Tabulated, TabulatedError,
};
pub use outline::Outline;
pub use shape::Shape;
pub use surface::{Reflection, Surface};
pub use window::{Window, WindowOwner};

use crate::{Quantity, Region, SourceOverTime};

/// The narrowest cosine lobe: half its peak at half a degree. A narrower one is a collimated
/// beam, which a scanning detector does not resolve.
pub const EXPONENT_MAX: f64 = 20_000.0;

/// How far below the sample's plane rounding may take a body that touches it, in parts of its size.
const SUNK: f64 = 1e-9;

/// What is there, on a dark plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    quantity: Quantity,
    emitters: Vec<Emitter>,
    surfaces: Vec<Surface>,
    lamps: Vec<Lamp>,
    occluders: Vec<Solid>,
    windows: Vec<Window>,
    over_time: SourceOverTime,
    notes: Vec<String>,
}

impl Scene {
    /// A dark plane; levels to come are in the quantity's unit.
    pub const fn new(quantity: Quantity) -> Self {
        Self {
            quantity,
            emitters: Vec::new(),
            surfaces: Vec::new(),
            lamps: Vec::new(),
            occluders: Vec::new(),
            windows: Vec::new(),
            over_time: SourceOverTime { warm_up: None, mains_flicker: None },
            notes: Vec::new(),
        }
    }

    /// The scene with light that goes so with time.
    #[must_use]
    pub const fn over_time_as(mut self, over_time: SourceOverTime) -> Self {
        self.over_time = over_time;
        self
    }

    /// The scene and one emitter more.
    pub fn with(mut self, emitter: Emitter) -> Result<Self, SceneError> {
        self.add(emitter)?;
        Ok(self)
    }

    /// Adds an emitter. Patches do not overlap: which of two would be seen is not defined.
    pub fn add(&mut self, emitter: Emitter) -> Result<(), SceneError> {
        emitter.check()?;
        self.check_body(emitter.body())?;
        self.emitters.push(emitter);
        Ok(())
    }

    /// Adds a surface that is lit.
    pub fn add_surface(&mut self, surface: Surface) -> Result<(), SceneError> {
        surface.check()?;
        self.check_body(surface.body())?;
        self.surfaces.push(surface);
        Ok(())
    }

    /// Adds a lamp.
    pub fn add_lamp(&mut self, lamp: Lamp) -> Result<(), SceneError> {
        lamp.check()?;
        if let Some(solid) = lamp.solid() {
            self.check_solid(solid)?;
        }
        self.lamps.push(lamp);
        Ok(())
    }

    /// Adds a black body that stands in the way.
    pub fn add_occluder(&mut self, occluder: Solid) -> Result<(), SceneError> {
        if occluder.extent_m() <= 0.0 && !matches!(occluder, Solid::HalfPlane(_)) {
            return Err(SceneError::NoArea(0.0));
        }
        self.check_solid(&occluder)?;
        self.occluders.push(occluder);
        Ok(())
    }

    /// Adds a window.
    pub fn add_window(&mut self, window: Window) -> Result<(), SceneError> {
        window.check()?;
        let (low, high) = (window.z_m, window.z_m + window.thickness_m);
        let clash = self.windows.iter().position(|other| {
            let shared = high.min(other.z_m + other.thickness_m) - low.max(other.z_m);
            shared > SUNK * window.thickness_m
        });
        if let Some(i) = clash {
            return Err(SceneError::Penetrates { other: format!("window[{i}]") });
        }
        for (name, solid) in self.solids() {
            let (bottom, top) = solid.heights_m();
            // What lies in the plane of a face touches it.
            if is_within(bottom, top, &window) {
                return Err(SceneError::Penetrates { other: name });
            }
        }
        self.windows.push(window);
        Ok(())
    }

    /// How the light of all emitters and lamps goes with time.
    pub const fn over_time(&self) -> &SourceOverTime {
        &self.over_time
    }

    /// What all emitters send out, W or lm.
    pub fn flux(&self) -> f64 {
        self.emitters.iter().map(Emitter::flux).sum()
    }

    /// What the levels are.
    pub const fn quantity(&self) -> Quantity {
        self.quantity
    }

    /// What emits, in the order of the file.
    pub fn emitters(&self) -> &[Emitter] {
        &self.emitters
    }

    /// What is lit, in the order of the file.
    pub fn surfaces(&self) -> &[Surface] {
        &self.surfaces
    }

    /// What lights, in the order of the file.
    pub fn lamps(&self) -> &[Lamp] {
        &self.lamps
    }

    /// What is black and stands in the way, in the order of the file.
    pub fn occluders(&self) -> &[Solid] {
        &self.occluders
    }

    /// In the order of the file.
    pub fn windows(&self) -> &[Window] {
        &self.windows
    }

    /// What a person should know about the files that the scene refers to: irregularities that
    /// were handled, and light that the scene leaves out.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The bounding rectangle of all that lies on the plane, with directions up to 80°. Of a scene
    /// without any, the square centimetre around the origin.
    pub(crate) fn bounding_region(&self) -> Region {
        let around = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
        let bodies = self.emitters.iter().map(Emitter::body);
        let bodies = bodies.chain(self.surfaces.iter().map(Surface::body));
        let boxes = bodies.filter_map(Body::shape).map(Shape::bounding_box);
        let all = boxes.reduce(|a, b| (around(a.0, b.0), around(a.1, b.1)));
        let (x_m, y_m) = all.unwrap_or(((-0.005, 0.005), (-0.005, 0.005)));
        Region { x_m, y_m, theta_max_rad: 80.0 / 180.0 * PI }
    }

    /// Radiance from (x, y), metres, into (θ, φ), radians, of the emitters on the plane alone. Zero
    /// off every patch. On an outline that two patches share, the first is seen.
    pub fn radiance(&self, x_m: f64, y_m: f64, theta_rad: f64, phi_rad: f64) -> f64 {
        let on = |emitter: &&Emitter| emitter.shape().is_some_and(|shape| shape.contains(x_m, y_m));
        let emitter = self.emitters.iter().find(on);
        emitter.map_or(0.0, |emitter| emitter.radiance_at(x_m, y_m, theta_rad, phi_rad))
    }

    /// Whether there is nothing but patches that emit on the sample's plane. Lamps without anything
    /// to shine on, at no place where they are seen, are nothing.
    pub(crate) fn is_flat_emitters(&self) -> bool {
        self.emitters.iter().all(|emitter| emitter.shape().is_some())
            && self.surfaces.is_empty()
            && self.occluders.is_empty()
            && self.windows.is_empty()
            && self.lamps.is_empty()
    }

    /// What is above the plane and lets no light pass, with the name that scene.toml's order gives it.
    pub(crate) fn opaque(&self) -> Vec<(String, Solid)> {
        let is_flat = |name: &str| {
            let emitters = self.emitters.iter().enumerate();
            let surfaces = self.surfaces.iter().enumerate();
            emitters
                .filter(|(_, emitter)| emitter.shape().is_some())
                .map(|(i, _)| format!("emitter[{i}]"))
                .chain(
                    surfaces
                        .filter(|(_, surface)| surface.body().shape().is_some())
                        .map(|(i, _)| format!("surface[{i}]")),
                )
                .any(|flat| flat == name)
        };
        self.solids().into_iter().filter(|(name, _)| !is_flat(name)).collect()
    }

    /// Everything opaque, with the name that scene.toml's order gives it.
    fn solids(&self) -> Vec<(String, Solid)> {
        let mut solids = Vec::new();
        let mut add = |what: &str, i: usize, solid: Option<Solid>| {
            solids.extend(solid.map(|solid| (format!("{what}[{i}]"), solid)));
        };
        for (i, emitter) in self.emitters.iter().enumerate() {
            add("emitter", i, emitter.body().solid());
        }
        for (i, surface) in self.surfaces.iter().enumerate() {
            add("surface", i, surface.body().solid());
        }
        for (i, lamp) in self.lamps.iter().enumerate() {
            add("lamp", i, lamp.solid().cloned());
        }
        for (i, occluder) in self.occluders.iter().enumerate() {
            add("occluder", i, Some(occluder.clone()));
        }
        solids
    }

    fn check_body(&self, body: &Body) -> Result<(), SceneError> {
        if let Body::Flat(shape) = body {
            let emitters = self.emitters.iter().map(Emitter::body).enumerate();
            let surfaces = self.surfaces.iter().map(Surface::body).enumerate();
            let named = emitters.map(|(i, body)| (format!("emitter[{i}]"), body));
            let named = named.chain(surfaces.map(|(i, body)| (format!("surface[{i}]"), body)));
            for (other, body) in named {
                if body.shape().is_some_and(|other| other.overlaps(shape)) {
                    return Err(SceneError::Overlap { other });
                }
            }
        }
        body.solid().map_or(Ok(()), |solid| self.check_solid(&solid))
    }

    fn check_solid(&self, solid: &Solid) -> Result<(), SceneError> {
        let (bottom, top) = solid.heights_m();
        if bottom < -SUNK * solid.extent_m() {
            return Err(SceneError::Below(bottom));
        }
        if let Some(i) = self.windows.iter().position(|window| is_within(bottom, top, window)) {
            return Err(SceneError::Penetrates { other: format!("window[{i}]") });
        }
        let clash = self.solids().into_iter().find(|(_, other)| other.penetrates(solid));
        clash.map_or(Ok(()), |(other, _)| Err(SceneError::Penetrates { other }))
    }
}

/// Whether what reaches from `bottom` to `top` has a part inside a window.
fn is_within(bottom: f64, top: f64, window: &Window) -> bool {
    let margin = SUNK * window.thickness_m;
    top > window.z_m + margin && bottom < window.z_m + window.thickness_m - margin
}
