//! How honest stated uncertainties are: for every cell of a study, how many of its 95 % intervals
//! hold the truth against the RMS of error over u.

use kuva::plot::annotations::ReferenceLine;
use kuva::plot::scatter::MarkerShape;
use kuva::plot::{LegendPosition, ScatterPlot};
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

/// Cells that belong together.
#[derive(Debug, Clone)]
pub struct Cells {
    /// As the legend names them.
    pub name: String,
    /// Drawn with a cross rather than a dot.
    pub is_cross: bool,
    /// RMS of error over u, and the part of the intervals that hold the truth.
    pub cells: Vec<(f64, f64)>,
}

const COLOURS: [&str; 7] =
    ["#1f5fa8", "#2a8a4a", "#c0392b", "#8e44ad", "#d68910", "#117a8b", "#7f5539"];

/// An SVG document. `band`: the parts between which 99.9 % of honest cells lie. An honest cell lies at
/// 1 and 95 %; to the right of it and below, u is too small.
pub fn scores_svg(title: &str, cells: &[Cells], band: (f64, f64)) -> String {
    let highest = cells.iter().flat_map(|c| &c.cells).map(|(rms, _)| *rms).fold(1.2, f64::max);
    let lowest = cells.iter().flat_map(|c| &c.cells).map(|(_, part)| *part).fold(0.9, f64::min);
    let plots: Vec<Plot> = cells
        .iter()
        .zip(COLOURS.iter().cycle())
        .map(|(group, colour)| {
            let marker = if group.is_cross { MarkerShape::Cross } else { MarkerShape::Circle };
            ScatterPlot::new()
                .with_data(group.cells.iter().map(|(rms, part)| (*rms, 100.0 * part)))
                .with_color(*colour)
                .with_marker(marker)
                .with_size(3.0)
                .with_marker_opacity(0.7)
                .with_legend(group.name.clone())
                .into()
        })
        .collect();
    let line = |at: f64| ReferenceLine::horizontal(100.0 * at).with_color("#888888");
    let layout = Layout::auto_from_plots(&plots)
        .with_title(title)
        .with_x_label("RMS of (value - truth)/u")
        .with_y_label("95 % intervals that hold the truth / %")
        .with_x_axis_min(0.0)
        .with_x_axis_max(libm::ceil(5.0 * highest) / 5.0)
        .with_y_axis_min(libm::floor(10.0 * lowest) * 10.0)
        .with_y_axis_max(100.0)
        .with_reference_line(line(band.0))
        .with_reference_line(line(band.1))
        .with_reference_line(ReferenceLine::vertical(1.0).with_color("#888888"))
        .with_legend_position(LegendPosition::OutsideRightTop);
    kuva::render_to_svg(plots, layout)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_picture_names_its_cells() {
        let cells = |name: &str, is_cross| Cells {
            name: name.into(),
            is_cross,
            cells: vec![(1.0, 0.95), (2.4, 0.4)],
        };
        let svg =
            scores_svg("coverage", &[cells("lobe", false), cells("batwing", true)], (0.9, 1.0));
        assert!(svg.starts_with("<svg") || svg.starts_with("<?xml"), "{svg}");
        assert!(svg.contains("lobe") && svg.contains("batwing") && !svg.contains("NaN"), "{svg}");
    }
}
