//! `file`: an image that a scene names.

use photometry_files::netpbm;
use spanned_toml::{Problem, Table};

use super::super::Image;
use super::Load;

const EXPECTED: &str = "a grey image, PGM or PFM";

pub(super) fn read(table: &Table<'_>, load: Load<'_>) -> Result<Image, Problem> {
    let file = table.required_text("file")?;
    let bytes = load(file).map_err(|error| {
        table.problem("file", &error, EXPECTED, "its path is relative to the scene's file")
    })?;
    let image = netpbm::read(&bytes).map_err(|error| {
        let help = "image programs write PGM (16 bits) and PFM (floats)";
        table.problem("file", &format!("{file}: {error}"), EXPECTED, help)
    })?;
    Image::from_grey(image)
        .ok_or_else(|| table.problem("file", &format!("{file}: no pixels"), EXPECTED, ""))
}
