//! From scores to cells, from cells to pools, and what is demanded of both.

use std::ops::RangeInclusive;

use super::{Family, Kind, Run, Scale, Score, Target, binomial_band, rms_band};

/// From so many runs on an RMS tells 1.05 from 1 well enough to be held to it.
pub const SENSITIVE_RUNS: usize = 1000;

const INTERVAL: f64 = 0.95;
const RMS: RangeInclusive<f64> = 0.95..=1.05;
const COVERAGE: RangeInclusive<f64> = 0.93..=0.97;
/// Where the basis limits, an interval may be too wide, though not by more than this.
const U_OVER_RMS_MAX: f64 = 2.0;

/// Scores of many runs together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tally {
    /// How many.
    pub scores: usize,
    /// Root mean square of (value - truth)/u.
    pub rms: f64,
    /// Mean of (value - truth)/u.
    pub mean: f64,
    /// How many 95 % intervals hold the truth.
    pub covered: usize,
    /// The median of u, relative as in [`Score`].
    pub median_u: f64,
    /// Root mean square of the error, relative as in [`Score`].
    pub rms_error: f64,
}

impl Tally {
    /// Which part of the 95 % intervals holds the truth.
    pub fn coverage(&self) -> f64 {
        self.covered as f64 / self.scores as f64
    }

    /// How much wider than the errors the stated u is.
    pub fn u_over_rms_error(&self) -> f64 {
        self.median_u / self.rms_error
    }
}

/// Of scores, at least one.
pub fn tally<'a>(scores: impl IntoIterator<Item = &'a Score>) -> Tally {
    let (mut n, mut squares, mut sum, mut covered, mut errors) = (0, 0.0, 0.0, 0, 0.0);
    let mut u: Vec<f64> = Vec::new();
    for score in scores {
        n += 1;
        squares += score.z() * score.z();
        sum += score.z();
        covered += usize::from(score.is_covered());
        errors += score.error * score.error;
        u.push(score.u);
    }
    u.sort_by(f64::total_cmp);
    let count = n as f64;
    Tally {
        scores: n,
        rms: libm::sqrt(squares / count),
        mean: sum / count,
        covered,
        median_u: u.get(n / 2).copied().unwrap_or(f64::NAN),
        rms_error: libm::sqrt(errors / count),
    }
}

/// One target over the runs of one family on rigs of one kind.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// What was looked at.
    pub family: Family,
    /// How well the rigs knew their scale.
    pub scale: Scale,
    /// What was asked.
    pub target: Target,
    /// What came out.
    pub tally: Tally,
    /// The least and the most of its 95 % intervals that hold the truth in 99.9 % of experiments.
    pub band: (usize, usize),
}

impl Cell {
    /// All cells of the runs of one family on rigs of one kind, at least one run.
    pub fn of(family: Family, scale: Scale, targets: &[Target], runs: &[Run]) -> Vec<Self> {
        let cell = |(i, target): (usize, &Target)| {
            let tally = tally(runs.iter().filter_map(|run| run.scores.get(i)));
            let band = binomial_band(tally.scores, INTERVAL);
            Self { family, scale, target: *target, tally, band }
        };
        targets.iter().enumerate().map(cell).collect()
    }

    /// Whether as many intervals hold the truth as honest ones do.
    pub fn is_in_band(&self) -> bool {
        (self.band.0..=self.band.1).contains(&self.tally.covered)
    }
}

/// All scores of one kind of quantity: of one family, or of all that the basis follows.
#[derive(Debug, Clone, PartialEq)]
pub struct Pool {
    /// `None`: all families that the basis follows.
    pub family: Option<Family>,
    /// How well the rigs knew their scale.
    pub scale: Scale,
    /// What was asked.
    pub kind: Kind,
    /// Independent runs behind it: several rays of one run share their errors.
    pub runs: usize,
    /// What came out.
    pub tally: Tally,
}

/// A demand, and whether it was met.
#[derive(Debug, Clone, PartialEq)]
pub struct Demand {
    /// In words, with what was found.
    pub text: String,
    /// Whether it was met.
    pub is_met: bool,
}

/// What is demanded. Pools of all families that the basis follows: an RMS of 0.95 to 1.05, and 93 to
/// 97 % of the intervals holding the truth; of so few runs that honest answers scatter more, within
/// the range of 99.9 % of honest experiments. Their cells: each within its band. Pools of families
/// that the basis does not follow: 93 % at least, with a median u at most twice the errors' RMS.
pub fn demands(cells: &[Cell], pools: &[Pool]) -> Vec<Demand> {
    let mut all: Vec<Demand> = Vec::new();
    for pool in pools {
        match pool.family {
            None => all.extend(of_followed(pool)),
            Some(family) if family.is_limited_by_basis() => all.extend(of_limited(pool, family)),
            Some(_) => {}
        }
    }
    let followed = || cells.iter().filter(|cell| !cell.family.is_limited_by_basis());
    let outside = followed().filter(|cell| !cell.is_in_band()).count();
    let count = followed().count();
    all.push(Demand {
        text: format!(
            "each of {count} cells that the basis follows within its 99.9 % band: {outside} outside"
        ),
        is_met: outside == 0,
    });
    all
}

