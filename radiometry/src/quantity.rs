//! Radiometric quantities as types: a number with its unit, and the operators that physics has.
//!
//! Plain dimension analysis cannot tell irradiance from exitance (both W/m²) nor radiance from
//! irradiance (the steradian is 1), which are the likeliest slips; so each is a type of its own.
//! Numbers enter and leave through a named unit, and by no other way: there is no `Deref`, no
//! `From<f64>`, no public field. Who measured a quantity, and how well, is not known here.
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

use core::fmt;
use core::iter::Sum;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// One quantity: what any amount can do. Amounts of one kind add, scale by a number and have a
/// ratio; negative ones are kept (a dark-subtracted radiance may be below zero).
macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident, $unit:literal, $from:ident, $to:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
        pub struct $name(f64);

        impl $name {
            /// Nothing of it.
            pub const ZERO: Self = Self(0.0);

            #[doc = concat!("That many ", $unit, ".")]
            pub const fn $from(value: f64) -> Self {
                Self(value)
            }

            #[doc = concat!("The number of ", $unit, ".")]
            pub const fn $to(self) -> f64 {
                self.0
            }

            /// Its size without the sign.
            #[must_use]
            pub const fn abs(self) -> Self {
                Self(self.0.abs())
            }

            /// Whether it is a number at all: neither NaN nor infinite.
            pub const fn is_finite(self) -> bool {
                self.0.is_finite()
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                fmt::Display::fmt(&self.0, f)?;
                f.write_str(concat!(" ", $unit))
            }
        }

        impl fmt::LowerExp for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                fmt::LowerExp::fmt(&self.0, f)?;
                f.write_str(concat!(" ", $unit))
            }
        }

        impl Add for $name {
            type Output = Self;
            fn add(self, other: Self) -> Self {
                Self(self.0 + other.0)
            }
        }

        impl AddAssign for $name {
            fn add_assign(&mut self, other: Self) {
                self.0 += other.0;
            }
        }

        impl Sub for $name {
            type Output = Self;
            fn sub(self, other: Self) -> Self {
                Self(self.0 - other.0)
            }
        }

        impl SubAssign for $name {
            fn sub_assign(&mut self, other: Self) {
                self.0 -= other.0;
            }
        }

        impl Neg for $name {
            type Output = Self;
            fn neg(self) -> Self {
                Self(-self.0)
            }
        }

        impl Mul<f64> for $name {
            type Output = Self;
            fn mul(self, factor: f64) -> Self {
                Self(self.0 * factor)
            }
        }

        impl Mul<$name> for f64 {
            type Output = $name;
            fn mul(self, amount: $name) -> $name {
                $name(self * amount.0)
            }
        }

        impl Div<f64> for $name {
            type Output = Self;
            fn div(self, divisor: f64) -> Self {
                Self(self.0 / divisor)
            }
        }

        impl Div for $name {
            type Output = f64;
            fn div(self, other: Self) -> f64 {
                self.0 / other.0
            }
        }

        impl Sum for $name {
            fn sum<I: Iterator<Item = Self>>(amounts: I) -> Self {
                amounts.fold(Self::ZERO, Add::add)
            }
        }
    };
}

/// a · b = c in SI units, in either order.
macro_rules! product {
    ($a:ident * $b:ident = $c:ident) => {
        impl Mul<$b> for $a {
            type Output = $c;
            fn mul(self, other: $b) -> $c {
                $c(self.0 * other.0)
            }
        }

        impl Mul<$a> for $b {
            type Output = $c;
            fn mul(self, other: $a) -> $c {
                $c(self.0 * other.0)
            }
        }
    };
}

/// c / a = b in SI units.
macro_rules! quotient {
    ($c:ident / $a:ident = $b:ident) => {
        impl Div<$a> for $c {
            type Output = $b;
            fn div(self, other: $a) -> $b {
                $b(self.0 / other.0)
            }
        }
    };
}

