//! A field over the whole sphere of directions: polar curves all round in two planes through the
//! poles, and the field and its uncertainty as equal-area disks (Lambert's projection, r = sin(θ/2)):
//! the zenith in the middle, the horizon at 0.71 of the radius, the nadir all along the rim. φ = 0
//! points right and φ grows counterclockwise.
//!
//! It is handed functions of direction. What they are evaluated from it does not know.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use super::raster::{self, Cell, Frame};
use super::svg::{Anchor, Picture, Svg, marks, polyline, px};
use super::ticks::Ticks;

const NAME: &str = "sphere";
const RADIUS: f64 = 150.0;
/// Cells across a disk.
const SIDE: usize = 80;
const PANEL: f64 = 480.0;
const TOP: f64 = 205.0;
const HEIGHT: f64 = 405.0;
const HATCH: &str = "url(#sphere-hatch)";
/// Points of a polar curve, all round.
const POINTS: u32 = 361;
/// Two-sided 95 % of a normal distribution.
const K: f64 = 1.959_964;
const MARKS_MAX: usize = 1000;
/// C = -φ: C90 is at φ = -90°.
const PLANES: [(&str, f64, &str); 2] =
    [("C0-C180", 0.0, "var(--a)"), ("C90-C270", -FRAC_PI_2, "var(--b)")];

/// What is drawn.
pub struct Sphere<'a> {
    /// What the field is: `radiance L`.
    pub quantity: &'a str,
    /// Its unit; may be empty.
    pub unit: &'a str,
    /// The field and its standard uncertainty at (θ, φ), radians.
    pub value: &'a dyn Fn(f64, f64) -> (f64, f64),
    /// Beyond this θ nothing was measured, radians, up to π.
    pub theta_max_rad: f64,
    /// The directions of the readings that the field rests on.
    pub directions: &'a [(f64, f64)],
    /// Where the field is looked at: a sentence for the caption.
    pub place: &'a str,
}

