//! What was asked for, in words, and the names of angles by their planes.

use fit::derive::{ALL_DIRECTIONS, Medium, PointReceiver, Reference, Zone};
use glam::DVec3;

use crate::plan::{Asked, Wanted};

/// C of a plane's azimuth, degrees in [0, 360).
fn c_deg(phi_rad: f64) -> f64 {
    let c_deg = (-phi_rad.to_degrees()).rem_euclid(360.0);
    // Radians to degrees and back costs a last digit, which nobody wrote.
    let rounded = (c_deg * 1e9).round() / 1e9;
    // Not -0 either, which is what the turn of +0 is.
    if rounded >= 360.0 { 0.0 } else { rounded.abs() }
}

pub(super) fn angle_name(name: Option<&str>, phi_rad: f64, level: f64) -> String {
    let percent = (level * 1e4).round() / 1e2;
    let kind = match percent {
        50.0 => "beam_angle".to_owned(),
        10.0 => "field_angle".to_owned(),
        other => format!("angle_at_{other}_percent"),
    };
    let c_deg = c_deg(phi_rad);
    let opposite = (c_deg + 180.0) % 360.0;
    format!("{}-C{c_deg}-C{opposite}", name.unwrap_or(&kind))
}

/// What was asked for, for people.
pub(super) fn in_words(wanted: &Wanted) -> String {
    let deg = |rad: f64| (rad.to_degrees() * 1e9).round() / 1e9;
    let mm = |m: f64| (m * 1e12).round() / 1e9;
    let place = |p: DVec3| format!("({}, {}, {}) mm", mm(p.x), mm(p.y), mm(p.z));
    let zone = |zone: &Zone| {
        if *zone == ALL_DIRECTIONS {
            return "in all directions".to_owned();
        }
        format!("within {}° to {}° of the normal", deg(zone.from_rad), deg(zone.to_rad))
    };
    let text = match &wanted.asked {
        Asked::Radiance(ray) => format!(
            "from ({}, {}) mm at theta {}°, phi {}°",
            mm(ray.x_m),
            mm(ray.y_m),
            deg(ray.theta_rad),
            deg(ray.phi_rad)
        ),
        Asked::Exitance { at_m: Some((x, y)), zone: z } => {
            format!("at ({}, {}) mm, {}", mm(*x), mm(*y), zone(z))
        }
        Asked::Exitance { at_m: None, zone: z } => format!("mean over the region, {}", zone(z)),
        Asked::Intensity { theta_rad, phi_rad } => {
            format!("at theta {}°, phi {}°", deg(*theta_rad), deg(*phi_rad))
        }
        Asked::PeakIntensity => "largest within the cone that was measured".to_owned(),
        Asked::Flux(z) => zone(z),
        Asked::FluxInto(cone) => format!(
            "within {}° of theta {}°, phi {}°",
            deg(cone.half_angle_rad),
            deg(cone.axis_theta_rad),
            deg(cone.axis_phi_rad)
        ),
        Asked::Irradiance(receiver) => {
            let n = receiver.normal();
            let size = receiver.area_m2() * 1e6;
            let shape = if size > 0.0 { format!("{size:.6} mm² about ") } else { String::new() };
            let [x, y, z] = [n.x, n.y, n.z].map(|c| (c * 1e6).round() / 1e6);
            format!("at {shape}{} facing ({x}, {y}, {z})", place(receiver.place_m()))
        }
        Asked::IrradianceAtPoint(receiver) => {
            let components = |v: DVec3| {
                let [x, y, z] = [v.x, v.y, v.z].map(|c| (c * 1e6).round() / 1e6);
                format!("({x}, {y}, {z})")
            };
            match receiver {
                PointReceiver::Face { normal } => {
                    format!("at the point, facing {}", components(*normal))
                }
                PointReceiver::Cylinder { axis } => {
                    format!("at the point, of a cylinder about {}", components(*axis))
                }
                PointReceiver::Sphere => "at the point, from all sides".to_owned(),
            }
        }
        Asked::BeamAngle { phi_rad, level, reference } => {
            let of = match reference {
                Reference::PlanePeak => "the plane's largest intensity",
                Reference::Centre => "the centre beam intensity",
            };
            let percent = (level * 1e4).round() / 1e2;
            let c = c_deg(*phi_rad);
            format!("at {percent} % of {of}, plane C{c}-C{}", (c + 180.0) % 360.0)
        }
        Asked::Environment(map) => {
            format!("seen from {}, {} x {} cells", place(map.place_m), map.rows, map.columns)
        }
        Asked::TwoPlane(grid) => {
            format!("between z = 0 and z = {} mm", mm(grid.distance_m))
        }
    };
    match wanted.medium {
        Medium::Air => text,
        Medium::Window(layer) => {
            format!("{text}; window of n = {} removed", layer.index.value)
        }
        Medium::Immersion(layer) => {
            format!("{text}; within the emitter's medium of n = {}", layer.index.value)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_named_by_c() {
        assert_eq!(angle_name(None, 0.0, 0.5), "beam_angle-C0-C180");
        assert_eq!(angle_name(None, -std::f64::consts::FRAC_PI_2, 0.1), "field_angle-C90-C270");
        assert_eq!(angle_name(Some("w"), -30f64.to_radians(), 0.25), "w-C30-C210");
    }
}
