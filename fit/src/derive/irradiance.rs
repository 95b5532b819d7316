//! The irradiance that the region causes at a receiver: E = ∬ L cos θ cos θ'/d² dA, the mean over
//! the receiver's face. Nothing stands between, and nothing is thrown back.
//!
//! The part of the region that the face looks at is cut out first, so that no rule runs over the
//! edge where cos θ' ends. Then both sides are cut into pieces no larger than their distance.

use super::patch::Patch;
use super::receiver::Receiver;
use super::sum::{Node, Terms};
use super::{DeriveError, Derived, Field, Remark};
use crate::{Ray, Region};
use glam::DVec3;
use radiometry::direction::angles;
use radiometry::quadrature::gauss_legendre;
use std::f64::consts::FRAC_PI_2;

/// What a receiver receives.
#[derive(Debug, Clone, PartialEq)]
pub struct Received {
    /// The irradiance, mean over the receiver's face, in the values' unit times sr.
    pub irradiance: Derived,
    /// The flux, irradiance times the receiver's area, in the values' unit times m² sr; of a point
    /// there is none.
    pub flux: Option<Derived>,
}

impl Field<'_> {
    /// What arrives at a receiver from the region.
    pub fn received(&self, receiver: &Receiver) -> Result<Received, DeriveError> {
        if self.medium.is_immersion() {
            return Err(DeriveError::InAir { what: "the receiver" });
        }
        self.demand_surface("irradiance at a receiver elsewhere")?;
        self.area_m2()?;
        let region = *self.fit.region();
        let lit = seen_part(&region, receiver);
        let nodes_first = 4 + self.lines() / 4;
        let grid = |level: usize| -> Option<Vec<(DVec3, f64)>> {
            receiver.nodes(&gauss_legendre(3 + level), |centre, extent| {
                (to_rectangle(&region, centre) - extent).max(0.0)
            })
        };
        // Pieces don't change with the level, so that it is known here whether there are too many;
        // and those of the region multiply with the logarithm of the distance alone.
        let extent_m = libm::hypot(region.x_m.1 - region.x_m.0, region.y_m.1 - region.y_m.0);
        if receiver.lowest_m() < NEAREST_BY_EXTENT * extent_m || grid(0).is_none() {
            return Err(DeriveError::TooNear { height_m: receiver.lowest_m() });
        }
        let normal = receiver.normal();
        let rule = |level: usize| -> Terms<'_> {
            let gauss = gauss_legendre(nodes_first + 2 * level);
            let (lit, receivers) = (lit.clone(), grid(level).unwrap_or_default());
            Box::new(receivers.into_iter().flat_map(move |(place, share)| {
                let distance =
                    |centre: DVec3, extent: f64| (centre.distance(place) - extent).max(0.0);
                let pieces = Patch::graded(lit.clone(), distance).unwrap_or_default();
                let gauss = gauss.clone();
                pieces.into_iter().flat_map(move |piece| {
                    piece
                        .nodes(&gauss)
                        .map(|(foot, area)| arriving(foot, place, normal, share * area))
                        .collect::<Vec<_>>()
                })
            }))
        };
        let mut irradiance = self.refined(rule)?;
        if lit.is_empty() {
            irradiance.remarks.push(Remark::FaceAway);
        }
        let area_m2 = receiver.area_m2();
        let flux = (area_m2 > 0.0).then(|| irradiance.clone().times(area_m2));
        Ok(Received { irradiance, flux })
    }
}

/// The ray from a place on the sample to one on the receiver, and cos θ cos θ'/d² times the weight.
fn arriving(foot: DVec3, place: DVec3, normal: DVec3, weight: f64) -> (Node, f64) {
    let across = place - foot;
    let distance2 = across.length_squared();
    let towards = across / distance2.sqrt();
    let kernel = towards.z * (-towards.dot(normal)).max(0.0) / distance2;
    let (theta_rad, phi_rad) = angles(towards);
    let ray = Ray { x_m: foot.x, y_m: foot.y, theta_rad: theta_rad.min(FRAC_PI_2), phi_rad };
    (Node::Along(ray), weight * kernel)
}

/// The part of the region's rectangle in front of the receiver's face, as triangles.
fn seen_part(region: &Region, receiver: &Receiver) -> Vec<Patch> {
    let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    let ((x0, x1), (y0, y1)) = (region.x_m, region.y_m);
    let corners = [corner(x0, y0), corner(x1, y0), corner(x1, y1), corner(x0, y1)];
    let height = |point: DVec3| (point - receiver.place_m()).dot(receiver.normal());
    // Sutherland and Hodgman (1974), one edge.
    let mut outline: Vec<DVec3> = Vec::new();
    for (i, &here) in corners.iter().enumerate() {
        let next = corners[(i + 1) % corners.len()];
        let (a, b) = (height(here), height(next));
        if a > 0.0 {
            outline.push(here);
        }
        if (a > 0.0) != (b > 0.0) {
            outline.push(here + (next - here) * (a / (a - b)));
        }
    }
    let fan = |i: usize| Patch::Triangle([outline[0], outline[i], outline[i + 1]]);
    (1..outline.len().saturating_sub(1)).map(fan).collect()
}

/// From a point to the nearest one of the region's rectangle, m.
fn to_rectangle(region: &Region, point: DVec3) -> f64 {
    let nearest = DVec3::new(
        point.x.clamp(region.x_m.0, region.x_m.1),
        point.y.clamp(region.y_m.0, region.y_m.1),
        0.0,
    );
    point.distance(nearest)
}

/// A receiver nearer to the plane than this share of the region's diagonal touches it.
const NEAREST_BY_EXTENT: f64 = 1e-9;
