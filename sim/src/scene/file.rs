//! scene.toml. Its keys are listed here and nowhere else.

use core::f64::consts::PI;

use spanned_toml::{Bounds, Document, Problem, Table};

use super::{EXPONENT_MAX, Emitter, Scene, SceneError, Shape, photometric};
use crate::{Quantity, SourceOverTime};

/// Reads a file that the scene names, by the name that it gives it: the caller knows relative to
/// what. The error is a phrase for a person.
pub type Load<'l> = &'l dyn Fn(&str) -> Result<Vec<u8>, String>;

/// No sample of a gantry is larger than this: millimetres.
const EXTENT_MM: f64 = 1e5;

/// The Sun's disk has a radiance of 2e7 W·m⁻²·sr⁻¹ and a luminance of 1.6e9 cd·m⁻²; lasers aside,
/// nothing on Earth exceeds this.
const LEVEL_MAX: f64 = 1e15;

#[derive(Clone, Copy)]
enum Kind {
    CosinePower,
    Lambertian,
    PhotometricFile,
}

impl Scene {
    /// Reads scene.toml for a detector that is calibrated for `quantity`. Levels are asked for
    /// in its unit, and refused in another.
    pub fn read(document: &Document, quantity: Quantity, load: Load<'_>) -> Result<Self, Problem> {
        let root = document.root();
        let mut scene = Self::new(quantity);
        let tables = root.tables("emitter")?;
        if tables.is_empty() {
            return Err(root.problem(
                "emitter",
                "the scene has no emitter",
                "at least one [[emitter]]",
                "a dark sample is an emitter with a level of 0",
            ));
        }
        if let Some(source) = root.table("source")? {
            scene.over_time = SourceOverTime::read(source)?;
        }
        root.finish()?;
        for table in tables {
            read_emitter(table, &mut scene, load)?;
        }
        Ok(scene)
    }
}

fn read_emitter(table: Table<'_>, scene: &mut Scene, load: Load<'_>) -> Result<(), Problem> {
    let kind = table.required_choice(
        "kind",
        &[
            ("lambertian", Kind::Lambertian),
            ("cosine-power", Kind::CosinePower),
            ("photometric-file", Kind::PhotometricFile),
        ],
    )?;
    let emitter = match kind {
        Kind::CosinePower => {
            let bounds = Bounds::between(0.0, EXPONENT_MAX);
            let exponent = table.required_number("exponent", bounds)?;
            let normal = read_level(&table, scene.quantity, (exponent + 2.0) / (2.0 * PI))?;
            Emitter::cosine_power(required_shape(&table)?, exponent, normal)
        }
        Kind::Lambertian => {
            let radiance = read_level(&table, scene.quantity, 1.0 / PI)?;
            Emitter::lambertian(required_shape(&table)?, radiance)
        }
        Kind::PhotometricFile => {
            let (emitter, notes) = photometric::read(&table, scene.quantity, load)?;
            scene.notes.extend(notes);
            emitter
        }
    };
    scene.add(emitter).map_err(|e| {
        let key = match e {
            SceneError::Overlap { .. } | SceneError::Shape(_) => shape_key(&table),
            SceneError::Exponent(_) => "exponent",
            SceneError::Level(_) => "kind",
        };
        table.problem(key, &e.to_string(), e.expected(), "")
    })?;
    table.finish()
}

/// The keys of a level: as radiance, as exitance.
const fn level_keys(quantity: Quantity) -> (&'static str, &'static str) {
    match quantity {
        Quantity::Luminance => ("luminance_cd_per_m2", "luminous_exitance_lm_per_m2"),
        Quantity::Radiance | Quantity::Relative => ("radiance_w_per_m2_sr", "exitance_w_per_m2"),
    }
}

/// Radiance along the normal, from the level as it is written.
fn read_level(
    table: &Table<'_>,
    quantity: Quantity,
    radiance_per_exitance: f64,
) -> Result<f64, Problem> {
    let bounds = Bounds::between(0.0, LEVEL_MAX);
    let keys = level_keys(quantity);
    let other = match quantity {
        Quantity::Luminance => Quantity::Radiance,
        Quantity::Radiance | Quantity::Relative => Quantity::Luminance,
    };
    let others = level_keys(other);
    for foreign in [others.0, others.1] {
        if table.has(foreign) {
            table.leave(foreign);
            return Err(table.problem(
                foreign,
                &format!("the rig's detector is calibrated for {}", quantity.name()),
                &format!("{} or {}", keys.0, keys.1),
                "one can't be had from the other without a spectrum: state the level in the \
                 rig's unit, or use another rig",
            ));
        }
    }
    let radiance = table.number(keys.0, bounds)?;
    let exitance = table.number(keys.1, bounds)?;
    match (radiance, exitance) {
        (Some(radiance), None) => Ok(radiance),
        (None, Some(exitance)) => Ok(exitance * radiance_per_exitance),
        (Some(_), Some(_)) => Err(table.problem(
            keys.1,
            "the level is stated twice",
            &format!("either {} or {}", keys.0, keys.1),
            "remove one of the two",
        )),
        (None, None) => Err(table.problem(
            keys.0,
            "missing key",
            &format!("{} or {}", keys.0, keys.1),
            "add the emitter's level",
        )),
    }
}

fn required_shape(table: &Table<'_>) -> Result<Shape, Problem> {
    read_shape(table)?.ok_or_else(|| {
        table.problem(
            "x_mm",
            "the emitter has no outline",
            "x_mm and y_mm, each [low, high], or radius_mm",
            "add x_mm = [-10, 10] and y_mm = [-10, 10], say",
        )
    })
}

/// The outline that is written, if one is.
pub(super) fn read_shape(table: &Table<'_>) -> Result<Option<Shape>, Problem> {
    let extent = Bounds::between(-EXTENT_MM, EXTENT_MM);
    let x = table.interval("x_mm", extent)?.map(metres);
    let y = table.interval("y_mm", extent)?.map(metres);
    let radius = table.number("radius_mm", Bounds::positive_up_to(EXTENT_MM))?;
    let centre = table.numbers("centre_mm", extent, 2..=2)?;
    let contradiction = |key: &str, what: &str| {
        let expected = "x_mm with y_mm, or radius_mm (with centre_mm)";
        Err(table.problem(key, what, expected, "keep the keys of one outline"))
    };
    match (x, y, radius) {
        (Some(x_m), Some(y_m), None) if centre.is_none() => Ok(Some(Shape::Rectangle { x_m, y_m })),
        (Some(_), Some(_), None) => contradiction("centre_mm", "a rectangle is given by its sides"),
        (None, None, Some(radius)) => {
            let centre = centre.unwrap_or_else(|| vec![0.0, 0.0]);
            Ok(Some(Shape::disk(centre[0] / 1e3, centre[1] / 1e3, radius / 1e3)))
        }
        (None, None, None) if centre.is_none() => Ok(None),
        (None, None, None) => contradiction("centre_mm", "a centre without a radius"),
        (Some(_), None, None) => contradiction("x_mm", "y_mm is missing beside it"),
        (None, Some(_), None) => contradiction("y_mm", "x_mm is missing beside it"),
        (_, _, Some(_)) => contradiction("radius_mm", "a disk and a rectangle at once"),
    }
}

fn shape_key(table: &Table<'_>) -> &'static str {
    ["x_mm", "radius_mm", "file"].into_iter().find(|key| table.has(key)).unwrap_or("kind")
}

fn metres((low, high): (f64, f64)) -> (f64, f64) {
    (low / 1e3, high / 1e3)
}
