//! What the way through all targets takes at least, whatever their order: a bound below every tour, to
//! say how far the order found is from the best there is.
//!
//! Between two targets nothing is quicker than the quickest of the moves between the positions that
//! see them. Of tours over such times a 1-tree is no longer than the shortest (Held and Karp 1970,
//! Oper. Res. 18, 1138), and is raised by weights on the places until it nearly is a tour (1971, Math.
//! Program. 1, 6).

use super::tree::MoveTime;
use super::{Plan, Sequence, Step};
use crate::rig::{Approach, AxisPositions, ReadingKind, Rig, comes_to_rest, set_out};

/// With more places than this the table of times takes too much memory.
const PLACES_MAX: usize = 2_000;
/// Steps of the ascent in all, in times looked at: less than a second.
const WORK_MAX: usize = 10_000_000;
const ROUNDS: (usize, usize) = (10, 150);

/// A way through all targets or all sweeps, from the reference pose and back to it, each once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Way {
    /// What it takes to move and to settle in the plan's order, seconds; of sweeps to move from where
    /// one comes to rest to where the next sets out.
    pub seconds: f64,
    /// What any order takes at least.
    pub least_s: f64,
}

impl Way {
    /// How much longer it is than the quickest at most, relative.
    pub fn gap(&self) -> f64 {
        if self.least_s > 0.0 { self.seconds / self.least_s - 1.0 } else { 0.0 }
    }
}

impl Plan {
    /// The way of a sequence of this plan, without the readings of the reference pose in between. `None`
    /// of fewer than three targets, or sweeps, of more than 1999, and of sweeps that are taken at rest.
    pub fn way(&self, rig: &Rig, sequence: &Sequence) -> Option<Way> {
        if sequence.sweeps() > 0 {
            return way_of_sweeps(rig, sequence);
        }
        let is_visit = |step: &&Step| {
            step.swept.is_none() && matches!(step.kind, ReadingKind::Target { repeat: 0, .. })
        };
        let visits: Vec<&Step> = sequence.steps.iter().filter(is_visit).collect();
        if visits.len() < 3 || visits.len() >= PLACES_MAX {
            return None;
        }
        let start = sequence.reference.positions;
        let time = MoveTime::of(rig);
        let stops: Vec<AxisPositions> =
            std::iter::once(start).chain(visits.iter().map(|step| step.positions)).collect();
        let next = stops.iter().cycle().skip(1);
        let seconds = stops.iter().zip(next).map(|(a, b)| time.directed(a, b)).sum();
        let seen_from = |step: &&Step| rig.reachable(step.pose?).ok();
        let mut places = vec![vec![start]];
        places.extend(visits.iter().map(seen_from).collect::<Option<Vec<_>>>()?);
        Some(Way { seconds, least_s: Bound::new(time, &places).raised(seconds) })
    }
}

/// A sweep is a place that is reached at one of its ends and left at either: whichever way it is flown,
/// nothing is quicker between two of them than between the nearest of their ends.
fn way_of_sweeps(rig: &Rig, sequence: &Sequence) -> Option<Way> {
    if rig.takes_sweeps_at_rest() {
        return None;
    }
    let is_first = |step: &&Step| {
        let is_visit = matches!(step.kind, ReadingKind::Target { repeat: 0, .. });
        is_visit && step.swept.is_some_and(|swept| swept.first == step.id)
    };
    let firsts: Vec<&Step> = sequence.steps.iter().filter(is_first).collect();
    if firsts.len() < 3 || firsts.len() >= PLACES_MAX {
        return None;
    }
    let start = sequence.reference.positions;
    let time = MoveTime::of(rig).without_settling();
    let (mut here, mut seconds) = (start, 0.0);
    let mut places = vec![vec![start]];
    for step in firsts {
        let windows = u16::try_from(step.swept?.count).ok()?;
        let flight = step.flight(windows)?;
        let ends = |flight| {
            let motion = rig.flight(flight).ok()?;
            Some([set_out(&motion), comes_to_rest(&motion)].map(|counts| rig.positions(counts)))
        };
        let [from, to] = ends(flight)?;
        seconds += time.directed(&here, &from);
        here = to;
        let mut place = vec![from, to];
        if rig.axes[0].approach == Approach::Either {
            place.extend(ends(flight.reversed()).into_iter().flatten());
        }
        places.push(place);
    }
    seconds += time.directed(&here, &start);
    Some(Way { seconds, least_s: Bound::new(time, &places).raised(seconds) })
}

/// The times between all places.
struct Bound {
    count: usize,
    times: Vec<f64>,
}

/// A tree over all places but the first, and the two shortest edges to that one.
struct OneTree {
    length: f64,
    degrees: Vec<i32>,
}

