//! Irradiance at a place of a surface: from each source in closed form, behind whatever stands in
//! the way of it, and through the windows above. Which bodies can stand in the way at all is found once;
//! where none does, nothing is asked about them.

use core::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use radiometry::projected::{self, Occluder, Receiver, RegionShadow, Source as Shining};
use radiometry::quantity::ProjectedSolidAngle;
use radiometry::shape::Polygon;
use radiometry::{EstimateError, Tolerance};

use super::gloss::{Counts, Gloss, Lobe, Sight};
use super::plate::Plate;
use super::rings::{self, Rings, Shines, mean_transmittance};
use super::smooth::Smooth;
use super::source::{Source, SourceKind, position, sources};
use super::{Included, occluder_of};
use crate::CompileError;
use crate::scene::{Body, Scene, Shape, Solid, Surface, WindowOwner};

/// How near the irradiance is to what it should be, relative to the unshaded source.
const TOLERANCE: f64 = 1e-9;

/// What shines on one surface.
#[derive(Debug)]
pub(super) struct Lighting {
    by: Vec<LitBy>,
    /// The sample's windows above the surface, the lowest first.
    plates: Vec<Plate>,
    is_fine: bool,
}

#[derive(Debug, Clone)]
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
    way: Way,
}

/// What windows do on the way from a source.
#[derive(Debug, Clone)]
enum Way {
    /// There are none.
    Open,
    /// They let this part pass, and shift nothing that matters.
    Dimmed(f64),
    /// They stand between, so many of them, and nothing hides anything. Over a patch of the plane the
    /// irradiance for a radiance of one is smooth.
    Behind(usize, Option<Smooth<POINTS>>),
}

/// Places along each side of a patch that light through windows is computed at.
const POINTS: usize = 13;

