//! Quantities of light, each in watts or in lumens by a marker. They do not know what a watt of which
//! wavelength is worth to the eye.

use core::fmt::Debug;
use core::marker::PhantomData;

use super::extent::{Area, ProjectedArea, ProjectedSolidAngle, SolidAngle, Throughput};

/// How light of different wavelengths is added up. There are two ways, and no third can be made.
pub trait Weighting: Debug + Copy + PartialEq + PartialOrd + Default + sealed::Sealed {}

mod sealed {
    pub trait Sealed {
        const IS_PHOTOMETRIC: bool;
    }
}

/// Every watt alike: W.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
pub struct Radiometric;

/// By the eye of the standard photometric observer, V(λ): lm.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
pub struct Photometric;

impl sealed::Sealed for Radiometric {
    const IS_PHOTOMETRIC: bool = false;
}
impl sealed::Sealed for Photometric {
    const IS_PHOTOMETRIC: bool = true;
}
impl Weighting for Radiometric {}
impl Weighting for Photometric {}

/// A quantity of light and its twin.
macro_rules! light {
    (
        $(#[$doc:meta])* $name:ident, $unit:literal, $from:ident, $to:ident;
        $(#[$twins_doc:meta])* $twin:ident, $twins_unit:literal, $twins_from:ident, $twins_to:ident
    ) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
        pub struct $name<W: Weighting = Radiometric>(pub(super) f64, PhantomData<W>);

        $(#[$twins_doc])*
        pub type $twin = $name<Photometric>;

        impl $name {
            #[doc = concat!("That many ", $unit, ".")]
            pub const fn $from(value: f64) -> Self {
                Self::new(value)
            }

            #[doc = concat!("The number of ", $unit, ".")]
            pub const fn $to(self) -> f64 {
                self.0
            }
        }

        impl $twin {
            #[doc = concat!("That many ", $twins_unit, ".")]
            pub const fn $twins_from(value: f64) -> Self {
                Self::new(value)
            }

            #[doc = concat!("The number of ", $twins_unit, ".")]
            pub const fn $twins_to(self) -> f64 {
                self.0
            }
        }

        impl<W: Weighting> $name<W> {
            pub(super) const fn new(value: f64) -> Self {
                Self(value, PhantomData)
            }

            const fn unit() -> &'static str {
                if W::IS_PHOTOMETRIC { $twins_unit } else { $unit }
            }
        }

        amount!([W: Weighting] $name<W>);
    };
}

light!(
    /// Radiant exitance, M, W·m⁻²: flux *leaving* a surface by its area.
    Exitance, "W·m⁻²", from_w_per_m2, w_per_m2;
    /// Luminous exitance, M, lm·m⁻².
    LuminousExitance, "lm·m⁻²", from_lm_per_m2, lm_per_m2
);
light!(
    /// Irradiance, E, W·m⁻²: flux *arriving* at a surface by its area.
    Irradiance, "W·m⁻²", from_w_per_m2, w_per_m2;
    /// Illuminance, E, lx = lm·m⁻².
    Illuminance, "lx", from_lx, lx
);
light!(
    /// Radiance, L, W·m⁻²·sr⁻¹: flux by throughput; the quantity that a ray carries unchanged.
    Radiance, "W·m⁻²·sr⁻¹", from_w_per_m2_sr, w_per_m2_sr;
    /// Luminance, L, cd·m⁻² = lm·m⁻²·sr⁻¹.
    Luminance, "cd·m⁻²", from_cd_per_m2, cd_per_m2
);
light!(
    /// Radiant flux, Φ, W.
    RadiantFlux, "W", from_w, w;
    /// Luminous flux, Φ, lm.
    LuminousFlux, "lm", from_lm, lm
);
light!(
    /// Radiant intensity, I, W·sr⁻¹: flux of a whole source by solid angle.
    RadiantIntensity, "W·sr⁻¹", from_w_per_sr, w_per_sr;
    /// Luminous intensity, I, cd = lm·sr⁻¹.
    LuminousIntensity, "cd", from_cd, cd
);

product!([W: Weighting] Radiance<W>, Throughput => RadiantFlux<W>);
quotient!([W: Weighting] RadiantFlux<W>, Throughput => Radiance<W>);
quotient!([W: Weighting] RadiantFlux<W>, Radiance<W> => Throughput);

product!([W: Weighting] Radiance<W>, ProjectedSolidAngle => Irradiance<W>);
quotient!([W: Weighting] Irradiance<W>, ProjectedSolidAngle => Radiance<W>);
quotient!([W: Weighting] Irradiance<W>, Radiance<W> => ProjectedSolidAngle);
quotient!([W: Weighting] Exitance<W>, ProjectedSolidAngle => Radiance<W>);
quotient!([W: Weighting] Exitance<W>, Radiance<W> => ProjectedSolidAngle);

product!([W: Weighting] Radiance<W>, ProjectedArea => RadiantIntensity<W>);
quotient!([W: Weighting] RadiantIntensity<W>, ProjectedArea => Radiance<W>);
quotient!([W: Weighting] RadiantIntensity<W>, Radiance<W> => ProjectedArea);

product!([W: Weighting] RadiantIntensity<W>, SolidAngle => RadiantFlux<W>);
quotient!([W: Weighting] RadiantFlux<W>, SolidAngle => RadiantIntensity<W>);
quotient!([W: Weighting] RadiantFlux<W>, RadiantIntensity<W> => SolidAngle);

// RadiantFlux / Area would have to choose between arriving and leaving: the methods say which.
product!([W: Weighting] Irradiance<W>, Area => RadiantFlux<W>);
quotient!([W: Weighting] RadiantFlux<W>, Irradiance<W> => Area);
product!([W: Weighting] Exitance<W>, Area => RadiantFlux<W>);
quotient!([W: Weighting] RadiantFlux<W>, Exitance<W> => Area);

impl<W: Weighting> Radiance<W> {
    /// That many of the unit of its weighting.
    pub(crate) const fn from_amount(amount: f64) -> Self {
        Self::new(amount)
    }

    /// The number, in the unit of its weighting.
    pub(crate) const fn amount(self) -> f64 {
        self.0
    }

    /// The exitance of a surface that sends this radiance out into a projected solid angle. (The
    /// same product with light that *arrives* is an irradiance: `*`.)
    pub fn exitance_into(self, projected: ProjectedSolidAngle) -> Exitance<W> {
        Exitance::new(self.0 * projected.0)
    }
}

impl<W: Weighting> RadiantFlux<W> {
    /// The irradiance, if this flux arrives evenly on an area.
    pub fn irradiance_over(self, area: Area) -> Irradiance<W> {
        Irradiance::new(self.0 / area.0)
    }

    /// The exitance, if this flux leaves an area evenly.
    pub fn exitance_over(self, area: Area) -> Exitance<W> {
        Exitance::new(self.0 / area.0)
    }
}
