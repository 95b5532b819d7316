//! The operators that amounts have, as macros: written once for quantities of one unit and for those
//! with a photometric twin. They do not know any quantity.

/// What any amount can do. Amounts of one kind add, scale by a number and have a ratio; negative ones
/// are kept (a dark-subtracted radiance may be below zero).
macro_rules! amount {
    ([$($generics:tt)*] $name:ty) => {
        impl<$($generics)*> $name {
            /// Nothing of it.
            pub const ZERO: Self = Self::new(0.0);

            /// Its size without the sign.
            #[must_use]
            pub const fn abs(self) -> Self {
                Self::new(self.0.abs())
            }

            /// Whether it is a number at all: neither NaN nor infinite.
            pub const fn is_finite(self) -> bool {
                self.0.is_finite()
            }
        }

        impl<$($generics)*> core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                core::fmt::Display::fmt(&self.0, f)?;
                write!(f, " {}", Self::unit())
            }
        }

        impl<$($generics)*> core::fmt::LowerExp for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                core::fmt::LowerExp::fmt(&self.0, f)?;
                write!(f, " {}", Self::unit())
            }
        }

        impl<$($generics)*> core::ops::Add for $name {
            type Output = Self;
            fn add(self, other: Self) -> Self {
                Self::new(self.0 + other.0)
            }
        }

        impl<$($generics)*> core::ops::AddAssign for $name {
            fn add_assign(&mut self, other: Self) {
                self.0 += other.0;
            }
        }

        impl<$($generics)*> core::ops::Sub for $name {
            type Output = Self;
            fn sub(self, other: Self) -> Self {
                Self::new(self.0 - other.0)
            }
        }

        impl<$($generics)*> core::ops::SubAssign for $name {
            fn sub_assign(&mut self, other: Self) {
                self.0 -= other.0;
            }
        }

        impl<$($generics)*> core::ops::Neg for $name {
            type Output = Self;
            fn neg(self) -> Self {
                Self::new(-self.0)
            }
        }

        impl<$($generics)*> core::ops::Mul<f64> for $name {
            type Output = Self;
            fn mul(self, factor: f64) -> Self {
                Self::new(self.0 * factor)
            }
        }

        impl<$($generics)*> core::ops::Mul<$name> for f64 {
            type Output = $name;
            fn mul(self, amount: $name) -> $name {
                <$name>::new(self * amount.0)
            }
        }

        impl<$($generics)*> core::ops::Div<f64> for $name {
            type Output = Self;
            fn div(self, divisor: f64) -> Self {
                Self::new(self.0 / divisor)
            }
        }

        impl<$($generics)*> core::ops::Div for $name {
            type Output = f64;
            fn div(self, other: Self) -> f64 {
                self.0 / other.0
            }
        }

        impl<$($generics)*> core::iter::Sum for $name {
            fn sum<I: Iterator<Item = Self>>(amounts: I) -> Self {
                amounts.fold(Self::ZERO, core::ops::Add::add)
            }
        }
    };
}

/// a · b = c in SI units, in either order.
macro_rules! product {
    ([$($generics:tt)*] $a:ty, $b:ty => $c:ty) => {
        impl<$($generics)*> core::ops::Mul<$b> for $a {
            type Output = $c;
            fn mul(self, other: $b) -> $c {
                <$c>::new(self.0 * other.0)
            }
        }

        impl<$($generics)*> core::ops::Mul<$a> for $b {
            type Output = $c;
            fn mul(self, other: $a) -> $c {
                <$c>::new(self.0 * other.0)
            }
        }
    };
}

/// c / a = b in SI units.
macro_rules! quotient {
    ([$($generics:tt)*] $c:ty, $a:ty => $b:ty) => {
        impl<$($generics)*> core::ops::Div<$a> for $c {
            type Output = $b;
            fn div(self, other: $a) -> $b {
                <$b>::new(self.0 / other.0)
            }
        }
    };
}

/// A quantity of one unit.
macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident, $unit:literal, $from:ident, $to:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
        pub struct $name(pub(super) f64);

        impl $name {
            #[doc = concat!("That many ", $unit, ".")]
            pub const fn $from(value: f64) -> Self {
                Self::new(value)
            }

            #[doc = concat!("The number of ", $unit, ".")]
            pub const fn $to(self) -> f64 {
                self.0
            }

            pub(super) const fn new(value: f64) -> Self {
                Self(value)
            }

            const fn unit() -> &'static str {
                $unit
            }
        }

        amount!([] $name);
    };
}
