//! Cubic B-splines over the hemisphere: in θ between normal and horizon, round φ in every band of θ
//! as many as its circle is long, so that they are about as wide everywhere.
//!
//! At the pole a field that is smooth in space is 1, θ cos φ, θ sin φ, θ² cos 2φ, ... and nothing
//! else. So the band that begins at the pole and the one after hold sines and cosines instead of
//! splines round φ: of order 0 the two of them together, which have no slope at the pole; of order
//! 1 the second; the third holds orders up to 2. From the fourth on, where the splines begin with
//! θ³, there are splines in φ ("polar splines", after Toshniwal, Speleers, Hiemstra and Hughes
//! 2017). The sum of those of order 0 and of all others is 1.
//!
//! A stretch of θ may have narrower spans, and in it a stretch of φ: every band of θ has breaks of its
//! own round φ, so that a lobe is followed without a finer mesh all round.

use super::spec::{Around, Fine};
use glam::DVec3;
use radiometry::DomainError;
use radiometry::basis::{Active, BSpline};
use radiometry::quadrature::gauss_legendre;
use std::f64::consts::{FRAC_PI_2, TAU};

/// The functions round φ of one band.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Band {
    /// 1, cos φ, sin φ, cos 2φ, ... from order `first` to `last`.
    Orders { first: usize, last: usize },
    /// Periodic B-splines.
    Local(Round),
}

/// The spans of φ of one band: so many equal ones, of which the first of a stretch and those up to its
/// end (counted on beyond a full turn) are cut into equal parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Round {
    count: usize,
    from: usize,
    to: usize,
    parts: usize,
}

impl Band {
    pub(crate) fn len(self) -> usize {
        match self {
            Self::Orders { first: 0, last } => 2 * last + 1,
            Self::Orders { first, last } => 2 * (last + 1 - first),
            Self::Local(round) => round.len(),
        }
    }
}

impl Round {
    const fn even(count: usize) -> Self {
        Self { count, from: 0, to: 0, parts: 1 }
    }

    /// Of so many equal spans those cut that the stretch, of spans round the horizon, reaches into.
    fn within(count: usize, around: Around, phi_spans: usize) -> Self {
        let from = around.from * count / phi_spans.max(1);
        let to = (around.to * count).div_ceil(phi_spans.max(1)).min(from + count);
        Self { count, from, to, parts: 1 << around.halvings }
    }

    fn len(self) -> usize {
        self.count + (self.to - self.from) * (self.parts - 1)
    }

    /// Where spans begin and end, from 0 to a full turn.
    fn breaks(self) -> Vec<f64> {
        let is_cut = |k: usize| {
            (self.from..self.to).contains(&k) || (self.from..self.to).contains(&(k + self.count))
        };
        let within = (0..self.count).flat_map(|k| {
            let parts = if is_cut(k) { self.parts } else { 1 };
            (0..parts).map(move |i| k as f64 + i as f64 / parts as f64)
        });
        let turn = |at: f64| TAU * at / self.count as f64;
        within.chain([self.count as f64]).map(turn).collect()
    }

    /// The fewest equal spans that are nowhere wider.
    fn finest(self) -> usize {
        self.count * if self.to > self.from { self.parts } else { 1 }
    }
}

/// Where the spans of θ begin and end.
fn breaks(theta_spans: usize, fine: Fine) -> Vec<f64> {
    let spans = theta_spans.max(1);
    let parts = |i: usize| if (fine.from..fine.to).contains(&i) { 1 << fine.halvings } else { 1 };
    let within = (0..spans).flat_map(|i| {
        let parts = parts(i);
        (0..parts).map(move |k| i as f64 + f64::from(k) / f64::from(parts))
    });
    within.chain([spans as f64]).map(|at| FRAC_PI_2 * at / spans as f64).collect()
}

