//! Bodies as a receiver sees them: which directions they fill, how far away they are there, and their
//! outline, all in the stretched frame of a view. It does not know who hides whom.

use core::f64::consts::{PI, TAU};

use glam::DVec3;

use super::limit::Limit;
use super::outline::Curve;
use super::view::View;
use crate::direction::{angle_between, frame, normalised};
use crate::domain::DomainError;
use crate::error_free::DoubleDouble;
use crate::shape::{Disk, HalfPlane, Polygon, Sphere};
use crate::wide::{WideVec, length};

const ZERO: DoubleDouble = DoubleDouble::from_f64(0.0);

/// A set of directions with its outline.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    fill: Fill,
    pub(super) curves: Vec<Curve>,
    pub(super) limits: Vec<Limit>,
}

#[derive(Debug, Clone)]
enum Fill {
    /// All below the horizon.
    Below,
    /// |x|² distance² - (x·center)² is the limit's function; `clear` is distance² - radius².
    Sphere {
        center: DVec3,
        clear: f64,
    },
    Disk {
        plane: Plane,
    },
    Polygon {
        plane: Plane,
        edges: Vec<Edge>,
    },
    HalfPlane {
        plane: Plane,
    },
}

/// A plane that the receiver is not in: normal · x = distance > 0, the normal of any length.
#[derive(Debug, Clone, Copy)]
struct Plane {
    normal: DVec3,
    distance: f64,
}

impl Plane {
    /// How many times x it is away in its direction.
    fn reach(&self, x: DVec3) -> Option<f64> {
        let along = self.normal.dot(x);
        let reach = self.distance / along;
        (along > 0.0 && reach.is_finite()).then_some(reach)
    }
}

/// An edge with the unit normal of its plane through the receiver; the inside is on its left.
#[derive(Debug, Clone, Copy)]
struct Edge {
    from: DVec3,
    to: DVec3,
    across: DVec3,
}

impl Seen {
    /// What the horizon hides: like a body that is nearer than any other.
    pub(super) fn below(view: &View, normal: DVec3) -> Option<Self> {
        let normal = normalised(view.horizon(normal))?;
        let (from, through) = frame(-normal);
        Some(Self {
            fill: Fill::Below,
            curves: vec![Curve::great_arc(from, through, TAU)],
            limits: vec![Limit::Plane { normal }],
        })
    }

    /// None if it has no extent. A receiver inside is refused.
    pub(super) fn sphere(view: &View, sphere: &Sphere) -> Result<Option<Self>, DomainError> {
        let radius = sphere.radius_m();
        let center = view.turned(view.relative(sphere.center_m()));
        let wide_distance = center.length();
        let distance = wide_distance.to_f64();
        let wide_radius = DoubleDouble::from_f64(radius);
        let clear = wide_distance.sub(wide_radius).mul(wide_distance.add(wide_radius));
        if clear.to_f64() < 0.0 || distance == 0.0 {
            let (distance_m, radius_m) = (distance, radius);
            return Err(DomainError::Inside { shape: "sphere", distance_m, radius_m });
        }
        if radius == 0.0 {
            return Ok(None);
        }
        let [x, y, z] = center.components();
        // |c × p|² - r²|p|², by what it makes of the axes.
        let across = [
            WideVec::new(ZERO, z, y.neg()),
            WideVec::new(z.neg(), ZERO, x),
            WideVec::new(y, x.neg(), ZERO),
        ];
        let along = [
            WideVec::new(wide_radius, ZERO, ZERO),
            WideVec::new(ZERO, wide_radius, ZERO),
            WideVec::new(ZERO, ZERO, wide_radius),
        ];
        let width = radius / distance / view.unit_rad();
        let curve = tangent_circle(view, center, wide_distance, wide_radius, clear);
        Ok(Some(Self {
            fill: Fill::Sphere { center: view.plane(center), clear: clear.to_f64() },
            curves: vec![curve],
            limits: vec![Limit::cone(view, across, along, width)],
        }))
    }

