//! What is not known between the sweeps, and which further sweeps lessen it the most for their time.
//!
//! At each θ the values of all sweeps are interpolated over azimuth and place, and each sweep left out
//! in turn says how good that is there. Where the others miss it by more than the interpolation
//! expects, its surroundings are taken to be as bad: that is what makes the choice go to lobes.

use fit::kriging::{Kriging, Place, Unknown};

use super::Terms;
use super::scans::{Nodes, Scan, knots, place};
use crate::plan::Meridian;
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

/// What the sweeps so far leave open.
pub(super) struct Between {
    nodes: Nodes,
    candidates: Vec<Meridian>,
    /// Node by node, over candidates' positive sides and then their negative ones.
    unknown: Vec<Unknown>,
    noise: Vec<f64>,
    /// Mean square of the radiance, weighted.
    signal: f64,
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
        let knots = knots(terms, scans, &self.nodes, node);
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
        let noise = knots.iter().map(|knot| knot.variance).sum::<f64>() / knots.len() as f64;
        self.signal += weight * square;
        self.noise_square += weight * noise;
        self.noise.push(noise);
        self.unknown.push(field.unknown(&places).scaled(&factors));
        Some(())
    }

    /// The root mean square error that is expected between the sweeps, relative to the radiance's
    /// root mean square.
    pub(super) fn relative(&self) -> f64 {
        let count = (self.candidates.len() * self.sides) as f64;
        let of = |(unknown, weight): (&Unknown, &f64)| weight * unknown.total() / count;
        let square: f64 = self.unknown.iter().zip(&self.nodes.weights).map(of).sum();
        libm::sqrt(square / self.signal)
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
            let tried = free.iter().filter_map(|candidate| {
                let way_s = self.way_s(terms, &stands, *candidate);
                let (from, to, gain, time_s) = self.best_part(terms, *candidate, way_s)?;
                Some((*candidate, from, to, gain / time_s, time_s))
            });
            let best = tried.max_by(|a, b| a.3.total_cmp(&b.3));
            let Some((candidate, from, to, rate, time_s)) = best.filter(|best| best.3 > 0.0) else {
                break;
            };
            debug_assert!(rate.is_finite(), "a sweep takes time");
            free.retain(|other| *other != candidate);
            self.learn(candidate, from, to);
            let whole = self.candidates[candidate];
            stands.push(counts(terms, &whole));
            let theta_rad = self.range(&whole, from, to);
            chosen.push(Meridian { theta_rad, ..whole });
            left_s -= time_s;
        }
        chosen
    }

    /// Whole candidates, as many as that and one at least: spread evenly over azimuths and places.
    pub(super) fn evenly(&self, count: f64) -> Vec<Meridian> {
        let far = |i: &usize| (*i as f64) < count.max(1.0);
        let taken = self.candidates.iter().enumerate().take_while(|(i, _)| far(i));
        taken.map(|(_, candidate)| *candidate).collect()
    }

    /// Time to come to a candidate from the nearest of the places where the axes will have stood.
    fn way_s(&self, terms: &Terms, stands: &[Latched], candidate: usize) -> f64 {
        let to = counts(terms, &self.candidates[candidate]);
        let time = |stand: &Latched| terms.rig.move_duration(*stand, to).as_secs_f64();
        stands.iter().map(time).fold(f64::INFINITY, f64::min)
    }

    /// The part of a candidate's way, in signed nodes, with the most gain for its time; the gain, and
    /// the time.
    fn best_part(
        &self,
        terms: &Terms,
        candidate: usize,
        way_s: f64,
    ) -> Option<(usize, usize, f64, f64)> {
        let gains: Vec<f64> = (0..self.signed()).map(|at| self.gain(candidate, at)).collect();
        let mut sums = vec![0.0];
        for gain in &gains {
            sums.push(sums[sums.len() - 1] + gain);
        }
        let parts = (0..gains.len())
            .flat_map(|from| (from + NODES_MIN..=gains.len()).map(move |to| (from, to)));
        let rated = parts.map(|(from, to)| {
            let span = (to - from) as f64 * self.nodes.step_rad;
            let time_s = terms.pace.around_s + way_s + span * terms.pace.seconds_per_rad;
            (from, to, sums[to] - sums[from], time_s)
        });
        rated.max_by(|a, b| (a.2 / a.3).total_cmp(&(b.2 / b.3)))
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

    fn gain(&self, candidate: usize, at: usize) -> f64 {
        let (node, ray) = self.node(candidate, at);
        self.nodes.weights[node] * self.unknown[node].reduction(ray, self.noise[node])
    }

    fn learn(&mut self, candidate: usize, from: usize, to: usize) {
        for at in from..to {
            let (node, ray) = self.node(candidate, at);
            let noise = self.noise[node];
            self.unknown[node].learn(ray, noise);
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
    let ratio = |(knot, left_out): (&fit::kriging::Knot, &fit::kriging::LeftOut)| {
        let expected = (left_out.variance - knot.variance).max(1e-3 * left_out.variance);
        let seen = (left_out.error * left_out.error - knot.variance).max(0.0);
        (knot.at, seen / expected)
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
