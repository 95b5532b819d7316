//! Which readings belong together as one sweep, seen from their poses alone: what shares a sweep
//! shares its drift, and a basis is judged by sweeps that it was not fitted to. The order of the
//! readings plays no part.
//!
//! Readings at one place and one azimuth line are a sweep in θ; where a plan has none of these,
//! readings at one place and one θ (a ring), or of one direction (a scan over the sample). A plan
//! that has no such lines at all (low discrepancy, lists) is cut into blocks that hang together in
//! direction and place.
//!
//! Where a plan flies the same lines of directions at several places, a line is left out at all of
//! them together: a sweep left out alone would be given away by its twin at the next place, and
//! nothing would test what a basis does between the lines.

use crate::grid::Grid;
use crate::{Ray, Region, Sample};

/// How readings were found to belong together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SweepKind {
    /// One place, one azimuth line (φ and φ + 180°), θ running.
    Theta,
    /// One place, one θ, φ running.
    Phi,
    /// One direction, the place running.
    Place,
    /// Blocks of neighbouring directions and places.
    Block,
}

impl SweepKind {
    /// As files name it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Theta => "sweeps in theta",
            Self::Phi => "sweeps in phi",
            Self::Place => "scans over the sample",
            Self::Block => "blocks of neighbouring rays",
        }
    }
}

/// Readings by sweep.
#[derive(Debug, Clone)]
pub(crate) struct Sweeps {
    pub(crate) kind: SweepKind,
    /// Indices of the samples of each.
    pub(crate) members: Vec<Vec<usize>>,
    /// Which line of directions each runs along; those of one line stand together.
    lines: Vec<i64>,
}

impl Sweeps {
    pub(crate) fn of(samples: &[Sample], region: &Region) -> Self {
        let grid = Grid::of(samples, region);
        let rays: Vec<Ray> = samples.iter().map(|s| grid.snap(&s.ray)).collect();
        for (kind, key) in KINDS {
            let (members, mut lines) = by_key(&rays, key);
            if kind == SweepKind::Place {
                // One direction each.
                lines = numbered(members.len());
            }
            if are_sweeps(members.iter().map(Vec::len)) {
                return Self { kind, members, lines };
            }
        }
        let members = blocks(samples, region);
        let lines = numbered(members.len());
        Self { kind: SweepKind::Block, members, lines }
    }

    /// How many lines of directions there are, where they run at more than one place each.
    pub(crate) fn shared_lines(&self) -> Option<usize> {
        let distinct = self.lines.chunk_by(|a, b| a == b).count();
        (distinct >= LINES_MIN && distinct < self.members.len()).then_some(distinct)
    }

    /// At most `most` readings in whole sweeps, evenly out of all of them: of each line at other
    /// places than of the next one.
    pub(crate) fn thinned(mut self, most: usize) -> Self {
        let total: usize = self.members.iter().map(Vec::len).sum();
        if total > most {
            let every = total.div_ceil(most);
            let mut runs = Vec::new();
            for (number, run) in self.lines.chunk_by(|a, b| a == b).enumerate() {
                runs.extend((0..run.len()).map(|at| (number + at).is_multiple_of(every)));
            }
            let mut kept = runs.iter();
            self.members.retain(|_| kept.next() == Some(&true));
            let mut kept = runs.iter();
            self.lines.retain(|_| kept.next() == Some(&true));
        }
        // A single sweep may be longer than all that is asked for.
        let longest = (most / self.members.len().max(1)).max(1);
        for sweep in &mut self.members {
            let every = sweep.len().div_ceil(longest);
            *sweep = sweep.iter().copied().step_by(every).collect();
        }
        self
    }

    /// The samples of all sweeps, in their order.
    pub(crate) fn samples_of(&self, samples: &[Sample]) -> Vec<Sample> {
        self.members.iter().flatten().map(|i| samples[*i]).collect()
    }

    /// The sweeps dealt into `count` folds, neighbouring ones into different folds; where lines are
    /// shared, and unless sweeps are to be left out one by one, all of a line into one. Indices
    /// count the readings in the order of `members`.
    pub(crate) fn folds(&self, count: usize, one_by_one: bool) -> Vec<Vec<usize>> {
        let shared = self.shared_lines().filter(|_| !one_by_one);
        let dealt = count.min(shared.unwrap_or(self.members.len())).max(1);
        let mut folds = vec![Vec::new(); dealt];
        let (mut at, mut number) = (0, 0);
        for (i, sweep) in self.members.iter().enumerate() {
            if i > 0 && (shared.is_none() || self.lines[i] != self.lines[i - 1]) {
                number += 1;
            }
            folds[number % dealt].extend(at..at + sweep.len());
            at += sweep.len();
        }
        folds.retain(|fold| !fold.is_empty());
        folds
    }
}

