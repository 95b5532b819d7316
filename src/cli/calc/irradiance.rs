//! Irradiance from uniform sources, from an environment map and from the Sun.

use glam::DVec3;
use radiometry::environment::{EnvironmentError, EqualArea, LatLong};
use radiometry::irradiance::{self, Sun};
use radiometry::quantity::Radiance;
use radiometry::shape::Polygon;

use super::inputs::Inputs;
use super::quantity::{Answer, Input, Quantity, Refusal, Rounding, not_negative, tolerance};
use super::solid_angles::{disk, occluder, receiver, source, sphere};

const IRRADIANCE: &str = "W/m²";

const RADIANCE: Input = Input::new("radiance", "W/(m² sr), uniform, 0 or more");
const POINT: Input = Input::new("point", "x,y,z of the receiver, m");
const NORMAL: Input = Input::new("normal", "the receiver's, x,y,z of any length");
const CENTER: Input = Input::new("center", "x,y,z, m");
const RADIUS: Input = Input::new("radius", "m");
const MAP: Input = Input::new("map", "list of rows of W/(m² sr), all as long");
const PIXELS: Input = Input::optional(
    "pixels",
    "lat-long (default): equal steps, rows from θ = 0 (+z) to π, each from φ = 0 (+x) once round \
     over +y; equal-area: Clarberg's octahedral square, rows towards +y, columns towards +x, +z in \
     the middle",
);
const DISTANCE: Input = Input::optional(
    "distance",
    "m, to the centre of the nominal Sun (IAU 2015); without it the lecture's Sun, 1353 W/m² \
     under a half angle of 0.25°",
);

