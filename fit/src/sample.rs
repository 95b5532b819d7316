//! What goes into a fit: rays, the values seen along them, and the region that they stand for.
//! Knows nothing of rigs, counts or files.

use crate::{Chart, Face};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

/// A ray by its place and its direction: in the surface chart where it leaves the sample, in others
/// what [`Chart`] says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Its place, metres.
    pub x_m: f64,
    /// Its place, metres.
    pub y_m: f64,
    /// From the sample's normal +z, radians, in [0, π/2], or over the whole sphere to π.
    pub theta_rad: f64,
    /// From +x towards +y, radians, any turn.
    pub phi_rad: f64,
}

/// A value (a radiance, or what stands for one) seen along a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// The ray as it is known to the host.
    pub ray: Ray,
    /// The value in the unit of the fit: W·m⁻²·sr⁻¹, cd·m⁻² or relative. Negative values (a dark
    /// reading subtracted from noise) are as good as others, and needed.
    pub value: f64,
    /// What is independent from sample to sample.
    pub noise: Noise,
}

/// The independent noise of one sample. What is common to all samples is a [`crate::Common`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Noise {
    /// A variance known beforehand.
    Fixed {
        /// In the value's unit squared, greater than 0.
        variance: f64,
    },
    /// A variance that grows with the level as shot noise does: `floor + per_radiance max(L, 0)`,
    /// L being the *fitted* level. Weights taken from the reading's own value would favour the
    /// readings that came out low.
    Modelled {
        /// Read noise and quantisation, in the value's unit squared, greater than 0.
        floor: f64,
        /// Shot noise, in the value's unit, 0 or more.
        per_radiance: f64,
    },
    /// Nothing is known: the scatter of the residuals tells, alike for all such samples.
    Unknown,
}

/// What the fit stands for: a rectangle of places, and the cone that was to be measured. There is
/// a constructor for each chart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// From and to, metres. Equal ends stand for a single position.
    pub x_m: (f64, f64),
    /// From and to, metres. Equal ends stand for a single position.
    pub y_m: (f64, f64),
    /// The cone's half angle about +z, radians, in (0, π/2], over the whole sphere to π. Between two
    /// planes the largest angle that both rectangles allow for.
    pub theta_max_rad: f64,
    /// In which coordinates all this is.
    pub chart: Chart,
}

impl Region {
    /// A rectangle on a flat sample, and the cone about its normal.
    pub const fn surface(x_m: (f64, f64), y_m: (f64, f64), theta_max_rad: f64) -> Self {
        Self { x_m, y_m, theta_max_rad, chart: Chart::Surface }
    }

    /// An object that lies within a sphere about the origin, seen to an angle from +z: π for all
    /// sides. Beyond the sphere nothing shines.
    ///
    /// ```
    /// let ball = fit::Region::object(0.1, std::f64::consts::PI);
    /// assert!((ball.area_m2() - std::f64::consts::PI * 0.01).abs() < 1e-15);
    /// ```
    pub const fn object(radius_m: f64, theta_max_rad: f64) -> Self {
        let side = (-radius_m, radius_m);
        let chart = Chart::Perpendicular { face: Face::Disk };
        Self { x_m: side, y_m: side, theta_max_rad, chart }
    }

    /// A rectangle of the plane across each direction, its sides along growing θ and φ.
    pub const fn perpendicular(x_m: (f64, f64), y_m: (f64, f64), theta_max_rad: f64) -> Self {
        Self { x_m, y_m, theta_max_rad, chart: Chart::Perpendicular { face: Face::Rectangle } }
    }

    /// What arrives at a point, to an angle from +z: π for all sides.
    pub const fn environment(theta_max_rad: f64) -> Self {
        let point = (0.0, 0.0);
        Self { x_m: point, y_m: point, theta_max_rad, chart: Chart::Environment }
    }

    /// A rectangle (u, v) in z = 0 and another one (s, t) in z = `distance_m`.
    pub fn two_plane(
        (u_m, v_m): ((f64, f64), (f64, f64)),
        (s_m, t_m): ((f64, f64), (f64, f64)),
        distance_m: f64,
    ) -> Self {
        let apart = |a: (f64, f64), b: (f64, f64)| (b.1 - a.0).abs().max((a.1 - b.0).abs());
        let across_m = libm::hypot(apart(u_m, s_m), apart(v_m, t_m));
        let theta_max_rad = libm::atan2(across_m, distance_m).clamp(f64::MIN_POSITIVE, FRAC_PI_2);
        let chart = Chart::TwoPlane { distance_m, s_m, t_m };
        Self { x_m: u_m, y_m: v_m, theta_max_rad, chart }
    }

    /// What its places fill, m²; 0 of a single position, or a line of them.
    pub fn area_m2(&self) -> f64 {
        let rectangle = (self.x_m.1 - self.x_m.0) * (self.y_m.1 - self.y_m.0);
        match self.chart {
            Chart::Perpendicular { face: Face::Disk } => FRAC_PI_4 * rectangle,
            _ => rectangle,
        }
    }

