//! The part of a patch between two parallels and two meridians that a tilted receiver sees, and what it
//! contributes to the irradiance. It knows no radiance.
//!
//! With α the receiver's tilt from +z, at most a right angle, and ψ the azimuth from the direction of the
//! tilt, the horizon lies at `θ_h(ψ)` = atan2(cos α, -sin α cos ψ), and above it is what has θ < `θ_h`. The
//! projected solid angle ½ ∮ n·(ω × dω) of a spherical patch (Arvo 1995, *Applications of irradiance
//! tensors*, eq. 4) is elementary along meridians, parallels and the horizon: the integral needs no
//! quadrature.

use glam::DVec3;

use crate::direction::normalised;
use crate::domain::{DomainError, finite_vector};
use crate::error_free::difference_of_products;

/// Rounding of a patch's projected solid angle, in units of 2⁻⁵² of the size of its terms.
const ULPS: f64 = 8.0;

/// An angle by its sine and cosine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Turn {
    pub(super) sin: f64,
    pub(super) cos: f64,
}

impl Turn {
    pub(super) fn of(angle: f64) -> Self {
        let (sin, cos) = libm::sincos(angle);
        Self { sin, cos }
    }

    /// Less another angle.
    fn less(self, other: Self) -> Self {
        Self {
            sin: self.sin * other.cos - self.cos * other.sin,
            cos: self.cos * other.cos + self.sin * other.sin,
        }
    }

    /// sin of the angle from here to another.
    fn sin_to(self, other: Self) -> f64 {
        difference_of_products(other.sin, self.cos, other.cos, self.sin)
    }

    /// The angle from here to another, in (-π, π].
    fn to(self, other: Self) -> f64 {
        libm::atan2(self.sin_to(other), self.cos * other.cos + self.sin * other.sin)
    }
}

/// A ring between two parallels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ring {
    /// The parallel nearer to the pole θ = 0.
    pub(super) top: Turn,
    pub(super) bottom: Turn,
    /// ∫ sin² θ dθ.
    pub(super) across: f64,
    /// ∫ sin θ cos θ dθ.
    pub(super) along: f64,
}

/// A projected solid angle with a bound of its error.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    pub(super) sr: f64,
    pub(super) error_bound: f64,
}

/// The horizon of a receiver, in the half of all tilts that the mirror at z = 0 leaves.
#[derive(Debug, Clone, Copy)]
pub(super) struct Horizon {
    /// The receiver's, of length 1.
    pub(super) normal: DVec3,
    tilt: Turn,
    /// The azimuth of the tilt.
    heading: Turn,
    /// The normal has z < 0: what is said here is said of its mirror image.
    pub(super) is_mirrored: bool,
}

impl Horizon {
    pub(super) fn of(normal: DVec3) -> Result<Self, DomainError> {
        let given = finite_vector("normal", normal)?;
        let normal = normalised(given).ok_or(DomainError::ZeroVector { argument: "normal" })?;
        let across = libm::hypot(normal.x, normal.y);
        let heading = if across > 0.0 {
            Turn { sin: normal.y / across, cos: normal.x / across }
        } else {
            Turn { sin: 0.0, cos: 1.0 }
        };
        Ok(Self {
            normal,
            tilt: Turn { sin: across, cos: normal.z.abs() },
            heading,
            is_mirrored: normal.z < 0.0,
        })
    }

    /// An azimuth φ as ψ, from the direction of the tilt.
    pub(super) fn azimuth(&self, phi: Turn) -> Turn {
        phi.less(self.heading)
    }

    /// The least and the greatest θ at which the horizon crosses the meridians between two azimuths
    /// at most a right angle apart.
    pub(super) fn between(&self, from: Turn, to: Turn) -> (f64, f64) {
        let at = |cos: f64| libm::atan2(self.tilt.cos, -self.tilt.sin * cos);
        let passes_tilt = from.sin <= 0.0 && to.sin >= 0.0 && from.cos > 0.0;
        let passes_back = from.sin >= 0.0 && to.sin <= 0.0 && from.cos < 0.0;
        let least = if passes_back { -1.0 } else { from.cos.min(to.cos) };
        let greatest = if passes_tilt { 1.0 } else { from.cos.max(to.cos) };
        (at(least), at(greatest))
    }

