//! Error against rig time on logarithmic axes, one curve a strategy: what was measured, what was
//! foretold, the front, and the limits that light and motion set.

use super::chart::{Chart, Series, Stroke};
use super::svg::Picture;
use crate::study::{FrontierPoint, FrontierRow, by_strategy};

/// Photon noise below this part of the least error would press the curves together.
const IN_SIGHT: f64 = 0.03;

/// A value of a row or of a point.
struct Values {
    of_row: fn(&FrontierRow) -> f64,
    of_point: fn(&FrontierPoint) -> f64,
    foretold: fn(&FrontierPoint) -> Option<f64>,
}

/// Diagrams of the radiance's error and of the exitance's, both without the factor common to all
/// readings, against rig time. Errors of zero have no place on a logarithmic axis and are left out.
pub fn frontier_pictures(
    title: &str,
    rows: &[FrontierRow],
    points: &[FrontierPoint],
) -> Vec<Picture> {
    let radiance = Values {
        of_row: |row| row.error_shape_rms_relative,
        of_point: |point| point.shape[1],
        foretold: |point| Some(point.foretold.uncertainty?.shape),
    };
    let exitance = Values {
        of_row: |row| row.error_exitance_shape_relative.abs(),
        of_point: |point| point.exitance_shape_rms,
        foretold: |point| Some(point.foretold.uncertainty?.exitance_shape),
    };
    let mut of_radiance = curves(rows, points, &radiance);
    of_radiance.extend(limits(points));
    let photons = photons(points);
    let common = "The factor that fits the truth best is taken out of every fit. Dots are runs, one a \
                  seed; dashes are what was foretold from the plan alone, at the rig time foretold.";
    let charts = [
        Chart {
            name: "frontier",
            title: format!("{title}: radiance"),
            caption: format!(
                "Root mean square error of the radiance over the region. Lines join the medians of \
                 the rungs. {common} Pale marks: no other rung is as quick and as good. Dotted: \
                 the medians again, at the time that the way alone takes.{photons}"
            ),
            x_label: "rig time / s".to_owned(),
            y_label: "relative error of radiance".to_owned(),
            is_logarithmic: true,
            series: of_radiance,
        },
        Chart {
            name: "frontier-exitance",
            title: format!("{title}: exitance"),
            caption: format!(
                "Error of the exitance over the hemisphere. Lines join the root mean squares over \
                 the seeds. {common}"
            ),
            x_label: "rig time / s".to_owned(),
            y_label: "relative error of exitance".to_owned(),
            is_logarithmic: true,
            series: curves(rows, points, &exitance),
        },
    ];
    charts.into_iter().filter_map(Chart::picture).collect()
}

fn series(name: &str, colour: usize, stroke: Stroke, points: Vec<(f64, f64)>) -> Series {
    Series { name: name.to_owned(), colour, stroke, points, errors: Vec::new() }
}

fn curves(rows: &[FrontierRow], points: &[FrontierPoint], values: &Values) -> Vec<Series> {
    let mut all = Vec::new();
    for (colour, (name, curve)) in by_strategy(points).into_iter().enumerate() {
        let runs = rows.iter().filter(|row| row.strategy == name);
        let dots = runs.map(|row| (row.rig_s, (values.of_row)(row))).collect();
        let line = curve.iter().map(|point| (point.rig_s, (values.of_point)(point))).collect();
        let foretold = curve
            .iter()
            .filter_map(|point| Some((point.foretold.rig_s, (values.foretold)(point)?)))
            .collect();
        all.push(series("", colour, Stroke::Dots, dots));
        all.push(series(name, colour, Stroke::Line, line));
        all.push(series(&format!("{name}, foretold"), colour, Stroke::Dashes, foretold));
    }
    all
}

/// The way's limit, the photons' where it is in sight, and the front.
fn limits(points: &[FrontierPoint]) -> Vec<Series> {
    let mut all = Vec::new();
    let mut front = Vec::new();
    let is_in_sight = are_photons_in_sight(points);
    for (colour, (name, curve)) in by_strategy(points).into_iter().enumerate() {
        let way = curve.iter().map(|point| (point.foretold.way_s, point.shape[1])).collect();
        all.push(series(&format!("{name}, its way alone"), colour, Stroke::Dotted, way));
        if is_in_sight {
            let photons =
                curve.iter().filter_map(|point| Some((point.rig_s, photon_limit(point)?)));
            let name = format!("{name}, its photons alone");
            all.push(series(&name, colour, Stroke::Dotted, photons.collect()));
        }
        let best = curve.iter().filter(|point| point.is_on_front);
        front.push(series(
            "",
            colour,
            Stroke::Halos,
            best.map(|p| (p.rig_s, p.shape[1])).collect(),
        ));
    }
    all.extend(front);
    all
}

fn photon_limit(point: &FrontierPoint) -> Option<f64> {
    point.foretold.uncertainty.map(|u| u.photon_limit)
}

/// Whether the photons' limit is near enough to what was reached to stand in the same picture.
fn are_photons_in_sight(points: &[FrontierPoint]) -> bool {
    let lowest = points.iter().map(|point| point.shape[1]).fold(f64::INFINITY, f64::min);
    points.iter().filter_map(photon_limit).any(|limit| limit >= IN_SIGHT * lowest)
}

/// In words, for the caption.
fn photons(points: &[FrontierPoint]) -> String {
    let limits = points.iter().filter_map(photon_limit);
    let ends = limits.fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
    match ends {
        (low, high) if low > high => String::new(),
        (low, high) => format!(
            " The photons of the dwells alone would leave {low:.1e} to {high:.1e}{}.",
            if are_photons_in_sight(points) { ", dotted too" } else { ", far below" }
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::{Foretold, points};

    fn row(strategy: &str, rig_s: f64, error: f64) -> FrontierRow {
        let foretold = Foretold { rig_s, way_s: 0.5 * rig_s, dwelling_s: 1.0, uncertainty: None };
        FrontierRow {
            scene: "luminaire".into(),
            strategy: strategy.into(),
            parameters: format!("{rig_s}"),
            seed: 1,
            rig_s,
            readings: 10,
            error_radiance_rms_relative: error,
            error_exitance_relative: error,
            error_flux_relative: error,
            u_exitance_relative: error,
            error_shape_rms_relative: error,
            error_exitance_shape_relative: -error,
            foretold,
            compute_s: 0.1,
        }
    }

    #[test]
    fn the_pictures_name_axes_and_strategies_and_survive_zero_errors() {
        let rows =
            [row("sweep", 10.0, 0.1), row("sweep", 100.0, 0.01), row("stop-and-go", 300.0, 0.0)];
        let pictures = frontier_pictures("luminaire", &rows, &points(&rows));
        assert_eq!(pictures.len(), 2);
        let svg = &pictures[0].svg;
        assert!(svg.contains("rig time / s") && svg.contains("sweep, its way alone"), "{svg}");
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    }
}
