//! What shines on surfaces: lamps, and emitters above the plane, as kernels and lobes take them. It knows no
//! surface.

use std::sync::Arc;

use glam::DVec3;
use radiometry::environment::LatLong;
use radiometry::projected::{self, Occluder, RegionShadow, Source as Shining};
use radiometry::quantity::Radiance;
use radiometry::shape::{Disk, Polygon, Sphere};

use super::Included;
use super::gloss::{Sight, Surrounding};
use super::plate::Plate;
use crate::CompileError;
use crate::scene::{Body, Emitter, Image, LampSource, Law, Scene, Solid, Surface};

/// How far away a distant lamp is put: farther than any body of a scene. It stands at the same place
/// seen from everywhere, so that the distance has no other meaning.
const FAR_M: f64 = 1e4;

/// What shines on surfaces.
#[derive(Debug)]
pub(super) struct Source {
    /// As its effect is called: `lamp[0]`.
    pub(super) name: String,
    pub(super) radiance: f64,
    pub(super) kind: SourceKind,
    /// Its place among the opaque bodies, if it is one.
    pub(super) own: Option<usize>,
    /// Of an emitter: what it is, of which one side shines.
    pub(super) emitter: Option<Body>,
}

#[derive(Debug)]
pub(super) enum SourceKind {
    /// A body; of a flat one that shines from its front alone, a point and its normal.
    Body(Shining, Option<(DVec3, DVec3)>),
    Distant {
        towards: DVec3,
        half_angle_rad: f64,
    },
    Surrounding(Box<Sky>),
}

/// A surrounding: all of it in closed form, and what is seen of it past bodies.
#[derive(Debug)]
pub(super) struct Sky {
    /// Half a turn about z from the scene's: its columns begin at φ = 0, an image's at -π.
    turned: LatLong,
    pub(super) seen: Surrounding,
}

impl Sky {
    fn new(image: &Image, name: &str) -> Result<Self, CompileError> {
        let pixels = (0..image.rows() * image.columns())
            .map(|i| image.value(i % image.columns(), i / image.columns()))
            .map(Radiance::from_w_per_m2_sr);
        let pixels: Vec<_> = pixels.collect();
        let turned = LatLong::new(image.rows(), image.columns(), &pixels);
        let turned = turned.map_err(|e| CompileError::Scene(format!("{name}: {e}")))?;
        Ok(Self { turned, seen: Surrounding::new(image) })
    }

    /// On a receiver that nothing stands before, relative to white.
    pub(super) fn irradiance(&self, normal: DVec3) -> f64 {
        let turned = DVec3::new(-normal.x, -normal.y, normal.z);
        self.turned.irradiance(turned).map_or(0.0, |e| e.value)
    }
}

/// Everything that shines on surfaces: lamps, and emitters above the plane.
pub(super) fn sources(
    scene: &Scene,
    is_in: Included<'_>,
) -> Result<Vec<Arc<Source>>, CompileError> {
    let mut sources = Vec::new();
    for (i, lamp) in scene.lamps().iter().enumerate() {
        let name = format!("lamp[{i}]");
        if !is_in(&name) || lamp.radiance() == 0.0 {
            continue;
        }
        let kind = match lamp.source() {
            LampSource::Body(solid) => SourceKind::Body(shining(solid, &name)?, None),
            LampSource::Distant { towards, half_angle_rad } => {
                SourceKind::Distant { towards: *towards, half_angle_rad: *half_angle_rad }
            }
            LampSource::Surrounding(image) => {
                SourceKind::Surrounding(Box::new(Sky::new(image, &name)?))
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

impl Source {
    /// A body in its place; a distant one as a ball that a place sees there.
    pub(super) fn seen_from(&self, place: DVec3) -> Option<Shining> {
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
    pub(super) fn sight(&self) -> Option<Sight> {
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
    pub(super) fn shades(
        &self,
        region: Option<&projected::Region>,
        occluder: &Occluder,
    ) -> RegionShadow {
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

    /// The same through plates, which make the region look higher, less so straight down.
    pub(super) fn shades_lifted(
        &self,
        region: Option<&projected::Region>,
        occluder: &Occluder,
        plates: &[Plate],
    ) -> RegionShadow {
        if plates.is_empty() {
            return self.shades(region, occluder);
        }
        let is_lit = [1.0, 0.5, 0.0].into_iter().all(|cos| {
            let by_m = plates.iter().map(|plate| plate.raises_m(cos)).sum();
            let region = region.map(|region| lifted(region, by_m));
            self.shades(region.as_ref(), occluder) == RegionShadow::Lit
        });
        if is_lit { RegionShadow::Lit } else { RegionShadow::Mixed }
    }

    /// Whether it is a surrounding.
    pub(super) const fn is_sky(&self) -> bool {
        matches!(self.kind, SourceKind::Surrounding(_))
    }

    /// The lowest z of it; infinite where it is at no place.
    pub(super) fn bottom_m(&self) -> f64 {
        match self.sight() {
            Some(Sight::Body(solid)) => solid.heights_m().0,
            Some(Sight::Cap(..)) | None => f64::INFINITY,
        }
    }

    /// Whether it is so far away that it stands alike from everywhere.
    pub(super) const fn is_far(&self) -> bool {
        matches!(self.kind, SourceKind::Distant { .. } | SourceKind::Surrounding(_))
    }

    /// Whether it shines towards a place.
    pub(super) fn faces(&self, place: DVec3) -> bool {
        match &self.kind {
            SourceKind::Body(_, Some((point, front))) => front.dot(place - *point) > 0.0,
            SourceKind::Body(..) | SourceKind::Distant { .. } | SourceKind::Surrounding(_) => true,
        }
    }

    /// Directions of some points of it.
    pub(super) fn towards(&self, place: DVec3) -> Vec<DVec3> {
        if let SourceKind::Surrounding(sky) = &self.kind {
            return sky.seen.brightest(GLINTS);
        }
        match self.sight() {
            Some(Sight::Cap(towards, _)) => vec![towards],
            Some(Sight::Body(solid)) => {
                solid.points().into_iter().map(|point| (point - place).normalize()).collect()
            }
            None => Vec::new(),
        }
    }
}

/// Of a surrounding's pixels, the brightest ones.
const GLINTS: usize = 8;

/// A region as it looks from above, that much higher.
fn lifted(region: &projected::Region, by_m: f64) -> projected::Region {
    let up = DVec3::Z * by_m;
    let lifted = match region {
        projected::Region::Polygon(polygon) => {
            let corners = polygon.vertices().iter().map(|corner| *corner + up).collect();
            Polygon::new(corners).map(projected::Region::Polygon)
        }
        projected::Region::Disk(disk) => {
            let lifted = Disk::new(disk.center_m() + up, disk.axis(), disk.radius_m());
            lifted.map(projected::Region::Disk)
        }
    };
    lifted.unwrap_or_else(|_| region.clone())
}
