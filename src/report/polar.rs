//! Polar diagrams of two planes through the normal, C0-C180 and C90-C270: the curve of the field,
//! its 95 % band, and the readings near the plane. The normal points up.
//!
//! It is handed functions of direction and readings; where they come from it does not know.

use core::f64::consts::{FRAC_PI_2, PI};

use fit::Coverage;

use super::svg::{Anchor, Picture, Svg, marks, polyline};
use super::ticks::Ticks;

const NAME: &str = "polar";
const RADIUS: f64 = 170.0;
const PANEL: f64 = 460.0;
const HEIGHT: f64 = 275.0;
const BASE: f64 = 215.0;
/// Points of each curve, from horizon to horizon.
const POINTS: u32 = 181;
/// Readings this close to a plane are drawn in it, radians.
const NEAR_RAD: f64 = 0.0524;
/// Two-sided 95 % of a normal distribution.
const K: f64 = 1.959_964;
const MARKS_MAX: usize = 1000;

/// What is drawn.
pub struct Polar<'a> {
    /// What the field is: `radiance L`.
    pub quantity: &'a str,
    /// Its unit; may be empty.
    pub unit: &'a str,
    /// The field and its standard uncertainty at (θ, φ), radians.
    pub value: &'a dyn Fn(f64, f64) -> (f64, f64),
    /// Readings that the field rests on: θ, φ, value.
    pub readings: &'a [(f64, f64, f64)],
    /// Where the field is looked at: a sentence for the caption.
    pub place: &'a str,
}

/// A point of a curve: the angle from the normal, signed, and what is there.
#[derive(Debug, Clone, Copy)]
struct Point {
    angle: f64,
    value: f64,
    u: f64,
    is_measured: bool,
}

impl Polar<'_> {
    /// Both planes as one picture.
    pub fn picture(&self) -> Picture {
        let directions: Vec<(f64, f64)> = self.readings.iter().map(|r| (r.0, r.1)).collect();
        let coverage = Coverage::of(&directions);
        // C = -φ: C90 is at φ = -90°.
        let planes = [0.0, -FRAC_PI_2];
        let curves = planes.map(|phi| self.curve(phi, &coverage));
        let readings = planes.map(|phi| self.near(phi));
        let largest =
            |point: &Point| if point.is_measured { point.value + K * point.u } else { 0.0 };
        let of_curves = curves.iter().flatten().map(largest);
        let of_readings = readings.iter().flatten().map(|(_, value)| *value);
        let end = 1.04 * of_curves.chain(of_readings).fold(0.0, f64::max);
        let end = if end > 0.0 && end.is_finite() { end } else { 1.0 };
        let title = format!("Polar diagram of {}", self.quantity);
        let mut svg = Svg::new(2.0 * PANEL, HEIGHT, &title);
        let names = [("C0", "C180"), ("C90", "C270")];
        let mut drawn = 0;
        for (i, left) in [0.0, PANEL].into_iter().enumerate() {
            let panel = Panel { centre: (left + 0.5 * PANEL, BASE), end };
            panel.graticule(&mut svg, names[i], self.unit);
            panel.curve(&mut svg, &curves[i]);
            drawn += panel.readings(&mut svg, &readings[i]);
        }
        Picture { name: NAME, title, caption: self.caption(&readings, drawn), svg: svg.finish() }
    }

    /// Along a half plane and its opposite one.
    fn curve(&self, phi: f64, coverage: &Coverage) -> Vec<Point> {
        let point = |i: u32| {
            let angle = PI * (f64::from(i) / f64::from(POINTS - 1) - 0.5);
            let phi = if angle < 0.0 { phi + PI } else { phi };
            let (value, u) = (self.value)(angle.abs(), phi);
            Point { angle, value, u, is_measured: coverage.holds(angle.abs(), phi) }
        };
        (0..POINTS).map(point).collect()
    }

    /// The readings near a plane: their angle from the normal within it, and their values.
    fn near(&self, phi: f64) -> Vec<(f64, f64)> {
        let within = |&(theta, azimuth, value): &(f64, f64, f64)| {
            let (along, across) = (
                libm::sin(theta) * libm::cos(azimuth - phi),
                libm::sin(theta) * libm::sin(azimuth - phi),
            );
            let is_near = libm::asin(across.clamp(-1.0, 1.0)).abs() <= NEAR_RAD;
            is_near.then(|| (libm::atan2(along, libm::cos(theta)), value))
        };
        self.readings.iter().filter_map(within).collect()
    }

    fn caption(&self, readings: &[Vec<(f64, f64)>; 2], drawn: usize) -> String {
        let all: usize = readings.iter().map(Vec::len).sum();
        let below = readings.iter().flatten().filter(|(_, value)| *value < 0.0).count();
        let mut said = vec![format!(
            "{}. Line: the fit, dotted where nothing was measured nearby; band: 95 % (k = 1.96); \
             dots: readings within {:.0}° of the plane, at any position on the sample. C0 is φ = \
             0°, C90 is φ = −90°.",
            self.place,
            NEAR_RAD.to_degrees()
        )];
        if drawn < all {
            said.push(format!("{drawn} of {all} readings are drawn."));
        }
        if below > 0 {
            said.push(format!("{below} readings below zero stand at the centre."));
        }
        said.join(" ")
    }
}

struct Panel {
    centre: (f64, f64),
    /// The value at the rim.
    end: f64,
}

impl Panel {
    /// A value in a direction of the plane; below zero it stands at the centre.
    fn at(&self, angle: f64, value: f64) -> (f64, f64) {
        let r = RADIUS * (value / self.end).clamp(0.0, 1.0);
        (self.centre.0 + r * libm::sin(angle), self.centre.1 - r * libm::cos(angle))
    }

