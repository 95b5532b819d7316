//! Irradiance at a place through windows: an integral over directions, ring by ring about the windows' normal.
//! It knows one source at a time and no detector.
//!
//! A plate lets through what it does, and shifts what is above it, by the angle θ to its normal alone:
//! from a place below, what is above is seen along θ as from a place that is higher by
//! d (1 - tan θ₂ / tan θ₁). So on a ring of one θ every body above or below ends where a cone from
//! a known place does. Between such ends the irradiance is closed, ∫ cos θₙ dφ. Over θ the rings are cut where
//! what they cross changes, with Gauss and Legendre's rule between; there may be square roots at the
//! cuts, which a sine takes away.

#[cfg(test)]
mod tests;

use core::f64::consts::{FRAC_PI_2, TAU};
use std::sync::OnceLock;

use glam::DVec3;
use radiometry::direction::angle_between;
use radiometry::quadrature::gauss_legendre;

use super::gloss::{Curve, Level, Sight, Surrounding};
use super::plate::Plate;

/// Nodes over θ between two cuts, and more, to tell the error.
const NODES: usize = 10;
const FINER: usize = 16;
/// Rings that are looked at across a source, and across a body before it.
const LOOKS: u32 = 12;
const LOOKS_BEFORE: u32 = 6;
/// Halvings of the place of a cut; cuts between two looks at most.
const HALVINGS: u32 = 28;
const CUTS: u32 = 8;
/// How much wider than a ball about it a body is looked for.
const WIDER: f64 = 1.01;

/// What shines, with a radiance of 1 or as a sky does.
#[derive(Clone, Copy)]
pub(super) enum Shines<'s> {
    /// Behind so many plates.
    Body(&'s Sight, usize),
    /// Beyond all of them.
    Sky(&'s Surrounding),
}

/// A place, and what it sees upwards.
pub(super) struct Rings<'r> {
    pub(super) place: DVec3,
    /// The receiver's unit normal.
    pub(super) normal: DVec3,
    /// Above the place, the lowest first.
    pub(super) plates: &'r [Plate],
    pub(super) shines: Shines<'r>,
    /// What may hide a part, each behind so many plates.
    pub(super) before: &'r [(&'r Sight, usize)],
    /// What becomes of light along a cosine to the plates' normal.
    pub(super) passes: &'r dyn Fn(f64) -> f64,
    pub(super) is_fine: bool,
}

/// A part of a ring that is lit: from, to, and the radiance where that is even.
type Lit = (f64, f64, f64);

/// One ring: what of it is lit, and what is crossed, in which order.
struct Ring {
    lit: Vec<Lit>,
    order: Vec<u32>,
}

