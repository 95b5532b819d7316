//! A ray against a triangle and against a mesh of triangles.

use glam::DVec3;

use super::polygon::first_within_plane;
use super::{Exact, Ray, determinant};
use crate::domain::{DomainError, finite_vector};
use crate::error_free::two_sum;
use crate::polynomial::{Number, Pair, Polynomial, value};

/// Where a triangle is hit, as a mesh counts it.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Place {
    Inside,
    Edge(DVec3, DVec3),
    Corner(DVec3),
}

struct Hit {
    place: Place,
    parameter: f64,
    exponent: i32,
}

impl Ray {
    /// Distance to a triangle, m, from either side; edges and corners belong to it, decided by
    /// exact signs. A triangle without area is an error. A ray within the triangle's plane meets
    /// its border first, or is on it from the start.
    ///
    /// ```
    /// use glam::DVec3;
    /// use radiometry::ray::Ray;
    /// let triangle = [DVec3::Z, DVec3::new(1.0, 0.0, 1.0), DVec3::new(1.0, 1.0, 1.0)];
    /// // Exactly through the long edge.
    /// let ray = Ray::new(DVec3::ZERO, DVec3::new(0.5, 0.5, 1.0))?;
    /// assert_eq!(ray.triangle(triangle)?, Some(1.5f64.sqrt()));
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn triangle(self, corners: [DVec3; 3]) -> Result<Option<f64>, DomainError> {
        match self.hit(corners)? {
            Some(hit) => self.ahead(hit.parameter, hit.exponent),
            None => Ok(None),
        }
    }

    /// How many times the ray meets a mesh at or after its origin. An edge or a corner that
    /// triangles share is one hit, so that a ray neither slips between them nor counts twice.
    pub fn mesh_hits(self, triangles: &[[DVec3; 3]]) -> Result<usize, DomainError> {
        let mut inside = 0;
        let mut shared: Vec<Place> = Vec::new();
        for corners in triangles {
            match self.hit(*corners)? {
                Some(hit) if hit.parameter < 0.0 => {}
                Some(Hit { place: Place::Inside, .. }) => inside += 1,
                Some(hit) if !shared.contains(&hit.place) => shared.push(hit.place),
                _ => {}
            }
        }
        Ok(inside + shared.len())
    }

    /// Edge functions dᵀ(a × b) about the ray (Plücker): of one sign, or zero on an edge.
    fn hit(self, corners: [DVec3; 3]) -> Result<Option<Hit>, DomainError> {
        for corner in corners {
            finite_vector("corner", corner)?;
        }
        demand_area(corners)?;
        let local = self.local(corners, &mut []);
        let (exponent, direction) = (local.exponent, self.exact_direction());
        let [a, b, c] = local.points;
        let edges = [(&a, &b), (&b, &c), (&c, &a)].map(|(p, q)| determinant(&direction, p, q));
        if edges.iter().any(|edge| *edge > 0.0) && edges.iter().any(|edge| *edge < 0.0) {
            return Ok(None);
        }
        let along: f64 = edges.iter().sum();
        if along == 0.0 {
            let parameter = first_within_plane(&direction, &local.points);
            return Ok(parameter.map(|parameter| Hit {
                place: Place::Inside,
                parameter,
                exponent,
            }));
        }
        let parameter = determinant(&a, &b, &c) / along;
        Ok(Some(Hit { place: place(edges, corners), parameter, exponent }))
    }
}

fn place(edges: [f64; 3], [a, b, c]: [DVec3; 3]) -> Place {
    /// The same whichever triangle names it.
    fn edge(p: DVec3, q: DVec3) -> Place {
        if p.to_array() < q.to_array() { Place::Edge(p, q) } else { Place::Edge(q, p) }
    }
    match edges.map(|edge| edge == 0.0) {
        [true, true, _] => Place::Corner(b),
        [_, true, true] => Place::Corner(c),
        [true, _, true] => Place::Corner(a),
        [true, ..] => edge(a, b),
        [_, true, _] => edge(b, c),
        [_, _, true] => edge(c, a),
        _ => Place::Inside,
    }
}

/// Three corners that are not on one line.
fn demand_area(corners: [DVec3; 3]) -> Result<(), DomainError> {
    let largest = corners.iter().map(|corner| corner.abs().max_element()).fold(0.0, f64::max);
    let exponent = if largest > 0.0 { libm::ilogb(largest) } else { 0 };
    let [a, b, c] = corners.map(|corner| corner.to_array().map(|x| libm::scalbn(x, -exponent)));
    let side = |to: [f64; 3]| -> Exact { core::array::from_fn(|i| two_sum(to[i], -a[i])) };
    let (first, second) = (side(b), side(c));
    let is_flat = [(0, 1), (1, 2), (2, 0)]
        .iter()
        .all(|&(i, j)| value(&Minor(first[i], first[j], second[i], second[j])) == 0.0);
    if is_flat {
        return Err(DomainError::NotPositive { argument: "the triangle's area", value: 0.0 });
    }
    Ok(())
}

/// u v' - v u'.
struct Minor(Pair, Pair, Pair, Pair);

impl Polynomial for Minor {
    fn evaluate<N: Number>(&self) -> N {
        let [a, b, c, d] = [self.0, self.1, self.2, self.3].map(N::from_pair);
        a.mul(&d).sub(&b.mul(&c))
    }
}
