//! `[[emitter]]`: laws and their keys.

use radiometry::direction::unit;
use spanned_toml::{Bounds, Problem, Table};

use super::super::{
    Batwing, Body, EXPONENT_MAX, Emitter, LOBE_EXPONENT_MIN, Law, Lobe, Lobes, SHARPNESS_MAX,
    Scene, Shape,
};
use super::level::{self, Worth};
use super::{Load, outline, photometric, pixels, refused};

#[derive(Clone, Copy)]
enum Kind {
    Batwing,
    CosinePower,
    Image,
    Lambertian,
    Lobes,
    PhotometricFile,
}

pub(super) fn read(table: Table<'_>, scene: &mut Scene, load: Load<'_>) -> Result<(), Problem> {
    let kind = table.required_choice(
        "kind",
        &[
            ("lambertian", Kind::Lambertian),
            ("cosine-power", Kind::CosinePower),
            ("batwing", Kind::Batwing),
            ("lobes", Kind::Lobes),
            ("image", Kind::Image),
            ("photometric-file", Kind::PhotometricFile),
        ],
    )?;
    let emitter = match kind {
        Kind::Lambertian => of_law(&table, scene, Law::Lambertian)?,
        Kind::CosinePower => {
            let bounds = Bounds::between(0.0, EXPONENT_MAX);
            let exponent = table.required_number("exponent", bounds)?;
            of_law(&table, scene, Law::CosinePower { exponent })?
        }
        Kind::Batwing => of_law(&table, scene, read_batwing(&table)?)?,
        Kind::Lobes => of_law(&table, scene, read_lobes(&table)?)?,
        Kind::Image => read_image(&table, scene, load)?,
        Kind::PhotometricFile => {
            let (emitter, notes) = photometric::read(&table, scene.quantity, load)?;
            scene.notes.extend(notes);
            emitter
        }
    };
    scene.add(emitter).map_err(|error| refused(&table, &error))?;
    table.finish()
}

fn of_law(table: &Table<'_>, scene: &Scene, law: Law) -> Result<Emitter, Problem> {
    let exitance = Emitter::exitance_per_level(&law, None);
    let body = outline::required_body(table);
    // A level that is missing or foreign is told before an outline that is, as it stands first in
    // most files.
    let area_m2 = body.as_ref().ok().map(Body::area_m2);
    let worth = Worth { exitance, area_m2: Some(area_m2.unwrap_or(1.0)) };
    let level = level::read(table, scene.quantity, &worth)?;
    Ok(Emitter::new(body?, law, level))
}

fn read_batwing(table: &Table<'_>) -> Result<Law, Problem> {
    let peak_deg = table.required_number("peak_theta_deg", Bounds::between(0.1, 89.9))?;
    let valley = table.required_number("valley", Bounds::between(0.0, 1.0))?;
    let sharpness = table.integer("sharpness", 1..=i64::from(SHARPNESS_MAX))?.unwrap_or(1);
    let sharpness = u32::try_from(sharpness).unwrap_or(SHARPNESS_MAX);
    Batwing::new(peak_deg.to_radians(), valley, sharpness).map(Law::Batwing).ok_or_else(|| {
        table.problem("peak_theta_deg", "no batwing has these numbers", "an angle off 0 and 90", "")
    })
}

fn read_lobes(table: &Table<'_>) -> Result<Law, Problem> {
    let weight = Bounds::between(0.0, 1e9);
    let base = table.number("base_weight", weight)?.unwrap_or(0.0);
    let mut lobes = Vec::new();
    for lobe in table.tables("lobes")? {
        let theta = lobe.required_number("theta_deg", Bounds::between(0.0, 90.0))?;
        let phi = lobe.number("phi_deg", Bounds::between(-360.0, 360.0))?.unwrap_or(0.0);
        let exponent = read_exponent(&lobe)?;
        let axis = unit(theta.to_radians(), phi.to_radians());
        let weight = lobe.number("weight", weight)?.unwrap_or(1.0);
        lobe.finish()?;
        lobes.push(Lobe { axis, exponent, weight });
    }
    Lobes::new(base, lobes).map(Law::Lobes).ok_or_else(|| {
        let expected =
            "at least one lobe: lobes = [{ theta_deg = 30, phi_deg = 0, exponent = 20 }]";
        table.problem("lobes", "the emitter has no lobe", expected, "")
    })
}

/// How narrow a lobe is: by its exponent, or by its full width at half maximum.
fn read_exponent(lobe: &Table<'_>) -> Result<f64, Problem> {
    let exponent = lobe.number("exponent", Bounds::between(LOBE_EXPONENT_MIN, EXPONENT_MAX))?;
    let width = lobe.number("width_deg", Bounds::between(0.7, 90.0))?;
    match (exponent, width) {
        (Some(exponent), None) => Ok(exponent),
        (None, Some(width_deg)) => {
            Ok(Lobe::exponent_of_width(width_deg.to_radians())
                .clamp(LOBE_EXPONENT_MIN, EXPONENT_MAX))
        }
        (Some(_), Some(_)) => {
            let what = "the lobe's width is stated twice";
            Err(lobe.problem("width_deg", what, "either exponent or width_deg", "keep one"))
        }
        (None, None) => {
            let help = "width_deg is the full width at half maximum";
            Err(lobe.problem("exponent", "missing key", "exponent or width_deg", help))
        }
    }
}

fn read_image(table: &Table<'_>, scene: &Scene, load: Load<'_>) -> Result<Emitter, Problem> {
    let image = pixels::read(table, load)?;
    let exponent = table.number("exponent", Bounds::between(0.0, EXPONENT_MAX))?.unwrap_or(0.0);
    let law = if exponent == 0.0 { Law::Lambertian } else { Law::CosinePower { exponent } };
    let shape = outline::shape(table)?;
    let Some(Shape::Rectangle { x_m, y_m }) = shape else {
        let expected = "x_mm and y_mm, each [low, high]";
        return Err(table.problem("x_mm", "an image fills a rectangle", expected, ""));
    };
    let area_m2 = Shape::Rectangle { x_m, y_m }.area_m2();
    let exitance = Emitter::exitance_per_level(&law, Some(&image));
    let worth = Worth { exitance, area_m2: Some(area_m2) };
    let level = level::read(table, scene.quantity, &worth)?;
    Ok(Emitter::image(x_m, y_m, image, law, level))
}
