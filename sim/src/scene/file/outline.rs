//! Where something is: the keys of outlines and bodies.

use glam::DVec3;
use radiometry::shape::{Disk, HalfPlane, Polygon, Sphere};
use spanned_toml::{Bounds, Problem, Table};

use super::super::{Body, Outline, Shape, Solid};
use super::EXTENT_MM;

/// A polygon of more corners is a mesh, which is not what a scene is made of.
const CORNERS_MAX: usize = 256;

const KEYS: &str = "x_mm with y_mm; radius_mm (with centre_mm); or corners_mm";

/// The body that is written; it must be there.
pub(super) fn required_body(table: &Table<'_>) -> Result<Body, Problem> {
    let is_raised = table.has("axis")
        || centre(table)?.is_some_and(|centre| centre.len() == 3)
        || corners(table)?.is_some_and(|corners| corners.iter().any(|c| c.len() == 3));
    if is_raised && !table.has("x_mm") && !table.has("y_mm") {
        return Ok(Body::Raised(raised(table)?));
    }
    let shape = shape(table)?.ok_or_else(|| {
        table.problem(
            "x_mm",
            "it has no outline",
            "x_mm and y_mm, each [low, high]; radius_mm; or corners_mm",
            "add x_mm = [-10, 10] and y_mm = [-10, 10], say",
        )
    })?;
    Ok(Body::Flat(shape))
}

/// The outline on the sample's plane that is written, if one is.
pub(super) fn shape(table: &Table<'_>) -> Result<Option<Shape>, Problem> {
    let extent = Bounds::between(-EXTENT_MM, EXTENT_MM);
    let x = table.interval("x_mm", extent)?.map(metres);
    let y = table.interval("y_mm", extent)?.map(metres);
    let radius = radius(table)?;
    let centre = centre(table)?;
    let corners = corners(table)?;
    let contradiction =
        |key: &str, what: &str| Err(table.problem(key, what, KEYS, "keep the keys of one outline"));
    let sides = match (x, y) {
        (Some(x_m), Some(y_m)) => Some(Shape::Rectangle { x_m, y_m }),
        (Some(_), None) => return contradiction("x_mm", "y_mm is missing beside it"),
        (None, Some(_)) => return contradiction("y_mm", "x_mm is missing beside it"),
        (None, None) => None,
    };
    if let Some(centre) = &centre {
        if sides.is_some() {
            return contradiction("centre_mm", "a rectangle is given by its sides");
        }
        if corners.is_some() {
            return contradiction("centre_mm", "a polygon is given by its corners");
        }
        if radius.is_none() {
            return contradiction("centre_mm", "a centre without a radius");
        }
        if centre.len() != 2 {
            return contradiction(
                "centre_mm",
                "a height, where the outline lies on the sample's plane",
            );
        }
    }
    match (sides, radius, corners) {
        (Some(_), Some(_), _) => contradiction("radius_mm", "a disk and a rectangle at once"),
        (Some(_), _, Some(_)) => contradiction("corners_mm", "a polygon and a rectangle at once"),
        (None, Some(_), Some(_)) => contradiction("corners_mm", "a polygon and a disk at once"),
        (Some(rectangle), None, None) => Ok(Some(rectangle)),
        (None, Some(radius_m), None) => {
            let (x, y) = centre.map_or((0.0, 0.0), |centre| (centre[0], centre[1]));
            Ok(Some(Shape::disk(x, y, radius_m)))
        }
        (None, None, Some(corners)) => polygon_on_plane(table, &corners).map(Some),
        (None, None, None) => Ok(None),
    }
}

fn polygon_on_plane(table: &Table<'_>, corners: &[Vec<f64>]) -> Result<Shape, Problem> {
    let flat = corners.iter().map(|corner| (corner[0], corner[1])).collect();
    Outline::new(flat).map(Shape::Polygon).map_err(|error| {
        let expected = "the corners of a polygon in order, its edges not crossing";
        table.problem("corners_mm", &error.to_string(), expected, "")
    })
}

/// A body that stands above the plane: a ball, a disk with an axis, a polygon.
fn raised(table: &Table<'_>) -> Result<Solid, Problem> {
    if table.has("corners_mm") {
        for other in ["radius_mm", "centre_mm", "axis"] {
            if table.has(other) {
                let what = "a polygon is given by its corners";
                return Err(table.problem(other, what, KEYS, "keep the keys of one body"));
            }
        }
        return polygon(table);
    }
    if table.has("axis") { disk(table) } else { sphere(table) }
}

