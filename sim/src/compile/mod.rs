//! From a scene, a rig as stated and the terms of a plan to a rig as it is: every effect weighed,
//! what is chosen turned into stages, every uncertain number drawn once, and a row written for
//! each effect, in or out.
//!
//! How a module takes part: it offers its candidates for a [`Setting`] (`candidates`), and builds
//! what was [`Chosen`](crate::effect::Chosen) of them. The order of the rows is that in which light
//! and counts meet them.

mod compiled;
mod drawn;
mod error;
mod setting;

use core::f64::consts::PI;
use std::sync::Arc;

pub use compiled::Compiled;
pub use error::CompileError;

pub(crate) use setting::{PART_OF_NOISE, Setting};

use crate::check::check;
use crate::effect::decide;
use crate::light::Scenery;
use crate::optics::Light;
use crate::{Nominal, Scene, Simulated, Terms, detector, light, mechanics, time};
use drawn::Drawn;

/// Compiles a rig. The same arguments give the same rig, to the last bit.
pub fn compile(
    scene: Scene,
    nominal: Nominal,
    simulated: Simulated,
    terms: &Terms,
) -> Result<Compiled, CompileError> {
    check(&scene, &nominal, &simulated, terms)?;
    let scene = Arc::new(scene);
    let mut scenery = Scenery::new(Arc::clone(&scene))?;
    if scenery.sees_itself() {
        let tolerance = Setting::new(&scenery, &nominal, &simulated, terms)?.tolerance;
        let spot_radius_m = nominal.detector.spot_radius_m;
        scenery = scenery.with_exchange(tolerance, PI * spot_radius_m * spot_radius_m)?;
    }
    let mut setting = Setting::new(&scenery, &nominal, &simulated, terms)?;
    let tolerance = setting.tolerance;
    let mut beam = Light::of(&setting).map_err(CompileError::Beam)?;
    let mut candidates = core::mem::take(&mut beam.candidates);
    let of_light = light::candidates(&setting)?;
    let light: Vec<String> = of_light.iter().map(|own| own.name.clone()).collect();
    let called: Vec<String> =
        of_light.iter().filter(|own| own.cause.is_some()).map(|own| own.name.clone()).collect();
    candidates.extend(of_light);
    candidates.extend(mechanics::candidates(&setting));
    candidates.extend(time::candidates(&setting));
    candidates.extend(detector::candidates(&setting));
    let chosen = decide(candidates, tolerance, terms)?;
    let is_in = |name: &str| chosen.has(name);
    setting.field = light::field(&scenery, Some(nominal.detector.distance_m), &is_in)?;
    let is_whole = called.iter().all(|name| chosen.has(name));
    let (region, optics) = (setting.region, beam.optics(&setting, &chosen, is_whole));
    let (seen, field) = (Arc::clone(&setting.field), light::field(&scenery, None, &is_in)?);
    let (seed, drawn) = (terms.seed, Drawn::new(&nominal, &simulated, terms.seed, &chosen)?);
    Ok(Compiled {
        scene,
        nominal,
        simulated,
        seed,
        drawn,
        seen,
        field,
        light,
        scenery,
        optics,
        chosen,
        region,
        tolerance,
    })
}
