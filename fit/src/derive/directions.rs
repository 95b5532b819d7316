//! Parts of the hemisphere, and rules of directions over them under the projected solid angle
//! cos θ dω: zones about the normal, and cones about any direction, cut by the horizon.

use super::DeriveError;
use glam::DVec3;
use radiometry::direction::{angles, frame, unit};
use radiometry::quadrature::gauss_legendre;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// The directions between two polar angles from the normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Zone {
    /// From here, radians, 0 at the normal.
    pub from_rad: f64,
    /// To here, radians, at most π/2.
    pub to_rad: f64,
}

/// The directions within an angle of an axis; those below the sample's plane don't count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cone {
    /// The axis's polar angle, radians, in [0, π/2].
    pub axis_theta_rad: f64,
    /// The axis's azimuth, radians.
    pub axis_phi_rad: f64,
    /// Radians, in (0, π/2].
    pub half_angle_rad: f64,
}

/// A direction with its weight in sr of projected solid angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Direction {
    pub(super) theta_rad: f64,
    pub(super) phi_rad: f64,
    pub(super) weight_sr: f64,
}

impl Zone {
    pub(super) fn check(&self, end_rad: f64) -> Result<(), DeriveError> {
        let refuse = |what, value, expected| Err(DeriveError::Domain { what, value, expected });
        let [from, to] = if end_rad > FRAC_PI_2 {
            ["an angle from 0 to below π", "an angle above from_rad, up to π"]
        } else {
            ["an angle from 0 to below π/2", "an angle above from_rad, up to π/2"]
        };
        if !(self.from_rad >= 0.0 && self.from_rad < end_rad) {
            return refuse("from_rad", self.from_rad, from);
        }
        if !(self.to_rad > self.from_rad && self.to_rad <= end_rad + 1e-9) {
            return refuse("to_rad", self.to_rad, to);
        }
        Ok(())
    }

    /// The zone in two at an angle inside it, so that no rule runs over a change of kind.
    pub(super) fn split(self, at_rad: f64) -> Vec<Self> {
        if at_rad > self.from_rad && at_rad < self.to_rad {
            vec![Self { to_rad: at_rad, ..self }, Self { from_rad: at_rad, ..self }]
        } else {
            vec![self]
        }
    }

    /// Gauss-Legendre in sin² θ times equidistant azimuths.
    pub(super) fn directions(self, rings: usize, spokes: usize) -> Vec<Direction> {
        let (low, high) = (square_of_sine(self.from_rad), square_of_sine(self.to_rad));
        let mut directions = Vec::with_capacity(rings * spokes);
        for (node, weight) in gauss_legendre(rings) {
            let sin2 = 0.5 * ((1.0 - node) * low + (1.0 + node) * high);
            let theta_rad = libm::atan2(sin2.sqrt(), (1.0 - sin2).max(0.0).sqrt());
            let weight_sr = 0.25 * weight * (high - low) * TAU / spokes as f64;
            directions.extend((0..spokes).map(|k| {
                let phi_rad = TAU * k as f64 / spokes as f64;
                Direction { theta_rad, phi_rad, weight_sr }
            }));
        }
        directions
    }

    /// (θ, φ, weight) by one of the two rules.
    pub(crate) fn weighted(
        self,
        is_whole: bool,
        rings: usize,
        spokes: usize,
    ) -> Vec<(f64, f64, f64)> {
        let directions = if is_whole {
            self.all_directions(rings, spokes)
        } else {
            self.directions(rings, spokes)
        };
        let of =
            |direction: Direction| (direction.theta_rad, direction.phi_rad, direction.weight_sr);
        directions.into_iter().map(of).collect()
    }

    /// The same by solid angle: Gauss-Legendre in cos θ times equidistant azimuths.
    pub(super) fn all_directions(self, rings: usize, spokes: usize) -> Vec<Direction> {
        let (low, high) = (libm::cos(self.to_rad), libm::cos(self.from_rad));
        let mut directions = Vec::with_capacity(rings * spokes);
        for (node, weight) in gauss_legendre(rings) {
            let theta_rad = libm::acos(0.5 * ((1.0 - node) * low + (1.0 + node) * high));
            let weight_sr = 0.5 * weight * (high - low) * TAU / spokes as f64;
            directions.extend((0..spokes).map(|k| {
                let phi_rad = TAU * k as f64 / spokes as f64;
                Direction { theta_rad, phi_rad, weight_sr }
            }));
        }
        directions
    }
}

