//! Quantities of rays alone: areas, angles, throughput. They do not know how light is counted.

quantity!(
    /// Area of a surface, A, m².
    Area, "m²", from_m2, m2
);
quantity!(
    /// Form factor, F₁₂, 1: the part of the flux leaving a diffuse surface 1 that reaches 2.
    FormFactor, "(form factor)", from_ratio, ratio
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
    /// Solid angle, Ω, sr; 2π for a hemisphere.
    SolidAngle, "sr", from_sr, sr
);
quantity!(
    /// Throughput (étendue), T = ∬ cos θ dω dA, m²·sr: the measure of a set of rays.
    Throughput, "m²·sr", from_m2_sr, m2_sr
);

product!([] Area, ProjectedSolidAngle => Throughput);
quotient!([] Throughput, Area => ProjectedSolidAngle);
quotient!([] Throughput, ProjectedSolidAngle => Area);
product!([] ProjectedArea, SolidAngle => Throughput);
quotient!([] Throughput, ProjectedArea => SolidAngle);
quotient!([] Throughput, SolidAngle => ProjectedArea);

impl ProjectedSolidAngle {
    /// The whole hemisphere's: π sr. Times a diffuse surface's radiance it is the exitance.
    pub const HEMISPHERE: Self = Self(core::f64::consts::PI);
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
