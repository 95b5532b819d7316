//! A field over the hemisphere and its uncertainty as equal-area disks (Lambert's projection,
//! r = √2 sin(θ/2)): equal areas are equal solid angles. φ = 0 points right and φ grows
//! counterclockwise, as one sees it from the detector's side.
//!
//! It is handed functions of direction. What they are evaluated from it does not know.

use core::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_4, SQRT_2, TAU};

use fit::Coverage;

use super::raster::{self, Cell, Frame};
use super::svg::{Anchor, Picture, Svg, marks, px};
use super::ticks::significant;

const NAME: &str = "hemisphere";
const RADIUS: f64 = 150.0;
/// Cells across the disk of the field; its value is asked for at each.
const SIDE: usize = 100;
const PANEL: f64 = 480.0;
const HATCH: &str = "url(#hemisphere-hatch)";
const CENTRE: (f64, f64) = (195.0, 205.0);
const HEIGHT: f64 = 390.0;
/// Directions that are drawn, at most.
const MARKS_MAX: usize = 800;

/// What is drawn over the hemisphere.
pub struct Hemisphere<'a> {
    /// What the field is: `radiance L`.
    pub quantity: &'a str,
    /// Its unit; may be empty.
    pub unit: &'a str,
    /// The field at (θ, φ), radians.
    pub value: &'a dyn Fn(f64, f64) -> f64,
    /// Its standard uncertainty there: combined, and without the scale that all readings share.
    pub u: &'a dyn Fn(f64, f64) -> [f64; 2],
    /// The square root of how many places the uncertainty is asked at, on rings and spokes;
    /// between them it is interpolated.
    pub u_side: usize,
    /// The directions of the readings that the field rests on.
    pub directions: &'a [(f64, f64)],
    /// Where the field is looked at: a sentence for the caption.
    pub place: &'a str,
}

/// A panel's cells: `None` outside the disk, NaN where nothing was measured.
type Cells = Vec<Option<f64>>;