impl Cone {
    pub(super) fn check(&self, end_rad: f64) -> Result<(), DeriveError> {
        let refuse = |what, value, expected| Err(DeriveError::Domain { what, value, expected });
        if !(self.axis_theta_rad >= 0.0 && self.axis_theta_rad <= end_rad + 1e-9) {
            let is_whole = end_rad > FRAC_PI_2;
            let expected =
                if is_whole { "an angle from 0 to π" } else { "an angle from 0 to π/2" };
            return refuse("axis_theta_rad", self.axis_theta_rad, expected);
        }
        if !self.axis_phi_rad.is_finite() {
            return refuse("axis_phi_rad", self.axis_phi_rad, "a finite angle");
        }
        if !(self.half_angle_rad > 0.0 && self.half_angle_rad <= FRAC_PI_2 + 1e-9) {
            return refuse("half_angle_rad", self.half_angle_rad, "an angle above 0, up to π/2");
        }
        Ok(())
    }

    /// By solid angle, whatever lies below: Gauss-Legendre in the cosine about the axis.
    pub(super) fn all_directions(self, rings: usize, spokes: usize) -> Vec<Direction> {
        let about = Zone { from_rad: 0.0, to_rad: self.half_angle_rad };
        let axis = unit(self.axis_theta_rad, self.axis_phi_rad);
        let (across, beside) = tilt_frame(axis, self.axis_phi_rad);
        let mut directions = about.all_directions(rings, spokes);
        for direction in &mut directions {
            let local = unit(direction.theta_rad, direction.phi_rad);
            let towards = local.z * axis + local.x * across + local.y * beside;
            (direction.theta_rad, direction.phi_rad) = angles(towards);
        }
        directions
    }

    /// Circles about the axis, each as far as it is above the horizon. Where the horizon begins to
    /// cut them the arcs' ends leave like a square root: the rule is graded there.
    pub(super) fn directions(self, rings: usize, spokes: usize) -> Vec<Direction> {
        let axis = unit(self.axis_theta_rad, self.axis_phi_rad);
        let (across, beside) = tilt_frame(axis, self.axis_phi_rad);
        let grazing_rad = (FRAC_PI_2 - self.axis_theta_rad).max(0.0);
        let mut directions = Vec::with_capacity(rings * spokes);
        let whole_to = self.half_angle_rad.min(grazing_rad);
        for (node, weight) in gauss_legendre(rings) {
            // Equal steps of 1 - cos α, as on a sphere's cap.
            let cap = 1.0 - libm::cos(whole_to);
            let alpha_rad = 2.0 * libm::asin((0.25 * (1.0 + node) * cap).sqrt());
            let ring_sr = 0.5 * weight * cap * TAU;
            circle(&mut directions, [axis, across, beside], alpha_rad, ring_sr, spokes);
        }
        if self.half_angle_rad > whole_to {
            let span_rad = self.half_angle_rad - whole_to;
            for (node, weight) in gauss_legendre(2 * rings) {
                let t = 0.5 * (1.0 + node);
                let alpha_rad = whole_to + span_rad * t * t;
                let step_rad = weight * t * span_rad;
                let arcs = [axis, across, beside];
                arc(&mut directions, arcs, alpha_rad, step_rad, grazing_rad, spokes);
            }
        }
        directions
    }
}

/// Azimuths all round the axis.
fn circle(
    out: &mut Vec<Direction>,
    frame: [DVec3; 3],
    alpha_rad: f64,
    ring_sr: f64,
    spokes: usize,
) {
    for k in 0..spokes {
        let beta_rad = TAU * (k as f64 + 0.5) / spokes as f64;
        out.push(direction(frame, alpha_rad, beta_rad, ring_sr / spokes as f64));
    }
}

