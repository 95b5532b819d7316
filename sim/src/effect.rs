//! The physical effects as the compiler weighs them and as a person sees them: what calls for
//! each, how large its influence is at most, whether it is in, and how it is computed.
//!
//! It does not know any effect: each module brings its own candidates.

use core::fmt;
use std::collections::BTreeSet;

use crate::{CompileError, Terms};

/// One effect, in or out.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectRow {
    /// What it is called, also on the command line.
    pub name: String,
    /// Whether it is a stage of the compiled rig. What is not has no code that runs.
    pub included: bool,
    /// Whether it can be left out: it is not part of what a reading is.
    pub can_be_left_out: bool,
    /// The key of scene, rig or `[simulated]` table that calls for it, or a fact found while
    /// compiling. `None`: nothing does.
    pub cause: Option<String>,
    /// How large its influence is at most; for something random or drawn, its standard
    /// deviation.
    pub bound: Option<Bound>,
    /// How far, relative to a reading, the way in which it is computed may be off; `None` where it
    /// is exact to rounding.
    pub error: Option<f64>,
    /// What it costs a reading, nanoseconds, once somebody has measured it.
    pub cost_ns: Option<f64>,
    /// How it is computed, or why it is left out.
    pub how: String,
}

/// The size of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// At least zero.
    pub value: f64,
    /// What the value is.
    pub unit: BoundUnit,
}

/// What a bound is stated in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BoundUnit {
    /// Current at the detector's input, A.
    Ampere,
    /// Length, m.
    Metre,
    /// Angle, rad.
    Radian,
    /// A part of the signal, 1.
    Relative,
}

impl BoundUnit {
    /// As it is printed after the number.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Ampere => "A",
            Self::Metre => "m",
            Self::Radian => "rad",
            Self::Relative => "of the signal",
        }
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3e} {}", self.value, self.unit.symbol())
    }
}

/// An effect before it is decided whether it is in.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    /// Stable, in lower case with hyphens; with its place in the file where there are several.
    pub(crate) name: String,
    /// What calls for it. `None`: nothing.
    pub(crate) cause: Option<String>,
    pub(crate) influence: Influence,
    /// Of the way in which it is computed: see [`EffectRow::error`].
    pub(crate) error: Option<f64>,
    /// How it is computed where it is in.
    pub(crate) how_in: String,
    /// What a reading is taken for where it is out; why nothing calls for it.
    pub(crate) how_out: String,
}

/// How much an effect matters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Influence {
    /// It is part of what a reading is (the signal itself, the converter's counts): it can't be
    /// left out, by nobody. With what there is to say of its size.
    Mandatory(Option<Bound>),
    /// At most |with - without| / max(|reading|, noise floor) over the region, the larger of the
    /// two readings. Of something random, the standard deviation of a dwell's mean.
    Relative(f64),
}

impl Candidate {
    /// Called for, or not, by a number of a file: `key` says which, with its value.
    pub(crate) fn of_key(
        name: impl Into<String>,
        key: &str,
        calls: bool,
        influence: Influence,
        how_in: &str,
    ) -> Self {
        Self {
            name: name.into(),
            cause: calls.then(|| key.to_owned()),
            influence,
            error: None,
            how_in: how_in.to_owned(),
            how_out: if calls { String::new() } else { format!("not called for: {key}") },
        }
    }

    /// Whether a person who says this means it: its whole name, or the end of that after a
    /// hyphen, which stands for all that end so ("backlash" for every axis's).
    fn answers_to(&self, wish: &str) -> bool {
        let ends = self.name.strip_suffix(wish);
        ends.is_some_and(|rest| rest.is_empty() || (!wish.is_empty() && rest.ends_with('-')))
    }

    const fn is_mandatory(&self) -> bool {
        matches!(self.influence, Influence::Mandatory(_))
    }

    fn bound(&self) -> Option<Bound> {
        match self.influence {
            Influence::Mandatory(bound) => bound,
            Influence::Relative(value) => Some(Bound { value, unit: BoundUnit::Relative }),
        }
    }
}

/// What was decided: which effects are in, and the row of each.
#[derive(Debug, Clone, Default)]
pub(crate) struct Chosen {
    included: BTreeSet<String>,
    pub(crate) rows: Vec<EffectRow>,
}

