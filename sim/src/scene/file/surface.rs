//! `[[surface]]`: what is lit, and how it reflects.

use spanned_toml::{Bounds, Problem, Table};

use super::super::{EXPONENT_MAX, Reflection, Scene, Surface};
use super::{outline, refused};

pub(super) fn read(table: Table<'_>, scene: &mut Scene) -> Result<(), Problem> {
    let is_glossy = table.required_choice("kind", &[("lambertian", false), ("glossy", true)])?;
    let part = Bounds::between(0.0, 1.0);
    let reflection = if is_glossy {
        let albedo = table.number("albedo", part)?.unwrap_or(0.0);
        let gloss = table.required_number("gloss", part)?;
        let exponent = table.required_number("exponent", Bounds::between(0.0, EXPONENT_MAX))?;
        Reflection { albedo, gloss, exponent }
    } else {
        Reflection::lambertian(table.required_number("albedo", part)?)
    };
    let surface = Surface::new(outline::required_body(&table)?, reflection);
    scene.add_surface(surface).map_err(|error| refused(&table, &error))?;
    table.finish()
}
