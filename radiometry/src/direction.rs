//! Directions: unit vectors and angles (θ, φ), exact at the poles, at the seam and between nearly
//! equal directions. It does not know what points there.
//!
//! θ is counted from +z, φ from +x towards +y, radians. All averages are formed on vectors, so that
//! neither pole nor seam can do harm. A NaN in gives a NaN out; the zero vector has no direction,
//! and what each function answers for it is said there.

use glam::DVec3;

use crate::error_free::{difference_of_products, two_sum};

/// The unit vector of (θ, φ): (sin θ cos φ, sin θ sin φ, cos θ). Any angles.
/// Who needs it: the rig, the plan and the simulator, wherever angles become a ray.
///
/// ```
/// use radiometry::direction::unit;
/// assert!((unit(std::f64::consts::FRAC_PI_2, 0.0) - glam::DVec3::X).length() < 1e-16);
/// ```
pub fn unit(theta: f64, phi: f64) -> DVec3 {
    let (sin_theta, cos_theta) = libm::sincos(theta);
    let (sin_phi, cos_phi) = libm::sincos(phi);
    DVec3::new(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta)
}

/// (θ, φ) of a vector of any length: θ in [0, π], φ in (-π, π]. On the poles, where φ has no
/// meaning, it is 0; so are both angles for the zero vector.
/// Who needs it: the rig's calibration and the simulator's laws, wherever a ray becomes angles.
///
/// ```
/// use radiometry::direction::angles;
/// assert_eq!(angles(glam::DVec3::new(1e-9, 0.0, 1.0)).0, 1e-9);
/// assert_eq!(angles(glam::DVec3::new(-1.0, -0.0, 0.0)).1, std::f64::consts::PI);
/// ```
pub fn angles(direction: DVec3) -> (f64, f64) {
    let across = libm::hypot(direction.x, direction.y);
    let theta = libm::atan2(across, direction.z);
    if across == 0.0 {
        return (theta, 0.0);
    }
    // Adding zero turns -0 into +0: half a turn is +π, whichever zero y is.
    (theta, libm::atan2(direction.y + 0.0, direction.x))
}

/// An angle brought into (-π, π] by whole turns of the true 2π (the library reduces exactly; taking
/// off the double nearest 2π is off by 2.4e-16 a turn).
/// Who needs it: the rig's kinematics and whoever drives it by hand.
///
/// ```
/// use std::f64::consts::PI;
/// assert_eq!(radiometry::direction::wrap(1.0), 1.0);
/// assert!((radiometry::direction::wrap(3.5 * PI) + 0.5 * PI).abs() < 1e-14);
/// ```
pub fn wrap(angle: f64) -> f64 {
    let (sin, cos) = libm::sincos(angle);
    libm::atan2(sin, cos)
}

/// An angle in degrees brought into (-180, 180], exactly.
/// Who needs it: the plan, whose files are in degrees.
///
/// ```
/// assert_eq!(radiometry::direction::wrap_deg(540.0), 180.0);
/// assert_eq!(radiometry::direction::wrap_deg(190.0), -170.0);
/// ```
pub fn wrap_deg(angle_deg: f64) -> f64 {
    let wrapped = libm::remainder(angle_deg, 360.0);
    if wrapped <= -180.0 { 180.0 } else { wrapped }
}

/// The rotation from one angle to another by the shorter way, in (-π, π], exact for nearly equal
/// angles and across the seam.
/// Who needs it: the page on directions: the way of an axis across the seam.
///
/// ```
/// use radiometry::direction::shortest_rotation;
/// assert!((shortest_rotation(3.0, -3.0) - (std::f64::consts::TAU - 6.0)).abs() < 1e-15);
/// ```
pub fn shortest_rotation(from: f64, to: f64) -> f64 {
    let (difference, rest) = two_sum(to, -from);
    let (sin, cos) = libm::sincos(difference);
    libm::atan2(rest.mul_add(cos, sin), (-rest).mul_add(sin, cos))
}

