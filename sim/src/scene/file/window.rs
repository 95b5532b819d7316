//! `[[window]]`.

use spanned_toml::{Bounds, Problem, Table};

use super::super::{Scene, Window, WindowOwner};
use super::{EXTENT_MM, refused};

pub(super) fn read(table: Table<'_>, scene: &mut Scene) -> Result<(), Problem> {
    let z_mm = table.required_number("z_mm", Bounds::between(-EXTENT_MM, EXTENT_MM))?;
    let thickness_mm = table.required_number("thickness_mm", Bounds::positive_up_to(EXTENT_MM))?;
    let index = table.required_number("index", Bounds::between(1.0, 10.0))?;
    let absorption = table.number("absorption_per_mm", Bounds::between(0.0, 1e6))?.unwrap_or(0.0);
    let owners = [("sample", WindowOwner::Sample), ("beam", WindowOwner::Beam)];
    let window = Window {
        z_m: z_mm / 1e3,
        thickness_m: thickness_mm / 1e3,
        index,
        absorption_per_m: absorption * 1e3,
        belongs_to: table.required_choice("belongs_to", &owners)?,
    };
    scene.add_window(window).map_err(|error| refused(&table, &error))?;
    table.finish()
}
