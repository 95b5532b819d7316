//! Diagrams of one number over another: marks, lines and error bars on plain or logarithmic axes.
//! The one place of this room that knows the plotting library. That writes fixed colours, white
//! paper and a fixed size; what it drew is dressed here in the page's own colours, so that it can
//! be read on dark paper too.

use std::sync::Arc;

use kuva::plot::{LegendPosition, LinePlot, ScatterPlot};
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;
use kuva::render::theme::Theme;

use super::svg::{Picture, escape};
use super::ticks::{Ticks, round_down_1_2_5, round_up_1_2_5};

/// Marks of a series at most: with more, every so many-th is drawn and the extremes.
const MARKS_MAX: usize = 800;
const WIDTH: f64 = 820.0;
/// Of a diagram of something over time.
const HEIGHT: f64 = 260.0;
/// Of one with powers on both axes.
const HEIGHT_LOGARITHMIC: f64 = 420.0;
/// Placeholders that no plot draws by itself, and what they become.
const COLOURS: [(&str, &str); 7] = [
    ("#010203", "var(--ink)"),
    ("#010204", "var(--grid)"),
    ("#010205", "var(--paper)"),
    ("#01020a", "var(--a)"),
    ("#01020b", "var(--b)"),
    ("#01020c", "var(--c)"),
    ("#01020d", "var(--d)"),
];
/// Of these, the first that is a series'.
const FIRST_SERIES: usize = 3;
/// What is no series, a line to compare with: in the ink of the axes.
pub const INK: usize = usize::MAX;

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stroke {
    /// Dots.
    Dots,
    /// Larger dots with error bars, if it has errors.
    Points,
    /// A line.
    Line,
    /// A dashed line.
    Dashes,
    /// A dotted line.
    Dotted,
    /// Large pale dots: marks round others that are drawn later.
    Halos,
}

/// A series of points.
#[derive(Debug, Clone)]
pub struct Series {
    /// Its name in the legend; empty for none.
    pub name: String,
    /// Which of the four colours, from 0.
    pub colour: usize,
    /// How it is drawn.
    pub stroke: Stroke,
    /// The points.
    pub points: Vec<(f64, f64)>,
    /// Half lengths of error bars, one a point; or none at all.
    pub errors: Vec<f64>,
}

/// A diagram.
#[derive(Debug, Clone)]
pub struct Chart {
    /// A name for files and anchors.
    pub name: &'static str,
    /// What it shows.
    pub title: String,
    /// How to read it.
    pub caption: String,
    /// With its unit.
    pub x_label: String,
    /// With its unit.
    pub y_label: String,
    /// Whether both axes are logarithmic: what is not above zero is not drawn then.
    pub is_logarithmic: bool,
    /// What is drawn, the first at the bottom.
    pub series: Vec<Series>,
}

impl Chart {
    /// The diagram; `None` where there is no point to draw.
    pub fn picture(mut self) -> Option<Picture> {
        let is_logarithmic = self.is_logarithmic;
        let fits = |v: f64| v.is_finite() && (v > 0.0 || !is_logarithmic);
        let mut notes = String::new();
        for series in &mut self.series {
            series.keep(|x, y| fits(x) && fits(y));
            if let Some(note) = series.thin() {
                notes.push_str(&note);
            }
        }
        self.series.retain(|series| !series.points.is_empty());
        if self.series.is_empty() {
            return None;
        }
        let svg = self.draw();
        let caption = format!("{}{notes}", self.caption);
        Some(Picture { name: self.name, title: self.title, caption, svg })
    }

    fn draw(&self) -> String {
        let points = || self.series.iter().flat_map(|series| series.points.iter());
        let (x, y) = (self.axis(points().map(|p| p.0)), self.axis(self.heights()));
        let has_legend = self.series.iter().any(|series| !series.name.is_empty());
        let plots: Vec<Plot> = self.series.iter().flat_map(Series::plots).collect();
        let mut layout = Layout::auto_from_plots(&plots)
            .with_width(WIDTH)
            .with_height(if self.is_logarithmic { HEIGHT_LOGARITHMIC } else { HEIGHT })
            .with_theme(theme())
            .with_x_label(self.x_label.clone())
            .with_y_label(self.y_label.clone())
            .with_x_axis_min(x.0)
            .with_x_axis_max(x.1)
            .with_y_axis_min(y.0)
            .with_y_axis_max(y.1)
            .with_x_tick_format(ticks(x, self.is_logarithmic))
            .with_y_tick_format(ticks(y, self.is_logarithmic));
        if self.is_logarithmic {
            layout = layout.with_log_x().with_log_y();
        }
        if has_legend {
            layout = layout.with_legend_position(LegendPosition::OutsideRightTop);
        }
        dressed(&kuva::render_to_svg(plots, layout), self.name, &self.title)
    }

