//! The beam: from the axis of the detector to the mean radiance of what it accepts. It does not
//! know photocurrents.

mod beams;
mod boundary;
mod coverage;
mod forms;
mod poses;
mod table;
mod weigh;

use core::fmt;
use std::sync::Arc;

use glam::DVec3;
use radiometry::DomainError;
use radiometry::beam::Beam;

pub(crate) use boundary::Boundary;

use crate::Scene;
use crate::compile::Setting;
use crate::effect::{Bound, BoundUnit, Candidate, Chosen, Influence};
use crate::field::{Field, Ray};
use forms::Form;
use weigh::Weighed;

/// The name of the effect that not the axis alone is seen.
pub(crate) const FINITE_BEAM: &str = "finite-beam";

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

    /// The same, looking at something else.
    fn looking_at(&self, field: Arc<dyn Field>) -> Arc<dyn Optics>;
}

/// The beam's axis stands for all of it.
#[derive(Debug)]
pub(crate) struct PointSampled(pub(crate) Arc<dyn Field>);

impl Optics for PointSampled {
    fn radiance(&self, axis: &Axis) -> f64 {
        let ray = Ray::through(axis.spot, axis.direction);
        ray.map_or(0.0, |ray| self.0.radiance(&ray))
    }

    fn looking_at(&self, field: Arc<dyn Field>) -> Arc<dyn Optics> {
        Arc::new(Self(field))
    }
}

/// What the light brings to the compiler.
pub(crate) struct Light {
    pub(crate) candidates: Vec<Candidate>,
    beam: Weighed,
    form: Option<Form>,
}

impl Light {
    /// Its emitters, and the beam.
    pub(crate) fn of(setting: &Setting<'_>) -> Result<Self, DomainError> {
        let detector = &setting.nominal.detector;
        let (pupil, spot) = (detector.pupil_radius_m, detector.spot_radius_m);
        let beam = Weighed::new(setting, Beam::of_spot(pupil, spot, detector.distance_m)?);
        let is_wanted = !setting.terms.without.iter().any(|name| name == FINITE_BEAM);
        let is_forced = setting.terms.force.iter().any(|name| name == FINITE_BEAM);
        // To find the cheapest form costs more than to find out that none is needed.
        let form = (is_wanted && (is_forced || beam.bound > 0.0)).then(|| beam.form(setting));
        let mut candidates = emission(setting.scene);
        candidates.push(Candidate {
            name: FINITE_BEAM.to_owned(),
            cause: Some(format!(
                "detector.pupil_diameter_mm = {}, spot_diameter_mm = {}: {}",
                2e3 * pupil,
                2e3 * spot,
                beam.fact
            )),
            influence: Influence::Relative(beam.bound),
            error: form.map(|(_, off)| off.relative),
            how_in: form.map_or_else(String::new, |(form, off)| form.how(off)),
            how_out: "the radiance along the axis stands for the beam's".to_owned(),
        });
        Ok(Self { candidates, beam, form: form.map(|(form, _)| form) })
    }

    /// The beam as chosen; `is_whole`: whether all is in that the light of the scene calls for.
    pub(crate) fn optics(
        &self,
        setting: &Setting<'_>,
        chosen: &Chosen,
        is_whole: bool,
    ) -> Arc<dyn Optics> {
        match self.form.filter(|_| chosen.has(FINITE_BEAM)) {
            Some(form) => self.beam.build(setting, form, is_whole),
            None => Arc::new(PointSampled(Arc::clone(&setting.field))),
        }
    }
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
