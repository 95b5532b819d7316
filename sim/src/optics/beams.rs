//! The mean radiance over a finite beam: by rays, whatever there is to see; and for flat patches by
//! directions or places alone where a patch fills the beam, with cuts along the outlines where none does.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use radiometry::beam::{Beam, BeamRule, Footprint, Placed, disk_rule};
use radiometry::quadrature::Sum;

use super::coverage::{Rules, Sight};
use super::table::{Tabled, Wanted};
use super::{Axis, Optics};
use crate::Region;
use crate::field::{Field, Goes, Patch, Ray};

/// Of the rule for h⁴/r⁴ over the stop.
const STOP_DEGREE: usize = 13;

/// The rays of a rule.
#[derive(Debug, Clone)]
pub(crate) struct Rays {
    beam: Beam,
    rule: BeamRule,
}

impl Rays {
    /// Of these degrees over the stop and over the pupil.
    pub(crate) fn new(beam: Beam, stop: usize, pupil: usize) -> Self {
        Self { rule: beam.rule_of(stop, pupil), beam }
    }

    fn mean(&self, axis: &Axis, mut radiance: impl FnMut(&Ray) -> f64) -> f64 {
        let placed = Placed::new(axis.spot, axis.direction);
        self.rule.mean(|ray| {
            let (point, direction) = (placed.point(ray.point), placed.direction(ray.direction));
            // A point of the pupil below the plane sees nothing of the sample.
            let along = self.beam.separation_m() / ray.direction.z;
            if point.z + along * direction.z <= 0.0 {
                return 0.0;
            }
            Ray::through(point, direction).map_or(0.0, |ray| radiance(&ray))
        })
    }
}

/// By the rays of a rule.
#[derive(Debug, Clone)]
pub(crate) struct ByRays {
    pub(crate) field: Arc<dyn Field>,
    pub(crate) rays: Rays,
}

impl Optics for ByRays {
    fn radiance(&self, axis: &Axis) -> f64 {
        self.rays.mean(axis, |ray| self.field.radiance(ray))
    }

    fn looking_at(&self, field: Arc<dyn Field>) -> Arc<dyn Optics> {
        Arc::new(Self { field, rays: self.rays.clone() })
    }
}

/// By the directions of a beam: of a field that goes with direction alone.
#[derive(Debug, Clone)]
pub(crate) struct ByDirections {
    pub(crate) field: Arc<dyn Field>,
    /// Beam's frame.
    pub(crate) directions: Vec<(DVec3, f64)>,
}

impl ByDirections {
    fn mean(&self, axis: &Axis, radiance: impl Fn(&Ray) -> f64) -> f64 {
        let placed = Placed::new(axis.spot, axis.direction);
        let point = Ray::through(axis.spot, axis.direction).map_or(axis.spot, |ray| ray.point);
        let parts = self.directions.iter().map(|(direction, weight)| {
            weight * radiance(&Ray { point, direction: placed.direction(*direction) })
        });
        parts.sum()
    }
}

impl Optics for ByDirections {
    fn radiance(&self, axis: &Axis) -> f64 {
        self.mean(axis, |ray| self.field.radiance(ray))
    }

    fn looking_at(&self, field: Arc<dyn Field>) -> Arc<dyn Optics> {
        Arc::new(Self { field, directions: self.directions.clone() })
    }
}

/// A field read from tables, where it goes with the place alone.
pub(crate) fn tabled(
    field: &Arc<dyn Field>,
    region: &Region,
    wanted: Wanted,
) -> Option<Arc<dyn Field>> {
    Some(Arc::new(Tabled::new(field, region, wanted)?))
}

/// What is before a beam.
enum Before {
    /// None of the patches.
    Nothing,
    /// One that fills it, by its place among them.
    One(usize),
    /// An outline, perhaps, within so many metres.
    Outlines(DVec2, f64),
}

/// How a beam over flat patches is averaged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Degrees {
    /// Of the rule of directions, where a patch fills the beam and goes with direction alone.
    pub(crate) directions: usize,
    /// Of the rays over stop and pupil, where it goes with the place.
    pub(crate) rays: (usize, usize),
    /// Of the pupil's points for a beam across an outline.
    pub(crate) pupil: usize,
    /// Points between two changes of an outline's shape, and along a chord.
    pub(crate) chords: (usize, usize),
}

