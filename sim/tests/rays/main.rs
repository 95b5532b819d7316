//! What could break: an effect that is in and is not what light does. Each is held against a slow
//! reference that shares no formula with the simulator: rays from random places of the pupil through
//! random places of the spot, refracted at every face, scattered at every surface, lamps hit by chance.
//!
//! A comparison fails beyond five standard errors and what the effect's row states; how small the
//! error must be is asserted too, so that it can fail.

#[path = "../bench/mod.rs"]
mod bench;

mod beam;
mod beams;
mod conserved;
mod dice;
mod form;
mod glass;
mod lit;
mod panes;
mod world;

use glam::DVec3;
use sim::{Axis, Compiled, Nominal, Quantity, Ray, Region, Scene, Simulated, Terms, compile};
use spanned_toml::{Document, Source};

use beam::{Mean, along_axis, reading};
use world::World;

const MM: f64 = 1e-3;

fn read(text: &str) -> Scene {
    let document = Document::parse(Source::new("scene.toml", text)).unwrap();
    let load = |name: &str| match name {
        "sky.pgm" => Ok(b"P2 4 4 9\n4 1 0 9 1 2 3 1 0 0 0 0 0 0 0 0\n".to_vec()),
        "image.pgm" => Ok(b"P2 3 2 9\n9 3 5\n1 0 7\n".to_vec()),
        _ => Err("no such file".to_owned()),
    };
    Scene::read(&document, Quantity::Radiance, &load).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// A scene, compiled with everything that it calls for, beside its reference.
struct Both {
    compiled: Compiled,
    world: World,
    nominal: Nominal,
}

impl Both {
    fn new(scene: Scene, laws: &[fn(DVec3) -> f64], nominal: Nominal) -> Self {
        Self::without(&[], scene, laws, nominal)
    }

    /// Along axes alone: to choose a beam takes longer than to look along some rays.
    fn of_axes(text: &str) -> Self {
        Self::without(&["finite-beam"], read(text), &[], bench::exact_rig())
    }

    fn without(
        effects: &[&str],
        scene: Scene,
        laws: &[fn(DVec3) -> f64],
        nominal: Nominal,
    ) -> Self {
        let side = (-10.0 * MM, 10.0 * MM);
        let region = Region { x_m: side, y_m: side, theta_max_rad: 75f64.to_radians() };
        let without = effects.iter().map(|name| (*name).to_owned()).collect();
        let (region, tolerance) = (Some(region), Some(1e-5));
        let terms = Terms { region, tolerance, without, ..Terms::default() };
        let world = World::new(&scene, laws);
        let compiled = compile(scene, nominal.clone(), Simulated::default(), &terms);
        Self { compiled: compiled.unwrap_or_else(|e| panic!("{e}")), world, nominal }
    }

    /// What the row of the beam states.
    fn stated(&self) -> f64 {
        let row = self.compiled.effects().iter().find(|row| row.name == "finite-beam").unwrap();
        row.error.unwrap_or(row.bound.unwrap().value).max(self.compiled.tolerance())
    }

    /// The finite beam.
    fn seen(&self, axis: &Axis, rays: u32) -> (f64, Mean) {
        let found = self.compiled.seen_radiance(axis);
        (found, reading(&self.world, &self.nominal.detector, axis, rays, 1))
    }

    /// One ray of what leaves the sample, from a place on its way that nothing is before.
    fn leaving(&self, axis: &Axis, z_m: f64, paths: u32) -> (f64, Mean) {
        let ray = Ray { point: axis.spot, direction: axis.direction };
        let from = axis.spot + axis.direction * (z_m / axis.direction.z);
        let mean = beam::along(&self.world, from, -axis.direction, paths, 3);
        (self.compiled.radiance(&ray), mean)
    }

    /// One ray, of what leaves the sample's plane, below all that stands above it.
    fn along(&self, axis: &Axis, paths: u32) -> (f64, Mean) {
        let ray = Ray { point: axis.spot, direction: axis.direction };
        let found = self.compiled.radiance(&ray);
        (found, along_axis(&self.world, axis, paths, 2))
    }
}

fn axis(x_mm: f64, y_mm: f64, theta_deg: f64, phi_deg: f64) -> Axis {
    let ray = Ray::new(x_mm * MM, y_mm * MM, theta_deg.to_radians(), phi_deg.to_radians());
    Axis { spot: ray.point, direction: ray.direction }
}

/// Within five standard errors, which must be small beside `scale`, and a stated error.
fn agree(what: &str, (found, mean): (f64, Mean), scale: f64, stated: f64, fine: f64) {
    let Mean { value, error } = mean;
    assert!(error <= fine * scale, "{what}: {value} ± {error} is too coarse to tell");
    let allowed = 5.0 * error + stated * scale;
    assert!((found - value).abs() <= allowed, "{what}: {found}, by rays {value} ± {error}");
}