impl Hemisphere<'_> {
    /// All maps as one picture.
    pub fn picture(&self) -> Picture {
        let coverage = Coverage::of(self.directions);
        let values = cells(&coverage, |theta, phi| (self.value)(theta, phi));
        let [combined, rest] = self.uncertainties(&coverage);
        let title = format!("{} over the hemisphere, and its uncertainty", self.quantity);
        let mut svg = Svg::new(2.0 * PANEL, 2.0 * HEIGHT, &title);
        raster::hatch(&mut svg, "hemisphere-hatch");
        let least = 4.0 * median(&combined);
        let ends = [(&values, least), (&combined, 0.0), (&rest, 0.0)]
            .map(|(cells, least)| raster::ends(cells.iter().flatten().copied(), least));
        let symbol = symbol(self.quantity);
        let headings = [
            self.quantity.to_owned(),
            format!("standard uncertainty u({symbol})"),
            format!("u({symbol}) without the common scale"),
        ];
        let limit = coverage.theta_max_rad();
        for (i, cells) in [&values, &combined, &rest].into_iter().enumerate() {
            let panel = Panel::new(i, limit);
            panel.map(&mut svg, cells, ends[i]);
            panel.frame(&mut svg, &headings[i], "over");
            raster::bar(&mut svg, panel.beside(), 2.0 * RADIUS, ends[i], self.unit);
        }
        let drawn = Self::read(&mut svg, &Panel::new(3, limit), &values, &coverage);
        let has_gaps = values.iter().any(|value| value.is_some_and(f64::is_nan));
        let has_gaps = has_gaps || limit < core::f64::consts::FRAC_PI_2;
        let gap = has_gaps.then(|| (coverage.reach_rad(), self.unmeasured_share(&coverage)));
        let caption = self.caption(gap, drawn);
        Picture { name: NAME, title, caption, svg: svg.finish() }
    }

    fn uncertainties(&self, coverage: &Coverage) -> [Cells; 2] {
        let (rings, spokes) = ((self.u_side / 2).max(2), (2 * self.u_side).max(8));
        let limit = SQRT_2 * libm::sin(0.5 * coverage.theta_max_rad());
        let node = |i: usize| {
            let r = limit * (i / spokes) as f64 / rings as f64;
            let phi = TAU * (i % spokes) as f64 / spokes as f64;
            let (theta, phi) = nearest_direction(r * libm::cos(phi), r * libm::sin(phi));
            (self.u)(theta, phi)
        };
        let lattice: Vec<[f64; 2]> = (0..(rings + 1) * spokes).map(node).collect();
        let split = |t: f64, count: usize| {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to count
            let below = (t * count as f64) as usize;
            let below = below.min(count - 1);
            (below, t * count as f64 - below as f64)
        };
        [0, 1].map(|which| {
            cells(coverage, |theta, phi| {
                let (i, a) = split(SQRT_2 * libm::sin(0.5 * theta) / limit, rings);
                let (j, b) = split(phi.rem_euclid(TAU) / TAU, spokes);
                let node = |i: usize, j: usize| lattice[i * spokes + j % spokes][which];
                let ring = |i: usize| (1.0 - b) * node(i, j) + b * node(i, j + 1);
                (1.0 - a) * ring(i) + a * ring(i + 1)
            })
        })
    }

    /// How much of what leaves into the hemisphere, by the field's own values, goes where nothing
    /// was measured; `None` where nothing leaves.
    fn unmeasured_share(&self, coverage: &Coverage) -> Option<f64> {
        let (mut all, mut unmeasured) = (0.0, 0.0);
        for i in 0..SIDE * SIDE {
            let (x, y) = (place(i % SIDE), -place(i / SIDE));
            if libm::hypot(x, y) > 1.0 {
                continue;
            }
            let (theta, phi) = nearest_direction(x, y);
            let part = (self.value)(theta, phi) * libm::cos(theta);
            all += part;
            unmeasured += if coverage.holds(theta, phi) { 0.0 } else { part };
        }
        (all > 0.0).then(|| unmeasured / all)
    }

    /// Where readings were taken; how many of them are drawn.
    fn read(svg: &mut Svg, panel: &Panel, values: &[Option<f64>], coverage: &Coverage) -> usize {
        let gaps: Cells = values.iter().map(|value| value.filter(|v| v.is_nan())).collect();
        panel.map(svg, &gaps, (0.0, 1.0));
        panel.frame(svg, "directions read", "grid");
        let stride = coverage.units().len().div_ceil(MARKS_MAX).max(1);
        let shown = coverage.units().iter().step_by(stride);
        let points = shown.clone().map(|&[x, y, z]| {
            let (x, y) = on_disk(libm::acos(z.clamp(-1.0, 1.0)), libm::atan2(y, x));
            (panel.centre.0 + RADIUS * x, panel.centre.1 - RADIUS * y)
        });
        let attributes =
            "class=\"readings\" stroke=\"var(--b)\" stroke-width=\"3\" stroke-linecap=\"round\"";
        svg.path(attributes, &marks(points));
        shown.count()
    }

    fn caption(&self, gap: Option<(f64, Option<f64>)>, drawn: usize) -> String {
        let mut said = vec![format!(
            "{}. Equal areas are equal solid angles; φ from +x (right) towards +y (up), seen from \
             the detector's side; C = −φ.",
            self.place
        )];
        let all = self.directions.len();
        if drawn < all {
            said.push(format!("{drawn} dots stand for the directions of {all} readings."));
        }
        if let Some((reach, share)) = gap {
            said.push(format!(
                "Hatched: no reading within {:.1}°, or beyond the largest θ read.",
                reach.to_degrees()
            ));
            said.extend(share.map(|share| {
                let percent = significant(100.0 * share, 2);
                format!("By the fit, {percent} % of what leaves here goes into hatched directions.")
            }));
        }
        said.join(" ")
    }
}