    /// Whether the ends are finite and in order, and the cone within what the chart names.
    pub(crate) fn is_sound(&self) -> bool {
        let in_order = |(from, to): (f64, f64)| from.is_finite() && to.is_finite() && from <= to;
        in_order(self.x_m)
            && in_order(self.y_m)
            && self.theta_max_rad > 0.0
            && self.theta_max_rad <= self.chart.theta_end_rad()
            && self.chart.is_sound()
    }

    /// How far outside the rectangle a measured position may lie, metres: a readback is never
    /// exactly the position asked for, and a polynomial bears that much.
    pub(crate) fn margin_m(&self) -> f64 {
        margin_m(self.x_m, self.y_m)
    }

    /// Where a ray that misses the second rectangle pierces its plane; `None` of one that doesn't,
    /// and where there is no such plane.
    pub(crate) fn missed_second_plane(&self, ray: &Ray) -> Option<(f64, f64)> {
        let Chart::TwoPlane { distance_m, s_m, t_m } = self.chart else { return None };
        let (s, t) = ray.beyond(distance_m);
        let margin_m = margin_m(s_m, t_m);
        let within = |at: f64, (from, to): (f64, f64)| at >= from - margin_m && at <= to + margin_m;
        (!within(s, s_m) || !within(t, t_m)).then_some((s, t))
    }

    /// Whether the position lies in the rectangle, or within its margin.
    pub(crate) fn holds(&self, ray: &Ray) -> bool {
        let margin_m = self.margin_m();
        let within = |t: f64, (from, to): (f64, f64)| t >= from - margin_m && t <= to + margin_m;
        let is_in_face = match self.chart {
            Chart::Perpendicular { face: Face::Disk } => {
                let radius_m = 0.5 * (self.x_m.1 - self.x_m.0);
                let (x, y) =
                    (f64::midpoint(self.x_m.0, self.x_m.1), f64::midpoint(self.y_m.0, self.y_m.1));
                libm::hypot(ray.x_m - x, ray.y_m - y) <= radius_m + margin_m
            }
            _ => true,
        };
        is_in_face && within(ray.x_m, self.x_m) && within(ray.y_m, self.y_m)
    }

    /// Whether something was to be measured along the ray: within the places, and the cone or the
    /// second rectangle.
    pub fn covers(&self, ray: &Ray) -> bool {
        self.holds(ray)
            && ray.theta_rad <= self.theta_max_rad + ROUNDING_RAD
            && self.missed_second_plane(ray).is_none()
    }

    /// The position in the rectangle mapped to [-1, 1]²; 0 along a side without length.
    pub(crate) fn scaled(&self, ray: &Ray) -> (f64, f64) {
        (scale(ray.x_m, self.x_m), scale(ray.y_m, self.y_m))
    }
}

impl Ray {
    /// The ray from (u, v) in z = 0 through (s, t) in z = `distance_m`, above 0.
    pub fn between((u_m, v_m): (f64, f64), (s_m, t_m): (f64, f64), distance_m: f64) -> Self {
        let (x, y) = (s_m - u_m, t_m - v_m);
        Self {
            x_m: u_m,
            y_m: v_m,
            theta_rad: libm::atan2(libm::hypot(x, y), distance_m),
            phi_rad: libm::atan2(y, x),
        }
    }

    /// Where it pierces the plane z = `distance_m`, metres; very far off along the plane.
    pub fn beyond(&self, distance_m: f64) -> (f64, f64) {
        let across_m = distance_m * libm::tan(self.theta_rad);
        let (sin, cos) = libm::sincos(self.phi_rad);
        (self.x_m + across_m * cos, self.y_m + across_m * sin)
    }
}

/// Of a rectangle.
fn margin_m(x_m: (f64, f64), y_m: (f64, f64)) -> f64 {
    let half_width_m = 0.5 * (x_m.1 - x_m.0).max(y_m.1 - y_m.0);
    if half_width_m > 0.0 { MARGIN_RELATIVE * half_width_m } else { MARGIN_OF_A_POINT_M }
}

fn scale(t: f64, (from, to): (f64, f64)) -> f64 {
    let half_width = 0.5 * (to - from);
    if half_width > 0.0 { (t - 0.5 * (from + to)) / half_width } else { 0.0 }
}

/// The largest angle from the normal, radians, with room for a conversion's rounding.
pub(crate) const HORIZON_RAD: f64 = std::f64::consts::FRAC_PI_2 + 1e-9;
/// An angle's rounding.
const ROUNDING_RAD: f64 = 1e-9;
/// Share of the larger half width. A Legendre polynomial of degree 4 grows by a third over it.
const MARGIN_RELATIVE: f64 = 0.02;
/// Where the region is one point: a tenth of a millimetre, what a stage's readback may be off.
const MARGIN_OF_A_POINT_M: f64 = 1e-4;
