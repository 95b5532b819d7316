//! What is seen along a ray of a scene with everything in it: emitters, lit surfaces, raised bodies,
//! windows, and what stands in the detector's beam. It knows no beam of a width and no detector but
//! how far away that stands.

mod effects;
mod gloss;
mod interreflection;
mod lamps;
mod landmarks;
mod patches;
mod plate;
mod returned;
mod rings;
mod scenery;
mod smooth;
mod source;

use std::sync::Arc;

use core::f64::consts::PI;

use glam::DVec3;
use radiometry::projected::Occluder;

pub(crate) use effects::{candidates, field};
pub(crate) use scenery::Scenery;

use crate::field::{Field, Ray};
use crate::scene::{Body, Emitter, Law, Reflection, Scene, Solid, WindowOwner};
use crate::{CompileError, Region};
use gloss::Gloss;
use interreflection::Interreflection;
use lamps::Lighting;
use plate::Plate;
use returned::{Patch, Returned};

/// The name of the effect that surfaces light each other.
const INTERREFLECTION: &str = "interreflection";

/// Which of a scene's effects are in, by their names.
pub(crate) type Included<'i> = &'i dyn Fn(&str) -> bool;

/// A scene as it looks.
#[derive(Debug)]
pub(crate) struct LitScene {
    /// What lies in the sample's plane, then what stands above it.
    flat: Vec<Part>,
    raised: Vec<Part>,
    /// The highest first.
    plates: Vec<Plate>,
    /// What the sample's window throws back on its plane.
    returned: Option<Returned>,
    /// What surfaces that see each other send to one another.
    interreflection: Option<Interreflection>,
    /// How far the detector is from the sample's plane, along its beam; nothing farther is in its
    /// way. Infinite for what leaves the sample.
    reach_m: f64,
}

/// One body of it.
#[derive(Debug)]
struct Part {
    name: String,
    body: Body,
    glow: Glow,
}

/// What a body sends out.
#[derive(Debug)]
enum Glow {
    Black,
    Emits(Emitter),
    /// The same everywhere, from both faces.
    Lamp(f64),
    Lit(Lit),
}

/// A surface: its place in the scene, how it reflects, and what shines on it.
#[derive(Debug)]
struct Lit {
    surface: usize,
    reflection: Reflection,
    lighting: Arc<Lighting>,
    /// Its lobe, if it has one.
    gloss: Option<Gloss>,
}

impl LitScene {
    /// What the detector sees at a distance, or (without one) what leaves the sample.
    pub(crate) fn new(
        scenery: &Scenery,
        distance_m: Option<f64>,
        is_in: Included<'_>,
    ) -> Result<Self, CompileError> {
        let scene = &*scenery.scene;
        let mut parts = Vec::new();
        for (i, emitter) in scene.emitters().iter().enumerate() {
            let (name, body) = (format!("emitter[{i}]"), emitter.body().clone());
            parts.push(Part { name, body, glow: Glow::Emits(emitter.clone()) });
        }
        let lightings = Lighting::all(scene, is_in)?;
        for (i, surface) in scene.surfaces().iter().enumerate() {
            let lighting = Arc::clone(&lightings[i]);
            let reflection = *surface.reflection();
            let gloss = Gloss::new(&reflection).filter(|_| is_in(&format!("gloss[{i}]")));
            let glow = Glow::Lit(Lit { surface: i, reflection, lighting, gloss });
            parts.push(Part { name: format!("surface[{i}]"), body: surface.body().clone(), glow });
        }
        if distance_m.is_some() {
            in_the_beam(scene, is_in, &mut parts);
        }
        // What stands higher than the detector is met by no ray on its way there.
        let reach_m = distance_m.unwrap_or(f64::INFINITY);
        parts.retain(|part| match &part.body {
            Body::Raised(solid) => solid.heights_m().0 < reach_m,
            Body::Flat(_) => true,
        });
        let (flat, raised) = parts.into_iter().partition(|part| part.body.shape().is_some());
        let windows = scene.windows().iter().enumerate().filter(|(i, window)| {
            let is_seen = distance_m.is_some() || window.belongs_to == WindowOwner::Sample;
            is_seen && is_in(&format!("window[{i}]"))
        });
        let plates = windows.map(|(i, window)| {
            Plate::new(window).map_err(|e| CompileError::Scene(format!("window[{i}]: {e}")))
        });
        let mut plates = plates.collect::<Result<Vec<_>, _>>()?;
        plates.sort_by(|a, b| b.low_m().total_cmp(&a.low_m()));
        let exchange = scenery.exchange.as_ref().filter(|_| is_in(INTERREFLECTION));
        let interreflection = exchange.map(|exchange| exchange.lit(&lightings)).transpose()?;
        let mut lit = Self { flat, raised, plates, returned: None, interreflection, reach_m };
        lit.returned = lit.thrown_back(scene, is_in)?;
        Ok(lit)
    }