/// Numbers of order 1 that differ by rounding alone are one.
#[allow(clippy::cast_possible_truncation)] // angles and metres
fn key(value: f64) -> i64 {
    libm::round(value * KEYS_PER_UNIT) as i64
}

/// What rays of one sweep share, once they lie on the grid.
pub(super) type Keys = fn(&Ray) -> [i64; 3];

/// Kinds of sweeps in the order in which they are looked for.
pub(super) const KINDS: [(SweepKind, Keys); 3] = [
    (SweepKind::Theta, |ray| {
        let line = key(ray.phi_rad.rem_euclid(core::f64::consts::PI));
        [line, key(ray.x_m * 1e2), key(ray.y_m * 1e2)]
    }),
    (SweepKind::Phi, |ray| [key(ray.theta_rad), key(ray.x_m * 1e2), key(ray.y_m * 1e2)]),
    (SweepKind::Place, |ray| {
        [key(ray.theta_rad), key(ray.phi_rad.rem_euclid(core::f64::consts::TAU)), 0]
    }),
];

/// Whether readings that share a key, this many each, are sweeps: enough long ones that hold nearly all.
pub(super) fn are_sweeps(lengths: impl Iterator<Item = usize>) -> bool {
    let (mut long, mut held, mut all) = (0, 0, 0);
    for length in lengths {
        all += length;
        if length >= LENGTH_MIN {
            long += 1;
            held += length;
        }
    }
    long >= SWEEPS_MIN && held as f64 >= HELD_MIN * all as f64
}

/// What shares a key, and which line of directions that is: the key's first number of sweeps, which
/// stand in its order.
fn by_key(rays: &[Ray], key: Keys) -> (Vec<Vec<usize>>, Vec<i64>) {
    let mut members = std::collections::BTreeMap::<[i64; 3], Vec<usize>>::new();
    for (i, ray) in rays.iter().enumerate() {
        members.entry(key(ray)).or_default().push(i);
    }
    // From one horizon through the normal to the other, so that every second one is of both halves.
    let along = |ray: &Ray| {
        let theta = self::key(ray.theta_rad);
        let is_far = ray.phi_rad.rem_euclid(core::f64::consts::TAU) >= core::f64::consts::PI;
        [if is_far { -theta } else { theta }, self::key(ray.phi_rad)]
    };
    let lines = members.keys().map(|key| key[0]).collect();
    let mut members: Vec<Vec<usize>> = members.into_values().collect();
    for sweep in &mut members {
        sweep.sort_by_key(|i| along(&rays[*i]));
    }
    (members, lines)
}

/// Each a line of its own.
fn numbered(count: usize) -> Vec<i64> {
    (0_i64..).take(count).collect()
}

/// Halves the readings across the coordinate that varies most, again and again.
fn blocks(samples: &[Sample], region: &Region) -> Vec<Vec<usize>> {
    let is_whole = region.chart.is_whole_sphere();
    let places: Vec<[f64; 5]> = samples
        .iter()
        .map(|sample| {
            let (sin, (s, c)) = (libm::sin(sample.ray.theta_rad), libm::sincos(sample.ray.phi_rad));
            let (x, y) = region.scaled(&sample.ray);
            let z = if is_whole { libm::cos(sample.ray.theta_rad) } else { 0.0 };
            [sin * c, sin * s, x, y, z]
        })
        .collect();
    let mut blocks = vec![(0..samples.len()).collect::<Vec<usize>>()];
    while blocks.len() < BLOCKS && blocks.iter().all(|block| block.len() >= 2 * LENGTH_MIN) {
        blocks = blocks.into_iter().flat_map(|block| halves(block, &places)).collect();
    }
    blocks
}

fn halves(mut block: Vec<usize>, places: &[[f64; 5]]) -> [Vec<usize>; 2] {
    let spread = |axis: usize| {
        let values = block.iter().map(|i| places[*i][axis]);
        let (low, high) = values
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        high - low
    };
    let axis = (0..5).fold(0, |best, axis| if spread(axis) > spread(best) { axis } else { best });
    let by_place = |a: &usize, b: &usize| {
        let order = places[*a][axis].total_cmp(&places[*b][axis]);
        order.then_with(|| {
            let rest = places[*a].iter().zip(&places[*b]).map(|(a, b)| a.total_cmp(b));
            rest.fold(core::cmp::Ordering::Equal, core::cmp::Ordering::then)
        })
    };
    block.sort_by(by_place);
    let upper = block.split_off(block.len() / 2);
    [block, upper]
}