impl Bound {
    fn new(time: MoveTime, places: &[Vec<AxisPositions>]) -> Self {
        let count = places.len();
        let mut times = vec![0.0; count * count];
        for i in 0..count {
            for j in 0..i {
                let ways = places[i].iter().flat_map(|a| places[j].iter().map(move |b| (a, b)));
                let least = ways.map(|(a, b)| time.between(a, b)).fold(f64::INFINITY, f64::min);
                times[i * count + j] = least;
                times[j * count + i] = least;
            }
        }
        Self { count, times }
    }

    /// The bound after the ascent; `tour` is the length of a tour, which no bound exceeds.
    fn raised(&self, tour: f64) -> f64 {
        let rounds = (WORK_MAX / (self.count * self.count)).clamp(ROUNDS.0, ROUNDS.1);
        let mut weights = vec![0.0; self.count];
        let mut before: Vec<i32> = vec![0; self.count];
        let (mut best, mut part, mut idle) = (0.0_f64, 1.0, 0);
        for _ in 0..rounds {
            let tree = self.one_tree(&weights);
            let length = tree.length - 2.0 * weights.iter().sum::<f64>();
            idle = if length > best { 0 } else { idle + 1 };
            best = best.max(length);
            let excess: Vec<i32> = tree.degrees.iter().map(|degree| degree - 2).collect();
            let square: i32 = excess.iter().map(|e| e * e).sum();
            if square == 0 {
                // A tour: the shortest there is.
                break;
            }
            if idle == 5 {
                (part, idle) = (0.6 * part, 0);
            }
            let step = part * (tour - length).max(1e-3 * tour) / f64::from(square);
            for ((weight, now), was) in weights.iter_mut().zip(&excess).zip(&before) {
                *weight += step * (0.7 * f64::from(*now) + 0.3 * f64::from(*was));
            }
            before = excess;
        }
        best.min(tour)
    }

    /// The shortest, by Prim's algorithm, with a weight added to every edge at a place.
    fn one_tree(&self, weights: &[f64]) -> OneTree {
        let edge = |a: usize, b: usize| self.times[a * self.count + b] + weights[a] + weights[b];
        let mut degrees = vec![0; self.count];
        let mut length = 0.0;
        let mut near = vec![(f64::INFINITY, 1_usize); self.count];
        let mut left: Vec<usize> = (2..self.count).collect();
        let mut here = 1;
        while !left.is_empty() {
            let (mut soonest, mut least) = (0, f64::INFINITY);
            for (k, &place) in left.iter().enumerate() {
                let reach = edge(here, place);
                if reach < near[place].0 {
                    near[place] = (reach, here);
                }
                if near[place].0 < least {
                    (soonest, least) = (k, near[place].0);
                }
            }
            here = left.swap_remove(soonest);
            length += least;
            degrees[here] += 1;
            degrees[near[here].1] += 1;
        }
        let mut first: Vec<(f64, usize)> = (1..self.count).map(|b| (edge(0, b), b)).collect();
        first.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (reach, place) in first.iter().take(2) {
            length += reach;
            degrees[*place] += 1;
            degrees[0] += 1;
        }
        OneTree { length, degrees }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(xs: &[(f64, f64)]) -> Vec<Vec<AxisPositions>> {
        xs.iter().map(|(x, y)| vec![AxisPositions([0.0, 0.0, *x, *y])]).collect()
    }

    #[test]
    fn of_few_places_it_is_the_shortest_of_all_orders_or_less_and_near_it() {
        let time = MoveTime::of(&Rig::built_in().unwrap());
        let at = |k: u32| {
            let part = |step: f64| (f64::from(k) * step).fract() * 0.04 - 0.02;
            (part(0.618_034), part(0.414_214))
        };
        let places = places(&(0..8).map(at).collect::<Vec<_>>());
        let mut order: Vec<usize> = (1..8).collect();
        let mut shortest = f64::INFINITY;
        permute(&mut order, 0, &mut |order| {
            let mut here = 0;
            let mut length = 0.0;
            for &next in order.iter().chain([&0]) {
                length += time.between(&places[here][0], &places[next][0]);
                here = next;
            }
            shortest = shortest.min(length);
        });
        let bound = Bound::new(time, &places).raised(1.2 * shortest);
        assert!(bound <= shortest * (1.0 + 1e-12), "{bound} s, {shortest} s");
        assert!(bound > 0.97 * shortest, "{bound} s, {shortest} s");
    }

    fn permute(order: &mut Vec<usize>, from: usize, take: &mut impl FnMut(&[usize])) {
        if from == order.len() {
            return take(order);
        }
        for k in from..order.len() {
            order.swap(from, k);
            permute(order, from + 1, take);
            order.swap(from, k);
        }
    }
}
