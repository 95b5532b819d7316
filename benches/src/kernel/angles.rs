//! Directions, interfaces and bases.

use radiometry::basis::{harmonics, legendre, zernike};
use radiometry::direction;
use radiometry::interface::{Incidence, Interface, Window};

use super::Row;
use super::{Call, Kind, value};
use crate::Unmeasured;

pub(super) fn call(quantity: &str, row: Row<'_>) -> Result<Option<Call>, Unmeasured> {
    let of = |inputs: [&str; 1]| row.numbers(inputs);
    Ok(Some(match quantity {
        "angle-between-vectors" => {
            let vectors = [row.vector("a")?, row.vector("b")?];
            Call::new(Kind::Closed, vectors, |[a, b]| direction::angle_between(*a, *b))
        }
        "angular-distance" => {
            let angles = row.numbers(["theta1", "phi1", "theta2", "phi2"])?;
            Call::new(Kind::Closed, angles, |[t, p, u, q]| {
                direction::angular_distance(*t, *p, *u, *q)
            })
        }
        "direction-theta" => {
            Call::new(Kind::Closed, row.vector("direction")?, |v| direction::angles(*v).0)
        }
        "direction-phi" => {
            Call::new(Kind::Closed, row.vector("direction")?, |v| direction::angles(*v).1)
        }
        "wrap-angle" => Call::new(Kind::Closed, of(["angle"])?, |[angle]| direction::wrap(*angle)),
        "shortest-rotation" => Call::new(Kind::Closed, row.numbers(["from", "to"])?, |[a, b]| {
            direction::shortest_rotation(*a, *b)
        }),
        "orthonormal-basis-defect" => Call::new(Kind::Closed, row.vector("normal")?, |normal| {
            let (tangent, bitangent) = direction::frame(*normal);
            tangent.x + bitangent.y
        }),
        "zernike-radial" => {
            let (n, m) = (row.count("n")?, row.count("m")?);
            Call::new(Kind::Recurrence, (n, m, row.number("r")?), |(n, m, r)| {
                value(zernike::radial(*n, *m, *r), |radial| radial)
            })
        }
        "legendre" => {
            let inputs = (row.count("l")?, row.number("x")?);
            Call::new(Kind::Recurrence, inputs, |(l, x)| value(legendre::polynomial(*l, *x), |p| p))
        }
        "spherical-harmonic" => {
            let inputs = (row.count("l")?, row.count("m")?, row.number("theta")?);
            Call::new(Kind::Recurrence, inputs, |(l, m, theta)| {
                value(harmonics::amplitude(*l, *m, *theta), |amplitude| amplitude)
            })
        }
        _ => return interfaces(quantity, row),
    }))
}

fn interfaces(quantity: &str, row: Row<'_>) -> Result<Option<Call>, Unmeasured> {
    if !row.has("n1") {
        return Ok(None);
    }
    let [n1, n2] = row.numbers(["n1", "n2"])?;
    let face = Interface::new(n1, n2)?;
    if quantity == "radiance-ratio-across-interface" {
        return Ok(Some(Call::new(Kind::Closed, face, |face| face.radiance_ratio())));
    }
    if quantity == "refract-direction" {
        let inputs = (face, row.vector("direction")?, row.vector("normal")?);
        return Ok(Some(Call::new(Kind::Closed, inputs, |(face, direction, normal)| {
            value(face.refract(*direction, *normal), |refracted| {
                refracted.map_or(f64::NAN, |refracted| refracted.z)
            })
        })));
    }
    if let Some(kernel) = windows(quantity) {
        let absorption = if row.has("absorption") { row.number("absorption")? } else { 0.0 };
        let window = Window::new(face, row.number("thickness")?, absorption)?;
        return at_incidence(row, window, kernel).map(Some);
    }
    let kernel: fn(Interface, Incidence) -> f64 = match quantity {
        "fresnel-reflectance" => |face, at| face.reflectance(at),
        "fresnel-reflectance-s" => |face, at| face.reflectance_s(at),
        "fresnel-reflectance-p" => |face, at| face.reflectance_p(at),
        "fresnel-transmittance" => |face, at| face.transmittance(at),
        "fresnel-transmittance-s" => |face, at| face.transmittance_s(at),
        "fresnel-transmittance-p" => |face, at| face.transmittance_p(at),
        "snell-refraction" => |face, at| face.refracted_cos(at).unwrap_or(f64::NAN),
        "snell-refraction-angle" => |face, at| face.refracted_angle(at).unwrap_or(f64::NAN),
        "refraction-deviation" => |face, at| face.deviation(at).unwrap_or(f64::NAN),
        _ => return Ok(None),
    };
    at_incidence(row, face, kernel).map(Some)
}

fn windows(quantity: &str) -> Option<fn(Window, Incidence) -> f64> {
    Some(match quantity {
        "window-transmittance" => |window, at| window.transmittance(at),
        "window-reflectance" => |window, at| window.reflectance(at),
        "window-lateral-shift" => |window, at| window.lateral_shift_m(at).unwrap_or(f64::NAN),
        _ => return None,
    })
}

/// The incidence is read anew at each call: it is what changes from ray to ray.
fn at_incidence<B: Copy + 'static>(
    row: Row<'_>,
    body: B,
    kernel: fn(B, Incidence) -> f64,
) -> Result<Call, Unmeasured> {
    Ok(if row.has("cos_i") {
        Call::new(Kind::Closed, (body, row.number("cos_i")?), move |(body, cos)| {
            value(Incidence::from_cos(*cos), |incidence| kernel(*body, incidence))
        })
    } else {
        Call::new(Kind::Closed, (body, row.number("theta_i")?), move |(body, angle)| {
            value(Incidence::from_angle(*angle), |incidence| kernel(*body, incidence))
        })
    })
}
