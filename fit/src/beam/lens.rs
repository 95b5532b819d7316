//! Rays of one direction through a beam's two disks cross the stop in a lens: what the stop and
//! the pupil, shifted against it, have in common. Its area is the direction's weight, its points
//! are where on the stop such rays pass. Lengths in metres; it knows no sample.

use std::f64::consts::{FRAC_PI_2, PI};

use radiometry::beam::disk_rule;
use radiometry::quadrature::gauss_legendre;

/// Chords of each of a lens's two parts.
const CHORDS: usize = 6;

/// The disk of radius `stop` about the origin and that of radius `pupil` about (-`shift`, 0).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lens {
    pub(crate) stop: f64,
    pub(crate) pupil: f64,
    pub(crate) shift: f64,
}

/// A place on the stop, along the shift and across it, and its part of the lens.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    pub(crate) along: f64,
    pub(crate) across: f64,
    pub(crate) weight: f64,
}

/// The part of a circle to one side of a line.
fn segment(radius: f64, angle: f64) -> f64 {
    // From the pole to the chord at the angle ψ: ∫ 2 r² cos² ψ dψ from -π/2.
    let (sin, cos) = libm::sincos(angle);
    radius * radius * (angle + FRAC_PI_2 + sin * cos)
}

impl Lens {
    /// A rectangle that holds it, with the shift turned by this angle: its lower and upper corner.
    pub(crate) fn box_of(&self, cos: f64, sin: f64) -> ((f64, f64), (f64, f64)) {
        let side =
            |shift: f64| ((-self.stop).max(-shift - self.pupil), self.stop.min(self.pupil - shift));
        let (x, y) = (side(self.shift * cos), side(self.shift * sin));
        ((x.0, y.0), (x.1, y.1))
    }

    /// The lens's area, m².
    pub(crate) fn area(&self) -> f64 {
        match self.parts() {
            Parts::None => 0.0,
            Parts::Whole { radius, .. } => PI * radius * radius,
            Parts::Two { stop_angle, pupil_angle } => {
                segment(self.stop, stop_angle) + segment(self.pupil, -pupil_angle)
            }
        }
    }

    /// Places and weights (that sum to one) whose mean is exact for polynomials of this degree in
    /// the place; to 1e-9 where the lens is not a whole disk.
    pub(crate) fn rule(&self, degree: usize) -> Vec<Place> {
        match self.parts() {
            Parts::None => Vec::new(),
            Parts::Whole { radius, centre } => {
                let disk = disk_rule(degree).into_iter();
                let place = |(node, weight): (glam::DVec2, f64)| Place {
                    along: centre + radius * node.x,
                    across: radius * node.y,
                    weight,
                };
                disk.map(place).collect()
            }
            Parts::Two { stop_angle, pupil_angle } => {
                if degree <= 1 {
                    let beyond = segment(self.pupil, -pupil_angle);
                    let along = -self.shift * beyond / self.area();
                    return vec![Place { along, across: 0.0, weight: 1.0 }];
                }
                self.chords(degree, stop_angle, pupil_angle)
            }
        }
    }

    fn chords(&self, degree: usize, stop_angle: f64, pupil_angle: f64) -> Vec<Place> {
        let across = gauss_legendre(degree / 2 + 1);
        let mut places = Vec::new();
        let arcs = [
            (self.stop, 0.0, -FRAC_PI_2, stop_angle),
            (self.pupil, -self.shift, pupil_angle, FRAC_PI_2),
        ];
        for (radius, centre, from, to) in arcs {
            let (middle, half) = (f64::midpoint(from, to), (to - from) / 2.0);
            for (node, weight) in gauss_legendre(CHORDS + degree / 2) {
                let (sin, cos) = libm::sincos(middle + half * node);
                let chord = weight * half * radius * radius * cos * cos;
                places.extend(across.iter().map(|(t, part)| Place {
                    along: centre + radius * sin,
                    across: radius * cos * t,
                    weight: chord * part,
                }));
            }
        }
        let sum: f64 = places.iter().map(|place| place.weight).sum();
        for place in &mut places {
            place.weight /= sum;
        }
        places
    }

    fn parts(&self) -> Parts {
        let Self { stop, pupil, shift } = *self;
        if shift >= stop + pupil {
            return Parts::None;
        }
        if shift <= (stop - pupil).abs() {
            let is_stop = stop <= pupil;
            let (radius, centre) = if is_stop { (stop, 0.0) } else { (pupil, -shift) };
            return Parts::Whole { radius, centre };
        }
        // Where the circles meet.
        let at = ((pupil - stop) * (pupil + stop) - shift * shift) / (2.0 * shift);
        let angle = |at: f64, radius: f64| libm::asin((at / radius).clamp(-1.0, 1.0));
        Parts::Two { stop_angle: angle(at, stop), pupil_angle: angle(at + shift, pupil) }
    }
}

/// What a lens is made of.
enum Parts {
    None,
    /// One disk lies in the other.
    Whole {
        radius: f64,
        centre: f64,
    },
    /// The stop's circle to an angle, the pupil's from an angle on; as sines of places along.
    Two {
        stop_angle: f64,
        pupil_angle: f64,
    },
}
