//! What is wrong with all samples at once: a responsivity, a dark level, an axis zero. Such a
//! component doesn't average out, so that it is kept from the weights and carried through the fit
//! afterwards.

use crate::Ray;
use radiometry::beam::Beam;
use std::fmt;

/// A source of uncertainty that all samples share. Components are independent of each other.
pub struct Common {
    /// What it is, as a budget's row names it. Of a name such as `theta readback @ 16°` the row has
    /// what stands before the @: components that differ by a place alone share a row.
    pub name: String,
    /// Its standard uncertainty: relative for [`Shift::Scale`] and [`Shift::Beam`], in the value's unit for
    /// [`Shift::Offset`]. For the others it informs only: they are handed a shift by one u.
    pub u: f64,
    /// What being off by one u does to the samples.
    pub shift: Shift,
}

/// What a common component, being off by one u, does to the samples.
pub enum Shift {
    /// All values are too large by the same factor 1 + u.
    Scale,
    /// All values are too large by u.
    Offset,
    /// The ray that was really seen, from the sample's index and the ray it is taken for.
    Ray(RayShift),
    /// As [`Shift::Ray`], but each sample is off by a draw of its own: what an encoder is off by at a
    /// position where no other sample was taken. It shifts nothing in common; it adds to the variance of
    /// each sample, by how much the fitted field changes from one ray to the other.
    Jitter(RayShift),
    /// The beam that was really seen through. Values are too large by the factor 1 + u, by which its
    /// throughput is larger than that of the beam they are taken for, and each is the mean over
    /// another footprint. Without optics the factor is all.
    Beam(Beam),
    /// By how much the value is too large, from the sample's index and its fitted level. For what
    /// holds for some samples alone, such as one gain range's factor.
    Value(ValueShift),
}

impl Shift {
    /// Whether samples share it, so that it does not average away.
    pub fn is_shared(&self) -> bool {
        !matches!(self, Self::Jitter(_))
    }
}

/// From a sample's index and the ray that it is taken for to the ray that was really seen.
pub type RayShift = Box<dyn Fn(usize, &Ray) -> Ray + Send + Sync>;
/// From a sample's index and its fitted level to the excess of its value.
pub type ValueShift = Box<dyn Fn(usize, f64) -> f64 + Send + Sync>;

impl fmt::Debug for Common {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Common {{ name: {:?}, u: {}, shift: {:?} }}", self.name, self.u, self.shift)
    }
}

impl fmt::Debug for Shift {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Scale => "Scale",
            Self::Offset => "Offset",
            Self::Ray(_) => "Ray(..)",
            Self::Jitter(_) => "Jitter(..)",
            Self::Beam(_) => "Beam(..)",
            Self::Value(_) => "Value(..)",
        })
    }
}