    /// None if it has no extent or is seen edge-on.
    pub(super) fn disk(view: &View, disk: &Disk) -> Option<Self> {
        let center = view.turned(view.relative(disk.center_m()));
        let axis = view.turned(WideVec::from_vec(disk.axis()).unit()?);
        let distance = WideVec::from_vec(disk.axis()).dot(view.relative(disk.center_m()));
        let is_away = distance.to_f64() >= 0.0;
        let axis = if is_away { axis } else { axis.scaled(0).times(DoubleDouble::from_f64(-1.0)) };
        let distance = distance.to_f64().abs() / length(disk.axis());
        let radius = disk.radius_m();
        if radius == 0.0 || distance == 0.0 {
            return None;
        }
        let [cx, cy, cz] = center.components();
        let [mx, my, mz] = axis.components();
        // p (m·c) - c (m·p), by what it makes of the axes, without the differences.
        let across = [
            WideVec::new(cy.mul(my).add(cz.mul(mz)), cy.mul(mx).neg(), cz.mul(mx).neg()),
            WideVec::new(cx.mul(my).neg(), cx.mul(mx).add(cz.mul(mz)), cz.mul(my).neg()),
            WideVec::new(cx.mul(mz).neg(), cy.mul(mz).neg(), cx.mul(mx).add(cy.mul(my))),
        ];
        let wide_radius = DoubleDouble::from_f64(radius);
        let along = [mx, my, mz].map(|m| WideVec::new(wide_radius.mul(m), ZERO, ZERO));
        // From the centre towards where the line of sight meets the disk's plane.
        let toward = across[2].unit();
        let toward = match toward {
            Some(toward) if mz.to_f64() < 0.0 => toward.times(DoubleDouble::from_f64(-1.0)),
            Some(toward) => toward,
            None => WideVec::from_vec(frame(axis.to_vec()).0),
        };
        let arm = toward.times(wide_radius);
        let curve = Curve::rim(
            view.stretched(center.add(arm)),
            view.stretched(arm),
            view.stretched(axis.cross(arm)),
        );
        let width = radius / length(center.to_vec()) / view.unit_rad();
        Some(Self {
            fill: Fill::Disk { plane: Plane { normal: view.plane(axis), distance } },
            curves: vec![curve],
            limits: vec![Limit::cone(view, across, along, width)],
        })
    }

    /// None if it has no extent or is seen edge-on.
    pub(super) fn polygon(view: &View, polygon: &Polygon) -> Option<Self> {
        let mut corners: Vec<WideVec> =
            polygon.vertices().iter().map(|vertex| view.turned(view.relative(*vertex))).collect();
        let first = *corners.first()?;
        let fan = corners.windows(2).map(|pair| pair[0].sub(first).cross(pair[1].sub(first)));
        let area = fan.reduce(WideVec::add)?;
        let volume = area.dot(first).to_f64();
        if volume == 0.0 {
            return None;
        }
        // Left-hand inside, as seen from without the unit sphere.
        if volume < 0.0 {
            corners.reverse();
        }
        let outward = if volume < 0.0 { area.times(DoubleDouble::from_f64(-1.0)) } else { area };
        let (mut edges, mut curves, mut limits) = (Vec::new(), Vec::new(), Vec::new());
        for (i, a) in corners.iter().enumerate() {
            let b = corners[(i + 1) % corners.len()];
            let (from, to) = (view.stretched(*a), view.stretched(b));
            let across = view.plane(a.normal_sized().cross(b.normal_sized()));
            let (Some(across), Some(start)) = (normalised(across), normalised(from)) else {
                continue;
            };
            edges.push(Edge { from, to, across });
            limits.push(Limit::Plane { normal: across });
            let through = across.cross(start).normalize_or_zero();
            curves.push(Curve::great_arc(start, through, angle_between(from, to)));
        }
        let plane = Plane { normal: view.plane(outward), distance: volume.abs() };
        Some(Self { fill: Fill::Polygon { plane, edges }, curves, limits })
    }

    /// None if it is seen edge-on.
    pub(super) fn half_plane(view: &View, half_plane: &HalfPlane) -> Option<Self> {
        let corner = DVec3::new(half_plane.x_max_m(), 0.0, half_plane.z_m());
        let [x, _, z] = view.relative(corner).components();
        let height = z.to_f64();
        if height == 0.0 {
            return None;
        }
        let turned = |v: DVec3| view.turned(WideVec::from_vec(v));
        let edge = view.turned(WideVec::new(x, ZERO, z));
        let middle = edge.unit()?.add(turned(DVec3::NEG_X));
        // Through the receiver and the edge, and through the receiver and infinity.
        let planes = [view.turned(WideVec::new(z.neg(), ZERO, x)), turned(DVec3::Z)];
        let along = normalised(view.stretched(turned(DVec3::Y)))?;
        let (mut curves, mut limits) = (Vec::new(), Vec::new());
        for (plane, toward) in planes.into_iter().zip([edge, turned(DVec3::NEG_X)]) {
            let normal = normalised(view.plane(plane))?;
            let inside = plane.dot(middle).to_f64();
            let normal = normal * inside.signum();
            // Half a great circle between the ends of the y axis.
            let through = normal.cross(along).normalize_or_zero();
            let sense = through.dot(view.stretched(toward)).signum();
            curves.push(Curve::great_arc(along * sense, through * sense, PI));
            limits.push(Limit::Plane { normal });
        }
        let normal = view.plane(turned(DVec3::Z)) * height.signum();
        let plane = Plane { normal, distance: height.abs() };
        Some(Self { fill: Fill::HalfPlane { plane }, curves, limits })
    }

