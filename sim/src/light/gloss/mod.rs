//! The glossy part of what a surface sends towards the detector: the lobe about the mirror direction,
//! integrated over what is seen of a source. It knows one source at a time and no detector.
//!
//! L = s (n + 2)/(2π) ∫ L' cosⁿα cos θ dω with α from the mirror direction (Lafortune and Willems 1994).
//! By Stokes it is an integral once along the outline of what is seen, as Arvo (1995) has it for
//! polygons: with cos θ = m cos α + sin α (e cos ψ + f sin ψ), the integrals over α from the mirror
//! direction out are functions of α alone, and what is left goes over ψ along the outline, by Gauss and
//! Legendre's rule on pieces no longer than the lobe is wide. The outline is made of pieces of those of
//! the source, the horizon and the bodies before it, each cut where it crosses another; a piece counts
//! where the source is seen on one side of it and not on the other.

mod moments;
mod outline;
mod surrounding;
#[cfg(test)]
mod tests;

use std::sync::{Arc, OnceLock};

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;
use radiometry::direction::{angle_between, normalised};
use radiometry::quadrature::gauss_legendre;

use crate::scene::{Reflection, Solid};
use moments::Moments;
pub(super) use outline::{Curve, Level};
pub(super) use surrounding::{Counts, Surrounding};

/// Nodes on a piece of an outline; and more, to tell the error.
const NODES: usize = 8;
const FINER: usize = 14;
/// On pieces much shorter than what happens along them.
const FEW: usize = 3;
const SHORT: f64 = 0.15;
/// The length of a piece of an outline, in widths of the lobe or distances from its middle; radians
/// at most; and how often it is halved at most.
const LENGTH: f64 = 1.5;
const LONGEST_RAD: f64 = 0.6;
const HALVINGS: u32 = 14;
/// And of a circle, which cancels but for its size, however small it is: a quarter of it.
const TURN_RAD: f64 = 1.6;
/// From as many widths on the integral is taken from beyond, so that nothing cancels.
const FAR: f64 = 3.0;
/// How far beside an outline is looked, radians.
const BESIDE_RAD: f64 = 1e-7;

/// From where the integrals over α are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Taken {
    /// From the mirror direction out.
    Within,
    /// From beyond the lobe in, far from its middle.
    Beyond,
    /// The same, as near to the middle as it may be.
    AllAround,
}

/// What shines or hides, as directions from a place.
#[derive(Debug, Clone)]
pub(super) enum Sight {
    Body(Solid),
    /// At infinity: the direction of its centre and half of what it subtends.
    Cap(DVec3, f64),
}

/// How a surface reflects beside Lambert's law.
#[derive(Debug, Clone)]
pub(super) struct Gloss {
    /// s (n + 2)/(2π).
    factor: f64,
    moments: Arc<Moments>,
    is_fine: bool,
}

impl Gloss {
    /// `None` of a surface that has no lobe.
    pub(super) fn new(of: &Reflection) -> Option<Self> {
        let factor = of.gloss * (of.exponent + 2.0) / TAU;
        let moments = || Arc::new(Moments::new(of.exponent));
        (!of.is_lambertian()).then(|| Self { factor, moments: moments(), is_fine: false })
    }

    /// With more nodes.
    pub(super) fn finer(&self) -> Self {
        Self { is_fine: true, ..self.clone() }
    }

    /// Lambert's law as a lobe: 1/π of what arrives above a surface, looked at along its normal.
    pub(super) fn of_all_that_arrives() -> &'static Self {
        static WHOLE: OnceLock<Gloss> = OnceLock::new();
        WHOLE.get_or_init(|| Self {
            factor: 1.0 / PI,
            moments: Arc::new(Moments::new(0.0)),
            is_fine: false,
        })
    }

    /// At a place, for light that leaves into a direction.
    pub(super) fn lobe(&self, place: DVec3, normal: DVec3, into: DVec3) -> Lobe<'_> {
        let mirror = normal * (2.0 * normal.dot(into)) - into;
        let mirror = normalised(mirror).unwrap_or(normal);
        Lobe { gloss: self, place, normal, mirror, rise: normal.dot(mirror) }
    }
}

/// Where the lobe is looked at from.
pub(super) struct Lobe<'g> {
    gloss: &'g Gloss,
    place: DVec3,
    normal: DVec3,
    mirror: DVec3,
    /// The mirror direction's cosine to the normal.
    rise: f64,
}

