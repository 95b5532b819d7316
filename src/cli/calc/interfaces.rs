//! Refraction and reflection at an interface, and through a window.

use radiometry::interface::{Incidence, Interface, Window};

use super::inputs::Inputs;
use super::quantity::{Answer, Input, Quantity, Refusal, Rounding};

const N1: Input = Input::new("n1", "refractive index, where the ray comes from");
const N2: Input = Input::new("n2", "refractive index");
const COS: Input = Input::optional("cos_i", "cosine of incidence, 0 to 1");
const THETA: Input = Input::optional("theta_i", "instead: angle of incidence, rad, 0 to π/2");
const THICKNESS: Input = Input::new("thickness", "m");
const ABSORPTION: Input = Input::optional("absorption", "1/m, default 0");

/// The roundings of some ten operations.
const ROUNDING: Rounding = Rounding::Relative(4e-15);

/// A quantity of one interface and one incidence.
const fn at_incidence(
    name: &'static str,
    unit: &'static str,
    example: &'static str,
    compute: fn(Inputs<'_>) -> Result<Answer, Refusal>,
) -> Quantity {
    let inputs = &[N1, N2, COS, THETA];
    Quantity { name, inputs, unit, example, rounding: ROUNDING, compute }
}

const BY_COS: &str = "--n1 1 --n2 1.5 --cos-i 0.5";
const BY_ANGLE: &str = "--n1 1 --n2 1.5 --theta-i 0.5";

pub(super) const QUANTITIES: &[Quantity] = &[
    at_incidence("fresnel-reflectance", "1", BY_COS, |inputs| {
        Ok(interface(inputs)?.reflectance(incidence(inputs)?).into())
    }),
    at_incidence("fresnel-reflectance-s", "1", BY_ANGLE, |inputs| {
        Ok(interface(inputs)?.reflectance_s(incidence(inputs)?).into())
    }),
    at_incidence("fresnel-reflectance-p", "1", BY_ANGLE, |inputs| {
        Ok(interface(inputs)?.reflectance_p(incidence(inputs)?).into())
    }),
    at_incidence("fresnel-transmittance", "1", BY_COS, |inputs| {
        Ok(interface(inputs)?.transmittance(incidence(inputs)?).into())
    }),
    at_incidence("fresnel-transmittance-s", "1", BY_COS, |inputs| {
        Ok(interface(inputs)?.transmittance_s(incidence(inputs)?).into())
    }),
    at_incidence("fresnel-transmittance-p", "1", BY_COS, |inputs| {
        Ok(interface(inputs)?.transmittance_p(incidence(inputs)?).into())
    }),
    at_incidence("snell-refraction", "1", BY_COS, |inputs| {
        Ok(interface(inputs)?.refracted_cos(incidence(inputs)?).into())
    }),
    at_incidence("snell-refraction-angle", "rad", BY_ANGLE, |inputs| {
        Ok(interface(inputs)?.refracted_angle(incidence(inputs)?).into())
    }),
    at_incidence("refraction-deviation", "rad", BY_ANGLE, |inputs| {
        Ok(interface(inputs)?.deviation(incidence(inputs)?).into())
    }),
    Quantity {
        name: "refract-direction",
        inputs: &[
            N1,
            N2,
            Input::new("direction", "x,y,z of any length"),
            Input::new("normal", "x,y,z of any length, towards medium 1"),
        ],
        unit: "1",
        example: "--n1 1 --n2 1.5 --direction 0.6,0,-0.8 --normal 0,0,1",
        rounding: ROUNDING,
        compute: |inputs| {
            let (direction, normal) = (inputs.direction("direction")?, inputs.direction("normal")?);
            let refracted = interface(inputs)?.refract(direction, normal)?;
            Ok(refracted.map_or(Answer::from(None), Answer::from))
        },
    },
    Quantity {
        name: "radiance-ratio-across-interface",
        inputs: &[N1, N2],
        unit: "1",
        example: "--n1 1 --n2 1.5",
        rounding: Rounding::Relative(5e-16),
        compute: |inputs| Ok(interface(inputs)?.radiance_ratio().into()),
    },
    Quantity {
        name: "window-transmittance",
        inputs: &[N1, N2, COS, THETA, THICKNESS, ABSORPTION],
        unit: "1",
        example: "--n1 1 --n2 1.5 --cos-i 1 --thickness 0.004",
        rounding: ROUNDING,
        compute: |inputs| Ok(window(inputs)?.transmittance(incidence(inputs)?).into()),
    },
    Quantity {
        name: "window-reflectance",
        inputs: &[N1, N2, COS, THETA, THICKNESS, ABSORPTION],
        unit: "1",
        example: "--n1 1 --n2 1.5 --cos-i 1 --thickness 0.004",
        rounding: ROUNDING,
        compute: |inputs| Ok(window(inputs)?.reflectance(incidence(inputs)?).into()),
    },
    Quantity {
        name: "window-lateral-shift",
        inputs: &[N1, N2, COS, THETA, THICKNESS],
        unit: "m",
        example: "--n1 1 --n2 1.5 --theta-i 0.5 --thickness 0.004",
        rounding: ROUNDING,
        compute: |inputs| Ok(window(inputs)?.lateral_shift_m(incidence(inputs)?).into()),
    },
];

fn interface(inputs: Inputs<'_>) -> Result<Interface, Refusal> {
    Ok(Interface::new(inputs.number("n1")?, inputs.number("n2")?)?)
}

fn incidence(inputs: Inputs<'_>) -> Result<Incidence, Refusal> {
    match (inputs.has("cos_i"), inputs.has("theta_i")) {
        (true, false) => Ok(Incidence::from_cos(inputs.number("cos_i")?)?),
        (false, true) => Ok(Incidence::from_angle(inputs.number("theta_i")?)?),
        _ => Err(Refusal::new("expected either cos_i or theta_i")),
    }
}

fn window(inputs: Inputs<'_>) -> Result<Window, Refusal> {
    let absorption = if inputs.has("absorption") { inputs.number("absorption")? } else { 0.0 };
    Ok(Window::new(interface(inputs)?, inputs.number("thickness")?, absorption)?)
}
