//! Many radiances at once, each with its u: the environment that the sample makes for a point, and
//! the light field between two planes.

use super::sum::Node;
use super::{DeriveError, Field};
use crate::{Chart, Estimate, Ray, Region};
use glam::DVec3;
use radiometry::chart::{Surface, TwoPlane};
use radiometry::direction::{angle_between, angles, frame, normalised, unit};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// How the hemisphere before a point is cut into cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cells {
    /// Equal steps of θ by equal steps of φ.
    LatLong,
    /// Equal steps of cos θ by equal steps of φ: all cells have the same solid angle (Lambert 1772).
    EqualArea,
}

/// A point that looks about, and the grid of its map: radiance by (θ, φ) in the point's own frame,
/// θ from its normal, from 0 to π/2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnvironmentMap {
    /// The point, m, above the sample's plane.
    pub place_m: DVec3,
    /// The pole of the map, of any length but 0.
    pub normal: DVec3,
    /// Which cells.
    pub cells: Cells,
    /// Steps of θ.
    pub rows: usize,
    /// Steps of φ.
    pub columns: usize,
}

/// A cell of the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnvironmentCell {
    /// From the point's normal to the cell's middle, radians.
    pub theta_rad: f64,
    /// About it, radians, in [0, 2π).
    pub phi_rad: f64,
    /// Unit vector from the point to the cell's middle, in the sample's coordinates: towards the
    /// light.
    pub towards: DVec3,
    /// Of the cell.
    pub solid_angle_sr: f64,
    /// How much of the cell the region fills.
    pub covered: f64,
    /// How much of that, by rays, was measured; 0 where nothing is covered.
    pub measured: f64,
    /// The mean radiance over the cell, nothing coming from beside the region.
    pub radiance: Estimate,
}

/// The two-plane chart's grid. (u, v) is where a ray leaves the sample's plane z = 0, (s, t) where it
/// pierces z = distance; both in the sample's own x and y, in metres, not relative to each other and
/// not scaled by the distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoPlaneGrid {
    /// Between the planes, m, above 0.
    pub distance_m: f64,
    /// From and to, and how many places, ends included.
    pub u: (f64, f64, usize),
    /// Likewise.
    pub v: (f64, f64, usize),
    /// Likewise.
    pub s: (f64, f64, usize),
    /// Likewise.
    pub t: (f64, f64, usize),
}

/// A ray of the grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoPlaneRay {
    /// Its coordinates.
    pub place: TwoPlane,
    /// The same ray in the surface chart.
    pub ray: Ray,
    /// Whether something was measured there: within region and cone.
    pub is_measured: bool,
    /// The radiance; `None` where next to nothing came out of the layer.
    pub radiance: Option<Estimate>,
}