/// One of the Sun's own figures.
const fn of_sun(
    name: &'static str,
    unit: &'static str,
    compute: fn(Inputs<'_>) -> Result<Answer, Refusal>,
) -> Quantity {
    let example = "--distance 149597870700";
    Quantity {
        name,
        inputs: &[DISTANCE],
        unit,
        example,
        rounding: Rounding::Relative(4e-15),
        compute,
    }
}

pub(super) const QUANTITIES: &[Quantity] = &[
    Quantity {
        name: "irradiance-from-disk",
        inputs: &[
            POINT,
            NORMAL,
            CENTER,
            Input::new("axis", "x,y,z of any length; both faces emit"),
            RADIUS,
            RADIANCE,
        ],
        unit: IRRADIANCE,
        example: "--point 0,0,0 --normal 0,0,1 --center 0,0,1 --axis 0,0,-1 --radius 1 \
                  --radiance 100",
        rounding: Rounding::Relative(1e-10),
        compute: |inputs| {
            let disk = disk(inputs, inputs.direction("axis")?)?;
            let found = irradiance::from_disk(&receiver(inputs)?, &disk, radiance(inputs)?)?;
            Ok(found.w_per_m2().into())
        },
    },
    Quantity {
        name: "irradiance-from-sphere",
        inputs: &[POINT, NORMAL, CENTER, RADIUS, RADIANCE],
        unit: IRRADIANCE,
        example: "--point 0,0,0 --normal 0,0,1 --center 0,0,2 --radius 1 --radiance 100",
        rounding: Rounding::Relative(1e-10),
        compute: |inputs| {
            let (receiver, sphere) = (receiver(inputs)?, sphere(inputs)?);
            let found = irradiance::from_sphere(&receiver, &sphere, radiance(inputs)?)?;
            Ok(found.w_per_m2().into())
        },
    },
    Quantity {
        name: "irradiance-from-polygon",
        inputs: &[
            POINT,
            NORMAL,
            Input::new("vertices", "list of [x,y,z], m; both faces emit"),
            RADIANCE,
        ],
        unit: IRRADIANCE,
        example: "--point 0,0,0 --normal 0,0,1 --vertices [[0,0,1],[1,0,1],[0,1,1]] \
                  --radiance 100",
        rounding: Rounding::Relative(1e-12),
        compute: |inputs| {
            let polygon = Polygon::new(inputs.vectors("vertices")?)?;
            let found = irradiance::from_polygon(&receiver(inputs)?, &polygon, radiance(inputs)?)?;
            Ok(found.w_per_m2().into())
        },
    },
    Quantity {
        name: "irradiance-from-occluded-source",
        inputs: &[
            POINT,
            NORMAL,
            Input::new("source", "{kind: disk | sphere | polygon, center, radius | vertices}"),
            Input::new(
                "occluder",
                "{kind: half-plane | disk | sphere | polygon, x_max, z | center, radius | vertices}",
            ),
            RADIANCE,
            Input::optional("relative_tolerance", "of the unoccluded source's, default 1e-10"),
        ],
        unit: IRRADIANCE,
        example: "--point 0,0,0 --normal 0,0,1 \
                  --source {\"kind\":\"disk\",\"center\":[0,0,4],\"radius\":1} \
                  --occluder {\"kind\":\"half-plane\",\"x_max\":0,\"z\":2} --radiance 100",
        rounding: Rounding::Stated,
        compute: |inputs| {
            let source = source(inputs.object("source")?)?;
            let occluder = occluder(inputs.object("occluder")?)?;
            let (receiver, tolerance) = (receiver(inputs)?, tolerance(inputs)?);
            let radiance = radiance(inputs)?;
            let found =
                irradiance::from_occluded(&receiver, &source, &occluder, radiance, tolerance)?;
            Ok(found.into())
        },
    },
    Quantity {
        name: "irradiance-from-environment",
        inputs: &[NORMAL, MAP, PIXELS, Input::optional("relative_tolerance", "default 1e-10")],
        unit: IRRADIANCE,
        example: "--normal 1,0,1 --map [[100,100,100,100],[50,80,50,50],[10,10,10,10]] \
                  --pixels lat-long",
        rounding: Rounding::Stated,
        compute: |inputs| {
            let normal = inputs.direction("normal")?;
            Ok(match map(inputs)? {
                Map::LatLong(map) => map.irradiance(normal)?.into(),
                Map::EqualArea(map) => map.irradiance(normal, tolerance(inputs)?)?.into(),
            })
        },
    },
    Quantity {
        name: "environment-radiance",
        inputs: &[Input::new("direction", "towards the light, x,y,z of any length"), MAP, PIXELS],
        unit: "W/(m² sr)",
        example: "--direction 0,1,0.1 --map [[100,100,100,100],[50,80,50,50],[10,10,10,10]]",
        rounding: Rounding::Absolute(0.0),
        compute: |inputs| {
            let towards: DVec3 = inputs.direction("direction")?;
            let radiance = match map(inputs)? {
                Map::LatLong(map) => map.radiance(towards)?,
                Map::EqualArea(map) => map.radiance(towards)?,
            };
            Ok(radiance.w_per_m2_sr().into())
        },
    },
    Quantity {
        name: "irradiance-from-sun",
        inputs: &[
            Input::new("normal_angle", "rad, from the receiver's normal to the Sun, 0 to π"),
            DISTANCE,
        ],
        unit: IRRADIANCE,
        example: "--normal-angle 0.5",
        rounding: Rounding::Relative(1e-10),
        compute: |inputs| {
            let normal_angle = inputs.number("normal_angle")?;
            Ok(sun(inputs)?.irradiance_at(normal_angle)?.w_per_m2().into())
        },
    },
    of_sun("sun-radiance", "W/(m² sr)", |inputs| Ok(sun(inputs)?.radiance().w_per_m2_sr().into())),
    of_sun("sun-exitance", IRRADIANCE, |inputs| Ok(sun(inputs)?.exitance().w_per_m2().into())),
    of_sun("sun-half-angle", "rad", |inputs| Ok(sun(inputs)?.half_angle_rad().into())),
    of_sun("sun-projected-solid-angle", "sr", |inputs| {
        Ok(sun(inputs)?.projected_solid_angle().sr().into())
    }),
];

fn radiance(inputs: Inputs<'_>) -> Result<Radiance, Refusal> {
    Ok(Radiance::from_w_per_m2_sr(not_negative(inputs, "radiance")?))
}

fn sun(inputs: Inputs<'_>) -> Result<Sun, Refusal> {
    if inputs.has("distance") {
        Ok(Sun::nominal(inputs.number("distance")?)?)
    } else {
        Ok(Sun::lecture())
    }
}

/// An environment map.
enum Map {
    LatLong(LatLong),
    EqualArea(EqualArea),
}

impl From<EnvironmentError> for Refusal {
    fn from(error: EnvironmentError) -> Self {
        Self::new(format!("map: {error}"))
    }
}

fn map(inputs: Inputs<'_>) -> Result<Map, Refusal> {
    let rows = inputs.columns("map")?;
    let columns = rows.first().map_or(0, Vec::len);
    if let Some((row, found)) = rows.iter().enumerate().find(|(_, row)| row.len() != columns) {
        let found = found.len();
        return Err(Refusal::new(format!(
            "map: row {row} has {found} numbers, expected {columns} as in row 0"
        )));
    }
    let radiances: Vec<_> = rows.iter().flatten().map(|l| Radiance::from_w_per_m2_sr(*l)).collect();
    let pixels = if inputs.has("pixels") { inputs.text("pixels")? } else { "lat-long" };
    match pixels {
        "lat-long" => Ok(Map::LatLong(LatLong::new(rows.len(), columns, &radiances)?)),
        "equal-area" if rows.len() != columns => Err(Refusal::new(format!(
            "map has {} rows of {columns}, expected a square of equal-area pixels",
            rows.len()
        ))),
        "equal-area" => Ok(Map::EqualArea(EqualArea::new(columns, &radiances)?)),
        other => Err(Refusal::new(format!("pixels is `{other}`, expected lat-long or equal-area"))),
    }
}
