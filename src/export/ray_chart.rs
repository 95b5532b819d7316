//! How files name rays in each chart: which columns, and what of them is an angle of which range.
//! Knows no values and no fit.

use super::RayColumns;

/// In which chart a file's rays are.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum RayChart {
    /// `x_mm`, `y_mm`, `theta_deg`, `phi_deg`: where a ray leaves the sample, and where to.
    #[default]
    Surface,
    /// The same names: the place on the plane across the ray through the origin, θ to 180°.
    Perpendicular,
    /// `theta_deg`, `phi_deg`: towards where the light comes from, θ to 180°.
    Environment,
    /// `u_mm`, `v_mm` in z = 0 and `s_mm`, `t_mm` in z = distance; or the surface chart's columns.
    TwoPlane {
        /// Between the planes, m.
        distance_m: f64,
    },
}

/// A ray with the numbers that its file names it by.
#[derive(Debug, Clone, PartialEq)]
pub struct ListedRay {
    /// In the order of the columns.
    pub numbers: Vec<f64>,
    /// In the units of the program.
    pub ray: fit::Ray,
}

impl RayChart {
    /// The columns that a ray takes.
    pub const fn names(self) -> &'static [&'static str] {
        match self {
            Self::Surface | Self::Perpendicular => &RayColumns::NAMES,
            Self::Environment => &["theta_deg", "phi_deg"],
            Self::TwoPlane { .. } => &["u_mm", "v_mm", "s_mm", "t_mm"],
        }
    }

    /// Whether directions go all round.
    pub const fn is_all_round(self) -> bool {
        matches!(self, Self::Perpendicular | Self::Environment)
    }

    /// The largest θ in its columns, degrees.
    pub(super) const fn theta_end_deg(self) -> f64 {
        match self {
            Self::Surface | Self::TwoPlane { .. } => 90.0,
            Self::Perpendicular | Self::Environment => 180.0,
        }
    }

    /// What θ has to be.
    pub(super) const fn theta_expected(self) -> &'static str {
        match self {
            Self::Surface => {
                "an angle in [0, 90] (to 180 with --chart perpendicular or --chart environment)"
            }
            Self::TwoPlane { .. } => "an angle in [0, 90]",
            Self::Perpendicular | Self::Environment => "an angle in [0, 180]",
        }
    }

    /// The ray from (u, v) through (s, t), as the surface chart names it.
    pub(super) fn between(distance_m: f64, [u_mm, v_mm, s_mm, t_mm]: [f64; 4]) -> RayColumns {
        let metres = |a: f64, b: f64| (a * 1e-3, b * 1e-3);
        let ray = fit::Ray::between(metres(u_mm, v_mm), metres(s_mm, t_mm), distance_m);
        RayColumns {
            x_mm: u_mm,
            y_mm: v_mm,
            theta_deg: ray.theta_rad.to_degrees(),
            phi_deg: ray.phi_rad.to_degrees(),
        }
    }
}
