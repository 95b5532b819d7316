//! The way of a reading that is taken in flight: the rays between its first and its last. It does
//! not know what is seen along them.

use crate::Ray;

/// The ray at a part of the way from 0 to 1: the place goes straight, the direction along the
/// chord. Ways are a few degrees long at most, where that is the great circle at constant speed to
/// a part in a thousand of their length.
pub(super) fn along((from, to): &(Ray, Ray), part: f64) -> Ray {
    let between = |a: f64, b: f64| a + (b - a) * part;
    let (a, b) = (unit(from), unit(to));
    let [x, y, z] = [0, 1, 2].map(|i| between(a[i], b[i]));
    let across = libm::hypot(x, y);
    Ray {
        x_m: between(from.x_m, to.x_m),
        y_m: between(from.y_m, to.y_m),
        theta_rad: libm::atan2(across, z),
        phi_rad: if across > 0.0 { libm::atan2(y, x) } else { from.phi_rad },
    }
}

fn unit(ray: &Ray) -> [f64; 3] {
    let (sin, cos) = libm::sincos(ray.theta_rad);
    let (sin_phi, cos_phi) = libm::sincos(ray.phi_rad);
    [sin * cos_phi, sin * sin_phi, cos]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(theta_deg: f64, phi_deg: f64, x_m: f64) -> Ray {
        let (theta_rad, phi_rad) = (theta_deg.to_radians(), phi_deg.to_radians());
        Ray { x_m, y_m: 0.0, theta_rad, phi_rad }
    }

    #[test]
    fn a_way_goes_evenly_and_through_the_pole() {
        let way = (ray(40.0, 30.0, 0.0), ray(42.0, 30.0, 1.0));
        let at = along(&way, 0.25);
        assert!((at.theta_rad.to_degrees() - 40.5).abs() < 1e-3 && (at.x_m - 0.25).abs() < 1e-15);
        let over = (ray(1.0, 180.0, 0.0), ray(1.0, 0.0, 0.0));
        assert!(along(&over, 0.5).theta_rad.abs() < 1e-12);
        let beyond = along(&over, 0.75);
        assert!((beyond.theta_rad.to_degrees() - 0.5).abs() < 1e-3 && beyond.phi_rad.abs() < 1e-9);
    }
}
