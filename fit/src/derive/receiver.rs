//! What light arrives at: a point with a normal, a disk, a polygon, each with one face, in the
//! sample's coordinates. Checked when it is made: all of it lies above the sample's plane.

use super::DeriveError;
use super::patch::Patch;
use glam::DVec3;
use radiometry::direction::{frame, normalised};
use radiometry::shape::Polygon;

/// A receiver above the sample's plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Receiver {
    shape: Shape,
    /// A point of its plane.
    place_m: DVec3,
    /// Unit vector; light arrives from the half-space that it points into.
    normal: DVec3,
    area_m2: f64,
    /// Height of its lowest point, above 0.
    lowest_m: f64,
}

#[derive(Debug, Clone, PartialEq)]
enum Shape {
    Point,
    /// A disk or a polygon as pieces that don't overlap.
    Pieces(Vec<Patch>),
}

impl Receiver {
    /// A point, with the normal of any length but 0 of the face that light falls on.
    pub fn point(place_m: DVec3, normal: DVec3) -> Result<Self, DeriveError> {
        let normal = face(normal)?;
        above(place_m, place_m.z)?;
        Ok(Self { shape: Shape::Point, place_m, normal, area_m2: 0.0, lowest_m: place_m.z })
    }

    /// A disk of a radius above 0.
    pub fn disk(centre_m: DVec3, normal: DVec3, radius_m: f64) -> Result<Self, DeriveError> {
        let normal = face(normal)?;
        if !(radius_m > 0.0 && radius_m.is_finite()) {
            let expected = "more than 0";
            return Err(DeriveError::Domain { what: "radius_m", value: radius_m, expected });
        }
        let sag = radius_m * (1.0 - normal.z * normal.z).max(0.0).sqrt();
        let lowest_m = centre_m.z - sag;
        above(centre_m, lowest_m)?;
        let (t, b) = frame(normal);
        let shape = Shape::Pieces(Patch::disk(centre_m, [t, b], radius_m));
        let area_m2 = std::f64::consts::PI * radius_m * radius_m;
        Ok(Self { shape, place_m: centre_m, normal, area_m2, lowest_m })
    }

    /// A flat polygon, convex or not. Light falls on the face from which its vertices run
    /// counter-clockwise.
    pub fn polygon(vertices_m: Vec<DVec3>) -> Result<Self, DeriveError> {
        let polygon = Polygon::new(vertices_m)
            .map_err(|error| DeriveError::Receiver { what: error.to_string() })?;
        let vertices = polygon.vertices();
        let lowest_m = vertices.iter().map(|vertex| vertex.z).fold(f64::INFINITY, f64::min);
        above(vertices[0], lowest_m)?;
        let twice_area = (1..vertices.len() - 1)
            .map(|i| (vertices[i] - vertices[0]).cross(vertices[i + 1] - vertices[0]))
            .fold(DVec3::ZERO, |sum, part| sum + part);
        let no_area = || DeriveError::Receiver { what: "its polygon has no area".to_owned() };
        let normal = normalised(twice_area).ok_or_else(no_area)?;
        let pieces = triangles(vertices, normal).ok_or_else(no_area)?;
        let area_m2 = 0.5 * twice_area.length();
        let (shape, place_m) = (Shape::Pieces(pieces), vertices[0]);
        Ok(Self { shape, place_m, normal, area_m2, lowest_m })
    }

    /// Its area, m²; 0 of a point.
    pub fn area_m2(&self) -> f64 {
        self.area_m2
    }

    pub(super) fn lowest_m(&self) -> f64 {
        self.lowest_m
    }

    /// A point of it: its centre, or a polygon's first vertex.
    pub fn place_m(&self) -> DVec3 {
        self.place_m
    }

    /// Unit vector into the half-space that light arrives from.
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// Points with their shares of the area; pieces are cut finer where the distance asks for it.
    pub(super) fn nodes(
        &self,
        rule: &[(f64, f64)],
        distance: impl Fn(DVec3, f64) -> f64,
    ) -> Option<Vec<(DVec3, f64)>> {
        match &self.shape {
            Shape::Point => Some(vec![(self.place_m, 1.0)]),
            Shape::Pieces(pieces) => {
                let pieces = Patch::graded(pieces.clone(), distance)?;
                let nodes = pieces.into_iter().flat_map(|piece| piece.nodes(rule));
                Some(nodes.map(|(point, area)| (point, area / self.area_m2)).collect())
            }
        }
    }
}

fn face(normal: DVec3) -> Result<DVec3, DeriveError> {
    normalised(normal).ok_or_else(|| DeriveError::Receiver {
        what: "its normal has no direction; expected three finite numbers, not all 0".to_owned(),
    })
}

fn above(place_m: DVec3, lowest_m: f64) -> Result<(), DeriveError> {
    if !place_m.is_finite() || !lowest_m.is_finite() {
        return Err(DeriveError::Receiver { what: "its place is not finite".to_owned() });
    }
    if lowest_m > 0.0 { Ok(()) } else { Err(DeriveError::BelowPlane { height_m: lowest_m }) }
}

/// A simple polygon cut into triangles by its ears (Meisters 1975); `None` if rounding leaves none.
fn triangles(vertices: &[DVec3], normal: DVec3) -> Option<Vec<Patch>> {
    let mut left: Vec<DVec3> = vertices.to_vec();
    left.dedup();
    let turn = |a: DVec3, b: DVec3, c: DVec3| (b - a).cross(c - b).dot(normal);
    let mut pieces = Vec::new();
    while left.len() > 3 {
        let n = left.len();
        let ear = (0..n).find(|&i| {
            let (a, b, c) = (left[(i + n - 1) % n], left[i], left[(i + 1) % n]);
            let holds = |p: &DVec3| {
                let inside =
                    turn(a, b, *p) >= 0.0 && turn(b, c, *p) >= 0.0 && turn(c, a, *p) >= 0.0;
                inside && ![a, b, c].contains(p)
            };
            turn(a, b, c) > 0.0 && !left.iter().any(holds)
        });
        // A straight corner is no ear, and can go.
        let straight =
            || (0..n).find(|&i| turn(left[(i + n - 1) % n], left[i], left[(i + 1) % n]) == 0.0);
        match (ear, straight()) {
            (Some(i), _) => {
                pieces.push(Patch::Triangle([left[(i + n - 1) % n], left[i], left[(i + 1) % n]]));
                left.remove(i);
            }
            (None, Some(i)) => drop(left.remove(i)),
            (None, None) => return None,
        }
    }
    if let [a, b, c] = left[..] {
        pieces.push(Patch::Triangle([a, b, c]));
    }
    (!pieces.is_empty()).then_some(pieces)
}
