//! Light that a window throws back: what leaves the patches of the sample's plane is mirrored by the
//! plate above them and lights them again. Solved once, at nodes on each patch.
//!
//! A plate of the lower face at height z mirrors a patch to the height 2z; what its upper face throws
//! back seems to come from 2(z + d/n). The part of the lower face is Fresnel's R, that of the rest the
//! plate's reflectance less R.

use core::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DVec2, DVec3};
use radiometry::quadrature::gauss_legendre;

use super::lamps::Lighting;
use super::plate::Plate;
use super::smooth::Smooth;
use crate::scene::{Emitter, Shape};

/// Nodes along each side, and fewer, for an estimate of the error.
const NODES: usize = 10;
const FEWER: usize = 7;
/// Places along each side at which what comes back is kept.
const POINTS: usize = 13;
/// Rounds of reflection at most; each is weaker by a plate's reflectance and more.
const ROUNDS: usize = 60;

/// What shines up at a plate from one place of the sample's plane, times the area that it stands for.
#[derive(Debug, Clone)]
struct Node {
    place: DVec2,
    area_m2: f64,
    glow: NodeGlow,
}

#[derive(Debug, Clone)]
enum NodeGlow {
    /// The same radiance into all directions.
    Even(f64),
    Emits(Arc<Emitter>),
}

/// The light that a plate throws back on the plane: smooth over each patch, since it comes from as far
/// as the plate, so that values at a few places stand for all.
#[derive(Debug)]
pub(super) struct Returned {
    smooth: Vec<Smooth<POINTS>>,
    /// How far irradiances may be off, relative to the largest direct one.
    pub(super) error: f64,
}

/// A patch of the plane, as it takes part.
pub(super) enum Patch<'p> {
    Emits(&'p Emitter),
    Lit { shape: &'p Shape, albedo: f64, lighting: &'p Lighting },
}

