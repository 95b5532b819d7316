//! A surrounding as lobes see it: an image of all directions, even within each pixel, perhaps behind
//! bodies. It knows no place and no detector.
//!
//! Of what is even in parts, an integral by Stokes is a sum over the borders between the parts, each
//! with the step of radiance across it. Taken from beyond the lobe inwards, only borders within the lobe
//! count, and what lies at its middle counts as if it filled the lobe.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;
use radiometry::direction::{angle_between, frame, normalised};

use super::outline::{Curve, Level};
use super::{BESIDE_RAD, Lobe, Sight, Taken};
use crate::scene::Image;

/// By how much the lobe's middle is moved off every border: what is seen there has to lie on one side.
const OFF_RAD: f64 = 1e-8;
/// A border next to the lobe's middle is halved down to a part of that.
const HALVINGS: u32 = 48;

/// θ over the rows, the first at +z; φ over the columns from -π to π.
#[derive(Debug, Clone)]
pub(in crate::light) struct Surrounding {
    image: Image,
    borders: Vec<Border>,
    /// The planes of the borders between columns.
    meridians: Vec<Level>,
}

/// Between two pixels of different radiance.
#[derive(Debug, Clone, Copy)]
struct Border {
    curve: Curve,
    range: (f64, f64),
    /// A cone that holds it.
    middle: DVec3,
    half_rad: f64,
    /// From right to left.
    step: f64,
}

/// What of a surrounding counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::light) enum Counts {
    /// What is seen past bodies.
    Seen,
    /// What bodies hide.
    Hidden,
}

impl Surrounding {
    pub(in crate::light) fn new(image: &Image) -> Self {
        let (rows, columns) = (image.rows(), image.columns());
        let theta = |row: usize| PI * row as f64 / rows as f64;
        let phi = |column: usize| TAU * column as f64 / columns as f64 - PI;
        let mut borders = Vec::new();
        for row in 0..rows {
            for column in 0..columns {
                let own = image.value(column, row);
                // Below it, left being up; and at the side of its lower φ.
                if row + 1 < rows {
                    let (sin, cos) = libm::sincos(theta(row + 1));
                    let curve = Curve::Circle(DVec3::Z * cos, DVec3::X * sin, DVec3::Y * sin);
                    let range = (phi(column), phi(column + 1));
                    let step = own - image.value(column, row + 1);
                    borders.push(Border::new(curve, range, step));
                }
                let before = image.value((column + columns - 1) % columns, row);
                let (sin, cos) = libm::sincos(phi(column));
                let curve = Curve::Circle(DVec3::ZERO, DVec3::Z, DVec3::new(cos, sin, 0.0));
                borders.push(Border::new(curve, (theta(row), theta(row + 1)), own - before));
            }
        }
        borders.retain(|border| border.step != 0.0);
        // An even number of meridians makes half as many planes.
        let planes = if columns.is_multiple_of(2) { columns / 2 } else { columns };
        let plane = |column| {
            let (sin, cos) = libm::sincos(phi(column));
            Level::Plane(DVec3::new(-sin, cos, 0.0))
        };
        let meridians = (0..planes).map(plane).collect();
        Self { image: image.clone(), borders, meridians }
    }

    /// Of a pixel.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a part of a count
    pub(in crate::light) fn radiance(&self, towards: DVec3) -> f64 {
        let cell = |part: f64, count: usize| ((part * count as f64) as usize).min(count - 1);
        let theta = libm::atan2(libm::hypot(towards.x, towards.y), towards.z);
        let phi = libm::atan2(towards.y, towards.x);
        let column = cell((phi + PI) / TAU, self.image.columns());
        self.image.value(column, cell(theta / PI, self.image.rows()))
    }

    /// The middles of its brightest pixels.
    pub(in crate::light) fn brightest(&self, count: usize) -> Vec<DVec3> {
        let (rows, columns) = (self.image.rows(), self.image.columns());
        let mut pixels: Vec<(f64, usize)> = (0..rows * columns)
            .map(|i| (self.image.value(i % columns, i / columns), i))
            .filter(|(value, _)| *value > 0.0)
            .collect();
        pixels.sort_by(|a, b| b.0.total_cmp(&a.0));
        let middle = |(_, i): (f64, usize)| {
            let theta = PI * ((i / columns) as f64 + 0.5) / rows as f64;
            let phi = TAU * ((i % columns) as f64 + 0.5) / columns as f64 - PI;
            radiometry::direction::unit(theta, phi)
        };
        pixels.into_iter().take(count).map(middle).collect()
    }

    /// θ of the borders between rows.
    pub(in crate::light) fn parallels(&self) -> Vec<f64> {
        let rows = self.image.rows();
        (1..rows).map(|row| PI * row as f64 / rows as f64).collect()
    }