impl Sphere<'_> {
    /// The polar curves and both maps as one picture.
    pub fn picture(&self) -> Picture {
        let title = format!("{} in all directions, and its uncertainty", self.quantity);
        let mut svg = Svg::new(3.0 * PANEL, HEIGHT, &title);
        raster::hatch(&mut svg, "sphere-hatch");
        self.polar(&mut svg, (0.5 * PANEL, TOP));
        let cells: Vec<Option<(f64, f64)>> = (0..SIDE * SIDE).map(|i| self.cell(i)).collect();
        let of = |which: fn((f64, f64)) -> f64| cells.iter().map(move |c| c.map(which));
        let known = |cell: &Option<f64>| cell.filter(|value| value.is_finite());
        let (values, us): (Vec<_>, Vec<_>) = (of(|c| c.0).collect(), of(|c| c.1).collect());
        let middling = us.iter().filter_map(known).fold((0.0, 0.0), |(s, n), u| (s + u, n + 1.0));
        let least = 4.0 * middling.0 / f64::max(middling.1, 1.0);
        let symbol = self.quantity.rsplit(' ').next().unwrap_or(self.quantity);
        let headings = [self.quantity.to_owned(), format!("standard uncertainty u({symbol})")];
        for (i, (cells, least)) in [(values, least), (us, 0.0)].into_iter().enumerate() {
            let centre = (PANEL * (i as f64 + 1.0) + 195.0, TOP);
            let ends = raster::ends(cells.iter().filter_map(known), least);
            Self::map(&mut svg, centre, i, &cells, ends);
            frame(&mut svg, centre, &headings[i]);
            if i == 0 {
                self.read(&mut svg, centre);
            }
            let beside = (centre.0 + RADIUS + 52.0, centre.1 - RADIUS);
            raster::bar(&mut svg, beside, 2.0 * RADIUS, ends, self.unit);
        }
        Picture { name: NAME, title, caption: self.caption(), svg: svg.finish() }
    }

    /// `None` outside the disk, NaN where nothing was measured.
    fn cell(&self, i: usize) -> Option<(f64, f64)> {
        let (theta, phi) = direction_of(middle(i % SIDE), -middle(i / SIDE))?;
        let is_measured = theta <= self.theta_max_rad;
        Some(if is_measured { (self.value)(theta, phi) } else { (f64::NAN, f64::NAN) })
    }

    fn map(svg: &mut Svg, (x, y): (f64, f64), i: usize, cells: &[Option<f64>], ends: (f64, f64)) {
        let clip = format!("sphere-clip-{i}");
        let (cx, cy) = (px(x), px(y));
        svg.raw(&format!(
            "<clipPath id=\"{clip}\"><circle cx=\"{cx}\" cy=\"{cy}\" r=\"{RADIUS}\"/></clipPath>\
             <g clip-path=\"url(#{clip})\">"
        ));
        let cell = 2.0 * RADIUS / SIDE as f64;
        let (left, top) = (x - RADIUS, y - RADIUS);
        let frame = Frame { left, top, cell: (cell, cell), columns: SIDE, rows: SIDE };
        raster::cells(svg, frame, HATCH, |column, row| {
            cells[row * SIDE + column].map_or(Cell::Outside, |value| raster::shown(value, ends))
        });
        svg.raw("</g>");
    }

    fn read(&self, svg: &mut Svg, (x, y): (f64, f64)) {
        let stride = self.directions.len().div_ceil(MARKS_MAX).max(1);
        let points = self.directions.iter().step_by(stride).map(|&(theta, phi)| {
            let (dx, dy) = on_disk(theta, phi);
            (x + RADIUS * dx, y - RADIUS * dy)
        });
        let attributes = "class=\"readings\" stroke=\"#fff\" stroke-opacity=\".7\" \
                          stroke-width=\"2\" stroke-linecap=\"round\"";
        svg.path(attributes, &marks(points));
    }

    /// Both planes in one diagram, θ = 0 above.
    fn polar(&self, svg: &mut Svg, centre: (f64, f64)) {
        let curves = PLANES.map(|(_, phi, _)| self.curve(phi));
        let largest = |p: &(f64, f64, f64)| p.1 + K * p.2;
        let end = 1.04 * curves.iter().flatten().flatten().map(largest).fold(0.0, f64::max);
        let end = if end > 0.0 && end.is_finite() { end } else { 1.0 };
        let at = |angle: f64, value: f64| {
            let r = RADIUS * (value / end).clamp(0.0, 1.0);
            (centre.0 + r * libm::sin(angle), centre.1 - r * libm::cos(angle))
        };
        svg.label("heading", Anchor::Middle, (centre.0, centre.1 - RADIUS - 38.0), self.quantity);
        let ticks = Ticks::within((0.0, end), 4);
        for &value in ticks.at.iter().filter(|value| **value > 0.0) {
            svg.circle("grid", centre, RADIUS * value / end);
            svg.label("soft", Anchor::Start, at(2.9, value), &ticks.label(value));
        }
        svg.circle("grid", centre, RADIUS);
        for step in 0..12 {
            let degrees = 30.0 * f64::from(step);
            let angle = degrees.to_radians();
            svg.line("grid", centre, at(angle, end));
            let (sin, cos) = (libm::sin(angle), libm::cos(angle));
            let anchor = match sin {
                s if s > 0.1 => Anchor::Start,
                s if s < -0.1 => Anchor::End,
                _ => Anchor::Middle,
            };
            let place = (centre.0 + (RADIUS + 8.0) * sin, centre.1 - (RADIUS + 12.0) * cos + 4.0);
            let theta = if degrees > 180.0 { 360.0 - degrees } else { degrees };
            svg.label("", anchor, place, &format!("{theta:.0}°"));
        }
        for (i, (curve, (name, _, colour))) in curves.iter().zip(PLANES).enumerate() {
            let edge = |sign: f64| {
                curve
                    .iter()
                    .map(move |p| p.map(|(angle, value, u)| at(angle, value + sign * K * u)))
            };
            let band = polyline(edge(1.0).chain(edge(-1.0).rev()));
            svg.path(&format!("class=\"band\" fill=\"{colour}\" fill-opacity=\".25\""), &band);
            let line = polyline(edge(0.0));
            let attributes = format!("fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.8\"");
            svg.path(&format!("class=\"curve\" {attributes}"), &line);
            let y = centre.1 + RADIUS + 36.0;
            let x = centre.0 - 90.0 + 110.0 * i as f64;
            svg.path(&attributes, &format!("M{} {}h22", px(x), px(y - 4.0)));
            svg.label("", Anchor::Start, (x + 27.0, y), name);
        }
        let place = (centre.0 + RADIUS + 60.0, centre.1 + RADIUS + 36.0);
        svg.label("soft", Anchor::End, place, &ticks.unit(self.unit));
    }

    /// All round a plane: the signed angle, value and u; `None` where nothing was measured.
    fn curve(&self, phi: f64) -> Vec<Option<(f64, f64, f64)>> {
        let point = |i: u32| {
            let angle = TAU * f64::from(i) / f64::from(POINTS - 1) - PI;
            let phi = if angle < 0.0 { phi + PI } else { phi };
            let (value, u) = (self.value)(angle.abs(), phi);
            (angle.abs() <= self.theta_max_rad).then_some((angle, value, u))
        };
        (0..POINTS).map(point).collect()
    }

    fn caption(&self) -> String {
        let mut said = format!(
            "{}. Left: the fit with its 95 % band (k = 1.96) in two planes through the poles, C0 \
             (φ = 0°) and C90 (φ = −90°) to the right. Maps: equal areas are equal solid angles; \
             θ = 0° in the middle, 180° all along the rim; φ from +x (right) towards +y (up). Dots: \
             the directions of readings.",
            self.place
        );
        if self.theta_max_rad < PI - 1e-6 {
            said.push_str(" Hatched: beyond the largest θ that was measured.");
        }
        said
    }
}