fn of_followed(pool: &Pool) -> [Demand; 2] {
    let (scale, kind) = (pool.scale.name(), pool.kind.name());
    let honest = rms_band(pool.runs);
    let (low, high) = (RMS.start().min(honest.0), RMS.end().max(honest.1));
    let (low, high) =
        if pool.runs < SENSITIVE_RUNS { (low, high) } else { (*RMS.start(), *RMS.end()) };
    let rms = pool.tally.rms;
    let (from, to) = coverage_range(pool.runs);
    let coverage = pool.tally.coverage();
    [
        Demand {
            text: format!("scale {scale}, {kind}: RMS of error/u {low:.2} to {high:.2}: {rms:.3}"),
            is_met: (low..=high).contains(&rms),
        },
        Demand {
            text: format!(
                "scale {scale}, {kind}: {:.1} to {:.1} % of intervals hold the truth: {:.1} %",
                100.0 * from,
                100.0 * to,
                100.0 * coverage
            ),
            is_met: (from..=to).contains(&coverage),
        },
    ]
}

fn of_limited(pool: &Pool, family: Family) -> [Demand; 2] {
    let (scale, kind, family) = (pool.scale.name(), pool.kind.name(), family.name());
    let (from, _) = coverage_range(pool.runs);
    let coverage = pool.tally.coverage();
    let ratio = pool.tally.u_over_rms_error();
    [
        Demand {
            text: format!(
                "{family}, scale {scale}, {kind}: at least {:.1} % of intervals hold the truth: \
                 {:.1} %",
                100.0 * from,
                100.0 * coverage
            ),
            is_met: coverage >= from,
        },
        Demand {
            text: format!(
                "{family}, scale {scale}, {kind}: median u at most {U_OVER_RMS_MAX} times the RMS \
                 error: {ratio:.2}"
            ),
            is_met: ratio <= U_OVER_RMS_MAX,
        },
    ]
}

fn coverage_range(runs: usize) -> (f64, f64) {
    let (low, high) = (*COVERAGE.start(), *COVERAGE.end());
    if runs >= SENSITIVE_RUNS {
        return (low, high);
    }
    let (least, most) = binomial_band(runs, INTERVAL);
    (low.min(least as f64 / runs as f64), high.max(most as f64 / runs as f64))
}

#[cfg(test)]
mod tests {
    use super::super::Draws;
    use super::*;

    /// Normal numbers by the sum of twelve uniform ones: near enough to ±3.
    fn runs(count: usize, understated: f64) -> Vec<Run> {
        let mut draws = Draws::new(3);
        let mut normal = || (0..12).map(|_| draws.uniform()).sum::<f64>() - 6.0;
        let score = |z: f64| Score { error: 1e-3 * z, u: 1e-3 / understated };
        (0..count).map(|_| Run { scores: vec![score(normal())] }).collect()
    }

    fn judged(count: usize, understated: f64, family: Family) -> Vec<Demand> {
        let runs = runs(count, understated);
        let target = Target { kind: Kind::Exitance, ray: None };
        let cells = Cell::of(family, Scale::Known, &[target], &runs);
        let tally = tally(runs.iter().flat_map(|run| &run.scores));
        let family = family.is_limited_by_basis().then_some(family);
        let pool = Pool { family, scale: Scale::Known, kind: target.kind, runs: count, tally };
        demands(&cells, &[pool])
    }

    #[test]
    fn honest_answers_pass_and_others_do_not() {
        let all_met = |demands: &[Demand]| demands.iter().all(|demand| demand.is_met);
        assert!(all_met(&judged(4000, 1.0, Family::Lobe)));
        assert!(all_met(&judged(60, 1.0, Family::Lobe)));
        for understated in [1.2, 0.8] {
            let judged = judged(4000, understated, Family::Lobe);
            assert!(judged.iter().all(|demand| !demand.is_met), "{judged:?}");
        }
    }

    #[test]
    fn where_the_basis_limits_a_wide_interval_passes_and_a_huge_one_does_not() {
        let met = |understated| -> Vec<bool> {
            let judged = judged(2000, understated, Family::Batwing);
            judged.iter().take(2).map(|demand| demand.is_met).collect()
        };
        assert_eq!(met(0.7), [true, true]);
        assert_eq!(met(0.3), [true, false]);
        assert_eq!(met(1.5), [false, true]);
    }

    #[test]
    fn a_tally_is_what_its_scores_say() {
        let scores = [(2.0, 1.0), (-1.0, 1.0), (0.0, 4.0)].map(|(error, u)| Score { error, u });
        let tally = tally(&scores);
        assert!((tally.rms - libm::sqrt(5.0 / 3.0)).abs() < 1e-15);
        assert!((tally.mean - 1.0 / 3.0).abs() < 1e-15);
        assert_eq!((tally.scores, tally.covered), (3, 2));
        assert!((tally.median_u - 1.0).abs() < 1e-15);
        assert!((tally.rms_error - libm::sqrt(5.0 / 3.0)).abs() < 1e-15);
    }
}