    /// How far away the body is along a vector, in its lengths; none if it is not there at all.
    pub(super) fn distance(&self, direction: DVec3) -> Option<f64> {
        self.fills(direction).then(|| self.reach(direction)).flatten()
    }

    fn fills(&self, direction: DVec3) -> bool {
        match &self.fill {
            Fill::Below | Fill::Sphere { .. } | Fill::Disk { .. } => {
                self.limits[0].value(direction) < 0.0
            }
            Fill::Polygon { plane, edges } => surrounds(edges, direction, plane.normal),
            Fill::HalfPlane { .. } => self.limits.iter().all(|limit| limit.value(direction) > 0.0),
        }
    }

    /// The same on or beside the outline, where rounding does not know whether it is there.
    pub(super) fn reach(&self, direction: DVec3) -> Option<f64> {
        match &self.fill {
            Fill::Below => Some(0.0),
            Fill::Sphere { center, clear } => {
                let along = center.dot(direction);
                let root = (-self.limits[0].value(direction)).max(0.0).sqrt();
                (along > 0.0).then(|| clear / (along + root))
            }
            Fill::Disk { plane } | Fill::Polygon { plane, .. } | Fill::HalfPlane { plane } => {
                plane.reach(direction)
            }
        }
    }

    /// Where the planes of two flat bodies are equally far away; none if one is not flat. Which of
    /// them is nearer changes there alone.
    pub(super) fn level_with(&self, other: &Self) -> Option<Limit> {
        let (a, b) = (self.plane()?, other.plane()?);
        let normal = normalised(a.normal * b.distance - b.normal * a.distance)?;
        Some(Limit::Plane { normal })
    }

    fn plane(&self) -> Option<Plane> {
        match &self.fill {
            Fill::Below | Fill::Sphere { .. } => None,
            Fill::Disk { plane } | Fill::Polygon { plane, .. } | Fill::HalfPlane { plane } => {
                let size = plane.normal.length();
                Some(Plane { normal: plane.normal / size, distance: plane.distance / size })
            }
        }
    }
}

/// The outline of a sphere, from its point nearest to the line of sight: σ the sphere's half angle, α
/// the angle between the two.
fn tangent_circle(
    view: &View,
    center: WideVec,
    distance: DoubleDouble,
    radius: DoubleDouble,
    clear: DoubleDouble,
) -> Curve {
    let [x, y, z] = center.components();
    let aside = x.mul(x).add(y.mul(y)).sqrt();
    let square = distance.mul(distance);
    let root = clear.sqrt();
    // sin(α - σ) and cos(α - σ)
    let sine = aside.mul(root).sub(z.mul(radius)).div(square);
    let cosine = z.mul(root).add(aside.mul(radius)).div(square);
    let (right, up) = if aside.to_f64() > 0.0 {
        (x.div(aside), y.div(aside))
    } else {
        (DoubleDouble::from_f64(1.0), ZERO)
    };
    let base = WideVec::new(right.mul(sine), up.mul(sine), cosine);
    // From the axis to that point, and across.
    let sin_sigma = radius.div(distance);
    let (along, height) =
        (z.div(distance).mul(sin_sigma).neg(), aside.div(distance).mul(sin_sigma));
    let arm = WideVec::new(right.mul(along), up.mul(along), height);
    let tangent = center.cross(arm).times(DoubleDouble::from_f64(1.0).div(distance));
    let (sine, cosine) = (sine.to_f64(), cosine.to_f64());
    let lift = if cosine > 0.0 { -sine * sine / (1.0 + cosine) } else { cosine - 1.0 };
    Curve::circle(view.stretched(base), lift, view.stretched(arm), view.stretched(tangent))
}

/// Whether a polygon that faces the receiver has the direction inside it: how often the edges'
/// planes are crossed on the way to one side.
fn surrounds(edges: &[Edge], direction: DVec3, normal: DVec3) -> bool {
    if normal.dot(direction) <= 0.0 {
        return false;
    }
    // A half-plane from the direction sideways; an edge counts if its ends are on either side of
    // the half-plane's plane and it passes beyond the direction.
    let sideways = normal.any_orthogonal_vector();
    let wall = direction.cross(sideways);
    let mut inside = false;
    for Edge { from, to, across } in edges {
        let (a_side, b_side) = (wall.dot(*from), wall.dot(*to));
        if (a_side > 0.0) != (b_side > 0.0) {
            let beyond = direction.dot(*across);
            inside ^= (beyond > 0.0) == (b_side > a_side);
        }
    }
    inside
}
