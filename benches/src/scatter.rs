//! Points on two logarithmic axes, in groups, with levels drawn across. It does not know what they
//! are of.

use std::sync::Arc;

use kuva::backend::svg::SvgBackend;
use kuva::plot::{LinePlot, MarkerShape, ScatterPlot};
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;
use kuva::render::render::render_multiple;

/// Points of one colour.
pub struct Group {
    /// In the legend.
    pub name: String,
    /// Both above zero.
    pub points: Vec<(f64, f64)>,
}

/// A figure.
pub struct Scatter {
    /// Above it.
    pub title: String,
    /// Below the abscissa.
    pub x_label: String,
    /// Beside the ordinate.
    pub y_label: String,
    /// Lines across, at these ordinates.
    pub levels: Vec<f64>,
    /// In the order of the legend.
    pub groups: Vec<Group>,
}

/// Told apart in print and by most eyes (Okabe and Ito 2008).
const COLORS: [&str; 5] = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00"];
const MARKERS: [MarkerShape; 4] =
    [MarkerShape::Circle, MarkerShape::Square, MarkerShape::Triangle, MarkerShape::Diamond];

impl Scatter {
    /// As an SVG document.
    pub fn svg(&self) -> String {
        let all = || self.groups.iter().flat_map(|group| &group.points);
        let x = decades(all().map(|(x, _)| *x));
        let y = decades(all().map(|(_, y)| *y).chain(self.levels.iter().copied()));
        let mut plots: Vec<Plot> = Vec::new();
        for level in &self.levels {
            let at = libm::log10(*level);
            let line = LinePlot::new().with_data(vec![(x.0, at), (x.1, at)]).with_color("#555555");
            plots.push(line.with_stroke_width(1.2).with_dashed().into());
        }
        for (i, group) in self.groups.iter().enumerate() {
            let points = group.points.iter().map(|(x, y)| (libm::log10(*x), libm::log10(*y)));
            let points: Vec<(f64, f64)> = points.collect();
            let marks = ScatterPlot::new()
                .with_data(points)
                .with_color(COLORS[i % COLORS.len()])
                .with_marker(MARKERS[i % MARKERS.len()])
                .with_size(4.0)
                .with_legend(&group.name);
            plots.push(marks.into());
        }
        // The plot library ends a logarithmic axis at 1e-10: these are drawn by their exponents.
        let power = |exponent: f64| format!("1e{exponent:.0}");
        let layout = Layout::auto_from_plots(&plots)
            .with_title(self.title.clone())
            .with_title_size(15)
            .with_label_size(13)
            .with_tick_size(11)
            .with_x_label(self.x_label.clone())
            .with_y_label(self.y_label.clone())
            .with_x_axis_min(x.0)
            .with_x_axis_max(x.1)
            .with_y_axis_min(y.0)
            .with_y_axis_max(y.1)
            .with_x_tick_step(1.0)
            .with_y_tick_step(1.0)
            .with_x_tick_format(TickFormat::Custom(Arc::new(power)))
            .with_y_tick_format(TickFormat::Custom(Arc::new(power)));
        SvgBackend.render_scene(&render_multiple(plots, layout))
    }
}

/// The exponents of whole decades around all values.
fn decades(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .fold((f64::INFINITY, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
    if high <= 0.0 {
        return (0.0, 1.0);
    }
    let (low, high) = (libm::floor(libm::log10(low)), libm::ceil(libm::log10(high)));
    (low, high.max(low + 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_group_is_named_and_every_point_has_a_place() {
        let group = |name: &str| Group { name: name.into(), points: vec![(1e-9, 3.0), (0.5, 1.0)] };
        let figure = Scatter {
            title: "all of them".into(),
            x_label: "across".into(),
            y_label: "up".into(),
            levels: vec![1.0, 100.0],
            groups: vec![group("first"), group("second")],
        };
        let svg = figure.svg();
        for word in ["all of them", "across", "up", "first", "second", "1e-9", "1e2"] {
            assert!(svg.contains(word), "{word} is missing");
        }
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        assert_eq!(decades([3e-9, 0.4].into_iter()), (-9.0, 0.0));
        assert_eq!(decades([1.0].into_iter()), (0.0, 1.0));
        assert_eq!(decades(core::iter::empty()), (0.0, 1.0));
    }
}
