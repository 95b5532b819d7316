//! What is not known between the sweeps, and which further sweeps lessen it the most for their time.
//!
//! At each θ the values of all sweeps are interpolated over azimuth and place, and each sweep left out
//! in turn says how good that is there. Where the others miss it by more than the interpolation
//! expects, its surroundings are taken to be as bad: that is what makes the choice go to lobes.

use std::time::Duration;

use fit::kriging::{Kriging, Place, Unknown};

use super::Terms;
use super::scans::{Nodes, Scan, knots, place};
use crate::plan::{Meridian, SweepPace};
use crate::rig::{AxisPositions, Latched};

/// Rays at each θ where the field is asked for: half of them candidates' one side, half their other.
const CANDIDATES: u32 = 96;
/// Lengths over azimuth that are tried, in narrowest widths, ...
const ARCS: [f64; 5] = [0.7, 1.5, 3.0, 6.0, 15.0];
/// ... and over the sample, in halves of the region.
const SPANS: [f64; 3] = [0.7, 2.0, 6.0];
/// A left-out sweep speaks for its surroundings up to so many lengths away ...
const SPEAKS_LENGTHS: f64 = 1.0;
/// ... and all of them together as loud as this part of one.
const ALL_SPEAK: f64 = 0.3;
/// A short sweep has this many nodes at least: less is not worth the way there.
const NODES_MIN: usize = 3;

/// A part of a candidate's way, in signed nodes.
struct Part {
    candidate: usize,
    from: usize,
    to: usize,
    pace: SweepPace,
    gain: f64,
    time_s: f64,
}

impl Part {
    fn rate(&self) -> f64 {
        self.gain / self.time_s
    }
}

/// What a reading at a node is worth.
struct Worth {
    /// If it had no noise, weighted.
    without_noise: f64,
    /// Of what is not known there.
    variance: f64,
    /// Of a value there at the plan's pace.
    noise: f64,
}

impl Worth {
    /// So many times as slow as by the plan's windows: that pays where the noise counts.
    fn gain(&self, slower: f64) -> f64 {
        let whole = self.variance + self.noise / slower;
        if whole > 0.0 { self.without_noise * self.variance / whole } else { 0.0 }
    }
}

/// What the sweeps so far leave open.
pub(super) struct Between {
    nodes: Nodes,
    candidates: Vec<Meridian>,
    /// Node by node, over candidates' positive sides and then their negative ones.
    unknown: Vec<Unknown>,
    /// Of a value there at the plan's pace.
    noise: Vec<f64>,
    /// Mean square of the radiance, weighted.
    signal: f64,
    /// Mean square of the error between the sweeps, had their readings no noise, weighted.
    open: f64,
    /// Of one reading at a node, weighted.
    noise_square: f64,
    sides: usize,
}

impl Between {
    /// `None` where the sweeps are too few, or dark.
    pub(super) fn new(terms: &Terms, scans: &[Scan], round: u32) -> Option<Self> {
        let adaptive = terms.adaptive;
        let nodes =
            Nodes::of(terms.plan.region.theta_max_rad, adaptive.narrowest_feature_deg.to_radians());
        let candidate = |i| adaptive.candidate(&terms.plan, &terms.rig, round * CANDIDATES + i);
        let candidates: Vec<Meridian> = (0..CANDIDATES).map(candidate).collect();
        let sides = if candidates[0].theta_rad.0 < 0.0 { 2 } else { 1 };
        let mut between = Self {
            unknown: Vec::new(),
            noise: Vec::new(),
            signal: 0.0,
            open: 0.0,
            noise_square: 0.0,
            sides,
            candidates,
            nodes,
        };
        for node in 0..between.nodes.thetas_rad.len() {
            between.add(terms, scans, node)?;
        }
        (between.signal > 0.0).then_some(between)
    }