impl Field<'_> {
    /// The radiance that arrives at a point, cell by cell, row after row from the pole.
    pub fn environment(&self, map: &EnvironmentMap) -> Result<Vec<EnvironmentCell>, DeriveError> {
        if self.medium.is_immersion() {
            return Err(DeriveError::InAir { what: "the point" });
        }
        if !matches!(self.fit.region().chart, Chart::Environment) {
            self.demand_surface("environment map")?;
        }
        let no_direction = || DeriveError::Receiver {
            what: "its normal has no direction; expected three finite numbers, not all 0"
                .to_owned(),
        };
        let normal = normalised(map.normal).ok_or_else(no_direction)?;
        if let Chart::Environment = self.fit.region().chart {
            return self.resampled(map, normal);
        }
        if !map.place_m.is_finite() || map.place_m.z <= 0.0 {
            return Err(DeriveError::BelowPlane { height_m: map.place_m.z });
        }
        check_count("cells", map.rows.saturating_mul(map.columns))?;
        self.area_m2()?;
        let sight = Sight::of(self.fit.region(), map.place_m);
        let cells = (0..map.rows * map.columns)
            .map(|k| self.cell(map, &sight, normal, (k / map.columns, k % map.columns)));
        Ok(cells.collect())
    }

    /// The map of an environment that was measured itself: all round, the map's rows going from its
    /// normal to the opposite. The middle of a cell stands for it.
    fn resampled(
        &self,
        map: &EnvironmentMap,
        normal: DVec3,
    ) -> Result<Vec<EnvironmentCell>, DeriveError> {
        check_count("cells", map.rows.saturating_mul(map.columns))?;
        let (t, b) = frame(normal);
        let step_rad = TAU / map.columns as f64;
        let cell = |k: usize| {
            let (row, column) = (k / map.columns, k % map.columns);
            let share = |i: usize| i as f64 / map.rows as f64;
            let (upper, lower, middle_rad) = match map.cells {
                Cells::LatLong => (
                    libm::cos(PI * share(row)),
                    libm::cos(PI * share(row + 1)),
                    PI * (row as f64 + 0.5) / map.rows as f64,
                ),
                Cells::EqualArea => {
                    let cos = |i: usize| 1.0 - 2.0 * share(i);
                    (cos(row), cos(row + 1), libm::acos(f64::midpoint(cos(row), cos(row + 1))))
                }
            };
            let phi_rad = step_rad * (column as f64 + 0.5);
            let local = unit(middle_rad, phi_rad);
            let towards = local.x * t + local.y * b + local.z * normal;
            let (theta, phi) = angles(towards);
            let ray = Ray { x_m: 0.0, y_m: 0.0, theta_rad: theta, phi_rad: phi };
            EnvironmentCell {
                theta_rad: middle_rad,
                phi_rad,
                towards,
                solid_angle_sr: (upper - lower) * step_rad,
                covered: 1.0,
                measured: f64::from(u8::from(self.fit.is_measured(&ray))),
                radiance: self.fit.radiance(&ray),
            }
        };
        Ok((0..map.rows * map.columns).map(cell).collect())
    }

    fn cell(
        &self,
        map: &EnvironmentMap,
        sight: &Sight,
        normal: DVec3,
        (row, column): (usize, usize),
    ) -> EnvironmentCell {
        let (t, b) = frame(normal);
        let towards = |theta_rad: f64, phi_rad: f64| {
            let local = unit(theta_rad, phi_rad);
            local.x * t + local.y * b + local.z * normal
        };
        let (upper, lower) = map.cosines(row);
        let step_rad = TAU / map.columns as f64;
        let (theta_rad, phi_rad) = (map.middle_rad(row), step_rad * (column as f64 + 0.5));
        let corners = [(upper, 0.0), (upper, 1.0), (lower, 0.0), (lower, 1.0)];
        let corners = corners
            .map(|(cos, share)| towards(libm::acos(cos), step_rad * (column as f64 + share)));
        let side = sight.rays_a_side(towards(theta_rad, phi_rad), &corners, map.columns);
        let part = 1.0 / (side * side).max(1) as f64;
        let rays = (0..side * side).filter_map(|k| {
            let (i, j) = ((k / side) as f64 + 0.5, (k % side) as f64 + 0.5);
            let theta_rad = libm::acos(upper + (lower - upper) * i / side as f64);
            let phi_rad = step_rad * (column as f64 + j / side as f64);
            self.leaving(map.place_m, towards(theta_rad, phi_rad))
        });
        let rays: Vec<Ray> = rays.collect();
        let is_known =
            |ray: &&Ray| self.medium.seen(ray).is_some_and(|(seen, _)| self.fit.is_measured(&seen));
        let known = rays.iter().filter(is_known).count();
        let terms: Vec<(Node, f64)> = rays.iter().map(|ray| (Node::Along(*ray), part)).collect();
        EnvironmentCell {
            theta_rad,
            phi_rad,
            towards: towards(theta_rad, phi_rad),
            solid_angle_sr: (upper - lower) * step_rad,
            covered: rays.len() as f64 * part,
            measured: known as f64 / rays.len().max(1) as f64,
            radiance: self.estimate(&terms),
        }
    }

    /// The ray that leaves the region and comes to the point from a direction; none from beside it.
    fn leaving(&self, place_m: DVec3, towards: DVec3) -> Option<Ray> {
        if towards.z >= 0.0 {
            return None;
        }
        let foot = place_m - (place_m.z / towards.z) * towards;
        let region = self.fit.region();
        let within = |t: f64, (from, to): (f64, f64)| t >= from && t <= to;
        let (theta_rad, phi_rad) = angles(-towards);
        let ray = Ray { x_m: foot.x, y_m: foot.y, theta_rad: theta_rad.min(FRAC_PI_2), phi_rad };
        (within(foot.x, region.x_m) && within(foot.y, region.y_m)).then_some(ray)
    }
}

impl Field<'_> {
    /// The radiance along the rays of a grid between two planes: t fastest, then s, v and u.
    pub fn two_plane(&self, grid: &TwoPlaneGrid) -> Result<Vec<TwoPlaneRay>, DeriveError> {
        let TwoPlaneGrid { distance_m, u, v, s, t } = *grid;
        if !matches!(self.fit.region().chart, Chart::TwoPlane { .. }) {
            self.demand_surface("two-plane table")?;
        }
        if !(distance_m > 0.0 && distance_m.is_finite()) {
            let expected = "more than 0";
            return Err(DeriveError::Domain { what: "distance_m", value: distance_m, expected });
        }
        let mut rays = 1_usize;
        for (from, to, count) in [u, v, s, t] {
            if !from.is_finite() || !to.is_finite() || from > to {
                let expected = "finite places, the first no larger than the last";
                return Err(DeriveError::Domain { what: "the grid's end", value: to, expected });
            }
            rays = rays.saturating_mul(count);
        }
        check_count("rays", rays)?;
        let [us, vs, ss, ts] = [u, v, s, t].map(places);
        let mut out = Vec::with_capacity(rays);
        for &u_m in &us {
            for &v_m in &vs {
                for &s_m in &ss {
                    for &t_m in &ts {
                        let place = TwoPlane { u_m, v_m, s_m, t_m, distance_m };
                        out.extend(self.along(place));
                    }
                }
            }
        }
        Ok(out)
    }

    fn along(&self, place: TwoPlane) -> Option<TwoPlaneRay> {
        let Surface { x_m, y_m, theta_rad, phi_rad } = Surface::of(&place.line().ok()?)?;
        let ray = Ray { x_m, y_m, theta_rad, phi_rad };
        let seen = self.medium.seen(&ray);
        Some(TwoPlaneRay {
            place,
            ray,
            is_measured: seen.is_some_and(|(seen, _)| self.fit.is_measured(&seen)),
            radiance: seen.map(|_| self.estimate(&[(Node::Along(ray), 1.0)])),
        })
    }
}

