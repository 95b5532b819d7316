//! Random scenes and rigs with one effect each, the bound that the compiler states of it, and its true
//! influence: what forcing it in against leaving it out changes at most. The tests here look at some,
//! the command `influences` of the crate benches at as many as one likes.
//!
//! To add an effect: a function that draws a case, and its name in [`rigs::EFFECTS`] for what is
//! measured on the board, in [`scenes::EFFECTS`] for what the detector sees.

mod board;
mod dice;
mod rigs;
mod scenes;

use std::sync::atomic::{AtomicU64, Ordering};

use dice::Dice;

/// So many kinds of cases take turns.
pub(crate) const KINDS: u64 = (rigs::EFFECTS.len() + scenes::EFFECTS.len()) as u64;

/// What was stated and what was found.
pub(crate) struct Weighed {
    pub(crate) effect: String,
    pub(crate) bound: f64,
    /// The true influence: the largest found by search, or of something random its root mean square.
    pub(crate) found: f64,
    /// By what factor chance alone may put `found` above what it is found of.
    chance: f64,
    /// What is smaller can't be told from rounding.
    seen: f64,
}

/// What became of a bound.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// It lies between once and a hundred times the true influence.
    Holds,
    /// The true influence is too small to be seen, and the bound small too.
    Unseen,
    /// The effect exceeds it.
    Exceeded,
    /// It is more than a hundred times the true influence.
    TooWide,
}

impl Weighed {
    /// Whether the influence is large enough to be told from rounding.
    pub(crate) fn is_seen(&self) -> bool {
        self.found > self.seen
    }

    /// How much larger than the true influence the bound is.
    pub(crate) fn ratio(&self) -> f64 {
        self.bound / self.found
    }

    pub(crate) fn verdict(&self) -> Verdict {
        let Self { bound, found, chance, seen, .. } = *self;
        if found > bound * chance + seen * 1e-3 {
            Verdict::Exceeded
        } else if self.is_seen() {
            if self.ratio() > WIDEST { Verdict::TooWide } else { Verdict::Holds }
        } else if bound > WIDEST_UNSEEN {
            Verdict::TooWide
        } else {
            Verdict::Unseen
        }
    }
}

/// How much larger than the true influence a bound may be.
const WIDEST: f64 = 100.0;
/// How large it may be where no influence is seen.
const WIDEST_UNSEEN: f64 = 1e-3;

/// The first cases of a seed; the kinds take turns. On as many threads as there are cores.
pub(crate) fn weigh(cases: u64, seed: u64) -> Vec<Weighed> {
    let next = AtomicU64::new(0);
    let work = || -> Vec<(u64, Weighed)> {
        let mine = core::iter::from_fn(|| {
            let i = next.fetch_add(1, Ordering::Relaxed);
            (i < cases).then(|| (i, weigh_one(i, seed)))
        });
        mine.collect()
    };
    let cores = std::thread::available_parallelism().map_or(1, core::num::NonZero::get);
    let mut all: Vec<(u64, Weighed)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
        threads.into_iter().flat_map(|thread| thread.join().expect("no panic")).collect()
    });
    all.sort_by_key(|(i, _)| *i);
    all.into_iter().map(|(_, weighed)| weighed).collect()
}

fn weigh_one(i: u64, seed: u64) -> Weighed {
    // The states of neighbours are neighbours, what they draw is not.
    let of_seed = Dice::new(seed).next();
    let mut dice = Dice::new(Dice::new(of_seed.wrapping_add(i)).next());
    let kind = usize::try_from(i % KINDS).expect("some tens");
    match kind.checked_sub(rigs::EFFECTS.len()) {
        None => rigs::EFFECTS[kind](&mut dice).weighed(&mut dice),
        Some(kind) => scenes::EFFECTS[kind](&mut dice).weighed(&mut dice),
    }
}
