//! What the light brings to the compiler: lamps, shadows on surfaces, bodies and windows in the
//! detector's beam. Each one's influence is what the scene looks like with it and without it, over the
//! rays that tell most of a region.

use std::sync::Arc;

use super::{INTERREFLECTION, Included, LitScene, Scenery, landmarks, plain};
use crate::compile::Setting;
use crate::effect::{Candidate, Influence};
use crate::field::{Field, Ray};
use crate::scene::{Body, Emitter, Scene, Solid, Surface, Window, WindowOwner};
use crate::{CompileError, Region};

/// What the rays that are looked at may miss of the largest influence.
const MARGIN: f64 = 1.25;

/// What is seen of a scene: from a distance, or (without one) what leaves the sample.
pub(crate) fn field(
    scenery: &Scenery,
    distance_m: Option<f64>,
    is_in: Included<'_>,
) -> Result<Arc<dyn Field>, CompileError> {
    if let Some(plain) = plain(&scenery.scene) {
        return Ok(plain);
    }
    Ok(Arc::new(LitScene::new(scenery, distance_m, is_in)?))
}

/// One for each lamp, occluder and window. None for a scene of flat emitters.
pub(crate) fn candidates(setting: &Setting<'_>) -> Result<Vec<Candidate>, CompileError> {
    let scene = setting.scene;
    if scene.is_flat_emitters() {
        return Ok(Vec::new());
    }
    let distance_m = Some(setting.nominal.detector.distance_m);
    let whole = LitScene::new(setting.scenery, distance_m, &|_| true)?;
    let rays = whole.landmarks(&setting.region).into_iter();
    let seen = rays.map(|ray| (ray, whole.radiance(&ray))).collect();
    let weighing = Weighing { setting, distance_m, whole: &whole, seen };
    let mut found = Vec::new();
    for (i, lamp) in scene.lamps().iter().enumerate() {
        let lights = !scene.surfaces().is_empty() && lamp.radiance() > 0.0;
        let cause = lights.then(|| format!("lamp[{i}].kind = \"{}\"", lamp.kind()));
        let how = "irradiance of surfaces in closed form";
        found.push(weighing.candidate(format!("lamp[{i}]"), cause, how)?);
        if let Some(solid) = lamp.solid() {
            let cause = weighing.in_beam(&format!("lamp[{i}]"), solid.heights_m());
            let how = "the lamp is seen where a ray meets it before the detector";
            found.push(weighing.candidate(format!("lamp-in-beam[{i}]"), cause, how)?);
        }
    }
    let cells = landmarks::shaded(&whole, &setting.region);
    for (i, occluder) in scene.occluders().iter().enumerate() {
        let cause = shadow_fact(&format!("occluder[{i}]"), &cells, scene);
        let how = "visible part of the source in closed form, where a shadow may fall; elsewhere \
                   nothing is asked";
        found.push(weighing.candidate(format!("shadow[{i}]"), cause, how)?);
        let cause = weighing.in_beam(&format!("occluder[{i}]"), occluder.heights_m());
        let how = "black where a ray meets it before the detector";
        found.push(weighing.candidate(format!("beam-shadow[{i}]"), cause, how)?);
    }
    for i in 0..scene.surfaces().len() {
        found.extend(weighing.gloss(i)?);
    }
    found.extend(weighing.interreflection()?);
    for (i, window) in scene.windows().iter().enumerate() {
        let owner = match window.belongs_to {
            WindowOwner::Beam => "beam",
            WindowOwner::Sample => "sample",
        };
        let cause = format!("window[{i}].index = {}, of the {owner}", window.index);
        let how = "Fresnel's and Beer's laws with all reflections inside; the ray shifted sideways";
        let mut candidate = weighing.candidate(format!("window[{i}]"), Some(cause), how)?;
        let is_own = window.belongs_to == WindowOwner::Sample && !scene.surfaces().is_empty();
        let error = if is_own { weighing.error_of_rules()? } else { 0.0 };
        candidate.error = (error > 0.0).then_some(error);
        found.push(candidate);
        let returns = returning(scene)?.is_some_and(|(returning, _)| returning == i);
        let cause = returns.then(|| format!("window[{i}] mirrors the patches below it"));
        let how = "solved once, at nodes on each patch";
        let mut candidate = weighing.candidate(format!("window-return[{i}]"), cause, how)?;
        let error = whole.returned.as_ref().filter(|_| returns).map(|returned| returned.error);
        // A part of what is thrown back, which is a part of the reading.
        candidate.error = error.map(|error| match candidate.influence {
            Influence::Relative(influence) => error * influence,
            Influence::Mandatory(_) => error,
        });
        found.push(candidate);
    }
    Ok(found)
}