impl Returned {
    pub(super) fn new(plate: Plate, patches: &[Patch<'_>]) -> Self {
        let solved = Solved::new(plate, patches, NODES);
        let rough = Solved::new(plate, patches, FEWER);
        let of = |place: DVec2| solved.irradiance(place);
        let smooth: Vec<Smooth<POINTS>> = patches
            .iter()
            .filter_map(|patch| match patch {
                Patch::Lit { shape, .. } => Some(Smooth::new(shape, &of)),
                Patch::Emits(_) => None,
            })
            .collect();
        let mut returned = Self { smooth, error: 0.0 };
        let (mut largest, mut apart) = (f64::MIN_POSITIVE, 0.0_f64);
        for place in solved.nodes.iter().map(|node| node.place) {
            let (fine, coarse) = (solved.irradiance(place), rough.irradiance(place));
            apart = apart.max((fine - coarse).abs());
            apart = apart.max((fine - returned.irradiance(place)).abs());
            largest = largest.max(fine);
        }
        returned.error = apart / largest;
        returned
    }

    /// What comes back to a place of a lit patch, W·m⁻² or lm·m⁻².
    pub(super) fn irradiance(&self, place: DVec2) -> f64 {
        let on = self.smooth.iter().find(|smooth| smooth.holds(place));
        on.map_or(0.0, |smooth| smooth.at(place))
    }
}

/// What the plane sends up, once all is settled.
#[derive(Debug)]
struct Solved {
    plate: Plate,
    nodes: Vec<Node>,
}

impl Solved {
    fn new(plate: Plate, patches: &[Patch<'_>], count: usize) -> Self {
        let (mut nodes, mut direct, mut albedos) = (Vec::new(), Vec::new(), Vec::new());
        for patch in patches {
            let shape = match patch {
                Patch::Emits(emitter) => emitter.shape(),
                Patch::Lit { shape, .. } => Some(*shape),
            };
            let Some(shape) = shape else { continue };
            let own = match patch {
                Patch::Emits(emitter) => Some(Arc::new((*emitter).clone())),
                Patch::Lit { .. } => None,
            };
            for (place, area_m2) in spread(shape, count) {
                let (glow, received, albedo) = match (patch, &own) {
                    (Patch::Lit { albedo, lighting, .. }, _) => {
                        let received = lighting.irradiance(place.extend(0.0), DVec3::Z);
                        (NodeGlow::Even(albedo / PI * received), received, *albedo)
                    }
                    (Patch::Emits(_), Some(emitter)) => {
                        (NodeGlow::Emits(Arc::clone(emitter)), 0.0, 0.0)
                    }
                    (Patch::Emits(_), None) => continue,
                };
                nodes.push(Node { place, area_m2, glow });
                direct.push(received);
                albedos.push(albedo);
            }
        }
        let mut returned = Self { plate, nodes };
        for _ in 0..ROUNDS {
            let places: Vec<DVec2> = returned.nodes.iter().map(|node| node.place).collect();
            let arriving = places.iter().map(|place| returned.irradiance(*place));
            let arriving: Vec<f64> = arriving.collect();
            let mut change: f64 = 0.0;
            for (i, node) in returned.nodes.iter_mut().enumerate() {
                if let NodeGlow::Even(radiance) = &mut node.glow {
                    let next = albedos[i] / PI * (direct[i] + arriving[i]);
                    change = change.max((next - *radiance).abs() / next.max(f64::MIN_POSITIVE));
                    *radiance = next;
                }
            }
            if change < 1e-13 {
                break;
            }
        }
        returned
    }

    /// What comes back to a place of the plane.
    fn irradiance(&self, place: DVec2) -> f64 {
        let near = 2.0 * self.plate.low_m();
        let far = near + 2.0 * self.plate.apparent_thickness_m();
        let of_node = |node: &Node| {
            let apart = place - node.place;
            // R h²/r⁴ for each unit of area: cos θ at both ends over r².
            let kernel = |height: f64| {
                let square = height * height + apart.length_squared();
                (height * height / (square * square), height / libm::sqrt(square))
            };
            let ((k1, cos1), (k2, cos2)) = (kernel(near), kernel(far));
            let (first, _) = self.plate.reflectances(cos1);
            let (lower, whole) = self.plate.reflectances(cos2);
            let part = first * k1 + (whole - lower).max(0.0) * k2;
            let radiance = match &node.glow {
                NodeGlow::Even(radiance) => *radiance,
                NodeGlow::Emits(emitter) => {
                    let up = (apart.extend(near)).normalize_or_zero();
                    emitter.radiance_into(node.place.x, node.place.y, up)
                }
            };
            radiance * part * node.area_m2
        };
        self.nodes.iter().map(of_node).sum()
    }
}

/// Nodes over a shape, with the areas that they stand for: a rule exact for smooth functions.
fn spread(shape: &Shape, count: usize) -> Vec<(DVec2, f64)> {
    let rule = gauss_legendre(count);
    let between =
        |(low, high): (f64, f64), node: f64| low + (high - low) * f64::midpoint(1.0, node);
    let mut nodes = Vec::new();
    match shape {
        Shape::Rectangle { x_m, y_m } => {
            let scale = (x_m.1 - x_m.0) * (y_m.1 - y_m.0) / 4.0;
            for (u, a) in &rule {
                for (v, b) in &rule {
                    nodes.push((DVec2::new(between(*x_m, *u), between(*y_m, *v)), a * b * scale));
                }
            }
        }
        Shape::Disk { x_m, y_m, radius_m } => {
            let spokes = 2 * count;
            for (u, a) in &rule {
                // Even steps of r².
                let radius = radius_m * libm::sqrt(f64::midpoint(1.0, *u));
                let area_m2 = PI * radius_m * radius_m * a / 2.0 / spokes as f64;
                for spoke in 0..spokes {
                    let (sin, cos) = libm::sincos(TAU * spoke as f64 / spokes as f64);
                    nodes.push((DVec2::new(x_m + radius * cos, y_m + radius * sin), area_m2));
                }
            }
        }
        Shape::Polygon(outline) => {
            for [a, b, c] in outline.triangles() {
                let (a, b, c) = (DVec2::from(a), DVec2::from(b), DVec2::from(c));
                let twice = (b - a).perp_dot(c - a);
                for (u, p) in &rule {
                    for (v, q) in &rule {
                        // Duffy's square, gathered at a.
                        let (s, t) = (f64::midpoint(1.0, *u), f64::midpoint(1.0, *v));
                        let place = a + (b - a) * (s * (1.0 - t)) + (c - a) * (s * t);
                        nodes.push((place, twice * s * p * q / 4.0));
                    }
                }
            }
        }
    }
    nodes
}
