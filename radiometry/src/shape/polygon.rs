//! A flat simple polygon: checked once, so that the kernels need not.

use glam::DVec3;

use crate::domain::{DomainError, finite_vector};
use crate::error_free::DoubleDouble;
use crate::wide::{cross, in_units, length, unit_exponent};

/// How far off the plane a vertex may be, in parts of the polygon's extent: room for
/// coordinates of six digits.
const OFF_PLANE: f64 = 1e-6;

/// A flat polygon without holes, convex or not, vertices in order (either sense), both faces alike.
/// Who needs it: sources and occluders here; the simulator's outlines.
#[derive(Debug, Clone, PartialEq)]
pub struct Polygon {
    vertices_m: Vec<DVec3>,
}

impl Polygon {
    /// Vertices may repeat and lie on straight edges. Refused: fewer than 3 distinct ones, one
    /// farther than 1e-6 of the extent off the plane of the others, edges that cross.
    ///
    /// ```
    /// use glam::DVec3;
    /// use radiometry::{DomainError, shape::Polygon};
    /// let bow_tie = Polygon::new(vec![DVec3::ZERO, DVec3::ONE, DVec3::X, DVec3::new(0.0, 1.0, 1.0)]);
    /// assert_eq!(bow_tie, Err(DomainError::SelfIntersecting { edge: 0, other: 2 }));
    /// ```
    pub fn new(vertices_m: Vec<DVec3>) -> Result<Self, DomainError> {
        for vertex in &vertices_m {
            finite_vector("vertices", *vertex)?;
        }
        enough_vertices(&vertices_m)?;
        let unit = unit_exponent(vertices_m.iter().flat_map(DVec3::to_array));
        let scaled: Vec<DVec3> = vertices_m.iter().map(|v| in_units(*v, unit)).collect();
        let normal = plane_normal(&scaled);
        let size = length(normal);
        // Without an area there is neither a plane nor a crossing that could matter.
        if size > 0.0 {
            planar(&scaled, normal / size, unit)?;
            simple(&scaled, normal)?;
        }
        Ok(Self { vertices_m })
    }

    /// In the order given.
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices_m
    }

    /// With lengths in units of two to the power, exactly.
    pub(crate) fn in_units(&self, exponent: i32) -> Self {
        Self { vertices_m: self.vertices_m.iter().map(|v| in_units(*v, exponent)).collect() }
    }
}

fn enough_vertices(vertices: &[DVec3]) -> Result<(), DomainError> {
    let mut distinct: Vec<DVec3> = Vec::with_capacity(3);
    for vertex in vertices {
        if !distinct.contains(vertex) {
            distinct.push(*vertex);
        }
        if distinct.len() == 3 {
            return Ok(());
        }
    }
    Err(DomainError::TooFewVertices { distinct: distinct.len() })
}

/// Across the plane: the largest cross product of a fan, so that a bow tie, whose area cancels,
/// has one too.
fn plane_normal(vertices: &[DVec3]) -> DVec3 {
    let origin = vertices[0];
    let crosses = vertices.windows(2).map(|pair| cross(pair[0] - origin, pair[1] - origin));
    crosses.fold(DVec3::ZERO, |best, next| if length(next) > length(best) { next } else { best })
}

fn planar(vertices: &[DVec3], normal: DVec3, unit: i32) -> Result<(), DomainError> {
    let origin = vertices[0];
    let extent = vertices.iter().map(|v| length(*v - origin)).fold(0.0, f64::max);
    let (vertex, off_plane) = vertices
        .iter()
        .map(|v| (*v - origin).dot(normal).abs())
        .enumerate()
        .fold((0, 0.0), |worst, next| if next.1 > worst.1 { next } else { worst });
    // The coordinates' own rounding is no bend either.
    if off_plane <= OFF_PLANE * extent + 16.0 * f64::EPSILON {
        Ok(())
    } else {
        Err(DomainError::NotPlanar { vertex, off_plane_m: libm::scalbn(off_plane, unit) })
    }
}

/// No two edges cross in the projection along the normal's largest component; signs are exact, so
/// that slivers are neither refused nor let through by rounding.
fn simple(vertices: &[DVec3], normal: DVec3) -> Result<(), DomainError> {
    let flat = flattened(vertices, normal);
    let count = flat.len();
    let side = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| -> f64 {
        let difference = DoubleDouble::difference;
        let first = difference(b[0], a[0]).mul(difference(c[1], a[1]));
        first.sub(difference(b[1], a[1]).mul(difference(c[0], a[0]))).to_f64()
    };
    let opposite = |p: f64, q: f64| (p > 0.0 && q < 0.0) || (p < 0.0 && q > 0.0);
    for edge in 0..count {
        let (a, b) = (flat[edge], flat[(edge + 1) % count]);
        for other in edge + 2..count {
            let (c, d) = (flat[other], flat[(other + 1) % count]);
            if opposite(side(a, b, c), side(a, b, d)) && opposite(side(c, d, a), side(c, d, b)) {
                return Err(DomainError::SelfIntersecting { edge, other });
            }
        }
    }
    Ok(())
}

/// The coordinates other than the one along which the normal is largest.
fn flattened(vertices: &[DVec3], normal: DVec3) -> Vec<[f64; 2]> {
    let size = normal.abs();
    let pick: fn(&DVec3) -> [f64; 2] = if size.z >= size.x && size.z >= size.y {
        |v| [v.x, v.y]
    } else if size.y >= size.x {
        |v| [v.x, v.z]
    } else {
        |v| [v.y, v.z]
    };
    vertices.iter().map(pick).collect()
}
