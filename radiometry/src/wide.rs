//! Vectors of double-doubles: differences of coordinates without loss, and products of them with 32
//! digits, for the geometry whose answer is a small rest of large terms. It knows vectors only.

use glam::DVec3;

use crate::error_free::{DoubleDouble, difference_of_products, scaled};

/// A vector with about 32 digits in each component.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WideVec {
    x: DoubleDouble,
    y: DoubleDouble,
    z: DoubleDouble,
}

impl WideVec {
    pub(crate) fn from_vec(vector: DVec3) -> Self {
        Self {
            x: DoubleDouble::from_f64(vector.x),
            y: DoubleDouble::from_f64(vector.y),
            z: DoubleDouble::from_f64(vector.z),
        }
    }

    /// a - b without loss.
    pub(crate) fn difference(a: DVec3, b: DVec3) -> Self {
        Self {
            x: DoubleDouble::difference(a.x, b.x),
            y: DoubleDouble::difference(a.y, b.y),
            z: DoubleDouble::difference(a.z, b.z),
        }
    }

    pub(crate) fn new(x: DoubleDouble, y: DoubleDouble, z: DoubleDouble) -> Self {
        Self { x, y, z }
    }

    /// x, y, z.
    pub(crate) fn components(self) -> [DoubleDouble; 3] {
        [self.x, self.y, self.z]
    }

    /// Each component rounded to the nearest double.
    pub(crate) fn to_vec(self) -> DVec3 {
        DVec3::new(self.x.to_f64(), self.y.to_f64(), self.z.to_f64())
    }

    pub(crate) fn add(self, other: Self) -> Self {
        Self { x: self.x.add(other.x), y: self.y.add(other.y), z: self.z.add(other.z) }
    }

    pub(crate) fn sub(self, other: Self) -> Self {
        Self { x: self.x.sub(other.x), y: self.y.sub(other.y), z: self.z.sub(other.z) }
    }

    pub(crate) fn times(self, factor: DoubleDouble) -> Self {
        Self { x: self.x.mul(factor), y: self.y.mul(factor), z: self.z.mul(factor) }
    }

    /// Times two to the power, exactly.
    pub(crate) fn scaled(self, exponent: i32) -> Self {
        Self { x: self.x.scaled(exponent), y: self.y.scaled(exponent), z: self.z.scaled(exponent) }
    }

    pub(crate) fn dot(self, other: Self) -> DoubleDouble {
        self.x.mul(other.x).add(self.y.mul(other.y)).add(self.z.mul(other.z))
    }

    pub(crate) fn cross(self, other: Self) -> Self {
        let minor = |a: DoubleDouble, b: DoubleDouble, c: DoubleDouble, d: DoubleDouble| {
            a.mul(d).sub(b.mul(c))
        };
        Self {
            x: minor(self.y, self.z, other.y, other.z),
            y: minor(self.z, self.x, other.z, other.x),
            z: minor(self.x, self.y, other.x, other.y),
        }
    }

    pub(crate) fn length(self) -> DoubleDouble {
        self.dot(self).sqrt()
    }

    /// Of length 1, with all digits; the zero vector has no direction.
    pub(crate) fn unit(self) -> Option<Self> {
        let scaled = self.normal_sized();
        let length = scaled.length();
        (length.to_f64() > 0.0).then(|| scaled.times(DoubleDouble::from_f64(1.0).div(length)))
    }

    /// The power of two of the largest component; none for the zero vector.
    pub(crate) fn exponent(self) -> Option<i32> {
        let largest = self.to_vec().abs().max_element();
        (largest > 0.0).then(|| libm::ilogb(largest))
    }

    /// Scaled by a power of two so that its largest component is in [1, 2].
    pub(crate) fn normal_sized(self) -> Self {
        self.exponent().map_or(self, |exponent| self.scaled(-exponent))
    }
}

/// a × b, each component within 1.5 ulp (Kahan's difference of products).
pub(crate) fn cross(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::new(
        difference_of_products(a.y, b.z, a.z, b.y),
        difference_of_products(a.z, b.x, a.x, b.z),
        difference_of_products(a.x, b.y, a.y, b.x),
    )
}

/// The length, without overflow or underflow of the squares.
pub(crate) fn length(vector: DVec3) -> f64 {
    libm::hypot(libm::hypot(vector.x, vector.y), vector.z)
}

/// The exponent of the unit of length in which the largest of these coordinates is in [1, 2); 0
/// if they are all zero.
pub(crate) fn unit_exponent(coordinates: impl IntoIterator<Item = f64>) -> i32 {
    let largest = coordinates.into_iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    if largest == 0.0 { 0 } else { libm::ilogb(largest) }
}

/// The vector in units of two to the power.
pub(crate) fn in_units(vector: DVec3, exponent: i32) -> DVec3 {
    DVec3::from_array(vector.to_array().map(|value| scaled(value, -exponent)))
}
