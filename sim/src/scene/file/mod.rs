//! scene.toml. Its keys are listed in this folder and nowhere else.

mod emitter;
mod lamp;
mod level;
mod outline;
mod photometric;
mod pixels;
mod surface;
mod window;

use spanned_toml::{Document, Problem, Table};

use super::{Scene, SceneError};
use crate::{Quantity, SourceOverTime};

/// Reads a file that the scene names, by the name that it gives it: the caller knows relative to
/// what. The error is a phrase for a person.
pub type Load<'l> = &'l dyn Fn(&str) -> Result<Vec<u8>, String>;

/// No sample of a gantry is larger than this: millimetres.
const EXTENT_MM: f64 = 1e5;

/// The Sun's disk has a radiance of 2e7 W·m⁻²·sr⁻¹ and a luminance of 1.6e9 cd·m⁻²; lasers aside,
/// nothing on Earth exceeds this.
const LEVEL_MAX: f64 = 1e15;

impl Scene {
    /// Reads scene.toml for a detector that is calibrated for `quantity`. Levels are asked for
    /// in its unit, and refused in another.
    pub fn read(document: &Document, quantity: Quantity, load: Load<'_>) -> Result<Self, Problem> {
        let root = document.root();
        let mut scene = Self::new(quantity);
        let emitters = root.tables("emitter")?;
        let surfaces = root.tables("surface")?;
        let lamps = root.tables("lamp")?;
        let occluders = root.tables("occluder")?;
        let windows = root.tables("window")?;
        if let Some(source) = root.table("source")? {
            scene.over_time = SourceOverTime::read(source)?;
        }
        if emitters.is_empty() && surfaces.is_empty() {
            return Err(root.problem(
                "emitter",
                "the scene has no emitter and no surface",
                "at least one [[emitter]] or one [[surface]] with a [[lamp]]",
                "a dark sample is an emitter with a level of 0",
            ));
        }
        if emitters.is_empty() && lamps.is_empty() {
            return Err(root.problem(
                "lamp",
                "nothing lights the surfaces",
                "at least one [[lamp]] or [[emitter]]",
                "a lamp that is off has a level of 0",
            ));
        }
        root.finish()?;
        for table in emitters {
            emitter::read(table, &mut scene, load)?;
        }
        for table in surfaces {
            surface::read(table, &mut scene)?;
        }
        for table in lamps {
            lamp::read(table, &mut scene, load)?;
        }
        for table in occluders {
            lamp::read_occluder(table, &mut scene)?;
        }
        for table in windows {
            window::read(table, &mut scene)?;
        }
        if let Some((i, what)) = scene.unsupported_gloss() {
            let surfaces = document.root().tables("surface")?;
            let (root, own) = (document.root(), surfaces.get(i));
            return Err(own.unwrap_or(&root).problem(
                "kind",
                &format!("not simulated: {what}"),
                "a glossy surface that sees no other surface and no window of the sample above it",
                "make it lambertian, or leave the other out",
            ));
        }
        Ok(scene)
    }
}

/// A scene's refusal at the key that it is about.
fn refused(table: &Table<'_>, error: &SceneError) -> Problem {
    let key = match error {
        SceneError::Below(_)
        | SceneError::NoArea(_)
        | SceneError::Overlap { .. }
        | SceneError::Penetrates { .. }
        | SceneError::Shape(_) => {
            let keys = ["x_mm", "corners_mm", "radius_mm", "z_mm", "x_max_mm", "theta_deg", "file"];
            keys.into_iter().find(|key| table.has(key)).unwrap_or("kind")
        }
        SceneError::Exponent(_) => "exponent",
        SceneError::Level(_) | SceneError::Unsupported(_) => "kind",
        SceneError::Reflects(..) => {
            if table.has("gloss") {
                "gloss"
            } else {
                "albedo"
            }
        }
        SceneError::Window(..) => "index",
    };
    table.problem(key, &error.to_string(), error.expected(), "")
}