/// The angle between two vectors of any length, in [0, π], a few ulp near 0 and near π alike; 0 if
/// one of them is the zero vector.
///
/// atan2(|a × b|, a · b) with each product in the cross product taken without loss (Kahan's
/// difference of products), after scaling by powers of two. The arc cosine of the dot product
/// answers 0 below 1.5e-8.
/// Who needs it: the plan's and the rig's tests: how far a pose is off.
///
/// ```
/// use radiometry::direction::angle_between;
/// let (a, b) = (glam::DVec3::X, glam::DVec3::new(1.0, 1e-9, 0.0));
/// assert_eq!(angle_between(a, b), 1e-9);
/// ```
pub fn angle_between(a: DVec3, b: DVec3) -> f64 {
    let (a, b) = (scaled(a), scaled(b));
    let cross = DVec3::new(
        difference_of_products(a.y, b.z, a.z, b.y),
        difference_of_products(a.z, b.x, a.x, b.z),
        difference_of_products(a.x, b.y, a.y, b.x),
    );
    libm::atan2(length(cross), a.dot(b))
}

/// The angle between the directions (θ₁, φ₁) and (θ₂, φ₂), in [0, π], from the angles themselves:
/// haversine and its exact complement, so that neither end loses digits.
/// Who needs it: the page on directions, for angles without vectors.
///
/// ```
/// use radiometry::direction::angular_distance;
/// // Across the pole, half a radian on either side.
/// let found = angular_distance(0.5, 1.0, 0.5, 1.0 + std::f64::consts::PI);
/// assert!((found - 1.0).abs() < 1e-15);
/// ```
pub fn angular_distance(theta_1: f64, phi_1: f64, theta_2: f64, phi_2: f64) -> f64 {
    let (sin_difference, cos_difference) = libm::sincos((theta_2 - theta_1) / 2.0);
    let (sin_sum, cos_sum) = libm::sincos(f64::midpoint(theta_1, theta_2));
    let (sin_phi, cos_phi) = libm::sincos((phi_2 - phi_1) / 2.0);
    let sin_half = libm::hypot(sin_difference * cos_phi, sin_sum * sin_phi);
    let cos_half = libm::hypot(cos_difference * cos_phi, cos_sum * sin_phi);
    2.0 * libm::atan2(sin_half, cos_half)
}

/// The unit vector half-way between two directions, on the shorter arc; none if they are opposite
/// (every half-way direction would do) or one is the zero vector.
/// Who needs it: the page on directions: averages on vectors.
pub fn midpoint(a: DVec3, b: DVec3) -> Option<DVec3> {
    mean([a, b])
}

/// The direction of the mean of the unit vectors along the given directions; none if they cancel to
/// rounding, if one is the zero vector or not finite, or if there are none.
/// Who needs it: the rig's calibration, for the pose of a dwell.
pub fn mean(directions: impl IntoIterator<Item = DVec3>) -> Option<DVec3> {
    let (mut sum, mut count) = (DVec3::ZERO, 0.0);
    for direction in directions {
        sum += normalised(direction)?;
        count += 1.0;
    }
    // The rounding of `count` unit vectors: what is left below it has no direction.
    let meaningful = 8.0 * f64::EPSILON * count;
    if sum.length() > meaningful { normalised(sum) } else { None }
}

/// A vector of length 1 along `direction`, whatever its length; none for the zero vector and for
/// components that are not finite.
/// Who needs it: the simulator's emitters and every kernel here that is handed a direction.
pub fn normalised(direction: DVec3) -> Option<DVec3> {
    if !direction.is_finite() || direction == DVec3::ZERO {
        return None;
    }
    let scaled = scaled(direction);
    Some(scaled / length(scaled))
}

/// Two unit vectors that make a right-handed orthonormal frame with a unit normal: (t, b, n). There
/// is no bad normal (Duff et al. 2017, JCGT 6:1, listing 3); like every such frame it jumps
/// somewhere, here at z = 0.
/// Who needs it: the simulator, to lay a lobe or a contact about a normal.
pub fn frame(normal: DVec3) -> (DVec3, DVec3) {
    let sign = libm::copysign(1.0, normal.z);
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    (
        DVec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
        DVec3::new(b, sign + normal.y * normal.y * a, -normal.y),
    )
}

/// The vector times a power of two, so that its largest component is in [1, 2): exact but for
/// components so small that they no longer matter.
fn scaled(vector: DVec3) -> DVec3 {
    let largest = vector.abs().max_element();
    if largest == 0.0 || !largest.is_finite() {
        return vector;
    }
    let exponent = -libm::ilogb(largest);
    DVec3::new(
        libm::scalbn(vector.x, exponent),
        libm::scalbn(vector.y, exponent),
        libm::scalbn(vector.z, exponent),
    )
}

/// Without overflow or underflow of the squares.
fn length(vector: DVec3) -> f64 {
    libm::hypot(libm::hypot(vector.x, vector.y), vector.z)
}
