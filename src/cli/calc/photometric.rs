//! Watts to lumens and back, each through a luminous efficacy that is stated.

use radiometry::quantity::{
    Exitance, Illuminance, Irradiance, Luminance, LuminousEfficacy, LuminousExitance, LuminousFlux,
    LuminousIntensity, Radiance, RadiantFlux, RadiantIntensity,
};

use super::inputs::Inputs;
use super::quantity::{Answer, Input, Quantity, Refusal, Rounding, not_negative};

/// The answer to one question of the table.
type Compute = fn(Inputs<'_>) -> Result<Answer, Refusal>;

const EFFICACY: Input = Input::new(
    "efficacy",
    "lm/W, luminous efficacy of the radiation, above 0 to 683.002 (at 540 THz 683, exactly)",
);

const fn converted(
    name: &'static str,
    inputs: &'static [Input],
    unit: &'static str,
    example: &'static str,
    compute: Compute,
) -> Quantity {
    Quantity { name, inputs, unit, example, rounding: Rounding::Relative(2.3e-16), compute }
}

pub(super) const QUANTITIES: &[Quantity] = &[
    converted(
        "luminance",
        &[Input::new("radiance", "W/(m² sr)"), EFFICACY],
        "cd/m²",
        "--radiance 2 --efficacy 300",
        |inputs| {
            let radiance = Radiance::from_w_per_m2_sr(not_negative(inputs, "radiance")?);
            Ok((radiance * efficacy(inputs)?).cd_per_m2().into())
        },
    ),
    converted(
        "illuminance",
        &[Input::new("irradiance", "W/m²"), EFFICACY],
        "lx",
        "--irradiance 2 --efficacy 300",
        |inputs| {
            let irradiance = Irradiance::from_w_per_m2(not_negative(inputs, "irradiance")?);
            Ok((irradiance * efficacy(inputs)?).lx().into())
        },
    ),
    converted(
        "luminous-exitance",
        &[Input::new("exitance", "W/m²"), EFFICACY],
        "lm/m²",
        "--exitance 2 --efficacy 300",
        |inputs| {
            let exitance = Exitance::from_w_per_m2(not_negative(inputs, "exitance")?);
            Ok((exitance * efficacy(inputs)?).lm_per_m2().into())
        },
    ),
    converted(
        "luminous-intensity",
        &[Input::new("radiant_intensity", "W/sr"), EFFICACY],
        "cd",
        "--radiant-intensity 2 --efficacy 300",
        |inputs| {
            let intensity = not_negative(inputs, "radiant_intensity")?;
            Ok((RadiantIntensity::from_w_per_sr(intensity) * efficacy(inputs)?).cd().into())
        },
    ),
    converted(
        "luminous-flux",
        &[Input::new("radiant_flux", "W"), EFFICACY],
        "lm",
        "--radiant-flux 2 --efficacy 300",
        |inputs| {
            let flux = RadiantFlux::from_w(not_negative(inputs, "radiant_flux")?);
            Ok((flux * efficacy(inputs)?).lm().into())
        },
    ),
    converted(
        "radiance-from-luminance",
        &[Input::new("luminance", "cd/m²"), EFFICACY],
        "W/(m² sr)",
        "--luminance 600 --efficacy 300",
        |inputs| {
            let luminance = Luminance::from_cd_per_m2(not_negative(inputs, "luminance")?);
            Ok((luminance / efficacy(inputs)?).w_per_m2_sr().into())
        },
    ),
    converted(
        "irradiance-from-illuminance",
        &[Input::new("illuminance", "lx"), EFFICACY],
        "W/m²",
        "--illuminance 600 --efficacy 300",
        |inputs| {
            let illuminance = Illuminance::from_lx(not_negative(inputs, "illuminance")?);
            Ok((illuminance / efficacy(inputs)?).w_per_m2().into())
        },
    ),
    converted(
        "exitance-from-luminous-exitance",
        &[Input::new("luminous_exitance", "lm/m²"), EFFICACY],
        "W/m²",
        "--luminous-exitance 600 --efficacy 300",
        |inputs| {
            let exitance = not_negative(inputs, "luminous_exitance")?;
            let exitance = LuminousExitance::from_lm_per_m2(exitance);
            Ok((exitance / efficacy(inputs)?).w_per_m2().into())
        },
    ),
    converted(
        "radiant-intensity-from-luminous-intensity",
        &[Input::new("luminous_intensity", "cd"), EFFICACY],
        "W/sr",
        "--luminous-intensity 600 --efficacy 300",
        |inputs| {
            let intensity = not_negative(inputs, "luminous_intensity")?;
            let intensity = LuminousIntensity::from_cd(intensity);
            Ok((intensity / efficacy(inputs)?).w_per_sr().into())
        },
    ),
    converted(
        "radiant-flux-from-luminous-flux",
        &[Input::new("luminous_flux", "lm"), EFFICACY],
        "W",
        "--luminous-flux 600 --efficacy 300",
        |inputs| {
            let flux = LuminousFlux::from_lm(not_negative(inputs, "luminous_flux")?);
            Ok((flux / efficacy(inputs)?).w().into())
        },
    ),
];

fn efficacy(inputs: Inputs<'_>) -> Result<LuminousEfficacy, Refusal> {
    let stated = LuminousEfficacy::from_lm_per_w(inputs.number("efficacy")?);
    if LuminousEfficacy::ZERO < stated && stated <= LuminousEfficacy::K_M {
        return Ok(stated);
    }
    let expected = LuminousEfficacy::K_M.lm_per_w();
    let found = stated.lm_per_w();
    Err(Refusal::new(format!("efficacy is {found}, expected more than 0 and at most {expected}")))
}