/// What has an outline: the horizon, or a body.
#[derive(Clone, Copy)]
enum Bounding<'b> {
    Horizon,
    Of(&'b Sight),
}

impl Lobe<'_> {
    /// What it sends on of a source of radiance 1 behind bodies.
    pub(super) fn radiance(&self, source: &Sight, before: &[Sight]) -> f64 {
        let moments = &*self.gloss.moments;
        let cone = source.cone(self.place);
        let low = cone.map_or(0.0, |(towards, half)| angle_between(self.mirror, towards) - half);
        let height = |(towards, half): (DVec3, f64)| {
            let middle = FRAC_PI_2 - angle_between(self.normal, towards);
            (middle - half, middle + half)
        };
        let heights = cone.map_or((-1.0, 1.0), height);
        if low >= moments.edge() || heights.1 <= 0.0 {
            return 0.0;
        }
        let is_near = |body: &&Sight| match (cone, body.cone(self.place)) {
            (Some((a, half_a)), Some((b, half_b))) => angle_between(a, b) < half_a + half_b,
            _ => true,
        };
        let before: Vec<&Sight> = before.iter().filter(is_near).collect();
        let horizon = (heights.0 <= 0.0).then_some(Bounding::Horizon);
        let bodies = before.iter().map(|body| Bounding::Of(body));
        let all: Vec<Bounding<'_>> =
            horizon.into_iter().chain([Bounding::Of(source)]).chain(bodies).collect();
        let levels: Vec<Vec<Level>> = all.iter().map(|own| self.levels(*own)).collect();
        let is_far = low > FAR * moments.width();
        let taken = if is_far { Taken::Beyond } else { Taken::Within };
        let mut sum = 0.0;
        for (i, own) in all.iter().enumerate() {
            for curve in self.outline(*own) {
                let (first, last) = curve.range();
                let mut cuts = Vec::new();
                curve.crossings(&Level::Plane(self.mirror), &mut cuts);
                for (_, others) in levels.iter().enumerate().filter(|(k, _)| *k != i) {
                    for level in others {
                        curve.crossings(level, &mut cuts);
                    }
                }
                cuts.extend([first, last]);
                cuts.sort_by(f64::total_cmp);
                for pair in cuts.windows(2).filter(|pair| pair[0] < pair[1]) {
                    let side = self.side(
                        &curve,
                        f64::midpoint(pair[0], pair[1]),
                        source,
                        &all[..i],
                        &before,
                    );
                    if side != 0.0 {
                        sum += side * self.along(&curve, (pair[0], pair[1]), taken, HALVINGS);
                    }
                }
            }
        }
        // What cancels may leave less than nothing.
        (self.gloss.factor * sum).max(0.0)
    }

    fn outline(&self, of: Bounding<'_>) -> Vec<Curve> {
        match of {
            Bounding::Horizon => vec![Curve::great_circle(self.normal)],
            Bounding::Of(sight) => sight.outline(self.place),
        }
    }

    fn levels(&self, of: Bounding<'_>) -> Vec<Level> {
        match of {
            Bounding::Horizon => vec![Level::Plane(self.normal)],
            Bounding::Of(sight) => sight.levels(self.place),
        }
    }

    /// 1 where the source is seen to the left of a curve and not to the right, -1 the other way round,
    /// 0 where both sides are alike or an earlier outline goes the same way.
    fn side(
        &self,
        curve: &Curve,
        t: f64,
        source: &Sight,
        earlier: &[Bounding<'_>],
        before: &[&Sight],
    ) -> f64 {
        let (at, goes) = curve.at(t);
        let (Some(at), Some(left)) = (normalised(at), normalised(at.cross(goes))) else {
            return 0.0;
        };
        let sides = [at + left * BESIDE_RAD, at - left * BESIDE_RAD];
        let holds = |of: &Bounding<'_>, towards: DVec3| match of {
            Bounding::Horizon => towards.dot(self.normal) > 0.0,
            Bounding::Of(sight) => sight.distance(self.place, towards).is_some(),
        };
        if earlier.iter().any(|of| holds(of, sides[0]) != holds(of, sides[1])) {
            return 0.0;
        }
        let is_seen = |towards: DVec3| {
            let far =
                source.distance(self.place, towards).filter(|_| towards.dot(self.normal) > 0.0);
            let hides = |far: f64, body: &&Sight| {
                body.distance(self.place, towards).is_some_and(|near| near < far)
            };
            far.is_some_and(|far| !before.iter().any(|body| hides(far, body)))
        };
        let [left, right] = sides.map(|side| f64::from(u8::from(is_seen(side))));
        left - right
    }

    /// Over a part of a curve, in pieces.
    fn along(&self, curve: &Curve, (from, to): (f64, f64), taken: Taken, halvings: u32) -> f64 {
        let middle = f64::midpoint(from, to);
        let [Some(a), Some(b), Some(c)] = [from, middle, to].map(|t| normalised(curve.at(t).0))
        else {
            return 0.0;
        };
        let length = a.distance(b) + b.distance(c);
        let from_mirror = |sign: f64| {
            let nearest =
                [a, b, c].map(|d| d.distance(self.mirror * sign)).into_iter().fold(2.0, f64::min);
            nearest - length / 2.0
        };
        let (ahead, moments) = (from_mirror(1.0), &*self.gloss.moments);
        if taken != Taken::Within && ahead > moments.edge() {
            return 0.0;
        }
        let scale = match taken {
            // The integrals from the mirror direction out have no limit right behind.
            Taken::Within => ahead.max(moments.width()).min(from_mirror(-1.0)),
            Taken::Beyond => ahead.max(moments.width()),
            // Those from beyond have none in the middle.
            Taken::AllAround => ahead.min(2.0 * moments.width()),
        };
        let is_long =
            length > (LENGTH * scale).min(LONGEST_RAD) || curve.turns(from, to) > TURN_RAD;
        if halvings > 0 && is_long {
            return self.along(curve, (from, middle), taken, halvings - 1)
                + self.along(curve, (middle, to), taken, halvings - 1);
        }
        let half = (to - from) / 2.0;
        let is_short = length < SHORT * scale && taken == Taken::AllAround;
        let parts = rule(self.gloss.is_fine, is_short).iter();
        parts
            .map(|(node, weight)| weight * half * self.turn(curve.at(middle + half * node), taken))
            .sum()
    }

    /// What a step along a curve brings.
    fn turn(&self, (at, goes): (DVec3, DVec3), taken: Taken) -> f64 {
        let square = at.length_squared();
        let towards = at / libm::sqrt(square);
        let cos = self.mirror.dot(towards);
        let sin_square = self.mirror.cross(towards).length_squared();
        let turned = self.mirror.dot(at.cross(goes)) / square;
        let sin = libm::sqrt(sin_square);
        if sin <= f64::EPSILON {
            return 0.5 * self.rise * turned;
        }
        let (cone, aside) = if taken == Taken::Within {
            self.gloss.moments.within(sin, cos)
        } else {
            let (cone, aside) = self.gloss.moments.beyond(sin, cos);
            (-cone, -aside)
        };
        let across = (self.normal.dot(towards) - cos * self.rise) / sin;
        (cone * self.rise + aside * across) * turned / sin_square
    }
}

