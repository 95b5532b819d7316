//! Where a ray first meets a surface: distances in metres, whatever the direction's length.

use radiometry::ray::Ray;
use radiometry::shape::Polygon;

use super::inputs::Inputs;
use super::quantity::{Input, Quantity, Refusal, Rounding};

const ORIGIN: Input = Input::new("origin", "x,y,z, m");
const DIRECTION: Input = Input::new("direction", "x,y,z of any length");
const NORMAL: Input = Input::new("normal", "x,y,z of any length");
const CENTER: Input = Input::new("center", "x,y,z, m");
const RADIUS: Input = Input::new("radius", "m");

const ROUNDING: Rounding = Rounding::Relative(4e-15);

pub(super) const QUANTITIES: &[Quantity] = &[
    Quantity {
        name: "ray-plane-distance",
        inputs: &[ORIGIN, DIRECTION, Input::new("point", "x,y,z, m"), NORMAL],
        unit: "m",
        example: "--origin 0,0,0 --direction 1,0,1 --point 0,0,2 --normal 0,0,1",
        rounding: ROUNDING,
        compute: |inputs| {
            let normal = inputs.direction("normal")?;
            Ok(ray(inputs)?.plane(inputs.vector("point")?, normal)?.into())
        },
    },
    Quantity {
        name: "ray-sphere-distance",
        inputs: &[ORIGIN, DIRECTION, CENTER, RADIUS],
        unit: "m",
        example: "--origin=-1e8,0.5,0 --direction 1,0,0 --center 0,0,0 --radius 1",
        rounding: ROUNDING,
        compute: |inputs| {
            let radius = inputs.number("radius")?;
            Ok(ray(inputs)?.sphere(inputs.vector("center")?, radius)?.into())
        },
    },
    Quantity {
        name: "ray-disk-distance",
        inputs: &[ORIGIN, DIRECTION, CENTER, NORMAL, RADIUS],
        unit: "m",
        example: "--origin 0,0,0 --direction 1,0,1 --center 0,0,2 --normal 0,0,1 --radius 3",
        rounding: ROUNDING,
        compute: |inputs| {
            let (center, normal) = (inputs.vector("center")?, inputs.direction("normal")?);
            Ok(ray(inputs)?.disk(center, normal, inputs.number("radius")?)?.into())
        },
    },
    Quantity {
        name: "ray-triangle-distance",
        inputs: &[
            ORIGIN,
            DIRECTION,
            Input::new("a", "x,y,z, m"),
            Input::new("b", "x,y,z, m"),
            Input::new("c", "x,y,z, m"),
        ],
        unit: "m",
        example: "--origin 0,0,0 --direction 0.5,0.5,1 --a 0,0,1 --b 1,0,1 --c 1,1,1",
        rounding: ROUNDING,
        compute: |inputs| {
            let corners = [inputs.vector("a")?, inputs.vector("b")?, inputs.vector("c")?];
            Ok(ray(inputs)?.triangle(corners)?.into())
        },
    },
    Quantity {
        name: "ray-polygon-distance",
        inputs: &[ORIGIN, DIRECTION, Input::new("vertices", "list of [x,y,z], m")],
        unit: "m",
        example: "--origin 0.5,0.5,0 --direction 0,0,1 --vertices [[0,0,1],[2,0,1],[0,2,1]]",
        rounding: ROUNDING,
        compute: |inputs| {
            let polygon = Polygon::new(inputs.vectors("vertices")?)?;
            Ok(ray(inputs)?.polygon(&polygon)?.into())
        },
    },
    Quantity {
        name: "ray-cylinder-distance",
        inputs: &[
            ORIGIN,
            DIRECTION,
            Input::new("base", "x,y,z, m"),
            Input::new("top", "x,y,z, m"),
            RADIUS,
        ],
        unit: "m",
        example: "--origin=-3,0,1 --direction 1,0,0 --base 0,0,0 --top 0,0,2 --radius 1",
        rounding: ROUNDING,
        compute: |inputs| {
            let (base, top) = (inputs.vector("base")?, inputs.vector("top")?);
            Ok(ray(inputs)?.cylinder(base, top, inputs.number("radius")?)?.into())
        },
    },
    Quantity {
        name: "ray-mesh-hit-count",
        inputs: &[ORIGIN, DIRECTION, Input::new("triangles", "list of [a,b,c], each [x,y,z], m")],
        unit: "1",
        example: "--origin 0.2,0.2,0 --direction 0,0,1 --triangles [[[0,0,1],[1,0,1],[0,1,1]]]",
        rounding: Rounding::Absolute(0.0),
        compute: |inputs| {
            let triangles = inputs.triangles("triangles")?;
            if triangles.is_empty() {
                return Err(Refusal::new("triangles is empty, expected at least one"));
            }
            Ok((ray(inputs)?.mesh_hits(&triangles)? as f64).into())
        },
    },
];

fn ray(inputs: Inputs<'_>) -> Result<Ray, Refusal> {
    Ok(Ray::new(inputs.vector("origin")?, inputs.direction("direction")?)?)
}