/// Heading, rings of θ and spokes of φ, with their labels.
fn frame(svg: &mut Svg, (x, y): (f64, f64), heading: &str) {
    let at = |theta: f64, phi: f64, out: f64| {
        let (dx, dy) = on_disk(theta, phi);
        let (ox, oy) = (out * libm::cos(phi), out * libm::sin(phi));
        (x + RADIUS * dx + ox, y - RADIUS * dy - oy)
    };
    svg.label("heading", Anchor::Middle, (x, y - RADIUS - 38.0), heading);
    for degrees in [45.0_f64, 90.0, 135.0] {
        let theta = degrees.to_radians();
        let class = if degrees > 89.0 && degrees < 91.0 { "axis" } else { "over" };
        svg.circle(class, (x, y), RADIUS * libm::sin(0.5 * theta));
        svg.label("halo", Anchor::Middle, at(theta, 1.2, 0.0), &format!("{degrees:.0}°"));
    }
    for turn in 0..8 {
        let degrees = f64::from(turn) * 45.0 - 135.0;
        let phi = degrees.to_radians();
        svg.line("over", (x, y), at(PI, phi, 0.0));
        let anchor = match libm::cos(phi) {
            c if c > 0.1 => Anchor::Start,
            c if c < -0.1 => Anchor::End,
            _ => Anchor::Middle,
        };
        let label = if turn == 3 { "φ 0°".to_owned() } else { format!("{degrees:.0}°") };
        svg.label("", anchor, at(PI, phi, 9.0), &label);
    }
    svg.circle("axis", (x, y), RADIUS);
}

fn on_disk(theta: f64, phi: f64) -> (f64, f64) {
    let r = libm::sin(0.5 * theta);
    (r * libm::cos(phi), r * libm::sin(phi))
}

/// Half a cell beyond the rim counts as the rim.
fn direction_of(x: f64, y: f64) -> Option<(f64, f64)> {
    let r = libm::hypot(x, y);
    (r <= 1.0 + 1.5 / SIDE as f64).then(|| (2.0 * libm::asin(r.min(1.0)), libm::atan2(y, x)))
}

/// The middle of a cell, from -1 to 1.
fn middle(index: usize) -> f64 {
    (2.0 * index as f64 + 1.0) / SIDE as f64 - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_areas_are_equal_solid_angles_over_the_whole_sphere() {
        for theta in [0.3, FRAC_PI_2, 2.8] {
            let (x, y) = on_disk(theta, 1.0);
            let cap = (1.0 - libm::cos(theta)) / 2.0;
            assert!((x * x + y * y - cap).abs() < 1e-12);
            let (back, phi) = direction_of(x, y).unwrap();
            assert!((back - theta).abs() < 1e-9 && (phi - 1.0).abs() < 1e-12);
        }
        assert_eq!(direction_of(0.9, 0.9), None);
    }

    #[test]
    fn what_was_not_measured_is_hatched_and_said_so() {
        let drawn = |theta_max_rad: f64| {
            Sphere {
                quantity: "radiance L",
                unit: "W/(m² sr)",
                value: &|theta, _| (1.0 + 0.5 * libm::cos(theta), 0.01),
                theta_max_rad,
                directions: &[(0.5, 0.0), (2.0, 1.0)],
                place: "At the point",
            }
            .picture()
        };
        let (whole, part) = (drawn(PI), drawn(2.0));
        assert_eq!(whole.svg.matches("class=\"curve\"").count(), 2);
        assert!(!whole.caption.contains("Hatched") && part.caption.contains("Hatched"));
        assert_eq!(whole.svg.matches("class=\"gap\"").count(), 0);
        assert_eq!(part.svg.matches("class=\"gap\"").count(), 2);
        assert!(whole.svg.contains(">C90-C270<") && whole.svg.contains(">135°<"));
    }
}