/// Rays on which the rule along outlines is held against a finer one.
const LOBES: usize = 400;
/// What is darker than this part of the brightest ray has its error beside that part.
const DIM: f64 = 0.01;

struct Weighing<'w> {
    setting: &'w Setting<'w>,
    distance_m: Option<f64>,
    whole: &'w LitScene,
    /// Rays that tell most, and what is seen along them with everything in.
    seen: Vec<(Ray, f64)>,
}

impl Weighing<'_> {
    /// Weighed by looking with it and without it.
    fn candidate(
        &self,
        name: String,
        cause: Option<String>,
        how_in: &str,
    ) -> Result<Candidate, CompileError> {
        let influence = match &cause {
            Some(_) => self.influence(&name)?,
            None => 0.0,
        };
        let how_out = match &cause {
            Some(_) => "the light is taken as without it",
            None => "not called for: it changes nothing that is seen in the region",
        };
        Ok(Candidate {
            name,
            cause,
            influence: Influence::Relative(influence),
            error: None,
            how_in: how_in.to_owned(),
            how_out: how_out.to_owned(),
        })
    }

    /// Of a glossy surface, with the error of its rule where the lobe is looked at.
    fn gloss(&self, i: usize) -> Result<Option<Candidate>, CompileError> {
        let reflection = self.setting.scene.surfaces()[i].reflection();
        if reflection.is_lambertian() {
            return Ok(None);
        }
        let cause = format!("surface[{i}].gloss = {}", reflection.gloss);
        let how = "once along the outline of what is seen of each lamp, by Stokes, with 8 nodes on \
                   pieces no longer than the lobe is wide";
        let mut candidate = self.candidate(format!("gloss[{i}]"), Some(cause), how)?;
        candidate.error = Some(self.error_of_rules()?);
        Ok(Some(candidate))
    }

    /// How far readings are from what more nodes say, of lobes and of what comes through windows.
    fn error_of_rules(&self) -> Result<f64, CompileError> {
        let mut finer = LitScene::new(self.setting.scenery, self.distance_m, &|_| true)?;
        if !finer.refine() {
            return Ok(0.0);
        }
        let every = self.seen.len().div_ceil(LOBES).max(1);
        let apart = self.seen.iter().step_by(every).map(|(ray, a)| {
            let b = finer.radiance(ray);
            (a - b).abs() / self.scale(a.max(b))
        });
        Ok(apart.fold(f64::EPSILON, f64::max))
    }

    /// What an error of a reading stands beside.
    fn scale(&self, reading: f64) -> f64 {
        let brightest = self.seen.iter().map(|(_, seen)| *seen).fold(0.0, f64::max);
        reading.max(self.setting.floor).max(DIM * brightest).max(f64::MIN_POSITIVE)
    }

    /// Of scenes with two surfaces or more.
    fn interreflection(&self) -> Result<Option<Candidate>, CompileError> {
        if self.setting.scene.surfaces().len() < 2 {
            return Ok(None);
        }
        let exchange = self.setting.scenery.exchange.as_ref();
        let pairs = exchange.map(|exchange| exchange.pairs()).unwrap_or_default();
        let cause = pairs.first().map(|first| {
            let others = if pairs.len() > 2 { ", and others" } else { "" };
            format!(
                "surface[{}] and surface[{}] see each other, F = {:.2e}{others}",
                first.from, first.to, first.form_factor
            )
        });
        let how =
            "radiosity, solved once on cells as fine as the light asks for; a polynomial on each";
        let mut candidate = self.candidate(INTERREFLECTION.to_owned(), cause, how)?;
        candidate.error = exchange.map(|exchange| exchange.error);
        Ok(Some(candidate))
    }

    /// The largest |with - without| / max(with, without, noise floor) over the region's rays.
    fn influence(&self, name: &str) -> Result<f64, CompileError> {
        let without = LitScene::new(self.setting.scenery, self.distance_m, &|other| other != name)?;
        let largest = self.seen.iter().fold(0.0, |largest: f64, (ray, a)| {
            let b = without.radiance(ray);
            let scale = a.max(b).max(self.setting.floor);
            if scale > 0.0 { largest.max((a - b).abs() / scale) } else { largest }
        });
        Ok((MARGIN * largest).min(1.0))
    }

    /// Whether a body may stand between the region and the detector: whether a ray of the region is as
    /// high as the body before it is as far as the detector.
    fn in_beam(&self, body: &str, (low, _): (f64, f64)) -> Option<String> {
        let detector = &self.setting.nominal.detector;
        let part = self.whole.raised.iter().find(|part| part.name == body)?;
        let Body::Raised(solid) = &part.body else { return None };
        let Region { x_m, y_m, theta_max_rad } = self.setting.region;
        let (sin, cos) = libm::sincos(theta_max_rad);
        let is_reached = match (solid, solid.bounding_ball()) {
            (Solid::HalfPlane(edge), _) => {
                let aside = (x_m.0 - edge.x_max_m()).max(0.0);
                let is_ahead = libm::hypot(aside, edge.z_m()) < detector.distance_m;
                is_ahead && aside * cos < edge.z_m() * sin
            }
            (_, Some((centre, radius_m))) => {
                let aside = libm::hypot(
                    centre.x - centre.x.clamp(x_m.0, x_m.1),
                    centre.y - centre.y.clamp(y_m.0, y_m.1),
                );
                // A ray up to θ from the normal is aside by z tan θ at most; the ball adds r / cos θ.
                let is_ahead = libm::hypot(aside, centre.z) - radius_m < detector.distance_m;
                is_ahead && aside * cos <= centre.z * sin + radius_m
            }
            (_, None) => true,
        };
        is_reached.then(|| {
            format!(
                "{body} stands between the region and the detector, at z from {:.3} mm",
                low * 1e3
            )
        })
    }
}

