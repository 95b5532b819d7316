//! Solid angles and projected solid angles.

use radiometry::quantity::SolidAngle;
use radiometry::solid_angle;

use super::quantity::{Input, Quantity, Rounding};

const SR: &str = "sr";

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
];
