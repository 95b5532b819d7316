//! The pixels of an equal-area map folded into one eighth of the sphere, and what of them is above a
//! horizon. Between curves φ = πb/2r, with dω = 2r dr dφ, the integral over φ is elementary. It does
//! not know what is integrated to which tolerance.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

/// A pixel by its place in its quadrant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pixel {
    pub(super) sign_x: f64,
    pub(super) sign_y: f64,
    /// Of a = |u|, from 0.
    pub(super) i: usize,
    /// Of b = |v|, from 0.
    pub(super) j: usize,
    pub(super) radiance: f64,
}

/// Half of a pixel, between a parallel and two curves φ = πb/2r, folded up: along t in [0, 1/half] it is t
/// wide in b.
#[derive(Debug, Clone, Copy)]
pub(super) struct Triangle {
    /// At t = 0, where it begins or ends in a point.
    r: f64,
    /// b at that point.
    b: f64,
    /// Away from the pole with t, or towards it.
    is_growing: bool,
    /// In the hemisphere z < 0.
    is_lower: bool,
}

impl Pixel {
    pub(super) fn new(row: usize, column: usize, half: usize, radiance: f64) -> Self {
        let fold = |index: usize| {
            if index >= half { (1.0, index - half) } else { (-1.0, half - 1 - index) }
        };
        let ((sign_x, i), (sign_y, j)) = (fold(column), fold(row));
        Self { sign_x, sign_y, i, j, radiance }
    }

    /// A normal, folded as the pixel.
    pub(super) fn folded(&self, normal: DVec3) -> DVec3 {
        DVec3::new(normal.x * self.sign_x, normal.y * self.sign_y, normal.z)
    }

    /// The direction of its middle.
    pub(super) fn middle(&self, half: usize) -> DVec3 {
        let at = |index: usize| (index as f64 + 0.5) / half as f64;
        let (a, b) = (at(self.i), at(self.j));
        let is_lower = self.i + self.j + 1 > half;
        let (r, difference) = (if is_lower { 2.0 - a - b } else { a + b }, b - a);
        let (sin, cos) = libm::sincos(0.5 * FRAC_PI_2 * (1.0 + difference / r));
        let across = r * (2.0 - r * r).sqrt();
        let height = 1.0 - r * r;
        DVec3::new(
            self.sign_x * across * cos,
            self.sign_y * across * sin,
            if is_lower { -height } else { height },
        )
    }

    /// Its two halves on either side of its diagonal a + b.
    pub(super) fn triangles(&self, half: usize) -> [Triangle; 2] {
        let on = |index: usize| index as f64 / half as f64;
        let upper = self.i + self.j < half;
        // One that the equator halves has two like halves.
        let is_halved = self.i + self.j + 1 == half;
        let (i, j) = if upper { (self.i, self.j) } else { (half - 1 - self.j, half - 1 - self.i) };
        let nearer = Triangle { r: on(i + j), b: on(j), is_growing: true, is_lower: !upper };
        let farther = if is_halved {
            Triangle { is_lower: true, ..nearer }
        } else {
            Triangle { r: on(i + j + 2), b: on(j + 1), is_growing: false, is_lower: !upper }
        };
        [nearer, farther]
    }
}

impl Triangle {
    /// r, and the azimuths of the ends, at t.
    fn at(&self, t: f64) -> (f64, [f64; 2]) {
        if self.is_growing {
            let r = self.r + t;
            // From b to where a is what it was.
            (r, [FRAC_PI_2 * (self.b / r), FRAC_PI_2 * ((self.b + t) / r)])
        } else {
            let r = self.r - t;
            (r, [FRAC_PI_2 * ((self.b - t) / r), FRAC_PI_2 * (self.b / r)])
        }
    }

