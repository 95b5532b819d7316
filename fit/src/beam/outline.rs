//! Where the sample ends: beyond its outline its radiance is zero.

use crate::FitError;

/// The sample's extent on its plane. Both are convex, so that a line is in them over one interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outline {
    /// Sides along the axes.
    Rectangle {
        /// From and to, metres.
        x_m: (f64, f64),
        /// From and to, metres.
        y_m: (f64, f64),
    },
    /// A round one.
    Disk {
        /// Of its middle, metres.
        centre_m: (f64, f64),
        /// Metres, above 0.
        radius_m: f64,
    },
}

impl Outline {
    /// Whether its numbers are finite and it has an area.
    pub(crate) fn check(&self) -> Result<(), FitError> {
        let is_sound = match *self {
            Self::Rectangle { x_m, y_m } => {
                let in_order =
                    |(from, to): (f64, f64)| from.is_finite() && to.is_finite() && from < to;
                in_order(x_m) && in_order(y_m)
            }
            Self::Disk { centre_m, radius_m } => {
                centre_m.0.is_finite()
                    && centre_m.1.is_finite()
                    && radius_m.is_finite()
                    && radius_m > 0.0
            }
        };
        if is_sound { Ok(()) } else { Err(FitError::Outline) }
    }

    /// Whether the place is on the sample.
    pub fn holds(&self, x: f64, y: f64) -> bool {
        match *self {
            Self::Rectangle { x_m, y_m } => x >= x_m.0 && x <= x_m.1 && y >= y_m.0 && y <= y_m.1,
            Self::Disk { centre_m, radius_m } => {
                libm::hypot(x - centre_m.0, y - centre_m.1) <= radius_m
            }
        }
    }

    /// Whether none of the convex hull of these places is on it, as far as its bounding box tells.
    pub(crate) fn misses(&self, places: &[(f64, f64)]) -> bool {
        let (x_m, y_m) = match *self {
            Self::Rectangle { x_m, y_m } => (x_m, y_m),
            Self::Disk { centre_m: (x, y), radius_m: r } => ((x - r, x + r), (y - r, y + r)),
        };
        let all = |beyond: &dyn Fn((f64, f64)) -> bool| places.iter().all(|place| beyond(*place));
        all(&|(x, _)| x < x_m.0)
            || all(&|(x, _)| x > x_m.1)
            || all(&|(_, y)| y < y_m.0)
            || all(&|(_, y)| y > y_m.1)
    }
}