/// Azimuths as far as the circle is above the horizon: cos β >= -cot α cot θ of the axis, β counted
/// from the side that rises.
fn arc(
    out: &mut Vec<Direction>,
    frame: [DVec3; 3],
    alpha_rad: f64,
    step_rad: f64,
    grazing_rad: f64,
    spokes: usize,
) {
    let cos_end = -libm::tan(grazing_rad) / libm::tan(alpha_rad);
    let end_rad = libm::acos(cos_end.clamp(-1.0, 1.0));
    let (sin_alpha, _) = libm::sincos(alpha_rad);
    for (node, weight) in gauss_legendre(spokes) {
        let weight_sr = weight * end_rad * sin_alpha * step_rad;
        out.push(direction(frame, alpha_rad, node * end_rad, weight_sr));
    }
}

fn direction(
    [axis, across, beside]: [DVec3; 3],
    alpha_rad: f64,
    beta_rad: f64,
    solid_sr: f64,
) -> Direction {
    let (sin_alpha, cos_alpha) = libm::sincos(alpha_rad);
    let (sin_beta, cos_beta) = libm::sincos(beta_rad);
    let towards = cos_alpha * axis + sin_alpha * (cos_beta * across + sin_beta * beside);
    let (theta_rad, phi_rad) = angles(towards);
    let weight_sr = solid_sr * towards.z.max(0.0);
    Direction { theta_rad: theta_rad.min(FRAC_PI_2), phi_rad, weight_sr }
}

/// Two unit vectors across the axis, the first the one that rises towards the normal.
fn tilt_frame(axis: DVec3, phi_rad: f64) -> (DVec3, DVec3) {
    let (theta_rad, _) = angles(axis);
    if theta_rad == 0.0 {
        return frame(axis);
    }
    // The direction of falling θ.
    let rising = -unit(theta_rad + FRAC_PI_2, phi_rad);
    (rising, axis.cross(rising))
}

fn square_of_sine(theta_rad: f64) -> f64 {
    let sin = libm::sin(theta_rad.min(PI));
    sin * sin
}

#[cfg(test)]
mod tests {
    use super::*;

    fn projected_sr(cone: Cone) -> f64 {
        cone.directions(40, 80).iter().map(|direction| direction.weight_sr).sum()
    }

    #[test]
    fn a_cone_above_the_horizon_projects_to_its_closed_form() {
        // π sin² α cos of the axis (the projection of a cap's vector area).
        for (axis, half) in [(0.0, 0.3), (0.7, 0.5), (1.2, 0.3), (0.0, FRAC_PI_2)] {
            let cone = Cone { axis_theta_rad: axis, axis_phi_rad: 2.0, half_angle_rad: half };
            let sin = libm::sin(half);
            let expected = PI * sin * sin * libm::cos(axis);
            assert!((projected_sr(cone) / expected - 1.0).abs() < 1e-12, "{axis} {half}");
        }
    }

    #[test]
    fn a_cone_cut_by_the_horizon_projects_as_a_sphere_that_sets() {
        for (axis, half) in [(1.2, 0.8), (FRAC_PI_2, 0.5), (0.9, FRAC_PI_2), (1.5, 0.1)] {
            let cone = Cone { axis_theta_rad: axis, axis_phi_rad: -1.0, half_angle_rad: half };
            let sphere = radiometry::projected::sphere_tilted(libm::sin(half), 1.0, axis);
            let expected = sphere.unwrap().sr();
            let found = projected_sr(cone);
            assert!((found / expected - 1.0).abs() < 1e-6, "{axis} {half}: {found} {expected}");
        }
    }

    #[test]
    fn zones_add_up() {
        let zone = Zone { from_rad: 0.2, to_rad: 1.3 };
        let sum = |zone: Zone| zone.directions(6, 4).iter().map(|d| d.weight_sr).sum::<f64>();
        let parts: f64 = zone.split(0.9).into_iter().map(sum).sum();
        let expected = PI * (libm::sin(1.3).powi(2) - libm::sin(0.2).powi(2));
        assert!((parts - expected).abs() < 1e-12 && (sum(zone) - expected).abs() < 1e-12);
    }
}