/// Fewer readings in a row are no sweep.
const LENGTH_MIN: usize = 4;
/// Fewer sweeps than these can't be left out one by one.
const SWEEPS_MIN: usize = 4;
/// Of fewer lines none is left out: half of what was measured, or a third, says little of the rest,
/// and the smoothest field that guesses it wins. A bright line over the sample, read along two lines of
/// directions, was taken for an even one (error/u 32 instead of 5).
const LINES_MIN: usize = 4;
/// The share of the readings that has to lie in sweeps.
const HELD_MIN: f64 = 0.8;
/// Blocks of a plan without sweeps.
const BLOCKS: usize = 64;
/// Angles closer than 5 µrad and places closer than 50 nm are equal once they are snapped to a grid.
const KEYS_PER_UNIT: f64 = 2e5;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Noise;

    const REGION: Region = Region::surface((-0.01, 0.01), (-0.01, 0.01), 1.4);

    fn sample(x_m: f64, theta_deg: f64, phi_deg: f64) -> Sample {
        let (theta_rad, phi_rad) = (theta_deg.to_radians(), phi_deg.to_radians());
        let ray = Ray { x_m, y_m: 0.0, theta_rad, phi_rad };
        Sample { ray, value: 1.0, noise: Noise::Unknown }
    }

    #[test]
    fn meridians_of_a_raster_are_sweeps_whatever_their_order() {
        let mut samples = Vec::new();
        for x in [-0.005, 0.005] {
            for phi in [0.0, 45.0, 90.0, 135.0, 180.0, 225.0] {
                samples.extend((1..8).map(|i| sample(x, f64::from(i) * 10.0 + 0.004, phi + 0.003)));
            }
        }
        let sweeps = Sweeps::of(&samples, &REGION);
        assert_eq!(sweeps.kind, SweepKind::Theta);
        // 0 and 180, 45 and 225 are one line each.
        assert_eq!(sweeps.members.len(), 2 * 4);
        samples.reverse();
        let turned = Sweeps::of(&samples, &REGION);
        let n = samples.len();
        let back = |sweep: &Vec<usize>| sweep.iter().map(|i| n - 1 - i).collect::<Vec<usize>>();
        assert_eq!(sweeps.members, turned.members.iter().map(back).collect::<Vec<_>>());
        // Each line at both places together, or one by one.
        assert_eq!(sweeps.shared_lines(), Some(4));
        for (folds, lengths) in [
            (sweeps.folds(16, false), vec![28, 28, 14, 14]),
            (sweeps.folds(16, true), vec![14, 14, 14, 14, 7, 7, 7, 7]),
        ] {
            assert_eq!(folds.iter().map(Vec::len).collect::<Vec<_>>(), lengths);
            assert_eq!(lengths.iter().sum::<usize>(), n);
        }
    }

    #[test]
    fn of_many_sweeps_every_line_and_every_place_stays() {
        let mut samples = Vec::new();
        for x in [-0.009, -0.003, 0.003, 0.009] {
            for phi in 0..12 {
                let line = f64::from(phi) * 15.0;
                samples.extend((1..8).map(|i| sample(x, f64::from(i) * 10.0, line)));
            }
        }
        for part in [2, 3, 4] {
            let few = Sweeps::of(&samples, &REGION).thinned(samples.len() / part);
            let of: Vec<Ray> = few.members.iter().map(|sweep| samples[sweep[0]].ray).collect();
            assert!((48 / part - 2..=48 / part).contains(&of.len()), "{}", of.len());
            let distinct = |value: &dyn Fn(&Ray) -> f64| {
                of.iter()
                    .map(|ray| key(value(ray)))
                    .collect::<std::collections::BTreeSet<_>>()
                    .len()
            };
            assert_eq!((distinct(&|ray| ray.phi_rad), distinct(&|ray| 1e2 * ray.x_m)), (12, 4));
        }
    }

    #[test]
    fn a_thinned_sweep_has_readings_on_both_sides_of_the_normal() {
        let line = |phi: f64| {
            let of =
                move |side: f64| (1..66).map(move |i| sample(0.0, f64::from(i) * 1.2, phi + side));
            of(0.0).chain(of(180.0))
        };
        let samples: Vec<Sample> = (0..30).flat_map(|k| line(6.0 * f64::from(k))).collect();
        let few = Sweeps::of(&samples, &REGION).thinned(samples.len() / 8);
        for sweep in &few.members {
            let near = sweep.iter().filter(|i| samples[**i].ray.phi_rad < 3.1).count();
            assert!((near as f64 / sweep.len() as f64 - 0.5).abs() < 0.1, "{near}");
            assert!(sweep.len() < 130);
        }
    }

    #[test]
    fn scattered_readings_are_cut_into_blocks() {
        let samples: Vec<Sample> = (0..200)
            .map(|i| {
                let t = f64::from(i);
                sample(0.01 * libm::sin(t * 1.7), 40.0 + 35.0 * libm::sin(t * 0.77), t * 137.5)
            })
            .collect();
        let sweeps = Sweeps::of(&samples, &REGION);
        assert_eq!((sweeps.kind, sweeps.members.len()), (SweepKind::Block, 32));
        let mut all: Vec<usize> = sweeps.members.iter().flatten().copied().collect();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..200));
        let few = sweeps.thinned(50);
        assert!(few.members.iter().map(Vec::len).sum::<usize>() <= 50);
    }
}