/// The bands of θ, from the pole; the first one's function of θ is the sum of the first two splines,
/// the second's the second.
pub(crate) fn bands(
    theta_spans: usize,
    phi_spans: usize,
    fine: Fine,
) -> impl Iterator<Item = Band> {
    let breaks = breaks(theta_spans, fine);
    let width = |span: &[f64]| span[1] - span[0];
    let widest = breaks.windows(2).map(width).fold(0.0, f64::max);
    let edge = |span: usize| FRAC_PI_2 * span as f64 / theta_spans.max(1) as f64;
    let stretch = edge(fine.from)..=edge(fine.to);
    (0..breaks.len() - 1 + DEGREE).map(move |i| match i {
        0 => Band::Orders { first: 0, last: 0 },
        1 => Band::Orders { first: 1, last: 1 },
        2 => Band::Orders { first: 0, last: 2 },
        _ => {
            let theta_rad = greville(i, &breaks);
            let is_cut = !fine.around.is_none() && stretch.contains(&theta_rad);
            // Where a stretch of φ is finer it is that which follows the lobe.
            let finer = if fine.around.is_none() { finer(theta_rad, &breaks, widest) } else { 1.0 };
            let round = (libm::sin(theta_rad) * finer).min(1.0);
            let round = libm::round(phi_spans as f64 * round);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // small, positive
            let count = (round as usize).max(PHI_SPANS_MIN);
            let even = Round::even(count);
            Band::Local(if is_cut { Round::within(count, fine.around, phi_spans) } else { even })
        }
    })
}

/// How many times narrower the span at θ is than the widest. A lobe that is narrow in θ near the pole
/// bends in φ as much as one at the horizon.
fn finer(theta_rad: f64, breaks: &[f64], widest: f64) -> f64 {
    let end = breaks.partition_point(|at| *at <= theta_rad).max(1);
    let own = breaks.get(end).map_or(widest, |at| at - breaks[end - 1]);
    // Halved spans are narrower by whole powers of 2.
    libm::round(widest / own)
}

/// Where spline `i` over these breaks is centred: Greville's abscissa.
fn greville(i: usize, breaks: &[f64]) -> f64 {
    let knot = |k: usize| breaks[k.saturating_sub(DEGREE).min(breaks.len() - 1)];
    (1..=DEGREE).map(|k| knot(i + k)).sum::<f64>() / DEGREE as f64
}

/// All functions, ready to be evaluated.
#[derive(Debug, Clone)]
pub(crate) struct PolarSplines {
    theta: BSpline,
    bands: Vec<Placed>,
    len: usize,
    breaks: Vec<f64>,
    phi_spans: usize,
    /// The fewest equal spans of φ that are nowhere wider than the narrowest.
    phi_finest: usize,
}

#[derive(Debug, Clone)]
struct Placed {
    band: Band,
    /// Of its first function.
    at: usize,
    /// Of [`Band::Local`].
    round: Option<BSpline>,
    /// ∫ dφ of the functions of [`Band::Local`].
    turns: Vec<f64>,
}

impl Placed {
    /// The spans of φ, where some are cut.
    fn cut(&self) -> Option<Round> {
        match self.band {
            Band::Local(round) if round.to > round.from => Some(round),
            _ => None,
        }
    }

    /// The fewest equal places round the circle that tell its functions apart.
    fn finest(&self) -> usize {
        self.cut().map_or(self.band.len(), Round::finest)
    }
}

/// The functions of θ or of φ that are not zero at a place.
type Few = Active<{ DEGREE + 1 }>;

/// A value or a derivative: of this order in θ, and in φ.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Derivative {
    pub(crate) theta: usize,
    pub(crate) phi: usize,
}