    fn add(&mut self, terms: &Terms, scans: &[Scan], node: usize) -> Option<()> {
        let theta = self.nodes.thetas_rad[node];
        let (knots, noise) = knots(terms, scans, &self.nodes, node);
        let narrowest = terms.adaptive.narrowest_feature_deg.to_radians();
        let arcs = ARCS.map(|arc| (arc * narrowest).min(2.0));
        let field = Kriging::likeliest(&knots, &arcs, &SPANS)?;
        let arms = [theta, -theta];
        let places: Vec<Place> = arms[..self.sides]
            .iter()
            .flat_map(|arm| {
                let of = |m: &Meridian| place(terms, *arm, m.phi_rad, m.x_m, m.y_m);
                self.candidates.iter().map(of)
            })
            .collect();
        let factors = scales(&field, &places);
        let weight = self.nodes.weights[node];
        let count = places.len() as f64;
        let square = places.iter().map(|at| field.value(at).powi(2)).sum::<f64>() / count;
        self.signal += weight * square;
        self.noise_square += weight * noise;
        self.noise.push(noise);
        let unknown = field.unknown(&places).scaled(&factors);
        let exact = field.without_noise().map(|exact| exact.unknown(&places).scaled(&factors));
        self.open += weight * exact.as_ref().unwrap_or(&unknown).total() / count;
        self.unknown.push(unknown);
        Some(())
    }

    /// The root mean square error that is expected between the sweeps, relative to the radiance's
    /// root mean square. Noise is not in it: a fit evens it out, and checks tell how well.
    pub(super) fn relative(&self) -> f64 {
        libm::sqrt(self.open / self.signal)
    }

    /// The noise of one reading, relative alike.
    pub(super) fn noise_relative(&self) -> f64 {
        libm::sqrt(self.noise_square / self.signal)
    }

    /// The mean square of the radiance over the region.
    pub(super) fn mean_square(&self) -> f64 {
        self.signal / self.nodes.weights.iter().sum::<f64>()
    }

    /// The sweeps that lessen the error the most for their time, one after the other as if those
    /// before were measured, until their time is used up.
    pub(super) fn choose(&mut self, terms: &Terms, here: Latched, seconds: f64) -> Vec<Meridian> {
        let mut chosen: Vec<Meridian> = Vec::new();
        let mut stands = vec![here];
        let mut left_s = seconds;
        let mut free: Vec<usize> = (0..self.candidates.len()).collect();
        while left_s > 0.0 && !free.is_empty() {
            let rated = free.iter().flat_map(|candidate| {
                let way_s = self.way_s(terms, &stands, *candidate);
                let worths = self.worths(*candidate);
                let part = |pace| self.best_part(terms, *candidate, &worths, pace, way_s);
                terms.paces.iter().filter_map(part).collect::<Vec<Part>>()
            });
            let best = rated.max_by(|a, b| a.rate().total_cmp(&b.rate()));
            let Some(part) = best.filter(|part| part.rate() > 0.0) else { break };
            debug_assert!(part.rate().is_finite(), "a sweep takes time");
            free.retain(|other| *other != part.candidate);
            self.learn(terms, &part);
            let whole = self.candidates[part.candidate];
            stands.push(counts(terms, &whole));
            let theta_rad = self.range(&whole, part.from, part.to);
            chosen.push(Meridian { theta_rad, window: part.pace.window, ..whole });
            left_s -= part.time_s;
        }
        chosen
    }

    /// Whole candidates, as many as that and one at least: spread evenly over azimuths and places, with
    /// windows of one length.
    pub(super) fn evenly(&self, count: f64, window: Duration) -> Vec<Meridian> {
        let far = |i: &usize| (*i as f64) < count.max(1.0);
        let taken = self.candidates.iter().enumerate().take_while(|(i, _)| far(i));
        taken.map(|(_, candidate)| Meridian { window, ..*candidate }).collect()
    }

    /// Time to come to a candidate from the nearest of the places where the axes will have stood.
    fn way_s(&self, terms: &Terms, stands: &[Latched], candidate: usize) -> f64 {
        let to = counts(terms, &self.candidates[candidate]);
        let time = |stand: &Latched| terms.rig.move_duration(*stand, to).as_secs_f64();
        stands.iter().map(time).fold(f64::INFINITY, f64::min)
    }