/// Over flat patches, which are all that there is to see.
#[derive(Debug, Clone)]
pub(crate) struct OverPatches {
    field: Arc<dyn Field>,
    patches: Vec<Patch>,
    beam: Beam,
    directions: ByDirections,
    rays: Rays,
    /// The pupil's points, for a beam across an outline.
    pupil: Vec<(DVec2, f64)>,
    rules: Rules,
    /// One over the mean of h⁴/r⁴ over pupil and stop.
    scale: f64,
    /// Of the tables that the field is read from, if it is.
    tables: Option<(Region, Wanted)>,
}

impl OverPatches {
    /// `tables`: what the field's tables were made for, if it has any.
    pub(crate) fn new(
        field: &Arc<dyn Field>,
        patches: Vec<Patch>,
        beam: Beam,
        degrees: Degrees,
        tables: Option<(Region, Wanted)>,
    ) -> Self {
        let rule = disk_rule(degrees.pupil);
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
        let directions = beam.directions(degrees.directions);
        let (chords, along) = degrees.chords;
        Self {
            directions: ByDirections { field: Arc::clone(field), directions },
            rays: Rays::new(beam, degrees.rays.0, degrees.rays.1),
            field: Arc::clone(field),
            patches,
            beam,
            pupil: rule,
            rules: Rules::new(chords, along),
            scale,
            tables,
        }
    }

    /// What the footprint lies on.
    fn before(&self, axis: &Axis) -> Before {
        let footprint = Footprint::on_plane(&self.beam, axis.spot, axis.direction);
        let ray = Ray::through(axis.spot, axis.direction);
        let (Some(footprint), Some(ray)) = (footprint, ray) else {
            return Before::Outlines(DVec2::ZERO, f64::INFINITY);
        };
        let (at, radius) = (ray.point.truncate(), footprint.radius_m());
        let mut before = Before::Nothing;
        for (i, patch) in self.patches.iter().enumerate() {
            if patch.boundary.distance(at) <= radius {
                return Before::Outlines(at, radius);
            }
            if patch.boundary.holds(at) {
                before = Before::One(i);
            }
        }
        before
    }

    /// Over the patches that reach within a distance of a place.
    fn across(&self, axis: &Axis, at: DVec2, radius: f64) -> f64 {
        let is_near =
            |patch: &Patch| patch.boundary.holds(at) || patch.boundary.distance(at) <= radius;
        let near: Vec<(usize, &Patch)> =
            self.patches.iter().enumerate().filter(|(_, patch)| is_near(patch)).collect();
        let placed = Placed::new(axis.spot, axis.direction);
        let mut sum = Sum::default();
        for (on_pupil, weight) in &self.pupil {
            let Some(sight) = Sight::new(&self.beam, &self.rules, &placed, *on_pupil) else {
                continue;
            };
            for (i, patch) in &near {
                let mean = sight.mean_of(&patch.boundary, |point, direction| match patch.goes {
                    Goes::Even(radiance) => radiance,
                    _ => self.field.on_patch(*i, &Ray { point, direction }),
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
            Before::One(i) => match self.patches[i].goes {
                Goes::Even(radiance) => radiance,
                Goes::WithDirection { .. } => {
                    self.directions.mean(axis, |ray| self.field.on_patch(i, ray))
                }
                Goes::WithPlace | Goes::WithBoth => {
                    self.rays.mean(axis, |ray| self.field.on_patch(i, ray))
                }
            },
            Before::Outlines(at, radius) => self.across(axis, at, radius),
        }
    }

    fn looking_at(&self, field: Arc<dyn Field>) -> Arc<dyn Optics> {
        let field = self.tables.map_or(Arc::clone(&field), |(region, wanted)| {
            tabled(&field, &region, wanted).unwrap_or(field)
        });
        // With what a patch goes does not change; how bright an even one is may.
        let patches = field.patches().unwrap_or_else(|| self.patches.clone());
        let directions = ByDirections { field: Arc::clone(&field), ..self.directions.clone() };
        Arc::new(Self { field, patches, directions, ..self.clone() })
    }
}