/// Where which source is behind a body, for a person.
fn shadow_fact(body: &str, cells: &[landmarks::ShadedCell], scene: &Scene) -> Option<String> {
    let before = |cell: &landmarks::ShadedCell| {
        cell.shades.iter().find(|shade| shade.body == body).map(|shade| shade.source.clone())
    };
    let wider = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
    let mut shaded = cells.iter().filter_map(|cell| Some((before(cell)?, cell)));
    let on_plane = shaded.next().map(|(source, first)| {
        let rest = shaded.map(|(_, cell)| (cell.x_m, cell.y_m));
        let (x, y) = rest
            .fold((first.x_m, first.y_m), |all, cell| (wider(all.0, cell.0), wider(all.1, cell.1)));
        format!(
            "{body} comes between {source} and {} for x from {:.3} to {:.3} mm, y from {:.3} to \
             {:.3} mm",
            first.surface,
            x.0 * 1e3,
            x.1 * 1e3,
            y.0 * 1e3,
            y.1 * 1e3
        )
    });
    let raised = scene.surfaces().iter().position(|surface| surface.body().shape().is_none());
    on_plane.or_else(|| raised.map(|i| format!("{body} may shade surface[{i}], which is raised")))
}

/// The window that throws light back on the patches of the sample's plane, if one does.
pub(super) fn returning(scene: &Scene) -> Result<Option<(usize, &Window)>, CompileError> {
    let reflects = |surface: &Surface| surface.reflection().reflectance_bound() > 0.0;
    if !scene.surfaces().iter().any(reflects) {
        return Ok(None);
    }
    let windows = scene.windows().iter().enumerate();
    let mut own = windows.filter(|(_, window)| window.belongs_to == WindowOwner::Sample);
    let (Some((i, window)), further) = (own.next(), own.next()) else { return Ok(None) };
    let is_raised = |body: &Body| {
        body.solid().is_some_and(|solid| body.shape().is_none() && solid.heights_m().0 < window.z_m)
    };
    let bodies = scene.emitters().iter().map(Emitter::body);
    let raised = bodies.chain(scene.surfaces().iter().map(Surface::body)).any(is_raised);
    let blocked = scene.opaque().iter().any(|(_, solid)| solid.heights_m().0 < window.z_m);
    if further.is_some() || raised || blocked {
        return Err(CompileError::Unsupported(format!(
            "light that window[{i}] throws back on surfaces, with a second window or with bodies \
             below it"
        )));
    }
    Ok(Some((i, window)))
}

/// What is not simulated, by name.
pub(super) fn refuse(scene: &Scene) -> Result<(), CompileError> {
    if let Some((_, what)) = scene.unsupported_gloss() {
        return Err(CompileError::Unsupported(what));
    }
    let pairs = scene.facing();
    let glass = scene.windows().iter().position(|w| w.belongs_to == WindowOwner::Sample);
    if let (Some((i, k)), Some(glass)) = (pairs.first(), glass) {
        return Err(CompileError::Unsupported(format!(
            "surface[{i}] and surface[{k}] see each other, light that goes between them, with \
             window[{glass}] of the sample"
        )));
    }
    Ok(())
}