    /// cos of the angle between the normal and a direction; above the horizon where positive.
    fn elevation(&self, theta: Turn, psi_cos: f64) -> f64 {
        let (sideways, upright) = (self.tilt.sin * psi_cos, self.tilt.cos);
        difference_of_products(upright, theta.cos, -sideways, theta.sin)
    }

    /// The visible part of a ring between two azimuths at most a right angle apart.
    pub(super) fn visible(&self, ring: &Ring, from: Turn, to: Turn) -> Seen {
        let mut turns = [from; 6];
        let mut count = 1;
        for edge in [ring.top, ring.bottom] {
            for crossing in self.crossings(edge).into_iter().flatten() {
                if from.sin_to(crossing) > 0.0 && crossing.sin_to(to) > 0.0 {
                    turns[count] = crossing;
                    count += 1;
                }
            }
        }
        turns[1..count].sort_by(|p, q| from.sin_to(*p).total_cmp(&from.sin_to(*q)));
        turns[count] = to;
        let (mut sr, mut size) = (0.0, 0.0);
        for pair in turns[..=count].windows(2) {
            let (part, its_size) = self.piece(ring, pair[0], pair[1]);
            sr += part;
            size += its_size;
        }
        Seen { sr: sr.max(0.0), error_bound: ULPS * f64::EPSILON * size }
    }

    /// Where the horizon crosses a parallel: cos ψ = -cot θ cot α.
    fn crossings(&self, edge: Turn) -> [Option<Turn>; 2] {
        let (top, bottom) = (-edge.cos * self.tilt.cos, edge.sin * self.tilt.sin);
        if bottom <= 0.0 || top.abs() > bottom {
            return [None, None];
        }
        let cos = top / bottom;
        let sin = ((1.0 - cos) * (1.0 + cos)).sqrt();
        [Some(Turn { sin, cos }), Some(Turn { sin: -sin, cos })]
    }

    /// Between azimuths among which the horizon crosses neither parallel: all of the ring, none of it,
    /// or from the upper parallel to the horizon. Beside it the size of the terms.
    fn piece(&self, ring: &Ring, from: Turn, to: Turn) -> (f64, f64) {
        let middle = (from.cos + to.cos) / libm::hypot(from.cos + to.cos, from.sin + to.sin);
        let elevation = self.elevation(ring.top, middle);
        // A pole on the horizon has no elevation, and what lies below it may be above the horizon.
        let sets = self.falling(ring.top, middle) >= 0.0;
        if elevation < 0.0 || (elevation == 0.0 && sets) {
            return (0.0, 0.0);
        }
        let width = from.to(to);
        let chord = to.sin - from.sin;
        if self.elevation(ring.bottom, middle) >= 0.0 {
            let (across, along) = (self.tilt.sin * ring.across, self.tilt.cos * ring.along);
            return (across * chord + along * width, ring.across + ring.along.abs() * width);
        }
        let (top, tilt) = (ring.top, self.tilt);
        let down_from = self.down_to_horizon(top, from);
        let down_to = self.down_to_horizon(top, to);
        let arc = libm::atan2(
            tilt.cos * from.sin_to(to),
            from.cos * to.cos + tilt.cos * tilt.cos * (from.sin * to.sin),
        );
        let meridians = tilt.sin * (down_to * to.sin - down_from * from.sin);
        let parallel = top.sin * (tilt.sin * top.cos * chord - tilt.cos * top.sin * width);
        let size = down_from.abs() + down_to.abs() + arc + width;
        (0.5 * (meridians + arc + parallel), size)
    }

    /// How fast the elevation falls with θ on a meridian.
    fn falling(&self, theta: Turn, psi_cos: f64) -> f64 {
        let sideways = self.tilt.sin * psi_cos;
        difference_of_products(self.tilt.cos, theta.sin, sideways, theta.cos)
    }

    /// `θ_h` - θ on a meridian.
    fn down_to_horizon(&self, theta: Turn, psi: Turn) -> f64 {
        libm::atan2(self.elevation(theta, psi.cos), self.falling(theta, psi.cos))
    }
}
