//! Means over a beam: rays with weights, from one to thousands, and the beam's moments.
//!
//! The throughput of a ray through two parallel disks a distance h apart is
//! dT = cos θ cos θ' dA dA' / r² = h²/r⁴ dA dA' (Nicodemus 1963). Each disk has a product rule
//! (Stroud 1971, S₂): Gauss-Legendre in ρ², the mean over equidistant azimuths.

use glam::{DVec2, DVec3};

use super::Beam;
use crate::domain::DomainError;
use crate::quadrature::{Sum, gauss_legendre};

/// A ray of a beam, in the beam's frame.
/// Who needs it: the simulator and the fit: see [`BeamRule`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeamRay {
    /// Where it passes the stop (the spot), metres; any point of the ray would do.
    pub point: DVec3,
    /// Of length one, to the detector.
    pub direction: DVec3,
    /// Its part of the throughput; all are positive and sum to one.
    pub weight: f64,
}

/// Rays that stand for a beam.
/// Who needs it: the simulator and the fit, to average a field over a reading's beam.
#[derive(Debug, Clone, PartialEq)]
pub struct BeamRule {
    rays: Vec<BeamRay>,
    throughput_m2_sr: f64,
}

/// Second moments of a beam, the same in any plane through its axis, throughput-weighted.
/// Who needs it: the fit, to tell whether a point may stand for a beam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments {
    /// Of a ray's place across the axis at the origin, one component, m².
    pub position_m2: f64,
    /// Of a ray's direction across the axis, one component of the unit vector.
    pub direction: f64,
    /// Of the two together, m: below zero where rays that start on one side lean to the other.
    pub position_direction_m: f64,
}

/// Nodes and weights on the unit disk, exact for polynomials in x and y up to `degree`; the weights
/// sum to one. Degree 0 and 1: the centre alone. Each ring begins on the x axis.
/// Who needs it: [`BeamRule`] on pupil and spot.
///
/// ```
/// use radiometry::beam::disk_rule;
/// // The mean of x² over a unit disk is 1/4.
/// let mean: f64 = disk_rule(3).iter().map(|(node, weight)| weight * node.x * node.x).sum();
/// assert!((mean - 0.25).abs() < 1e-16);
/// ```
pub fn disk_rule(degree: usize) -> Vec<(DVec2, f64)> {
    if degree <= 1 {
        return vec![(DVec2::ZERO, 1.0)];
    }
    // Rings integrate ρ² to degree 2n - 1, that is ρ to 4n - 2, and odd powers vanish; spokes
    // resolve azimuthal orders below their number.
    let (rings, spokes) = ((degree + 1).div_ceil(4), degree + 1);
    let mut nodes = Vec::with_capacity(rings * spokes);
    for (t, weight) in gauss_legendre(rings) {
        let radius = f64::midpoint(1.0, t).sqrt();
        for k in 0..spokes {
            let angle = core::f64::consts::TAU * k as f64 / spokes as f64;
            let (sin, cos) = libm::sincos(angle);
            let node = DVec2::new(radius * cos, radius * sin);
            nodes.push((node, weight / 2.0 / spokes as f64));
        }
    }
    nodes
}