    fn graticule(&self, svg: &mut Svg, (right, left): (&str, &str), unit: &str) {
        let (x, y) = self.centre;
        let ticks = Ticks::within((0.0, self.end), 4);
        for &value in ticks.at.iter().filter(|value| **value > 0.0) {
            let from = self.at(-FRAC_PI_2, value);
            let to = self.at(FRAC_PI_2, value);
            let r = super::svg::px(RADIUS * value / self.end);
            let [x1, y1, x2, y2] = [from.0, from.1, to.0, to.1].map(super::svg::px);
            svg.path("class=\"grid\"", &format!("M{x1} {y1}A{r} {r} 0 0 1 {x2} {y2}"));
            svg.label("soft", Anchor::Middle, (to.0, y + 14.0), &ticks.label(value));
        }
        let [x1, base, r, x2] = [x - RADIUS, y, RADIUS, x + RADIUS].map(super::svg::px);
        svg.path("class=\"grid\"", &format!("M{x1} {base}A{r} {r} 0 0 1 {x2} {base}"));
        svg.label("soft", Anchor::Middle, (x, y + 14.0), "0");
        svg.label("soft", Anchor::Middle, (x, y + 32.0), &ticks.unit(unit));
        for step in -3..=3 {
            let degrees = 30.0 * f64::from(step);
            let angle = degrees.to_radians();
            svg.line("grid", self.centre, self.at(angle, self.end));
            let out = 1.0 + 14.0 / RADIUS;
            let (sin, cos) = (libm::sin(angle), libm::cos(angle));
            let place = (x + RADIUS * out * sin, y - RADIUS * out * cos);
            let anchor = match sin {
                s if s > 0.1 => Anchor::Start,
                s if s < -0.1 => Anchor::End,
                _ => Anchor::Middle,
            };
            let nudge = if step == 0 { 0.0 } else { -6.0 * sin };
            let place = (place.0 + nudge, place.1);
            svg.label("", anchor, place, &format!("{:.0}°", degrees.abs()));
        }
        svg.label("heading", Anchor::Start, (x + 0.72 * RADIUS, 14.0), right);
        svg.label("heading", Anchor::End, (x - 0.72 * RADIUS, 14.0), left);
        svg.line("axis", self.at(-FRAC_PI_2, self.end), self.at(FRAC_PI_2, self.end));
    }

    fn curve(&self, svg: &mut Svg, curve: &[Point]) {
        for part in curve.chunk_by(|a, b| a.is_measured == b.is_measured) {
            if !part[0].is_measured {
                continue;
            }
            let edge = |sign: f64| {
                let place = move |p: &Point| Some(self.at(p.angle, p.value + sign * K * p.u));
                part.iter().map(place)
            };
            let d = polyline(edge(1.0).chain(edge(-1.0).rev()));
            svg.path("class=\"band\" fill=\"var(--a)\" fill-opacity=\".25\"", &format!("{d}Z"));
        }
        let line = |wanted: bool| {
            polyline(curve.iter().map(|point| {
                (point.is_measured == wanted).then(|| self.at(point.angle, point.value))
            }))
        };
        let attributes = "fill=\"none\" stroke=\"var(--a)\"";
        svg.path(&format!("class=\"curve\" {attributes} stroke-width=\"1.8\""), &line(true));
        let open = line(false);
        if !open.is_empty() {
            svg.path(&format!("{attributes} stroke-width=\"1.2\" stroke-dasharray=\"1 4\""), &open);
        }
    }

    fn readings(&self, svg: &mut Svg, readings: &[(f64, f64)]) -> usize {
        let stride = readings.len().div_ceil(MARKS_MAX).max(1);
        let shown = readings.iter().step_by(stride);
        let d = marks(shown.clone().map(|&(angle, value)| self.at(angle, value)));
        svg.path(
            "class=\"readings\" stroke=\"var(--b)\" stroke-width=\"4\" stroke-linecap=\"round\"",
            &d,
        );
        shown.count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reading_is_drawn_in_its_own_half_plane() {
        // Brighter towards C90, which is φ = -90°.
        let field = |theta: f64, phi: f64| 1.0 - 0.5 * libm::sin(theta) * libm::sin(phi);
        let readings: Vec<(f64, f64, f64)> = (-6..6)
            .flat_map(|i| (0..9).map(move |j| (f64::from(j) * 0.15, f64::from(i) * PI / 6.0)))
            .map(|(theta, phi)| (theta, phi, field(theta, phi)))
            .collect();
        let value = |theta: f64, phi: f64| (field(theta, phi), 0.01);
        let polar = Polar {
            quantity: "radiance L",
            unit: "W/(m² sr)",
            value: &value,
            readings: &readings,
            place: "At the middle",
        };
        let curve = polar.curve(-FRAC_PI_2, &Coverage::of(&[]));
        assert!(curve[150].value > curve[30].value, "C90 is brighter than C270");
        for (angle, value) in polar.near(-FRAC_PI_2) {
            assert!((value - (1.0 + 0.5 * libm::sin(angle))).abs() < 1e-9);
        }
        assert!(polar.near(0.0).iter().all(|(_, value)| (value - 1.0).abs() < 1e-9));
        let picture = polar.picture();
        let (c90, c270) = (picture.svg.find(">C90<"), picture.svg.find(">C270<"));
        assert!(c90.is_some() && c270.is_some());
        assert_eq!(picture.svg.matches("class=\"curve\"").count(), 2);
        assert_eq!(picture.svg.matches("stroke-dasharray").count(), 2, "beyond 69 degrees");
    }
}
