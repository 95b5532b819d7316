//! Solid angles and projected solid angles.

use glam::DVec3;
use radiometry::projected::{self, Occluder, Receiver, Source};
use radiometry::quantity::SolidAngle;
use radiometry::shape::{Disk, HalfPlane, Polygon, Sphere};
use radiometry::solid_angle;

use super::inputs::Inputs;
use super::quantity::{Input, Quantity, Refusal, Rounding, tolerance};

const SR: &str = "sr";

const A: Input = Input::new("a", "x,y,z, m");
const B: Input = Input::new("b", "x,y,z, m");
const C: Input = Input::new("c", "x,y,z, m");
const POINT: Input = Input::new("point", "x,y,z of the receiver, m");
const NORMAL: Input = Input::new("normal", "the receiver's, x,y,z of any length");
const NORMAL_ANGLE: Input =
    Input::new("normal_angle", "rad, from the receiver's normal to the body's centre, 0 to π");
const CENTER: Input = Input::new("center", "x,y,z, m");
const RADIUS: Input = Input::new("radius", "m");
const DISTANCE: Input = Input::new("distance", "m");

pub(super) const QUANTITIES: &[Quantity] = &[
    Quantity {
        name: "cone-solid-angle",
        inputs: &[Input::new("half_angle", "rad, 0 to π")],
        unit: SR,
        example: "--half-angle 0.5",
        rounding: Rounding::Relative(1e-15),
        compute: |inputs| Ok(solid_angle::cone(inputs.number("half_angle")?)?.sr().into()),
    },
    Quantity {
        name: "cone-projected-solid-angle",
        inputs: &[Input::new("half_angle", "rad, 0 to π")],
        unit: SR,
        example: "--half-angle 0.5",
        rounding: Rounding::Relative(1e-15),
        compute: |inputs| {
            Ok(solid_angle::cone_projected(inputs.number("half_angle")?)?.sr().into())
        },
    },
    Quantity {
        name: "cone-half-angle",
        inputs: &[Input::new("solid_angle", "sr, 0 to 4π")],
        unit: "rad",
        example: "--solid-angle 6e-5",
        rounding: Rounding::Relative(1e-15),
        compute: |inputs| {
            let solid_angle = SolidAngle::from_sr(inputs.number("solid_angle")?);
            Ok(solid_angle::cone_half_angle(solid_angle)?.into())
        },
    },
    Quantity {
        name: "annulus-solid-angle",
        inputs: &[
            Input::new("inner", "half angle, rad, 0 to π"),
            Input::new("outer", "half angle, rad, inner to π"),
        ],
        unit: SR,
        example: "--inner 0.1 --outer 0.2",
        rounding: Rounding::Relative(2e-15),
        compute: |inputs| {
            let (inner, outer) = (inputs.number("inner")?, inputs.number("outer")?);
            Ok(solid_angle::annulus(inner, outer)?.sr().into())
        },
    },
    Quantity {
        name: "disk-solid-angle",
        inputs: &[Input::new("radius", "m"), Input::new("distance", "m, along its axis")],
        unit: SR,
        example: "--radius 0.005 --distance 0.3",
        rounding: Rounding::Relative(2e-15),
        compute: |inputs| {
            let (radius, distance) = (inputs.number("radius")?, inputs.number("distance")?);
            Ok(solid_angle::disk(radius, distance)?.sr().into())
        },
    },
    Quantity {
        name: "off-axis-disk-solid-angle",
        inputs: &[RADIUS, DISTANCE, Input::new("offset", "m, of the point from the disk's axis")],
        unit: SR,
        example: "--radius 1 --distance 1 --offset 0.5",
        rounding: Rounding::Relative(1e-13),
        compute: |inputs| {
            let (radius, distance) = (inputs.number("radius")?, inputs.number("distance")?);
            let offset = inputs.number("offset")?;
            Ok(solid_angle::disk_off_axis(radius, distance, offset)?.sr().into())
        },
    },
    Quantity {
        name: "solid-angle-of-disk",
        inputs: &[POINT, CENTER, Input::new("axis", "x,y,z of any length"), RADIUS],
        unit: SR,
        example: "--point 0,0,0 --center 0.5,0,1 --axis 0,0,1 --radius 1",
        rounding: Rounding::Relative(1e-13),
        compute: |inputs| {
            let disk = disk(inputs, inputs.direction("axis")?)?;
            Ok(solid_angle::disk_from(inputs.vector("point")?, &disk)?.sr().into())
        },
    },
    Quantity {
        name: "sphere-solid-angle",
        inputs: &[RADIUS, Input::new("distance", "m, to its centre, from outside")],
        unit: SR,
        example: "--radius 1 --distance 2",
        rounding: Rounding::Relative(2e-15),
        compute: |inputs| {
            let (radius, distance) = (inputs.number("radius")?, inputs.number("distance")?);
            Ok(solid_angle::sphere(radius, distance)?.sr().into())
        },
    },
    Quantity {
        name: "polygon-solid-angle",
        inputs: &[POINT, Input::new("vertices", "list of [x,y,z], m, in one plane")],
        unit: SR,
        example: "--point 0,0,0 --vertices [[-1,-1,1],[1,-1,1],[1,1,1],[-1,1,1]]",
        rounding: Rounding::Relative(1e-12),
        compute: |inputs| {
            let polygon = Polygon::new(inputs.vectors("vertices")?)?;
            Ok(solid_angle::polygon(inputs.vector("point")?, &polygon)?.sr().into())
        },
    },
    Quantity {
        name: "triangle-solid-angle",
        inputs: &[A, B, C],
        unit: SR,
        example: "--a 1,0,0 --b 0,1,0 --c 0,0,1",
        rounding: Rounding::Relative(1e-13),
        compute: |inputs| {
            let (a, b, c) = (inputs.vector("a")?, inputs.vector("b")?, inputs.vector("c")?);
            Ok(solid_angle::triangle(a, b, c)?.sr().into())
        },
    },
    Quantity {
        name: "signed-triangle-solid-angle",
        inputs: &[POINT, A, B, C],
        unit: SR,
        example: "--point 0,0,0 --a 1,0,0 --b 0,1,0 --c 0,0,1",
        rounding: Rounding::Relative(1e-12),
        compute: |inputs| {
            let (a, b, c) = (inputs.vector("a")?, inputs.vector("b")?, inputs.vector("c")?);
            Ok(solid_angle::triangle_signed(inputs.vector("point")?, a, b, c)?.sr().into())
        },
    },
    Quantity {
        name: "polygon-projected-solid-angle",
        inputs: &[POINT, NORMAL, Input::new("vertices", "list of [x,y,z], m")],
        unit: SR,
        example: "--point 0,0,0 --normal 0,0,1 --vertices [[0,0,1],[1,0,1],[0,1,1]]",
        rounding: Rounding::Relative(1e-12),
        compute: |inputs| {
            let polygon = Polygon::new(inputs.vectors("vertices")?)?;
            Ok(projected::polygon(&receiver(inputs)?, &polygon)?.sr().into())
        },
    },
    Quantity {
        name: "disk-projected-solid-angle",
        inputs: &[RADIUS, DISTANCE, Input::new("offset", "m, of the centre from the normal")],
        unit: SR,
        example: "--radius 1 --distance 1 --offset 0",
        rounding: Rounding::Relative(1e-13),
        compute: |inputs| {
            let (radius, distance) = (inputs.number("radius")?, inputs.number("distance")?);
            Ok(projected::disk_parallel(radius, distance, inputs.number("offset")?)?.sr().into())
        },
    },
    Quantity {
        name: "tilted-disk-projected-solid-angle",
        inputs: &[RADIUS, DISTANCE, NORMAL_ANGLE],
        unit: SR,
        example: "--radius 1 --distance 1 --normal-angle 1",
        rounding: Rounding::Relative(1e-10),
        compute: |inputs| {
            let (radius, distance) = (inputs.number("radius")?, inputs.number("distance")?);
            let angle = inputs.number("normal_angle")?;
            Ok(projected::disk_tilted(radius, distance, angle)?.sr().into())
        },
    },
    Quantity {
        name: "projected-solid-angle-of-disk",
        inputs: &[POINT, NORMAL, CENTER, Input::new("axis", "x,y,z of any length"), RADIUS],
        unit: SR,
        example: "--point 0,0,0 --normal 0,0,1 --center 0,0,1 --axis 0,0,-1 --radius 1",
        rounding: Rounding::Relative(1e-10),
        compute: |inputs| {
            let disk = disk(inputs, inputs.direction("axis")?)?;
            Ok(projected::disk(&receiver(inputs)?, &disk)?.sr().into())
        },
    },
    Quantity {
        name: "sphere-projected-solid-angle",
        inputs: &[RADIUS, DISTANCE, NORMAL_ANGLE],
        unit: SR,
        example: "--radius 1 --distance 2 --normal-angle 0.3",
        rounding: Rounding::Relative(1e-10),
        compute: |inputs| {
            let (radius, distance) = (inputs.number("radius")?, inputs.number("distance")?);
            let angle = inputs.number("normal_angle")?;
            Ok(projected::sphere_tilted(radius, distance, angle)?.sr().into())
        },
    },
    Quantity {
        name: "projected-solid-angle-of-sphere",
        inputs: &[POINT, NORMAL, CENTER, RADIUS],
        unit: SR,
        example: "--point 0,0,0 --normal 0,0,1 --center 0,0,2 --radius 1",
        rounding: Rounding::Relative(1e-10),
        compute: |inputs| Ok(projected::sphere(&receiver(inputs)?, &sphere(inputs)?)?.sr().into()),
    },
    Quantity {
        name: "occluded-projected-solid-angle",
        inputs: &[
            POINT,
            NORMAL,
            Input::new("source", "{kind: disk | sphere | polygon, center, radius | vertices}"),
            Input::optional(
                "occluder",
                "{kind: half-plane | disk | sphere | polygon, x_max, z | center, radius | vertices}",
            ),
            Input::optional("occluders", "list of such bodies, instead of one"),
            Input::optional("relative_tolerance", "default 1e-10"),
        ],
        unit: SR,
        example: "--point 0,0,0 --normal 0,0,1 \
                  --source {\"kind\":\"disk\",\"center\":[0,0,4],\"radius\":1} \
                  --occluder {\"kind\":\"half-plane\",\"x_max\":0,\"z\":2}",
        rounding: Rounding::Stated,
        compute: |inputs| {
            let (source, occluders) = (source(inputs.object("source")?)?, occluders(inputs)?);
            let tolerance = tolerance(inputs)?;
            Ok(projected::occluded_by(&receiver(inputs)?, &source, &occluders, tolerance)?.into())
        },
    },
];

