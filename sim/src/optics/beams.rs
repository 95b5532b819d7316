//! The mean radiance over a finite beam: by rays, whatever there is to see; and for flat patches
//! exactly where a patch fills the beam, with cuts along the outlines where it does not.

use std::sync::Arc;

use glam::DVec2;
use radiometry::beam::{Beam, BeamRule, Footprint, Placed, disk_rule};
use radiometry::quadrature::Sum;

use super::coverage::{Rules, Sight};
use super::{Axis, Optics};
use crate::field::{Field, Patch, Ray};

/// Of the rule for h⁴/r⁴ over the stop.
const STOP_DEGREE: usize = 13;

/// By the rays of a rule.
#[derive(Debug, Clone)]
pub(crate) struct ByRays {
    field: Arc<dyn Field>,
    beam: Beam,
    rule: BeamRule,
}

impl ByRays {
    pub(crate) fn new(field: Arc<dyn Field>, beam: Beam, degree: usize) -> Self {
        Self { field, rule: beam.rule(degree), beam }
    }
}

impl Optics for ByRays {
    fn radiance(&self, axis: &Axis) -> f64 {
        let placed = Placed::new(axis.spot, axis.direction);
        self.rule.mean(|ray| {
            let (point, direction) = (placed.point(ray.point), placed.direction(ray.direction));
            // A point of the pupil below the plane sees nothing of the sample.
            let along = self.beam.separation_m() / ray.direction.z;
            if point.z + along * direction.z <= 0.0 {
                return 0.0;
            }
            Ray::through(point, direction).map_or(0.0, |ray| self.field.radiance(&ray))
        })
    }

    fn looking_at(&self, field: Arc<dyn Field>) -> Arc<dyn Optics> {
        Arc::new(Self { field, ..self.clone() })
    }
}

/// What is before a beam.
enum Before<'p> {
    /// None of the patches.
    Nothing,
    /// One that fills it.
    One(&'p Patch),
    /// An outline, perhaps.
    Outlines,
}

/// Over flat patches, which are all that there is to see.
#[derive(Debug, Clone)]
pub(crate) struct OverPatches {
    field: Arc<dyn Field>,
    patches: Vec<Patch>,
    beam: Beam,
    /// For a beam that one patch fills.
    inside: ByRays,
    /// The pupil's points, for a beam across an outline.
    pupil: Vec<(DVec2, f64)>,
    rules: Rules,
    /// One over the mean of h⁴/r⁴ over pupil and stop.
    scale: f64,
}

impl OverPatches {
    /// `inside`: the degree of the rule for a beam that a patch fills; `pupil`: that of the
    /// pupil's for a beam across an outline.
    pub(crate) fn new(
        field: &Arc<dyn Field>,
        patches: Vec<Patch>,
        beam: Beam,
        inside: usize,
        pupil: usize,
    ) -> Self {
        // A radiance that is the same everywhere needs no more than the weights do.
        let is_even = patches.iter().all(|patch| patch.uniform.is_some());
        let rule = disk_rule(pupil);
        // What these points of the pupil make of the whole stop: so the mean of one is one.
        let (r, s, h) = (beam.pupil_radius_m(), beam.stop_radius_m(), beam.separation_m());
        let whole: Sum = rule
            .iter()
            .flat_map(|(on_pupil, weight)| {
                disk_rule(STOP_DEGREE).into_iter().map(move |(on_stop, part)| {
                    let across = (*on_pupil * r - on_stop * s) / h;
                    let ratio = 1.0 / (1.0 + across.length_squared());
                    weight * part * ratio * ratio
                })
            })
            .collect();
        let scale = 1.0 / whole.value();
        Self {
            inside: ByRays::new(Arc::clone(field), beam, inside),
            field: Arc::clone(field),
            patches,
            beam,
            pupil: rule,
            rules: Rules::new(if is_even { 2 } else { 4 }),
            scale,
        }
    }

    /// What the footprint lies on.
    fn before(&self, axis: &Axis) -> Before<'_> {
        let footprint = Footprint::on_plane(&self.beam, axis.spot, axis.direction);
        let ray = Ray::through(axis.spot, axis.direction);
        let (Some(footprint), Some(ray)) = (footprint, ray) else { return Before::Outlines };
        let (at, radius) = (ray.point.truncate(), footprint.radius_m());
        let mut before = Before::Nothing;
        for patch in &self.patches {
            if patch.boundary.distance(at) <= radius {
                return Before::Outlines;
            }
            if patch.boundary.holds(at) {
                before = Before::One(patch);
            }
        }
        before
    }

    fn across(&self, axis: &Axis) -> f64 {
        let placed = Placed::new(axis.spot, axis.direction);
        let mut sum = Sum::default();
        for (on_pupil, weight) in &self.pupil {
            let Some(sight) = Sight::new(&self.beam, &self.rules, &placed, *on_pupil) else {
                continue;
            };
            for patch in &self.patches {
                let mean = sight.mean_of(&patch.boundary, |point, direction| match patch.uniform {
                    Some(radiance) => radiance,
                    None => self.field.radiance(&Ray { point, direction }),
                });
                sum.add(weight * mean);
            }
        }
        sum.value() * self.scale
    }
}

impl Optics for OverPatches {
    fn radiance(&self, axis: &Axis) -> f64 {
        match self.before(axis) {
            Before::Nothing => 0.0,
            Before::One(patch) => match patch.uniform {
                Some(radiance) => radiance,
                None => self.inside.radiance(axis),
            },
            Before::Outlines => self.across(axis),
        }
    }

    fn looking_at(&self, field: Arc<dyn Field>) -> Arc<dyn Optics> {
        let inside = ByRays { field: Arc::clone(&field), ..self.inside.clone() };
        Arc::new(Self { field, inside, ..self.clone() })
    }
}
