//! How radiance goes with direction, for a level of one: its value, its integral over the
//! projected hemisphere, its largest value, and how steep and how curved it is at most.

mod batwing;
mod cosine;
mod lobes;
mod tabulated;

use core::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use radiometry::direction::{angles, unit};

pub use batwing::{Batwing, SHARPNESS_MAX};
pub use lobes::{LOBE_EXPONENT_MIN, Lobe, Lobes};
pub use tabulated::{Tabulated, TabulatedError};

/// An angular law, for a level of one.
#[derive(Debug, Clone, PartialEq)]
pub enum Law {
    /// L = v + (1 - v) s(θ), brightest on a ring around the normal.
    Batwing(Batwing),
    /// L(θ) = cosⁿ θ.
    CosinePower {
        /// n, at least 0.
        exponent: f64,
    },
    /// L = 1.
    Lambertian,
    /// L = b + Σ wᵢ cosⁿγᵢ, each lobe around an axis of its own.
    Lobes(Lobes),
    /// L = I(C, γ) / cos θ, with γ = θ and C = -φ; the level is one over the opening's area.
    Tabulated(Tabulated),
}

impl Law {
    /// What scene.toml calls it.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Batwing(_) => "batwing",
            Self::CosinePower { .. } => "cosine-power",
            Self::Lambertian => "lambertian",
            Self::Lobes(_) => "lobes",
            Self::Tabulated(_) => "photometric-file",
        }
    }

    /// Whether it is the same all round the normal.
    pub const fn is_round(&self) -> bool {
        match self {
            Self::Batwing(_) | Self::CosinePower { .. } | Self::Lambertian => true,
            Self::Lobes(_) | Self::Tabulated(_) => false,
        }
    }

    /// Into (θ, φ), radians; 0 for θ of 90° and beyond.
    pub fn radiance(&self, theta_rad: f64, phi_rad: f64) -> f64 {
        if theta_rad >= FRAC_PI_2 {
            return 0.0;
        }
        match self {
            Self::CosinePower { exponent } => libm::pow(libm::cos(theta_rad), *exponent),
            Self::Lambertian => 1.0,
            Self::Tabulated(table) => table.intensity(theta_rad, phi_rad) / libm::cos(theta_rad),
            Self::Batwing(_) | Self::Lobes(_) => self.radiance_into(unit(theta_rad, phi_rad)),
        }
    }

    /// Into a unit vector, the normal being +z; 0 for what doesn't rise above the plane.
    pub fn radiance_into(&self, direction: DVec3) -> f64 {
        if direction.z <= 0.0 {
            return 0.0;
        }
        match self {
            Self::Batwing(batwing) => batwing.value(direction.z),
            Self::CosinePower { exponent } => libm::pow(direction.z, *exponent),
            Self::Lambertian => 1.0,
            Self::Lobes(lobes) => lobes.value(direction),
            Self::Tabulated(table) => {
                let (theta, phi) = angles(direction);
                table.intensity(theta, phi) / direction.z
            }
        }
    }

    /// ∫ L cos θ dω over directions up to `theta_max_rad` from the normal, sr.
    pub fn exitance_within(&self, theta_max_rad: f64) -> f64 {
        let theta = theta_max_rad.clamp(0.0, FRAC_PI_2);
        match self {
            Self::Batwing(batwing) => batwing.exitance_within(theta),
            Self::CosinePower { exponent } => cosine::exitance_within(*exponent, theta),
            Self::Lambertian => {
                let sin = libm::sin(theta);
                PI * sin * sin
            }
            Self::Lobes(lobes) => lobes.exitance_within(theta),
            Self::Tabulated(table) => table.flux_within(theta),
        }
    }

    /// The largest L up to `theta_max_rad`, with its direction (θ, φ). `None` where it grows beyond
    /// any bound, as a table does that ends above zero at 90°.
    pub fn peak_within(&self, theta_max_rad: f64) -> Option<(f64, f64, f64)> {
        let theta = theta_max_rad.clamp(0.0, FRAC_PI_2);
        match self {
            Self::Batwing(batwing) => Some(batwing.peak_within(theta)),
            Self::CosinePower { .. } | Self::Lambertian => Some((1.0, 0.0, 0.0)),
            Self::Lobes(lobes) => Some(lobes.peak_within(theta)),
            Self::Tabulated(table) => table.peak_within(theta),
        }
    }

    /// A bound of |dL/dγ|, per radian, along every great circle up to `theta_max_rad` from the
    /// normal. `None` where nothing bounds it there.
    pub fn slope_bound(&self, theta_max_rad: f64) -> Option<f64> {
        let theta = theta_max_rad.clamp(0.0, FRAC_PI_2);
        let bound = match self {
            Self::Batwing(batwing) => batwing.slope_bound(theta),
            Self::CosinePower { exponent } => cosine::slope_bound(*exponent, (0.0, theta)),
            Self::Lambertian => 0.0,
            Self::Lobes(lobes) => lobes.slope_bound(theta),
            Self::Tabulated(table) => return table.slope_bound(theta),
        };
        bound.is_finite().then_some(bound)
    }

    /// A bound of |d²L/dγ²|, per square radian, along every great circle up to `theta_max_rad` from
    /// the normal. `None` where nothing bounds it there, and for a table, which has kinks.
    pub fn curvature_bound(&self, theta_max_rad: f64) -> Option<f64> {
        let theta = theta_max_rad.clamp(0.0, FRAC_PI_2);
        let bound = match self {
            Self::Batwing(batwing) => batwing.curvature_bound(theta),
            Self::CosinePower { exponent } => cosine::curvature_bound(*exponent, (0.0, theta)),
            Self::Lambertian => 0.0,
            Self::Lobes(lobes) => lobes.curvature_bound(theta),
            Self::Tabulated(_) => return None,
        };
        bound.is_finite().then_some(bound)
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::TAU;

    use super::*;

    fn laws() -> Vec<Law> {
        let lobe = |theta: f64, phi: f64, exponent, weight| Lobe {
            axis: unit(theta, phi),
            exponent,
            weight,
        };
        vec![
            Law::Lambertian,
            Law::CosinePower { exponent: 0.7 },
            Law::CosinePower { exponent: 1.0 },
            Law::CosinePower { exponent: 1.8 },
            Law::CosinePower { exponent: 30.0 },
            Law::Batwing(Batwing::new(1.0, 0.3, 1).unwrap()),
            Law::Batwing(Batwing::new(0.6, 0.0, 4).unwrap()),
            Law::Lobes(Lobes::new(0.0, vec![lobe(0.0, 0.0, 8.0, 1.0)]).unwrap()),
            Law::Lobes(
                Lobes::new(0.1, vec![lobe(0.8, 1.0, 20.0, 1.0), lobe(1.3, -2.0, 3.0, 0.5)])
                    .unwrap(),
            ),
        ]
    }

    /// The midpoint rule on a fine grid, which knows no law.
    fn summed(law: &Law, theta_max: f64) -> f64 {
        let (thetas, phis) = (2000_u32, 400_u32);
        let (dt, dp) = (theta_max / f64::from(thetas), TAU / f64::from(phis));
        let mut sum = 0.0;
        for i in 0..thetas {
            let theta = (f64::from(i) + 0.5) * dt;
            let weight = libm::sin(theta) * libm::cos(theta) * dt * dp;
            let ring: f64 = (0..phis).map(|j| law.radiance(theta, (f64::from(j) + 0.5) * dp)).sum();
            sum += weight * ring;
        }
        sum
    }

    #[test]
    fn exitance_is_what_a_sum_over_directions_finds() {
        for law in laws() {
            for theta_max in [0.3, 1.2, FRAC_PI_2] {
                let (found, sum) = (law.exitance_within(theta_max), summed(&law, theta_max));
                assert!((found / sum - 1.0).abs() < 3e-6, "{law:?} {theta_max}: {found} {sum}");
            }
        }
    }

    #[test]
    fn angles_and_vectors_ask_the_same_law() {
        for law in laws() {
            for (theta, phi) in [(0.0, 0.0), (0.5, 1.0), (1.2, -2.5), (1.57, 3.0)] {
                let (a, b) = (law.radiance(theta, phi), law.radiance_into(unit(theta, phi)));
                assert!((a - b).abs() < 1e-12, "{law:?}: {a} {b}");
            }
            assert_eq!(law.radiance_into(-DVec3::Z).to_bits(), 0);
        }
    }

    #[test]
    fn nothing_exceeds_the_peak_the_slope_or_the_curvature() {
        for law in laws() {
            for theta_max in [0.2, 0.9, 1.4] {
                let (peak, theta, phi) = law.peak_within(theta_max).unwrap();
                assert!((law.radiance(theta, phi) / peak - 1.0).abs() < 1e-12);
                assert!(theta <= theta_max);
                let slope = law.slope_bound(theta_max).unwrap();
                let curvature = law.curvature_bound(theta_max).unwrap();
                let (mut steepest, mut most_curved): (f64, f64) = (0.0, 0.0);
                let step = 1e-4;
                for i in 0..60 {
                    for j in 0..48 {
                        let from = unit(theta_max * f64::from(i) / 60.0, TAU * f64::from(j) / 48.0);
                        let (e, f) = radiometry::direction::frame(from);
                        for k in 0..6 {
                            let turn = PI * f64::from(k) / 6.0;
                            let across = e * libm::cos(turn) + f * libm::sin(turn);
                            let at = |t: f64| {
                                law.radiance_into(from * libm::cos(t) + across * libm::sin(t))
                            };
                            let (low, middle, high) = (at(-step), at(0.0), at(step));
                            assert!(middle <= peak * (1.0 + 1e-12), "{law:?} {theta_max}");
                            steepest = steepest.max((high - low).abs() / (2.0 * step));
                            let second = (low - 2.0 * middle + high).abs() / (step * step);
                            most_curved = most_curved.max(second);
                        }
                    }
                }
                assert!(
                    steepest <= slope * 1.001 + 1e-6,
                    "{law:?} {theta_max}: {steepest} {slope}"
                );
                assert!(
                    most_curved <= curvature * 1.001 + 1e-5,
                    "{law:?} {theta_max}: {most_curved} {curvature}"
                );
                assert!(slope <= 20.0 * steepest + 1e-9, "{law:?} {theta_max}: {steepest} {slope}");
            }
        }
    }
}
