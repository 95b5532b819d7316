//! Form factors.

use radiometry::Tolerance;
use radiometry::form_factor;
use radiometry::quantity::FormFactor;

use super::row::Row;
use super::{Call, Kind, estimated, value};
use crate::study::arithmetic::Unmeasured;

pub(super) fn call(quantity: &str, row: Row<'_>) -> Result<Option<Call>, Unmeasured> {
    Ok(Some(match quantity {
        "form-factor-coaxial-disks" => {
            Call::new(Kind::Closed, row.numbers(["r1", "r2", "h"])?, |[r1, r2, h]| {
                value(form_factor::coaxial_disks(*r1, *r2, *h), FormFactor::ratio)
            })
        }
        "form-factor-sphere-disk" => {
            Call::new(Kind::Closed, row.numbers(["r1", "h", "r2"])?, |[r1, h, r2]| {
                value(form_factor::sphere_disk(*r1, *h, *r2), FormFactor::ratio)
            })
        }
        "form-factor-concentric-spheres" => {
            Call::new(Kind::Closed, row.numbers(["r1", "r2"])?, |[r1, r2]| {
                value(form_factor::concentric_spheres(*r1, *r2), FormFactor::ratio)
            })
        }
        "form-factor-strips" => {
            let from = [row.point_2d("p0")?, row.point_2d("p1")?];
            let to = [row.point_2d("q0")?, row.point_2d("q1")?];
            Call::new(Kind::Closed, (from, to), |(from, to)| {
                value(form_factor::strips(*from, *to), FormFactor::ratio)
            })
        }
        "form-factor-parallel-cylinders" => {
            Call::new(Kind::Closed, row.numbers(["r", "d"])?, |[r, d]| {
                value(form_factor::parallel_cylinders(*r, *d), FormFactor::ratio)
            })
        }
        _ => return rectangles(quantity, row),
    }))
}

fn rectangles(quantity: &str, row: Row<'_>) -> Result<Option<Call>, Unmeasured> {
    Ok(Some(match quantity {
        "form-factor-parallel-rectangles" => {
            Call::new(Kind::Corners, row.numbers(["a", "b", "c"])?, |[a, b, c]| {
                value(form_factor::parallel_rectangles(*a, *b, *c), FormFactor::ratio)
            })
        }
        "form-factor-perpendicular-rectangles" => {
            Call::new(Kind::Corners, row.numbers(["w", "h", "l"])?, |[w, h, l]| {
                value(form_factor::perpendicular_rectangles(*w, *h, *l), FormFactor::ratio)
            })
        }
        "form-factor-aligned-rectangles" => {
            let keys = [["x1", "x2"], ["y1", "y2"], ["xi1", "xi2"], ["eta1", "eta2"]];
            let [x, y, xi, eta] = keys.map(|keys| row.numbers(keys));
            let inputs = (x?, y?, xi?, eta?, row.number("z")?);
            Call::new(Kind::Corners, inputs, |(x, y, xi, eta, z)| {
                let factor = form_factor::aligned_rectangles(*x, *y, *xi, *eta, *z);
                value(factor, FormFactor::ratio)
            })
        }
        "form-factor-perpendicular-offset-rectangles" => {
            let keys = [["x1", "x2"], ["y1", "y2"], ["z1", "z2"], ["eta1", "eta2"]];
            let [x, y, z, eta] = keys.map(|keys| row.numbers(keys));
            Call::new(Kind::Corners, (x?, y?, z?, eta?), |(x, y, z, eta)| {
                let factor = form_factor::perpendicular_offset_rectangles(*x, *y, *z, *eta);
                value(factor, FormFactor::ratio)
            })
        }
        _ => return integrals(quantity, row),
    }))
}

fn integrals(quantity: &str, row: Row<'_>) -> Result<Option<Call>, Unmeasured> {
    Ok(Some(match quantity {
        "form-factor-parallel-disks" => {
            let inputs = (row.numbers(["r1", "r2", "h", "offset"])?, row.tolerance()?);
            Call::new(Kind::Integral, inputs, |([r1, r2, h, offset], tolerance)| {
                estimated(form_factor::parallel_disks(*r1, *r2, *h, *offset, *tolerance))
            })
        }
        "form-factor-spheres" => {
            let inputs = (row.numbers(["r1", "r2", "d"])?, row.tolerance()?);
            Call::new(Kind::Integral, inputs, |([r1, r2, d], tolerance)| {
                estimated(form_factor::spheres(*r1, *r2, *d, *tolerance))
            })
        }
        "form-factor-wedge-rectangles" => {
            let sizes = row.numbers(["a", "b", "l", "cos_phi"])?;
            let inputs = (sizes, row.tolerance_or(Tolerance::FINE)?);
            Call::new(Kind::Integral, inputs, |([a, b, l, cos_phi], tolerance)| {
                estimated(form_factor::wedge_rectangles(*a, *b, *l, *cos_phi, *tolerance))
            })
        }
        "form-factor-polygons" => {
            let inputs = (row.polygon("from")?, row.polygon("to")?, row.tolerance()?);
            Call::new(Kind::Integral, inputs, |(from, to, tolerance)| {
                estimated(form_factor::polygons(from, to, *tolerance))
            })
        }
        _ => return Ok(None),
    }))
}
