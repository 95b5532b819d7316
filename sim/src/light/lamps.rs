//! Irradiance at a place of a surface: from each source in closed form, behind whatever stands in
//! the way of it. Which bodies can stand in the way at all is found once; where none does, nothing is
//! asked about them.

use std::sync::Arc;

use glam::DVec3;
use radiometry::environment::LatLong;
use radiometry::projected::{self, Occluder, Receiver, RegionShadow, Source as Shining};
use radiometry::quadrature::cone;
use radiometry::quantity::{ProjectedSolidAngle, Radiance};
use radiometry::shape::{Polygon, Sphere};
use radiometry::{EstimateError, Tolerance};

use super::gloss::{Lobe, Sight};
use super::plate::Plate;
use super::{Included, occluder_of};
use crate::CompileError;
use crate::scene::{Body, Emitter, LampSource, Law, Scene, Shape, Solid, Surface, WindowOwner};

/// How far away a distant lamp is put: farther than any body of a scene. It stands at the same place
/// seen from everywhere, so that the distance has no other meaning.
const FAR_M: f64 = 1e4;

/// How near the irradiance is to what it should be, relative to the unshaded source.
const TOLERANCE: f64 = 1e-9;

/// What shines on surfaces.
#[derive(Debug)]
pub(super) struct Source {
    /// As its effect is called: `lamp[0]`.
    pub(super) name: String,
    radiance: f64,
    kind: SourceKind,
    /// Its place among the opaque bodies, if it is one.
    own: Option<usize>,
    /// Of an emitter: what it is, of which one side shines.
    emitter: Option<Body>,
}

#[derive(Debug)]
enum SourceKind {
    /// A body; of a flat one that shines from its front alone, a point and its normal.
    Body(Shining, Option<(DVec3, DVec3)>),
    Distant {
        towards: DVec3,
        half_angle_rad: f64,
        /// What the windows let through, the mean over the disk.
        transmittance: f64,
    },
    Surrounding(Box<LatLong>),
}

/// What shines on one surface.
#[derive(Debug)]
pub(super) struct Lighting {
    by: Vec<LitBy>,
}

#[derive(Debug)]
struct LitBy {
    source: Arc<Source>,
    /// What may hide a part of it from a part of the surface, and their names.
    before: Vec<Occluder>,
    hiding: Vec<Sight>,
    /// The source as lobes see it; none of a surrounding.
    sight: Option<Sight>,
    names: Vec<String>,
    /// What hides all of it from all of the surface.
    umbra_of: Option<String>,
}

/// That a body comes between a source and a place.
pub(super) struct Shade {
    pub(super) source: String,
    pub(super) body: String,
}

/// Everything that shines on surfaces: lamps, and emitters above the plane.
fn sources(scene: &Scene, is_in: Included<'_>) -> Result<Vec<Arc<Source>>, CompileError> {
    let mut sources = Vec::new();
    for (i, lamp) in scene.lamps().iter().enumerate() {
        let name = format!("lamp[{i}]");
        if !is_in(&name) || lamp.radiance() == 0.0 {
            continue;
        }
        let kind = match lamp.source() {
            LampSource::Body(solid) => {
                refuse_under_glass(scene, &name, solid.heights_m().1)?;
                SourceKind::Body(shining(solid, &name)?, None)
            }
            LampSource::Distant { towards, half_angle_rad } => SourceKind::Distant {
                towards: *towards,
                half_angle_rad: *half_angle_rad,
                transmittance: through_windows(scene, *towards, *half_angle_rad, is_in)?,
            },
            LampSource::Surrounding(image) => {
                refuse_under_glass(scene, &name, f64::INFINITY)?;
                let pixels = (0..image.rows() * image.columns())
                    .map(|i| image.value(i % image.columns(), i / image.columns()))
                    .map(Radiance::from_w_per_m2_sr);
                let pixels: Vec<_> = pixels.collect();
                let map = LatLong::new(image.rows(), image.columns(), &pixels);
                let map = map.map_err(|e| CompileError::Scene(format!("{name}: {e}")))?;
                SourceKind::Surrounding(Box::new(map))
            }
        };
        let own = lamp.solid().and_then(|solid| position(scene, solid));
        sources.push(Arc::new(Source {
            name,
            radiance: lamp.radiance(),
            kind,
            own,
            emitter: None,
        }));
    }
    for (i, emitter) in scene.emitters().iter().enumerate() {
        sources.extend(emitting(scene, i, emitter)?.map(Arc::new));
    }
    Ok(sources)
}

