//! Solid angle of a triangle and of a polygon (Van Oosterom and Strackee 1983), in double-double
//! where the textbook formula loses its digits. It does not know the receiver's orientation.

use core::f64::consts::PI;

use glam::DVec3;

use crate::domain::{DomainError, finite_vector};
use crate::error_free::DoubleDouble;
use crate::quadrature::Sum;
use crate::quantity::SolidAngle;
use crate::shape::Polygon;
use crate::transcendental;
use crate::wide::{WideVec, in_units, unit_exponent};

/// A fan whose triangles are larger than this times their sum is summed in double-double.
const CANCELLATION_MAX: f64 = 30.0;

/// Signed solid angle of the triangle (a, b, c) seen from `point`: tan(Ω/2) = det/D with
/// det = a·(b×c) and D = abc + (a·b)c + (b·c)a + (c·a)b of the vectors from the point (Van Oosterom
/// and Strackee 1983, eq. 8). Positive where det is; |Ω| < 2π. Zero if the point is in the
/// triangle's plane outside it, or the triangle has no area. Answers the scene's triangle meshes.
///
/// det from differences of vertices, and both in double-double: they cancel for slivers, for far
/// triangles and beside an edge.
///
/// ```
/// use glam::DVec3;
/// use radiometry::solid_angle::triangle_signed;
/// let octant = triangle_signed(DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z)?;
/// assert_eq!(octant.sr(), std::f64::consts::FRAC_PI_2);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn triangle_signed(
    point: DVec3,
    a: DVec3,
    b: DVec3,
    c: DVec3,
) -> Result<SolidAngle, DomainError> {
    let (numerator, denominator) = narrow(half_tangent(point, [a, b, c])?);
    if numerator == 0.0 {
        // In the plane: nothing is seen from outside, and from inside it depends on the side.
        return if denominator > 0.0 {
            Ok(SolidAngle::ZERO)
        } else {
            Err(DomainError::Touching { shape: "triangle" })
        };
    }
    Ok(SolidAngle::from_sr(2.0 * libm::atan2(numerator, denominator)))
}

/// Solid angle of the triangle (a, b, c) seen from the origin, without a sign; 2π, the limit from
/// either side, if the origin lies inside it. See [`triangle_signed`].
/// Who needs it: the page on solid angle; triangle meshes.
///
/// ```
/// use glam::DVec3;
/// use radiometry::solid_angle::triangle;
/// let octant = triangle(DVec3::Y, DVec3::X, DVec3::Z)?;
/// assert_eq!(octant.sr(), std::f64::consts::FRAC_PI_2);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn triangle(a: DVec3, b: DVec3, c: DVec3) -> Result<SolidAngle, DomainError> {
    let (numerator, denominator) = narrow(half_tangent(DVec3::ZERO, [a, b, c])?);
    if numerator == 0.0 && denominator == 0.0 {
        return Err(DomainError::Touching { shape: "triangle's edge" });
    }
    Ok(SolidAngle::from_sr(2.0 * libm::atan2(numerator.abs(), denominator)))
}

/// Solid angle of a polygon, convex or not, seen from `point`: the signed triangles of a fan, in
/// double-double where they cancel. Zero from its plane outside it; up to 2π near its face.
/// Who needs it: the page on solid angle: faces of a room.
///
/// ```
/// use glam::DVec3;
/// use radiometry::{shape::Polygon, solid_angle::polygon};
/// // A face of a cube from the cube's centre.
/// let face = Polygon::new(vec![
///     DVec3::new(-1.0, -1.0, 1.0),
///     DVec3::new(1.0, -1.0, 1.0),
///     DVec3::new(1.0, 1.0, 1.0),
///     DVec3::new(-1.0, 1.0, 1.0),
/// ])?;
/// assert!((polygon(DVec3::ZERO, &face)?.sr() - 4.0 * std::f64::consts::PI / 6.0).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn polygon(point: DVec3, polygon: &Polygon) -> Result<SolidAngle, DomainError> {
    let vertices = polygon.vertices();
    let Some((&first, rest)) = vertices.split_first() else {
        return Ok(SolidAngle::ZERO);
    };
    let fan = || rest.windows(2).map(|pair| [first, pair[0], pair[1]]);
    let (mut sum, mut size) = (Sum::default(), 0.0);
    for [a, b, c] in fan() {
        let part = triangle_signed(point, a, b, c)?.sr();
        sum.add(part);
        size += part.abs();
    }
    let mut value = sum.value().abs();
    if size > CANCELLATION_MAX * value {
        let mut wide = DoubleDouble::from_f64(0.0);
        for triangle in fan() {
            wide = wide.add(half_angle(half_tangent(point, triangle)?));
        }
        value = 2.0 * wide.to_f64().abs();
    }
    Ok(SolidAngle::from_sr(value.min(2.0 * PI)))
}

/// The angle of such a tangent, with all its digits.
fn half_angle((numerator, denominator): (DoubleDouble, DoubleDouble)) -> DoubleDouble {
    if numerator.to_f64() < 0.0 {
        transcendental::angle(numerator.neg(), denominator).neg()
    } else {
        transcendental::angle(numerator, denominator)
    }
}

fn narrow((numerator, denominator): (DoubleDouble, DoubleDouble)) -> (f64, f64) {
    (numerator.to_f64(), denominator.to_f64())
}

/// The two arguments of the arc tangent that is half the solid angle.
fn half_tangent(
    point: DVec3,
    corners: [DVec3; 3],
) -> Result<(DoubleDouble, DoubleDouble), DomainError> {
    finite_vector("point", point)?;
    for (name, corner) in ["a", "b", "c"].into_iter().zip(corners) {
        finite_vector(name, corner)?;
    }
    let unit = unit_exponent(corners.into_iter().chain([point]).flat_map(|v| v.to_array()));
    let point = in_units(point, unit);
    let [a, b, c] = corners.map(|corner| WideVec::difference(in_units(corner, unit), point));
    let (Some(a_size), Some(b_size), Some(c_size)) = (a.exponent(), b.exponent(), c.exponent())
    else {
        return Err(DomainError::Touching { shape: "triangle's vertex" });
    };
    let det = a.dot(b.sub(a).cross(c.sub(a)));
    // Each vector by its own power of two: near and far vertices do not drown each other.
    let det = det.scaled(-(a_size + b_size + c_size));
    let (a, b, c) = (a.scaled(-a_size), b.scaled(-b_size), c.scaled(-c_size));
    let (a_length, b_length, c_length) = (a.length(), b.length(), c.length());
    let denominator: DoubleDouble = a_length
        .mul(b_length)
        .mul(c_length)
        .add(a.dot(b).mul(c_length))
        .add(b.dot(c).mul(a_length))
        .add(c.dot(a).mul(b_length));
    Ok((det, denominator))
}
