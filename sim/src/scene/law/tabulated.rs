//! Intensity over C-planes and γ, bilinear between the nodes, in the lower hemisphere of a
//! luminaire that hangs face down: γ from 0 to 90°, which is the side that a flat sample emits
//! to. CIE C and γ are the sample's -φ and θ.

use core::f64::consts::{FRAC_PI_2, PI, TAU};
use core::fmt;

use radiometry::quadrature::gauss_legendre;

/// A table of intensities, W·sr⁻¹ or cd. Between two nodes it is linear in C and in γ; outside
/// its range of γ it is zero.
#[derive(Debug, Clone, PartialEq)]
pub struct Tabulated {
    /// Once round: from 0 to 2π, both included, rising.
    c_rad: Vec<f64>,
    /// Rising, at least two, within [0, π/2].
    gamma_rad: Vec<f64>,
    /// One row a C-plane, one number a γ.
    intensity: Vec<f64>,
}

/// Why a table is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TabulatedError {
    /// The nodes do not rise, or C does not go from 0 to 360°.
    Nodes,
    /// An intensity that is negative or not a number: C and γ in degrees, the value.
    Intensity(f64, f64, f64),
    /// Fewer than two γ below 90°.
    NothingBelowHorizontal,
}

/// Nodes closer than this are one: degrees.
const NODE_DEG: f64 = 1e-9;

/// Points of the quadrature for a polynomial of the first degree times a sine over a cell of at
/// most 90°: the error is below rounding from seven on.
const QUADRATURE_POINTS: usize = 8;

impl Tabulated {
    /// A table with nodes at the given C (0 to 360°, both included, rising) and γ (rising;
    /// those above 90° are left out), degrees, of a function that is bilinear between them.
    pub fn new(
        c_deg: &[f64],
        gamma_deg: &[f64],
        intensity: impl Fn(f64, f64) -> f64,
    ) -> Result<Self, TabulatedError> {
        let rises = |nodes: &[f64]| nodes.windows(2).all(|pair| pair[0] < pair[1]);
        let ends = (c_deg.first().copied(), c_deg.last().copied());
        if !rises(c_deg) || !rises(gamma_deg) || ends != (Some(0.0), Some(360.0)) {
            return Err(TabulatedError::Nodes);
        }
        let gammas = up_to_horizontal(gamma_deg);
        if gammas.len() < 2 {
            return Err(TabulatedError::NothingBelowHorizontal);
        }
        let mut values = Vec::with_capacity(c_deg.len() * gammas.len());
        for &c in c_deg {
            for &gamma in &gammas {
                let value = intensity(c, gamma);
                if !value.is_finite() || value < 0.0 {
                    return Err(TabulatedError::Intensity(c, gamma, value));
                }
                values.push(value);
            }
        }
        let radians = |nodes: &[f64]| nodes.iter().map(|deg| deg.to_radians()).collect();
        Ok(Self { c_rad: radians(c_deg), gamma_rad: radians(&gammas), intensity: values })
    }

    /// I into the sample's (θ, φ), radians, θ within [0, π/2].
    pub fn intensity(&self, theta_rad: f64, phi_rad: f64) -> f64 {
        let c = once_round(-phi_rad);
        let Some((gamma, along)) = cell(&self.gamma_rad, theta_rad) else { return 0.0 };
        let Some((plane, across)) = cell(&self.c_rad, c) else { return 0.0 };
        let in_plane = |plane: usize| {
            let (low, high) = (self.at(plane, gamma), self.at(plane, gamma + 1));
            low + along * (high - low)
        };
        let (low, high) = (in_plane(plane), in_plane(plane + 1));
        low + across * (high - low)
    }

    /// ∫ I dω over γ up to `theta_max_rad` (at most π/2), W or lm: bilinear cell by cell, by a
    /// quadrature that is exact to rounding.
    pub fn flux_within(&self, theta_max_rad: f64) -> f64 {
        let rings: Vec<f64> = (0..self.gamma_rad.len()).map(|gamma| self.ring(gamma)).collect();
        let rule = gauss_legendre(QUADRATURE_POINTS);
        let mut flux = 0.0;
        for (i, pair) in self.gamma_rad.windows(2).enumerate() {
            let (from, to) = (pair[0], pair[1].min(theta_max_rad));
            if from >= to {
                break;
            }
            let half = (to - from) / 2.0;
            for (node, weight) in &rule {
                let gamma = from + half * (1.0 + node);
                let along = (gamma - from) / (pair[1] - from);
                let ring = rings[i] + along * (rings[i + 1] - rings[i]);
                flux += weight * half * ring * libm::sin(gamma);
            }
        }
        flux
    }

