//! Radiance, exitance, intensity and flux: integrals over directions, and over the region.

use super::directions::{Cone, Direction, Zone};
use super::sum::{Node, Terms};
use super::{DeriveError, Derived, Field, Remark};
use crate::Ray;
use std::f64::consts::FRAC_PI_2;

impl Field<'_> {
    /// The radiance along a ray of the sample.
    pub fn radiance(&self, ray: &Ray) -> Result<Derived, DeriveError> {
        check_ray(ray)?;
        if self.medium.seen(ray).is_none() {
            return Err(DeriveError::NothingThrough { theta_rad: ray.theta_rad });
        }
        self.refined(|_| Box::new(std::iter::once((Node::Along(*ray), 1.0))))
    }

    /// The exitance M(x, y) at a place, within a zone of directions, in the values' unit times sr.
    pub fn exitance_at(&self, x_m: f64, y_m: f64, zone: Zone) -> Result<Derived, DeriveError> {
        check_ray(&Ray { x_m, y_m, theta_rad: 0.0, phi_rad: 0.0 })?;
        self.over_zone(zone, 1.0, move |theta_rad, phi_rad| {
            Node::Along(Ray { x_m, y_m, theta_rad, phi_rad })
        })
    }

    /// The exitance within a zone of directions, mean over the region.
    pub fn mean_exitance(&self, zone: Zone) -> Result<Derived, DeriveError> {
        self.over_zone(zone, 1.0, |theta_rad, phi_rad| Node::Towards { theta_rad, phi_rad })
    }

    /// The flux that leaves the region within a zone of directions, in the values' unit times m² sr.
    pub fn flux(&self, zone: Zone) -> Result<Derived, DeriveError> {
        let area_m2 = self.area_m2()?;
        self.over_zone(zone, area_m2, |theta_rad, phi_rad| Node::Towards { theta_rad, phi_rad })
    }

    /// The flux that leaves the region within an angle of an axis.
    pub fn flux_into(&self, cone: &Cone) -> Result<Derived, DeriveError> {
        cone.check()?;
        let (area_m2, lines) = (self.area_m2()?, self.lines());
        let rule = |level: usize| -> Terms<'_> {
            let directions = cone.directions(lines / 2 + 3 + 2 * level, lines + 7 + 4 * level);
            Box::new(directions.into_iter().map(move |direction| {
                let Direction { theta_rad, phi_rad, weight_sr } = direction;
                (Node::Towards { theta_rad, phi_rad }, area_m2 * weight_sr)
            }))
        };
        self.refined(rule)
    }

    /// The intensity of the region as a whole in a direction, in the values' unit times m².
    pub fn intensity(&self, theta_rad: f64, phi_rad: f64) -> Result<Derived, DeriveError> {
        check_ray(&Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad })?;
        let weight = self.area_m2()? * libm::cos(theta_rad);
        let node = Node::Towards { theta_rad, phi_rad };
        self.functional(node)?;
        self.refined(move |_| Box::new(std::iter::once((node, weight))))
    }

    /// An integral over a zone. In a medium it ends where nothing comes out any more, or nothing was
    /// measured, and says so.
    fn over_zone(
        &self,
        zone: Zone,
        factor: f64,
        node: impl Fn(f64, f64) -> Node + Copy,
    ) -> Result<Derived, DeriveError> {
        zone.check()?;
        let edge_rad = self.medium.inner_theta_rad(self.fit.region().theta_max_rad);
        let ends_rad =
            if self.medium.is_immersion() { zone.to_rad.min(edge_rad) } else { zone.to_rad };
        let critical_rad = self.medium.inner_theta_rad(FRAC_PI_2);
        if zone.from_rad >= ends_rad {
            return Err(DeriveError::NothingThrough { theta_rad: zone.from_rad });
        }
        let zones = Zone { to_rad: ends_rad, ..zone }.split(edge_rad);
        let lines = self.lines();
        let rule = |level: usize| -> Terms<'_> {
            let (rings, spokes) = (lines / 2 + 3 + 2 * level, lines + 7 + 4 * level);
            let directions =
                zones.clone().into_iter().flat_map(move |zone| zone.directions(rings, spokes));
            Box::new(directions.map(move |direction| {
                let Direction { theta_rad, phi_rad, weight_sr } = direction;
                (node(theta_rad, phi_rad), factor * weight_sr)
            }))
        };
        let mut derived = self.refined(rule)?;
        if ends_rad < zone.to_rad {
            derived.measured_fraction = None;
            derived.remarks.push(Remark::Unmeasured { end_rad: ends_rad, critical_rad });
        }
        Ok(derived)
    }

    /// How many lines the basis may draw over the hemisphere, at least the degree of a polynomial
    /// basis of as many functions: rules begin that fine, so that they don't agree on too little.
    pub(super) fn lines(&self) -> usize {
        let coefficients = self.fit.coefficients().len();
        (1..coefficients).find(|n| n * (n + 1) / 2 >= coefficients).unwrap_or(coefficients)
    }
}

fn check_ray(ray: &Ray) -> Result<(), DeriveError> {
    let refuse = |what, value, expected| Err(DeriveError::Domain { what, value, expected });
    for (what, value) in [("x_m", ray.x_m), ("y_m", ray.y_m), ("phi_rad", ray.phi_rad)] {
        if !value.is_finite() {
            return refuse(what, value, "a finite number");
        }
    }
    if !(ray.theta_rad >= 0.0 && ray.theta_rad <= FRAC_PI_2 + 1e-9) {
        return refuse("theta_rad", ray.theta_rad, "an angle from 0 to π/2");
    }
    Ok(())
}
