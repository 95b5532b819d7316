//! Bars on a logarithmic axis, one a line, as SVG. It does not know what was measured.

use std::fmt::Write as _;

/// One bar.
pub struct Bar {
    /// To the left of it.
    pub name: String,
    /// Its length; what is not above [`Bars::floor`] has none.
    pub value: f64,
    /// At its end.
    pub label: String,
    /// Which colour it has.
    pub group: usize,
}

/// A chart.
pub struct Bars {
    /// Above it.
    pub title: String,
    /// Below the axis.
    pub axis: String,
    /// Where bars begin.
    pub floor: f64,
    /// What the colours mean.
    pub groups: Vec<String>,
    /// From top to bottom.
    pub bars: Vec<Bar>,
}

/// Told apart in print and by most eyes (Okabe and Ito 2008).
const COLORS: [&str; 5] = ["#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9"];

const ROW: f64 = 20.0;
const LEFT: f64 = 300.0;
const WIDTH: f64 = 460.0;
const RIGHT: f64 = 130.0;
const TOP: f64 = 66.0;
const BOTTOM: f64 = 48.0;

impl Bars {
    /// As an SVG document.
    pub fn svg(&self) -> String {
        let largest = self.bars.iter().map(|bar| bar.value).fold(self.floor, f64::max);
        let low = libm::log10(self.floor);
        let high = libm::ceil(libm::log10(largest)).max(low + 1.0);
        let at = |value: f64| {
            let part = (libm::log10(value.max(self.floor)) - low) / (high - low);
            LEFT + WIDTH * part
        };
        let height = TOP + ROW * self.bars.len() as f64 + BOTTOM;
        let bottom = height - BOTTOM;
        let width = LEFT + WIDTH + RIGHT;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
             font-family=\"sans-serif\" font-size=\"12\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
        );
        text(&mut svg, width / 2.0, 22.0, "middle", &self.title);
        self.legend(&mut svg);
        #[allow(clippy::cast_possible_truncation)] // a few decades
        for power in low as i32..=high as i32 {
            let x = at(libm::exp10(f64::from(power)));
            let _ = writeln!(
                svg,
                "<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{TOP}\" y2=\"{bottom}\" stroke=\"#ddd\"/>"
            );
            text(&mut svg, x, bottom + 16.0, "middle", &tick(power));
        }
        text(&mut svg, LEFT + WIDTH / 2.0, bottom + 36.0, "middle", &self.axis);
        for (i, bar) in self.bars.iter().enumerate() {
            let y = TOP + ROW * i as f64;
            text(&mut svg, LEFT - 8.0, y + 14.0, "end", &bar.name);
            let end = at(bar.value);
            let _ = writeln!(
                svg,
                "<rect x=\"{LEFT}\" y=\"{:.1}\" width=\"{:.1}\" height=\"14\" fill=\"{}\"/>",
                y + 3.0,
                end - LEFT,
                COLORS[bar.group % COLORS.len()]
            );
            text(&mut svg, end + 6.0, y + 14.0, "start", &bar.label);
        }
        svg + "</svg>\n"
    }

    fn legend(&self, svg: &mut String) {
        let mut x = LEFT;
        for (i, group) in self.groups.iter().enumerate() {
            let color = COLORS[i % COLORS.len()];
            let _ = writeln!(
                svg,
                "<rect x=\"{x}\" y=\"38\" width=\"12\" height=\"12\" fill=\"{color}\"/>"
            );
            text(svg, x + 18.0, 48.0, "start", group);
            x += 40.0 + 7.0 * group.chars().count() as f64;
        }
    }
}

/// Up to 10 000 in full.
fn tick(power: i32) -> String {
    if (-2..=4).contains(&power) {
        format!("{}", libm::exp10(f64::from(power)))
    } else {
        format!("1e{power}")
    }
}

fn text(svg: &mut String, x: f64, y: f64, anchor: &str, words: &str) {
    let words = words.replace('&', "&amp;").replace('<', "&lt;");
    let _ =
        writeln!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{words}</text>");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_are_as_long_as_their_logarithms() {
        let bar = |name: &str, value: f64| Bar {
            name: name.into(),
            value,
            label: format!("{value}"),
            group: 0,
        };
        let bars = Bars {
            title: "all".into(),
            axis: "ns".into(),
            floor: 1.0,
            groups: vec!["one".into()],
            bars: vec![bar("none", 0.0), bar("half", 10.0), bar("a < b", 100.0)],
        };
        let svg = bars.svg();
        for part in ["width=\"0.0\"", "width=\"230.0\"", "width=\"460.0\"", "a &lt; b"] {
            assert!(svg.contains(part), "{part} is missing from\n{svg}");
        }
    }
}