    /// The part of a candidate's way with the most gain for its time, at one pace.
    fn best_part(
        &self,
        terms: &Terms,
        candidate: usize,
        worths: &[Worth],
        pace: &SweepPace,
        way_s: f64,
    ) -> Option<Part> {
        let slower = pace.slower_than(terms.pace());
        let mut sums = vec![0.0];
        for worth in worths {
            sums.push(sums[sums.len() - 1] + worth.gain(slower));
        }
        let ends = (0..worths.len())
            .flat_map(|from| (from + NODES_MIN..=worths.len()).map(move |to| (from, to)));
        let parts = ends.map(|(from, to)| {
            let span = (to - from) as f64 * self.nodes.step_rad;
            let time_s = way_s + pace.sweep_s(span);
            let gain = sums[to] - sums[from];
            Part { candidate, from, to, pace: *pace, gain, time_s }
        });
        parts.max_by(|a, b| a.rate().total_cmp(&b.rate()))
    }

    /// Nodes along the arm's whole way.
    fn signed(&self) -> usize {
        self.sides * self.nodes.thetas_rad.len()
    }

    /// The node of a place on the arm's way, and its ray among those at that node.
    fn node(&self, candidate: usize, at: usize) -> (usize, usize) {
        let count = self.nodes.thetas_rad.len();
        if self.sides == 1 {
            (at, candidate)
        } else if at < count {
            (count - 1 - at, candidate + self.candidates.len())
        } else {
            (at - count, candidate)
        }
    }

    /// What reading along a candidate's whole way is worth, node by node.
    fn worths(&self, candidate: usize) -> Vec<Worth> {
        let worth = |at: usize| {
            let (node, ray) = self.node(candidate, at);
            let unknown = &self.unknown[node];
            Worth {
                without_noise: self.nodes.weights[node] * unknown.reduction(ray, 0.0),
                variance: unknown.variance(ray),
                noise: self.noise[node],
            }
        };
        (0..self.signed()).map(worth).collect()
    }

    fn learn(&mut self, terms: &Terms, part: &Part) {
        let slower = part.pace.slower_than(terms.pace());
        for at in part.from..part.to {
            let (node, ray) = self.node(part.candidate, at);
            self.unknown[node].learn(ray, self.noise[node] / slower);
        }
    }

    /// A part's angles of the arm, half a node beyond its nodes' middles.
    fn range(&self, whole: &Meridian, from: usize, to: usize) -> (f64, f64) {
        let edge = |at: usize| {
            let from_low = at as f64 * self.nodes.step_rad;
            (whole.theta_rad.0 + from_low).min(whole.theta_rad.1)
        };
        (edge(from), edge(to))
    }
}

fn counts(terms: &Terms, meridian: &Meridian) -> Latched {
    terms.rig.counts(AxisPositions([0.0, meridian.phi_rad, meridian.x_m, meridian.y_m]))
}

/// How many times as large as expected errors are around each place, by the values left out.
fn scales(field: &Kriging, places: &[Place]) -> Vec<f64> {
    // Where noise is most of an error, chance must not pass for structure.
    let ratio = |(knot, left_out): (&fit::kriging::Knot, &fit::kriging::LeftOut)| {
        let seen = (left_out.error * left_out.error).max(knot.variance);
        (knot.at, seen / left_out.variance)
    };
    let ratios: Vec<(Place, f64)> = field.knots().iter().zip(field.left_out()).map(ratio).collect();
    let mean = ratios.iter().map(|(_, ratio)| ratio).sum::<f64>() / ratios.len() as f64;
    let scale = |at: &Place| {
        let (mut sum, mut weights) = (ALL_SPEAK * mean, ALL_SPEAK);
        for (knot, ratio) in &ratios {
            let distance = field.distance(knot, at) / SPEAKS_LENGTHS;
            let weight = libm::exp(-0.5 * distance * distance);
            sum += weight * ratio;
            weights += weight;
        }
        libm::sqrt(sum / weights)
    };
    places.iter().map(scale).collect()
}
