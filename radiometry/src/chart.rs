//! Charts of the space of rays: four numbers that name a ray, and how much throughput lies in a
//! small box of them, dT/(dp₁ dp₂ dp₃ dp₄). And the two-dimensional chart of an environment.
//!
//! A beam has one throughput whatever it is written in; each chart has rays that it cannot name,
//! and answers none for those. For the page on ray charts; the rig's files and the fit write rays in the
//! surface chart's coordinates. Rays are lines with a sense here: where along one is not known.

use glam::DVec3;

use crate::direction::{angles, normalised, unit};
use crate::domain::{DomainError, finite, finite_vector, positive, within};

/// A line with a sense: the way light runs.
/// Who needs it: the charts, which all name lines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    point_m: DVec3,
    direction: DVec3,
}

impl Line {
    /// Through a point, along a direction of any length but zero.
    pub fn new(point_m: DVec3, direction: DVec3) -> Result<Self, DomainError> {
        let direction = finite_vector("direction", direction)?;
        let unit = normalised(direction);
        let direction = unit.ok_or(DomainError::ZeroVector { argument: "direction" })?;
        Ok(Self { point_m: finite_vector("point", point_m)?, direction })
    }

    /// One of its points.
    pub const fn point_m(&self) -> DVec3 {
        self.point_m
    }

    /// Its unit vector.
    pub const fn direction(&self) -> DVec3 {
        self.direction
    }

    /// Where it crosses the plane z = `height`; none where it runs beside it.
    fn at_height(&self, height_m: f64) -> Option<DVec3> {
        let along = (height_m - self.point_m.z) / self.direction.z;
        along.is_finite().then(|| self.point_m + along * self.direction)
    }
}

/// The surface chart: where a ray leaves the plane z = 0, and its direction from the normal +z.
/// dT = cos θ sin θ dx dy dθ dφ. It names the rays with a direction in z > 0.
/// Who needs it: the page on ray charts: the rig's own coordinates (x, y, θ, φ).
///
/// ```
/// use radiometry::chart::{Line, Surface};
/// let line = Line::new(glam::DVec3::new(1.0, 2.0, 3.0), glam::DVec3::new(1.0, 0.0, 1.0))?;
/// let ray = Surface::of(&line).unwrap();
/// assert!((ray.x_m + 2.0).abs() < 1e-15 && ray.y_m == 2.0);
/// assert!((ray.density() - 0.5).abs() < 1e-15); // cos 45° sin 45°
/// # Ok::<(), radiometry::DomainError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Where it leaves, m.
    pub x_m: f64,
    /// Where it leaves, m.
    pub y_m: f64,
    /// From +z, in [0, π/2), radians.
    pub theta_rad: f64,
    /// From +x towards +y, radians.
    pub phi_rad: f64,
}

impl Surface {
    /// The line's name; none for one that doesn't leave the surface.
    pub fn of(line: &Line) -> Option<Self> {
        if line.direction.z <= 0.0 {
            return None;
        }
        let place = line.at_height(0.0)?;
        let (theta_rad, phi_rad) = angles(line.direction);
        Some(Self { x_m: place.x, y_m: place.y, theta_rad, phi_rad })
    }

    /// The line of that name.
    pub fn line(&self) -> Result<Line, DomainError> {
        let theta = within("theta_rad", self.theta_rad, 0.0, core::f64::consts::FRAC_PI_2)?;
        Line::new(DVec3::new(self.x_m, self.y_m, 0.0), unit(theta, finite("phi", self.phi_rad)?))
    }

    /// dT/(dx dy dθ dφ) = cos θ sin θ, sr/rad²; 0 at the pole and at the horizon.
    pub fn density(&self) -> f64 {
        let (sin, cos) = libm::sincos(self.theta_rad);
        sin * cos
    }
}

/// The perpendicular chart: a ray's direction, and where it pierces the plane through the origin
/// across it. dT = sin θ dθ dφ dx dy. It names every ray. The plane's x runs along the direction of
/// growing θ, its y along that of growing φ; at the poles, where no frame is continuous, φ is 0.
/// Who needs it: the page on ray charts: all light leaving an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Perpendicular {
    /// From +z, in [0, π], radians.
    pub theta_rad: f64,
    /// From +x towards +y, radians.
    pub phi_rad: f64,
    /// Along growing θ, m.
    pub x_m: f64,
    /// Along growing φ, m.
    pub y_m: f64,
}

impl Perpendicular {
    /// The line's name.
    pub fn of(line: &Line) -> Self {
        let (theta_rad, phi_rad) = angles(line.direction);
        let (along_theta, along_phi) = transverse(theta_rad, phi_rad);
        let (x_m, y_m) = (line.point_m.dot(along_theta), line.point_m.dot(along_phi));
        Self { theta_rad, phi_rad, x_m, y_m }
    }

