//! Error against time on logarithmic axes, a panel a problem. It does not know how it was measured.

use std::sync::Arc;

use kuva::backend::svg::SvgBackend;
use kuva::plot::{LegendEntry, LegendShape, LinePlot, MarkerShape, ScatterPlot};
use kuva::render::figure::Figure;
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;

/// A curve, or a single mark.
pub struct Curve {
    /// In the legend; curves of one name share a colour across panels.
    pub name: String,
    /// Seconds and relative error; an error of 0 stands on [`FLOOR`].
    pub points: Vec<(f64, f64)>,
    /// By a line, as the efforts of one method are; cases of their own are not.
    pub is_joined: bool,
}

/// One problem.
pub struct Panel {
    /// Above it.
    pub title: String,
    /// What is compared.
    pub curves: Vec<Curve>,
}

/// Errors below half a unit in the last place stand here.
pub const FLOOR: f64 = 1e-16;

/// Told apart in print and by most eyes (Okabe and Ito 2008), in the order of first appearance.
const COLORS: [&str; 8] =
    ["#000000", "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C510A"];
const MARKERS: [MarkerShape; 4] =
    [MarkerShape::Circle, MarkerShape::Square, MarkerShape::Triangle, MarkerShape::Diamond];

/// An SVG document with all panels on the same axes, `columns` of them beside each other.
pub fn error_against_time(title: &str, panels: &[Panel], columns: usize) -> String {
    let mut names: Vec<&str> = Vec::new();
    for curve in panels.iter().flat_map(|panel| &panel.curves) {
        if !names.contains(&curve.name.as_str()) {
            names.push(&curve.name);
        }
    }
    let style = |name: &str| {
        let place = names.iter().position(|known| *known == name).unwrap_or_default();
        (COLORS[place % COLORS.len()], MARKERS[place % MARKERS.len()])
    };
    let legend = names.iter().map(|name| {
        let (color, marker) = style(name);
        LegendEntry {
            label: (*name).to_owned(),
            color: color.to_owned(),
            shape: LegendShape::Marker(marker),
            dasharray: None,
        }
    });
    let times = panels.iter().flat_map(|panel| &panel.curves).flat_map(|curve| &curve.points);
    let ends =
        times.fold((f64::INFINITY, 0.0_f64), |(low, high), (s, _)| (low.min(*s), high.max(*s)));
    let plots: Vec<Vec<Plot>> = panels.iter().map(|panel| plots(panel, &style)).collect();
    let layouts = panels.iter().zip(&plots).map(|(panel, plots)| layout(panel, plots, ends));
    let layouts: Vec<Layout> = layouts.collect();
    let figure = Figure::new(panels.len().div_ceil(columns), columns)
        .with_title(title)
        .with_plots(plots)
        .with_layouts(layouts)
        .with_cell_size(430.0, 330.0)
        .with_shared_legend_entries(legend.collect())
        .with_shared_legend_bottom();
    SvgBackend.render_scene(&figure.render())
}

fn plots<'a>(panel: &Panel, style: &impl Fn(&str) -> (&'a str, MarkerShape)) -> Vec<Plot> {
    let mut plots: Vec<Plot> = Vec::new();
    for curve in &panel.curves {
        let (color, marker) = style(&curve.name);
        let points: Vec<(f64, f64)> =
            curve.points.iter().map(|(s, error)| (*s, libm::log10(error.max(FLOOR)))).collect();
        let single = points.len() == 1;
        if curve.is_joined {
            let line = LinePlot::new().with_data(points.clone()).with_color(color);
            plots.push(line.with_stroke_width(1.6).into());
        }
        let marks = ScatterPlot::new().with_data(points).with_color(color).with_marker(marker);
        plots.push(marks.with_size(if single { 6.5 } else { 3.5 }).into());
    }
    plots
}

fn layout(panel: &Panel, plots: &[Plot], (first_s, last_s): (f64, f64)) -> Layout {
    // The plot library ends a logarithmic axis at 1e-10: this one is drawn by its exponents.
    let power = |value: f64| format!("1e{:.0}", libm::log10(value));
    let exponent = |value: f64| format!("1e{value:.0}");
    Layout::auto_from_plots(plots)
        .with_title(panel.title.clone())
        .with_title_size(15)
        .with_label_size(13)
        .with_tick_size(11)
        .with_x_label("time per value / s")
        .with_y_label("relative error")
        .with_x_axis_min(libm::exp10(libm::floor(libm::log10(first_s))))
        .with_x_axis_max(libm::exp10(libm::ceil(libm::log10(last_s))))
        .with_y_axis_min(libm::log10(FLOOR) - 1.0)
        .with_y_axis_max(1.0)
        .with_y_tick_step(2.0)
        .with_log_x()
        .with_x_tick_format(TickFormat::Custom(Arc::new(power)))
        .with_y_tick_format(TickFormat::Custom(Arc::new(exponent)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_zero_have_a_place_and_every_curve_a_name() {
        let curve = |name: &str| Curve {
            name: name.into(),
            points: vec![(1e-7, 0.0), (1e-3, 1e-2)],
            is_joined: true,
        };
        let panel =
            Panel { title: "a square".into(), curves: vec![curve("closed"), curve("dice")] };
        let svg = error_against_time("all", &[panel], 1);
        for word in ["a square", "closed", "dice", "relative error", "time per value"] {
            assert!(svg.contains(word), "{word} is missing");
        }
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }
}