/// An emitter, as far as a surface lies before it.
fn emitting(scene: &Scene, i: usize, emitter: &Emitter) -> Result<Option<Source>, CompileError> {
    let is_before = |surface: &Surface| emitter.body().faces(surface.body());
    let solid = emitter.body().solid().filter(|_| scene.surfaces().iter().any(is_before));
    let Some(solid) = solid.filter(|_| emitter.level() > 0.0) else { return Ok(None) };
    let name = format!("emitter[{i}]");
    if *emitter.law() != Law::Lambertian || emitter.texture().is_some() {
        return Err(CompileError::Unsupported(format!(
            "light of {name} on surfaces: it is not lambertian and the same everywhere"
        )));
    }
    refuse_under_glass(scene, &name, solid.heights_m().1)?;
    let front = match solid {
        Solid::Sphere(_) | Solid::HalfPlane(_) => None,
        Solid::Disk(_) | Solid::Polygon(_) => {
            let (point, _) = solid.plane();
            Some((point, emitter.body().normal(point)))
        }
    };
    let kind = SourceKind::Body(shining(&solid, &name)?, front);
    let own = position(scene, &solid);
    let body = emitter.body().clone();
    Ok(Some(Source { name, radiance: emitter.level(), kind, own, emitter: Some(body) }))
}

/// Among the opaque bodies above the plane.
pub(super) fn position(scene: &Scene, solid: &Solid) -> Option<usize> {
    scene.opaque().iter().position(|(_, other)| other == solid)
}

pub(super) fn shining(solid: &Solid, name: &str) -> Result<Shining, CompileError> {
    match solid {
        Solid::Disk(disk) => Ok(Shining::Disk(*disk)),
        Solid::Polygon(polygon) => Ok(Shining::Polygon(polygon.clone())),
        Solid::Sphere(ball) => Ok(Shining::Sphere(*ball)),
        Solid::HalfPlane(_) => Err(CompileError::Unsupported(format!("{name}: a half-plane"))),
    }
}

/// Light of a lamp that is not at infinity is refracted by a window to other places than its
/// straight path leads to: not computed.
fn refuse_under_glass(scene: &Scene, name: &str, top_m: f64) -> Result<(), CompileError> {
    let glass = scene.windows().iter().position(|window| {
        window.belongs_to == WindowOwner::Sample && window.z_m + window.thickness_m <= top_m
    });
    match glass.filter(|_| !scene.surfaces().is_empty()) {
        Some(i) => Err(CompileError::Unsupported(format!(
            "light of {name} through window[{i}] onto surfaces (only a sun's is simulated)"
        ))),
        None => Ok(()),
    }
}

/// The mean transmittance over a distant lamp's disk, weighted with what a level surface receives.
fn through_windows(
    scene: &Scene,
    towards: DVec3,
    half_angle_rad: f64,
    is_in: Included<'_>,
) -> Result<f64, CompileError> {
    let mut plates = Vec::new();
    for (i, window) in scene.windows().iter().enumerate() {
        if window.belongs_to == WindowOwner::Sample && is_in(&format!("window[{i}]")) {
            let plate = Plate::new(window);
            plates.push(plate.map_err(|e| CompileError::Scene(format!("window[{i}]: {e}")))?);
        }
    }
    if plates.is_empty() {
        return Ok(1.0);
    }
    let nodes = cone(half_angle_rad, 6, 16).map_err(|e| CompileError::Scene(e.to_string()))?;
    let (e, f) = radiometry::direction::frame(towards);
    let (mut passed, mut all) = (0.0, 0.0);
    for node in nodes {
        let local = radiometry::direction::unit(node.theta_rad, node.phi_rad);
        let direction = e * local.x + f * local.y + towards * local.z;
        // The rule's weight holds the cosine to the disk's centre; the receiver's is another.
        let weight = node.weight_sr / local.z * direction.z.max(0.0);
        all += weight;
        passed +=
            weight * plates.iter().map(|plate| plate.transmittance(direction)).product::<f64>();
    }
    Ok(if all > 0.0 { passed / all } else { 1.0 })
}

impl Lighting {
    /// Of all surfaces of a scene.
    pub(super) fn all(scene: &Scene, is_in: Included<'_>) -> Result<Vec<Arc<Self>>, CompileError> {
        let sources = sources(scene, is_in)?;
        let of = |i| Self::new(scene, i, &sources, is_in).map(Arc::new);
        (0..scene.surfaces().len()).map(of).collect()
    }