/// That a body comes between a source and a place.
pub(super) struct Shade {
    pub(super) source: String,
    pub(super) body: String,
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
        let (region, plates) = (region_of(surface.body()), plates_above(scene, surface, is_in)?);
        let mut by = Vec::new();
        let reaches = |source: &&Arc<Source>| {
            source.emitter.as_ref().is_none_or(|emitter| emitter.faces(surface.body()))
        };
        for source in sources.iter().filter(reaches) {
            let own_zone = zone(&plates, source.bottom_m());
            let (mut before, mut names, mut hiding) = (Vec::new(), Vec::new(), Vec::new());
            let mut umbra_of = None;
            for (k, (name, solid)) in scene.opaque().iter().enumerate() {
                let is_out = name
                    .strip_prefix("occluder")
                    .is_some_and(|place| !is_in(&format!("shadow{place}")));
                let zone = zone(&plates, solid.heights_m().0);
                if is_out || Some(k) == own || Some(k) == source.own || zone > own_zone {
                    continue;
                }
                let occluder = occluder_of(solid);
                // Seen through glass, a region looks higher.
                let is_shifted = zone > 0 || (own_zone > 0 && !source.is_far());
                let between = &plates[..if is_shifted { own_zone } else { 0 }];
                match source.shades_lifted(region.as_ref(), &occluder, between) {
                    RegionShadow::Lit => {}
                    RegionShadow::Umbra if !is_shifted => umbra_of = Some(name.clone()),
                    RegionShadow::Mixed | RegionShadow::Umbra => {
                        if is_shifted || (own_zone > 0 && source.is_sky()) {
                            return Err(CompileError::Unsupported(format!(
                                "the shadow of {name} in the light of {} that comes through a \
                                 window onto surface[{i}]",
                                source.name
                            )));
                        }
                        before.push(occluder);
                        hiding.push(Sight::Body(solid.clone()));
                        names.push(name.clone());
                    }
                }
            }
            let way = match &source.kind {
                _ if own_zone == 0 => Way::Open,
                SourceKind::Distant { towards, half_angle_rad } => {
                    Way::Dimmed(mean_transmittance(&plates, *towards, *half_angle_rad))
                }
                _ => Way::Behind(own_zone, None),
            };
            let (source, sight) = (Arc::clone(source), source.sight());
            by.push(LitBy { source, before, hiding, sight, names, umbra_of, way });
        }
        let mut lighting = Self { by, plates, is_fine: false };
        if let Body::Flat(shape) = surface.body() {
            lighting.tabulate(shape);
        }
        Ok(lighting)
    }

    /// What comes through windows onto a patch of the plane.
    fn tabulate(&mut self, shape: &Shape) {
        for i in 0..self.by.len() {
            let Way::Behind(count, _) = self.by[i].way else { continue };
            let of = |place: DVec2| self.by[i].through(count, place.extend(0.0), DVec3::Z, self);
            // A sky stands alike over all places.
            let (x_m, y_m) = shape.bounding_box();
            let middle = DVec2::new(f64::midpoint(x_m.0, x_m.1), f64::midpoint(y_m.0, y_m.1));
            let table = if self.by[i].source.is_sky() {
                let everywhere = of(middle);
                Smooth::new(shape, &|_| everywhere)
            } else {
                Smooth::new(shape, &of)
            };
            self.by[i].way = Way::Behind(count, Some(table));
        }
    }

    /// With more nodes where light comes through windows, and no table.
    pub(super) fn finer(&self) -> Option<Self> {
        let mut by = self.by.clone();
        let mut is_any = false;
        for by in &mut by {
            if let Way::Behind(_, table) = &mut by.way {
                (*table, is_any) = (None, true);
            }
        }
        is_any.then(|| Self { by, plates: self.plates.clone(), is_fine: true })
    }

    /// Whether nothing but the direction decides what arrives from where: a sky that nothing hides.
    pub(super) fn is_of_sky_alone(&self) -> bool {
        let is_sky = |by: &LitBy| {
            matches!(by.source.kind, SourceKind::Surrounding(_)) && by.before.is_empty()
        };
        self.by.iter().all(is_sky)
    }

    /// What may come between which source and a cell of the surface; nothing else does.
    pub(super) fn shades(&self, cell: &projected::Region) -> Vec<Shade> {
        let mut shades = Vec::new();
        for by in &self.by {
            let source = &by.source;
            let certain = by.umbra_of.iter();
            let possible = by.names.iter().zip(&by.before).filter_map(|(name, body)| {
                let is_shaded = source.shades(Some(cell), body) != RegionShadow::Lit;
                is_shaded.then_some(name)
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
        let all = self.by.iter().flat_map(|by| by.source.towards(place));
        all.filter(|towards| towards.is_finite()).collect()
    }

    /// W·m⁻² or lm·m⁻².
    pub(super) fn irradiance(&self, place: DVec3, normal: DVec3) -> f64 {
        self.by.iter().map(|by| by.irradiance(place, normal, self)).sum()
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

impl Way {
    fn passes(&self) -> f64 {
        match self {
            Self::Dimmed(part) => *part,
            Self::Open | Self::Behind(..) => 1.0,
        }
    }
}

/// The sample's windows that are in, and that stand above a surface; the lowest first.
fn plates_above(
    scene: &Scene,
    surface: &Surface,
    is_in: Included<'_>,
) -> Result<Vec<Plate>, CompileError> {
    let top_m = match surface.body() {
        Body::Raised(solid) => solid.heights_m().1,
        Body::Flat(_) => 0.0,
    };
    let mut plates = Vec::new();
    for (i, window) in scene.windows().iter().enumerate() {
        let is_above = window.z_m + window.thickness_m / 2.0 > top_m;
        let is_own = window.belongs_to == WindowOwner::Sample;
        if is_above && is_own && is_in(&format!("window[{i}]")) {
            let plate = Plate::new(window);
            plates.push(plate.map_err(|e| CompileError::Scene(format!("window[{i}]: {e}")))?);
        }
    }
    plates.sort_by(|a, b| a.low_m().total_cmp(&b.low_m()));
    Ok(plates)
}

/// How many plates lie below what begins at a height. Nothing lies inside one.
fn zone(plates: &[Plate], bottom_m: f64) -> usize {
    let middle = |plate: &Plate| f64::midpoint(plate.low_m(), plate.high_m());
    plates.iter().filter(|plate| middle(plate) < bottom_m).count()
}

impl LitBy {
    fn glossy(&self, lobe: &Lobe<'_>, place: DVec3) -> f64 {
        if self.umbra_of.is_some() || !self.source.faces(place) {
            return 0.0;
        }
        let seen = match (&self.source.kind, &self.sight) {
            (SourceKind::Surrounding(sky), _) => {
                lobe.of_surrounding(&sky.seen, &self.hiding, Counts::Seen)
            }
            (_, Some(sight)) => self.way.passes() * lobe.radiance(sight, &self.hiding),
            (_, None) => 0.0,
        };
        self.source.radiance * seen
    }

    fn irradiance(&self, place: DVec3, normal: DVec3, of: &Lighting) -> f64 {
        if self.umbra_of.is_some() || !self.source.faces(place) {
            return 0.0;
        }
        let source = &*self.source;
        match &self.way {
            Way::Behind(_, Some(table)) => {
                return source.radiance * table.at(place.truncate()).max(0.0);
            }
            Way::Behind(count, None) => {
                return source.radiance * self.through(*count, place, normal, of);
            }
            Way::Open | Way::Dimmed(_) => {}
        }
        if let SourceKind::Surrounding(sky) = &source.kind {
            let lobe = Gloss::of_all_that_arrives().lobe(place, normal, normal);
            let hidden = PI * lobe.of_surrounding(&sky.seen, &self.hiding, Counts::Hidden);
            return source.radiance * (sky.irradiance(normal) - hidden).max(0.0);
        }
        // At a place that touches a body the kernel has no answer; next to it, it has.
        let seen = self.projected(place, normal).or_else(|| {
            let beside = place + normal * BESIDE_M;
            self.projected(beside, normal)
        });
        source.radiance * self.way.passes() * seen.unwrap_or(0.0)
    }

    /// Irradiance that comes through so many windows for a radiance of one.
    fn through(&self, count: usize, place: DVec3, normal: DVec3, of: &Lighting) -> f64 {
        let shines = match (&self.source.kind, &self.sight) {
            (SourceKind::Surrounding(sky), _) => Shines::Sky(&sky.seen),
            (_, Some(sight)) => Shines::Body(sight, count),
            (_, None) => return 0.0,
        };
        let (plates, is_fine) = (&of.plates[..count], of.is_fine);
        let passes = |cos: f64| rings::transmittance(plates, cos);
        Rings { place, normal, plates, shines, before: &[], passes: &passes, is_fine }.sum()
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
