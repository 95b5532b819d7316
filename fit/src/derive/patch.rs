//! Triangles and sectors in space: pieces of a source or a receiver, cut finer where the other side
//! is near, each with a Gauss-Legendre product rule.

use glam::DVec3;
use std::f64::consts::TAU;

/// A flat piece of area.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Patch {
    /// By its vertices.
    Triangle([DVec3; 3]),
    /// A part of a disk between two radii and two azimuths.
    Sector {
        /// The disk's centre.
        centre: DVec3,
        /// Two unit vectors in its plane.
        axes: [DVec3; 2],
        /// From and to, m.
        radius: (f64, f64),
        /// From and to, radians.
        azimuth: (f64, f64),
    },
}

impl Patch {
    /// A disk as four sectors.
    pub(super) fn disk(centre: DVec3, axes: [DVec3; 2], radius_m: f64) -> Vec<Self> {
        let sector = |k: f64| Self::Sector {
            centre,
            axes,
            radius: (0.0, radius_m),
            azimuth: (TAU * k / 4.0, TAU * (k + 1.0) / 4.0),
        };
        [0.0, 1.0, 2.0, 3.0].map(sector).to_vec()
    }

    /// Pieces no larger than the share of their distance that a rule bears; `None` where those are
    /// too many.
    pub(super) fn graded(
        patches: Vec<Self>,
        distance: impl Fn(DVec3, f64) -> f64,
    ) -> Option<Vec<Self>> {
        let (mut open, mut done) = (patches, Vec::new());
        while let Some(patch) = open.pop() {
            let (centre, extent) = patch.ball();
            if 2.0 * extent <= SIZE_BY_DISTANCE * distance(centre, extent) {
                done.push(patch);
            } else {
                open.extend(patch.halves());
            }
            if open.len() + done.len() > PATCHES_MAX {
                return None;
            }
        }
        Some(done)
    }

    /// Points with their areas, from a rule on [-1, 1].
    pub(super) fn nodes(self, rule: &[(f64, f64)]) -> impl Iterator<Item = (DVec3, f64)> {
        rule.iter().flat_map(move |&(s, ws)| {
            rule.iter().map(move |&(t, wt)| {
                let (point, area) = self.at(0.5 * (1.0 + s), 0.5 * (1.0 + t));
                (point, 0.25 * ws * wt * area)
            })
        })
    }

    /// The point at (s, t) of the unit square, and the area element there. A triangle's is Duffy's
    /// map (1982).
    fn at(&self, s: f64, t: f64) -> (DVec3, f64) {
        match *self {
            Self::Triangle([a, b, c]) => {
                let twice_area = (b - a).cross(c - a).length();
                (a + s * ((b - a) + t * (c - b)), twice_area * s)
            }
            Self::Sector { centre, axes, radius, azimuth } => {
                let r = radius.0 + s * (radius.1 - radius.0);
                let (sin, cos) = libm::sincos(azimuth.0 + t * (azimuth.1 - azimuth.0));
                let point = centre + r * (cos * axes[0] + sin * axes[1]);
                (point, r * (radius.1 - radius.0) * (azimuth.1 - azimuth.0))
            }
        }
    }

    /// A ball that holds it.
    fn ball(&self) -> (DVec3, f64) {
        match *self {
            Self::Triangle(corners) => {
                let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
                let far = corners.iter().map(|corner| corner.distance(centre)).fold(0.0, f64::max);
                (centre, far)
            }
            Self::Sector { radius, azimuth, .. } => {
                let (centre, _) = self.at(0.5, 0.5);
                let half_arc = 0.5 * radius.1 * (azimuth.1 - azimuth.0);
                (centre, libm::hypot(0.5 * (radius.1 - radius.0), half_arc))
            }
        }
    }

    fn halves(&self) -> [Self; 2] {
        match *self {
            Self::Triangle([a, b, c]) => {
                let sides = [a.distance(b), b.distance(c), c.distance(a)];
                let [a, b, c] = if sides[0] >= sides[1] && sides[0] >= sides[2] {
                    [c, a, b]
                } else if sides[1] >= sides[2] {
                    [a, b, c]
                } else {
                    [b, c, a]
                };
                let middle = b.midpoint(c);
                [Self::Triangle([a, b, middle]), Self::Triangle([a, middle, c])]
            }
            Self::Sector { centre, axes, radius, azimuth } => {
                let arc = radius.1 * (azimuth.1 - azimuth.0);
                let sector = |radius, azimuth| Self::Sector { centre, axes, radius, azimuth };
                if arc > radius.1 - radius.0 {
                    let middle = f64::midpoint(azimuth.0, azimuth.1);
                    [sector(radius, (azimuth.0, middle)), sector(radius, (middle, azimuth.1))]
                } else {
                    let middle = f64::midpoint(radius.0, radius.1);
                    [sector((radius.0, middle), azimuth), sector((middle, radius.1), azimuth)]
                }
            }
        }
    }
}

/// A piece's diameter over its distance: the kernel 1/d² is then analytic in an ellipse about it
/// that lets each node of a Gauss rule gain more than one digit.
const SIZE_BY_DISTANCE: f64 = 1.0;
/// Beyond it a receiver is so near the plane that pieces multiply.
const PATCHES_MAX: usize = 20_000;
