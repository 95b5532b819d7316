//! An emitter after a photometric file: which of its units and openings make a flat patch, and
//! what the table says once round and down to the horizontal.

use photometry_files::lm63::{self, IntensityUnit, Opening, Outline, Photometry};
use spanned_toml::{Problem, Table};

use super::super::{Emitter, Shape, Tabulated};
use super::{Load, outline};
use crate::Quantity;

/// Two extents of an ellipse that differ by less than this part are a circle's.
const CIRCLE: f64 = 1e-9;

/// The emitter, and what to tell a person about its file.
pub(super) fn read(
    table: &Table<'_>,
    quantity: Quantity,
    load: Load<'_>,
) -> Result<(Emitter, Vec<String>), Problem> {
    let file = table.required_text("file")?;
    let at_file = |what: &str, expected: &str, help: &str| {
        table.problem("file", &format!("{file}: {what}"), expected, help)
    };
    let bytes = load(file).map_err(|e| {
        // The error names the file as it was looked for.
        let help = "its path is relative to the scene's file";
        table.problem("file", &e, "a photometric file", help)
    })?;
    let photometry = lm63::read(&bytes).map_err(|e| {
        let help = "is the file complete, and the right one? Get it again from where it came";
        at_file(&e.to_string(), "a photometric file in IES LM-63", help)
    })?;
    let scale = si_unit(photometry.intensity_unit(), quantity).map_err(|expected| {
        let what = format!(
            "intensities in {}, and the rig's detector is calibrated for {}",
            photometry.intensity_unit(),
            quantity.name()
        );
        let help = "one can't be had from the other without a spectrum: use a file in the rig's \
                    unit, or another rig";
        at_file(&what, expected, help)
    })?;
    let shape = match outline::shape(table)? {
        Some(shape) => shape,
        None => flat(&photometry.opening()).map_err(|opening| {
            let what = format!("its luminous opening is {opening}");
            let help = "state what shines in the scene: x_mm and y_mm, or radius_mm";
            at_file(&what, "a flat rectangle or circle", help)
        })?,
    };
    let intensity = |c_deg, gamma_deg| scale * photometry.intensity(c_deg, gamma_deg);
    let tabulated = Tabulated::new(&once_round(&photometry), photometry.gamma_deg(), intensity)
        .map_err(|e| at_file(&e.to_string(), "intensities of at least 0 below 90°", ""))?;
    let notes = photometry.notes().iter().map(|note| format!("{file}: {note}")).collect();
    Ok((Emitter::tabulated(shape, tabulated), notes))
}

/// What one unit of the file is in W·sr⁻¹ or cd; or what would have been right.
fn si_unit(unit: IntensityUnit, quantity: Quantity) -> Result<f64, &'static str> {
    match (quantity, unit.watts_per_steradian()) {
        (Quantity::Luminance, None) => Ok(1.0),
        (Quantity::Luminance, Some(_)) => Err("intensities in candela"),
        (Quantity::Radiance | Quantity::Relative, Some(watts)) => Ok(watts),
        (Quantity::Radiance | Quantity::Relative, None) => {
            Err("intensities in W/sr, mW/sr or µW/sr")
        }
    }
}

/// The patch that a flat opening is, around the turntable's axis; or what the opening is instead.
fn flat(opening: &Opening) -> Result<Shape, &'static str> {
    match opening.outline().map_err(|e| e.opening)? {
        Outline::Rectangle { x_m, y_m } => Ok(Shape::rectangle(0.0, 0.0, x_m, y_m)),
        Outline::Ellipse { x_m, y_m } if (x_m - y_m).abs() <= CIRCLE * x_m => {
            Ok(Shape::disk(0.0, 0.0, x_m / 2.0))
        }
        Outline::Ellipse { .. } => Err("an ellipse"),
    }
}

/// Every C, degrees, at which the table may bend, from 0 to 360: the file's planes and their
/// mirror images, whichever of them its symmetry uses.
fn once_round(photometry: &Photometry) -> Vec<f64> {
    let mirrored = |c: f64| [c, 180.0 - c, 180.0 + c, 360.0 - c];
    let planes = photometry.c_deg().iter().flat_map(|c| mirrored(*c));
    let mut nodes: Vec<f64> =
        planes.filter(|c| *c > 0.0 && *c < 360.0).chain([0.0, 360.0]).collect();
    nodes.sort_by(f64::total_cmp);
    nodes.dedup_by(|next, previous| *next - *previous < 1e-9);
    if let Some(last) = nodes.last_mut() {
        *last = 360.0;
    }
    nodes
}
