//! The beam: from the axis of the detector to the mean radiance of what it accepts. It does not
//! know photocurrents.

use core::fmt;
use std::sync::Arc;

use glam::DVec3;

use crate::Scene;
use crate::compile::Setting;
use crate::effect::{Bound, BoundUnit, Candidate, Chosen, Influence};
use crate::field::{Field, Ray};

/// The name of the effect that not the axis alone is seen.
const FINITE_BEAM: &str = "finite-beam";

/// Where the detector stands, sample's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// The point on the detector's axis at the stated distance from its pupil, metres. In a
    /// perfect rig it lies in the sample's plane.
    pub spot: DVec3,
    /// Along the axis to the detector, of length one.
    pub direction: DVec3,
}

/// What of the light reaches the detector.
pub(crate) trait Optics: fmt::Debug + Send + Sync {
    /// Mean radiance over the beam, weighted with its throughput.
    fn radiance(&self, axis: &Axis) -> f64;
}

/// The beam's axis stands for all of it.
#[derive(Debug)]
pub(crate) struct PointSampled(pub(crate) Arc<dyn Field>);

impl Optics for PointSampled {
    fn radiance(&self, axis: &Axis) -> f64 {
        let ray = Ray::through(axis.spot, axis.direction);
        ray.map_or(0.0, |ray| self.0.radiance(&ray))
    }
}

/// What the light brings to the compiler: its emitters, and the beam.
pub(crate) fn candidates(setting: &Setting<'_>) -> Vec<Candidate> {
    let mut candidates = emission(setting.scene);
    let spot_mm = 2e3 * setting.nominal.detector.spot_radius_m;
    candidates.push(Candidate {
        name: FINITE_BEAM.to_owned(),
        cause: None,
        influence: Influence::Relative(1.0),
        how_in: String::new(),
        how_out: format!(
            "detector.spot_diameter_mm = {spot_mm} would call for it: the beam is point-sampled: \
             the reading is the radiance of the axis's ray times the throughput, and the host \
             takes it so too; not bounded: within a spot's radius of an emitter's outline the \
             difference may be the whole signal"
        ),
    });
    candidates
}

/// The beam as chosen.
pub(crate) fn chosen(setting: &Setting<'_>, _chosen: &Chosen) -> Arc<dyn Optics> {
    Arc::new(PointSampled(Arc::clone(&setting.field)))
}

fn emission(scene: &Scene) -> Vec<Candidate> {
    let emitters = scene.emitters();
    if emitters.is_empty() {
        let (key, how) = ("the scene has no emitter", "nothing emits: every reading is dark");
        let influence = Influence::Mandatory(None);
        return vec![Candidate::of_key("emission", key, false, influence, how)];
    }
    let whole = Influence::Mandatory(Some(Bound { value: 1.0, unit: BoundUnit::Relative }));
    let each = emitters.iter().enumerate().map(|(i, emitter)| {
        let cause = format!("emitter[{i}].kind = \"{}\"", emitter.kind());
        let how = "radiance along a ray, in closed form";
        Candidate::of_key(format!("emission[{i}]"), &cause, true, whole, how)
    });
    each.collect()
}