/// Row by row. A cell that the largest θ cuts shows what is just within it; the hatch beyond is
/// drawn over it.
fn cells(coverage: &Coverage, value: impl Fn(f64, f64) -> f64) -> Cells {
    let limit = coverage.theta_max_rad();
    let cell_rad = 3.0 / SIDE as f64;
    let all = (0..SIDE * SIDE).map(|i| {
        let (theta, phi) = direction_of(place(i % SIDE), -place(i / SIDE))?;
        let near = if theta < limit + cell_rad { theta.min(limit) } else { theta };
        match coverage.holds(near, phi) {
            true => Some(value(near, phi)),
            // The hatch beyond the limit has an edge of its own.
            false if theta >= limit => None,
            false => Some(f64::NAN),
        }
    });
    all.collect()
}

/// The letter at the end of `radiance L`.
fn symbol(quantity: &str) -> &str {
    quantity.rsplit(' ').next().unwrap_or(quantity)
}

fn median(values: &[Option<f64>]) -> f64 {
    let mut known: Vec<f64> = values.iter().flatten().copied().filter(|v| v.is_finite()).collect();
    known.sort_by(f64::total_cmp);
    known.get(known.len() / 2).copied().unwrap_or(0.0)
}

/// The middle of a cell, from -1 to 1.
fn place(index: usize) -> f64 {
    (2.0 * index as f64 + 1.0) / SIDE as f64 - 1.0
}

/// The unit disk's point to a direction; half a cell beyond the rim counts as the rim.
fn direction_of(x: f64, y: f64) -> Option<(f64, f64)> {
    let rim = 1.0 + SQRT_2 / SIDE as f64;
    (libm::hypot(x, y) <= rim).then(|| nearest_direction(x, y))
}

fn nearest_direction(x: f64, y: f64) -> (f64, f64) {
    let r = libm::hypot(x, y).min(1.0);
    (2.0 * libm::asin(r * FRAC_1_SQRT_2), libm::atan2(y, x))
}

fn on_disk(theta: f64, phi: f64) -> (f64, f64) {
    let r = SQRT_2 * libm::sin(0.5 * theta);
    (r * libm::cos(phi), r * libm::sin(phi))
}

/// One disk of the picture.
struct Panel {
    index: usize,
    centre: (f64, f64),
    /// Beyond it nothing was measured, radians.
    limit_rad: f64,
}

impl Panel {
    /// From left to right and from top to bottom, two a row.
    fn new(index: usize, limit_rad: f64) -> Self {
        let (column, row) = ((index % 2) as f64, (index / 2) as f64);
        Self { index, centre: (CENTRE.0 + PANEL * column, CENTRE.1 + HEIGHT * row), limit_rad }
    }

    /// Where its colour bar begins.
    fn beside(&self) -> (f64, f64) {
        (self.centre.0 + RADIUS + 52.0, self.centre.1 - RADIUS)
    }

    fn map(&self, svg: &mut Svg, values: &[Option<f64>], ends: (f64, f64)) {
        let (x, y) = (px(self.centre.0), px(self.centre.1));
        let clip = format!("hemisphere-clip-{}", self.index);
        svg.raw(&format!(
            "<clipPath id=\"{clip}\"><circle cx=\"{x}\" cy=\"{y}\" r=\"{RADIUS}\"/></clipPath>\
             <g clip-path=\"url(#{clip})\">"
        ));
        let cell = 2.0 * RADIUS / SIDE as f64;
        let frame = Frame {
            left: self.centre.0 - RADIUS,
            top: self.centre.1 - RADIUS,
            cell: (cell, cell),
            columns: SIDE,
            rows: SIDE,
        };
        raster::cells(svg, frame, HATCH, |column, row| {
            values[row * SIDE + column].map_or(Cell::Outside, |value| raster::shown(value, ends))
        });
        svg.raw("</g>");
        if self.limit_rad < core::f64::consts::FRAC_PI_2 {
            let r = RADIUS * SQRT_2 * libm::sin(0.5 * self.limit_rad);
            let ring = [RADIUS, r].map(|r| self.ring(r)).concat();
            let attributes = format!("class=\"gap beyond\" fill-rule=\"evenodd\" fill=\"{HATCH}\"");
            svg.path(&attributes, &ring);
        }
    }

    /// A circle as a part of a path.
    fn ring(&self, radius: f64) -> String {
        let [left, y, r, d] = [self.centre.0 - radius, self.centre.1, radius, 2.0 * radius].map(px);
        format!("M{left} {y}a{r} {r} 0 1 0 {d} 0a{r} {r} 0 1 0 -{d} 0z")
    }

