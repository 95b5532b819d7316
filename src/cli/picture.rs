//! `gonio fit --picture`: a field over the whole sphere as a picture of its own. A run's pictures
//! are its report's.

use std::path::Path;

use fit::{Chart, Fit, Ray, Sample};

use super::failure::Failure;
use crate::export::write_atomically;
use crate::report::{Picture, Sphere};
use crate::rig::Quantity;

/// Refuses a picture of a chart that has none, before anything is fitted.
pub(super) fn check(chart: &str) -> Result<(), Failure> {
    if chart == "perpendicular" || chart == "environment" {
        return Ok(());
    }
    Err(Failure::with_help(
        format!("--picture: there is none of the {chart} chart"),
        "give it to a fit in the perpendicular or the environment chart; a run's pictures are \
         `gonio report DIR --pictures FOLDER`",
    ))
}

/// Draws the field that was fitted to samples, and writes it.
pub(super) fn write(
    path: &Path,
    fit: &Fit,
    quantity: Quantity,
    samples: &[Sample],
) -> Result<(), Failure> {
    let directions: Vec<(f64, f64)> =
        samples.iter().map(|s| (s.ray.theta_rad, s.ray.phi_rad)).collect();
    let document = picture(fit, quantity, &directions).document();
    write_atomically(path, |out| out.write_all(document.as_bytes())).map_err(Failure::midway)
}

/// The intensity of an object with an area, else the radiance at the middle.
fn picture(fit: &Fit, quantity: Quantity, directions: &[(f64, f64)]) -> Picture {
    let region = fit.region();
    let (x_m, y_m) =
        (f64::midpoint(region.x_m.0, region.x_m.1), f64::midpoint(region.y_m.0, region.y_m.1));
    let is_object = matches!(region.chart, Chart::Perpendicular { .. }) && region.area_m2() > 0.0;
    let [radiance_unit, ..] = quantity.units();
    let (name, unit) = match (is_object, quantity) {
        (true, Quantity::Radiance) => ("intensity I", "W/sr"),
        (true, Quantity::Luminance) => ("luminous intensity I", "cd"),
        (true, Quantity::Relative) => ("relative intensity I", ""),
        (false, Quantity::Luminance) => ("luminance L", radiance_unit),
        (false, Quantity::Radiance) => ("radiance L", radiance_unit),
        (false, Quantity::Relative) => ("relative radiance L", radiance_unit),
    };
    let value = |theta_rad: f64, phi_rad: f64| {
        let estimate = if is_object {
            fit.intensity(theta_rad, phi_rad)
        } else {
            fit.radiance(&Ray { x_m, y_m, theta_rad, phi_rad })
        };
        (estimate.value, estimate.u)
    };
    let place = match (region.chart, is_object) {
        (Chart::Environment, _) => "What arrives at the point, by where it comes from",
        (_, true) => "The object as a whole, by where its light goes",
        (_, false) => "At the middle of the region, by where the light goes",
    };
    Sphere {
        quantity: name,
        unit,
        value: &value,
        theta_max_rad: region.theta_max_rad,
        directions,
        place,
    }
    .picture()
}