    /// What shines on surface `i`, with the bodies that can stand before each source.
    fn new(
        scene: &Scene,
        i: usize,
        sources: &[Arc<Source>],
        is_in: Included<'_>,
    ) -> Result<Self, CompileError> {
        let surface = &scene.surfaces()[i];
        let own = match surface.body() {
            Body::Raised(solid) => position(scene, solid),
            Body::Flat(_) => None,
        };
        let region = region_of(surface.body());
        let mut by = Vec::new();
        let reaches = |source: &&Arc<Source>| {
            source.emitter.as_ref().is_none_or(|emitter| emitter.faces(surface.body()))
        };
        for source in sources.iter().filter(reaches) {
            let (mut before, mut names, mut hiding) = (Vec::new(), Vec::new(), Vec::new());
            let mut umbra_of = None;
            for (k, (name, solid)) in scene.opaque().iter().enumerate() {
                let is_out = name
                    .strip_prefix("occluder")
                    .is_some_and(|place| !is_in(&format!("shadow{place}")));
                if is_out || Some(k) == own || Some(k) == source.own {
                    continue;
                }
                let occluder = occluder_of(solid);
                match source.shades(region.as_ref(), &occluder) {
                    RegionShadow::Lit => {}
                    RegionShadow::Umbra => umbra_of = Some(name.clone()),
                    RegionShadow::Mixed => {
                        source.can_be_shaded(scene, name, solid)?;
                        before.push(occluder);
                        hiding.push(Sight::Body(solid.clone()));
                        names.push(name.clone());
                    }
                }
            }
            let (source, sight) = (Arc::clone(source), source.sight());
            by.push(LitBy { source, before, hiding, sight, names, umbra_of });
        }
        Ok(Self { by })
    }

    /// What may come between which source and a cell of the surface; nothing else does.
    pub(super) fn shades(&self, cell: &projected::Region) -> Vec<Shade> {
        let mut shades = Vec::new();
        for by in &self.by {
            let source = &by.source;
            let certain = by.umbra_of.iter();
            let possible = by.names.iter().zip(&by.before).filter_map(|(name, body)| {
                (source.shades(Some(cell), body) != RegionShadow::Lit).then_some(name)
            });
            shades.extend(
                certain
                    .chain(possible)
                    .map(|body| Shade { source: source.name.clone(), body: body.clone() }),
            );
        }
        shades
    }

    /// Radiance of a lobe about the mirror direction, in the scene's unit.
    pub(super) fn glossy(&self, lobe: &Lobe<'_>, place: DVec3) -> f64 {
        self.by.iter().map(|by| by.glossy(lobe, place)).sum()
    }

    /// Directions of some points of each source.
    pub(super) fn towards(&self, place: DVec3) -> Vec<DVec3> {
        let of = |by: &LitBy| match &by.sight {
            Some(Sight::Cap(towards, _)) => vec![*towards],
            Some(Sight::Body(solid)) => {
                solid.points().into_iter().map(|point| (point - place).normalize()).collect()
            }
            None => Vec::new(),
        };
        self.by.iter().flat_map(of).filter(|towards| towards.is_finite()).collect()
    }

    /// W·m⁻² or lm·m⁻².
    pub(super) fn irradiance(&self, place: DVec3, normal: DVec3) -> f64 {
        self.by.iter().map(|by| by.irradiance(place, normal)).sum()
    }
}

/// The region that a surface fills, where it is flat.
pub(super) fn region_of(body: &Body) -> Option<projected::Region> {
    let flat = |corners: &[(f64, f64)]| {
        Polygon::new(corners.iter().map(|(x, y)| DVec3::new(*x, *y, 0.0)).collect()).ok()
    };
    match body {
        Body::Flat(Shape::Rectangle { x_m: x, y_m: y }) => {
            flat(&[(x.0, y.0), (x.1, y.0), (x.1, y.1), (x.0, y.1)]).map(projected::Region::Polygon)
        }
        Body::Flat(Shape::Polygon(outline)) => {
            flat(outline.corners_m()).map(projected::Region::Polygon)
        }
        Body::Flat(shape @ Shape::Disk { .. }) => match Solid::of_shape(shape) {
            Some(Solid::Disk(disk)) => Some(projected::Region::Disk(disk)),
            _ => None,
        },
        Body::Raised(Solid::Polygon(polygon)) => Some(projected::Region::Polygon(polygon.clone())),
        Body::Raised(Solid::Disk(disk)) => Some(projected::Region::Disk(*disk)),
        Body::Raised(Solid::Sphere(_) | Solid::HalfPlane(_)) => None,
    }
}

impl Source {
    /// A body in its place; a distant one as a ball that a place sees there.
    fn seen_from(&self, place: DVec3) -> Option<Shining> {
        match &self.kind {
            SourceKind::Body(shining, _) => Some(shining.clone()),
            SourceKind::Distant { towards, half_angle_rad, .. } => {
                let radius_m = FAR_M * libm::sin(*half_angle_rad);
                Sphere::new(place + *towards * FAR_M, radius_m).ok().map(Shining::Sphere)
            }
            SourceKind::Surrounding(_) => None,
        }
    }

