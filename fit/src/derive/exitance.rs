//! Radiance, exitance, intensity and flux: integrals over directions, and over the region.

use super::directions::{Cone, Direction, Zone};
use super::sum::{Node, Terms};
use super::{ALL_DIRECTIONS, DeriveError, Derived, Field, HEMISPHERE, Medium, Remark, of_chart};
use crate::{Chart, Ray};
use std::f64::consts::FRAC_PI_2;

impl Field<'_> {
    /// The radiance along a ray of the sample.
    pub fn radiance(&self, ray: &Ray) -> Result<Derived, DeriveError> {
        check_ray(ray, self.theta_end_rad())?;
        if self.medium.seen(ray).is_none() {
            return Err(DeriveError::NothingThrough { theta_rad: ray.theta_rad });
        }
        self.refined(|_| Box::new(std::iter::once((Node::Along(*ray), 1.0))))
    }

    /// The exitance M(x, y) at a place, within a zone of directions, in the values' unit times sr.
    pub fn exitance_at(&self, x_m: f64, y_m: f64, zone: Zone) -> Result<Derived, DeriveError> {
        self.demand_surface("exitance")?;
        check_ray(&Ray { x_m, y_m, theta_rad: 0.0, phi_rad: 0.0 }, FRAC_PI_2)?;
        self.over_zone(zone, 1.0, move |theta_rad, phi_rad| {
            Node::Along(Ray { x_m, y_m, theta_rad, phi_rad })
        })
    }

    /// The exitance within a zone of directions, mean over the region.
    pub fn mean_exitance(&self, zone: Zone) -> Result<Derived, DeriveError> {
        self.demand_surface("exitance")?;
        self.over_zone(zone, 1.0, |theta_rad, phi_rad| Node::Towards { theta_rad, phi_rad })
    }

    /// The flux that leaves the region within a zone of directions, in the values' unit times m² sr;
    /// between two planes that through both rectangles, of all directions alone.
    pub fn flux(&self, zone: Zone) -> Result<Derived, DeriveError> {
        if let Chart::TwoPlane { .. } = self.fit.region().chart {
            return self.flux_through_both(zone);
        }
        self.demand_leaving("flux")?;
        let area_m2 = self.area_m2()?;
        self.over_zone(zone, area_m2, |theta_rad, phi_rad| Node::Towards { theta_rad, phi_rad })
    }

    /// The flux that leaves the region within an angle of an axis.
    pub fn flux_into(&self, cone: &Cone) -> Result<Derived, DeriveError> {
        self.demand_leaving("flux into a cone")?;
        let is_whole = self.fit.region().chart.is_whole_sphere();
        cone.check(self.theta_end_rad())?;
        let (area_m2, lines) = (self.area_m2()?, self.lines());
        let rule = |level: usize| -> Terms<'_> {
            let (rings, spokes) = (lines / 2 + 3 + 2 * level, lines + 7 + 4 * level);
            let directions = if is_whole {
                cone.all_directions(rings, spokes)
            } else {
                cone.directions(rings, spokes)
            };
            Box::new(directions.into_iter().map(move |direction| {
                let Direction { theta_rad, phi_rad, weight_sr } = direction;
                (Node::Towards { theta_rad, phi_rad }, area_m2 * weight_sr)
            }))
        };
        self.refined(rule)
    }

    /// The intensity of the region as a whole in a direction, in the values' unit times m².
    pub fn intensity(&self, theta_rad: f64, phi_rad: f64) -> Result<Derived, DeriveError> {
        self.demand_leaving("intensity")?;
        check_ray(&Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad }, self.theta_end_rad())?;
        let weight = self.area_m2()? * self.projection(theta_rad);
        let node = Node::Towards { theta_rad, phi_rad };
        self.functional(node)?;
        self.refined(move |_| Box::new(std::iter::once((node, weight))))
    }

    /// The flux through both rectangles of the two-plane chart.
    fn flux_through_both(&self, zone: Zone) -> Result<Derived, DeriveError> {
        if zone != ALL_DIRECTIONS && zone != HEMISPHERE {
            return Err(of_chart("flux into a zone", &self.fit.region().chart));
        }
        if !matches!(self.medium, Medium::Air) {
            let what = "flux through a window removed";
            return Err(of_chart(what, &self.fit.region().chart));
        }
        let flux = self.fit.throughput_sum();
        Ok(Derived {
            measured_fraction: Some(1.0),
            functional: Some(flux.clone()),
            ..self.first_order(self.fit.of(&flux).value, &flux, |_| None)
        })
    }

    /// An integral over a zone. In a medium it ends where nothing comes out any more, or nothing was
    /// measured, and says so.
    fn over_zone(
        &self,
        zone: Zone,
        factor: f64,
        node: impl Fn(f64, f64) -> Node + Copy,
    ) -> Result<Derived, DeriveError> {
        let zone = if zone == ALL_DIRECTIONS {
            Zone { from_rad: 0.0, to_rad: self.theta_end_rad() }
        } else {
            zone
        };
        zone.check(self.theta_end_rad())?;
        let is_whole = self.fit.region().chart.is_whole_sphere();
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
            let directions = zones.clone().into_iter().flat_map(move |zone| {
                if is_whole {
                    zone.all_directions(rings, spokes)
                } else {
                    zone.directions(rings, spokes)
                }
            });
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

fn check_ray(ray: &Ray, end_rad: f64) -> Result<(), DeriveError> {
    let refuse = |what, value, expected| Err(DeriveError::Domain { what, value, expected });
    for (what, value) in [("x_m", ray.x_m), ("y_m", ray.y_m), ("phi_rad", ray.phi_rad)] {
        if !value.is_finite() {
            return refuse(what, value, "a finite number");
        }
    }
    if !(ray.theta_rad >= 0.0 && ray.theta_rad <= end_rad + 1e-9) {
        let is_whole = end_rad > FRAC_PI_2;
        let expected = if is_whole { "an angle from 0 to π" } else { "an angle from 0 to π/2" };
        return refuse("theta_rad", ray.theta_rad, expected);
    }
    Ok(())
}