    /// Values with the ends of their error bars.
    fn heights(&self) -> impl Iterator<Item = f64> {
        self.series.iter().flat_map(|series| {
            let bar = |i: usize| series.errors.get(i).copied().unwrap_or(0.0);
            series.points.iter().enumerate().flat_map(move |(i, p)| [p.1 - bar(i), p.1 + bar(i)])
        })
    }

    /// The ends of an axis that holds all values, with some room.
    fn axis(&self, values: impl Iterator<Item = f64>) -> (f64, f64) {
        let (low, high) = values
            .filter(|v| *v > 0.0 || !self.is_logarithmic)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        if self.is_logarithmic {
            return (round_down_1_2_5(0.97 * low), round_up_1_2_5(high));
        }
        let span = high - low;
        let room = if span > 0.0 { 0.05 * span } else { (0.05 * low.abs()).max(1e-12) };
        (low - room, high + room)
    }
}

impl Series {
    fn keep(&mut self, fits: impl Fn(f64, f64) -> bool) {
        let kept = |i: usize| fits(self.points[i].0, self.points[i].1);
        let kept: Vec<usize> = (0..self.points.len()).filter(|i| kept(*i)).collect();
        self.pick(&kept);
    }

    /// Leaves out what is too many to be seen, and says so. The lowest and the highest stay.
    fn thin(&mut self) -> Option<String> {
        let all = self.points.len();
        let stride = all.div_ceil(MARKS_MAX);
        if stride <= 1 {
            return None;
        }
        let by_height = |a: &usize, b: &usize| self.points[*a].1.total_cmp(&self.points[*b].1);
        let ends = [(0..all).min_by(by_height), (0..all).max_by(by_height)];
        let mut kept: Vec<usize> =
            (0..all).step_by(stride).chain(ends.into_iter().flatten()).collect();
        kept.sort_unstable();
        kept.dedup();
        self.pick(&kept);
        let name = if self.name.is_empty() { "points" } else { &self.name };
        Some(format!(" Of {all} {name} one in {stride} is drawn, with the lowest and the highest."))
    }

    fn pick(&mut self, kept: &[usize]) {
        if kept.len() == self.points.len() {
            return;
        }
        self.points = kept.iter().map(|&i| self.points[i]).collect();
        if !self.errors.is_empty() {
            self.errors = kept.iter().filter_map(|&i| self.errors.get(i).copied()).collect();
        }
    }

    fn plots(&self) -> Vec<Plot> {
        let place = match self.colour {
            INK => 0,
            colour => FIRST_SERIES + colour % (COLOURS.len() - FIRST_SERIES),
        };
        let colour = COLOURS[place].0;
        let points = self.points.iter().copied();
        match self.stroke {
            Stroke::Dots | Stroke::Points => {
                let size = if self.stroke == Stroke::Dots { 1.8 } else { 3.0 };
                let marks = ScatterPlot::new().with_data(points).with_color(colour).with_size(size);
                let marks = if self.name.is_empty() {
                    marks
                } else {
                    marks.with_legend(self.name.as_str())
                };
                let has_errors = self.errors.len() == self.points.len();
                let marks =
                    if has_errors { marks.with_y_err(self.errors.iter().copied()) } else { marks };
                vec![marks.into()]
            }
            Stroke::Halos => {
                let marks = ScatterPlot::new().with_data(points).with_color(colour);
                let marks = marks.with_size(8.0).with_marker_opacity(0.3);
                let marks =
                    if self.name.is_empty() { marks } else { marks.with_legend(&*self.name) };
                vec![marks.into()]
            }
            Stroke::Line | Stroke::Dashes | Stroke::Dotted => {
                let line =
                    LinePlot::new().with_data(points).with_color(colour).with_stroke_width(1.6);
                let line = match self.stroke {
                    Stroke::Dashes => line.with_dashed(),
                    Stroke::Dotted => line.with_dotted(),
                    _ => line,
                };
                let line =
                    if self.name.is_empty() { line } else { line.with_legend(self.name.as_str()) };
                vec![line.into()]
            }
        }
    }
}

