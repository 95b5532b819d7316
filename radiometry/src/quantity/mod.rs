//! Radiometric quantities as types: a number with its unit, and the operators that physics has.
//!
//! Plain dimension analysis cannot tell irradiance from exitance (both W/m²) nor radiance from
//! irradiance (the steradian is 1), which are the likeliest slips; so each is a type of its own.
//! Numbers enter and leave through a named unit, and by no other way: there is no `Deref`, no
//! `From<f64>`, no public field. Who measured a quantity, and how well, is not known here.
//!
//! Light is counted in watts or in lumens, and a quantity of light says which by a marker:
//! `Radiance<Photometric>` is the luminance. The twins share every operator and meet only through a
//! [`LuminousEfficacy`]. For the rig and the simulator, whose detectors are calibrated for either, and
//! for the lecture's table of names and units.
//!
//! ```
//! use radiometry::quantity::{Radiance, RadiantFlux, Throughput};
//! let radiance = Radiance::from_w_per_m2_sr(4.0);
//! let flux: RadiantFlux = radiance * Throughput::from_m2_sr(0.5);
//! assert_eq!(flux, RadiantFlux::from_w(2.0));
//! assert_eq!(flux.to_string(), "2 W");
//! ```
//!
//! Arriving and leaving do not add:
//! ```compile_fail
//! use radiometry::quantity::{Exitance, Irradiance};
//! let _ = Irradiance::from_w_per_m2(1.0) + Exitance::from_w_per_m2(1.0);
//! ```
//! and a solid angle is no projected solid angle:
//! ```compile_fail
//! use radiometry::quantity::{Irradiance, Radiance, SolidAngle};
//! let _: Irradiance = Radiance::from_w_per_m2_sr(1.0) * SolidAngle::from_sr(1.0);
//! ```
//! Nor do watts and lumens,
//! ```compile_fail
//! use radiometry::quantity::{Luminance, Radiance};
//! let _ = Radiance::from_w_per_m2_sr(1.0) + Luminance::from_cd_per_m2(683.0);
//! ```
//! and no luminance becomes a flux in watts:
//! ```compile_fail
//! use radiometry::quantity::{Luminance, RadiantFlux, Throughput};
//! let _: RadiantFlux = Luminance::from_cd_per_m2(1.0) * Throughput::from_m2_sr(1.0);
//! ```

#[macro_use]
mod operators;

mod efficacy;
mod extent;
mod light;

pub use efficacy::LuminousEfficacy;
pub use extent::{Area, FormFactor, ProjectedArea, ProjectedSolidAngle, SolidAngle, Throughput};
pub use light::{
    Exitance, Illuminance, Irradiance, Luminance, LuminousExitance, LuminousFlux,
    LuminousIntensity, Photometric, Radiance, RadiantFlux, RadiantIntensity, Radiometric,
    Weighting,
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lambertian_surface_has_exitance_pi_l() {
        let hemisphere = ProjectedSolidAngle::from_sr(core::f64::consts::PI);
        let exitance = Radiance::from_w_per_m2_sr(10.0).exitance_into(hemisphere);
        assert_eq!(exitance, Exitance::from_w_per_m2(10.0 * core::f64::consts::PI));
        assert_eq!(exitance / hemisphere, Radiance::from_w_per_m2_sr(10.0));
    }

    #[test]
    fn intensity_over_projected_area_is_radiance() {
        let area = Area::from_m2(4.0).projected(0.5);
        let intensity = RadiantIntensity::from_w_per_sr(6.0);
        assert_eq!(intensity / area, Radiance::from_w_per_m2_sr(3.0));
    }

    #[test]
    fn display_prints_the_unit_and_keeps_the_precision_asked_for() {
        assert_eq!(format!("{:.2}", Radiance::from_w_per_m2_sr(1.0)), "1.00 W·m⁻²·sr⁻¹");
        assert_eq!(format!("{:.1e}", Throughput::from_m2_sr(2.5e-9)), "2.5e-9 m²·sr");
    }

    #[test]
    fn the_twins_have_the_same_operators_and_their_own_units() {
        let luminance = Luminance::from_cd_per_m2(10.0);
        let hemisphere = ProjectedSolidAngle::HEMISPHERE;
        let illuminance: Illuminance = luminance * hemisphere;
        assert_eq!(illuminance, Illuminance::from_lx(10.0 * core::f64::consts::PI));
        let flux: LuminousFlux = illuminance * Area::from_m2(2.0);
        assert_eq!(flux.exitance_over(Area::from_m2(2.0)), luminance.exitance_into(hemisphere));
        let intensity: LuminousIntensity = luminance * Area::from_m2(2.0).projected(0.5);
        assert_eq!(intensity, LuminousIntensity::from_cd(10.0));
        let units = [
            luminance.to_string(),
            Illuminance::from_lx(1.0).to_string(),
            LuminousExitance::from_lm_per_m2(1.0).to_string(),
            intensity.to_string(),
            LuminousFlux::from_lm(1.5).to_string(),
            LuminousEfficacy::K_M.to_string(),
        ];
        assert_eq!(units, ["10 cd·m⁻²", "1 lx", "1 lm·m⁻²", "10 cd", "1.5 lm", "683.002 lm·W⁻¹"]);
    }

    #[test]
    fn watts_become_lumens_through_an_efficacy_and_nothing_else() {
        let lamp = LuminousEfficacy::from_lm_per_w(300.0);
        let flux = RadiantFlux::from_w(2.0);
        assert_eq!(flux * lamp, LuminousFlux::from_lm(600.0));
        assert_eq!(lamp * flux / flux, lamp);
        assert_eq!(Illuminance::from_lx(600.0) / lamp, Irradiance::from_w_per_m2(2.0));
        // Before or after the geometry: the same.
        let seen = Throughput::from_m2_sr(0.5);
        let radiance = Radiance::from_w_per_m2_sr(4.0);
        assert_eq!((radiance * lamp) * seen, (radiance * seen) * lamp);
    }
}