impl Beam {
    /// The rule whose disks are exact to `degree`: 1 ray, or the square of the disk's nodes (16
    /// for degree 3, 144 for 5, 256 for 7, 900 for 9). Rays are the product of both disks'; their
    /// weights carry h²/r⁴ and are scaled to sum to one, so that the mean of a constant is exact.
    ///
    /// Edges (the field jumps within the beam) are beyond any degree: the error then falls only
    /// with the number of rays.
    ///
    /// ```
    /// use radiometry::beam::Beam;
    /// let beam = Beam::of_spot(0.01, 0.005, 0.2)?;
    /// let rule = beam.rule(7);
    /// // What the rule makes of the throughput, beside the closed form.
    /// let off = rule.throughput_m2_sr() / beam.throughput()?.m2_sr() - 1.0;
    /// assert!(off.abs() < 1e-10);
    /// assert!((rule.mean(|_| 3.0) - 3.0).abs() < 1e-15 * 3.0);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn rule(&self, degree: usize) -> BeamRule {
        self.rule_of(degree, degree)
    }

    /// The same with a degree for each disk: what goes with the place on the spot alone, as on a
    /// Lambertian surface, needs many places and few directions.
    ///
    /// ```
    /// use radiometry::beam::Beam;
    /// let rule = Beam::of_spot(0.01, 0.005, 0.2)?.rule_of(14, 3);
    /// assert_eq!(rule.rays().len(), 60 * 4);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn rule_of(&self, stop_degree: usize, pupil_degree: usize) -> BeamRule {
        let (stop_rule, pupil_rule) = (disk_rule(stop_degree), disk_rule(pupil_degree));
        let h = self.separation_m;
        let mut rays = Vec::with_capacity(stop_rule.len() * pupil_rule.len());
        let mut sum = Sum::default();
        for (on_stop, stop_weight) in &stop_rule {
            for (on_pupil, pupil_weight) in &pupil_rule {
                let stop = *on_stop * self.stop_radius_m;
                let across = *on_pupil * self.pupil_radius_m - stop;
                let r2 = h * h + across.length_squared();
                let ratio = h * h / r2;
                let weight = stop_weight * pupil_weight * ratio * ratio;
                sum.add(weight);
                rays.push(BeamRay {
                    point: stop.extend(self.stop_z_m),
                    direction: across.extend(h) / r2.sqrt(),
                    weight,
                });
            }
        }
        let sum = sum.value();
        for ray in &mut rays {
            ray.weight /= sum;
        }
        let area = |radius: f64| core::f64::consts::PI * radius * radius;
        let scale = area(self.pupil_radius_m) / h * (area(self.stop_radius_m) / h);
        BeamRule { rays, throughput_m2_sr: sum * scale }
    }

    /// The second moments, by the rule of degree 9: what it misses goes with the tenth power of
    /// (R + r)/h, rounding for the beams of spot detectors.
    ///
    /// ```
    /// use radiometry::beam::Beam;
    /// // A slender beam: ⟨x²⟩ = r²/4 of the spot, ⟨u²⟩ = (R² + r²)/4h², ⟨xu⟩ = -r²/4h.
    /// let (pupil, spot, h) = (1e-3, 2e-3, 1.0);
    /// let moments = Beam::of_spot(pupil, spot, h)?.moments()?;
    /// assert!((moments.position_m2 / (spot * spot / 4.0) - 1.0).abs() < 1e-5);
    /// let direction = (pupil * pupil + spot * spot) / 4.0;
    /// assert!((moments.direction / direction - 1.0).abs() < 1e-5);
    /// assert!((moments.position_direction_m / (-spot * spot / 4.0) - 1.0).abs() < 1e-5);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn moments(&self) -> Result<Moments, DomainError> {
        let rule = self.rule(MOMENTS_DEGREE);
        let at_origin = |ray: &BeamRay| ray.point - ray.direction * (ray.point.z / ray.direction.z);
        let across = |a: DVec3, b: DVec3| f64::midpoint(a.x * b.x, a.y * b.y);
        let moments = Moments {
            position_m2: rule.mean(|ray| across(at_origin(ray), at_origin(ray))),
            direction: rule.mean(|ray| across(ray.direction, ray.direction)),
            position_direction_m: rule.mean(|ray| across(at_origin(ray), ray.direction)),
        };
        if moments.position_m2.is_finite() {
            Ok(moments)
        } else {
            Err(DomainError::Overflow { result: "position_m2" })
        }
    }
}

const MOMENTS_DEGREE: usize = 9;

impl BeamRule {
    /// The rays, in a fixed order.
    pub fn rays(&self) -> &[BeamRay] {
        &self.rays
    }

    /// The mean of a function over the beam.
    pub fn mean(&self, mut of: impl FnMut(&BeamRay) -> f64) -> f64 {
        let mut sum = Sum::default();
        for ray in &self.rays {
            sum.add(ray.weight * of(ray));
        }
        sum.value()
    }

    /// The throughput as these rays have it: beside [`Beam::throughput`] it tells how well they
    /// follow the beam.
    pub const fn throughput_m2_sr(&self) -> f64 {
        self.throughput_m2_sr
    }
}