    /// 2r ∫ max(0, n·ω) dφ at t, with what rounding may make of it; the normal folded as the pixel.
    pub(super) fn visible(&self, t: f64, normal: DVec3) -> (f64, f64) {
        let (r, [from, to]) = self.at(t);
        let height = 1.0 - r * r;
        let upright = normal.z * if self.is_lower { -height } else { height };
        let sideways = libm::hypot(normal.x, normal.y) * r * (2.0 - r * r).sqrt();
        let heading = libm::atan2(normal.y, normal.x);
        // The horizon is at ±width from the heading.
        let width = if upright >= sideways {
            PI
        } else if upright <= -sideways {
            0.0
        } else {
            libm::acos(-upright / sideways)
        };
        let mut value = 0.0;
        for heading in [heading - TAU, heading, heading + TAU] {
            let (low, high) = (from.max(heading - width), to.min(heading + width));
            if low < high {
                let half = 0.5 * (high - low);
                let middle = libm::cos(f64::midpoint(low, high) - heading);
                value += 2.0 * (sideways * middle * libm::sin(half) + upright * half);
            }
        }
        // An angle is off by some ulp of a turn, where the integrand is at most 1.
        (2.0 * r * value.max(0.0), 2.0 * r * 16.0 * f64::EPSILON * (to - from))
    }

    /// Where the horizon crosses an edge or touches a parallel: there the integrand over t has kinks.
    pub(super) fn breaks(&self, normal: DVec3, end: f64, points: &mut Vec<f64>) {
        /// A curve this short crosses the horizon once or twice.
        const LOOKS: u32 = 8;
        let touching = (1.0 - libm::hypot(normal.x, normal.y)).max(0.0).sqrt();
        let touches = if self.is_growing { touching - self.r } else { self.r - touching };
        points.extend(Some(touches).filter(|t| (0.0..end).contains(t)));
        for edge in [0, 1] {
            let elevation = |t: f64| {
                let (r, azimuths) = self.at(t);
                let (sin, cos) = libm::sincos(azimuths[edge]);
                let height = if self.is_lower { r * r - 1.0 } else { 1.0 - r * r };
                (normal.x * cos + normal.y * sin) * r * (2.0 - r * r).sqrt() + normal.z * height
            };
            // The pole itself has no azimuth.
            let look = |k: u32| end * (f64::from(k) / f64::from(LOOKS)).max(1e-12);
            let mut from = (look(0), elevation(look(0)));
            for k in 1..=LOOKS {
                let to = (look(k), elevation(look(k)));
                if from.1 * to.1 < 0.0 {
                    points.push(root(from, to, 0.0, &elevation));
                }
                from = to;
            }
        }
    }

    /// ∫ ω dφ 2r at t, folded up.
    pub(super) fn moment(&self, t: f64) -> DVec3 {
        let (r, [from, to]) = self.at(t);
        let half = 0.5 * FRAC_PI_2 * (t / r);
        let (sin, cos) = libm::sincos(f64::midpoint(from, to));
        let across = r * (2.0 - r * r).sqrt() * 2.0 * libm::sin(half);
        let height = if self.is_lower { r * r - 1.0 } else { 1.0 - r * r };
        2.0 * r * DVec3::new(across * cos, across * sin, height * 2.0 * half)
    }
}

/// Where a function between two places of opposite sign is zero, or no farther from it than is enough:
/// false position with the Illinois correction (Dowell and Jarratt 1971).
pub(super) fn root(
    mut from: (f64, f64),
    mut to: (f64, f64),
    enough: f64,
    f: &impl Fn(f64) -> f64,
) -> f64 {
    const STEPS: u32 = 60;
    for _ in 0..STEPS {
        let t = (from.0 * to.1 - to.0 * from.1) / (to.1 - from.1);
        let at = (t, f(t));
        if at.1.abs() <= enough || (to.0 - from.0).abs() <= 4.0 * f64::EPSILON * t.abs() {
            return t;
        }
        if at.1 * to.1 < 0.0 {
            from = to;
        } else {
            from.1 *= 0.5;
        }
        to = at;
    }
    to.0
}
