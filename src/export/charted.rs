//! What fit.json says of a fit by its chart: the region, and the quantities that are always there.
//! The surface chart's keys are the contract's; each other chart has its own, and none that it has not.

use fit::derive::{ALL_DIRECTIONS, Derived, Field, PointReceiver};
use fit::{Chart, Estimate, Face, Fit, Ray, Region};
use glam::DVec3;
use serde_json::{Map, Value, json};

use crate::rig::Quantity;

/// The region, by its chart's own coordinates.
pub(super) fn region_json(region: &Region) -> Value {
    let mm = |(from, to): (f64, f64)| [from * 1e3, to * 1e3];
    let theta_max_deg = region.theta_max_rad.to_degrees();
    match region.chart {
        Chart::Perpendicular { face: Face::Disk } => json!({
            "radius_mm": (region.x_m.1 - region.x_m.0) * 0.5e3,
            "theta_max_deg": theta_max_deg,
        }),
        Chart::Surface | Chart::Perpendicular { face: Face::Rectangle } => json!({
            "x_mm": mm(region.x_m),
            "y_mm": mm(region.y_m),
            "theta_max_deg": theta_max_deg,
        }),
        Chart::Environment => json!({"theta_max_deg": theta_max_deg}),
        Chart::TwoPlane { distance_m, s_m, t_m } => json!({
            "u_mm": mm(region.x_m),
            "v_mm": mm(region.y_m),
            "s_mm": mm(s_m),
            "t_mm": mm(t_m),
            "distance_mm": distance_m * 1e3,
        }),
    }
}

/// A ray, by its chart's own coordinates.
pub(super) fn ray_json(ray: Ray, chart: &Chart) -> Value {
    let named = coordinates(ray, chart).into_iter();
    Value::Object(named.map(|(name, value)| (name.to_owned(), json!(value))).collect())
}

/// The same as names with their units, and numbers.
pub(super) fn coordinates(ray: Ray, chart: &Chart) -> Vec<(&'static str, f64)> {
    let direction =
        [("theta_deg", ray.theta_rad.to_degrees()), ("phi_deg", ray.phi_rad.to_degrees())];
    let (x_mm, y_mm) = (ray.x_m * 1e3, ray.y_m * 1e3);
    match *chart {
        Chart::Surface | Chart::Perpendicular { .. } => {
            [("x_mm", x_mm), ("y_mm", y_mm)].into_iter().chain(direction).collect()
        }
        Chart::Environment => direction.to_vec(),
        Chart::TwoPlane { distance_m, .. } => {
            let (s_m, t_m) = ray.beyond(distance_m);
            vec![("u_mm", x_mm), ("v_mm", y_mm), ("s_mm", s_m * 1e3), ("t_mm", t_m * 1e3)]
        }
    }
}

/// A quantity of a chart other than the surface one.
#[derive(Debug, Clone)]
pub struct Charted {
    /// Its key in fit.json.
    pub key: &'static str,
    /// What people call it.
    pub name: &'static str,
    /// Its unit; empty for a relative one.
    pub unit: &'static str,
    /// The value and what is known of it.
    pub derived: Derived,
    /// Its direction, where it has one: θ and φ, radians.
    pub towards: Option<(f64, f64)>,
}

/// The quantities that a chart other than the surface one always has; of a region without an area
/// only those that need none.
pub fn charted(fit: &Fit, quantity: Quantity) -> Vec<Charted> {
    let field = Field::of(fit);
    let [_, exitance_unit, flux_unit] = quantity.units();
    let flux = || {
        let derived = field.flux(ALL_DIRECTIONS).ok()?;
        let (key, name) = (quantity.flux_key(), "flux");
        Some(Charted { key, name, unit: flux_unit, derived, towards: None })
    };
    let at_point = |key, name, receiver: PointReceiver| {
        let derived = field.irradiance_at_point(&receiver).ok()?;
        let unit = if exitance_unit == "lm/m²" { "lx" } else { exitance_unit };
        Some(Charted { key, name, unit, derived, towards: None })
    };
    let found = match fit.region().chart {
        Chart::Surface => Vec::new(),
        Chart::Perpendicular { .. } => vec![flux(), peak_intensity(&field, quantity)],
        Chart::TwoPlane { .. } => vec![flux()],
        Chart::Environment => {
            let [face, sphere] = irradiance_keys(quantity);
            let up = PointReceiver::Face { normal: DVec3::Z };
            vec![
                at_point(face, "irradiance facing +z", up),
                at_point(sphere, "spherical irradiance", PointReceiver::Sphere),
            ]
        }
    };
    found.into_iter().flatten().collect()
}

fn peak_intensity(field: &Field<'_>, quantity: Quantity) -> Option<Charted> {
    let peak = field.peak_intensity().ok()?;
    let (key, unit) = match quantity {
        Quantity::Radiance => ("peak_intensity_w_per_sr", "W/sr"),
        Quantity::Luminance => ("peak_luminous_intensity_cd", "cd"),
        Quantity::Relative => ("peak_intensity_relative", ""),
    };
    let towards = Some((peak.theta_rad, peak.phi_rad));
    Some(Charted { key, name: "peak intensity", unit, derived: peak.intensity, towards })
}

/// Of a face, and from all sides.
const fn irradiance_keys(quantity: Quantity) -> [&'static str; 2] {
    match quantity {
        Quantity::Radiance => ["irradiance_w_per_m2", "spherical_irradiance_w_per_m2"],
        Quantity::Luminance => ["illuminance_lx", "spherical_illuminance_lx"],
        Quantity::Relative => ["irradiance_relative", "spherical_irradiance_relative"],
    }
}

impl Charted {
    fn json(&self) -> Value {
        let Estimate { value, u, u_independent } = self.derived.estimate;
        let mut object = json!({"value": value, "u": u, "u_independent": u_independent});
        if let Some((theta_rad, phi_rad)) = self.towards {
            object["theta_deg"] = json!(theta_rad.to_degrees());
            object["phi_deg"] = json!(phi_rad.to_degrees());
        } else {
            object["measured_fraction"] = json!(self.derived.measured_fraction);
        }
        object
    }
}

/// Puts a chart's quantities, and the budget of the first of them.
pub(super) fn put_charted(fit: &Fit, quantity: Quantity, object: &mut Map<String, Value>) {
    for (i, one) in charted(fit, quantity).into_iter().enumerate() {
        if i == 0 {
            let budget = one.derived.budget.iter();
            let budget = budget.map(|part| json!({"name": part.name, "u": part.u})).collect();
            object.insert(format!("uncertainty_budget_{}", one.key), budget);
        }
        object.insert(one.key.to_owned(), one.json());
    }
}