pub(super) fn polygon(table: &Table<'_>) -> Result<Solid, Problem> {
    let expected = "the corners of a flat polygon in order, its edges not crossing";
    let Some(corners) = corners(table)? else {
        return Err(table.problem("corners_mm", "missing key", expected, ""));
    };
    let place =
        |corner: &Vec<f64>| DVec3::new(corner[0], corner[1], corner.get(2).copied().unwrap_or(0.0));
    Polygon::new(corners.iter().map(place).collect())
        .map(Solid::Polygon)
        .map_err(|error| table.problem("corners_mm", &error.to_string(), expected, ""))
}

pub(super) fn sphere(table: &Table<'_>) -> Result<Solid, Problem> {
    let (centre, radius_m) = (required_centre(table)?, required_radius(table)?);
    Sphere::new(centre, radius_m)
        .map(Solid::Sphere)
        .map_err(|error| table.problem("radius_mm", &error.to_string(), "a ball", ""))
}

pub(super) fn disk(table: &Table<'_>) -> Result<Solid, Problem> {
    let (centre, radius_m) = (required_centre(table)?, required_radius(table)?);
    let expected = "[x, y, z], the direction of its normal, not all 0";
    let axis = table.numbers("axis", Bounds::between(-1e6, 1e6), 3..=3)?;
    let axis = axis.ok_or_else(|| {
        table.problem("axis", "missing key", expected, "add axis = [0, 0, 1], say")
    })?;
    Disk::new(centre, DVec3::new(axis[0], axis[1], axis[2]), radius_m)
        .map(Solid::Disk)
        .map_err(|error| table.problem("axis", &error.to_string(), expected, ""))
}

pub(super) fn half_plane(table: &Table<'_>) -> Result<Solid, Problem> {
    let extent = Bounds::between(-EXTENT_MM, EXTENT_MM);
    let x_max_m = table.required_number("x_max_mm", extent)? / 1e3;
    let z_m = table.required_number("z_mm", extent)? / 1e3;
    HalfPlane::new(x_max_m, z_m)
        .map(Solid::HalfPlane)
        .map_err(|error| table.problem("z_mm", &error.to_string(), "a height", ""))
}

fn required_centre(table: &Table<'_>) -> Result<DVec3, Problem> {
    match centre(table)?.as_deref() {
        Some([x, y, z]) => Ok(DVec3::new(*x, *y, *z)),
        Some(_) => Err(table.problem("centre_mm", "a centre without z", "[x, y, z]", "")),
        None => Err(table.problem("centre_mm", "missing key", "[x, y, z]", "")),
    }
}

fn required_radius(table: &Table<'_>) -> Result<f64, Problem> {
    Ok(table.required_number("radius_mm", Bounds::positive_up_to(EXTENT_MM))? / 1e3)
}

fn radius(table: &Table<'_>) -> Result<Option<f64>, Problem> {
    let radius = table.number("radius_mm", Bounds::positive_up_to(EXTENT_MM))?;
    Ok(radius.map(|radius| radius / 1e3))
}

/// Two or three numbers, metres.
fn centre(table: &Table<'_>) -> Result<Option<Vec<f64>>, Problem> {
    let extent = Bounds::between(-EXTENT_MM, EXTENT_MM);
    let centre = table.numbers("centre_mm", extent, 2..=3)?;
    Ok(centre.map(|centre| centre.into_iter().map(|length| length / 1e3).collect()))
}

/// Two or three numbers each, metres; all as many.
fn corners(table: &Table<'_>) -> Result<Option<Vec<Vec<f64>>>, Problem> {
    let extent = Bounds::between(-EXTENT_MM, EXTENT_MM);
    let Some(corners) = table.points("corners_mm", extent, 3..=CORNERS_MAX, 2..=3)? else {
        return Ok(None);
    };
    if corners.iter().any(|corner| corner.len() != corners[0].len()) {
        let expected = "[x, y] for each corner, on the sample's plane, or [x, y, z] for each";
        return Err(table.problem(
            "corners_mm",
            "some corners have a z and some none",
            expected,
            "",
        ));
    }
    let metres = |corner: Vec<f64>| corner.into_iter().map(|length| length / 1e3).collect();
    Ok(Some(corners.into_iter().map(metres).collect()))
}

fn metres((low, high): (f64, f64)) -> (f64, f64) {
    (low / 1e3, high / 1e3)
}