impl PolarSplines {
    pub(crate) fn new(
        theta_spans: usize,
        phi_spans: usize,
        fine: Fine,
    ) -> Result<Self, DomainError> {
        let breaks = breaks(theta_spans, fine);
        let mut placed = Vec::with_capacity(breaks.len() + DEGREE);
        let (mut at, mut phi_finest) = (0, phi_spans);
        for band in bands(theta_spans, phi_spans, fine) {
            let (mut round, mut turns) = (None, Vec::new());
            if let Band::Local(spans) = band {
                let splines = BSpline::periodic(DEGREE, &spans.breaks())?;
                turns.resize(splines.len(), 0.0);
                let (from, to) = splines.domain();
                splines.integrals(from, to, &mut turns)?;
                round = Some(splines);
                phi_finest = phi_finest.max(spans.finest());
            }
            placed.push(Placed { band, at, round, turns });
            at += band.len();
        }
        let theta = BSpline::open(DEGREE, &breaks)?;
        Ok(Self { theta, bands: placed, len: at, breaks, phi_spans, phi_finest })
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// The most places of a grid over a quarter turn that tell the functions apart.
    pub(crate) fn fineness(&self) -> usize {
        let narrowest = self.breaks.windows(2).map(|two| two[1] - two[0]).fold(FRAC_PI_2, f64::min);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count
        let along = libm::ceil(FRAC_PI_2 / narrowest - 1e-6) as usize + DEGREE;
        along.max(self.phi_finest.div_ceil(2))
    }

    /// Two polar angles a span of θ, and two azimuths a function that goes round there.
    pub(crate) fn rings(&self) -> Vec<(f64, usize)> {
        let spans = self.breaks.windows(2).enumerate();
        let rings = spans.flat_map(|(i, span)| {
            // The splines that are not zero over the span.
            let round = self.bands[i..=i + DEGREE].iter().map(Placed::finest).max();
            let round = 2 * round.unwrap_or(1);
            [(span[0], round), (f64::midpoint(span[0], span[1]), round)]
        });
        rings.collect()
    }

    /// All values in a direction; below the horizon those at it.
    pub(crate) fn evaluate_direction(&self, d: DVec3, out: &mut [f64]) {
        out.fill(0.0);
        self.each_along(d, |k, value| out[k] += value);
    }

    /// The value with these coefficients in a direction given by its angles.
    pub(crate) fn value(&self, coefficients: &[f64], theta_rad: f64, phi_rad: f64) -> f64 {
        let mut sum = 0.0;
        self.each_towards(theta_rad, phi_rad, |k, value| sum += coefficients[k] * value);
        sum
    }

    /// Hands on every function that may not be zero in a direction, some in two parts; below the
    /// horizon those at it.
    pub(crate) fn each_along(&self, d: DVec3, hand: impl FnMut(usize, f64)) {
        let theta_rad = libm::atan2(libm::hypot(d.x, d.y), d.z);
        self.each_towards(theta_rad, libm::atan2(d.y, d.x), hand);
    }

    /// The same in a direction given by its angles.
    pub(crate) fn each_towards(&self, theta_rad: f64, phi_rad: f64, hand: impl FnMut(usize, f64)) {
        let value = Derivative { theta: 0, phi: 0 };
        // Within the domain by the clamp.
        let done = self.each(theta_rad, phi_rad, value, hand);
        debug_assert!(done.is_ok(), "a direction has a θ and a φ");
    }

    /// Hands on every function whose derivative may not be zero, in θ and φ.
    pub(crate) fn each(
        &self,
        theta_rad: f64,
        phi_rad: f64,
        order: Derivative,
        mut hand: impl FnMut(usize, f64),
    ) -> Result<(), DomainError> {
        let theta_rad = theta_rad.clamp(0.0, FRAC_PI_2);
        // Within the turn that the bands' breaks are counted in.
        let phi_rad = if phi_rad < 0.0 { phi_rad + TAU } else { phi_rad };
        let across: Few = self.theta.active(theta_rad, order.theta)?;
        // Towards the horizon neighbouring bands often have the same functions round φ.
        let mut last: Option<(Band, Few)> = None;
        for (i, along) in across.iter() {
            // The first band's function of θ is the first spline and the second.
            if i == 1 && order.phi == 0 {
                hand(self.bands[0].at, along);
            }
            let placed = &self.bands[i];
            match (&placed.round, placed.band) {
                (Some(round), band) => {
                    if last.as_ref().is_none_or(|(before, _)| *before != band) {
                        last = Some((band, round.active(phi_rad, order.phi)?));
                    }
                    let Some((_, around)) = &last else { continue };
                    around.iter().for_each(|(j, value)| hand(placed.at + j, along * value));
                }
                (None, Band::Orders { first, last }) => {
                    let mut at = placed.at;
                    for m in first..=last {
                        let [cos, sin] = wave(m, phi_rad, order.phi);
                        hand(at, along * cos);
                        at += 1;
                        if m > 0 {
                            hand(at, along * sin);
                            at += 1;
                        }
                    }
                }
                (None, Band::Local(_)) => {}
            }
        }
        Ok(())
    }

    /// What the coefficients of the constant 1 are.
    pub(crate) fn unity(&self, out: &mut [f64]) {
        out.fill(0.0);
        for placed in &self.bands {
            match placed.band {
                Band::Orders { first: 0, .. } => out[placed.at] = 1.0,
                Band::Orders { .. } => {}
                Band::Local(round) => out[placed.at..][..round.len()].fill(1.0),
            }
        }
    }

    /// ∫ cos θ dω of every function over the cone.
    pub(crate) fn integrals_within(
        &self,
        theta_max_rad: f64,
        out: &mut [f64],
    ) -> Result<(), DomainError> {
        out.fill(0.0);
        let rule = gauss_legendre(GAUSS);
        let mut over_theta = vec![0.0; self.theta.len()];
        for (low, high) in self.theta.spans() {
            let high = high.min(theta_max_rad);
            if low >= high {
                break;
            }
            let (middle, half) = (f64::midpoint(low, high), (high - low) / 2.0);
            for (node, weight) in &rule {
                let theta = middle + half * node;
                let (sin, cos) = libm::sincos(theta);
                for (i, value) in self.theta.nonzero(theta)?.iter() {
                    over_theta[i] += weight * half * sin * cos * value;
                }
            }
        }
        out[self.bands[0].at] = TAU * over_theta[1];
        for (placed, over_theta) in self.bands.iter().zip(&over_theta) {
            match placed.band {
                Band::Orders { first: 0, .. } => out[placed.at] += TAU * over_theta,
                Band::Orders { .. } => {}
                Band::Local(_) => {
                    let out = out[placed.at..].iter_mut().zip(&placed.turns);
                    out.for_each(|(out, turn)| *out = turn * over_theta);
                }
            }
        }
        Ok(())
    }

    /// Nodes that integrate products of two functions' derivatives over the hemisphere, with
    /// weights sin θ dθ dφ: exact but for the sine where the splines round φ have their knots at
    /// the nodes' spans, and close to it elsewhere.
    pub(crate) fn nodes(&self) -> Vec<(f64, f64, f64)> {
        let rule = gauss_legendre(DEGREE + 1);
        let mut nodes = Vec::new();
        for (i, (low, high)) in self.theta.spans().enumerate() {
            let (middle, half) = (f64::midpoint(low, high), (high - low) / 2.0);
            let round = self.nodes_round(&self.bands[i..=i + DEGREE]);
            for (node, weight) in &rule {
                let theta = middle + half * node;
                let weight = weight * half * libm::sin(theta);
                nodes.extend(round.iter().map(|(phi, turn)| (theta, *phi, weight * turn)));
            }
        }
        nodes
    }

    /// Nodes round φ for the functions of these bands: evenly, or where a stretch is finer by a rule in
    /// each span of the finest band.
    fn nodes_round(&self, bands: &[Placed]) -> Vec<(f64, f64)> {
        let cut = bands.iter().filter_map(Placed::cut).max_by_key(|round| round.len());
        let Some(round) = cut else {
            let count = 3 * self.phi_spans.max(2 * PHI_SPANS_MIN);
            let turn = TAU / count as f64;
            return (0..count).map(|k| (turn * (k as f64 + 0.5), turn)).collect();
        };
        let rule = gauss_legendre(DEGREE);
        let breaks = round.breaks();
        let spans =
            breaks.windows(2).map(|span| (f64::midpoint(span[0], span[1]), span[1] - span[0]));
        let nodes = spans.flat_map(|(middle, width)| {
            rule.iter()
                .map(move |(node, weight)| (middle + 0.5 * width * node, 0.5 * width * weight))
        });
        nodes.collect()
    }

    /// Where a function is centred.
    pub(crate) fn name(&self, k: usize) -> String {
        let at = self.bands.partition_point(|placed| placed.at <= k) - 1;
        let placed = &self.bands[at];
        let theta_deg = greville(at, &self.breaks).to_degrees();
        match placed.band {
            Band::Local(round) => {
                // A cubic spline is centred two spans after its support begins; the first one's
                // begins three spans before φ = 0.
                let (breaks, len) = (round.breaks(), round.len());
                let phi_deg = breaks[(k - placed.at + len - 1) % len].to_degrees();
                format!("B({theta_deg:.1}°,{phi_deg:.1}°)")
            }
            Band::Orders { first, .. } => {
                let place = k - placed.at + usize::from(first != 0);
                let m = place.div_ceil(2);
                match (m, place % 2) {
                    (0, _) => format!("B({theta_deg:.1}°)"),
                    (m, 1) => format!("B({theta_deg:.1}°) cos {m}φ"),
                    (m, _) => format!("B({theta_deg:.1}°) sin {m}φ"),
                }
            }
        }
    }
}

/// cos mφ and sin mφ, or their derivatives.
fn wave(m: usize, phi_rad: f64, order: usize) -> [f64; 2] {
    let m = m as f64;
    let (sin, cos) = libm::sincos(m * phi_rad);
    match order {
        0 => [cos, sin],
        1 => [-m * sin, m * cos],
        _ => [-m * m * cos, -m * m * sin],
    }
}

/// Cubic: the field and its first two derivatives are continuous.
const DEGREE: usize = 3;
/// Fewer splines round a circle than these tell no lobe's direction; those next to the pole.
pub(super) const PHI_SPANS_MIN: usize = 6;
/// Nodes of a span's integral: a cubic times sin θ cos θ is exact to rounding.
const GAUSS: usize = 10;