    /// The line of that name.
    pub fn line(&self) -> Result<Line, DomainError> {
        let theta = within("theta_rad", self.theta_rad, 0.0, core::f64::consts::PI)?;
        let phi = finite("phi_rad", self.phi_rad)?;
        let (along_theta, along_phi) = transverse(theta, phi);
        Line::new(self.x_m * along_theta + self.y_m * along_phi, unit(theta, phi))
    }

    /// dT/(dθ dφ dx dy) = sin θ, sr/rad²; 0 at the poles.
    pub fn density(&self) -> f64 {
        libm::sin(self.theta_rad)
    }
}

/// The unit vectors along growing θ and φ.
fn transverse(theta: f64, phi: f64) -> (DVec3, DVec3) {
    let (sin_theta, cos_theta) = libm::sincos(theta);
    let (sin_phi, cos_phi) = libm::sincos(phi);
    (
        DVec3::new(cos_theta * cos_phi, cos_theta * sin_phi, -sin_theta),
        DVec3::new(-sin_phi, cos_phi, 0.0),
    )
}

/// The two-plane chart: where a ray pierces the planes z = 0 and z = distance.
/// dT = cos θ cos θ'/r² du dv ds dt, r the distance of both places. It names the rays with a
/// direction in z > 0.
/// Who needs it: the page on ray charts: light fields and camera arrays.
///
/// ```
/// use radiometry::chart::TwoPlane;
/// let straight = TwoPlane { u_m: 1.0, v_m: 1.0, s_m: 1.0, t_m: 1.0, distance_m: 2.0 };
/// assert_eq!(straight.density(), 0.25);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoPlane {
    /// Place in z = 0, m.
    pub u_m: f64,
    /// Place in z = 0, m.
    pub v_m: f64,
    /// Place in the second plane, m.
    pub s_m: f64,
    /// Place in the second plane, m.
    pub t_m: f64,
    /// Between the planes, above 0, m.
    pub distance_m: f64,
}

impl TwoPlane {
    /// The line's name between planes at that distance; none for one that does not run upward.
    pub fn of(line: &Line, distance_m: f64) -> Option<Self> {
        if line.direction.z <= 0.0 {
            return None;
        }
        let (first, second) = (line.at_height(0.0)?, line.at_height(distance_m)?);
        Some(Self { u_m: first.x, v_m: first.y, s_m: second.x, t_m: second.y, distance_m })
    }

    /// The line of that name.
    pub fn line(&self) -> Result<Line, DomainError> {
        let distance = positive("distance_m", self.distance_m)?;
        let across = DVec3::new(self.s_m - self.u_m, self.t_m - self.v_m, distance);
        Line::new(DVec3::new(self.u_m, self.v_m, 0.0), across)
    }

    /// dT/(du dv ds dt) = cos θ cos θ'/r² = d²/r⁴, sr/m².
    pub fn density(&self) -> f64 {
        let across = libm::hypot(self.s_m - self.u_m, self.t_m - self.v_m);
        let separation = libm::hypot(across, self.distance_m);
        let cos = self.distance_m / separation;
        let cos_by_distance = cos / separation;
        cos_by_distance * cos_by_distance
    }
}

/// The environment chart: the directions from which light comes to one point, from the receiver's
/// normal +z. Two-dimensional: dΩ̃ = cos θ sin θ dθ dφ. It names the directions above the horizon.
/// Who needs it: the page on ray charts: what arrives at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Environment {
    /// From +z, in [0, π/2], radians.
    pub theta_rad: f64,
    /// From +x towards +y, radians.
    pub phi_rad: f64,
}

impl Environment {
    /// The name of a direction towards the light; none below the horizon and for the zero vector.
    pub fn of(towards: DVec3) -> Option<Self> {
        if !towards.is_finite() || towards == DVec3::ZERO || towards.z < 0.0 {
            return None;
        }
        let (theta_rad, phi_rad) = angles(towards);
        Some(Self { theta_rad, phi_rad })
    }

    /// The unit vector of that name.
    pub fn direction(&self) -> DVec3 {
        unit(self.theta_rad, self.phi_rad)
    }

    /// dΩ̃/(dθ dφ) = cos θ sin θ, sr/rad²; nothing from below the horizon.
    pub fn density(&self) -> f64 {
        let (sin, cos) = libm::sincos(self.theta_rad);
        (sin * cos).max(0.0)
    }
}

/// Which of the lines the surface chart and the two-plane chart can name: those that run upward.
/// Who needs it: the charts that name half of all rays only.
pub fn upward(lines: &[Line]) -> Vec<bool> {
    lines.iter().map(|line| line.direction.z > 0.0).collect()
}
