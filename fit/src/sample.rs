//! What goes into a fit: rays, the values seen along them, and the region that they stand for.
//! Knows nothing of rigs, counts or files.

/// A ray in the surface chart: where it leaves the sample and in which direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where the ray leaves the sample, metres.
    pub x_m: f64,
    /// Where the ray leaves the sample, metres.
    pub y_m: f64,
    /// From the sample's normal, radians, in [0, π/2].
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

/// What the fit stands for: a rectangle on the sample, and the cone that was to be measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// From and to, metres. Equal ends stand for a single position.
    pub x_m: (f64, f64),
    /// From and to, metres. Equal ends stand for a single position.
    pub y_m: (f64, f64),
    /// The cone's half angle, radians, in (0, π/2].
    pub theta_max_rad: f64,
}

impl Region {
    /// The rectangle's area, m².
    pub fn area_m2(&self) -> f64 {
        (self.x_m.1 - self.x_m.0) * (self.y_m.1 - self.y_m.0)
    }

    /// Whether the ends are finite and in order, and the cone within the hemisphere.
    pub(crate) fn is_sound(&self) -> bool {
        let in_order = |(from, to): (f64, f64)| from.is_finite() && to.is_finite() && from <= to;
        in_order(self.x_m)
            && in_order(self.y_m)
            && self.theta_max_rad > 0.0
            && self.theta_max_rad <= HORIZON_RAD
    }

    /// How far outside the rectangle a measured position may lie, metres: a readback is never
    /// exactly the position asked for, and a polynomial bears that much.
    pub(crate) fn margin_m(&self) -> f64 {
        let half_width_m = 0.5 * (self.x_m.1 - self.x_m.0).max(self.y_m.1 - self.y_m.0);
        if half_width_m > 0.0 { MARGIN_RELATIVE * half_width_m } else { MARGIN_OF_A_POINT_M }
    }

    /// Whether the position lies in the rectangle, or within its margin.
    pub(crate) fn holds(&self, ray: &Ray) -> bool {
        let margin_m = self.margin_m();
        let within = |t: f64, (from, to): (f64, f64)| t >= from - margin_m && t <= to + margin_m;
        within(ray.x_m, self.x_m) && within(ray.y_m, self.y_m)
    }

    /// The position in the rectangle mapped to [-1, 1]²; 0 along a side without length.
    pub(crate) fn scaled(&self, ray: &Ray) -> (f64, f64) {
        (scale(ray.x_m, self.x_m), scale(ray.y_m, self.y_m))
    }
}

fn scale(t: f64, (from, to): (f64, f64)) -> f64 {
    let half_width = 0.5 * (to - from);
    if half_width > 0.0 { (t - 0.5 * (from + to)) / half_width } else { 0.0 }
}

/// The largest angle from the normal, radians, with room for a conversion's rounding.
pub(crate) const HORIZON_RAD: f64 = std::f64::consts::FRAC_PI_2 + 1e-9;
/// Share of the larger half width. A Legendre polynomial of degree 4 grows by a third over it.
const MARGIN_RELATIVE: f64 = 0.02;
/// Where the region is one point: a tenth of a millimetre, what a stage's readback may be off.
const MARGIN_OF_A_POINT_M: f64 = 1e-4;
