//! The rays at which fields over a region are compared and integrated: a product rule for the
//! throughput cos θ dω dA.

use fit::{Ray, Region};
use radiometry::quadrature::gauss_legendre;

/// How finely a region is looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fineness {
    /// Nodes in sin²θ.
    pub theta: usize,
    /// Nodes round the circle; the trapezoid rule is exact for harmonics below this count.
    pub phi: u32,
    /// Equal parts of each of x and y, ...
    pub parts: u32,
    /// ... and the nodes in each. A polynomial would do with fewer parts; an emitter that ends
    /// inside the region is seen the better the more evenly they stand.
    pub in_part: usize,
}

impl Fineness {
    /// Sees features of 15° in φ and an emitter's outline inside the region to a sixth of it.
    pub const USUAL: Self = Self { theta: 32, phi: 48, parts: 3, in_part: 2 };
}

/// Gauss-Legendre in sin²θ and in parts of x and y, the trapezoid rule in φ. Weights of each
/// coordinate sum to 1, so that sums are means over the region's throughput.
#[derive(Debug, Clone, PartialEq)]
pub struct Nodes {
    x: Vec<(f64, f64)>,
    y: Vec<(f64, f64)>,
    theta: Vec<(f64, f64)>,
    phi: Vec<(f64, f64)>,
    throughput_per_area: f64,
}

impl Nodes {
    /// Over the region's rectangle and the cone from the normal to its largest θ.
    pub fn of(region: &Region, fineness: Fineness) -> Self {
        let sin2_max = libm::sin(region.theta_max_rad).powi(2);
        let halved = |nodes: Vec<(f64, f64)>| -> Vec<(f64, f64)> {
            nodes.into_iter().map(|(t, weight)| (0.5 * (1.0 + t), 0.5 * weight)).collect()
        };
        let part = 1.0 / f64::from(fineness.parts);
        let in_part = halved(gauss_legendre(fineness.in_part));
        let along = |(low, high): (f64, f64)| -> Vec<(f64, f64)> {
            let of_part = |i: u32| {
                let in_part = in_part.iter();
                in_part.map(move |(t, weight)| {
                    (low + (high - low) * part * (f64::from(i) + t), part * weight)
                })
            };
            (0..fineness.parts).flat_map(of_part).collect()
        };
        let polar = halved(gauss_legendre(fineness.theta));
        let theta = polar.into_iter().map(|(t, w)| (libm::asin(libm::sqrt(sin2_max * t)), w));
        let count = f64::from(fineness.phi);
        let turn = |k: u32| core::f64::consts::PI * (2.0 * (f64::from(k) + 0.5) / count - 1.0);
        Self {
            x: along(region.x_m),
            y: along(region.y_m),
            theta: theta.collect(),
            phi: (0..fineness.phi).map(|k| (turn(k), 1.0 / count)).collect(),
            throughput_per_area: core::f64::consts::PI * sin2_max,
        }
    }

    /// The x of the nodes, metres.
    pub fn x_m(&self) -> impl Iterator<Item = f64> + '_ {
        self.x.iter().map(|(at, _)| *at)
    }

    /// The y of the nodes, metres.
    pub fn y_m(&self) -> impl Iterator<Item = f64> + '_ {
        self.y.iter().map(|(at, _)| *at)
    }

    /// The θ of the nodes, radians.
    pub fn theta_rad(&self) -> impl Iterator<Item = f64> + '_ {
        self.theta.iter().map(|(at, _)| *at)
    }

    /// The φ of the nodes, radians.
    pub fn phi_rad(&self) -> impl Iterator<Item = f64> + '_ {
        self.phi.iter().map(|(at, _)| *at)
    }

    /// Every ray with its weight, φ fastest, then θ, y and x: what is the same into all directions
    /// is then known from the ray before.
    pub fn rays(&self) -> impl Iterator<Item = (Ray, f64)> + '_ {
        self.x.iter().flat_map(move |&(x_m, of_x)| {
            self.y.iter().flat_map(move |&(y_m, of_y)| {
                self.theta.iter().flat_map(move |&(theta_rad, of_theta)| {
                    self.phi.iter().map(move |&(phi_rad, of_phi)| {
                        (Ray { x_m, y_m, theta_rad, phi_rad }, of_x * of_y * of_theta * of_phi)
                    })
                })
            })
        })
    }

    /// The exitance into the region's cone, the mean over its rectangle, of values at the rays in
    /// their order.
    pub fn exitance(&self, values: &[f64]) -> f64 {
        let mean: f64 = self.rays().zip(values).map(|((_, weight), value)| weight * value).sum();
        self.throughput_per_area * mean
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REGION: Region = Region::surface((-0.01, 0.03), (0.0, 0.02), 1.2);

    #[test]
    fn an_even_field_has_pi_sin_squared_of_its_radiance() {
        let nodes = Nodes::of(&REGION, Fineness::USUAL);
        let exitance = nodes.exitance(&vec![2.0; nodes.rays().count()]);
        let expected = 2.0 * core::f64::consts::PI * libm::sin(1.2).powi(2);
        assert!((exitance / expected - 1.0).abs() < 1e-13, "{exitance}");
    }

    #[test]
    fn a_lobe_and_a_slope_are_integrated() {
        // ∫ cos³ dω over the cone = π/2 (1 - cos⁴); the slope's mean is its value in the middle.
        let nodes = Nodes::of(&REGION, Fineness::USUAL);
        let radiance = |ray: Ray| libm::cos(ray.theta_rad).powi(2) * (1.0 + 10.0 * ray.x_m);
        let values: Vec<f64> = nodes.rays().map(|(ray, _)| radiance(ray)).collect();
        let expected = core::f64::consts::FRAC_PI_2 * (1.0 - libm::cos(1.2).powi(4)) * 1.1;
        let found = nodes.exitance(&values);
        assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
    }
}