    /// The planes in which the borders between columns lie.
    pub(in crate::light) fn meridians(&self) -> &[Level] {
        &self.meridians
    }

    /// What is 0 along borders that a cone of directions may meet: parallels and meridians.
    fn levels(&self, cone: Option<(DVec3, f64)>) -> Vec<Level> {
        let rows = self.image.rows();
        let reach = cone.map_or((0.0, PI), |(middle, half)| {
            let theta = libm::acos(middle.z.clamp(-1.0, 1.0));
            (theta - half, theta + half)
        });
        let mut levels = Vec::new();
        for row in 1..rows {
            let theta = PI * row as f64 / rows as f64;
            if theta > reach.0 - BESIDE_RAD && theta < reach.1 + BESIDE_RAD {
                let cos = libm::cos(theta);
                levels.push(Level::Round(DVec3::Z, cos));
            }
        }
        levels.extend(self.meridians.iter().filter(|level| {
            let Level::Plane(across) = level else { return true };
            cone.is_none_or(|(middle, half)| {
                middle.dot(*across).abs() <= libm::sin(half.min(FRAC_PI_2)) + BESIDE_RAD
            })
        }));
        levels
    }
}

impl Border {
    fn new(curve: Curve, range: (f64, f64), step: f64) -> Self {
        let towards = |t: f64| normalised(curve.at(t).0).unwrap_or(DVec3::Z);
        let middle = towards(f64::midpoint(range.0, range.1));
        // Its ends are the farthest of it.
        let half_rad = angle_between(middle, towards(range.0));
        Self { curve, range, middle, half_rad, step }
    }
}

/// A body before a surrounding: the directions that hold it, and what is 0 along its outline.
struct Body<'b> {
    sight: &'b Sight,
    cone: Option<(DVec3, f64)>,
    levels: Vec<Level>,
}

/// A lobe before a surrounding.
struct Before<'l> {
    lobe: &'l Lobe<'l>,
    map: &'l Surrounding,
    bodies: Vec<Body<'l>>,
    counts: Counts,
}

impl Lobe<'_> {
    /// What it sends on of a surrounding whose white has a radiance of 1.
    pub(in crate::light) fn of_surrounding(
        &self,
        map: &Surrounding,
        before: &[Sight],
        counts: Counts,
    ) -> f64 {
        // Generic: no border of any image leads this way.
        let (e, f) = frame(self.mirror);
        let mirror = self.mirror + (e * 0.6 + f * 0.8) * OFF_RAD;
        let mirror = normalised(mirror).unwrap_or(self.mirror);
        let lobe = Lobe { mirror, rise: self.normal.dot(mirror), ..*self };
        let bodies = before.iter().map(|sight| Body {
            sight,
            cone: sight.cone(lobe.place),
            levels: sight.levels(lobe.place),
        });
        let is_up = |body: &Body<'_>| {
            body.cone.is_none_or(|(towards, half)| {
                lobe.normal.dot(towards) > -libm::sin(half.min(FRAC_PI_2))
            })
        };
        let bodies: Vec<Body<'_>> = bodies.filter(is_up).collect();
        if counts == Counts::Hidden && bodies.is_empty() {
            return 0.0;
        }
        (lobe.gloss.factor * Before { lobe: &lobe, map, bodies, counts }.sum()).max(0.0)
    }
}

