//! Rays of a region that tell most of what is seen there: a grid, the places into which shadows may
//! fall, and the bodies that stand in the way.

use core::f64::consts::TAU;

use glam::DVec3;
use radiometry::direction::angles;
use radiometry::projected;
use radiometry::shape::Polygon;

use super::lamps::Shade;
use super::{Glow, Lit, LitScene};
use crate::Region;
use crate::field::{Field, Ray, grid};
use crate::scene::Body;

/// Cells along each side of a region, 2 to this power, of which each is asked for shadows.
const HALVINGS: u32 = 5;
/// Polar angles and azimuths under which a body is looked at from below.
const LEANS: u32 = 3;
const TURNS: u32 = 8;
/// Steps along each side where nothing is known of shadows.
const STEPS: u32 = 16;
/// Of slow fields every so many rays of the grid: prime to its directions.
const SPARSE: usize = 7;
/// Places along each side of a region from which the mirror images of lamps are looked at.
const GLINTS: u32 = 5;

pub(super) fn of(lit: &LitScene, region: &Region) -> Vec<Ray> {
    let every = if lit.is_slow() { SPARSE } else { 1 };
    let all = if lit.is_even() { Vec::new() } else { grid(region) };
    let mut rays: Vec<Ray> = all.into_iter().step_by(every).collect();
    rays.extend(towards_bodies(lit, region));
    rays.extend(glints(lit, region));
    if lit.flat.iter().any(|part| matches!(part.glow, Glow::Lit(_))) {
        let at =
            |(low, high): (f64, f64), i: u32| low + (high - low) * f64::from(i) / f64::from(STEPS);
        for i in 0..=STEPS {
            rays.extend(
                (0..=STEPS).map(|k| Ray::new(at(region.x_m, i), at(region.y_m, k), 0.0, 0.0)),
            );
        }
        for cell in shaded(lit, region) {
            let (x, y) = cell.middle();
            rays.push(Ray::new(x, y, 0.0, 0.0));
            if !lit.is_slow() {
                rays.extend(cell.corners().map(|(x, y)| Ray::new(x, y, 0.0, 0.0)));
            }
        }
    }
    if let Some(interreflection) = &lit.interreflection {
        let places = interreflection.places();
        rays.extend(places.into_iter().flat_map(|place| towards(place, region)));
    }
    rays
}

/// From places of glossy surfaces into directions in which what shines on them is mirrored: there a lobe
/// is brightest, and what stands before a lamp hides most of it.
fn glints(lit: &LitScene, region: &Region) -> Vec<Ray> {
    let at =
        |(low, high): (f64, f64), i: u32| low + (high - low) * f64::from(i) / f64::from(GLINTS - 1);
    let within = |(low, high): (f64, f64), at: f64| (low..=high).contains(&at);
    let mut rays = Vec::new();
    for part in lit.flat.iter().chain(&lit.raised) {
        let Glow::Lit(Lit { lighting, gloss: Some(_), .. }) = &part.glow else { continue };
        let places: Vec<DVec3> = match &part.body {
            Body::Raised(solid) => solid.points(),
            Body::Flat(_) => (0..GLINTS * GLINTS)
                .map(|i| DVec3::new(at(region.x_m, i / GLINTS), at(region.y_m, i % GLINTS), 0.0))
                .collect(),
        };
        for place in places {
            let normal = part.body.normal(place);
            rays.extend(lighting.towards(place).into_iter().filter_map(|towards| {
                let into = normal * (2.0 * normal.dot(towards)) - towards;
                let ray = Ray::through(place, into)?;
                let is_seen = angles(into).0 <= region.theta_max_rad
                    && within(region.x_m, ray.point.x)
                    && within(region.y_m, ray.point.y);
                is_seen.then_some(ray)
            }));
        }
    }
    rays
}

/// A small rectangle of the sample's plane into which a shadow may fall, and whose.
pub(super) struct ShadedCell {
    pub(super) x_m: (f64, f64),
    pub(super) y_m: (f64, f64),
    pub(super) surface: String,
    pub(super) shades: Vec<Shade>,
}

impl ShadedCell {
    fn middle(&self) -> (f64, f64) {
        (f64::midpoint(self.x_m.0, self.x_m.1), f64::midpoint(self.y_m.0, self.y_m.1))
    }

