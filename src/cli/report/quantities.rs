//! The table of results: each quantity with its uncertainty, with and without the scale that all
//! readings share, and on a simulated rig what is true.

use fit::{Estimate, Fit};
use radiometry::quadrature::gauss_legendre;

use super::words::Words;
use crate::cli::results::Results;
use crate::cli::setup::Setup;
use crate::cli::text::{percent, with_uncertainty};
use crate::report::{Table, significant};
use crate::rig::calibration::{Calibrated, Fitted};

/// Nodes along each side of the region for the true intensity.
const NODES: usize = 24;

/// A row of the table.
struct Row {
    name: String,
    estimate: Estimate,
    unit: &'static str,
    measured_fraction: Option<f64>,
    truth: Option<f64>,
}

/// The table of a fit's results.
pub(super) fn table(setup: &Setup, results: &Results, fitted: &Fitted) -> Table {
    let has_truth = results.truth.is_some();
    let mut columns =
        vec!["", "value ± u (k = 1)", "u", "u without the common scale", "measured fraction"];
    if has_truth {
        columns.extend(["truth", "error", "error / u"]);
    }
    let shape = without_scale(&fitted.fit, &results.calibrated);
    let rest = rows(setup, results, &shape).into_iter().map(|row| row.estimate.u);
    let rows = rows(setup, results, &fitted.fit).into_iter().zip(rest);
    Table {
        columns: columns.into_iter().map(str::to_owned).collect(),
        rows: rows.map(|(row, rest)| row.cells(rest, has_truth)).collect(),
    }
}

fn rows(setup: &Setup, results: &Results, fit: &Fit) -> Vec<Row> {
    let words = Words::of(setup.rig.detector.quantity);
    let truth = results.truth;
    let peak = fit.peak();
    let cone = format!("  within {:.1}°", fit.region().theta_max_rad.to_degrees());
    let row = |name: &str, estimate, unit, truth| Row {
        name: name.to_owned(),
        estimate,
        unit,
        measured_fraction: None,
        truth,
    };
    let fraction = fit.measured_fraction();
    let exitance =
        row(words.exitance, fit.exitance(), words.exitance_unit, truth.map(|t| t.exitance));
    let within = truth.map(|t| t.exitance_within_region);
    let mut rows = vec![
        Row { measured_fraction: fraction, ..exitance },
        row(&cone, fit.exitance_within_region(), words.exitance_unit, within),
    ];
    if fit.region().area_m2() > 0.0 {
        let flux = row(words.flux, fit.flux(), words.flux_unit, truth.map(|t| t.flux));
        rows.push(Row { measured_fraction: fraction, ..flux });
        let name = format!("{} on axis", words.intensity);
        let on_axis = intensity_on_axis(setup);
        rows.push(row(&name, fit.intensity(0.0, 0.0), words.intensity_unit, on_axis));
    }
    let known = fit.pointing(&peak).map(pointing).unwrap_or_default();
    let name = format!("peak {}, {}{known}", words.radiance, place(&peak.ray));
    let largest = truth.and_then(|t| t.peak).map(|peak| peak.value);
    rows.push(row(&name, peak.radiance, words.radiance_unit, largest));
    rows
}

/// How well the direction is known, after it.
fn pointing(known: fit::Pointing) -> String {
    let angle = |u_rad: f64| significant(u_rad.to_degrees(), 2);
    format!(" (u {}° along θ, {}° across)", angle(known.u_theta_rad), angle(known.u_across_rad))
}

fn place(ray: &fit::Ray) -> String {
    format!(
        "at x {:.2} mm, y {:.2} mm, θ {:.2}°, φ {:.2}°",
        ray.x_m * 1e3,
        ray.y_m * 1e3,
        ray.theta_rad.to_degrees(),
        ray.phi_rad.to_degrees()
    )
}

impl Row {
    /// `rest` is u without the common scale.
    fn cells(&self, rest: f64, has_truth: bool) -> Vec<String> {
        let Estimate { value, u, .. } = self.estimate;
        let relative =
            |u: f64| if value == 0.0 { "–".to_owned() } else { percent(u / value.abs()) };
        let none = || "–".to_owned();
        let mut cells = vec![
            self.name.clone(),
            with_uncertainty(value, u, self.unit),
            relative(u),
            relative(rest),
            self.measured_fraction.map_or_else(none, percent),
        ];
        if !has_truth {
            return cells;
        }
        match self.truth {
            Some(truth) => {
                let error = value - truth;
                let sign = if error > 0.0 { "+" } else { "" };
                let part = if truth == 0.0 { none() } else { percent(error / truth) };
                let part = format!("{sign}{part}");
                let in_u = if u > 0.0 { format!("{:+.2}", error / u) } else { none() };
                let text = with_uncertainty(truth, u, self.unit);
                // As many digits as the value; its own uncertainty is none.
                let digits = text.split(" ± ").next().unwrap_or_default();
                let digits = digits.trim_start_matches('(');
                let exponent = text.split(")e").nth(1).and_then(|rest| rest.split(' ').next());
                let exponent = exponent.map_or_else(String::new, |e| format!("e{e}"));
                let text = format!("{digits}{exponent} {}", self.unit);
                cells.extend([text.trim_end().to_owned(), part, in_u]);
            }
            None => cells.extend([none(), none(), none()]),
        }
        cells
    }
}

/// The fit without what scales all readings alike: the detector's responsivity and throughput, and the
/// gain where only one range was used.
pub(super) fn without_scale(fit: &Fit, calibrated: &Calibrated) -> Fit {
    fit.without_scale(&calibrated.scales())
}

/// The true intensity of the region along the normal: the radiance over the region, by a product
/// rule, exact for what is smooth in position, to about 1/24 of an edge within the region.
fn intensity_on_axis(setup: &Setup) -> Option<f64> {
    let truth = setup.truth()?;
    let region = setup.region();
    let nodes = gauss_legendre(NODES);
    let at = |(low, high): (f64, f64), t: f64| low + (high - low) * 0.5 * (1.0 + t);
    let row = |&(tx, wx): &(f64, f64)| -> f64 {
        let cell = |&(ty, wy): &(f64, f64)| {
            0.25 * wx * wy * truth.radiance(at(region.x_m, tx), at(region.y_m, ty), 0.0, 0.0)
        };
        nodes.iter().map(cell).sum()
    };
    let mean: f64 = nodes.iter().map(row).sum();
    Some(mean * (region.x_m.1 - region.x_m.0) * (region.y_m.1 - region.y_m.0))
}
