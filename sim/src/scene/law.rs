//! How radiance goes with direction, for a level of one: its value, its integral over the
//! projected hemisphere and its largest value, each in closed form.

use core::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

use super::Tabulated;

/// An angular law, for a level of one.
#[derive(Debug, Clone, PartialEq)]
pub enum Law {
    /// L(θ) = cosⁿ θ.
    CosinePower {
        /// n, at least 0.
        exponent: f64,
    },
    /// L = 1.
    Lambertian,
    /// L = I(C, γ) / cos θ, with γ = θ and C = -φ; the level is one over the opening's area.
    Tabulated(Tabulated),
}

impl Law {
    /// What scene.toml calls it.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::CosinePower { .. } => "cosine-power",
            Self::Lambertian => "lambertian",
            Self::Tabulated(_) => "photometric-file",
        }
    }

    pub(super) fn radiance(&self, theta_rad: f64, phi_rad: f64) -> f64 {
        if theta_rad >= FRAC_PI_2 {
            return 0.0;
        }
        match self {
            Self::CosinePower { exponent } => libm::pow(libm::cos(theta_rad), *exponent),
            Self::Lambertian => 1.0,
            Self::Tabulated(table) => table.intensity(theta_rad, phi_rad) / libm::cos(theta_rad),
        }
    }

    /// As [`Law::radiance`], into a direction of length one.
    pub(super) fn radiance_into(&self, direction: DVec3) -> f64 {
        let cos_theta = direction.z;
        if cos_theta <= 0.0 {
            return 0.0;
        }
        match self {
            Self::CosinePower { exponent } => libm::pow(cos_theta, *exponent),
            Self::Lambertian => 1.0,
            Self::Tabulated(_) => {
                let sin_theta = libm::hypot(direction.x, direction.y);
                let theta_rad = libm::atan2(sin_theta, cos_theta);
                self.radiance(theta_rad, libm::atan2(direction.y, direction.x))
            }
        }
    }

    /// ∫ L cos θ dω over directions up to `theta_max_rad` from the normal.
    pub(super) fn exitance_within(&self, theta_max_rad: f64) -> f64 {
        let theta = theta_max_rad.clamp(0.0, FRAC_PI_2);
        match self {
            // 2π ∫ cosⁿ⁺¹θ sin θ dθ = 2π (1 - cosⁿ⁺²θ) / (n + 2), without cancellation near 0:
            // cosᵏθ = exp(k ln cos θ), and ln cos θ = ln(1 - 2 sin²(θ/2)).
            Self::CosinePower { exponent } => {
                let half = libm::sin(theta / 2.0);
                let log_cos = libm::log1p((-2.0 * half * half).max(-1.0));
                -2.0 * PI * libm::expm1((exponent + 2.0) * log_cos) / (exponent + 2.0)
            }
            Self::Lambertian => {
                let sin = libm::sin(theta);
                PI * sin * sin
            }
            Self::Tabulated(table) => table.flux_within(theta),
        }
    }

    /// The largest L up to `theta_max_rad`, with its direction (θ, φ).
    pub(super) fn peak_within(&self, theta_max_rad: f64) -> Option<(f64, f64, f64)> {
        match self {
            Self::CosinePower { .. } | Self::Lambertian => Some((1.0, 0.0, 0.0)),
            Self::Tabulated(table) => table.peak_within(theta_max_rad.min(FRAC_PI_2)),
        }
    }
}