    fn corners(&self) -> [(f64, f64); 4] {
        let (x, y) = (self.x_m, self.y_m);
        [(x.0, y.0), (x.1, y.0), (x.1, y.1), (x.0, y.1)]
    }
}

/// The cells of a region's flat surfaces that are not certain to be unshaded: halved and halved again,
/// so that no shadow is missed however small it is.
pub(super) fn shaded(lit: &LitScene, region: &Region) -> Vec<ShadedCell> {
    let mut found = Vec::new();
    for part in &lit.flat {
        let (Glow::Lit(Lit { lighting, .. }), Some(shape)) = (&part.glow, part.body.shape()) else {
            continue;
        };
        let (x, y) = shape.bounding_box();
        let within = |a: (f64, f64), b: (f64, f64)| (a.0.max(b.0), a.1.min(b.1));
        let mut open = vec![(within(x, region.x_m), within(y, region.y_m), HALVINGS)];
        while let Some((x, y, halvings)) = open.pop() {
            if x.0 >= x.1 || y.0 >= y.1 {
                continue;
            }
            let corners = [(x.0, y.0), (x.1, y.0), (x.1, y.1), (x.0, y.1)];
            let corners = corners.map(|(x, y)| DVec3::new(x, y, 0.0)).to_vec();
            let Ok(polygon) = Polygon::new(corners) else { continue };
            let shades = lighting.shades(&projected::Region::Polygon(polygon));
            if shades.is_empty() {
                continue;
            }
            if halvings == 0 {
                let surface = part.name.clone();
                found.push(ShadedCell { x_m: x, y_m: y, surface, shades });
                continue;
            }
            let (mx, my) = (f64::midpoint(x.0, x.1), f64::midpoint(y.0, y.1));
            for x in [(x.0, mx), (mx, x.1)] {
                open.extend([(x, (y.0, my), halvings - 1), (x, (my, y.1), halvings - 1)]);
            }
        }
    }
    found
}

/// Rays through the middle of each raised body and just inside its outline, as far as the region has
/// them.
pub(super) fn towards_bodies(lit: &LitScene, region: &Region) -> Vec<Ray> {
    let mut rays = Vec::new();
    for part in &lit.raised {
        let Body::Raised(solid) = &part.body else { continue };
        for target in solid.points() {
            rays.extend(towards(target, region));
            rays.extend(under(target, region));
        }
    }
    rays
}

/// A place as it is seen over the region's corners and middle; one on the plane from above.
fn towards(target: DVec3, region: &Region) -> Vec<Ray> {
    let within = |(low, high): (f64, f64), at: f64| (low..=high).contains(&at);
    if target.z == 0.0 {
        let is_inside = within(region.x_m, target.x) && within(region.y_m, target.y);
        return is_inside.then(|| Ray::new(target.x, target.y, 0.0, 0.0)).into_iter().collect();
    }
    let over = corners_and_middle(region).into_iter().filter_map(|(x, y)| {
        let (theta, phi) = angles(target - DVec3::new(x, y, 0.0));
        (theta <= region.theta_max_rad).then(|| Ray::new(x, y, theta, phi))
    });
    over.collect()
}

/// Through a point into directions of the region, from places of it.
fn under(target: DVec3, region: &Region) -> Vec<Ray> {
    let mut rays = Vec::new();
    for i in 0..LEANS * TURNS {
        let theta = region.theta_max_rad * f64::from(i / TURNS) / f64::from(LEANS - 1);
        let ray = Ray::new(0.0, 0.0, theta, TAU * f64::from(i % TURNS) / f64::from(TURNS));
        let Some(ray) = Ray::through(target, ray.direction) else { continue };
        let within = |(low, high): (f64, f64), at: f64| (low..=high).contains(&at);
        if within(region.x_m, ray.point.x) && within(region.y_m, ray.point.y) {
            rays.push(ray);
        }
    }
    rays
}

fn corners_and_middle(region: &Region) -> [(f64, f64); 5] {
    let (x, y) = (region.x_m, region.y_m);
    let middle = (f64::midpoint(x.0, x.1), f64::midpoint(y.0, y.1));
    [(x.0, y.0), (x.1, y.0), (x.1, y.1), (x.0, y.1), middle]
}