fn theme() -> Theme {
    let [ink, grid, paper] = [0, 1, 2].map(|i: usize| COLOURS[i].0.to_owned());
    Theme {
        background: paper.clone(),
        axis_color: ink.clone(),
        grid_color: grid.clone(),
        tick_color: ink.clone(),
        text_color: ink,
        legend_bg: paper,
        legend_border: grid,
        ..Theme::light()
    }
}

/// Labels with as many decimals as tell neighbours apart.
fn ticks(ends: (f64, f64), is_logarithmic: bool) -> TickFormat {
    if is_logarithmic {
        return TickFormat::Custom(Arc::new(|value| super::ticks::significant(value, 1)));
    }
    // The library's steps are its own, and may be 2.5 times a power of ten.
    let ticks = Ticks::plain(ends, 40);
    TickFormat::Custom(Arc::new(move |value| {
        let label = ticks.label(value);
        if !label.contains('.') {
            return label;
        }
        label.trim_end_matches('0').trim_end_matches('.').to_owned()
    }))
}

/// What the library drew, in the page's colours and with names that no other picture has.
fn dressed(svg: &str, name: &str, title: &str) -> String {
    let mut svg = svg.to_owned();
    for (placeholder, colour) in COLOURS {
        svg = svg.replace(placeholder, colour);
    }
    // The version of the library would make other bytes of the same picture.
    if let (Some(from), Some(to)) = (svg.find("<!--"), svg.find("-->")) {
        svg.replace_range(from..to + 3, "");
    }
    let svg = svg.replace("kuva-", &format!("{name}-"));
    let size = |key: &str| {
        let from = svg.find(&format!("{key}=\""))? + key.len() + 2;
        svg[from..].split('"').next()
    };
    let view = match (size("width"), size("height")) {
        (Some(width), Some(height)) => format!(" viewBox=\"0 0 {width} {height}\""),
        _ => String::new(),
    };
    let label = escape(title);
    let root = format!("<svg class=\"picture\" role=\"img\" aria-label=\"{label}\"{view} ");
    svg.replacen("<svg ", &root, 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>) -> Chart {
        let series = Series {
            name: "readings".to_owned(),
            colour: 0,
            stroke: Stroke::Dots,
            points,
            errors: Vec::new(),
        };
        Chart {
            name: "test",
            title: "A <test>".to_owned(),
            caption: "Read it.".to_owned(),
            x_label: "time / s".to_owned(),
            y_label: "value".to_owned(),
            is_logarithmic: false,
            series: vec![series],
        }
    }

    #[test]
    fn what_was_drawn_has_the_pages_colours_and_names_of_its_own() {
        let picture = chart(vec![(0.0, 1.0), (1.0, 2.0)]).picture().unwrap();
        let svg = &picture.svg;
        assert!(svg.contains("var(--a)") && svg.contains("var(--ink)") && svg.contains("viewBox"));
        for left in ["#0102", "kuva", "white", "<test>", "black"] {
            assert!(!svg.contains(left), "{left} in {svg}");
        }
    }

    #[test]
    fn many_points_are_thinned_openly_and_extremes_stay() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|i| (f64::from(i), 1.0)).collect();
        points[77_777].1 = 5.0;
        let mut thinned = chart(points);
        let note = thinned.series[0].thin().unwrap();
        assert!(note.contains("100000 readings one in 125 is"), "{note}");
        assert!(thinned.series[0].points.len() <= MARKS_MAX + 2);
        assert!(thinned.series[0].points.contains(&(77_777.0, 5.0)));
    }

    #[test]
    fn nothing_to_draw_is_no_picture() {
        assert_eq!(chart(vec![(f64::NAN, 1.0)]).picture(), None);
        let mut dark = chart(vec![(1.0, 0.0)]);
        dark.is_logarithmic = true;
        assert_eq!(dark.picture(), None);
        assert!(chart(vec![(1.0, 1.0)]).picture().is_some(), "one point has an axis");
    }
}
