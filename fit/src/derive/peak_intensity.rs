//! Where the region as a whole is brightest: the largest intensity and its direction. The value's u
//! is that of the intensity in that direction, as the first order of a maximum knows no place; how well
//! the direction is known [`crate::pointing`] tells.

use super::sum::Node;
use super::{DeriveError, Derived, Field, Remark};
use crate::pointing::{Pointing, STENCIL_RAD, tangents};
use crate::{Estimate, Functional};
use glam::DVec3;
use radiometry::direction::{angles, unit};
use std::f64::consts::{PI, TAU};

/// The largest intensity within the cone that was measured.
#[derive(Debug, Clone, PartialEq)]
pub struct PeakIntensity {
    /// The intensity, in the values' unit times m². The largest of noisy values is on average above
    /// the true largest one by a part of u, which u doesn't include.
    pub intensity: Derived,
    /// Where, from the normal, radians.
    pub theta_rad: f64,
    /// Where, from +x towards +y, radians, in (-π, π].
    pub phi_rad: f64,
    /// Standard uncertainty of the direction along growing θ, radians; `None` where the intensity
    /// is flat there or the peak lies at the rim.
    pub u_theta_rad: Option<f64>,
    /// And across it, as an angle on the sphere.
    pub u_across_rad: Option<f64>,
}

impl Field<'_> {
    /// The largest intensity within the cone that was measured.
    pub fn peak_intensity(&self) -> Result<PeakIntensity, DeriveError> {
        self.demand_leaving("peak intensity")?;
        let area_m2 = self.area_m2()?;
        let end_rad = self.cone_end_rad();
        let lobes = self.lobes(end_rad)?;
        let Some(&(peak, value)) = lobes.first() else { return Err(DeriveError::NoPeak) };
        if value <= 0.0 {
            return Err(DeriveError::NoPeak);
        }
        let (theta_rad, phi_rad) = angles(peak);
        let functional = self.over_area(peak)?;
        let mut intensity =
            self.first_order(area_m2 * value, &functional.clone().times(area_m2), |medium| {
                let field = Field { fit: self.fit, medium };
                Some(area_m2 * field.lobes(field.cone_end_rad()).ok()?.first()?.1)
            });
        if let Some(&(other, _)) = lobes.get(1) {
            let apart = functional.plus(-1.0, &self.over_area(other)?);
            let Estimate { value, u, .. } = self.fit.of(&apart);
            if value.abs() < TIE_U * u {
                intensity.remarks.push(Remark::Tie);
            }
        }
        let is_at_rim = end_rad < PI && theta_rad > end_rad - 2.0 * STENCIL_RAD;
        if is_at_rim {
            intensity.remarks.push(Remark::AtRim);
        }
        let (u_theta_rad, u_across_rad) =
            if is_at_rim { None } else { self.pointing(peak)? }.unzip();
        Ok(PeakIntensity { intensity, theta_rad, phi_rad, u_theta_rad, u_across_rad })
    }

    /// Of the peak's direction, along growing θ and across; `None` where the top is no hill.
    fn pointing(&self, peak: DVec3) -> Result<Option<(f64, f64)>, DeriveError> {
        let known = self.fit.pointing_of(peak, |towards| self.over_area(towards))?;
        Ok(known.map(|Pointing { u_theta_rad, u_across_rad }| (u_theta_rad, u_across_rad)))
    }

    fn cone_end_rad(&self) -> f64 {
        self.medium.inner_theta_rad(self.fit.region().theta_max_rad.min(self.theta_end_rad()))
    }

    /// The intensity over the area as a functional.
    fn over_area(&self, towards: DVec3) -> Result<Functional, DeriveError> {
        let (theta_rad, phi_rad) = angles(towards);
        let node = Node::Towards { theta_rad: theta_rad.min(self.theta_end_rad()), phi_rad };
        let is_whole = self.fit.region().chart.is_whole_sphere();
        let projection = if is_whole { 1.0 } else { towards.z.max(0.0) };
        Ok(self.functional(node)?.times(projection))
    }

    /// The tops of lobes with their heights, the highest first: from the best points of a grid.
    fn lobes(&self, end_rad: f64) -> Result<Vec<(DVec3, f64)>, DeriveError> {
        let value = |towards: DVec3| Ok(self.fit.of_value(&self.over_area(towards)?));
        let rings = (2 * self.lines()).clamp(RINGS_MIN, RINGS_MAX);
        let spokes = 2 * rings;
        let point = |ring: usize, spoke: usize| {
            unit(end_rad * ring as f64 / rings as f64, TAU * spoke as f64 / spokes as f64)
        };
        let mut grid = vec![vec![value(DVec3::Z)?; spokes]];
        for ring in 1..=rings {
            let along = (0..spokes).map(|spoke| value(point(ring, spoke)));
            grid.push(along.collect::<Result<_, DeriveError>>()?);
        }
        let mut starts: Vec<(DVec3, f64)> = Vec::new();
        for ring in 0..=rings {
            for spoke in 0..if ring == 0 { 1 } else { spokes } {
                let here = grid[ring][spoke];
                let (before, after) = ((spoke + spokes - 1) % spokes, (spoke + 1) % spokes);
                let beside = ring == 0 || (here >= grid[ring][before] && here > grid[ring][after]);
                let inner = ring == 0 || here >= grid[ring - 1][spoke];
                let outer = ring == rings
                    || (if ring == 0 { 0..spokes } else { spoke..spoke + 1 })
                        .all(|spoke| here >= grid[ring + 1][spoke]);
                if beside && inner && outer {
                    starts.push((point(ring, spoke), here));
                }
            }
        }
        starts.sort_by(|a, b| b.1.total_cmp(&a.1));
        starts.truncate(LOBES);
        let step_rad = end_rad / rings as f64;
        let mut tops: Vec<(DVec3, f64)> = Vec::new();
        for (start, height) in starts {
            let top = self.climbed(start, height, step_rad, end_rad)?;
            if tops.iter().all(|(other, _)| other.distance(top.0) > step_rad) {
                tops.push(top);
            }
        }
        tops.sort_by(|a, b| b.1.total_cmp(&a.1));
        Ok(tops)
    }

    fn climbed(
        &self,
        start: DVec3,
        height: f64,
        step_rad: f64,
        end_rad: f64,
    ) -> Result<(DVec3, f64), DeriveError> {
        let (mut place, mut value, mut step_rad) = (start, height, step_rad);
        while step_rad > STEP_LAST_RAD {
            let mut best = (place, value);
            for turn in 0..8 {
                let next = aside(place, step_rad, TAU * f64::from(turn) / 8.0);
                if angles(next).0 <= end_rad {
                    let height = self.fit.of_value(&self.over_area(next)?);
                    if height > best.1 {
                        best = (next, height);
                    }
                }
            }
            if best.1 > value { (place, value) = best } else { step_rad *= 0.5 }
        }
        Ok((place, value))
    }
}

/// A direction a step away.
fn aside(place: DVec3, step_rad: f64, turn_rad: f64) -> DVec3 {
    let (along, across) = tangents(place);
    let (sin, cos) = libm::sincos(turn_rad);
    let (sin_step, cos_step) = libm::sincos(step_rad);
    (cos_step * place + sin_step * (cos * along + sin * across)).normalize()
}

const RINGS_MIN: usize = 24;
const RINGS_MAX: usize = 180;
/// Lobes that are climbed.
const LOBES: usize = 8;
const STEP_LAST_RAD: f64 = 1e-6;
const TIE_U: f64 = 2.0;