impl Rings<'_> {
    pub(super) fn sum(&self) -> f64 {
        let (low, high) = match &self.shines {
            Shines::Body(sight, zone) => self.reach(sight, *zone),
            Shines::Sky(_) => (0.0, FRAC_PI_2),
        };
        if low >= high {
            return 0.0;
        }
        let cuts = self.cuts(low, high);
        let pairs = cuts.windows(2).filter(|pair| pair[0] < pair[1]);
        pairs.map(|pair| self.over(pair[0], pair[1])).sum::<f64>().max(0.0)
    }

    /// From where a direction is seen beyond so many plates.
    fn origin(&self, zone: usize, cos: f64) -> DVec3 {
        let raised = self.plates[..zone].iter().map(|plate| plate.raises_m(cos)).sum::<f64>();
        self.place + DVec3::Z * raised
    }

    /// The smallest and the largest θ under which a body may be seen.
    fn reach(&self, sight: &Sight, zone: usize) -> (f64, f64) {
        let from = |cos: f64| match sight.cone(self.origin(zone, cos)) {
            Some((towards, half)) => {
                let theta = angle_between(DVec3::Z, towards);
                (theta - WIDER * half, theta + WIDER * half)
            }
            None => (0.0, FRAC_PI_2),
        };
        let (a, b) = (from(1.0), from(0.0));
        (a.0.min(b.0).max(0.0), a.1.max(b.1).min(FRAC_PI_2))
    }

    /// Where what rings cross changes, and both ends.
    fn cuts(&self, low: f64, high: f64) -> Vec<f64> {
        let mut looks = vec![low, high];
        let mut across = |(a, b): (f64, f64), count: u32| {
            let (a, b) = (a.max(low), b.min(high));
            if a < b {
                let step = (b - a) / f64::from(count);
                looks.extend((0..=count).map(|i| a + step * f64::from(i)));
            }
        };
        across((low, high), LOOKS);
        for (sight, zone) in self.before {
            across(self.reach(sight, *zone), LOOKS_BEFORE);
        }
        let mut cuts = vec![low, high];
        if let Shines::Sky(map) = &self.shines {
            let rows = map.parallels();
            looks.extend(rows.iter().copied().filter(|theta| *theta > low && *theta < high));
            cuts.extend(rows.into_iter().filter(|theta| *theta > low && *theta < high));
        }
        looks.sort_by(f64::total_cmp);
        let mut before: Option<(f64, Vec<u32>)> = None;
        for at in looks {
            let order = self.ring(at).order;
            if let Some((mut from, mut was)) = before.take() {
                for _ in 0..CUTS {
                    if was == order {
                        break;
                    }
                    let (mut a, mut b) = (from, at);
                    for _ in 0..HALVINGS {
                        let middle = f64::midpoint(a, b);
                        if self.ring(middle).order == was { a = middle } else { b = middle }
                    }
                    cuts.push(b);
                    (from, was) = (b, self.ring(b).order);
                }
            }
            before = Some((at, order));
        }
        cuts.sort_by(f64::total_cmp);
        cuts
    }

    /// Between two cuts.
    fn over(&self, low: f64, high: f64) -> f64 {
        let half = 0.5 * (high - low);
        let nodes = rule(self.is_fine).iter();
        let of = |(node, weight): &(f64, f64)| {
            // The slope vanishes at both ends.
            let (sin, cos) = libm::sincos(FRAC_PI_2 * node);
            weight * FRAC_PI_2 * cos * half * self.on_ring(low + half * (1.0 + sin))
        };
        nodes.map(of).sum()
    }

    /// ∫ over φ, with all that depends on θ.
    fn on_ring(&self, theta: f64) -> f64 {
        let (sin, cos) = libm::sincos(theta);
        let passes = (self.passes)(cos);
        if passes <= 0.0 {
            return 0.0;
        }
        let normal = self.normal;
        let along = |(from, to, radiance): &Lit| {
            let ((s1, c1), (s2, c2)) = (libm::sincos(*from), libm::sincos(*to));
            let round = normal.x * (s2 - s1) - normal.y * (c2 - c1);
            radiance * (normal.z * cos * (to - from) + sin * round)
        };
        passes * sin * self.ring(theta).lit.iter().map(along).sum::<f64>()
    }

    fn ring(&self, theta: f64) -> Ring {
        let (sin, cos) = libm::sincos(theta);
        let mut ends: Vec<(f64, u32)> = Vec::new();
        let (ring, mut id) = (Curve::parallel(sin, cos), 0);
        let mut crossed = |levels: &[Level]| {
            for level in levels {
                let mut found = Vec::new();
                ring.crossings(level, &mut found);
                ends.extend(found.into_iter().map(|phi| (phi, id)));
                id += 1;
            }
        };
        crossed(&[Level::Plane(self.normal)]);
        let own = match &self.shines {
            Shines::Sky(map) => {
                crossed(map.meridians());
                None
            }
            Shines::Body(sight, zone) => Some((*sight, *zone)),
        };
        for (sight, zone) in own.iter().chain(self.before) {
            crossed(&sight.levels(self.origin(*zone, cos)));
        }
        ends.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut lit, mut order, mut is_any) = (Vec::new(), Vec::new(), false);
        let turns = ends.len().max(1);
        for i in 0..turns {
            let from = ends.get(i).map_or(0.0, |end| end.0);
            let to = ends.get(i + 1).or(ends.first()).map_or(TAU, |end| end.0);
            let to = if i + 1 >= turns { if ends.is_empty() { TAU } else { to + TAU } } else { to };
            let (s, c) = libm::sincos(f64::midpoint(from, to));
            let radiance = self.seen(DVec3::new(sin * c, sin * s, cos));
            order.extend(ends.get(i).map(|end| 2 * end.1 + u32::from(radiance.is_some())));
            if let Some(radiance) = radiance {
                is_any = true;
                lit.push((from, to, radiance));
            }
        }
        if !is_any {
            order.clear();
        } else if ends.is_empty() {
            order.push(u32::MAX);
        }
        Ring { lit, order }
    }

    /// What is seen of a sky in a direction, or 1 of a body.
    fn seen(&self, towards: DVec3) -> Option<f64> {
        if towards.dot(self.normal) <= 0.0 {
            return None;
        }
        let (far, zone, radiance) = match &self.shines {
            Shines::Sky(map) => (f64::INFINITY, self.plates.len(), map.radiance(towards)),
            Shines::Body(sight, zone) => {
                let origin = self.origin(*zone, towards.z);
                let far = sight.distance(origin, towards)?;
                (far, *zone, 1.0)
            }
        };
        let is_hidden = self.before.iter().any(|(sight, own)| {
            let near = sight.distance(self.origin(*own, towards.z), towards);
            near.is_some_and(|near| *own < zone || near < far)
        });
        (!is_hidden).then_some(radiance)
    }
}

/// Nodes in (-1, 1) and weights.
fn rule(is_fine: bool) -> &'static [(f64, f64)] {
    static RULES: [OnceLock<Vec<(f64, f64)>>; 2] = [const { OnceLock::new() }; 2];
    let nodes = if is_fine { FINER } else { NODES };
    RULES[usize::from(is_fine)].get_or_init(|| gauss_legendre(nodes))
}

/// The mean of what plates let through of a disk at infinity, weighted with what a level surface receives.
pub(super) fn mean_transmittance(plates: &[Plate], towards: DVec3, half_angle_rad: f64) -> f64 {
    let Ok(nodes) = radiometry::quadrature::cone(half_angle_rad, 6, 16) else { return 0.0 };
    let (e, f) = radiometry::direction::frame(towards);
    let (mut passed, mut all) = (0.0, 0.0);
    for node in nodes {
        let local = radiometry::direction::unit(node.theta_rad, node.phi_rad);
        let direction = e * local.x + f * local.y + towards * local.z;
        // The rule's weight holds the cosine to the disk's centre; the receiver's is another.
        let weight = node.weight_sr / local.z * direction.z.max(0.0);
        all += weight;
        passed += weight * transmittance(plates, direction.z);
    }
    if all > 0.0 { passed / all } else { 1.0 }
}

/// Of all of them together.
pub(super) fn transmittance(plates: &[Plate], cos: f64) -> f64 {
    plates.iter().map(|plate| plate.transmittance(cos)).product()
}
