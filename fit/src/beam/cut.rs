//! Rays of one direction that the sample's outline, the horizon or the end of the position
//! polynomials cuts: an integral over a part of the lens, by chords of the stop that are cut where
//! these are met. Chords are taken between all places where their length changes its shape.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use radiometry::beam::Beam;
use radiometry::quadrature::gauss_legendre;

use super::Outline;
use super::directions::{Node, Ring};
use super::sight::{Line, Shear, Sight};

/// Rules, and room for breaks, made once.
#[derive(Debug, Clone)]
pub(crate) struct Cutter {
    chords: Vec<(f64, f64)>,
    along: Vec<(f64, f64)>,
}

/// What cuts the rays of one direction, in the stop's coordinates.
#[derive(Debug)]
pub(crate) struct Cuts {
    /// Half-planes that the rays must lie in: the outline's sides, the horizon.
    within: Vec<Line>,
    /// Lines at which the integrand breaks.
    breaks: Vec<Line>,
    /// A round outline: its middle in the frame of incidence, and radius.
    round: Option<((f64, f64), f64)>,
}

impl Cuts {
    pub(crate) fn new(
        sight: &Sight,
        shear: &Shear,
        beam: &Beam,
        node: &Node,
        outline: Option<&Outline>,
        ends: &[(bool, (f64, f64))],
    ) -> Self {
        let side = |is_x: bool, at: f64, is_upper: bool| {
            let ((n1, n2), offset) = sight.axis(is_x);
            let sign = if is_upper { 1.0 } else { -1.0 };
            shear.on_stop((sign * n1, sign * n2), sign * (at - offset))
        };
        let sides =
            |is_x: bool, (low, high): (f64, f64)| [side(is_x, low, false), side(is_x, high, true)];
        let mut within = Vec::with_capacity(5);
        let mut round = None;
        match outline {
            Some(Outline::Rectangle { x_m, y_m }) => {
                within.extend(sides(true, *x_m));
                within.extend(sides(false, *y_m));
            }
            Some(Outline::Disk { centre_m, radius_m }) => {
                round = Some((sight.seen(*centre_m), *radius_m));
            }
            None => {}
        }
        // The ray's place on the pupil stands above the plane.
        if sight.sin > 0.0 && sight.has_horizon() {
            let height = beam.pupil_z_m() * sight.cos / sight.sin;
            let r = height - beam.separation_m() * node.slope.0;
            within.push(Line { m: (1.0, 0.0), r });
        }
        let breaks = ends.iter().flat_map(|(is_x, ends)| sides(*is_x, *ends)).collect();
        Self { within, breaks, round }
    }
}

/// A disk of the stop's plane: the stop, or the pupil's shadow.
#[derive(Debug, Clone, Copy)]
struct Circle {
    centre: (f64, f64),
    radius: f64,
}

impl Circle {
    /// The chord at s₁: from and to, in s₂.
    fn chord(&self, s1: f64) -> Option<(f64, f64)> {
        let off = s1 - self.centre.0;
        let square = (self.radius - off) * (self.radius + off);
        let half = (square > 0.0).then(|| square.sqrt())?;
        Some((self.centre.1 - half, self.centre.1 + half))
    }

    /// Where it crosses a line: s₁.
    fn crossings(&self, line: &Line) -> Option<[f64; 2]> {
        let (m1, m2) = line.m;
        let square = m1 * m1 + m2 * m2;
        let off = line.r - m1 * self.centre.0 - m2 * self.centre.1;
        let root = self.radius * self.radius * square - off * off;
        let root = (root > 0.0 && square > 0.0).then(|| root.sqrt())?;
        let foot = self.centre.0 + m1 * off / square;
        Some([foot - m2 * root / square, foot + m2 * root / square])
    }
}

impl Cutter {
    /// For polynomials of this degree in the place.
    pub(crate) fn new(position_degree: usize) -> Self {
        // On t in (-1, 1) the place is sin(πt/2): square roots at the ends of an interval vanish.
        let chords = gauss_legendre(CHORDS).into_iter().map(|(node, weight)| {
            let (sin, cos) = libm::sincos(FRAC_PI_2 * node);
            (sin, weight * FRAC_PI_2 * cos)
        });
        Self { chords: chords.collect(), along: gauss_legendre(position_degree / 2 + 1) }
    }

    /// Calls `at` with places on the stop and their area as a part of the whole lens's.
    pub(crate) fn places(
        &self,
        ring: &Ring,
        node: &Node,
        shear: &Shear,
        cuts: &Cuts,
        mut at: impl FnMut((f64, f64), f64),
    ) {
        let lens = &ring.lens;
        let shadow = (-lens.shift * node.cos, -lens.shift * node.sin);
        let circles = [
            Circle { centre: (0.0, 0.0), radius: lens.stop },
            Circle { centre: shadow, radius: lens.pupil },
        ];
        let breaks = breaks(&circles, shear, cuts);
        let mut ends = Vec::new();
        for pair in breaks.windows(2) {
            let (middle, half) = (f64::midpoint(pair[0], pair[1]), (pair[1] - pair[0]) / 2.0);
            for (t, weight) in &self.chords {
                let s1 = middle + half * t;
                let Some((low, high)) = chord(&circles, shear, cuts, s1) else { continue };
                ends.clear();
                ends.push(low);
                ends.extend(cuts.breaks.iter().filter_map(|line| {
                    let s2 = (line.r - line.m.0 * s1) / line.m.1;
                    (s2 > low && s2 < high).then_some(s2)
                }));
                ends.push(high);
                ends.sort_by(f64::total_cmp);
                for part in ends.windows(2) {
                    let (middle, length) = (f64::midpoint(part[0], part[1]), part[1] - part[0]);
                    let area = weight * half * length / 2.0 / ring.area;
                    for (t, weight) in &self.along {
                        at((s1, middle + t * length / 2.0), area * weight);
                    }
                }
            }
        }
    }
}

