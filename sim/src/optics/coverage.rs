//! What one point of the pupil sees of a flat patch through the beam's stop: an integral over the
//! part of the stop behind which the patch lies, cut exactly where its outline is.
//!
//! Chords of the stop that are horizontal are seen along lines of the sample's plane, in
//! proportion. So the stop is cut into such chords, each chord where the outline crosses it, and
//! the chords' places where the outline's shape along them changes: at corners, at tangents, and
//! where the outline leaves the stop. Between these the integrand is smooth: the stop's rim by the
//! angle under which a chord ends, and the square roots at a round outline's tangents by another
//! such change of variable.

use core::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec2, DVec3};
use radiometry::beam::{Beam, Placed};

use super::boundary::{Boundary, edges};

/// Where a circle is looked at for crossings of the stop's rim.
const LOOKS: u32 = 48;
/// Halvings of the place of such a crossing, to the last bit.
const HALVINGS: u32 = 52;

/// Rules over an interval, made once.
#[derive(Debug, Clone)]
pub(crate) struct Rules {
    across: Vec<(f64, f64)>,
    /// Across an interval at whose ends there may be square roots.
    across_roots: Vec<(f64, f64)>,
    along: Vec<(f64, f64)>,
}

impl Rules {
    /// With so many chords between two changes of shape (with 8 the error of a rim's area is below
    /// 1e-8 of the stop's), and so many points along each.
    pub(crate) fn new(chords: usize, along: usize) -> Self {
        // On s in (-1, 1) the place is sin(πs/2): even so, its slope vanishes at both ends.
        let across = radiometry::quadrature::gauss_legendre(chords);
        let roots = radiometry::quadrature::gauss_legendre(chords + 4);
        let roots = roots.iter().map(|(s, weight)| {
            let (sin, cos) = libm::sincos(FRAC_PI_2 * s);
            (sin, weight * FRAC_PI_2 * cos)
        });
        let across_roots = roots.collect();
        Self { across, across_roots, along: radiometry::quadrature::gauss_legendre(along) }
    }
}

/// A beam's stop as one point of its pupil sees it.
pub(crate) struct Sight<'b> {
    pupil: DVec3,
    /// The stop's centre and its two axes as long as its radius; `y` is horizontal.
    centre: DVec3,
    x: DVec3,
    y: DVec3,
    axis: DVec3,
    beam: &'b Beam,
    rules: &'b Rules,
}

impl<'b> Sight<'b> {
    /// From the point of the pupil at `on_pupil` (of the unit disk). `None` from below the
    /// sample's plane.
    pub(crate) fn new(
        beam: &'b Beam,
        rules: &'b Rules,
        placed: &Placed,
        on_pupil: DVec2,
    ) -> Option<Self> {
        let pupil = placed.point((on_pupil * beam.pupil_radius_m()).extend(beam.pupil_z_m()));
        let [x, y, axis] = placed.axes();
        let radius = beam.stop_radius_m();
        let centre = placed.point(DVec3::new(0.0, 0.0, beam.stop_z_m()));
        (pupil.z > 0.0).then_some(Self {
            pupil,
            centre,
            x: x * radius,
            y: y * radius,
            axis,
            beam,
            rules,
        })
    }

    /// The mean over the whole stop, with the weight h⁴/r⁴, of `radiance` of (place, direction)
    /// where the patch lies behind, and of zero elsewhere.
    pub(crate) fn mean_of(
        &self,
        boundary: &Boundary,
        mut radiance: impl FnMut(DVec3, DVec3) -> f64,
    ) -> f64 {
        let breaks = self.breaks(boundary);
        let mut ends = Vec::new();
        let mut sum = 0.0;
        for pair in breaks.windows(2) {
            let ((low, is_root_low), (high, is_root_high)) = (pair[0], pair[1]);
            let (middle, half) = (f64::midpoint(low, high), (high - low) / 2.0);
            let has_root = is_root_low || is_root_high;
            let rules = &self.rules;
            let across = if has_root { &rules.across_roots } else { &rules.across };
            for (node, weight) in across {
                // The chord at x = sin ψ ends at y = ±cos ψ, and dx = cos ψ dψ.
                let (at, rim) = libm::sincos(middle + half * node);
                let Some((origin, along)) = self.line(at) else { continue };
                boundary.chords(origin, along, &mut ends);
                for part in ends.chunks_exact(2) {
                    let (low, high) = (part[0].max(-rim), part[1].min(rim));
                    if low < high {
                        let chord = self.chord(at, low, high, (origin, along), &mut radiance);
                        sum += weight * half * rim * chord;
                    }
                }
            }
        }
        sum / core::f64::consts::PI
    }