impl Chosen {
    /// Whether an effect is in.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.included.contains(name)
    }

    /// The same without one that is in and need not be.
    pub(crate) fn less(&self, name: &str) -> Option<Self> {
        let mut less = self.clone();
        let row = less.rows.iter_mut().find(|row| row.name == name)?;
        if !row.included || !row.can_be_left_out {
            return None;
        }
        row.included = false;
        row.error = None;
        "left out by request".clone_into(&mut row.how);
        less.included.remove(name);
        Some(less)
    }
}

/// Why an effect is in or out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Why {
    CalledFor,
    Forced,
    NotCalledFor,
    BelowTolerance,
    Without,
}

/// Decides: out is what nothing calls for, what a person wants out, and of what can be weighed
/// the smallest, as long as the sum of what is left out stays within the tolerance.
pub(crate) fn decide(
    candidates: Vec<Candidate>,
    tolerance: f64,
    terms: &Terms,
) -> Result<Chosen, CompileError> {
    check(&candidates, terms)?;
    let mut why: Vec<Why> = candidates
        .iter()
        .map(|candidate| {
            let is_meant = |wishes: &[String]| wishes.iter().any(|wish| candidate.answers_to(wish));
            if is_meant(&terms.without) && !candidate.is_mandatory() {
                Why::Without
            } else if candidate.cause.is_none() {
                Why::NotCalledFor
            } else if is_meant(&terms.force) {
                Why::Forced
            } else {
                Why::CalledFor
            }
        })
        .collect();
    let mut weighed: Vec<(f64, usize)> = candidates
        .iter()
        .enumerate()
        .filter(|(i, _)| why[*i] == Why::CalledFor)
        .filter_map(|(i, candidate)| match candidate.influence {
            Influence::Relative(bound) => Some((bound, i)),
            Influence::Mandatory(_) => None,
        })
        .collect();
    weighed.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut left_out = 0.0;
    for (bound, i) in weighed {
        left_out += bound;
        if left_out > tolerance {
            break;
        }
        why[i] = Why::BelowTolerance;
    }
    let mut chosen = Chosen::default();
    for (candidate, why) in candidates.into_iter().zip(why) {
        if matches!(why, Why::CalledFor | Why::Forced) {
            chosen.included.insert(candidate.name.clone());
        }
        chosen.rows.push(row(candidate, why, tolerance));
    }
    Ok(chosen)
}

fn row(candidate: Candidate, why: Why, tolerance: f64) -> EffectRow {
    let bound = candidate.bound();
    let can_be_left_out = !matches!(candidate.influence, Influence::Mandatory(_));
    let changes_nothing = bound.is_some_and(|bound| bound.value <= 0.0);
    let Candidate { name, cause, error, how_in, how_out, .. } = candidate;
    let how = match why {
        Why::CalledFor => how_in,
        Why::Forced => format!("{how_in} (forced)"),
        Why::NotCalledFor => how_out,
        // No tolerance is used up, and what a reading is taken for is what it is.
        Why::BelowTolerance if changes_nothing => "left out: it changes nothing here".to_owned(),
        Why::BelowTolerance => {
            let why =
                format!("left out: what is left out stays within the tolerance of {tolerance:.1e}");
            followed_by(why, &how_out)
        }
        Why::Without => followed_by("left out by request".to_owned(), &how_out),
    };
    let included = matches!(why, Why::CalledFor | Why::Forced);
    let error = error.filter(|_| included);
    EffectRow { name, included, can_be_left_out, cause, bound, error, cost_ns: None, how }
}

/// What a reading is taken for stands behind why, where there is something to say of it.
fn followed_by(why: String, how_out: &str) -> String {
    if how_out.is_empty() { why } else { format!("{why}; {how_out}") }
}