    /// The largest I / cos θ up to `theta_max_rad` (at most π/2), with its θ and φ. `None` where
    /// it has no bound, the table being above zero at 90°.
    ///
    /// It stands at a node or at the end: along C the table is linear, and along γ the quotient
    /// (a + bγ) / cos γ of a cell has no stationary point but minima.
    pub fn peak_within(&self, theta_max_rad: f64) -> Option<(f64, f64, f64)> {
        let reaches = |gamma: &&f64| **gamma <= theta_max_rad;
        let mut gammas: Vec<f64> = self.gamma_rad.iter().take_while(reaches).copied().collect();
        if gammas.last().is_none_or(|last| *last < theta_max_rad) {
            gammas.push(theta_max_rad);
        }
        let mut peak = (0.0, 0.0, 0.0);
        for &c in &self.c_rad[..self.c_rad.len() - 1] {
            let phi = if c < PI { -c } else { TAU - c };
            for &gamma in &gammas {
                let intensity = self.intensity(gamma, phi);
                if gamma >= FRAC_PI_2 {
                    if intensity > 0.0 {
                        return None;
                    }
                } else if intensity / libm::cos(gamma) > peak.0 {
                    peak = (intensity / libm::cos(gamma), gamma, phi + 0.0);
                }
            }
        }
        Some(peak)
    }

    /// A bound of |d(I / cos γ)/d angle| up to `theta_max_rad`, from each cell's differences; `None` at
    /// 90°, and where the planes disagree at the pole, which is a jump.
    pub(super) fn slope_bound(&self, theta_max_rad: f64) -> Option<f64> {
        let planes = self.c_rad.len() - 1;
        let has_pole = self.gamma_rad[0] == 0.0;
        let is_round = (1..planes).all(|plane| (self.at(plane, 0) - self.at(0, 0)).abs() <= 0.0);
        let starts_dark = (0..planes).all(|plane| self.at(plane, 0) == 0.0);
        let ends_dark = (0..planes).all(|plane| self.at(plane, self.gamma_rad.len() - 1) == 0.0);
        let last = self.gamma_rad[self.gamma_rad.len() - 1];
        let jumps = (has_pole && !is_round)
            || (!has_pole && !starts_dark)
            || (last < theta_max_rad && !ends_dark);
        let reached = self.gamma_rad.partition_point(|gamma| *gamma < theta_max_rad);
        if jumps || theta_max_rad >= FRAC_PI_2 {
            return None;
        }
        let mut bound: f64 = 0.0;
        for i in 1..=reached.min(self.gamma_rad.len() - 1) {
            let (from, to) = (self.gamma_rad[i - 1], self.gamma_rad[i].min(theta_max_rad));
            let (cos, tan) = (libm::cos(to), libm::tan(to));
            for plane in 0..planes {
                let corner = |plane, gamma| self.at(plane, gamma);
                let corners = [corner(plane, i - 1), corner(plane + 1, i - 1)];
                let further = [corner(plane, i), corner(plane + 1, i)];
                let height = self.gamma_rad[i] - from;
                let along = (further[0] - corners[0]).abs().max((further[1] - corners[1]).abs());
                let most = corners.into_iter().chain(further).fold(0.0, f64::max);
                let width = self.c_rad[plane + 1] - self.c_rad[plane];
                // ∂I/∂C is linear in γ; over sin γ it is largest at an end, or next to the pole.
                let near = (corners[1] - corners[0]).abs();
                let far = (further[1] - further[0]).abs();
                let around = if from == 0.0 {
                    far / (width * height) * (to / libm::sin(to))
                } else {
                    near.max(far) / (width * libm::sin(from))
                };
                let meridian = along / height + most * tan;
                bound = bound.max(libm::hypot(meridian, around) / cos);
            }
        }
        Some(bound)
    }

    fn at(&self, plane: usize, gamma: usize) -> f64 {
        self.intensity[plane * self.gamma_rad.len() + gamma]
    }

    /// ∫ I dC at one γ.
    fn ring(&self, gamma: usize) -> f64 {
        let planes = self.c_rad.windows(2).enumerate();
        planes
            .map(|(i, c)| (c[1] - c[0]) * f64::midpoint(self.at(i, gamma), self.at(i + 1, gamma)))
            .sum()
    }
}

/// The nodes below 90°, and 90° itself if the table reaches it.
fn up_to_horizontal(gamma_deg: &[f64]) -> Vec<f64> {
    let mut nodes: Vec<f64> =
        gamma_deg.iter().copied().take_while(|gamma| *gamma < 90.0 - NODE_DEG).collect();
    if gamma_deg.last().is_some_and(|last| *last >= 90.0 - NODE_DEG) && !nodes.is_empty() {
        nodes.push(90.0);
    }
    nodes
}

/// Into [0, 2π].
fn once_round(angle_rad: f64) -> f64 {
    let rest = libm::fmod(angle_rad, TAU);
    if rest < 0.0 { rest + TAU } else { rest }
}

/// The cell of rising nodes that holds `x`, and how far into it, from 0 to 1.
fn cell(nodes: &[f64], x: f64) -> Option<(usize, f64)> {
    let (first, last) = (*nodes.first()?, *nodes.last()?);
    if !(first..=last).contains(&x) {
        return None;
    }
    let i = nodes.partition_point(|node| *node <= x).clamp(1, nodes.len() - 1) - 1;
    Some((i, (x - nodes[i]) / (nodes[i + 1] - nodes[i])))
}