impl Before<'_> {
    fn sum(&self) -> f64 {
        let lobe = self.lobe;
        let moments = &*lobe.gloss.moments;
        // As if what is at the middle filled the lobe: ∫ cosⁿ⁺¹ sin over all of it.
        let whole = TAU * lobe.rise / (moments.exponent() + 2.0);
        let mut sum = whole * self.counted(lobe.mirror);
        let reach = moments.edge();
        for border in &self.map.borders {
            let aside = angle_between(border.middle, lobe.mirror);
            if aside - border.half_rad > reach || !self.may_count(border) {
                continue;
            }
            sum += self.along_border(border);
        }
        sum += self.along_horizon();
        for i in 0..self.bodies.len() {
            sum += self.along_body(i);
        }
        sum
    }

    /// Whether some of a border may lie where what counts is.
    fn may_count(&self, border: &Border) -> bool {
        let is_up =
            self.lobe.normal.dot(border.middle) > -libm::sin(border.half_rad.min(FRAC_PI_2));
        let is_hidden = |body: &Body<'_>| {
            body.cone.is_none_or(|(middle, half)| {
                angle_between(middle, border.middle) <= half + border.half_rad
            })
        };
        is_up && (self.counts == Counts::Seen || self.bodies.iter().any(is_hidden))
    }

    fn along_border(&self, border: &Border) -> f64 {
        let mut cuts = Vec::new();
        border.curve.crossings(&Level::Plane(self.lobe.mirror), &mut cuts);
        border.curve.crossings(&Level::Plane(self.lobe.normal), &mut cuts);
        for body in &self.bodies {
            let is_near = body.cone.is_none_or(|(middle, half)| {
                angle_between(middle, border.middle) <= half + border.half_rad
            });
            for level in body.levels.iter().filter(|_| is_near) {
                border.curve.crossings(level, &mut cuts);
            }
        }
        // Of meridians t is θ, of parallels φ, and both may be asked for in another turn.
        let (first, last) = border.range;
        let turned = cuts.clone();
        cuts.extend(turned.iter().map(|t| t - TAU));
        cuts.retain(|t| *t > first && *t < last);
        self.pieces(&border.curve, cuts, border.range, |_, _| false)
    }

    fn along_horizon(&self) -> f64 {
        let meets = |body: &Body<'_>| {
            body.cone.is_none_or(|(towards, half)| {
                self.lobe.normal.dot(towards).abs() < libm::sin(half.min(FRAC_PI_2))
            })
        };
        if self.counts == Counts::Hidden && !self.bodies.iter().any(meets) {
            return 0.0;
        }
        let curve = Curve::great_circle(self.lobe.normal);
        let mut cuts = Vec::new();
        curve.crossings(&Level::Plane(self.lobe.mirror), &mut cuts);
        let others = self.map.levels(None);
        for level in others.iter().chain(self.bodies.iter().flat_map(|body| &body.levels)) {
            curve.crossings(level, &mut cuts);
        }
        let range = curve.range();
        self.pieces(&curve, cuts, range, |a, b| self.is_across_border(a, b))
    }

    fn along_body(&self, own: usize) -> f64 {
        let body = &self.bodies[own];
        let mut sum = 0.0;
        let others = self.bodies.iter().enumerate().filter(|(k, _)| *k != own);
        let others: Vec<&Level> = others.flat_map(|(_, body)| &body.levels).collect();
        let borders = self.map.levels(body.cone);
        for curve in body.sight.outline(self.lobe.place) {
            let mut cuts = Vec::new();
            curve.crossings(&Level::Plane(self.lobe.mirror), &mut cuts);
            curve.crossings(&Level::Plane(self.lobe.normal), &mut cuts);
            for level in borders.iter().chain(others.iter().copied()) {
                curve.crossings(level, &mut cuts);
            }
            let range = curve.range();
            sum += self.pieces(&curve, cuts, range, |a, b| {
                self.is_across_border(a, b)
                    || self.is_up(a) != self.is_up(b)
                    || self.bodies[..own]
                        .iter()
                        .any(|body| self.is_before(body, a) != self.is_before(body, b))
            });
        }
        sum
    }

    /// Over the pieces of a curve between cuts, but for those that an earlier curve has covered.
    fn pieces(
        &self,
        curve: &Curve,
        mut cuts: Vec<f64>,
        (first, last): (f64, f64),
        is_covered: impl Fn(DVec3, DVec3) -> bool,
    ) -> f64 {
        cuts.extend([first, last]);
        cuts.sort_by(f64::total_cmp);
        let mut sum = 0.0;
        for pair in cuts.windows(2).filter(|pair| pair[0] < pair[1]) {
            let (at, goes) = curve.at(f64::midpoint(pair[0], pair[1]));
            let (Some(at), Some(left)) = (normalised(at), normalised(at.cross(goes))) else {
                continue;
            };
            let (left, right) = (at + left * BESIDE_RAD, at - left * BESIDE_RAD);
            let step = self.counted(left) - self.counted(right);
            if step != 0.0 && !is_covered(left, right) {
                let ends = (pair[0], pair[1]);
                sum += step * self.lobe.along(curve, ends, Taken::AllAround, HALVINGS);
            }
        }
        sum
    }

    /// The radiance from a direction, as far as it counts.
    fn counted(&self, towards: DVec3) -> f64 {
        if !self.is_up(towards) {
            return 0.0;
        }
        let is_hidden = self.bodies.iter().any(|body| self.is_before(body, towards));
        let counts = is_hidden == (self.counts == Counts::Hidden);
        if counts { self.map.radiance(towards) } else { 0.0 }
    }

    fn is_up(&self, towards: DVec3) -> bool {
        self.lobe.normal.dot(towards) > 0.0
    }

    fn is_before(&self, body: &Body<'_>, towards: DVec3) -> bool {
        body.sight.distance(self.lobe.place, towards).is_some()
    }

    fn is_across_border(&self, a: DVec3, b: DVec3) -> bool {
        self.map.radiance(a).to_bits() != self.map.radiance(b).to_bits()
    }
}