/// Names that are none, and wishes that can't be granted.
fn check(candidates: &[Candidate], terms: &Terms) -> Result<(), CompileError> {
    for (name, is_forced) in
        terms.force.iter().map(|name| (name, true)).chain(terms.without.iter().map(|n| (n, false)))
    {
        let meant: Vec<&Candidate> = candidates.iter().filter(|c| c.answers_to(name)).collect();
        let Some(first) = meant.first() else {
            let known: Vec<String> = candidates.iter().map(|c| c.name.clone()).collect();
            let nearest = spanned_toml::nearest(name, &known).cloned();
            return Err(CompileError::UnknownEffect { name: name.clone(), nearest, known });
        };
        let refused = if is_forced {
            meant.iter().all(|c| c.cause.is_none()).then(|| first.how_out.clone())
        } else if meant.iter().all(|c| c.is_mandatory()) {
            Some("it is part of what a reading is".to_owned())
        } else {
            terms.force.contains(name).then(|| "it is forced as well".to_owned())
        };
        if let Some(why) = refused {
            return Err(CompileError::Effect { name: name.clone(), is_forced, why });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(name: &str, is_called: bool, influence: Influence) -> Candidate {
        Candidate::of_key(name, "some.key = 1", is_called, influence, "in some way")
    }

    fn candidates() -> Vec<Candidate> {
        vec![
            candidate("signal", true, Influence::Mandatory(None)),
            candidate("large", true, Influence::Relative(0.5)),
            candidate("small", true, Influence::Relative(4e-4)),
            candidate("smaller", true, Influence::Relative(3e-4)),
            candidate("absent", false, Influence::Relative(0.0)),
        ]
    }

    fn included(
        tolerance: f64,
        force: &[&str],
        without: &[&str],
    ) -> Result<Vec<String>, CompileError> {
        let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        let terms = Terms { force: owned(force), without: owned(without), ..Terms::default() };
        let chosen = decide(candidates(), tolerance, &terms)?;
        let rows = chosen.rows.iter().filter(|row| row.included).map(|row| row.name.clone());
        let rows: Vec<String> = rows.collect();
        assert!(rows.iter().all(|name| chosen.has(name)));
        assert_eq!(chosen.rows.len(), 5, "a row for each, in or out");
        Ok(rows)
    }

    #[test]
    fn the_smallest_are_left_out_as_long_as_their_sum_is_tolerable() {
        assert_eq!(included(0.0, &[], &[]).unwrap(), ["signal", "large", "small", "smaller"]);
        assert_eq!(included(5e-4, &[], &[]).unwrap(), ["signal", "large", "small"]);
        // Either alone would do, but not both.
        assert_eq!(included(6.9e-4, &[], &[]).unwrap(), ["signal", "large", "small"]);
        assert_eq!(included(7.1e-4, &[], &[]).unwrap(), ["signal", "large"]);
        assert_eq!(included(1.0, &[], &[]).unwrap(), ["signal"]);
    }

    #[test]
    fn what_changes_nothing_says_so_and_what_changes_little_names_the_tolerance() {
        let of = |bound: f64| candidate("own", true, Influence::Relative(bound));
        let how = |bound: f64, tolerance: f64| {
            decide(vec![of(bound)], tolerance, &Terms::default()).unwrap().rows[0].how.clone()
        };
        assert_eq!(how(0.0, 1e-3), "left out: it changes nothing here");
        assert_eq!(how(0.0, 0.0), "left out: it changes nothing here");
        assert!(how(1e-300, 1e-3).contains("tolerance of 1.0e-3"), "{}", how(1e-300, 1e-3));
        assert_eq!(how(1e-2, 1e-3), "in some way");
    }

    #[test]
    fn a_person_has_the_last_word_on_what_is_not_the_signal() {
        assert_eq!(included(1.0, &["small"], &[]).unwrap(), ["signal", "small"]);
        assert_eq!(included(0.0, &[], &["large"]).unwrap(), ["signal", "small", "smaller"]);
        // What is out by request is no part of what the tolerance allows.
        assert_eq!(included(5e-4, &[], &["smaller"]).unwrap(), ["signal", "large"]);
        let refused = |force: &[&str], without: &[&str]| {
            included(0.0, force, without).unwrap_err().to_string()
        };
        assert!(refused(&["smal"], &[]).contains("did you mean small?"));
        assert!(refused(&[], &["nonsense"]).contains("signal, large, small, smaller, absent"));
        assert!(refused(&["absent"], &[]).contains("not called for: some.key = 1"));
        assert!(refused(&[], &["signal"]).contains("part of what a reading is"));
        assert!(refused(&["large"], &["large"]).contains("forced as well"));
    }

    #[test]
    fn the_end_of_a_name_stands_for_all_that_end_so() {
        let names = ["theta-play", "phi-play", "x-play", "horseplay"];
        let candidates =
            names.map(|name| candidate(name, name != "phi-play", Influence::Relative(0.1)));
        let decided = |force: &[&str], without: &[&str]| {
            let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
            let terms = Terms { force: owned(force), without: owned(without), ..Terms::default() };
            let rows = decide(candidates.to_vec(), 1.0, &terms).unwrap().rows;
            rows.into_iter().filter(|row| row.included).map(|row| row.name).collect::<Vec<_>>()
        };
        assert_eq!(decided(&["play"], &[]), ["theta-play", "x-play"]);
        assert_eq!(decided(&["play", "horseplay"], &["x-play"]), ["theta-play", "horseplay"]);
    }
}
