//! The fitted field as pictures: polar diagram, hemisphere, the sample's plane, the budget.

use fit::{Contribution, Fit, Ray};

use super::quantities::without_scale;
use super::words::Words;
use crate::cli::results::Results;
use crate::cli::setup::Setup;
use crate::report::{Budget, Hemisphere, Picture, Plane, Polar, Section};
use crate::rig::calibration::{Fitted, IndependentParts, Sample};

/// Multiplications that the map of u may cost: each place takes the square of the coefficients.
const WORK_MAX: f64 = 4e7;
const U_SIDE: (f64, f64) = (16.0, 60.0);

/// The pictures of the field.
pub(super) fn section(setup: &Setup, results: &Results, fitted: &Fitted) -> Section {
    let fit = &fitted.fit;
    let words = Words::of(setup.rig.detector.quantity);
    let used: Vec<&Sample> =
        results.calibrated.samples.iter().filter(|s| !s.flags.excludes_from_fit()).collect();
    let shape = without_scale(fit, &results.calibrated);
    let mut pictures = vec![polar(fit, &words, &used), hemisphere([fit, &shape], &words, &used)];
    pictures.extend(plane(fit, &words, &used));
    Section { title: format!("The field: {}", words.radiance), pictures, ..Section::default() }
}

fn centre(fit: &Fit) -> (f64, f64) {
    let region = fit.region();
    (0.5 * (region.x_m.0 + region.x_m.1), 0.5 * (region.y_m.0 + region.y_m.1))
}

fn at_centre(fit: &Fit) -> String {
    let (x, y) = centre(fit);
    format!("At the region's centre, x = {:.2} mm, y = {:.2} mm", x * 1e3, y * 1e3)
}

fn polar(fit: &Fit, words: &Words, used: &[&Sample]) -> Picture {
    let (x_m, y_m) = centre(fit);
    let value = |theta_rad: f64, phi_rad: f64| {
        let estimate = fit.radiance(&Ray { x_m, y_m, theta_rad, phi_rad });
        (estimate.value, estimate.u)
    };
    let reading = |sample: &&Sample| (sample.pose.theta_rad, sample.pose.phi_rad, sample.value);
    let readings: Vec<(f64, f64, f64)> = used.iter().map(reading).collect();
    Polar {
        quantity: &words.radiance_symbol(),
        unit: words.radiance_unit,
        value: &value,
        readings: &readings,
        place: &at_centre(fit),
    }
    .picture()
}

/// Of a fit, with and without the common scale.
fn hemisphere([fit, shape]: [&Fit; 2], words: &Words, used: &[&Sample]) -> Picture {
    let (x_m, y_m) = centre(fit);
    let ray = |theta_rad: f64, phi_rad: f64| Ray { x_m, y_m, theta_rad, phi_rad };
    let directions: Vec<(f64, f64)> =
        used.iter().map(|sample| (sample.pose.theta_rad, sample.pose.phi_rad)).collect();
    let coefficients = fit.coefficients().len() as f64;
    let side = libm::sqrt(WORK_MAX) / coefficients;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 16 to 60
    let u_side = side.clamp(U_SIDE.0, U_SIDE.1) as usize;
    Hemisphere {
        quantity: &words.radiance_symbol(),
        unit: words.radiance_unit,
        value: &|theta, phi| fit.value(&ray(theta, phi)),
        u: &|theta, phi| [fit, shape].map(|fit| fit.radiance(&ray(theta, phi)).u),
        u_side,
        directions: &directions,
        place: &at_centre(fit),
    }
    .picture()
}

/// `None` for a region without an extent.
fn plane(fit: &Fit, words: &Words, used: &[&Sample]) -> Option<Picture> {
    let region = fit.region();
    let peak = fit.peak();
    let (theta_rad, phi_rad) = (peak.ray.theta_rad, peak.ray.phi_rad);
    let mm = |(low, high): (f64, f64)| (low * 1e3, high * 1e3);
    let positions: Vec<(f64, f64)> =
        used.iter().map(|sample| (sample.pose.x_m * 1e3, sample.pose.y_m * 1e3)).collect();
    let value = |x_mm: f64, y_mm: f64| {
        fit.value(&Ray { x_m: x_mm * 1e-3, y_m: y_mm * 1e-3, theta_rad, phi_rad })
    };
    let place = format!(
        "In the direction of the peak, θ = {:.1}°, φ = {:.1}°",
        theta_rad.to_degrees(),
        phi_rad.to_degrees()
    );
    (region.area_m2() > 0.0).then(|| {
        Plane {
            quantity: &words.radiance_symbol(),
            unit: words.radiance_unit,
            x_mm: mm(region.x_m),
            y_mm: mm(region.y_m),
            value: &value,
            u: peak.radiance.u,
            positions: &positions,
            place: &place,
        }
        .picture()
    })
}

/// The uncertainties' sources, the independent parts by their own.
pub(super) fn budget(
    setup: &Setup,
    fitted: &Fitted,
    independent: &IndependentParts,
) -> Option<Section> {
    let words = Words::of(setup.rig.detector.quantity);
    let fit = &fitted.fit;
    let bars = |name: &'static str, quantity: &str, value: f64, rows: Vec<Contribution>, own| {
        let own: &[Contribution] = own;
        let mut rows = rows;
        if !own.is_empty() {
            // The first row is the independent part as a whole.
            rows.splice(..1, own.iter().cloned());
        }
        let parts: Vec<(String, f64)> = rows.into_iter().map(|part| (part.name, part.u)).collect();
        Budget { name, quantity, value, parts: &parts }.picture()
    };
    let exitance = fit.exitance().value;
    let normal = fit.mean_towards(0.0, 0.0).times(fit.region().area_m2());
    let on_axis = format!("{} on axis", words.intensity);
    let peak = fit.peak();
    let at_peak = format!("{} at the peak", words.radiance);
    let rows = fit.radiance_contributions(&peak.ray);
    let all = [
        bars("budget", words.exitance, exitance, fit.contributions(), &independent.exitance),
        bars(
            "budget-intensity",
            &on_axis,
            fit.of(&normal).value,
            fit.contributions_of(&normal),
            &independent.intensity,
        ),
        bars("budget-peak", &at_peak, peak.radiance.value, rows, &independent.peak),
    ];
    let pictures: Vec<Picture> = all.into_iter().flatten().collect();
    let title = "Where the uncertainty comes from".to_owned();
    (!pictures.is_empty()).then(|| Section { title, pictures, ..Section::default() })
}
