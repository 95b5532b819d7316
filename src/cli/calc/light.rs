//! Light on rays: throughput, its density in each chart, and the quantities that radiance makes with it.

use std::f64::consts::PI;

use radiometry::chart::{Environment, Perpendicular, Surface, TwoPlane};
use radiometry::convex::{self, ConvexBody};
use radiometry::form_factor;
use radiometry::quantity::{Area, Exitance, ProjectedSolidAngle, Radiance, Throughput};
use radiometry::shape::Polygon;
use radiometry::throughput;

use super::inputs::Inputs;
use super::quantity::{Input, Quantity, Refusal, Rounding, not_negative, tolerance};

const ROUNDING: Rounding = Rounding::Relative(4e-15);

const THETA: Input = Input::new("theta", "rad, from the normal");
const BODY: Input = Input::new(
    "shape",
    "{kind: sphere | box | cylinder | cone | ellipsoid, radius, height | a, b, c}, closed, m",
);
const RADIANCE: Input = Input::new("radiance", "W/(m² sr)");

pub(super) const QUANTITIES: &[Quantity] = &[
    Quantity {
        name: "throughput-coaxial-disks",
        inputs: &[Input::new("r1", "m"), Input::new("r2", "m"), Input::new("h", "m, gap")],
        unit: "m² sr",
        example: "--r1 0.00625 --r2 0.0025 --h 0.3",
        rounding: ROUNDING,
        compute: |inputs| {
            let (r1, r2) = (inputs.number("r1")?, inputs.number("r2")?);
            Ok(throughput::coaxial_disks(r1, r2, inputs.number("h")?)?.m2_sr().into())
        },
    },
    Quantity {
        name: "throughput-spot-detector",
        inputs: &[
            Input::new("pupil_radius", "m, of the entrance pupil"),
            Input::new("spot_radius", "m, of the spot across the axis, on the sample"),
            Input::new("distance", "m, from pupil to spot"),
        ],
        unit: "m² sr",
        example: "--pupil-radius 0.00625 --spot-radius 0.0025 --distance 0.3",
        rounding: ROUNDING,
        compute: |inputs| {
            let (pupil, spot) = (inputs.number("pupil_radius")?, inputs.number("spot_radius")?);
            let throughput = throughput::coaxial_disks(pupil, spot, inputs.number("distance")?)?;
            Ok(throughput.m2_sr().into())
        },
    },
    Quantity {
        name: "throughput-infinitesimal-beam",
        inputs: &[
            Input::new("area1", "m², small beside distance²"),
            Input::new("theta1", "rad, from its normal to the beam, 0 to π/2"),
            Input::new("area2", "m²"),
            Input::new("theta2", "rad, from its normal to the beam, 0 to π/2"),
            Input::new("distance", "m"),
        ],
        unit: "m² sr",
        example: "--area1 1e-6 --theta1 0 --area2 2e-6 --theta2 0.5 --distance 0.3",
        rounding: ROUNDING,
        compute: |inputs| {
            let end = |area, theta| {
                Ok::<_, Refusal>((Area::from_m2(inputs.number(area)?), inputs.number(theta)?))
            };
            let (from, to) = (end("area1", "theta1")?, end("area2", "theta2")?);
            let distance = inputs.number("distance")?;
            Ok(throughput::infinitesimal_beam(from, to, distance)?.m2_sr().into())
        },
    },
    Quantity {
        name: "throughput-polygons",
        inputs: &[
            Input::new("from", "list of [x,y,z], m; the order of vertices means nothing"),
            Input::new("to", "list of [x,y,z], m"),
            Input::optional("relative_tolerance", "default 1e-10"),
        ],
        unit: "m² sr",
        example: "--from [[0,0,0],[1,0,0],[1,1,0],[0,1,0]] \
                  --to [[0,0,1],[0,1,1],[1,1,1],[1,0,1]] --relative-tolerance 1e-8",
        rounding: Rounding::Stated,
        compute: |inputs| {
            let polygon = |name| Ok::<_, Refusal>(Polygon::new(inputs.vectors(name)?)?);
            let (from, to) = (polygon("from")?, polygon("to")?);
            Ok(form_factor::throughput_of_polygons(&from, &to, tolerance(inputs)?)?.into())
        },
    },
    Quantity {
        name: "mean-projected-area",
        inputs: &[BODY],
        unit: "m²",
        example: "--shape {\"kind\":\"sphere\",\"radius\":1.5}",
        rounding: Rounding::Relative(1e-12),
        compute: |inputs| Ok(convex::mean_projected_area(body(inputs)?)?.m2().into()),
    },
    Quantity {
        name: "throughput-convex-body",
        inputs: &[BODY],
        unit: "m² sr",
        example: "--shape {\"kind\":\"box\",\"a\":1,\"b\":2,\"c\":3}",
        rounding: Rounding::Relative(1e-12),
        compute: |inputs| Ok(convex::throughput(body(inputs)?)?.m2_sr().into()),
    },
    Quantity {
        name: "chart-density-surface",
        inputs: &[THETA],
        unit: "sr/rad²",
        example: "--theta 0.5",
        rounding: ROUNDING,
        compute: |inputs| {
            let theta_rad = angle(inputs, PI / 2.0)?;
            Ok(Surface { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad: 0.0 }.density().into())
        },
    },
    Quantity {
        name: "chart-density-perpendicular",
        inputs: &[Input::new("theta", "rad, 0 to π")],
        unit: "sr/rad²",
        example: "--theta 0.5",
        rounding: ROUNDING,
        compute: |inputs| {
            let theta_rad = angle(inputs, PI)?;
            Ok(Perpendicular { theta_rad, phi_rad: 0.0, x_m: 0.0, y_m: 0.0 }.density().into())
        },
    },
    Quantity {
        name: "chart-density-two-plane",
        inputs: &[
            Input::new("u", "m, in the first plane"),
            Input::new("v", "m, in the first plane"),
            Input::new("s", "m, in the second plane"),
            Input::new("t", "m, in the second plane"),
            Input::new("distance", "m, between the planes"),
        ],
        unit: "sr/m²",
        example: "--u 0 --v 0 --s 0.1 --t 0 --distance 0.3",
        rounding: ROUNDING,
        compute: |inputs| {
            let chart = TwoPlane {
                u_m: inputs.number("u")?,
                v_m: inputs.number("v")?,
                s_m: inputs.number("s")?,
                t_m: inputs.number("t")?,
                distance_m: inputs.number("distance")?,
            };
            // Refuses planes that are none.
            chart.line()?;
            Ok(chart.density().into())
        },
    },
    Quantity {
        name: "chart-density-environment",
        inputs: &[THETA],
        unit: "sr/rad²",
        example: "--theta 0.5",
        rounding: ROUNDING,
        compute: |inputs| {
            let theta_rad = angle(inputs, PI / 2.0)?;
            Ok(Environment { theta_rad, phi_rad: 0.0 }.density().into())
        },
    },
    Quantity {
        name: "irradiance",
        inputs: &[RADIANCE, Input::new("projected_solid_angle", "sr, 0 to π")],
        unit: "W/m²",
        example: "--radiance 100 --projected-solid-angle 6e-5",
        rounding: Rounding::Relative(2.3e-16),
        compute: |inputs| {
            let seen =
                ProjectedSolidAngle::from_sr(between(inputs, "projected_solid_angle", 0.0, PI)?);
            Ok((radiance(inputs)? * seen).w_per_m2().into())
        },
    },
    Quantity {
        name: "radiant-flux",
        inputs: &[RADIANCE, Input::new("throughput", "m² sr")],
        unit: "W",
        example: "--radiance 100 --throughput 2.5e-8",
        rounding: Rounding::Relative(2.3e-16),
        compute: |inputs| {
            let throughput = Throughput::from_m2_sr(not_negative(inputs, "throughput")?);
            Ok((radiance(inputs)? * throughput).w().into())
        },
    },
    Quantity {
        name: "radiance-from-exitance",
        inputs: &[Input::new("exitance", "W/m², of a diffuse emitter")],
        unit: "W/(m² sr)",
        example: "--exitance 314.15926",
        rounding: Rounding::Relative(4.6e-16),
        compute: |inputs| {
            let exitance = Exitance::from_w_per_m2(not_negative(inputs, "exitance")?);
            Ok((exitance / ProjectedSolidAngle::HEMISPHERE).w_per_m2_sr().into())
        },
    },
    Quantity {
        name: "exitance",
        inputs: &[Input::new("radiance", "W/(m² sr), of a diffuse emitter")],
        unit: "W/m²",
        example: "--radiance 100",
        rounding: Rounding::Relative(4.6e-16),
        compute: |inputs| {
            // π L.
            let hemisphere = ProjectedSolidAngle::HEMISPHERE;
            Ok(radiance(inputs)?.exitance_into(hemisphere).w_per_m2().into())
        },
    },
];