impl Sight {
    /// How far it is from a place in a direction, if it is there.
    pub(super) fn distance(&self, place: DVec3, towards: DVec3) -> Option<f64> {
        match self {
            Self::Body(solid) => solid.last_hit(place, towards, (0.0, f64::INFINITY)),
            Self::Cap(centre, half) => {
                let is_inside = towards.distance(*centre) <= 2.0 * libm::sin(half / 2.0);
                is_inside.then_some(f64::INFINITY)
            }
        }
    }

    /// Directions from a place that hold it: their middle and half of what they subtend. `None` of a
    /// half-plane, and where a ball about it holds the place too: it may be anywhere.
    pub(super) fn cone(&self, place: DVec3) -> Option<(DVec3, f64)> {
        match self {
            Self::Cap(centre, half) => Some((*centre, *half)),
            Self::Body(solid) => {
                let (centre, radius_m) = solid.bounding_ball()?;
                let away = centre - place;
                let part = radius_m / away.length();
                (part < 1.0).then(|| (away / away.length(), libm::asin(part)))
            }
        }
    }
}

/// Nodes in (-1, 1) and weights.
fn rule(is_fine: bool, is_short: bool) -> &'static [(f64, f64)] {
    static RULES: [OnceLock<Vec<(f64, f64)>>; 4] = [const { OnceLock::new() }; 4];
    let nodes = match (is_fine, is_short) {
        (false, false) => NODES,
        (true, false) => FINER,
        (false, true) => FEW,
        (true, true) => 2 * FEW,
    };
    RULES[2 * usize::from(is_short) + usize::from(is_fine)].get_or_init(|| gauss_legendre(nodes))
}
