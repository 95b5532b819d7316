//! Which kind of sweeps readings come in, told block by block: how many share a key, and not which. What
//! [`Sweeps`](super::Sweeps) says of readings that are all there.
//!
//! Where there are too many keys to count, those of every second hash are forgotten, again and again: of
//! the others all readings are counted still.

use std::collections::BTreeMap;

use super::gleaning::hash;
use super::sweeps::{KINDS, SweepKind, are_sweeps};
use crate::Sample;
use crate::grid::Grid;
use crate::stored::{Numbers, put_all, whole};

/// Counts of readings by what those of a sweep share.
#[derive(Debug)]
pub(crate) struct Tally {
    grid: Grid,
    /// One for each of the kinds that are looked for.
    kinds: [Counts; KINDS.len()],
}

/// How many readings share a key.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Counts {
    /// Of 2^this keys one is counted.
    halvings: u32,
    counts: BTreeMap<[i64; 3], usize>,
}

impl Tally {
    /// Of readings whose poses lie about a grid.
    pub(crate) fn new(grid: Grid) -> Self {
        Self { grid, kinds: Default::default() }
    }

    pub(crate) fn take(&mut self, samples: &[Sample]) {
        for sample in samples {
            let ray = self.grid.snap(&sample.ray);
            for ((_, key), counts) in KINDS.iter().zip(&mut self.kinds) {
                counts.take(key(&ray), 1);
            }
        }
    }

    pub(crate) fn kind(&self) -> SweepKind {
        let mut found = KINDS.iter().zip(&self.kinds);
        let kind = found.find(|(_, counts)| are_sweeps(counts.counts.values().copied()));
        kind.map_or(SweepKind::Block, |((kind, _), _)| *kind)
    }
}

impl Counts {
    /// Counts so many readings of a key.
    pub(super) fn take(&mut self, key: [i64; 3], readings: usize) {
        if hash(&key).trailing_zeros() < self.halvings {
            return;
        }
        *self.counts.entry(key).or_default() += readings;
        while self.counts.len() > KEYS_MAX {
            self.halve(self.halvings + 1);
        }
    }

    /// Takes in what another one counted.
    pub(super) fn merge(&mut self, other: &Self) {
        self.halve(self.halvings.max(other.halvings));
        other.counts.iter().for_each(|(key, readings)| self.take(*key, *readings));
    }

    /// By other keys, which several of these may share.
    pub(super) fn renamed(
        &self,
        name: impl Fn(&[i64; 3]) -> [i64; 3],
    ) -> BTreeMap<[i64; 3], usize> {
        let mut renamed = BTreeMap::new();
        for (key, readings) in &self.counts {
            *renamed.entry(name(key)).or_default() += readings;
        }
        renamed
    }

    fn halve(&mut self, halvings: u32) {
        self.halvings = halvings;
        self.counts.retain(|key, _| hash(key).trailing_zeros() >= halvings);
    }

    /// Adds the numbers that it consists of.
    pub(super) fn put(&self, out: &mut Vec<f64>) {
        out.push(f64::from(self.halvings));
        let entry = |(key, readings): (&[i64; 3], &usize)| {
            let [a, b, c] = key.map(|part| part as f64);
            [a, b, c, *readings as f64]
        };
        put_all(out, self.counts.iter().map(entry));
    }

    /// Takes them up again.
    pub(super) fn stored(numbers: &mut Numbers<'_>) -> Option<Self> {
        let halvings = u32::try_from(numbers.count(64)?).ok()?;
        let counts = numbers.all(KEYS_MAX, |[a, b, c, readings]| {
            let readings = usize::try_from(whole(readings)?).ok()?;
            Some(([whole(a)?, whole(b)?, whole(c)?], readings))
        });
        Some(Self { halvings, counts: counts? })
    }
}

/// Keys that are counted at most: about a megabyte of each kind.
const KEYS_MAX: usize = 1 << 14;

#[cfg(test)]
mod tests {
    use super::super::Sweeps;
    use super::*;
    use crate::scattered::{REGION, reading};
    use crate::{Noise, Ray};

    fn tallied(samples: &[Sample]) -> Tally {
        let mut tally = Tally::new(Grid::of(samples, &REGION));
        samples.chunks(61).for_each(|block| tally.take(block));
        assert!(tally.kinds.iter().all(|counts| counts.counts.len() <= KEYS_MAX));
        tally
    }

    #[test]
    fn blocks_come_in_the_kind_of_sweeps_that_all_readings_together_do() {
        let noise = Noise::Unknown;
        let scattered: Vec<Sample> =
            (0..900).map(|i| Sample { ray: reading(i).0, value: 1.0, noise }).collect();
        // Of i one coordinate runs, and the others step.
        let of = |i: usize, run: f64, place: f64| [run * (i % 10) as f64, place * (i / 10) as f64];
        let meridian = |i: usize| {
            let [theta_rad, phi_rad] = of(i, 0.12, 0.4);
            Ray { x_m: 0.0, y_m: 0.0, theta_rad: theta_rad + 0.1, phi_rad }
        };
        let ring = |i: usize| {
            let [phi_rad, theta_rad] = of(i, 0.63, 0.04);
            Ray { x_m: 0.0, y_m: 0.0, theta_rad: theta_rad + 0.2, phi_rad: phi_rad * theta_rad }
        };
        let scan = |i: usize| {
            let [x_m, turn] = of(i, 1e-3, 0.613);
            let theta_rad = 0.2 + (turn * 1.3).fract();
            Ray { x_m, y_m: 0.0, theta_rad, phi_rad: turn }
        };
        let swept = |ray: &dyn Fn(usize) -> Ray| {
            (0..200).map(|i| Sample { ray: ray(i), value: 1.0, noise }).collect::<Vec<_>>()
        };
        let mut kinds = Vec::new();
        for samples in [scattered, swept(&meridian), swept(&ring), swept(&scan)] {
            let expected = Sweeps::of(&samples, &REGION).kind;
            assert_eq!(tallied(&samples).kind(), expected);
            kinds.push(expected);
        }
        let [block, theta, phi, place] =
            [SweepKind::Block, SweepKind::Theta, SweepKind::Phi, SweepKind::Place];
        assert_eq!(kinds, [block, theta, phi, place]);
    }

    #[test]
    fn too_many_keys_are_told_by_some_of_them() {
        let noise = Noise::Unknown;
        // Ten readings each of 20,000 places on one line.
        let sample = |i: usize| {
            let ray = Ray {
                x_m: 1e-7 * (i / 10 % 200) as f64,
                y_m: 1e-7 * (i / 2000) as f64,
                theta_rad: 0.1 * (i % 10) as f64 + 0.2,
                phi_rad: 0.3,
            };
            Sample { ray, value: 1.0, noise }
        };
        let samples: Vec<Sample> = (0..200_000).map(sample).collect();
        let small = crate::Region::surface((0.0, 2e-5), (0.0, 1e-5), 1.4);
        let mut tally = Tally::new(Grid::of(&samples, &small));
        samples.chunks(4096).for_each(|block| tally.take(block));
        assert!(tally.kinds[0].halvings > 0 && tally.kinds[0].counts.len() <= KEYS_MAX);
        assert!(tally.kinds[0].counts.values().all(|count| *count == 10));
        assert_eq!(tally.kind(), SweepKind::Theta);
    }
}