/// A closed convex body.
fn body(inputs: Inputs<'_>) -> Result<ConvexBody, Refusal> {
    let shape = inputs.object("shape")?;
    let kind = shape.text("kind")?;
    let sizes: &[&'static str] = match kind {
        "sphere" => &["radius"],
        "box" | "ellipsoid" => &["a", "b", "c"],
        "cylinder" | "cone" => &["radius", "height"],
        other => return Err(Refusal::new(format!("the shape kind `{other}` is not known"))),
    };
    let keys: Vec<Input> = ["kind"].iter().chain(sizes).map(|key| Input::new(key, "m")).collect();
    shape.expect_only(&keys)?;
    let edges = || Ok::<_, Refusal>([shape.number("a")?, shape.number("b")?, shape.number("c")?]);
    let radius = || shape.number("radius");
    let height = || shape.number("height");
    Ok(match kind {
        "sphere" => ConvexBody::Sphere { radius_m: radius()? },
        "box" => ConvexBody::Box { edges_m: edges()? },
        "ellipsoid" => ConvexBody::Ellipsoid { semi_axes_m: edges()? },
        "cylinder" => ConvexBody::Cylinder { radius_m: radius()?, height_m: height()? },
        _ => ConvexBody::Cone { radius_m: radius()?, height_m: height()? },
    })
}

fn radiance(inputs: Inputs<'_>) -> Result<Radiance, Refusal> {
    Ok(Radiance::from_w_per_m2_sr(not_negative(inputs, "radiance")?))
}

fn angle(inputs: Inputs<'_>, max: f64) -> Result<f64, Refusal> {
    between(inputs, "theta", 0.0, max)
}

fn between(inputs: Inputs<'_>, name: &str, low: f64, high: f64) -> Result<f64, Refusal> {
    let value = inputs.number(name)?;
    if (low..=high).contains(&value) {
        Ok(value)
    } else {
        Err(Refusal::new(format!("{name} is {value}, expected {low} to {high}")))
    }
}
