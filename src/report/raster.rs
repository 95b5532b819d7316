//! Maps as coloured cells: runs of equal colour along a row become one stroke of one path, so that
//! a map is a few tens of kilobytes. And the colour bar beside it.

use std::fmt::Write as _;

use super::colour::{LEVELS, level, of_level};
use super::svg::{Anchor, Svg, px};
use super::ticks::Ticks;

/// What a cell shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Cell {
    /// Nothing is there.
    Outside,
    /// Something is there that nobody measured.
    Gap,
    /// A step of the colour map.
    Level(usize),
}

/// Where cells lie, in pixels; rows run downwards.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) cell: (f64, f64),
    pub(super) columns: usize,
    pub(super) rows: usize,
}

/// The ends of a colour bar: those of the values, and at least `least` apart, so that a map does
/// not paint what is smaller than its own uncertainty.
pub(super) fn ends(values: impl Iterator<Item = f64>, least: f64) -> (f64, f64) {
    let values = values.filter(|value| value.is_finite());
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return (0.0, 1.0);
    }
    let lacking = 0.5 * (least - (high - low)).max(0.0);
    if low >= high && lacking <= 0.0 {
        let margin = if low == 0.0 { 1.0 } else { 0.01 * low.abs() };
        return (low - margin, high + margin);
    }
    (low - lacking, high + lacking)
}

/// Draws the cells, row by row. `gap` is the fill of what was not measured.
pub(super) fn cells(svg: &mut Svg, frame: Frame, gap: &str, cell: impl Fn(usize, usize) -> Cell) {
    let mut gaps = String::new();
    let mut paths = vec![String::new(); LEVELS];
    for row in 0..frame.rows {
        let mut column = 0;
        while column < frame.columns {
            let shown = cell(column, row);
            let first = column;
            while column < frame.columns && cell(column, row) == shown {
                column += 1;
            }
            let path = match shown {
                Cell::Outside => continue,
                Cell::Gap => &mut gaps,
                Cell::Level(level) => &mut paths[level.min(LEVELS - 1)],
            };
            let (width, height) = frame.cell;
            let (x, y) = (frame.left + width * first as f64, frame.top + height * row as f64);
            let (run, height) = (px(width * (column - first) as f64), px(height));
            // Writing to a string does not fail.
            let _ = write!(path, "M{} {}h{run}v{height}h-{run}z", px(x), px(y));
        }
    }
    for (level, path) in paths.iter().enumerate().filter(|(_, path)| !path.is_empty()) {
        let fill = of_level(level);
        svg.path(&format!("fill=\"{fill}\" shape-rendering=\"crispEdges\""), path);
    }
    if !gaps.is_empty() {
        svg.path(&format!("class=\"gap\" fill=\"{gap}\""), &gaps);
    }
}

/// Defines a hatch by this name; its fill is `url(#name)`.
pub(super) fn hatch(svg: &mut Svg, name: &str) {
    svg.raw(&format!(
        "<defs><pattern id=\"{name}\" width=\"7\" height=\"7\" patternUnits=\"userSpaceOnUse\" \
         patternTransform=\"rotate(45)\"><rect class=\"paper\" width=\"7\" height=\"7\"/>\
         <path class=\"axis\" stroke-opacity=\".55\" d=\"M0 0V7\"/></pattern></defs>"
    ));
}

/// A colour bar with its top at a point, its unit above it and its ticks to the right.
pub(super) fn bar(svg: &mut Svg, (x, top): (f64, f64), height: f64, ends: (f64, f64), unit: &str) {
    const WIDTH: f64 = 14.0;
    let step = height / LEVELS as f64;
    for shown in 0..LEVELS {
        let y = top + step * (LEVELS - 1 - shown) as f64;
        let (fill, y, h) = (of_level(shown), px(y), px(step + 0.3));
        let x = px(x);
        svg.raw(&format!("<rect shape-rendering=\"crispEdges\" fill=\"{fill}\" x=\"{x}\" y=\"{y}\" width=\"{WIDTH}\" height=\"{h}\"/>"));
    }
    let ticks = Ticks::within(ends, 5);
    for &value in &ticks.at {
        let part = if ends.1 > ends.0 { (value - ends.0) / (ends.1 - ends.0) } else { 0.5 };
        let y = top + height * (1.0 - part);
        svg.line("axis", (x + WIDTH, y), (x + WIDTH + 4.0, y));
        svg.label("", Anchor::Start, (x + WIDTH + 7.0, y), &ticks.label(value));
    }
    svg.label("", Anchor::Start, (x, top - 16.0), &ticks.unit(unit));
}

/// The cell of a value.
pub(super) fn shown(value: f64, ends: (f64, f64)) -> Cell {
    if value.is_finite() { Cell::Level(level(value, ends)) } else { Cell::Gap }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_one_colour_are_one_stroke() {
        let frame = Frame { left: 0.0, top: 0.0, cell: (2.0, 3.0), columns: 4, rows: 1 };
        let mut svg = Svg::new(8.0, 3.0, "");
        cells(&mut svg, frame, "url(#h)", |column, _| match column {
            0 => Cell::Outside,
            1 => Cell::Gap,
            _ => Cell::Level(0),
        });
        let text = svg.finish();
        assert!(text.contains("d=\"M4 0h4v3h-4z\""), "{text}");
        assert!(text.contains("class=\"gap\" fill=\"url(#h)\" d=\"M2 0h2v3h-2z\""), "{text}");
    }

    #[test]
    fn a_bar_is_never_narrower_than_asked() {
        assert_eq!(ends([1.0, 2.0].into_iter(), 0.5), (1.0, 2.0));
        assert_eq!(ends([1.0, 2.0].into_iter(), 3.0), (0.0, 3.0));
        assert_eq!(ends([f64::NAN].into_iter(), 0.0), (0.0, 1.0));
        let (low, high) = ends([5.0].into_iter(), 0.0);
        assert!(low < 5.0 && high > 5.0);
    }
}