    /// With more nodes over each lobe, and over what comes through windows; whether there are any.
    fn refine(&mut self) -> bool {
        let mut is_any = false;
        for part in self.flat.iter_mut().chain(&mut self.raised) {
            let Glow::Lit(lit) = &mut part.glow else { continue };
            if let Some(gloss) = &mut lit.gloss {
                *gloss = gloss.finer();
                is_any = true;
            }
            if let Some(finer) = lit.lighting.finer() {
                lit.lighting = Arc::new(finer);
                is_any = true;
            }
        }
        is_any
    }

    /// Of the sample's window, if it has one and patches that it can light.
    fn thrown_back(
        &self,
        scene: &Scene,
        is_in: Included<'_>,
    ) -> Result<Option<Returned>, CompileError> {
        let Some((i, window)) = effects::returning(scene)? else { return Ok(None) };
        if !is_in(&format!("window-return[{i}]")) || !is_in(&format!("window[{i}]")) {
            return Ok(None);
        }
        let plate = Plate::new(window);
        let plate = plate.map_err(|e| CompileError::Scene(format!("window[{i}]: {e}")))?;
        let patches = self.flat.iter().filter_map(|part| match &part.glow {
            Glow::Emits(emitter) => Some(Patch::Emits(emitter)),
            Glow::Lit(Lit { reflection, lighting, .. }) => {
                let shape = part.body.shape()?;
                Some(Patch::Lit { shape, albedo: reflection.albedo, lighting })
            }
            Glow::Black | Glow::Lamp(_) => None,
        });
        let patches: Vec<Patch<'_>> = patches.collect();
        Ok(Some(Returned::new(plate, &patches)))
    }

    /// What is raised and nearest to the detector, of the part of a ray between two distances from
    /// the sample's plane.
    fn raised_along(&self, ray: &Ray, (from, to): (f64, f64)) -> Option<f64> {
        let hits = self.raised.iter().filter_map(|part| {
            let Body::Raised(solid) = &part.body else { return None };
            Some((solid.last_hit(ray.point, ray.direction, (from, to))?, part))
        });
        let (distance, part) = hits.max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(self.radiance_of(part, ray.point + ray.direction * distance, ray.direction))
    }

    fn flat_at(&self, ray: &Ray) -> f64 {
        let part = self.flat.iter().find(|part| {
            part.body.shape().is_some_and(|shape| shape.contains(ray.point.x, ray.point.y))
        });
        part.map_or(0.0, |part| self.radiance_of(part, ray.point, ray.direction))
    }

    /// From a place of a part into a direction.
    fn radiance_of(&self, part: &Part, place: DVec3, direction: DVec3) -> f64 {
        match &part.glow {
            Glow::Black => 0.0,
            Glow::Emits(emitter) => emitter.radiance_from(place, direction),
            Glow::Lamp(radiance) => *radiance,
            Glow::Lit(lit) => {
                let normal = part.body.normal(place);
                if normal.dot(direction) <= 0.0 {
                    return 0.0;
                }
                let mut arriving = lit.lighting.irradiance(place, normal);
                if let Some(returned) =
                    self.returned.as_ref().filter(|_| part.body.shape().is_some())
                {
                    arriving += returned.irradiance(place.truncate());
                }
                if let Some(others) = &self.interreflection {
                    arriving += others.irradiance(lit.surface, place);
                }
                let mut radiance = lit.reflection.albedo / PI * arriving;
                if let Some(gloss) = &lit.gloss {
                    radiance += lit.lighting.glossy(&gloss.lobe(place, normal, direction), place);
                }
                radiance
            }
        }
    }
}