impl fmt::Display for TabulatedError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nodes => f.write_str("the angles do not rise, or C does not go once round"),
            Self::Intensity(c, gamma, value) => {
                write!(f, "intensity {value} at C {c}°, γ {gamma}° is not at least 0")
            }
            Self::NothingBelowHorizontal => {
                f.write_str("no intensities at two or more γ from 0° to 90°")
            }
        }
    }
}

impl core::error::Error for TabulatedError {}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: f64, expected: f64, tolerance: f64) {
        assert!(libm::fabs(found - expected) <= tolerance, "{found} beside {expected}");
    }

    fn asymmetric() -> Tabulated {
        let gamma: Vec<f64> = (0..=36).map(|i| 2.5 * f64::from(i)).collect();
        let c: Vec<f64> = (0..=16).map(|i| 22.5 * f64::from(i)).collect();
        Tabulated::new(&c, &gamma, |c, gamma| {
            let turn = libm::cos((c - 70.0).to_radians()) + 0.5 * libm::sin(2.0 * c.to_radians());
            (1.0 - gamma / 90.0) * (2.0 + turn * gamma / 90.0)
        })
        .unwrap()
    }

    #[test]
    fn c_runs_against_phi() {
        let table = Tabulated::new(&[0.0, 90.0, 180.0, 270.0, 360.0], &[0.0, 90.0], |c, _| {
            if (c - 90.0).abs() < 1.0 { 1.0 } else { 0.0 }
        })
        .unwrap();
        close(table.intensity(0.3, -FRAC_PI_2), 1.0, 1e-15);
        close(table.intensity(0.3, FRAC_PI_2), 0.0, 1e-15);
        close(table.intensity(0.3, -FRAC_PI_2 / 2.0), 0.5, 1e-15);
        close(table.intensity(0.3, PI), 0.0, 1e-15);
    }

    #[test]
    fn constant_intensity_fills_the_solid_angle_of_a_cap() {
        let table = Tabulated::new(&[0.0, 360.0], &[0.0, 40.0, 90.0, 180.0], |_, _| 3.0).unwrap();
        for theta in [0.0, 0.1, 0.7, 1.2, FRAC_PI_2] {
            let cap = 2.0 * PI * 2.0 * libm::sin(theta / 2.0) * libm::sin(theta / 2.0);
            close(table.flux_within(theta), 3.0 * cap, 1e-14);
        }
        assert_eq!(table.peak_within(FRAC_PI_2), None);
    }

    #[test]
    fn flux_agrees_with_a_midpoint_sum_over_directions() {
        // An integration that knows neither cells nor planes: the midpoint rule on a fine grid.
        let table = asymmetric();
        for theta_max in [0.5, 1.1, FRAC_PI_2] {
            let (thetas, phis) = (1500_u32, 720_u32);
            let (dt, dp) = (theta_max / f64::from(thetas), TAU / f64::from(phis));
            let mut sum = 0.0;
            for i in 0..thetas {
                let theta = (f64::from(i) + 0.5) * dt;
                let ring: f64 =
                    (0..phis).map(|j| table.intensity(theta, (f64::from(j) + 0.5) * dp - PI)).sum();
                sum += ring * dp * dt * libm::sin(theta);
            }
            close(table.flux_within(theta_max) / sum, 1.0, 1e-5);
        }
    }

    #[test]
    fn nothing_exceeds_the_peak_and_the_peak_is_reached() {
        let table = asymmetric();
        for theta_max in [0.02, 0.4, 1.0, 1.5] {
            let (peak, theta, phi) = table.peak_within(theta_max).unwrap();
            close(table.intensity(theta, phi) / libm::cos(theta), peak, 1e-15);
            for i in 0..400 {
                for j in 0..180 {
                    let theta = theta_max * f64::from(i) / 400.0;
                    let phi = TAU * f64::from(j) / 180.0 - PI;
                    assert!(table.intensity(theta, phi) / libm::cos(theta) <= peak * (1.0 + 1e-14));
                }
            }
        }
    }

    #[test]
    fn bad_tables_are_refused() {
        let flat = |_, _| 1.0;
        let of = |c: &[f64], gamma: &[f64]| Tabulated::new(c, gamma, flat).unwrap_err();
        assert_eq!(of(&[0.0, 180.0], &[0.0, 90.0]), TabulatedError::Nodes);
        assert_eq!(of(&[0.0, 360.0], &[10.0, 10.0]), TabulatedError::Nodes);
        assert_eq!(of(&[0.0, 360.0], &[90.0, 180.0]), TabulatedError::NothingBelowHorizontal);
        let negative = Tabulated::new(&[0.0, 360.0], &[0.0, 90.0], |_, gamma| 1.0 - gamma);
        assert_eq!(negative, Err(TabulatedError::Intensity(0.0, 90.0, -89.0)));
    }
}
