//! What a watt is worth in lumens. It depends on the spectrum, which is not known here: whoever
//! converts states it.

use super::light::{Exitance, Irradiance, Photometric, Radiance, RadiantFlux, RadiantIntensity};

quantity!(
    /// Luminous efficacy of radiation, K, lm·W⁻¹: luminous by radiant flux of one and the same light.
    /// The only way between a radiometric quantity and its photometric twin.
    ///
    /// ```
    /// use radiometry::quantity::{Luminance, LuminousEfficacy, Radiance};
    /// // A green laser at 540 THz.
    /// let luminance: Luminance = Radiance::from_w_per_m2_sr(2.0) * LuminousEfficacy::K_CD;
    /// assert_eq!(luminance, Luminance::from_cd_per_m2(1366.0));
    /// assert_eq!(luminance / LuminousEfficacy::K_CD, Radiance::from_w_per_m2_sr(2.0));
    /// ```
    LuminousEfficacy, "lm·W⁻¹", from_lm_per_w, lm_per_w
);

impl LuminousEfficacy {
    /// Of monochromatic radiation of 540 THz (about 555 nm), exact by definition of the candela: 683
    /// lm·W⁻¹ (BIPM, *The International System of Units*, 9th edition, 2019, section 2.2).
    pub const K_CD: Self = Self(683.0);

    /// The largest there is for the light-adapted eye, where V(λ) = 1, at 555 nm in standard air: 683.002
    /// lm·W⁻¹ (CIE 018:2019 and BIPM-2019/05, *Principles governing photometry*), rounded as there.
    pub const K_M: Self = Self(683.002);
}

/// radiometric · efficacy = photometric, and both ways back.
macro_rules! through_efficacy {
    ($($name:ident)*) => {$(
        product!([] $name, LuminousEfficacy => $name<Photometric>);
        quotient!([] $name<Photometric>, LuminousEfficacy => $name);
        quotient!([] $name<Photometric>, $name => LuminousEfficacy);
    )*};
}

through_efficacy!(Exitance Irradiance Radiance RadiantFlux RadiantIntensity);