impl EnvironmentMap {
    /// cos θ at a row's upper and lower edge.
    fn cosines(&self, row: usize) -> (f64, f64) {
        let cos = |share: f64| match self.cells {
            Cells::LatLong => libm::cos(FRAC_PI_2 * share),
            Cells::EqualArea => 1.0 - share,
        };
        let share = |i: usize| i as f64 / self.rows as f64;
        (cos(share(row)), cos(share(row + 1)))
    }

    fn middle_rad(&self, row: usize) -> f64 {
        match self.cells {
            Cells::LatLong => FRAC_PI_2 * (row as f64 + 0.5) / self.rows as f64,
            Cells::EqualArea => libm::acos(1.0 - (row as f64 + 0.5) / self.rows as f64),
        }
    }
}

/// Places from one end to the other, ends included; of one alone the middle.
fn places((from, to, count): (f64, f64, usize)) -> Vec<f64> {
    let step = (to - from) / count.saturating_sub(1).max(1) as f64;
    let at = |i: usize| if count == 1 { f64::midpoint(from, to) } else { from + step * i as f64 };
    (0..count).map(at).collect()
}

fn check_count(what: &'static str, count: usize) -> Result<(), DeriveError> {
    if (1..=COUNT_MAX).contains(&count) {
        return Ok(());
    }
    let expected = "1 to 1000000 in all";
    Err(DeriveError::Domain { what, value: count as f64, expected })
}

/// The region as a point sees it.
struct Sight {
    /// Unit vector to its centre.
    centre: DVec3,
    /// From there to the farthest corner, radians.
    half_angle_rad: f64,
    /// Across its narrower side, radians.
    narrow_rad: f64,
}

impl Sight {
    fn of(region: &Region, place_m: DVec3) -> Self {
        let ((x0, x1), (y0, y1)) = (region.x_m, region.y_m);
        let to = |x: f64, y: f64| DVec3::new(x, y, 0.0) - place_m;
        let across = to(f64::midpoint(x0, x1), f64::midpoint(y0, y1));
        let distance_m = across.length();
        let centre = across / distance_m;
        let corners = [to(x0, y0), to(x1, y0), to(x1, y1), to(x0, y1)];
        let half_angle_rad = corners.map(|corner| angle_between(corner, centre));
        Self {
            centre,
            half_angle_rad: half_angle_rad.into_iter().fold(0.0, f64::max),
            narrow_rad: (x1 - x0).min(y1 - y0) * centre.z.abs() / distance_m,
        }
    }

    /// How many rays along each side of a cell: none where it doesn't meet the region, and so many
    /// where it does that a narrow region isn't passed over.
    fn rays_a_side(&self, middle: DVec3, corners: &[DVec3; 4], columns: usize) -> usize {
        let radii = corners.map(|corner| angle_between(corner, middle));
        let radius_rad = radii.into_iter().fold(0.0, f64::max);
        let apart_rad = angle_between(middle, self.centre);
        let is_compact = columns >= COLUMNS_COMPACT;
        if is_compact && apart_rad > self.half_angle_rad + ROOM * radius_rad {
            return 0;
        }
        let extent_rad = if is_compact { 2.0 * radius_rad } else { TAU };
        let wanted = RAYS_ACROSS * extent_rad / self.narrow_rad.max(f64::MIN_POSITIVE);
        // Between the two.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let side = wanted.ceil().clamp(SIDE_MIN, SIDE_MAX) as usize;
        side
    }
}

/// Rays a side of a cell at least, and at most.
const SIDE_MIN: f64 = 4.0;
const SIDE_MAX: f64 = 128.0;
/// Rays across the region's narrower side.
const RAYS_ACROSS: f64 = 8.0;
/// With fewer columns a cell reaches farther than its corners.
const COLUMNS_COMPACT: usize = 8;
/// Room for a cell's edges, which bulge beyond its corners.
const ROOM: f64 = 1.2;
/// Cells or rays of one map.
const COUNT_MAX: usize = 1_000_000;