/// What the detector's beam may meet before the sample: occluders, and lamps that have a place.
fn in_the_beam(scene: &Scene, is_in: Included<'_>, parts: &mut Vec<Part>) {
    for (i, occluder) in scene.occluders().iter().enumerate() {
        if is_in(&format!("beam-shadow[{i}]")) {
            let (name, body) = (format!("occluder[{i}]"), Body::Raised(occluder.clone()));
            parts.push(Part { name, body, glow: Glow::Black });
        }
    }
    for (i, lamp) in scene.lamps().iter().enumerate() {
        let Some(solid) = lamp.solid().filter(|_| is_in(&format!("lamp-in-beam[{i}]"))) else {
            continue;
        };
        let (name, body) = (format!("lamp[{i}]"), Body::Raised(solid.clone()));
        parts.push(Part { name, body, glow: Glow::Lamp(lamp.radiance()) });
    }
}

impl Field for LitScene {
    fn radiance(&self, ray: &Ray) -> f64 {
        let rise = ray.direction.z;
        let (mut ray, mut passes, mut top) = (*ray, 1.0, self.reach_m);
        for plate in &self.plates {
            let upper = plate.high_m() / rise;
            if upper >= self.reach_m {
                continue;
            }
            if let Some(radiance) = self.raised_along(&ray, (upper, top)) {
                return passes * radiance;
            }
            let passage = plate.passage(ray.direction);
            passes *= passage.transmittance;
            ray.point += passage.shift_m;
            top = plate.low_m() / rise;
        }
        let raised = self.raised_along(&ray, (0.0, top));
        passes * raised.unwrap_or_else(|| self.flat_at(&ray))
    }

    fn landmarks(&self, region: &Region) -> Vec<Ray> {
        landmarks::of(self, region)
    }

    fn details(&self, region: &Region) -> Vec<Ray> {
        let mut rays = landmarks::towards_bodies(self, region);
        for part in &self.flat {
            let Glow::Emits(emitter) = &part.glow else { continue };
            let places = emitter.borders_within(region.x_m, region.y_m);
            rays.extend(places.into_iter().map(|(x, y)| Ray::new(x, y, 0.0, 0.0)));
        }
        rays
    }

    fn patches(&self) -> Option<Vec<crate::field::Patch>> {
        self.flat_patches()
    }

    fn on_patch(&self, patch: usize, ray: &Ray) -> f64 {
        self.of_flat_patch(patch, ray)
    }

    fn is_slow(&self) -> bool {
        let mut parts = self.flat.iter().chain(&self.raised);
        parts.any(|part| matches!(&part.glow, Glow::Lit(lit) if lit.gloss.is_some()))
    }

    fn is_even(&self) -> bool {
        let is_even = |part: &Part| match &part.glow {
            Glow::Emits(emitter) => *emitter.law() == Law::Lambertian,
            Glow::Lit(lit) => lit.gloss.is_none(),
            Glow::Black | Glow::Lamp(_) => true,
        };
        self.plates.is_empty() && self.raised.is_empty() && self.flat.iter().all(is_even)
    }
}

/// A body as radiometry's kernels take it.
fn occluder_of(solid: &Solid) -> Occluder {
    match solid {
        Solid::Disk(disk) => Occluder::Disk(*disk),
        Solid::HalfPlane(edge) => Occluder::HalfPlane(*edge),
        Solid::Polygon(polygon) => Occluder::Polygon(polygon.clone()),
        Solid::Sphere(ball) => Occluder::Sphere(*ball),
    }
}

/// The field of a scene without anything but flat emitters is the scene itself.
pub(crate) fn plain(scene: &Arc<Scene>) -> Option<Arc<dyn Field>> {
    scene.is_flat_emitters().then(|| Arc::clone(scene) as Arc<dyn Field>)
}
