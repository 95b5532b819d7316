//! A field over the sample's plane in one direction, as a map of x and y.

use std::collections::BTreeMap;

use super::raster::{self, Frame};
use super::svg::{Anchor, Picture, Svg, marks};
use super::ticks::Ticks;

const NAME: &str = "plane";
/// Cells along the longer side.
const SIDE: usize = 60;
const LENGTH: f64 = 300.0;
const LEFT: f64 = 60.0;
const TOP: f64 = 45.0;
const MARKS_MAX: usize = 600;

/// What is drawn.
pub struct Plane<'a> {
    /// What the field is: `radiance L`.
    pub quantity: &'a str,
    /// Its unit; may be empty.
    pub unit: &'a str,
    /// From and to, millimetres; both sides have a length.
    pub x_mm: (f64, f64),
    /// From and to, millimetres.
    pub y_mm: (f64, f64),
    /// The field at (x, y), millimetres.
    pub value: &'a dyn Fn(f64, f64) -> f64,
    /// A standard uncertainty that is typical of it: the colour bar spans at least four of them.
    pub u: f64,
    /// Where readings were taken, millimetres.
    pub positions: &'a [(f64, f64)],
    /// In which direction: a sentence for the caption.
    pub place: &'a str,
}

impl Plane<'_> {
    /// The map.
    pub fn picture(&self) -> Picture {
        let (width_mm, height_mm) = (self.x_mm.1 - self.x_mm.0, self.y_mm.1 - self.y_mm.0);
        let longer = width_mm.max(height_mm);
        let cells = |length: f64| {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 1 to SIDE
            let cells = libm::round(SIDE as f64 * length / longer) as usize;
            cells.clamp(1, SIDE)
        };
        let (columns, rows) = (cells(width_mm), cells(height_mm));
        // A sliver would have no room for its ticks.
        let size = |length: f64| (LENGTH * length / longer).max(30.0);
        let (width, height) = (size(width_mm), size(height_mm));
        let title = format!("{} over the sample, towards the peak", self.quantity);
        let mut svg = Svg::new(LEFT + width + 170.0, TOP + height + 50.0, &title);
        let middle = |(low, high): (f64, f64), i: usize, n: usize| {
            low + (high - low) * (i as f64 + 0.5) / n as f64
        };
        let value = |i: usize| {
            let row = rows - 1 - i / columns;
            (self.value)(middle(self.x_mm, i % columns, columns), middle(self.y_mm, row, rows))
        };
        let values: Vec<f64> = (0..rows * columns).map(value).collect();
        let ends = raster::ends(values.iter().copied(), 4.0 * self.u);
        let frame = Frame {
            left: LEFT,
            top: TOP,
            cell: (width / columns as f64, height / rows as f64),
            columns,
            rows,
        };
        raster::cells(&mut svg, frame, "none", |column, row| {
            raster::shown(values[row * columns + column], ends)
        });
        self.axes(&mut svg, (width, height));
        let drawn = self.marks(&mut svg, (width, height));
        raster::bar(&mut svg, (LEFT + width + 30.0, TOP), height, ends, self.unit);
        let all = self.positions.len();
        let thinned =
            if drawn < all { format!(", {drawn} for {all} readings") } else { String::new() };
        let (low, high) = raster::ends(values.iter().copied(), 0.0);
        let is_flat = values.iter().all(|value| value.to_bits() == values[0].to_bits())
            || high - low <= 1e-12 * high.abs();
        let flat = if is_flat { " The fit does not vary with position." } else { "" };
        let caption = format!("{}. Dots: where beams met the sample{thinned}.{flat}", self.place);
        Picture { name: NAME, title, caption, svg: svg.finish() }
    }

    fn axes(&self, svg: &mut Svg, (width, height): (f64, f64)) {
        let (right, bottom) = (LEFT + width, TOP + height);
        let corners = [(LEFT, TOP), (right, TOP), (right, bottom), (LEFT, bottom), (LEFT, TOP)];
        for side in corners.windows(2) {
            svg.line("axis", side[0], side[1]);
        }
        let ticks = Ticks::within(self.x_mm, 5);
        for &x in &ticks.at {
            let at = LEFT + width * (x - self.x_mm.0) / (self.x_mm.1 - self.x_mm.0);
            svg.line("axis", (at, bottom), (at, bottom + 4.0));
            svg.label("", Anchor::Middle, (at, bottom + 14.0), &ticks.label(x));
        }
        svg.label("", Anchor::Middle, (LEFT + 0.5 * width, bottom + 34.0), &ticks.unit("x / mm"));
        let ticks = Ticks::within(self.y_mm, 5);
        for &y in &ticks.at {
            let at = bottom - height * (y - self.y_mm.0) / (self.y_mm.1 - self.y_mm.0);
            svg.line("axis", (LEFT - 4.0, at), (LEFT, at));
            svg.label("", Anchor::End, (LEFT - 7.0, at), &ticks.label(y));
        }
        svg.label("", Anchor::End, (LEFT - 7.0, TOP - 16.0), &ticks.unit("y / mm"));
    }

    fn marks(&self, svg: &mut Svg, (width, height): (f64, f64)) -> usize {
        let part = |value: f64, (low, high): (f64, f64)| (value - low) / (high - low);
        // One for each hundredth of a side.
        let mut places: BTreeMap<(i64, i64), (f64, f64)> = BTreeMap::new();
        for &(x, y) in self.positions {
            let (x, y) = (part(x, self.x_mm), part(y, self.y_mm));
            #[allow(clippy::cast_possible_truncation)] // saturates
            let place = |t: f64| libm::round(100.0 * t) as i64;
            places.entry((place(x), place(y))).or_insert((x, y));
        }
        let stride = places.len().div_ceil(MARKS_MAX).max(1);
        let shown: Vec<(f64, f64)> = places.into_values().step_by(stride).collect();
        let is_inside = |t: f64| (-0.03..=1.03).contains(&t);
        let inside = shown.iter().filter(|(x, y)| is_inside(*x) && is_inside(*y));
        let d = marks(inside.map(|(x, y)| (LEFT + width * x, TOP + height * (1.0 - y))));
        for (colour, width) in [("#000", 3.2), ("#fff", 2.0)] {
            let stroke = format!("stroke=\"{colour}\" stroke-width=\"{width}\"");
            svg.path(&format!("{stroke} stroke-linecap=\"round\""), &d);
        }
        shown.len()
    }
}