    /// ∫ h⁴/r⁴ L dy over a part of the chord at x.
    fn chord(
        &self,
        x: f64,
        low: f64,
        high: f64,
        (origin, along): (DVec2, DVec2),
        radiance: &mut impl FnMut(DVec3, DVec3) -> f64,
    ) -> f64 {
        let (middle, half) = (f64::midpoint(low, high), (high - low) / 2.0);
        let h2 = self.beam.separation_m() * self.beam.separation_m();
        let mut sum = 0.0;
        for (node, weight) in &self.rules.along {
            let y = middle + half * node;
            let to_pupil = self.pupil - (self.centre + self.x * x + self.y * y);
            let r2 = to_pupil.length_squared();
            let seen = (origin + along * y).extend(0.0);
            sum += weight * (h2 / r2) * (h2 / r2) * radiance(seen, to_pupil / libm::sqrt(r2));
        }
        sum * half
    }

    /// The line of the sample's plane behind the chord at x, by the chord's own parameter. `None`
    /// if there is none behind.
    fn line(&self, x: f64) -> Option<(DVec2, DVec2)> {
        let from_pupil = self.centre + self.x * x - self.pupil;
        if from_pupil.z >= 0.0 {
            return None;
        }
        let stretch = self.pupil.z / -from_pupil.z;
        let origin = self.pupil + from_pupil * stretch;
        let sound = stretch.is_finite() && origin.is_finite();
        sound.then(|| (origin.truncate(), self.y.truncate() * stretch))
    }

    /// Where a point of the sample's plane is seen on the stop, which is the unit disk.
    fn on_stop(&self, point: DVec2) -> Option<DVec2> {
        let ray = point.extend(0.0) - self.pupil;
        let before = ray.dot(self.axis);
        if before >= 0.0 {
            return None;
        }
        let across =
            ray * ((self.centre - self.pupil).dot(self.axis) / before) - (self.centre - self.pupil);
        let radius = self.beam.stop_radius_m();
        Some(DVec2::new(across.dot(self.x), across.dot(self.y)) / (radius * radius))
    }

    /// Angles ψ of chords (at x = sin ψ) at which the outline's shape along them changes, with
    /// both ends; and whether it does so as a square root.
    fn breaks(&self, boundary: &Boundary) -> Vec<(f64, bool)> {
        let (mut breaks, mut roots) = (vec![-1.0, 1.0], Vec::new());
        match boundary {
            Boundary::Circle { centre, radius } => {
                self.tangents(*centre, *radius, &mut roots);
                self.circle_crossings(*centre, *radius, &mut breaks);
            }
            Boundary::Polygon(corners) => {
                let seen = corners.iter().filter_map(|corner| self.on_stop(*corner));
                breaks.extend(seen.filter(|at| at.length_squared() < 1.0).map(|at| at.x));
                for (a, b) in edges(corners) {
                    self.edge_crossings(a, b, &mut breaks);
                }
            }
        }
        let all =
            breaks.into_iter().map(|at| (at, false)).chain(roots.into_iter().map(|at| (at, true)));
        let within = all.filter(|(at, _)| (-1.0..=1.0).contains(at));
        let mut breaks: Vec<(f64, bool)> =
            within.map(|(at, is_root)| (libm::asin(at), is_root)).collect();
        breaks.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        breaks
    }

    /// Where an edge's line crosses the stop's rim.
    fn edge_crossings(&self, a: DVec2, b: DVec2, breaks: &mut Vec<f64>) {
        // The plane through pupil and edge, cut with the stop's plane.
        let normal = (a.extend(0.0) - self.pupil).cross(b.extend(0.0) - self.pupil);
        let across = DVec2::new(normal.dot(self.x), normal.dot(self.y));
        let Some(unit) = across.try_normalize() else { return };
        let off = -normal.dot(self.centre - self.pupil) / across.length();
        let square = (1.0 - off) * (1.0 + off);
        if square > 0.0 {
            let half = libm::sqrt(square);
            breaks.extend([off * unit.x - half * unit.y, off * unit.x + half * unit.y]);
        }
    }