    /// As lobes see it.
    fn sight(&self) -> Option<Sight> {
        let solid = match &self.kind {
            SourceKind::Body(Shining::Disk(disk), _) => Solid::Disk(*disk),
            SourceKind::Body(Shining::Sphere(ball), _) => Solid::Sphere(*ball),
            SourceKind::Body(Shining::Polygon(polygon), _) => Solid::Polygon(polygon.clone()),
            SourceKind::Distant { towards, half_angle_rad, .. } => {
                return Some(Sight::Cap(*towards, *half_angle_rad));
            }
            SourceKind::Surrounding(_) => return None,
        };
        Some(Sight::Body(solid))
    }

    /// Whether a body leaves a region lit, dark, or neither for certain.
    fn shades(&self, region: Option<&projected::Region>, occluder: &Occluder) -> RegionShadow {
        let (Some(region), Some(mut shining)) = (region, self.seen_from(DVec3::ZERO)) else {
            return RegionShadow::Mixed;
        };
        if let (SourceKind::Distant { .. }, Shining::Sphere(ball)) = (&self.kind, &shining) {
            // Wider by what the region's extent makes of its direction.
            let far = match region {
                projected::Region::Polygon(polygon) => {
                    polygon.vertices().iter().map(|v| v.length()).fold(0.0, f64::max)
                }
                projected::Region::Disk(disk) => disk.center_m().length() + disk.radius_m(),
            };
            let Ok(wider) = Sphere::new(ball.center_m(), ball.radius_m() + far) else {
                return RegionShadow::Mixed;
            };
            shining = Shining::Sphere(wider);
        }
        projected::region_shadow(region, &shining, occluder).unwrap_or(RegionShadow::Mixed)
    }

    fn can_be_shaded(&self, scene: &Scene, name: &str, solid: &Solid) -> Result<(), CompileError> {
        if matches!(self.kind, SourceKind::Surrounding(_)) {
            return Err(CompileError::Unsupported(format!(
                "{}, a surrounding, behind {name}: its shadow",
                self.name
            )));
        }
        let is_above_glass = scene.windows().iter().any(|window| {
            window.belongs_to == WindowOwner::Sample && window.z_m < solid.heights_m().1
        });
        if is_above_glass {
            return Err(CompileError::Unsupported(format!(
                "the shadow of {name}, above a window, in the light of {}",
                self.name
            )));
        }
        Ok(())
    }
}

impl LitBy {
    fn glossy(&self, lobe: &Lobe<'_>, place: DVec3) -> f64 {
        let passes = match &self.source.kind {
            SourceKind::Body(_, Some((point, front))) if front.dot(place - *point) <= 0.0 => 0.0,
            SourceKind::Distant { transmittance, .. } => *transmittance,
            SourceKind::Body(..) | SourceKind::Surrounding(_) => 1.0,
        };
        // A surrounding is refused before glossy surfaces.
        let Some(sight) = self.sight.as_ref().filter(|_| self.umbra_of.is_none() && passes > 0.0)
        else {
            return 0.0;
        };
        self.source.radiance * passes * lobe.radiance(sight, &self.hiding)
    }

    fn irradiance(&self, place: DVec3, normal: DVec3) -> f64 {
        if self.umbra_of.is_some() {
            return 0.0;
        }
        let source = &*self.source;
        let passes = match &source.kind {
            SourceKind::Surrounding(map) => {
                return source.radiance * map.irradiance(normal).map_or(0.0, |e| e.value);
            }
            SourceKind::Body(_, Some((point, front))) if front.dot(place - *point) <= 0.0 => {
                return 0.0;
            }
            SourceKind::Body(..) => 1.0,
            SourceKind::Distant { transmittance, .. } => *transmittance,
        };
        // At a place that touches a body the kernel has no answer; next to it, it has.
        let seen = self.projected(place, normal).or_else(|| {
            let beside = place + normal * BESIDE_M;
            self.projected(beside, normal)
        });
        source.radiance * passes * seen.unwrap_or(0.0)
    }

    /// Projected solid angle of what is seen of the source, sr.
    fn projected(&self, place: DVec3, normal: DVec3) -> Option<f64> {
        let receiver = Receiver::new(place, normal).ok()?;
        let shining = self.source.seen_from(place)?;
        if self.before.is_empty() {
            let whole = match &shining {
                Shining::Disk(disk) => projected::disk(&receiver, disk),
                Shining::Polygon(polygon) => projected::polygon(&receiver, polygon),
                Shining::Sphere(ball) => projected::sphere(&receiver, ball),
            };
            return whole.ok().map(ProjectedSolidAngle::sr);
        }
        let tolerance = Tolerance::from_relative(TOLERANCE).ok()?;
        match projected::occluded_by(&receiver, &shining, &self.before, tolerance) {
            Ok(estimate) | Err(EstimateError::Unmet { estimate, .. }) => Some(estimate.value),
            Err(_) => None,
        }
    }
}

/// Next to a body that it touches, metres.
const BESIDE_M: f64 = 1e-9;
