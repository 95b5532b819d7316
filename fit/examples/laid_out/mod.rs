//! Where examples measure and where they ask for the truth, and the lobe that most of their fields are made of.

use fit::{Ray, Region};
use radiometry::direction::unit;
use radiometry::quadrature::Sobol;
use std::error::Error;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// At one place; what lies beyond 80° is not asked for.
pub(crate) const POINT: Region = Region::surface((0.0, 0.0), (0.0, 0.0), 80.0 * PI / 180.0);
/// ±20 mm.
pub(crate) const PATCH: Region = Region::surface((-0.02, 0.02), (-0.02, 0.02), 80.0 * PI / 180.0);

/// exp(g (cos of the angle to a direction - 1)).
pub(crate) fn lobe(ray: &Ray, g: f64, theta_deg: f64, phi_deg: f64) -> f64 {
    let axis = unit(theta_deg.to_radians(), phi_deg.to_radians());
    libm::exp(g * (unit(ray.theta_rad, ray.phi_rad).dot(axis) - 1.0))
}

/// Lines through the normal, `lines` of them half a turn round, read every `step_deg` at each of `side` by `side` places.
pub(crate) fn patches_of(
    region: &Region,
    side: usize,
    to_deg: f64,
    step_deg: f64,
    lines: usize,
) -> Vec<Ray> {
    #[allow(clippy::cast_possible_truncation)] // a few hundred
    let steps = libm::round(to_deg / step_deg) as i32;
    let at = |(from, to): (f64, f64), i: usize| {
        if side == 1 {
            f64::midpoint(from, to)
        } else {
            from + (to - from) * i as f64 / (side - 1) as f64
        }
    };
    let mut rays = Vec::new();
    for place in 0..side * side {
        for line in 0..lines {
            let phi_rad = PI * line as f64 / lines as f64;
            for step in -steps..=steps {
                let theta_rad = (f64::from(step.abs()) * step_deg).to_radians();
                let phi_rad = if step < 0 { phi_rad - PI } else { phi_rad };
                let (x_m, y_m) = (at(region.x_m, place % side), at(region.y_m, place / side));
                rays.push(Ray { x_m, y_m, theta_rad, phi_rad });
            }
        }
    }
    rays
}

/// Evenly in throughput over the region: RMS over these is the throughput-weighted one.
pub(crate) fn truth_rays(region: &Region, count: usize) -> Result<Vec<Ray>, Box<dyn Error>> {
    let mut sobol = Sobol::<4>::new()?;
    let sin_most = libm::sin(region.theta_max_rad.min(FRAC_PI_2));
    let between = |(from, to): (f64, f64), t: f64| from + (to - from) * t;
    let ray = |t: [f64; 4]| Ray {
        x_m: between(region.x_m, t[2]),
        y_m: between(region.y_m, t[3]),
        theta_rad: libm::asin(sin_most * t[0].sqrt()),
        phi_rad: TAU * t[1],
    };
    let mut next = || sobol.next_point().map(|bits| (f64::from(bits) + 0.5) * 2f64.powi(-32));
    Ok((0..count).map(|_| ray(next())).collect())
}