pub(super) fn receiver(inputs: Inputs<'_>) -> Result<Receiver, Refusal> {
    Ok(Receiver::new(inputs.vector("point")?, inputs.direction("normal")?)?)
}

pub(super) fn disk(inputs: Inputs<'_>, axis: DVec3) -> Result<Disk, Refusal> {
    Ok(Disk::new(inputs.vector("center")?, axis, inputs.number("radius")?)?)
}

pub(super) fn sphere(inputs: Inputs<'_>) -> Result<Sphere, Refusal> {
    Ok(Sphere::new(inputs.vector("center")?, inputs.number("radius")?)?)
}

/// What a body is described by, beside its kind.
const ROUND: &[Input] = &[Input::new("kind", "word"), CENTER, RADIUS];
const VERTICES: &[Input] =
    &[Input::new("kind", "word"), Input::new("vertices", "list of [x,y,z], m")];
const HALF_PLANE: &[Input] =
    &[Input::new("kind", "word"), Input::new("x_max", "m"), Input::new("z", "m")];

fn polygon(body: Inputs<'_>) -> Result<Polygon, Refusal> {
    body.expect_only(VERTICES)?;
    Ok(Polygon::new(body.vectors("vertices")?)?)
}

/// Disks lie across the z axis.
pub(super) fn source(body: Inputs<'_>) -> Result<Source, Refusal> {
    match body.text("kind")? {
        "polygon" => Ok(Source::Polygon(polygon(body)?)),
        "disk" => {
            body.expect_only(ROUND)?;
            Ok(Source::Disk(disk(body, DVec3::Z)?))
        }
        "sphere" => {
            body.expect_only(ROUND)?;
            Ok(Source::Sphere(sphere(body)?))
        }
        other => Err(unknown_kind("source", other, "disk, sphere or polygon")),
    }
}

