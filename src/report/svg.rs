//! An SVG document as text, element by element. Everything that comes from outside is escaped;
//! numbers are written with two decimals, so that the same picture is the same bytes.

use std::fmt::Write as _;

/// What a picture's classes mean, on light and on dark paper and in print.
pub(super) const STYLE: &str = "\
:root{color-scheme:light dark;--ink:#1b1f24;--soft:#57606a;--grid:#d5dae0;--paper:#fff;--a:#1f6fb8;\
--b:#c8601a;--c:#238a55;--d:#8a4fb0}\
@media (prefers-color-scheme:dark){:root{--ink:#e4e8ec;--soft:#9aa5b1;--grid:#3a424c;--paper:#14181d;\
--a:#62a8ea;--b:#ec9350;--c:#57c48b;--d:#bd8ae0}}\
@media print{:root{color-scheme:light;--ink:#000;--soft:#444;--grid:#ccc;--paper:#fff;--a:#1f6fb8;\
--b:#c8601a;--c:#238a55;--d:#8a4fb0}}\
.picture{font-family:system-ui,'DejaVu Sans',Verdana,Arial,sans-serif;font-size:12px;color:var(--ink)}\
.picture text{fill:var(--ink)}.picture .soft{fill:var(--soft)}\
.picture .grid{stroke:var(--grid);fill:none}.picture .axis{stroke:var(--ink);fill:none}\
.picture .over{stroke:#fff;stroke-opacity:.4;fill:none}\
.picture .halo{paint-order:stroke;stroke:var(--paper);stroke-width:3px;stroke-linejoin:round}\
.picture .paper{fill:var(--paper)}.picture .heading{font-weight:600}";

/// A picture, ready to stand in a page or in a file of its own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// A name for files and anchors: lower-case letters and hyphens.
    pub name: &'static str,
    /// What it shows, in a few words.
    pub title: String,
    /// How to read it: units, what was left out, what the marks are.
    pub caption: String,
    /// The `<svg>` element.
    pub svg: String,
}

impl Picture {
    /// A document of its own: the element with its style inside it.
    pub fn document(&self) -> String {
        let style = format!("><style>{STYLE}</style>");
        // The root's own tag is the first to end.
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{}\n",
            self.svg.replacen('>', &style, 1)
        )
    }
}

/// Text that can stand between tags and in quoted attributes. What XML has no place for (most
/// control characters) becomes U+FFFD.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            '\t' | '\n' | '\r' => escaped.push(c),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}

/// A coordinate, to a hundredth of a pixel.
pub(super) fn px(x: f64) -> String {
    let text = format!("{x:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// Where a text stands about its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

impl Anchor {
    const fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Middle => "middle",
            Self::End => "end",
        }
    }
}

/// An `<svg>` element in the making.
#[derive(Debug)]
pub(super) struct Svg {
    text: String,
}

impl Svg {
    /// An empty one of this size in pixels; `label` is what a screen reader says.
    pub(super) fn new(width: f64, height: f64, label: &str) -> Self {
        let (width, height) = (px(width), px(height));
        let text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"picture\" role=\"img\" \
             aria-label=\"{}\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
             height=\"{height}\">",
            escape(label)
        );
        Self { text }
    }

    /// Markup of our own, nothing of which comes from outside.
    pub(super) fn raw(&mut self, markup: &str) {
        self.text.push_str(markup);
    }

    /// A straight line.
    pub(super) fn line(&mut self, class: &str, from: (f64, f64), to: (f64, f64)) {
        let [x1, y1, x2, y2] = [from.0, from.1, to.0, to.1].map(px);
        self.put(format_args!(
            "<line class=\"{class}\" x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\"/>"
        ));
    }

    /// A circle.
    pub(super) fn circle(&mut self, class: &str, (x, y): (f64, f64), radius: f64) {
        let [x, y, radius] = [x, y, radius].map(px);
        self.put(format_args!("<circle class=\"{class}\" cx=\"{x}\" cy=\"{y}\" r=\"{radius}\"/>"));
    }

    /// A path with these attributes.
    pub(super) fn path(&mut self, attributes: &str, d: &str) {
        self.put(format_args!("<path {attributes} d=\"{d}\"/>"));
    }

    /// A text at a point, its base line below the middle of it.
    pub(super) fn label(&mut self, class: &str, anchor: Anchor, (x, y): (f64, f64), text: &str) {
        let (x, y, anchor, text) = (px(x), px(y + 4.0), anchor.name(), escape(text));
        self.put(format_args!(
            "<text class=\"{class}\" x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\">{text}</text>"
        ));
    }

    /// The finished element.
    pub(super) fn finish(mut self) -> String {
        self.text.push_str("</svg>");
        self.text
    }

    fn put(&mut self, markup: std::fmt::Arguments<'_>) {
        // Writing to a string does not fail.
        let _ = self.text.write_fmt(markup);
    }
}

/// Small squares at these points, as one path: a tenth of the bytes of as many circles.
pub(super) fn marks(points: impl IntoIterator<Item = (f64, f64)>) -> String {
    let mut d = String::new();
    for (x, y) in points {
        // A line without length under a round cap is a dot.
        let _ = write!(d, "M{} {}h0", px(x), px(y));
    }
    d
}

/// Points joined by straight lines; a point without a place breaks the line.
pub(super) fn polyline(points: impl IntoIterator<Item = Option<(f64, f64)>>) -> String {
    let mut d = String::new();
    let mut is_down = false;
    for point in points {
        if let Some((x, y)) = point {
            let _ = write!(d, "{}{} {}", if is_down { 'L' } else { 'M' }, px(x), px(y));
        }
        is_down = point.is_some();
    }
    d
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_from_outside_can_end_its_tag() {
        assert_eq!(escape("<a href='x'>&\"\u{1}"), "&lt;a href=&#39;x&#39;&gt;&amp;&quot;\u{fffd}");
        let mut svg = Svg::new(1.0, 1.0, "\"><script>");
        svg.label("", Anchor::Start, (0.0, 0.0), "</text><script>");
        let text = svg.finish();
        assert!(!text.contains("<script"), "{text}");
    }

    #[test]
    fn coordinates_are_short() {
        assert_eq!(
            [0.0, -0.001, 12.5, 100.0, 1.0 / 3.0].map(px),
            ["0", "0", "12.5", "100", "0.33"]
        );
        assert_eq!(
            polyline([Some((0.0, 1.0)), Some((2.0, 3.0)), None, Some((4.0, 5.0))]),
            "M0 1L2 3M4 5"
        );
    }
}
