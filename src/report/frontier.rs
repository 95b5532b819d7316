//! Error against rig time on logarithmic axes, one curve a quantity.

use kuva::plot::{LegendPosition, LinePlot, ScatterPlot};
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

use crate::study::FrontierPoint;

const RADIANCE: &str = "#1f5fa8";
const SHAPE: &str = "#2a8a4a";
const EXITANCE: &str = "#c0392b";

/// An SVG document: the relative error of the radiance (median over the seeds, with the range),
/// of its shape, and of the exitance (RMS over the seeds), against rig time in seconds. Points
/// whose error is zero have no place on a logarithmic axis and are left out.
pub fn frontier_svg(title: &str, points: &[FrontierPoint]) -> String {
    let mut plots: Vec<Plot> = Vec::new();
    let mut curve = |color: &str, name: &str, values: Vec<(f64, [f64; 3])>| {
        let values: Vec<_> = values.into_iter().filter(|(_, [low, ..])| *low > 0.0).collect();
        let line: Vec<(f64, f64)> =
            values.iter().map(|(t, [_, middle, _])| (*t, *middle)).collect();
        let range = values.iter().map(|(_, [low, middle, high])| (middle - low, high - middle));
        let marks = ScatterPlot::new()
            .with_data(line.clone())
            .with_color(color)
            .with_size(3.5)
            .with_y_err_asymmetric(range);
        let line = LinePlot::new().with_data(line).with_color(color).with_stroke_width(1.8);
        plots.push(line.with_legend(name).into());
        plots.push(marks.into());
    };
    let over = |value: fn(&FrontierPoint) -> [f64; 3]| {
        points.iter().map(|point| (point.rig_s, value(point))).collect::<Vec<_>>()
    };
    curve(RADIANCE, "radiance, RMS over the region", over(|p| p.radiance));
    curve(SHAPE, "the same without the common scale", over(|p| p.shape));
    curve(EXITANCE, "exitance, RMS over the seeds", over(|p| [p.exitance_rms; 3]));
    let times = points.iter().map(|point| point.rig_s);
    let errors = points.iter().flat_map(|p| [p.radiance, p.shape, [p.exitance_rms; 3]].concat());
    let (time, error) = (axis(times), axis(errors));
    // Errors fall with time: the upper right is empty.
    let layout = Layout::auto_from_plots(&plots)
        .with_title(title)
        .with_x_axis_min(time.0)
        .with_x_axis_max(time.1)
        .with_y_axis_min(error.0)
        .with_y_axis_max(error.1)
        .with_x_label("rig time / s")
        .with_y_label("relative error")
        .with_log_x()
        .with_log_y()
        .with_legend_position(LegendPosition::InsideTopRight);
    kuva::render_to_svg(plots, layout)
}

/// The ends of a logarithmic axis that holds all positive values: 1, 2 or 5 times a power of ten.
fn axis(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .filter(|value| *value > 0.0 && value.is_finite())
        .fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
    if high <= 0.0 {
        return (0.1, 1.0);
    }
    let decade = |value: f64| libm::exp10(libm::floor(libm::log10(value)));
    let below = [5.0, 2.0].map(|m| m * decade(low)).into_iter().find(|end| *end < low);
    let above = [1.0, 2.0, 5.0].map(|m| m * decade(high)).into_iter().find(|end| *end > high);
    (below.unwrap_or(decade(low)), above.unwrap_or(10.0 * decade(high)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_ends_at_round_numbers_beyond_the_values() {
        let (low, high) = axis([288.0, 1104.0, 0.0].into_iter());
        assert!((low - 200.0).abs() < 1e-9 && (high - 2000.0).abs() < 1e-9, "{low} {high}");
    }

    #[test]
    fn the_picture_names_its_axes_and_survives_zero_errors() {
        let point = |rig_s: f64, error: f64| FrontierPoint {
            parameters: String::new(),
            rig_s,
            radiance: [error; 3],
            shape: [0.0; 3],
            exitance_rms: error,
        };
        let svg = frontier_svg("luminaire", &[point(10.0, 0.1), point(100.0, 0.01)]);
        assert!(svg.starts_with("<svg") || svg.starts_with("<?xml"), "{svg}");
        assert!(svg.contains("rig time / s") && svg.contains("luminaire"));
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    }
}