/// One body or a list of them, not both.
fn occluders(inputs: Inputs<'_>) -> Result<Vec<Occluder>, Refusal> {
    if !inputs.has("occluders") {
        return Ok(vec![occluder(inputs.object("occluder")?)?]);
    }
    if inputs.has("occluder") {
        return Err(Refusal::new("occluder and occluders are both given, expected one of them"));
    }
    inputs.objects("occluders")?.into_iter().map(occluder).collect()
}

pub(super) fn occluder(body: Inputs<'_>) -> Result<Occluder, Refusal> {
    match body.text("kind")? {
        "polygon" => Ok(Occluder::Polygon(polygon(body)?)),
        "disk" => {
            body.expect_only(ROUND)?;
            Ok(Occluder::Disk(disk(body, DVec3::Z)?))
        }
        "sphere" => {
            body.expect_only(ROUND)?;
            Ok(Occluder::Sphere(sphere(body)?))
        }
        "half-plane" => {
            body.expect_only(HALF_PLANE)?;
            let half_plane = HalfPlane::new(body.number("x_max")?, body.number("z")?)?;
            Ok(Occluder::HalfPlane(half_plane))
        }
        other => Err(unknown_kind("occluder", other, "half-plane, disk, sphere or polygon")),
    }
}

fn unknown_kind(what: &str, found: &str, expected: &str) -> Refusal {
    Refusal::new(format!("the {what} kind `{found}` is not known, expected {expected}"))
}