    /// The chords whose lines touch a circle.
    fn tangents(&self, centre: DVec2, radius: f64, breaks: &mut Vec<f64>) {
        let across = self.y.truncate().perp().normalize_or_zero() * radius;
        let touching = [centre - across, centre + across];
        breaks.extend(touching.into_iter().filter_map(|at| self.on_stop(at)).map(|at| at.x));
    }

    /// Where a circle crosses the stop's rim.
    fn circle_crossings(&self, centre: DVec2, radius: f64, breaks: &mut Vec<f64>) {
        let outside = |angle: f64| {
            let (sin, cos) = libm::sincos(angle);
            let (origin, along) = self.line(cos)?;
            Some((origin + along * sin).distance_squared(centre) - radius * radius)
        };
        let step = TAU / f64::from(LOOKS);
        let mut before = outside(0.0);
        for i in 0..LOOKS {
            let (mut low, mut high) = (step * f64::from(i), step * f64::from(i + 1));
            let then = outside(high);
            if let (Some(first), Some(last)) = (before, then)
                && (first > 0.0) != (last > 0.0)
            {
                for _ in 0..HALVINGS {
                    let middle = f64::midpoint(low, high);
                    match outside(middle) {
                        Some(value) if (value > 0.0) == (first > 0.0) => low = middle,
                        _ => high = middle,
                    }
                }
                breaks.push(libm::cos(low));
            }
            before = then;
        }
    }
}

#[cfg(test)]
mod tests {
    use radiometry::beam::disk_rule;

    use super::*;

    /// What all of the pupil sees of a patch, as a part of the beam.
    fn part(beam: &Beam, boundary: &Boundary, theta_deg: f64, along: usize, pupil: usize) -> f64 {
        let (sin, cos) = libm::sincos(theta_deg.to_radians());
        let placed = Placed::new(DVec3::ZERO, DVec3::new(0.6 * sin, 0.8 * sin, cos));
        let rules = Rules::new(8, along);
        let sum: f64 = disk_rule(pupil)
            .into_iter()
            .filter_map(|(at, w)| Some((Sight::new(beam, &rules, &placed, at)?, w)))
            .map(|(sight, weight)| weight * sight.mean_of(boundary, |_, _| 1.0))
            .sum();
        let (r, s, h) = (beam.pupil_radius_m(), beam.stop_radius_m(), beam.separation_m());
        let root = core::f64::consts::PI * (r / h) * s;
        sum * root * root / beam.throughput().unwrap().m2_sr()
    }

    #[test]
    fn a_patch_that_fills_the_beam_is_all_of_it() {
        let beam = Beam::of_spot(0.006_25, 0.002_5, 0.3).unwrap();
        let wide = [
            Boundary::of_rectangle((-1.0, 1.0), (-1.0, 1.0)),
            Boundary::Circle { centre: DVec2::new(0.1, 0.1), radius: 1.0 },
        ];
        for boundary in wide {
            for theta in [0.0, 30.0, 60.0, 80.0, 87.0] {
                let all = part(&beam, &boundary, theta, 2, 5);
                assert!((all - 1.0).abs() < 1e-8, "{boundary:?} at {theta}°: {all}");
            }
        }
    }

    #[test]
    fn a_patch_that_ends_at_the_axis_is_half_of_it() {
        let beam = Beam::of_spot(0.006_25, 0.002_5, 0.3).unwrap();
        // A large square whose edge goes through the origin along the beam's lean.
        let along = DVec2::new(0.6, 0.8);
        let corners = [along, -along, -along + along.perp(), along + along.perp()];
        let half = Boundary::Polygon(corners.to_vec());
        for theta in [0.0, 30.0, 60.0, 80.0, 87.0] {
            for pupil in [3, 7, 13] {
                let part = part(&beam, &half, theta, 2, pupil);
                println!("{theta} {pupil} {:e}", part - 0.5);
                assert!((part - 0.5).abs() < 5e-8, "{theta}°, {pupil}: {part}");
            }
        }
    }
}
