//! Angles and directions.

use radiometry::direction;

use super::inputs::Inputs;
use super::quantity::{Answer, Input, Quantity, Refusal, Rounding};

const RAD: &str = "rad";

pub(super) const QUANTITIES: &[Quantity] = &[
    Quantity {
        name: "angle-between-vectors",
        inputs: &[Input::new("a", "x,y,z of any length"), Input::new("b", "x,y,z of any length")],
        unit: RAD,
        example: "--a 1,0,0 --b 1,1e-9,0",
        rounding: Rounding::Relative(1e-15),
        compute: |inputs| {
            let (a, b) = (inputs.direction("a")?, inputs.direction("b")?);
            Ok(direction::angle_between(a, b).into())
        },
    },
    Quantity {
        name: "angular-distance",
        inputs: &[
            Input::new("theta1", RAD),
            Input::new("phi1", RAD),
            Input::new("theta2", RAD),
            Input::new("phi2", RAD),
        ],
        unit: RAD,
        example: "--theta1 0.5 --phi1 0 --theta2 0.5 --phi2 3.1",
        rounding: Rounding::Relative(1e-14),
        compute: |inputs| {
            let (theta1, phi1) = (inputs.number("theta1")?, inputs.number("phi1")?);
            let (theta2, phi2) = (inputs.number("theta2")?, inputs.number("phi2")?);
            Ok(direction::angular_distance(theta1, phi1, theta2, phi2).into())
        },
    },
    Quantity {
        name: "direction-theta",
        inputs: &[Input::new("direction", "x,y,z of any length")],
        unit: RAD,
        example: "--direction 1,0,1",
        rounding: Rounding::Relative(1e-15),
        compute: |inputs| Ok(direction::angles(inputs.direction("direction")?).0.into()),
    },
    Quantity {
        name: "direction-phi",
        inputs: &[Input::new("direction", "x,y,z of any length")],
        unit: RAD,
        example: "--direction=-1,0,1",
        rounding: Rounding::Relative(1e-15),
        compute: |inputs| Ok(direction::angles(inputs.direction("direction")?).1.into()),
    },
    Quantity {
        name: "wrap-angle",
        inputs: &[Input::new("angle", RAD)],
        unit: RAD,
        example: "--angle 7",
        rounding: Rounding::Relative(1e-15),
        compute: |inputs| Ok(direction::wrap(inputs.number("angle")?).into()),
    },
    Quantity {
        name: "shortest-rotation",
        inputs: &[Input::new("from", RAD), Input::new("to", RAD)],
        unit: RAD,
        example: "--from 3 --to -3",
        rounding: Rounding::Relative(1e-15),
        compute: |inputs| {
            Ok(direction::shortest_rotation(inputs.number("from")?, inputs.number("to")?).into())
        },
    },
    Quantity {
        name: "orthonormal-basis-defect",
        inputs: &[Input::new("normal", "x,y,z of any length")],
        unit: "1",
        example: "--normal 1e-9,-1e-9,-1",
        rounding: Rounding::Absolute(1e-15),
        compute: defect,
    },
];

/// The largest deviation of the frame built on a normal from orthonormality.
fn defect(inputs: Inputs<'_>) -> Result<Answer, Refusal> {
    let normal = direction::normalised(inputs.direction("normal")?)
        .ok_or_else(|| Refusal::new("the normal has no direction"))?;
    let (tangent, bitangent) = direction::frame(normal);
    let defects = [
        tangent.dot(normal),
        bitangent.dot(normal),
        tangent.dot(bitangent),
        tangent.length_squared() - 1.0,
        bitangent.length_squared() - 1.0,
    ];
    Ok(defects.into_iter().map(f64::abs).fold(0.0, f64::max).into())
}
