//! Refraction and reflection at an interface, and through a window.

use radiometry::interface::{
    ExponentialProfile, Incidence, IndexProfile, Interface, Leg, LinearProfile, Stratified, Window,
    basic_radiance, radiance_in_medium,
};
use radiometry::quantity::Radiance;

use super::inputs::Inputs;
use super::quantity::{Answer, Input, Quantity, Refusal, Rounding, tolerance};

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
    Quantity {
        name: "basic-radiance",
        inputs: &[Input::new("radiance", "W/(m² sr)"), Input::new("n", INDEX)],
        unit: "W/(m² sr)",
        example: "--radiance 9 --n 1.5",
        rounding: Rounding::Relative(5e-16),
        compute: |inputs| {
            let radiance = Radiance::from_w_per_m2_sr(inputs.number("radiance")?);
            Ok(basic_radiance(radiance, inputs.number("n")?)?.w_per_m2_sr().into())
        },
    },
    Quantity {
        name: "radiance-in-medium",
        inputs: &[Input::new("basic_radiance", "L/n², W/(m² sr)"), Input::new("n", INDEX)],
        unit: "W/(m² sr)",
        example: "--basic-radiance 4 --n 1.5",
        rounding: Rounding::Relative(5e-16),
        compute: |inputs| {
            let basic = Radiance::from_w_per_m2_sr(inputs.number("basic_radiance")?);
            Ok(radiance_in_medium(basic, inputs.number("n")?)?.w_per_m2_sr().into())
        },
    },
    in_layers("graded-index-displacement", PASSING, |inputs| {
        let leg = leg(inputs)?;
        Ok(if leg.turns { None.into() } else { leg.across.into() })
    }),
    in_layers("graded-index-optical-path", PASSING, |inputs| {
        let leg = leg(inputs)?;
        Ok(if leg.turns { None.into() } else { leg.optical_path_m.into() })
    }),
    in_layers("graded-index-turning-rise", TURNING, |inputs| {
        let leg = leg(inputs)?;
        if leg.turns {
            return Ok(Answer::within(leg.end_level_m, leg.end_level_error_m));
        }
        Ok(None.into())
    }),
    in_layers("graded-index-turning-displacement", TURNING, |inputs| {
        let leg = leg(inputs)?;
        Ok(if leg.turns { leg.across.into() } else { None.into() })
    }),
];

const INDEX: &str = "refractive index, 1 to 1000";

/// Plane layers, heights counted from where the ray starts.
const LAYERS: [Input; 6] = [
    Input::new("n", "refractive index where the ray starts, 1 to 1000"),
    Input::new("theta", "there, to the layers' normal, rad, 0 to π/2"),
    Input::new("rise", "m, to where the ray is followed; negative downwards"),
    Input::optional("slope", "of the index with height, 1/m"),
    Input::optional("scale_height", "instead: n - 1 falls to 1/e of it with this height, m"),
    Input::optional("relative_tolerance", "default 1e-10"),
];

const PASSING: &str = "--n 1.5 --theta 0.5 --rise 1 --slope -0.1";
const TURNING: &str = "--n 1.0003 --theta 1.57 --rise 50 --scale-height 8000";

/// What a ray's way through plane layers says; none where it turns first, or doesn't turn.
const fn in_layers(
    name: &'static str,
    example: &'static str,
    compute: fn(Inputs<'_>) -> Result<Answer, Refusal>,
) -> Quantity {
    Quantity { name, inputs: &LAYERS, unit: "m", example, rounding: Rounding::Stated, compute }
}

fn leg(inputs: Inputs<'_>) -> Result<Leg, Refusal> {
    let index = inputs.number("n")?;
    match (inputs.has("slope"), inputs.has("scale_height")) {
        (true, false) => leg_in(inputs, LinearProfile::new(index, inputs.number("slope")?)?),
        (false, true) => {
            let scale_height_m = inputs.number("scale_height")?;
            leg_in(inputs, ExponentialProfile::new(index, 0.0, scale_height_m)?)
        }
        _ => Err(Refusal::new("expected either slope or scale_height")),
    }
}

fn leg_in(inputs: Inputs<'_>, profile: impl IndexProfile) -> Result<Leg, Refusal> {
    let layers = Stratified::plane(profile);
    let ray = layers.ray(0.0, inputs.number("theta")?)?;
    Ok(ray.leg(inputs.number("rise")?, tolerance(inputs)?)?)
}

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