quantity!(
    /// Area of a surface, A, m².
    Area, "m²", from_m2, m2
);
quantity!(
    /// Radiant exitance, M, W·m⁻²: flux *leaving* a surface by its area.
    Exitance, "W·m⁻²", from_w_per_m2, w_per_m2
);
quantity!(
    /// Form factor, F₁₂, 1: the part of the flux leaving a diffuse surface 1 that reaches 2.
    FormFactor, "(form factor)", from_ratio, ratio
);
quantity!(
    /// Irradiance, E, W·m⁻²: flux *arriving* at a surface by its area.
    Irradiance, "W·m⁻²", from_w_per_m2, w_per_m2
);
quantity!(
    /// Area as seen from a direction, A cos θ for a flat surface, m².
    ProjectedArea, "m²", from_m2, m2
);
quantity!(
    /// Projected solid angle, Ω̃ = ∫ cos θ dω, sr; π for the whole hemisphere.
    ProjectedSolidAngle, "sr", from_sr, sr
);
quantity!(
    /// Radiance, L, W·m⁻²·sr⁻¹: flux by throughput; the quantity that a ray carries unchanged.
    Radiance, "W·m⁻²·sr⁻¹", from_w_per_m2_sr, w_per_m2_sr
);
quantity!(
    /// Radiant flux, Φ, W.
    RadiantFlux, "W", from_w, w
);
quantity!(
    /// Radiant intensity, I, W·sr⁻¹: flux of a whole source by solid angle.
    RadiantIntensity, "W·sr⁻¹", from_w_per_sr, w_per_sr
);
quantity!(
    /// Solid angle, Ω, sr; 2π for a hemisphere.
    SolidAngle, "sr", from_sr, sr
);
quantity!(
    /// Throughput (étendue), T = ∬ cos θ dω dA, m²·sr: the measure of a set of rays.
    Throughput, "m²·sr", from_m2_sr, m2_sr
);

product!(Radiance * Throughput = RadiantFlux);
quotient!(RadiantFlux / Throughput = Radiance);
quotient!(RadiantFlux / Radiance = Throughput);

product!(Radiance * ProjectedSolidAngle = Irradiance);
quotient!(Irradiance / ProjectedSolidAngle = Radiance);
quotient!(Irradiance / Radiance = ProjectedSolidAngle);
quotient!(Exitance / ProjectedSolidAngle = Radiance);
quotient!(Exitance / Radiance = ProjectedSolidAngle);

product!(Radiance * ProjectedArea = RadiantIntensity);
quotient!(RadiantIntensity / ProjectedArea = Radiance);
quotient!(RadiantIntensity / Radiance = ProjectedArea);

product!(RadiantIntensity * SolidAngle = RadiantFlux);
quotient!(RadiantFlux / SolidAngle = RadiantIntensity);
quotient!(RadiantFlux / RadiantIntensity = SolidAngle);

product!(Area * ProjectedSolidAngle = Throughput);
quotient!(Throughput / Area = ProjectedSolidAngle);
quotient!(Throughput / ProjectedSolidAngle = Area);
product!(ProjectedArea * SolidAngle = Throughput);
quotient!(Throughput / ProjectedArea = SolidAngle);
quotient!(Throughput / SolidAngle = ProjectedArea);

// RadiantFlux / Area would have to choose between arriving and leaving: the methods say which.
product!(Irradiance * Area = RadiantFlux);
quotient!(RadiantFlux / Irradiance = Area);
product!(Exitance * Area = RadiantFlux);
quotient!(RadiantFlux / Exitance = Area);

impl Radiance {
    /// The exitance of a surface that sends this radiance out into a projected solid angle. (The
    /// same product with light that *arrives* is an irradiance: `*`.)
    pub fn exitance_into(self, projected: ProjectedSolidAngle) -> Exitance {
        Exitance(self.0 * projected.0)
    }
}

impl RadiantFlux {
    /// The irradiance, if this flux arrives evenly on an area.
    pub fn irradiance_over(self, area: Area) -> Irradiance {
        Irradiance(self.0 / area.0)
    }

    /// The exitance, if this flux leaves an area evenly.
    pub fn exitance_over(self, area: Area) -> Exitance {
        Exitance(self.0 / area.0)
    }
}

impl Area {
    /// As seen from a direction whose angle to the normal has this cosine.
    pub fn projected(self, cos_theta: f64) -> ProjectedArea {
        ProjectedArea(self.0 * cos_theta)
    }
}

impl SolidAngle {
    /// Of a cone so narrow that one cosine to the receiver's normal stands for all of it.
    pub fn projected(self, cos_theta: f64) -> ProjectedSolidAngle {
        ProjectedSolidAngle(self.0 * cos_theta)
    }
}

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
}