/// The part of a chord that is in everything.
fn chord(circles: &[Circle; 2], shear: &Shear, cuts: &Cuts, s1: f64) -> Option<(f64, f64)> {
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for circle in circles {
        let (from, to) = circle.chord(s1)?;
        (low, high) = (low.max(from), high.min(to));
    }
    for Line { m: (m1, m2), r } in &cuts.within {
        let rest = r - m1 * s1;
        if *m2 > 0.0 {
            high = high.min(rest / m2);
        } else if *m2 < 0.0 {
            low = low.max(rest / m2);
        } else if rest < 0.0 {
            return None;
        }
    }
    if let Some(((x, y), radius)) = cuts.round {
        let at = shear.place((s1, 0.0));
        let (off, step) = ((at.0 - x, at.1 - y), shear.across);
        // |off + s₂ step| = radius.
        let square = step.0 * step.0 + step.1 * step.1;
        let aside = (off.0 * step.1 - off.1 * step.0) / square.sqrt();
        let root = (radius - aside) * (radius + aside) / square;
        let half = (root > 0.0).then(|| root.sqrt())?;
        let middle = -(off.0 * step.0 + off.1 * step.1) / square;
        (low, high) = (low.max(middle - half), high.min(middle + half));
    }
    (low < high).then_some((low, high))
}

/// The places along s₁ at which a chord's length may change its shape, rising.
fn breaks(circles: &[Circle; 2], shear: &Shear, cuts: &Cuts) -> Vec<f64> {
    let mut breaks = Vec::with_capacity(32);
    let extent =
        |circle: &Circle| (circle.centre.0 - circle.radius, circle.centre.0 + circle.radius);
    let (a, b) = (extent(&circles[0]), extent(&circles[1]));
    let (low, high) = (a.0.max(b.0), a.1.min(b.1));
    breaks.extend([low, high]);
    let lines = || cuts.within.iter().chain(&cuts.breaks);
    for circle in circles {
        breaks.extend(lines().filter_map(|line| circle.crossings(line)).flatten());
        if let Some(round) = &cuts.round {
            meetings(circle, shear, *round, &mut breaks);
        }
    }
    if let Some(both) = circles[0].crossings(&radical(circles)) {
        breaks.extend(both);
    }
    for (i, a) in lines().enumerate() {
        // Corners; and lines that are chords themselves.
        if a.m.1 == 0.0 && a.m.0 != 0.0 {
            breaks.push(a.r / a.m.0);
        }
        for b in lines().skip(i + 1) {
            let determinant = a.m.0 * b.m.1 - a.m.1 * b.m.0;
            if determinant != 0.0 {
                breaks.push((a.r * b.m.1 - a.m.1 * b.r) / determinant);
            }
        }
    }
    if let Some((centre, radius)) = cuts.round {
        breaks.extend(shear.tangents(centre, radius));
    }
    breaks.retain(|s1| *s1 >= low && *s1 <= high);
    breaks.sort_by(f64::total_cmp);
    let apart = NEGLIGIBLE * circles[0].radius;
    breaks.dedup_by(|next, kept| *next - *kept < apart);
    breaks
}

/// The line through both points that two circles share.
fn radical(circles: &[Circle; 2]) -> Line {
    let [a, b] = circles;
    let m = (2.0 * (b.centre.0 - a.centre.0), 2.0 * (b.centre.1 - a.centre.1));
    let square =
        |c: &Circle| c.centre.0 * c.centre.0 + c.centre.1 * c.centre.1 - c.radius * c.radius;
    Line { m, r: square(b) - square(a) }
}

/// Where a round outline crosses a circle of the stop's plane: s₁, by sign changes between looks.
fn meetings(
    circle: &Circle,
    shear: &Shear,
    ((x, y), radius): ((f64, f64), f64),
    breaks: &mut Vec<f64>,
) {
    let on = |angle: f64| {
        let (sin, cos) = libm::sincos(angle);
        (circle.centre.0 + circle.radius * cos, circle.centre.1 + circle.radius * sin)
    };
    let beyond = |angle: f64| {
        let at = shear.place(on(angle));
        libm::hypot(at.0 - x, at.1 - y) - radius
    };
    let step = TAU / f64::from(LOOKS);
    let mut last = (-PI, beyond(-PI));
    for look in 1..=LOOKS {
        let next = (f64::from(look) * step - PI, beyond(f64::from(look) * step - PI));
        if (last.1 < 0.0) != (next.1 < 0.0) {
            let (mut low, mut high) = (last, next);
            for _ in 0..HALVINGS {
                let middle = f64::midpoint(low.0, high.0);
                let at = (middle, beyond(middle));
                if (at.1 < 0.0) == (low.1 < 0.0) { low = at } else { high = at }
            }
            breaks.push(on(low.0).0);
        }
        last = next;
    }
}

/// Chords between two breaks.
const CHORDS: usize = 5;
/// Looks round a circle for crossings.
const LOOKS: u32 = 24;
/// Halvings of the angle of a crossing: to 1e-9 of the circle, which moves the area by less.
const HALVINGS: u32 = 28;
/// Breaks closer than this, in radii of the stop, are one.
const NEGLIGIBLE: f64 = 1e-9;