    /// Heading, rings of θ and spokes of φ, with their labels.
    fn frame(&self, svg: &mut Svg, heading: &str, class: &str) {
        let centre = self.centre;
        let at = |theta: f64, phi: f64, out: f64| {
            let (x, y) = on_disk(theta, phi);
            let (dx, dy) = (out * libm::cos(phi), out * libm::sin(phi));
            (centre.0 + RADIUS * x + dx, centre.1 - RADIUS * y - dy)
        };
        svg.label("heading", Anchor::Middle, (centre.0, centre.1 - RADIUS - 38.0), heading);
        let rings = [30.0_f64, 60.0];
        for degrees in rings {
            svg.circle(class, centre, RADIUS * SQRT_2 * libm::sin(0.5 * degrees.to_radians()));
        }
        let horizon = core::f64::consts::FRAC_PI_2;
        for turn in 0..8 {
            let degrees = f64::from(turn) * 45.0 - 135.0;
            let phi = degrees.to_radians();
            svg.line(class, centre, at(horizon, phi, 0.0));
            let anchor = match libm::cos(phi) {
                x if x > 0.1 => Anchor::Start,
                x if x < -0.1 => Anchor::End,
                _ => Anchor::Middle,
            };
            let label = if turn == 3 { "φ 0°".to_owned() } else { format!("{degrees:.0}°") };
            svg.label("", anchor, at(horizon, phi, 9.0), &label);
        }
        svg.circle("axis", centre, RADIUS);
        let between = 1.5 * FRAC_PI_4;
        for degrees in rings {
            let place = at(degrees.to_radians(), between, 0.0);
            svg.label("halo", Anchor::Middle, place, &format!("{degrees:.0}°"));
        }
        svg.label("", Anchor::Middle, at(horizon, between, 13.0), "θ 90°");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_projection_keeps_areas_and_comes_back() {
        for (theta, phi) in [(0.3, 1.0), (1.2, -2.0), (core::f64::consts::FRAC_PI_2, 3.0)] {
            let (x, y) = on_disk(theta, phi);
            let (t, p) = nearest_direction(x, y);
            assert!((t - theta).abs() < 1e-12 && (p - phi).abs() < 1e-12);
            // The cap's solid angle over the hemisphere's is the disk's share of area.
            assert!((x * x + y * y - (1.0 - libm::cos(theta))).abs() < 1e-12);
        }
    }

    fn drawn(read: &[(f64, f64)]) -> Picture {
        Hemisphere {
            quantity: "radiance L",
            unit: "W/(m² sr)",
            value: &|theta, _| libm::cos(theta),
            u: &|_, _| [0.02, 0.01],
            u_side: 20,
            directions: read,
            place: "At the middle",
        }
        .picture()
    }

    fn rings(count: u32, keep: impl Fn(f64) -> bool) -> Vec<(f64, f64)> {
        let ring = |i: u32| (-18..18).map(move |k| (f64::from(i) * 0.15, f64::from(k) * 0.1745));
        (0..count).flat_map(ring).filter(|(theta, phi)| *theta < 0.2 || keep(*phi)).collect()
    }

    #[test]
    fn what_was_not_measured_is_hatched_and_its_share_is_named() {
        // To 60 degrees: of cos θ, cos³ 60.2° = 1/8 of the exitance lies beyond.
        let cone = drawn(&rings(8, |_| true));
        assert_eq!(cone.svg.matches("class=\"gap beyond\"").count(), 4);
        assert_eq!(cone.svg.matches("class=\"gap\"").count(), 0);
        assert!(cone.caption.contains("12 % of what leaves here"), "{}", cone.caption);
        let wedge = drawn(&rings(8, |phi| !(0.3..1.8).contains(&phi)));
        assert_eq!(wedge.svg.matches("class=\"gap\"").count(), 4);
        assert!(wedge.caption.contains("Hatched: no reading within"), "{}", wedge.caption);
        assert!(wedge.svg.contains(">W/(m² sr)<"));
    }
}
