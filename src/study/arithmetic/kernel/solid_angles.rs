//! Solid angles and projected solid angles.

use glam::DVec3;
use radiometry::projected::{self, Occluder, Receiver, Source};
use radiometry::quantity::{ProjectedSolidAngle, SolidAngle};
use radiometry::shape::{Disk, HalfPlane, Sphere};
use radiometry::solid_angle;

use super::row::Row;
use super::{Call, Kind, estimated, value};
use crate::study::arithmetic::Unmeasured;

pub(super) fn call(quantity: &str, row: Row<'_>) -> Result<Option<Call>, Unmeasured> {
    Ok(Some(match quantity {
        "cone-solid-angle" => Call::new(Kind::Closed, row.number("half_angle")?, |angle| {
            value(solid_angle::cone(*angle), SolidAngle::sr)
        }),
        "cone-projected-solid-angle" => {
            Call::new(Kind::Closed, row.number("half_angle")?, |angle| {
                value(solid_angle::cone_projected(*angle), ProjectedSolidAngle::sr)
            })
        }
        "cone-half-angle" => Call::new(Kind::Closed, row.number("solid_angle")?, |omega| {
            value(solid_angle::cone_half_angle(SolidAngle::from_sr(*omega)), |angle| angle)
        }),
        "annulus-solid-angle" => {
            Call::new(Kind::Closed, row.numbers(["inner", "outer"])?, |[inner, outer]| {
                value(solid_angle::annulus(*inner, *outer), SolidAngle::sr)
            })
        }
        "disk-solid-angle" => {
            Call::new(Kind::Closed, row.numbers(["radius", "distance"])?, |[radius, distance]| {
                value(solid_angle::disk(*radius, *distance), SolidAngle::sr)
            })
        }
        "triangle-solid-angle" => {
            let corners = [row.vector("a")?, row.vector("b")?, row.vector("c")?];
            Call::new(Kind::Corners, corners, |[a, b, c]| {
                value(solid_angle::triangle(*a, *b, *c), SolidAngle::sr)
            })
        }
        "signed-triangle-solid-angle" => {
            let points = ["point", "a", "b", "c"].map(|key| row.vector(key));
            let [point, a, b, c] = points;
            Call::new(Kind::Corners, [point?, a?, b?, c?], |[point, a, b, c]| {
                value(solid_angle::triangle_signed(*point, *a, *b, *c), SolidAngle::sr)
            })
        }
        _ => return projected(quantity, row),
    }))
}

fn projected(quantity: &str, row: Row<'_>) -> Result<Option<Call>, Unmeasured> {
    let receiver = || Ok::<_, Unmeasured>((row.vector("point")?, row.vector("normal")?));
    Ok(Some(match quantity {
        "polygon-projected-solid-angle" => {
            Call::new(Kind::Corners, (receiver()?, row.polygon("vertices")?), |(at, polygon)| {
                value(Receiver::new(at.0, at.1), |receiver| {
                    value(projected::polygon(&receiver, polygon), ProjectedSolidAngle::sr)
                })
            })
        }
        "disk-projected-solid-angle" => {
            let sizes = row.numbers(["radius", "distance", "offset"])?;
            Call::new(Kind::Closed, sizes, |[radius, distance, offset]| {
                value(
                    projected::disk_parallel(*radius, *distance, *offset),
                    ProjectedSolidAngle::sr,
                )
            })
        }
        "tilted-disk-projected-solid-angle" => {
            let sizes = row.numbers(["radius", "distance", "normal_angle"])?;
            Call::new(Kind::Closed, sizes, |[radius, distance, angle]| {
                value(projected::disk_tilted(*radius, *distance, *angle), ProjectedSolidAngle::sr)
            })
        }
        "sphere-projected-solid-angle" => {
            let sizes = row.numbers(["radius", "distance", "normal_angle"])?;
            Call::new(Kind::Closed, sizes, |[radius, distance, angle]| {
                value(projected::sphere_tilted(*radius, *distance, *angle), ProjectedSolidAngle::sr)
            })
        }
        "projected-solid-angle-of-disk" => {
            let disk = disk(row, row.vector("axis")?)?;
            Call::new(Kind::Closed, (receiver()?, disk), |(at, disk)| {
                value(Receiver::new(at.0, at.1), |receiver| {
                    value(projected::disk(&receiver, disk), ProjectedSolidAngle::sr)
                })
            })
        }
        "projected-solid-angle-of-sphere" => {
            Call::new(Kind::Closed, (receiver()?, sphere(row)?), |(at, sphere)| {
                value(Receiver::new(at.0, at.1), |receiver| {
                    value(projected::sphere(&receiver, sphere), ProjectedSolidAngle::sr)
                })
            })
        }
        "occluded-projected-solid-angle" => {
            let bodies = (source(row.object("source"))?, occluder(row.object("occluder"))?);
            let inputs = (receiver()?, bodies, row.tolerance()?);
            Call::new(Kind::Integral, inputs, |(at, (source, occluder), tolerance)| {
                value(Receiver::new(at.0, at.1), |receiver| {
                    estimated(projected::occluded(&receiver, source, occluder, *tolerance))
                })
            })
        }
        _ => return Ok(None),
    }))
}

fn disk(row: Row<'_>, axis: DVec3) -> Result<Disk, Unmeasured> {
    Ok(Disk::new(row.vector("center")?, axis, row.number("radius")?)?)
}

fn sphere(row: Row<'_>) -> Result<Sphere, Unmeasured> {
    Ok(Sphere::new(row.vector("center")?, row.number("radius")?)?)
}

/// Disks lie across the z axis.
fn source(body: Row<'_>) -> Result<Source, Unmeasured> {
    Ok(match body.text("kind") {
        "polygon" => Source::Polygon(body.polygon("vertices")?),
        "disk" => Source::Disk(disk(body, DVec3::Z)?),
        _ => Source::Sphere(sphere(body)?),
    })
}

fn occluder(body: Row<'_>) -> Result<Occluder, Unmeasured> {
    Ok(match body.text("kind") {
        "polygon" => Occluder::Polygon(body.polygon("vertices")?),
        "disk" => Occluder::Disk(disk(body, DVec3::Z)?),
        "half-plane" => {
            Occluder::HalfPlane(HalfPlane::new(body.number("x_max")?, body.number("z")?)?)
        }
        _ => Occluder::Sphere(sphere(body)?),
    })
}
