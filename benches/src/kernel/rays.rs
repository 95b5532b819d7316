//! Rays against surfaces; the ray is checked anew at each call.

use radiometry::ray::Ray;

use super::Row;
use super::{Call, Kind, value};
use crate::Unmeasured;

pub(super) fn call(quantity: &str, row: Row<'_>) -> Result<Option<Call>, Unmeasured> {
    if !row.has("origin") {
        return Ok(None);
    }
    let at = (row.vector("origin")?, row.vector("direction")?);
    let hit = |distance: Option<f64>| distance.unwrap_or(f64::NAN);
    let (kind, corners) = (Kind::Closed, Kind::Corners);
    Ok(Some(match quantity {
        "ray-plane-distance" => {
            let plane = (row.vector("point")?, row.vector("normal")?);
            Call::new(kind, (at, plane), move |(at, plane)| {
                value(Ray::new(at.0, at.1), |ray| value(ray.plane(plane.0, plane.1), hit))
            })
        }
        "ray-sphere-distance" => {
            let sphere = (row.vector("center")?, row.number("radius")?);
            Call::new(kind, (at, sphere), move |(at, sphere)| {
                value(Ray::new(at.0, at.1), |ray| value(ray.sphere(sphere.0, sphere.1), hit))
            })
        }
        "ray-disk-distance" => {
            let disk = (row.vector("center")?, row.vector("normal")?, row.number("radius")?);
            Call::new(kind, (at, disk), move |(at, disk)| {
                value(Ray::new(at.0, at.1), |ray| value(ray.disk(disk.0, disk.1, disk.2), hit))
            })
        }
        "ray-triangle-distance" => {
            let triangle = [row.vector("a")?, row.vector("b")?, row.vector("c")?];
            Call::new(corners, (at, triangle), move |(at, triangle)| {
                value(Ray::new(at.0, at.1), |ray| value(ray.triangle(*triangle), hit))
            })
        }
        "ray-polygon-distance" => {
            Call::new(corners, (at, row.polygon("vertices")?), move |(at, polygon)| {
                value(Ray::new(at.0, at.1), |ray| value(ray.polygon(polygon), hit))
            })
        }
        "ray-cylinder-distance" => {
            let cylinder = (row.vector("base")?, row.vector("top")?, row.number("radius")?);
            Call::new(kind, (at, cylinder), move |(at, cylinder)| {
                value(Ray::new(at.0, at.1), |ray| {
                    value(ray.cylinder(cylinder.0, cylinder.1, cylinder.2), hit)
                })
            })
        }
        "ray-mesh-hit-count" => {
            Call::new(corners, (at, row.triangles("triangles")?), move |(at, triangles)| {
                value(Ray::new(at.0, at.1), |ray| value(ray.mesh_hits(triangles), |n| n as f64))
            })
        }
        _ => return Ok(None),
    }))
}
