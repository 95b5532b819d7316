//! `[[lamp]]` and `[[occluder]]`: what lights, and what is in its way.

use core::f64::consts::PI;

use radiometry::direction::unit;
use radiometry::irradiance::Sun;
use spanned_toml::{Bounds, Problem, Table};

use super::super::{Lamp, LampSource, Scene, Solid};
use super::level::{self, Worth};
use super::{LEVEL_MAX, Load, outline, pixels, refused};
use crate::Quantity;

#[derive(Clone, Copy)]
enum Kind {
    Disk,
    Environment,
    HalfPlane,
    Polygon,
    Sphere,
    Sun,
}

pub(super) fn read(table: Table<'_>, scene: &mut Scene, load: Load<'_>) -> Result<(), Problem> {
    let kind = table.required_choice(
        "kind",
        &[
            ("disk", Kind::Disk),
            ("sphere", Kind::Sphere),
            ("polygon", Kind::Polygon),
            ("sun", Kind::Sun),
            ("environment", Kind::Environment),
        ],
    )?;
    let lamp = match kind {
        Kind::Sun => read_sun(&table, scene.quantity)?,
        Kind::Environment => {
            let image = pixels::read(&table, load)?;
            let worth = Worth { exitance: PI, area_m2: None };
            let level = level::read(&table, scene.quantity, &worth)?;
            Lamp::new(LampSource::Surrounding(image), level)
        }
        Kind::Disk | Kind::HalfPlane | Kind::Polygon | Kind::Sphere => {
            let solid = read_solid(&table, kind)?;
            let worth = Worth { exitance: PI, area_m2: None };
            let level = level::read(&table, scene.quantity, &worth)?;
            Lamp::new(LampSource::Body(solid), level)
        }
    };
    scene.add_lamp(lamp).map_err(|error| refused(&table, &error))?;
    table.finish()
}

pub(super) fn read_occluder(table: Table<'_>, scene: &mut Scene) -> Result<(), Problem> {
    let kind = table.required_choice(
        "kind",
        &[
            ("half-plane", Kind::HalfPlane),
            ("disk", Kind::Disk),
            ("sphere", Kind::Sphere),
            ("polygon", Kind::Polygon),
        ],
    )?;
    let solid = read_solid(&table, kind)?;
    scene.add_occluder(solid).map_err(|error| refused(&table, &error))?;
    table.finish()
}

fn read_solid(table: &Table<'_>, kind: Kind) -> Result<Solid, Problem> {
    match kind {
        Kind::Disk => outline::disk(table),
        Kind::Polygon => outline::polygon(table),
        Kind::Sphere => outline::sphere(table),
        Kind::HalfPlane | Kind::Environment | Kind::Sun => outline::half_plane(table),
    }
}

/// The Sun without an atmosphere, after a preset or with a stated irradiance.
fn read_sun(table: &Table<'_>, quantity: Quantity) -> Result<Lamp, Problem> {
    let presets = [("lecture", Preset::Lecture), ("nominal", Preset::Nominal)];
    let preset = table.choice("preset", &presets)?.unwrap_or(Preset::Lecture);
    let theta = table.required_number("theta_deg", Bounds::between(0.0, 89.999))?;
    let phi = table.number("phi_deg", Bounds::between(-360.0, 360.0))?.unwrap_or(0.0);
    let towards = unit(theta.to_radians(), phi.to_radians());
    let sun = match preset {
        Preset::Lecture => Sun::lecture(),
        Preset::Nominal => Sun::nominal(ASTRONOMICAL_UNIT_M)
            .map_err(|e| table.problem("preset", &e.to_string(), "\"lecture\"", ""))?,
    };
    let keys = ["irradiance_w_per_m2", "illuminance_lx"];
    let (own, foreign) = match quantity {
        Quantity::Luminance => (keys[1], keys[0]),
        Quantity::Radiance | Quantity::Relative => (keys[0], keys[1]),
    };
    if table.has(foreign) {
        table.leave(foreign);
        let what = format!("the rig's detector is calibrated for {}", quantity.name());
        let help = "one can't be had from the other without a spectrum";
        return Err(table.problem(foreign, &what, own, help));
    }
    let stated = table.number(own, Bounds::between(0.0, LEVEL_MAX))?;
    let irradiance = match (stated, quantity) {
        (Some(stated), _) => stated,
        (None, Quantity::Luminance) => {
            let help = "on a surface that faces it: 127500 outside the atmosphere, say";
            return Err(table.problem(own, "missing key", "the Sun's illuminance", help));
        }
        (None, Quantity::Radiance | Quantity::Relative) => sun.irradiance().w_per_m2(),
    };
    let source = LampSource::Distant { towards, half_angle_rad: sun.half_angle_rad() };
    Ok(Lamp::new(source, irradiance / sun.projected_solid_angle().sr()))
}

#[derive(Clone, Copy)]
enum Preset {
    Lecture,
    Nominal,
}

const ASTRONOMICAL_UNIT_M: f64 = 149_597_870_700.0;
